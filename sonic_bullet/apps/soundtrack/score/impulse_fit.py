"""Impulses from the second differences of the poses, from 120 poses a second up.

    m (x(k+1) - 2x(k) + x(k-1))/T - m g T = Σ_j J_j tri((t_j - t_k)/T)              tri: a triangle, 1 at 0, 0 at ±1
    L(k+½) - L(k-½)                       = Σ_j (p_j - x) × J_j tri(…)              L = R I Rᵀ ω, ω of the half step

Exact for linear momentum whatever happens within a frame (Taylor's theorem with the remainder as an integral, of which
the triangle is the kernel). For Bullet's own steps the triangle has one sample: the impulse of step k.

    MOTION (t, b) -> second differences; pairs that can touch -> places (PoseStage.closest)
        -> non-negative least squares of all bodies that touch each other, friction as a pyramid -> RAW of each frame

min |W(A f - r)|², f >= 0, W the inverse square root of mass and inertia: the residual is a kinetic energy [Erleben
2007 and Todorov 2014, who solve for the forward step; nonnegative least squares: Lawson & Hanson 1974, ch. 23].
"""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.records import Array
from sonic_bullet.simulators.animated import PoseStage, matrices
from sonic_bullet.simulators.frames import rotate_orientations
from sonic_bullet.simulators.polling import NO_RAW


def momentum_changes(animation: Animation, motion: Array, hidden_m_s: float = 0.0) -> Array:
    """Compute linear and angular momentum (t, b, 6) that contacts gave round each frame, in N·s and N·m·s.

    In the world, about the centre of mass; zero in the first and last frame, of which nothing is known, and for
    massless bodies. A body that changes its speed by less than hidden_m_s, and its spin by no more at its radius of
    gyration, changes neither.
    """
    mass = np.array([one.mass_kg for one in animation.bodies])
    step_s = 1 / animation.fps
    found = np.zeros((len(animation), len(animation.bodies), 6))
    velocity = motion["velocity_m_s"]
    change = velocity[2:] - velocity[1:-1]
    weight = np.where(np.array([one.driven for one in animation.bodies])[:, None], 0.0, animation.gravity_m_s2)
    inertia = np.stack([one.inertia_kg_m2 for one in animation.bodies])
    gyration_m = np.sqrt(inertia.sum(axis=1) / (2 * np.maximum(mass, 1e-12)))
    rim_m_s = gyration_m * np.linalg.norm(np.diff(motion["spin_rad_s"][1:], axis=0), axis=2)
    still = np.maximum(np.linalg.norm(change, axis=2), rim_m_s) < hidden_m_s
    change = np.where(still[..., None], 0.0, change)
    found[1:-1, :, :3] = mass[:, None] * (change - weight * step_s)
    spin, turn = motion["spin_rad_s"][1:], motion["quaternion_xyzw"]
    half = _halfway(turn[:-1], spin * step_s)
    frame = matrices(half)
    momentum = np.einsum("tbij,bj,tbkj,tbk->tbi", frame, inertia, frame, spin)
    found[1:-1, :, 3:] = np.where(still[..., None], 0.0, momentum[1:] - momentum[:-1])
    found[:, mass == 0] = 0
    return found


def _halfway(turn: Array, whole_rad: Array) -> Array:
    shape = turn.shape
    return rotate_orientations(turn.reshape(-1, 4), whole_rad.reshape(-1, 3) / 2).reshape(shape)


def fit_steps(
    animation: Animation,
    stage: PoseStage,
    found: list[tuple[Array, Array]],
    *,
    known: Array | float = 0.0,
    only: Set[int] | None = None,
    hidden_m_s: float = 0.0,
) -> None:
    """Append MOTION (b,) and loaded RAW rows of each frame but the last.

    Parameters
    ----------
    known : (t, b, 6) momentum from contacts that are known already
    only : of pairs with one of these bodies, None: of all
    hidden_m_s : a smaller change of speed is noise in the poses
    """
    reach_m = stage.reach_m
    motion, step_s = animation.poses(), 1 / animation.fps
    change = momentum_changes(animation, motion, hidden_m_s) - known
    static = ~animation.moving
    # how far apart bodies may seem at the moment at which they touch: collision margins (Bullet's hulls: 1 mm)
    margin_m = 1.5e-3
    touch_m = margin_m + hidden_m_s / float(np.sqrt(6)) / animation.fps  # what noise hides of a gap, too
    for k in range(len(animation) - 1):
        raw = NO_RAW
        if k:
            after = motion[k + 1]
            speed = np.maximum(speeds(motion[k], reach_m), speeds(after, reach_m))
            pairs = near_pairs(motion[k], reach_m, speed * step_s + touch_m, static, stage)
            if only is not None:
                pairs = [pair for pair in pairs if pair[0] in only or pair[1] in only]
            far = float(speed.max(initial=0.0)) * 2 * step_s + touch_m
            raw = stage.closest(motion[k], pairs, far) if pairs else NO_RAW
            raw = raw[_can_touch(raw, motion[k], after, step_s, stage, touch_m)]
            raw = load_contacts(animation, motion[k], raw, change[k], stage)
        found.append((motion[k], raw))
        report_fraction((k + 1) / len(animation))


def speeds(motion: Array, reach_m: Array) -> Array:
    """Bound the speed (b,) of any point of each body."""
    return np.asarray(
        np.linalg.norm(motion["velocity_m_s"], axis=1) + np.linalg.norm(motion["spin_rad_s"], axis=1) * reach_m
    )


