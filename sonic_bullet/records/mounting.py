"""Mounting of a body, as it affects its modes; clamped points are `fixed=` of its modes.

    "free"      not held: its material and the air take its energy. The default of moving bodies
    "placed"    set down in a building: its own modes, η = 0.03 more, both sides radiate. The default of mass 0
    "on floor"  the same, with one side against a body that neither moves nor radiates: half the power
    a number    a loss factor η in place of 0.03, both sides radiate

    d += η ω/2    [Cremer, Heckl, Petersson 2005, eq. 3.6: decay of a mode by a loss factor]

The loss of built-up structures is the weakest source of this project: 0.01 to 0.05 after Cremer and Heckl, the middle
of it here. The edge term of EN 12354-1 gives a light board 1e-3, so it does not say more. Measure yours, and give it.
"""

from __future__ import annotations

from sonic_bullet.records.coerce import as_number, quote
from sonic_bullet.records.errors import RecordError, SonicBulletError

Mounting = str | float


def as_mounting(value: object, name: str = "mounting", error: type[SonicBulletError] = RecordError) -> Mounting:
    """Return one of mountings, or a loss factor, or raise ``error``."""
    most_loss = 1.0  # largest loss factor of a mode
    mounting_remedy = f"give 'free', 'placed', 'on floor' or a loss factor, 0 … {most_loss:g}"
    mountings = ("free", "placed", "on floor")
    if isinstance(value, str):
        if value not in mountings:
            raise error(f"{name} is {quote(value)}", mounting_remedy)
        return value
    return as_number(value, name, mounting_remedy, least=0, most=most_loss, error=error)


def usual_mounting(mass_kg: float) -> Mounting:
    """Return the default mounting: "placed" of mass 0, which never moves, else "free"."""
    return "placed" if mass_kg == 0 else "free"


def loss_factor(mounting: Mounting) -> float:
    """Return η that the mounting adds to a body's own losses."""
    in_place = 0.03  # loss factor of a placed body, in addition to its material's own
    if isinstance(mounting, str):
        return 0.0 if mounting == "free" else in_place
    return mounting


def radiating_share(mounting: Mounting) -> float:
    """Return the fraction of its power that a body radiates in this mounting."""
    return 0.5 if mounting == "on floor" else 1.0
