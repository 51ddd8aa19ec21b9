"""Render a sound for each body of a scene. Stems add up to the mix."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps.soundtrack.stems import render_stems
from sonic_bullet.scene import render_scene

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "rolling.py"
result = render_scene(SCENE, seconds=2.6)
stems = render_stems(result.log)
figure, axes = plt.subplots(len(stems), sharex=True, sharey=True, figsize=(8, 4), layout="constrained")
for axis, stem in zip(axes, stems, strict=True):
    sound = stem.sound.samples()[0]
    axis.plot(np.arange(sound.size) / result.sr, sound, linewidth=0.5)
    axis.set_title(result.log.bodies[stem.index].name, loc="left")
axes[-1].set(xlabel="time in s", ylabel="Pa")
figure.savefig("stems.png")

total = sum(stem.sound.samples() for stem in stems)
print(f"mix less sum of stems: {np.abs(result.samples - total).max():.1e} Pa of {np.abs(total).max():.2g}")
left, right = stems[0].sound.samples()[0], stems[1].sound.samples()[0]
sb.write_audio("stems.flac", np.stack([left, right]), result.sr, peak_dbfs=-1)  # the first board left, the second right
