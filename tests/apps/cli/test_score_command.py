"""`score` from the command line: a GLB, a scene that moves a body by hand, and what a user gets wrong."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.scoring import read_animation, score_scene
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import read_audio, read_log
from sonic_bullet.machine.progress import progress_to
from sonic_bullet.records.errors import FileError
from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.made.animations import EDGES_M, box_mesh, dropped, keyframes, write_glb

REPO = Path(__file__).resolve().parents[3]
STILL = {"position": [[0, 0, 0.5]] * 145, "quaternion_xyzw": [[0, 0, 0, 1]] * 145}
HAND = """
import math
SECONDS = 0.5
MICROPHONE = (0, -0.5, 0.3)
def build(client):
    global mallet, other
    client.setGravity(0, 0, -9.81)
    table = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.15, 0.1, 0.01]))
    box = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.02, 0.02, 0.02])
    mallet = client.createMultiBody(0.1, box, basePosition=[0, 0, 0.1])
    other = client.createMultiBody(0.1, box, basePosition=[0.1, 0, 0.03])
    return {table: "wood", mallet: "steel", other: "wood"}
def act(client, time_s):
    z = 0.03 + 0.07 * abs(math.cos(2 * math.pi * 2 * time_s))
    client.resetBasePositionAndOrientation(mallet, [0, 0, z], [0, 0, 0, 1])
    if abs(time_s - 0.25) < 1e-3:
        client.resetBasePositionAndOrientation(other, [-0.1, 0, 0.03], [0, 0, 0, 1])
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def left(place: Path) -> set[str]:
    return {one.name for one in place.iterdir() if one.suffix not in (".glb", ".json", ".py") and one.is_file()}


