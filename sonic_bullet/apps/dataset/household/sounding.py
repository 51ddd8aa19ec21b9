"""From a clip to its sound: the run time plays a contact log, as it plays any.

HouseholdClip -> object_of_size: modes and radiation -> held_model where fingers hold it
struck, scraped: LogWriter: loads on what it lies on, then one strike, or strokes to and fro under a load
dropped, rolled, shaken: PyBullet, its contacts
-> ContactLog -> render_log, in the room -> + ambient noise -> microphone -> pascals
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from sonic_bullet.apps.dataset.household.clips import (
    FREE_SUPPORTS,
    PLACE_SCATTER_M,
    ROLLED,
    SCRAPED,
    SHAKEN,
    HouseholdClip,
    draw_change,
    draw_clip,
    draw_take,
)
from sonic_bullet.apps.dataset.household.holding import held_model
from sonic_bullet.apps.dataset.household.materials import specimen
from sonic_bullet.apps.dataset.household.objects import shape_of
from sonic_bullet.apps.dataset.household.solved import object_of_size
from sonic_bullet.apps.dataset.household.strikers import HARD, Striker
from sonic_bullet.apps.dataset.household.surroundings import CHAIN, noise_of, noise_rms_pa, room_response
from sonic_bullet.apps.dataset.impacts import collision_shape
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry.nearest_point import closest_point
from sonic_bullet.machine.progress import without_progress
from sonic_bullet.options.dataset import HouseholdOptions
from sonic_bullet.records import Air, Array, Material, Microphone, ModalModel, RoomResponse, Shape
from sonic_bullet.session import attach
from sonic_bullet.session.drawn_recording import draw_chain, record
from sonic_bullet.session.log_writer import LogWriter
from sonic_bullet.simulators import direct_client, keep_restitution
from sonic_bullet.simulators.animated import matrices

STEP_S, LONG_STEP = 1 / 60, 15
"""A step until the strike is over; so many are one after it, when no load changes."""
REST_STEPS = 8
"""Before the strike: loads are smoothed over 30 ms."""
STROKE_M = 0.01
"""Half of a scraping stroke: a finger's or a wrist's small movement, on which small objects are near their tangent."""
SLIDING_FRICTION = 0.4
"""Of dry solids: most lie between 0.2 and 0.6 [Blau 2001, Tribology International 34(9), 585]."""
SHAKING_HZ = 4.0
"""A hand goes to and fro: wrists tap at 5 to 6 Hz at most [Keele & Hawkins 1982, J. Motor Behavior 14(1)]."""
GRAVITY_M_S2 = 9.81
UPRIGHT = [0.0, 0.0, 0.0, 1.0]


@dataclass(frozen=True, slots=True, eq=False)
class HouseholdScene:
    """A clip, or a pair of clips that differ in one cause, as a recipe's scene."""

    clip: HouseholdClip
    options: HouseholdOptions
    cause: str = ""
    other: HouseholdClip | None = None
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def object(self) -> str:
        """Whose sound it is: both clips of a pair are its object's."""
        return self.clip.object.name

    def play(self, sr: int, seed: int, _: Callable[..., Any]) -> tuple[Array, ContactLog]:
        """Return the sound (channels, n) and the log, of a pair that of the first one's first take."""
        if self.other is None:
            return sound_of(self.clip, self.options, sr, seed)
        n = self.options.takes
        takes = [draw_take(self.clip, k) for k in range(n)] + [draw_take(self.other, n + k) for k in range(n)]
        made = [sound_of(take, self.options, sr, seed + take.take, self.clip) for take in takes]
        return np.concatenate([sound for sound, _ in made]), made[0][1]


