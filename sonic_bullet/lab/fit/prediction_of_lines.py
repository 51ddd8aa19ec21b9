"""A fitted material played on strikes: what the sensor would record, in the recording's units.

x(t) = Re Σ_j σ J ψ_j s_j e^{(−d_j + iω_j)t}
    ψ, s: observation.py; ω_j with the correction learnt on the fitted strikes
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet._engine import add_linear_modes
from sonic_bullet.lab.lines.band_limit import LOWEST_AUDIBLE_HZ
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError
from sonic_bullet.signal.short_time import raised_cosine

if TYPE_CHECKING:
    from sonic_bullet.files.cases import CaseRecording
    from sonic_bullet.lab.fit.case_fit import CaseFit, ObjectFit
    from sonic_bullet.lab.lines.joint_lines import Lines


def damped_sum(freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int) -> Array:
    """Re Σ A e^{(−d + iω)t} (n,) of modes (m,), A complex at t = 0."""
    most_nepers = 40.0
    sound = np.zeros(n)
    heard = np.flatnonzero(amplitude)
    pole = (-decay_per_s + 2j * np.pi * freq_hz)[heard] / sr
    length = np.minimum(most_nepers / np.maximum(-pole.real, most_nepers / max(n, 1)) + 1, n).astype(np.int64)
    add_linear_modes(pole, np.asarray(amplitude[heard], complex), length, 0.0, sound)
    return sound


def risen_sum(freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int, rise: int) -> Array:
    """Sum (n,) of lines of amplitude `at_peak`, ``rise`` samples after the first: damped from there on.

    Until then the contact drives them: they rise to what they are at the peak, as a raised cosine. A line that outlasts
    the rise turns back at its own frequency. One that does not follows the force, and one that is louder than all of
    them together is cancelled by others: these are mirrored in time, so that what cancels after the peak does before.
    """
    rise = min(rise, n)
    turn = np.exp(2j * np.pi / sr * np.outer(np.arange(rise + 1), freq_hz)) * amplitude
    after = damped_sum(freq_hz, decay_per_s, turn[-1], max(n - rise, round(sr / LOWEST_AUDIBLE_HZ)), sr)
    loudest = np.abs(after[: round(sr / LOWEST_AUDIBLE_HZ)]).max()
    turns = (decay_per_s * rise < sr) & (np.abs(amplitude) <= loudest)
    mirrored = damped_sum(freq_hz[~turns], decay_per_s[~turns], turn[-1, ~turns], rise + 1, sr)[:0:-1]
    driven = turn[:-1, turns].sum(axis=1).real + mirrored
    return np.concatenate([raised_cosine(np.arange(rise) / max(rise, 1)) * driven, after[: n - rise]])


def lines_sound(lines: Lines, i: int, n: int, sr: int) -> Array:
    """Add up the lines of recording i (n,): the recording less this is what no damped sinusoid explains."""
    return risen_sum(lines.freq_hz, lines.decay_per_s, lines.at_peak[i], n, sr, round(lines.rise_s[i] * sr))


def predict_sound(o: ObjectFit, pattern: Array, gain: float, n: int, sr: int) -> Array:
    """Sound (n,) of an object's modes with pattern (m,) = J ψ from the onset on."""
    assert o.evidence.seen is not None
    start = o.evidence.seen.start(o.freq_hz, o.decay_per_s)
    observed = o.freq_hz < 0.5 * sr
    return damped_sum(o.freq_hz[observed], o.decay_per_s[observed], (gain * pattern * start)[observed], n, sr)


def strike_modes(
    found: CaseFit, recording: CaseRecording, sr: int, *, corrected: bool = True
) -> tuple[Array, Array, Array]:
    """Return frequency, decay and complex amplitude (m,) that the fit predicts of any strike of its case.

    Of a fitted object with its corrections, of another object of the material without. Raises FileError, MeshError
    where the object has no mesh or the strike no place.
    """
    from sonic_bullet.lab.fit.object_fit import object_of
    from sonic_bullet.lab.fit.recorded import body_family, describe_observation, guess_of

    if recording.position_m is None:
        raise FileError("a strike without a place cannot be predicted", "give its position")
    thing = found.case.objects[recording.object]
    same = next((o for o in found.objects if o.evidence.thing.name == recording.object), None)
    guess = guess_of(thing)
    body = same.evidence.family if same else body_family(found.case, thing, guess, "default")
    if body is None:
        raise FileError(f"object '{thing.name}' has no mesh", "a prediction needs its shape")
    seen = describe_observation(found.case, thing, guess, (recording,), body)
    made = object_of(found, thing, guess, body, seen, same)
    freq = made.freq_hz if corrected else made.model_hz
    in_range = freq < 0.5 * sr
    amplitude = found.fit.sigma * made.pattern[0] * seen.start(freq, made.decay_per_s)
    return freq[in_range], made.decay_per_s[in_range], amplitude[in_range]
