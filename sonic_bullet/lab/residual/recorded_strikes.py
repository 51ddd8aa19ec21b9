"""Recordings -> the residual: what the modes leave unsaid of the features, and the features of the sound.

    CaseFit -> Features and modes of each strike -> match ratios R_i -> lines √(1 - w_i²) φ_i, leftover -> Residual
        [Ren, Yeh, Lin 2013, sec. 6.1]

    R(φ_i, Φ̃) = Σ_j u_ij k_ij / Σ_j u_ij,   k = 1/(1 + D²),  u_ij = w_j/(D² + δ²)²
        [eq. 23-25]
    w_i = min(R_i, √(Σ_j k_ij² a_j²)/a_i)

D is stricter than in a search for the material, as frequencies have been corrected by then. What is left is to be
added, so it differs in two ways more: a mode that rings longer than the feature leaves nothing to add (D counts Y one
way only), and a feature is not represented further than the modes are loud there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.engine.residual.offline import synthesize_lines
from sonic_bullet.engine.residual.transfer import StruckModes
from sonic_bullet.lab.fit.case_fit import CaseFit, ObjectFit
from sonic_bullet.lab.fit.prediction_of_lines import lines_sound, risen_sum
from sonic_bullet.lab.fit.typical_strike import select_ringing
from sonic_bullet.lab.lines.line_values import Lines, energy, lines_at
from sonic_bullet.lab.residual.compute import residual_record
from sonic_bullet.lab.residual.nearest_parts import keep_nearest_parts
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.perceptual.loudness import bark


def match_ratios(
    freq_hz: Array, decay_per_s: Array, mode_hz: Array, mode_decay_per_s: Array, mode_amplitude: Array
) -> tuple[Array, Array]:
    """R (k,) of features (k,) beside modes (m,), and the amplitude √Σ k²a² (k,) that the modes have there."""
    nearby = 0.02
    per_bark = 40.0
    per_duration = 1.0
    if not len(mode_hz) or not len(freq_hz):
        return np.zeros(len(freq_hz)), np.zeros(len(freq_hz))
    loud = energy(mode_decay_per_s, mode_amplitude)
    per_s = per_duration * float(np.average(mode_decay_per_s, weights=loud + 1e-300))
    across = per_bark * (bark(freq_hz)[:, None] - bark(mode_hz)[None])
    along = np.maximum(
        per_s / np.maximum(decay_per_s, 1e-3)[:, None] - per_s / np.maximum(mode_decay_per_s, 1e-3)[None], 0.0
    )
    apart = across**2 + along**2
    loudness_power = 0.3
    score, near = 1 / (1 + apart), (loud**loudness_power) / (apart + nearby**2) ** 2
    ratio = (near * score).sum(axis=1) / np.maximum(near.sum(axis=1), 1e-300)
    return ratio, np.sqrt(((score * mode_amplitude) ** 2).sum(axis=1))


def represented_share(
    freq_hz: Array, decay_per_s: Array, amplitude: Array, mode_hz: Array, mode_decay_per_s: Array, mode_amplitude: Array
) -> Array:
    """Return the share w (k,) of each feature's amplitude that modes (m,) represent.

    amplitude (s, k), mode_amplitude (s, m): at s strikes, taken together by power. A strike louder than the model says
    and another softer are no residual: what is left is left on the average.
    """
    loud, played = (np.sqrt((np.abs(x) ** 2).mean(axis=0)) for x in (amplitude, mode_amplitude))
    ratio, there = match_ratios(freq_hz, decay_per_s, mode_hz, mode_decay_per_s, played)
    return np.asarray(np.clip(np.minimum(ratio, there / np.maximum(loud, 1e-300)), 0.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Strikes:
    """s strikes of one body from the onset on, and what they leave.

    signals, left (s, n): recorded, beside all features. freq_hz, decay_per_s (k,), amplitude (s, k) complex: features;
    share (k,): what of each the modes represent. mode_* (m,), mode_amplitude (s, m) complex.
    """

    signals: Array
    left: Array
    sr: int
    freq_hz: Array
    decay_per_s: Array
    amplitude: Array
    share: Array
    mode_hz: Array
    mode_decay_per_s: Array
    mode_amplitude: Array
    residual: Residual


def strikes_of(
    signals: Array,
    left: Array,
    sr: int,
    lines: tuple[Array, Array, Array],
    modes: tuple[Array, Array, Array],
    source: str,
    rise: Array | None = None,
) -> Strikes:
    """Compute the residual of strikes (s, n) from the onset on, ``rise`` (s,) samples before their first peaks.

    lines: freq_hz, decay_per_s (k,), amplitude (s, k) of the features, without which ``left`` (s, n) remains.
    modes: freq_hz, decay_per_s (m,), amplitude (s, m) complex of what the model plays. Both are `at_peak`.
    Raises AudioError, RecordError.
    """
    freq, decay, amplitude = lines
    order = np.argsort(modes[0], kind="stable")
    order = order[np.append(True, np.diff(modes[0][order]) > 0)] if len(order) else order
    hz, mode_decay, played = modes[0][order], modes[1][order], modes[2][:, order]
    share = represented_share(freq, decay, amplitude, hz, mode_decay, played)
    # a feature whose power is represented but for less than this, a tenth of a decibel, leaves nothing
    unrepresented = 0.02
    loud = np.sqrt(np.where(1 - share**2 > unrepresented, 1 - share**2, 0.0) * (np.abs(amplitude) ** 2).mean(axis=0))
    mean = np.sqrt((np.abs(played) ** 2).mean(axis=0))
    late = np.zeros(len(signals), int) if rise is None else rise
    each = zip(signals, played, late, strict=True)
    rest = np.stack([x - risen_sum(hz, mode_decay, a, signals.shape[1], sr, at) for x, a, at in each])
    residual = residual_record(signals, left, rest, sr, StruckModes(hz, mode_decay, mean), (freq, decay, loud), source)
    return Strikes(signals, left, sr, freq, decay, amplitude, share, hz, mode_decay, played, residual)


@one_thread()
def case_strikes(found: CaseFit) -> Strikes:
    """Compute the residual of a fitted case, of the object with the most strikes, beside what a fit plays of them.

    That is the modes of a shape struck at known places, or else the lines. Raises AudioError where no recording can be
    used.
    """
    shaped = {o.evidence.thing.name: o for o in found.objects if np.isfinite(o.pattern).any()}
    recorded = [e for e in found.evidence if e.signals is not None and (e.thing.name in shaped or len(e.lines.freq_hz))]
    if not recorded:
        raise AudioError(
            f"case {found.case.name} has no recording in which anything rings",
            "a residual is what a recording has beside its modes",
        )
    e = max(recorded, key=lambda x: (x.thing.name in shaped, len(x.recordings)))
    assert e.signals is not None
    sr, n = e.sr, e.signals.shape[1]
    # what is over within a few cycles describes the attack, by amplitudes that cancel one another: with phases of their
    # own such lines would be 20 dB too loud, so that they are noise
    rings = lines_at(e.lines, select_ringing(e.lines))
    left = np.stack([signal - lines_sound(rings, i, n, sr) for i, signal in enumerate(e.signals)])
    lines = rings.freq_hz, np.nan_to_num(rings.decay_per_s), np.nan_to_num(rings.at_peak)
    modes = _played_modes(found, shaped[e.thing.name]) if e.thing.name in shaped else _played_lines(e.lines)
    rise = np.round(e.lines.rise_s * sr).astype(int)
    names = ", ".join(r.file.name for r in e.recordings if r.file is not None)
    made = strikes_of(e.signals, left, sr, lines, modes, f"{found.case.name}: {names}"[:400], rise)
    return replace(made, residual=keep_nearest_parts(found, e, made.residual))


def _played_lines(lines: Lines) -> tuple[Array, Array, Array]:
    """Frequency, decay (m,), amplitude (s, m) of the lines that a preset plays where no shape is known."""
    keep = select_ringing(lines)
    return lines.freq_hz[keep], lines.decay_per_s[keep], lines.at_peak[:, keep]


def _played_modes(found: CaseFit, o: ObjectFit) -> tuple[Array, Array, Array]:
    """Return frequency, decay (m,), amplitude (s, m) of what a fit plays of the strikes of a shape.

    Of those without a place what was recorded.
    """
    e = o.evidence
    assert e.seen is not None
    use = o.freq_hz < e.sr / 2
    measured = (
        np.where(o.line >= 0, e.lines.at_peak[:, o.line], 0.0)
        if len(e.lines.freq_hz)
        else np.zeros((len(e.recordings), len(o.line)))
    )
    predicted = found.fit.sigma * o.pattern * e.seen.start(o.freq_hz, o.decay_per_s)
    predicted = predicted * np.exp(-np.outer(e.lines.rise_s, o.decay_per_s))
    amplitude = np.where(np.isfinite(predicted), predicted, measured)
    return o.freq_hz[use], o.decay_per_s[use], amplitude[:, use]


@one_thread()
def recording_strikes(sample: Array, sr: int, onset_s: float | None, name: str) -> Strikes:
    """Compute the residual of one recording (n,) whose shape is not known: its features stand in for modes.

    Raises AudioError.
    """
    from sonic_bullet.lab.lines.extraction import extract

    found = extract(sample, sr, onset_s=onset_s)
    if not len(found.freq_hz):
        raise AudioError(
            "no damped sinusoid stands above the noise", "record a louder strike, nearer, in a quieter place"
        )
    signal = np.asarray(sample, float)[round(found.onset_s * sr) :]
    # a sin(ωt + φ) = Re a e^{i(φ - π/2)} e^{iωt}
    amplitude = found.amplitude * np.exp(1j * (found.phase_rad - np.pi / 2))
    observed = synthesize_lines(found.freq_hz, found.decay_per_s, amplitude, len(signal), sr)
    modes = found.freq_hz, found.decay_per_s, amplitude[None]
    return strikes_of(signal[None], (signal - observed)[None], sr, modes, modes, name)