def draw_scene(rng: np.random.Generator, options: HouseholdOptions) -> HouseholdScene:
    """Draw a scene: the recipe's ``sample``."""
    clip = draw_clip(rng, options)
    if not options.counterfactual:
        return HouseholdScene(clip, options, parameters=clip.parameters())
    cause, other = draw_change(clip, rng)
    columns = clip.parameters() | {"cause": cause, "other": other.parameters()}
    return HouseholdScene(clip, options, cause, other, columns)


def sound_of(
    clip: HouseholdClip, options: HouseholdOptions, sr: int, seed: int, like: HouseholdClip | None = None
) -> tuple[Array, ContactLog]:
    """Play a clip: (1, n) in pascals, and its log.

    like: on whose surface, as large as the clip's, places are drawn, for those of another wall or material to be there.
    """
    material, model = body_of(clip, options, like)
    if clip.excitation == SHAKEN:
        log = shaken_log(clip, options, material, model, sr, seed)
    elif clip.striker is None:
        log = dropped_log(clip, options, material, model, sr, seed)
    else:
        log = struck_log(clip, options, material, model, sr, seed, like)
    room = None
    if "room" not in options.without:
        room = RoomResponse(room_response(clip.room, float(np.linalg.norm(clip.microphone_m)), sr)[None], sr)
    sound = render_log(log, room=room)
    if "chain" not in options.without:
        rms_pa = noise_rms_pa(clip.noise_db, float(np.abs(sound).max()))
        sound = sound + noise_of(rms_pa, clip.noise_slope_db, sr, sound.shape[1], (clip.seed, clip.take))
        sound, _ = record(sound, sr, draw_chain(np.random.default_rng(clip.seed + 1), CHAIN))
    return sound, log


def body_of(
    clip: HouseholdClip, options: HouseholdOptions, like: HouseholdClip | None = None
) -> tuple[Material, ModalModel]:
    """Return the object's material and its modes at its size, held as it is; their radiation is known."""
    material, model = _free_body(clip, options)
    if clip.fingers_n_s_m and "support" not in options.without:
        surface, rng = _surface_like(clip, options, model, like), np.random.default_rng([clip.place_seed, 1])
        place, _ = _places(surface, rng, len(clip.fingers_n_s_m), -1.0)  # held_model takes what is nearest
        model = held_model(model, place, np.array(clip.fingers_n_s_m), Air())
    return material, model


def _free_body(clip: HouseholdClip, options: HouseholdOptions) -> tuple[Material, ModalModel]:
    of = clip.object
    elastic, loss = np.random.default_rng(clip.elastic_seed), np.random.default_rng(clip.loss_seed)
    material = specimen(of.material, elastic, loss)
    return material, object_of_size(of, clip.size, material, "radiation" in options.without)


def _surface_like(
    clip: HouseholdClip, options: HouseholdOptions, model: ModalModel, like: HouseholdClip | None
) -> ModalModel:
    """Return a body on whose surface places are drawn: its own, or that of another object at its size."""
    if like is None or like.object == clip.object:
        return model
    return _free_body(replace(like, size=clip.size), options)[1]


def _places(model: ModalModel, rng: np.random.Generator, count: int, lowest_z: float) -> tuple[Array, Array]:
    """Draw points (count, 3) of the surface and their normals, evenly over what faces above lowest_z."""
    corner = model.vertex_m[model.face]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(across, axis=1)
    normal = across / np.maximum(area, 1e-300)[:, None]
    weight = np.where(normal[:, 2] >= lowest_z, area, 0.0)
    face = rng.choice(len(area), size=count, p=weight / weight.sum())
    share = rng.dirichlet(np.ones(3), size=count)
    return np.einsum("kc,kcx->kx", share, corner[face]), normal[face]


def _lies(clip: HouseholdClip, options: HouseholdOptions) -> bool:
    return clip.support not in FREE_SUPPORTS and "support" not in options.without


