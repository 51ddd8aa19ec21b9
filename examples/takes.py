"""Make four takes of one contact log: other surfaces, contact places and materials within their spread."""

from pathlib import Path

import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps.report.plots.scene_plot import render_picture
from sonic_bullet.scene import render_scene
from sonic_bullet.session.variation import make_take

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "bar.py"
log = render_scene(SCENE, seconds=0.4).log
sounds = []
for number in (1, 2, 3, 4):  # the first is the log itself; the same seed gives the same takes
    take = make_take(log, number)
    sounds.append(sb.render_log(take.log))
    for body, factors in take.drawn.items():
        print(f"take {number}, {body}:", ", ".join(f"{name} × {factor:.3f}" for name, factor in factors.items()))

one_after_another = np.concatenate(sounds, axis=1)
sb.write_audio("takes.flac", one_after_another, log.sr, peak_dbfs=-1)
render_picture("takes.png", one_after_another, log.sr, title="four takes of one strike")
