"""Links of a MuJoCo model: which things can touch and sound, their names, masses and shapes.

    MjModel -> bodies with geoms, each geom of the world body on its own -> roster, Body, Shape in the inertial frame

A link is (body id, -1); a geom of the world body, which is a floor or a table and no part of the others there, is
(0, geom id). A user may also name link k ≥ 0 of a body: the k-th body below it, as MuJoCo counts them, depth first.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from sonic_bullet.geometry.flat_faces import flat_faces
from sonic_bullet.records import Array, Body, Shape
from sonic_bullet.records.coerce import as_whole, nearest, quote
from sonic_bullet.records.errors import MeshError, SceneError
from sonic_bullet.simulators.frames import Roster, decode, encode
from sonic_bullet.simulators.known_bodies import only_curvature
from sonic_bullet.simulators.mujoco.geom_shapes import shape_of_geom
from sonic_bullet.simulators.tables.motion_world import roster_of


class ModelLinks:
    """The links of one model.

    Attributes
    ----------
    roster
    row_of_geom : Array, shape (geoms,)
        Row of the link in the roster that each geom belongs to.
    body, geom : Array, shape (n,)
        MuJoCo's body of each row, and its geom where it is one of the world body, else -1.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        owner = np.asarray(model.geom_bodyid, np.int64)
        of_world = np.flatnonzero(owner == 0)
        moving = np.unique(owner[owner > 0])
        self.body = np.concatenate([np.zeros(len(of_world), np.int64), moving])
        self.geom = np.concatenate([of_world, np.full(len(moving), -1)])
        code = np.concatenate([encode(0, of_world), encode(moving, -1)])
        fixed = (np.asarray(model.body_weldid)[self.body] == 0) | (np.asarray(model.body_mocapid)[self.body] >= 0)
        self.roster: Roster = roster_of(code.tolist(), fixed.tolist())
        self.row_of_geom = np.searchsorted(
            code, np.where(owner == 0, encode(0, np.arange(len(owner))), encode(owner, -1))
        )

    def check_contacts(self) -> None:
        """Raise SceneError where no two geoms of the model can touch."""
        model, flags = self.model, mujoco.mjtDisableBit
        if model.opt.disableflags & (int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_CONSTRAINT)):
            raise SceneError("the MuJoCo model has its contacts disabled", "remove <flag contact='disable'/>")
        if model.npair == 0 and not self._can_touch():
            raise SceneError(
                "the MuJoCo model has no contacts: no two geoms of different bodies can touch",
                "give the geoms contype and conaffinity, or a <pair>",
            )

    def _can_touch(self) -> bool:
        """Tell whether some pair passes contype and conaffinity, one of them moving."""
        model, still = self.model, self.roster.static[self.row_of_geom]
        kinds = np.unique(
            np.stack([model.geom_contype, model.geom_conaffinity, still, self.row_of_geom], axis=1), axis=0
        )
        for kind in kinds[kinds[:, 2] == 0]:
            other = kinds[kinds[:, 3] != kind[3]]
            if ((kind[0] & other[:, 1]) | (other[:, 0] & kind[1])).any():
                return True
        return False

    @cached_property
    def colliding(self) -> Array:
        """Mask (geoms,) of the geoms that can touch something."""
        model = self.model
        mask = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
        for pair in (model.pair_geom1, model.pair_geom2):
            mask[np.asarray(pair, np.int64)] = True
        return np.asarray(mask)

    def touching(self) -> tuple[tuple[int, int], ...]:
        """List (body, link) of every link with a geom that can touch something."""
        rows = np.unique(self.row_of_geom[self.colliding])
        return tuple(decode(code) for code in self.roster.code[rows].tolist())

    def own(self, body: int, link: int) -> tuple[int, int]:
        """Return (body, link) of a link as the roster has it; SceneError where there is none."""
        model = self.model
        if not 0 <= body < model.nbody:
            raise SceneError(f"no body {quote(body)}", f"give a name, or a number below {model.nbody}")
        if body == 0:
            if not 0 <= link < model.ngeom or model.geom_bodyid[link] != 0:
                raise SceneError(f"the world has no geom {quote(link)}", "give the name of one of its geoms")
            return 0, link
        if link == -1:
            return body, -1
        if not 0 <= link < self._below(body):
            raise SceneError(f"body {body} has no link {quote(link)}", f"use -1, itself … {self._below(body) - 1}")
        return body + 1 + link, -1

    def row(self, body: int, link: int) -> int:
        """Return the row of a link in the roster; SceneError where there is none, or it has no geom."""
        code = int(encode(*self.own(body, link)))
        at = int(np.searchsorted(self.roster.code, code))
        if at == len(self.roster.code) or self.roster.code[at] != code:
            raise SceneError(f"{self.name(*self.own(body, link))} has no geom", "give it one")
        return at

    def find_links(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """Return the body and links meant; raises SceneError, MeshError. See `World.links_called`."""
        number, only = self._named(body) if isinstance(body, str) else (
            as_whole(body, "body", "give the name or number of a body", error=SceneError), None,
        )  # fmt: skip
        if only is not None:
            if link not in (-1, "all"):
                raise SceneError(f"link is {quote(link)}", "leave it out: a geom of the world is one thing")
            return 0, (only,)
        if not 0 <= number < self.model.nbody:
            raise SceneError(f"body is {quote(body)}", f"give a name, or a number below {self.model.nbody}")
        if isinstance(link, str) and link == "all":
            return number, self._all_of(number)
        if isinstance(link, str):
            return number, (self._link_named(number, link),)
        one = as_whole(link, "link", 'give -1, the body itself, a number or name, or "all"', error=SceneError)
        if number == 0 and one == -1:
            only_one = self._all_of(0)
            if len(only_one) > 1:
                raise SceneError("link is -1, and the world has several geoms", "give the name of one of them")
            one = only_one[0]
        self.row(number, one)
        return number, (one,)

    def _named(self, name: str) -> tuple[int, int | None]:
        """Find a body, or a geom of the world, of that name."""
        body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body > 0:
            return body, None
        geom = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, name)
        if geom >= 0 and self.model.geom_bodyid[geom] == 0:
            return 0, geom
        known = [self.name(*one) for one in zip(self.body.tolist(), self.geom.tolist(), strict=True)]
        raise SceneError(f"no body is called {quote(name)}", nearest(name, known))

    def _all_of(self, body: int) -> tuple[int, ...]:
        """List the links with colliding geoms of a body and those below it; raises MeshError."""
        seen = set(np.asarray(self.model.geom_bodyid)[self.colliding].tolist())
        if body == 0:
            links = [geom for geom in self.geom[self.body == 0].tolist() if self.colliding[geom]]
        else:
            links = [one - body - 1 for one in range(body, body + 1 + self._below(body)) if one in seen]
        if not links:
            raise MeshError(f"link is 'all', but nothing of body {body} can touch", "add a link with mesh=")
        return tuple(links)

    def _link_named(self, body: int, name: str) -> int:
        links = range(-1, self._below(body)) if body else self.geom[self.body == 0].tolist()
        names = {self.name(*self.own(body, link)): link for link in links}
        if name not in names:
            raise SceneError(
                f"link is {quote(name)}, and body {body} has none of that name", nearest(name, list(names))
            )
        return names[name]

    def _below(self, body: int) -> int:
        """Count the bodies below one, which follow it in MuJoCo's order."""
        parent, last = np.asarray(self.model.body_parentid), body
        while last + 1 < self.model.nbody and parent[last + 1] >= body:
            last += 1
        return last - body

    def name(self, body: int, link: int) -> str:
        """Return a link's own name; "body 2" or "geom 3" without any."""
        kind, number, word = (
            (mujoco.mjtObj.mjOBJ_BODY, body, "body") if body else (mujoco.mjtObj.mjOBJ_GEOM, link, "geom")
        )
        return mujoco.mj_id2name(self.model, kind, number) or f"{word} {number}"

    def describe(self, body: int, link: int) -> Body:
        """Return the silent record of a link; raises SceneError."""
        model, row = self.model, self.row(body, link)
        number, of_world = int(self.body[row]), int(self.geom[row])
        mass, inertia = (0.0, np.zeros(3)) if self.roster.static[row] else _mass_of(model, number)
        geom = of_world if number == 0 else int(np.flatnonzero(np.asarray(model.geom_bodyid) == number)[0])
        friction, solref = model.geom_friction[geom], model.geom_solref[geom]
        dynamics = {"mass": mass, "sliding": friction[0], "torsional": friction[1], "rolling": friction[2]}
        dynamics |= {"solref_0": solref[0], "solref_1": solref[1]}
        try:
            shapes: tuple[Shape, ...] = self.shapes(body, link)
        except MeshError:
            shapes = ()
        return Body(
            number, of_world if number == 0 else -1, 0, self.name(number, of_world), mass, np.diag(inertia),
            curvature_per_m=only_curvature(shapes), dynamics={name: float(x) for name, x in dynamics.items()},
            flat_faces_m=flat_faces(shapes if mass == 0 else ()),
        )  # fmt: skip

    def shapes(self, body: int, link: int) -> tuple[Shape, ...]:
        """Return the geometry of a link in its frame: what collides, or all where nothing does; raises MeshError."""
        row = self.row(body, link)
        mine = np.flatnonzero(self.row_of_geom == row)
        touching = mine[self.colliding[mine]]
        geoms = touching if len(touching) else mine
        number = int(self.body[row])
        if number == 0:
            return (shape_of_geom(self.model, int(geoms[0]), np.zeros(3), np.array([1.0, 0, 0, 0]), placed=False),)
        place, turn = self.model.body_ipos[number], self.model.body_iquat[number]
        return tuple(shape_of_geom(self.model, int(geom), place, turn) for geom in geoms)


def _mass_of(model: Any, body: int) -> tuple[float, Array]:
    """Return mass and principal inertia of a moving body; of the body it is welded to where it has no mass itself."""
    if model.body_mass[body] == 0:
        body = int(model.body_weldid[body])
    return float(model.body_mass[body]), np.array(model.body_inertia[body])
