"""A material goes in, recordings are made of it, and it comes back: with its spreads, or with the reason why not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.material_fit import CaseFit, fit_case
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum, lines_sound, strike_modes
from sonic_bullet.records import Material
from sonic_bullet.records.errors import AudioError, FileError, MeshError
from sonic_bullet.signal.log_spectral import floor_of, log_spectral_db, noise_floor_db, with_noise
from tests.made.case import SR, Planted, make

BRASS = Material.isotropic("made", youngs_pa=1.04e11, poisson=0.345, density_kg_m3=8500, alpha_per_s=6.0, beta_s=3e-8)
GUESS = (1.25e11, 8000.0, 0.31)  # E and E/ρ off by 20 and 28 %, ν by 0.035


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Planted, CaseFit]:
    made = make(tmp_path_factory.mktemp("bar"), BRASS, guess=GUESS)
    return made, fit_case(read_case(made.folder))


@pytest.mark.slow
def test_planted_material_comes_back(planted: tuple[Planted, CaseFit]) -> None:
    _, found = planted
    fit = found.fit
    assert fit.verdict == "fitted"
    gamma = BRASS.youngs_pa / BRASS.density_kg_m3
    sd = np.sqrt(np.diag(fit.covariance))
    assert abs(fit.gamma_m2_s2 / gamma - 1) < 1e-4
    # the polynomials of truth and fit differ in number: torsion by 1.1e-4
    assert abs(fit.poisson_ratio - 0.345) < 5e-4 < sd[4]
    for value, truth, spread in ((fit.alpha_per_s, 6.0, sd[0]), (fit.beta_s, 3e-8, sd[1])):
        assert abs(np.log(value / truth)) < 4 * spread < 0.02  # within what the noise allows, and that is little
    assert not found.warnings


def test_gain_is_the_cases_own(planted: tuple[Planted, CaseFit]) -> None:
    made, found = planted
    # shapes go with 1/ρ, and ρ is the guess's: the gain takes what that gets wrong
    assert found.fit.sigma == pytest.approx(made.gain * found.density_kg_m3 / BRASS.density_kg_m3, rel=2e-3)
    assert any("density" in line for line in found.assumed)


def test_modes_are_the_bodys(planted: tuple[Planted, CaseFit]) -> None:
    made, found = planted
    truth = made.model.freq_hz
    nearest = np.abs(np.log(found.fit.freq_hz[:, None] / truth)).min(axis=1)
    assert len(found.fit.freq_hz) == len(truth)
    assert nearest.max() < 1e-4


def test_held_out_strike_is_predicted_to_the_noise(planted: tuple[Planted, CaseFit]) -> None:
    _, found = planted
    held = next(r for r in found.case.recordings if r.split == "holdout")
    observed, sr = soundfile.read(str(held.file))
    made = damped_sum(*strike_modes(found, held, sr), len(observed), sr)
    o = found.objects[0].evidence
    assert o.signals is not None
    floor = floor_of(o.signals[0] - lines_sound(o.lines, 0, o.signals.shape[1], o.sr))
    assert log_spectral_db(observed, with_noise(made, floor, 7), floor) < noise_floor_db(made, floor) + 0.2
    assert log_spectral_db(observed, with_noise(2 * made, floor, 7), floor) > noise_floor_db(made, floor) + 3


@pytest.mark.slow
def test_constant_loss_is_no_rayleigh_damping(planted: tuple[Planted, CaseFit], tmp_path: Path) -> None:
    made, _ = planted
    make(tmp_path, BRASS, guess=GUESS, decay=1e-3 * np.pi * made.model.freq_hz)
    found = fit_case(read_case(tmp_path))
    assert found.fit.verdict.startswith("misfit: decays scatter by")
    assert found.fit.poisson_ratio == pytest.approx(0.345, abs=2e-3)  # what is right stays right


@pytest.mark.slow
def test_foreign_line_is_named(planted: tuple[Planted, CaseFit], tmp_path: Path) -> None:
    make(tmp_path, BRASS, guess=GUESS)
    t = np.arange(int(0.8 * SR)) / SR
    for path in tmp_path.glob("s*.wav"):
        observed, _ = soundfile.read(path)
        soundfile.write(path, observed + 0.1 * np.exp(-20 * t) * np.sin(2 * np.pi * 1733 * t), SR, subtype="FLOAT")
    found = fit_case(read_case(tmp_path))
    assert "belong to no mode (1733 Hz)" in found.fit.verdict
    assert found.fit.alpha_per_s == pytest.approx(6.0, rel=0.02)


def test_one_line_tells_neither_alpha_nor_beta_nor_poisson(planted: tuple[Planted, CaseFit], tmp_path: Path) -> None:
    made, _ = planted
    case = json.loads((made.folder / "case.json").read_text())
    case["recordings"] = [
        {"features": [{"freq_hz": float(made.model.freq_hz[0]), "decay_per_s": 4.0}], "object": "box", "split": "fit"}
    ]
    (tmp_path / "box.obj").write_text((made.folder / "box.obj").read_text())
    (tmp_path / "case.json").write_text(json.dumps(case))
    found = fit_case(read_case(tmp_path))
    told = found.fit.verdict
    assert told.startswith("not identifiable")
    assert all(name in told for name in ("alpha", "beta", "poisson_ratio", "sigma"))
    assert np.isnan(found.fit.covariance[[0, 1, 3, 4], [0, 1, 3, 4]]).all()


def test_without_a_mesh_decays_alone_are_told(planted: tuple[Planted, CaseFit], tmp_path: Path) -> None:
    made, _ = planted
    model = made.model
    lines = [
        {"freq_hz": float(f), "decay_per_s": float(d), "decay_sd_per_s": 0.01 * float(d)}
        for f, d in zip(model.freq_hz, model.decay_per_s, strict=True)
    ]
    (tmp_path / "case.json").write_text(
        json.dumps({"format": "sonic-bullet-case/1", "recordings": [{"features": lines}]})
    )
    found = fit_case(read_case(tmp_path))
    assert found.fit.alpha_per_s == pytest.approx(6.0, rel=1e-3)
    assert found.fit.beta_s == pytest.approx(3e-8, rel=1e-3)
    assert "gamma" in found.fit.verdict
    assert np.isnan(found.fit.covariance[2, 2])


@pytest.mark.slow
def test_clamped_body_is_fitted_clamped(tmp_path: Path) -> None:
    fixed = ((-0.07, 0.0, 0.0, 0.016),)
    made = make(tmp_path, BRASS, guess=GUESS, fixed=fixed)
    found = fit_case(read_case(tmp_path))
    assert found.fit.verdict == "fitted"
    assert found.fit.gamma_m2_s2 == pytest.approx(BRASS.youngs_pa / BRASS.density_kg_m3, rel=1e-3)
    assert found.fit.freq_hz[0] == pytest.approx(made.model.freq_hz[0], rel=1e-4)


@pytest.mark.parametrize(
    ("edit", "error", "word"),
    [
        (lambda c: c["recordings"][0]["strike"].update(position=[0, 0, 0.05]), MeshError, "off the surface"),
        (lambda c: c["objects"]["box"].update(units="mm"), MeshError, "across"),
        (lambda c: c["objects"]["box"].update(mesh="none.obj"), FileError, "does not exist"),
        (lambda c: c.update(recordings=[{"file": "none.wav", "object": "box"}]), FileError, "no such file"),
        (lambda c: c.update(recordings=[{"file": "quiet.wav", "object": "box"}]), AudioError, "silent"),
        (lambda c: c.update(recordings=[{"file": "clipped.wav", "object": "box"}]), AudioError, "clipped"),
        (lambda c: c.update(recordings=[{"file": "nan.wav", "object": "box"}]), AudioError, "NaN"),
        (
            lambda c: c.update(recordings=[{"file": "short.wav", "object": "box"}]),
            AudioError,
            "short.wav holds 50 samples",
        ),
        (lambda c: c.update(recordings=[{"file": "noise.wav", "object": "box"}]), AudioError, "no damped sinusoid"),
        (lambda c: c.update(recordings=[{"file": "text.wav", "object": "box"}]), FileError, "cannot read"),
    ],
)
def test_bad_evidence_is_one_line(
    planted: tuple[Planted, CaseFit], tmp_path: Path, edit: object, error: type[Exception], word: str
) -> None:
    made, _ = planted
    case = json.loads((made.folder / "case.json").read_text())
    edit(case)  # type: ignore[operator]
    for name in ("box.obj", "s0.wav", "s1.wav", "s2.wav", "s3.wav"):
        (tmp_path / name).write_bytes((made.folder / name).read_bytes())
    n = 20_000
    loud = np.clip(3 * np.sin(np.arange(n) * 0.05), -1, 1)
    soundfile.write(tmp_path / "quiet.wav", np.zeros(n), SR)
    soundfile.write(tmp_path / "clipped.wav", loud, SR)
    soundfile.write(tmp_path / "nan.wav", np.where(np.arange(n) == 5, np.nan, 0.5), SR, subtype="FLOAT")
    soundfile.write(tmp_path / "short.wav", np.sin(np.arange(50) * 0.5), SR, subtype="FLOAT")
    soundfile.write(tmp_path / "noise.wav", 0.1 * np.random.default_rng(0).standard_normal(n), SR, subtype="FLOAT")
    (tmp_path / "text.wav").write_text("not audio")
    (tmp_path / "case.json").write_text(json.dumps(case))
    with pytest.raises(error, match=word) as caught:
        fit_case(read_case(tmp_path))
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.shared
def test_practice_01(shared_path: Path) -> None:
    case = read_case(shared_path / "practice" / "practice-01")
    truth = json.loads((shared_path / "practice" / "practice-01" / "truth.json").read_text())
    found = fit_case(case)
    assert found.fit.verdict == "fitted"
    assert found.fit.alpha_per_s == pytest.approx(truth["alpha"], rel=5e-3)
    assert found.fit.beta_s == pytest.approx(truth["beta"], rel=5e-3)
    gap = np.abs(np.log(np.array(truth["modes_hz"])[:, None] / found.objects[0].model_hz)).min(axis=1)
    assert gap.max() < 3e-3
    o = found.objects[0].evidence
    assert o.signals is not None
    floor = floor_of(o.signals[0] - lines_sound(o.lines, 0, o.signals.shape[1], o.sr))
    held = [r for r in case.recordings if r.split == "holdout"]
    assert len(held) == 3
    for r in held:
        observed, sr = soundfile.read(str(r.file))
        made = damped_sum(*strike_modes(found, r, sr), len(observed), sr)
        assert log_spectral_db(observed, with_noise(made, floor, 5), floor) < noise_floor_db(made, floor) + 0.5
    assert np.abs(found.objects[0].correction).max() <= 0.01
