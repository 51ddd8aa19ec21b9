"""Bake a steel bowl's modes for another engine, read them back, and strike them."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps import bake

BOWL = Path(__file__).resolve().parents[1] / "assets" / "bowl.obj"
bake.write_baked("bake.glb", [bake.bake_mesh(BOWL, sb.load_material("steel"))])  # .json, .dsp and .h too

(model,) = sb.read_baked("bake.glb")
rim = model.point_m[np.argmax(model.point_m[:, 2] + model.point_m[:, 0])]
strike = bake.choose_strike(model, point_m=rim, impulse_n_s=0.01, contact_s=2e-4)
sound = bake.render_strike(model, strike, sr=48_000, seconds=1.5)  # pascals at 1 m
sb.write_audio("bake.flac", sound, 48_000, peak_dbfs=-1)

t60_s = np.log(1000) / model.decay_per_s
plt.figure(figsize=(8, 3), layout="constrained")
plt.loglog(model.freq_hz, t60_s, "o")
plt.xlabel("frequency in Hz"), plt.ylabel("T60 in s"), plt.title(f"{model.freq_hz.size} modes of a steel bowl")
plt.savefig("bake.png")
