"""Bodies and logs made by hand, so that a test of the run time needs neither PyBullet nor finite elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.records import Body, Material, ModalModel
from sonic_bullet.records.contacts import Contacts, Step

STEEL = Material.isotropic(
    "steel", youngs_pa=2e11, poisson=0.29, density_kg_m3=7850, alpha_per_s=4.0, beta_s=2e-9, restitution=0.6
)
WOOD = Material.isotropic(
    "wood", youngs_pa=1.1e10, poisson=0.3, density_kg_m3=700, alpha_per_s=40.0, beta_s=2e-7, restitution=0.4
)
GLASS = Material.isotropic(
    "glass", youngs_pa=7e10, poisson=0.22, density_kg_m3=2500, alpha_per_s=8.0, beta_s=1e-8, restitution=0.6
)
GRAVITY_M_S2 = np.array([0.0, 0.0, -9.81])
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def box_surface(edges_m: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """The 8 corners and 12 outward triangles of a box about the origin."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.asarray(edges_m, float) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner, np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))], np.int32)


def box_model(
    edges_m: Sequence[float], freq_hz: Sequence[float], material: Material = STEEL, *, seed: int = 0
) -> ModalModel:
    """A box of that size whose corners move as seeded directions say, a mode for each frequency, of about unit modal
    mass.
    """
    vertex, face = box_surface(edges_m)
    volume = float(np.prod(edges_m))
    mass = volume * material.density_kg_m3
    freq = np.sort(np.asarray(freq_hz, float))
    shape = np.random.default_rng(seed).normal(size=(len(vertex), 3, len(freq))) / np.sqrt(mass)
    decay = 0.5 * ((material.alpha_per_s or 0.0) + (material.beta_s or 0.0) * (2 * np.pi * freq) ** 2)
    return ModalModel(freq, decay, shape, vertex, face, np.zeros(len(face)), volume, mass)


def box_body(
    edges_m: Sequence[float],
    freq_hz: Sequence[float],
    material: Material = STEEL,
    *,
    body_id: int = 0,
    mass_kg: float | None = None,
) -> Body:
    """The body of `box_model`. mass_kg None: as the model; 0: it does not move."""
    model = box_model(edges_m, freq_hz, material, seed=body_id)
    mass = model.mass_kg if mass_kg is None else mass_kg
    e = np.asarray(edges_m, float)
    inertia = np.diag(mass / 12 * np.array([e[1] ** 2 + e[2] ** 2, e[0] ** 2 + e[2] ** 2, e[0] ** 2 + e[1] ** 2]))
    return Body(body_id, -1, 0, f"box{body_id}", mass, inertia, model.volume_m3, material=material, model=model)


def ball_body(radius_m: float, material: Material = STEEL, *, body_id: int = 0, mass_kg: float | None = None) -> Body:
    """A sphere without modes: it only clicks."""
    volume = 4 / 3 * np.pi * radius_m**3
    mass = volume * material.density_kg_m3 if mass_kg is None else mass_kg
    vertex, face = box_surface([2 * radius_m / np.sqrt(3)] * 3)
    none = np.zeros(0)
    model = ModalModel(
        none, none, np.zeros((len(vertex), 3, 0)), vertex, face, np.full(len(face), 1 / radius_m), volume, mass
    )
    return Body(
        body_id,
        -1,
        0,
        f"ball{body_id}",
        mass,
        0.4 * mass * radius_m**2 * np.eye(3),
        volume,
        1 / radius_m,
        material,
        model,
    )


def wall_body(*, body_id: int = 9) -> Body:
    """A silent partner that never moves."""
    return Body(body_id, -1, 0, "wall", 0.0, np.zeros((3, 3)))


def row(
    a: int,
    b: int,
    impulse_n_s: Sequence[float],
    *,
    normal: Sequence[float] = (0, 0, 1),
    point_a: Sequence[float] = (0, 0, 0),
    point_b: Sequence[float] = (0, 0, 0),
    slip: Sequence[float] = (0, 0, 0),
    sweep: Sequence[float] = (0, 0),
    approach: float = 1.0,
    gap: float = 0.0,
) -> Contacts:
    """One contact; join several with `Contacts.joined`."""
    one = {
        "point_a_m": point_a,
        "point_b_m": point_b,
        "normal": normal,
        "impulse_n_s": impulse_n_s,
        "slip_m_s": slip,
        "sweep_m_s": sweep,
        "approach_m_s": approach,
        "gap_m": gap,
    }
    return Contacts(np.array([a]), np.array([b]), **{name: np.array([value], float) for name, value in one.items()})


def step(
    position_m: Sequence[Sequence[float]],
    contacts: Contacts | None = None,
    *,
    dt_s: float = 1 / 240,
    gravity: object = (0, 0, 0),
) -> Step:
    """A step with all bodies upright."""
    b = len(position_m)
    return Step(
        dt_s,
        np.asarray(position_m, float),
        np.tile(UPRIGHT, (b, 1)),
        np.zeros(b, bool),
        contacts or Contacts.none(),
        np.asarray(gravity, float),
    )
