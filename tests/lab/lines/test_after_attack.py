"""Lines of what rings after the attack: of made takes whose attack is no sum of modes, and of real ones."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.records import Array
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

SR = 16_000
TIME = np.arange(SR) / SR
BAND = (20.0, 7_500.0)
MODES = ((412.0, 3.0, 0.1), (1170.0, 8.0, 0.2), (1920.0, 12.0, 0.15), (6240.0, 40.0, 0.3))


def take(seed: int, modes: tuple[tuple[float, float, float], ...] = MODES, room: float = 0.0) -> Array:
    """A tap with a slap of 5 ms as loud as all modes, noise, and a room's decaying noise."""
    rng = np.random.default_rng(seed)
    sound = sum(
        a * rng.uniform(0.5, 1.5) * np.exp(-d * TIME) * np.cos(2 * np.pi * f * TIME + rng.uniform(0, 6))
        for f, d, a in modes
    )
    slap = 2.0 * rng.standard_normal(len(TIME)) * np.exp(-TIME / 6e-4)
    reverberation = room * rng.standard_normal(len(TIME)) * np.exp(-20 * TIME)
    return np.asarray(sound + slap + reverberation + 1e-4 * rng.standard_normal(len(TIME)))


@parametrize_few("room", [0.0, 0.003], (1,))
def test_an_attack_makes_no_lines(room: float) -> None:
    lines = ringing_lines(take(1, room=room)[None], SR, BAND, signed=True)
    assert len(lines.freq_hz) == len(MODES)
    for k, (freq, decay, _) in enumerate(MODES):
        assert abs(lines.freq_hz[k] - freq) < 4 * lines.freq_sd_hz[k] + 0.01
        assert abs(lines.decay_per_s[k] - decay) < 4 * lines.decay_sd_per_s[k] + 0.05


def test_takes_share_poles_and_amplitudes_are_their_own() -> None:
    takes = np.stack([take(seed) for seed in (2, 3, 4)])
    lines = ringing_lines(takes, SR, BAND, signed=True)
    assert lines.amplitude.shape == (3, len(MODES))
    for k, (_, _, level) in enumerate(MODES):
        assert np.all((np.abs(lines.amplitude[:, k]) > 0.4 * level) & (np.abs(lines.amplitude[:, k]) < 1.6 * level))
        assert np.ptp(np.abs(lines.amplitude[:, k])) > 0.05 * level


@pytest.mark.slow
def test_spreads_are_those_of_many_draws() -> None:
    """Errors over their spreads have a variance of one, within what 5 draws of 4 modes let differ."""
    off = []
    for seed in range(5):
        lines = ringing_lines(take(10 + seed, room=0.002)[None], SR, BAND, signed=True)
        for freq, _, _ in MODES:
            k = int(np.argmin(np.abs(lines.freq_hz - freq)))
            off.append((lines.freq_hz[k] - freq) / lines.freq_sd_hz[k])
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 2.0


@parametrize_few("seed", range(5), 2)
def test_noise_has_no_lines(seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal(SR)[None]
    assert len(ringing_lines(noise, SR, BAND, signed=True).freq_hz) <= 1


def test_beating_twins_are_two_lines_and_cancel_nothing() -> None:
    twins = ((1170.0, 4.0, 0.2), (1173.0, 4.0, 0.2))
    lines = ringing_lines(take(5, twins)[None], SR, BAND, signed=True)
    assert np.allclose(lines.freq_hz, (1170, 1173), atol=0.05)
    assert np.abs(lines.amplitude).max() < 0.35


@pytest.mark.slow
@pytest.mark.shared
def test_the_bar_of_a_real_set(shared_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """E within 1 % of ASTM E1876's 214.9 GPa from f1 alone, f1 a mode, at most 10 lines."""
    monkeypatch.chdir(tmp_path)
    source = shared_path / "measured" / "pyrfda-steel-bar"
    told = json.loads((source / "case.json").read_text())
    shutil.copy(source / told["files"][0]["file"], "bar.flac")
    shutil.copy(source / "mesh" / "bar.obj", "bar.obj")
    density = told["mass_kg"] / float(np.prod(list(told["dimensions_m"].values())))
    bar = {
        "mesh": "bar.obj",
        "units": "m",
        "material": "steel",
        "elastic_guess": {"youngs_modulus": 2e11, "density": density, "poisson_ratio": 0.29},
    }
    case = {
        "format": "sonic-bullet-case/1",
        "case": "bar",
        "objects": {"bar": bar},
        "recordings": [{"file": "bar.flac", "object": "bar"}],
        "sensor": {"type": "microphone"},
    }
    Path("case.json").write_text(json.dumps(case))
    assert run("fit", ".", "--json", "fit.json", "-o", "bar.json") == 0
    found = json.loads(Path("fit.json").read_text())
    assert len(found["lines"]) <= 10
    assert found["gamma_m2_s2"] * density == pytest.approx(214.9e9, rel=0.01)
    assert "gamma" not in found["verdict"].split("not identifiable")[-1]
    assert min(abs((line["mode_hz"] or 0) - told["files"][0]["main_lines"][0]["f_hz"]) for line in found["lines"]) < 1
