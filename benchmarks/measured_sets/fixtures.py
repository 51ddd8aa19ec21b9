"""One object on two fixtures (a hammer's table, a robot's hold), and two tools on two objects.

frequencies  lines of the robot's takes -> the hammer's                             error: median |Δf|/f
decays       d_hammer = d_robot  ->
    d_robot + c (a support that takes alike from all lines), c on every second line, judged on the others
strikers
    a line that a tool brings on one object and the other tool does not, looked for on the other object: the tool's own,
    or not
null         c on shuffled lines; frequencies at random in the band
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.observed import lines
from benchmarks.measured_sets.values import DRAWS, Array, Lines, Outcome, Row, clear

PARTNER = "diffimpact-hammer"
TAKES = 4  # of a tool on an object
NEAR = 0.006
DB = 20 / np.log(10)
BAND = (200.0, 14000.0)
MATERIAL = {"ceramic-mug": "ceramic", "wood-holder": "wood", "polycarbonate-cup": "polycarb", "steel-bowl": "steel"}


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Robot's takes beside the hammer's of the folder next to it. Raises ValueError where no take can be read."""
    takes: dict[tuple[str, str], list[Lines]] = {}
    skipped: list[str] = []
    count: dict[tuple[str, str], int] = {}
    for entry in case["files"]:
        key = (entry["tool"], entry["object"])
        count[key] = count.get(key, 0) + 1
        if count[key] > TAKES:
            continue
        try:
            found = lines(
                folder / entry["file"], start_s=entry["t_hit_s"] + 0.003, seconds=0.8, onset_s=0.0, band_hz=BAND
            )
            takes.setdefault(key, []).append(clear(found, sure=0.3))
        except Exception as error:  # one take less: the others are judged
            skipped.append(f"{entry['file']}: {error}")
    if not takes:
        raise ValueError("; ".join(skipped))
    left_out = sum(max(n - TAKES, 0) for n in count.values())
    rows, texts, pairs = [], [f"{TAKES} takes of each tool on each object are looked at, {left_out} more are not."], {}
    for thing in sorted({k[1] for k in takes}):
        robot = merged([t for k, group in takes.items() if k[1] == thing for t in group], 2)
        try:
            hammer = merged(hammered(folder.parent / PARTNER, MATERIAL.get(thing, thing)), 2)
        except Exception as error:  # the partner set is absent: tools alone are judged
            skipped.append(f"{thing} under the hammer: {error}")
            continue
        more, text, pair = fixtures(thing, robot, hammer)
        rows += more
        texts.append(text)
        pairs[thing] = pair
    more, text = strikers(takes)
    left = (
        "what a hold takes from a line goes with the line's shape where it is held; neither shape nor place is "
        "given, so the difference of decays stays a list"
    )
    return Outcome((*rows, *more), " ".join([*texts, text]), left, lambda figure: paint(figure, pairs), tuple(skipped))


def hammered(folder: Path, material: str) -> list[Lines]:
    """The hammer's hits of an object. Raises OSError."""
    case = json.loads((folder / "case.json").read_text())
    entry = next(e for e in case["files"] if Path(e["file"]).name.startswith(material))
    found = []
    for h in entry["hits"]:
        part = {"start_s": h["t_hit_s"] + 0.0015, "seconds": min(h["ring_window_s"] - 0.01, 0.5)}
        found.append(clear(lines(folder / entry["file"], onset_s=0.0, band_hz=BAND, **part), sure=0.3))
    return found


def merged(bodies: list[Lines], least: int) -> Lines:
    """Lines that `least` takes share, each number the median over them."""
    every = [
        np.concatenate([getattr(b, n) for b in bodies])
        for n in ("freq_hz", "decay_per_s", "decay_sd_per_s", "amplitude", "freq_sd_hz")
    ]
    order = np.argsort(every[0])
    rows, f = [], every[0][order]
    for group in np.split(order, np.flatnonzero(np.diff(np.log(f)) > NEAR / 2) + 1):
        if len(group) >= least:
            rows.append([float(np.median(x[group])) for x in every])
    return Lines(*np.array(rows).T) if rows else Lines(*(np.zeros(0) for _ in range(5)))


