"""Command `bake`: a mesh, or the bodies of a scene or log, as a file that other engines play."""

from __future__ import annotations

from sonic_bullet.apps.cli.commands import command
from sonic_bullet.options.bake import BakeOptions


@command(BakeOptions, "MESH…|SCENE.py|LOG.npz")
def bake(sources: tuple[str, ...], options: BakeOptions) -> None:
    """Write the modal sound of a mesh, or of a scene's bodies, for another engine.

    A scene or log as .glb or .gltf has its physics and its recorded motion, too.
    """
    from sonic_bullet.apps.cli.solids.bake_outputs import run_bake

    run_bake(sources, options)
