"""Fields of case.json as classes that msgspec decodes, with the bounds of each number.

case_schema.py describes each field, cases.py makes a `Case` of them.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

LARGEST_NUMBER = 1e6  # metres, or N·s: no place, size or impulse is larger, and squares of such numbers stay finite
Number = Annotated[float, msgspec.Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Magnitude = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
Hertz = Annotated[float, msgspec.Meta(le=1e7)]
Channel = Annotated[int, msgspec.Meta(le=4096)]
Vector = tuple[Number, Number, Number]


class ElasticFields(msgspec.Struct, frozen=True):
    """Estimated elastic constants."""

    youngs_modulus: float | None = None
    density: Annotated[float, msgspec.Meta(ge=1e-3, le=LARGEST_NUMBER)] | None = None
    poisson_ratio: float | None = None


class ObjectFields(msgspec.Struct, frozen=True):
    """One object."""

    mesh: str | None = None
    units: str = "m"
    material: str | None = None
    elastic_guess: ElasticFields = ElasticFields()
    dimension_tolerance: float | None = None


class FixedFields(msgspec.Struct, frozen=True):
    """A clamp."""

    position: Vector
    radius: Number = 0.0
    object: str | None = None


class SupportFields(msgspec.Struct, frozen=True):
    """Supports of the objects."""

    fixed: tuple[FixedFields, ...] = ()


class SensorFields(msgspec.Struct, frozen=True):
    """The sensor that recorded the strikes."""

    type: str = ""
    response: str = ""
    position: dict[str, Vector] | Vector | None = None
    direction: dict[str, Vector] | Vector | None = None


class ForceFields(msgspec.Struct, frozen=True):
    """Force signal of an instrumented hammer."""

    file: str
    channel: Channel = 0
    newton_per_unit: Magnitude | None = None


class StrikeFields(msgspec.Struct, frozen=True):
    """Position, direction and impulse of a strike."""

    position: Vector | None = None
    direction: Vector | None = None
    impulse: Annotated[float, msgspec.Meta(ge=1e-12, le=LARGEST_NUMBER)] | None = None
    force: ForceFields | None = None


class Line(msgspec.Struct, frozen=True):
    """A measured resonance: freq_hz, and the other quantities measured."""

    freq_hz: Hertz
    decay_per_s: Hertz | None = None
    freq_sd_hz: Hertz | None = None
    decay_sd_per_s: Hertz | None = None
    amplitude: Magnitude | None = None


class RecordingFields(msgspec.Struct, frozen=True):
    """One strike."""

    file: str | None = None
    features: tuple[Line, ...] | None = None
    object: str | None = None
    split: str = "fit"
    strike: StrikeFields = StrikeFields()
    channel: Channel | None = None
    state: str | None = None


class CaseFields(msgspec.Struct, frozen=True):
    """A whole case.json."""

    format: str
    recordings: tuple[RecordingFields, ...]
    objects: dict[str, ObjectFields] = {}
    case: str = ""
    support: SupportFields | str | None = None
    sensor: SensorFields | None = None
    band_hz: tuple[Hertz, Hertz] | None = None
    onset: str | Number | None = None
    response_hz: tuple[Hertz, Hertz] | None = None
    medium: str | None = None
    dimension_tolerance: float | None = None
    states: dict[str, Magnitude] = {}
