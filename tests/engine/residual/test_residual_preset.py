"""A residual in a preset file: small, exact to a quarter of a decibel, refused in one line where it cannot be; and
the command that makes it.
"""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sonic_bullet.effects.presets_of_effects import with_modes
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.residual.offline import synthesize_lines
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.engine.runtime.residual_voice import build_residual_voice
from sonic_bullet.files import presets, read_log, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.residual_code import form_of, residual_of
from sonic_bullet.lab.fit.prediction_of_lines import lines_sound
from sonic_bullet.lab.lines.joint_lines import joint_lines
from sonic_bullet.lab.residual.recorded_strikes import recording_strikes, strikes_of
from sonic_bullet.records import Air, Material, Microphone, Residual
from sonic_bullet.records.errors import AudioError, MaterialError, RecordError
from tests.made.models import box_body, row, step, wall_body
from tests.made.residuals import SR, modes, residual

SOURCE = modes((400.0, 900.0, 1500.0, 2600.0), (8.0, 12.0, 20.0, 30.0), (1.0, 0.7, 0.5, 0.3))
MADE = residual(SOURCE, lines=((1200.0, 8.0, 0.3),))


def saved(folder: Path, **changes: object) -> str:
    """Path of a wooden preset with the residual, its fields changed."""
    preset = msgspec.structs.replace(presets.named_preset("wood"), residual=form_of(MADE))
    content = json.loads(msgspec.json.encode(preset))
    content["residual"] |= changes
    path = folder / "mine.json"
    path.write_text(json.dumps(content))
    return str(path)


def test_a_residual_comes_back_from_its_preset(tmp_path: Path) -> None:
    material = presets.load_material(saved(tmp_path))
    got = material.residual
    assert got is not None
    assert 10 * np.abs(np.log10(got.power_per_hz / MADE.power_per_hz)).max() <= 0.2501
    for name in (
        "mode_freq_hz",
        "mode_decay_per_s",
        "mode_amplitude",
        "line_freq_hz",
        "line_amplitude",
        "freq_hz",
        "time_s",
    ):
        assert getattr(got, name) == pytest.approx(getattr(MADE, name), rel=1e-8)
    assert presets.load_material("wood").residual is None
    assert residual_of(form_of(got)).power_per_hz == pytest.approx(got.power_per_hz, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"levels": "###"}, "base64"),
        ({"levels": ""}, "levels for"),
        ({"levels": base64.b64encode(b"abc").decode()}, "3 levels for"),
        ({"mode_freq_hz": [], "mode_decay_per_s": [], "mode_amplitude": []}, "without modes"),
        ({"mode_amplitude": [0.0, 0.0, 0.0, 0.0]}, "without modes"),
        ({"mode_freq_hz": [900.0, 400.0, 1500.0, 2600.0]}, "does not ascend"),
        ({"mode_decay_per_s": [1.0, 2.0]}, "shape"),
        ({"line_amplitude": [-1.0]}, "below zero"),
        ({"freq_hz": [], "time_s": [], "levels": ""}, "empty"),
        ({"loudest_per_hz": 1e9}, "louder than the recordings"),
        ({"loudest_per_hz": -1.0}, "loudest_per_hz"),
        ({"clip_energy": 1e-12}, "louder than the recordings"),
        ({"clip_energy": 0.9 * MADE.energy}, "louder than the recordings"),
        ({"mode_amplitude": [1e-9, 0.0, 0.0, 0.0]}, "too faint"),
        ({"mode_freq_hz": [400.0, 900.0, 1500.0, 1e300]}, "1e.300"),
        ({"mode_decay_per_s": [8.0, 12.0, 20.0, 1e30]}, "1e.30"),
        ({"line_freq_hz": [1e-9]}, "1e-09 Hz"),
        ({"line_amplitude": [1e300]}, "1e.300"),
        ({"colour": 1}, "colour"),
        ({"time_s": "long"}, "time_s"),
    ],
)
def test_a_wrong_residual_is_one_line_that_names_the_file(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(MaterialError, match=words) as caught:
        presets.load_material(saved(tmp_path, **changes))
    assert "mine.json" in str(caught.value)
    assert "\n" not in str(caught.value)


EFFECTS = [
    {"id": "damping-law", "law": "constant-loss", "eta": 0.004},
    {"id": "amplitude-pitch", "bend": 50.0, "measure": "velocity"},
    {"id": "amplitude-damping", "choke": 30.0, "measure": "velocity", "alpha_per_s": 8.0, "beta_s": 1e-8, "power": 2.0},
]


def test_a_preset_with_effects_and_a_residual_plays_both(tmp_path: Path) -> None:
    """Modes bend and choke by the effects, and the residual's lines do as the modes they follow; other than with either
    alone; the log keeps both.
    """
    path = Path(saved(tmp_path))
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"effects": EFFECTS}))
    both = presets.load_material(str(path))
    assert both.residual is not None and len(both.effects) == len(EFFECTS)
    body = box_body((0.2, 0.1, 0.01), (400.0, 900.0, 1500.0, 2600.0), both)
    assert body.model is not None

    def log(material: Material) -> ContactLog:
        bodies = replace(body, material=material, model=with_modes(body.model, material)), wall_body()
        hit = row(0, 1, (0, 0, -0.2), normal=(0, 0, -1), point_a=(0.03, 0.02, 0.005))
        steps = tuple(step([(0, 0, 0), (0, 0, 0.01)], hit if i == 2 else None) for i in range(60))
        return ContactLog(bodies, steps, (Microphone([0, 0, 1.0]),), SR, 0)

    whole = log(both)
    sound, plain = render_log(whole), render_log(whole, residual=False)
    linear, straight = (
        render_log(log(replace(both, effects=()))),
        render_log(log(replace(both, effects=())), residual=False),
    )
    assert np.isfinite(sound).all()
    assert all(
        np.abs(a - b).max() > 1e-3 * np.abs(a).max()
        for a, b in ((sound, plain), (sound, linear), (plain, straight), (sound - plain, linear - straight))
    )
    resonator = build_resonator(whole.bodies[0], (), SR, Air())
    beside = build_residual_voice(resonator, SR, Air())
    assert (
        beside is not None
        and beside.lines.bend is not None
        and beside.lines.damping_growth is not None
        and resonator.bend is not None
        and resonator.damping_growth is not None
    )
    assert (beside.lines.bend == resonator.bend[beside.follows]).all() and beside.lines.bend.all()
    assert (
        beside.lines.damping_growth == resonator.damping_growth[beside.follows]
    ).all() and beside.lines.damping_growth.all()
    assert beside.lines.damping_growth_power == resonator.damping_growth_power == 2.0
    whole.save(tmp_path / "both.npz")
    assert (render_log(read_log(tmp_path / "both.npz")) == sound).all()


