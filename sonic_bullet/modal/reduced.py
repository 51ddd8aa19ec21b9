"""All isotropic materials of one body at once: its modes at two Poisson's ratios span those between, and a little
beyond.

    K(E, ν) = E [ l(ν) K_l + s(ν) K_s ],   l = ν/((1+ν)(1−2ν)),  s = 1/(2(1+ν))
        [Hughes 1987, ch. 2.7]
    V: modes at ν₁ and ν₂ together, VᵀMV = 1;   (l VᵀK_lV + s VᵀK_sV) q = θ q,  λ = γ θ/L²,  γ = E/ρ     [Rayleigh-Ritz]

The error of λ is of the fourth order in the distances from ν₁ and ν₂. Lengths by the body's diagonal L, as in model.py.
A free box takes polynomials in place of elements (polynomials.py), a free body of revolution a Fourier series around
its axis (revolved.py): their λ are good to 2e-4, where elements within the same time are 1e-2 too stiff.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.files import cache as store
from sonic_bullet.modal.isotropic_family import Family, mixed
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.model import MOST_MODES, SHIFT, _diagonal_m
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError, ModalError

APART = 0.05  # of ν₁ and ν₂ from the guess
POISSON = (-0.5, 0.485)
BEYOND = 1.1  # of the limit on λ: modes that are none at one ν may be some at the other
SECTION_EDGE, SECTION_WAVE = 0.5, 0.25  # a section's cubic triangles: of the wall's thickness and of the shortest wave
AROUND = 5  # cells around to a wave
KEPT = {
    "lame": store.Kept("f8", ("b", "b")),
    "shear": store.Kept("f8", ("b", "b")),
    "skin": store.Kept("f4", ("v", 3, "b")),
    "vertex": store.Kept("f8", ("v", 3)),
    "face": store.Kept("i", (None, 3), "v"),
    "numbers": store.Kept("f8", (3,)),
}


def family(
    shape: Shape,
    *,
    gamma_m2_s2: float,
    poisson: float,
    to_hz: float,
    fixed: tuple[tuple[float, float, float, float], ...] = (),
    edge_m: float | None = None,
    cache: store.Place = "default",
    progress: Callable[[str], None] | None = None,
) -> Family:
    """The family of one body about a guess, its modes true up to to_hz at the guessed γ. fixed, edge_m, cache,
    progress: as in `analyse`.

    Raises MeshError, ModalError.
    """
    say = progress or (lambda _: None)
    length = _diagonal_m((shape,))
    limit = (2 * np.pi * to_hz) ** 2 * length**2 / gamma_m2_s2
    clamp = np.array(fixed, float).reshape(-1, 4)
    name = key("family", shape.vertex_m, shape.face, edge_m, clamp, poisson, limit)
    found = store.load(cache, name, KEPT)
    if found is not None:
        a, note = found
        volume, count, meshed = a["numbers"]
        return Family(
            a["lame"],
            a["shear"],
            a["skin"],
            a["vertex"],
            a["face"],
            length,
            float(volume),
            int(count),
            note,
            bool(meshed),
        )
    made = None
    if edge_m is None and not len(clamp):
        made = _of_box(shape, length, limit, poisson, say) or _of_revolution(shape, length, limit, poisson, say)
    if made is None:
        made = _family(shape, length, limit, poisson, clamp, edge_m, say)
    numbers = np.array([made.volume_m3, made.count, made.meshed])
    arrays = {
        "lame": made.lame,
        "shear": made.shear,
        "skin": made.skin,
        "vertex": made.vertex_m,
        "face": made.face,
        "numbers": numbers,
    }
    store.save(cache, name, arrays, made.note)
    return made


def _poissons(poisson: float) -> tuple[float, float]:
    low, high = (float(np.clip(poisson + apart, *POISSON)) for apart in (-APART, APART))
    if high - low < APART / 2:
        raise ModalError(f"Poisson's ratio {poisson} is no isotropic solid's", "guess one between -0.5 and 0.48")
    return low, high


def _together(first: Array, second: Array, mass: Callable[[Array], Array]) -> Array:
    """Columns (n, b) with VᵀMV = 1 that span those of both, first's first."""
    rest = second - first @ (first.T @ mass(second))
    rest -= first @ (first.T @ mass(rest))
    value, turn = np.linalg.eigh(rest.T @ mass(rest))
    good = value > 1e-12
    return np.concatenate([first, rest @ (turn[:, good] / np.sqrt(value[good]))], axis=1)


def _lame_shear() -> tuple[Array, Array]:
    lame, shear = np.zeros((6, 6)), np.diag([2.0, 2, 2, 1, 1, 1])
    lame[:3, :3] = 1
    return lame, shear


