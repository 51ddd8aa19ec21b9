"""Modes above the last one that was solved, filled statistically: of plates and shells, and of a draft's lumps.

    N(f) = A/4π <k²>,   k² = a + √(b² + ω²ρh/D),   a, b = ω²/2 (1/c_s² ± 1/c_p²)
        [Cremer, Heckl, Petersson 2005, sec. 4.2; Mindlin 1951, J. Appl. Mech. 18, 31, the lower branch]
    <φ²> = 1/M:   Re Y = π/2 · dN/dω · <φ²> = 1/(8√(Dρh))   [Cremer, Heckl, Petersson 2005, sec. 5.3, 5.7]

    a lump's:  N(f) = V ω³/6π² (1/c_l³ + 2/c_t³) + S ω²/16π (2c_t⁴ − 3c_t²c_l² + 3c_l⁴)/(c_t²c_l²(c_l² − c_t²))
        [Weyl's law of a free elastic body; Dupuis, Mazo, Onsager 1960, J. Chem. Phys. 33, 1452]

D = Q h³/12, Q of a bending wave's direction in the wall's plane, its stress-free faces condensed; c_p² = Q/ρ, c_s² =
5G/6ρ. Averages are over the wall and over directions. Shapes are waves of random direction and phase of that k
[Berry 1977, J. Phys. A 10, 2083], along the wall's normal, seeded by the surface. So few resonators as tell
the ear no more stand for all: 20 a third octave, each for several modes where these are denser. Their mean
square continues that of the upper half of the solved ones. Where a wall is not thin by its extent, no wave of it is:
such a lump has a tail of shear waves in a draft alone, whose modes end below 20 kHz for their number, not its own.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.effects.damping_law.thermoelastic import ThermoelasticLoss, walls
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.geometry.triangles import face_areas_m2, outward_normals, volume_m3
from sonic_bullet.modal.fem import VOIGT
from sonic_bullet.records import Array, Material, ModalModel
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.records.units import HEARING_LIMIT_HZ
from sonic_bullet.signal.robust import weighted_median

WALL_SAMPLES = 96
"""Places of the wall and directions at them that averages are over."""
SUMMED_WAVES = 32
"""In a shape: the sum is normal within 1 % of its fourth moment."""


def with_tail(
    model: ModalModel,
    material: Material,
    to_hz: float = HEARING_LIMIT_HZ,
    resonators_per_third: float = 20.0,
    *,
    lumps: bool = False,
    most_modes: float = np.inf,
) -> ModalModel:
    """Return a model with resonators above its last mode, up to to_hz; itself where it has none to be continued.

    lumps: whether bodies that are no plate or shell have them, too. 20 of a third octave are twice as many as the ear
    has filters' widths there, 4 to a tone's own. most_modes: of the model in all, solved and stood for.
    The note says how many, and for how many modes they stand.
    """
    top_hz = min(to_hz, HEARING_LIMIT_HZ)
    fewest_solved = 6  # solved modes whose mean square is continued
    alive = model.mode_count >= fewest_solved and len(model.face) > 0 and material.alpha_per_s is not None
    if not alive or model.freq_hz[-1] >= 0.95 * top_hz or any(isinstance(e, RecordedLines) for e in material.effects):
        return model
    thickness, across = walls(model.vertex_m, model.face)
    ratio, area = _wall_thickening(model), face_areas_m2(model.vertex_m, model.face)
    thickness = thickness / ratio
    hidden = 2.0  # from so many times as thick on, cells of a lattice close what lies between walls: volume tells them
    if ratio > hidden:
        thickness = np.minimum(thickness, 2 * model.volume_m3 / area.sum())
    known = across >= 0
    flat = area[known].sum() >= 0.5 * area.sum()
    middle_m = weighted_median(thickness[known], area[known]) if flat else np.inf
    skin = known & (thickness < 2.5 * middle_m)
    wall_m2 = model.volume_m3 / middle_m
    thin_wall = 5.0  # √area over thickness from which on a body is a plate or a shell
    flat = flat and np.sqrt(wall_m2) >= thin_wall * middle_m and area[skin].sum() >= 0.5 * area.sum()
    if not flat and not lumps:
        return model
    seed = hashlib.sha256(np.round(model.vertex_m, 7).tobytes() + model.face.tobytes()).digest()
    rng = np.random.default_rng(int.from_bytes(seed[:8], "little"))
    waves: _BendingWaves | _ShearWaves = (
        _BendingWaves(model, material, thickness, area * skin, wall_m2) if flat else _ShearWaves(model, material)
    )
    freq, modes = _places(waves, (float(model.freq_hz[-1]), top_hz), resonators_per_third, rng)
    some = model.mode_count + np.cumsum(modes) <= most_modes
    freq, modes = freq[some], modes[some]
    if not len(freq):
        return model
    weight = _vertex_areas(model, area * skin if flat else area)
    shape = waves.shapes(weight, freq, rng) * np.sqrt(_continue_mean_square(model, weight, waves) * modes)
    lam = (2 * np.pi * freq) ** 2
    decay = own_decay_per_s(material, lam)
    for loss in (effect for effect in material.effects if flat and isinstance(effect, ThermoelasticLoss)):
        plate = (1 + loss.poisson) / (1 - loss.poisson)  # of a plate over a beam [Norris & Photiadis 2005, eq. 28]
        decay = decay + np.pi * freq * plate * loss.loss_of_beam(np.full(len(freq), middle_m), 2 * np.pi * freq)
    damped = np.sqrt(np.maximum(lam - decay**2, 0)) / (2 * np.pi)
    audible = np.flatnonzero((decay < np.pi * freq) & (damped > model.freq_hz[-1]))
    audible = audible[np.argsort(damped[audible], kind="stable")]  # strong damping bends them back down
    freq, decay, shape, modes = damped[audible], decay[audible], shape[:, :, audible], modes[audible]
    if not len(freq):
        return model
    zeros = np.zeros(len(freq))
    grown: dict[str, Any] = {
        name: np.concatenate([getattr(model, name), zeros])
        for name in ("bend_s2_m2", "damping_growth_s_m")
        if getattr(model, name) is not None
    }
    reach_hz = top_hz if some.all() else float(freq[-1])
    note = (
        f"; above them {len(freq)} resonators for {modes.sum():.0f} modes up to {reach_hz:.0f} Hz, by the density of "
        f"{f'bending waves in walls of {1000 * middle_m:.3g} mm' if flat else 'waves in its volume'}"
    )
    return replace(
        model,
        freq_hz=np.concatenate([model.freq_hz, freq]),
        decay_per_s=np.concatenate([model.decay_per_s, decay]),
        shape=np.concatenate([model.shape, quantize_shapes(shape.astype(np.float32))], axis=2),
        stands_for=np.concatenate([np.ones(model.mode_count), modes]),
        note=model.note + note,
        **grown,
    )


def _wall_thickening(model: ModalModel) -> float:
    """Return how many times as thick the walls of a model's surface are as the body's (modal.meshing.filling)."""
    alike = 0.05  # relative: elements' surfaces hold a body's volume to less
    held = abs(volume_m3(model.vertex_m, model.face))
    ratio = held / model.volume_m3 if model.volume_m3 > 0 else 1.0
    return ratio if ratio > 1 + alike else 1.0


class _BendingWaves:
    """Bending waves at places of a wall and in directions along it, with equal parts of its area.

    direction (s, 3); stiff (s,): ρh/D; slow, fast (s,): 1/c_s², 1/c_p²; area_m2: of the wall; axis (v, 3): its normal.
    """

    def __init__(self, model: ModalModel, material: Material, thickness: Array, area: Array, area_m2: float) -> None:
        self.vertex_m, self.area_m2 = model.vertex_m, area_m2
        each = face_areas_m2(model.vertex_m, model.face)[:, None] * outward_normals(model.vertex_m, model.face) / 3
        self.outward_m2 = np.zeros((len(model.vertex_m), 3))
        for corner in range(3):
            np.add.at(self.outward_m2, model.face[:, corner], each)
        self.axis = _wall_axes(model, area / np.maximum(thickness, 1e-12) ** 4)
        chosen = np.searchsorted(np.cumsum(area), (np.arange(WALL_SAMPLES) + 0.5) / WALL_SAMPLES * area.sum())
        normal = outward_normals(model.vertex_m, model.face)[chosen]
        first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        angle = np.pi * (np.arange(WALL_SAMPLES) * 0.618033988749895 % 1)
        second = np.cross(normal, first)
        self.direction = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        tensor = material.stiffness_pa[VOIGT[:, :, None, None], VOIGT[None, None]]
        frame = np.stack([self.direction, np.cross(normal, self.direction), normal], axis=1)
        turned = np.einsum("sai,sbj,sck,sdl,ijkl->sabcd", frame, frame, frame, frame, tensor, optimize=True)
        free = [(2, 2), (2, 0), (2, 1)]
        inner = np.array([[turned[:, a, b, c, d] for c, d in free] for a, b in free]).transpose(2, 0, 1)
        outer = np.array([turned[:, 0, 0, a, b] for a, b in free]).T
        bent = turned[:, 0, 0, 0, 0] - np.einsum("si,si->s", outer, np.linalg.solve(inner, outer[:, :, None])[:, :, 0])
        rho, h = material.density_kg_m3, thickness[chosen]
        self.stiff = 12 * rho / (bent * h**2)
        self.slow, self.fast = rho / (5 / 6 * turned[:, 2, 0, 2, 0]), rho / bent

    def square(self, freq_hz: Array) -> Array:
        """Compute k² (m, s) at frequencies (m,)."""
        omega2 = (2 * np.pi * np.asarray(freq_hz)[:, None]) ** 2
        return np.asarray(
            omega2 / 2 * (self.slow + self.fast)
            + np.sqrt(omega2**2 / 4 * (self.slow - self.fast) ** 2 + omega2 * self.stiff)
        )

    def count(self, freq_hz: Array) -> Array:
        """Compute N (m,)."""
        return np.asarray(self.area_m2 / (4 * np.pi) * self.square(freq_hz).mean(axis=1))

    def along(self, shape: Array) -> Array:
        """Return squares (v, m) of what waves move of shapes (v, 3, m)."""
        return np.asarray(np.einsum("vi,vim->vm", self.axis, shape) ** 2)

    def shapes(self, weight: Array, freq: Array, rng: np.random.Generator) -> Array:
        """Draw shapes (v, 3, m) along the wall's normal, of mean square 1 over it, that keep the body's volume.

        Bending stretches one side of a wall as it presses the other: ∮ u·n dS = ∫ div u dV = 0. Random waves of a small
        or bent body swell it, which sounds as no mode of it does where it is small by the wavelength.
        """
        swells = np.einsum("vi,vi->v", self.outward_m2, self.axis)
        swell = swells / np.maximum(np.linalg.norm(self.outward_m2, axis=1), 1e-300)
        size = np.zeros((len(freq), len(self.vertex_m)))  # a shape's in turn: a tenth of the time of one of all in turn
        for m, square in enumerate(self.square(freq)):
            chosen = rng.choice(WALL_SAMPLES, SUMMED_WAVES, p=square / square.sum())
            vector = np.sqrt(square[chosen])[:, None] * self.direction[chosen]
            phase = self.vertex_m @ vector.T + rng.uniform(0, 2 * np.pi, SUMMED_WAVES)
            along = np.einsum("vi,vi->v", np.cos(phase) @ rng.standard_normal((SUMMED_WAVES, 3)), self.axis)
            along -= (swells @ along) / max(float(swells @ swell), 1e-300) * swell
            size[m] = along / np.sqrt(weight @ along**2)
        return self.axis[:, :, None] * size.T[:, None, :]


class _ShearWaves:
    """Waves in a lump's volume; nine tenths of them and more are shear waves. slow, fast: c_t, c_l in m/s."""

    def __init__(self, model: ModalModel, material: Material) -> None:
        stiff = np.diag(material.stiffness_pa)
        self.fast, self.slow = (float(np.sqrt(part.mean() / material.density_kg_m3)) for part in (stiff[:3], stiff[3:]))
        self.vertex_m, self.volume_m3 = model.vertex_m, model.volume_m3
        self.area_m2 = float(face_areas_m2(model.vertex_m, model.face).sum())

    def count(self, freq_hz: Array) -> Array:
        """Compute N (m,)."""
        omega, slow, fast = 2 * np.pi * np.asarray(freq_hz), self.slow**2, self.fast**2
        inside = self.volume_m3 / (6 * np.pi**2) * (1 / self.fast**3 + 2 / self.slow**3)
        skin = (2 * slow**2 - 3 * slow * fast + 3 * fast**2) / (slow * fast * (fast - slow))
        return np.asarray(inside * omega**3 + self.area_m2 / (16 * np.pi) * skin * omega**2)

    def along(self, shape: Array) -> Array:
        """Return squares (v, m) of what waves move of shapes (v, 3, m)."""
        return np.asarray((shape**2).sum(axis=1))

    def shapes(self, weight: Array, freq: Array, rng: np.random.Generator) -> Array:
        """Draw shapes (v, 3, m), across the ways of their waves, of mean square 1 over the surface."""
        made = np.zeros((len(freq), len(self.vertex_m), 3))
        for m, number in enumerate(2 * np.pi * freq / self.slow):
            way = rng.standard_normal((SUMMED_WAVES, 3))
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            across = np.cross(way, rng.standard_normal((SUMMED_WAVES, 3)))
            phase = number * self.vertex_m @ way.T + rng.uniform(0, 2 * np.pi, SUMMED_WAVES)
            made[m] = np.cos(phase) @ across
            made[m] /= np.sqrt(weight @ (made[m] ** 2).sum(axis=1))
        return np.ascontiguousarray(made.transpose(1, 2, 0))


