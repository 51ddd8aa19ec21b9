"""The command line: parses, calls, exits.

    render SCENE.py | LOG.npz -> RenderResult -> WAV, contact log, picture, JSON
    modes MESH                -> ModalModel   -> table, JSON, npz
    materials, doctor SCENE   -> table, JSON
    case FOLDER               -> case.json, and whether it can be read

Exit 0: done. 2: one line on stderr says what is wrong and how to mend it, and no file stands under its final name
half-written. 130 (Ctrl-C), 143 (terminated): what was rendered so far is closed as a valid file and named. With --json
and no path only JSON goes to stdout, whatever a scene prints. SONIC_BULLET_DEBUG=1 shows tracebacks. Everything heavy
is imported by the command that needs it.
"""

from __future__ import annotations

import io
import os
import signal
import sys
from typing import Any

import click

from sonic_bullet.cli.examples import (
    CASE_EPILOG,
    DIAGNOSE_EPILOG,
    FEATURES_EPILOG,
    FIT_EPILOG,
    GROUP_EPILOG,
    MODES_EPILOG,
    RENDER_EPILOG,
    RESIDUAL_EPILOG,
)
from sonic_bullet.records.errors import SonicBulletError, interrupts

DEFAULT_SR = 48_000
DEFAULT_MODES_MATERIAL = "steel"


class Numbers(click.ParamType):  # type: ignore[type-arg,unused-ignore]  # generic since click 8.3
    """``count`` finite numbers, separated by commas."""

    def __init__(self, metavar: str) -> None:
        self.name, self.count = metavar, metavar.count(",") + 1

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """What help calls the value."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """The numbers in ``value``; click's usage error where there are not ``count`` finite ones."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != self.count or not all(abs(number) < float("inf") for number in numbers):
            self.fail(f"{value!r} is not {self.name}: {self.count} finite numbers with commas between", param, ctx)
        return numbers


json_option = click.option(
    "--json",
    "json_to",
    is_flag=False,
    flag_value="-",
    metavar="[PATH.json]",
    help="Write the result as JSON to PATH.json, or alone to stdout.",
)


@click.group(epilog=GROUP_EPILOG, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="sonic_bullet", prog_name="sonic-bullet")
def cli() -> None:
    """PyBullet scenes that sound: impacts, rolling and sliding from physics alone, in pascals."""


@cli.command(epilog=RENDER_EPILOG)
@click.argument("scene", metavar="SCENE.py|LOG.npz")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="NAME.wav",
    help="Sound file: .wav .flac .ogg .aiff .caf .w64 .rf64; float formats hold 1.0 = 1 Pa.",
)
@click.option(
    "--seconds",
    type=float,
    metavar="S",
    help="How long to simulate; of a log, how much of it. [default: the scene's own, else 4]",
)
@click.option(
    "--sr", type=float, metavar="HZ", help=f"Sample rate, 8000 … 384000. [default: {DEFAULT_SR}; a log's own]"
)
@click.option(
    "--contacts", metavar="NAME.npz", help="Also write the contact log, which renders again without PyBullet."
)
@click.option("--picture", metavar="NAME.png", help="Also draw pressure, spectrogram and events.")
@json_option
@click.option("--peak-dbfs", type=float, metavar="DB", help="Scale so that the peak is DB below full scale (say -1).")
@click.option("--lufs", type=float, metavar="L", help="Scale to this programme loudness (say -23).")
@click.option(
    "--microphone",
    "microphones",
    type=Numbers("X,Y,Z"),
    multiple=True,
    help="A microphone in the world, in m; repeat for more channels. [default: the scene's own]",
)
@click.option("--seed", type=click.IntRange(0), help="Seed of the surfaces' roughness. [default: 0; a log's own]")
@click.option(
    "--material", metavar="M", help="Material of the bodies of a script that names none (a name or a preset file)."
)
@click.option(
    "--residual/--no-residual", default=True, help="What presets sound beside their modes. [default: sounded]"
)
def render(**options: Any) -> None:
    """Run a PyBullet scene, or replay a contact log, to a sound file."""
    from sonic_bullet.cli.scene_commands import run_render

    run_render(**options)


