"""A file of pybullet_data in a world of its own, heard for 100 steps as `render` would hear it: one a process.

python -m tests.made.robots FILE [sound]     -> a line of JSON: links, notes, steps, processor_s, memory_mb
"""

from __future__ import annotations

import json
import random
import resource
import sys
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
from pybullet_utils.bullet_client import BulletClient

STEPS = 100
ONE_A_KIND = (
    "block.urdf", "cube_small.urdf", "sphere_small.urdf", "cloth_z_up.urdf", "plane.urdf", "plane_implicit.urdf",
    "sphere2red_nocol.urdf", "mjcf/capsule_fromtoX.xml", "mjcf/hopper.xml", "mjcf/cylinder.xml",
    "stadium_no_collision.sdf", "torus_deform.urdf",
)  # fmt: skip
"""A box, one more, a ball, cloth, two grounds, a body without a shape, two capsules by their ends, a cylinder, a world
of pictures, and one that PyBullet cannot load."""
CANNOT_BE_LOADED = {
    "gripper/wsg50_one_motor_gripper_free_base.sdf": -11,
    "kuka_iiwa/kuka_world.sdf": 3,
    "kuka_iiwa/model2.sdf": 3,
    "kuka_iiwa/model_for_sdf.urdf": 3,
    "toys/concave_box.urdf": 3,
    "torus_deform.urdf": 3,
}
"""Files that PyBullet 3.2.7 itself cannot load, with how the process ends: by a signal, or by our own code 3."""


def all_files(seed: int = 0, drawn: int = 20) -> list[str]:
    """Every URDF, MJCF and SDF file outside random_urdfs, and some of those, drawn."""
    root = Path(pybullet_data.getDataPath())
    names = sorted(str(place.relative_to(root)) for kind in ("urdf", "xml", "sdf") for place in root.rglob(f"*.{kind}"))
    apart = [name for name in names if name.startswith("random_urdfs")]
    return [name for name in names if name not in set(apart)] + random.Random(seed).sample(apart, drawn)


def listen(name: str, *, sound: bool) -> dict[str, object]:
    """What came of a file. sound: a microphone hears it; else its contacts and modes alone."""
    import sonic_bullet
    from sonic_bullet.session.arguments import as_material
    from sonic_bullet.session.links_of_script import add_links
    from sonic_bullet.simulators import body_ids, is_static, links_with_shapes

    client = BulletClient(pybullet.DIRECT)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    client.setGravity(0, 0, -9.81)
    listener = sonic_bullet.attach(client, microphone=(0.0, -1.0, 0.5) if sound else ())
    load = client.loadMJCF if name.endswith("xml") else client.loadSDF if name.endswith("sdf") else client.loadURDF
    try:
        load(name)
    except pybullet.error:
        sys.exit(3)
    links = [link for body in body_ids(client._client) for link in links_with_shapes(client._client, body)]
    cast = dict.fromkeys(links, as_material("steel"))
    notes = add_links(listener, cast, partial(is_static, client._client))
    for _ in range(STEPS):
        client.stepSimulation()
    if sound:
        assert np.isfinite(listener.sound()).all()
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return {
        "links": len(links),
        "notes": notes,
        "steps": len(listener.contacts.steps),
        "processor_s": sum(use.ru_utime + use.ru_stime for use in (own, others)),
        "memory_mb": max(own.ru_maxrss, others.ru_maxrss) / (1 << 20 if sys.platform == "darwin" else 1 << 10),
    }


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print("\n" + json.dumps(listen(sys.argv[1], sound="sound" in sys.argv[2:])), flush=True)
