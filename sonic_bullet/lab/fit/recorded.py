"""What a case's strikes of one object say, and the object's modes to hold it against.

CaseRecording's files -> onset cut -> hum taken out -> Lines (joint_lines.py)
mesh + guess -> Family (modal.reduced) -> Observation
    both -> RecordedObject, one per object (and one per list of features)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sonic_bullet.files import read_channel
from sonic_bullet.files.cases import Case, CaseObject, CaseRecording, Line
from sonic_bullet.files.presets import load_material, material_names, warn_of_units
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.files.uff.impulse_response import period_spectrum, since_impulse
from sonic_bullet.lab.effects.common.hum import hum_of, subtract_hum, without_hum
from sonic_bullet.lab.fit.observation import Observation, observation
from sonic_bullet.lab.fit.takes.impact_check import describe_no_impacts
from sonic_bullet.lab.fit.takes.usable_take import refuse_clipped, refuse_short
from sonic_bullet.lab.lines.band_limit import LOWEST_AUDIBLE_HZ, limit_band, without_drift
from sonic_bullet.lab.lines.joint_lines import NO_SOUND_BEYOND, Lines, joint_lines, lines_of, noise_rms
from sonic_bullet.lab.lines.line_values import lines_at, too_loud
from sonic_bullet.lab.lines.onset import describe_doubts, span, until_next_hit
from sonic_bullet.lab.lines.response_lines import response_lines
from sonic_bullet.lab.lines.session_noise import session_floor, tone_power, without_loud_noise
from sonic_bullet.lab.lines.standing_hum import describe_hum, find_session_hum
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import read_mesh
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.modal.reduced import family
from sonic_bullet.records import Array, Material
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError, MeshError
from sonic_bullet.records.regular_files import check_regular
from sonic_bullet.signal.log_spectral import Floor

LONGEST_RISE_S = 0.005
"""From an impact's first sample to its first peak: what rises for longer is no single pulse."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class RecordedObject:
    """One object's lines, its family and how its strikes are observed. family None: no mesh.

    signals (s, n) from the onset, None for features. ringing: lines are those after the attack.
    responses: what was measured, where that was over frequency. hum_hz: of the session's hum, which is taken off.
    floor: the session's noise, where it stands before the onsets. doubtful: which of the recordings may be no impact.
    later_hits: how many hits after the first they hold.
    """

    thing: CaseObject
    guess: Material
    recordings: tuple[CaseRecording, ...]
    lines: Lines
    family: Family | None
    seen: Observation | None
    signals: Array | None
    sr: int
    notes: tuple[str, ...] = ()
    ringing: bool = False
    responses: Responses | None = None
    hum_hz: float = 0.0
    floor: Floor | None = None
    doubtful: tuple[int, ...] = ()
    later_hits: int = 0


class Sounds(NamedTuple):
    """Strikes of one object: signals (s, n) from the onset, without hum, their rate, what is odd about them.

    kept: which of the recordings they are. before: part of each recording's energy that lies before its onset, from
    where it begins to sound. responses: what was measured, where that was over frequency. hum_hz: of the session's hum,
    which was taken off; 0 where there was none. floor: the session's noise, where it stands before the onsets.
    late: samples from each onset to its first peak, from where lines are read. later_hits: in all of them.
    """

    signals: Array
    sr: int
    remarks: list[str]
    before: list[float]
    responses: Responses | None
    kept: tuple[int, ...]
    hum_hz: float = 0.0
    floor: Floor | None = None
    late: tuple[int, ...] = ()
    later_hits: int = 0


class Responses(NamedTuple):
    """Frequency responses value (s, n) at_hz (n,): transforms of what an impulse leaves, in the recordings' units."""

    value: Array
    at_hz: Array


def guess_of(thing: CaseObject) -> Material:
    """Return the object's guessed material: the declared constants, the named preset's for what is not declared.

    Warns as `load_material` does. Raises MaterialError, FileError.
    """
    made = _guess(thing)
    warn_of_units(made)
    return made


def _guess(thing: CaseObject) -> Material:
    given = (thing.youngs_pa, thing.poisson, thing.density_kg_m3)
    name = (thing.material or "").lower()
    if None not in given and name not in material_names():
        return Material.isotropic(
            thing.material or "guess", youngs_pa=given[0] or 0, poisson=given[1] or 0, density_kg_m3=given[2] or 0
        )
    if not name:
        raise FileError(
            f"object '{thing.name}' has neither a material nor all of elastic_guess",
            "name a guess; 'sonic-bullet materials' lists all",
        )
    base = load_material(thing.material or "")
    rest = {
        "alpha_per_s": base.alpha_per_s,
        "beta_s": base.beta_s,
        "roughness_m": base.roughness_m,
        "hurst": base.hurst,
        "restitution": base.restitution,
    }
    return Material.isotropic(
        base.name,
        youngs_pa=thing.youngs_pa or base.youngs_pa,
        poisson=base.poisson if thing.poisson is None else thing.poisson,
        density_kg_m3=thing.density_kg_m3 or base.density_kg_m3,
        source=base.source,
        **rest,
    )


