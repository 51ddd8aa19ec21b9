"""Fit a material to what a vibrometer recorded of three strikes; here they are computed, of a bar known to be glass."""

from pathlib import Path

import numpy as np
import trimesh

import sonic_bullet as sb
from sonic_bullet.apps import bake
from sonic_bullet.apps.report.plots.fit_plot import write_fit_picture
from sonic_bullet.files.cases import Case, CaseObject, CaseRecording
from sonic_bullet.lab.fit.material_fit import fit_case

mesh, up, down, band_hz = Path("fit_material.obj"), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (20.0, 10_000.0)
trimesh.creation.box([0.14, 0.03, 0.005]).subdivide().subdivide().export(mesh)
bar = bake.bake_mesh(mesh, sb.load_material("glass"), to_hz=band_hz[1])
rng = np.random.default_rng(1)
top, shape = np.flatnonzero(bar.point_m[:, 2] > 0.0024), bar.shape[:, 2]
corner = top[np.argmax(bar.point_m[top].sum(axis=1))]
ringing = np.exp(np.outer(2j * np.pi * bar.freq_hz - bar.decay_per_s, np.arange(24_000) / 48_000)).real
recordings, sounds = [], [-0.01 * (shape[point] * shape[corner]) @ ringing for point in top[:3]]  # m/s, of 0.01 N·s
for point, sound in zip(top, sounds, strict=False):
    sb.write_audio(f"strike-{point}.wav", sound + rng.normal(scale=1e-4, size=sound.size), 48_000)
    place = tuple(bar.point_m[point].tolist())
    recordings.append(CaseRecording(Path(f"strike-{point}.wav"), None, "bar", "fit", place, down, 0.01))
sb.write_audio("fit_material.flac", np.concatenate(sounds), 48_000, peak_dbfs=-1)
guess, at = CaseObject("bar", mesh, 1.0, "porcelain"), {"bar": tuple(bar.point_m[corner].tolist())}
case = Case("bar", Path(), {"bar": guess}, tuple(recordings), "velocity", at, {"bar": up}, band_hz, 0.0, medium="air")
write_fit_picture("fit_material.png", found := fit_case(case))
print(f"{found.fit.verdict}: E/ρ = {found.fit.gamma_m2_s2:.4g} m²/s², for glass {7.13e10 / 2500:.4g}")
