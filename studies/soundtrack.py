"""Films and stems measured: do pictures and sound keep one clock, what do they cost, do stems add up?

.venv/bin/python studies/soundtrack.py clicks [MINUTES] [mp4/aac mov/pcm mkv/flac mkv/opus mp4/mp3]
    a click planted at an early frame and at one after MINUTES (10), at six rates: samples off, by decoding
.venv/bin/python studies/soundtrack.py stems [SCENE ...]
    the mix less the sum of its stems, in memory and in float32 files; time of all stems over the mix
.venv/bin/python studies/soundtrack.py film [LOG.npz]
    5 s of the table-top at 1280x720, 60 a second, with sound, from its log: wall and processor time over real time
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from sonic_bullet.apps.soundtrack.film import FilmLook, make_film
from sonic_bullet.apps.soundtrack.film_writer import samples_of
from sonic_bullet.apps.soundtrack.stems import render_stems, write_stems
from sonic_bullet.engine.runtime.replay import render_kept
from sonic_bullet.files import read_audio, read_log, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Array
from tests.made.films import write_film

FORMATS = ("mp4/aac", "mov/pcm", "mkv/flac", "mkv/opus", "mp4/mp3")
RATES = (Fraction(24), Fraction(25), Fraction(30000, 1001), Fraction(30), Fraction(60), Fraction(240))
SR, SIDE = 48_000, 16
PULSE = np.hanning(13)[1:-1]
SCENES = ("bar", "drop", "robot_arm", "rolling", "sliding", "tabletop")
EARLY = 7


def clicks(minutes: float, formats: list[str]) -> None:
    print("| format | fps | early, samples off | late, samples off | pictures off | samples after the last picture |")
    for form in formats:
        for fps in RATES:
            late = int(minutes * 60 * fps) + EARLY
            print(f"| {form} | {fps} | {' | '.join(map(str, click_errors(form, fps, late)))} |", flush=True)


def click_errors(form: str, fps: Fraction, late: int) -> tuple[int, int, int, int]:
    """Samples that each click is off, pictures that are not where they should be, and samples too many."""
    ending, codec = form.split("/")
    count = late + int(fps) // 2
    frames = samples_of(count, fps, SR)
    sound, half = np.zeros((1, frames)), len(PULSE) // 2
    places = [samples_of(at, fps, SR) for at in (EARLY, late)]
    for place in places:
        sound[0, place - half : place + half + 1] = 0.8 * PULSE
    dark, light = np.zeros((SIDE, SIDE, 3), np.uint8), np.full((SIDE, SIDE, 3), 255, np.uint8)
    pictures = (light if k in (EARLY, late) else dark for k in range(count))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x.{ending}"
        write_film(path, pictures, KeptSound.of(sound), SR, fps=fps, size=(SIDE, SIDE), codec=codec)
        heard = decoded_sound(path)
        bright = [k for k, level in enumerate(levels(path)) if level > 128]
    off = [click_at(heard, place) - place for place in places]
    return off[0], off[1], len(set(bright) ^ {EARLY, late}), len(heard) - frames


def click_at(sound: Array, near: int) -> int:
    start = max(near - SR // 4, 0)
    return start + int(np.argmax(np.correlate(sound[start : near + SR // 4], PULSE, "same")))


def decoded_sound(path: Path) -> Array:
    """The sound from the container's time 0 on."""
    import av

    parts: list[Array] = []
    first = 0
    with av.open(str(path)) as file:
        for frame in file.decode(audio=0):
            if not parts and frame.pts is not None:
                first = round(frame.pts * frame.time_base * SR)
            samples = frame.to_ndarray().ravel()
            parts.append((samples / 2**31 if frame.format.name.startswith("s32") else samples).astype(np.float32))
    return np.concatenate([np.zeros(max(first, 0), np.float32), *parts])[max(-first, 0) :]


def levels(path: Path) -> Iterator[float]:
    import av

    with av.open(str(path)) as file:
        for frame in file.decode(video=0):
            yield float(frame.to_ndarray(format="gray").mean())


def stems(scenes: list[str]) -> None:
    print("| scene | stems | mix - sum, over its peak | in float32 files, over 2^-23 x stems | time over the mix |")
    for name in scenes:
        log = scene_log(name.removesuffix("+residual"))
        if name.endswith("+residual"):
            log = with_residuals(log)
        print(f"| {name} | {' | '.join(stem_row(log))} |", flush=True)


def scene_log(name: str) -> ContactLog:
    from sonic_bullet.scene import render_scene

    return render_scene(Path(__file__).parents[1] / "scenes" / f"{name}.py").log


def with_residuals(log: ContactLog) -> ContactLog:
    """The log with noise beside the modes of every material."""
    from sonic_bullet.records import Residual

    freq, time_s = np.linspace(0, 24_000, 200), np.linspace(0, 0.5, 100)
    power = 1e-7 * np.exp(-20 * time_s)[None] * np.ones((200, 1))
    source = np.geomspace(200, 12_000, 12), np.full(12, 20.0), np.ones(12)
    none = np.zeros(0)
    residual = Residual(*source, none, none, none, freq, time_s, power, 1.0, "made")
    bodies = tuple(
        body if body.material is None else replace(body, material=replace(body.material, residual=residual))
        for body in log.bodies
    )
    return replace(log, bodies=bodies, residual=True)


def stem_row(log: ContactLog) -> tuple[str, ...]:
    render_kept(log), render_stems(log)  # compiled, and read from the disk
    spent = []
    for work in (render_kept, render_stems):
        best = np.inf
        for _ in range(3):
            begin = time.process_time()
            work(log)
            best = min(best, time.process_time() - begin)
        spent.append(best)
    mix, made = render_kept(log), render_stems(log)
    whole = mix.samples()
    peak = float(np.abs(whole).max())
    error = float(np.abs(sum(stem.sound.samples() for stem in made) - whole).max()) / peak
    with tempfile.TemporaryDirectory() as folder:
        report = write_audio(Path(folder) / "mix.wav", mix, log.sr, peak_dbfs=-1)
        reports = list(write_stems(Path(folder) / "stems", made, log.sr, gain_per_pa=report.gain_per_pa))
        sounds = [read_audio(one.path)[0] for one in reports]
        read = read_audio(Path(folder) / "mix.wav")[0]
    files = float(np.abs(np.sum(sounds, axis=0) - read).max()) / float(np.abs(read).max())
    return str(len(made)), f"{error:.1e}", f"{files / (2**-23 * len(made)):.2f}", f"{spent[1] / spent[0]:.2f}"


def film(path: str | None) -> None:
    log = read_log(path) if path else scene_log("tabletop")
    for shadows in (False, True):
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        mine = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            look = FilmLook(fps=Fraction(60), shadows=shadows)
            report = make_film(Path(folder) / "x.mp4", log, render_kept(log), log.sr, look=look, peak_dbfs=-1)
        wall = time.perf_counter() - begin
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = time.process_time() - mine + after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        length = float(report.pictures / report.fps)
        words = "with shadows" if shadows else "without shadows"
        print(f"{words}: {wall / length:.2f} x real time (wall), {spent / length:.2f} (processor, all processes)")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["clicks", *rest]:
            numbers = [word for word in rest if "/" not in word]
            clicks(float(numbers[0]) if numbers else 10.0, [word for word in rest if "/" in word] or list(FORMATS))
        case ["stems", *rest]:
            stems(rest or [*SCENES, "tabletop+residual"])
        case ["film", *rest]:
            film(rest[0] if rest else None)
        case _:
            sys.exit(__doc__)