def struck_place(
    clip: HouseholdClip, options: HouseholdOptions, model: ModalModel, like: HouseholdClip | None = None
) -> tuple[Array, Array]:
    """Draw where it is struck (3,), and the surface's normal there; of what lies, its underside is out of reach."""
    surface = _surface_like(clip, options, model, like)
    lies = _lies(clip if like is None else like, options)
    place, normal = _places(surface, np.random.default_rng(clip.place_seed), 1, -0.2 if lies else -1.0)
    if clip.take == 0 and surface is model:
        return place[0], normal[0]
    aside = PLACE_SCATTER_M * np.random.default_rng([clip.place_seed, 2, clip.take]).normal(size=3) * (clip.take > 0)
    aside -= (aside @ normal[0]) * normal[0]
    face, share, _ = closest_point(model.vertex_m, model.face, place + aside, normal)
    corner = model.vertex_m[model.face[face[0]]]
    across = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    return share[0] @ corner, across / np.linalg.norm(across)


def feet_of(model: ModalModel) -> Array:
    """Return three points (3, 3) of the lowest ones, far apart."""
    at = model.vertex_m
    near = 1e-3 * np.ptp(at[:, 2]) + 1e-6
    low = at[at[:, 2] <= at[:, 2].min() + near]
    first = low[np.argmax(low[:, 0])]
    second = low[np.argmax(np.linalg.norm(low - first, axis=1))]
    along = (second - first) / max(float(np.linalg.norm(second - first)), 1e-12)
    off = (low - first) - ((low - first) @ along)[:, None] * along
    return np.array([first, second, low[np.argmax(np.linalg.norm(off, axis=1))]])


def scale_shape(shape: Shape, size: float) -> Shape:
    """Return a shape times a size."""
    return replace(shape, size_m=size * shape.size_m, vertex_m=size * shape.vertex_m)


@lru_cache(maxsize=8)
def surface_of(name: str) -> tuple[Shape, Material]:
    """Return what things lie on: a wooden board, which sounds, or ground of stone or cloth, which does not.

    Cloth is soft and lossy: 0.3 MPa and η = 0.2, of felts and foams [Ashby 2011, Materials Selection, appendix A].
    """
    if name == "wood":
        return Shape("box", np.array([0.8, 0.6, 0.02])), load_material("made-wood")
    if name == "stone":
        return Shape("plane"), load_material("concrete")
    cloth = Material.isotropic(
        "cloth", youngs_pa=3e5, poisson=0.2, density_kg_m3=300.0, alpha_per_s=100.0, beta_s=1e-4, roughness_m=1e-4,
        restitution=0.2,
    )  # fmt: skip
    return Shape("plane"), cloth


