"""Newton's worlds, many at once, and the sound of those that were asked for.

    pip install newton warp-lang
    python -m studies.newton_worlds -o OUT [--worlds 64] [--listen 0 5]

One model of all worlds -> XPBD, its contact forces as an observable -> a step's contacts as arrays, sorted by world
without a loop over worlds -> a log of each world that is listened to -> render_log

A box of steel falls on a board of wood, in each world from another height. The check is of momentum: what a log gives
the box is what it fell with.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import sonic_bullet as sb
from sonic_bullet.records import Array

STEP_S, STEPS = 1 / 240, 360
HALF_M = np.array([0.06, 0.01, 0.005])
DENSITY_KG_M3 = 7850.0


class StepContacts(NamedTuple):
    """Contacts (k,) of a step in all worlds: whose, where, the normal and the impulse on the box (k, 3), the gap."""

    world: Array
    point_m: Array
    normal: Array
    impulse_n_s: Array
    gap_m: Array


def build(worlds: int) -> Any:
    """Build a model of many worlds, in each a box above the ground."""
    import newton
    import warp as wp

    one = newton.ModelBuilder()
    body = one.add_body()
    shape = newton.ModelBuilder.ShapeConfig(density=DENSITY_KG_M3, mu=0.4, restitution=0.4)
    one.add_shape_box(body, hx=float(HALF_M[0]), hy=float(HALF_M[1]), hz=float(HALF_M[2]), cfg=shape)
    builder = newton.ModelBuilder()
    builder.replicate(one, worlds)
    builder.add_ground_plane(cfg=shape)
    rng = np.random.default_rng(0)
    for number in range(worlds):
        turn = rng.normal(size=3) * 0.2
        builder.body_q[number] = wp.transform((0.0, 0.0, 0.1 + 0.002 * number), wp.quat_rpy(*turn.tolist()))
    return builder.finalize(device="cpu")


def rotated(quaternion: Array, vector: Array) -> Array:
    """Turn vectors (k, 3) by quaternions (k, 4), x y z w."""
    u, w = quaternion[:, :3], quaternion[:, 3:]
    return np.asarray(vector + 2 * np.cross(u, np.cross(u, vector) + w * vector))


def contacts_of(model: Any, contacts: Any, force: Any, pose: Array) -> StepContacts:
    """Read a step's contacts of all worlds; the first shape's body or the second's is the box."""
    count = int(contacts.rigid_contact_count.numpy()[0])
    owner = model.shape_body.numpy()
    shape = np.stack([contacts.rigid_contact_shape0.numpy()[:count], contacts.rigid_contact_shape1.numpy()[:count]])
    body = owner[shape]
    mine = (body[1] >= 0).astype(int)  # which of the two is the box; the ground has no body
    box = np.where(mine, body[1], body[0])
    local = np.where(
        mine[:, None], contacts.rigid_contact_point1.numpy()[:count], contacts.rigid_contact_point0.numpy()[:count]
    )
    point = pose[box, :3] + rotated(pose[box, 3:], local)
    normal = contacts.rigid_contact_normal.numpy()[:count] * np.where(mine, 1.0, -1.0)[:, None]  # towards the box
    push = force.numpy()[:count, :3] * np.where(mine, -1.0, 1.0)[:, None]  # Newton's is on the first shape's body
    order = np.argsort(model.body_world.numpy()[box], kind="stable")
    world = model.body_world.numpy()[box][order]
    gap = point[order, 2]
    return StepContacts(world, point[order], normal[order], STEP_S * push[order], gap)


def simulate(worlds: int, listened: list[int]) -> dict[int, tuple[sb.LogWriter, Array]]:
    """Run all worlds; return the logs of some, and how far each one's box is from momentum's balance, in N s."""
    import newton

    model = build(worlds)
    solver = newton.solvers.SolverXPBD(model, iterations=8, enable_restitution=True)
    now, after = model.state(), model.state()
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()
    seen = solver.observables({solver.ObservableKind.CONTACT_F}, contacts=contacts)
    writers = {}
    for number in listened:
        writer = sb.LogWriter(microphone=(0.0, -0.5, 0.3))
        board = writer.add("board", sb.Shape("box", size_m=(0.4, 0.4, 0.015)), material="wood", mass_kg=0)
        box = writer.add("box", sb.Shape("box", size_m=2 * HALF_M), material="steel", mass_kg=mass_kg())
        writers[number] = (writer, box, board)
    given = {number: np.zeros(3) for number in listened}
    begun = now.body_qd.numpy()[:, :3].copy()
    for _ in range(STEPS):
        pose, twist = now.body_q.numpy(), now.body_qd.numpy()
        pipeline.collide(now, contacts)
        solver.step(now, after, None, contacts, STEP_S, observables=seen)
        found = contacts_of(model, contacts, seen.contact_f, pose)
        edge = np.searchsorted(found.world, np.arange(worlds + 1))
        for number, (writer, box, board) in writers.items():  # only those that are listened to
            some = slice(edge[number], edge[number + 1])
            given[number] += found.impulse_n_s[some].sum(axis=0)
            told = {
                "pair": np.tile([box, board], (some.stop - some.start, 1)), "point_m": found.point_m[some],
                "normal": found.normal[some], "impulse_n_s": found.impulse_n_s[some], "gap_m": found.gap_m[some],
            }  # fmt: skip
            writer.step(
                STEP_S,
                [[0, 0, -0.0075], pose[number, :3]],
                [[0, 0, 0, 1], pose[number, 3:]],
                velocity_m_s=[[0, 0, 0], twist[number, :3]],
                spin_rad_s=[[0, 0, 0], twist[number, 3:]],
                **(told if some.stop > some.start else {}),
            )
        now, after = after, now
    ended = now.body_qd.numpy()[:, :3]
    fallen = np.array([0, 0, -9.81 * mass_kg() * STEP_S * STEPS])
    left = {n: given[n] + fallen - mass_kg() * (ended[n] - begun[n]) for n in listened}
    return {number: (writers[number][0], left[number]) for number in listened}


def mass_kg() -> float:
    """Return the box's mass."""
    return float(8 * HALF_M.prod() * DENSITY_KG_M3)


def main() -> None:
    """Write the logs and say what is left of momentum."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--listen", type=int, nargs="+", default=[0, 5])
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    fall_n_s = 9.81 * mass_kg() * STEP_S * STEPS
    for number, (writer, left) in simulate(asked.worlds, asked.listen).items():
        writer.save(asked.output / f"world-{number}.npz")
        off = np.linalg.norm(left) / fall_n_s
        print(f"world {number}: {len(writer.log)} contacts, momentum off by {100 * off:.2g} % of its weight's impulse")


if __name__ == "__main__":
    main()
