"""Hear from where: bars fall around ambisonics of order 1, which show each one's direction and make a stereo pair."""

import matplotlib.pyplot as plt
import numpy as np
import pybullet as p
import pybullet_utils.bullet_client as bc

import sonic_bullet as sb

client = bc.BulletClient(p.DIRECT)
client.setGravity(0, 0, -9.81)
listener = sb.attach(client, microphone=sb.Ambisonics([0, 0, 0.1], order=1))  # x ahead, y left
client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE))
shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.06, 0.01, 0.004])
directions = [-120, 60, 0, -60, 120]
for fall, degrees in enumerate(directions):  # one more every 0.2 s
    x_m, y_m, z_m = np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.01 + 4.905 * (0.2 * fall + 0.1) ** 2
    listener.add(client.createMultiBody(0.15, shape, basePosition=[x_m, y_m, z_m]), material="steel")
sb.keep_restitution(client)
for _ in range(300):
    client.stepSimulation()

w, y, _, x = listener.sound()  # ACN order: W, Y, Z, X
frame = listener.sr // 20  # active intensity of 50 ms points to where it comes from
along_y, along_x = (np.sum((w * one)[: w.size // frame * frame].reshape(-1, frame), axis=1) for one in (y, x))
plt.plot(0.05 * np.arange(along_x.size), np.degrees(np.arctan2(along_y, along_x)), "o")
plt.xlabel("time in s"), plt.ylabel("direction in °, left above"), plt.savefig("microphone_array.png")
sb.write_audio("microphone_array.flac", np.stack([w + y, w - y]) / 2, listener.sr, peak_dbfs=-1)  # two cardioids
