"""The gallery's examples run as they stand, write what the site shows, and do what their first line says."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from sonic_bullet.files import read_audio
from sonic_bullet.simulators import disconnect

REPO = Path(__file__).parents[1]
EXAMPLES = sorted((REPO / "examples").glob("*.py"))
GALLERY = (REPO / "docs" / "gallery.md").read_text(encoding="utf-8")
MOST_LINES = 30


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    plt.close("all")


def run(name: str, folder: Path) -> dict[str, Any]:
    """Run an example: what its names stand for at the end. It has written a sound and a picture."""
    names = runpy.run_path(str(REPO / "examples" / f"{name}.py"))
    sound, sr = read_audio(folder / f"{name}.flac")
    assert sr == 48_000 and 0.2 * sr < sound.shape[1] < 6 * sr
    assert np.abs(sound).max() > 0
    assert (folder / f"{name}.png").stat().st_size > 5000
    if "client" in names:
        disconnect(names["client"])  # its finaliser would end whoever has its id next
    return names


def test_the_gallery_shows_every_example() -> None:
    assert len(EXAMPLES) == 10
    shown = re.findall(r"(?m)^\[examples/(\w+)\.py\]\(\.\./examples/\1\.py\)$", GALLERY)
    assert sorted(shown) == [path.stem for path in EXAMPLES]
    tested = re.findall(r'run\("(\w+)"', Path(__file__).read_text(encoding="utf-8"))
    assert sorted(tested) == [path.stem for path in EXAMPLES]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_does(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert re.fullmatch(r'"""[A-Z].*\."""', lines[0])


def test_first_sound_begins_when_the_bar_lands(folder: Path) -> None:
    sound = run("first_sound", folder)["listener"].sound()
    lands_s = np.sqrt(2 * (0.1 - 0.01 - 0.03) / 9.81)  # of a corner, which the tilt brings at most 3 cm lower
    assert np.abs(sound[:, : int(48_000 * lands_s)]).max() == 0
    assert np.abs(sound).max() > 0.1


def test_an_array_hears_the_first_bar_where_it_fell(folder: Path) -> None:
    names = run("microphone_array", folder)
    angle = np.degrees(np.arctan2(names["along_y"], names["along_x"]))
    first = np.flatnonzero(names["along_x"])[0]
    assert 0.05 * first == pytest.approx(0.1, abs=0.051)
    assert angle[first : first + 3] == pytest.approx(names["directions"][0], abs=2)


def test_materials_of_a_log_differ_and_its_motion_does_not(folder: Path) -> None:
    names = run("other_material", folder)
    assert all(
        (one.contacts.impulse_n_s == other.contacts.impulse_n_s).all()
        for one, other in zip(names["log"].steps, names["other"].steps, strict=True)
    )
    pitch_hz = [one.argmax() for one in np.abs(np.fft.rfft([sound[0] for sound in names["sounds"]]))]
    assert len(set(pitch_hz)) == 3


def test_takes_differ_by_factors_that_they_name(folder: Path) -> None:
    names = run("takes", folder)
    assert set(names["take"].drawn) == {"bar", "ball"}
    assert len({sound.tobytes() for sound in names["sounds"]}) == 4


def test_stems_add_up(folder: Path) -> None:
    names = run("stems", folder)
    assert np.abs(names["total"] - names["result"].samples).max() < 1e-12


def test_an_observation_holds_the_sound_of_a_step(folder: Path) -> None:
    pytest.importorskip("mujoco")
    names = run("gymnasium_observation", folder)
    assert names["observation"]["audio"].shape == (1, 2400)
    assert set(names["env"].observation_space.spaces) == {"audio", "observation"}


def test_a_contact_microphone_hears_before_the_air_does(folder: Path) -> None:
    names = run("contact_microphone", folder)
    begins = [np.flatnonzero(np.abs(one) > 1e-3 * np.abs(one).max())[0] for one in names["sound"]]
    way_m = np.hypot(0.4, 0.3) - 0.13  # at least, to the nearest of the bar
    assert begins[0] - begins[2] > way_m / 343 * 48_000


def test_a_fit_finds_what_the_bar_is_made_of(folder: Path) -> None:
    found = run("fit_material", folder)["found"]
    assert found.fit.verdict == "fitted"
    assert found.fit.gamma_m2_s2 == pytest.approx(7.13e10 / 2500, rel=0.005)


def test_a_comparison_names_the_one_input(folder: Path) -> None:
    found = run("compare_versions", folder)["found"]
    assert [(cause.who, cause.what) for cause in found.causes] == [("ball", "start position")]
    assert found.exact


def test_what_was_baked_comes_back(folder: Path) -> None:
    names = run("bake", folder)
    assert names["model"].freq_hz.size > 20
    assert names["sound"].size == 72_000
