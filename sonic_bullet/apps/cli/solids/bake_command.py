"""Command `bake`: a mesh, or the bodies of a scene or log, as a file that other engines play."""

from __future__ import annotations

from typing import Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.parameters import Numbers, json_option


@click.command(epilog=EXAMPLES["bake"])
@click.argument("sources", nargs=-1, required=True, metavar="MESH…|SCENE.py|LOG.npz")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="NAME.EXT",
    help="What for: .html (a page: struck in a browser, offline), .glb .gltf (KHR_audio_rigid_bodies; of scenes also "
    "KHR_physics_rigid_bodies), .json, .dsp (Faust), .h (C), .wav (one strike).",
)
@click.option(
    "--material",
    metavar="[NAME=]M",
    multiple=True,
    help="A name ('sonic-bullet materials') or a preset file; of a scene, a log or several meshes, of the body NAME or "
    "of all. "
    "[default: steel; a scene's own]",
)
@click.option("--modes", type=click.IntRange(1), metavar="N", help="Keep the N modes that matter most to an ear.")
@click.option(
    "--below",
    "below_db",
    type=click.FloatRange(0, min_open=True),
    metavar="DB",
    help="Leave out modes that others mask, and those DB below the strongest.",
)
@click.option(
    "--points",
    type=click.IntRange(3),
    metavar="N",
    help="Shapes at N points: fewer than the mesh has, or more. [default: its own vertices, in its file's order; "
    "64 for .dsp and .h; 1000 to 2000 for .html]",
)
@click.option(
    "--other",
    "others",
    multiple=True,
    metavar="M",
    help="Of an .html: a further material to choose there, a name or a preset file, such as the guess of a fit.",
)
@click.option(
    "--recording",
    "recordings",
    multiple=True,
    metavar="SOUND",
    help="Of an .html: also play a recording there, as loud as the last strike.",
)
@click.option("--body", metavar="NAME", help="That body of a scene or log alone.")
@click.option(
    "--seconds",
    type=click.FloatRange(0, min_open=True),
    metavar="S",
    help="Of a scene or log as .glb or .gltf: how much of its motion. [default: all; a scene's own SECONDS, or 4]",
)
@click.option(
    "--emitters",
    is_flag=True,
    help="Of a scene or log as .glb or .gltf: also a clip a body (KHR_audio_emitter) for viewers that play no modes.",
)
@click.option(
    "--scale",
    type=float,
    default=1.0,
    show_default=True,
    metavar="S",
    help="Metres per mesh unit: 0.001 for a mesh in millimetres.",
)
@click.option("--thickness", "thickness_m", type=float, metavar="T", help="Wall thickness in m of an open surface.")
@click.option(
    "--to-hz",
    type=click.FloatRange(0, min_open=True),
    metavar="F",
    help="All elastic modes of a mesh up to F. [default: 20000]",
)
@click.option(
    "--strike", type=Numbers("X,Y,Z"), help="Of a .wav: where, in m, mesh frame. [default: where it is loudest]"
)
@click.option("--direction", type=Numbers("X,Y,Z"), help="Of a .wav: of the impulse. [default: into the surface]")
@click.option(
    "--impulse", type=click.FloatRange(0, min_open=True), metavar="J", help="Of a .wav: in N·s. [default: 0.01]"
)
@click.option(
    "--contact",
    "contact_ms",
    type=click.FloatRange(0, 50),
    metavar="MS",
    help="Of a .wav: length of the pulse. [default: 0.1]",
)
@json_option
def bake(**options: Any) -> None:
    """Write the modal sound of a mesh, or of a scene's bodies, for another engine.

    A scene or log as .glb or .gltf has its physics and its recorded motion, too.
    """
    from sonic_bullet.apps.cli.solids.bake_outputs import run_bake

    run_bake(**options)
