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

from typing import TYPE_CHECKING

import click

from sonic_bullet.apps.cli.commands import command
from sonic_bullet.apps.cli.console import run_and_exit
from sonic_bullet.apps.cli.examples import EXAMPLES

if TYPE_CHECKING:
    from sonic_bullet.options.bake import BakeOptions
    from sonic_bullet.options.cache import CacheOptions, DoctorOptions
    from sonic_bullet.options.case import CaseOptions
    from sonic_bullet.options.compare import BaselineOptions, CompareOptions
    from sonic_bullet.options.dataset import DatasetOptions
    from sonic_bullet.options.film import FilmOptions
    from sonic_bullet.options.fit import DiagnoseOptions, FitOptions, ResidualOptions
    from sonic_bullet.options.modes import JsonOptions, ModesOptions
    from sonic_bullet.options.play import PlayOptions
    from sonic_bullet.options.render import RenderOptions
    from sonic_bullet.options.score import ScoreOptions
    from sonic_bullet.options.states import FeatureOptions, StatesOptions


@command("render", "SCENE.py|.gltf|LOG.npz")
def render(scene: str, options: RenderOptions) -> None:
    """Run a PyBullet scene, or replay a contact log, to a sound file."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_render

    run_render(scene, options)


@command("play", "SCENE.py|.gltf|LOG.npz")
def play(scene: str, options: PlayOptions) -> None:
    """Play a PyBullet scene, or a contact log, on a sound card while it runs."""
    from sonic_bullet.apps.cli.scenes.play_command import run_play

    run_play(scene, options)


@command("film", "SCENE.py|.gltf|LOG.npz")
def film(scene: str, options: FilmOptions) -> None:
    """Film a PyBullet scene, or a contact log, with its sound: pictures and samples on one clock."""
    from sonic_bullet.apps.cli.soundtrack.film_command import run_film

    run_film(scene, options)


@command("score", "ANIMATION|SCENE.py")
def score(animation: str, options: ScoreOptions) -> None:
    """Render a baked animation's sound (.glb .gltf .json .npz), or that of a scene's bodies that are moved by hand."""
    from sonic_bullet.apps.cli.soundtrack.score_command import run_score

    run_score(animation, options)


@command("cache", "SCENE.py")
def doctor(scene: str, options: DoctorOptions) -> None:
    """Name the settings of a scene that would spoil its sound, and their remedies."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_doctor

    run_doctor(scene, options)


@command("dataset", "RECIPE.py|impacts|household")
def dataset(recipe: str, options: DatasetOptions) -> None:
    """Make a data set: audio, contacts as labels, parameters and provenance of each sample, split by object."""
    from sonic_bullet.apps.cli.scenes.dataset_command import run_dataset

    run_dataset(recipe, options)


@command("modes", "MESH")
def modes(mesh: str, options: ModesOptions) -> None:
    """Compute the elastic vibration modes of a mesh, ascending."""
    from sonic_bullet.apps.cli.solid_commands import run_modes

    run_modes(mesh, options)


@command("modes")
def materials(options: JsonOptions) -> None:
    """List the materials that come with the package, with their sources."""
    from sonic_bullet.apps.cli.solid_commands import run_materials

    run_materials(options.json_to)


@command("bake", "MESH…|SCENE.py|LOG.npz")
def bake(sources: tuple[str, ...], options: BakeOptions) -> None:
    """Write the modal sound of a mesh, or of a scene's bodies, for another engine.

    A scene or log as .glb or .gltf has its physics and its recorded motion, too.
    """
    from sonic_bullet.apps.cli.solids.bake_outputs import run_bake

    run_bake(sources, options)


@command("states", "RECORDING")
def features(recording: str, options: FeatureOptions) -> None:
    """List the damped sinusoids of a recorded impact: frequency, decay, amplitude, each with its spread."""
    from sonic_bullet.apps.cli.features_command import run_features

    run_features(recording, options)


@command("fit", "RECORDING|CASE_DIR...")
def fit(sources: tuple[str, ...], options: FitOptions) -> None:
    """Fit a material to recorded strikes: E/density, Poisson's ratio, damping, gain, with spreads and a verdict."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("fit", sources, options)


@command("fit", "RECORDING|CASE_DIR")
def residual(source: str, options: ResidualOptions) -> None:
    """Store the non-modal part of recorded strikes in a preset that plays it with every contact."""
    from sonic_bullet.apps.cli.residual_command import run_residual

    run_residual(source, options)


@command("fit", "CASE_DIR...")
def diagnose(sources: tuple[str, ...], options: DiagnoseOptions) -> None:
    """Find which physical effect the fitted model lacks, judged on strikes it was not fitted to."""
    from sonic_bullet.apps.cli.many import run_one_or_many

    run_one_or_many("diagnose", sources, options)


@command("case", "FOLDER", "[RECORDING]...", name="new", examples="case")
def case_new(folder: str, more: tuple[str, ...], options: CaseOptions) -> None:
    """Write FOLDER/case.json for recordings of one object; files from elsewhere are copied into the folder."""
    from sonic_bullet.apps.cli.case_command import run_case_new

    run_case_new(folder, (*options.recordings, *more), options)


@command("", "CASE_DIR", name="check")
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


@command("states", "BEFORE AFTER...")
def states(paths: tuple[str, ...], options: StatesOptions) -> None:
    """Tell what changed between two states of one thing: what moved, which physics, and how well that predicts.

    BEFORE, AFTER: folders of recordings, a take each, or a recording each; more are held against the first. One
    folder may hold a folder or a recording a state, or a case.json whose recordings name a "state".
    """
    from sonic_bullet.apps.cli.states_command import run_states

    run_states(paths, options)


@command("compare", "A", "[B]")
def compare(a: str, b: str | None, options: CompareOptions) -> None:
    """Tell whether two versions sound the same, and if not, which input is the cause.

    A, B: scenes (.py), contact logs (.npz), recordings, or folders of them whose files are paired by name; A may be a
    baseline (.json) of the scene B. Folders of recordings that no renderer made are takes of a thing in two states: it
    answers as `states` does.
    """
    from sonic_bullet.apps.cli.compare_commands import run_compare

    run_compare(a, b, options)


@command("compare", "SCENE.py...")
def baseline(scenes: tuple[str, ...], options: BaselineOptions) -> None:
    """Store the present sound of scenes as small files, for tests to compare with."""
    from sonic_bullet.apps.cli.compare_commands import run_baseline

    run_baseline(scenes, options)


@command("cache")
def cache(options: CacheOptions) -> None:
    """List what is kept between runs (computed modes, how they radiate), bound it or clear it."""
    from sonic_bullet.apps.cli.cache_command import run_cache

    run_cache(options)


@click.group(
    commands=[
        render, play, film, score, doctor, dataset, modes, materials, bake, features, fit, residual, diagnose, case,
        states, compare, baseline, cache,
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
