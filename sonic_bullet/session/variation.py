"""Takes of one log: what a simulation does not determine is drawn anew, all else stays.

    ContactLog, seed, number of the take -> surfaces   another seed of all that is rough
                                         -> places     contacts moved within the footprint of their pair
                                         -> materials  each body's numbers within the spread of its material
        -> ContactLog, and the factors drawn

Take 1 is the log itself. Every take draws from generators of its own, seeded by (seed, take, kind, body): the same seed
gives the same bytes, and a kind that is not varied does not affect the others.

Surfaces: a body's profile is one of many of its spectrum.
Places: Bullet takes two points of a pair for one contact where they are nearer than 0.02 of the smaller body's bounding
radius [btCollisionShape::getContactBreakingThreshold, gContactBreakingThreshold = 0.02]; the place of a contact within
it is not known. A pair that comes into contact gets a vector d, |d| ≤ r, and keeps it until it separates; both points
move by d - (d·n)n, n the normal, so that places move where the normal rotates.
Materials: E, ρ, damping, roughness, Hurst exponent and restitution of a preset have spreads, standard deviations of the
logarithm, and ranges (docs/reference/preset.md). With factors e of E, r of ρ: λ' = λ e/r, shapes u/√r [UᵀMU = I].
Poisson's ratio and with it the shapes stay.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.effects.damping_law import DampingLaw, own_decay_per_s
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.presets import made_names, named_preset, table_names
from sonic_bullet.records import Array, Body, Material, ModalModel
from sonic_bullet.records.coerce import nearest
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.roughness import with_roughness as with_roughness_of
from sonic_bullet.session.material_choice import as_choice
from sonic_bullet.simulators.names import match_name

VARIED = ("surfaces", "places", "materials")
AS_SIMULATED = "motion, masses and contact forces of every take are those of the log"


@dataclass(frozen=True, slots=True)
class Variation:
    """Kinds to vary, of `VARIED`. footprint_m: radius of a footprint; None: Bullet's."""

    varied: frozenset[str] = frozenset(VARIED)
    footprint_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LogTake:
    """A take's log. drawn: factors of its material's numbers, by body."""

    number: int
    log: ContactLog
    drawn: Mapping[str, Mapping[str, float]]


def make_take(log: ContactLog, number: int, variation: Variation | None = None) -> LogTake:
    """Make take ``number`` of a log, counted from 1, by its seed; raises SceneError."""
    variation = variation or Variation()
    if number < 1:
        raise SceneError(f"there is no take {number}", "count takes from 1")
    if number == 1:
        return LogTake(1, log, {})
    unknown = sorted(variation.varied - set(VARIED))
    if unknown:
        raise SceneError(f"takes do not vary in {unknown[0]}", nearest(unknown[0], list(VARIED)))
    made = log
    drawn: dict[str, dict[str, float]] = {}
    if "places" in variation.varied:
        made = _moved_contacts(made, number, variation.footprint_m)
    if "materials" in variation.varied:
        made, drawn = _other_materials(made, number)
    if "surfaces" in variation.varied:
        made = replace(made, seed=int(_state(log.seed, number, "surfaces")[0]))
    return LogTake(number, made, drawn)


def _state(seed: int, number: int, what: str, *who: int) -> Array:
    """Derive two 32-bit numbers for one quantity of a take."""
    words = [seed & 0xFFFFFFFF, seed >> 32, number, VARIED.index(what), *(x & 0xFFFFFFFF for x in who)]
    return np.random.SeedSequence(words).generate_state(2)


def _generator(seed: int, number: int, what: str, *who: int) -> np.random.Generator:
    return np.random.default_rng(_state(seed, number, what, *who))


def _identity(body: Body) -> tuple[int, int, int]:
    return body.body_id, body.link + 1, body.epoch


def footprints_m(bodies: Collection[Body]) -> Array:
    """Return Bullet's radius (b,) for each body; infinite for planes and bodies of unknown size."""
    radius = [_radius_m(body) for body in bodies]
    # radius within which a pair's points are one contact, over the smaller body's bounding radius: Bullet's own
    footprint = 0.02
    return np.array([footprint * r if r > 0 else np.inf for r in radius])


def _radius_m(body: Body) -> float:
    if body.model is not None and len(body.model.vertex_m):
        return float(np.linalg.norm(body.model.vertex_m, axis=1).max())
    return float((3 * body.volume_m3 / (4 * np.pi)) ** (1 / 3))


