"""Does `states` name what differs between the two of a counterfactual pair, from their takes alone?

    sonic-bullet dataset household -o PAIRS --count 56 --seed 5 --sr 24000 --counterfactual ...
    python -m studies.sim_to_real.pairs PAIRS [--from NUMBER] [--out TABLE.md]

A pair differs audibly where third-octave levels of its states, each without its own gain, are AUDIBLE_DB apart (rms,
of what lies within 40 dB of the loudest) beyond what half of a state's takes are from its other half. It is named
where the effect that `states` puts first is the cause's (NAMES_OF_CAUSE); its class is named where the cause is among
what `states` says cannot be told from that effect (TOLD_AS_CLASS); it is wrong where another effect is named and the
cause is not among these. Of a pair without change none is right.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
import soundfile

from sonic_bullet.files import read_audio
from sonic_bullet.lab.states.changes import compare_states, values_of
from sonic_bullet.lab.states.recorded_states import read_states
from sonic_bullet.lab.states.state_causes import find_causes
from sonic_bullet.lab.states.state_comparison import StateComparison
from sonic_bullet.records import Array

LOSS = ("damping", "less-damping")
NAMES_OF_CAUSE = {
    "material": ("material", "stiffness"), "size": ("stiffness",), "wall": ("stiffness", "added-stiffness"),
    "hammer": ("contact-time",), "height": ("contact-time",), "support": LOSS, "room": ("room",), "none": ("none",),
}  # fmt: skip
"""stiffness: all lines by one factor, as size, stiffness over mass and the thickness of a plate make them; added-
stiffness: lines up by factors of their own; contact-time: how hard and how fast the striker is."""
TOLD_AS_CLASS = {
    "material": ("material",), "size": ("size",), "wall": ("wall-thickness",), "hammer": ("striker", "contact-time"),
    "height": ("contact-time",), "support": ("support-damping", *LOSS), "room": ("room",), "none": (),
}  # fmt: skip
OUTCOMES = ("named", "class", "unexplained", "none", "wrong")
AUDIBLE_DB = 1.5
"""About what spectra must differ by to be told apart [Green 1988, Profile Analysis, ch. 4: 1 to 3 dB]."""
WINDOWS_S = ((0.0, 0.03), (0.03, 0.1), (0.1, 0.4))
BELOW_DB = 40.0


def levels_of(take: Array, sr: int) -> Array:
    """Compute levels (windows · thirds,) in dB less the whole's, floor included."""
    first = max(0, int(np.argmax(np.abs(take) > 0.1 * np.abs(take).max())) - sr // 1000)
    edges = 1000 * 2.0 ** ((np.arange(-10, 11) - 0.5) / 3)  # thirds from 100 Hz to 10 kHz
    found = []
    for start_s, stop_s in WINDOWS_S:
        piece = take[first + round(start_s * sr) : first + round(stop_s * sr)]
        power, at = np.abs(np.fft.rfft(piece, sr // 2)) ** 2, np.fft.rfftfreq(sr // 2, 1 / sr)
        found.append(np.histogram(at, edges, weights=power)[0])
    level = 10 * np.log10(np.concatenate(found) + 1e-30)
    return np.asarray(np.maximum(level - level.max(), -BELOW_DB))


def apart_db(one: Array, other: Array) -> float:
    """Return the rms distance of mean levels of takes (k, f) where either is above the floor."""
    a, b = one.mean(axis=0), other.mean(axis=0)
    heard = np.maximum(a, b) > -BELOW_DB + 3
    return float(np.sqrt(((a - b)[heard] ** 2).mean()))


def audible_db(before: Array, after: Array, sr: int) -> float:
    """Return how far apart two states (takes, n) are beyond their takes' scatter."""
    a, b = (np.array([levels_of(take, sr) for take in state]) for state in (before, after))
    scatter = [apart_db(state[::2], state[1::2]) for state in (a, b)]
    return float(np.sqrt(max(apart_db(a, b) ** 2 - float(np.mean(np.square(scatter))), 0.0)))


def outcome_of(cause: str, found: StateComparison) -> str:
    """Say which of `OUTCOMES` an answer is."""
    said = [one.name for one in found.causes] or [found.verdict]
    if said[0] in NAMES_OF_CAUSE[cause]:
        return "named"
    if found.causes and set(found.causes[0].alternatives) & set(TOLD_AS_CLASS[cause]):
        return "class"
    return said[0] if said[0] in OUTCOMES else "wrong"


def compare_pair(before: Array, after: Array, sr: int) -> StateComparison:
    """Ask `states`, without its prediction."""
    with tempfile.TemporaryDirectory() as place:
        folders = []
        for name, state in (("before", before), ("after", after)):
            folder = Path(place) / name
            folder.mkdir()
            for number, take in enumerate(state):
                soundfile.write(folder / f"{number}.wav", take, sr, "FLOAT")
            folders.append(str(folder))
        one, other = (values_of(state) for state in read_states(folders))
    found = compare_states(one, other)
    return StateComparison(found, find_causes(found), None)


def main() -> None:
    """Print a line a pair, and the table by cause."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--from", type=int, default=0, dest="first", help="number of the first pair that is judged")
    asked = parser.parse_args()
    rows: dict[str, list[tuple[float, str, str]]] = defaultdict(list)
    in_class: list[int] = []
    for text in (asked.pairs / "manifest.jsonl").read_text().splitlines():
        line = json.loads(text)
        if line["number"] < asked.first:
            continue
        sound, sr = read_audio(asked.pairs / line["audio"])
        before, after = np.split(sound, 2)
        cause, far = line["parameters"]["cause"], audible_db(before, after, sr)
        found = compare_pair(before, after, sr)
        outcome = outcome_of(cause, found)
        rows[cause].append((far, outcome, found.verdict))
        alternatives = found.causes[0].alternatives if found.causes else ()
        if outcome == "class":
            in_class.append(1 + len(alternatives))
        kind, words = line["parameters"]["kind"], ", ".join(alternatives)
        print(line["number"], kind, cause, f"{far:.1f} dB", outcome, found.verdict, words, sep=" | ", flush=True)
    lines = [f"| differs in | pairs | audibly | {' | '.join(OUTCOMES)} | said of them |", "|---|---|---|" + "---|" * 6]
    whole = np.zeros(2 + len(OUTCOMES), int)
    for cause, judged in rows.items():
        heard = [(outcome, said) for far, outcome, said in judged if far >= AUDIBLE_DB or cause == "none"]
        said = [one for _, one in heard]
        numbers = [len(judged), len(heard), *(sum(one == of for one, _ in heard) for of in OUTCOMES)]
        counts = ", ".join(f"{said.count(one)} {one}" for one in sorted(set(said), key=said.count, reverse=True))
        lines.append(f"| {cause} | {' | '.join(map(str, numbers))} | {counts} |")
        if cause != "none":
            whole += numbers
    lines.append(f"| all but none | {' | '.join(map(str, whole))} | |")
    if in_class:
        lines += ["", f"A class holds {np.mean(in_class):.1f} causes on average."]
    print("\n".join(lines))
    if asked.out is not None:
        asked.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
