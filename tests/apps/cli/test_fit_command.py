"""`sonic-bullet fit`: from a file to a preset that plays, and one line where it cannot."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.apps.cli import main
from sonic_bullet.files.presets import load_material, read_preset
from sonic_bullet.records import Material
from tests.few_cases import parametrize_few
from tests.made.case import make

KEYS = {
    "alpha_per_s",
    "beta_s",
    "gamma_m2_s2",
    "sigma",
    "poisson_ratio",
    "covariance",
    "dimension_tolerance",
    "verdict",
    "log_spectral_db",
    "takes",
    "next_measurement",
    "modes",
    "lines",
}
BRASS = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = make(tmp_path_factory.mktemp("bar"), BRASS, (0.12, 0.025, 0.006), guess=(1.1e11, 8400.0, 0.34), strikes=3)
    return made.folder


def run(*words: object) -> int:
    sys.argv = ["sonic-bullet", *map(str, words)]
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.slow
def test_case_to_preset_json_and_picture(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert (
        run(
            "fit",
            folder,
            "-o",
            tmp_path / "p.json",
            "--picture",
            tmp_path / "p.png",
            "--csv",
            tmp_path / "p.csv",
            "--json",
        )
        == 0
    )
    told: dict[str, Any] = json.loads(capfd.readouterr().out)
    assert set(told) == KEYS
    assert told["verdict"] == "fitted"
    assert 0 < told["log_spectral_db"] < 3
    assert told["alpha_per_s"] == pytest.approx(8.0, rel=5e-3)
    assert np.array(told["covariance"], float).shape == (5, 5)
    assert set(told["modes"][0]) == {"freq_hz", "decay_per_s", "amplitude"}
    mode = next(line for line in told["lines"] if line["mode_hz"] is not None)
    assert mode["freq_hz"] == pytest.approx(mode["mode_hz"], rel=1e-3)
    assert mode["t60_s"] == pytest.approx(np.log(1000) / mode["decay_per_s"])
    assert mode["loss_factor"] * mode["q"] == pytest.approx(1.0)
    head, *rows = (tmp_path / "p.csv").read_text().splitlines()
    assert head.split(",") == list(mode) and len(rows) == len(told["lines"])
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    preset = read_preset(tmp_path / "p.json")
    assert preset.provenance is not None
    assert preset.provenance.verdict == "fitted"
    assert preset.provenance.parameters["alpha_per_s"] == told["alpha_per_s"]
    assert load_material(tmp_path / "p.json").beta_s == told["beta_s"]


@pytest.mark.slow
def test_preset_plays_at_once(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("fit", folder, "-o", tmp_path / "p.json") == 0
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    import sonic_bullet
    from sonic_bullet.simulators import disconnect

    client = BulletClient(pybullet.DIRECT)
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(pybullet.GEOM_PLANE))
    box = client.createMultiBody(
        0.1,
        client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.06, 0.0125, 0.003]),
        basePosition=[0, 0, 0.05],
    )
    observed = []
    with sonic_bullet.attach(client, microphone=(0, 0.3, 0.3)) as listener:
        listener.add(box, material=tmp_path / "p.json")
        for _ in range(60):
            client.stepSimulation()
            observed.append(listener.frame)
    assert max(float(np.abs(f).max()) for f in observed) > 1e-4
    disconnect(client)  # its finaliser would end whoever has its id next


@pytest.mark.slow
def test_one_recording_of_undeclared_onset(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    observed, sr = soundfile.read(folder / "s0.wav")
    late = np.concatenate([3e-5 * np.random.default_rng(1).standard_normal(3000), observed])
    soundfile.write(tmp_path / "late.wav", late, sr, subtype="FLOAT")
    case = json.loads((folder / "case.json").read_text())
    strike = ",".join(map(str, case["recordings"][0]["strike"]["position"]))
    at = ",".join(map(str, case["sensor"]["position"]["box"]))
    words = [
        "--mesh",
        folder / "box.obj",
        "--strike",
        strike,
        "--sensor",
        "velocity",
        "--sensor-at",
        at,
        "--sensor-direction",
        "0,0,2",
        "--material",
        "brass",
    ]
    words += ["--medium", "none"]
    assert run("fit", tmp_path / "late.wav", *words, "-o", tmp_path / "p.json", "--json", tmp_path / "f.json") == 0
    told = json.loads((tmp_path / "f.json").read_text())
    assert told["alpha_per_s"] == pytest.approx(8.0, rel=0.02)
    assert told["beta_s"] == pytest.approx(4e-8, rel=0.02)
    assert told["gamma_m2_s2"] == pytest.approx(1.0e11 / 8400, rel=0.005)
    assert "sigma" in told["verdict"]  # no impulse was given


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.wav", "--mesh", "box.obj", "--strike", "0,0,0", "--material", "brass"], "no such file"),
        (["s0.wav"], "--mesh and --strike and --material missing"),
        (["s0.wav", "--mesh", "none.obj", "--strike", "0,0,0", "--material", "brass"], "does not exist"),
        (["s0.wav", "--mesh", "box.obj", "--strike", "0,0,0", "--material", "unobtainium"], "no material"),
        (["s0.wav", "--mesh", "box.obj", "--strike", "0,0,9", "--material", "brass"], "off the surface"),
        (["s0.wav", "--mesh", "box.obj", "--strike", "0,0,0.003", "--material", "brass", "--scale", "1000"], "across"),
        (["box.obj", "--mesh", "box.obj", "--strike", "0,0,0.003", "--material", "brass"], "cannot read"),
        (["s0.wav", "--mesh", "box.obj", "--strike", "0,nan,0", "--material", "brass"], "finite"),
        (
            [
                "s0.wav",
                "--mesh",
                "box.obj",
                "--strike",
                "0,0,0.003",
                "--material",
                "brass",
                "--sensor-direction",
                "0,0,1",
            ],
            "--sensor is pressure",
        ),
        (
            [
                "s0.wav",
                "--mesh",
                "box.obj",
                "--strike",
                "0,0,0.003",
                "--material",
                "brass",
                "--sensor",
                "velocity",
                "--sensor-at",
                "0.1,0,0.003",
                "--sensor-direction",
                "0,0,0",
            ],
            "--sensor-direction is zero",
        ),
        (["."], "out.txt"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    folder: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(folder)
    output = tmp_path / ("out.txt" if said == "out.txt" else "out.json")
    assert run("fit", *words, "-o", output) == 2
    error = capfd.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def spoiled(folder: Path, place: Path, how: str) -> Path:
    """The first strike of a case, spoiled in one way."""
    observed, sr = soundfile.read(folder / "s0.wav")
    t = np.arange(len(observed)) / sr
    if how == "5 ms":  # 20 say the decays of a sound without noise to a percent
        observed = observed[: int(0.005 * sr)]
    elif how == "other rate":
        sr //= 2
    elif how == "tone":
        observed = 0.3 * np.sin(2 * np.pi * 1000 * t)
    elif how == "stereo":
        observed = np.stack([observed, 0.5 * observed], axis=1)
    elif how == "speech":  # pulses of a wavering pitch through three resonances, four syllables a second
        from scipy.signal import lfilter

        voice = np.diff(np.floor(np.cumsum(120 * (1 + 0.1 * np.sin(2 * np.pi * 3 * t))) / sr), prepend=0.0)
        for f, width in ((700, 80), (1220, 90), (2600, 120)):
            r = np.exp(-np.pi * width / sr)
            voice = lfilter([1 - r], [1, -2 * r * np.cos(2 * np.pi * f / sr), r * r], voice)
        voice *= (0.5 + 0.5 * np.sin(2 * np.pi * 4 * t)) ** 2
        observed = 0.5 * voice / np.abs(voice).max() + 1e-4 * np.random.default_rng(0).standard_normal(len(t))
    soundfile.write(place / "spoiled.wav", observed[: sr // 2], sr, subtype="FLOAT")
    return place / "spoiled.wav"


@parametrize_few(("how", "surest"), [("5 ms", 0), ("other rate", 0), ("tone", 0), ("speech", 0), ("stereo", 2)], (0, 3))
def test_what_a_recording_does_not_say_is_not_claimed(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], how: str, surest: int
) -> None:
    strike = ",".join(map(str, json.loads((folder / "case.json").read_text())["recordings"][0]["strike"]["position"]))
    path = spoiled(folder, tmp_path, how)
    code = run(
        "fit",
        path,
        "--mesh",
        folder / "box.obj",
        "--strike",
        strike,
        "--material",
        "brass",
        "-o",
        tmp_path / "p.json",
        "--json",
        tmp_path / "f.json",
    )
    shown = capfd.readouterr()
    if code == 2:
        assert shown.err.count("\n") == 1
        assert "DEBUG" not in shown.err  # a reason, not an accident
        return
    assert code == 0
    told = json.loads((tmp_path / "f.json").read_text())
    told_of = np.array([[x is not None for x in row] for row in told["covariance"]])
    assert told_of.diagonal()[:3].sum() <= surest + 1
    if not surest:
        assert told["verdict"] != "fitted"
        assert not told_of.diagonal()[:2].any()  # neither damping is claimed
        assert not told_of[2, 2] or told["gamma_m2_s2"] == pytest.approx(1.0e11 / 8400, rel=0.02)


def test_clipped_recording_is_refused(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    observed, sr = soundfile.read(folder / "s0.wav")
    soundfile.write(tmp_path / "c.wav", np.clip(8 * observed, -0.5, 0.5), sr)
    assert (
        run(
            "fit",
            tmp_path / "c.wav",
            "--mesh",
            folder / "box.obj",
            "--strike",
            "0,0,0.003",
            "--material",
            "brass",
            "-o",
            tmp_path / "p.json",
        )
        == 2
    )
    assert "is clipped" in capfd.readouterr().err


@pytest.mark.parametrize("name", ["--impulse", "--scale", "--onset"])
def test_numbers_that_are_none_are_refused(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    words = [
        "fit",
        folder / "s0.wav",
        "--mesh",
        folder / "box.obj",
        "--strike",
        "0,0,0.003",
        "--material",
        "brass",
        name,
        "nan",
        "-o",
        tmp_path / "p.json",
    ]
    assert run(*words) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert "DEBUG" not in error


def stereo(folder: Path, place: Path, **entry: Any) -> Path:
    """A case of the first strike in the second of two channels, noise in the first."""
    observed, sr = soundfile.read(folder / "s0.wav")
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(observed))
    soundfile.write(place / "two.wav", np.stack([noise, observed], axis=1), sr, subtype="FLOAT")
    (place / "box.obj").write_text((folder / "box.obj").read_text())
    case = json.loads((folder / "case.json").read_text())
    case["recordings"] = [{**case["recordings"][0], "file": "two.wav", **entry}]
    (place / "case.json").write_text(json.dumps(case))
    return place


def test_the_entrys_channel_is_fitted_and_said(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("fit", stereo(folder, tmp_path, channel=1, chanel=0), "-o", tmp_path / "p.json", "--json") == 0
    out, err = capfd.readouterr()
    assert json.loads(out)["alpha_per_s"] == pytest.approx(8.0, rel=0.02)
    lines = err.splitlines()
    assert len(lines) == 2 and all(line.startswith("sonic-bullet: warning: ") for line in lines)
    assert "field 'chanel' is not known and not read: did you mean 'channel'?" in lines[0]
    assert lines[1].endswith("two.wav: 2 channels: channel 1 is used, counted from 0")


@parametrize_few("command", ["fit", "residual", "diagnose"], 1)
def test_the_first_channel_unless_another_is_named(
    folder: Path, tmp_path: Path, command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(command, stereo(folder, tmp_path), "-o", tmp_path / "p.json") == 2  # noise alone
    assert "no damped sinusoid" in capfd.readouterr().err
    assert run(command, stereo(folder, tmp_path, channel=2), "-o", tmp_path / "p.json") == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.endswith("two.wav has no channel 2; it has 2 channels, 0 to 1")


@pytest.mark.slow
def test_channels_of_a_recording_alone(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    stereo(folder, tmp_path)
    words = ["--mesh", folder / "box.obj", "--strike", "0,0,0.003", "--material", "brass", "-o", tmp_path / "p.json"]
    for command in ("fit", "residual"):
        assert run(command, tmp_path / "two.wav", *words, "--channel", "5") == 2
        assert "has no channel 5; it has 2 channels, 0 to 1" in capfd.readouterr().err
        assert run(command, tmp_path, "-o", tmp_path / "p.json", "--channel", "0") == 2
        assert "--channel given beside a case" in capfd.readouterr().err
    unshaped = ["residual", tmp_path / "two.wav", "--material", "brass", "-o", tmp_path / "p.json"]
    assert run(*unshaped, "--channel", "1") == 0
    assert "2 channels: channel 1 is used" in capfd.readouterr().err
    assert run(*unshaped) == 2  # noise alone
    assert "2 channels: the first is used" in capfd.readouterr().err


def test_a_residual_without_a_recording_is_refused_at_once(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Before a recording is opened, whatever the case holds."""
    monkeypatch.setattr("sonic_bullet.lab.fit.recorded.read_channel", lambda *_: pytest.fail("a recording was read"))
    case = json.loads((stereo(folder, tmp_path) / "case.json").read_text())
    lines = [{"object": "box", "features": [{"freq_hz": 1000.0, "decay_per_s": 3.0}]}]
    (tmp_path / "case.json").write_text(json.dumps(case | {"recordings": lines}))
    assert run("residual", tmp_path, "-o", tmp_path / "p.json") == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "has no 'fit' recording" in line
    assert not (tmp_path / "p.json").exists()


@pytest.mark.parametrize("command", ["fit", "residual", "diagnose"])
def test_a_mesh_that_is_not_there_is_said_at_once(
    folder: Path, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Also where it is the last object's, or one that a diagnosis is only held against."""
    monkeypatch.setattr("sonic_bullet.lab.fit.recorded.read_channel", lambda *_: pytest.fail("a recording was read"))
    case = json.loads((stereo(folder, tmp_path) / "case.json").read_text())
    case["objects"]["other"] = {**case["objects"]["box"], "mesh": "none.obj"}
    split = "transfer" if command == "diagnose" else "fit"
    case["recordings"].append({**case["recordings"][0], "object": "other", "split": split})
    (tmp_path / "case.json").write_text(json.dumps(case))
    assert run(command, tmp_path, "-o", tmp_path / "p.json") == 2
    assert "none.obj' does not exist" in capfd.readouterr().err.splitlines()[-1]
