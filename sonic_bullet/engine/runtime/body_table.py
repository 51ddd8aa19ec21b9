"""Table of the bodies for the compiled stages: a BODY row each, and flat arrays of what belongs to its model.

Resonator + lines of its residual -> BODY row;  its model -> FACE, NODE rows, shapes, frequencies, once for all
    bodies that share it
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.engine.bank.resonator import Resonator
from sonic_bullet.engine.bank.rigid_motion import rigid_shape
from sonic_bullet.engine.contact.coupling import ContactSide
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.engine.contact.pulse_shape import spectrum_table
from sonic_bullet.engine.runtime.tables import BODY, FACE, NODE, TURN
from sonic_bullet.geometry.nearest_point import SurfaceIndex
from sonic_bullet.records import Array, Body, Material
from sonic_bullet.records.roughness import ORDINARY_HURST, ORDINARY_ROUGHNESS_M, track_slopes
from sonic_bullet.records.touching.surface_form import SurfaceForm


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a model's arrays begin in the flat ones, and how many faces it and the surface that is touched have."""

    frequency_at: int
    shape_at: int
    face_at: int
    faces: int
    node_at: int
    wall_m: float
    tie_m: float
    touched_face_at: int = 0
    touched_faces: int = 0
    touched_node_at: int = 0
    touched_wall_m: float = 0.0
    touched_tie_m: float = 0.0


def _key(resonator: Resonator, follows: Array) -> Hashable:
    """Return what bodies that share arrays have in common; records are compared by identity."""
    return resonator.body.model, follows.tobytes(), resonator.rigid_columns


def _stand(row: Any, place: _Place) -> None:
    """Enter the place of a body's model into its BODY row."""
    row["wall_m"], row["tie_m"] = place.wall_m, place.tie_m
    row["frequency_at"], row["shape_at"] = place.frequency_at, place.shape_at
    row["face_at"], row["faces"], row["node_at"] = place.face_at, place.faces, place.node_at
    row["touched_face_at"], row["touched_faces"] = place.touched_face_at, place.touched_faces
    row["touched_node_at"] = place.touched_node_at
    row["touched_wall_m"], row["touched_tie_m"] = place.touched_wall_m, place.touched_tie_m


class _GrowingArray:
    """Array that is appended to and stays in one piece: its filled part is a view."""

    def __init__(self, dtype: np.dtype | type) -> None:
        self._all, self._count = np.zeros(1, dtype), 0

    @property
    def filled(self) -> Array:
        """View of the filled part."""
        return self._all[: self._count]

    def append(self, values: Array) -> int:
        """Append the values (k,) and return the place of the first."""
        self.reserve(len(values))
        at, self._count = self._count, self._count + len(values)
        self._all[at : self._count] = values
        return at

    def reserve(self, more: int) -> None:
        """Make room for so many values."""
        if self._count + more > len(self._all):
            grown = np.zeros(max(self._count + more, 2 * len(self._all)), self._all.dtype)
            grown[: self._count] = self._all[: self._count]
            self._all = grown


def pressed_pa(material: Material, side: ContactSide) -> float:
    """Compute E/(1 − ν²) where a material is touched: of its softest axis, for boards are pressed across the grain."""
    soft, usual = 1 / side.compliance_per_pa, material.plane_strain_pa
    return soft if soft < 0.99 * usual else usual  # bit-identical where no axis is softer


def surface_of(body: Body) -> tuple[float, float]:
    """Return rms height in m and Hurst exponent of a body's surface.

    A static body that was not added is like any floor; a moving one, of which nobody says what it is, is smooth.
    """
    if body.material is not None:
        return body.material.roughness_m, body.material.hurst
    return (ORDINARY_ROUGHNESS_M if body.mass_kg == 0 else 0.0), ORDINARY_HURST


