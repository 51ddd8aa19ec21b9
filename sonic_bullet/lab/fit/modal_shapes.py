"""A fit as modal analysis writes it: shapes at points with frequency and decay, and the responses that they make.

mesh, E/ρ known   φ (v, 3, m) of the modes in the band, at 1 kg, corrected frequencies, fitted decays
lines alone       φ_s = Re(A_s e^{−iχ})/J_s · e_s at the strikes s of known place, 2χ = arg Σ A²
Y(f) = ½ Σ ψ [s/(iω − p) + s*/(iω − p*)],  ψ = σ φ(p)·e φ(q)·n                              [observation.py]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.files.uff.impulse_response import UFF_BAND_OF_HIGHEST
from sonic_bullet.files.uff.reader import Freedom, Point
from sonic_bullet.files.uff.writer import Mobility, ModalShapes
from sonic_bullet.lab.fit.case_fit import CaseFit, ObjectFit
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError


def modal_shapes(found: CaseFit) -> ModalShapes:
    """Return the modes of a fit's first object at points: on its surface where E/ρ is known, else at its strikes.

    Raises FileError where neither a shape nor a strike's place and direction is known.
    """
    if found.objects and np.isfinite(found.fit.covariance[2, 2]):
        return _of_surface(found, found.objects[0])
    return _of_strikes(found.case.name, found.evidence[0])


def _of_surface(found: CaseFit, o: ObjectFit) -> ModalShapes:
    """Shapes at 1 kg at the surface's vertices; modes that count as one have one frequency."""
    family, seen = o.evidence.family, o.evidence.seen
    assert family is not None and seen is not None
    which = np.concatenate([*o.member, np.zeros(0, int)]).astype(int)
    group = np.repeat(np.arange(len(o.member)), [len(m) for m in o.member])
    vector = family.modes(found.fit.gamma_m2_s2, found.fit.poisson_ratio)[1][:, which]
    shape = np.einsum("vxb,bm->vxm", family.skin.astype(float), vector) * np.sqrt(seen.scale_per_kg)
    words = [f"a line at {f:.6g} Hz" if np.isfinite(f) else "predicted, no line" for f in o.measured_hz[group]]
    return ModalShapes(
        family.vertex_m, shape, o.freq_hz[group], o.decay_per_s[group], 1.0, found.case.name, tuple(words)
    )


def _of_strikes(name: str, e: RecordedObject) -> ModalShapes:
    """Shapes at the strikes of known place and direction, along that direction. Raises FileError where none is."""
    known = [
        (s, r.position_m, r.direction, r.impulse_n_s or 1.0)
        for s, r in enumerate(e.recordings)
        if r.position_m is not None and r.direction is not None
    ]
    if not known or not len(e.lines.freq_hz):
        raise FileError(
            f"{name} has no modal shapes: neither E/ρ nor the place and direction of a strike is known",
            "give strike.position and strike.direction, or a mesh whose modes the lines are; or leave --uff out",
        )
    amplitude = e.lines.amplitude[[s for s, *_ in known]]
    real = np.real(amplitude * np.exp(-0.5j * np.angle((amplitude**2).sum(axis=0))))
    unit = np.array([direction for _, _, direction, _ in known])
    impulse = np.array([j for *_, j in known])
    shape = unit[:, :, None] * (real / impulse[:, None])[:, None, :]
    point = np.array([position for _, position, _, _ in known])
    return ModalShapes(point, shape, e.lines.freq_hz, e.lines.decay_per_s, 0.0, name)


def mobilities(found: CaseFit, shapes: ModalShapes) -> tuple[Mobility, ...]:
    """Predict velocity per force between the places of the first object's strikes and its sensor.

    None where a place, an impulse or the gain is not known, or a direction lies along no axis.
    """
    step_hz = 1.0
    if not found.objects or not found.plays_modes(found.objects[0].evidence) or found.case.sensor != "velocity":
        return ()
    o = found.objects[0]
    name = o.evidence.thing.name
    place, along = ((by_object or {}).get(name) for by_object in (found.case.sensor_m, found.case.sensor_direction))
    if place is None or along is None or (axis := _axis(along)) is None:
        return ()
    first = len(shapes.point_m) + 1
    sensor = Freedom(first, axis, place)
    at_hz = step_hz * np.arange(int(found.case.band_hz[1] / UFF_BAND_OF_HIGHEST / step_hz) + 2)
    return tuple(
        Mobility(_mobility(found, o, s, r, at_hz), step_hz, Freedom(first + 1 + s, struck, r.position_m), sensor)
        for s, r in enumerate(o.evidence.recordings)
        if r.position_m is not None
        and r.impulse_n_s is not None
        and r.direction is not None
        and (struck := _axis(r.direction)) is not None
    )


def _mobility(found: CaseFit, o: ObjectFit, s: int, recording: CaseRecording, at_hz: Array) -> Array:
    """Y (n,) of strike s."""
    assert o.evidence.seen is not None and recording.impulse_n_s is not None
    start = o.evidence.seen.start(o.freq_hz, o.decay_per_s)
    weight = 0.5 * found.fit.sigma * o.pattern[s] / recording.impulse_n_s * start
    pole = -o.decay_per_s + 2j * np.pi * o.freq_hz
    made = np.zeros(len(at_hz), complex)
    for a, p in zip(weight, pole, strict=True):
        made += a / (2j * np.pi * at_hz - p) + np.conj(a) / (2j * np.pi * at_hz - np.conj(p))
    return made


def _axis(direction: Point) -> int | None:
    """±1, ±2 or ±3 of a direction along an axis, else None."""
    along = 1e-3  # of a direction: how far off an axis it still is one
    unit = np.array(direction) / np.linalg.norm(direction)
    k = int(np.argmax(np.abs(unit)))
    return (k + 1) * int(np.sign(unit[k])) if abs(abs(unit[k]) - 1) < along else None
