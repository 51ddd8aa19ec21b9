"""A film of a log: its poses drawn, its sound beside them, on one clock (film_writer.py).

ContactLog, KeptSound -> Staging (poses at k/fps) -> pictures, by two processes -> FilmWriter -> NAME.mp4
    + events -> drawn into each picture (overlay.py)
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from sonic_bullet.apps.soundtrack.film_writer import FilmWriter, check_film_output, check_size, pictures_of, samples_of
from sonic_bullet.apps.soundtrack.overlay import shown_at, with_contacts
from sonic_bullet.apps.soundtrack.staging import Staging, chosen_camera, duration_of, stage_log
from sonic_bullet.engine.runtime.sound_events import SoundEvent, touching_pairs
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import FileLevel, find_level
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.parallel import arrays_in_order
from sonic_bullet.machine.progress import report_fraction, show_progress
from sonic_bullet.options.audio import FileLevelOptions
from sonic_bullet.options.film import FilmLook
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import nearest
from sonic_bullet.records.errors import AudioError, SceneError
from sonic_bullet.simulators.pictures import Camera, PlacedLink, open_pictures

__all__ = ["FilmLook", "FilmReport", "make_film", "pictures_in"]


@dataclass(frozen=True, slots=True)
class FilmReport:
    """What was made: pictures, samples and how loud they are."""

    path: str
    pictures: int
    fps: Fraction
    size: tuple[int, int]
    samples: int
    sr: int
    channels: int
    codec: str
    gain_per_pa: float
    clipped: int
    notes: tuple[str, ...]


def pictures_in(log: ContactLog, fps: Fraction, seconds: float | None = None) -> int:
    """Count the pictures of a film of a log: the last one begins before its end.

    Raises AudioError where it is to be longer than the log, or the log has no step.
    """
    lasts = duration_of(log)
    if not lasts:
        raise AudioError("there is no physics step to film", "simulate the scene first")
    if seconds is not None and seconds > float(lasts) + 1e-9:
        raise AudioError(
            f"a film of {seconds:g} s is longer than its sound, {float(lasts):.3f} s",
            "give fewer seconds, or simulate for longer",
        )
    wanted = lasts if seconds is None else min(lasts, Fraction(seconds).limit_denominator(1_000_000))
    return max(math.ceil(wanted * fps), 1)


@show_progress(in_percent=True)
def make_film(
    path: str | os.PathLike[str],
    log: ContactLog,
    sound: KeptSound,
    sr: int,
    *,
    look: FilmLook | None = None,
    seconds: float | None = None,
    standing: Sequence[PlacedLink] = (),
    events: Sequence[SoundEvent] | None = None,
    codec: str | None = None,
    peak_dbfs: float | None = None,
    lufs: float | None = None,
    level: FileLevel | None = None,
) -> FilmReport:
    """Make a film of a log with its sound (channels, n) in pascals, whole or not at all; two processes draw.

    Where the sound is longer than the log, the last picture stays.

    Parameters
    ----------
    standing
        Shapes of the scene's world, where it is there.
    events
        Drawn in, where they are given.
    codec
        Of the sound, None: the container's usual one.
    level
        Found before, in place of peak_dbfs and lufs.

    Raises
    ------
    FileError, AudioError, SceneError
        Stopped or failed under way, the error names the film that is finished so far.
    """
    look = FilmLook() if look is None else look
    check_film_output(path, sr, sound.shape[0], codec)
    check_size(look.size)
    FileLevelOptions(peak_dbfs=peak_dbfs, lufs=lufs)  # refuses what cannot be
    count = pictures_in(log, look.fps, seconds)
    if sound.shape[1] > math.floor(duration_of(log) * sr):  # it rings on: the last picture stays
        count = max(count, pictures_of(sound.shape[1], look.fps, sr))
    level = level or find_level(sound, sr, peak_dbfs, lufs, 1.0)
    gain, sound = level.gain_per_pa, sound.with_curve(level.curve)
    staging = stage_log(log, look.fps, count, standing)
    cameras = _cameras(log, staging, look)
    touching = None if events is None else _find_touching_pairs(log, staging)
    still = staging.still if len(cameras) == 1 else None
    drawer = open_pictures(staging.meshes, look.size, shadows=look.shadows, still=still)

    def draw(k: int) -> Array:
        camera = cameras[k] if len(cameras) > 1 else cameras[0]
        made = drawer.picture(staging.position_m[k], staging.quaternion_xyzw[k], staging.shown[k], camera)
        if events is None or touching is None:
            return made
        time_s = float(k / look.fps)
        return with_contacts(made, shown_at(events, time_s), touching[k], log, time_s, camera)

    width, height = look.size
    try:
        with FilmWriter(
            path, sound, sr, fps=look.fps, size=look.size, codec=codec, gain_per_pa=gain, pictures=count
        ) as film:
            for picture in arrays_in_order(draw, count, (height, width, 3), np.uint8):
                film.write(picture)
                report_fraction(film.pictures / count)
    finally:
        drawer.close()
    return FilmReport(
        film.path, count, look.fps, look.size, samples_of(count, look.fps, sr), sr, sound.shape[0], film.codec, gain,
        film.clipped, staging.notes,
    )  # fmt: skip


def _cameras(log: ContactLog, staging: Staging, look: FilmLook) -> list[Camera]:
    """Return one camera, or one a picture where it follows a body. Raises SceneError where there is no such body."""
    first = chosen_camera(log, staging, look.eye_m, look.target_m)
    if look.follow is None:
        return [first]
    names = [log.bodies[i].name if i >= 0 else "" for i in staging.body]
    if look.follow not in names:
        raise SceneError(f"no body called {look.follow!r} is drawn", nearest(look.follow, sorted({*names} - {""})))
    path = staging.position_m[:, names.index(look.follow)]
    off = first.eye_m - first.target_m
    return [replace(first, eye_m=place + off, target_m=place) for place in path]


def _find_touching_pairs(log: ContactLog, staging: Staging) -> list[dict[tuple[int, int], object]]:
    """Return where pairs touch, for each picture."""
    found: list[dict[tuple[int, int], object]] = []
    for number, step in enumerate(log.steps):
        while len(found) < len(staging.step) and staging.step[len(found)] == number:
            found.append(dict(touching_pairs(step)))
    return found