def gather(
    case: Case,
    *,
    split: str = "fit",
    cache: Place = "default",
    clipped: bool = False,
) -> tuple[RecordedObject, ...]:
    """Return RecordedObjects of all objects that have strikes of ``split`` with audio or features.

    clipped: let through what stands at its peak, and what holds several hits. Raises SonicBulletError where there is
    none.
    """
    found: list[RecordedObject] = []
    names = tuple(dict.fromkeys(r.object for r in case.recordings if r.split == split))
    check_meshes(case, names)
    for name in names:
        thing = case.objects.get(name, CaseObject(name or "object", None, 1.0, None, 2e11, 7850.0, 0.3))
        guess = guess_of(thing)
        mine = tuple(r for r in case.recordings if r.object == name and r.split == split)
        played = tuple(r for r in mine if r.file is not None and r.file.is_file())
        listed = tuple(r for r in mine if r.file is None and r.lines)
        gone = [str(r.file) for r in mine if r.file is not None and not r.file.is_file()]
        if gone and not played and not listed:
            raise FileError(f"cannot read {gone[0]}: no such file", "a fit needs the audio of its 'fit' strikes")
        sounds = None
        if played:  # before the modes, which take longer: a recording that will not do is reported at once
            report_progress(f"reading {format_count(len(played), 'recording')} of {name or 'the object'}")
            sounds = _sounds(case, thing, played, clipped)
        body = body_family(case, thing, guess, cache) if thing.mesh is not None else None
        if sounds is not None:
            signals, sr, remarks, before, responses, kept, hum_hz, floor, late, later_hits = sounds
            played = tuple(played[i] for i in kept)
            seen = describe_observation(case, thing, guess, played, body) if body is not None else None
            report_progress(f"listening to {format_count(len(played), 'recording')} of {name or 'the object'}")
            modes = _modes_observed(body, guess, case.band_hz) if clipped and body is not None else None
            if responses is not None:
                lines = response_lines(responses.value, responses.at_hz, sr)
                if body is not None:  # whose modes are told in the case's band alone
                    lines = lines_at(lines, np.flatnonzero(lines.freq_hz < case.band_hz[1]))
            else:
                still = without_hum(signals, noise_rms(signals, sr), sr)
                lines = _lines_from_peaks(case, still, sr, late, floor, modes)
            odd: list[str] = []
            if case.onset_s is None:
                odd = describe_no_impacts(signals, lines, sr, before, [str(r.file) for r in played])
            notes = (*(f"{g} is missing" for g in gone), *remarks, *filter(None, odd))
            doubtful = tuple(i for i, words in enumerate(odd) if words)
            found.append(
                RecordedObject(
                    thing,
                    guess,
                    played,
                    lines,
                    body,
                    seen,
                    signals,
                    sr,
                    notes,
                    responses=responses,
                    hum_hz=hum_hz,
                    floor=floor,
                    doubtful=doubtful,
                    later_hits=later_hits,
                )
            )
        found += [_read_listed(case, thing, guess, entry, body) for entry in listed]
    if not found:
        raise FileError(
            f"case {case.name} has no '{split}' strike with audio or features",
            "mark at least one recording with split 'fit'",
        )
    return tuple(found)


def _lines_from_peaks(
    case: Case, signals: Array, sr: int, late: tuple[int, ...], floor: Floor | None, modes: int | None
) -> Lines:
    """Identify the lines of signals (s, n) from each one's first peak on, taken back to its onset: A e^{(d − iω)t}.

    Where the session's noise is known, without those that stand no higher at the onsets than before them.
    """
    above = 4.0  # times the power: 6 dB, for there they are one tone and noise that adds to it
    at = np.array(late or [0] * len(signals))
    count = signals.shape[1] - int(at.max())
    rest = np.stack([x[first : first + count] for x, first in zip(signals, at, strict=True)])
    noise = noise_rms(rest, sr)
    lines = joint_lines(rest, sr, band_hz=case.band_hz, signed=case.onset_s is not None, modes=modes)
    if floor is not None and len(lines.freq_hz):
        power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
        struck = power > above * tone_power(floor, lines.freq_hz, sr)
        lines = lines if struck.all() else lines_of(rest, noise, lines.pole[struck], sr, lines.signed)
    if not at.any():
        return lines
    # a line that begins far above its take is one of a heap that cancel one another: without it the others are other
    while (loud := too_loud(lines, rest, NO_SOUND_BEYOND[0])).any():
        lines = lines_of(rest, noise, lines.pole[~loud], sr, lines.signed)
    back = np.exp(-np.outer(at / sr, lines.pole))
    amplitude, amplitude_sd = lines.amplitude * back, lines.amplitude_sd * np.abs(back)
    return replace(lines, amplitude=amplitude, amplitude_sd=amplitude_sd, rise_s=at / sr)