@cli.command(epilog=MODES_EPILOG)
@click.argument("mesh", metavar="MESH")
@click.option(
    "--material",
    metavar="M",
    help=f"A name ('sonic-bullet materials') or a preset file. [default: {DEFAULT_MODES_MATERIAL}, if no "
    "constants are given]",
)
@click.option(
    "--young", "youngs_pa", type=float, metavar="E", help="Young's modulus in Pa, in place of the material's."
)
@click.option("--poisson", type=float, metavar="N", help="Poisson's ratio, in place of the material's.")
@click.option(
    "--density", "density_kg_m3", type=float, metavar="R", help="Density in kg/m³, in place of the material's."
)
@click.option("--count", type=click.IntRange(1, 1000), metavar="K", help="The lowest K elastic modes.")
@click.option(
    "--to-hz", type=click.FloatRange(0, min_open=True), metavar="F", help="All elastic modes up to F. [default: 20000]"
)
@click.option(
    "--fix",
    "fixed",
    type=Numbers("X,Y,Z,R"),
    multiple=True,
    help="Clamp all within R of a point, in m, mesh frame; repeatable.",
)
@click.option("--thickness", "thickness_m", type=float, metavar="T", help="Wall thickness in m of an open surface.")
@click.option(
    "--scale",
    type=float,
    default=1.0,
    show_default=True,
    metavar="S",
    help="Metres per mesh unit: 0.001 for a mesh in millimetres.",
)
@json_option
@click.option(
    "-o",
    "--output",
    metavar="MODEL.npz",
    help="Also write the modal model: frequencies, decays, shapes on the surface.",
)
def modes(**options: Any) -> None:
    """Vibration modes of a mesh: the elastic ones, ascending."""
    from sonic_bullet.cli.solid_commands import run_modes

    run_modes(**options)


@cli.command()
@json_option
def materials(json_to: str | None) -> None:
    """List the materials that come with the package, with their sources."""
    from sonic_bullet.cli.solid_commands import run_materials

    run_materials(json_to)