def struck_log(
    clip: HouseholdClip,
    options: HouseholdOptions,
    material: Material,
    model: ModalModel,
    sr: int,
    seed: int,
    like: HouseholdClip | None = None,
) -> ContactLog:
    """Write the log of an object that hangs, is held, or lies, and is struck once; like: as of `sound_of`."""
    shape = scale_shape(shape_of(clip.object.kind, clip.object.wall_m, clip.object.seed), clip.size)
    lies = _lies(clip, options)
    writer = LogWriter(sr=sr, microphone=Microphone(np.array(clip.microphone_m)), seed=seed, supports=lies)
    with without_progress():
        body = writer.add("object", shape, material=material, model=model, mass_kg=model.mass_kg)
        striker = HARD if "contact-time" in options.without else clip.striker
        assert striker is not None
        tip = writer.add(
            "striker", Shape("sphere", np.array([striker.radius_m, 0, 0])), material=striker.material(),
            model=_ball(striker), mass_kg=striker.mass_kg,
        )  # fmt: skip
        place, normal = struck_place(clip, options, model, like)
        poses = [np.zeros(3), place + normal * 10 * striker.radius_m]
        feet = feet_of(model)
        if lies:
            under, of = surface_of(clip.support)
            height = feet[:, 2].min() - (0.5 * under.size_m[2] if under.kind == "box" else 0.0)
            count = 60 if under.kind == "box" else None
            ground = writer.add("support", under, material=of, mass_kg=0, count=count)
            poses.append(np.array([0.0, 0.0, height]))
    load: dict[str, Any] = {}
    if lies:
        load = {"pair": [[body, ground]] * 3, "point_m": feet, "normal": [[0, 0, 1]] * 3, "gap_m": [0.0] * 3}
    still = np.zeros((len(poses), 3))
    turns = [UPRIGHT] * len(poses)
    steps, number = round(options.seconds / STEP_S), 0
    scrapes = clip.excitation == SCRAPED
    while number < steps:
        width = 1 if scrapes or number < REST_STEPS + 3 else min(LONG_STEP, steps - number)
        contacts, speed, met = dict(load), still, dict[str, Any]()
        if lies:
            share = GRAVITY_M_S2 * model.mass_kg * width * STEP_S / 3
            contacts["impulse_n_s"] = [[0, 0, share]] * 3
        if scrapes:
            speed = still.copy()
            poses[tip], speed[tip], met = _stroke(
                clip, striker, (body, tip), place, normal, (number - REST_STEPS) * STEP_S
            )
        elif number <= REST_STEPS:
            speed = still.copy()
            speed[tip] = -clip.speed_m_s * normal
            ahead_m = _gap_m(clip) + (REST_STEPS - number) * STEP_S * clip.speed_m_s
            poses[tip] = place + normal * (striker.radius_m + ahead_m)
        if number == REST_STEPS and not scrapes:
            met = _strike(clip, material, model, striker, (body, tip), place, normal)
        contacts |= {key: [*contacts.get(key, ()), *new] for key, new in met.items()}
        # no gravity: it tells the run time which slow impacts are a load that rests, and here loads are known
        writer.step(
            width * STEP_S, poses, turns, velocity_m_s=speed, spin_rad_s=still, gravity_m_s2=(0, 0, 0), **contacts
        )
        number += width
    return writer.log


def _gap_m(clip: HouseholdClip) -> float:
    return 0.5 * STEP_S * clip.speed_m_s


def _strike(
    clip: HouseholdClip,
    material: Material,
    model: ModalModel,
    striker: Striker,
    pair: tuple[int, int],
    place: Array,
    normal: Array,
) -> dict[str, Any]:
    """Return the contact of the strike: two free masses, of which the lighter one bounces."""
    reduced = 1 / (1 / model.mass_kg + 1 / striker.mass_kg)
    impulse = (1 + material.restitution * striker.restitution) * reduced * clip.speed_m_s
    gap_m = _gap_m(clip)
    return {"pair": [list(pair)], "point_m": [place + 0.5 * gap_m * normal], "normal": [-normal],
            "impulse_n_s": [-impulse * normal], "gap_m": [gap_m]}  # fmt: skip


def _stroke(
    clip: HouseholdClip, striker: Striker, pair: tuple[int, int], place: Array, normal: Array, at_s: float
) -> tuple[Array, Array, dict[str, Any]]:
    """Return place and velocity of a tip that goes to and fro, x = a sin(v t/a), and its contact from t = 0 on."""
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    along /= np.linalg.norm(along)
    phase = clip.speed_m_s * max(at_s, 0.0) / STROKE_M
    point, velocity = place + STROKE_M * np.sin(phase) * along, clip.speed_m_s * np.cos(phase) * along
    if at_s < 0:
        return place + normal * 2 * striker.radius_m, np.zeros(3), {}
    push = clip.load_n * STEP_S * (SLIDING_FRICTION * np.sign(np.cos(phase)) * along - normal)
    contact = {"pair": [list(pair)], "point_m": [point], "normal": [-normal], "impulse_n_s": [push], "gap_m": [0.0]}
    return point + normal * striker.radius_m, velocity, contact