def check_meshes(case: Case, names: Iterable[str]) -> None:
    """Raise FileError where the mesh file of one of a case's objects is not there, before one is listened to."""
    for name in names:
        mesh = case.objects[name].mesh if name in case.objects else None
        if mesh is not None:
            check_regular(mesh)
        if mesh is not None and not mesh.is_file():
            raise FileError(f"mesh file '{mesh}' does not exist", "check the path")


def _modes_observed(body: Family, guess: Material, band_hz: tuple[float, float]) -> int:
    value, _ = body.modes(guess.youngs_pa / guess.density_kg_m3, guess.poisson)
    return int((np.sqrt(value) / (2 * np.pi) < band_hz[1]).sum())


def body_family(case: Case, thing: CaseObject, guess: Material, cache: Place) -> Family:
    """Return the family of a case's object. Raises FileError, MeshError."""
    margin = 1.36  # √(1.3/0.7): how far the guess may put a mode too high
    mesh_m = (2e-4, 5.0)  # bodies smaller or larger than this are in another unit
    shape = read_mesh(thing.mesh or "", thing.scale)
    across = float(np.linalg.norm(np.ptp(shape.vertex_m, axis=0)))
    if not mesh_m[0] < across < mesh_m[1]:
        raise MeshError(
            f"object '{thing.name}' is {across:.3g} m across",
            "give the mesh in metres, or say its unit (units: mm or cm in a case, --scale 0.001 or 0.01)"
            if thing.scale == 1
            else f"its mesh is scaled by {thing.scale:g}: leave --scale or units out where it is in metres",
        )
    gamma = guess.youngs_pa / guess.density_kg_m3
    high = case.band_hz[1]
    listed = [line.freq_hz for r in case.recordings if r.object == thing.name for line in r.lines or ()]
    if listed and not any(r.file for r in case.recordings):
        high = max(listed)
    return family(
        shape,
        gamma_m2_s2=gamma,
        poisson=guess.poisson,
        to_hz=high * margin,
        fixed=thing.fixed,
        cache=cache,
    )


def _strikes(
    recordings: tuple[CaseRecording, ...],
) -> list[tuple[tuple[float, float, float] | None, tuple[float, float, float] | None, float | None]]:
    return [(r.position_m, r.direction, r.impulse_n_s) for r in recordings]


def describe_observation(
    case: Case, thing: CaseObject, guess: Material, recordings: tuple[CaseRecording, ...], body: Family
) -> Observation:
    """How strikes of an object are observed by the case's sensor.

    Raises MeshError where a point lies off the surface.
    """
    at, along = (
        None if places is None else places.get(thing.name) for places in (case.sensor_m, case.sensor_direction)
    )
    return observation(body, guess.density_kg_m3, case.sensor, _strikes(recordings), at, along)


def recorded_signals(
    case: Case, thing: CaseObject, recordings: tuple[CaseRecording, ...], session_hum_hz: float = 0.0
) -> tuple[list[Array], int]:
    """Each take (n,) of an object from its onset to its own end, less its hum, and their rate.

    session_hum_hz: of the session's hum by other takes, 0 where it is not known. Raises FileError, AudioError.
    """
    found = [_sounds(case, thing, (r,), True, session_hum_hz) for r in recordings]
    return [one.signals[0] for one in found], found[0].sr


