"""The command line: parses, calls, exits.

    render SCENE.py | .gltf | LOG.npz -> RenderResult -> WAV, contact log, picture, JSON
    play SCENE.py | LOG.npz   -> the same, on a sound card
    film SCENE.py | LOG.npz   -> the same, with pictures: .mp4 .mov .mkv
    score ANIMATION           -> a baked animation's sound and contact log
    modes MESH                -> ModalModel   -> table, JSON, npz
    bake MESH | SCENE | LOG   -> BakedModel   -> .glb .gltf .json .dsp .h .wav
    dataset NAME.py           -> samples, manifest
    materials, doctor SCENE   -> table, JSON
    case FOLDER               -> case.json, and whether it can be read
    compare A B               -> Comparison   -> words, JSON, page
    states BEFORE AFTER       -> ComparedStates -> words, JSON, picture, page
    cache                     -> table, JSON

Exit 0: done. 2: one line on stderr states the fault and the remedy, and no half-written file has its final name; a
scene that ends its process or never steps is named with its line. 130 (Ctrl-C), 143 (terminated): within a second; the
sound so far is closed as a valid file and named. With --json and no path only JSON goes to stdout, whatever a scene
prints. SONIC_BULLET_DEBUG=1 shows tracebacks. Each command imports what it needs.
"""

from __future__ import annotations

from typing import Any

import click

from sonic_bullet.apps.cli.cache_command import cache
from sonic_bullet.apps.cli.compare_commands import baseline, compare
from sonic_bullet.apps.cli.console import run_and_exit
from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.parameters import (
    ManyOptions,
    Numbers,
    channel_option,
    csv_option,
    json_option,
    many_options,
    strike_options,
    uff_option,
)
from sonic_bullet.apps.cli.scenes.dataset_command import dataset
from sonic_bullet.apps.cli.scenes.play_command import play
from sonic_bullet.apps.cli.scenes.render_command import render
from sonic_bullet.apps.cli.solids.bake_command import bake
from sonic_bullet.apps.cli.soundtrack.film_command import film
from sonic_bullet.apps.cli.soundtrack.score_command import score
from sonic_bullet.apps.cli.states_command import states


