"""Reduced basis of a body for all orthotropic materials, axes along the mesh's: modes at several anchors span the rest.

    K(C) = Σ_k C_k K_k over the nine constants of `ORTHOTROPIC`;  V: modes at the anchors together, VᵀMV = 1
    (Σ_k (C_k/ρ) VᵀK_kV) q = λL² q,   ∂ ln λ/∂C_k = qᵀK_kq / qᵀKq,  qᵀq = 1
        [Rayleigh-Ritz; Hellmann-Feynman]

C_k/ρ in m²/s². A box whose sides lie along the axes takes polynomials (polynomials.py) and keeps its three mirrors:
eight small problems. The reduced modes lie above the true ones, the most by less than 1e-3 in f for ratios of 3:1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import fem, lanczos, polynomials
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.meshing import structured
from sonic_bullet.modal.meshing.shape_meshes import fill
from sonic_bullet.modal.meshing.solid import Solid, surface
from sonic_bullet.modal.modal_analysis import diagonal_m
from sonic_bullet.modal.sectors import MOST_MODES, SHIFT_RATIO
from sonic_bullet.records import ORTHOTROPIC, Array, Shape
from sonic_bullet.records.errors import MeshError

# e along x, y, z over the largest; G_yz, G_xz, G_xy over those that go with it, √(E_i E_j)/2(1+ν)
TENSOR_ANCHORS: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = (
    ((1, 1, 1), (1, 1, 1)),
    ((1, 0.1, 0.1), (1, 1, 1)),
    ((0.1, 1, 0.1), (1, 1, 1)),
    ((0.1, 0.1, 1), (1, 1, 1)),
    ((1, 0.3, 0.3), (1, 1, 1)),
    ((0.3, 1, 0.3), (1, 1, 1)),
    ((0.3, 0.3, 1), (1, 1, 1)),
    ((1, 1, 0.3), (1, 1, 1)),
    ((1, 0.3, 1), (1, 1, 1)),
    ((0.3, 1, 1), (1, 1, 1)),
    ((1, 1, 1), (0.3, 0.3, 0.3)),
    ((1, 1, 1), (0.3, 1, 1)),
    ((1, 1, 1), (1, 0.3, 1)),
    ((1, 1, 1), (1, 1, 0.3)),
)
FEWER_ANCHORS = (0, 4, 5, 6, 11, 12, 13)  # where each costs a solution by elements
# modes at each anchor over those wanted: one that lies above them at an anchor may be among them between
SPARE_MODES = 1.3


@dataclass(frozen=True, slots=True, eq=False)
class TensorFamily:
    """Modes of a body for every orthotropic tensor.

    Attributes
    ----------
    body : surface and basis as of `Family`, the isotropic family in this basis
    part : (9, b, b) reduced stiffness of each constant of `ORTHOTROPIC`
    ends : (p + 1,) bounds of the p blocks of the basis that no such tensor couples
    """

    body: Family
    part: Array
    ends: Array

    def modes(self, stiffness_m2_s2: Array) -> tuple[Array, Array]:
        """Compute λ (m,) in 1/s², ascending, and the modes (b, m) in the basis, of C/ρ (6, 6).

        Only the constants of `ORTHOTROPIC` count.
        """
        constant = constants_of(stiffness_m2_s2)
        values, vectors = [], []
        for a, b in pairwise(self.ends):
            value, vector = np.linalg.eigh(np.tensordot(constant, self.part[:, a:b, a:b], 1))
            whole = np.zeros((int(self.ends[-1]), min(b - a, self.body.count)))
            whole[a:b] = vector[:, : self.body.count]
            values.append(value[: self.body.count])
            vectors.append(whole)
        value = np.concatenate(values)
        order = np.argsort(value, kind="stable")[: self.body.count]
        return value[order] / self.body.length_m**2, np.concatenate(vectors, axis=1)[:, order]

    def slopes(self, vector: Array, value: Array) -> Array:
        """Compute ∂ ln λ/∂(C_k/ρ) (9, m) in s²/m² of modes (b, m) with λ (m,), all or some of what `modes` gives."""
        found = np.zeros((len(ORTHOTROPIC), len(value)))
        for a, b in pairwise(self.ends):
            mine = np.flatnonzero(vector[a:b].any(axis=0))
            q = vector[a:b, mine]
            found[:, mine] = np.einsum("bm,kbm->km", q, self.part[:, a:b, a:b] @ q)
        return np.asarray(found / (value * self.body.length_m**2))


def constants_of(stiffness: Array) -> Array:
    """Return the nine constants (9,) of a tensor (6, 6)."""
    return np.array([stiffness[i, j] for i, j in ORTHOTROPIC])


def unit_tensors() -> Array:
    """Return the tensors (9, 6, 6) that the constants multiply."""
    found = np.zeros((len(ORTHOTROPIC), 6, 6))
    for k, (i, j) in enumerate(ORTHOTROPIC):
        found[k, i, j] = found[k, j, i] = 1
    return found


def build_anchor(youngs: tuple[float, float, float], shear: tuple[float, float, float], poisson: float) -> Array:
    """Build the tensor (6, 6) of an anchor; ν_ij √(E_j/E_i) = ν for all pairs.

    Compliance of orthotropic bodies [Bodig & Jayne 1982, eq. 3.8].
    """
    root = np.sqrt(np.array(youngs, float))
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = ((1 + poisson) * np.eye(3) - poisson) / np.outer(root, root)
    normal = np.array([root[1] * root[2], root[0] * root[2], root[0] * root[1]]) / (2 * (1 + poisson))
    compliance[range(3, 6), range(3, 6)] = 1 / (normal * shear)
    return np.asarray(np.linalg.inv(compliance))


@one_thread()
def tensor_family(
    shape: Shape,
    *,
    poisson: float,
    count: int,
    fixed: tuple[tuple[float, float, float, float], ...] = (),
    edge_m: float | None = None,
    cache: store.Place = "default",
) -> TensorFamily:
    """Build the orthotropic family of one body: its lowest ``count`` modes.

    poisson: about that of the anchors. fixed, edge_m, cache: as in `analyse`. Raises MeshError, ModalError.
    """
    length = diagonal_m((shape,))
    count = min(count, MOST_MODES)
    clamp = np.array(fixed, float).reshape(-1, 4)
    name = key(
        "tensor",
        shape.kind,
        shape.size_m,
        shape.vertex_m,
        shape.face,
        edge_m,
        clamp,
        poisson,
        count,
        repr(TENSOR_ANCHORS),
        repr(FEWER_ANCHORS),
    )
    found = store.load(cache, name)
    if found is not None:
        a, note = found
        volume, meshed = a["numbers"]
        return _join_families(
            a["part"], a["ends"], a["skin"], a["vertex"], a["face"], (length, float(volume), count, bool(meshed)), note
        )
    made = _of_box(shape, length, count, poisson) if edge_m is None and not len(clamp) else None
    if made is None:
        made = _of_elements(shape, length, count, poisson, clamp, edge_m)
    body = made.body
    numbers = np.array([body.volume_m3, body.meshed])
    store.save(
        cache,
        name,
        {
            "part": made.part,
            "ends": made.ends,
            "skin": body.skin,
            "vertex": body.vertex_m,
            "face": body.face,
            "numbers": numbers,
        },
        body.note,
    )
    return made


def _join_families(
    part: Array,
    ends: Array,
    skin: Array,
    vertex_m: Array,
    face: Array,
    numbers: tuple[float, float, int, bool],
    note: str,
) -> TensorFamily:
    length, volume, count, meshed = numbers
    lame = part[0] + part[1] + part[2] + part[3] + part[4] + part[5]
    shear = 2 * (part[0] + part[1] + part[2]) + part[6] + part[7] + part[8]
    return TensorFamily(Family(lame, shear, skin, vertex_m, face, length, volume, count, note, meshed), part, ends)


def _span_vectors(vector: Array, gram: Array) -> Array:
    """Combine k unit vectors with Gram matrix (k, k) into (k, b) orthonormal ones that span all that has weight."""
    spanned = 1e-4  # weight (λ of the Gram matrix of unit modes) below which a direction adds nothing
    value, turn = np.linalg.eigh((gram + gram.T) / 2)
    good = value > spanned
    return np.asarray(vector @ (turn[:, good] / np.sqrt(value[good])))


def _of_box(shape: Shape, length: float, count: int, poisson: float) -> TensorFamily | None:
    """Build the family of a free box along the axes, without elements.

    None where the shape is no such box, or takes too many unknowns.
    """
    shorter = 1.0  # factor on the wave number of an isotropic body with as many modes
    most_unknowns = 2200  # of one parity: dense problems of that size take seconds

    box = polynomials.recognise_box(shape)
    if box is None or not np.allclose(np.abs(box.axes).max(axis=0), 1, atol=1e-6):
        return None
    turned = np.abs(box.axes).argmax(axis=0)
    voigt = np.concatenate([turned, 3 + turned])  # of the box's own, in the mesh's order
    size = box.size_m / length
    tensors = unit_tensors()[:, voigt][:, :, voigt]
    wave = shorter * polynomials.wave_number_of(count, size)
    x, y, z = np.ceil(wave * size / 2 + 3 + 2 * np.minimum(1, wave * size / 8)).astype(int)
    terms = (int(x), int(y), int(z))
    unknowns = polynomials.unknowns(terms)
    if unknowns > most_unknowns:
        return None
    report_progress(f"solving {8 * unknowns} unknowns of a box for {len(TENSOR_ANCHORS)} tensors")
    shell = structured.box(box.size_m, polynomials.skin_cells(size, wave))
    skin = surface(shell)
    point = shell.node_m[skin.node] / length
    parities = list(polynomials.parities(size, terms))
    stiff = [np.array([parity.stiffness(tensor) for tensor in tensors]) for parity in parities]
    found: list[list[Array]] = [[] for _ in parities]
    for anchor in TENSOR_ANCHORS:
        constant = constants_of(build_anchor(*anchor, poisson))
        solved = [_lowest(np.tensordot(constant, k, 1), int(SPARE_MODES * count) // 3 + 6) for k in stiff]
        limit = np.sort(np.concatenate([value for value, _ in solved]))[: int(SPARE_MODES * count)][-1]
        for mine, (value, vector) in zip(found, solved, strict=True):
            mine.append(vector[:, value <= limit])
    parts, moved, ends = [], [], [0]
    for parity, k, mine in zip(parities, stiff, found, strict=True):
        every = np.concatenate(mine, axis=1)
        if not every.shape[1]:
            continue
        basis = _span_vectors(every, every.T @ every)
        parts.append(basis.T @ k @ basis)
        moved.append(
            (polynomials.shapes_at(point, size, parity, basis).transpose(0, 2, 1) @ box.axes.T).astype(np.float32)
        )
        ends.append(ends[-1] + basis.shape[1])
    part = np.zeros((len(tensors), ends[-1], ends[-1]))
    for piece, a in zip(parts, ends[:-1], strict=True):
        part[:, a : a + piece.shape[1], a : a + piece.shape[1]] = (piece + piece.transpose(0, 2, 1)) / 2
    note = f"box of {' x '.join(str(n) for n in terms)} polynomials; "
    note += f"{len(TENSOR_ANCHORS)} tensors about nu {poisson:g}"
    basis_skin = np.ascontiguousarray(np.concatenate(moved, axis=1).transpose(0, 2, 1))
    vertex_m = shell.node_m[skin.node] @ box.axes.T + box.centre_m
    return _join_families(
        part, np.array(ends), basis_skin, vertex_m, skin.face, (length, float(np.prod(box.size_m)), count, False), note
    )


def _lowest(stiffness: Array, count: int) -> tuple[Array, Array]:
    """Find the lowest elastic λ (m,) and vectors (n, m), M = 1, of the first ``count`` modes of a dense K (n, n)."""
    from scipy.linalg import eigh

    value, vector = eigh(stiffness, subset_by_index=(0, min(count, len(stiffness)) - 1), check_finite=False)
    elastic = value > 1e-9 * float(np.abs(stiffness).max())
    return value[elastic], vector[:, elastic]


def _of_elements(
    shape: Shape,
    length: float,
    count: int,
    poisson: float,
    clamp: Array,
    edge_m: float | None,
) -> TensorFamily:

    body = fill((shape,), edge_m, None)
    unit = Solid(body.solid.node_m / length, body.solid.tet, body.solid.affine)
    corner = unit.node_m[body.skin.node][body.skin.face]
    area = float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)
    volume = fem.volume_m3(unit)
    held = fem.mark_clamped(body.solid, clamp)
    free = np.flatnonzero(np.repeat(~held, 3))
    if not len(free):
        raise MeshError("body has no unknowns", "clamp less of it")
    rigid = 6 - (
        int(np.linalg.matrix_rank(fem.rigid_modes(unit.node_m)[np.repeat(held, 3)], tol=1e-9)) if held.any() else 0
    )
    report_progress(f"assembling {len(free)} unknowns for {len(ORTHOTROPIC)} constants")
    stiff: list[Any] = []
    mass: Any = None
    for tensor in unit_tensors():
        matrix, mass = fem.assemble(unit, tensor, 1.0)
        stiff.append(matrix[free][:, free] if held.any() else matrix)
    mass = mass[free][:, free] if held.any() else mass
    most = min(MOST_MODES, max(1, len(free) // 3 - rigid))
    shift = -SHIFT_RATIO * (2 * volume / area) ** 2 / 10
    vectors = []
    wanted = min(int(SPARE_MODES * count), most)
    for number, anchor in enumerate([TENSOR_ANCHORS[i] for i in FEWER_ANCHORS]):
        report_progress(f"tensor {number + 1} of {len(FEWER_ANCHORS)}")
        whole = sum(c * matrix for c, matrix in zip(constants_of(build_anchor(*anchor, poisson)), stiff, strict=True))
        modes = lanczos.solve(whole, mass, shift, rigid=rigid, enough=lambda value: len(value) >= wanted, most=wanted)
        vectors.append(modes.vector)
    every = np.concatenate(vectors, axis=1)
    basis = _span_vectors(every, every.T @ (mass @ every))
    part = np.array([basis.T @ (matrix @ basis) for matrix in stiff])
    vector = np.zeros((3 * len(held), basis.shape[1]), np.float32)
    vector[free] = basis
    skin = np.ascontiguousarray(vector.reshape(len(held), 3, -1)[body.skin.node])
    note = f"{body.solid.note}; {len(free)} unknowns; {len(FEWER_ANCHORS)} tensors about nu {poisson:g}"
    numbers = (length, volume * length**3, min(count, wanted), True)
    ends = np.array([0, basis.shape[1]])
    return _join_families(
        (part + part.transpose(0, 2, 1)) / 2,
        ends,
        skin,
        body.solid.node_m[body.skin.node],
        body.skin.face,
        numbers,
        note,
    )
