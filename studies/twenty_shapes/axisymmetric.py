"""The truth of a round body: polynomials of degree 3, 4, 5 on two meshes of its section by NGSolve, Fourier round it.

    u_r = U cos mθ,  u_θ = V sin mθ,  u_z = W cos mθ  -> strains of each m      [Zienkiewicz & Taylor 2000, vol. 2, 9.4]
    on the axis U = V = W = 0;  of m = 0 U = V = 0;  of m = 1 W = 0, V = Q − U with Q = 0

Written apart from `sonic_bullet.modal.revolution`, whose errors it shall find; limits as in polynomials.py. The outline
is a polygon twice as fine as a user's.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from sonic_bullet.modal.revolution import rings
from sonic_bullet.records import Array
from studies.thin_walls.blocks import welded
from studies.thin_walls.bodies import BODIES, Detail, Stuff, ThinBody
from studies.twenty_shapes.catalogue import CAN
from studies.twenty_shapes.polynomials import DEGREES

OUTLINE = Detail(24, 6.0)
SIZES_MM = {"coarse": 6.0, "fine": 3.0}
ROUND = {"wine-glass": BODIES["wine-glass"], "tumbler": BODIES["tumbler"], "can": CAN}
AROUND = 5
EACH = 5
"""Modes of each number of waves round, more than there are among the first twenty."""


def solve(body: ThinBody, count: int) -> dict[str, Any]:
    """Modes of a body in two sizes and three degrees: "polynomials" of its part of truth.json."""
    made = welded(body.draw(OUTLINE))
    found = rings.recognise_revolution(made.node_m[made.skin], made.face)
    assert found is not None
    kept: dict[str, Any] = {}
    for size, edge_mm in SIZES_MM.items():
        began = time.process_time()
        section = _section(1000 * found.outline_m, edge_mm)
        runs = []
        for degree in DEGREES:
            each = [_around(section, m, degree, body.stuff) for m in range(AROUND + 1)]
            hertz = np.sort(np.concatenate([f if m == 0 else np.repeat(f, 2) for m, f in enumerate(each)]))
            runs.append([round(float(f), 4) for f in hertz[:count]])
        kept[size] = {
            "cells": section.ne,
            "processor_s": round(time.process_time() - began, 2),
            "frequency_hz": runs,
        }
    return kept


def _section(outline_mm: Array, edge_mm: float) -> Any:
    import ngsolve as ng
    from netgen.geom2d import SplineGeometry

    drawn = SplineGeometry()
    point = [drawn.AppendPoint(*map(float, p)) for p in outline_mm]
    for k, (one, after) in enumerate(zip(outline_mm, np.roll(outline_mm, -1, axis=0), strict=True)):
        axis = one[0] == 0 and after[0] == 0
        drawn.Append(["line", point[k], point[(k + 1) % len(point)]], bc="axis" if axis else "rim")
    return ng.Mesh(drawn.GenerateMesh(maxh=edge_mm, grading=0.3))


def _around(section: Any, m: int, degree: int, stuff: Stuff) -> Array:
    """Lowest elastic frequencies of m waves round, on a section in mm."""
    import ngsolve as ng

    held = ("axis", "axis", "") if m == 0 else ("", "axis", "axis") if m == 1 else ("axis", "axis", "axis")
    one = [ng.H1(section, order=degree, dirichlet=where) for where in held]
    space = one[0] * one[1] * one[2]
    trial, test = space.TnT()
    r = ng.x

    def motion(field: Any) -> tuple[Any, ...]:
        u, v, w = field
        slope = [ng.grad(f) for f in (u, v, w)]
        if m == 1:
            v, slope[1] = v - u, slope[1] - slope[0]
        (ur, uz), (vr, vz), (wr, wz) = ((s[0], s[1]) for s in slope)
        return (u, v, w), (ur, wz, (u + m * v) / r, vz - m * w / r, vr - (v + m * u) / r, uz + wr)

    (place, strain), (place_t, strain_t) = motion(trial), motion(test)
    shear = stuff.youngs_pa / (2 * (1 + stuff.poisson))
    bulk = stuff.youngs_pa * stuff.poisson / ((1 + stuff.poisson) * (1 - 2 * stuff.poisson))
    work = bulk * sum(strain[:3]) * sum(strain_t[:3])
    for k, (a, b) in enumerate(zip(strain, strain_t, strict=True)):
        work += (2 if k < 3 else 1) * shear * a * b
    over = ng.dx(bonus_intorder=2)
    stiff = ng.BilinearForm(1e6 * work * r * over).Assemble().mat
    mass = (
        ng.BilinearForm(stuff.density_kg_m3 * sum(a * b for a, b in zip(place, place_t, strict=True)) * r * over)
        .Assemble()
        .mat
    )
    free = np.array(list(space.FreeDofs()))

    def scipy_of(matrix: Any) -> Any:
        row, column, value = (np.array(x) for x in matrix.COO())
        whole = sp.csc_array((value, (row, column)), shape=(space.ndof, space.ndof))[free][:, free]
        return (whole + whole.T) / 2

    rigid = 2 if m < 2 else 0
    below = -((2 * np.pi * 50) ** 2)
    value = eigsh(scipy_of(stiff), k=EACH + rigid, M=scipy_of(mass), sigma=below, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.maximum(np.sort(value)[rigid:], 0)) / (2 * np.pi))
