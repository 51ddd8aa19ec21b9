"""From recordings of a thing in two states to what changed, by the command line; and real states."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from tests.apps.cli.called_here import call_here
from tests.lab.states.made_takes import Plate, take

SR = 44_100
PLATE = Plate(highest_hz=2500.0)


def run(*words: str, cwd: Path = Path()) -> subprocess.CompletedProcess[str]:
    return call_here(cwd, *words)


def folder(place: Path, seed: int, count: int, **change: object) -> Path:
    rng = np.random.default_rng(seed)
    place.mkdir(parents=True)
    for k in range(count):
        soundfile.write(place / f"take{k}.wav", take(replace(PLATE, **change), rng, SR, 0.8), SR, subtype="FLOAT")  # type: ignore[arg-type]
    return place


@pytest.fixture(scope="module")
def states(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder of takes of a plate, plain and loaded, with what `states` writes of them; and what it says."""
    place = tmp_path_factory.mktemp("states")
    one, other = folder(place / "plain", 1, 5), folder(place / "loaded", 2, 5, mass=0.03)
    written = ("--json", "found.json", "--report", "page.html", "--picture", "moved.png")
    done = run("states", str(one), str(other), *written, cwd=place)
    assert done.returncode == 0, done.stderr
    return place, done.stdout


def test_two_folders_say_what_changed_and_draw_it(states: tuple[Path, str]) -> None:
    place, said = states
    (found,) = json.loads((place / "found.json").read_text())["comparisons"]
    assert found["verdict"] == "added-mass" and found["prediction"]["gap_closed"] > 0.6
    assert "plain -> loaded (5 takes and 5): added-mass" in said
    assert (place / "page.html").read_text().startswith("<!doctype html>")
    assert (place / "moved.png").stat().st_size > 10_000


def test_compare_of_takes_and_diagnose_of_states_answer_by_the_same_code(
    states: tuple[Path, str], tmp_path: Path
) -> None:
    place, said = states
    compared = tmp_path / "compared.json"
    done = run("compare", str(place / "plain"), str(place / "loaded"), "--json", str(compared))
    assert (done.returncode, done.stdout) == (1, said), done.stderr
    assert json.loads(compared.read_text())["comparisons"][0]["verdict"] == "added-mass"
    case = {
        "format": "sonic-bullet-case/1",
        "objects": {"plate": {"material": "steel"}},
        "recordings": [
            {"file": f"{state}/take{k}.wav", "object": "plate", "split": "fit", "state": state}
            for state in ("plain", "loaded")
            for k in range(5)
        ],
    }
    (place / "case.json").write_text(json.dumps(case))
    diagnosed = run("diagnose", str(place))
    assert (diagnosed.returncode, diagnosed.stdout) == (0, said), diagnosed.stderr
    refused = run("diagnose", str(place), "-o", str(tmp_path / "preset.json"))
    assert refused.returncode == 2 and "names states of its object" in refused.stderr


def test_renders_of_two_versions_are_still_paired_by_name(tmp_path: Path) -> None:
    from sonic_bullet.files import write_audio

    for name, gain in (("old", 1.0), ("new", 0.5)):
        (tmp_path / name).mkdir()
        for k in range(2):
            sound = gain * take(PLATE, np.random.default_rng(k), SR, 0.5)
            write_audio(tmp_path / name / f"scene{k}.wav", sound[None], SR, full_scale_pa=1.0)
    done = run("compare", str(tmp_path / "old"), str(tmp_path / "new"))
    assert done.returncode == 1 and "compared 2: 0 the same, 2 differ" in done.stdout, done.stderr


def test_one_take_a_state_is_too_few(tmp_path: Path) -> None:
    one, other = (folder(tmp_path / str(k), k, 1) for k in (1, 2))
    done = run("states", str(one), str(other))
    assert done.returncode == 0 and "too few takes to say" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [(("nowhere", "there"), "there is no nowhere"), ((".",), "one state alone")],
)
def test_wrong_use_is_one_line(tmp_path: Path, arguments: tuple[str, ...], fault: str) -> None:
    done = run("states", *arguments, cwd=tmp_path)
    assert done.returncode == 2 and fault in done.stderr


def on_shared(shared_path: Path, tmp_path: Path, *states: str, options: tuple[str, ...] = ()) -> dict[str, Any]:
    places = [str(shared_path / "states" / state) for state in states]
    if not Path(places[0]).exists():
        pytest.skip("shared data not found: states")
    done = run("states", *places, *options, "--json", str(tmp_path / "found.json"))
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads((tmp_path / "found.json").read_text())
    return found


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize(
    ("states", "verdict"),
    [
        (("snare-muted/open", "snare-muted/muted"), "damping"),
        (("conga-hand/open", "conga-hand/muted"), "damping"),
        (("ride-bow-bell/bow", "ride-bow-bell/bell"), "strike-place"),
        (("tom-microphone/near", "tom-microphone/room"), "room"),
        (("hihat-opening/closed", "hihat-opening/loose"), "less-damping"),
    ],
)
def test_real_states(shared_path: Path, tmp_path: Path, states: tuple[str, ...], verdict: str) -> None:
    (found,) = on_shared(shared_path, tmp_path, *states)["comparisons"]
    assert found["verdict"] == verdict


@pytest.mark.shared
@pytest.mark.slow
def test_water_in_a_bottle_is_a_mass_whose_law_tells_the_full_one(shared_path: Path, tmp_path: Path) -> None:
    filled = "empty=0 thirtysecond=1/32 sixteenth=1/16 eighth=1/8 quarter=1/4 half=1/2 full=1"
    options = tuple(x for one in filled.split() for x in ("--number", one))
    series = on_shared(shared_path, tmp_path, "bottle-water", options=options)["series"]
    (law,) = series["moving"]
    assert series["verdict"] == "added-mass" and law["freq_hz"] == pytest.approx(218.6, abs=0.5)
    assert law["shift_percent"][-1] == pytest.approx(-31, abs=1) and law["error_share"] < 0.1
