"""A `World` of plain arrays: whoever simulates says what its bodies are, and after each step what it did.

    define(name, shapes, mass, inertia, centre) -> number of the body
    advance(dt, poses at the start, contacts with impulses) -> Motion, TOUCH -> Step -> the listener

Poses may be of any frame of a body; the records are in the frame of its centre of mass. Speeds that are not given are
the last step's, by differences: v(n) = (x(n) - x(n-1)) / dt(n-1), exact for a semi-implicit integrator.
"""

from __future__ import annotations

import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet._engine import TOUCH
from sonic_bullet.geometry import solid_of
from sonic_bullet.geometry.flat_faces import flat_faces
from sonic_bullet.records import Array, Body, Shape
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.coerce import as_items, as_number, as_text, as_whole, nearest, quote
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import MeshError, SceneError
from sonic_bullet.simulators.animated import matrices, rotation
from sonic_bullet.simulators.frames import Motion, Roster, encode
from sonic_bullet.simulators.known_bodies import only_curvature
from sonic_bullet.simulators.polling import Touches
from sonic_bullet.simulators.tables.motion_world import MotionWorld, roster_of


@dataclass(frozen=True, slots=True, eq=False)
class DefinedBody:
    """A body: its record while silent, its shapes in its own frame, the centre of mass in the frame of its poses."""

    record: Body
    shapes: tuple[Shape, ...]
    centre_m: Array


