"""Learned in simulation alone, tested on recordings: hollow or solid, how large, and what struck it?

    python -m studies.sim_to_real.tasks FULL [FULL ...] --data ../shared/measured [--closed]

    hollow    what would hold water (`HOLLOW`) against bars, boards, tiles and cutlery; balanced accuracy
    tool      metal against a stick; balanced accuracy. The takes are a robot's, whose tools are named by their source
    size      longest edge in m; rank correlation over the bars of one set, which are larger the lower they sound, and
              over bodies of known size

Each task's model is the one of `MODELS` that does best on simulated objects that it did not learn from. Intervals, of
90 %, draw bodies anew. Sizes of measured bodies are those of their sets (steel bar, ceramic bowl); of the others none
is given.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured import objects as measured_objects
from sonic_bullet.apps.dataset.household.objects import shape_of
from sonic_bullet.records import Array
from studies.sim_to_real.__main__ import DRAWS, GROUPS, Heard, heard, recorded, simulated, take_of
from studies.sim_to_real.halves import CLOSED, OPEN
from studies.sim_to_real.models import OnFeatures, losses_seen, statistics_seen

HOLLOW = ("bottle", "bowl", "box", "cup", "glass", "mug", "pan", "tin")
SOLID = ("bar", "board", "fork", "spoon", "tile")
HOLLOW_BODIES = (
    "ceramic mug", "polycarbonate cup", "wooden utensil holder", "ceramic bowl", "agogo bell", "small bell",
    "glass cup", "iron mortar", "ceramic pitcher",
)  # fmt: skip
SOLID_BODIES = ("bar of mild steel", "timber G5", "glockenspiel bar", "xylophone bar")
TOOLS = {"steel-fork": "metal", "wood-spoon": "stick"}
KNOWN_M = {"bar of mild steel": 0.11436, "ceramic bowl": 0.1155}
"""Longest edges, of the bowl by its mesh."""


@dataclass(frozen=True, slots=True)
class Learner:
    """A model of scikit-learn on features: a classifier's and a regression's."""

    features: Callable[[Any], Array]
    forest: bool

    def fit(self, seen: Any, wanted: Array) -> Any:
        """Return the fitted pipeline."""
        from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor
        from sklearn.svm import SVC, SVR

        numbers = wanted.dtype.kind == "f"
        if self.forest:
            how = {"n_estimators": 400, "min_samples_leaf": 2, "random_state": 0}
            model = ExtraTreesRegressor(**how) if numbers else ExtraTreesClassifier(**how, class_weight="balanced")
        else:
            model = SVR(C=3.0) if numbers else SVC(C=3.0, class_weight="balanced")
        return OnFeatures(self.features, model).model.fit(self.features(seen), wanted)


LEARNERS: Mapping[str, Learner] = {
    "trees on levels": Learner(statistics_seen, forest=True),
    "support vectors on levels": Learner(statistics_seen, forest=False),
    "trees on losses and lines": Learner(losses_seen, forest=True),
    "support vectors on losses and lines": Learner(losses_seen, forest=False),
}


def columns(folders: list[Path]) -> list[dict[str, Any]]:
    """Return the parameters of households' samples, in the order of `simulated`."""
    texts = (text for folder in folders for text in (folder / "manifest.jsonl").read_text().splitlines())
    return [json.loads(text)["parameters"] for text in texts]


def longest_edge_m(of: dict[str, Any]) -> float:
    """Return how large a simulated body is."""
    shape = shape_of(of["kind"], of["wall_m"], of["shape_seed"])
    edges = shape.size_m if shape.kind == "box" else np.ptp(shape.vertex_m, axis=0)
    return float(of["size"] * np.max(edges))


def balanced_accuracy(said: Array, true: Array, bodies: Array) -> tuple[float, float, float]:
    """Return the mean over classes of their bodies' shares of right takes, and 5th and 95th percentile over bodies."""
    rng, means = np.random.default_rng(0), []
    for of in np.unique(true):
        each = [(said == true)[bodies == body].mean() for body in np.unique(bodies[true == of])]
        means.append((np.mean(each), rng.choice(each, (DRAWS, len(each))).mean(axis=1)))
    low, high = np.quantile(np.mean([drawn for _, drawn in means], axis=0), [0.05, 0.95])
    return float(np.mean([mean for mean, _ in means])), float(low), float(high)


def rank_correlation(said: Array, true: Array) -> float:
    """Compute Spearman's rank correlation."""
    from scipy.stats import spearmanr

    return float(spearmanr(said, true).statistic)


