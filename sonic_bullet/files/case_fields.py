"""Records of case.json: the fields that msgspec decodes, what each means, and its bounds.

cases.py makes a `cases.Case` of them, and of their descriptions come `sonic-bullet case schema` and
docs/reference/case.md.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

CASE_FORMAT = "sonic-bullet-case/1"
LARGEST_NUMBER = 1e6  # metres, or N·s: no place, size or impulse is larger, and squares of such numbers stay finite
Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Magnitude = Annotated[float, Meta(ge=-1e12, le=1e12)]
Hertz = Annotated[float, Meta(le=1e7)]
NotNegative = Annotated[float, Meta(ge=0, le=1e7)]
Channel = Annotated[int, Meta(ge=0, le=4096)]
Unit = Literal["m", "cm", "mm"]
Split = Literal["fit", "holdout", "transfer"]
Vector = tuple[Number, Number, Number]


class ElasticGuess(msgspec.Struct, frozen=True):
    """Guessed constants; what is absent is the named material's."""

    youngs_modulus: Annotated[Annotated[float, Meta(gt=0, lt=1e16)] | None, Meta(description="Pa")] = None
    density: Annotated[
        Annotated[float, Meta(ge=1e-3, le=LARGEST_NUMBER)] | None,
        Meta(description="kg/m³; a fit cannot tell it from E, so it stays as given"),
    ] = None
    poisson_ratio: Annotated[
        Annotated[float, Meta(gt=-0.99, lt=0.5)] | None, Meta(description="between -1 and 0.5")
    ] = None


class Object(msgspec.Struct, frozen=True):
    """One object: its shape and what it is guessed to be made of."""

    mesh: Annotated[
        str | None,
        Meta(
            description="file inside the folder, any mesh that trimesh reads; without it nothing is known of the shape"
        ),
    ] = None
    units: Annotated[Unit, Meta(description="of the mesh: m, cm or mm")] = "m"
    material: Annotated[str | None, Meta(description="a name that `sonic-bullet materials` lists, as a guess")] = None
    elastic_guess: Annotated[ElasticGuess, Meta(description="in SI units, good to 30 %")] = ElasticGuess()
    dimension_tolerance: Annotated[
        float | None,
        Meta(
            description="of the mesh's dimensions, relative, one standard deviation, 0 to 0.2; absent: "
            "the case's. It enters the spread of E/ρ twice, and that of ν"
        ),
    ] = None


class Fixed(msgspec.Struct, frozen=True):
    """A clamp: all vertices within a radius of a point stand still."""

    position: Annotated[Vector, Meta(description="m, mesh frame")]
    radius: Annotated[float, Meta(ge=0, le=LARGEST_NUMBER, description="m")] = 0.0
    object: Annotated[str | None, Meta(description="whose; absent: every object's")] = None


class Support(msgspec.Struct, frozen=True):
    """How the objects were held."""

    fixed: Annotated[tuple[Fixed, ...], Meta(description="clamps; none: the objects are free")] = ()


class Sensor(msgspec.Struct, frozen=True):
    """What recorded the strikes. Places and directions are one for all objects, or one for each by its name."""

    type: Annotated[str, Meta(description="in words; read where `response` says nothing")] = ""
    response: Annotated[
        str,
        Meta(description="`velocity` of a surface, `pressure` or `sum of modes`, as a word in any text; else unknown"),
    ] = ""
    position: Annotated[
        dict[str, Vector] | Vector | None,
        Meta(description="m, mesh frame: where a surface's velocity was measured"),
    ] = None
    direction: Annotated[
        dict[str, Vector] | Vector | None, Meta(description="along which; absent: out of the surface")
    ] = None


class Force(msgspec.Struct, frozen=True):
    """The force of an instrumented hammer."""

    file: Annotated[str, Meta(description="audio file inside the folder")]
    channel: Annotated[Channel, Meta(description="from 0")] = 0
    newton_per_unit: Annotated[Magnitude | None, Meta(description="N per unit of the file")] = None


