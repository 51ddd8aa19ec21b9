"""Glue a contact microphone to a bar, aim a vibrometer at it, and hear a microphone beside them."""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sonic_bullet as sb
from sonic_bullet.records import Sensor
from sonic_bullet.scene import render_scene

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "bar.py"
log = render_scene(SCENE, seconds=0.6).log
bar = next(body for body in log.bodies if body.name == "bar").body_id
sensors: dict[str, Sensor] = {
    "microphone, Pa": sb.Microphone([0, -0.4, 0.3]),
    "contact microphone, m/s²": sb.ContactMicrophone(bar, point_m=[0.06, 0, 0.005], direction=[0, 0, 1]),
    "vibrometer, m/s": sb.Vibrometer(bar, point_m=[0.06, 0, 0.005], direction=[0, 0, 1]),
}
sound = sb.render_log(replace(log, sensors=tuple(sensors.values())))
figure, axes = plt.subplots(3, sharex=True, figsize=(8, 5), layout="constrained")
for axis, name, samples in zip(axes, sensors, sound, strict=True):
    axis.plot(np.arange(samples.size) / log.sr, samples, linewidth=0.5)
    axis.set_title(name, loc="left")
axes[-1].set(xlabel="time in s", xlim=(0, 0.2))
figure.savefig("contact_microphone.png")
sb.write_audio("contact_microphone.flac", sound[1], log.sr, peak_dbfs=-1, full_scale_pa=None)