@click.group(
    epilog=EXAMPLES["group"], context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(package_name="sonic_bullet", prog_name="sonic-bullet")
def cli() -> None:
    """PyBullet scenes that sound: impacts, rolling and sliding from physics alone, in pascals."""


cli.add_command(cache)
cli.add_command(compare)
cli.add_command(baseline)
cli.add_command(render)
cli.add_command(play)
cli.add_command(film)
cli.add_command(score)
cli.add_command(bake)
cli.add_command(dataset)
cli.add_command(states)


@cli.command(epilog=EXAMPLES["modes"])
@click.argument("mesh", metavar="MESH")
@click.option(
    "--material",
    metavar="M",
    help="A name ('sonic-bullet materials') or a preset file. [default: steel, if no constants are given]",
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
@click.option(
    "--accuracy",
    type=click.FloatRange(0, 0.5, min_open=True),
    default=0.01,
    show_default=True,
    metavar="A",
    help="Relative error allowed at the highest mode.",
)
@click.option(
    "--tail",
    is_flag=True,
    help="Also list the resonators that stand in a scene for a plate's or shell's modes above those.",
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
@uff_option
@json_option
@click.option(
    "-o",
    "--output",
    metavar="MODEL.npz",
    help="Also write the modal model: frequencies, decays, shapes on the surface.",
)
def modes(**options: Any) -> None:
    """Compute the elastic vibration modes of a mesh, ascending."""
    from sonic_bullet.apps.cli.solid_commands import run_modes

    run_modes(**options)


@cli.command()
@json_option
def materials(json_to: str | None) -> None:
    """List the materials that come with the package, with their sources."""
    from sonic_bullet.apps.cli.solid_commands import run_materials

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
    """Name the settings of a scene that would spoil its sound, and their remedies."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_doctor

    run_doctor(scene, seconds, json_to)


@cli.command(epilog=EXAMPLES["features"])
@click.argument("recording")
@click.option(
    "--onset", "onset_s", type=click.FloatRange(0), metavar="S", help="When the impact starts. [default: found]"
)
@click.option("--band", type=Numbers("LO,HI"), help="Look between these frequencies in Hz. [default: 20,20000]")
@channel_option
@click.option(
    "--picture", metavar="NAME.png", help="Also draw the spectrogram with the features on it, and decay over frequency."
)
@csv_option
@json_option
def features(**options: Any) -> None:
    """List the damped sinusoids of a recorded impact: frequency, decay, amplitude, each with its spread."""
    from sonic_bullet.apps.cli.features_command import run_features

    run_features(**options)


@cli.command(epilog=EXAMPLES["fit"])
@click.argument("sources", nargs=-1, required=True, metavar="RECORDING|CASE_DIR...")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="PRESET.json|DIR",
    help="The fitted material as a preset file; of several cases a folder, with a folder each.",
)
@strike_options
@click.option(
    "--dimension-tolerance",
    "tolerance_percent",
    type=float,
    metavar="PERCENT",
    help="Standard error of the mesh's dimensions, twice in the spread of E/density; 0: of the lines alone. "
    "[default: the case's, or 0.5]",
)
@click.option("--picture", metavar="NAME.png", help="Also draw recording, synthesis, features and the fitted circle.")
@click.option(
    "--page",
    metavar="NAME.html",
    help="Also write a page on which guess and fit are struck where the takes were, beside them, as loud.",
)
@csv_option
@uff_option
@json_option
@many_options
def fit(sources: tuple[str, ...], many: ManyOptions, **options: Any) -> None:
    """Fit a material to recorded strikes: E/density, Poisson's ratio, damping, gain, with spreads and a verdict."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("fit", sources, many, **options)


@cli.command(epilog=EXAMPLES["residual"])
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
    """Store the non-modal part of recorded strikes in a preset that plays it with every contact."""
    from sonic_bullet.apps.cli.residual_command import run_residual

    run_residual(**options)


@cli.command(epilog=EXAMPLES["diagnose"])
@click.argument("sources", nargs=-1, required=True, metavar="CASE_DIR...")
@click.option(
    "-o",
    "--output",
    metavar="PRESET.json|DIR",
    help="The fitted material, with the effects that belong to it and its object, as a preset file; of several cases "
    "a folder, with a folder each.",
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
    help="Also write one page that opens offline: bodies to strike before and after, players, evidence, the verdict.",
)
@click.option(
    "--next",
    "propose",
    is_flag=True,
    help="Also propose the strike that would separate the two best models that are still open most, and by how much.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Seed of what is left out in turn, and of the null effects.",
)
@many_options
def diagnose(sources: tuple[str, ...], many: ManyOptions, **options: Any) -> None:
    """Find which physical effect the fitted model lacks, judged on strikes it was not fitted to."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("diagnose", sources, many, **options)


@cli.group(epilog=EXAMPLES["case"])
def case() -> None:
    """Make and check a case: a folder of recorded strikes with a case.json that describes them."""


@case.command("new", epilog=EXAMPLES["case"])
@click.argument("folder")
@click.argument("more", nargs=-1, metavar="[RECORDING]...")
@click.option(
    "--recordings",
    multiple=True,
    metavar="A.wav [B.wav]...",
    help="The strikes' recordings, or a .uff or .unv file of responses. [default: all in the folder]",
)
@click.option("--split", is_flag=True, help="Cut recordings of several strikes into takes of one each.")
@click.option("--picture", metavar="NAME.png", help="With --split, also draw where each recording is cut.")
@click.option("--hold-out", type=int, metavar="N", help="Hold every N-th take out of the fit, to judge it by.")
@click.option("--force-channel", type=int, metavar="K", help="Channel, from 0, that is the hammer's force, not sound.")
@click.option("--force-newton", type=float, metavar="N", help="Newton at its full scale, which gives impulses in N·s.")
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
    type=click.Choice(["air", "none", "unknown"]),
    help="What it rang in: 'none' loses nothing to radiation, 'unknown' leaves it open. "
    "[default: air; with --sensor sum unknown]",
)
def case_new(folder: str, more: tuple[str, ...], recordings: tuple[str, ...], **options: Any) -> None:
    """Write FOLDER/case.json for recordings of one object; files from elsewhere are copied into the folder."""
    from sonic_bullet.apps.cli.case_command import run_case_new

    run_case_new(folder, (*recordings, *more), **options)


@case.command("check")
@click.argument("folder", metavar="CASE_DIR")
def case_check(folder: str) -> None:
    """Describe what a case holds, or the first thing that a fit would stop at."""
    from sonic_bullet.apps.cli.case_command import run_case_check

    run_case_check(folder)


@case.command("schema")
def case_schema() -> None:
    """Print the JSON Schema of case.json."""
    from sonic_bullet.apps.cli.case_command import run_case_schema

    run_case_schema()


def main() -> None:
    """Run a command as the console script: turn every error into one line on stderr, and exit."""
    run_and_exit(cli)