@lru_cache(maxsize=8)
def _ball(striker: Striker) -> ModalModel:
    """Return a ball that has no modes: what strikes is stiff and small, or soft and does not ring."""
    import trimesh

    made = trimesh.creation.icosphere(2, striker.radius_m)
    return ModalModel(
        freq_hz=np.zeros(0), decay_per_s=np.zeros(0), shape=np.zeros((len(made.vertices), 3, 0), np.float32),
        vertex_m=made.vertices, face=made.faces, curvature_per_m=np.full(len(made.faces), 1 / striker.radius_m),
        volume_m3=4 / 3 * np.pi * striker.radius_m**3, mass_kg=striker.mass_kg, note="a ball without modes",
    )  # fmt: skip


def dropped_log(
    clip: HouseholdClip, options: HouseholdOptions, material: Material, model: ModalModel, sr: int, seed: int
) -> ContactLog:
    """Let PyBullet drop the object, turned anyhow, or roll it on its side as a cylinder, and take its contacts."""
    client = direct_client()
    shape = shape_of(clip.object.kind, clip.object.wall_m, clip.object.seed)
    rng = np.random.default_rng(clip.place_seed)
    under, of = surface_of(clip.support)
    turn = rng.normal(size=4)
    rolls, axis = clip.excitation == ROLLED, 0 if clip.object.kind == "pipe" else 2
    if rolls:  # the axis of revolution along y
        turn = np.array([0.0, 0.0, 1.0, 1.0] if axis == 0 else [1.0, 0.0, 0.0, 1.0])
    turn /= np.linalg.norm(turn)
    client.setGravity(0, 0, -GRAVITY_M_S2)
    client.setTimeStep(1 / 480)
    top = 0.5 * float(under.size_m[2]) if under.kind == "box" else 0.0
    ground = client.createMultiBody(
        0,
        collision_shape(client, under, 1.0) if under.kind == "box" else client.createCollisionShape(client.GEOM_PLANE),
    )
    lowest = float(_rotate_vector(turn, model.vertex_m)[:, 2].min())
    body = client.createMultiBody(
        model.mass_kg, _roller(client, model.vertex_m, axis) if rolls else collision_shape(client, shape, clip.size),
        basePosition=(0, 0, top - lowest + clip.height_m), baseOrientation=turn,
    )  # fmt: skip
    if rolls:
        v = clip.speed_m_s
        client.resetBaseVelocity(body, linearVelocity=(v, 0, 0), angularVelocity=(0, v / -lowest, 0))
    else:
        client.resetBaseVelocity(body, angularVelocity=rng.normal(0, 2, 3).tolist())
    for one, made in ((ground, of), (body, material)):
        client.changeDynamics(one, -1, restitution=made.restitution, lateralFriction=0.5, linearDamping=0)
    keep_restitution(client)
    supports = "support" not in options.without
    with attach(client, sr=sr, seed=seed, microphone=(), supports=supports) as listener, without_progress():
        listener.add(ground, material=of, name="support", count=60 if under.kind == "box" else None)
        listener.add(body, material=material, model=model, name="object")
        while listener.time_s < options.seconds - 1e-9:
            client.stepSimulation()
        listener.finish()
        log = listener.contacts
    client.disconnect()
    return replace(log, sensors=(Microphone(np.array(clip.microphone_m) + np.array([0.0, 0.0, top])),))


