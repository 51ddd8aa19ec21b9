"""Damping as a preset file states it: Rayleigh's pair, a handbook's loss factor, or a law of frequency.

Damping is Rayleigh's, d = ½(α + βλ) [Ren, Yeh, Lin 2013, eq. 6]: alpha_per_s and beta_s, or a loss factor η of the
handbooks. η = 2d/ω independent of frequency is no Rayleigh damping; α and β are the pair that meets it at the two
frequencies of `equal_at_hz` [Chopra, Dynamics of Structures, 4th ed. 2012, eq. 11.4.9 and 11.4.10 with ζ = η/2]:

    α = η ω₁ω₂/(ω₁+ω₂),  β = η/(ω₁+ω₂)

Between them the loss is smaller (at √(ω₁ω₂) by 2√(ω₁ω₂)/(ω₁+ω₂)), outside larger. Without `equal_at_hz` a loss factor
is met at every frequency: the law that recordings support, with an `exponent` of frequency and a `floor_s` of T60 where
they show them (`DampingLaw`). Who knows Rayleigh alone gets the pair that meets the law at 500 Hz and 8 kHz.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
import numpy as np

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.damping_law.thermoelastic import ThermoelasticLoss
from sonic_bullet.effects.protocol import Effect
from sonic_bullet.records.errors import MaterialError, RecordError

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]


class PresetPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """A group of a preset's numbers.

    range: by field, the values that materials of that name have; spread: standard deviation of their logarithm. Neither
    changes a sound.
    """

    source: Annotated[str, msgspec.Meta(min_length=1)]
    note: str = ""
    range: dict[str, tuple[float, float]] = {}
    range_source: str = ""
    spread: dict[str, NotNegative] = {}


class Damping(PresetPart, frozen=True):
    """Rayleigh's alpha_per_s and beta_s, or a loss_factor and the two frequencies at which it is met, or a law.

    A law: loss_factor without frequencies, at 1 kHz where an exponent says that decays go as that power of frequency;
    floor_s: below which T60 does not fall.

    includes_radiation: these numbers, and laws among the effects, are total damping as recorded, and the run time adds
    no radiation. Absent: false, but for presets that an older `fit` made of recordings.
    """

    alpha_per_s: NotNegative | None = None
    beta_s: NotNegative | None = None
    loss_factor: NotNegative | None = None
    equal_at_hz: tuple[Positive, Positive] | None = None
    exponent: NotNegative | None = None
    floor_s: NotNegative | None = None
    includes_radiation: bool | None = None


class Thermal(PresetPart, frozen=True):
    """What a metal loses by heat depends on: linear expansion, conductivity, specific heat."""

    expansion_per_k: Positive
    conductivity_w_m_k: Positive
    heat_capacity_j_kg_k: Positive


def rayleigh_of_loss_factor(eta: float, low_hz: float, high_hz: float) -> tuple[float, float]:
    """Compute (alpha_per_s, beta_s) whose loss is ``eta`` at both frequencies; the module's head has the equations."""
    w1, w2 = 2 * math.pi * low_hz, 2 * math.pi * high_hz
    return eta * w1 * w2 / (w1 + w2), eta / (w1 + w2)


def law_of(damping: Damping) -> tuple[DampingLaw, ...]:
    """Return the law that a preset states, none where its damping is Rayleigh's."""
    if damping.loss_factor is None or damping.equal_at_hz is not None:
        return ()
    power = damping.exponent if damping.exponent is not None else 1.0
    law = "constant-loss" if power == 1.0 else "power"
    floor_s = 0.0 if damping.floor_s is None else damping.floor_s
    return (DampingLaw(law, damping.loss_factor, power, floor_s=floor_s),)


def rayleigh_pair(damping: Damping, label: str) -> tuple[float, float]:
    """Return a preset's (alpha_per_s, beta_s): its own, or the pair that meets its loss factor or law.

    Raises MaterialError, with the preset's label, where its damping is none of them.
    """
    numbers = msgspec.structs.asdict(damping)
    of_law = ("loss_factor", "equal_at_hz", "exponent", "floor_s")
    given = {name for name in ("alpha_per_s", "beta_s", *of_law) if numbers[name] is not None}
    if given == {"alpha_per_s", "beta_s"}:
        return numbers["alpha_per_s"], numbers["beta_s"]
    if given == {"loss_factor", "equal_at_hz"} and damping.equal_at_hz:
        return rayleigh_of_loss_factor(numbers["loss_factor"], *damping.equal_at_hz)
    # frequencies in Hz at which Rayleigh's pair meets a law that is none, where nobody names others
    rayleigh_hz = (500.0, 8000.0)
    for law in law_of(damping) if given <= set(of_law) else ():
        omega = 2 * np.pi * np.array(rayleigh_hz)
        decay = law.decay_per_s(omega)
        beta = max(0.0, float(2 * np.diff(decay)[0] / np.diff(omega**2)[0]))
        return max(0.0, float(2 * decay[0] - beta * omega[0] ** 2)), beta
    raise MaterialError(
        f"preset {label}: damping is neither Rayleigh's pair nor a loss factor",
        "give alpha_per_s and beta_s, or loss_factor, alone or with equal_at_hz, or with exponent and floor_s",
    )


def thermoelastic_of(thermal: Thermal | None, elastic: tuple[float | None, float | None, float]) -> tuple[Effect, ...]:
    """Return the thermoelastic loss of a material with (E, ν, ρ), none where no heat is stated."""
    youngs_pa, poisson, density_kg_m3 = elastic
    if thermal is None:
        return ()
    if youngs_pa is None or poisson is None:
        raise RecordError("thermal numbers of a material that is not isotropic", "leave `thermal` out")
    return (
        ThermoelasticLoss(
            youngs_pa,
            poisson,
            density_kg_m3,
            thermal.expansion_per_k,
            thermal.conductivity_w_m_k,
            thermal.heat_capacity_j_kg_k,
        ),
    )