def choose(full: Heard, wanted: Array) -> tuple[str, float]:
    """Return the learner that does best on simulated objects that it did not learn from, and how well it does."""
    objects = np.unique(full.objects)
    group = np.random.default_rng(0).permutation(len(objects)) % GROUPS
    mine = group[np.searchsorted(objects, full.objects)]
    scores = {}
    for name, learner in LEARNERS.items():
        said = np.empty_like(wanted)
        for k in range(GROUPS):
            learnt, other = full.where(mine != k), full.where(mine == k)
            said[mine == k] = learner.fit(learnt.seen, wanted[mine != k]).predict(learner.features(other.seen))
        scores[name] = (
            rank_correlation(said, wanted)
            if wanted.dtype.kind == "f"
            else balanced_accuracy(said, wanted, full.objects)[0]
        )
    best = max(scores, key=lambda name: scores[name])
    return best, scores[best]


def learn(task: str, full: Heard, wanted: Array) -> Callable[[Heard], Array]:
    """Choose a learner by simulated objects, print how well it does there, and return what it says of sounds."""
    best, score = choose(full, wanted)
    print(f"| {task} | simulated, left out: {best} | {len(wanted)} | {score:.2f} | | |")
    learner = LEARNERS[best]
    model = learner.fit(full.seen, wanted)
    return lambda test: np.asarray(model.predict(learner.features(test.seen)))


def tools_of(data: Path) -> Heard:
    """Read the robot's takes with tools that are metal or a stick, four of each tool and body."""
    found = []
    for one in measured_objects(data):
        tool = next((of for name, of in TOOLS.items() if one.set == "diffimpact-robot" and name in one.name), None)
        if tool is not None:
            found += [(*take_of(piece), tool, one.name) for piece in one.takes]
    return heard(found)


def shape_class(body: str) -> str:
    """Return what a measured body is: hollow, solid, or neither, which is not asked."""
    if body in HOLLOW_BODIES:
        return "hollow"
    return "solid" if body.startswith(SOLID_BODIES) else ""


def said_row(task: str, half: str, said: Array, true: Array, bodies: Array) -> str:
    """Return a line of the table of what is named."""
    mean, low, high = balanced_accuracy(said, true, bodies)
    each = ", ".join(
        f"{of} {np.mean([(said == true)[bodies == b].mean() for b in np.unique(bodies[true == of])]):.2f}"
        for of in np.unique(true)
    )
    count = f"{len(true)}, {len(np.unique(bodies))}"
    return f"| {task} | {half} | {count} | {mean:.2f} | {low:.2f} to {high:.2f} | {each} |"


def size_rows(half: str, said_m: Array, bodies: Array) -> list[str]:
    """Return lines on sizes: of sets of bars by their pitch, and of bodies of known size."""
    lines = []
    for set_name in ("glockenspiel bar", "xylophone bar"):
        mine = [(body, np.mean(said_m[bodies == body])) for body in np.unique(bodies) if body.startswith(set_name)]
        if len(mine) > 2:
            pitch = [note_number(body.rsplit(" ", 1)[1]) for body, _ in mine]
            rank = rank_correlation(np.array([size for _, size in mine]), -np.array(pitch))
            lines.append(f"| size | {half}: {set_name}s | {len(mine)} | {rank:+.2f} | | |")
    for body, true_m in KNOWN_M.items():
        if (bodies == body).any():
            said = float(np.exp(np.mean(np.log(said_m[bodies == body]))))
            lines.append(f"| size | {half}: {body} | 1 | {100 * said:.0f} cm of {100 * true_m:.0f} | | |")
    return lines


def note_number(note: str) -> int:
    """Return the number of a note such as C7, in semitones."""
    return {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}[note[0]] + 12 * int(note[1:])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("full", type=Path, nargs="+", metavar="FULL")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--closed", action="store_true")
    asked = parser.parse_args()
    full, of = simulated(*asked.full), columns(asked.full)
    kind, tool = np.array([one["kind"] for one in of]), np.array([one["excitation"] for one in of])
    print("| task | half | takes, bodies | right | 90 % | each |\n|---|---|---|---|---|---|")
    halves = {"open": OPEN} | ({"closed": CLOSED} if asked.closed else {})
    tests = {half: recorded(asked.data, sets) for half, sets in halves.items()}

    vessel = np.where(np.isin(kind, HOLLOW), "hollow", np.where(np.isin(kind, SOLID), "solid", ""))
    said = learn("hollow", full.where(vessel != ""), vessel[vessel != ""])
    for half, test in tests.items():
        true = np.array([shape_class(body) for body in test.objects])
        known = test.where(true != "")
        print(said_row("hollow", half, said(known), true[true != ""], known.objects))

    struck = np.isin(tool, list(TOOLS.values()))
    said, test = learn("tool", full.where(struck), tool[struck]), tools_of(asked.data)
    print(said_row("tool", "open", said(test), test.classes, test.objects))

    said = learn("size", full, np.log([longest_edge_m(one) for one in of]))
    for half, test in tests.items():
        for line in size_rows(half, np.exp(said(test)), test.objects):
            print(line)


if __name__ == "__main__":
    main()