class ArrayWorld(MotionWorld):
    """Bodies and steps from plain arrays."""

    def __init__(self) -> None:
        self.defined: list[DefinedBody] = []
        self._roster = roster_of([], [])
        self._after: Callable[[], object] | None = None
        super().__init__()

    def begin(self) -> None:
        """Clear all state, as before the first step."""
        super().begin()
        self._made: Step | None = None
        self._last: tuple[float, Array, Array] | None = None

    @property
    def roster(self) -> Roster:
        """The bodies so far."""
        return self._roster

    def define(
        self,
        name: str,
        shapes: Sequence[Shape],
        *,
        mass_kg: float,
        inertia_kg_m2: Any = None,
        centre_m: Any = None,
    ) -> int:
        """Define a body; return its number.

        Parameters
        ----------
        name
        shapes
            In the frame of its poses.
        mass_kg
            0: it never moves by itself.
        inertia_kg_m2 : Array, shape (3, 3) or (3,)
            About the centre of mass, in the axes of its poses; None: of the shapes as one solid.
        centre_m : Array, shape (3,)
            Centre of mass, in the frame of its poses; None: of the shapes as one solid.

        Raises
        ------
        SceneError, RecordError
            An argument is not valid, or a step was made already.
        """
        if self.step_count:
            raise SceneError(f"{quote(name)} comes after a step", "add all bodies before the first step")
        who = as_text(name, "name", "give a text", error=SceneError)
        heaviest_kg = 1e12
        mass = as_number(mass_kg, f"{who}: mass_kg", "give kilograms, 0 or more", least=0, below=heaviest_kg)
        volume, middle, moment = solid_of(shapes)
        if mass and not volume and (inertia_kg_m2 is None or centre_m is None):
            raise SceneError(f"{who} moves and encloses no volume", "give inertia_kg_m2= and centre_m=, or mass_kg=0")
        centre = middle if centre_m is None else frozen_array(centre_m, float, (3,), f"{who}: centre_m")
        tensor = moment * (mass / volume if volume else 0.0)
        if inertia_kg_m2 is not None:
            tensor = _as_tensor(inertia_kg_m2, f"{who}: inertia_kg_m2")
        own = tuple(replace(shape, position_m=shape.position_m - centre) for shape in shapes)
        number = len(self.defined)
        faces = flat_faces(own if mass == 0 else ())
        record = Body(number, -1, 0, who, mass, tensor, curvature_per_m=only_curvature(own), flat_faces_m=faces)
        self.defined.append(DefinedBody(record, own, centre))
        self._enrol()
        return number

    def drop_last(self) -> None:
        """Undo the last `define`."""
        self.defined.pop()
        self._enrol()

    def _enrol(self) -> None:
        code = encode(np.arange(len(self.defined)), -1).tolist()
        self._roster = roster_of(code, [one.record.mass_kg == 0 for one in self.defined])

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """Return the number of a body, given as such or by name; raises SceneError."""
        if link not in (-1, "all"):
            raise SceneError(f"link is {quote(link)}", "leave it out: add each link of a robot as a body of its own")
        number, only = self.link_of(body)
        return number, (only,)

    def link_of(self, body: object) -> tuple[int, int]:
        """Return the number of a body, given as such or by name, and its only link; raises SceneError."""
        names = [one.record.name for one in self.defined]
        if isinstance(body, str) and body not in names:
            raise SceneError(f"no body is called {quote(body)}", nearest(body, names))
        remedy = "give its number or name"
        number = names.index(body) if isinstance(body, str) else as_whole(body, "body", remedy, error=SceneError)
        self.describe(number, -1)
        return number, -1

    def describe(self, body: int, link: int) -> Body:
        """Return the silent record of a body; raises SceneError."""
        if not 0 <= body < len(self.defined) or link != -1:
            raise SceneError(f"no body {quote(body)}", f"give a number below {len(self.defined)}")
        return self.defined[body].record

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Return a body's shapes about its centre of mass; raises SceneError, MeshError."""
        record = self.describe(body, link)
        if not self.defined[body].shapes:
            raise MeshError(f"{record.name} has no shape", "give it one, or add it with mesh=")
        return self.defined[body].shapes

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` at the end of each `advance`."""
        self._after = after
        return True

    def unhook(self) -> None:
        """Call nothing any more."""
        self._after = None

    def after_step(self) -> Step:
        """Return the record of the step just made."""
        made, self._made = self._made, None
        if made is None:
            return self.empty_step(self._last[0] if self._last else 1.0, (0.0, 0.0, 0.0))
        self.stepped = True
        return made

    def advance(
        self,
        dt_s: float,
        position_m: Any,
        quaternion_xyzw: Any,
        *,
        pair: Any = (),
        point_m: Any = (),
        normal: Any = (),
        impulse_n_s: Any = (),
        gap_m: Any = None,
        velocity_m_s: Any = None,
        spin_rad_s: Any = None,
        gravity_m_s2: Any = (0.0, 0.0, -9.81),
        moved: Any = (),
    ) -> None:
        """Take a step that was made.

        Parameters
        ----------
        dt_s
            Its length.
        position_m, quaternion_xyzw : Array, shapes (b, 3), (b, 4)
            Of each body in the world, at its start.
        pair : Array, shape (k, 2)
            Numbers of the bodies a and b of each contact.
        point_m, normal, impulse_n_s : Array, shape (k, 3)
            Where they touched at its start, unit from b to a, and what the step gave to a, friction included; world.
        gap_m : Array, shape (k,)
            Distance at its start, negative where they overlapped, which tells when they met; 0 or None:
            not known.
        velocity_m_s, spin_rad_s : Array, shape (b, 3)
            At its start, of the centre of mass; both None: by differences of the poses.
        gravity_m_s2 : Array, shape (3,)
        moved
            Numbers of bodies set elsewhere by hand since the last step.

        Raises
        ------
        RecordError, SceneError
            An argument is not valid.
        """
        b = len(self.defined)
        dt = as_number(dt_s, "dt_s", "give seconds, above 0, at most 1", above=0, most=1)
        place, turn = self._poses(position_m, quaternion_xyzw)
        hand = [
            as_whole(one, "moved", "give numbers of bodies", least=0, most=b - 1)
            for one in as_items(moved, "moved", "give numbers of bodies")
        ]
        speed, spin = self._twists(place, turn, velocity_m_s, spin_rad_s, hand)
        gravity = frozen_array(gravity_m_s2, float, (3,), "gravity_m_s2")
        touches = self._touches(pair, point_m, normal, impulse_n_s, gap_m)
        self._last = dt, place, turn
        now = Motion.of(self._roster, place, turn, speed, spin)
        self._made = self.made_step(now, touches, dt, tuple(gravity.tolist()), hand)
        if self._after is not None:
            self._after()

    def _poses(self, position_m: Any, quaternion_xyzw: Any) -> tuple[Array, Array]:
        """Return positions of the centres of mass, and unit quaternions."""
        b = len(self.defined)
        turn = frozen_array(quaternion_xyzw, float, (b, 4), "quaternion_xyzw")
        _check_unit(turn, "quaternion_xyzw")
        centre = np.array([one.centre_m for one in self.defined]).reshape(b, 3)
        origin = frozen_array(position_m, float, (b, 3), "position_m")
        return origin + np.einsum("bij,bj->bi", matrices(turn), centre), turn

    def _twists(
        self, place: Array, turn: Array, velocity_m_s: Any, spin_rad_s: Any, moved: Sequence[int]
    ) -> tuple[Array, Array]:
        b = len(place)
        if (velocity_m_s is None) != (spin_rad_s is None):
            raise SceneError("only one of velocity_m_s, spin_rad_s is given", "give both or neither")
        if velocity_m_s is not None:
            return (
                frozen_array(velocity_m_s, float, (b, 3), "velocity_m_s"),
                frozen_array(spin_rad_s, float, (b, 3), "spin_rad_s"),
            )
        speed, spin = np.zeros((b, 3)), np.zeros((b, 3))
        if self._last is not None:
            dt, before, turned = self._last
            speed, spin = (place - before) / dt, rotation(turned, turn) / dt
            speed[list(moved)] = spin[list(moved)] = 0.0
        return speed, spin

    def _touches(self, pair: Any, point_m: Any, normal: Any, impulse_n_s: Any, gap_m: Any) -> Touches:
        """Return the contacts that carry an impulse."""
        k, b = len(as_items(pair, "pair", "give numbers of bodies (k, 2)")), len(self.defined)
        who = frozen_array(np.zeros((0, 2)) if not k else pair, np.int64, (k, 2), "pair")
        if k and not (((who >= 0) & (who < b)).all() and (who[:, 0] != who[:, 1]).all()):
            raise SceneError(
                "pair names bodies that are not two of those added", f"give two numbers below {b} a contact"
            )
        given = {"point_m": point_m, "normal": normal, "impulse_n_s": impulse_n_s}
        point, along, impulse = (
            frozen_array(
                np.zeros((0, 3)) if not k and isinstance(x, tuple) and not x else x,
                float,
                (k, 3),
                f"{name} of each pair",
            )
            for name, x in given.items()
        )
        if k:
            _check_unit(along, "normal")
        gap = frozen_array(np.zeros(k) if gap_m is None else gap_m, float, (k,), "gap_m of each pair")
        row = np.zeros(k, TOUCH)
        row["code_a"], row["code_b"] = encode(who[:, 0], -1), encode(who[:, 1], -1)
        half = 0.5 * gap[:, None] * along
        row["point_a_m"], row["point_b_m"], row["normal"] = point + half, point - half, along
        row["gap_m"], row["impulse_n_s"] = gap, impulse
        return Touches(row[(impulse != 0).any(axis=1)])


def _as_tensor(value: Any, name: str) -> Array:
    """Return an inertia (3, 3), given as such or by three principal moments; raises RecordError."""
    rows = as_items(value, name, "give moments (3,) or a tensor (3, 3)")
    flat = all(isinstance(one, numbers.Real) for one in rows)
    tensor = np.diag(frozen_array(value, float, (3,), name)) if flat else frozen_array(value, float, (3, 3), name)
    if not (np.allclose(tensor, tensor.T, rtol=1e-6) and np.linalg.eigvalsh(tensor)[0] >= 0):
        raise SceneError(f"{name} is no inertia", "give a symmetric tensor without negative moments")
    return tensor


def _check_unit(rows: Array, name: str) -> None:
    length = np.linalg.norm(rows, axis=1)
    length_tolerance = 1e-6  # how far from 1 the length of a quaternion or a normal may be
    if (np.abs(length - 1) > length_tolerance).any():
        raise SceneError(f"{name} holds a row of length {length[np.argmax(np.abs(length - 1))]:.6g}", "give unit rows")
