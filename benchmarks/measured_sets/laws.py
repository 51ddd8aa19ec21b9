"""Which law decays follow, told on some lines and judged on others.

baseline  d = ½(α + βω²), ln d by least squares under Cauchy's loss
    [Rayleigh; physics of ../sonic_bullet/effects/damping_law.py]
effect    DampingLaw.propose on the fitted lines
null      baseline · exp Σ c_i cos(q_i ln f + φ_i), q, φ at random, c fitted, as many as the effect has numbers
error     median |20 lg d'/d| over the lines held out
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.measured_sets.values import DRAWS, Array, Lines, Row, evidence
from sonic_bullet.effects.damping_law import DampingLaw

DB = 20 / np.log(10)
SCATTER = 0.02


@dataclass(frozen=True)
class Validation:
    """α and β of the baseline, the law that was proposed or None, and the row."""

    alpha_per_s: float
    beta_s: float
    law: DampingLaw | None
    row: Row

    def before(self, omega: Array) -> Array:
        return 0.5 * (self.alpha_per_s + self.beta_s * omega**2)

    def after(self, omega: Array) -> Array:
        return self.law.decay_per_s(omega) if self.law is not None else self.before(omega)

    @property
    def said(self) -> str:
        if self.law is None:
            return f"Rayleigh α = {self.alpha_per_s:.3g} 1/s, β = {self.beta_s:.3g} s"
        return ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else str(v) for k, v in self.law.parameters().items())


def rayleigh(lines: Lines) -> tuple[float, float]:
    """α, β of lines, in the logarithm of d, as the effect's own laws are fitted: no gain by another loss."""
    from scipy.optimize import least_squares

    w, y = lines.omega, np.log(lines.decay_per_s)
    sd = np.hypot(np.minimum(lines.decay_sd_per_s / lines.decay_per_s, 1.0), SCATTER)
    starts = [
        np.log([2 * lines.decay_per_s.min(), 2 * np.median(lines.decay_per_s / w**2)]),
        np.log([1e-3, 2 * np.median(lines.decay_per_s / w**2)]),
    ]
    starts.append(np.log([2 * np.median(lines.decay_per_s), 1e-12]))
    found = [
        least_squares(
            lambda p: (np.log(0.5 * (np.exp(p[0]) + np.exp(p[1]) * w**2)) - y) / sd,
            s,
            loss="cauchy",
            f_scale=2.0,
            bounds=(-40, 40),
        )
        for s in starts
    ]
    best = min(found, key=lambda f: f.cost).x
    return float(np.exp(best[0])), float(np.exp(best[1]))


def error_db(predicted: Array, true: Array) -> float:
    return float(np.median(np.abs(DB * np.log(predicted / true)))) if len(true) else float("nan")


def null_errors(fit: Lines, base: Array, held: Lines, held_base: Array, numbers: int, seed: int = 0) -> Array:
    """Errors (DRAWS,) on the held-out lines of a null effect of as many numbers."""
    rng = np.random.default_rng(seed)
    x, y = np.log(fit.freq_hz), np.log(held.freq_hz)
    middle, width = x.mean(), max(float(np.ptp(np.concatenate([x, y]))), 0.1)
    left, found = np.log(fit.decay_per_s / base), np.empty(DRAWS)
    for i in range(DRAWS):
        q, phase = rng.uniform(0.3, 3.0, numbers) * np.pi / width, rng.uniform(0, 2 * np.pi, numbers)
        columns, ahead = (np.cos(np.multiply.outer(z - middle, q) + phase) for z in (x, y))
        weight = np.ones(len(left))
        c = np.zeros(numbers)
        for _ in range(4):
            root = np.sqrt(weight)[:, None]
            c = np.linalg.lstsq(
                np.vstack([columns * root, 0.05 * np.eye(numbers)]),
                np.concatenate([left * root[:, 0], np.zeros(numbers)]),
                rcond=None,
            )[0]
            weight = 1 / (1 + ((left - columns @ c) / 0.2) ** 2)
        found[i] = error_db(held_base * np.exp(ahead @ c), held.decay_per_s)
    return found


def validated(what: str, fit: list[Lines], held: list[Lines], *, seed: int = 0) -> Validation:
    """The law of the fitted bodies on the held-out lines. Raises ValueError where there are too few lines."""
    mine, other = joined(fit), joined(held)
    if len(mine.freq_hz) < 2 or len(other.freq_hz) < 1:
        raise ValueError(
            f"{len(mine.freq_hz)} lines to fit and {len(other.freq_hz)} to predict: too few for a law of decay"
        )
    alpha, beta = rayleigh(mine)
    law = DampingLaw.propose(evidence(fit))
    base, ahead = (0.5 * (alpha + beta * x.omega**2) for x in (mine, other))
    before = error_db(ahead, other.decay_per_s)
    after = error_db(law.decay_per_s(other.omega), other.decay_per_s) if law is not None else before
    nulls = null_errors(mine, base, other, ahead, law.freedom() if law is not None else 2, seed)
    effect = f"damping-law ({law.law})" if law is not None else ""
    return Validation(
        alpha,
        beta,
        law,
        Row(
            what,
            len(other.freq_hz),
            "dB of d",
            before,
            after,
            float(np.median(nulls)),
            float((nulls <= after).mean()),
            effect,
        ),
    )


def joined(bodies: list[Lines]) -> Lines:
    return Lines(
        *(
            np.concatenate([getattr(b, n) for b in bodies])
            for n in ("freq_hz", "decay_per_s", "decay_sd_per_s", "amplitude", "freq_sd_hz")
        )
    )


def draw(axes: Any, validations: list[Validation], fit: list[Lines], held: list[Lines], title: str = "") -> None:
    """d against f: fitted lines full, held-out ones hollow; baseline dashed, effect drawn through."""
    mine, other = joined(fit), joined(held)
    axes.loglog(mine.freq_hz, mine.decay_per_s, "o", ms=3.5, color="0.35", label="fitted")
    axes.loglog(other.freq_hz, other.decay_per_s, "o", ms=5, mfc="none", color="C3", label="held out")
    f = np.geomspace(min(mine.freq_hz.min(), other.freq_hz.min()), max(mine.freq_hz.max(), other.freq_hz.max()), 200)
    for i, t in enumerate(validations):
        axes.loglog(f, t.before(2 * np.pi * f), "--", lw=1, color="C0", label="Rayleigh" if not i else None)
        if t.law is not None:
            axes.loglog(f, t.after(2 * np.pi * f), "-", lw=1.2, color="C2", label=t.law.law)
    axes.set_xlabel("frequency in Hz")
    axes.set_ylabel("decay in 1/s")
    axes.set_title(title, fontsize=8)
    axes.legend(fontsize=6)
