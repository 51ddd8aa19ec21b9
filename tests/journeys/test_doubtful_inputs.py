"""What a user gets wrong most: another unit, an empty file, a mistyped name; each told in one line with its remedy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonic_bullet.files.presets import TABLES_FOLDER
from tests.apps.cli.called_here import call_here
from tests.made.case import write_box

GIGA = "E = 214.6 Pa: is that GPa? give 214.6e9"
MEGA = "E = 210000 Pa: is that MPa? give 210000e6"
SHELL = "open surface: a wall of"
GRAM = "density = 7.85 kg/m³: is that g/cm³? give 7850"
TAP = "--strike 0,0,0.003"
BARE = ("--young", "214.6", "--poisson", "0.3", "--density")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a bar of 120 mm, the same in centimetres, a preset in GPa and an empty recording."""
    write_box(tmp_path / "bar.obj", (0.12, 0.025, 0.006))
    write_box(tmp_path / "cm.obj", (12, 2.5, 0.6))
    lines = (tmp_path / "bar.obj").read_text().splitlines()
    (tmp_path / "open.obj").write_text("\n".join(lines[:-2]) + "\n")
    (tmp_path / "zero.wav").touch()
    preset = json.loads((TABLES_FOLDER / "steel.json").read_text())
    preset["elasticity"] |= {"youngs_pa": 214.6}
    (tmp_path / "pre.json").write_text(json.dumps(preset))
    (tmp_path / "mistyped").mkdir()
    (tmp_path / "mistyped" / "case.json").write_text('{"format": "sonic-bullet-case/1", "recodings": []}')
    (tmp_path / "far").mkdir()
    write_box(tmp_path / "far" / "bar.obj", (0.12, 0.025, 0.006))
    far = {"file": "a.wav", "strike": {"position": [60, 0, 3]}}
    case = {"format": "sonic-bullet-case/1", "objects": {"bar": {"mesh": "bar.obj", "material": "steel"}}}
    (tmp_path / "far" / "case.json").write_text(json.dumps(case | {"recordings": [far | {"split": "holdout"}]}))
    return tmp_path


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("modes bar.obj --count 3 --material pre.json", 0, [GIGA]),
        (f"modes bar.obj --count 3 {' '.join(BARE)} 7.85", 0, [GIGA, GRAM]),
        ("modes bar.obj --count 3 --young 2.1e5 --poisson 0.3 --density 7850", 0, [MEGA]),
        ("modes bar.obj --count 3 --young 2.1e5 --poisson 0.45 --density 1000", 0, []),
        ("modes bar.obj --count 3 --material steel", 0, []),
        ("modes cm.obj --count 3 --material steel", 0, ["--scale 0.001", "0.01 if they are centimetres"]),
        ("fit bar.obj -o p.json --mesh bar.obj --material pre.json", 2, ["--strike missing; give it,"]),
        (f"fit zero.wav -o p.json --mesh bar.obj --material pre.json {TAP}", 2, [GIGA, "zero.wav: it is empty"]),
        ("modes open.obj --count 3 --material steel", 0, [SHELL]),
        ("bake open.obj -o open.json --material steel --to-hz 5000", 0, [SHELL]),
        ("modes open.obj --material steel --thickness 3", 2, ["wall of 3 m on a body of", "give metres: 0.003?"]),
        ("case check far", 2, ["strike 1 at (60, 0, 3) m lies 60 m off the surface"]),
        ("case check mistyped", 2, ["'recodings' is not known: did you mean 'recordings'?"]),
        ("features zero.wav", 2, ["zero.wav: it is empty"]),
    ],
)
def test_it_is_told_in_one_line(place: Path, words: str, code: int, told: list[str]) -> None:
    ended = call_here(place, *words.split())
    assert ended.returncode == code, ended.stderr
    for one in told:
        assert sum(one in line for line in ended.stderr.splitlines()) == 1, ended.stderr
    assert ("warning" in ended.stderr) == any(one in (GIGA, MEGA, GRAM, SHELL) or "scale" in one for one in told)