def _of_box(shape: Shape, length: float, limit: float, poisson: float, say: Callable[[str], None]) -> Family | None:
    """The family of a free box, without elements; None where the shape is no box, or one of too many unknowns."""
    from scipy.linalg import block_diag

    from sonic_bullet.modal import polynomials
    from sonic_bullet.modal.meshing import structured
    from sonic_bullet.modal.meshing.solid import surface

    box = polynomials.recognised(shape)
    if box is None:
        return None
    low, high = _poissons(poisson)
    size = box.size_m / length
    thin = float(size.min())
    tensors = _lame_shear()
    soft = mixed(max(low, high), *tensors)
    wave = min(polynomials.wave_number(limit, thin, soft), polynomials.wave_number_of(MOST_MODES, size))
    terms = polynomials.degrees(size, wave)
    if polynomials.unknowns(terms) > polynomials.MOST_UNKNOWNS:
        return None
    say(f"solving {8 * polynomials.unknowns(terms)} unknowns of a box")
    shell = structured.box(box.size_m, polynomials.skin_cells(size, wave))
    skin = surface(shell)
    point = shell.node_m[skin.node] / length
    counts = np.zeros(2, int)
    parts: list[tuple[Array, Array, Array]] = []
    for parity in polynomials.parities(size, terms):
        k_lame, k_shear = (parity.stiffness(tensor) for tensor in tensors)
        found = [polynomials.lowest(mixed(nu, k_lame, k_shear), BEYOND * limit, parity.rigid) for nu in (low, high)]
        counts += [int((value <= limit).sum()) for value, _ in found]
        basis = _together(found[0][1], found[1][1], lambda v: v)
        moved = polynomials.shapes_at(point, size, parity, basis).transpose(0, 2, 1) @ box.axes.T
        parts.append((basis.T @ k_lame @ basis, basis.T @ k_shear @ basis, moved.astype(np.float32)))
    lame, shear = (block_diag(*(part[k] for part in parts)) for k in (0, 1))
    basis_skin = np.ascontiguousarray(np.concatenate([moved for _, _, moved in parts], axis=1).transpose(0, 2, 1))
    note = f"box of {' x '.join(str(n) for n in terms)} polynomials; nu {low:g} and {high:g}"
    vertex_m = shell.node_m[skin.node] @ box.axes.T + box.centre_m
    count = min(MOST_MODES, int(counts.min()))
    return Family(
        (lame + lame.T) / 2,
        (shear + shear.T) / 2,
        basis_skin,
        vertex_m,
        skin.face,
        length,
        float(np.prod(box.size_m)),
        count,
        note,
        meshed=False,
    )


def _of_revolution(
    shape: Shape, length: float, limit: float, poisson: float, say: Callable[[str], None]
) -> Family | None:
    """The family of a free body of revolution; None where the shape is none."""
    from scipy.linalg import block_diag
    from scipy.sparse import block_diag as diagonal

    from sonic_bullet.modal import eigen, polynomials, revolved

    body = revolved.recognised(shape.vertex_m, shape.face) if shape.kind == "mesh" else None
    if body is None:
        return None
    low, high = _poissons(poisson)
    round_m = np.linalg.norm(np.roll(body.outline_m, -1, axis=0) - body.outline_m, axis=1)
    thick = 2 * body.area_m2 / float(round_m.sum())
    unit = revolved.Revolved(body.outline_m / length, body.axes, body.centre_m)
    tensors = _lame_shear()
    wave = polynomials.wave_number(limit, thick / length, mixed(max(low, high), *tensors))
    long = 2 * np.pi / wave
    section = revolved.sectioned(
        unit, float(min(SECTION_EDGE * thick / length, SECTION_WAVE * long)), long / polynomials.PER_WAVE
    )
    if section is None:
        return None
    n = len(section.order)
    say(f"solving {3 * n} unknowns of a section for each wave around")
    order = (section.order[:, None] + n * np.arange(3)).ravel()
    plain = section.slopes[3].T @ section.slopes[3]
    mass = diagonal([plain] * 3, format="csr")[order][:, order]
    shift = -SHIFT * (2 * thick / length) ** 2 / 3
    counts = np.zeros(2, int)
    parts: list[tuple[int, Array, Array, Array]] = []
    for m in range(MOST_MODES):
        strain = section.strains(m)
        k_lame, k_shear = (section.stiffness(strain, tensor)[order][:, order] for tensor in tensors)
        kept = []
        for k, nu in enumerate((low, high)):
            modes = eigen.solve(
                mixed(nu, k_lame, k_shear),
                mass,
                shift,
                rigid=2 if m < 2 else 0,
                enough=lambda value: bool(value[-1] > BEYOND * limit),
                most=MOST_MODES,
            )
            counts[k] += (1 if m == 0 else 2) * int((modes.lambda_per_s2 <= limit).sum())
            kept.append(modes.vector[:, modes.lambda_per_s2 <= BEYOND * limit])
        if kept[0].shape[1] + kept[1].shape[1] == 0:
            if m > 1:
                break
            continue
        basis = _together(kept[0], kept[1], lambda v: mass @ v)
        vector = np.zeros_like(basis)
        vector[order] = basis
        parts.append((m, basis.T @ (k_lame @ basis), basis.T @ (k_shear @ basis), vector))
    if not parts:
        return None
    cells = int(np.clip(AROUND * parts[-1][0], 24, 96))
    point, face = revolved.skin(section, cells)
    degenerate = [(part, second) for part in parts for second in ((False, True) if part[0] else (False,))]
    lame, shear = (block_diag(*(part[k] for part, _ in degenerate)) for k in (1, 2))
    moved = np.concatenate(
        [
            revolved.shapes_at(section, part[3], part[0], second, cells).astype(np.float32)
            for part, second in degenerate
        ],
        axis=2,
    )
    moved = np.ascontiguousarray(np.einsum("yx,vxb->vyb", body.axes.astype(np.float32), moved))
    note = f"body of revolution, section of {n} nodes, up to {parts[-1][0]} waves around; nu {low:g} and {high:g}"
    vertex_m = point * length @ body.axes.T + body.centre_m
    count = min(MOST_MODES, int(counts.min()))
    return Family(
        (lame + lame.T) / 2,
        (shear + shear.T) / 2,
        moved,
        vertex_m,
        face,
        length,
        body.volume_m3,
        count,
        note,
        meshed=False,
    )


