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
        "objects": {"bar": {"mesh": "bar.obj", "units": "mm", "material": "steel", "elastic_guess": {"youngs_modulus": 2e11, "density": 7850}}},
        "recordings": [{"file": "a.wav", "object": "bar", "split": "fit", "strike": STRIKE}],
    } | changes
    (folder / "case.json").write_text(json.dumps(case))
    return folder


def test_declared_is_read(tmp_path: Path) -> None:
    sensor = {"type": "near-field microphone", "response": "normal surface velocity", "position": {"bar": [0, 0, 0]}, "direction": {"bar": [0, 0, 1]}}
    support = {"fixed": [{"position": [1, 2, 3], "radius": 0.5}]}
    case = read_case(
        written(tmp_path, sensor=sensor, support=support, onset="the impulse arrives at sample 0 of every file", later="unknown fields are left alone")
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
    assert (case.sensor, case.onset_s, strike.position_m, strike.impulse_n_s, strike.file) == ("unknown", None, None, None, None)
    assert strike.split == "fit"


@pytest.mark.parametrize(
    ("said", "kind"), [("plain sum of modes", "sum"), ("sound pressure at 1 m", "pressure"), ("laser vibrometer", "velocity"), ("mystery", "unknown")]
)
def test_sensor_by_its_response(tmp_path: Path, said: str, kind: str) -> None:
    assert read_case(written(tmp_path, sensor={"response": said})).sensor == kind


@pytest.mark.parametrize("name", ["../a.wav", "/etc/passwd", "x/../../a.wav", "link/a.wav", "", "a\u0000b", "..\\a.wav"])
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
        ({"recordings": "none"}, "Expected"),
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
