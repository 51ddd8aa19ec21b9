"""Files of a failed comparison: expected and actual WAV, difference, spectrum.png, result.json.

Comparison -> FOLDER/expected.wav actual.wav difference.wav spectrum.png result.json [after pytest-mpl]
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.apps.compare.comparison_record import Comparison
from sonic_bullet.apps.compare.outcome.sound_effects import at_common_rate
from sonic_bullet.files import replace_file, write_audio
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import power_spectrum


def write_failure(folder: Path, found: Comparison) -> None:
    """Write all files; raises FileError."""
    folder.mkdir(parents=True, exist_ok=True)
    one, other, sr = at_common_rate(found.a.sound.samples(), found.b.sound.samples(), found.a.sr, found.b.sr)
    write_audio(str(folder / "expected.wav"), one, sr)
    write_audio(str(folder / "actual.wav"), other, sr)
    if len(one) == len(other):
        n = max(one.shape[1], other.shape[1])
        padded = [np.pad(x, ((0, 0), (0, n - x.shape[1]))) for x in (one, other)]
        write_audio(str(folder / "difference.wav"), padded[1] - padded[0], sr)
    _picture(folder / "spectrum.png", one, other, sr)
    with replace_file(str(folder / "result.json")) as file:
        file.write(json_bytes(found.to_json(), indent=2))


def _picture(place: Path, one: Array, other: Array, sr: int) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4))
    axis = figure.subplots()
    for x, name in ((one, "expected"), (other, "actual")):
        power = 10 * np.log10(power_spectrum(x).mean(axis=0) + 1e-30)
        axis.semilogx(np.fft.rfftfreq(x.shape[1], 1 / sr)[1:], power[1:], lw=0.7, label=name)
    axis.set(xlabel="frequency in Hz", ylabel="level in dB", xlim=(20, sr / 2))
    axis.legend(frameon=False)
    with replace_file(str(place)) as file:
        figure.savefig(file, format="png", dpi=100, bbox_inches="tight", metadata={"Software": None})
