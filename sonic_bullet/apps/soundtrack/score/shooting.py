"""Contacts between frames by simulation, below 120 poses a second.

    pose k, speed v, restitution e -> PoseStage.shoot, 240 Hz -> pose' at k+1        pose' - pose(k+1) -> better v, e

Single shooting with a prior [Press et al., Numerical Recipes, 3rd ed. 2007, sec. 18.1]: v is the speed with which the
frame before ended, changed as little as possible, and e what explains the next pose best,

    min over v, e of  |pose'(v, e) - pose(k+1)|²/σ_x² + |v - v⁻|²/σ_v²

by Gauss-Newton steps with differences, for all bodies that touch each other at once (an island); rotations count by the
radius of gyration. Islands that do not meet are searched in the same shots. Impulses are read off the best shot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import compute_whitening
from sonic_bullet.geometry import label_components
from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.records import Array
from sonic_bullet.simulators.animated import PoseStage, Rollout, rotation


@dataclass(slots=True)
class _Try:
    """Start speeds (b, 6), restitution (b,), the shot and its residuals (b, 12)."""

    speed: Array
    restitution: Array
    shot: Rollout
    residual: Array

    def cost(self, island: Array) -> float:
        return float((self.residual[island] ** 2).sum())


class Shooting:
    """Search through an animation, frame by frame.

    substeps: steps of the simulation to a frame. hidden_m_s: as in `find_steps`; noise in a pose, its 5 σ, hides
    hidden_m_s / (√6 fps).
    """

    # σ_x, σ_v: a pose is trusted to a tenth of a millimetre; a speed to what gravity changes it by in three
    # milliseconds, about a step of the simulation
    POSE_M, SPEED_M_S = 1e-4, 3e-2

    FORCE_ROWS = ("force_n", "friction_1_n", "friction_2_n")

    ENOUGH_COST = 4.0  # cost of a body's shot below which nothing is searched: every pose within 2 σ

    def __init__(self, animation: Animation, stage: PoseStage, substeps: int, hidden_m_s: float = 0.0) -> None:
        first_speed_m_s = 3.0
        self._animation, self._stage, self._substeps, self._hidden_m_s = animation, stage, substeps, hidden_m_s
        self._step_s = 1 / animation.fps / substeps
        self._hidden_m = hidden_m_s / float(np.sqrt(6)) / animation.fps
        self._pose_m = max(
            self.POSE_M, self._hidden_m / np.sqrt(self.ENOUGH_COST)
        )  # so that what is hidden is not searched for
        self._speed_m_s = max(self.SPEED_M_S, hidden_m_s / np.sqrt(self.ENOUGH_COST))
        self._motion = animation.poses()
        self._start = self._motion[0].copy()
        self._free = np.flatnonzero(animation.free)
        mass = np.array([max(one.mass_kg, 1e-12) for one in animation.bodies])
        inertia = np.array([one.inertia_kg_m2.sum() for one in animation.bodies])
        self._gyration_m = np.sqrt(inertia / (2 * mass))
        self._given = np.array([one.restitution for one in animation.bodies])
        self._restitution = self._given.copy()
        self._prior = np.concatenate([self._motion["velocity_m_s"][1], self._motion["spin_rad_s"][1]], axis=1)
        # the mean speed of the first frame is its end's, less what half of the steps' gravity adds
        lag = 0.5 * (substeps + 1) / substeps / animation.fps
        self._prior[self._free, :3] -= lag * animation.gravity_m_s2
        self._trust_m_s = first_speed_m_s

    def find_steps(self, found: list[tuple[Array, Array]]) -> None:
        """Append MOTION (b,) and loaded RAW rows of each step."""
        before: Rollout | None = None
        owed = np.zeros_like(self._prior)
        for k in range(len(self._motion) - 1):
            best = self._search_start(k)
            if before is not None:
                missing = best.speed - self._prior
                found += self._scale_impulses(before, owed + missing)
                owed = np.where(np.any(before.touching, axis=1, keepdims=True), 0.0, missing)
            before = shot = self._shot(k, best.speed, best.restitution, polled=True).shot
            last = shot.motion[-1]
            self._start = self._choose_start(last, self._motion[k + 1], np.asarray(shot.touching.any(axis=1)))
            self._prior = np.concatenate([last["velocity_m_s"], last["spin_rad_s"]], axis=1)
            self._trust_m_s = self._speed_m_s
            report_fraction((k + 1) / len(self._motion))
        if before is not None:
            found += self._scale_impulses(before, owed)

    def _choose_start(self, end: Array, pose: Array, touching: Array) -> Array:
        """Choose where the next frame begins: at its pose (b,), or, where noise hides the difference, at this end.

        Begun at poses anew, a body at rest, touching (b,), would fall a little in every frame.
        """
        good = np.sqrt(self.ENOUGH_COST) * self.POSE_M
        hidden = np.where(touching, max(self._hidden_m, good), self._hidden_m if self._hidden_m >= self.POSE_M else 0.0)
        away = np.linalg.norm(end["position_m"] - pose["position_m"], axis=1)
        turned = np.linalg.norm(rotation(pose["quaternion_xyzw"], end["quaternion_xyzw"]), axis=1)
        within = self._animation.free & (np.maximum(away, self._gyration_m * turned) < hidden)
        return np.where(within, end, pose)

    def _scale_impulses(self, shot: Rollout, missing: Array) -> list[tuple[Array, Array]]:
        """Scale the impulses of a frame's steps, each strike by its own factor.

        The speed (b, 6) with which the next frame began beyond that with which this one ended also came from its
        contacts.
        """
        from scipy.optimize import lsq_linear

        strikes = self._strikes(shot)
        if not strikes:
            return list(zip(shot.motion[:-1], shot.raw, strict=True))
        whiten = compute_whitening(self._animation, shot.motion[-1])
        mass = np.array([one.mass_kg for one in self._animation.bodies])
        trust = 1 / (np.sqrt(np.maximum(mass, 1e-12)) * self._speed_m_s)
        matrix = np.zeros((len(mass), 6, len(strikes)))
        for column, rows in enumerate(strikes.values()):
            for number, row in rows:
                at, raw = shot.motion[number], shot.raw[number][row : row + 1]
                force = raw["normal"] * raw["force_n"][:, None]
                force = force + raw["tangent_1"] * raw["friction_1_n"][:, None]
                force = force + raw["tangent_2"] * raw["friction_2_n"][:, None]
                for sign, who, point in ((1, "body_a", "point_a_m"), (-1, "body_b", "point_b_m")):
                    i = int(self._stage.rows(raw[who])[0])
                    arm = raw[point] - at["position_m"][i]
                    impulse = sign * self._step_s * np.concatenate([force, np.cross(arm, force)], axis=1)[0]
                    matrix[i, :, column] += trust[i] * whiten[i] @ impulse
        free = self._free
        inverse = np.linalg.inv(whiten[free])  # whitened momentum is the root of mass and inertia times speed
        right = trust[free, None] * np.einsum("bij,bj->bi", np.swapaxes(inverse, 1, 2), missing[free])
        whole = np.concatenate([matrix[free].reshape(-1, len(strikes)), np.eye(len(strikes))])
        share = lsq_linear(whole, np.concatenate([right.ravel(), np.zeros(len(strikes))]), bounds=(-1, np.inf)).x
        raws = [raw.copy() for raw in shot.raw]
        for rows, more in zip(strikes.values(), share.tolist(), strict=True):
            for number, row in rows:
                for name in self.FORCE_ROWS:
                    raws[number][name][row] *= 1 + more
            self._without_hidden(raws, rows)
        return list(zip(shot.motion[:-1], raws, strict=True))

    def _without_hidden(self, raws: list[Array], rows: list[tuple[int, int]]) -> None:
        """Remove a strike that changes the lighter body's speed by less than noise in the poses.

        A load that lasts all the frame becomes even, a short one zero.
        """
        number, row = rows[0]
        who = self._stage.rows(np.array([raws[number][name][row] for name in ("body_a", "body_b")]))
        mass = min(self._animation.bodies[i].mass_kg for i in who if self._animation.free[i])
        load: dict[int, float] = {}
        for number, row in rows:
            load[number] = load.get(number, 0.0) + float(raws[number]["force_n"][row])
        weight = mass * float(np.linalg.norm(self._animation.gravity_m_s2))
        first, *later = load.values()
        if (first + sum(max(one - weight, 0) for one in later)) * self._step_s < mass * self._hidden_m_s:
            mean = sum(load.values()) / len(load) if len(load) == self._substeps else 0.0
            for number, row in rows:
                for name in self.FORCE_ROWS:
                    raws[number][name][row] *= mean / load[number]

    def _strikes(self, shot: Rollout) -> dict[tuple[int, int, int], list[tuple[int, int]]]:
        """List (step, row) of a pair's loaded places in steps without a pause, by pair and first step."""
        found: dict[tuple[int, int, int], list[tuple[int, int]]] = {}
        last: dict[tuple[int, int], tuple[int, int]] = {}  # first step, and latest, of a pair
        for number, raw in enumerate(shot.raw):
            for row, (a, b, force) in enumerate(zip(raw["body_a"], raw["body_b"], raw["force_n"], strict=True)):
                if force > 0:
                    first, latest = last.get((a, b), (number, number))
                    first = first if number - latest <= 1 else number
                    last[a, b] = first, number
                    found.setdefault((int(a), int(b), first), []).append((number, row))
        return found

    def _shot(self, k: int, speed: Array, restitution: Array, *, polled: bool = False) -> _Try:
        start = self._start.copy()
        free = self._free
        start["velocity_m_s"][free], start["spin_rad_s"][free] = speed[free, :3], speed[free, 3:]
        goal = self._motion[k + 1]
        shot = self._stage.shoot(start, goal, self._substeps, self._step_s, restitution, polled=polled)
        end, rho = shot.motion[-1], self._gyration_m[:, None]
        away = speed - self._prior
        residual = np.concatenate(
            [
                (end["position_m"] - goal["position_m"]) / self._pose_m,
                rho * rotation(goal["quaternion_xyzw"], end["quaternion_xyzw"]) / self._pose_m,
                away[:, :3] / self._trust_m_s,
                rho * away[:, 3:] / self._trust_m_s,
            ],
            axis=1,
        )
        return _Try(speed, restitution, shot, residual)

    def _search_start(self, k: int) -> _Try:
        """Search the best start at frame k."""
        restitutions = (0.0, 0.3, 0.5, 0.65, 0.8, 0.95)
        rounds = 4
        best = self._shot(k, self._prior.copy(), self._given)
        best = self._flown(k, best)
        touching = best.shot.touching.copy()
        others = [self._shot(k, best.speed, self._with(e)) for e in restitutions] if touching.any() else []
        for one in others:
            touching |= one.shot.touching
        islands = self._islands(touching)
        for one in others:
            best = self._merge_starts(best, one, islands)
        if others:
            best = self._shot(k, best.speed, best.restitution)
        for _ in range(rounds):
            rest = [x for x in islands if best.cost(x) > self.ENOUGH_COST * len(x)]
            if not rest:
                break
            before = best.cost(self._free)
            best = self._step_islands(k, best, rest, touching)
            if best.cost(self._free) > 0.98 * before:
                break
        return best

    def _with(self, e: float) -> Array:
        made = self._given.copy()
        made[self._free] = np.minimum(e / max(float(self._given[~self._animation.free].max(initial=0.5)), 0.05), 1.0)
        return made

    def _flown(self, k: int, first: _Try) -> _Try:
        """Set the speed of bodies without contact to meet the next pose: one Newton step, twice for rotations."""
        best = first
        for _ in range(2):
            alone = ~best.shot.touching.any(axis=1) & self._animation.free
            wrong = alone & ((best.residual[:, :6] ** 2).sum(axis=1) > self.ENOUGH_COST)
            if not wrong.any():
                break
            speed = best.speed.copy()
            miss = best.residual[:, :6] * self._pose_m
            miss[:, 3:] /= np.maximum(self._gyration_m, 1e-12)[:, None]
            speed[wrong] -= miss[wrong] * self._animation.fps
            best = self._shot(k, speed, best.restitution)
        return best

    def _islands(self, touching: Array) -> list[Array]:
        free = self._free
        label = label_components(len(free), *np.nonzero(touching[np.ix_(free, free)]))
        return [free[label == i] for i in range(label.max(initial=-1) + 1)]

    def _merge_starts(self, best: _Try, other: _Try, islands: list[Array]) -> _Try:
        """Take the better start of each island; the shot is the first's."""
        speed, restitution, residual = best.speed.copy(), best.restitution.copy(), best.residual.copy()
        for island in islands:
            if other.cost(island) < best.cost(island):
                speed[island], restitution[island] = other.speed[island], other.restitution[island]
                residual[island] = other.residual[island]
        return _Try(speed, restitution, best.shot, residual)

    def _step_islands(self, k: int, best: _Try, islands: list[Array], touching: Array) -> _Try:
        """Take one Gauss-Newton step of every island, whole, halved or quartered."""
        nudge_m_s = 0.01  # and of restitution
        most = max(map(len, islands))
        columns: dict[int, list[Array]] = {i: [] for i in range(len(islands))}
        for member in range(most):
            for axis in range(6):
                speed = best.speed.copy()
                nudged = [x[member] for x in islands if len(x) > member]
                nudge = nudge_m_s / (self._gyration_m[nudged] if axis > 2 else 1)
                speed[nudged, axis] += nudge
                tried = self._shot(k, speed, best.restitution)
                for i, island in enumerate(islands):
                    if len(island) > member:
                        columns[i].append((tried.residual - best.residual)[island].ravel() / nudge_m_s)
        e = best.restitution.copy()
        e[self._free] += np.where(e[self._free] > 0.5, -nudge_m_s, nudge_m_s)
        tried = self._shot(k, best.speed, e)
        moves = []
        for i, island in enumerate(islands):
            slope = (tried.residual - best.residual)[island].ravel() / (e - best.restitution)[island[0]]
            matrix = np.stack([*columns[i], slope], axis=1)
            damped = 1e-3 * np.eye(matrix.shape[1]) * max(float(np.linalg.norm(matrix, 2)), 1e-9)
            moves.append(
                np.linalg.lstsq(
                    np.concatenate([matrix, damped]),
                    -np.concatenate([best.residual[island].ravel(), np.zeros(len(damped))]),
                    rcond=None,
                )[0]
            )
        made = best
        for share in (1.0, 0.5, 0.2):
            speed, restitution = best.speed.copy(), best.restitution.copy()
            for island, move in zip(islands, moves, strict=True):
                step = share * move[:-1].reshape(-1, 6)
                step[:, 3:] /= self._gyration_m[island, None]
                speed[island] += step
                restitution[island] = np.clip(restitution[island] + share * move[-1], 0.0, 1.0)
            made = self._merge_starts(made, self._shot(k, speed, restitution), islands)
        return self._shot(k, made.speed, made.restitution)
