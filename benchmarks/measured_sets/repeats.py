"""Taps of one piece at two dates: repeatability, and what a month did.

Every second tap of each date fitted, the others predicted.

frequency  f_k of all fitted taps -> one factor of all lines a date: √(E/ρ) has changed
    error: median |Δf|/f, ppm
decay      d_k of all fitted taps -> one factor of all lines a date
           each line by the factor of the others: one that is every line's own tells nothing of the next
null       the same with the dates of the fitted taps drawn by lot
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.observed import lines
from benchmarks.measured_sets.values import DRAWS, Array, Lines, Outcome, Row, clear

TAPS = 16  # of a recording
NEAR, MOVED = 0.012, 0.04  # relative: from tap to tap, from date to date
MOST = 0.6
DB = 20 / np.log(10)


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Raises ValueError where there are not two dates of one piece."""
    taps: list[tuple[str, Lines]] = []
    skipped = []
    for entry in case["files"]:
        for hit in entry["hits"][:TAPS]:
            try:
                seconds = min(hit["ring_window_s"] - 0.01, 0.3)
                found = lines(
                    folder / entry["file"],
                    start_s=hit["t_hit_s"] + 0.003,
                    seconds=seconds,
                    onset_s=0.0,
                    band_hz=(500.0, 8000.0),
                )
                taps.append((entry["date"], clear(found, sure=0.2)))
            except Exception as error:  # one tap less: the others are judged
                skipped.append(f"{entry['file']} at {hit.get('t_hit_s')} s: {error}")
    dates = sorted({t[0] for t in taps})
    if len(dates) != 2:
        raise ValueError(f"{len(dates)} dates with taps: two are compared")
    late = np.array([t[0] == dates[1] for t in taps])
    freq, decay = table([t[1] for t in taps], late)
    if freq.shape[1] < 2:
        raise ValueError("one line alone that most taps of both dates have: what is every line's takes two to tell")
    rows = [
        judged("frequencies of taps left out", "ppm of f", 1e6, freq, late, "stiffness drift (one factor a date)"),
        judged("decays of taps left out", "dB of d", DB, decay, late, "damping drift (one factor a date)"),
    ]
    first, last = np.nanmedian(freq[~late], axis=0), np.nanmedian(freq[late], axis=0)
    apart = np.nanmedian(np.abs(freq - np.where(late[:, None], last, first)), axis=0)
    share = [1e6 * (b / a - 1) for a, b in zip(first, last, strict=True)]
    text = (
        f"{int((~late).sum())} taps on {dates[0]}, {int(late.sum())} on {dates[1]}. Lines: "
        + "; ".join(
            f"{f:.0f} Hz (repeats to {1e6 * r / f:.0f} ppm, moved by {s:+.0f} ppm)"
            for f, r, s in zip(first, apart, share, strict=True)
        )
        + ". A drift of stiffness is no member of the effects' family: it belongs to the piece's moisture and "
        "age; one factor for all lines is the physics of E/ρ alone."
    )
    spread, repeats = float(np.ptp(share)), float(np.median(1e6 * apart / first))
    alike = f"lines move by amounts that differ by {spread:.0f} ppm among themselves"
    why = (
        "more than one stiffness, or another hanging"
        if spread > 2 * repeats
        else f"no more than they repeat from tap to tap ({repeats:.0f} ppm)"
    )
    left = f"{alike}: {why}; dimensions and mass are not given, E is not known"
    return Outcome(tuple(rows), text, left, lambda figure: paint(figure, freq, late, dates), tuple(skipped))


def table(taps: list[Lines], late: Array) -> tuple[Array, Array]:
    """f and d (taps, k) of the lines that most taps of either date have; NaN where a tap lacks one.

    A month may move a piece by more than its neighbouring lines are apart from tap to tap: lines are found date by
    date, and two dates' are one where each is the other's nearest, within MOVED.
    """
    first, last = (often([t for t, x in zip(taps, late, strict=True) if x == side]) for side in (False, True))
    pairs = [
        (a, b)
        for a in first
        for b in last
        if abs(b / a - 1) < MOVED and b == _nearest(last, a) and a == _nearest(first, b)
    ]
    if not pairs:
        raise ValueError("no line that most taps of both dates have")
    rows = np.full((2, len(taps), len(pairs)), np.nan)
    for i, t in enumerate(taps):
        for k, pair in enumerate(pairs):
            j = int(np.abs(t.freq_hz / pair[int(late[i])] - 1).argmin()) if len(t.freq_hz) else -1
            if j >= 0 and abs(t.freq_hz[j] / pair[int(late[i])] - 1) < NEAR:
                rows[:, i, k] = t.freq_hz[j], t.decay_per_s[j]
    return rows[0], rows[1]


def often(taps: list[Lines]) -> list[float]:
    """Frequencies in Hz that most of these taps have, ascending."""
    every = np.sort(np.concatenate([t.freq_hz for t in taps]))
    found: list[float] = []
    for group in np.split(every, np.flatnonzero(np.diff(np.log(every)) > NEAR / 3) + 1):
        m = float(np.median(group))
        if np.mean([bool((np.abs(t.freq_hz / m - 1) < NEAR).any()) for t in taps]) > MOST and (
            not found or m / found[-1] > 1 + NEAR
        ):
            found.append(m)  # what lies nearer is the same line of every tap
    return found


def _nearest(among: list[float], freq_hz: float) -> float:
    return min(among, key=lambda f: abs(np.log(f / freq_hz)))


def judged(what: str, unit: str, scale: float, value: Array, late: Array, effect: str) -> Row:
    """Even taps fitted, odd ones predicted."""
    y, fit = np.log(value), np.arange(len(value)) % 2 == 0
    held = ~fit

    def error(date: Array, told: Array) -> float:
        middle = np.stack([np.nanmedian(y[fit & (date == side)], axis=0) for side in (False, True)])
        moved = middle[1] - middle[0]
        factor = (
            np.array([np.nanmedian(np.delete(moved, k)) for k in range(len(moved))]) if len(moved) > 1 else np.zeros(1)
        )
        base = np.nanmedian(np.where(date[fit][:, None], y[fit] - factor, y[fit]), axis=0)
        return float(np.nanmedian(np.abs(scale * (y[held] - base - factor * told[held][:, None]))))

    before = float(np.nanmedian(np.abs(scale * (y[held] - np.nanmedian(y[fit], axis=0)))))
    after, rng = error(late, late), np.random.default_rng(0)
    nulls = []
    for _ in range(DRAWS):
        lot = late.copy()
        lot[fit] = rng.permutation(late[fit])
        nulls.append(error(lot, late))
    return Row(
        what,
        int(np.isfinite(y[held]).sum()),
        unit,
        before,
        after,
        float(np.median(nulls)),
        float((np.array(nulls) <= after).mean()),
        effect,
    )


def paint(figure: Any, freq: Array, late: Array, dates: list[str]) -> None:
    axes = figure.subplots()
    base = np.nanmedian(freq[~late], axis=0)
    for k in range(min(freq.shape[1], 6)):
        axes.plot(1e6 * (freq[:, k] / base[k] - 1), "o", ms=3, label=f"{base[k]:.0f} Hz")
    axes.axvline(int((~late).sum()) - 0.5, color="0.6", lw=0.8)
    axes.set_xlabel(f"tap ({dates[0]}, then {dates[1]})")
    axes.set_ylabel("Δf/f in ppm")
    axes.legend(fontsize=6, ncols=2)