def _moved_contacts(log: ContactLog, number: int, footprint_m: float | None) -> ContactLog:
    """Move each pair's contacts by its own vector, from its first step of contact to its last."""
    own = footprints_m(log.bodies) if footprint_m is None else np.full(len(log.bodies), footprint_m)
    touching: dict[tuple[int, int], Array] = {}
    met: dict[tuple[int, int], int] = {}
    steps = []
    for step in log.steps:
        row = step.contacts.row
        pairs = list(zip(np.minimum(row["a"], row["b"]).tolist(), np.maximum(row["a"], row["b"]).tolist(), strict=True))
        now: dict[tuple[int, int], Array] = {}
        for pair in pairs:
            if pair in now:
                continue
            if pair in touching:
                now[pair] = touching[pair]
                continue
            met[pair] = met.get(pair, 0) + 1
            who = (*_identity(log.bodies[pair[0]]), *_identity(log.bodies[pair[1]]), met[pair])
            radius = min(own[pair[0]], own[pair[1]])
            now[pair] = _in_ball(_generator(log.seed, number, "places", *who)) * (
                radius if np.isfinite(radius) else 0.0
            )
        touching = now
        steps.append(_move_points(step, np.array([now[pair] for pair in pairs])) if pairs else step)
    return replace(log, steps=tuple(steps))


def _in_ball(draw: np.random.Generator) -> Array:
    """Draw a vector (3,), uniform within the unit ball."""
    direction = draw.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction) * np.cbrt(draw.random()))


def _move_points(step: Step, vector_m: Array) -> Step:
    """Move the points of a step's rows by the vectors (k, 3), along the surfaces."""
    row = step.contacts.row.copy()
    along = vector_m - (vector_m * row["normal"]).sum(axis=1, keepdims=True) * row["normal"]
    for side, point in (("a", "point_a_m"), ("b", "point_b_m")):
        at = np.searchsorted(step.body, row[side])
        row[point] += _to_body(step.quaternion_xyzw[at], along)
    row.setflags(write=False)
    return replace(step, contacts=Contacts.of_trusted(row))


def _to_body(quaternion_xyzw: Array, vector: Array) -> Array:
    """Rotate world vectors (k, 3) to the frames of orientations (k, 4)."""
    q = quaternion_xyzw / np.linalg.norm(quaternion_xyzw, axis=1, keepdims=True)
    axis, w = -q[:, :3], q[:, 3:]
    twice = 2 * np.cross(axis, vector)
    return np.asarray(vector + w * twice + np.cross(axis, twice))


def _other_materials(log: ContactLog, number: int) -> tuple[ContactLog, dict[str, dict[str, float]]]:
    """Draw each body's material anew where a preset of that name states its spread; return the factors too."""
    bodies, drawn = [], {}
    for body in log.bodies:
        factors = {}
        if body.material is not None:
            factors = draw_factors(body.material, _generator(log.seed, number, "materials", *_identity(body)))
        if factors:
            drawn[body.name] = factors
            body = vary_body(body, factors)  # noqa: PLW2901 - the same body
        bodies.append(body)
    return replace(log, bodies=tuple(bodies)), drawn


def draw_factors(material: Material, draw: np.random.Generator) -> dict[str, float]:
    """Draw a factor of each number of a preset, e^(s z), z normal, within its range; none of an unknown material."""
    if material.name not in (*table_names(), *made_names()):
        return {}
    preset = named_preset(material.name)
    factors: dict[str, float] = {}
    for part in (preset.elasticity, preset.damping, preset.surface, preset.impact):
        for name, spread in part.spread.items():
            factor = float(np.exp(spread * draw.normal()))
            said = getattr(part, name, preset.density_kg_m3 if name == "density_kg_m3" else None)
            value = float(np.max(said)) if said else 0.0  # of a tensor: along the grain, as its range is
            if name in part.range and value:
                low, high = part.range[name]
                factor = min(max(factor, min(low / value, 1.0)), max(high / value, 1.0))
            factors[name] = factor
    factors.pop("poisson", None)
    return factors


