"""How `contact-time` is looked for.

Identified by the amplitudes: a roll-off common to all modes of a strike, with the pulse's zeros. Moments about the
strike's own pattern. Phases, where they are true, decide only whether τ depends on J: a pulse's middle is πfτ late,
which is observable long before its roll-off differs. Where a long contact leaves two or three lines, modes that should
be observed and are not count, too.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.common.pulses import magnitude
from sonic_bullet.effects.contact_time import FORMS, HERTZ, ContactTime
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.common.line_likelihood import fit_gains
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.robust import cauchy_loss

# times shorter or longer, where it is fitted again: √(5/3), half the way from the half-sine's first zero to its
# second
REFIT_RATIO = 1.29
SHAPE_ERROR = 0.03  # of a mode's strongest expected amplitude
FEWEST_ROLL_OFF_LINES = 2
UNHEARD_COUNT_UP_TO = 3  # lines: with no more, modes that nobody hears tell a roll-off, too
# of the ratios of what is observed to what is expected: gains to begin with
GAIN_QUANTILES = (0.05, 0.5, 0.95)
# times what noise alone makes of an amplitude, and of the strongest: what lines may not be found under
HEARD_OVER_NOISE = 10.0
HEARD_OF_STRONGEST = 0.02


def propose_contact_time(evidence: Evidence) -> ContactTime | None:
    """Fit pulse, duration and exponent to the lines' amplitudes; None where no roll-off is identified."""
    tables = [_table(h) for h in evidence.observed if len(h.freq_hz) >= FEWEST_ROLL_OFF_LINES]
    if not tables:
        return None
    freq, level, expected, observed, sd, most = (np.concatenate([t[i] for t in tables]) for i in range(6))
    thing = np.repeat(np.arange(len(tables)), [len(t[0]) for t in tables])
    mode = np.unique(freq + 1j * thing, return_inverse=True)[1]  # each object's own
    if len(freq) < 4:
        return None
    reference = float(np.exp(np.log(level).mean()))
    known = evidence.known if isinstance(evidence.known, ContactTime) else None
    # part of the evidence may have another pulse nearly as good far away; it is this one that is fitted again
    grid = (
        np.geomspace(0.15 / freq.max(), min(1.2 / freq.min(), 0.05), 90)
        if known is None
        else known.duration_s(reference) * np.geomspace(1 / REFIT_RATIO, REFIT_RATIO, 24)
    )

    def best(exponent: float, pulse: str) -> tuple[float, ContactTime]:
        share = (level / reference) ** exponent

        def at(tau: Array) -> Array:
            h = np.abs(magnitude(pulse, freq * tau[:, None] * share))
            # the gain is free: a pulse so long that it leaves nothing must not pass for a small one
            h = h / np.maximum(h.max(axis=1, keepdims=True), 1e-300)
            return _costs(expected * h, observed, sd, SHAPE_ERROR * most * np.maximum(h, 0.02), mode)

        cost, tau = search_number(lambda one: float(at(np.array([one]))[0]), grid, costs=at)
        return cost, ContactTime(tau, reference, exponent, pulse)

    forms: tuple[str, ...] = FORMS if known is None else (known.pulse,)
    ends: list[tuple[float, ContactTime]] = []
    for exponent in (HERTZ, 0.0):
        ends.append(min([best(exponent, form) for form in forms], key=lambda end: end[0]))
    cost, found = min(ends, key=lambda end: end[0] + sum(_late(h, end[1]) for h in evidence.observed))
    plain = float(_costs(expected[None], observed, sd, SHAPE_ERROR * most[None], mode)[0])
    return found if known is not None or cost < plain - 4 * np.log(len(freq)) else None


