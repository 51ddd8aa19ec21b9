"""Does every scene do and sound as the measurements beside it say? A line a claim; exit 1 where one fails.

    python benchmarks/scene_all.py [NAME …]

scenes/NAME.json -> `claims` -> (claim, measured, low, high). Each measurement is a range [low, high] under its name;
    "why" says where it comes from.

    first_strike_s, strikes         of all sounding bodies, as `load_leaps.find_leaps` finds them
    peak_db_spl                     20 log10(peak / 20 µPa) over all channels
    sound_j
        Σp² 4πr²/(ρ₀c sr): energy that left as sound, r from the origin to the first microphone
    moves_m: {body: range}          how far it got from its first place
    lowest_m                        the lowest place of any body: what falls off the table falls far
    silent_bodies
        sounding bodies that nothing ever touched after the first 0.1 s, or without a contact at all
    end_below_db                    how far the last 0.1 s lies below the loudest 0.1 s
    strongest_hz                    the highest line of the whole spectrum
    line_below_db: {hz: range}      how far the highest line within 2 % of hz lies below the strongest
    step_db: {before, after, range} level of one span of time over another's
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.load_leaps import find_leaps
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone
from sonic_bullet.scene import RenderResult, render_scene

SCENES = Path(__file__).resolve().parents[1] / "scenes"
Claim = tuple[str, float, float, float]


def expected(name: str) -> dict[str, Any]:
    """What scenes/NAME.json says."""
    found: dict[str, Any] = json.loads((SCENES / f"{name}.json").read_text(encoding="utf-8"))
    return found


def rms_db(samples: Array, sr: int, begin_s: float, end_s: float) -> float:
    """Level in dB SPL between two times."""
    part = samples[:, int(begin_s * sr) : int(end_s * sr)]
    return float(10 * np.log10(np.mean(part**2) / 4e-10 + 1e-30))


def places(log: ContactLog) -> Array:
    """(steps, bodies, 3) of the bodies known from the start: all that were added are."""
    count = len(log.steps[0].position_m)
    return np.array([step.position_m[:count] for step in log.steps])


def untouched(log: ContactLog) -> int:
    """How many sounding bodies nothing touched."""
    touched = set(log.rows.a.tolist()) | set(log.rows.b.tolist())
    return sum(body.model is not None and i not in touched for i, body in enumerate(log.bodies))


def claims(result: RenderResult, told: dict[str, Any]) -> Iterator[Claim]:
    """Each measurement that the scene promises, as it is and as it should be."""
    samples, log, sr = result.samples, result.log, result.sr
    seconds = samples.shape[1] / sr
    events = find_leaps(log)
    freq = np.fft.rfftfreq(samples.shape[1], 1 / sr)
    size = np.abs(np.fft.rfft(samples, axis=1)).max(axis=0)
    simple = {
        "first_strike_s": lambda: float(events.strike_s.min(initial=np.inf)),
        "strikes": lambda: float(len(events.strike_s)),
        "peak_db_spl": lambda: float(20 * np.log10(np.abs(samples).max() / 2e-5)),
        "sound_j": lambda: _sound_j(result),
        "lowest_m": lambda: float(places(log)[..., 2].min()),
        "silent_bodies": lambda: float(untouched(log)),
        "end_below_db": lambda: (
            max(rms_db(samples, sr, t, t + 0.1) for t in np.arange(0, seconds - 0.1, 0.05))
            - rms_db(samples, sr, seconds - 0.1, seconds)
        ),
        "strongest_hz": lambda: float(freq[np.argmax(size)]),
    }
    for name, measure in simple.items():
        if name in told:
            yield name, measure(), *told[name]
    for body, span in told.get("moves_m", {}).items():
        index = next(i for i, b in enumerate(log.bodies) if b.body_id == int(body) and b.model is not None)
        path = places(log)[:, index]
        yield f"moves_m {body}", float(np.linalg.norm(path - path[0], axis=1).max()), *span
    for hz, span in told.get("line_below_db", {}).items():
        near = np.abs(freq / float(hz) - 1) < 0.02
        yield f"line_below_db {hz}", float(20 * np.log10(size.max() / max(size[near].max(), 1e-300))), *span
    if "step_db" in told:
        step = told["step_db"]
        yield "step_db", rms_db(samples, sr, *step["after"]) - rms_db(samples, sr, *step["before"]), *step["range"]


def _sound_j(result: RenderResult) -> float:
    sensor = result.log.sensors[0]
    if not isinstance(sensor, Microphone):
        raise TypeError("the first sensor is no microphone")
    air = result.log.air
    intensity = np.sum(result.samples[0] ** 2) / result.sr / (air.density_kg_m3 * air.sound_speed_m_s)
    return float(intensity * 4 * np.pi * np.sum(np.square(sensor.position_m)))


def holds(claim: Claim) -> bool:
    """Whether the measured value lies in its range."""
    _, value, low, high = claim
    return bool(low <= value <= high)


def main(names: list[str]) -> int:
    failed = 0
    for name in names or sorted(path.stem for path in SCENES.glob("*.json")):
        begin = time.perf_counter()
        found = list(claims(render_scene(SCENES / f"{name}.py"), expected(name)))
        for claim in found:
            print(
                f"{'ok  ' if holds(claim) else 'FAIL'} {name:10s} {claim[0]:22s} {claim[1]:12.4g}   in "
                f"{claim[2]:g} … {claim[3]:g}"
            )
        failed += sum(not holds(claim) for claim in found)
        print(f"     {name:10s} {len(found)} claims in {time.perf_counter() - begin:.1f} s")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
