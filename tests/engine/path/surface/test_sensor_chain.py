"""What a contact microphone itself does: its response, of minimum phase, and its own noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from scipy.signal import welch

import sonic_bullet as sb
from sonic_bullet.apps.soundtrack.stems import render_stems
from sonic_bullet.engine.path.surface.sensor_chain import response_taps, sensor_noise
from sonic_bullet.engine.runtime.replay import render_blocks, render_log
from sonic_bullet.files import read_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import ContactMicrophone, SensorResponse
from sonic_bullet.records.errors import FileError
from tests.engine.runtime.test_render_sensors import SR, one_strike
from tests.made.jointed import FAR_HZ
from tests.made.models import box_body, row, wall_body

EDGES_M, TOP = (0.2, 0.1, 0.02), (0.03, 0.0, 0.01)
PIEZO = SensorResponse([20, 200, 1000, 3000, 3600, 8000, 20_000], [0.05, 0.5, 1, 3, 1.5, 0.4, 0.02])


def struck_log(*sensors: Any, steps: int = 24) -> ContactLog:
    bodies = box_body(EDGES_M, FAR_HZ), wall_body()
    contacts = row(0, 1, (0, 0, -0.01), normal=(0, 0, -1), point_a=TOP, approach=1.0)
    taken = one_strike(bodies, contacts, [(0, 0, 0), TOP], steps=steps)
    return ContactLog(bodies, tuple(taken), sensors, SR, 0)


def test_the_phase_is_the_least_that_the_magnitude_has() -> None:
    """One pole: its impulse response (1 - a)·aⁿ comes back from its magnitude alone."""
    pole, f = 0.9, np.linspace(1, SR / 2, 6000)
    magnitude = (1 - pole) / np.abs(1 - pole * np.exp(-2j * np.pi * f / SR))
    taps = response_taps(SensorResponse(f, magnitude), SR)
    assert np.abs(taps[:60] - (1 - pole) * pole ** np.arange(60)).max() < 1e-4


def test_a_sound_passes_through_the_response() -> None:
    """The spectrum with it over the one without is its magnitude, within 0.1 dB to 18 kHz."""
    plain = ContactMicrophone(0, TOP, (0, 0, -1))
    flat, shaped = render_log(struck_log(plain, replace(plain, response=PIEZO), steps=40))
    f = np.fft.rfftfreq(1 << 14, 1 / SR)
    band = (f > 100) & (f < 6000)
    ratio = np.abs(np.fft.rfft(shaped, 1 << 14))[band] / np.abs(np.fft.rfft(flat, 1 << 14))[band]
    assert np.abs(20 * np.log10(ratio / PIEZO.at(f[band]))).max() < 0.1


def test_noise_has_its_density_and_is_the_same_however_it_is_cut() -> None:
    noise = sensor_noise(2e-3, SR, (5, 0), 0, 8 * SR)
    f, power = welch(noise, SR, nperseg=4096)
    assert np.sqrt(power[(f > 100) & (f < 23_000)].mean()) == pytest.approx(2e-3, rel=0.01)
    parts = [sensor_noise(2e-3, SR, (5, 0), at, 333) for at in range(700, 4030, 333)]
    assert np.array_equal(np.concatenate(parts), noise[700 : 700 + 10 * 333])
    assert abs(np.corrcoef(noise, sensor_noise(2e-3, SR, (5, 1), 0, 8 * SR))[0, 1]) < 0.01
    assert not np.array_equal(noise, sensor_noise(2e-3, SR, (6, 0), 0, 8 * SR))


def test_replays_and_files_are_the_same_bits_and_stems_add_up(tmp_path: Path) -> None:
    ear = ContactMicrophone(0, TOP, (0, 0, -1), response=PIEZO, noise_m_s2_rthz=1e-2)
    log = struck_log(ear, replace(ear, noise_m_s2_rthz=0.0))
    sound = render_log(log)
    assert np.abs(sound[0, :300]).max() > 0 and not sound[1, :300].any()
    assert np.array_equal(np.concatenate([*render_blocks(log)], axis=1), sound)
    log.save(tmp_path / "a.npz")
    again = read_log(tmp_path / "a.npz")
    assert np.array_equal(render_log(again), sound)
    assert not np.array_equal(render_log(replace(log, seed=1))[0], sound[0])
    stems = sum(stem.sound.samples() for stem in render_stems(log))
    assert np.abs(stems - sound).max() <= 1e-9 * np.abs(sound).max()


def test_a_response_is_read_from_a_table_or_a_filter(tmp_path: Path) -> None:
    (tmp_path / "piezo.csv").write_text("Hz; factor\n100; 0.5\n\n1000; 2\n")
    table = sb.read_response(tmp_path / "piezo.csv")
    assert table.freq_hz.tolist() == [100, 1000] and table.magnitude.tolist() == [0.5, 2]
    soundfile.write(tmp_path / "fir.wav", np.array([0.5, 0.5]), SR, subtype="DOUBLE")
    fir = sb.read_response(tmp_path / "fir.wav")
    assert np.abs(fir.magnitude - np.abs(np.cos(np.pi * fir.freq_hz / SR))).max() < 1e-6


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "Hz, dB\n", "holds no row of numbers"),
        ("a.csv", "100, 1\n50, 1\n", "freq_hz"),
        ("a.csv", "100, 1\nx, 1\n", "a.csv:2"),
        ("a.csv", "100\n", "one number"),
        ("none.csv", None, "none.csv"),
        ("a.wav", "no sound", "a.wav"),
    ],
)
def test_what_is_no_response_is_one_line(tmp_path: Path, name: str, text: str | None, said: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=said) as caught:
        sb.read_response(tmp_path / name)
    assert "\n" not in str(caught.value)