def shaken_log(
    clip: HouseholdClip, options: HouseholdOptions, material: Material, model: ModalModel, sr: int, seed: int
) -> ContactLog:
    """Let PyBullet shake what holds pieces, a soft palm over its mouth, and take its contacts.

    In the vessel's own frame: it stays, and gravity is g - a of a hand that goes to and fro, a = -ω v sin(ωt + φ).
    """
    assert clip.striker is not None
    shape = Shape("mesh", vertex_m=model.vertex_m, face=model.face)
    floor, rim, width = _cavity(model)
    radius = min(clip.striker.radius_m, 0.3 * (rim - floor), 0.15 * width)
    mass = clip.striker.density_kg_m3 * 4 / 3 * np.pi * radius**3
    piece = replace(clip.striker, radius_m=radius, mass_kg=mass)
    rng = np.random.default_rng([clip.place_seed, clip.take])
    along, phase, turn = rng.normal(size=3), rng.uniform(0, 2 * np.pi), 2 * np.pi * SHAKING_HZ
    along /= np.linalg.norm(along)
    client = direct_client()
    client.setTimeStep(1 / 960)
    # with indices, PyBullet takes the mesh as it is, not its hull
    wall = client.createCollisionShape(
        client.GEOM_MESH, vertices=model.vertex_m.tolist(), indices=model.face.reshape(-1).tolist()
    )
    vessel = client.createMultiBody(0, wall)
    palm = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_PLANE, planeNormal=(0, 0, -1)), basePosition=(0, 0, rim)
    )
    ball = client.createCollisionShape(client.GEOM_SPHERE, radius=radius)
    count = min(clip.pieces, int((rim - floor - 0.1 * radius) / (2.1 * radius)))
    places = [(0.1 * radius * k, 0.0, floor + (1.1 + 2.1 * k) * radius) for k in range(count)]
    pieces = [client.createMultiBody(piece.mass_kg, ball, basePosition=place) for place in places]
    _, soft = surface_of("cloth")
    made = {vessel: material.restitution, palm: soft.restitution} | dict.fromkeys(pieces, piece.restitution)
    for one, restitution in made.items():
        client.changeDynamics(one, -1, restitution=restitution, lateralFriction=SLIDING_FRICTION, linearDamping=0)
    keep_restitution(client)
    with attach(client, sr=sr, seed=seed, microphone=(), supports=False) as listener, without_progress():
        listener.add(vessel, material=material, model=model, mesh=shape, name="object")
        listener.add(palm, material=soft, name="palm")
        for number, one in enumerate(pieces):
            listener.add(one, material=piece.material(), model=_ball(piece), name=f"piece-{number}")
        while listener.time_s < options.seconds - 1e-9:
            pull = turn * clip.speed_m_s * np.sin(turn * listener.time_s + phase) * along
            client.setGravity(*(pull - np.array([0.0, 0.0, GRAVITY_M_S2])).tolist())
            client.stepSimulation()
        listener.finish()
        log = listener.contacts
    client.disconnect()
    return replace(log, sensors=(Microphone(np.array(clip.microphone_m)),))


def _cavity(model: ModalModel) -> tuple[float, float, float]:
    """Measure a vessel that stands: the heights (z) of its inner floor and its rim, and how wide it is, in m."""
    size, corner = np.ptp(model.vertex_m, axis=0), model.vertex_m[model.face]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    up = across[:, 2] > 0.9 * np.linalg.norm(across, axis=1)  # the lowest that faces up; the foot faces down
    return float(corner[up, :, 2].mean(axis=1).min()), float(model.vertex_m[:, 2].max()), float(min(size[:2]))


def _roller(client: Any, vertex_m: Array, axis: int) -> int:
    """Make the cylinder around a body: facets of its hull would strike the ground one after the other."""
    along, across = vertex_m[:, axis], np.delete(vertex_m, axis, axis=1)
    centre = np.zeros(3)
    centre[axis] = 0.5 * (along.min() + along.max())
    return int(client.createCollisionShape(
        client.GEOM_CYLINDER, radius=float(np.linalg.norm(across, axis=1).max()), height=float(np.ptp(along)),
        collisionFramePosition=centre.tolist(),
        collisionFrameOrientation=(0, np.sqrt(0.5), 0, np.sqrt(0.5)) if axis == 0 else UPRIGHT,
    ))  # fmt: skip


def _rotate_vector(quaternion_xyzw: Array, vector: Array) -> Array:
    return np.asarray(vector @ matrices(quaternion_xyzw).T)
