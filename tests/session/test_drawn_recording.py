"""What a recording adds: each part does what its number says, and frames of any length give the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from sonic_bullet.files.presets import load_material
from sonic_bullet.records import Array
from sonic_bullet.records.errors import RecordError
from sonic_bullet.session.drawn_recording import (
    NOISE_OCTAVES_HZ,
    ChainSpread,
    RecordingChain,
    draw_chain,
    looped_noise,
    record,
    robot_tones,
    vary_material,
)

SR = 48_000
WIDE = ChainSpread((-6, 6), 4.0, (1e-6, 1e-3), (0.0, 0.05), (0.0, 0.002), (0.1, 1.0), (-20, 0))


def noise(channels: int = 2, n: int = 9600) -> Array:
    return np.random.default_rng(1).normal(size=(channels, n))


def test_the_same_seed_gives_the_same_chain_within_its_ranges() -> None:
    chains = [draw_chain(np.random.default_rng(seed), WIDE) for seed in range(300)]
    again = draw_chain(np.random.default_rng(7), WIDE)
    assert again.to_json() == chains[7].to_json() and again.to_json() != chains[8].to_json()
    for name, (low, high) in {"gain_db": (-6, 6), "noise_rthz": (1e-6, 1e-3), "clip": (0.1, 1)}.items():
        values = np.array([getattr(one, name) for one in chains])
        assert low <= values.min() < low + 0.1 * (high - low) and values.max() <= high
        assert values.max() > high - 0.1 * (high - low)
    assert np.median([one.noise_rthz for one in chains]) == pytest.approx(10**-4.5, rel=0.5)
    assert np.std([one.levels_db for one in chains]) == pytest.approx(4.0, rel=0.05)
    plain = draw_chain(np.random.default_rng(3), ChainSpread())
    assert np.array_equal(record(noise(), SR, plain)[0], noise())


def test_frames_of_any_length_are_the_same_bits() -> None:
    chain, sound = draw_chain(np.random.default_rng(2), WIDE), noise()
    robot = 0.1 * noise(1)
    whole, _ = record(sound, SR, chain, robot)
    made, state, at = [], None, 0
    for n in (1, 199, 0, 1024, 33, 5000, 3343):
        part, state = record(sound[:, at : at + n], SR, chain, robot[:, at : at + n], state)
        made.append(part)
        at += n
    assert at == sound.shape[1] and np.array_equal(np.concatenate(made, axis=1), whole)


def test_gain_latency_clipping_and_floor_are_what_their_numbers_say() -> None:
    sound = noise()
    louder, _ = record(sound, SR, RecordingChain(gain_db=6.0, latency_s=0.01))
    assert np.array_equal(louder[:, 480:], 10**0.3 * sound[:, :-480]) and not louder[:, :480].any()
    clipped, _ = record(sound, SR, RecordingChain(clip=0.5))
    assert np.abs(clipped).max() == 0.5 and np.array_equal(clipped, np.clip(sound, -0.5, 0.5))
    floor, _ = record(np.zeros((2, 4 * SR)), SR, RecordingChain(noise_rthz=1e-3, seed=4))
    f, power = welch(floor, SR, nperseg=4096)
    assert np.sqrt(power[:, (f > 100) & (f < 23_000)].mean(axis=1)) == pytest.approx(1e-3, rel=0.02)
    assert abs(np.corrcoef(floor)[0, 1]) < 0.01


def test_a_response_has_its_octaves() -> None:
    levels = np.array([-6, 3, 0, 4, -2, 6, -8, 1, -12.0])
    pulse = np.zeros((1, 1 << 14))
    pulse[0, 0] = 1
    heard, _ = record(pulse, SR, RecordingChain(levels_db=levels))
    f = np.fft.rfftfreq(pulse.shape[1], 1 / SR)
    level = 20 * np.log10(np.abs(np.fft.rfft(heard[0])))
    assert np.abs(np.interp(NOISE_OCTAVES_HZ, f, level) - levels).max() < 0.3


def test_jitter_bends_time_by_its_deviation() -> None:
    """A tone's phase tells its delay: latency on the mean, jitter as its standard deviation at the knots."""
    time, hz = np.arange(20 * SR) / SR, 100.0
    heard, _ = record(np.sin(2 * np.pi * hz * time)[None], SR, RecordingChain(latency_s=0.004, jitter_s=5e-4, seed=1))
    turned = np.exp(-2j * np.pi * hz * time) * heard[0]
    period = SR // 100
    phase = -np.angle(turned[: len(time) // period * period].reshape(-1, period).mean(axis=1) * 2j) / (2 * np.pi * hz)
    delay = phase[4:] % (1 / hz)
    assert delay.mean() == pytest.approx(0.004 + 1 / SR, abs=1e-4)
    assert 0.6 * 5e-4 < delay.std() < 5e-4  # linear between knots


def test_a_robots_tones_follow_its_joints() -> None:
    """A joint at 3 rad/s with 50 teeth sounds at 3·50/2π Hz with level·3; a joint at rest is silent; blocks go on."""
    speed = np.tile([3.0, 0.0], (49, 1))
    orders, level = np.array([[50.0], [80.0]]), np.array([[0.1], [0.1]])
    tone, _ = robot_tones(speed, 1 / 48, SR, orders, level)
    spectrum = np.abs(np.fft.rfft(tone * np.hanning(len(tone))))
    assert np.argmax(spectrum) * SR / len(tone) == pytest.approx(150 / (2 * np.pi), abs=1.0)
    assert np.abs(tone).max() == pytest.approx(0.3, rel=1e-3)
    first, phase = robot_tones(speed[:25], 1 / 48, SR, orders, level)
    second, _ = robot_tones(speed[24:], 1 / 48, SR, orders, level, phase)
    assert np.abs(np.concatenate([first, second]) - tone).max() < 1e-9


def test_a_robots_recording_is_looped() -> None:
    kept = np.arange(100.0)
    whole = looped_noise(kept, 0, 350, seed=3)
    assert np.array_equal(whole[100:200], whole[:100]) and set(whole[:100].tolist()) == set(kept.tolist())
    assert np.array_equal(looped_noise(kept, 120, 90, seed=3), whole[120:210])


def test_materials_stay_within_their_presets_spread() -> None:
    steel = load_material("steel")
    drawn = [vary_material(steel, np.random.default_rng(seed)) for seed in range(20)]
    heights = [one.roughness_m for one, _ in drawn]
    assert len(set(heights)) > 10
    assert all(one.roughness_m == pytest.approx(steel.roughness_m * f["roughness_m"]) for one, f in drawn)
    assert vary_material(steel, np.random.default_rng(5))[1] == drawn[5][1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"gain_db": (6, -6)}, "gain_db descends"),
        ({"gain_db": 3}, "gain_db"),
        ({"latency_s": (-0.1, 0)}, "latency_s"),
        ({"clip": (0, 1)}, "clip is 0"),
        ({"response_db": -1}, "response_db"),
        ({"noise_rthz": (0, float("nan"))}, "noise_rthz"),
    ],
)
def test_what_is_no_spread_is_one_line(words: dict[str, Any], said: str) -> None:
    with pytest.raises(RecordError, match=said) as caught:
        ChainSpread(**words)
    assert "\n" not in str(caught.value)
