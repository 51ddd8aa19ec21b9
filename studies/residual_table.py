"""Does the residual bring the sound nearer to recordings that were not fitted?

`python studies/residual_table.py [practice] [measured] [NAME …]`

Practice cases: fit and residual from the 'fit' strikes, judged on 'holdout' strikes, at the amplitudes that the fitted
model predicts. Measured objects with two recordings or more have no mesh: their features stand in for modes. Modes are
the damped sinusoids that the first half of the strikes share, with the mean of their amplitudes; a strike of the second
half is predicted by them at the strike's own level (one gain a strike, the same with and without the residual).
Distance: `signal.log_spectral.log_spectral_db` (dB, cells 10 dB above the recording's noise), each prediction
given that noise; with the residual, the mean over three grains of its noise.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sonic_bullet.engine.residual.offline import residual_sound, synthesize_lines
from sonic_bullet.files import read_audio, read_channel
from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.material_fit import CaseFit, fit_case
from sonic_bullet.lab.fit.prediction_of_lines import lines_sound, strike_modes
from sonic_bullet.lab.fit.recorded import onset_sample
from sonic_bullet.lab.lines.joint_lines import joint_lines
from sonic_bullet.lab.residual.recorded_strikes import Strikes, case_strikes, strikes_of
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.signal.log_spectral import Floor, floor_of, log_spectral_db, noise_floor_db, with_noise

SHARED = Path(os.environ.get("SONIC_BULLET_SHARED", Path(__file__).resolve().parents[2] / "shared"))
SECONDS = 1.0
LEAST_S = 0.2
MOST = 3  # strikes fitted, and strikes judged, of one object
BEFORE_S = 0.02
GRAINS = 3

Row = tuple[str, float, float, float]


def judged(name: str, sound: Array, sr: int, modes: tuple[Array, Array, Array], strikes: Strikes, floor: Floor) -> Row:
    """Distances without and with the residual, and of the noise alone."""
    plain = synthesize_lines(*modes, len(sound), sr)
    grains = [residual_sound(strikes.residual, *modes, len(sound), sr, seed) for seed in range(GRAINS)]
    without, *beside = (
        log_spectral_db(sound, with_noise(plain + x, floor, 1), floor) for x in (np.zeros(len(sound)), *grains)
    )
    return name, without, float(np.mean(beside)), noise_floor_db(plain, floor)


def of_case(folder: Path) -> Iterator[Row]:
    """Held-out strikes of a practice case."""
    found: CaseFit = fit_case(read_case(folder))
    strikes = case_strikes(found)
    floor = Floor(np.mean([floor_of(x).variance for x in strikes.left], axis=0))
    for recording in found.case.recordings:
        if (
            recording.split == "holdout"
            and recording.file is not None
            and recording.object == found.objects[0].evidence.thing.name
        ):
            sound, sr, _ = read_channel(recording.file, recording.channel)
            yield judged(
                f"{folder.name} {recording.file.stem}",
                sound,
                sr,
                strike_modes(found, recording, sr),
                strikes,
                floor,
            )


def of_object(name: str, sounds: list[Array], sr: int) -> Iterator[Row]:
    """The second half of an object's strikes, by what the first half says."""
    count = min(*(len(x) for x in sounds), round(SECONDS * sr))
    fitted, held = sounds[: max(1, min(MOST, len(sounds) // 2))], sounds[len(sounds) // 2 :][:MOST]
    signals = np.stack([x[:count] for x in fitted])
    lines = joint_lines(signals, sr, signed=False)
    left = np.stack([x - lines_sound(lines, i, count, sr) for i, x in enumerate(signals)])
    decay, size = np.nan_to_num(lines.decay_per_s), np.abs(lines.amplitude)
    level = np.sqrt((size**2).sum(axis=1))
    mean = np.sqrt(((size / level[:, None]) ** 2).mean(axis=0)) * np.exp(1j * np.angle(lines.amplitude[0]))
    strikes = strikes_of(
        signals, left, sr, (lines.freq_hz, decay, lines.amplitude), (lines.freq_hz, decay, level[:, None] * mean), name
    )
    floor = Floor(np.mean([floor_of(x).variance for x in left], axis=0))
    base = synthesize_lines(lines.freq_hz, decay, mean, count, sr)
    noise = float(floor.variance.mean()) * count
    for i, sound in enumerate(held):
        gain = np.sqrt(max(float((sound[:count] ** 2).sum()) - noise, 0.0) / float((base**2).sum()))
        yield judged(f"{name} {i + 1}", sound[:count], sr, (lines.freq_hz, decay, gain * mean), strikes, floor)


def measured() -> Iterator[tuple[str, list[Array], int]]:
    """Objects with two strikes or more: name, strikes from their onsets on, rate."""
    root = SHARED / "measured"
    for folder in sorted(x for x in root.iterdir() if (x / "case.json").is_file()):
        groups: dict[str, list[Array]] = {}
        rate = 0
        for entry in json.loads((folder / "case.json").read_text()).get("files", []):
            if (
                not isinstance(entry, dict)
                or not entry.get("file", "").endswith((".flac", ".npz"))
                or not (folder / entry["file"]).is_file()
            ):
                continue
            name = next(
                (str(entry[key]) for key in ("object", "specimen", "bell", "stroke", "bar") if key in entry),
                entry["file"],
            )
            name = f"{folder.name}: {name.split('(')[0].strip()}" + (f", {entry['tool']}" if "tool" in entry else "")
            if entry["file"].endswith(".npz"):
                with np.load(folder / entry["file"]) as data:
                    groups.setdefault(f"{folder.name}: part", []).extend(
                        _from_onset(x - x.mean(), 25600) for x in data["accel"]
                    )
                rate = 25600
                continue
            sound, rate = read_audio(folder / entry["file"])
            hits = [h["t_hit_s"] for h in entry.get("hits", [])] or [entry.get("t_hit_s", 0.0)]
            ends = [*hits[1:], len(sound[0]) / rate + BEFORE_S]
            for begin, end in zip(hits, ends, strict=True):
                part = sound[0, max(0, round((begin - BEFORE_S) * rate)) : round((end - BEFORE_S) * rate)]
                groups.setdefault(name, []).append(_from_onset(part, rate))
        for name, sounds in groups.items():
            long = [x for x in sounds if len(x) >= LEAST_S * rate]
            if len(long) > 1:
                yield name, long, rate


def _from_onset(sound: Array, sr: int) -> Array:
    return sound[onset_sample(sound[: round(0.2 * sr)], sr) :]


def main(words: list[str]) -> int:
    """Print the table; 1 where a row is farther than it may be."""
    kinds = {w for w in words if w in ("practice", "measured")} or {"practice", "measured"}
    names = [w for w in words if w not in ("practice", "measured")]
    bad = count = 0
    print(f"{'strike that was not fitted':48s} {'modal':>7s} {'+ residual':>10s} {'nearer':>7s} {'noise':>6s}")

    def told(rows: Iterator[Row], most: float, begun: float) -> None:
        nonlocal bad, count
        got = list(rows)
        for name, without, beside, noise in got:
            print(f"{name:48s} {without:7.2f} {beside:10.2f} {without - beside:7.2f} {noise:6.2f}")
        change = float(np.mean([beside - without for _, without, beside, _ in got]))
        count, bad = count + 1, bad + (not change < most)
        print(
            f"{'':14s}mean {-change:.2f} dB nearer; {time.process_time() - begun:.1f} s of processor time", flush=True
        )

    if "practice" in kinds:
        for folder in sorted((SHARED / "practice").glob("practice-*")):
            if not names or any(n in folder.name for n in names):
                told(of_case(folder), 0.1 if folder.name.endswith("01") else 0.0, time.process_time())
    if "measured" in kinds:
        for name, sounds, sr in measured():
            if not names or any(n in name for n in names):
                try:
                    told(of_object(name, sounds, sr), 0.0, time.process_time())
                except SonicBulletError as error:
                    bad += 1
                    print(f"{name}: {error}")
    print(f"{count} objects, {bad} farther than they may be")
    return 1 if bad or not count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
