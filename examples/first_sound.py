"""Drop a steel bar on a wooden board, and write what a microphone hears."""

import pybullet as p
import pybullet_utils.bullet_client as bc

import sonic_bullet as sb
from sonic_bullet.apps.report.plots.scene_plot import render_picture

client = bc.BulletClient(p.DIRECT)
client.setGravity(0, 0, -9.81)
listener = sb.attach(client, microphone=(0, -1, 0.5), seed=0)

board = client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.3, 0.2, 0.01]))
shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.12, 0.01, 0.005])
bar = client.createMultiBody(0.19, shape, basePosition=[0, 0, 0.1], baseOrientation=[0.1, 0.05, 0, 1])
listener.add(board, material="wood")
listener.add(bar, material="steel")
sb.keep_restitution(client)

for _ in range(240):
    client.stepSimulation()

listener.write("first_sound.flac", peak_dbfs=-1, tail_db=-60)
render_picture("first_sound.png", listener.sound(), listener.sr, listener.contacts, "a steel bar falls on a board")
listener.detach()
