"""Objects of a diagnosis: the mesh's own modes at the fitted material, at the strikes and the sensor.

    Family at (γ, ν) -> λ (m,), shapes on the skin and at every strike and the sensor, as last "vertices" of one
        ModalModel

An effect on the modes then changes strikes and sensor with the body. A sensor without a place (microphone, plain sum)
is a last vertex whose x component is each mode's weight. Without a mesh, or without a place, the modes are the lines of
`fit`, with their own decays and phases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonic_bullet.files.cases import Case, CaseRecording
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.lab.effects.evidence import Elastic, Poisson
from sonic_bullet.lab.fit.case_fit import POISSON_GUESS_SD, CaseFit, ObjectFit
from sonic_bullet.lab.fit.observation import direction_at
from sonic_bullet.lab.fit.radiation_share import into_air
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.fit.recorded import body_family, guess_of
from sonic_bullet.lab.fit.typical_strike import select_ringing, strike_lines
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True, slots=True, eq=False)
class StruckBody:
    """One object and all its strikes.

    Attributes
    ----------
    name : str
        The object.
    recordings : tuple of CaseRecording
        Its strikes.
    model : ModalModel
        Undamped, uncorrected; its last s + 1 vertices are the strikes and the sensor.
    direction : (s + 1, 3)
        Directions there, zero for a strike of unknown place.
    impulse_n_s : (s,)
        NaN where unknown.
    kind : str
        `Case.sensor`, or "lines".
    family : Family
        For other elasticities; None without a mesh.
    correction : (m,)
        Of each mode's frequency, relative, learnt on its fitted strikes, else 0.
    line : (m,)
        Fitted line that a mode was paired with, or -1.
    recorded : RecordedObject
        Its fitted lines and sounds; None for an object that was not fitted.
    elastic : Elastic
        Under any elasticity, see elastic_bodies.py.
    band_hz : (2,)
        Nothing outside it is recorded, though its modes are in the model: a mesh may have put them there.
    other : callable
        ν -> the model there, of as many modes.
    poisson : Poisson
        The same, cheap, for a search.
    own_decay_per_s : (m,)
        In place of a law of the material; None where the model has them.
    own_phase : (s, m)
        Of the modes at the onset, of magnitude 1; None where the model has them.
    radiated_per_s : (m,)
        What the modes lose to the air, computed of this body's own surface; None where nothing is known of the medium,
        or nothing is lost to it.
    relative : (s,)
        Impulses that are not known, over the mean of those; else 1.
    rise_s : (s,)
        From the onset to the first peak, until which the contact drives the lines; None where none is known.
    """

    name: str
    recordings: tuple[CaseRecording, ...]
    model: ModalModel
    direction: Array
    impulse_n_s: Array
    kind: str
    family: Family | None
    correction: Array
    line: Array
    recorded: Recorded | None
    elastic: Elastic | None = None
    band_hz: tuple[float, float] = (0.0, float("inf"))
    other: Callable[[float], ModalModel] | None = None
    poisson: Poisson | None = None
    own_decay_per_s: Array | None = None
    own_phase: Array | None = None
    radiated_per_s: Array | None = None
    relative: Array | None = None
    rise_s: Array | None = None

    @property
    def level_n_s(self) -> Array:
        """Return impulses (s,); relative ones, about 1, of strikes of unknown impulse."""
        rest = np.ones(self.strikes) if self.relative is None else self.relative
        return np.where(np.isfinite(self.impulse_n_s), self.impulse_n_s, rest)

    @property
    def strikes(self) -> int:
        """Return the number of strikes."""
        return len(self.recordings)

    @property
    def fitted(self) -> list[int]:
        """Return the indices of the recordings that its lines and sounds belong to, in their order.

        They are those of the split 'fit' that could be read.
        """
        observed = self.recorded.recordings if self.recorded is not None else ()
        return [i for one in observed for i, r in enumerate(self.recordings) if r is one or r == one]

    def surface_count(self, model: ModalModel | None = None) -> int:
        """Count the vertices of its model, or of another of its models, that are the body's."""
        return len((model or self.model).vertex_m) - self.strikes - 1


