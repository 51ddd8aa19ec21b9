"""Motion and contact impulses of one MuJoCo step, exactly those that moved the bodies.

    after mj_step: xipos, cvel, contact and efc_force are still of its start -> Motion, TOUCH, J = h F
    RK4: forces at four stages, J = h Σ b_i F_i; the first three are computed before the step on a copy of the state,
         the last is what mj_step leaves behind

All other integrators move bodies by the forces of the step's start (MuJoCo documentation, Computation, Numerical
integration), so that Σ J = m Δv - m g h holds to rounding; RK4's stages by Abramowitz and Stegun 1964, 25.5.10.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from sonic_bullet._engine import TOUCH, read_mujoco_motion
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import join_arrays
from sonic_bullet.simulators.frames import LINK_STATE, Motion
from sonic_bullet.simulators.mujoco.model_links import ModelLinks


class StageForces:
    """Reads one MjData by its links."""

    WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)

    def __init__(self, model: Any, data: Any, links: ModelLinks) -> None:
        self._model, self._data, self._links = model, data, links
        self._copy: Any = None
        self._before: tuple[Motion, list[tuple[Array, Array]]] | None = None
        self._force = np.zeros(6)
        of_world = links.body == 0
        self._row: Array = np.zeros(len(links.body), LINK_STATE)
        self._row["position_m"][of_world] = np.asarray(model.geom_pos)[links.geom[of_world]]
        self._row["quaternion_xyzw"][of_world] = np.asarray(model.geom_quat)[links.geom[of_world]][:, [1, 2, 3, 0]]

    @property
    def is_staged(self) -> bool:
        """Whether the integrator takes several forces a step."""
        return int(self._model.opt.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)

    def before(self) -> None:
        """Prepare for a step that is about to be made."""
        self._before = self._stages() if self.is_staged else None

    def after(self) -> tuple[Motion, Array]:
        """Return the motion at the start of the step just made, and its loaded contacts, rows of TOUCH."""
        h = float(self._model.opt.timestep)
        if self._before is None:
            return self.motion(self._data), self._touches(self._data, h, 0.0)[0]
        (motion, stages), self._before = self._before, None
        return motion, _merge_stages([*stages, self._touches(self._data, h * self.WEIGHTS[3], h)])

    @property
    def was_prepared(self) -> bool:
        """Whether `before` was called for the step just made, where that is needed."""
        return self._before is not None or not self.is_staged

    def motion(self, data: Any) -> Motion:
        """Return poses and twists of the links, as the last forward computation has them."""
        row = self._row.copy()
        links, model = self._links, self._model
        read_mujoco_motion(
            links.body, data.xipos, data.xquat, model.body_iquat, data.cvel, data.subtree_com, model.body_rootid, row
        )
        return Motion(links.roster, row)

    def _touches(self, data: Any, duration_s: float, elapsed_s: float) -> tuple[Array, Array]:
        """Return the contacts that carry a force, with what it gives in a duration, and what each is called.

        The name (k, 3): both geoms, and a number among the contacts of these.
        """
        contact = data.contact
        count = len(contact)
        if not count:
            return np.zeros(0, TOUCH), np.zeros((0, 3), np.int64)
        geom = np.asarray(contact.geom)
        loaded = np.flatnonzero((np.asarray(contact.efc_address) >= 0) & (geom >= 0).all(axis=1))
        force = np.empty((len(loaded), 3))
        for i, at in enumerate(loaded.tolist()):
            mujoco.mj_contactForce(self._model, data, at, self._force)
            force[i] = self._force[:3]
        frame = np.asarray(contact.frame)[loaded].reshape(-1, 3, 3)
        code, row = self._links.roster.code, self._links.row_of_geom[geom[loaded]]
        made = np.zeros(len(loaded), TOUCH)
        made["code_a"], made["code_b"] = code[row[:, 1]], code[row[:, 0]]
        made["normal"], made["gap_m"] = frame[:, 0], np.asarray(contact.dist)[loaded]
        half = 0.5 * made["gap_m"][:, None] * made["normal"]
        place = np.asarray(contact.pos)[loaded]
        made["point_a_m"], made["point_b_m"] = place + half, place - half
        made["impulse_n_s"] = duration_s * np.einsum("kij,ki->kj", frame, force)
        made["elapsed_s"] = elapsed_s
        some = (force != 0).any(axis=1)
        return made[some], np.column_stack([geom, _ordinals(geom)])[loaded][some]

    def _stages(self) -> tuple[Motion, list[tuple[Array, Array]]]:
        """Return the motion at the start of the coming step, and the contacts of its first three stages."""
        model, h = self._model, float(self._model.opt.timestep)
        if self._copy is None:
            self._copy = mujoco.MjData(model)
        copy, kind = self._copy, mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, self._data, state, kind)
        mujoco.mj_setState(model, copy, state, kind)
        mujoco.mj_forward(model, copy)
        motion = self.motion(copy)
        qpos, qvel, act, time_s = copy.qpos.copy(), copy.qvel.copy(), copy.act.copy(), copy.time
        stages = [self._touches(copy, h * self.WEIGHTS[0], 0.0)]
        # times of the second to fourth stage, in steps; each goes on from the slope of the stage before
        pulse_nodes = (0.5, 0.5, 1.0)
        for stage in (0, 1):
            speed, change, rate = copy.qvel.copy(), copy.qacc.copy(), copy.act_dot.copy()
            copy.qpos[:] = qpos
            mujoco.mj_integratePos(model, copy.qpos, speed, h * pulse_nodes[stage])
            copy.qvel[:], copy.act[:] = qvel + h * pulse_nodes[stage] * change, act + h * pulse_nodes[stage] * rate
            copy.time = time_s + h * pulse_nodes[stage]
            mujoco.mj_forwardSkip(model, copy, mujoco.mjtStage.mjSTAGE_NONE, 1)
            stages.append(self._touches(copy, h * self.WEIGHTS[stage + 1], h * pulse_nodes[stage]))
        return motion, stages


def _ordinals(geom: Array) -> Array:
    """Count the contacts (k,) of each pair of geoms (k, 2), which lie side by side, from 0."""
    first = np.ones(len(geom), bool)
    first[1:] = (geom[1:] != geom[:-1]).any(axis=1)
    start = np.flatnonzero(first)
    return np.asarray(np.arange(len(geom)) - start[np.cumsum(first) - 1])


def _merge_stages(stages: list[tuple[Array, Array]]) -> Array:
    """Join the contacts of stages: those of one name are one, as first seen, with the sum of their impulses."""
    row, name = join_arrays([row for row, _ in stages], TOUCH), np.concatenate([name for _, name in stages])
    _, first, back = np.unique(name, axis=0, return_index=True, return_inverse=True)
    made = row[first]
    made["impulse_n_s"] = 0.0
    np.add.at(made["impulse_n_s"], back.ravel(), row["impulse_n_s"])
    return np.asarray(made[np.argsort(first, kind="stable")])
