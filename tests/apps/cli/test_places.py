"""Where outputs go: the place that was named when the command began, tried before anything runs, whatever a scene does
meanwhile.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from sonic_bullet.files import check_output, read_audio, write_audio
from sonic_bullet.files.presets import named_preset, write_preset
from sonic_bullet.records.errors import FileError
from tests.apps.cli.called_here import call_here

SCENE = """
import os, pathlib
pathlib.Path({ran!r}).touch()
SECONDS = 0.05
def build(client):
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    bar = client.createMultiBody(0.5, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.01, 0.01]), \
basePosition=[0, 0, 0.011])
    os.chdir("elsewhere")
    return {{bar: {{"material": "steel", "count": 4}}}}
{act}
"""
PLAIN = """
import os, pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.01), basePosition=[0, 0, 1])
os.chdir("elsewhere")
for _ in range(10):
    p.stepSimulation()
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "elsewhere").mkdir()
    for name in ("a.wav", "a.npz", "a.png", "a.json", "a.partial.wav"):
        (tmp_path / "elsewhere" / name).write_text("another's")
    return tmp_path


def write_scene(folder: Path, act: str = "") -> None:
    (folder / "scene.py").write_text(SCENE.format(ran=str(folder / "ran"), act=act))


@pytest.mark.slow
def test_a_scene_that_changes_the_folder_does_not_move_its_outputs(folder: Path) -> None:
    write_scene(folder)
    done = call_here(
        folder,
        "render",
        "scene.py",
        "-o",
        "a.wav",
        "--tail",
        "0",
        "--contacts",
        "a.npz",
        "--picture",
        "a.png",
        "--json",
        "a.json",
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("a.wav: ")
    assert read_audio(folder / "a.wav")[0].shape == (1, 2400)
    assert {"a.wav", "a.npz", "a.png", "a.json"} < {path.name for path in folder.iterdir()}
    assert {path.read_text() for path in (folder / "elsewhere").iterdir()} == {"another's"}


def test_what_an_error_leaves_stays_where_it_was_asked_for(folder: Path) -> None:
    write_scene(folder, "def act(client, time_s):\n    if time_s > 0.02: 1 / 0")
    done = call_here(folder, "render", "scene.py", "-o", "a.wav")
    assert done.returncode == 2
    assert "are in a.partial.wav" in done.stderr
    assert read_audio(folder / "a.partial.wav")[0].size > 0
    assert {path.read_text() for path in (folder / "elsewhere").iterdir()} == {"another's"}


def test_a_preset_named_by_a_path_is_read_before_the_script_changes_the_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonic_bullet.scene import render_scene

    monkeypatch.chdir(folder)
    (folder / "plain.py").write_text(PLAIN)
    write_preset("mine.json", named_preset("steel"))
    result = render_scene("plain.py", seconds=0.02, material="mine.json")
    assert {body.material.name for body in result.log.bodies if body.material} == {"steel"}
    assert Path.cwd() == folder  # and the caller's folder is what it was


LONG = "x" * 246 + ".wav"
NO_UNICODE = b"a\xff.wav"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("-o", "x" * 252 + ".wav"), "too long"),
        (("-o", NO_UNICODE), "Unicode"),
        (("-o", "a.wav", "--contacts", b"\xff.npz"), "Unicode"),
        (("-o", "a.wav", "--picture", "p" * 252 + ".png"), "too long"),
        (("-o", "a.wav", "--json", b"\xff.json"), "Unicode"),
        (("-o", "a.wav", "--json", "no/such/a.json"), "no folder"),
        (("-o", "a.wav", "--contacts", "/proc/a.npz"), "cannot write"),
        (
            (
                "-o",
                "a.wav",
                "--picture",
                "elsewhere/b.png",
                "--contacts",
                "elsewhere/../elsewhere/b.npz",
                "--json=elsewhere/b.npz",
            ),
            "one name",
        ),
    ],
)
def test_a_name_that_cannot_be_written_ends_before_the_scene_runs(
    folder: Path, words: tuple[str | bytes, ...], says: str
) -> None:
    write_scene(folder)
    done = call_here(folder, "render", "scene.py", *words)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert says in done.stderr
    assert not (folder / "ran").exists()
    assert sorted(path.name for path in folder.iterdir()) == ["elsewhere", "scene.py"]
    assert {path.read_text() for path in (folder / "elsewhere").iterdir()} == {"another's"}


def test_a_name_of_250_characters_is_written(folder: Path) -> None:
    assert len(LONG) == 250
    write_scene(folder, "def act(client, time_s):\n    if time_s > 0.02: 1 / 0")
    done = call_here(folder, "render", "scene.py", "-o", LONG)
    assert done.returncode == 2
    kept = [path for path in folder.iterdir() if path.name.endswith(".partial.wav")]
    assert len(kept) == 1
    assert kept[0].name in done.stderr
    assert read_audio(kept[0])[0].size > 0
    write_audio(folder / LONG, read_audio(kept[0])[0], 48_000)
    assert read_audio(folder / LONG)[0].size > 0
    assert call_here(folder, "materials", "--json", "y" * 245 + ".json").returncode == 0


def test_a_place_is_tried_and_nothing_is_left_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert check_output("a.wav") == tmp_path / "a.wav"
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileError, match="Unicode"):
        check_output("a\ud800.wav")


@pytest.mark.parametrize("predict", ["made/for/this", "."])
def test_the_folder_of_predictions_is_tried_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, predict: str) -> None:
    from sonic_bullet.apps.cli.output import folder_place

    monkeypatch.chdir(tmp_path)
    assert folder_place(predict, "before", "after") == str(tmp_path / predict)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "before").write_text("a file")
    with pytest.raises(FileError, match="before"):
        folder_place(".", "before", "after")
    assert [path.name for path in tmp_path.iterdir()] == ["before"]
