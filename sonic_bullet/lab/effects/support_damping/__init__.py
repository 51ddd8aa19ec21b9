"""How `support-damping` is looked for."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.common.points import nearest
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.support_damping.dashpot_fit import Dashpot, DashpotFit
from sonic_bullet.lab.effects.support_damping.support_search import REACHES, refine_dashpots, search_dashpots
from sonic_bullet.records import ModalModel


def propose_support_damping(evidence: Evidence) -> SupportDamping | None:
    """Search for dashpots on the object with most lines; None where there are none."""
    fewest_lines, again = 6, 4  # lines: to look for dashpots, and to fit them again to a part of them
    observed = max(evidence.observed, key=lambda h: len(h.freq_hz) if h.model is not None else 0)
    if (
        observed.model is None
        or len(observed.freq_hz) < (fewest_lines if evidence.known is None else again)
        or not np.isfinite(observed.decay_per_s).all()
    ):
        return None
    trial = DashpotFit.of(observed)
    if isinstance(evidence.known, SupportDamping):
        return _of(trial, refine_dashpots(trial, _on(evidence.known, observed.model), REACHES[-1:], trial.wide)[1])
    found = search_dashpots(trial)
    # of a decay: dashpots that add less to every one are none, though modes are identified anew with them
    least = 0.02
    return _of(trial, found) if found and _most(trial, found) > least else None


def _of(trial: DashpotFit, found: tuple[Dashpot, ...]) -> SupportDamping:
    """Build the effect from the dashpots that a search found."""
    place = [trial.model.vertex_m[d.vertex] for d in found]
    return SupportDamping(
        tuple((float(a), float(b), float(c)) for a, b, c in place),
        tuple(d.c for d in found),
        tuple(d.along for d in found),
    )


def _on(support_damping: SupportDamping, x: ModalModel) -> tuple[Dashpot, ...]:
    """Return its dashpots at the vertices of a model."""
    along = support_damping.along or ("normal",) * len(support_damping.position_m)
    return tuple(
        Dashpot(nearest(x, p), c, direction)
        for p, c, direction in zip(support_damping.position_m, support_damping.strength_n_s_m, along, strict=True)
    )


def _most(trial: DashpotFit, found: tuple[Dashpot, ...]) -> float:
    """Compute the largest part of a mode's decay that dashpots add, to first order: ½ Σ_j c_j |Φ_j|²/d."""
    added = (trial.rows([found])[0] ** 2).sum(axis=0) / 2
    return float((added / np.maximum(trial.model.decay_per_s, 1e-9)).max(initial=0.0))
