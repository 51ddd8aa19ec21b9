"""glTF animations -> paths of bodies: a kinematic body follows its own, any other moves by physics.

keys of a body's node and of what it hangs on -> global transforms at all of them -> body frames, z up -> BodyPath
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sonic_bullet.files.gltf.gltf_animation import STRETCH, Sampler, local_transforms, read_channels
from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import BodyPath, RigidBody
from sonic_bullet.session.gltf_in.node_frames import UPRIGHT, Nodes
from sonic_bullet.session.gltf_in.physics import KHR_PHYSICS, body_frame


def paths_of(
    nodes: Nodes, number_of: Mapping[int, int], bodies: list[RigidBody], notes: list[str]
) -> tuple[BodyPath, ...]:
    """Read the paths of all bodies that are animated; number_of: bodies by their nodes. Raises the tree's error."""
    channels = read_channels(nodes.tree)
    if not channels:
        return ()
    found, by_physics, still = [], [], []
    for index, number in number_of.items():
        chain = (index, *nodes.ancestors(index))
        own = [sampler for one in chain for sampler in channels.get(one, {}).values()]
        if not own:
            continue
        found.append(_path(nodes, index, number, chain, channels, np.unique(np.concatenate([x.time_s for x in own]))))
        if bodies[number].mass_kg > 0:
            by_physics.append(bodies[number].name)
        elif "motion" not in nodes.extension(index, KHR_PHYSICS):
            still.append(bodies[number].name)
    if by_physics:
        notes.append(f"animations of {_few(by_physics)} are not played: they move by physics")
    if still:
        notes.append(f"animations of {_few(still)} are not played: give isKinematic to what is to move")
    return tuple(path for path in found if bodies[path.body].name not in still)


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _path(
    nodes: Nodes,
    index: int,
    number: int,
    chain: tuple[int, ...],
    channels: Mapping[int, Mapping[str, Sampler]],
    time_s: Array,
) -> BodyPath:
    keys_most = 1_000_000
    from scipy.spatial.transform import Rotation

    name, tree = nodes.name(index), nodes.tree
    if len(time_s) > keys_most:
        raise tree.error(f"{name} has {len(time_s)} keys, {keys_most} are the most", "export a shorter take")
    matrix = np.eye(4)
    for one in chain:
        matrix = local_transforms(nodes.entry[one], channels.get(one, {}), time_s) @ matrix
    frame = matrix[:, :3, :3]
    scale = np.linalg.norm(frame, axis=1)
    if not scale.min() > 1e-9 or np.abs(scale / scale[0] - 1).max() > STRETCH:
        raise tree.error(f"{name} changes its size", "animate position and rotation alone")
    own = body_frame(nodes, index)
    place = matrix[:, :3, 3] + frame @ own.local_centre
    turn = UPRIGHT @ (frame / scale[:, None, :]) @ own.local_turn
    return BodyPath(number, time_s, place @ UPRIGHT.T, Rotation.from_matrix(turn).as_quat())
