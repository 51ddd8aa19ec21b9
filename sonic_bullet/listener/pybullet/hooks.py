"""Catching steps and removals of a BulletClient without touching its class.

BulletClient forwards unknown attributes to the module, so a function set on the instance takes its place: every
stepSimulation of this client is caught, those hidden in a gym environment's step too, and no other client notices.
`disconnect` must never be looked up on it: the look-up alone clears its client id.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import pybullet

from sonic_bullet.records.errors import SceneError

POSE_SETTERS = ("resetBasePositionAndOrientation", "resetJointState", "resetJointStateMultiDof", "resetJointStatesMultiDof")
BODY_KEYWORDS = ("bodyUniqueId", "objectUniqueId", "multiBodyUniqueId")


class Watcher(Protocol):
    """What a hook tells: World."""

    client: Any
    client_id: int

    def forget(self, body: int | None = None) -> None: ...
    def mark_moved(self, body: int | None) -> None: ...
    def mark_changed(self) -> None: ...


def body_argument(args: tuple[Any, ...], kwargs: dict[str, Any]) -> int:
    """The body id among a PyBullet function's arguments."""
    if args:
        return int(args[0])
    return int(next(kwargs[name] for name in BODY_KEYWORDS if name in kwargs))


def install(world: Watcher, before: Callable[[], object], after: Callable[[], object]) -> Callable[[], None]:
    """Hook the world's client; a function that restores it. Raises SceneError where the client is no instance of a wrapper."""
    client, client_id = world.client, world.client_id
    if isinstance(client, (int, type(pybullet))):
        raise SceneError(
            "the pybullet module itself cannot be hooked", "call listener.step() after each stepSimulation, or use pybullet_utils.bullet_client.BulletClient"
        )
    kept = {
        name: vars(client)[name]
        for name in ("stepSimulation", "removeBody", "resetSimulation", "restoreState", "changeDynamics", *POSE_SETTERS)
        if name in vars(client)
    }

    def original(name: str) -> Callable[..., Any]:
        if name in kept:
            return kept[name]  # type: ignore[no-any-return]

        def forwarded(*args: Any, **kwargs: Any) -> Any:
            return getattr(pybullet, name)(*args, **{"physicsClientId": client_id, **kwargs})

        return forwarded

    listening = True  # a later hook may call ours after we are gone

    step, remove, reset, restore, change = (original(name) for name in ("stepSimulation", "removeBody", "resetSimulation", "restoreState", "changeDynamics"))

    def stepped(*args: Any, **kwargs: Any) -> Any:
        if listening:
            before()
        result = step(*args, **kwargs)
        if listening:
            after()
        return result

    def removed(*args: Any, **kwargs: Any) -> Any:
        result = remove(*args, **kwargs)
        world.forget(body_argument(args, kwargs))
        return result

    def cleared(*args: Any, **kwargs: Any) -> Any:
        result = reset(*args, **kwargs)
        world.forget()
        return result

    def restored(*args: Any, **kwargs: Any) -> Any:
        result = restore(*args, **kwargs)
        world.mark_moved(None)
        return result

    def changed(*args: Any, **kwargs: Any) -> Any:
        result = change(*args, **kwargs)
        world.mark_changed()
        return result

    def setter(name: str) -> Callable[..., Any]:
        call = original(name)

        def moved(*args: Any, **kwargs: Any) -> Any:
            result = call(*args, **kwargs)
            world.mark_moved(body_argument(args, kwargs))
            return result

        return moved

    ours = {
        "stepSimulation": stepped,
        "removeBody": removed,
        "resetSimulation": cleared,
        "restoreState": restored,
        "changeDynamics": changed,
        **{name: setter(name) for name in POSE_SETTERS},
    }
    vars(client).update(ours)

    def uninstall() -> None:
        nonlocal listening
        listening = False
        for name, function in ours.items():
            if vars(client).get(name) is function:
                del vars(client)[name]
                if name in kept:
                    vars(client)[name] = kept[name]

    return uninstall
