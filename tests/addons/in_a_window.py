"""Run by Blender in a window: the extension's panels are drawn, a bake is cancelled, three are made; tells it as JSON.

blender --enable-event-simulate --python in_a_window.py -- COMMAND FOLDER        pictures: of Xvfb's -fbdir, FOLDER
"""

import importlib
import json
import shutil
import sys
import tempfile
import time
import traceback
from pathlib import Path

import bpy

HERE = Path(__file__).parent
EXTENSION = "bl_ext.user_default.sonic_bullet_blender"
TICK_S, PATIENCE_S = 0.05, 300.0
FPS = 24


def kept_files():
    """What a bake keeps while it runs."""
    return sorted(one.name for one in Path(tempfile.gettempdir()).glob("sonic_bullet_*"))


def shoot(folder, name):
    """Draw the window, and keep what the X server shows: an XWD file, 24 bits."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=2)
    shutil.copy(folder / "Xvfb_screen0", folder / f"{name}.xwd")


def scroll_to_end():
    """Scroll the panels to their end, where the extension's is."""
    window = bpy.context.window_manager.windows[0]
    area = next(one for one in window.screen.areas if one.type == "PROPERTIES")
    region = next(one for one in area.regions if one.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        for _ in range(40):
            bpy.ops.view2d.scroll_down()


def start_bake():
    """Press the button."""
    window = bpy.context.window_manager.windows[0]
    area = next(one for one in window.screen.areas if one.type == "PROPERTIES")
    region = next(one for one in area.regions if one.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.sonic_bullet.bake("INVOKE_DEFAULT")


def make_scene(folder):
    """Three cubes above a floor, seen by a camera, in the window that is open."""
    from falling_in_blender import fill

    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        scene, items = fill(bpy, FPS)
        bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.2))
        bpy.ops.object.camera_add(location=(0.3, -2.2, 0.9), rotation=(1.27, 0, 0.12))
        scene.camera = bpy.context.object
        bpy.context.view_layer.objects.active = items[1]
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    for item, material in zip(items[1:], ("steel", "glass", "wood"), strict=True):
        item.sonic_bullet.material = material
    scene.sonic_bullet.sound = str(folder / "sound.wav")
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "PROPERTIES":
            area.spaces.active.context = "PHYSICS"
        if area.type == "DOPESHEET_EDITOR":
            area.type = "SEQUENCE_EDITOR"
        if area.type == "VIEW_3D":
            area.spaces.active.region_3d.view_perspective = "CAMERA"
    return scene, items


def scenario(command, folder, told):
    """Go through it; yields what it waits for."""
    yield lambda: True
    scene, items = make_scene(folder)
    addon = importlib.import_module(EXTENSION)
    preferences = bpy.context.preferences.addons[EXTENSION].preferences
    yield lambda: True

    preferences.command = str(folder / "nowhere")
    try:
        start_bake()
    except RuntimeError as error:  # an operator's report, where Python called it
        told["missing"] = str(error)
    told["missing_in_panel"] = addon.Running.words
    yield lambda: True
    scroll_to_end()
    yield lambda: True
    shoot(folder, "missing")

    preferences.command = command
    start_bake()
    yield lambda: addon.Running.job is not None and addon.Running.job.process is not None
    process, began = addon.Running.job.process, time.monotonic()
    scroll_to_end()
    yield lambda: time.monotonic() > began + 0.5  # the panel is drawn again
    shoot(folder, "baking")
    told["kept_while_baking"] = len(kept_files())
    bpy.context.window_manager.windows[0].event_simulate(type="ESC", value="PRESS")
    yield lambda: addon.Running.job is None
    told["cancelled"] = {
        "words": addon.Running.words,
        "alive": process.poll() is None,
        "kept": kept_files(),
        "files": sorted(one.name for one in folder.glob("*.wav")),
        "markers": len(scene.timeline_markers),
    }

    for name, changed in (("first", None), ("again", None), ("changed", 1)):
        if changed is not None:
            items[changed].sonic_bullet.material = "brass"
            scene.sonic_bullet.stems = True
        told["gaps"] = []
        began = time.monotonic()
        start_bake()
        yield lambda: addon.Running.job is None
        strips = getattr(scene.sequence_editor, "strips", None) or scene.sequence_editor.sequences
        told[name] = {
            "words": addon.Running.words,
            "took_s": time.monotonic() - began,
            "longest_gap_s": max(told.pop("gaps")),
            "strips": [[one.name, one.type, one.frame_final_start, one.frame_final_end, one.mute] for one in strips],
            "markers": [[one.name, one.frame] for one in scene.timeline_markers],
            "kept": kept_files(),
            "cache": sorted(one.name for one in (folder / "cache").glob("*.npz")),
        }
    scene.frame_set(9)
    yield lambda: True
    scroll_to_end()
    shoot(folder, "baked")


def main(command, folder):
    """Advance the scenario a step a tick, while Blender's own loop runs."""
    bpy.context.preferences.view.show_splash = False
    told = {"version": bpy.app.version_string, "window": not bpy.app.background}
    steps = scenario(command, folder, told)
    state = {"until": next(steps), "since": time.monotonic(), "last": None}

    def end():
        (folder / "told.json").write_text(json.dumps(told, indent=1))
        bpy.ops.wm.quit_blender()

    def tick():
        now = time.monotonic()
        if "gaps" in told and state["last"] is not None:
            told["gaps"].append(now - state["last"])
        state["last"] = now
        try:
            if state["until"]():
                state["until"], state["since"] = next(steps), now
            assert now - state["since"] < PATIENCE_S, "waited in vain"
        except StopIteration:
            return end()
        except Exception:
            told["error"] = traceback.format_exc()
            return end()
        return TICK_S

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)


if __name__ == "__main__":
    sys.path.insert(0, str(HERE))
    command, folder = sys.argv[sys.argv.index("--") + 1 :]
    main(command, Path(folder))
