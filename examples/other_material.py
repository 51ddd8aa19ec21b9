"""Render one contact log as brass, glass and wood: the motion and the contacts stay as they were simulated."""

from pathlib import Path

import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps.report.plots.scene_plot import render_picture
from sonic_bullet.scene import render_scene
from sonic_bullet.session.chosen_in_log import with_choice
from sonic_bullet.session.material_choice import as_choice

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "bar.py"
render_scene(SCENE, seconds=0.6).log.save("other_material.npz")

log = sb.read_log("other_material.npz")  # from here on no simulator is needed
sounds = []
for material in ("brass", "glass", "wood"):
    other, notes = with_choice(log, as_choice(materials={"bar": material}), "log")
    sounds.append(sb.render_log(other))
    print(*notes)

one_after_another = np.concatenate(sounds, axis=1)
sb.write_audio("other_material.flac", one_after_another, log.sr, peak_dbfs=-1)
render_picture("other_material.png", one_after_another, log.sr, title="one strike on brass, on glass, on wood")
