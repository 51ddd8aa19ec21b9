"""Options of `bake`. `PruningOptions` and `BakeMeshOptions` are also what `sonic_bullet.apps.bake` takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from sonic_bullet.options.modes import MeshOptions
from sonic_bullet.options.option import Options, group, option, require_option
from sonic_bullet.options.render import Point, client_option, json_option
from sonic_bullet.records.errors import ModalError, SonicBulletError


@dataclass(frozen=True, slots=True)
class PruningOptions(Options):
    """What is kept of modes and points.

    None: all. Raises ModalError naming the argument.
    """

    error: ClassVar[type[SonicBulletError]] = ModalError
    modes: int | None = option(
        None, "Keep the N modes that matter most to an ear.", metavar="N", least=1, most=1_000_000, unset="all"
    )
    below_db: float | None = option(
        None,
        "Leave out modes that others mask, and those DB below the strongest.",
        "--below",
        metavar="DB",
        above=0,
        unset="none",
    )
    points: int | None = option(
        None,
        "Shapes at N points: fewer than the mesh has, or more.",
        metavar="N",
        least=3,
        most=1_000_000,
        unset="its own vertices, in its file's order; 64 for .dsp and .h; 1000 to 2000 for .html",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BakeMeshOptions(MeshOptions):
    """Mesh."""

    pruning: PruningOptions | None = None
    accuracy: float = 0.01
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TapOptions(Options):
    """Strike that a sound file is of."""

    strike: Point | None = option(None, "Where, in m, mesh frame.", metavar="X,Y,Z", unset="where it is loudest")
    direction: Point | None = option(None, "Of the impulse.", metavar="X,Y,Z", unset="into the surface")
    impulse: float | None = option(None, "In N·s.", metavar="J", above=0, unset="0.01")
    contact_ms: float | None = option(
        None, "Length of the pulse in ms.", "--contact", metavar="MS", least=0, most=50, unset="0.1"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BakeOptions(Options):
    """Outputs."""

    output: str = field(
        metadata=require_option(
            "What for: .html (a page: struck in a browser, offline), .glb .gltf (KHR_audio_rigid_bodies; of scenes "
            "also KHR_physics_rigid_bodies), .json, .dsp (Faust), .h (C), .wav (one strike).",
            "-o",
            "--output",
            metavar="NAME.EXT",
        )
    )
    material: tuple[str, ...] = option(
        (),
        "A name ('sonic-bullet materials') or a preset file; of a scene, a log or several meshes, of the body NAME or "
        "of all.",
        metavar="[NAME=]M",
        unset="steel; a scene's own",
    )
    others: tuple[str, ...] = option(
        (),
        "Of an .html: a further material to choose there, a name or a preset file, such as the guess of a fit.",
        "--other",
        metavar="M",
    )
    recordings: tuple[str, ...] = option(
        (), "Of an .html: also play a recording there, as loud as the last strike.", "--recording", metavar="SOUND"
    )
    body: str | None = option(None, "That body of a scene or log alone.", metavar="NAME")
    seconds: float | None = option(
        None,
        "Of a scene or log as .glb or .gltf: how much of its motion.",
        metavar="S",
        above=0,
        unset="all; a scene's own SECONDS, or 4",
    )
    emitters: bool = option(
        False,
        "Of a scene or log as .glb or .gltf: also a clip a body (KHR_audio_emitter) for viewers that play no modes.",
    )
    client: int | None = client_option()
    json_to: str | None = json_option()
    mesh: MeshOptions = group(MeshOptions)
    pruning: PruningOptions = group(PruningOptions)
    tap: TapOptions = group(TapOptions)
