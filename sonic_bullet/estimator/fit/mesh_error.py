"""How far the mesh itself bends γ: what halving its elements would do, estimated from what doubling them twice does.

    ln λ(h) = ln λ + C h^p       h, r₁h, r₁r₂h solved: p, then  ln λ(h) − ln λ(h/2) = Δ₁ (1 − 2^−p)/(r₁^p − 1)
        [Richardson 1911]

Quadratic elements have p = 4 once h is small against everything [Strang & Fix 1973, ch. 6.3]; bars and plates one to
four cells thick are not there yet, and show 2 to 3: p is kept to 2 … 4. A mesh of half the size has eight times the
unknowns and takes a minute, so it is not made.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.estimator.fit.case_fit import ObjectFit
from sonic_bullet.modal.meshing.solid import Solid
from sonic_bullet.records import Array, Material
from sonic_bullet.records.errors import SonicBulletError

MESH_MOVES = 0.01
MOST = 40  # modes that are compared
ORDERS = np.linspace(2.0, 4.0, 201)
LEAST_RATIO = 1.2  # of edges: meshes more alike than this tell nothing
MOST_TIMES = 12.0


def mesh_warning(
    o: ObjectFit, youngs_pa: float, density: float, poisson: float, progress: Callable[[str], None] | None
) -> list[str]:
    """A warning where halving the elements would move γ by over 1 %, or where that cannot be estimated; none for one
    solved without them (polynomials.py, revolved.py).
    """
    if o.evidence.family is not None and not o.evidence.family.meshed:
        return []
    try:
        moved = halving_moves(o, youngs_pa, density, poisson, progress)
    except SonicBulletError as error:
        return [f"mesh error not known: a coarser mesh fails ({error.what})"]
    if not np.isfinite(moved):
        return ["mesh error not known: no coarser mesh could be made"]
    return (
        [f"halving the mesh size would move gamma by about {moved:.1%}: its frequencies are that uncertain"]
        if abs(moved) > MESH_MOVES
        else []
    )


def halving_moves(
    o: ObjectFit, youngs_pa: float, density: float, poisson: float, progress: Callable[[str], None] | None = None
) -> float:
    """Relative change of γ (the mean over the observed modes, the lowest 40 at most) that halving the elements would
    bring; NaN where it cannot be estimated.

    Raises MeshError, ModalError where a coarser mesh fails.
    """
    family = o.evidence.family
    observed = np.array([int(i) for who, line in zip(o.member, o.line, strict=True) if line >= 0 for i in who], int)
    if family is None or o.evidence.thing.mesh is None or not len(observed):
        return float("nan")
    observed = observed[observed < max(MOST, int(observed.min()) + 1)]
    count = int(observed.max()) + 1
    material = Material.isotropic("fit", youngs_pa=youngs_pa, poisson=poisson, density_kg_m3=density)
    fine = np.log(family.modes(youngs_pa / density, poisson)[0][:count])
    edges, shifts = [_edge_m(family.vertex_m, family.face)], []
    say, times = progress or (lambda _: None), 2.0
    for _ in range(2):
        coarse, edge = _coarser(o, material, times, edges[0], count, say)
        # elements keep to the surface's own creases, whatever edge is asked for
        while edge < LEAST_RATIO * edges[-1] and times < MOST_TIMES:
            times *= 1.6
            coarse, edge = _coarser(o, material, times, edges[0], count, say)
        times *= 2
        shared = observed[observed < len(coarse)]
        if not len(shared):
            return float("nan")
        shifts.append(float((coarse[shared] - fine[shared]).mean()))
        edges.append(edge)
    return halved(edges, shifts)


def halved(edges: list[float], shifts: list[float]) -> float:
    """What halving brings to a logarithm, from its shifts (2,) between the first mesh and two coarser ones; edges (3,)
    of all three.

    Shifts that do not grow as a power would are judged with order 2. NaN where the first two meshes are alike.
    """
    first, second = edges[1] / edges[0], edges[2] / edges[1]
    if first < LEAST_RATIO:
        return float("nan")
    order = 2.0
    step = shifts[1] - shifts[0]
    if second > LEAST_RATIO and shifts[0] > 0 and step > 0:
        growth = first**ORDERS * (second**ORDERS - 1) / (first**ORDERS - 1)
        order = float(ORDERS[np.argmin(np.abs(np.log(growth) - np.log(step / shifts[0])))])
    return float(-shifts[0] * (1 - 2**-order) / (first**order - 1))


def _edge_m(vertex_m: Array, face: Array) -> float:
    """Edge of the equilateral triangle as large as a face's median; a face is an element's, cut in four."""
    from sonic_bullet.geometry import face_areas_m2

    return float(np.sqrt(np.median(face_areas_m2(vertex_m, face)) * 16 / np.sqrt(3)))


def _coarser(
    o: ObjectFit, material: Material, times: float, edge_m: float, count: int, say: Callable[[str], None]
) -> tuple[Array, float]:
    """ln λ (c,) of the body with elements ``times`` as large, and what their edge came out as."""
    from sonic_bullet.modal import eigen, fem
    from sonic_bullet.modal.meshing.solid import surface

    length = o.evidence.family.length_m if o.evidence.family is not None else 1.0
    body = _filled(o, times, edge_m, say)
    skin = surface(body)
    unit = Solid(body.node_m / length, body.tet, body.affine)
    stiffness, mass = fem.assemble(unit, material.stiffness_pa / material.youngs_pa, 1.0)
    held = fem.clamped(body, np.array(o.evidence.thing.fixed, float).reshape(-1, 4))
    rigid = 6
    if held.any():
        free = np.flatnonzero(np.repeat(~held, 3))
        rigid -= int(np.linalg.matrix_rank(fem.rigid_modes(unit.node_m)[np.repeat(held, 3)], tol=1e-9))
        stiffness, mass = stiffness[free][:, free], mass[free][:, free]
    most = min(count, max(1, stiffness.shape[0] // 3 - rigid))
    thin = float(np.ptp(body.node_m, axis=0).min()) / length
    found = eigen.solve(
        stiffness,
        mass,
        -(thin**2) / 3,
        rigid=rigid,
        enough=lambda value: len(value) >= most + rigid,
        most=most,
        say=say,
    )
    gamma = material.youngs_pa / material.density_kg_m3
    return np.asarray(np.log(found.lambda_per_s2[:most] * gamma / length**2)), _edge_m(
        body.node_m[skin.node], skin.face
    )


def _filled(o: ObjectFit, times: float, edge_m: float, say: Callable[[str], None]) -> Solid:
    """The body's solid with coarser elements: a box by the same grid with fewer cells, anything else by a
    larger edge.
    """
    from sonic_bullet.estimator.fit.recorded import mesh_edge_m
    from sonic_bullet.geometry import is_closed
    from sonic_bullet.modal import read_mesh
    from sonic_bullet.modal.meshing import shape_meshes, structured
    from sonic_bullet.modal.meshing.prisms import as_box
    from sonic_bullet.modal.ordering import dissection

    shape = read_mesh(o.evidence.thing.mesh or "", o.evidence.thing.scale)
    box = as_box(shape.vertex_m, shape.face) if is_closed(shape.face) else None
    if box is None:
        return shape_meshes.fill((shape,), times * edge_m, None, say).solid
    size, axes, centre = box
    nx, ny, nz = (int(np.ceil(n / times)) for n in shape_meshes.box_cells(size, mesh_edge_m(shape)))
    made = structured.box(size, (nx, ny, nz))
    order = dissection(made.node_m, made.tet)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    return Solid((made.node_m @ axes.T + centre)[order], place[made.tet], made.affine, made.note)
