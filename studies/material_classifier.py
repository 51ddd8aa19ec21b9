"""Of which of four materials is it? A classifier that learns from one command's data set, on objects it never heard.

    sonic-bullet dataset impacts -o out --count 100 --seed 1
    python -m studies.material_classifier out --data ../shared/measured

Each object of the data set is named by what was learnt from all others; every body of the recordings whose material is
one of the four, by what was learnt from all. Writes docs/measured/material-classifier.md. Nothing of it was chosen by
the recordings: features and classifier are what one takes first.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.decay_objects import measured_bodies
from benchmarks.measured_decays import impact_of
from sonic_bullet.files import read_audio
from sonic_bullet.records import Array
from sonic_bullet.session.drawn_recording import ChainSpread, draw_chain, record

PAGE = Path("docs/measured/material-classifier.md")
CLASSES = ("metal", "glass", "ceramic", "wood")
CLASS_OF = {
    "steel": "metal", "aluminium": "metal", "brass": "metal", "copper": "metal", "iron": "metal", "bronze": "metal",
    "glass": "glass", "porcelain": "ceramic", "wood": "wood", "spruce": "wood",
}  # fmt: skip
"""Of presets and of measured bodies."""
CENTRES_HZ = 250.0 * 2.0 ** np.arange(6)
TIMES_S = (0.0, 0.02, 0.06, 0.14, 0.3)
FLOOR_DB = -60.0
CHAINS = ChainSpread(gain_db=(-6, 6), response_db=3, noise_rthz=(1e-6, 1e-4))
"""Of docs/how-to/train-for-real-recordings.md, for sound of a peak of 1."""
COPIES = 4
"""Chains drawn a sample."""


@dataclass(frozen=True, slots=True)
class Heard:
    """One impact: its features (f,), class and object."""

    features: Array
    material: str
    object: str


def features_of(sound: Array, sr: int) -> Array:
    """Compute octave levels in four windows after the onset, in dB of all windows' energy; gain has no part in them."""
    from scipy.signal import butter, sosfilt

    levels = np.full((len(CENTRES_HZ), len(TIMES_S) - 1), FLOOR_DB)
    edges = [round(t * sr) for t in TIMES_S]
    padded = np.zeros(edges[-1])
    padded[: len(sound)] = sound[: edges[-1]]
    total = max(float((padded**2).sum()), 1e-300)
    for row, centre in zip(levels, CENTRES_HZ, strict=True):
        high = min(centre * np.sqrt(2), 0.49 * sr)
        band = sosfilt(butter(4, [centre / np.sqrt(2), high], "bandpass", fs=sr, output="sos"), padded) ** 2
        for column, (start, stop) in enumerate(pairwise(edges)):
            row[column] = 10 * np.log10(max(band[start:stop].sum() / total, 10 ** (FLOOR_DB / 10)))
    return levels.reshape(-1)


def from_onset(sound: Array, sr: int) -> Array:
    """Cut what lies before the loudest of the first strikes, by a tenth of its peak."""
    first = int(np.argmax(np.abs(sound) > 0.1 * np.abs(sound).max()))
    return sound[max(0, first - round(0.001 * sr)) :]


def simulated(folder: Path, chains: bool) -> Iterator[Heard]:
    """Read a data set's samples; with chains each as COPIES drawn recordings."""
    for line in (folder / "manifest.jsonl").read_text().splitlines():
        labels: dict[str, Any] = json.loads(line)
        material = CLASS_OF.get(labels["parameters"]["material"])
        if material is None:
            continue
        sound, sr = read_audio(folder / labels["audio"])
        one = from_onset(sound[0] / np.abs(sound[0]).max(), sr)
        if not chains:
            yield Heard(features_of(one, sr), material, labels["object"])
            continue
        draw = np.random.default_rng(labels["seed"])
        for _ in range(COPIES):
            recorded, _ = record(one[None], sr, draw_chain(draw, CHAINS))
            yield Heard(features_of(recorded[0], sr), material, labels["object"])


def recorded_impacts(data: Path) -> Iterator[Heard]:
    """Read every take of every measured body of one of the four materials."""
    for body in measured_bodies(data):
        material = CLASS_OF.get(body.material)
        for piece in body.takes if material else ():
            sound, sr = impact_of(piece)
            yield Heard(features_of(from_onset(sound, sr), sr), material or "", body.name)


