"""Presets of recordings that ship: whose, under which licence, by which command, how near; and they play."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.recorded_objects import NUMBERS_ALONE, OBJECTS
from benchmarks.recorded_presets import table_rows
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.files import presets
from sonic_bullet.files.presets import Origin, Preset
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

REPO = Path(__file__).resolve().parents[1]
MAY_BE_COPIED = {"CC0-1.0", "MIT", "BSD-2-Clause", "BSD-3-Clause"}
LARGEST_BYTES = 40_000
NAMES = presets.recorded_names()


def read(name: str) -> tuple[Preset, Origin]:
    """A shipped preset and where it comes from."""
    preset = presets.read_preset(presets.RECORDED_FOLDER / f"{name}.json")
    assert preset.provenance is not None
    assert preset.provenance.origin is not None
    return preset, preset.provenance.origin


def test_there_are_some_and_each_can_be_made_again() -> None:
    assert len(NAMES) >= 6
    assert set(NAMES) == set(OBJECTS)
    assert not set(NAMES) & set(presets.table_names())
    assert set(presets.material_names()) == {*NAMES, *presets.table_names(), *presets.made_names()}


@pytest.mark.parametrize("name", NAMES)
def test_a_file_names_its_source_licence_command_and_error(name: str) -> None:
    preset, origin = read(name)
    assert preset.name == name
    assert (presets.RECORDED_FOLDER / f"{name}.json").stat().st_size < LARGEST_BYTES
    assert origin.struck == OBJECTS[name].struck
    assert origin.source == OBJECTS[name].source
    assert any(c.isdigit() for c in origin.source)  # a commit or a version
    assert origin.licence == OBJECTS[name].licence
    assert origin.licence in MAY_BE_COPIED or origin.licence.endswith(NUMBERS_ALONE)
    assert origin.command == f"python -m benchmarks.recorded_presets {name} --data ../shared/measured"
    assert preset.provenance is not None
    assert len(preset.provenance.recordings) == origin.takes_fitted
    held = "takes held out" if origin.takes_held_out else "none was held out"
    assert held in origin.distance
    assert origin.predicted_db < origin.silence_db
    assert (origin.other_take_db is not None) == bool(origin.takes_held_out)


@pytest.mark.parametrize("name", NAMES)
def test_what_was_recorded_is_held_by_files_whose_licence_allows_it(name: str) -> None:
    preset, origin = read(name)
    recorded = preset.residual is not None or any(e["id"] == RecordedLines.id for e in preset.effects)
    assert recorded == (origin.licence in MAY_BE_COPIED)
    if not recorded:
        assert preset.provenance is not None
        assert not preset.provenance.correction
        assert {"gamma_m2_s2", "poisson_ratio"} <= set(preset.provenance.spreads)


def test_the_notice_lies_with_the_files() -> None:
    notice = (presets.RECORDED_FOLDER / "NOTICE.txt").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"{name}.json" in notice
    assert notice.count("Permission is hereby granted") == 2
    assert all(word in notice for word in ("samuel-clarke", "Frank Wen", "AlaskaRobotics", "CC0 1.0"))


def test_numbers_are_no_finer_than_known() -> None:
    for name in NAMES:
        preset, _ = read(name)
        for effect in preset.effects:
            for value in (x for column in effect.values() if isinstance(column, list) for x in column):
                assert value == float(f"{value:.6g}"), name
    mug, _ = read("ceramic-mug")
    (lines,) = mug.effects
    assert all(d == float(f"{d:.3g}") for d in lines["decay_per_s"])
    assert min(lines["decay_per_s"]) > 1.0  # a tone of the recorder at 8821 Hz hardly decays, and is no line of a mug


def test_no_file_is_led_by_what_the_band_cut() -> None:
    """Lines at the end of the band that cancel each other would leave nothing of the level for those that ring."""
    count = 0
    for name in NAMES:
        for lines in (e for e in read(name)[0].effects if e["id"] == RecordedLines.id):
            energy = np.array(lines["amplitude"]) ** 2 / np.array(lines["decay_per_s"])
            inside = np.array(lines["freq_hz"]) + np.array(lines["decay_per_s"]) < 20_000
            assert inside.all(), name
            assert energy[np.array(lines["freq_hz"]) < 16_000].sum() > 0.9 * energy.sum(), name
            count += 1
    assert count >= 6


def test_known_modes_of_the_objects() -> None:
    """By the readers of the sets, who looked at peaks of a plain spectrum."""
    for name, freq_hz, t60_s in (
        ("ceramic-mug", 2215.4, 0.74),
        ("bell", 3620.96, 6.4),
        ("glockenspiel-bar", 2103.67, 3),
    ):
        (lines,) = read(name)[0].effects
        k = int(np.argmin(np.abs(np.array(lines["freq_hz"]) - freq_hz)))
        assert lines["freq_hz"][k] == pytest.approx(freq_hz, rel=2e-3), name
        assert math.log(1000) / lines["decay_per_s"][k] == pytest.approx(t60_s, rel=0.3), name
    steel, bowl = presets.load_material("steel-bar"), presets.load_material("ceramic-bowl")
    assert steel.youngs_pa == pytest.approx(214.9e9, rel=0.01)
    assert bowl.youngs_pa / bowl.density_kg_m3 == pytest.approx(2.83e7, rel=0.02)


SCENE = """
import pybullet as p
import sonic_bullet as sb