def _family(
    shape: Shape,
    length: float,
    limit: float,
    poisson: float,
    clamp: Array,
    edge_m: float | None,
    say: Callable[[str], None],
) -> Family:
    from sonic_bullet.modal import eigen, fem
    from sonic_bullet.modal.meshing.shape_meshes import fill
    from sonic_bullet.modal.meshing.solid import Solid

    body = fill((shape,), edge_m, None, say)
    unit = Solid(body.solid.node_m / length, body.solid.tet, body.solid.affine)
    corner = unit.node_m[body.skin.node][body.skin.face]
    area = float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)
    volume = fem.volume_m3(unit)
    lame, shear = _lame_shear()
    say(f"assembling {3 * len(unit.node_m)} unknowns")
    k_lame, mass = fem.assemble(unit, lame, 1.0)
    k_shear, _ = fem.assemble(unit, shear, 1.0)
    held = fem.clamped(body.solid, clamp)
    free = np.flatnonzero(np.repeat(~held, 3))
    rigid = 6
    if held.any():
        rigid -= int(np.linalg.matrix_rank(fem.rigid_modes(unit.node_m)[np.repeat(held, 3)], tol=1e-9))
        k_lame, k_shear, mass = (matrix[free][:, free] for matrix in (k_lame, k_shear, mass))
    most = min(MOST_MODES, max(1, len(free) // 3 - rigid))
    shift = -SHIFT * (2 * volume / area) ** 2 / 3
    vectors, counts = [], []
    low, high = _poissons(poisson)
    for nu in (low, high):
        modes = eigen.solve(
            mixed(nu, k_lame, k_shear),
            mass,
            shift,
            rigid=rigid,
            enough=lambda value: bool(value[-1] > limit),
            most=most,
            say=say,
        )
        vectors.append(modes.vector)
        counts.append(len(modes.lambda_per_s2))
    basis = _together(vectors[0], vectors[1], lambda v: mass @ v)
    vector = np.zeros((3 * len(held), basis.shape[1]), np.float32)
    vector[free] = basis
    if not len(basis):
        raise MeshError("body has no unknowns", "clamp less of it")
    reduced = [basis.T @ (matrix @ basis) for matrix in (k_lame, k_shear)]
    note = f"{body.solid.note}; {len(free)} unknowns; nu {low:g} and {high:g}" + (
        f"; {int(held.sum())} nodes clamped" if held.any() else ""
    )
    skin = np.ascontiguousarray(vector.reshape(len(held), 3, -1)[body.skin.node])
    lame_r, shear_r = ((matrix + matrix.T) / 2 for matrix in reduced)
    return Family(
        lame_r,
        shear_r,
        skin,
        body.solid.node_m[body.skin.node],
        body.skin.face,
        length,
        volume * length**3,
        min(counts),
        note,
    )
