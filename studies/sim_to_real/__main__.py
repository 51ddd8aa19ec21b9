"""Learned in simulation alone, tested on recordings: of which material is it?

    sonic-bullet dataset household -o FULL --count 320 --objects 40 --seed 1 --sr 24000
    python -m studies.sim_to_real FULL [FULL ...] --data ../shared/measured [--closed]
    python -m studies.sim_to_real.strikes FULL --out NO-ROOM --without room        each piece of physics, left out
    python -m studies.sim_to_real ALL --data ../shared/measured --without room=NO-ROOM ... [--draws 10]

Each model of `MODELS` learns from simulated objects and is judged on others (GROUPS times); the best there is the one
that is tested, before any recording is heard. Without --closed the open half of the recordings is named, body by body,
to look for physics that is missing. With it the other half, for the published number, once a release.

Balanced accuracy is the mean over classes; of a class, the mean over bodies of the share of a body's takes that are
named rightly. Intervals, of 90 %, draw bodies anew within their classes, 10,000 times; a class of one body adds nothing
to their width.

What a piece of physics is worth is what the same strikes teach with it beyond what they teach without it, of the open
half alone. Its interval also draws the objects anew that are learnt from, the same ones with and without.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from benchmarks.measured import Piece
from sonic_bullet.files import read_audio
from sonic_bullet.lab.lines.band_limit import without_drift
from sonic_bullet.lab.lines.onset import span
from sonic_bullet.records import Array
from studies.sim_to_real.features import cut_at_random, lines_of, losses_of, picture_of
from studies.sim_to_real.halves import CLASSES, CLOSED, OPEN, bodies_of
from studies.sim_to_real.models import MODELS, Seen

GROUPS = 4
"""Of simulated objects, each judged by what was learnt from the others."""
DRAWS = 10_000
ABLATED = (
    "trees on losses", "support vectors on losses", "trees on decays", "support vectors on decays",
)  # fmt: skip
"""Models that show what a piece of physics is worth: those that learn in a second, on the two kinds of features."""
PAIRS = (("trees on losses", "support vectors on losses"), ("trees on losses", "small net"))
"""Of models whose chances are added up: two ways to draw a border, and two ways to look."""


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """Sounds as they are seen, their classes (n,) and whose they are (n,)."""

    seen: Seen
    classes: Array
    objects: Array

    def where(self, mask: Array) -> Heard:
        """Return some of them."""
        return Heard(Seen(*(one[mask] for one in self.seen)), self.classes[mask], self.objects[mask])


def simulated(*folders: Path) -> Heard:
    """Read households' samples."""
    found = []
    for folder in folders:
        for text in (folder / "manifest.jsonl").read_text().splitlines():
            line = json.loads(text)
            sound, sr = read_audio(folder / line["audio"])
            cut = cut_at_random(sound[0], sr, line["number"])
            found.append((cut, sr, line["parameters"]["class"], line["object"]))
    return heard(found)


def heard(found: Sequence[tuple[Array, int, str, str]]) -> Heard:
    """Look at sounds (n,), each with its rate, class and whose it is."""
    looks = (picture_of, lines_of, losses_of)
    seen = Seen(*(np.array([look(sound, sr) for sound, sr, *_ in found]) for look in looks))
    return Heard(seen, *(np.array([one[k] for one in found]) for k in (2, 3)))


def take_of(piece: Piece) -> tuple[Array, int]:
    """Read a take to the next hit, and its rate."""
    file, start_s, stop_s = piece
    sound, sr = soundfile.read(file, always_2d=True)
    signal, _ = without_drift(np.ascontiguousarray(sound[max(0, round(start_s * sr)) : round(stop_s * sr), 0]), sr)
    found = span(signal, sr)
    return signal[found.start : found.stop], sr


def recorded(data: Path, sets: tuple[str, ...]) -> Heard:
    """Read the takes of some sets."""
    return heard([(*take_of(piece), of, body.name) for body, of in bodies_of(data, sets) for piece in body.takes])


