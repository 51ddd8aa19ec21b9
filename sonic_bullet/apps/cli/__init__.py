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

import click

from sonic_bullet.apps.cli.cache_command import cache
from sonic_bullet.apps.cli.commands import command
from sonic_bullet.apps.cli.compare_commands import baseline, compare
from sonic_bullet.apps.cli.console import run_and_exit
from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.scenes.dataset_command import dataset
from sonic_bullet.apps.cli.scenes.play_command import play
from sonic_bullet.apps.cli.scenes.render_command import render
from sonic_bullet.apps.cli.solids.bake_command import bake
from sonic_bullet.apps.cli.soundtrack.film_command import film
from sonic_bullet.apps.cli.soundtrack.score_command import score
from sonic_bullet.apps.cli.states_command import states
from sonic_bullet.options.cache import DoctorOptions
from sonic_bullet.options.case import CaseOptions
from sonic_bullet.options.fit import DiagnoseOptions, FitOptions, ResidualOptions
from sonic_bullet.options.modes import JsonOptions, ModesOptions
from sonic_bullet.options.states import FeatureOptions


@command(ModesOptions, "MESH")
def modes(mesh: str, options: ModesOptions) -> None:
    """Compute the elastic vibration modes of a mesh, ascending."""
    from sonic_bullet.apps.cli.solid_commands import run_modes

    run_modes(mesh, options)


@command(JsonOptions)
def materials(options: JsonOptions) -> None:
    """List the materials that come with the package, with their sources."""
    from sonic_bullet.apps.cli.solid_commands import run_materials

    run_materials(options.json_to)


@command(DoctorOptions, "SCENE.py")
def doctor(scene: str, options: DoctorOptions) -> None:
    """Name the settings of a scene that would spoil its sound, and their remedies."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_doctor

    run_doctor(scene, options.seconds, options.json_to)


@command(FeatureOptions, "RECORDING")
def features(recording: str, options: FeatureOptions) -> None:
    """List the damped sinusoids of a recorded impact: frequency, decay, amplitude, each with its spread."""
    from sonic_bullet.apps.cli.features_command import run_features

    run_features(recording, options)


@command(FitOptions, "RECORDING|CASE_DIR...")
def fit(sources: tuple[str, ...], options: FitOptions) -> None:
    """Fit a material to recorded strikes: E/density, Poisson's ratio, damping, gain, with spreads and a verdict."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("fit", sources, options)


@command(ResidualOptions, "RECORDING|CASE_DIR")
def residual(source: str, options: ResidualOptions) -> None:
    """Store the non-modal part of recorded strikes in a preset that plays it with every contact."""
    from sonic_bullet.apps.cli.residual_command import run_residual

    run_residual(source, options)


@command(DiagnoseOptions, "CASE_DIR...")
def diagnose(sources: tuple[str, ...], options: DiagnoseOptions) -> None:
    """Find which physical effect the fitted model lacks, judged on strikes it was not fitted to."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("diagnose", sources, options)


@command(CaseOptions, "FOLDER", "[RECORDING]...", name="new", examples="case")
def case_new(folder: str, more: tuple[str, ...], options: CaseOptions) -> None:
    """Write FOLDER/case.json for recordings of one object; files from elsewhere are copied into the folder."""
    from sonic_bullet.apps.cli.case_command import run_case_new

    run_case_new(folder, (*options.recordings, *more), options)


@command(None, "CASE_DIR", name="check")
def case_check(folder: str) -> None:
    """Describe what a case holds, or the first thing that a fit would stop at."""
    from sonic_bullet.apps.cli.case_command import run_case_check

    run_case_check(folder)


@command(name="schema")
def case_schema() -> None:
    """Print the JSON Schema of case.json."""
    from sonic_bullet.apps.cli.case_command import run_case_schema

    run_case_schema()


case = click.Group(
    "case",
    commands=[case_new, case_check, case_schema],
    help="Make and check a case: a folder of recorded strikes with a case.json that describes them.",
    epilog=EXAMPLES["case"],
)


@click.group(
    commands=[
        render, play, film, score, modes, bake, dataset, materials, doctor, features, fit, residual, diagnose, case,
        compare, baseline, states, cache,
    ],
    epilog=EXAMPLES["group"],
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)  # fmt: skip
@click.version_option(package_name="sonic_bullet", prog_name="sonic-bullet")
def cli() -> None:
    """PyBullet scenes that sound: impacts, rolling and sliding from physics alone, in pascals."""


def main() -> None:
    """Run a command as the console script: turn every error into one line on stderr, and exit."""
    run_and_exit(cli)
