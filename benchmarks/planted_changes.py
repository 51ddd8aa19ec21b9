"""Does a comparison find what was changed in a scene, and name that and nothing else?

    python benchmarks/planted_changes.py [NAME] …

scenes: 42 changes of one input; pairs: 20 of two; decoys: 10 inputs that change no sample, five alone and five beside a
change that matters; logs: the 42 changes, of logs alone; recordings: 12 changes of a WAV; held_out: 24 changes in
scenes of other kinds; same: unchanged runs; processes: in others; page: its size; cost: of equal inputs; piles: chaotic
ones, by sound. Without a word, the first five.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planted.held_out import held_out
from benchmarks.planted.recordings import recordings
from benchmarks.planted.scenes import SCENES, changed, write
from sonic_bullet.apps.compare.baselines import samples_digest
from sonic_bullet.apps.compare.compared_sides import compare_sides
from sonic_bullet.apps.compare.comparison_record import Comparison
from sonic_bullet.apps.compare.sides import SceneSide, Side, of_log, run
from sonic_bullet.engine.runtime.replay import render_blocks

PLAYED_S = 12.0

Change = tuple[tuple[Any, ...], Any]


@dataclass(frozen=True, slots=True)
class Planted:
    """scene: which; changes: what of it; who, what: the input that must be first; options: how B is rendered."""

    scene: str
    changes: tuple[Change, ...]
    who: str
    what: str
    options: dict[str, Any] = field(default_factory=dict)
    base: tuple[Change, ...] = ()


def by(factor: float) -> Callable[[float], float]:
    return lambda x: x * factor


def more(added: float, axis: int | None = None) -> Callable[[Any], Any]:
    def moved(x: Any) -> Any:
        return x + added if axis is None else [v + added * (i == axis) for i, v in enumerate(x)]

    return moved


def of(scene: str, who: str, key: str, value: Any, what: str, **rest: Any) -> Planted:
    path: tuple[Any, ...] = ("bodies", who, *key.split("."))
    return Planted(scene, ((path, value),), who, what, **rest)


def engine(scene: str, key: str, value: Any, what: str) -> Planted:
    return Planted(scene, ((("engine", key), value),), "", what)


def rendered(scene: str, what: str, base: tuple[Change, ...] = (), **options: Any) -> Planted:
    return Planted(scene, (), "", what, options, base)


WITH_RESIDUAL = ((("bodies", "block", "residual"), True),)
FINE = ((("bodies", "ball", "fineness"), 1),)
PLANTED = (
    of("bar", "bar", "factors.density", by(1.01), "density_kg_m3"),
    of("drop", "block", "factors.density", by(0.99), "density_kg_m3"),
    of("bar", "bar", "factors.young", by(1.02), "stiffness_pa"),
    of("rods", "rod", "factors.young", by(0.98), "stiffness_pa"),
    of("bar", "bar", "factors.loss", by(2.0), "damping"),
    of("rods", "rod", "factors.loss", by(2.0), "damping"),
    of("drop", "block", "mass", by(1.1), "mass"),
    of("bar", "striker", "mass", by(0.95), "mass"),
    of("roll", "ball", "mass", by(1.02), "mass"),
    of("bar", "striker", "at", more(0.005, 0), "start position"),
    of("drop", "block", "at", more(0.005, 2), "start position"),
    of("pile", "marble 3", "at", more(0.005, 0), "start position"),
    rendered("drop", "sr", sr=44_100),
    rendered("bar", "sr", sr=96_000),
    rendered("drop", "residual", WITH_RESIDUAL, residual=False),
    of("slide", "slab", "friction", by(1.1), "friction"),
    of("slide", "board", "friction", by(1.1), "friction"),
    of("pile", "marble 1", "friction", by(1.1), "friction"),
    of("drop", "block", "restitution", more(-0.05), "restitution"),
    of("pile", "board", "restitution", more(-0.05), "restitution"),
    engine("drop", "dt", by(0.5), "time step"),
    engine("rods", "dt", by(0.5), "time step"),
    engine("drop", "gravity", -9.80, "gravity"),
    engine("pile", "gravity", -9.80, "gravity"),
    Planted("bar", ((("microphone",), more(0.02, 1)),), "", "microphones"),
    Planted("roll", ((("microphone",), more(0.02, 0)),), "", "microphones"),
    of("pile", "marble 2", "", None, "body"),
    of("rods", "peg", "", None, "body"),
    of("roll", "ball", "fineness", 2, "mesh", base=FINE),
    of("bar", "bar", "modes", {"to_hz": 12_000.0}, "to_hz"),
    of("roll", "board", "factors.roughness", by(1.5), "roughness_m"),
    of("slide", "slab", "factors.roughness", by(1.5), "roughness_m"),
    rendered("slide", "seed", seed=1),
    rendered("roll", "seed", seed=2),
    engine("rods", "substeps", 2, "sub-steps"),
    engine("pile", "iterations", 20, "solver iterations"),
    of("roll", "ball", "velocity", more(0.02, 0), "start velocity"),
    of("drop", "block", "euler", more(0.02, 0), "start orientation"),
    of("bar", "bar", "shape", ["box", [0.12, 0.005, 0.0051]], "shape"),
    of("rods", "rod", "material", "aluminium", "material"),
    of("drop", "board", "modes", {"count": 60, "mounting": "on floor"}, "mounting"),
    of("rods", "board", "modes", {"count": 60, "mounting": 0.1}, "mounting"),
)
DECOYS = (
    of("drop", "bystander", "friction", 0.9, ""),
    of("slide", "bystander", "restitution", 0.1, ""),
    of("roll", "bystander", "mass", 0.2, ""),
    of("bar", "bystander", "at", [5, 6, 9], ""),
    of("pile", "bystander", "rolling", 0.3, ""),
    of("rods", "bystander", "spinning", 0.3, ""),
    of("drop", "bystander", "euler", [1, 0, 0], ""),
    of("slide", "bystander", "damping", 0.2, ""),
    of("roll", "board", "source", "another page", ""),
    of("bar", "bar", "source", "another page", ""),
)


class Bench:
    """Runs, each made once."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.made, self.count = folder, {}, 0  # type: ignore[var-annotated]

    def side(self, which: str, scene: str, changes: tuple[Change, ...], options: dict[str, Any]) -> Side:
        """The scene with those changes, run."""
        key = (which, repr(changed(SCENES[scene], *_paths(changes))), repr(options))
        if key not in self.made:
            self.count += 1
            place = write(self.folder / f"{scene}-{self.count}.py", changed(SCENES[scene], *_paths(changes)))
            side = run(SceneSide(place, **options), which)
            if which == "b":
                return side
            self.made[key] = side
        return self.made[key]

    def both(self, one: Planted, *others: Planted) -> tuple[Side, Side]:
        """A without and B with the changes."""
        changes = tuple(x for p in (one, *others) for x in p.changes)
        base = tuple(x for p in (one, *others) for x in p.base)
        options = {k: v for p in (one, *others) for k, v in p.options.items()}
        return self.side("a", one.scene, base, {}), self.side("b", one.scene, base + changes, options)


