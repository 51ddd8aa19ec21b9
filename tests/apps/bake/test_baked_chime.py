"""A chime of few modes is heard as the whole one, at its begin and while it rings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import sonic_bullet as sb
from sonic_bullet.apps.bake import PruningOptions
from sonic_bullet.apps.bake.baking import bake_mesh
from sonic_bullet.apps.bake.strike_playback import choose_strike, render_strike
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ, in_octave, octave_power

SR = 48_000


def octaves(sound: np.ndarray, at_s: float) -> np.ndarray:
    begin = int(at_s * SR)
    part = np.asarray(sound).ravel()[begin : begin + 4096]
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part)))) ** 2
    return np.array(octave_power(spectrum, np.fft.rfftfreq(len(part), 1 / SR), AUDIBLE_OCTAVES_HZ))


def test_a_chime_of_16_modes_is_within_3_db_by_octave_and_its_pitch_is_right(tmp_path: Path) -> None:
    trimesh.creation.box([0.3, 0.02, 0.006]).export(tmp_path / "chime.obj")
    steel = sb.load_material("steel")
    full = bake_mesh(tmp_path / "chime.obj", steel)
    few = bake_mesh(tmp_path / "chime.obj", steel, pruning=PruningOptions(modes=16))
    assert len(few.freq_hz) == 16 < len(full.freq_hz)
    assert few.freq_hz.min() == full.freq_hz.min()
    (said,) = [note for note in few.notes if "modes are kept" in note]
    assert "16 of" in said and "an octave loses" in said and "dB with 8" in said
    rings = np.array([in_octave(full.freq_hz, middle).any() for middle in AUDIBLE_OCTAVES_HZ])  # octaves with a mode
    assert rings.sum() >= 6
    for contact_s in (1e-4, 5e-4, 2e-3):
        strike = choose_strike(full, contact_s=contact_s)
        whole, some = (render_strike(model, strike, SR, 1.2) for model in (full, few))
        loudest = octaves(whole, 0.0).max()
        for at_s in (0.0, 0.5, 1.0):
            a, b = octaves(whole, at_s), octaves(some, at_s)
            heard = rings & (a > 1e-6 * loudest)
            assert heard.any()
            off_db = np.abs(10 * np.log10(b[heard] / a[heard])).max()
            assert off_db < 3, (contact_s, at_s, np.round(10 * np.log10(b / a), 1), said)
            assert np.argmax(np.abs(np.fft.rfft(np.ravel(some)[int(at_s * SR) :]))) == pytest.approx(
                np.argmax(np.abs(np.fft.rfft(np.ravel(whole)[int(at_s * SR) :]))), abs=2
            )