def struck_bodies(found: CaseFit, *, cache: Place = "default") -> tuple[StruckBody, ...]:
    """Build every object of the case, fitted ones first. Raises SonicBulletError."""
    case = found.case
    by_name = {o.evidence.thing.name: o for o in found.objects}
    made = [_build_fitted(found, o) for o in found.objects]
    for name in dict.fromkeys(r.object for r in case.recordings):
        if name in by_name or not case.objects:
            continue
        thing = case.objects[name]
        guess = guess_of(thing)
        if thing.mesh is None or not found.objects:
            continue
        family = body_family(case, thing, guess, cache)
        made.append(_build_placed(found, name, family, guess.density_kg_m3, None))
    return tuple(made)


def _build_fitted(found: CaseFit, o: ObjectFit) -> StruckBody:
    """Build a fitted object."""
    assert o.evidence.family is not None
    return _build_placed(found, o.evidence.thing.name, o.evidence.family, o.evidence.guess.density_kg_m3, o)


def _build_placed(found: CaseFit, name: str, family: Family, density: float, o: ObjectFit | None) -> StruckBody:
    """Build an object with a mesh."""
    case = found.case
    mine = tuple(r for r in case.recordings if r.object == name)
    value, vector = family.modes(found.fit.gamma_m2_s2, found.fit.poisson_ratio)
    keep = np.flatnonzero(np.sqrt(value) / (2 * np.pi) < 1.02 * case.band_hz[1])
    value, vector = value[keep], vector[:, keep]
    correction, line = np.zeros(len(keep)), np.full(len(keep), -1)
    if o is not None:
        for ratio, at, who in zip(o.correction, o.line, o.member, strict=True):
            inside = who[who < len(keep)]
            line[inside] = at
            if at >= 0:  # modes that one line stands for are one frequency, whatever the mesh made of them
                member = np.sqrt(value[inside])
                correction[inside] = (1 + ratio) * np.exp(np.log(member).mean()) / member - 1
    weight, radiated = None, None
    if case.sensor == "pressure" or found.radiation == "apart":
        weight, radiated = into_air(family, density, np.sqrt(value) / (2 * np.pi), vector)
    model, direction = modal_model(case, name, mine, family, density, value, vector, weight)
    impulse = np.array([np.nan if r.impulse_n_s is None else r.impulse_n_s for r in mine])

    def lowest(poisson: float) -> tuple[Array, Array]:
        lam, turned = family.modes(found.fit.gamma_m2_s2, poisson)
        return lam[: len(keep)], turned[:, : len(keep)]

    @lru_cache(maxsize=2)
    def other(poisson: float) -> ModalModel:
        return modal_model(case, name, mine, family, density, *lowest(poisson))[0]

    def sums(poisson: float) -> tuple[Array, Array]:
        lam, turned = lowest(poisson)
        return np.sqrt(lam) / (2 * np.pi), vector.T @ turned

    nu = Poisson(found.fit.poisson_ratio, guess_of(case.objects[name]).poisson, POISSON_GUESS_SD, sums)
    recorded = o.evidence if o is not None else None
    return StruckBody(
        name,
        mine,
        model,
        direction,
        impulse,
        case.sensor,
        family,
        correction,
        line,
        recorded,
        band_hz=case.band_hz,
        other=other,
        poisson=nu,
        radiated_per_s=radiated if found.radiation == "apart" else None,
    )