@cli.command()
@click.argument("scene", metavar="SCENE.py")
@click.option(
    "--seconds",
    type=click.FloatRange(0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="S",
    help="How long to watch the scene run.",
)
@json_option
def doctor(scene: str, seconds: float, json_to: str | None) -> None:
    """Name the settings of a scene that would ruin its sound, and how to mend them."""
    from sonic_bullet.cli.scene_commands import run_doctor

    run_doctor(scene, seconds, json_to)


channel_option = click.option(
    "--channel",
    type=click.IntRange(0),
    metavar="N",
    help="Which channel of a file of several, counted from 0. [default: the first, 0]",
)


@cli.command(epilog=FEATURES_EPILOG)
@click.argument("recording")
@click.option(
    "--onset", "onset_s", type=click.FloatRange(0), metavar="S", help="When the impact starts. [default: found]"
)
@click.option("--band", type=Numbers("LO,HI"), help="Look between these frequencies in Hz. [default: 20,20000]")
@channel_option
@click.option(
    "--picture", metavar="NAME.png", help="Also draw the spectrogram with the features on it, and decay over frequency."
)
@json_option
def features(**options: Any) -> None:
    """The damped sinusoids of a recorded impact: frequency, decay, amplitude, each with its spread."""
    from sonic_bullet.cli.features_command import run_features

    run_features(**options)


def strike_options(command: Any) -> Any:
    """The options that say how one recording was struck and recorded; a case says it itself."""
    for option in reversed(
        (
            click.option("--mesh", metavar="M", help="Mesh of what was struck."),
            click.option("--strike", type=Numbers("X,Y,Z"), help="Where it was struck, in m, mesh frame."),
            click.option(
                "--direction", type=Numbers("X,Y,Z"), help="Direction of the impulse. [default: into the surface]"
            ),
            click.option(
                "--impulse",
                type=click.FloatRange(0, min_open=True),
                metavar="J",
                help="Impulse in N·s; without it sigma stands for gain times impulse.",
            ),
            click.option(
                "--material",
                metavar="GUESS",
                help="A name ('sonic-bullet materials') or a preset file: E and density good to 30 %.",
            ),
            click.option(
                "--scale",
                type=float,
                metavar="S",
                help="Metres per mesh unit: 0.001 for a mesh in millimetres. [default: 1]",
            ),
            click.option(
                "--sensor",
                type=click.Choice(["sum", "pressure", "velocity"]),
                help="What was recorded: plain sum of modes, a microphone, a surface. [default: pressure]",
            ),
            click.option(
                "--sensor-at",
                type=Numbers("X,Y,Z"),
                help="Where the surface was measured, in m, for --sensor velocity.",
            ),
            click.option(
                "--sensor-direction",
                type=Numbers("X,Y,Z"),
                help="Along which, for --sensor velocity. [default: out of the surface]",
            ),
            click.option(
                "--medium",
                type=click.Choice(["air", "none"]),
                help="What it rang in: 'none' loses nothing to radiation. [default: air; with --sensor sum unknown]",
            ),
            click.option(
                "--onset",
                "onset_s",
                type=click.FloatRange(0),
                metavar="S",
                help="When the impulse arrives. [default: found]",
            ),
            channel_option,
            click.option(
                "--fix",
                "fixed",
                type=Numbers("X,Y,Z,R"),
                multiple=True,
                help="Clamp all within R of a point, in m, mesh frame; repeatable.",
            ),
        )
    ):
        command = option(command)
    return command


@cli.command(epilog=FIT_EPILOG)
@click.argument("source", metavar="RECORDING|CASE_DIR")
@click.option("-o", "--output", required=True, metavar="PRESET.json", help="The fitted material as a preset file.")
@strike_options
@click.option("--picture", metavar="NAME.png", help="Also draw recording, synthesis, features and the fitted circle.")
@json_option
def fit(**options: Any) -> None:
    """Fit a material to recorded strikes: E/density, Poisson's ratio, damping, gain, with spreads and a verdict."""
    from sonic_bullet.cli.fit_command import run_fit

    run_fit(**options)


@cli.command(epilog=RESIDUAL_EPILOG)
@click.argument("source", metavar="RECORDING|CASE_DIR")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="PRESET.json",
    help="The material, fitted where there is a shape, with its residual as a preset file.",
)
@strike_options
@click.option(
    "--picture",
    metavar="NAME.png",
    help="Also draw what was recorded, features, what is synthesised, represented, and left.",
)
@json_option
def residual(**options: Any) -> None:
    """What the modes of recorded strikes leave unsaid, into a preset that sounds it with every contact."""
    from sonic_bullet.cli.residual_command import run_residual

    run_residual(**options)


@cli.command(epilog=DIAGNOSE_EPILOG)
@click.argument("source", metavar="CASE_DIR")
@click.option(
    "-o",
    "--output",
    metavar="PRESET.json",
    help="The fitted material, with the effects that belong to it and its object, as a preset file.",
)
@json_option
@click.option(
    "--predict",
    metavar="DIR",
    help="Also write every strike as it is predicted, to DIR/before and DIR/after, whether its audio is there or not.",
)
@click.option(
    "--report",
    metavar="OUT.html",
    help="Also write one page that opens offline: players, spectrograms, evidence, the verdict in words.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Seed of what is left out in turn, and of the null effects.",
)
def diagnose(**options: Any) -> None:
    """Say which physical effect the fitted model lacks, judged on strikes it was not fitted to."""
    from sonic_bullet.cli.diagnose_command import run_diagnose

    run_diagnose(**options)


@cli.group(epilog=CASE_EPILOG)
def case() -> None:
    """Make and check a case: a folder of recorded strikes with a case.json that says what was struck."""


