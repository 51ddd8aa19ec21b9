"""Takes that were not fitted: lines as they were struck on average, distances, and what is worse than silence."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from click.testing import CliRunner

from sonic_bullet.apps.cli import cli
from sonic_bullet.files.cases import Case, read_case
from sonic_bullet.lab.diagnosis.selection import stepwise
from sonic_bullet.lab.fit.fitted_preset import recorded_lines
from sonic_bullet.lab.fit.held_out_takes import predicted_takes
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.fit.typical_strike import typical_strike
from sonic_bullet.lab.lines.joint_lines import Lines
from sonic_bullet.lab.residual.nearest_parts import keep_nearest_parts
from sonic_bullet.lab.residual.recorded_strikes import case_strikes
from sonic_bullet.records import Array, Material
from tests.few_cases import parametrize_few
from tests.made.case import make

SR = 24_000
HZ = np.array([410.0, 1130.0, 2270.0, 3890.0])
DECAY = np.array([9.0, 14.0, 25.0, 40.0])


def lines_of(amplitude: Array) -> Lines:
    """Four lines of takes (s, 4)."""
    s, none = len(amplitude), np.zeros(4)
    return Lines(HZ, DECAY, amplitude.astype(complex), none, none, np.zeros((s, 4)), np.ones(s), np.full(4, 1e6), True)


def test_a_gain_of_a_take_moves_neither_ratios_nor_spreads() -> None:
    rng = np.random.default_rng(3)
    size = rng.uniform(0.1, 1.0, (5, 4)) * np.exp(1j * rng.uniform(0, 6, (5, 4)))
    plain, scaled = typical_strike(lines_of(size)), typical_strike(lines_of(size * 10.0 ** rng.uniform(-2, 2, (5, 1))))
    ratio = np.abs(scaled.amplitude / plain.amplitude)
    assert np.allclose(ratio, ratio[0], rtol=1e-9)
    assert np.allclose(scaled.spread_db, plain.spread_db, atol=1e-9)


def test_takes_that_differ_by_gain_alone_have_no_spread() -> None:
    one = np.array([1.0, 0.5, 0.2, 0.05])
    found = typical_strike(lines_of(np.array([1.0, 3.0, 0.2])[:, None] * one))
    assert np.allclose(found.spread_db, 0, atol=1e-9)
    assert np.allclose(np.abs(found.amplitude) / np.abs(found.amplitude[0]), one, rtol=1e-9)


def case_of(folder: Path, holdouts: int, noise: float = 1e-4, *, seconds: float = 1.0) -> Path:
    """A case of takes of one object without a mesh, each as loud as chance has it."""
    rng, n = np.random.default_rng(11), round(seconds * SR)
    t = np.arange(n) / SR
    rows = []
    for i in range(3 + holdouts):
        size = rng.uniform(0.1, 0.9) * np.array([1.0, 0.6, 0.4, 0.2]) * 10 ** (rng.normal(0, 2, 4) / 20)
        ring = (size[:, None] * np.exp(-DECAY[:, None] * t) * np.cos(2 * np.pi * HZ[:, None] * t)).sum(axis=0)
        sound = np.concatenate([np.zeros(SR // 20), ring]) + noise * rng.standard_normal(n + SR // 20)
        soundfile.write(folder / f"take{i}.wav", 0.3 * sound, SR, subtype="FLOAT")
        rows.append({"file": f"take{i}.wav", "split": "fit" if i < 3 else "holdout"})
    (folder / "case.json").write_text(json.dumps({"format": "sonic-bullet-case/1", "case": "taps", "recordings": rows}))
    return folder


@pytest.mark.slow
def test_a_take_that_was_not_fitted_is_nearer_than_silence_and_about_as_near_as_another(tmp_path: Path) -> None:
    found = fit_case(read_case(case_of(tmp_path, 2)))
    assert [t.split for t in found.takes] == ["holdout", "holdout"]
    for take in found.takes:
        assert take.free_gain and take.predicted_db < take.silence_db / 2
        assert take.predicted_db < 1.5 * take.other_take_db
    assert not found.worse_than_silence


@pytest.mark.slow
def test_fit_says_how_near_each_take_is_and_its_preset_holds_the_lines(tmp_path: Path) -> None:
    folder = case_of(tmp_path, 1)
    out, verdict = tmp_path / "taps_preset.json", tmp_path / "fit.json"
    done = CliRunner().invoke(cli, ["fit", str(folder), "-o", str(out), "--json", str(verdict)])
    assert done.exit_code == 0, done.output
    assert "takes that were not fitted" in done.output and "take3.wav" in done.output
    (take,) = json.loads(verdict.read_text())["takes"]
    assert take["predicted_db"] < take["silence_db"]
    (lines,) = json.loads(out.read_text())["effects"]
    assert lines["id"] == "recorded-lines"
    for hz, decay in zip(HZ, DECAY, strict=True):
        nearest = int(np.argmin(np.abs(np.array(lines["freq_hz"]) - hz)))
        assert abs(lines["freq_hz"][nearest] - hz) < 1e-3 * hz
        assert abs(lines["decay_per_s"][nearest] - decay) < 0.05 * decay


@pytest.mark.slow
def test_what_is_over_in_a_few_cycles_is_no_line_of_a_preset(tmp_path: Path) -> None:
    """Lines of an attack cancel each other with their phases, which a preset does not play."""
    found = fit_case(read_case(case_of(tmp_path, 0)))
    (e,) = found.evidence
    size = np.full((3, 4), 50.0)
    attack = lines_of(size)
    attack = replace(attack, decay_per_s=np.array([9.0, 800.0, 900.0, 1000.0]))
    kept = recorded_lines(replace(found, evidence=(replace(e, lines=attack),)))
    assert kept is not None and kept.freq_hz == (HZ[0],)


def test_a_take_with_a_second_hit_does_not_shorten_the_others(tmp_path: Path) -> None:
    folder = case_of(tmp_path, 0, seconds=0.6)
    alone = fit_case(read_case(folder)).evidence[0]
    sound, _ = soundfile.read(folder / "take2.wav")
    later = round(0.1 * SR)
    sound[later:] += sound[:-later]
    soundfile.write(folder / "take2.wav", sound, SR, subtype="FLOAT")
    (e,) = fit_case(read_case(folder)).evidence
    assert [r.file.name for r in e.recordings if r.file] == ["take0.wav", "take1.wav"]
    assert e.signals is not None and alone.signals is not None and e.signals.shape[1] > 0.95 * alone.signals.shape[1]
    assert any("take2.wav" in note and "read without it" in note for note in e.notes)
    assert e.lines.freq_hz == pytest.approx(HZ, rel=1e-5)
    assert (e.lines.freq_sd_hz < 3 * alone.lines.freq_sd_hz).all()


@pytest.fixture(scope="module")
def placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case of a bar whose strikes have places and impulses."""
    brass = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
    folder = tmp_path_factory.mktemp("bar")
    return make(folder, brass, (0.12, 0.025, 0.006), guess=(1.1e11, 8400.0, 0.34), strikes=3).folder