def modal_model(
    case: Case,
    name: str,
    recordings: tuple[CaseRecording, ...],
    family: Family,
    density: float,
    value: Array,
    vector: Array,
    weight: Array | None = None,
) -> tuple[ModalModel, Array]:
    """Build an undamped model with strikes and sensor as last vertices. Raises MeshError.

    Parameters
    ----------
    case : Case
        The case.
    name : str
        The object.
    recordings : tuple of CaseRecording
        Its strikes.
    family : Family
        Its modes' basis.
    density : float
        In kg/m³.
    value, vector : (m,), (b, m)
        λ of the modes and their coefficients.
    weight : (m,)
        How loud a microphone hears them, where it has been computed.

    Returns
    -------
    ModalModel, (s + 1, 3)
        The model, and the directions of strikes and sensor.
    """
    scale = np.sqrt(density * family.length_m**3)
    axes = np.eye(3)
    extra, direction, place = [], [], []
    at, normal = (None if spots is None else spots.get(name) for spots in (case.sensor_m, case.sensor_direction))
    wanted = [(r.position_m, r.direction) for r in recordings] + ([(at, normal)] if case.sensor == "velocity" else [])
    for position, along in wanted:
        if position is None:
            extra.append(np.zeros((3, len(value))))
            direction.append(np.zeros(3))
            place.append(np.zeros(3))
            continue
        rows, _ = family.points(np.tile(position, (3, 1)), axes)
        extra.append(rows @ vector / scale)
        direction.append(direction_at(family, position, along, inward=True))
        place.append(np.array(position, float))
    freq = np.sqrt(value) / (2 * np.pi)
    if case.sensor != "velocity":
        loud = np.ones(len(freq))
        if case.sensor == "pressure":
            loud = into_air(family, density, freq, vector)[0] if weight is None else weight
        extra.append(np.stack([loud, 0 * loud, 0 * loud]))
        direction.append(axes[0])
        place.append(family.vertex_m.mean(axis=0))
    skin = np.einsum("vxb,bm->vxm", family.skin, vector.astype(np.float32)) / np.float32(scale)
    flat = np.zeros(len(family.face))
    mass = family.volume_m3 * density
    model = ModalModel(
        freq,
        np.zeros(len(freq)),
        np.concatenate([skin, np.array(extra, np.float32)]),
        np.concatenate([family.vertex_m, np.array(place)]),
        family.face,
        flat,
        family.volume_m3,
        mass,
        note=family.note,
    )
    return model, np.array(direction)


def shapeless(found: CaseFit, recorded: Recorded) -> StruckBody:
    """Build an object of unknown shape, or of unknown places of its strikes; see `strike_lines`.

    The lines of `fit` are its modes, with amplitudes and phases of the mean strike at each place, so that no effect can
    explain what depends on the place. Of a list of lines all are modes, of unknown phase.
    """
    lines, listed = recorded.lines, recorded.signals is None
    mine = tuple(r for r in found.case.recordings if r.object == recorded.recordings[0].object)
    line = np.arange(len(lines.freq_hz)) if listed else select_ringing(lines)
    undamped = np.hypot(2 * np.pi * lines.freq_hz, np.nan_to_num(lines.decay_per_s)) / (2 * np.pi)
    line = line[np.argsort(undamped[line], kind="stable")]
    place = np.argsort(np.argsort(lines.freq_hz[line], kind="stable"))  # of a line among those by frequency
    amplitude, known = np.ones((len(mine), len(line)), complex), np.zeros(len(mine), bool)
    rise_s = np.zeros(len(mine))
    for i, r in enumerate(mine):
        if listed:
            amplitude[i] = np.sqrt(np.nanmean(np.abs(lines.amplitude[:, line]) ** 2, axis=0))
        else:
            typical, known[i] = strike_lines(recorded, r)
            amplitude[i], rise_s[i] = typical.amplitude[place], typical.rise_s
    weight = np.sqrt((np.abs(amplitude) ** 2).mean(axis=0))
    shape = np.zeros((len(mine) + 1, 3, len(line)), np.float32)
    shape[:-1, 0] = np.nan_to_num(np.abs(amplitude) / np.maximum(weight, 1e-300))
    shape[-1, 0] = weight
    empty = np.zeros((0, 3))
    model = ModalModel(
        undamped[line],
        np.zeros(len(line)),
        shape,
        np.zeros((len(shape), 3)),
        empty,
        np.zeros(0),
        0.0,
        0.0,
        note="no mesh",
    )
    return StruckBody(
        recorded.thing.name,
        mine,
        model,
        np.tile([1.0, 0, 0], (len(mine) + 1, 1)),
        np.array([r.impulse_n_s if k and r.impulse_n_s else np.nan for r, k in zip(mine, known, strict=True)]),
        "lines",
        None,
        np.zeros(len(line)),
        line,
        recorded,
        band_hz=found.case.band_hz,
        own_decay_per_s=None if listed else lines.decay_per_s[line],
        own_phase=None if listed else np.exp(1j * np.angle(amplitude)),
        rise_s=rise_s if rise_s.any() else None,
    )
