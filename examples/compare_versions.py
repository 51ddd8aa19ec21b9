"""Find which input makes two versions of a scene sound different, and prove it."""

from pathlib import Path

import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps.report.plots.scene_plot import render_picture
from sonic_bullet.comparing import SceneSide
from sonic_bullet.scene import render_scene

old = Path(__file__).resolve().parents[1] / "scenes" / "bar.py"
new = Path("compare_versions_new.py")
new.write_text(old.read_text().replace("basePosition=[0, 0, 0.05]", "basePosition=[0.06, 0, 0.05]"))

found = sb.compare(SceneSide(old, seconds=0.5), SceneSide(new, seconds=0.5))
for line in found.lines():
    print(line)
assert found.exact and len(found.causes) == 1

sounds = [render_scene(path, seconds=0.5) for path in (old, new)]
both = np.concatenate([one.samples for one in sounds], axis=1)
sb.write_audio("compare_versions.flac", both, sounds[0].sr, peak_dbfs=-1)
render_picture("compare_versions.png", both, sounds[0].sr, title=found.verdict)
