"""A take that holds a second hit costs the others nothing, in what `fit` and what `diagnose` listen to."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import soundfile

from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.recorded import gather
from sonic_bullet.records import Array

SR = 16_000
HZ, DECAY = np.array([410.0, 1130.0, 2270.0]), np.array([6.0, 9.0, 14.0])


def ringing(seconds: float, rng: np.random.Generator) -> Array:
    t = np.arange(round(seconds * SR)) / SR
    size = rng.uniform(0.5, 1.0, 3)
    return np.exp(-np.outer(t, DECAY)) * np.sin(2 * np.pi * np.outer(t, HZ)) @ size * 0.2


def test_a_second_hit_cuts_its_own_take_alone(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    names = [f"{k}.wav" for k in range(4)]
    for k, name in enumerate(names):
        sound = 1e-5 * rng.standard_normal(round(1.2 * SR))
        sound[SR // 10 :] += ringing(1.1, rng)
        if k == 2:
            sound[SR // 2 :] += ringing(0.7, rng)
        soundfile.write(tmp_path / name, sound, SR, subtype="FLOAT")
    recordings = [{"file": name, "split": "fit", "object": "bar", "strike": {}} for name in names]
    made = {"format": "sonic-bullet-case/1", "objects": {"bar": {"material": "steel"}}, "recordings": recordings}
    (tmp_path / "case.json").write_text(json.dumps(made))
    case = read_case(tmp_path)
    for clipped in (False, True):  # as `fit` asks, and as `diagnose` does
        (one,) = gather(case, clipped=clipped)
        assert one.signals is not None
        assert one.signals.shape[0] == 3 and one.signals.shape[1] > 1.05 * SR
        assert [r.file.name for r in one.recordings if r.file] == ["0.wav", "1.wav", "3.wav"]
        assert any("2.wav" in note and "without it" in note for note in one.notes)
        np.testing.assert_allclose(one.lines.freq_hz, HZ, rtol=1e-4)
