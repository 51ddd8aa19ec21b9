"""Hooks on steps and removals of a BulletClient that leave its class alone.

BulletClient forwards unknown attributes to the module, so a function set on the instance replaces it: every
stepSimulation of this client is hooked, also inside a gym environment's step, and no other client is affected.
`disconnect` must never be looked up on it: the look-up alone clears its client id.

A client has one set of hooks for all its listeners (`Hooks`): the first listener installs it and the last removes it,
in whatever order they leave. No reference to the client is held: once dropped, it disconnects at once and does not
wait for the garbage collector.

A client known by its id alone has no instance: there `module_steps` hooks the steps made within a block.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.machine.worker import mark_step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.properties import SetValues
from sonic_bullet.simulators.pybullet.colliding.given_bodies import ENDERS, MAKERS, remember_arguments

DYNAMICS_IN_ORDER = (
    "bodyUniqueId",
    "linkIndex",
    "mass",
    "lateralFriction",
    "spinningFriction",
    "rollingFriction",
    "restitution",
    "linearDamping",
    "angularDamping",
    "contactStiffness",
    "contactDamping",
    "frictionAnchor",
)
"""Positional arguments of changeDynamics."""


class Watcher(Protocol):
    """The part of a world that hooks notify."""

    client_id: int

    @property
    def client(self) -> Any:
        """The hooked client."""

    def forget(self, body: int | None = None) -> None:
        """Note that a body was removed; None: all."""

    def mark_moved(self, body: int | None) -> None:
        """Note that a body was moved by hand; None: all."""

    def mark_changed(self, body: int, link: int) -> None:
        """Note that values of a link were set."""

    def mark_engine_changed(self) -> None:
        """Note that settings of the engine were set."""


@dataclass(frozen=True, slots=True, eq=False)
class HookedListener:
    """A listener: a world that is notified about bodies, and functions called before and after each step."""

    world: Watcher
    before: Callable[[], object]
    after: Callable[[], object]


def body_argument(args: tuple[Any, ...], kwargs: dict[str, Any]) -> int:
    """Return the body id among a PyBullet function's arguments."""
    body_keywords = ("bodyUniqueId", "objectUniqueId", "multiBodyUniqueId")
    if args:
        return int(args[0])
    return int(next(kwargs[name] for name in body_keywords if name in kwargs))


class Hooks:
    """The functions that replace a client's own, and their listeners.

    Without listeners, they only pass calls on.
    """

    POSE_SETTERS = (
        "resetBasePositionAndOrientation",
        "resetJointState",
        "resetJointStateMultiDof",
        "resetJointStatesMultiDof",
    )

    def __init__(self, client: Any, client_id: int) -> None:
        self._client = weakref.ref(client)
        self._client_id = client_id
        self.listening: list[HookedListener] = []
        self.set_values = SetValues()
        self._ours: dict[str, Callable[..., Any]] = {
            "stepSimulation": self._step(self._below(client, "stepSimulation")),
            "removeBody": self._telling("removeBody", client, lambda world, body: world.forget(body)),
            "resetSimulation": self._telling("resetSimulation", client, lambda world, _: world.forget()),
            "restoreState": self._telling("restoreState", client, lambda world, _: world.mark_moved(None)),
            "changeDynamics": self._setting_link(self._below(client, "changeDynamics")),
            "setPhysicsEngineParameter": self._setting_engine(self._below(client, "setPhysicsEngineParameter")),
            "setDefaultContactERP": self._setting_engine(self._below(client, "setDefaultContactERP"), "contactERP"),
            **{
                name: self._telling(name, client, lambda world, body: world.mark_moved(body))
                for name in self.POSE_SETTERS
            },
            **{name: remember_arguments(name, self._below(client, name), client_id, self._client) for name in MAKERS},
        }
        self._kept = {name: vars(client)[name] for name in self._ours if name in vars(client)}
        vars(client).update(self._ours)

    @classmethod
    def of(cls, client: Any, client_id: int) -> Hooks:
        """Return the hooks of a client; new ones where there are none, or where other functions replace one of them."""
        found = getattr(vars(client).get("stepSimulation"), "hooks", None)
        return found if isinstance(found, Hooks) and found._in_place(client) else cls(client, client_id)

    def leave(self, one: HookedListener) -> None:
        """Remove a listener; with the last one, restore the client's own functions that were not replaced again."""
        if one in self.listening:
            self.listening.remove(one)
        client = self._client()
        if self.listening or client is None:
            return
        for name, function in self._ours.items():
            if vars(client).get(name) is function:
                del vars(client)[name]
                if name in self._kept:
                    vars(client)[name] = self._kept[name]

    def _in_place(self, client: Any) -> bool:
        return all(vars(client).get(name) is function for name, function in self._ours.items())

    def _below(self, client: Any, name: str) -> Callable[..., Any]:
        """Return the client's function of that name before the hooks."""
        if name in vars(client):
            return vars(client)[name]  # type: ignore[no-any-return]

        def forwarded(*args: Any, **kwargs: Any) -> Any:
            return getattr(pybullet, name)(*args, **{"physicsClientId": self._client_id, **kwargs})

        return forwarded

    def _step(self, below: Callable[..., Any]) -> Callable[..., Any]:
        def stepped(*args: Any, **kwargs: Any) -> Any:
            for one in reversed(self.listening[:]):
                one.before()
            result = below(*args, **kwargs)
            mark_step()
            for one in self.listening[:]:
                one.after()
            return result

        stepped.hooks = self  # type: ignore[attr-defined]
        return stepped

    def _telling(self, name: str, client: Any, notify: Callable[[Watcher, int], None]) -> Callable[..., Any]:
        below = self._below(client, name)
        below = remember_arguments(name, below, self._client_id, self._client) if name in ENDERS else below
        of_body = name == "removeBody" or name in self.POSE_SETTERS

        def reporting(*args: Any, **kwargs: Any) -> Any:
            result = below(*args, **kwargs)
            body = body_argument(args, kwargs) if of_body else -1
            if name == "removeBody":
                self.set_values.forget(body)
            elif name == "resetSimulation":
                self.set_values.forget()
            for one in self.listening[:]:
                notify(one.world, body)
            return result

        return reporting

    def _setting_link(self, below: Callable[..., Any]) -> Callable[..., Any]:
        def setting(*args: Any, **kwargs: Any) -> Any:
            result = below(*args, **kwargs)
            body, link, values = named_dynamics(args, kwargs)
            self.set_values.set_link(body, link, values)
            for one in self.listening[:]:
                one.world.mark_changed(body, link)
            return result

        return setting

    def _setting_engine(self, below: Callable[..., Any], name: str | None = None) -> Callable[..., Any]:
        """Wrap a setter of the engine; name: of its only argument, None: arguments have their names."""

        def setting(*args: Any, **kwargs: Any) -> Any:
            result = below(*args, **kwargs)
            values = without_client(kwargs)
            self.set_values.set_engine(values if name is None else {name: next(iter((*args, *values.values())))})
            for one in self.listening[:]:
                one.world.mark_engine_changed()
            return result

        return setting