def near_pairs(
    motion: Array, reach_m: Array, margin_m: Array, static: Array, stage: PoseStage
) -> list[tuple[int, int]]:
    """Return pairs whose bounding boxes are near, one of which moves."""
    low, high = stage.boxes(motion)
    low, high = low - margin_m[:, None], high + margin_m[:, None]
    meet = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)
    meet &= ~(static[:, None] & static[None])
    return [(int(a), int(b)) for a, b in zip(*np.nonzero(np.triu(meet, 1)), strict=True)]


def _can_touch(raw: Array, before: Array, after: Array, step_s: float, stage: PoseStage, touch_m: float) -> Array:
    """Return (k,) whether a place closes within the frame before or after.

    It is moved on with its present speeds, or back with those of the later frame.
    """
    if not len(raw):
        return np.zeros(0, bool)
    a, b = stage.rows(raw["body_a"]), stage.rows(raw["body_b"])
    closing, parting = (_along(raw, m, before, a, b) for m in (before, after))
    travel = step_s * np.maximum(np.maximum(-closing, parting), 0)
    return np.asarray(raw["gap_m"] - travel <= touch_m)


def _along(raw: Array, speeds: Array, at: Array, a: Array, b: Array) -> Array:
    """Compute the speed (k,) at which both bodies separate along the normal."""
    v = [
        speeds["velocity_m_s"][i] + np.cross(speeds["spin_rad_s"][i], raw[point] - at["position_m"][i])
        for i, point in ((a, "point_a_m"), (b, "point_b_m"))
    ]
    return np.asarray(((v[0] - v[1]) * raw["normal"]).sum(axis=1))


def load_contacts(animation: Animation, motion: Array, raw: Array, change: Array, stage: PoseStage) -> Array:
    """Return the RAW rows with forces whose impulses over a frame give each body its `change` (b, 6), no others."""
    even = 1e-4  # Ridge, of the largest singular value: places of one face get even loads
    if not len(raw):
        return raw
    from scipy.optimize import nnls

    free = animation.free
    mass = np.array([one.mass_kg for one in animation.bodies])
    movable = mass > 0
    a, b = stage.rows(raw["body_a"]), stage.rows(raw["body_b"])
    friction = np.array([one.friction for one in animation.bodies])
    out = raw.copy()
    out["tangent_1"], out["tangent_2"] = _tangents(raw["normal"])
    mu = friction[a] * friction[b]
    arms = [raw[point] - motion["position_m"][i] for i, point in ((a, "point_a_m"), (b, "point_b_m"))]
    whiten = compute_whitening(animation, motion)
    for rows in _components(a, b, movable, free):
        bodies = sorted({int(x) for x in (*a[rows], *b[rows]) if movable[x]})
        # a driven body determines forces only where no free one does
        tells = [x for x in bodies if free[x]] or bodies
        row_of = {body: i for i, body in enumerate(tells)}
        matrix = np.zeros((6 * len(tells), 4 * len(rows)))
        for c, r in enumerate(rows):
            n, t, s = out["normal"][r], out["tangent_1"][r], out["tangent_2"][r]
            force = np.stack([n + mu[r] * t, n - mu[r] * t, n + mu[r] * s, n - mu[r] * s])
            for sign, body, arm in ((1, a[r], arms[0][r]), (-1, b[r], arms[1][r])):
                if int(body) in row_of:
                    i = 6 * row_of[int(body)]
                    wrench = np.concatenate([force, np.cross(arm, force)], axis=1)
                    matrix[i : i + 6, 4 * c : 4 * c + 4] += sign * whiten[body] @ wrench.T
        right = np.concatenate([whiten[x] @ change[x] for x in tells])
        ridge = np.sqrt(even) * np.linalg.norm(matrix, 2) * np.eye(matrix.shape[1]) / 10
        share = nnls(np.concatenate([matrix, ridge]), np.concatenate([right, np.zeros(len(ridge))]))[0]
        pyramid = share.reshape(-1, 4) * animation.fps
        out["force_n"][rows] = pyramid.sum(axis=1)
        out["friction_1_n"][rows] = mu[rows] * (pyramid[:, 0] - pyramid[:, 1])
        out["friction_2_n"][rows] = mu[rows] * (pyramid[:, 2] - pyramid[:, 3])
    return out[out["force_n"] > 0]


def _tangents(normal: Array) -> tuple[Array, Array]:
    axis = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)


def compute_whitening(animation: Animation, motion: Array) -> Array:
    """Compute inverse square roots (b, 6, 6) of mass and inertia in the world's axes; 0 for massless bodies."""
    frame = matrices(motion["quaternion_xyzw"])
    found = np.zeros((len(animation.bodies), 6, 6))
    for i, body in enumerate(animation.bodies):
        if body.mass_kg > 0:
            found[i, :3, :3] = np.eye(3) / np.sqrt(body.mass_kg)
            found[i, 3:, 3:] = frame[i] @ np.diag(body.inertia_kg_m2**-0.5) @ frame[i].T
    return found


def _components(a: Array, b: Array, movable: Array, free: Array) -> Sequence[Array]:
    """Group rows of places by the bodies that they connect.

    Through free bodies, and, where there is none in a pair, through that pair alone.
    """
    parent = list(range(len(movable) + len(a)))

    def root(x: int) -> int:
        while parent[x] != x:
            x = parent[x]
        return x

    for r, (one, other) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        own = len(movable) + r
        nodes = [x for x in (one, other) if free[x]] or [x for x in (one, other) if movable[x]]
        for x in nodes:
            parent[root(own)] = root(x)
    groups: dict[int, list[int]] = {}
    for r in range(len(a)):
        groups.setdefault(root(len(movable) + r), []).append(r)
    return [np.array(rows) for rows in groups.values()]
