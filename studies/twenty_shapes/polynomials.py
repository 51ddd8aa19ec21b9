"""The truth of a drawing: polynomials of degree 3, 4, 5 on two meshes of curved tetrahedra, by NGSolve.

    Drawing -> Netgen's tetrahedra in two sizes, curved to degree 3 -> K, M of each degree -> free modes, ascending
    f(p) = f∞ + c p^-s  of three degrees, s between 4λ = 2.18 (a crease of 90°) and 12 (smooth)  -> f∞ of each mesh

Spaces of one mesh contain each other, so each degree's modes lie above the next one's [Strang & Fix 1973, 6.2]; what is
left falls as p^-4λ beside a crease of exponent λ, faster where it is smooth [Babuška & Suri 1994, sec. 3]. Uncertain by
what the two meshes' limits differ, and by half of what is carried on from the last degree of the fine one.
"""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from sonic_bullet.records import Array

CURVED = 3  # less than no degree: turning is then among the polynomials
DEGREES = (3, 4, 5)
RIGID = 6
VOLUME = 1e-4  # share by which a mesh may differ from its drawing
ROUND = ((0.8, 0.4), (1.5, 1.0), (2.0, 0.6), (2.5, 1.5))  # what Netgen is asked for: cells a radius, cells an edge
CREASE, SMOOTH = 2.18, 12.0  # 4λ with λ = 0.5445, free faces that meet at 270° [Williams 1952]
PACKAGE = "ngsolve"
MOST = 80_000  # unknowns; larger than that no degree is solved on the finer mesh


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """frequency_hz (m,) of the free modes of one degree; unknowns; processor time; peak memory so far."""

    frequency_hz: Array
    unknowns: int
    processor_s: float
    peak_bytes: int


def mesh(shape: Any, edge_mm: float) -> tuple[Any, float]:
    """NGSolve's mesh of a drawing, in mm, curved on its surface, and by what share its volume is off the drawing's.
    Netgen folds some curved cells: it is asked for finer ones at what is round until the volume is right.
    """
    import ngsolve as ng
    from netgen.occ import OCCGeometry

    found = []
    for safety, segments in ROUND:
        made = ng.Mesh(
            OCCGeometry(shape).GenerateMesh(maxh=edge_mm, grading=0.6, curvaturesafety=safety, segmentsperedge=segments)
        )
        made.Curve(CURVED)
        off = float(ng.Integrate(ng.CF(1) * ng.dx(bonus_intorder=2 * CURVED), made) / shape.mass - 1)
        found.append((abs(off), made, off))
        if abs(off) < VOLUME:
            break
    _, made, off = min(found, key=lambda one: one[0])
    return made, off


def degrees(made: Any) -> tuple[int, ...]:
    """Which of `DEGREES` are solved on the finer mesh: two at least, those of `MOST` unknowns at most."""
    import ngsolve as ng

    few = sum(ng.VectorH1(made, order=p).ndof <= MOST for p in DEGREES)
    return DEGREES[: max(few, 2)]


def solve(made: Any, degree: int, youngs_pa: float, poisson: float, density_kg_m3: float, count: int) -> Solved:
    """Lowest ``count`` modes of a free body on a mesh in mm by polynomials of one degree."""
    import ngsolve as ng

    began = time.process_time()
    space = ng.VectorH1(made, order=degree)
    u, v = space.TnT()
    shear = youngs_pa / (2 * (1 + poisson))
    bulk = youngs_pa * poisson / ((1 + poisson) * (1 - 2 * poisson))

    def strain(w: Any) -> Any:
        return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

    work = (2 * shear * ng.InnerProduct(strain(u), strain(v)) + bulk * ng.div(u) * ng.div(v)) * 1e6
    turn = ng.dx(bonus_intorder=2 * (CURVED - 1))
    mass = ng.BilinearForm(density_kg_m3 * u * v * turn, symmetric=True).Assemble().mat
    span = np.ptp(np.array([vertex.point for vertex in made.vertices]), axis=0).max() / 1000
    shift = (2 * np.pi * 0.02 / span) ** 2 * youngs_pa / density_kg_m3 * 0.01
    form = ng.BilinearForm(work * turn + shift * density_kg_m3 * u * v * turn, symmetric=True).Assemble().mat
    inverse = form.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    size = space.ndof
    given, got = form.CreateColVector(), form.CreateColVector()

    def apply(operator: Any) -> LinearOperator:
        def product(x: Array) -> Array:
            given.FV().NumPy()[:] = x.ravel()
            got.data = operator * given
            return got.FV().NumPy().copy()

        return LinearOperator((size, size), matvec=product, dtype=float)

    value = eigsh(
        apply(form), k=count + RIGID, M=apply(mass), sigma=0.0, OPinv=apply(inverse), which="LM", tol=1e-8,
        return_eigenvectors=False,
    )  # fmt: skip
    hertz = np.sqrt(np.maximum(np.sort(value) - shift, 0)) / (2 * np.pi)
    if not hertz[RIGID - 1] < 0.05 * hertz[RIGID]:
        raise ArithmeticError(f"not the modes of a free body: {hertz[: RIGID + 1]}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return Solved(hertz[RIGID:], size, time.process_time() - began, peak)


def limit(hertz: Array, power: Array | None = None) -> tuple[Array, Array]:
    """Limits (m,) of modes (degrees, m) in the first of `DEGREES`, and powers s (m,) of c p^-s: fitted to three
    degrees, between a crease's and smooth ones'; of two degrees the power is given.
    """
    if power is None:
        trial = np.linspace(CREASE, SMOOTH, 400)
        a, b, c = (float(p) ** -trial for p in DEGREES)
        ratio = (a - b) / (b - c)  # rises with the power
        first, last = hertz[0] - hertz[1], np.maximum(hertz[1] - hertz[2], 0)
        power = np.interp(first / np.maximum(last, 1e-300), ratio, trial)
    before, end = (float(p) ** -power for p in DEGREES[len(hertz) - 2 : len(hertz)])
    return hertz[-1] - np.maximum(hertz[-2] - hertz[-1], 0) * end / (before - end), power
