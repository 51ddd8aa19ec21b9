"""How long real things ring: T60 by octave of every measured body of the sets, each body once.

    python -m benchmarks.measured_decays --data ../shared/measured [--out TABLE.csv] [--work FOLDER] [BODY ...]

takes -> what rings after the attack, of all takes of a body together (lab/lines/after_attack.py)
    -> lines that decay by three of their spreads
    -> those that ring: 20 ms after the onset still FAINTEST of the loudest one
    -> median T60 in each octave of OCTAVES_HZ, by the energy that is left after 20 ms -> docs/measured/decays.csv

In the attack lie the striker, the pulse and the room; lines fitted there cancel one another. So a line counts by what
of it is left after the attack, A² e^{-2dt}/2d.

Bodies of which the sets hold numbers alone bring their own lines. TDW's classes of size are rows of the kind "class":
nobody says which body stands behind one. What was read of a take stays in FOLDER, and is not read again.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile

from benchmarks.decay_objects import DecayLine, MeasuredBody, measured_bodies, size_classes
from benchmarks.measured import Piece
from benchmarks.recorded_presets import STANDARD_ERRORS
from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.lab.lines.band_limit import without_drift
from sonic_bullet.lab.lines.extraction import ATTACK_S
from sonic_bullet.lab.lines.joint_lines import HIGHEST_OF_RATE
from sonic_bullet.lab.lines.onset import span
from sonic_bullet.lab.lines.standing_hum import find_standing_hum
from sonic_bullet.records import Array

OCTAVES_HZ = (250, 500, 1000, 2000, 4000, 8000)
FAINTEST = 0.01
"""Of the loudest line after the attack: what is fainter is mostly hum, the room or the neighbour of a line."""
TABLE = Path("docs/measured/decays.csv")
COLUMNS = ("body", "material", "kind", "set", "octave_hz", "lines", "t60_s")


@dataclass(frozen=True, slots=True)
class MeasuredDecay:
    """T60 of a body in an octave. kind: "body", or "class" where nobody says which body it is."""

    body: str
    material: str
    kind: str
    set: str
    octave_hz: int
    lines: int
    t60_s: float


def octave_of(freq_hz: float) -> int | None:
    """Return the octave's centre that holds a frequency [IEC 61260-1, base two], None outside."""
    return next((c for c in OCTAVES_HZ if c / np.sqrt(2) <= freq_hz < c * np.sqrt(2)), None)


def impact_of(piece: Piece) -> tuple[Array, int]:
    """Read a take from its onset (n,) to the next hit, without hum, and its rate."""
    file, start_s, stop_s = piece
    sound, sr = soundfile.read(file, always_2d=True)
    signal, _ = without_drift(np.ascontiguousarray(sound[max(0, round(start_s * sr)) : round(stop_s * sr), 0]), sr)
    found = span(signal, sr)
    hum, _ = find_standing_hum(signal, sr, found.start)
    return (signal - hum)[found.start : found.stop], sr


def lines_of_takes(takes: Sequence[Piece]) -> list[DecayLine]:
    """Read the lines that ring in all takes of a body, and decay."""
    heard = [impact_of(piece) for piece in takes]
    sr, count = heard[0][1], min(len(signal) for signal, _ in heard)
    signals = np.array([signal[:count] for signal, _ in heard])
    found = ringing_lines(signals, sr, (100.0, min(12_000.0, HIGHEST_OF_RATE * sr)), signed=False)
    decays = found.decay_per_s >= STANDARD_ERRORS * found.decay_sd_per_s
    size = np.sqrt((np.abs(found.amplitude[:, decays]) ** 2).mean(axis=0))
    columns = (found.freq_hz[decays], np.log(1000) / found.decay_per_s[decays], size)
    return [(float(f), float(t), float(a)) for f, t, a in zip(*columns, strict=True)]


def lines_of_body(body: MeasuredBody, work: Path | None) -> list[DecayLine]:
    """Return all lines of a body; of takes as they were read before, if they were."""
    if not body.takes:
        return list(body.lines)
    kept = None if work is None else work / f"{body.name}.json".replace(" ", "-")
    if kept is not None and kept.is_file():
        return [(f, t, a) for f, t, a in json.loads(kept.read_text())]
    lines = lines_of_takes(body.takes)
    if kept is not None:
        kept.write_text(json.dumps(lines))
    return lines


def by_octave(lines: Iterable[DecayLine]) -> dict[int, tuple[float, int]]:
    """Compute T60 by octave, the median over lines by their energy after the attack, and how many lines those are."""
    table = np.array([line for line in lines if line[1] > 0], float).reshape(-1, 3)
    decay = np.log(1000) / table[:, 1]
    left = table[:, 2] * np.exp(-decay * ATTACK_S)
    rings = left >= FAINTEST * left.max(initial=0.0)
    found = {}
    for octave in OCTAVES_HZ:
        mine = np.flatnonzero(rings & np.array([octave_of(f) == octave for f in table[:, 0]], bool))
        if len(mine):
            order = mine[np.argsort(table[mine, 1])]
            weight = np.cumsum(left[order] ** 2 / decay[order])
            found[octave] = float(table[order[np.searchsorted(weight, weight[-1] / 2)], 1]), len(mine)
    return found


def decays_of(body: MeasuredBody, lines: Iterable[DecayLine], kind: str) -> list[MeasuredDecay]:
    """Return the rows of a body, one an octave in which it has lines."""
    return [
        MeasuredDecay(body.name, body.material, kind, body.set, octave, count, float(f"{t60:.3g}"))
        for octave, (t60, count) in by_octave(lines).items()
    ]


def write_table(path: Path, rows: Iterable[MeasuredDecay]) -> None:
    """Write the table, a row a body and octave."""
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(COLUMNS)
        out.writerows([getattr(row, name) for name in COLUMNS] for row in rows)


def read_table(path: Path = TABLE) -> list[MeasuredDecay]:
    """Read the table that `write_table` wrote."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            MeasuredDecay(
                row["body"], row["material"], row["kind"], row["set"], int(row["octave_hz"]), int(row["lines"]),
                float(row["t60_s"]),
            )
            for row in csv.DictReader(file)
        ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=TABLE)
    parser.add_argument("--work", type=Path, help="where lines of takes stay")
    parser.add_argument("bodies", nargs="*", metavar="BODY", help="these alone; all, and all classes, without one")
    asked = parser.parse_args()
    if asked.work is not None:
        asked.work.mkdir(parents=True, exist_ok=True)
    rows: list[MeasuredDecay] = []
    for body in measured_bodies(asked.data):
        if asked.bodies and body.name not in asked.bodies:
            continue
        mine = decays_of(body, lines_of_body(body, asked.work), "body")
        rows += mine
        print(f"{body.name}: {', '.join(f'{r.octave_hz} Hz {r.t60_s:.3g} s' for r in mine)}", flush=True)
    for one in () if asked.bodies else size_classes(asked.data):
        rows += decays_of(one, one.lines, "class")
    write_table(asked.out, rows)
    print(f"{len({r.body for r in rows})} bodies and classes, {len(rows)} rows: {asked.out}")


if __name__ == "__main__":
    main()