SECONDS = 0.4
MICROPHONE = [0.3, 0.3, 0.3]


def build(client):
    plate = client.createMultiBody(0.2, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.08, 0.05, 0.004]))
    ball = client.createMultiBody(
        0.002, client.createCollisionShape(p.GEOM_SPHERE, radius=0.004), basePosition=[0.06, 0.02, 0.0085]
    )
    client.resetBaseVelocity(ball, [0, 0, -1.0])
    sb.keep_restitution(client)
    return {{plate: "{name}"}}
"""


@parametrize_few("name", ["ceramic-mug", "ceramic-bowl"], 1)
def test_it_plays_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import soundfile

    monkeypatch.chdir(tmp_path)
    Path("scene.py").write_text(SCENE.format(name=name))
    assert run("render", "scene.py", "-o", "a.wav") == 0
    sound, sr = soundfile.read("a.wav")
    assert np.isfinite(sound).all()
    assert np.abs(sound).max() > 0.1
    if name == "ceramic-mug":
        (lines,) = read(name)[0].effects
        spectrum = np.abs(np.fft.rfft(sound[: sr // 2] * np.hanning(len(sound[: sr // 2]))))
        peak_hz = float(np.argmax(spectrum)) * sr / len(sound[: sr // 2])
        assert np.abs(np.array(lines["freq_hz"]) - peak_hz).min() < 10


def test_material_of_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.py").write_text(SCENE.format(name="steel"))
    assert run("render", "scene.py", "-o", "a.wav", "--material", "Polycarbonate-Cup") == 0
    assert Path("a.wav").stat().st_size > 1000


def test_the_command_lists_them_apart(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("materials") == 0
    tables = capfd.readouterr().out.split("\n\n")
    made, rows = ([line.split()[0] for line in one.splitlines()[2:]] for one in tables[1:3])
    assert (made, rows) == (list(presets.made_names()), list(NAMES))
    assert not set(NAMES) & {line.split()[0] for line in tables[0].splitlines()}
    assert run("materials", "--json") == 0
    found = json.loads(capfd.readouterr().out)
    assert [m["name"] for m in found["materials"]] == list(presets.table_names())
    assert [m["name"] for m in found["recorded"]] == list(NAMES)
    assert [m["name"] for m in found["made"]] == list(presets.made_names())
    assert all(m["origin"]["licence"] and m["origin"]["predicted_db"] > 0 for m in found["recorded"])


def test_the_page_says_what_the_files_say() -> None:
    page = (REPO / "docs" / "explanation" / "materials.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `[^|]+` \|.*$", page, re.M) == table_rows()


def test_an_unknown_field_of_an_origin_is_named(tmp_path: Path) -> None:
    text = (presets.RECORDED_FOLDER / "bell.json").read_text(encoding="utf-8")
    (tmp_path / "mine.json").write_text(text.replace('"struck"', '"stuck"'), encoding="utf-8")
    with pytest.raises(presets.MaterialError, match=r"mine\.json.*stuck"):
        presets.load_material(tmp_path / "mine.json")


@pytest.mark.slow
@pytest.mark.shared
def test_one_is_made_again_by_its_command_to_the_byte(shared_path: Path, tmp_path: Path) -> None:
    name = "polycarbonate-cup"
    command = read(name)[1].command.replace("../shared/measured", str(shared_path / "measured")).split()[1:]
    done = subprocess.run(
        [sys.executable, *command, "--out", str(tmp_path)],
        check=False,
        capture_output=True,
        text=True,
        cwd=REPO,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr
    shipped = (presets.RECORDED_FOLDER / f"{name}.json").read_bytes()
    assert (tmp_path / f"{name}.json").read_bytes() == shipped
