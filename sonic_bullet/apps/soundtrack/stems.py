"""Stems: a sound a body, of the same contacts as the mix, whose sum it is.

    ContactLog -> render_per_body -> (b, channels, n) -> a KeptSound a body -> NN-NAME.wav, all with the mix's gain

A body without a model is silent and has no stem. The sum over all stems is the mix to rounding, of double numbers in
memory and of 32-bit ones in files.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sonic_bullet.engine.path.room.room_convolution import keep_with_room
from sonic_bullet.engine.path.room.room_plan import RoomPlan
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.synthesis_state import StepObserver
from sonic_bullet.files import AudioReport, cannot, write_at_level
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import FileLevel, find_level
from sonic_bullet.files.loudness.meter import measure_loudness
from sonic_bullet.files.storage.spooled_sound import KeptSound, SoundSpool
from sonic_bullet.records import channels_of
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.errors import AudioError


@dataclass(frozen=True, slots=True, eq=False)
class Stem:
    """Stem of one body of a log: its index there, its file's name, its sound (channels, n) in pascals."""

    index: int
    name: str
    sound: KeptSound


def render_stems(
    log: ContactLog,
    *,
    sr: int | None = None,
    frames: int | None = None,
    observer: StepObserver | None = None,
    plan: RoomPlan | None = None,
) -> tuple[Stem, ...]:
    """Render the sound of every body with a model, all in one run; the sum is `render_log`'s.

    Beyond a few seconds it lies in nameless temporary files. Arguments, errors: as of `render_per_body`, and plan of
    the room around it; AudioError where there is no microphone.
    """
    if not log.sensors:
        raise AudioError("there is no microphone, so there is no stem", "give one, such as --microphone 0,-1,0.5")
    who = [index for index, body in enumerate(log.bodies) if body.model is not None and not body.model.unsolved]
    sounding = log if plan is None else replace(log, sensors=plan.sensors)
    spools = {index: SoundSpool(channels_of(log.sensors) if plan is None else len(plan.mixing)) for index in who}
    for body, frame in render_per_body(sounding, sr=sr, frames=frames, observer=observer, room=plan):
        there = dict(zip(body.tolist(), frame, strict=True))
        nothing = np.zeros(frame.shape[1:])
        for index, spool in spools.items():
            spool.add(there.get(index, nothing))
    sounds = {index: spool.finish() for index, spool in spools.items()}
    if plan is not None:
        sounds = {index: keep_with_room(plan, sound) for index, sound in sounds.items()}
    return tuple(Stem(index, stem_name(index, log.bodies[index].name), sounds[index]) for index in who)


def stem_name(index: int, name: str) -> str:
    """Make a file's name, without ending, of a body's: its number in the log, and letters that file systems take."""
    plain = re.sub(r"[^\w-]+", "_", name.encode("utf-8", "replace").decode()).strip("_")
    # characters of a body's name that its file keeps: 255 bytes hold them in any script, with number and ending
    name_length = 60
    return f"{index:02d}-{plain[:name_length] or 'body'}"


def write_stems(
    folder: str | os.PathLike[str],
    stems: Sequence[Stem],
    sr: int,
    *,
    gain_per_pa: float = 1.0,
    peak_dbfs: float | None = None,
    lufs: float | None = None,
    cues: Callable[[int], Sequence[Cue]] | None = None,
    time_reference: int = 0,
) -> Iterator[AudioReport]:
    """Write a float32 WAV a stem into a folder, made where it is missing, one after another; each whole or not at all.

    Parameters
    ----------
    gain_per_pa
        Of all, so that they add up.
    peak_dbfs, lufs
        Each to its own level instead; silent ones, or too short or faint for a loudness, stay as they are.
    cues
        A stem's own, by its body's index.

    Raises
    ------
    FileError, AudioError
    """
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot("make the folder", folder, error) from error
    for stem in stems:
        level = _own_level(stem.sound, sr, peak_dbfs, lufs) or FileLevel(gain_per_pa, stem.sound.curve)
        place_to, own_cues = place / f"{stem.name}.wav", None if cues is None else cues(stem.index)
        report = write_at_level(place_to, stem.sound, sr, level, cues=own_cues, time_reference=time_reference)
        yield replace(report, loudness=measure_loudness(stem.sound.with_curve(level.curve), sr, level.gain_per_pa))


def _own_level(sound: KeptSound, sr: int, peak_dbfs: float | None, lufs: float | None) -> FileLevel | None:
    """Find the level asked for, None where it cannot be reached or none is asked for."""
    if peak_dbfs is None and lufs is None:
        return None
    try:
        return find_level(sound, sr, peak_dbfs, lufs, 1.0)
    except AudioError:
        return None
