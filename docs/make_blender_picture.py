"""Pictures of the how-to on Blender. `make docs` makes them where the extension has changed, and Blender is at hand.

python docs/make_blender_picture.py
    SONIC_BULLET_BPY, or .venv/bpy: a Python with the wheel bpy, 5.0 or later -> docs/how-to/pictures/blender-scene.png
        a scene that Blender renders; its sequencer is drawn here from what strip and markers hold (it has no window)
    SONIC_BULLET_BLENDER: a Blender, 4.2 or later, with Xvfb on PATH -> blender-panel.png, its window while it bakes
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
PICTURE = REPO / "docs" / "how-to" / "pictures" / "blender-scene.png"
PANEL = PICTURE.with_name("blender-panel.png")
FPS, SEEN_FRAME = 24, 9  # where the first cube touches


def render_and_bake(folder: Path, command: str) -> None:
    """Run by Blender's Python: render the scene of the tests at a frame, bake its sound, tell strip and markers."""
    sys.path[:0] = [str(REPO / "tests" / "addons"), str(REPO / "addons" / "blender")]
    import bpy
    import sonic_bullet_blender as addon
    from falling_in_blender import build

    addon.register()
    scene, items = build(bpy, FPS)
    colours = {"steel": (0.4, 0.42, 0.45, 1), "glass": (0.3, 0.6, 0.7, 1), "wood": (0.5, 0.28, 0.12, 1)}
    for item, (material, colour) in zip(items[1:], colours.items(), strict=True):
        item.sonic_bullet.material = material
        look = bpy.data.materials.new(material)
        look.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
        item.data.materials.append(look)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.55, 0.65, 0.75, 1)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.4
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.2))
    bpy.context.object.data.energy = 2
    bpy.ops.object.camera_add(location=(0.3, -2.2, 0.9), rotation=(1.27, 0, 0.12))
    scene.camera = bpy.context.object
    scene.sonic_bullet.sound = str(folder / "sound.wav")
    job = addon.prepare(scene, command)
    for _ in addon.write_poses(scene, job.poses):
        pass
    job.start()
    scene.frame_set(SEEN_FRAME)
    scene.render.engine, scene.cycles.samples = "CYCLES", 24
    scene.render.resolution_x, scene.render.resolution_y, scene.render.filepath = 960, 400, str(folder / "scene.png")
    bpy.ops.render.render(write_still=True)
    assert job.thread is not None
    job.thread.join()
    assert not job.error, job.error
    strip = addon.finish(scene, job)
    marks = [[one.name, one.frame] for one in scene.timeline_markers]
    told = {"strip": strip.name, "start": strip.frame_final_start, "end": strip.frame_final_end, "markers": marks}
    (folder / "told.json").write_text(json.dumps(told), encoding="utf-8")


def draw(folder: Path) -> None:
    """Draw the rendered frame above the strip."""
    import matplotlib.image
    import numpy as np
    from matplotlib.figure import Figure

    import sonic_bullet as sb

    told = json.loads((folder / "told.json").read_text(encoding="utf-8"))
    sound, sr = sb.read_audio(folder / "sound.wav")
    figure = Figure(figsize=(8, 5), dpi=120, layout="constrained")
    seen, strip = figure.subplots(2, 1, height_ratios=(3, 1.2))
    seen.imshow(matplotlib.image.imread(folder / "scene.png"))
    seen.set(xticks=[], yticks=[], title=f"frame {SEEN_FRAME}")
    frame = told["start"] + FPS * np.arange(sound.shape[1]) / sr
    strip.plot(frame, sound[0] / abs(sound[0]).max(), lw=0.4, color="#3b6ea5")
    for name, at in told["markers"]:
        strip.axvline(at, color="#c2410c" if "impact" in name else "#8a8a8a", lw=1)
    strip.axvline(SEEN_FRAME, color="k", lw=0.8, ls=":")
    title = f"strip {told['strip']}, with markers of impacts (orange) and of slides (grey)"
    strip.set(xlim=(told["start"], told["end"]), yticks=[], xlabel="frame", title=title)
    figure.savefig(PICTURE, metadata={"Software": None})


def picture_window() -> None:
    """Let the extension bake in a window, as its test does, and keep what the screen showed."""
    import matplotlib.image

    sys.path.insert(0, str(REPO))
    from tests.addons.test_blender_window import read_screen, shown_in_blender

    with tempfile.TemporaryDirectory() as name:
        shown_in_blender(Path(name))
        matplotlib.image.imsave(PANEL, read_screen(Path(name) / "baking.xwd"), metadata={"Software": None})


def main() -> None:
    """Make the picture, or, as Blender's Python, its parts."""
    if len(sys.argv) > 1:
        render_and_bake(Path(sys.argv[1]), sys.argv[2])
        return
    python = os.environ.get("SONIC_BULLET_BPY") or str(REPO / ".venv" / "bpy" / "bin" / "python")
    if os.environ.get("SONIC_BULLET_BLENDER"):
        picture_window()
    if not Path(python).is_file():
        print("no Blender at hand (SONIC_BULLET_BPY): its picture stays as it is")
        return
    with tempfile.TemporaryDirectory() as name:
        beside = Path(sys.executable).with_name("sonic-bullet")
        subprocess.run([python, __file__, name, str(beside)], check=True, stdout=subprocess.DEVNULL)
        draw(Path(name))


if __name__ == "__main__":
    main()