def _paths(changes: tuple[Change, ...]) -> tuple[Change, ...]:
    return tuple((tuple(key for key in path if key != ""), value) for path, value in changes)


def is_that(found: Any, one: Planted) -> bool:
    """Whether a difference is the planted one."""
    return found.who == one.who and (found.what.split()[-1] == one.what or found.what.startswith(one.what))


def line(*cells: object) -> None:
    print(" | ".join(str(cell) for cell in cells), flush=True)


def names(found: Comparison) -> str:
    return "; ".join(
        f"{x.who}: {x.what}{'' if x.cause is None else ' !' if x.cause else ' -'}" for x in found.differences[:4]
    )


def scenes(bench: Bench, logs: bool = False) -> None:
    """42 changes of one input."""
    found_count = right = 0
    for number, one in enumerate(PLANTED):
        began = time.perf_counter()
        a, b = bench.both(one)
        if logs:
            assert a.log is not None and b.log is not None
            a, b = of_log(a.log, "a"), of_log(b.log, "b")
        found = compare_sides(a, b)
        first = bool(found.differences) and is_that(found.differences[0], one)
        found_count += not found.same
        right += first and (logs or len(found.causes) == 1)
        if not first or found.same or not (logs or len(found.causes) == 1):
            line(number, one.scene, one.who, one.what, "WRONG", names(found), found.notes)
        else:
            line(number, one.scene, one.who, one.what, f"{time.perf_counter() - began:.1f} s")
    line("logs" if logs else "scenes", f"{found_count} of {len(PLANTED)} found", f"{right} exactly that first")


def pairs(bench: Bench) -> None:
    """20 pairs of changes, both named."""
    rng = np.random.default_rng(35)
    right = 0
    listed: list[tuple[Planted, Planted]] = []
    while len(listed) < 20:
        i, j = (PLANTED[k] for k in rng.choice(len(PLANTED), 2, replace=False))
        if i.scene == j.scene and (i.who, i.what) != (j.who, j.what) and not {"body", "material"} & {i.what, j.what}:
            listed.append((i, j))
    for one, other in listed:
        found = compare_sides(*bench.both(one, other))
        good = len(found.causes) == 2 and all(any(is_that(x, p) for x in found.causes) for p in (one, other))
        right += good
        line(one.scene, f"{one.who}: {one.what}", f"{other.who}: {other.what}", "" if good else f"WRONG {names(found)}")
    line("pairs", f"{right} of {len(listed)} both named")


def decoys(bench: Bench) -> None:
    """Inputs that change no sample."""
    alone = beside = 0
    for number, one in enumerate(DECOYS):
        partner = next(
            x for x in PLANTED if x.scene == one.scene and not x.options and x.what not in ("body", "material")
        )
        found = compare_sides(*bench.both(*((one,) if number < 5 else (one, partner))))
        if number < 5:
            good = found.same and len(found.differences) == 1 and not found.causes
            alone += good
        else:
            good = is_that(found.differences[0], partner) and len(found.causes) == 1
            beside += good
        line(one.scene, one.who, one.changes[0][0][-1], "" if good else f"WRONG {found.same} {names(found)}")
    line("decoys", f"{alone} of 5 alone: same", f"{beside} of 5 beside a change: never first")