class Strike(msgspec.Struct, frozen=True):
    """Where and how hard an object was struck."""

    position: Annotated[Vector | None, Meta(description="m, mesh frame, on the surface")] = None
    direction: Annotated[Vector | None, Meta(description="of the impulse, any length; absent: into the surface")] = None
    impulse: Annotated[
        Annotated[float, Meta(ge=1e-12, le=LARGEST_NUMBER)] | None,
        Meta(description="N·s, above zero; without any, σ stands for gain times impulse"),
    ] = None
    force: Annotated[Force | None, Meta(description="its recorded force")] = None


class Line(msgspec.Struct, frozen=True):
    """A measured resonance: freq_hz, and what else was measured of it."""

    freq_hz: Annotated[float, Meta(gt=0, le=1e7, description="Hz, above zero")]
    decay_per_s: Annotated[NotNegative | None, Meta(description="d in e^(−dt), 1/s")] = None
    freq_sd_hz: Annotated[Hertz | None, Meta(description="standard error, Hz; absent: 10⁻⁴ of the frequency")] = None
    decay_sd_per_s: Annotated[Hertz | None, Meta(description="standard error, 1/s; absent: 5 % of the decay")] = None
    amplitude: Annotated[Magnitude | None, Meta(description="at the onset, any unit")] = None


class Recording(msgspec.Struct, frozen=True):
    """One strike, as an audio file or as a list of measured resonances."""

    file: Annotated[str | None, Meta(description="audio file inside the folder")] = None
    features: Annotated[tuple[Line, ...] | None, Meta(description="measured resonances, in place of a file")] = None
    object: Annotated[str | None, Meta(description="name of a listed object; may be left out where there is one")] = (
        None
    )
    split: Annotated[
        Split, Meta(description="`fit`, `holdout` or `transfer`; only `fit` is opened before a verdict stands")
    ] = "fit"
    strike: Annotated[Strike, Meta(description="where and how hard")] = Strike()
    channel: Annotated[
        Channel | None,
        Meta(description="of the file, from 0; absent: the first that is not dead, and a line says so"),
    ] = None
    state: Annotated[
        str | None,
        Meta(
            description="name of the state that the object was in, where it was recorded in several: `states` says "
            "what changed"
        ),
    ] = None


class CaseFile(msgspec.Struct, frozen=True):
    """A case: recorded strikes of known objects. What is not declared is null or absent."""

    format: Annotated[str, Meta(description=f"`{CASE_FORMAT}`")]
    recordings: Annotated[tuple[Recording, ...], Meta(description="at least one")]
    objects: Annotated[dict[str, Object], Meta(description="by name")] = {}
    case: Annotated[str, Meta(description="a name; absent: the folder's")] = ""
    support: Annotated[Support | str | None, Meta(description="clamps, or words")] = None
    sensor: Annotated[Sensor | None, Meta(description="one for all recordings")] = None
    band_hz: Annotated[
        tuple[Hertz, Hertz] | None, Meta(description="Hz, what the recordings hold; absent: 20 to 20 000")
    ] = None
    onset: Annotated[
        str | Number | None,
        Meta(
            description="arrival of the impulse in every file: s, or words with `sample 0`; absent: found, phases not "
            "used"
        ),
    ] = None
    response_hz: Annotated[
        tuple[Hertz, Hertz] | None,
        Meta(
            description="Hz, from where to where frequency responses were measured: then each file is one "
            "period of a response to an impulse at sample 0, their inverse transform, as `case new` makes of UFF "
            "files; absent: they are recordings"
        ),
    ] = None
    medium: Annotated[
        str | None,
        Meta(
            description="`air`, `none` where nothing takes sound away, or `unknown`; absent: air for a microphone "
            "or a vibrometer"
        ),
    ] = None
    dimension_tolerance: Annotated[
        float | None, Meta(description="of its objects that do not say their own; absent: 0.005")
    ] = None
    states: Annotated[
        dict[str, Magnitude],
        Meta(description="numbers of states by name, as litres filled in, in the order of the states"),
    ] = {}
