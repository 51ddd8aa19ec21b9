"""Options of `fit`, `residual` and `diagnose`: recorded strikes, one or a case of them, to what is known of a thing."""

from __future__ import annotations

from dataclasses import dataclass, field

from sonic_bullet.options.option import Options, group, option, require_option
from sonic_bullet.options.render import Point, json_option

SENSORS, MEDIA = ("sum", "pressure", "velocity"), ("air", "none", "unknown")


def channel_option() -> int | None:
    """Make the field of --channel, alike in all commands that read recordings."""
    return option(
        None,
        "Which channel of a file of several, counted from 0.",
        "--channel",
        metavar="N",
        least=0,
        unset="the first, 0",
    )


def csv_option() -> str | None:
    """Make the field of --csv."""
    return option(
        None, "Also write the lines: frequency, decay, T60, η and Q with their spreads.", "--csv", metavar="NAME.csv"
    )


def uff_option() -> str | None:
    """Make the field of --uff."""
    return option(
        None,
        "Also write modal shapes at points, with frequency and damping, as a UFF file (dataset 55). Extra: uff.",
        "--uff",
        metavar="NAME.uff",
    )


def guess_option() -> str | None:
    """Make the field of the material that is near what was struck."""
    return option(
        None,
        "A name ('sonic-bullet materials') or a preset file: E and density good to 30 %.",
        "--material",
        metavar="GUESS",
    )


def sensor_at_option() -> Point | None:
    """Make the field of the place of a sensor on a surface."""
    return option(None, "Where the surface was measured, in m, for --sensor velocity.", "--sensor-at", metavar="X,Y,Z")


def sensor_direction_option() -> Point | None:
    """Make the field of the direction of a sensor on a surface."""
    return option(
        None, "Along which, for --sensor velocity.", "--sensor-direction", metavar="X,Y,Z", unset="out of the surface"
    )


def medium_option() -> str | None:
    """Make the field of what a thing rang in."""
    return option(
        None,
        "What it rang in: 'none' loses nothing to radiation, 'unknown' leaves it open.",
        "--medium",
        choices=MEDIA,
        unset="air; with --sensor sum unknown",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StrikeOptions(Options):
    """One recorded strike, as a case describes it."""

    mesh: str | None = option(None, "Mesh of what was struck; needs --strike and --material.", metavar="M")
    strike: Point | None = option(None, "Where it was struck, in m, mesh frame.", metavar="X,Y,Z")
    direction: Point | None = option(None, "Direction of the impulse.", metavar="X,Y,Z", unset="into the surface")
    impulse: float | None = option(
        None, "Impulse in N·s; without it sigma stands for gain times impulse.", metavar="J", above=0
    )
    material: str | None = guess_option()
    scale: float | None = option(None, "Metres per mesh unit: 0.001 for a mesh in millimetres.", metavar="S", unset="1")
    sensor: str | None = option(
        None, "What was recorded: plain sum of modes, a microphone, a surface.", choices=SENSORS, unset="pressure"
    )
    sensor_at: Point | None = sensor_at_option()
    sensor_direction: Point | None = sensor_direction_option()
    onset_s: float | None = option(
        None, "When the impulse arrives, in s.", "--onset", metavar="S", least=0, unset="found"
    )
    fixed: tuple[tuple[float, float, float, float], ...] = option(
        (), "Clamp all within R of a point, in m, mesh frame.", "--fix", metavar="X,Y,Z,R"
    )
    channel: int | None = channel_option()
    medium: str | None = medium_option()


@dataclass(frozen=True, slots=True, kw_only=True)
class ManyOptions(Options):
    """Several cases."""

    workers: int | None = option(None, "Processes at once.", metavar="N", least=1, most=1024, unset="one a core")
    scheduler: str | None = option(None, "Of a Dask cluster whose workers do the cases.", metavar="tcp://HOST:PORT")
    limit_s: float | None = option(
        None, "Wall time in s that each may take.", "--limit", metavar="S", above=0, unset="3600"
    )

    @property
    def given(self) -> bool:
        """Whether any of them was given."""
        return self != ManyOptions()


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions(Options):
    """Outputs."""

    output: str = field(
        metadata=require_option(
            "The fitted material as a preset file; of several cases a folder, with a folder each.",
            "-o",
            "--output",
            metavar="PRESET.json|DIR",
        )
    )
    tolerance_percent: float | None = option(
        None,
        "Standard error of the mesh's dimensions, twice in the spread of E/density; 0: of the lines alone.",
        "--dimension-tolerance",
        metavar="PERCENT",
        unset="the case's, or 0.5",
    )
    picture: str | None = option(
        None, "Also draw recording, synthesis, features and the fitted circle.", metavar="NAME.png"
    )
    page: str | None = option(
        None,
        "Also write a page on which guess and fit are struck where the takes were, beside them, as loud.",
        metavar="NAME.html",
    )
    csv_to: str | None = csv_option()
    uff_to: str | None = uff_option()
    json_to: str | None = json_option()
    strike: StrikeOptions = group(StrikeOptions)
    many: ManyOptions = group(ManyOptions)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualOptions(Options):
    """Outputs."""

    output: str = field(
        metadata=require_option(
            "The material, fitted where there is a shape, with its residual as a preset file.",
            "-o",
            "--output",
            metavar="PRESET.json",
        )
    )
    picture: str | None = option(
        None, "Also draw what was recorded, features, what is synthesised, represented, and left.", metavar="NAME.png"
    )
    json_to: str | None = json_option()
    strike: StrikeOptions = group(StrikeOptions)


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnoseOptions(Options):
    """Outputs."""

    output: str | None = option(
        None,
        "The fitted material, with the effects that belong to it and its object, as a preset file; of several cases a "
        "folder, with a folder each.",
        "-o",
        "--output",
        metavar="PRESET.json|DIR",
    )
    json_to: str | None = json_option()
    predict: str | None = option(
        None,
        "Also write every strike as it is predicted, to DIR/before and DIR/after, whether its audio is there or not.",
        metavar="DIR",
    )
    report: str | None = option(
        None,
        "Also write one page that opens offline: bodies to strike before and after, players, evidence, the verdict.",
        metavar="OUT.html",
    )
    propose: bool = option(
        False,
        "Also propose the strike that would separate the two best models that are still open most, and by how much.",
        "--next",
    )
    seed: int = option(0, "Seed of what is left out in turn, and of the null effects.", least=0)
    many: ManyOptions = group(ManyOptions)