def learn(heard: Sequence[Heard]) -> Any:
    """Fit scikit-learn's logistic regression on standardised features, each class of one weight."""
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    model = make_pipeline(StandardScaler(), LogisticRegression(class_weight="balanced", max_iter=5000))
    return model.fit(np.array([one.features for one in heard]), [one.material for one in heard])


def names_of(model: Any, heard: Sequence[Heard]) -> list[str]:
    """Name the class of each impact."""
    return [str(name) for name in model.predict(np.array([one.features for one in heard]))]


def unheard_names(train: Sequence[Heard], heard: Sequence[Heard]) -> list[str]:
    """Name each impact by what was learnt from all other objects than its own."""
    of = {
        name: learn([one for one in train if one.object != name]) for name in dict.fromkeys(one.object for one in heard)
    }
    return [names_of(of[one.object], [one])[0] for one in heard]


def scores(names: Sequence[str], heard: Sequence[Heard]) -> tuple[float, float]:
    """Return the share of impacts named rightly, and its mean over the classes that occur."""
    of = np.array([one.material for one in heard])
    right = np.array(names) == of
    return float(right.mean()), float(np.mean([right[of == name].mean() for name in sorted(set(of))]))


def page(rows: Mapping[str, Sequence[Heard]], heard: Sequence[Heard], real: Sequence[Heard], asked: str) -> str:
    """Write the page. rows: what is learnt from, by name; heard: the data set's sounds; asked: how it was made."""
    objects = dict.fromkeys(one.object for one in heard)
    bodies = dict.fromkeys(one.object for one in real)
    counts = {of: sum(one.material == of for one in heard) for of in CLASSES}
    lines = [
        "# A classifier of four materials",
        "",
        "Learnt from one command's data set; tested on objects left out, and on recordings by others. Made by:",
        "",
        "```text",
        asked,
        "python -m studies.material_classifier out --data ../shared/measured",
        "```",
        "",
        f"{len(heard)} sounds of {len(objects)} objects: {', '.join(f'{n} {of}' for of, n in counts.items())}.",
        f"Each object is named by what was learnt from all others. {len(real)} takes of {len(bodies)} real bodies,",
        "named by what was learnt from all. Logistic regression on octave levels, 250 Hz to 8 kHz,",
        "in four windows of the first 0.3 s. The mean over classes counts each material alike: chance is 0.25.",
        "",
        "| learnt from | objects left out | mean over classes | real takes | mean over classes |",
        "|---|---|---|---|---|",
    ]
    said = {}
    for name, train in rows.items():
        said[name] = names_of(learn(train), real)
        shares = [*scores(unheard_names(train, heard), heard), *scores(said[name], real)]
        lines.append(f"| {name} | " + " | ".join(f"{share:.2f}" for share in shares) + " |")
    lines += ["", "Real takes named rightly, by class; what is below a half does not transfer:", ""]
    for name, names in said.items():
        counted = [
            (of, sum(one.material == of == word for one, word in zip(real, names, strict=True)),
             sum(one.material == of for one in real)) for of in CLASSES
        ]  # fmt: skip
        lines.append(f"- {name}: " + ", ".join(f"{of} {n} of {all_}" for of, n, all_ in counted))
    lines += ["", "Body by body: takes named rightly of all, and what the others were taken for.", ""]
    lines += ["| body | material | " + " | ".join(rows) + " |", "|---|---|" + "---|" * len(rows)]
    for body in bodies:
        mine = [number for number, one in enumerate(real) if one.object == body]
        of = real[mine[0]].material
        cells = list[str]()
        for names in said.values():
            wrong = sorted({names[number] for number in mine} - {of})
            right = sum(names[number] == of for number in mine)
            cells.append(f"{right} of {len(mine)}" + (f", {' and '.join(wrong)}" if wrong else ""))
        lines.append(f"| {body} | {of} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=PAGE)
    asked = parser.parse_args()
    manifest = (asked.dataset / "manifest.jsonl").read_text().splitlines()
    first = json.loads(manifest[0])
    command = f"sonic-bullet dataset impacts -o out --count {len(manifest)} --seed {first['seed'][0]}"
    heard = list(simulated(asked.dataset, chains=False))
    rows = {
        "sound as simulated": heard,
        "sound through drawn recording chains": list(simulated(asked.dataset, chains=True)),
    }
    text = page(rows, heard, list(recorded_impacts(asked.data)), command)
    asked.out.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