def _sounds(
    case: Case,
    thing: CaseObject,
    recordings: tuple[CaseRecording, ...],
    clipped: bool,
    session_hum_hz: float = 0.0,
) -> Sounds:
    """Read what is heard of an object's strikes. Raises FileError, AudioError."""
    if case.response_hz is not None:
        return _measured_responses(thing, recordings, case.response_hz)
    sounds, limited, noted, remarks, sr = _read_takes(case, thing, recordings, clipped)
    begun: list[int] = []
    later_hits = 0
    hit_again: list[bool] = []
    starts: list[int] = []
    late: list[int] = []
    known = None if case.onset_s is None else round(case.onset_s * sr)
    rise = round(LONGEST_RISE_S * sr)
    rough = [known if known is not None else onset_sample(sound, sr) for sound in limited]
    hums, hum_hz = find_session_hum(limited, sr, rough, session_hum_hz)
    limited = [sound - hum for sound, hum in zip(limited, hums, strict=True)]
    floor = session_floor(limited, sr, rough) if known is None else None
    for i, r in enumerate(recordings):
        clear = limited[i] if floor is None else without_loud_noise(limited[i], floor)
        one = span(clear, sr) if known is None else until_next_hit(clear, sr, known)
        hit_again.append(bool(one.later) and known is None)
        if one.later:
            later_hits += len(one.later)
            used = ": only what comes before the second is used" if known is None else ", all of which is used"
            remarks.append(f"{r.file} holds {one.describe_hits(sr)}{used}")
            if known is None:
                sounds[i], limited[i], hums[i], clear = (x[: one.stop] for x in (sounds[i], limited[i], hums[i], clear))
        begun.append(one.start)
        starts.append(known if known is not None else onset_sample(clear, sr))
        late.append(starts[-1] - one.start if known is None and one.start <= starts[-1] < one.start + rise else 0)
        starts[-1] -= late[-1]
        doubts, _ = describe_doubts(limited[i][one.start :], sr)
        noted[i] += [describe_hum(hum_hz) if hums[i].any() else "", *doubts]
    remarks += _shared_remarks(noted, recordings)
    lengths = [len(sound) - start for sound, start in zip(sounds, starts, strict=True)]
    kept = _long_enough(lengths, hit_again)
    length = min(lengths[i] for i in kept)
    refuse_short(length, sr, recordings[next(i for i in kept if lengths[i] == length)].file)
    remarks += [
        f"{recordings[i].file} goes for {lengths[i] / sr:.3g} s, the others of {thing.name} for "
        f"{length / sr:.3g} s and more: the lines are read without it (--split cuts takes)"
        for i in range(len(lengths))
        if i not in kept
    ]
    signals = np.stack([(sounds[i] - hums[i])[starts[i] : starts[i] + length] for i in kept])
    if case.onset_s is None and not hum_hz:
        signals, hum_hz = _without_hum_of_tails(signals, sr, session_hum_hz)
        remarks += [f"hum at {round(hum_hz)} Hz and its multiples is in all tails, and is taken off"] if hum_hz else []
    before = [
        float(x[first:start] @ x[first:start]) / max(float(x[first:] @ x[first:]), 1e-300)
        for x, first, start in ((limited[i], begun[i], starts[i]) for i in kept)
    ]
    return Sounds(
        signals, sr, remarks, before, None, tuple(kept), hum_hz, floor, tuple(late[i] for i in kept), later_hits
    )


def _read_takes(
    case: Case, thing: CaseObject, recordings: tuple[CaseRecording, ...], clipped: bool
) -> tuple[list[Array], list[Array], list[list[str]], list[str], int]:
    """Read takes in the case's band above and on both sides, what is noted of each and said of some, and their rate."""
    sounds, limited, rates, remarks = [], [], [], []
    noted: list[list[str]] = []
    for r in recordings:
        sound, sr, which = read_channel(r.file or "", r.channel)
        if not clipped:
            refuse_clipped(sound, r.file)
        whole = until_it_breaks_off(sound, sr)
        if len(whole) < len(sound):
            remarks.append(
                f"{r.file} breaks off after {len(whole) / sr:.3g} s: the digital silence behind is no "
                "decay, and is left out"
            )
        if case.band_hz[0] > LOWEST_AUDIBLE_HZ:
            drift = ""
            sounds.append(limit_band(whole, sr, (case.band_hz[0], np.inf)))
            limited.append(limit_band(whole, sr, case.band_hz))
        else:
            above, drift = without_drift(whole, sr)
            sounds.append(above)
            limited.append(above)
        rates.append(sr)
        noted.append([which, drift])
    if len(set(rates)) > 1:
        raise AudioError(f"recordings of {thing.name} have rates {sorted(set(rates))} Hz", "give files of one rate")
    return sounds, limited, noted, remarks, rates[0]


def _shared_remarks(noted: list[list[str]], recordings: tuple[CaseRecording, ...]) -> list[str]:
    """Say once what was noted of several recordings."""
    several: dict[str, list[str]] = {}
    for notes, r in zip(noted, recordings, strict=True):
        for words in filter(None, notes):
            several.setdefault(words, []).append(str(r.file))
    return [
        f"{names[0]}{f' and {len(names) - 1} more' * (len(names) > 1)}: {words}" for words, names in several.items()
    ]


