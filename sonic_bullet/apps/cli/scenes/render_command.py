"""Command `render`: a scene or a contact log to a sound file."""

from __future__ import annotations

from typing import Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.parameters import json_option, scene_options
from sonic_bullet.apps.cli.scenes.room_options import room_options
from sonic_bullet.apps.cli.scenes.space_options import space_options
from sonic_bullet.apps.cli.scenes.take_options import take_options
from sonic_bullet.apps.cli.sound_level import level_options
from sonic_bullet.apps.cli.soundtrack.session_output import session_options
from sonic_bullet.apps.cli.soundtrack.soundtrack_outputs import soundtrack_options
from sonic_bullet.records.file_endings import AUDIO_FORMATS


@click.command(epilog=EXAMPLES["render"])
@click.argument("scene", metavar="SCENE.py|.gltf|LOG.npz")
@click.option(
    "-o",
    "--output",
    metavar="NAME.wav",
    help=f"Sound file: {' '.join(AUDIO_FORMATS)}; it says what its full scale is in Pa. Not needed with --session.",
)
@click.option(
    "--seconds",
    type=float,
    metavar="S",
    help="How long to simulate; of a log, how much of it. [default: the scene's own, else 4]",
)
@click.option("--sr", type=float, metavar="HZ", help="Sample rate, 8000 … 384000. [default: 48000; a log's own]")
@click.option(
    "--contacts", metavar="NAME.npz", help="Also write the contact log, which renders again without PyBullet."
)
@click.option(
    "--models",
    type=click.Choice(["included", "reference"]),
    help="Where that log's modal models are: in it, or in the cache, which makes it small. [default: included]",
)
@click.option("--picture", metavar="NAME.png", help="Also draw pressure, spectrogram and events.")
@json_option
@level_options
@scene_options
@click.option(
    "--residual/--no-residual",
    default=None,
    help="What presets sound beside their modes. [default: it sounds; of a log, as it was rendered]",
)
@click.option(
    "--supports/--no-supports", default=None, help="Bodies that stand on others ring less. [default: as above]"
)
@click.option(
    "--image/--no-image",
    default=None,
    help="Planes, and flat faces from 0.25 m on of bodies that do not move, mirror what sounds before them: up to "
    "6 dB of what sounds alike all round, 9.5 with two faces, 12 with three. "
    "Walls of a --room or --response count once. [default: as the script's own listener has it, or the log]",
)
@click.option(
    "--client",
    type=click.IntRange(0),
    metavar="N",
    help="Of a script with several physics clients, listen to the one with this id. [default: the first that steps]",
)
@soundtrack_options
@session_options
@take_options
@space_options
@room_options
def render(**options: Any) -> None:
    """Run a PyBullet scene, or replay a contact log, to a sound file."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_render

    run_render(**options)