class BodyTable:
    """Bodies (b,) of BODY; faces of FACE, nodes of NODE, shapes (float32) and frequencies in Hz, all flat.

    A body's row holds its places in them. `add` replaces the arrays, but not the places.
    """

    def __init__(self) -> None:
        self._bodies, self._faces, self._nodes = _GrowingArray(BODY), _GrowingArray(FACE), _GrowingArray(NODE)
        self._shapes, self._frequencies = _GrowingArray(np.float32), _GrowingArray(float)
        self._places: dict[Hashable, _Place] = {}
        self._turns = _GrowingArray(TURN)
        self._tracks, self._track_places = _GrowingArray(float), dict[SurfaceForm, tuple[int, int, float]]()

    @property
    def bodies(self) -> Array:
        """Rows of BODY (b,)."""
        return self._bodies.filled

    @property
    def faces(self) -> Array:
        """Rows of FACE."""
        return self._faces.filled

    @property
    def nodes(self) -> Array:
        """Rows of NODE."""
        return self._nodes.filled

    @property
    def shapes(self) -> Array:
        """Mode shapes, flat."""
        return self._shapes.filled

    @property
    def turns(self) -> Array:
        """Rows of TURN, as many for each body as it has pairs of modes that may turn; in use: those its row tells."""
        return self._turns.filled

    @property
    def frequency_hz(self) -> Array:
        """Frequencies of the modes, flat."""
        return self._frequencies.filled

    @property
    def spectrum(self) -> Array:
        """Spectra of both pulses."""
        return spectrum_table()

    @property
    def tracks(self) -> Array:
        """Slopes of measured tracks by octave, flat."""
        return self._tracks.filled

    @property
    def columns(self) -> int:
        """Most columns that a body has, 1 at least."""
        return int(self.bodies["columns"].max(initial=1))

    def reserve(self, bodies: Sequence[tuple[Resonator, Array]]) -> None:
        """Make room for the shapes of bodies that are to be added, with `follows`: they are copied once then."""
        sizes = {
            _key(one, follows): 3 * len(one.shape) * (one.mode_count + len(follows) + one.rigid_columns)
            for one, follows in bodies
            if one.index is not None
        }
        self._shapes.reserve(sum(size for key, size in sizes.items() if key not in self._places))

    def add(self, resonator: Resonator, follows: Array, surface_seed: int) -> int:
        """Add a body and return its index. follows (l,): the mode that each line of its residual is struck as."""
        never = -(1 << 40)  # number of a step that was long ago
        unknown_rebound = 0.7  # restitution of a body whose log does not give it; a pair's is 0.5 then
        # radius of a body's edges, as a fraction of its size: broken, as made things have them
        edge_radius_share, edge_radius_least_m = 0.005, 2e-4
        place = self._place(resonator, np.asarray(follows, np.int64))
        body = resonator.body
        material = body.material
        row = np.zeros(1, BODY)
        row["mass_kg"], row["inertia_kg_m2"] = body.mass_kg, body.inertia_kg_m2
        row["modulus_pa"] = np.inf if material is None else pressed_pa(material, resonator.side)
        row["restitution"] = np.inf if material is None else material.restitution
        row["roughness_m"], row["hurst"] = surface_of(body)
        given = None if material is None else material.octave_rms_m
        row["octave_rms_m"] = -1.0 if given is None else given
        self._enter_form(row, None if material is None else material.form)
        row["size_m"], row["volume_m3"] = resonator.size_m, body.volume_m3
        row["curvature_per_m"] = body.curvature_per_m
        row["edge_per_m"] = 1.0 / max(edge_radius_share * resonator.size_m, edge_radius_least_m)
        row["surface_seed"] = surface_seed
        row["rigid"] = resonator.translation is not None
        row["modes"] = resonator.mode_count
        row["columns"] = resonator.mode_count + len(follows) + resonator.rigid_columns
        _stand(row, place)
        # a silent partner's record begins where it first touches, not where it was put
        row["placed"] = -SPAN if material is None else body.since_step
        row["rebound"] = body.dynamics.get("restitution", unknown_rebound)
        row["loaded"] = row["cause_step"] = row["since_step"] = never
        row["turn_at"] = self._turns.append(np.zeros(len(resonator.mobility.pairs), TURN))
        return self._bodies.append(row)

    def _enter_form(self, row: Any, form: SurfaceForm | None) -> None:
        """Enter a surface's waves and track into its BODY row."""
        if form is None:
            return
        row["waviness_m"], row["waviness_length_m"] = form.waviness_m, form.waviness_length_m
        row["crest_per_m"] = form.crest_per_m
        if form.track_m is not None:
            place = self._track_places.get(form)
            if place is None:
                slopes, spacing_m = track_slopes(form.track_m, form.track_spacing_m)
                place = self._tracks.append(slopes.ravel()), slopes.shape[1], spacing_m
                self._track_places[form] = place
            row["track_at"], row["track_count"], row["track_spacing_m"] = place

    def copy(self) -> BodyTable:
        """Return a copy with its own bodies and their turns; what belongs to models is shared."""
        other = BodyTable()
        other._bodies.append(self.bodies)
        other._turns.append(self.turns)
        other._faces, other._nodes, other._shapes = self._faces, self._nodes, self._shapes
        other._frequencies, other._places = self._frequencies, dict(self._places)
        other._tracks, other._track_places = self._tracks, dict(self._track_places)
        return other

    def subset(self, keep: Array, kept: Sequence[tuple[Resonator, Array]]) -> BodyTable:
        """Return a table of only the bodies ``keep`` (k,), with their resonators and `follows`.

        What belongs to models is shared while half of it at least is theirs, else built anew.
        """
        other = BodyTable()
        other._bodies.append(self.bodies[keep])
        other._tracks, other._track_places = self._tracks, self._track_places
        for row, (one, _) in zip(other.bodies, kept, strict=True):
            first = int(row["turn_at"])
            row["turn_at"] = other._turns.append(self.turns[first : first + len(one.mobility.pairs)])
        keys = {_key(one, follows) for one, follows in kept}
        places = {key: place for key, place in self._places.items() if key in keys}
        if 2 * sum(place.faces + place.touched_faces for place in places.values()) >= len(self.faces):
            other._faces, other._nodes, other._shapes = self._faces, self._nodes, self._shapes
            other._frequencies, other._places = self._frequencies, places
        else:
            for row, (one, follows) in zip(other.bodies, kept, strict=True):
                _stand(row, other._place(one, follows))
        return other

    def _place(self, resonator: Resonator, follows: Array) -> _Place:
        """Return the place of the arrays of the body's model, added if it is the first that has it."""
        nowhere = _Place(0, 0, 0, 0, 0, 0.0, 0.0)
        model, index = resonator.body.model, resonator.index
        if model is None or index is None:
            return nowhere
        key = _key(resonator, follows)
        place = self._places.get(key)
        if place is None:
            parts = [resonator.shape]
            if len(follows):
                parts.append(resonator.shape[:, :, follows])
            if resonator.rigid_columns:
                parts.append(rigid_shape(model.vertex_m))
            shape = np.concatenate(parts, axis=2) if len(parts) > 1 else resonator.shape
            touched = resonator.touched
            place = self._places[key] = _Place(
                self._frequencies.append(resonator.omega_rad_s / (2 * np.pi)),
                self._shapes.append(shape.ravel()),
                self._faces.append(index.faces),
                len(index.faces),
                self._nodes.append(index.nodes),
                index.wall_m,
                index.tie_m,
                *(() if touched is None else self._touched_place(touched)),
            )
        return place

    def _touched_place(self, touched: SurfaceIndex) -> tuple[int, int, int, float, float]:
        """Add the surface that a body is touched on, and return the fields of its place."""
        face_at, node_at = self._faces.append(touched.faces), self._nodes.append(touched.nodes)
        return face_at, len(touched.faces), node_at, touched.wall_m, touched.tie_m