def _long_enough(lengths: list[int], hit_again: list[bool]) -> list[int]:
    """List the takes that are long enough for the others, which are read no farther than the shortest.

    A much shorter one would cost them more than it gives; so would one that a second hit ends, by a tenth already.
    """
    shorter, shorter_by_a_hit = 0.5, 0.9  # of the usual length
    usual = float(np.median(lengths))
    least = [shorter_by_a_hit if again else shorter for again in hit_again]
    return [i for i, length in enumerate(lengths) if length >= least[i] * usual]


def _without_hum_of_tails(signals: Array, sr: int, known_hz: float) -> tuple[Array, float]:
    """Take off hum that tails (s, n) alone tell: of a room that nobody declared silent it is noise, and no effect."""
    hum = hum_of(signals, noise_rms(signals, sr), sr, known_hz)
    return (signals, 0.0) if hum is None else (subtract_hum(signals, sr, hum), hum.hz)


def _measured_responses(
    thing: CaseObject, recordings: tuple[CaseRecording, ...], measured_hz: tuple[float, float]
) -> Sounds:
    """Read frequency responses, of which each file is one period. Raises FileError, AudioError."""
    read = [read_channel(r.file or "", r.channel) for r in recordings]
    if len({(len(sound), sr) for sound, sr, _ in read}) > 1:
        raise AudioError(f"responses of {thing.name} have different lengths or rates", "give responses of one band")
    sr = read[0][1]
    spectra = [period_spectrum(sound, sr, measured_hz) for sound, _, _ in read]
    return Sounds(
        np.stack([since_impulse(sound, sr, measured_hz) for sound, _, _ in read]),
        sr,
        [f"{r.file}: {which}" for r, (_, _, which) in zip(recordings, read, strict=True) if which],
        [0.0] * len(read),
        Responses(np.stack([value for value, _ in spectra]), spectra[0][1]),
        tuple(range(len(read))),
    )


def until_it_breaks_off(sound: Array, sr: int) -> Array:
    """Return a recording (n,) without the digital silence that it is filled up with.

    A decay ends in its last bit or in noise, not far above.
    """
    # of a gate: what lies before it, and behind it at least; of the peak (16 bits end at 3e-5)
    shut_s, shut = 0.01, 1e-3
    observed = np.flatnonzero(sound)
    last, short = int(observed[-1]) + 1 if len(observed) else 0, max(1, round(shut_s * sr))
    end = sound[max(0, last - short) : last]
    return sound[:last] if 0 < last < len(sound) - short and np.abs(end).max() > shut * np.abs(sound).max() else sound


def onset_sample(sound: Array, sr: int) -> int:
    """Return the sample after which energy has arrived.

    The first of the millisecond in which the power rises the most over all before it, then its peak. A strike's pulse
    is over after its first peak, so lines are read from there.
    """
    block = max(1, sr // 1000)
    power = (sound[: len(sound) // block * block].reshape(-1, block) ** 2).mean(axis=1) + 1e-20
    peak = int(np.argmax(power))
    before = np.minimum.accumulate(power[: peak + 1][::-1])[::-1] if peak else power[:1]
    start = int(np.argmax(before > 0.05 * power[peak])) * block
    return start + int(np.argmax(np.abs(sound[start : start + 4 * block])))


def _read_listed(
    case: Case, thing: CaseObject, guess: Material, entry: CaseRecording, body: Family | None
) -> RecordedObject:
    """RecordedObject of a list of measured features: no phases, amplitudes where given."""
    items: tuple[Line, ...] = tuple(sorted(entry.lines or (), key=lambda line: line.freq_hz))
    freq = np.array([line.freq_hz for line in items])

    def column(values: list[float | None], missing: Array) -> Array:
        return np.array([m if v is None else v for v, m in zip(values, missing, strict=True)])

    nothing = np.full(len(items), np.nan)
    decay = column([line.decay_per_s for line in items], nothing)
    amplitude = column([line.amplitude for line in items], nothing)[None, :]
    freq_sd = column([line.freq_sd_hz for line in items], 1e-4 * freq)
    decay_sd = column([line.decay_sd_per_s for line in items], 0.05 * decay)
    lines = Lines(
        freq,
        decay,
        amplitude.astype(complex),
        freq_sd,
        decay_sd,
        np.abs(amplitude) * 0.1,
        np.array([np.nan]),
        np.full(len(items), 1e3),
        False,
    )
    seen = describe_observation(case, thing, guess, (entry,), body) if body is not None else None
    return RecordedObject(thing, guess, (entry,), lines, body, seen, None, 0)