def test_a_glb_is_scored_and_its_log_is_one_as_any_other(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_glb(place / "a.glb", dropped())
    Path("table.json").write_text('[{"name": "box", "material": "wood"}]')
    words = ["score", "a.glb", "--materials", "table.json", "--sr", "16000", "--tail", "0"]
    assert run(*words, "-o", "a.wav", "--contacts", "a.npz", "--json", "said.json") == 0
    assert run(*words, "-o", "b.wav") == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    assert "clipped" not in "".join(capfd.readouterr())
    assert (
        run("score", "a.glb", "-o", "c.flac", "--sr", "16000", "--tail", "0", "--pascals", "--microphone", "0,-0.2,0.1")
        == 0
    )
    out, err = capfd.readouterr()
    assert ", clipped" in out and "FLAC PCM_24 holds nothing above 1.0" in err
    log, (sound, _) = read_log("a.npz"), read_audio("a.wav")
    assert np.abs(render_log(log) - sound).max() <= 2**-23 * np.abs(sound).max()
    assert {body.name for body in log.bodies} == {"floor", "box"}
    assert "silent partners" in err
    # nothing sounds before the first touch and the sound's way from it, 0.1 m of fall and 1 m of air
    quiet = sound[0, : int(16000 * 0.1)]
    assert np.abs(quiet).max() < 1e-3 * np.abs(sound).max()


def test_an_animation_is_scored_in_space_and_in_a_room(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """As its log is rendered: the same bytes; and what cannot be is one line."""
    pytest.importorskip("pyroomacoustics")
    write_glb(place / "a.glb", dropped())
    score, flat = ("score", "a.glb", "--sr", "16000"), ("--pascals", "--tail", "0")
    wanted = ("--ambisonics", "1", "--room", "3x2.5x2.4")
    assert run(*score, "-o", "a.wav", "--contacts", "a.npz", *flat, *wanted) == 0
    assert "room of 3 x 2.5 x 2.4 m" in capfd.readouterr().err
    assert run("render", "a.npz", "-o", "b.wav", *flat, *wanted[2:]) == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    assert read_audio("a.wav")[0].shape[0] == 4
    capfd.readouterr()
    assert "is called that" in error_of(capfd, *score, "-o", "c.wav", "--microphone-on", "cup")
    assert "outside the room" in error_of(capfd, *score, "-o", "c.wav", "--room", "0.3x0.3x0.3")
    assert not Path("c.wav").exists()


def test_who_is_driven_sounds_and_who_is_set_elsewhere_is_silent(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("hand.py").write_text(HAND)
    assert run("score", "hand.py", "-o", "a.wav", "--sr", "16000", "--contacts", "a.npz") == 0
    said = capfd.readouterr().err
    assert "driven by hand" in said and "teleport" in said
    log = read_log("a.npz")
    loaded = [
        float(begin)
        for step, begin in zip(log.steps, log.start_s, strict=True)
        for row in step.contacts.row
        if {int(row["a"]), int(row["b"])} == {0, 1} and row["impulse_n_s"].any()
    ]
    assert loaded and all(abs(((one + 0.125) % 0.25) - 0.25) < 0.02 or (one + 0.125) % 0.25 < 0.02 for one in loaded)


@pytest.mark.parametrize(
    ("change", "words", "said"),
    [
        (lambda keys: [one.update(STILL) for one in keys["bodies"]], [], "nothing moves"),
        (lambda keys: keys["bodies"].append({**keys["bodies"][1], "name": "copy"}), [], "on one spot"),
        (lambda keys: keys["bodies"].append(keys["bodies"][1]), [], "called 'box'"),
        (lambda keys: keys["bodies"][1]["mesh"]["faces"].pop(), [], "no volume"),
        (lambda keys: keys["bodies"][1].update(mesh=None), [], "0 shapes"),
        (lambda keys: keys["bodies"][1].update(mesh="../a.obj"), [], "outside"),
        (lambda keys: keys["bodies"][1].update(mass_kg=-1), [], "mass_kg"),
        (lambda keys: keys["bodies"][1].update(material="stel"), [], "did you mean steel"),
        (lambda keys: keys["bodies"][1].update(position=keys["bodies"][1]["position"][:9]), [], "rows"),
        (lambda keys: keys.update(unit_m=100), [], "--scale"),
        (lambda keys: None, ["--scale", "100"], "--scale"),
        (lambda keys: None, ["--fps", "0"], "fps"),
        (lambda keys: None, ["--materials", "none.json"], "none.json"),
        (lambda keys: None, ["--contacts", "x.txt"], ".npz"),
    ],
)
def test_what_cannot_be_scored_is_one_line(
    place: Path, capfd: pytest.CaptureFixture[str], change: Any, words: list[str], said: str
) -> None:
    keys = json.loads(json.dumps(keyframes(dropped())))
    change(keys)
    Path("a.json").write_text(json.dumps(keys))
    assert said in error_of(capfd, "score", "a.json", "-o", "a.wav", *words)
    assert left(place) == set()


def test_a_scene_that_drives_nobody_is_to_be_rendered(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("hand.py").write_text(HAND[: HAND.index("def act")])
    assert "render it" in error_of(capfd, "score", "hand.py", "-o", "a.wav", "--sr", "8000")
    assert left(place) == set()


class Properties(dict[str, Any]):
    """An object of Blender: attributes and custom properties."""

    def __init__(self, about: dict[str, Any], **attributes: Any) -> None:
        super().__init__(about)
        self.__dict__.update(attributes)


def test_the_export_script_writes_what_is_read(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With Blender's interface stood in for: a box that falls, scaled in its object and not in its mesh."""
    vertex, face = box_mesh(EDGES_M)
    frame = 0
    shape = SimpleNamespace(
        vertices=[SimpleNamespace(co=corner / 2) for corner in vertex],
        loop_triangles=[SimpleNamespace(vertices=one.tolist()) for one in face],
        calc_loop_triangles=lambda: None,
    )

    class Matrix:
        def to_scale(self) -> tuple[float, ...]:
            return (2.0, 2.0, 2.0)

        def decompose(self) -> tuple[Any, ...]:
            return (0.0, 0.0, 3 - 9.81 * (frame / 24) ** 2 / 2), SimpleNamespace(x=0.0, y=0.0, z=0.6, w=0.8), None

    rigid = SimpleNamespace(restitution=0.4, friction=0.5, kinematic=False, type="ACTIVE", mass=0.3)
    box = Properties({"material": "oak"}, name="box", type="MESH", rigid_body=rigid, matrix_world=Matrix())
    box.__dict__["evaluated_get"] = lambda graph: SimpleNamespace(to_mesh=lambda: shape, matrix_world=Matrix())

    def frame_set(number: int) -> None:
        nonlocal frame
        frame = number

    scene = SimpleNamespace(
        objects=[box, SimpleNamespace(type="CAMERA", rigid_body=None)],
        frame_start=1, frame_end=12, frame_set=frame_set,
        render=SimpleNamespace(fps=24, fps_base=1.0), unit_settings=SimpleNamespace(scale_length=1.0),
        gravity=(0.0, 0.0, -9.81), use_gravity=True,
    )  # fmt: skip
    blender = ModuleType("bpy")
    blender.context = SimpleNamespace(scene=scene, evaluated_depsgraph_get=lambda: None)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "bpy", blender)
    monkeypatch.setattr(sys, "argv", ["blender", "-b", "--", "shot.npz"])
    runpy.run_path(str(REPO / "docs" / "how-to" / "export_from_blender.py"), run_name="__main__")
    export = read_animation("shot.npz")
    (one,) = export.objects
    assert (export.fps, one.stated.material, one.stated.mass_kg) == (24.0, "oak", 0.3)
    assert one.mesh is not None and np.abs(one.mesh[0] - vertex).max() < 1e-12
    assert np.diff(one.position_m[:, 2], 2) == pytest.approx(np.full(10, -9.81 / 24**2))


@pytest.mark.parametrize("words", [["--materials", "t.json"], ["--fps", "24"], ["--scale", "0.01"]])
def test_what_a_scene_says_itself_is_not_passed_over(
    place: Path, capfd: pytest.CaptureFixture[str], words: list[str]
) -> None:
    Path("hand.py").write_text(HAND)
    Path("t.json").write_text("[]")
    assert "leave out" in error_of(capfd, "score", "hand.py", "-o", "a.wav", *words)


def test_a_log_that_cannot_be_written_does_not_take_the_sound_with_it(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonic_bullet import files

    def full(*_: object) -> None:
        raise FileError("cannot write a.npz: no space left", "make room")

    monkeypatch.setattr(files, "write_log", full)
    write_glb(place / "a.glb", dropped(60))
    said = error_of(capfd, "score", "a.glb", "-o", "a.wav", "--sr", "8000", "--contacts", "a.npz")
    assert "no space left" in said and "a.partial.wav" in said
    assert read_audio("a.partial.wav")[0].any()


@parametrize_few("at", [0.6, 0.9], 1)
def test_a_scene_that_is_stopped_after_its_simulation_is_kept(place: Path, at: float) -> None:
    Path("hand.py").write_text(HAND)

    def stop(share: float) -> None:
        if share > at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught, progress_to(fraction=stop):
        score_scene("hand.py", sr=8000)
    assert caught.value.partial.sound.samples().any()  # type: ignore[attr-defined]