def _places(
    waves: _BendingWaves | _ShearWaves,
    span_hz: tuple[float, float],
    resonators_per_third: float,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Return frequencies of resonators, ascending, and the modes that each stands for."""
    grid = np.geomspace(*span_hz, 2000)
    number = waves.count(grid)
    per_third = np.gradient(number, np.log2(grid)) / 3
    each = np.maximum(per_third / resonators_per_third, 1 + 1e-9)  # solved ones stand for 1, these for more
    index = np.concatenate([[0.0], np.cumsum(np.diff(number) / ((each[1:] + each[:-1]) / 2))])
    count = int(index[-1])
    at = np.arange(count) + 0.5 + rng.uniform(-0.4, 0.4, count)
    freq = np.interp(at, index, grid)
    return freq, np.interp(freq, grid, each)


def _wall_axes(model: ModalModel, weight: Array) -> Array:
    """Find the wall's normal (v, 3) at vertices, of either sign; at those of no wall that of the nearest one."""
    from scipy.spatial import cKDTree

    normal = outward_normals(model.vertex_m, model.face)
    tensor = np.zeros((len(model.vertex_m), 3, 3))
    each = weight[:, None, None] * normal[:, :, None] * normal[:, None, :]
    for corner in range(3):
        np.add.at(tensor, model.face[:, corner], each)
    size = np.trace(tensor, axis1=1, axis2=2)
    known = np.flatnonzero(size > 1e-3 * np.median(size[size > 0]))
    axis = np.linalg.eigh(tensor[known])[1][:, :, -1]
    return np.asarray(axis[cKDTree(model.vertex_m[known]).query(model.vertex_m)[1]])


def _vertex_areas(model: ModalModel, area: Array) -> Array:
    """Share the areas (f,) of faces out to vertices (v,), 1 in all."""
    found = np.zeros(len(model.vertex_m))
    for corner in range(3):
        np.add.at(found, model.face[:, corner], area)
    return np.asarray(found / found.sum())


def _continue_mean_square(model: ModalModel, weight: Array, waves: _BendingWaves | _ShearWaves) -> float:
    """Compute the mean square of a mode above: as the upper half of those solved.

    Over their number in the theory, for modes along a wall are among them and move its normal little; the median over
    the surface, for free edges move more, and the interior of a large one has 1/M. No more than one of them moves in
    all directions: where coarse elements have more modes than the theory, these are no modes of the body.
    """
    half = model.mode_count // 2
    low, high = waves.count(model.freq_hz[[half - 1, -1]])
    upper = model.shape[:, :, half:].astype(float)
    along = weighted_median(waves.along(upper).sum(axis=1), weight) / max(float(high - low), 1e-9)
    return float(min(along, weighted_median((upper**2).sum(axis=(1, 2)), weight) / upper.shape[2]))