def named_dynamics(args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[int, int, dict[str, Any]]:
    """Return body, link and values of changeDynamics' arguments."""
    values = {**dict(zip(DYNAMICS_IN_ORDER, args, strict=False)), **kwargs}
    return int(values.pop("bodyUniqueId")), int(values.pop("linkIndex")), without_client(values)


def without_client(values: dict[str, Any]) -> dict[str, Any]:
    """Remove the client id from arguments."""
    return {name: x for name, x in values.items() if name != "physicsClientId"}


def install(
    world: Watcher, before: Callable[[], object], after: Callable[[], object]
) -> tuple[SetValues, Callable[[], None]]:
    """Install hooks on the world's client; return the values set from then on, and a function that removes the hooks.

    Raises
    ------
    SceneError
        The client is not an instance of a wrapper.
    """
    client = world.client
    if client is None or isinstance(client, (int, type(pybullet))):
        raise SceneError(
            "the pybullet module itself cannot be hooked",
            "call listener.step() after each stepSimulation, or use pybullet_utils.bullet_client.BulletClient",
        )
    hooks, one = Hooks.of(client, world.client_id), HookedListener(world, before, after)
    hooks.listening.append(one)
    return hooks.set_values, lambda: hooks.leave(one)


@contextmanager
def replaced_functions(ours: Mapping[str, Callable[..., Any]]) -> Iterator[None]:
    """Replace functions of pybullet within the block, for its callers and for BulletClients.

    BulletClient passes its id on to built-in functions only, so its look-up is replaced too. A script that imported a
    function itself by name is not observed.
    """
    forward = BulletClient.__getattr__

    def forward_ours(self: Any, name: str) -> Any:
        return partial(ours[name], physicsClientId=self._client) if name in ours else forward(self, name)

    from unittest.mock import patch  # brings asyncio

    with ExitStack() as patches:
        for name, function in ours.items():
            patches.enter_context(patch.object(pybullet, name, function))
        patches.enter_context(patch.object(BulletClient, "__getattr__", forward_ours))
        yield


@contextmanager
def module_steps(client_id: int, after: Callable[[], object]) -> Iterator[None]:
    """Call ``after`` after every step of that client made by `pybullet.stepSimulation` within the block."""
    real_step = pybullet.stepSimulation

    def step(physicsClientId: int = 0) -> Any:
        result = real_step(physicsClientId=physicsClientId)
        if physicsClientId == client_id:
            after()
        return result

    with replaced_functions({"stepSimulation": step}):
        yield


@contextmanager
def seen_moves(world_of: Callable[[int], Watcher | None]) -> Iterator[None]:
    """Notify the world of a client, where it has one, of bodies that are moved by hand or removed within the block."""
    removers = ("removeBody", "resetSimulation")

    def telling(name: str) -> Callable[..., Any]:
        real = getattr(pybullet, name)

        def call(*args: Any, **kwargs: Any) -> Any:
            result = real(*args, **kwargs)
            world = world_of(int(kwargs.get("physicsClientId", 0)))
            if world is not None:
                body = None if name in ("restoreState", "resetSimulation") else body_argument(args, kwargs)
                (world.forget if name in removers else world.mark_moved)(body)
            return result

        return call

    with replaced_functions({name: telling(name) for name in (*Hooks.POSE_SETTERS, "restoreState", *removers)}):
        yield


@contextmanager
def seen_settings() -> Iterator[dict[int, SetValues]]:
    """Record the values set on engines and links within the block, by client id."""
    setters = ("changeDynamics", "setPhysicsEngineParameter", "removeBody", "resetSimulation")
    seen: dict[int, SetValues] = {}

    def setter(name: str) -> Callable[..., Any]:
        real = getattr(pybullet, name)

        def setting(*args: Any, **kwargs: Any) -> Any:
            result = real(*args, **kwargs)
            known = seen.setdefault(int(kwargs.get("physicsClientId", 0)), SetValues())
            if name == "resetSimulation":
                known.forget()
            elif name == "removeBody":
                known.forget(body_argument(args, kwargs))
            elif name == "changeDynamics":
                known.set_link(*named_dynamics(args, kwargs))
            else:
                known.set_engine(without_client(kwargs))
            return result

        return setting

    with replaced_functions({name: setter(name) for name in setters}):
        yield seen