def _table(h: ObjectEvidence) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Flatten strikes and lines: frequency, impulse, expected and observed magnitude, spread, strongest expected."""
    expected, observed = np.abs(h.expected), np.abs(h.amplitude)
    freq, sd = h.freq_hz, h.amplitude_sd
    if len(freq) <= UNHEARD_COUNT_UP_TO and h.model is not None and h.signal is not None:
        high, quiet, least = _find_unobserved(h)
        freq, expected, observed, sd = (
            np.append(freq, high),
            np.hstack([expected, quiet]),
            np.hstack([observed, np.zeros(quiet.shape)]),
            np.hstack([sd, least]),
        )
    good = np.isfinite(expected) & np.isfinite(observed) & np.isfinite(h.impulse_n_s)[:, None] & (expected > 0)
    most = np.broadcast_to(expected.max(axis=0, keepdims=True), expected.shape)
    freq = np.broadcast_to(freq, expected.shape)
    level = np.broadcast_to(h.level_n_s[:, None], expected.shape)
    return freq[good], level[good], expected[good], observed[good], sd[good], most[good]


def _find_unobserved(h: ObjectEvidence) -> tuple[Array, Array, Array]:
    """Find modes (u,) without a line, what is expected of them (s, u), and the amplitude (s, u) that may be hidden.

    Hidden is what lies in the noise, where an amplitude's spread is σ √(4d/sr), or under louder lines.
    """
    near = 0.01  # of ln f: a line that near may be that mode
    assert h.model is not None
    alone = np.setdiff1d(np.arange(len(h.all_hz)), np.concatenate([*h.mode, np.zeros(0, int)]))
    alone = alone[np.abs(np.log(h.all_hz[alone, None] / h.every_hz)).min(axis=1) > near]
    hidden = (
        HEARD_OVER_NOISE * h.noise_at(h.all_hz[alone]) * np.sqrt(4 * h.model.decay_per_s[alone] / h.sr)
        + HEARD_OF_STRONGEST * np.abs(h.amplitude).max(axis=1)[:, None]
    )
    return h.all_hz[alone], np.abs(h.push[:, alone]), hidden


def _costs(expected: Array, observed: Array, sd: Array, rough: Array, mode: Array) -> Array:
    """Compute −2 ln L (r,) of magnitudes (n,) at the best common gains with those expected (r, n).

    mode (n,): the index of each one's mode.
    """
    count, starts = len(GAIN_QUANTILES), np.ones((len(expected), len(GAIN_QUANTILES)))
    for i, own in enumerate(expected):
        loud = (observed > 0) & (own > 0)
        if loud.any():
            starts[i] = np.quantile(observed[loud] / own[loud], GAIN_QUANTILES)
    every, off = np.repeat(expected, count, axis=0), np.repeat(rough, count, axis=0)
    return np.asarray(fit_gains(observed, every, sd, off, starts.ravel(), mode).misfit.reshape(-1, count).min(axis=1))


def _late(h: ObjectEvidence, effect: ContactTime) -> float:
    """Compute twice the negative log likelihood (Cauchy) of the phases (s, k) at the best delay; 0 without phases."""
    if not h.signed or h.dry:
        return 0.0
    tau = np.array([effect.duration_s(float(j)) if np.isfinite(j) else np.nan for j in h.impulse_n_s])[:, None]
    turn, x = 2 * np.pi * h.freq_hz, np.abs(h.expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.angle(h.amplitude / h.expected * np.sign(magnitude(effect.pulse, h.freq_hz * tau))) + turn * tau / 2
        width = np.hypot(h.amplitude_sd / np.abs(h.amplitude), SHAPE_ERROR * x.max(axis=0) / x)
    good = np.isfinite(off) & np.isfinite(width) & (width < 1)
    turn, off, width = np.broadcast_to(turn, off.shape)[good], off[good], width[good]

    def at(delay_s: float) -> float:
        return float(cauchy_loss((2 * np.sin((off + turn * delay_s) / 2) / width) ** 2 / 9, 9).sum())

    return search_number(at, np.arange(-4e-5, 4.01e-5, 2e-6))[0]  # of the files' onset
