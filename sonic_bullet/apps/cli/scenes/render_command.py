"""Command `render`: a scene or a contact log to a sound file."""

from __future__ import annotations

from sonic_bullet.apps.cli.commands import command
from sonic_bullet.options.render import RenderOptions


@command(RenderOptions, "SCENE.py|.gltf|LOG.npz")
def render(scene: str, options: RenderOptions) -> None:
    """Run a PyBullet scene, or replay a contact log, to a sound file."""
    from sonic_bullet.apps.cli.scenes.scene_commands import run_render

    run_render(scene, options)