def fixtures(thing: str, robot: Lines, hammer: Lines) -> tuple[list[Row], str, tuple[Array, Array, Array]]:
    """Rows, what they say, and the common lines' f, d on either."""
    both = _common(robot.freq_hz, hammer.freq_hz)
    f, g, d, e = (
        robot.freq_hz[both[0]],
        hammer.freq_hz[both[1]],
        robot.decay_per_s[both[0]],
        hammer.decay_per_s[both[1]],
    )
    text = (
        f"{thing}: {len(robot.freq_hz)} lines under the robot, {len(hammer.freq_hz)} under the hammer, {len(f)} "
        "in common"
    )
    if len(f) < 4:
        return [], text + ": too few to judge.", (f, d, e)
    rng = np.random.default_rng(0)
    span = np.log(BAND[1] / BAND[0])
    wide = [
        float(
            np.mean(np.abs(np.log(rng.uniform(*BAND, len(robot.freq_hz))[:, None] / hammer.freq_hz)).min(axis=1) < NEAR)
        )
        for _ in range(DRAWS)
    ]
    text += f" (by chance {np.mean(wide) * len(robot.freq_hz):.1f}, over {span:.1f} e-folds)"
    worst = float(np.median(np.abs(100 * (g / f - 1))))
    fit, held = np.arange(len(f)) % 2 == 0, np.arange(len(f)) % 2 == 1

    def error(extra: float) -> float:
        return float(np.median(np.abs(DB * np.log(np.maximum(d[held] + extra, 0.05) / e[held]))))

    c = max(float(np.median((e - d)[fit])), -0.9 * float(d.min()))
    nulls = []
    for _ in range(DRAWS):
        draw = rng.permutation(e[fit]) - d[fit]
        nulls.append(error(max(float(draw[rng.integers(len(draw))]), -0.9 * float(d.min()))))
    before, after = error(0.0), error(c)
    rows = [
        Row(f"{thing}: frequencies, hammer from robot", len(f), "% of f", worst, worst, float("nan"), 1.0, ""),
        Row(
            f"{thing}: decays, hammer from robot",
            int(held.sum()),
            "dB of d",
            before,
            after,
            float(np.median(nulls)),
            float((np.array(nulls) <= after).mean()),
            "support-damping (one number for all lines)",
        ),
    ]
    text += (
        f"; the hammer's fixture changes decays by {DB * np.median(np.log(e / d)):+.1f} dB at the median, "
        f"{DB * np.log(e / d).min():+.1f} to {DB * np.log(e / d).max():+.1f} dB; c = {c:+.1f} 1/s."
    )
    return rows, text, (f, d, e)


def _common(f: Array, g: Array) -> tuple[Array, Array]:
    near = [(i, int(np.abs(g / x - 1).argmin())) for i, x in enumerate(f)] if len(g) else []
    good = [(i, j) for i, j in near if abs(g[j] / f[i] - 1) < NEAR and int(np.abs(f / g[j] - 1).argmin()) == i]
    return np.array([p[0] for p in good], int), np.array([p[1] for p in good], int)


def strikers(takes: dict[tuple[str, str], list[Lines]]) -> tuple[list[Row], str]:
    """Lines a tool alone brings on the first object, looked for on the second."""
    tools, things = sorted({k[0] for k in takes}), sorted({k[1] for k in takes})
    if len(tools) < 2 or len(things) < 2:
        return [], "One tool or one object: a striker's lines cannot be told apart."
    rows, said = [], []
    seen = {k: merged(group, max(2, len(group) // 2)) for k, group in takes.items()}
    rng = np.random.default_rng(1)
    for tool in tools:
        here, there = seen.get((tool, things[0])), seen.get((tool, things[1]))
        others = [seen[k] for k in seen if k[0] != tool and k[1] == things[0]]
        if here is None or there is None or not others or not len(there.freq_hz):
            continue
        alone = np.array(
            [
                f
                for f in here.freq_hz
                if all(not len(o.freq_hz) or np.abs(o.freq_hz / f - 1).min() > NEAR for o in others)
            ]
        )
        if not len(alone):
            said.append(f"{tool}: no line of its own")
            continue
        again = np.abs(there.freq_hz[None, :] / alone[:, None] - 1).min(axis=1) < NEAR
        draws = np.array(
            [
                (np.abs(there.freq_hz[None, :] / x[:, None] - 1).min(axis=1) < NEAR).mean()
                for x in np.exp(rng.uniform(np.log(BAND[0]), np.log(BAND[1]), (DRAWS, len(alone))))
            ]
        )
        miss, null = 100 * (1 - again.mean()), 100 * (1 - np.median(draws))
        rows.append(
            Row(
                f"{tool}: its lines on the {things[0]} found again on the {things[1]}",
                len(alone),
                "% missed",
                100.0,
                miss,
                null,
                float((draws >= again.mean()).mean()),
                "foreign-mode",
            )
        )
        said.append(
            f"{tool}: {len(alone)} lines that the other tool does not bring on the {things[0]}, again on the "
            f"{things[1]}: {', '.join(f'{f:.0f}' for f in alone[again]) or 'none'} Hz"
        )
    return rows, "; ".join(said) + "."


def paint(figure: Any, pairs: dict[str, tuple[Array, Array, Array]]) -> None:
    """d under the hammer against d under the robot."""
    axes = figure.subplots()
    for thing, (_, d, e) in pairs.items():
        axes.loglog(d, e, "o", ms=4, label=thing)
    low, high = axes.get_xlim()
    axes.plot([low, high], [low, high], "--", color="0.6", lw=0.8)
    axes.set_xlabel("decay under the robot in 1/s")
    axes.set_ylabel("decay under the hammer in 1/s")
    axes.legend(fontsize=6)
