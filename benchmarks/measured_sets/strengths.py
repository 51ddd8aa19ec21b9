"""One body at several strengths: all but the loudest fitted, the loudest predicted, line by line.

J: the strikes' relative strength, by the body's own lowest strong lines.

frequency  f_k             -> amplitude-pitch    f_k (1 + b J²)                          b: one number of all lines
decay      d_k             -> amplitude-damping  d_k (1 + c J)                           c: one number
level      |A_k|/|A_ref|   -> contact-time       · |F̂(f τ(J))|/|F̂(f τ(J_ref))|, τ = τ₀ (J/J₀)^{−1/5}   τ₀: one number
null       the same with J, or the lines' order over frequency, shuffled
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.observed import lines
from benchmarks.measured_sets.values import DRAWS, Array, Lines, Outcome, Row, clear
from sonic_bullet.effects.common.pulses import magnitude
from sonic_bullet.effects.contact_time import ContactTime

LATE_S = {"agogo-forzee": 0.0015, "ride-bja": 0.003}
PART = {"agogo-forzee": (1.2, (500.0, 14000.0)), "ride-bja": (1.0, (300.0, 5000.0))}
SAME = 0.004  # relative: a line of two strikes
LEAST = 4  # lines common to all strikes
DB = 20 / np.log(10)


@dataclass(frozen=True, eq=False)
class Table:
    """k lines of s strikes, soft to loud: f, d, |A| (s, k); level (s,) relative, the softest 1."""

    freq_hz: Array
    decay_per_s: Array
    amplitude: Array
    level: Array
    name: tuple[str, ...]


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Every stroke of which there are two strengths or more. Raises ValueError where no stroke has lines in common."""
    late, (seconds, band) = LATE_S.get(case["set"], 0.002), PART.get(case["set"], (1.2, (200.0, 14000.0)))
    groups: dict[str, list[tuple[int, str, Lines]]] = {}
    skipped = []
    for entry in case["files"]:
        try:
            found = clear(
                lines(
                    folder / entry["file"], start_s=entry["t_hit_s"] + late, seconds=seconds, onset_s=0.0, band_hz=band
                ),
                sure=0.3,
                apart=0.003,
            )
            groups.setdefault(str(entry.get("stroke", entry.get("bell", ""))), []).append(
                (entry["strength_layer"], Path(entry["file"]).stem, found)
            )
        except Exception as error:  # one file less: the others are judged
            skipped.append(f"{entry['file']}: {error}")
    rows, texts, tables = [], [], []
    for stroke, strikes in groups.items():
        strikes.sort(key=lambda s: s[0])
        table = common([s[2] for s in strikes], [s[1] for s in strikes])
        if table is None or len(strikes) < 2:
            skipped.append(f"stroke '{stroke}': {len(strikes)} strengths with fewer than {LEAST} lines in common")
            continue
        more, text = judged(table, stroke)
        rows += more
        texts.append(text)
        tables.append(table)
    if not tables:
        raise ValueError("; ".join(skipped) or "no stroke has two strengths")
    left = (
        "decays and levels line by line differ between strikes by more than any law of level explains: where and "
        "with what was struck is not given"
    )
    return Outcome(tuple(rows), " ".join(texts), left, lambda figure: paint(figure, tables[0]), tuple(skipped))


