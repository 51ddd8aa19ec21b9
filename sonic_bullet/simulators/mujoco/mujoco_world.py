"""A MuJoCo world as the sound needs it: bodies by value, and one `Step` for each physics step.

    (model, data) -> ModelLinks                                   bodies, names, shapes, once
    mujoco.mj_step, watched -> StageForces -> Motion, TOUCH -> MotionWorld -> SoftImpacts -> Step

MuJoCo's contacts are soft: an impact lasts about twice the time constant of solref, 40 ms where nothing is said. Its
whole impulse is given out as one strike when it is over (tables.soft_impacts).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from sonic_bullet.machine.package_version import find_version
from sonic_bullet.records import Body, Shape
from sonic_bullet.records.coerce import as_number, quote
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.simulated import Values, finite
from sonic_bullet.simulators.frames import Roster
from sonic_bullet.simulators.mujoco.model_links import ModelLinks
from sonic_bullet.simulators.mujoco.stage_forces import StageForces
from sonic_bullet.simulators.mujoco.stepping import watch
from sonic_bullet.simulators.polling import Touches
from sonic_bullet.simulators.tables.motion_world import MotionWorld
from sonic_bullet.simulators.tables.soft_impacts import SoftImpacts


class MujocoWorld(MotionWorld):
    """A `World` that reads one MjModel and MjData.

    Parameters
    ----------
    model, data
        Of the package mujoco.

    Raises
    ------
    SceneError
        They are no model and data, or nothing in the model can touch.
    """

    def __init__(self, model: Any, data: Any) -> None:
        if not isinstance(model, mujoco.MjModel) or not isinstance(data, mujoco.MjData):
            raise SceneError(
                f"client is ({quote(model)}, {quote(data)})", "pass (model, data), MuJoCo's MjModel and MjData"
            )
        self.model, self.data = model, data
        self.links = ModelLinks(model)
        self.links.check_contacts()
        self._forces = StageForces(model, data, self.links)
        self._leave: Callable[[], None] = lambda: None
        self._after: Callable[[], object] | None = None
        super().__init__()

    def begin(self) -> None:
        """Clear all state, as before the first step."""
        super().begin()
        self.impacts = SoftImpacts()
        self._seen_s = float(self.data.time)
        self._step_s = self._length_s()
        self._is_due = False

    @property
    def roster(self) -> Roster:
        """The links of the model."""
        return self.links.roster

    def own(self, body: int, link: int) -> tuple[int, int]:
        """Return (body, link) as records have them; raises SceneError."""
        return self.links.own(body, link)

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """List (body, link) of every link with a geom that can touch something."""
        return self.links.touching()

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """Return the body and links meant by names or numbers; raises SceneError, MeshError."""
        return self.links.find_links(body, link)

    def describe(self, body: int, link: int) -> Body:
        """Return the silent record of a link; raises SceneError."""
        return self.links.describe(body, link)

    def link_name(self, body: int, link: int) -> str:
        """Return a link's own name."""
        return self.links.name(*self.links.own(body, link))

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Return the geometry of a link in its inertial frame; raises SceneError, MeshError."""
        return self.links.shapes(body, link)

    def likeness(self, body: int, link: int) -> tuple[int, int]:
        """Return what tells a link from others: a model's links are always the same."""
        return self.own(body, link)

    def engine(self) -> Values:
        """Return MuJoCo's options."""
        mujoco_options = (
            "timestep",
            "impratio",
            "tolerance",
            "iterations",
            "noslip_iterations",
            "integrator",
            "cone",
            "solver",
        )
        option = self.model.opt
        gravity = {f"gravity_{axis}": float(x) for axis, x in zip("xyz", option.gravity, strict=True)}
        return finite({**{name: float(getattr(option, name)) for name in mujoco_options}, **gravity})

    def versions(self) -> dict[str, str]:
        """Return MuJoCo's version."""
        return {"mujoco": find_version("mujoco")}

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` after each `mujoco.mj_step` of this data."""
        self.unhook()
        self._after, self._leave = after, watch(self.data, self)
        return True

    def unhook(self) -> None:
        """Watch no further steps."""
        self._leave()
        self._after = None

    def before_step(self) -> None:
        """Prepare for a step that is about to be made."""
        self._forces.before()

    def tell_step(self) -> None:
        """Tell the listener of the step just made."""
        self._is_due = True
        if self._after is not None:
            self._after()

    def after_step(self) -> Step:
        """Return the record of the step just made; SceneError where several were made and one is seen."""
        now_s, h = float(self.data.time), self._length_s()
        gravity = self._gravity()
        if not self._is_due:
            if now_s == self._seen_s:
                return self.empty_step(h, gravity)
            self._check_unseen(now_s, h)
        self._is_due = False
        if h != self._step_s:
            self.properties.engine_changed(self.step_count)
            self._step_s = h
        begun_anew = now_s < self._seen_s
        self._seen_s = now_s
        motion, row = self._forces.after()
        touches = Touches(row)
        if (len(row) and not touches.usable.all()) or not (np.abs(motion.number) < 1e9).all():
            raise SceneError("MuJoCo's state is not a number, or beyond 1e9", "look for the body that became unstable")
        moved = [one for one, _, static in self.roster.bodies if not static] if begun_anew else ()
        return self.made_step(motion, touches, h, gravity, moved)

    def _check_unseen(self, now_s: float, h: float) -> None:
        """Raise SceneError unless one step was made that nobody watched, and it can be read afterwards."""
        remedy = "call mujoco.mj_step by its module's name, or listener.step() after each single step"
        made = (now_s - self._seen_s) / h
        if made > 1.5:
            raise SceneError(f"{made:.0f} MuJoCo steps were made and one is seen", remedy)
        if not self._forces.was_prepared:
            raise SceneError("a step of the integrator RK4 was made that was not seen from its start", remedy)

    def _length_s(self) -> float:
        remedy = "set model.opt.timestep between 0 and 1 s"
        return as_number(self.model.opt.timestep, "MuJoCo's timestep", remedy, above=0, most=1, error=SceneError)

    def _gravity(self) -> tuple[float, ...]:
        off = self.model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        return (0.0, 0.0, 0.0) if off else tuple(float(x) for x in self.model.opt.gravity)
