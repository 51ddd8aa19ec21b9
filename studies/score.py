"""How much of what happened does `score` find in exported poses? The truth is what the simulation's own log plays.

    python -m studies.score [--fps 240,60,24] [--scene dice] [--float32] [--quiet]

An impact is found where the score has one of the same pair within WINDOW_S of it; by impulse, each counts as much as it
weighs. invented: impulse of found impacts that no true one of the pair is near, over all true impulse. chance: the same
rate with the truth shifted in time, the mean of SHIFTS_S. alone: no other contact on its moving bodies for two frames.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from time import process_time
from typing import NamedTuple

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.files.contact_log import ContactLog
from studies.scoring.scenes import QUIET, TRUTH, Scene
from studies.scoring.truth import Impact, at_rate, impacts, large, loads, played, pulses, scored

WINDOW_S = {240: 2 / 240, 60: 0.5 / 60, 24: 0.5 / 24}
ALONE_S, ALONE_SHARE = 1e-3, 0.05
SHIFTS_S = (0.11, 0.17, 0.29, 0.41, 0.53)
HEARD_AT_REST_S = 0.3
"""After this much of a quiet scene its first touches are over."""


class Found(NamedTuple):
    """Truth with what was found of it: (true, found or None) of each."""

    pairs: list[tuple[Impact, Impact | None]]

    @property
    def number(self) -> float:
        """Share of impacts."""
        return float(np.mean([found is not None for _, found in self.pairs])) if self.pairs else np.nan

    @property
    def impulse(self) -> float:
        """Share of impulse."""
        whole = sum(true.impulse_n_s for true, _ in self.pairs)
        return sum(true.impulse_n_s for true, found in self.pairs if found is not None) / whole if whole else np.nan

    @property
    def late_s(self) -> np.ndarray:
        """How far onsets are off."""
        return np.array([abs(found.time_s - true.time_s) for true, found in self.pairs if found is not None])

    @property
    def off(self) -> np.ndarray:
        """How far impulses are off, over the true one."""
        return np.array([abs(f.impulse_n_s / t.impulse_n_s - 1) for t, f in self.pairs if f is not None])


def matched(truth: Sequence[Impact], found: Sequence[Impact], window_s: float) -> Found:
    """Each true impact with the nearest of its pair that is no other's, nearest first."""
    near = sorted(
        (abs(f.time_s - t.time_s), i, j)
        for i, t in enumerate(truth)
        for j, f in enumerate(found)
        if (t.low, t.high) == (f.low, f.high) and abs(f.time_s - t.time_s) <= window_s
    )
    taken: dict[int, int] = {}
    for _, i, j in near:
        if i not in taken and j not in taken.values():
            taken[i] = j
    return Found([(t, found[taken[i]] if i in taken else None) for i, t in enumerate(truth)])


def shifted(truth: Sequence[Impact], by_s: float, seconds: float) -> list[Impact]:
    """The truth as if it had happened later, its end at the start."""
    return [one._replace(time_s=(one.time_s + by_s) % seconds) for one in truth]


def alone(
    truth: Sequence[Impact], load: Sequence[tuple[int, int, float]], heavy: Sequence[bool], near_s: float
) -> list[Impact]:
    """Impacts beside which no other pair loads their moving bodies, and their own for a moment only."""

    def lonely(one: Impact) -> bool:
        bodies = {b for b in (one.low, one.high) if heavy[b]}
        close = [(a, b) for a, b, t in load if abs(t - one.time_s) <= near_s and bodies & {a, b}]
        return all(pair == (one.low, one.high) for pair in close) and len(close) <= 3

    return [one for one in truth if lonely(one)]


def measured(scene: Scene, log: ContactLog, animation: Animation, fps: int, single: bool) -> dict[str, float]:
    """One row of the table."""
    began = process_time()
    heard = scored(at_rate(animation, 240 // fps, single=single))
    cost = process_time() - began
    mass = [one.mass_kg for one in animation.bodies]
    group_s, window_s = 2 / fps, WINDOW_S[fps]
    every = impacts(pulses(log), group_s)
    truth, found = large(every, mass), impacts(pulses(heard), group_s)
    of, by_chance = matched(truth, found, window_s), [
        matched(shifted(truth, by_s, scene.seconds), found, window_s) for by_s in SHIFTS_S
    ]  # fmt: skip
    heavy = large(found, mass)
    kept = {found for _, found in matched(every, found, window_s).pairs if found is not None}
    single_out = alone(truth, loads(log), [m > 0 for m in mass], group_s)
    lone = matched(single_out, found, window_s)
    whole = sum(one.impulse_n_s for one in truth)
    return {
        "true": len(truth), "number": of.number, "impulse": of.impulse,
        "by chance": float(np.mean([c.number for c in by_chance])),
        "impulse by chance": float(np.mean([c.impulse for c in by_chance])),
        "onset, 9 of 10, ms": 1e3 * float(np.quantile(of.late_s, 0.9)) if len(of.late_s) else np.nan,
        "impulse off": float(np.median(of.off)) if len(of.off) else np.nan,
        "invented": sum(one.impulse_n_s for one in heavy if one not in kept) / whole,
        "alone": len(single_out), "alone found": lone.number,
        "alone, median ms": 1e3 * float(np.median(lone.late_s)) if len(lone.late_s) else np.nan,
        "alone, impulse off": float(np.median(lone.off)) if len(lone.off) else np.nan,
        "processor s": cost,
    }  # fmt: skip


def quiet(name: str, scene: Scene, fps: int, single: bool) -> None:
    """What is invented where nothing strikes after the first touch."""
    log, animation = played(scene)
    mass = [one.mass_kg for one in animation.bodies]
    found = impacts(pulses(scored(at_rate(animation, 240 // fps, single=single))), 2 / fps)
    true = impacts(pulses(log), 2 / fps)
    kept = {f for _, f in matched(true, found, 2 / fps).pairs if f is not None}
    late = [one for one in found if one.time_s > HEARD_AT_REST_S]
    invented = [one for one in late if one not in kept]
    expected = sum(t.time_s > HEARD_AT_REST_S for t in true)
    weight = 1e3 * sum(one.impulse_n_s for one in invented)
    print(
        f"| {name} | {fps} | {'float32' if single else 'float64'} | {expected} | {len(late)} | {len(invented)} |",
        end="",
    )
    print(f" {weight:.3g} | {len(large(invented, mass))} |", flush=True)


def main() -> None:
    """Print the rows that were asked for."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--fps", default="240,60,24")
    ask.add_argument("--scene")
    ask.add_argument("--float32", action="store_true")
    ask.add_argument("--quiet", action="store_true")
    asked = ask.parse_args()
    rates = [int(rate) for rate in asked.fps.split(",")]
    if asked.quiet:
        print(
            "| scene | fps | poses | true after the first touch | found | invented | mN s | of them large |\n|"
            + "---|" * 8
        )
        for name, scene in QUIET.items():
            for fps in rates if asked.scene in (None, name) else ():
                quiet(name, scene, fps, asked.float32)
        return
    head = None
    for name, scene in TRUTH.items():
        if asked.scene not in (None, name):
            continue
        log, animation = played(scene)
        for fps in rates:
            row = measured(scene, log, animation, fps, asked.float32)
            if head is None:
                head = list(row)
                print("| scene | fps | " + " | ".join(head) + " |\n|" + "---|" * (2 + len(head)))
            print(f"| {name} | {fps} | " + " | ".join(f"{value:.3g}" for value in row.values()) + " |", flush=True)


if __name__ == "__main__":
    main()
