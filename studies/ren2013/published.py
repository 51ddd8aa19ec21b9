"""The figures that the paper gives [Ren, Yeh, Lin 2013, Tables I and II]: what was estimated, and what it took.

α and β are in 1/s and s. γ and σ are in units that the paper does not name: γ of metal lies below any
metal's E/ρ in m²/s², and the ratio differs by material. Times are of one 2.8 GHz core of a Xeon X5560 of 2009.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Published:
    """One material. Table I: α, β, γ, σ. Table II: starts, mean iterations a start, mean seconds a start."""

    alpha_per_s: float
    beta_s: float
    gamma: float
    sigma: float
    starts: int
    iterations: int
    seconds_a_start: float


MATERIALS = {
    "wood": Published(2.1364, 3.0828e-6, 6.6625e5, 3.3276e-6, 60, 1011, 46.5),
    "plastic": Published(52.627, 8.7753e-7, 8.9008e4, 2.2050e-6, 210, 904, 49.4),
    "metal": Published(6.3035, 2.1160e-8, 4.5935e5, 9.2624e-6, 50, 1679, 393.5),
    "porcelain": Published(0.037388, 8.4142e-8, 3.7068e5, 4.3800e-7, 80, 1451, 131.3),
    "glass": Published(18.301, 1.4342e-7, 2.0282e5, 1.1336e-6, 190, 1156, 68.9),
}


def tables() -> str:
    """Both tables as one, in Markdown."""
    rows = [
        f"| {name} | {m.alpha_per_s:g} | {m.beta_s:.4e} | {m.gamma:.4e} | {m.sigma:.4e} "
        f"| {m.starts} | {m.iterations} | {m.seconds_a_start:g} |"
        for name, m in MATERIALS.items()
    ]
    head = "| paper's material | α 1/s | β s | γ | σ | starts | iterations a start | s a start |"
    return "\n".join([head, "|---" * 8 + "|", *rows])
