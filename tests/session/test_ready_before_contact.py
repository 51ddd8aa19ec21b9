"""Machine code that a contact needs is loaded with the first step: a live world must not pause at its first contact."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys

import pybullet as p
from numba.core.registry import CPUDispatcher
from pybullet_utils.bullet_client import BulletClient

import sonic_bullet as sb


def loaded():
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("sonic_bullet")]
    kernels = {id(one): one for module in modules for one in vars(module).values() if isinstance(one, CPUDispatcher)}
    return {one.py_func.__qualname__: len(one.overloads) for one in kernels.values()}


client = BulletClient(p.DIRECT)
client.setGravity(0, 0, -9.81)
client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE))
box = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05, 0.04, 0.03])
listener = sb.attach(client)
for k in range(2):
    body = client.createMultiBody(0.4, box, basePosition=[0, 0, 0.05 + 0.1 * k])
    client.resetBaseVelocity(body, [0.3, 0, 0])
    listener.add(body, material="plastic", count=8)
client.stepSimulation()
before = loaded()
for _ in range(120):
    client.stepSimulation()
after = loaded()
assert before["place_points"] and before["take_coming"] and before["begin"]
print(sorted(name for name, count in after.items() if count != before.get(name)))
"""


def test_a_first_contact_loads_no_machine_code() -> None:
    run = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"