def common(strikes: list[Lines], names: list[str]) -> Table | None:
    """Lines that all strikes have."""
    first, found = strikes[-1], []
    for k, f in enumerate(first.freq_hz):
        near = [np.abs(s.freq_hz / f - 1) for s in strikes]
        if all(len(n) and n.min() < SAME for n in near):
            found.append([int(n.argmin()) for n in near[:-1]] + [k])
    if len(found) < LEAST:
        return None
    index = np.array(found).T
    freq, decay, size = (
        np.stack([getattr(s, n)[i] for s, i in zip(strikes, index, strict=True)])
        for n in ("freq_hz", "decay_per_s", "amplitude")
    )
    low = np.argsort(freq[0])[: max(3, freq.shape[1] // 4)]
    return Table(freq, decay, size, np.exp(np.log(size[:, low] / size[0, low]).mean(axis=1)), tuple(names))


def judged(t: Table, stroke: str) -> tuple[list[Row], str]:
    """Rows of one stroke, and what they say."""
    soft, loud, rng = t.level[:-1] / t.level[-1], 1.0, np.random.default_rng(0)
    label = f"{stroke}: " if stroke else ""
    ends = f"{t.name[-1]} from {', '.join(t.name[:-1])}"
    rows = []
    if len(soft) > 1:  # one soft strike tells no law of level
        y = np.log(t.freq_hz[:-1] / t.freq_hz[0])
        rows.append(
            _power(
                f"{label}frequency of {ends}",
                "ppm of f",
                1e6,
                y,
                np.log(t.freq_hz[-1] / t.freq_hz[0]),
                soft,
                loud,
                2,
                "amplitude-pitch",
                rng,
            )
        )
        y = np.log(t.decay_per_s[:-1] / t.decay_per_s[0])
        rows.append(
            _power(
                f"{label}decay of {ends}",
                "dB of d",
                DB,
                y,
                np.log(t.decay_per_s[-1] / t.decay_per_s[0]),
                soft,
                loud,
                1,
                "amplitude-damping",
                rng,
            )
        )
        rows.append(_levels(t, f"{label}level of {ends}", rng))
    else:
        for what, unit, scale, values in (
            ("frequency", "ppm of f", 1e6, t.freq_hz),
            ("decay", "dB of d", DB, t.decay_per_s),
        ):
            error = float(np.median(np.abs(scale * np.log(values[-1] / values[0]))))
            rows.append(Row(f"{label}{what} of {ends}", values.shape[1], unit, error, error, np.nan, 1.0, ""))
    shift = 1e6 * np.log(t.freq_hz[-1] / t.freq_hz[0])
    text = (
        f"{label or 'Strikes '}{t.freq_hz.shape[1]} lines in common, strengths "
        f"{', '.join(f'{20 * np.log10(v):.0f}' for v in t.level)} dB. Loudest against softest: frequency "
        f"{np.median(shift):+.0f} ppm at the median line (quartiles {np.quantile(shift, 0.25):+.0f}, "
        f"{np.quantile(shift, 0.75):+.0f}), decay "
        f"{DB * np.median(np.log(t.decay_per_s[-1] / t.decay_per_s[0])):+.1f} dB."
    )
    return rows, text


def _power(
    what: str,
    unit: str,
    scale: float,
    y: Array,
    told: Array,
    soft: Array,
    loud: float,
    power: int,
    effect: str,
    rng: np.random.Generator,
) -> Row:
    """ln of a line's number over the first strike's goes as c (J^p − J₀^p): c on the soft ones, by the median slope of
    lines.
    """

    def error(level: Array, top: float) -> float:
        x = level**power - level[0] ** power
        slope = float(np.median((x[:, None] * y).sum(axis=0) / max(float((x**2).sum()), 1e-12)))
        return float(np.median(np.abs(scale * (told - slope * (top**power - level[0] ** power)))))

    before, after = float(np.median(np.abs(scale * told))), error(soft, loud)
    drawn = rng.uniform(0, 1, (DRAWS, len(soft) + 1))
    nulls = np.array([error(v[:-1], float(v[-1])) for v in drawn])
    return Row(what, len(told), unit, before, after, float(np.median(nulls)), float((nulls <= after).mean()), effect)


def _levels(t: Table, what: str, rng: np.random.Generator) -> Row:
    """Levels of the loudest from the strike before it, one gain free in both; τ₀ from the strikes before."""
    y = DB * np.log(t.amplitude / t.amplitude[0])

    def law(tau: float, freq: Array) -> Array:
        made = ContactTime(tau, float(t.level[0]))
        told = np.stack([np.abs(magnitude("half-sine", freq * made.duration_s(float(j)))) for j in t.level])
        return DB * np.log(np.maximum(told, 0.03) / np.maximum(told[0], 0.03))

    def misfit(left: Array) -> Array:
        return np.median(np.abs(left - np.median(left, axis=-1, keepdims=True)), axis=-1)

    def error(freq: Array) -> float:
        taus = np.geomspace(0.1 / freq.max(), 1.3 / freq.max(), 40)
        best = min(taus, key=lambda tau: float(misfit(y[1:-1] - law(tau, freq)[1:-1]).sum()))
        return float(misfit(y[-1] - law(best, freq)[-1]))

    freq = t.freq_hz[0]
    before, after = float(misfit(y[-1])), error(freq)
    nulls = np.array([error(rng.permutation(freq)) for _ in range(40)])
    return Row(
        what, len(freq), "dB", before, after, float(np.median(nulls)), float((nulls <= after).mean()), "contact-time"
    )


def paint(figure: Any, t: Table) -> None:
    """Shift of frequency and of decay of each strike against the softest."""
    left, right = figure.subplots(1, 2)
    for i, name in enumerate(t.name[1:], 1):
        left.plot(t.freq_hz[0] / 1e3, 1e6 * np.log(t.freq_hz[i] / t.freq_hz[0]), "o", ms=3, label=name)
        right.plot(t.freq_hz[0] / 1e3, DB * np.log(t.decay_per_s[i] / t.decay_per_s[0]), "o", ms=3)
    for axes, what in ((left, "frequency, ppm"), (right, "decay, dB")):
        axes.axhline(0, color="0.7", lw=0.8)
        axes.set_xlabel("kHz")
        axes.set_ylabel(f"{what}, over {t.name[0]}")
    left.legend(fontsize=6)
