"""`sonic-bullet case`: a case.json that `fit` reads, whole or not at all."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
from scipy.signal import lfilter

from sonic_bullet.apps.cli import main
from sonic_bullet.files.case_fields import CASE_FORMAT, CaseFile
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.storage.json_records import record_schema
from tests.made.case import write_box


def run(*words: object) -> int:
    sys.argv = ["sonic-bullet", *map(str, words)]
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def tap(path: Path, freq_hz: tuple[float, ...] = (1310.0, 3570.0, 6900.0)) -> None:
    """A synthetic tap: three damped sinusoids and some noise."""
    t = np.arange(22_050) / 44_100
    sound = sum(0.1 * np.exp(-15 * t) * np.sin(2 * np.pi * f * t) for f in freq_hz)
    soundfile.write(path, sound + 1e-6 * np.random.default_rng(1).standard_normal(len(t)), 44_100, subtype="FLOAT")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two taps and a box beside one another, and the working folder there."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.wav", "b.wav"):
        tap(tmp_path / name)
    write_box(tmp_path / "bar.obj", (0.12, 0.025, 0.006))
    return tmp_path


@pytest.mark.slow
def test_new_writes_a_case_that_fit_reads(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert (
        run(
            "case",
            "new",
            "mine",
            "--mesh",
            "bar.obj",
            "--material",
            "steel",
            "--sensor",
            "pressure",
            "--recordings",
            "a.wav",
            "b.wav",
        )
        == 0
    )
    assert {p.name for p in (place / "mine").iterdir()} == {"case.json", "bar.obj", "a.wav", "b.wav"}
    case = read_case(place / "mine")
    assert [r.split for r in case.recordings] == ["fit", "fit"]
    assert case.sensor == "pressure"
    assert case.objects["object"].youngs_pa == pytest.approx(2e11, rel=0.1)
    capfd.readouterr()
    assert run("case", "check", "mine") == 0
    said = capfd.readouterr().out
    assert "120 × 25 × 6" in said
    assert "0 of 2" in said
    path = place / "mine" / "case.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"band_hz": [20, 4000]}))  # fewer modes: a quicker fit
    assert run("fit", "mine", "-o", "preset.json") == 0
    assert (place / "preset.json").is_file()


def test_new_takes_what_lies_in_the_folder_where_it_is(place: Path) -> None:
    (place / "mine").mkdir()
    for name in ("a.wav", "b.wav"):
        shutil.move(place / name, place / "mine" / name)
    assert run("case", "new", "mine") == 0  # neither shape nor material is known
    case = read_case(place / "mine")
    assert [r.file.name for r in case.recordings if r.file is not None] == ["a.wav", "b.wav"]
    assert case.objects == {}


@pytest.mark.parametrize("sensor", ["sum", "pressure", "velocity"])
def test_the_sensor_is_read_as_it_was_given(place: Path, sensor: str) -> None:
    more = ["--sensor-at", "0.05,0,0.003"] if sensor == "velocity" else []
    assert run("case", "new", "mine", "a.wav", "--sensor", sensor, *more) == 0
    case = read_case(place / "mine")
    assert case.sensor == sensor
    assert (case.sensor_m is not None) == (sensor == "velocity")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.wav", "b.wav"], "is no folder"),
        (["none"], "holds no recordings"),
        (["mine", "none.wav"], "no such file"),
        (["mine", "bar.obj"], "cannot read"),
        (["mine", "a.wav", "--mesh", "bar.obj"], "--material missing"),
        (["mine", "a.wav", "--mesh", "none.obj", "--material", "steel"], "does not exist"),
        (["mine", "a.wav", "--mesh", "bar.obj", "--material", "unobtainium"], "no material"),
        (["mine", "a.wav", "--sensor-at", "0,0,0"], "--sensor is pressure"),
        (["mine", "a.wav", "--sensor", "ear"], "ear"),
        (["mine", "a.wav", "deep/a.wav"], "two files would be called a.wav"),
        (["there", "a.wav"], "is there already"),
        (["other", "a.wav"], "is another file"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    place: Path, capfd: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    for folder in ("deep", "there", "other"):
        (place / folder).mkdir()
    (place / "there" / "case.json").write_text("{}")
    tap(place / "deep" / "a.wav", (900.0,))
    tap(place / "other" / "a.wav", (700.0,))
    before = {p: p.read_bytes() for p in place.rglob("*") if p.is_file()}
    assert run("case", "new", *words) == 2
    error = capfd.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert {p: p.read_bytes() for p in place.rglob("*") if p.is_file()} == before
    assert not (place / "mine").exists()


@pytest.mark.parametrize(
    ("words", "medium"),
    [
        ([], "air"),
        (["--medium", "none"], "none"),
        (["--sensor", "sum"], "unknown"),
        (["--sensor", "sum", "--medium", "air"], "air"),
    ],
)
def test_new_writes_the_medium(place: Path, words: list[str], medium: str) -> None:
    assert run("case", "new", "mine", "a.wav", *words) == 0
    assert read_case(place / "mine").medium == medium
    assert "medium" in json.loads((place / "mine" / "case.json").read_text())


def test_check_names_what_is_not_read_and_refuses_nothing(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("case", "new", "mine", "a.wav") == 0
    path = place / "mine" / "case.json"
    case = json.loads(path.read_text())
    assert not read_case(place / "mine").warnings
    case["recordings"][0] |= {"chanel": 0, "note": "the good one"}
    path.write_text(json.dumps(case | {"medium": "water"}))
    capfd.readouterr()
    assert run("case", "check", "mine") == 0
    said = capfd.readouterr()
    assert "1 fit" in said.out
    assert "field 'chanel' is not known and not read: did you mean 'channel'?" in said.err
    assert "medium 'water' is not known" in said.err
    assert said.err.count("warning") == said.err.count("\n") == 2


@pytest.mark.parametrize(
    ("channel", "code", "words"),
    [(None, 0, "the first is used"), (1, 0, "channel 1 is used"), (2, 2, "has no channel 2")],
)
def test_check_says_which_channel_is_used(
    place: Path, capfd: pytest.CaptureFixture[str], channel: int | None, code: int, words: str
) -> None:
    sound, sr = soundfile.read(place / "a.wav")
    soundfile.write(place / "a.wav", np.stack([sound, 0.5 * sound], axis=1), sr, subtype="FLOAT")
    assert run("case", "new", "mine", "a.wav") == 0
    path = place / "mine" / "case.json"
    case = json.loads(path.read_text())
    case["recordings"][0]["channel"] = channel
    path.write_text(json.dumps(case))
    capfd.readouterr()
    assert run("case", "check", "mine") == code
    error = capfd.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_failed_write_leaves_nothing(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("sonic_bullet.apps.cli.case_command.json_bytes", full)
    assert run("case", "new", "mine", "a.wav") == 2
    assert not (place / "mine").exists()
    assert "disk full" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"recordings": []}, "no recordings"),
        ({"band_hz": [5, 1]}, "band_hz"),
        ({"recordings": [{"file": "gone.wav"}]}, "no such file"),
        ({"format": "x"}, "format 'x'"),
    ],
)
def test_check_names_what_is_wrong(
    place: Path, capfd: pytest.CaptureFixture[str], change: dict[str, object], said: str
) -> None:
    assert run("case", "new", "mine", "a.wav") == 0
    path = place / "mine" / "case.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    capfd.readouterr()
    assert run("case", "check", "mine") == 2
    error = capfd.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_the_schema_names_every_field(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("case", "schema") == 0
    schema = json.loads(capfd.readouterr().out)
    assert schema == record_schema(CaseFile, CASE_FORMAT)
    parts = schema["$defs"]
    assert set(parts) == {
        "CaseFile",
        "Object",
        "ElasticGuess",
        "Support",
        "Fixed",
        "Sensor",
        "Force",
        "Strike",
        "Line",
        "Recording",
    }
    checked = [
        name for part in parts.values() for name, field in part["properties"].items() if field.get("description")
    ]
    assert len(checked) == sum(len(part["properties"]) for part in parts.values()) > 30


def test_a_long_recording_is_cut_into_takes(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Each take holds its own strike, at LEAD_S, in every channel; every third is held out."""
    one, sr = soundfile.read("a.wav")
    at = [4410, 26_000, 60_000, 61_000 + 22_050, 110_000]
    sound = np.zeros((140_000, 2))
    for k, start in enumerate(at):
        sound[start : start + len(one), 0] += (0.3 + 0.1 * k) * one
    sound += 1e-5 * np.random.default_rng(2).standard_normal(sound.shape)
    soundfile.write("long.wav", sound, sr, subtype="FLOAT")
    words = ("--split", "--hold-out", "3", "--picture", "takes.svg")
    assert run("case", "new", "mine", "long.wav", *words) == 0
    drawn = Path("takes.svg").read_text()
    assert (
        all(f"<!-- {text} -->" in drawn for text in ("long.wav", "1", "5", "time in s")) and "<!-- 6 -->" not in drawn
    )
    said = capfd.readouterr().out
    case = json.loads((place / "mine" / "case.json").read_text())
    files = [r["file"] for r in case["recordings"]]
    assert files == [f"long-{k:02d}.wav" for k in range(1, 6)]
    assert [r["split"] for r in case["recordings"]] == ["fit", "fit", "holdout", "fit", "fit"]
    for name, start in zip(files, at, strict=True):
        take, _ = soundfile.read(place / "mine" / name)
        row = next(line for line in said.splitlines() if line.startswith(name))
        assert take.shape[1] == 2 and abs(float(row.split()[1]) - start / sr) < 0.002
        begin = int(np.argmax(np.abs(take[:, 0]) > 1e-3)) / sr
        assert abs(begin - 0.05) < 0.003, "the strike stands where it was cut for"
    read_case(place / "mine")


