"""Intercept the calls into PyBullet that build and drive a world and, where a plan says so, substitute their arguments.

    scene: createMultiBody(0.004, 3) -> Call by value -> Plan -> calls of another scene first, then this one, changed

The functions of the module are replaced within the block, so that calls are intercepted whether a scene calls the
module or a BulletClient, or this package calls for it. Queries (get…) and pictures are not intercepted. Functions that
were imported by name before are not either; a run of which no inputs were recorded is compared by its effects alone.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.simulators.calls import FIRST_ABSENT, Call, InputFile, ObjectId, Plan, map_leaves
from sonic_bullet.simulators.pybullet.hooks import DYNAMICS_IN_ORDER

IN_ORDER: dict[str, tuple[str, ...]] = {
    "changeDynamics": DYNAMICS_IN_ORDER,
    "createCollisionShape": ("shapeType", "radius", "halfExtents", "height", "fileName", "meshScale", "planeNormal"),
    "createMultiBody": (
        "baseMass", "baseCollisionShapeIndex", "baseVisualShapeIndex", "basePosition", "baseOrientation",
        "baseInertialFramePosition", "baseInertialFrameOrientation",
    ),
    "loadURDF": ("fileName", "basePosition", "baseOrientation", "useMaximalCoordinates", "useFixedBase", "flags"),
    "setGravity": ("gravX", "gravY", "gravZ"),
    "setTimeStep": ("timeStep",),
    "setDefaultContactERP": ("defaultContactERP",),
    "resetBasePositionAndOrientation": ("bodyUniqueId", "posObj", "ornObj"),
    "resetBaseVelocity": ("objectUniqueId", "linearVelocity", "angularVelocity"),
    "resetJointState": ("bodyUniqueId", "jointIndex", "targetValue", "targetVelocity"),
    "setJointMotorControl2": ("bodyUniqueId", "jointIndex", "controlMode"),
    "setJointMotorControlArray": ("bodyUniqueId", "jointIndices", "controlMode", "targetPositions"),
    "applyExternalForce": ("objectUniqueId", "linkIndex", "forceObj", "posObj", "flags"),
    "applyExternalTorque": ("objectUniqueId", "linkIndex", "torqueObj", "flags"),
    "createConstraint": (
        "parentBodyUniqueId", "parentLinkIndex", "childBodyUniqueId", "childLinkIndex", "jointType", "jointAxis",
        "parentFramePosition", "childFramePosition", "parentFrameOrientation", "childFrameOrientation",
    ),
    "setCollisionFilterPair": ("bodyUniqueIdA", "bodyUniqueIdB", "linkIndexA", "linkIndexB", "enableCollision"),
    "setCollisionFilterGroupMask": ("bodyUniqueId", "linkIndexA", "collisionFilterGroup", "collisionFilterMask"),
    "loadSDF": ("sdfFileName",),
    "loadMJCF": ("mjcfFileName",),
    "loadBullet": ("bulletFileName",),
    "removeBody": ("bodyUniqueId",),
    "removeConstraint": ("userConstraintUniqueId",),
    "changeConstraint": ("userConstraintUniqueId",),
}  # fmt: skip
"""Positional arguments, by PyBullet's names for them."""
SHAPE_ARGUMENTS = {"baseCollisionShapeIndex", "linkCollisionShapeIndices"}
PICTURES = {"baseVisualShapeIndex", "linkVisualShapeIndices", "rgbaColor", "specularColor"}


def list_intercepted() -> list[str]:
    """List the names of the functions that are intercepted."""
    prefixes = ("create", "load", "change", "set", "reset", "apply", "remove", "enable", "restore")
    # functions that change a picture, a window, or what is queried; restoreState has no value to compare
    no_inputs = re.compile(
        "Visual|Texture|Debug|VR|AdditionalSearchPath|TimeOut|RealTime|Plugin|Flags|UserData"
        "|State$|SensorJoint|createSoft"
    )
    return [
        name
        for name in dir(pybullet)
        if name.startswith(prefixes)
        and (not no_inputs.search(name) or name.startswith("resetJointState"))
        and callable(getattr(pybullet, name))
    ]


