"""Run by a Python that has bpy: three bodies fall, are baked by the add-on, and what became of it is printed as JSON.

python falling_in_blender.py ADDONS COMMAND FOLDER FPS [cancel]
"""

import itertools
import json
import sys
import time
from pathlib import Path

HEIGHTS_M = (0.35, 0.5, 0.7)
EDGE_M, FINE_FPS, SECONDS = 0.1, 960, 0.7


def build(bpy, fps):
    """An empty scene with a floor and three cubes above it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return fill(bpy, fps)


def fill(bpy, fps):
    """A floor and three cubes above it, in the scene that is there."""
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = fps, 1, round(SECONDS * fps) + 1
    bpy.ops.rigidbody.world_add()
    scene.rigidbody_world.substeps_per_frame = max(1, FINE_FPS // fps)
    scene.rigidbody_world.point_cache.frame_end = scene.frame_end
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, -0.1))
    floor = bpy.context.object
    floor.name, floor.scale = "floor", (3, 3, 0.2)
    items = [floor]
    for number, height in enumerate(HEIGHTS_M):
        bpy.ops.mesh.primitive_cube_add(size=EDGE_M, location=(0.5 * number - 0.5, 0, height + EDGE_M / 2))
        bpy.context.object.name = f"cube {number}"
        items.append(bpy.context.object)
    for item in items:
        bpy.context.view_layer.objects.active = item
        bpy.ops.rigidbody.object_add(type="PASSIVE" if item is floor else "ACTIVE")
        item.rigid_body.collision_shape = "BOX"
        item.rigid_body.use_margin, item.rigid_body.collision_margin = True, 0.0
        item.rigid_body.restitution, item.rigid_body.friction = 0.5, 0.5
        if item is not floor:
            item.rigid_body.mass = 1.0
    bpy.context.view_layer.update()
    return scene, items


def first_touches(bpy):
    """When each cube's fall ends, s, in a simulation of fine frames."""
    scene, items = build(bpy, FINE_FPS)
    heights = {item.name: [] for item in items[1:]}
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        for item in items[1:]:
            heights[item.name].append(item.evaluated_get(graph).matrix_world.translation.z)
    found = {}
    for name, z in heights.items():
        rise = [b - a for a, b in itertools.pairwise(z)]
        found[name] = next(k for k in range(1, len(rise)) if rise[k] > rise[k - 1] + 1e-4) / FINE_FPS
    return found


def main(addons, command, folder, fps, cancel):
    """Bake, or begin to and cancel; print what is there then."""
    sys.path.insert(0, addons)
    import bpy

    touches = first_touches(bpy)
    import sonic_bullet_blender as addon

    addon.register()
    scene, items = build(bpy, fps)
    for item, material in zip(items[1:], ("steel", "glass", "wood"), strict=True):
        item.sonic_bullet.material = material
    scene.sonic_bullet.sound = str(Path(folder) / "sound.wav")
    missing = ""
    try:
        addon.prepare(scene, str(Path(folder) / "nowhere"))
    except ValueError as error:
        missing = str(error)
    job = addon.prepare(scene, command)
    for _ in addon.write_poses(scene, job.poses):
        pass
    began = time.monotonic()
    job.start()
    started_s = time.monotonic() - began
    if cancel:
        while job.process is None:
            time.sleep(0.05)
        time.sleep(1.0)
        job.cancel()
        left = {"folder": job.folder.exists(), "sound": job.sound.exists(), "alive": job.process.poll() is None}
        print(json.dumps(left))
        addon.unregister()  # else the module of 4.2 falls at its exit
        return
    while job.running:
        time.sleep(0.1)
    assert not job.error, job.error
    events = job.events()
    try:
        strip = addon.finish(scene, job)
    except RuntimeError as error:
        assert "without Audaspace" in str(error)  # the wheel of 4.2 has no sound, Blender itself has
        strip = None
    print(
        json.dumps(
            {
                "version": bpy.app.version_string,
                "touches": touches,
                "started_s": started_s,
                "events": events,
                "missing": missing,
                "strip": strip
                and {
                    "name": strip.name,
                    "type": strip.type,
                    "start": strip.frame_final_start,
                    "end": strip.frame_final_end,
                },
                "markers": [[one.name, one.frame] for one in scene.timeline_markers],
                "left": job.folder.exists(),
            }
        )
    )
    addon.unregister()


if __name__ == "__main__":
    main(*sys.argv[1:4], int(sys.argv[4]), "cancel" in sys.argv[5:])