def body_shares(said: Array, heard: Heard) -> dict[str, Array]:
    """Return of each class the shares (k,) of its bodies' takes that are named rightly."""
    right = said == heard.classes
    made = {}
    for of in CLASSES:
        bodies = list(dict.fromkeys(heard.objects[heard.classes == of]))
        if bodies:
            made[of] = np.array([right[heard.objects == body].mean() for body in bodies])
    return made


def balanced(shares: dict[str, Array]) -> float:
    """Return the mean over classes."""
    return float(np.mean([one.mean() for one in shares.values()]))


def interval(shares: dict[str, Array], rng: np.random.Generator) -> tuple[float, float]:
    """Return the 5th and 95th percentile when bodies are drawn anew within classes."""
    means = [rng.choice(one, (DRAWS, len(one))).mean(axis=1) for one in shares.values()]
    low, high = np.quantile(np.mean(means, axis=0), [0.05, 0.95])
    return float(low), float(high)


def name_of(chances: Array, names: Array) -> Array:
    """Return the likeliest class of each sound (n,)."""
    return np.asarray(names[chances.argmax(axis=1)])


def left_out(full: Heard) -> dict[str, Array]:
    """Return each model's chances (n, c) of simulated sounds, of objects that it did not learn from."""
    objects = np.unique(full.objects)
    group = np.random.default_rng(0).permutation(len(objects)) % GROUPS
    mine = group[np.searchsorted(objects, full.objects)]
    made = {name: np.empty((len(mine), len(CLASSES))) for name in MODELS}
    for k in range(GROUPS):
        learnt, other = full.where(mine != k), full.where(mine == k)
        for name, model in MODELS.items():
            made[name][mine == k] = model().fit(learnt.seen, learnt.classes).chances(other.seen)
    return made | {" and ".join(pair): made[pair[0]] + made[pair[1]] for pair in PAIRS}


class Fits:
    """Models as they learnt from some sounds, each when it is first asked for."""

    def __init__(self, train: Heard) -> None:
        self.train, self._made = train, dict[str, Any]()

    def named(self, model: str, test: Heard) -> Array:
        """Return the class (n,) that a model, or the sum of two, gives each sound."""
        parts = model.split(" and ")
        for one in set(parts) - set(self._made):
            self._made[one] = MODELS[one]().fit(self.train.seen, self.train.classes)
        chances = [self._made[one].chances(test.seen) for one in parts]
        return name_of(np.sum(chances, axis=0), self._made[parts[0]].names)


def row_of(name: str, model: str, fits: Fits, test: Heard) -> tuple[str, Array]:
    """Return a row of the table, and what was said."""
    said = fits.named(model, test)
    shares = body_shares(said, test)
    low, high = interval(shares, np.random.default_rng(0))
    each = " | ".join(f"{shares[of].mean():.2f}" if of in shares else "" for of in CLASSES)
    return (
        f"| {name} | {len(fits.train.classes)} | {model} | {balanced(shares):.2f} | {low:.2f} to {high:.2f} | {each} |",
        said,
    )


def named(said: Array, test: Heard) -> list[str]:
    """Return lines on each body: how many takes were named rightly, and what the others were taken for."""
    lines = ["| body | class | named |", "|---|---|---|"]
    for body in dict.fromkeys(test.objects):
        mine = test.objects == body
        of = test.classes[mine][0]
        wrong = ", ".join(sorted(set(said[mine].tolist()) - {of}))
        right = f"{(said[mine] == of).sum()} of {mine.sum()}"
        lines.append(f"| {body} | {of} | {right}{f': {wrong}' if wrong else ''} |")
    return lines


