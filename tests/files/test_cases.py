"""Cases read from disk: what is declared, what is not, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet.files.cases import read_case
from sonic_bullet.records.errors import FileError

STRIKE = {"position": [0, 0, 0.1], "direction": [0, 0, -2], "impulse": 0.01}


def written(folder: Path, **changes: Any) -> Path:
    case = {
        "format": "sonic-bullet-case/1",
        "objects": {
            "bar": {
                "mesh": "bar.obj",
                "units": "mm",
                "material": "steel",
                "elastic_guess": {"youngs_modulus": 2e11, "density": 7850},
            }
        },
        "recordings": [{"file": "a.wav", "object": "bar", "split": "fit", "strike": STRIKE}],
    } | changes
    (folder / "case.json").write_text(json.dumps(case))
    return folder


def test_declared_is_read(tmp_path: Path) -> None:
    sensor = {
        "type": "near-field microphone",
        "response": "normal surface velocity",
        "position": {"bar": [0, 0, 0]},
        "direction": {"bar": [0, 0, 1]},
    }
    support = {"fixed": [{"position": [1, 2, 3], "radius": 0.5}]}
    case = read_case(
        written(
            tmp_path,
            sensor=sensor,
            support=support,
            onset="the impulse arrives at sample 0 of every file",
            later="unknown fields are left alone",
        )
    )
    assert case.objects["bar"].scale == 1e-3
    assert case.objects["bar"].poisson is None
    assert case.objects["bar"].fixed == ((1, 2, 3, 0.5),)
    assert case.sensor == "velocity"  # what is recorded overrides what the sensor is called
    assert case.onset_s == 0
    assert case.recordings[0].direction == (0, 0, -1)


def test_undeclared_stays_unknown(tmp_path: Path) -> None:
    case = read_case(written(tmp_path, objects={}, recordings=[{"features": [{"freq_hz": 100.0}]}]))
    strike = case.recordings[0]
    assert (case.sensor, case.onset_s, strike.position_m, strike.impulse_n_s, strike.file) == (
        "unknown",
        None,
        None,
        None,
        None,
    )
    assert strike.split == "fit"


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ("plain sum of modes", "sum"),
        ("sound pressure at 1 m", "pressure"),
        ("laser vibrometer", "velocity"),
        ("mystery", "unknown"),
    ],
)
def test_sensor_by_its_response(tmp_path: Path, said: str, kind: str) -> None:
    assert read_case(written(tmp_path, sensor={"response": said})).sensor == kind


@pytest.mark.parametrize(
    "name", ["../a.wav", "/etc/passwd", "x/../../a.wav", "link/a.wav", "", "a\u0000b", "..\\a.wav"]
)
@pytest.mark.parametrize("field", ["file", "mesh", "force"])
def test_paths_stay_inside(tmp_path: Path, name: str, field: str) -> None:
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    recording: dict[str, Any] = {"file": name if field == "file" else "a.wav", "object": "bar", "strike": dict(STRIKE)}
    if field == "force":
        recording["strike"]["force"] = {"file": name}
    objects = {"bar": {"mesh": name if field == "mesh" else "bar.obj", "material": "steel"}}
    with pytest.raises(FileError, match="names the file"):
        read_case(written(folder, recordings=[recording], objects=objects))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"format": "other/1"}, "format"),
        ({"recordings": []}, "no recordings"),
        ({"recordings": [{"object": "bar"}]}, "neither file nor features"),
        ({"recordings": [{"file": "a.wav", "object": "cup"}]}, "not listed"),
        ({"recordings": [{"file": "a.wav", "split": "test"}]}, "split"),
        ({"recordings": [{"file": "a.wav", "strike": {"direction": [0, 0, 0]}}]}, "direction is zero"),
        ({"recordings": [{"file": "a.wav", "strike": {"impulse": -1}}]}, "impulse"),
        ({"recordings": [{"features": [{"freq_hz": -5}]}]}, "feature"),
        ({"objects": {"bar": {"units": "inch"}}}, "unit"),
        ({"objects": {"bar": {"elastic_guess": {"density": -1}}}}, "density"),
        ({"objects": {"bar": {"elastic_guess": {"poisson_ratio": 0.7}}}}, "poisson"),
        ({"band_hz": [500, 20]}, "band_hz"),
        ({"recordings": "none"}, "recordings is .none., wanted a list"),
        ({"recordings": [{"file": "a.wav", "strike": {"impulse": 1e308}}]}, "impulse"),
        ({"recordings": [{"file": "a.wav", "strike": {"impulse": 1e-320}}]}, "impulse"),
        ({"recordings": [{"file": "a.wav", "strike": {"position": [0, 1e308, 0]}}]}, "position"),
        ({"recordings": [{"file": "a.wav", "strike": {"direction": [1e200, 0, 0]}}]}, "direction"),
        ({"recordings": [{"file": "a.wav", "channel": -1}]}, "channel"),
        ({"recordings": [{"file": "a.wav", "channel": 10**30}]}, "channel"),
        ({"recordings": [{"features": [{"freq_hz": 1e308}]}]}, "freq_hz"),
        ({"recordings": [{"file": "x" * 5000}]}, "of 5000 characters"),
        ({"recordings": [{"file": "x" * 250 + "é" * 3}]}, "of 253 characters"),
        ({"recordings": [{"file": "a/" * 2500 + "a.wav"}]}, "of 5005 characters"),
        ({"objects": {"bar": {"mesh": "x" * 5000}}}, "of 5000 characters"),
        ({"objects": {"bar": {"elastic_guess": {"density": 1e308}}}}, "density"),
        ({"onset": 1e308}, "onset"),
        ({"band_hz": [20, 1e308]}, "band_hz"),
        ({"support": {"fixed": [{"position": [0, 0, 0], "radius": -1}]}}, "radius"),
    ],
)
def test_refused_in_one_line(tmp_path: Path, changes: dict[str, Any], word: str) -> None:
    with pytest.raises(FileError, match=word) as caught:
        read_case(written(tmp_path, **changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b'{"format": 1e999}', b'{"format": NaN}'])
def test_broken_json_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "case.json").write_bytes(content)
    with pytest.raises(FileError, match="case"):
        read_case(tmp_path)


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot read"):
        read_case(tmp_path / "none")


def test_fields_that_are_not_read_are_named_with_the_nearest(tmp_path: Path) -> None:
    """At every level, a line each; nothing is refused."""
    bar = {
        "mesh": "bar.obj",
        "unit": "mm",
        "material": "steel",
        "elastic_guess": {"youngs_modulus": 2e11, "dens": 7850},
    }
    strike = {"position": [0, 0, 0.1], "impuls": 0.01, "force": {"file": "f.wav", "chanel": 1}}
    entry = {"file": "a.wav", "chanel": 1, "strike": strike, "features": [{"freq_hz": 100.0, "decay": 3.0}]}
    fixed = {"position": [0, 0, 0], "raduis": 0.1}
    case = read_case(
        written(
            tmp_path,
            band=[20, 5000],
            objects={"bar": bar},
            recordings=[entry],
            support={"fixed": [fixed]},
            sensor={"respons": "velocity"},
            qwxz=1,
        )
    )
    assert case.band_hz == (20.0, 20_000.0)
    said = {line.split("field '")[1].split("'")[0]: line for line in case.warnings}
    meant = {
        "band": "band_hz",
        "unit": "units",
        "dens": "density",
        "impuls": "impulse",
        "decay": "decay_per_s",
        "raduis": "radius",
        "respons": "response",
    }
    assert {name: line.split("did you mean '")[1].rstrip("'?") for name, line in said.items() if name in meant} == meant
    # of the recording and of its force
    assert sum("'chanel'" in line and "'channel'" in line for line in case.warnings) == 2
    assert "known here: format, recordings" in said["qwxz"]
    assert len(case.warnings) == len(meant) + 3
    assert "recordings 1: strike: force: field 'chanel'" in " ".join(case.warnings)


def test_words_for_people_and_what_is_documented_are_no_warning(tmp_path: Path) -> None:
    assert not read_case(
        written(tmp_path, note="a tap", source="mine", medium="air", onset=0.0, sensor={"type": "microphone"})
    ).warnings
    assert read_case(tmp_path).medium == "air"


def test_warnings_are_few_and_short(tmp_path: Path) -> None:
    case = read_case(written(tmp_path, **{f"{i}{'x' * 5000}\n": 1 for i in range(500)}))
    assert len(case.warnings) == 21
    assert "480 more" in case.warnings[-1]
    assert all("\n" not in line and len(line) < 500 for line in case.warnings)


@pytest.mark.shared
def test_no_practice_case_warns(shared_path: Path) -> None:
    cases = [read_case(folder) for folder in sorted((shared_path / "practice").glob("practice-*"))]
    assert len(cases) >= 6
    assert not [line for case in cases for line in case.warnings]
    assert {case.medium for case in cases} == {"none"}


def test_a_channel_below_zero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="channel is -1, wanted a whole number of at least 0"):
        read_case(written(tmp_path, recordings=[{"file": "a.wav", "channel": -1}]))


def test_an_impulse_beyond_physics_is_one_line_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    import sys

    from sonic_bullet.apps.cli import main

    (tmp_path / "a.wav").write_bytes(b"RIFF")
    for words in (
        ["a.wav", "--mesh", "a.wav", "--strike", "0,0,0", "--material", "steel", "--impulse", "1e308"],
        [str(written(tmp_path, onset=1e308))],
    ):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["sonic-bullet", "fit", *words, "-o", "p.json"])
        with pytest.raises(SystemExit, match="2"):
            main()
        said = capfd.readouterr().err
        assert said.count("\n") == 1 and ("impulse" in said or "onset" in said)
