"""How `measurement-chain` is looked for.

Identified by the amplitudes (one factor a frequency for all strikes), the samples at the peak, and the last third of
every recording.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.effects.measurement_chain import ORDERS, MeasurementChain
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.common.hum import hum_of
from sonic_bullet.lab.effects.common.line_likelihood import misfit_about_constant
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array

CORNERS_TRIED = 160
HIGHEST_CORNER = 0.49  # of the rate
# samples at the limit: in a row, and in all
STUCK_IN_A_ROW = 4
STUCK_IN_ALL = 12


def propose_measurement_chain(evidence: Evidence) -> MeasurementChain | None:
    """Look for a limit, hum and, where there is no limit, a filter; None where none is found."""
    better = 16.0
    fewest_lines, again = 5, 3  # lines: to look for a filter, and to fit it again to a part of them
    observed = [h for h in evidence.observed if h.signal is not None and h.predicted is not None]
    if not observed:
        return None
    parts: dict[str, Any] = {}
    if limit := limit_of(
        [h.signal for h in observed if h.signal is not None],
        evidence.known.limit if isinstance(evidence.known, MeasurementChain) else 0.0,
    ):
        parts["limit"] = limit
    parts |= _hum(observed, evidence.known.hum_hz if isinstance(evidence.known, MeasurementChain) else 0.0)
    if "limit" not in parts:
        parts |= _filter(observed, better, fewest_lines) if evidence.known is None else _filter(observed, 0.0, again)
    return MeasurementChain(**parts) if parts else None


def butterworth(freq_hz: Array, corner_hz: float, order: int, high: bool, sr: int) -> Array:
    """|H| (f,) of the filter at a rate: the bilinear transform bends frequencies.

    Source: Oppenheim & Schafer 2010, eq. 7.28.
    """
    x = np.tan(np.pi * np.asarray(freq_hz) / sr) / np.tan(np.pi * corner_hz / sr)
    return np.asarray(1 / np.sqrt(1 + x ** (-2 * order if high else 2 * order)))


def limit_of(signals: list[Array], known: float = 0.0) -> float:
    """Find the level at which one recording or more is clipped, and which is another's peak.

    Two strikes never have the same peak to same otherwise.

    Parameters
    ----------
    signals : list of (s, n)
        Recordings by object.
    known : float
        Limit found in the whole evidence; then one recording that reaches it is enough.

    Returns
    -------
    float
        The limit in units of the file, 0 where there is none.
    """
    same = 2e-3  # of a limit: how far peaks that it has made are apart
    peak = np.concatenate([np.abs(signal).max(axis=1) for signal in signals])
    if known:
        return known if abs(float(peak.max()) / known - 1) < same else 0.0
    stands = np.array([_stands(row) for signal in signals for row in signal])
    if not stands.any():
        return 0.0
    level = float(np.median(peak[stands]))
    at = np.abs(peak / level - 1) < same
    return level if at.sum() >= 2 and at[stands].all() and peak.max() < (1 + same) * level else 0.0


def _stands(row: Array) -> bool:
    """Decide whether a recording (n,) is at its peak for long, or often."""
    stuck = np.abs(row) > 0.998 * np.abs(row).max()
    return bool(
        stuck.sum() > STUCK_IN_ALL
        or np.convolve(stuck, np.ones(STUCK_IN_A_ROW), "valid").max(initial=0) >= STUCK_IN_A_ROW
    )


def _hum(observed: list[ObjectEvidence], known_hz: float) -> dict[str, Any]:
    """Find a tone at the mains and its multiples, of one amplitude in all recordings of the object that has most.

    known_hz is the frequency found in the whole evidence. Where onsets are not declared it is a room's, which has been
    taken off with what precedes them, and nothing of the chain.
    """
    h = max(observed, key=lambda one: len(one.impulse_n_s))
    assert h.signal is not None
    if not h.signed:
        return {}
    found = hum_of(h.signal, h.noise, h.sr, known_hz)
    return (
        {}
        if found is None
        else {"hum_hz": found.hz, "hum_amplitude": found.amplitude, "hum_phase_rad": found.phase_rad}
    )


def _filter(observed: list[ObjectEvidence], better: float, fewest: int) -> dict[str, Any]:
    """Fit one high-pass or low-pass that all strikes share."""
    rows = [_ratio(h) for h in observed if len(h.freq_hz) >= fewest]
    if not rows:
        return {}
    freq, ratio, sd = (np.concatenate([r[i] for r in rows]) for i in range(3))
    if len(freq) < fewest:
        return {}
    sr = min(h.sr for h in observed)
    trials: list[tuple[float, dict[str, Any]]] = [
        (misfit_about_constant(ratio, sd) - better - 2 * np.log(len(freq)), {})
    ]
    bottom, top = float(freq.min()), min(float(freq.max()), HIGHEST_CORNER * sr)
    # beyond all lines it is a slope, which much else is
    for name, ends in (("high", (0.3 * bottom, top)), ("low", (bottom, min(3 * top, HIGHEST_CORNER * sr)))):
        for order in ORDERS:

            def cost(corner: float, order: int = order, high: bool = name == "high") -> float:
                return misfit_about_constant(ratio - np.log(butterworth(freq, corner, order, high, sr)), sd)

            left, corner = search_number(cost, np.geomspace(*ends, CORNERS_TRIED))
            trials.append((left, {f"{name}_pass_hz": corner, f"{name}_order": order}))
    return min(trials, key=lambda trial: trial[0])[1]


def _ratio(h: ObjectEvidence) -> tuple[Array, Array, Array]:
    """Compute per line frequency, ln of observed over expected amplitude, and its spread with the strikes' scatter."""
    rough = 0.03
    expected, seen = np.abs(h.expected), np.abs(h.amplitude)
    width = np.hypot(h.amplitude_sd, rough * expected.max(axis=0, keepdims=True)) + 1e-300
    gain = (expected * seen / width**2).sum(axis=0) / np.maximum((expected**2 / width**2).sum(axis=0), 1e-300)
    left = np.sqrt((((seen - gain * expected) / width) ** 2).mean(axis=0))
    size = np.sqrt((expected**2 / width**2).sum(axis=0))
    good = (gain > 0) & (size > 3)
    sd = np.hypot(np.maximum(left, 1.0)[good] / (size[good] * np.maximum(gain[good], 1e-300)), rough)
    return h.freq_hz[good], np.log(gain[good]), sd