def choose(full: Heard) -> tuple[str, list[str]]:
    """Return the model that names simulated objects best that it did not learn from, and lines that say so."""
    names = np.unique(full.classes)
    scores = {}
    for model, chances in left_out(full).items():
        right = name_of(chances, names) == full.classes
        scores[model] = float(np.mean([right[full.classes == one].mean() for one in names]))
    best = max(scores, key=lambda name: scores[name])
    listed = ", ".join(f"{name} {score:.2f}" for name, score in scores.items())
    return best, [
        f"Learnt from {len(full.classes)} clips of {len(np.unique(full.objects))} simulated objects.",
        f"Balanced accuracy on simulated objects that were left out: {listed}.",
        f"So {best} counts; the others are shown.",
    ]


def worth_of(full: Heard, without: Sequence[tuple[str, Heard]], test: Heard, draws: int) -> list[str]:
    """Return the table of what pieces of physics are worth: models and their mean, bodies and objects drawn anew."""
    rng = np.random.default_rng(0)
    objects = np.unique(full.objects)
    bodies = [np.unique(test.objects[test.classes == of]) for of in CLASSES if of in test.classes]
    again = [rng.integers(len(one), size=(DRAWS // draws, len(one))) for one in bodies]
    found = np.empty((1 + len(without), len(ABLATED), draws, DRAWS // draws))
    for draw in range(draws):
        chosen = rng.choice(objects, len(objects))
        for k, heard_of in enumerate((full, *(one for _, one in without))):
            learnt = heard_of.where(np.concatenate([np.flatnonzero(heard_of.objects == one) for one in chosen]))
            fits = Fits(learnt)
            for m, model in enumerate(ABLATED):
                shares = body_shares(fits.named(model, test), test).values()
                means = [one[drawn].mean(axis=1) for one, drawn in zip(shares, again, strict=True)]
                found[k, m, draw] = np.mean(means, axis=0)
    lines = [f"| without | {' | '.join(ABLATED)} | mean of these |", "|---|" + "---|" * (1 + len(ABLATED))]
    level = [f"{one.mean():.2f}" for one in (*found[0], found[0])]
    lines.append(f"| nothing | {' | '.join(level)} |")
    for (what, _), one in zip(without, found[1:], strict=True):
        change = one - found[0]
        cells = []
        for part in (*change, change.mean(axis=0)):
            low, high = np.quantile(part, [0.05, 0.95])
            cells.append(f"{part.mean():+.2f} ({low:+.2f} to {high:+.2f})")
        lines.append(f"| {what} | {' | '.join(cells)} |")
    return lines


def half_of(name: str, best: str, fits: Fits, test: Heard) -> list[str]:
    """Return the lines on a half of the recordings."""
    lines = [
        f"## The {name} half",
        "",
        f"{len(test.classes)} takes of {len(np.unique(test.objects))} bodies.",
        "",
        "| learnt from | clips | model | balanced accuracy | 90 % | " + " | ".join(CLASSES) + " |",
        "|---|---|---|---|---|" + "---|" * len(CLASSES),
    ]
    row, said = row_of("all physics", best, fits, test)
    others = (*MODELS, *(" and ".join(pair) for pair in PAIRS))
    lines += [row, *(row_of("all physics", model, fits, test)[0] for model in others if model != best)]
    return [*lines, "", *named(said, test), ""]


def main() -> None:
    """Print the page, and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("full", type=Path, nargs="+", metavar="FULL")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--without", nargs="*", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--closed", action="store_true", help="open the half that gives the published number, too")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--draws", type=int, default=10, help="of the objects learnt from, for --without")
    asked = parser.parse_args()
    full = simulated(*asked.full)
    if asked.without:
        parts = [(name, simulated(Path(folder))) for name, _, folder in (one.partition("=") for one in asked.without)]
        lines = worth_of(full, parts, recorded(asked.data, OPEN), asked.draws)
    else:
        fits = Fits(full)
        best, lines = choose(full)
        halves = {"open": OPEN, **({"closed": CLOSED} if asked.closed else {})}
        for name, sets in halves.items():
            lines += ["", *half_of(name, best, fits, recorded(asked.data, sets))]
    text = "\n".join(lines)
    print(text)
    if asked.out is not None:
        asked.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
