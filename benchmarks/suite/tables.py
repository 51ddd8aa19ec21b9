"""Rows -> what the suite says, in words and tables.

closed = (before − after) / (before − floor), of the means over an effect's cases: 1 where nothing is left to explain
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.suite.effects import LISTED

Row = dict[str, Any]


def _of(rows: list[Row], *kind: str) -> list[Row]:
    return [r for r in rows if r["case"].startswith(kind)]


def _named(row: Row) -> bool:
    return bool(row["verdict"] == "explained" and row["found"] == row["true"])


def confusion(rows: list[Row]) -> str:
    """What each single effect was taken for."""
    lines = ["single effects: what was there -> what was said (weak, medium, strong named; all)"]
    for name in LISTED:
        mine = [r for r in rows if r["true"] == [name]]
        if not mine:
            continue
        said = Counter("+".join(r["found"]) if r["found"] else r["verdict"] for r in mine)
        by = [
            f"{sum(map(_named, part))}/{len(part)}"
            for s in ("weak", "medium", "strong")
            if (part := [r for r in mine if f"-{s}-" in r["case"]]) is not None
        ]
        lines.append(f"  {name:18s} {'  '.join(by)}   " + ", ".join(f"{what} {n}" for what, n in said.most_common()))
    return "\n".join(lines)


def errors(rows: list[Row]) -> str:
    """Log-spectral distance before, after and floor on strikes that were not fitted, by effect."""
    lines = ["error in dB on holdout and transfer: before -> after (floor), share closed"]
    for name in (*LISTED, ""):
        mine = [r for r in rows if r["true"] == ([name] if name else []) and r.get("errors")]
        parts = []
        for split in ("holdout", "transfer"):
            three = [
                (r["errors"]["before"].get(split), r["errors"]["after"].get(split), r["errors"].get("floor"))
                for r in mine
                if isinstance(r["errors"].get("before"), dict) and isinstance(r["errors"].get("after"), dict)
            ]
            full = np.array([[_number(b), _number(a), _number(f, split)] for b, a, f in three], float).reshape(-1, 3)
            full = full[np.isfinite(full).all(axis=1)]
            if len(full):
                b, a, f = full.mean(axis=0)
                parts.append(
                    f"{split} {b:.2f} -> {a:.2f} ({f:.2f})"
                    + (f", {100 * (b - a) / (b - f):.0f} %" if b - f > 0.1 else "")
                )
        if parts:
            lines.append(f"  {name or 'nothing':18s} " + "   ".join(parts))
    return "\n".join(lines)


def _number(value: Any, split: str = "") -> float:
    if isinstance(value, dict):
        value = value.get(split)
    return float("nan") if value is None else float(value)


def closed(row: Row) -> float:
    """Share of the gap on strikes held out that what was named closes, NaN where none are."""
    before, after = (_number((row["errors"][when] or {}).get("holdout")) for when in ("before", "after"))
    return (before - after) / (before - _number(row["errors"]["floor"]))


def by_room(rows: list[Row]) -> str:
    """How many of each kind are right, in rooms as they are and in still ones, what names close, what a case cost."""
    right: dict[str, Callable[[Row], bool]] = {
        "single": _named,
        "null": lambda r: r["verdict"] == "none" and not r["found"],
        "pair": _named,
        "unlisted": lambda r: not r["found"] and r["verdict"] != "failed",
    }
    lines = ["right of those judged; share closed by right names, median and least; processor time, median and worst"]
    for name, is_live in (("rooms as they are", True), ("still rooms", False)):
        mine = [r for r in rows if r["case"].endswith("-live") == is_live]
        if not mine:
            continue
        cpu = np.array([r["cpu_s"] for r in mine])
        counts = [
            f"{kind} {sum(map(good, some))}/{len(some)}"
            for kind, good in right.items()
            if (some := _of(mine, f"{kind}-"))
        ]
        share = np.array([closed(r) for r in mine if r["found"] and _named(r)] or [np.nan])
        lines.append(
            f"  {name:18s} {'  '.join(counts)}   {np.median(share):.2f}, {share.min():.2f}   "
            f"{np.median(cpu):.0f} s, {cpu.max():.0f} s"
        )
    return "\n".join(lines)


def report(rows: list[Row], planned: int) -> str:
    """The whole report; counts are of cases that were judged, and those that were not are said."""
    singles, nulls, pairs, unlisted, poor = (
        _of(rows, *k.split()) for k in ("single-", "null-", "pair-", "unlisted-", "features- no-mesh-")
    )
    failed = [r for r in rows if r["verdict"] == "failed"]
    alarms = [r for r in nulls if r["found"] or r["verdict"] != "none"]
    wrong = [r for r in singles + pairs if set(r["found"]) - set(r["true"])]
    both = sum(set(r["true"]) <= set(r["found"]) for r in pairs)
    exact = sum(map(_named, pairs))
    lucky = [r for r in unlisted if r["found"]]
    cpu = np.array([r["cpu_s"] for r in rows] or [0.0])
    lines = [
        f"{len(rows)} of {planned} cases judged, {len(failed)} failed"
        + "".join(f"\n  {r['case']}: {r.get('why', '')}" for r in failed),
        confusion(singles),
        f"singles named: {sum(map(_named, singles))} of {len(singles)}; a wrong name in {len(wrong)} of "
        f"{len(singles) + len(pairs)} singles and pairs",
        f"false alarms: {len(alarms)} of {len(nulls)} nulls"
        + "".join(f"\n  {r['case']}: {r['verdict']} {'+'.join(r['found'])}" for r in alarms),
        f"pairs: both found {both} of {len(pairs)}, exactly {exact}"
        + "".join(
            f"\n  {'+'.join(r['true'])} -> {'+'.join(r['found']) or r['verdict']}" for r in pairs if not _named(r)
        ),
        f"unlisted: named wrongly {len(lucky)} of {len(unlisted)}"
        + "".join(f"\n  {r['case']}: {'+'.join(r['found']) or r['verdict']}" for r in unlisted),
        "without audio or mesh:" + "".join(f"\n  {r['case']}: {'+'.join(r['found']) or r['verdict']}" for r in poor),
        errors(singles + nulls),
        by_room(rows),
        f"CPU: median {np.median(cpu):.0f} s a case, worst {cpu.max():.0f} s",
    ]
    return "\n\n".join(lines)
