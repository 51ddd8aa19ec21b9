"""Hits of an instrumented hammer: the softer ones fitted, the louder ones predicted, force known.

    contact time   τ of the soft hits' mean   -> contact-time  τ₀ (J/J₀)^{−1/5}
        error: median |τ'/τ − 1|; null: J^x, x drawn from −½ to ½
    lines          |A_k| = g_k J              -> contact-time  g_k J |F̂(f_k τ(J))|/|F̂(0)|
        g_k, τ₀ by the soft hits
                                              -> the measured pulse's own spectrum |F(f_k)|
    null           τ₀ and exponent at random (τ₀ in 0.2 to 5 of it, x as above)

J = ∫F dt over the contact, τ: where F exceeds a tenth of its peak, times what a half-sine needs: 1/(1 − 2 asin(0.1)/π).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.observed import cut, features, jittered, lines
from benchmarks.measured_sets.values import DRAWS, Array, Lines, Outcome, Row, clear
from sonic_bullet.effects.common.pulses import magnitude
from sonic_bullet.effects.contact_time import ContactTime

HALF_SINE = 1 / (1 - 2 * np.arcsin(0.1) / np.pi)
AFTER_S = 0.0015
DB = 20 / np.log(10)
SAME = 0.006
FULL = 0.98  # of full scale


@dataclass(frozen=True, eq=False)
class Hit:
    """impulse, tau_s; pulse (n,) force at sr; lines after it; clipped: samples of the sound at its limit."""

    impulse: float
    tau_s: float
    pulse: Array
    sr: int
    lines: Lines
    clipped: int

    def spectrum(self, freq_hz: Array) -> Array:
        """|F(f)| over F(0)."""
        t = np.arange(len(self.pulse)) / self.sr
        return np.abs(np.exp(-2j * np.pi * np.multiply.outer(freq_hz, t)) @ self.pulse) / abs(self.pulse.sum())


def pulse(force: Array, sr: int, at_s: float) -> tuple[float, float, Array]:
    """Impulse, τ and the pulse (n,) of the hit nearest to a time."""
    first = max(round((at_s - 0.003) * sr), 0)
    part = force[first : round((at_s + 0.006) * sr)]
    part = part - np.median(force[max(first - sr // 50, 0) : max(first, 1)])
    top = int(part.argmax())
    over = part > 0.1 * part[top]
    begin = top - int(np.argmin(over[: top + 1][::-1])) + 1 if not over[: top + 1].all() else 0
    end = top + int(np.argmin(over[top:])) if not over[top:].all() else len(part)
    # where the straight line crosses a tenth
    left = (part[begin] - 0.1 * part[top]) / max(part[begin] - part[max(begin - 1, 0)], 1e-12)
    right = (part[end - 1] - 0.1 * part[top]) / max(part[end - 1] - part[min(end, len(part) - 1)], 1e-12)
    width = (end - 1 - begin + min(left, 1.0) + min(right, 1.0)) / sr
    shape = np.maximum(part[max(begin - 2, 0) : end + 2], 0.0)
    return float(shape.sum() / sr), float(width * HALF_SINE), shape


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Each object by itself, its louder half predicted. Raises ValueError where no object can be read."""
    objects, skipped = {}, []
    for entry in case["files"]:
        try:
            path = folder / entry["file"]
            name = entry.get("object", case.get("object", path.stem)).split(" (")[0]
            objects[name] = (
                _measured(path, float(entry["fs_hz"])) if path.suffix == ".npz" else _hits(path, entry["hits"])
            )
        except Exception as error:  # one object less: the others are judged
            skipped.append(f"{entry['file']}: {error}")
    if not objects:
        raise ValueError("; ".join(skipped))
    rows, texts = [], []
    for name, hits in objects.items():
        if len(hits) < 2:
            skipped.append(f"{name}: one hit, nothing to predict")
            continue
        hits.sort(key=lambda h: h.impulse)
        soft, loud = hits[: (len(hits) + 1) // 2], hits[(len(hits) + 1) // 2 :]
        rows += [*judged(name, soft, loud), *levels(name, soft, loud)]
        slope = exponent(hits)
        texts.append(
            f"{name}: {len(hits)} hits, J over {20 * np.log10(hits[-1].impulse / hits[0].impulse):.0f} dB, τ "
            f"{1e3 * min(h.tau_s for h in hits):.2f} to "
            f"{1e3 * max(h.tau_s for h in hits):.2f} ms, τ ~ J^{slope:+.2f}; {sum(h.clipped for h in hits)} "
            "samples at the limit."
        )
    left = (
        "places of the hits are not given and vary, so a line's level per impulse moves by several dB from "
        "hit to hit, before and after alike; "
        "with two to five hits an exponent of −1/5 cannot be distinguished from 0"
    )
    return Outcome(tuple(rows), " ".join(texts), left, lambda figure: paint(figure, objects), tuple(skipped))


def _hits(path: Path, told: list[dict[str, Any]]) -> list[Hit]:
    found = []
    force, sr = cut(path, 1)
    for h in told:
        impulse, tau, shape = pulse(force, sr, h["t_hit_s"])
        seconds = min(h["ring_window_s"] - 0.01, 0.5)
        mine = clear(
            lines(path, start_s=h["t_hit_s"] + AFTER_S, seconds=seconds, onset_s=0.0, band_hz=(200.0, 14000.0)),
            sure=0.3,
        )
        sound, _ = cut(path, 0, h["t_hit_s"], seconds)
        mine = Lines(
            mine.freq_hz,
            mine.decay_per_s,
            mine.decay_sd_per_s,
            mine.amplitude * np.exp(mine.decay_per_s * AFTER_S),
            mine.freq_sd_hz,
        )
        found.append(Hit(impulse, tau, shape, sr, mine, int((np.abs(sound) > FULL).sum())))
    return found


def _measured(path: Path, fs_hz: float) -> list[Hit]:
    """Hits in an npz of force (s, n) and accel (s, n), a hit a row."""
    with np.load(path, allow_pickle=False) as kept:
        rows = list(zip(kept["force"], kept["accel"], strict=True))
    found, sr = [], round(fs_hz)
    for force, sound in rows:
        at = float(np.argmax(force)) / fs_hz
        impulse, tau, shape = pulse(np.asarray(force, float), sr, at)
        first = round((at + AFTER_S) * fs_hz)
        mine = clear(
            features(
                jittered(np.ascontiguousarray(sound[first : first + round(0.5 * fs_hz)], float)),
                sr,
                onset_s=0.0,
                band_hz=(200.0, 0.45 * fs_hz),
            ),
            sure=0.3,
        )
        mine = Lines(
            mine.freq_hz,
            mine.decay_per_s,
            mine.decay_sd_per_s,
            mine.amplitude * np.exp(mine.decay_per_s * AFTER_S),
            mine.freq_sd_hz,
        )
        found.append(Hit(impulse, tau, shape, sr, mine, 0))
    return found


def exponent(hits: list[Hit]) -> float:
    """x of τ ~ J^x by least squares; 0 where all J are alike."""
    x, y = np.log([h.impulse for h in hits]), np.log([h.tau_s for h in hits])
    return float(np.polyfit(x, y, 1)[0]) if np.ptp(x) > 0.1 else 0.0


def law(soft: list[Hit], x: float = -0.2, scale: float = 1.0) -> ContactTime:
    """τ ~ J^x through the middle of the soft hits."""
    j = float(np.exp(np.mean([np.log(h.impulse) for h in soft])))
    return ContactTime(scale * float(np.exp(np.mean([np.log(h.tau_s) for h in soft]))), j, x)


def judged(name: str, soft: list[Hit], loud: list[Hit], seed: int = 0) -> list[Row]:
    """The loud hits' contact times."""
    told = np.array([h.tau_s for h in loud])

    def error(x: float) -> float:
        made = law(soft, x)
        return float(np.median(np.abs(100 * (np.array([made.duration_s(h.impulse) for h in loud]) / told - 1))))

    nulls = np.array([error(x) for x in np.random.default_rng(seed).uniform(-0.5, 0.5, DRAWS)])
    return [
        Row(
            f"{name}: contact time",
            len(loud),
            "% of τ",
            error(0.0),
            error(-0.2),
            float(np.median(nulls)),
            float((nulls <= error(-0.2)).mean()),
            "contact-time (τ ~ J^-1/5)",
        )
    ]


def levels(name: str, soft: list[Hit], loud: list[Hit], seed: int = 0) -> list[Row]:
    """The loud hits' lines, by the soft hits' lines per impulse."""
    found = [
        (
            h,
            k,
            [
                (s, int(i))
                for s in soft
                if len(s.lines.freq_hz)
                for i in [np.argmin(np.abs(s.lines.freq_hz / h.lines.freq_hz[k] - 1))]
            ],
        )
        for h in loud
        for k in range(len(h.lines.freq_hz))
    ]
    pairs = [
        (h, k, [(s, i) for s, i in near if abs(s.lines.freq_hz[i] / h.lines.freq_hz[k] - 1) < SAME])
        for h, k, near in found
    ]
    pairs = [p for p in pairs if p[2]]
    if len(pairs) < 3:
        return []

    def error(share: Any) -> float:
        off = []
        for h, k, near in pairs:
            gain = np.mean([np.log(s.lines.amplitude[i] / (s.impulse * share(s, s.lines.freq_hz[i]))) for s, i in near])
            off.append(abs(DB * (np.log(h.lines.amplitude[k] / (h.impulse * share(h, h.lines.freq_hz[k]))) - gain)))
        return float(np.median(off))

    def by(made: ContactTime) -> float:
        return error(
            lambda h, f: max(abs(float(magnitude("half-sine", np.array([f * made.duration_s(h.impulse)]))[0])), 0.02)
        )

    rng = np.random.default_rng(seed)
    before, after = error(lambda h, f: 1.0), by(law(soft))
    nulls = np.array(
        [
            by(law(soft, x, c))
            for x, c in zip(rng.uniform(-0.5, 0.5, 60), np.exp(rng.uniform(np.log(0.2), np.log(5), 60)), strict=True)
        ]
    )
    own = error(lambda h, f: max(float(h.spectrum(np.array([f]))[0]), 0.02))
    chance = [float((nulls <= e).mean()) for e in (after, own)]
    middle = float(np.median(nulls))
    kinds = ((after, "contact-time (half-sine, τ ~ J^-1/5)"), (own, "contact-time (measured pulse)"))
    return [
        Row(f"{name}: level of lines", len(pairs), "dB", before, e, middle, c, what)
        for (e, what), c in zip(kinds, chance, strict=True)
    ]


def paint(figure: Any, objects: dict[str, list[Hit]]) -> None:
    left, right = figure.subplots(1, 2)
    for name, hits in objects.items():
        hits.sort(key=lambda h: h.impulse)
        left.loglog([h.impulse for h in hits], [1e3 * h.tau_s for h in hits], "o", ms=4, label=name[:16])
        made = law(hits[: (len(hits) + 1) // 2])
        left.loglog(
            [h.impulse for h in hits],
            [1e3 * made.duration_s(h.impulse) for h in hits],
            "-",
            lw=0.8,
            color=left.lines[-1].get_color(),
        )
        f = np.linspace(100, 8000, 160)
        right.plot(f / 1e3, 20 * np.log10(np.maximum(hits[-1].spectrum(f), 1e-3)), lw=1)
    left.set_xlabel("J in full scale · s")
    left.set_ylabel("τ in ms (line: τ ~ J^-1/5)")
    left.legend(fontsize=6)
    right.set_xlabel("kHz")
    right.set_ylabel("|F| over F(0), dB, loudest hit")
