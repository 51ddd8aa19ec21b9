"""Far-field pressure of each mode from its modal velocity, and its radiation damping.

    p(r̂) = (iωρ₀/4π) ∮ [v + ik (r̂·n) ψ] e^{ik r̂·x} dS             at 1 m, v = φ·n for unit modal velocity
        [Pierce 1989, eq. 4-6.4, e^{iωt}]
    near field p_s = iωρ₀ψ: `surface_waves`, at the mode's own k, where the mesh has three edges a wavelength; above
        ψ = Σ_j e_j (e_j·v)/q_j
        e_j, t_j: eigenvectors and -values of the air moved at k = 0, `entrained_mass`
    q_j(k) = 1/L + √(κ_j² + (1/L + ik)²),  q_j(0) = 1/t_j
        its change with k; L the body's middle principal extent
    |p| = √<|p(r̂)|²>,  Δd = 2π <|p|²>/ρ₀c
        mean over directions; power = 4π<|p|²>/2ρ₀c = 2 Δd · ½|z|²

On a sphere (a = L/2) the e_j are the harmonics and q_j interpolates -k h_l'(ka)/h_l(ka): exact for l = 0, for every l
at k → 0, where it is (l+1)/a, and to second order for k → ∞ (1/a + ik). On a wide flat face they are waves, and q =
√(κ² - k²) [Cremer et al. 2005, eq. 6.26]. Edges and corners couple the e_j: below coincidence that is most
of the sound [Maidanik 1962], and no q_j has it.

The mean is a product Gauss rule in the body's principal frame, exact for bodies small by the wavelength; for large ones
512 directions spread evenly. The weight is complex. Its size is the mean over directions. Its phase is that of the loud
directions, each counted from the instant sound leaves the surface on that side: of <p² |p|¹⁶>, which sides of opposite
signs share, with the sign of <p |p|¹⁶ e^{a·r̂}>, which distinguishes them. No single direction decides, nor one side of
a symmetric body: shapes that differ in their last bits radiate alike. A shape and its negative sound the same.
v vertices, f faces, m modes, s patches, n directions in pairs ±r̂.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.radiation.compact import COMPACT, MODES_AT_ONCE, compact_weight, sound_faces
from sonic_bullet.radiation.entrained_mass import PotentialMap
from sonic_bullet.radiation.near_mesh import DRAFT_TRIANGLES, cells, least_triangles, surface_air
from sonic_bullet.radiation.surface_waves import ALIKE, DRAWN_ALIKE, RESOLVED, SurfaceWaves
from sonic_bullet.records import Air, Array, ModalModel

NearField = Callable[[Array, Array, Array, int], tuple[PotentialMap, Array] | None]


class SurfaceTerms(NamedTuple):
    """What a body's modes send, in its principal frame, which ``turn`` (3, 3) leads to.

    k (m,); point (p, 3): corners. moment (m, 7, s) at place (s, 3): ∫ of v, of v (x - place) + n Re ψ, and of n Im ψ
    over each patch.
    """

    k: Array
    moment: Array
    place: Array
    point: Array
    turn: Array


UNEVEN_AXIS = np.array(
    [0.8, 0.6, 0.4]
)  # a: along no axis and in no plane between axes, so even bodies' modes do not cancel


def radiation(model: ModalModel, air: Air) -> tuple[Array, Array]:
    """Compute pressure weight (m,) complex, in Pa·m per modal velocity (m/s·√kg), and radiation damping (m,) in 1/s.

    Pressure at distance r is Re(weight·z)/r, z the modal state of `bank`. Zero for a model without a surface.
    Equations: the module's.
    """
    return radiation_and_note(model, air)[:2]


def radiation_and_note(model: ModalModel, air: Air, near_field: NearField | None = None) -> tuple[Array, Array, str]:
    """Compute `radiation`, and a note: `COMPACT` where the compact law replaces the near field, else "".

    near_field: takes the place of `surface_air`.
    """
    least_rings, most_rings = 6, 12  # of directions between the poles
    # power of |p| by which directions count: half of a plate's modes are within 2° of the loudest one's phase
    louder = 16
    spread = 256  # directions, and their negatives, where even the most rings are too few
    m = model.mode_count
    face = sound_faces(model)[1]
    if m == 0 or len(face) == 0:
        return np.zeros(m, complex), np.zeros(m), ""
    terms = surface_terms(model, air, near_field)
    if not isinstance(terms, SurfaceTerms):
        weight = compact_weight(model, face, *terms, air)
        return weight, _radiation_damping(weight, air), COMPACT
    k = terms.k
    rings = np.clip(np.ceil(k * np.linalg.norm(terms.point, axis=1).max()) + 4, least_rings, most_rings + 1).astype(int)
    weight = np.zeros(m, complex)
    for count in np.unique(rings):
        now = np.flatnonzero(rings == count)
        direction, share = directions(int(count)) if count <= most_rings else spread_directions(spread)
        pressure, reach = surface_pressure(terms, air, direction, now)
        every, both = np.concatenate([share, share]), np.concatenate([direction, -direction])
        mean = np.abs(pressure) ** 2 @ every
        left = pressure * np.exp(-1j * k[now, None] * reach)
        loud = (np.abs(left) / np.maximum(np.abs(left).max(axis=1, keepdims=True), 1e-300)) ** louder
        phase = _unit(np.sqrt((loud * left**2) @ every))
        sense = ((loud * left) @ (every * np.exp(both @ UNEVEN_AXIS)) * phase.conj()).real
        weight[now] = np.sqrt(mean) * np.where(sense < 0, -phase, phase)
    return weight, _radiation_damping(weight, air), ""


def surface_pressure(terms: SurfaceTerms, air: Air, direction: Array, modes: Array) -> tuple[Array, Array]:
    """Compute the pressure (k, 2·n) of some modes (k,) at 1 m towards directions (n, 3) and their negatives.

    Also return how far (2·n,) the surface reaches that way: p e^{-ik reach} counts from when sound leaves it there.
    """
    ahead, behind = np.empty((2, len(modes), len(direction)), complex)
    parts = [one.view(float).reshape(*one.shape, 2) for one in (ahead, behind)]
    _engine.sum_patches(terms.k[modes], terms.moment[modes], np.ascontiguousarray(terms.place.T), direction, *parts)
    pressure = (
        np.concatenate([ahead, behind], axis=1)
        * (1j * terms.k[modes] * air.sound_speed_m_s * air.density_kg_m3 / (4 * np.pi))[:, None]
    )
    both = np.concatenate([direction, -direction])
    reach = np.concatenate([(terms.point @ some.T).max(axis=0) for some in np.array_split(both, 16)])
    return pressure, reach


def surface_terms(
    model: ModalModel, air: Air, near_field: NearField | None = None
) -> SurfaceTerms | tuple[Array, Array, Array]:
    """Compute what the modes of a body with a surface send; areas, normals and k where its near field cannot be."""
    most_patches = 1800
    m = model.mode_count
    corner, face = sound_faces(model)
    k = 2 * np.pi * model.freq_hz / air.sound_speed_m_s
    corner, turn = _principal(corner, (model.shape**2).sum(axis=(1, 2), dtype=float)[face].mean(axis=1))
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    normal = twice / (2 * area[:, None])
    extent = np.sort(np.ptp(corner.reshape(-1, 3), axis=0))
    patch, place = _patches(corner, area, normal, most_patches)
    near = (near_field or surface_air)(
        corner, area, normal, DRAFT_TRIANGLES if model.solution == "draft" else least_triangles(m)
    )
    if near is None:
        return area, normal @ turn, k
    moved, nearest = near
    low = k * np.sqrt(4 / np.sqrt(3) * moved.area_m2.mean()) < RESOLVED
    drawn = np.zeros(m, bool) if model.stands_for is None else model.stands_for > 1
    waves = SurfaceWaves(moved.corner_m) if low.any() else None
    moment = np.zeros((m, 7, len(place)))
    flow, lever, mean_speed = _surface_sums(face, normal @ turn, area, corner, (patch, place), near)
    push = _patch_push(area, normal, patch, nearest, (len(place), len(moved.area_m2)))
    for lo in range(0, m, MODES_AT_ONCE):
        some = slice(lo, min(lo + MODES_AT_ONCE, m))
        motion = model.shape[: face.max() + 1, :, some].reshape(-1, model.shape[0, 0, some].size).astype(float)
        mean = mean_speed @ motion
        level = _near_field(k[some], 1 / extent[1], moved, mean)
        for chosen, alike in ((low & ~drawn, ALIKE), (low & drawn, DRAWN_ALIKE)):
            if waves is not None and (now := np.flatnonzero(chosen[some])).size:
                level[:, now] = waves.potential(k[some][now], mean[:, now], alike)
        moment[some, 0] = (flow @ motion).T
        for i in range(3):
            moment[some, 1 + i] = (lever[i] @ motion + push[i] @ level.real).T
            moment[some, 4 + i] = (push[i] @ level.imag).T
    return SurfaceTerms(k, moment, place, corner.reshape(-1, 3)[np.unique(face, return_index=True)[1]], turn)


def _radiation_damping(weight: Array, air: Air) -> Array:
    return np.asarray(2 * np.pi * np.abs(weight) ** 2 / (air.density_kg_m3 * air.sound_speed_m_s))


def _unit(number: Array) -> Array:
    """Divide complex numbers by their sizes; 1 for zeros."""
    size = np.abs(number)
    return np.where(size > 0, number / np.where(size > 0, size, 1), 1)


def directions(rings: int) -> tuple[Array, Array]:
    """Return unit vectors (n, 3) of the upper half sphere and weights (n,), ½ in all.

    With their negatives exact to degree 2·rings - 1 [Stroud 1971, sec. 2.7].
    """
    height, share = np.polynomial.legendre.leggauss(rings + rings % 2)
    height, share = height[height > 0], share[height > 0]
    turns = 4 * ((rings + 1) // 2)
    angle = 2 * np.pi * (np.arange(turns) + 0.5) / turns
    radius = np.sqrt(1 - height**2)[:, None]
    vector = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.broadcast_to(height[:, None], (len(height), turns))],
        axis=-1,
    )
    return np.ascontiguousarray(vector.reshape(-1, 3)), np.repeat(share / (2 * turns), turns)


def spread_directions(count: int) -> tuple[Array, Array]:
    """Return `directions` spread evenly along a spiral [Swinbank & Purser 2006, eq. 1-3].

    No symmetry of a body makes any of them superfluous.
    """
    height = (np.arange(count) + 0.5) / count
    angle = np.pi * (np.sqrt(5) - 1) * np.arange(count)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1), np.full(count, 0.5 / count)


def _principal(corner: Array, motion: Array) -> tuple[Array, Array]:
    """Rotate corners about the surface's centroid to its principal axes, longest first; also return the frame (3, 3).

    Axes point to where there is more motion (f,), summed over modes. Where there is as much on both sides, within
    `even_share`, their sense does not matter, and is that of the surface's moments alone.
    """
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    centre = corner.mean(axis=1)
    middle = area @ centre / area.sum()
    spread = np.einsum("f,fi,fj->ij", area, centre - middle, centre - middle)
    # rounded: equal moments leave the body's own axes
    turn = np.linalg.eigh(np.round(spread * (1e6 / np.trace(spread))))[1][:, ::-1].T
    skew = (area * motion) @ (centre - middle) @ turn.T
    # of motion and its lever: less is a mesh's own, 1e-6 … 3e-3 on even bodies; rounding moves it by 5e-5
    even_share = 0.01
    even = even_share * ((area * motion) @ np.abs((centre - middle) @ turn.T))
    turn[skew < -even] *= -1
    turn[2] *= np.sign(np.linalg.det(turn))
    return (corner - middle) @ turn.T, turn


def _patches(corner: Array, area: Array, normal: Array, most: int) -> tuple[Array, Array]:
    """Return the patch (f,) of each face and the place (s, 3) of each patch: its centroid.

    Neighbours that face the same side are merged where there are too many.
    """
    centre = corner.mean(axis=1)
    patch = np.arange(len(area))
    edge_m = np.sqrt(area.sum() / most)
    while patch.max() >= most:
        patch = cells(centre, normal, edge_m)
        edge_m *= 1.15
    total = np.bincount(patch, area)
    return patch, np.stack([np.bincount(patch, area * centre[:, i]) / total for i in range(3)], axis=1)


def _surface_sums(
    face: Array,
    normal: Array,
    area: Array,
    corner: Array,
    patches: tuple[Array, Array],
    near: tuple[PotentialMap, Array],
) -> tuple[Any, list[Any], Any]:
    """Build what sums the vertices' motion (3 v, m) over the surface, scipy sparse: once for all modes.

    ∫ v over each patch (s, 3 v); its three ∫ v (x - place); the mean speed (c, 3 v) of each triangle of `moved`, that
    of the faces that it represents, or of the nearest where it represents none.

    face, normal (f, 3) in the body's frame; area (f,) and corner (f, 3, 3) in the principal one. patches: of
    `_patches`; near: of `surface_air`.
    """
    from scipy.sparse import csr_array

    (patch, place), (moved, nearest) = patches, near
    faces, triangles = len(face), len(moved.area_m2)
    vertices = int(face.max()) + 1
    vertex = (3 * face[:, :, None] + np.arange(3)).ravel()
    # v at the corners of faces, from their vertices' motion
    speed = csr_array(
        (np.repeat(normal, 3, axis=0).ravel(), vertex, 3 * np.arange(3 * faces + 1)),
        shape=(3 * faces, 3 * vertices),
    )
    speed.eliminate_zeros()
    each = np.arange(3 * faces)

    def summed(weight: Array, row: Array, rows: int) -> Any:
        return csr_array((weight.ravel(), (np.repeat(row, 3), each)), shape=(rows, 3 * faces)) @ speed

    third = np.repeat(area / 3, 3)
    arm = corner - place[patch][:, None]
    # ∫ v y over a triangle of linear v, y = area/12 (Σv Σy + Σvy)
    moment = area[:, None, None] / 12 * (arm.sum(axis=1, keepdims=True) + arm)
    size = np.bincount(nearest, area, triangles)
    mean = summed(third / np.repeat(np.where(size > 0, size, 1)[nearest], 3), nearest, triangles)
    none = np.flatnonzero(size == 0)
    if len(none):
        from scipy.spatial import cKDTree

        nearest = cKDTree(corner.mean(axis=1)).query(moved.corner_m[none].mean(axis=1))[1]
        column = (3 * nearest[:, None] + np.arange(3)).ravel()
        taken = csr_array((np.full(len(column), 1 / 3), (np.repeat(none, 3), column)), shape=(triangles, 3 * faces))
        mean = mean + taken @ speed
    lever = [summed(moment[:, :, i], patch, len(place)) for i in range(3)]
    return summed(third, patch, len(place)), lever, mean


def _patch_push(area: Array, normal: Array, patch: Array, nearest: Array, shape: tuple[int, int]) -> list[Any]:
    """Build what sums n ψ of triangles (c, m) over each patch: three matrices (s, c), scipy sparse."""
    from scipy.sparse import csr_array

    return [csr_array((area * normal[:, i], (patch, nearest)), shape=shape) for i in range(3)]


def _near_field(k: Array, curved_per_m: float, moved: PotentialMap, speed: Array) -> Array:
    """Compute ψ (c, m) in m·(1/√kg), complex, of the triangles' mean speeds (c, m)."""
    root = np.sqrt(moved.area_m2)[:, None]
    curved = np.minimum(curved_per_m, 0.5 / moved.length_m)[:, None]
    across = (1 / moved.length_m[:, None] - curved) ** 2 - curved**2
    q = curved + np.sqrt(across + (curved + 1j * k) ** 2)
    share: Array = moved.vector.T @ (root * speed)
    return np.asarray(moved.vector @ np.divide(share, q) / root)


def jerk_coefficient(volume_m3: float, air: Air) -> float:
    """Compute K = 3ρ₀V/(8πc) in Pa·m per m/s³.

    A rigid compact body's far pressure is K cosθ · jerk(t - r/c)/r [Chadwick, Zheng, James 2012, eq. 9], θ from the
    jerk to the listener. It is the sphere's law at small ka: displaced air and half as much again as added mass [Pierce
    1989, sec. 4-2].
    """
    return 3 * air.density_kg_m3 * volume_m3 / (8 * np.pi * air.sound_speed_m_s)
