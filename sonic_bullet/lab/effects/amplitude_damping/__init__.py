"""How `amplitude-damping` is looked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from sonic_bullet.effects.amplitude_damping import POWERS, AmplitudeDamping
from sonic_bullet.effects.common.axes import AXES_PAIR
from sonic_bullet.lab.effects.amplitude_damping.damped_lines import (
    DecayFit,
    DecayFrames,
    fit_decays,
    fitted_decay,
    lines_under,
    onset,
    under,
    would,
)
from sonic_bullet.lab.effects.common.axes import ANGLES
from sonic_bullet.lab.effects.common.envelope import envelopes, levels
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.signal.robust import fit_nonnegative

GROWTHS = np.geomspace(0.02, 30, 28)  # of c a₀ at the loudest
AGAIN = np.geomspace(0.4, 2.5, 9)  # of what all evidence said


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A damping growth, its gain in ln variance, and every line's fit under it."""

    damping_growth: float
    gain: float
    fits: tuple[DecayFit, ...]


def propose_amplitude_damping(evidence: Evidence) -> AmplitudeDamping | None:
    """Fit a common damping growth to the envelopes of each object; None where no object's lines agree on one."""
    best: tuple[float, AmplitudeDamping] | None = None
    known = evidence.known if isinstance(evidence.known, AmplitudeDamping) else None
    for h in evidence.observed:
        e = envelopes(h)
        if e is None:
            continue
        plain = {name: lines_under(e, h, name) for name in (levels(h) if known is None else (known.measure,))}
        for name, power in product(plain, POWERS if known is None else (known.power,)):
            lines = [replace(line, power=power) for line in plain[name]]
            if evidence.held_out and known is not None:
                lines = [_restrict_to_angle(line, known) for line in lines]
            found = _fit_growth(lines, known.damping_growth if known is not None else None)
            if found is not None and (best is None or found.gain > best[0]):
                axes = (
                    (known.freq_hz, known.turn_rad) if evidence.held_out and known is not None else _axes(lines, found)
                )
                best = (
                    found.gain,
                    AmplitudeDamping(
                        found.damping_growth,
                        name,
                        *_rayleigh(h, lines, found.fits),
                        _louder(h, lines, found),
                        *axes,
                        power,
                    ),
                )
    return best[1] if best is not None else None


def _fit_growth(lines: list[DecayFrames], known: float | None) -> _Fit | None:
    """Fit the damping growth that all lines agree on; None where it is not certain.

    known is the one found in the whole evidence, if this is a part of it.
    """
    least = 0.05  # of c a₀ at the loudest
    better = 3.0  # of ln variance of the envelopes' logarithms, all lines together
    if len(lines) < 2:
        return None
    most = float(max(line.level.max() for line in lines))

    def fits(damping_growth: float) -> tuple[DecayFit, ...]:
        return tuple(fitted_decay(line, damping_growth) for line in lines)

    grid = GROWTHS / most if known is None else known * AGAIN
    _, damping_growth = search_number(
        lambda c: sum(one.least for one in fits(c)),
        grid,
        0.02,
        lambda every: np.array([[one.least for one in fit_decays(line, every)] for line in lines]).sum(axis=0),
    )
    plain, row = fits(0.0), fits(damping_growth)
    gain = np.array([a.least - b.least for a, b in zip(plain, row, strict=True)])
    if damping_growth * most < least:
        return None
    if known is None and not (
        gain.sum() > better
        and -gain[gain < 0].sum() < 0.3 * gain[gain > 0].sum()
        and _supported_by_lines(lines, damping_growth, plain, row)
    ):
        return None
    return _Fit(damping_growth, float(gain.sum()), row)


def _restrict_to_angle(line: DecayFrames, known: AmplitudeDamping) -> DecayFrames:
    """Restrict a line to the known angle of its degenerate modes."""
    turn = next(
        (t for f, t in zip(known.freq_hz, known.turn_rad, strict=True) if abs(f / line.freq_hz - 1) < AXES_PAIR), 0.0
    )
    return under(line, int(np.abs(ANGLES - turn).argmin())) if len(line.amplitude) > 1 else line


def _supported_by_lines(
    lines: list[DecayFrames], damping_growth: float, plain: tuple[DecayFit, ...], row: tuple[DecayFit, ...]
) -> bool:
    """Decide whether the lines that the damping growth would bend are bent as it predicts.

    Each line counts by the part of its misfit that the damping growth would make, so one loud mode and a softer one are
    enough.
    """
    share, fewest_lines = 0.5, 1.5  # of the misfit must go, in lines that a damping growth would bend; of such lines
    before = np.exp([one.spread[0] for one in plain])
    after = np.exp([one.least for one in row])
    bent = np.array(
        [
            would(line, damping_growth, float(one.decay_per_s[one.best]), one.best)
            for line, one in zip(lines, row, strict=True)
        ]
    )
    says = np.minimum(bent / before, 1.0)
    gone = np.maximum(1 - after / before, -1.0)
    many = float(says.sum() ** 2 / max((says**2).sum(), 1e-300))
    return many >= fewest_lines and float((says * gone).sum() / max(says.sum(), 1e-300)) > share


def _louder(h: ObjectEvidence, lines: list[DecayFrames], found: _Fit) -> float:
    """Compute the modes' levels at the onset over the linear model's: the median of all lines and strikes."""
    level = [
        onset(line, found.damping_growth, float(one.decay_per_s[one.best]), one.best)
        for line, one in zip(lines, found.fits, strict=True)
    ]
    plain = [np.abs(h.push[:, h.mode[line.number]].sum(axis=1)) for line in lines]
    ratio = np.stack(level, axis=1) / np.maximum(np.stack(plain, axis=1), 1e-300)
    return float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0


def _axes(lines: list[DecayFrames], found: _Fit) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return frequencies and angles of the degenerate modes whose axes are observable."""
    observed = [
        (line.freq_hz, float(ANGLES[one.best])) for line, one in zip(lines, found.fits, strict=True) if one.turned
    ]
    return tuple(f for f, _ in observed), tuple(t for _, t in observed)


def _rayleigh(h: ObjectEvidence, lines: list[DecayFrames], row: tuple[DecayFit, ...]) -> tuple[float, float]:
    """Fit α, β >= 0 to the lines' decays at low level, by relative least squares with Huber's weights."""
    rough = 0.1  # of a decay: more off counts less
    omega2 = np.array([h.omega[line.number] ** 2 for line in lines])
    decay = np.array([one.decay_per_s[one.best] for one in row])
    alpha, beta = fit_nonnegative(
        decay, rough / 3 * decay, np.stack([np.full(len(omega2), 0.5), 0.5 * omega2], axis=1)
    )[0]
    return float(alpha), float(beta)