class Interception:
    """The calls of one run.

    Parameters
    ----------
    side
        Run that the bodies belong to.
    plan
        Calls to substitute.
    look
        Called before each step.
    """

    def __init__(self, side: str, plan: Plan | None = None, look: Callable[[], None] = lambda: None) -> None:
        self.side, self.plan, self.look = side, plan, look
        self.calls: list[Call] = []
        self.steps = 0
        self.client = 0
        self.ids: dict[ObjectId, int] = {}  # living or not; the latest owner of an id is the last
        self._bearer: dict[tuple[str, int], ObjectId] = {}
        self._shapes: dict[int, Mapping[str, Any]] = {}
        self._count = {"body": 0, "constraint": 0}
        self._folders: list[str] = []
        self.files: set[str] = set()
        self._real: dict[str, Any] = {}

    def who(self, body: int, kind: str = "body") -> ObjectId:
        """Return the body, or constraint, that has that id now."""
        return self._bearer.get((kind, body)) or ObjectId("", body, kind)

    @contextmanager
    def replace_functions(self) -> Iterator[None]:
        """Replace the module's functions within the block."""
        # Functions that are intercepted though they set nothing
        besides = ("stepSimulation", "setAdditionalSearchPath")
        self._real = {name: getattr(pybullet, name) for name in (*list_intercepted(), *besides)}
        ours: dict[str, Any] = {name: functools.partial(self._call, name) for name in list_intercepted()}
        ours |= {"stepSimulation": self._step, "setAdditionalSearchPath": self._search}
        forward = BulletClient.__getattr__

        def forwarded(client: Any, name: str) -> Any:
            if name in ours and vars(pybullet)[name] is ours[name]:  # else another function replaces it
                return functools.partial(ours[name], physicsClientId=client._client)
            return forward(client, name)

        with patch.dict(vars(pybullet), ours), patch.object(BulletClient, "__getattr__", forwarded):
            yield

    def _step(self, *args: Any, **kwargs: Any) -> Any:
        self.look()
        self.make(self.plan.remaining_calls(self.steps) if self.plan is not None else [])
        result = self._real["stepSimulation"](*args, **kwargs)
        self.steps += 1
        return result

    def _search(self, *args: Any, **kwargs: Any) -> Any:
        self._folders.append(str(args[0] if args else kwargs.get("path", "")))
        return self._real["setAdditionalSearchPath"](*args, **kwargs)

    def _call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        order = IN_ORDER.get(name, ())
        given = {**{order[i] if i < len(order) else str(i): x for i, x in enumerate(args)}, **kwargs}
        client = self.client = given.pop("physicsClientId", 0)
        call = self._by_value(name, given)
        if self.plan is None:
            if name != "createCollisionShape":  # is an argument of the call that uses it
                self.calls.append(call)
            return self._made(call, self._real[name](*args, **kwargs))
        if name == "createCollisionShape":
            return self._made(call, self._real[name](*args, **kwargs))
        first, arguments = self.plan.ahead_of(call)
        self.make(first)
        if arguments is None:
            return self._not_made(call)
        changed = {key: x for key, x in arguments.items() if key not in call.arguments or x is not call.arguments[key]}
        if not changed and len(arguments) == len(call.arguments):
            return self._made(call, self._real[name](*args, **kwargs))
        own = {key: x for key, x in given.items() if key in arguments or key in PICTURES}
        return self._made(call, self._ask(name, {**own, **self._to_ask(changed)}, client))

    def make(self, calls: list[Call]) -> None:
        """Make calls of another scene, in the client that was called last."""
        for call in calls:
            if call.name in self._real and call.name != "createCollisionShape":
                result = self._ask(call.name, self._to_ask(call.arguments), self.client)
                for one, body in zip(call.made, _ids(result), strict=False):
                    self.ids[one], self._bearer[one.kind, body] = body, one

    def _ask(self, name: str, given: Mapping[str, Any], client: int) -> Any:
        placed = [given[key] for key in sorted(key for key in given if key.isdigit())]
        return self._real[name](*placed, **{k: x for k, x in given.items() if not k.isdigit()}, physicsClientId=client)

    def _made(self, call: Call, result: Any) -> Any:
        if call.name == "createCollisionShape":
            self._shapes[int(result)] = call.arguments
        for one, body in zip(call.made or self._whom(call.name, result), _ids(result), strict=False):
            self.ids[one], self._bearer[one.kind, body] = body, one
        if call.name == "resetSimulation":
            self._bearer.clear()
        if self.plan is None and call.name != "createCollisionShape":
            made = tuple(self._bearer[kind, body] for kind, body in self._kinds(call.name, result))
            self.calls[-1] = Call(call.name, call.step, call.arguments, call.who, made)
        return result

    def _not_made(self, call: Call) -> Any:
        whom = self._whom(call.name, FIRST_ABSENT + sum(self._count.values()))
        for one in whom:
            self.ids[one] = FIRST_ABSENT + one.serial
            self._bearer[one.kind, FIRST_ABSENT + one.serial] = one
        made = [self.ids[one] for one in whom]
        return tuple(made) if call.name in ("loadSDF", "loadMJCF", "loadBullet") else next(iter(made), None)

    def _kinds(self, name: str, result: Any) -> list[tuple[str, int]]:
        if name == "createConstraint":
            return [("constraint", body) for body in _ids(result)]
        makes = name in ("createMultiBody", "loadURDF", "loadSDF", "loadMJCF", "loadBullet", "loadSoftBody")
        return [("body", body) for body in _ids(result)] if makes else []

    def _whom(self, name: str, result: Any) -> list[ObjectId]:
        """Assign serial numbers to the bodies and constraints that a call made."""
        found = []
        for kind, _ in self._kinds(name, result):
            found.append(ObjectId(self.side, self._count[kind], kind))
            self._count[kind] += 1
        return found

    def _by_value(self, name: str, given: Mapping[str, Any]) -> Call:
        body_argument = re.compile("^(body|object|multiBody|parentBody|childBody)UniqueId[AB]?$")
        constraint = "userConstraintUniqueId"
        whom: ObjectId | None = None
        arguments: dict[str, Any] = {}
        for key, raw in given.items():
            if key in PICTURES:
                continue
            value = _plain(raw)
            if body_argument.match(key) or key == constraint:
                value = self.who(int(raw), "constraint" if key == constraint else "body")
                whom = whom or value
            elif key in SHAPE_ARGUMENTS:
                value = map_leaves(value, lambda index: self._shapes.get(index, index))
            elif key.lower().endswith("filename"):
                value = self._file(str(raw))
            arguments[key] = value
        return Call(name, self.steps, arguments, whom)

    def _to_ask(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Convert arguments by value to those that PyBullet takes."""
        return {key: self._handle(key, value) for key, value in arguments.items()}

    def _handle(self, key: str, value: Any) -> Any:
        if key in SHAPE_ARGUMENTS:
            if isinstance(value, Mapping):
                index = self._ask("createCollisionShape", self._to_ask(value), self.client)
                self._shapes[int(index)] = value
                return index
            return [self._handle(key, one) for one in value] if isinstance(value, tuple) else value
        if isinstance(value, ObjectId):
            return self.ids.get(value, value.serial)
        return value.path if isinstance(value, InputFile) else value

    def _file(self, name: str) -> InputFile:
        for folder in ("", *reversed(self._folders)):
            place = Path(folder, name)
            if place.is_file():
                self.files.add(os.path.abspath(place))
                return InputFile(str(place.resolve()), _digest(place))
        return InputFile(name, f"no file {name}")


def _ids(result: Any) -> list[int]:
    return [int(one) for one in (result if isinstance(result, tuple) else (result,)) if isinstance(one, int)]


def _plain(value: Any) -> Any:
    """Convert to numbers, texts and tuples of them."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, (list, tuple)) else value


@functools.lru_cache(maxsize=1024)
def _digest_of(path: str, changed_ns: int, size: int) -> str:
    digest = hashlib.sha256()
    data = Path(path).read_bytes()
    digest.update(data)
    if path.lower().endswith((".urdf", ".sdf", ".xml")):
        for named in sorted(set(re.findall(rb'(?:filename|file)\s*=\s*"([^"]+)"', data))):
            inner = Path(path).parent / named.decode(errors="replace").removeprefix("package://")
            if inner.is_file():
                digest.update(inner.read_bytes())
    return digest.hexdigest()


def _digest(place: Path) -> str:
    state = place.stat()
    return _digest_of(str(place.resolve()), state.st_mtime_ns, state.st_size)