@case.command("new", epilog=CASE_EPILOG)
@click.argument("folder")
@click.argument("more", nargs=-1, metavar="[RECORDING]...")
@click.option(
    "--recordings",
    multiple=True,
    metavar="A.wav [B.wav]...",
    help="The strikes' recordings. [default: all in the folder]",
)
@click.option("--mesh", metavar="M", help="Mesh of what was struck.")
@click.option("--units", type=click.Choice(["m", "cm", "mm"]), default="m", show_default=True, help="Of the mesh.")
@click.option(
    "--material",
    metavar="GUESS",
    help="A name ('sonic-bullet materials') or a preset file: E and density good to 30 %.",
)
@click.option(
    "--sensor",
    type=click.Choice(["sum", "pressure", "velocity"]),
    default="pressure",
    show_default=True,
    help="What was recorded: plain sum of modes, a microphone, a surface.",
)
@click.option("--sensor-at", type=Numbers("X,Y,Z"), help="Where the surface was measured, in m, for --sensor velocity.")
@click.option(
    "--sensor-direction",
    type=Numbers("X,Y,Z"),
    help="Along which, for --sensor velocity. [default: out of the surface]",
)
@click.option(
    "--medium",
    type=click.Choice(["air", "none"]),
    help="What it rang in: 'none' loses nothing to radiation. [default: air; with --sensor sum unknown]",
)
def case_new(folder: str, more: tuple[str, ...], recordings: tuple[str, ...], **options: Any) -> None:
    """Write FOLDER/case.json for recordings of one object; files from elsewhere are copied into the folder."""
    from sonic_bullet.cli.case_command import run_case_new

    run_case_new(folder, (*recordings, *more), **options)


@case.command("check")
@click.argument("folder", metavar="CASE_DIR")
def case_check(folder: str) -> None:
    """Say what a case holds, or the first thing that a fit would stop at."""
    from sonic_bullet.cli.case_command import run_case_check

    run_case_check(folder)


@case.command("schema")
def case_schema() -> None:
    """Print the JSON Schema of case.json."""
    from sonic_bullet.cli.case_command import run_case_schema

    run_case_schema()


def main() -> None:
    """The console script: run a command, turn every error into one line on stderr, and exit."""
    import logging
    import warnings

    debug = bool(os.environ.get("SONIC_BULLET_DEBUG"))
    if not debug:
        warnings.simplefilter("ignore")  # a library's warning is no line of ours
        logging.getLogger("matplotlib").setLevel(logging.ERROR)  # nor that it found no home for its fonts
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters still gets its table
    signal.signal(signal.SIGTERM, _terminated)
    try:
        # cli.main() would swallow what an interrupt says
        with interrupts(), cli.make_context("sonic-bullet", _settled(sys.argv[1:]) or ["--help"]) as context:
            cli.invoke(context)
        _say_what_is_not_kept()
        sys.stdout.flush()
        sys.exit(0)
    except click.exceptions.Exit as done:
        code = done.exit_code
    except KeyboardInterrupt as error:
        code = 143 if str(error).startswith("terminated") else 130
        _say(str(error) or "stopped")
    except click.ClickException as error:
        where = getattr(error, "ctx", None)
        code, hint = 2, f"; see '{where.command_path} --help'" if where is not None else ""
        _say(error.format_message().rstrip(".") + hint)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the reader left; flushing at exit must not complain
        code = 141
    except SonicBulletError as error:
        if debug:
            raise
        code = 2
        _say(str(error))
    except Exception as error:
        if debug:
            raise
        code = 2
        notes = "; ".join(getattr(error, "__notes__", []))
        _say(
            f"{type(error).__name__}: {error}"
            + (f"; {notes}" if notes else "")
            + "; set SONIC_BULLET_DEBUG=1 to see where"
        )
    sys.exit(code)


def _settled(words: list[str]) -> list[str]:
    """The command line with every --json that no name ending in .json follows as --json=-: what follows is another
    argument then.
    """
    follows = [*words[1:], ""]
    return [
        "--json=-" if word == "--json" and not after.lower().endswith(".json") else word
        for word, after in zip(words, follows, strict=True)
    ]


def _terminated(*_: object) -> None:
    raise KeyboardInterrupt("terminated")


def _say_what_is_not_kept() -> None:
    """One note where there was no folder for compiled code and computed models: each run then takes a minute that the
    next could do without.
    """
    folder = sys.modules.get("sonic_bullet.machine.user_folder")
    if folder is not None and folder.NOTES:
        _say(
            f"note: compiled code and computed models are not kept for the next run: {folder.NOTES[0]}; "
            "XDG_CACHE_HOME names another folder"
        )


def _say(text: str) -> None:
    """One line on stderr."""
    print("sonic-bullet: " + " ".join(text.split()), file=sys.stderr)