def test_records_of_a_residual_prove_themselves() -> None:
    with pytest.raises(RecordError, match="NaN"):
        Residual(*(getattr(MADE, name) for name in Residual.__slots__[:8]), MADE.power_per_hz * np.nan, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        MADE.power_per_hz[0, 0] = 1.0


def clip(seconds: float = 1.0) -> np.ndarray:
    return synthesize_lines(SOURCE.freq_hz, SOURCE.decay_per_s, 0.2 * SOURCE.amplitude, round(seconds * SR), SR)


@pytest.mark.slow
def test_a_purely_modal_clip_of_the_model_leaves_nothing() -> None:
    """Residual energy at most -40 dB of the clip's, features found, not given: 24 modes with six pairs too close to
    be told apart, noise 80 dB below the peak.

    A line that the model lacks, 20 dB below the clip, is left all the same.
    """
    random = np.random.default_rng(3)
    n = SR // 2
    single = np.geomspace(500.0, 11_000.0, 18)
    freq = np.sort(np.concatenate([single, single[6::2] * (1 + np.array([5e-4, 2e-3, 4e-3, 8e-3, 5e-4, 2e-3]))]))
    decay = 0.5 * (20 + 5e-7 * (2 * np.pi * freq) ** 2)
    played = random.uniform(0.1, 1.0, (2, len(freq))) * random.choice([-1, 1], (2, len(freq)))
    modal = np.stack([synthesize_lines(freq, decay, -1j * a, n, SR) for a in played])
    foreign = synthesize_lines(np.array([3333.0]), np.array([30.0]), np.array([1.0]), n, SR)
    shares, line_hz = [], []
    for level in (0.0, 0.1 * np.sqrt((modal**2).sum() / 2 / (foreign**2).sum())):
        signals = modal + level * foreign + 1e-4 * np.abs(modal).max() * random.normal(size=modal.shape)
        lines = joint_lines(signals, SR)
        left = signals - np.stack([lines_sound(lines, i, n, SR) for i in range(2)])
        found = strikes_of(
            signals,
            left,
            SR,
            (lines.freq_hz, np.nan_to_num(lines.decay_per_s), lines.amplitude),
            (freq, decay, -1j * played),
            "made",
        ).residual
        shares.append(found.share_of_clip)
        line_hz.append(found.line_freq_hz[np.argmax(found.line_amplitude)] if len(found.line_freq_hz) else 0.0)
    assert shares[0] <= 1e-4
    assert shares[1] == pytest.approx(0.01, rel=0.3)
    assert line_hz[1] == pytest.approx(3333.0, abs=1.0)


def test_what_modes_lack_is_left_and_what_they_have_is_not() -> None:
    """A foreign line stays, at its level; a mode of half the level leaves √¾ of the feature; one of twice the level
    leaves nothing; a burst of noise is cells.
    """
    random = np.random.default_rng(1)
    n = SR
    features = (
        np.array([400.0, 900.0, 1500.0, 2000.0]),
        np.array([8.0, 12.0, 20.0, 15.0]),
        np.array([[1.0, 0.7, 0.5, 0.25]]),
    )
    burst = 0.2 * random.normal(size=n) * np.exp(-100 * np.arange(n) / SR)
    sound = synthesize_lines(features[0], features[1], features[2][0], n, SR) + burst + 1e-4 * random.normal(size=n)
    model = features[0][:3], features[1][:3], np.array([[0.5, 1.4, 0.5]])
    found = strikes_of(sound[None], burst[None], SR, features, model, "made").residual
    unit = model[2].max()
    assert found.line_freq_hz == pytest.approx([400.0, 2000.0])
    assert unit * found.line_amplitude == pytest.approx([np.sqrt(0.75), 0.25], rel=0.02)
    noise = 2 * np.trapezoid(np.trapezoid(found.power_per_hz, found.time_s, axis=1), found.freq_hz) * unit**2
    assert noise == pytest.approx(float((burst**2).sum() / SR), rel=0.5)


@pytest.mark.slow
def test_a_recording_without_shape_has_its_features_for_modes(tmp_path: Path) -> None:
    sound = (
        clip()
        + 0.05 * np.random.default_rng(2).normal(size=SR) * np.exp(-80 * np.arange(SR) / SR)
        + 1e-4 * np.random.default_rng(5).normal(size=SR)
    )
    strikes = recording_strikes(np.concatenate([np.zeros(2400), sound]), SR, 0.05, "tap.wav")
    assert len(strikes.mode_hz) >= 4
    assert (strikes.residual.power_per_hz > 0).sum() > 20
    assert strikes.residual.share_of_clip < 0.1
    with pytest.raises(AudioError, match="silent"):
        recording_strikes(np.zeros(SR), SR, None, "silence.wav")
    write_audio(str(tmp_path / "tap.wav"), sound[None], SR)


@pytest.mark.slow
def test_the_command_writes_a_preset_that_plays(tmp_path: Path) -> None:
    from click.testing import CliRunner

    from sonic_bullet.apps.cli import cli

    sound = clip(0.6) + 0.05 * np.random.default_rng(2).normal(size=round(0.6 * SR)) * np.exp(
        -80 * np.arange(round(0.6 * SR)) / SR
    )
    write_audio(str(tmp_path / "tap.wav"), sound[None], SR)
    preset, picture = tmp_path / "tap.json", tmp_path / "tap.png"
    run = CliRunner()
    done = run.invoke(
        cli,
        [
            "residual",
            str(tmp_path / "tap.wav"),
            "--material",
            "wood",
            "--onset",
            "0",
            "-o",
            str(preset),
            "--picture",
            str(picture),
            "--json",
        ],
    )
    assert done.exit_code == 0, done.output
    assert presets.load_material(str(preset)).residual is not None
    assert picture.stat().st_size > 10_000
    assert preset.stat().st_size < 0.3 * (tmp_path / "tap.wav").stat().st_size
    for words, message in (
        (["residual", str(tmp_path / "tap.wav"), "-o", str(preset)], "--material missing"),
        (["residual", str(tmp_path / "no.wav"), "--material", "wood", "-o", str(preset)], "no.wav"),
        (
            ["residual", str(tmp_path / "tap.wav"), "--material", "wood", "--strike", "0,0,0", "-o", str(preset)],
            "without a shape",
        ),
        (["residual", str(tmp_path / "tap.wav"), "--material", "wood", "-o", "preset.txt"], "json"),
        (
            ["residual", str(tmp_path / "tap.wav"), "--material", "wood", "--onset", "nan", "-o", str(preset)],
            "Invalid value for '--onset'",
        ),
    ):
        failed = run.invoke(cli, words)
        assert failed.exit_code != 0
        assert message in f"{failed.exception} {failed.output}"
    assert "--no-residual" in run.invoke(cli, ["render", "--help"]).output