def vary_body(body: Body, factors: Mapping[str, float]) -> Body:
    """Multiply the numbers of a body's material; its modes follow by the module's equations."""
    material = body.material
    assert material is not None
    stiff = factors.get("youngs_pa", factors.get("stiffness_pa", 1.0))
    dense = factors.get("density_kg_m3", 1.0)
    loss = factors.get("loss_factor", 1.0)
    changed: dict[str, Any] = {
        "stiffness_pa": material.stiffness_pa * stiff,
        "density_kg_m3": material.density_kg_m3 * dense,
        "roughness_m": material.roughness_m * factors.get("roughness_m", 1.0),
        "hurst": min(material.hurst * factors.get("hurst", 1.0), 0.999),
        "restitution": min(material.restitution * factors.get("restitution", 1.0), 1.0),
    }
    if material.alpha_per_s is not None and material.beta_s is not None:
        changed["alpha_per_s"] = material.alpha_per_s * factors.get("alpha_per_s", loss)
        changed["beta_s"] = material.beta_s * factors.get("beta_s", loss)
    changed["effects"] = tuple(_vary_law(e, factors) if isinstance(e, DampingLaw) else e for e in material.effects)
    rough = with_roughness_of(material, changed.pop("roughness_m"))
    made = replace(rough, **changed)
    model = None if body.model is None else _vary_model(body.model, material, made, stiff / dense, dense)
    return replace(body, material=made, model=model)


def _vary_law(law: DampingLaw, factors: Mapping[str, float]) -> DampingLaw:
    """Multiply the numbers of a law by the factors of the preset's that state them."""
    return replace(
        law,
        eta=law.eta * factors.get("loss_factor", 1.0),
        exponent=law.exponent * factors.get("exponent", 1.0),
        floor_s=law.floor_s * factors.get("floor_s", 1.0),
    )


def _vary_model(model: ModalModel, old: Material, new: Material, ratio: float, dense: float) -> ModalModel:
    """Scale modes to eigenvalues times ratio and density times dense; decays change as their material's own do."""
    if not model.mode_count:
        return replace(model, mass_kg=model.mass_kg * dense)
    eigenvalue = model.omega0_squared_per_s2
    decay = model.decay_per_s
    if new.alpha_per_s is not None and old.alpha_per_s is not None:
        law, wanted = own_decay_per_s(old, eigenvalue), own_decay_per_s(new, eigenvalue * ratio)
        decay = np.where(law > 0, decay * wanted / np.where(law > 0, law, 1.0), decay)
    omega_squared = eigenvalue * ratio - np.nan_to_num(decay) ** 2
    order = np.argsort(omega_squared, kind="stable")
    order = order[omega_squared[order] > 0]
    return replace(
        model,
        freq_hz=np.sqrt(omega_squared[order]) / (2 * np.pi),
        decay_per_s=decay[order],
        shape=model.shape[:, :, order] / np.float32(np.sqrt(dense)),
        mass_kg=model.mass_kg * dense,
        dropped=model.dropped + model.mode_count - len(order),
        bend_s2_m2=None if model.bend_s2_m2 is None else model.bend_s2_m2[order],
        damping_growth_s_m=None if model.damping_growth_s_m is None else model.damping_growth_s_m[order],
        stands_for=None if model.stands_for is None else model.stands_for[order],
    )


def with_roughness(log: ContactLog, roughness_m: Mapping[str, float], where: str) -> ContactLog:
    """Return the log with other rms heights of surfaces, by names of bodies or links; "": of all others.

    Raises
    ------
    SceneError
        No body has that name.
    """
    named = {name: height for name, height in roughness_m.items() if name}
    _check_names(log, named, where)
    bodies = []
    for body in log.bodies:
        found = match_name(body.name, named)
        if found is not None and body.material is None:
            raise SceneError(f"{body.name} has no surface: it was no sounding body", "give it a --material, too")
        height = roughness_m.get(found or "")
        if height is not None and body.material is not None:
            body = replace(body, material=with_roughness_of(body.material, height))  # noqa: PLW2901 - the same body
        bodies.append(body)
    return replace(log, bodies=tuple(bodies))


def with_gains(log: ContactLog, gain_db: Mapping[str, float], where: str) -> ContactLog:
    """Return the log with gains of bodies at the sensors, by names of bodies or links.

    Raises
    ------
    SceneError
        No body has that name.
    """
    _check_names(log, gain_db, where)
    bodies = []
    for body in log.bodies:
        found = match_name(body.name, gain_db)
        bodies.append(body if found is None else replace(body, gain_db=gain_db[found]))
    return replace(log, bodies=tuple(bodies))


def _check_names(log: ContactLog, names: Collection[str], where: str) -> None:
    as_choice(silent=list(names)).check_names([body.name for body in log.bodies], where)
