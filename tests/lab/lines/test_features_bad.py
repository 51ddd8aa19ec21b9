"""What is no impact, or no good recording of one, says so: a verdict or an error, never a confident number."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.lines import onset
from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.records.errors import AudioError

SR = 22_050


def struck(freq_hz: float = 900.0, decay_per_s: float = 20.0, count: int = SR // 2) -> np.ndarray:
    time = np.arange(count) / SR
    return 0.3 * np.exp(-decay_per_s * time) * np.sin(2 * np.pi * freq_hz * time)


def speech(seconds: float = 1.2) -> np.ndarray:
    """A glottal pulse train of gliding pitch through three moving formants, in syllables."""
    count = int(seconds * SR)
    time = np.arange(count) / SR
    pulse = np.diff(np.floor(np.cumsum(120 + 25 * np.sin(2 * np.pi * 1.3 * time) + 10 * time) / SR), prepend=0)
    sound = pulse
    for k, (low, high, width) in enumerate(((300, 750, 80), (900, 2100, 100), (2400, 2900, 150))):
        freq = low + (high - low) * 0.5 * (1 + np.sin(2 * np.pi * (1.7 + 0.6 * k) * time + k))
        r, a, b, out = np.exp(-np.pi * width / SR), 0.0, 0.0, np.zeros(count)
        turn = 2 * r * np.cos(2 * np.pi * freq / SR)
        for i in range(count):
            a, b = sound[i] + turn[i] * a - r * r * b, a
            out[i] = a
        sound = out / np.abs(out).max()
    return 0.5 * sound * np.clip(np.sin(2 * np.pi * 2.2 * time) + 0.3, 0, 1)


def test_speech_gives_no_feature() -> None:
    x = np.concatenate([np.zeros(SR // 5), speech()]) + 1e-4 * np.random.default_rng(1).standard_normal(
        SR // 5 + int(1.2 * SR)
    )
    said = extract(x, SR)
    assert "not an impact" in said.note and len(said.freq_hz) == 0


def test_noise_gives_no_feature() -> None:
    said = extract(0.1 * np.random.default_rng(1).standard_normal(SR // 2), SR)
    assert "not an impact" in said.note and len(said.freq_hz) == 0


def test_a_short_clip_claims_no_more_than_it_holds() -> None:
    """28 ms: a decay of 2 1/s comes with a spread that covers what noise makes of it, or not at all; one of 400 1/s is
    told.
    """
    rng = np.random.default_rng(2)
    for decay, noise in ((2.0, 0.1), (400.0, 3e-4), (400.0, 3e-3)):
        said = extract(struck(decay_per_s=decay)[: SR // 36] + noise * rng.standard_normal(SR // 36), SR)
        assert "ms of sound" in said.note
        assert np.abs(said.decay_per_s[:1] - decay) == pytest.approx(0, abs=4 * said.decay_sd_per_s[:1].sum() + 1e-9)
        assert len(said.freq_hz) <= 1 and (len(said.freq_hz) == 1 or decay == 2.0)


def test_clipping_is_told() -> None:
    x = 5 * struck() + 1e-4 * np.random.default_rng(3).standard_normal(SR // 2)
    assert "clipped" in extract(np.clip(x, -1, 1), SR).note
    assert "clipped" not in extract(x / 6, SR).note


def test_low_rate_is_told() -> None:
    time = np.arange(8000) / 8000
    x = 0.3 * np.exp(-20 * time) * np.cos(2 * np.pi * 900 * time) + 1e-4 * np.random.default_rng(4).standard_normal(
        8000
    )
    said = extract(x, 8000)
    assert "nothing above 3920 Hz" in said.note
    assert said.freq_hz == pytest.approx([900], abs=0.05)


def test_beats_are_no_second_hit_and_a_second_hit_is() -> None:
    rng = np.random.default_rng(5)
    noise = 1e-4 * rng.standard_normal(SR)
    beating = struck(600, 3, SR) + struck(611, 3, SR) + struck(1500, 5, SR) + struck(1527, 5, SR)
    assert onset.span(beating + noise, SR).hits == 1
    twice = struck(600, 8, SR) + struck(1500, 9, SR) + struck(4000, 20, SR)
    twice[SR // 2 :] += twice[: SR // 2].copy()
    found = onset.span(twice + noise, SR)
    assert found.hits == 2 and abs(found.stop - SR // 2) < 0.012 * SR


def test_a_sound_that_grows_is_told() -> None:
    time = np.arange(SR) / SR
    x = 0.1 * (0.1 + time) * np.sin(2 * np.pi * 900 * time) + 1e-5 * np.random.default_rng(6).standard_normal(SR)
    said = extract(x, SR, onset_s=0.0)
    assert "grows" in said.note


@pytest.mark.parametrize(
    "broken",
    [np.zeros(SR), np.full(SR, np.nan), np.zeros((2, SR)), struck()[:300], np.zeros(0)],
    ids=["silent", "nan", "two", "short", "empty"],
)
def test_what_cannot_be_read_is_an_error(broken: np.ndarray) -> None:
    with pytest.raises(AudioError):
        extract(broken, SR)


def test_a_band_outside_the_rate_is_an_error() -> None:
    with pytest.raises(AudioError, match="band"):
        extract(struck(), SR, band_hz=(12_000, 20_000))
