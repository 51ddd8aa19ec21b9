"""The noise of a state is what its takes share beside lines, and of takes of lines alone it is far below them."""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.states.changes import values_of
from sonic_bullet.lab.states.recorded_states import RecordedState, take_of
from sonic_bullet.lab.states.state_noise import noise_to_json, state_noise
from sonic_bullet.signal.band_time import THIRDS_HZ

SR = 24_000


def made_state(hiss: float) -> RecordedState:
    """Four takes of two lines, and of a hiss in the octave about 6 kHz that falls by e in 50 ms."""
    time, takes = np.arange(SR) / SR, []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        turn = rng.uniform(0, 6, 2)
        lines = sum(
            0.3 * np.exp(-6 * time) * np.cos(2 * np.pi * f * time + p) for f, p in zip((400, 930), turn, strict=True)
        )
        spectrum = np.fft.rfft(rng.standard_normal(SR))
        freq = np.fft.rfftfreq(SR, 1 / SR)
        spectrum[(freq < 4243) | (freq > 8485)] = 0
        rustle = np.fft.irfft(spectrum, SR)
        sound = lines + hiss * rustle / rustle.std() * np.exp(-20 * time) + 1e-5 * rng.standard_normal(SR)
        takes.append(take_of(np.concatenate([1e-5 * rng.standard_normal(SR // 5), sound]), SR, f"take{seed}"))
    return RecordedState("made", tuple(takes), SR, None)


def test_a_hiss_stands_in_its_bands_and_falls_as_it_does() -> None:
    told = noise_to_json(state_noise(values_of(made_state(0.03))))
    level = np.array(told["level_db"], float)
    third = int(np.abs(THIRDS_HZ - 6350).argmin())
    # a third of an octave of it, over the first 16 ms; e^{−40 t} of power
    share = 6350 * (2 ** (1 / 6) - 2 ** (-1 / 6)) / (8485 - 4243)
    wanted = 10 * np.log10(0.03**2 * share * (1 - np.exp(-0.64)) / 0.64)
    assert abs(level[third, 0] - wanted) < 2
    assert abs(level[third, 3] - level[third, 0] - 10 * np.log10(np.exp(-40 * 0.096) / np.exp(-40 * 0.008))) < 3


def test_lines_alone_leave_far_less_than_they_are() -> None:
    noise = state_noise(values_of(made_state(0.0)))
    with_hiss = state_noise(values_of(made_state(0.03)))
    third = int(np.abs(THIRDS_HZ - 6350).argmin())
    # from the second block on: lines of other phases begin with another click
    assert noise.power[third, 1:10].mean() < 1e-4 * with_hiss.power[third, 1:10].mean()
