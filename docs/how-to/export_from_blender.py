"""Poses of a Blender scene's rigid bodies as keyframes that `sonic-bullet score` reads.

blender -b shot.blend -P export_from_blender.py -- shot.npz

Objects with a rigid body go out: active ones with mass, friction and bounciness as Blender has them, animated ones as
driven, passive ones as what never moves. An object's custom property `material` names what it is made of.
"""

import json
import sys

import bpy
import numpy as np

FORMAT = "sonic-bullet-animation/1"


def mesh_of(item, graph):
    """Vertices and triangles as modifiers leave them, scaled, in the object's frame."""
    shape = item.evaluated_get(graph).to_mesh()
    shape.calc_loop_triangles()
    scale = np.array(item.matrix_world.to_scale())
    vertices = np.array([corner.co for corner in shape.vertices]) * scale
    return {"vertices": vertices.tolist(), "faces": [list(face.vertices) for face in shape.loop_triangles]}


def body_of(item, graph):
    """What the file says of an object, without its poses."""
    rigid = item.rigid_body
    said = {
        "name": item.name,
        "mesh": mesh_of(item, graph),
        "restitution": rigid.restitution,
        "friction": rigid.friction,
        "driven": bool(rigid.kinematic),
    }
    if rigid.type == "ACTIVE":
        said["mass_kg"] = rigid.mass
    if "material" in item:
        said["material"] = item["material"]
    return said


def main(path):
    """Write the frames of the scene that is open."""
    scene = bpy.context.scene
    items = [item for item in scene.objects if item.type == "MESH" and item.rigid_body]
    scene.frame_set(scene.frame_start)
    graph = bpy.context.evaluated_depsgraph_get()
    header = {
        "format": FORMAT,
        "fps": scene.render.fps / scene.render.fps_base,
        "unit_m": scene.unit_settings.scale_length,
        "gravity_m_s2": list(scene.gravity) if scene.use_gravity else [0.0, 0.0, 0.0],
        "bodies": [body_of(item, graph) for item in items],
    }
    positions, turns = [], []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        poses = [item.evaluated_get(graph).matrix_world.decompose() for item in items]
        positions.append([list(place) for place, _, _ in poses])
        turns.append([[turn.x, turn.y, turn.z, turn.w] for _, turn, _ in poses])
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(path, header=text, position=np.array(positions), quaternion_xyzw=np.array(turns))
    print(f"{path}: {len(items)} bodies, {len(positions)} frames")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1])