def same(bench: Bench, runs: int = 200) -> None:
    """Unchanged runs: the same bits."""
    a = bench.side("a", "drop", (), {})
    equal = sum(compare_sides(a, bench.side("b", "drop", (), {})).same for _ in range(runs))
    line("same", f"{equal} of {runs} unchanged runs have the same bits")


def processes(bench: Bench, count: int = 10) -> None:
    """Unchanged runs in other processes, each with another number of threads; and rendered in blocks of other sizes."""
    code = "import sys; from sonic_bullet.apps.compare.baselines import samples_digest as d; "
    code += "from sonic_bullet.apps.compare.sides import SceneSide, run; print(d(run(SceneSide(sys.argv[1]), 'a')"
    code += ".sound))"
    place = write(bench.folder / "processes.py", SCENES["drop"])
    side = run(SceneSide(place), "a")
    assert side.log is not None
    known, equal = samples_digest(side.sound), 0
    for number in range(count):
        threads = str(1 + number % 4)
        asked = {
            **os.environ,
            "OMP_NUM_THREADS": threads,
            "OPENBLAS_NUM_THREADS": threads,
        }
        words = [sys.executable, "-c", code, str(place)]
        done = subprocess.run(words, env=asked, check=True, capture_output=True, text=True)
        equal += done.stdout.split()[-1] == known
    again = np.concatenate([*render_blocks(side.log)], axis=1)
    blocks = np.array_equal(again.view(np.int64), side.sound.samples().view(np.int64))
    line(
        "processes", f"{equal} of {count} in other processes, of 1 to 4 threads", f"rendered as a whole: same {blocks}"
    )


def page(bench: Bench, count: int = 20) -> None:
    """The size of a page of so many scenes that differ, each as long as a player plays."""
    from sonic_bullet.apps.compare.compare_page import page_entry, write_page

    place = write(bench.folder / "long.py", changed(SCENES["pile"], (("seconds",), PLAYED_S)))
    a = run(SceneSide(place), "a")
    assert a.log is not None
    b = of_log(replace(a.log, seed=a.log.seed + 1, sensors=tuple(moved(x) for x in a.log.sensors)), "b")
    write_page(str(bench.folder / "page.html"), [page_entry(compare_sides(of_log(a.log, "a"), b))] * count)
    line("page", f"{(bench.folder / 'page.html').stat().st_size / 1e6:.2f} MB of {count} scenes, {PLAYED_S:g} s each")


def moved(sensor: Any) -> Any:
    return replace(sensor, position_m=sensor.position_m + 0.05)


def cost(bench: Bench) -> None:
    """Equal inputs against two renders."""
    from sonic_bullet.apps.compare import compare
    from sonic_bullet.scene import render_scene

    place = write(bench.folder / "cost.py", changed(SCENES["pile"], (("seconds",), 3.0)))
    render_scene(place)
    ratios = []
    for _ in range(5):
        start = time.process_time()
        render_scene(place), render_scene(place)
        middle = time.process_time()
        compare(place, place)
        ratios.append((time.process_time() - middle) / (middle - start))
    line("cost", f"{np.median(ratios):.2f} of two renders", ", ".join(f"{x:.2f}" for x in ratios))


def piles(bench: Bench, count: int = 100) -> None:
    """Chaotic piles whose starts are shifted by 0.1 mm: named as input, and by sound no alarm."""
    from sonic_bullet.apps.compare.ensemble import ShiftPlan, ensemble, judge_run, measure_side

    place = write(bench.folder / "pile.py", SCENES["pile"])
    scene = SceneSide(place)
    known = ensemble(scene)
    alarms = 0
    for seed in range(1000, 1000 + count):
        alarms += judge_run(
            known, *measure_side(run(SceneSide(place, seconds=known.seconds), "b", plan=ShiftPlan(seed)))
        ).beyond_chance
    line("piles", f"{alarms} alarms of {count} by sound", f"run for {known.seconds:.2f} s, rests: {known.rests}")


def main() -> None:
    asked = sys.argv[1:] or ["scenes", "pairs", "decoys", "logs", "recordings"]
    with tempfile.TemporaryDirectory() as place:
        bench = Bench(Path(place))
        table: dict[str, Callable[[], None]] = {
            "scenes": lambda: scenes(bench),
            "logs": lambda: scenes(bench, logs=True),
            "pairs": lambda: pairs(bench),
            "decoys": lambda: decoys(bench),
            "recordings": lambda: recordings(bench.side("a", "drop", (), {}), bench.folder, line),
            "held_out": lambda: held_out(bench.folder, line),
            "same": lambda: same(bench),
            "processes": lambda: processes(bench),
            "page": lambda: page(bench),
            "cost": lambda: cost(bench),
            "piles": lambda: piles(bench),
        }
        for name in asked:
            table[name]()


if __name__ == "__main__":
    main()