def test_what_cannot_be_cut_is_named_and_leaves_nothing(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    soundfile.write("nothing.wav", np.zeros(44_100), 44_100, subtype="FLOAT")
    assert run("case", "new", "mine", "nothing.wav", "--split") == 2
    assert "nothing.wav is silent" in capfd.readouterr().err
    assert run("case", "new", "mine", "a.wav", "--hold-out", "1") == 2
    for words in (("--picture", "takes.png"), ("--split", "--picture", "takes.txt")):
        assert run("case", "new", "mine", "a.wav", *words) == 2
        assert f"cannot write {words[-1]}" in capfd.readouterr().err
    assert not (place / "mine").exists()
    assert run("case", "new", "mine", "a.wav", "--split") == 0
    assert json.loads((place / "mine" / "case.json").read_text())["recordings"][0]["file"] == "a.wav"


def test_new_says_what_a_case_without_a_mesh_cannot_do(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("case", "new", "mine", "a.wav") == 0
    said = capfd.readouterr().out
    assert "mine/case.json: 1 recording\n" in said
    assert "no E/ρ" in said and "--mesh" in said
    assert run("case", "new", "other", "a.wav", "--mesh", "bar.obj", "--material", "steel") == 0
    assert "--mesh" not in capfd.readouterr().out
    assert run("case", "check", "other") == 0
    assert "other: 1 strike (1 fit)" in capfd.readouterr().out


def test_new_says_that_a_recording_holds_several_hits(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    one, sr = soundfile.read("a.wav")
    soundfile.write("long.wav", np.tile(np.append(np.zeros(4410), one), 3), sr, subtype="FLOAT")
    assert run("case", "new", "mine", "long.wav", "a.wav") == 0
    said = capfd.readouterr().err
    assert "long.wav holds 3 hits: --split cuts it into takes" in said and "a.wav holds" not in said


@pytest.mark.parametrize("kind", ["noise", "hum", "rumble"])
def test_split_finds_no_hit_in_what_lasts(place: Path, capfd: pytest.CaptureFixture[str], kind: str) -> None:
    t = np.arange(44_100) / 44_100
    noise = np.random.default_rng(3).standard_normal(len(t))
    sound = {
        "noise": 0.1 * noise,
        "hum": 0.3 * np.sin(2 * np.pi * 50 * t) + 1e-3 * noise,
        "rumble": 0.01 * lfilter([1], [1, -0.98], noise),
    }[kind]
    soundfile.write("lasting.wav", sound, 44_100, subtype="FLOAT")
    assert run("case", "new", "mine", "a.wav", "lasting.wav", "--split") == 2
    assert "no hit found in lasting.wav" in capfd.readouterr().err
    assert not (place / "mine").exists()


def test_check_refuses_a_take_that_is_too_short(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    sound, sr = soundfile.read(place / "a.wav")
    soundfile.write(place / "a.wav", sound[:100], sr, subtype="FLOAT")
    assert run("case", "new", "mine", "--material", "steel", "a.wav") == 0
    capfd.readouterr()
    assert run("case", "check", "mine") == run("fit", "mine", "-o", "f.json") == 2
    said = capfd.readouterr().err.strip().splitlines()
    assert sum("ms after the onset, less than 20 ms" in line for line in said) == 2
