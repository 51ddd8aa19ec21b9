"""Small gymnasium environments over PyBullet: a box that falls, with its physics steps hidden."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pybullet as p

from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model

DT_S = 1 / 240
PLATE = plate_model()


def plates(client: Any) -> dict[int, Any]:
    """The box of `FallingBox`: a model by hand, no finite elements."""
    return {1: {"material": STEEL, "model": PLATE}}


class FallingBox(gymnasium.Env[Any, Any]):
    """A box falls onto a floor; an action pushes it. Observed: its position."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, hidden: int = 4, dt_s: float = DT_S, renew: bool = False) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.hidden, self.dt_s, self.renew = hidden, dt_s, renew
        self.connect()
        self.build()

    def connect(self) -> None:
        self.physics: Any = direct_client()

    def build(self) -> None:
        self.physics.resetSimulation()
        self.physics.setGravity(0, 0, -9.81)
        self.physics.setTimeStep(self.dt_s)
        floor(self.physics)
        self.body = box(self.physics, [0, 0, 0.06])

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        if self.renew:
            self.build()
        turn = p.getQuaternionFromEuler(self.np_random.uniform(-0.3, 0.3, 3))
        self.physics.resetBasePositionAndOrientation(self.body, [0, 0, 0.06], turn)
        self.physics.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0])
        return self.position(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        force = [float(x) for x in action]
        for _ in range(self.hidden):
            self.physics.applyExternalForce(self.body, -1, force, [0, 0, 0], p.LINK_FRAME)
            self.physics.stepSimulation()
        return self.position(), 0.0, False, False, {}

    def position(self) -> Any:
        return np.array(self.physics.getBasePositionAndOrientation(self.body)[0])

    def close(self) -> None:
        disconnect(self.physics)


class _Numbered:
    """The pybullet module with one client's number filled in, called by name each time as a program would."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __getattr__(self, name: str) -> Any:
        return lambda *args, **named: getattr(p, name)(*args, **named, physicsClientId=self.__dict__["number"])


class NumberedBox(FallingBox):
    """The same, of a program that knows its client by number."""

    def connect(self) -> None:
        self._physics_client_id = p.connect(p.DIRECT)

    @property
    def physics(self) -> Any:
        return _Numbered(self._physics_client_id)

    def close(self) -> None:
        if p.isConnected(self._physics_client_id):
            p.disconnect(self._physics_client_id)


class Empty(gymnasium.Env[Any, Any]):
    """A world without bodies, one step of 1/240 s at a time."""

    def __init__(self) -> None:
        self.observation_space = gymnasium.spaces.Dict({"nothing": gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)})
        self.action_space = gymnasium.spaces.Discrete(2)
        self.parts: dict[str, Any] = {"world": [direct_client()]}

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return {"nothing": np.zeros(1, np.float32)}, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.parts["world"][0].stepSimulation()
        return {"nothing": np.zeros(1, np.float32)}, 0.0, False, False, {}

    def close(self) -> None:
        disconnect(self.parts["world"][0])