@pytest.mark.slow
@parametrize_few(("factor", "worse"), [(1.0, False), (3e3, True), (3e4, True)], (1,))
def test_what_is_farther_than_silence_is_said_and_ends_with_one(
    placed: Path, tmp_path: Path, factor: float, worse: bool
) -> None:
    """The impulse of the take held out is stated so many times too large: it is predicted as much too loud."""
    folder = shutil.copytree(placed, tmp_path / "case")
    case = json.loads((folder / "case.json").read_text())
    for entry in case["recordings"]:
        if entry["split"] != "fit":
            entry["strike"]["impulse"] *= factor
    (folder / "case.json").write_text(json.dumps(case))
    out = tmp_path / "p.json"
    done = CliRunner().invoke(cli, ["fit", str(folder), "-o", str(out)])
    assert done.exit_code == (1 if worse else 0), done.output
    verdict = json.loads(out.read_text())["provenance"]["verdict"]
    assert verdict.startswith("worse-than-silence: ") == worse
    assert ("worse-than-silence" in done.output) == worse


@pytest.mark.slow
def test_an_end_farther_than_silence_is_said(placed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A baseline that is 80 dB too loud, whatever fitted it."""
    real = stepwise.refit_material
    monkeypatch.setattr(
        stepwise, "refit_material", lambda base, bodies: replace(h := real(base, bodies), gain=1e4 * h.gain)
    )
    out = tmp_path / "d.json"
    done = CliRunner().invoke(cli, ["diagnose", str(placed), "-o", str(out)])
    assert done.exit_code == 1, done.output
    assert "worse-than-silence" in done.output and "no effect brings it nearer" in done.output
    assert json.loads(out.read_text())["provenance"]["verdict"] == "worse-than-silence"


@pytest.mark.slow
def test_what_lies_outside_the_band_is_no_part_of_a_distance(tmp_path: Path) -> None:
    """A line above the case's band that one take has and the others have not."""
    plain, loud = case_of(tmp_path, 1), tmp_path / "loud"
    case = json.loads((plain / "case.json").read_text()) | {"band_hz": [100.0, 6000.0]}
    (plain / "case.json").write_text(json.dumps(case))
    shutil.copytree(plain, loud)
    sound, _ = soundfile.read(loud / "take3.wav")
    t = np.arange(len(sound) - SR // 20) / SR
    sound[SR // 20 :] += 0.05 * np.exp(-20 * t) * np.sin(2 * np.pi * 9000 * t)
    soundfile.write(loud / "take3.wav", sound, SR, subtype="FLOAT")
    (a,), (b,) = (fit_case(read_case(folder)).takes for folder in (plain, loud))
    assert abs(a.predicted_db - b.predicted_db) < 0.2 and abs(a.silence_db - b.silence_db) < 0.2


@pytest.mark.slow
def test_the_residual_of_an_object_without_a_shape_joins_its_lines(tmp_path: Path) -> None:
    """It is what the takes have beside the lines that the preset plays; the command says how near they are with it."""
    out, told = tmp_path / "p.json", tmp_path / "residual.json"
    words = ["residual", str(case_of(tmp_path, 1)), "-o", str(out), "--json", str(told)]
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.output
    assert "takes that were not fitted" in done.output
    (take,) = json.loads(told.read_text())["takes"]
    assert take["split"] == "holdout" and take["predicted_db"] < 1.5 * take["other_take_db"]
    made = json.loads(out.read_text())
    assert made["residual"] and made["effects"][0]["id"] == "recorded-lines"


def noisy_case(tmp_path: Path) -> Case:
    """A case whose takes begin with noise that fades."""
    folder = case_of(tmp_path, 1)
    rng, n = np.random.default_rng(5), SR // 4
    for path in sorted(folder.glob("take*.wav")):
        sound, _ = soundfile.read(path)
        sound[SR // 20 : SR // 20 + n] += 0.05 * rng.standard_normal(n) * np.exp(-np.arange(n) / (0.03 * SR))
        soundfile.write(path, sound, SR, subtype="FLOAT")
    return read_case(folder)


@pytest.mark.slow
def test_a_residual_brings_takes_nearer_that_begin_with_noise(tmp_path: Path) -> None:
    found = fit_case(noisy_case(tmp_path))
    (lines,), (whole,) = found.takes, predicted_takes(found, residual=case_strikes(found).residual)
    assert whole.predicted_db < lines.predicted_db - 1
    assert whole.predicted_db < 1.5 * whole.other_take_db
    assert np.isnan(lines.levels_db) and whole.levels_db < 1.2 * whole.other_take_levels_db


@pytest.mark.slow
def test_a_part_of_a_residual_that_takes_are_farther_with_is_not_kept(tmp_path: Path) -> None:
    """Noise that swells where the takes' own fades goes; theirs stays."""
    found = fit_case(noisy_case(tmp_path))
    made = case_strikes(found).residual
    turned = replace(made, power_per_hz=made.power_per_hz[:, ::-1], clip_energy=1e4 * made.clip_energy)
    kept = [keep_nearest_parts(found, found.evidence[0], one).power_per_hz for one in (made, turned)]
    assert np.array_equal(kept[0], made.power_per_hz) and kept[0].any() and not kept[1].any()
