"""A silent render says why, from its log; a world in which nothing can touch is no healthy one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest
import soundfile

import sonic_bullet as sb
from sonic_bullet.apps.cli import main
from sonic_bullet.engine.runtime.replay import silence_notes, why_silent
from sonic_bullet.records.errors import AudioError, SceneWarning
from sonic_bullet.scene import examine_scene, render_scene
from sonic_bullet.simulators import diagnose_world
from tests.few_cases import parametrize_few
from tests.made.worlds import floor, sounding_box

HEAD = """
import pybullet as p
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, ball, box, floor, plate_model
from sonic_bullet import Microphone, MicrophonePath, Vibrometer

PLATE = {"material": STEEL, "model": plate_model()}
SECONDS = 0.25
"""
REST = "box(client, (0, 0, 0.005), turn=(0, 0, 0))"
SCALES = "--peak-dbfs -1 scales it"
LOUD = "def build(client):\n    floor(client)\n    return {box(client, (0, 0, 0.1)): PLATE}\n"
CRUMB = (
    "MICROPHONE = (0, -0.5, 0.5)\nSECONDS = 0.5\nEDGES = (0.002, 0.001, 0.0005)\n\n"
    "def build(client):\n    floor(client)\n"
    "    flake = box(client, (0, 0, 0.02), edges=EDGES, mass=8e-6)\n"
    '    return {flake: {"material": STEEL, "model": box_model(EDGES, (), STEEL)}}\n'
)
SCENES = {
    "nothing was added": "def build(client):\n    floor(client)\n    box(client, (0, 0, 0.2))\n    return {}\n",
    "no body that can sound is there": (
        "def build(client):\n    terrain = client.createCollisionShape(p.GEOM_HEIGHTFIELD, numHeightfieldRows=3,"
        " numHeightfieldColumns=3, heightfieldData=[0.0] * 9)\n    client.createMultiBody(0, terrain)\n    return {}\n"
    ),
    "nothing touched": "def build(client):\n    return {box(client, (0, 0, 1)): PLATE}\n",
    "there is no gravity, and body 1 stayed where it was": "def build(client):\n    client.setGravity(0, 0, 0)\n"
    "    floor(client)\n    return {box(client, (0, 0, 0.1)): PLATE}\n",
    "only bodies that were not added touched": (
        "def build(client):\n    floor(client)\n    ball(client, (3, 0, 0.05))\n"
        "    return {box(client, (0, 0, 9)): PLATE}\n"
    ),
    "moved by hand in": (
        "def build(client):\n    floor(client)\n    return {box(client, (0, 0, 0.02)): PLATE}\n\n"
        "def act(client, time_s):\n"
        "    place = [0.3 * (round(240 * time_s) % 2), 0, 0.0045]\n"
        "    client.resetBasePositionAndOrientation(1, place, [0, 0, 0, 1])\n"
    ),
    "was not added and moves, and so is taken as smooth; add it": (
        "MICROPHONE = (0, -40, 0.5)\n\n"
        "def build(client):\n    floor(client)\n    under = box(client, (0, 0, 0.02), edges=(1, 1, 0.04), mass=50,"
        " turn=(0, 0, 0))\n    over = box(client, (-0.1, 0, 0.045), turn=(0, 0, 0))\n"
        "    client.changeDynamics(under, -1, restitution=0)\n    client.changeDynamics(over, -1, restitution=0)\n"
        "    client.resetBaseVelocity(over, [0.5, 0, 0])\n    return {over: PLATE}\n"
    ),
    "which has a roughness of 0; give one": (
        "MICROPHONE = (0, -40, 0.5)\nUNDER = box_model((1, 1, 0.04), (), STEEL)\n\n"
        "def build(client):\n    under = box(client, (0, 0, 0.02), edges=(1, 1, 0.04), mass=0, turn=(0, 0, 0))\n"
        "    over = box(client, (-0.1, 0, 0.045), turn=(0, 0, 0))\n"
        "    client.changeDynamics(under, -1, restitution=0)\n    client.changeDynamics(over, -1, restitution=0)\n"
        "    client.resetBaseVelocity(over, [0.5, 0, 0])\n"
        '    return {under: {"material": STEEL, "model": UNDER, "roughness_m": 0}, over: {**PLATE, "roughness_m": 0}}\n'
    ),
    f"let it fall from higher, or {SCALES}": CRUMB,
    "the nearest microphone is 20 m away; move it nearer": CRUMB.replace("(0, -0.5, 0.5)", "(0, 0, 20)"),
    f"20 µPa: {SCALES}": CRUMB.replace(
        "(0, -0.5, 0.5)", "[Microphone(path=MicrophonePath([0, 1], [[0, -0.5, 0.5], [0, -0.5, 1]]))]"
    ),
    "is silenced by --silent: body 1; name fewer": LOUD,
    "no audible mode: those of": (
        "MODEL = box_model(EDGES_M, (5000.0, 9000.0), STEEL)\n\n"
        "def build(client):\n    still = box(client, (0, 0, 0), mass=0, turn=(0, 0, 0))\n"
        "    ball(client, (0, 0, 0.06))\n"
        '    return {still: {"material": STEEL, "model": MODEL}}\n'
    ),
    "no audible mode: body 0 has none": (
        "MODEL = box_model(EDGES_M, (), STEEL)\n\n"
        "def build(client):\n    still = box(client, (0, 0, 0), mass=0, turn=(0, 0, 0))\n"
        "    ball(client, (0, 0, 0.06))\n"
        '    return {still: {"material": STEEL, "model": MODEL}}\n'
    ),
    "the vibrometer is on body 2, and only body 1 was touched": (
        "MICROPHONE = [Vibrometer(2, (0, 0, 0), (0, 0, 1))]\n\n"
        "def build(client):\n    floor(client)\n"
        "    return {box(client, (0, 0, 0.1)): PLATE, box(client, (0, 0, 9)): PLATE}\n"
    ),
    "support at rest": "def build(client):\n    client.setGravity(0, 0, -9.81)\n    floor(client)\n"
    f"    return {{{REST}: PLATE}}\n",
    "m from the first contact, at": "MICROPHONE = (0, 0, 1000)\n\ndef build(client):\n    floor(client)\n"
    "    return {box(client, (0, 0, 0.1)): PLATE}\n",
    "there is no microphone": "MICROPHONE = ()\n\ndef build(client):\n    floor(client)\n"
    "    return {box(client, (0, 0, 0.1)): PLATE}\n",
}
ASKED: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "no audible mode: those of": ({"sr": 8000}, {"sr": 48_000}),
    "is silenced by --silent: body 1; name fewer": ({"silent": ["body 1"]}, {}),
}
"""What is asked of `render_scene`, and then instead, by the advice."""
MENDED: dict[str, tuple[str, str]] = {
    "nothing was added": ("return {}", "return {1: PLATE}"),
    "no body that can sound is there": ("return {}", "return {box(client, (0, 0, 0.1)): PLATE}"),
    "nothing touched": (
        "return {box(client, (0, 0, 1)): PLATE}",
        "floor(client)\n    return {box(client, (0, 0, 0.1)): PLATE}",
    ),
    "there is no gravity, and body 1 stayed where it was": ("setGravity(0, 0, 0)", "setGravity(0, 0, -9.81)"),
    "only bodies that were not added touched": ("(0, 0, 9)): PLATE", "(0, 0, 9)): PLATE, 1: PLATE"),
    "moved by hand in": (
        "client.resetBasePositionAndOrientation(1, place, [0, 0, 0, 1])",
        "client.resetBaseVelocity(1, [0, 0, 0.5 - 8 * time_s]) if time_s < 0.2 else None",
    ),
    "was not added and moves, and so is taken as smooth; add it": (
        "return {over: PLATE}",
        "return {over: PLATE, under: PLATE}",
    ),
    "which has a roughness of 0; give one": ('"roughness_m": 0', '"roughness_m": 1e-6'),
    f"let it fall from higher, or {SCALES}": ("(0, 0, 0.02)", "(0, 0, 0.6)"),
    "the nearest microphone is 20 m away; move it nearer": ("(0, 0, 20)", "(0, 0, 0.05)"),
    "no audible mode: body 0 has none": ("EDGES_M, ()", "EDGES_M, (900.0,)"),
    "the vibrometer is on body 2, and only body 1 was touched": ("Vibrometer(2", "Vibrometer(1"),
    "support at rest": ("(0, 0, 0.005), turn", "(0, 0, 0.1), turn"),
    "m from the first contact, at": ("(0, 0, 1000)", "(0, 0, 1)"),
    "there is no microphone": ("MICROPHONE = ()", "MICROPHONE = (0, -1, 0.5)"),
}


def scene(folder: Path, text: str) -> Path:
    path = folder / "scene.py"
    text = text.replace("def build(client):\n", "def build(client):\n    client.setGravity(0, 0, -9.81)\n")
    path.write_text(HEAD + text)
    return path


@parametrize_few("reason", SCENES, (0, 1, 2, 5, 8, 10))
def test_a_silent_render_says_why(tmp_path: Path, reason: str) -> None:
    """In the notes of a scene, and of the log that it leaves."""
    asked, _ = ASKED.get(reason, ({}, {}))
    result = render_scene(scene(tmp_path, SCENES[reason]), **{"sr": 8000, **asked})
    assert not np.abs(result.samples).max(initial=0) > 2e-5
    (note,) = result.notes
    assert "silent" in note
    assert reason in note
    assert "\n" not in note
    result.log.save(tmp_path / "log.npz")
    log = sb.read_log(tmp_path / "log.npz")
    assert silence_notes(sb.render_log(log), log) == (note,)


@parametrize_few("reason", [reason for reason in SCENES if reason in ASKED or reason in MENDED], (3, 4))
def test_following_the_advice_gives_sound(tmp_path: Path, reason: str) -> None:
    """Of every message of silence that a scene provokes, as an option or as a change of the scene."""
    _, asked = ASKED.get(reason, ({}, {}))
    old, new = MENDED.get(reason, ("", ""))
    assert old in SCENES[reason]
    result = render_scene(scene(tmp_path, SCENES[reason].replace(old, new)), **{"sr": 8000, **asked})
    least = 1e-9 if "vibrometer" in reason else 2e-5
    assert np.abs(result.samples).max() > least
    assert not any("the render is" in note for note in result.notes), result.notes


def test_an_almost_silent_render_names_what_took_the_sound_away(tmp_path: Path) -> None:
    """Between the threshold of hearing and 20 dB SPL; what slides over a partner that was added is as far away loud."""
    reason = "was not added and moves, and so is taken as smooth; add it"
    smooth = render_scene(scene(tmp_path, SCENES[reason]), sr=8000)
    away_m = 40 * np.abs(smooth.samples).max() / 8e-5
    near = replace(smooth.log, sensors=(sb.Microphone((0, -away_m, 0.5)),))
    (note,) = silence_notes(sb.render_log(near), near)
    assert note.startswith("the render is almost silent, its peak ") and reason in note
    added = render_scene(scene(tmp_path, SCENES[reason].replace(*MENDED[reason])), sr=8000).log
    added = replace(added, sensors=near.sensors)
    assert silence_notes(sb.render_log(added), added) == ()


def test_every_message_has_its_advice() -> None:
    """A scaled file is the advice of those that are too soft."""
    assert {reason for reason in SCENES if reason not in ASKED and reason not in MENDED} == {f"20 µPa: {SCALES}"}


def test_what_is_too_soft_fills_the_file_where_it_is_scaled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene(tmp_path, SCENES[f"20 µPa: {SCALES}"])
    out = str(tmp_path / "a.wav")
    monkeypatch.setattr(
        "sys.argv", ["sonic-bullet", "render", str(path), "-o", out, "--sr", "8000", "--peak-dbfs", "-1"]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    made = soundfile.read(out)[0]
    assert np.abs(made).max() == pytest.approx(10 ** (-1 / 20), rel=1e-3)


def test_a_world_that_was_not_stepped_sounds_once_it_is(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=(0, -1, 0.5), sr=8000)
    floor(client)
    sounding_box(client, listener, (0, 0, 0.1))
    (note,) = silence_notes(listener.sound(), listener.contacts)
    assert "there is no physics step; call stepSimulation" in note
    for _ in range(60):
        client.stepSimulation()
    assert silence_notes(listener.sound(), listener.contacts) == ()


def test_the_module_that_nobody_told_of_a_step_says_so_and_its_advice_gives_sound(client: Any) -> None:
    """As most scripts have it: `import pybullet as p`, and no BulletClient that could be hooked."""
    listener = sb.attach(client._client, microphone=(0, -1, 0.5), sr=8000)
    floor(client)
    sounding_box(client, listener, (0, 0, 0.1))
    client.setGravity(0, 0, -9.81)
    for _ in range(30):
        client.stepSimulation()
    with pytest.warns(SceneWarning, match=r"no step was told to the listener; call listener\.step\(\)"):
        assert listener.sound().shape == (1, 0)
    for _ in range(60):
        client.stepSimulation()
        listener.step()
    assert np.abs(listener.sound()).max() > 0


def test_a_render_that_sounds_says_nothing(tmp_path: Path) -> None:
    result = render_scene(scene(tmp_path, LOUD), sr=8000)
    assert np.abs(result.samples).max() > 1e-3
    assert result.notes == ()
    assert why_silent(result.log) is None


def test_a_log_without_steps_and_a_faint_sound(tmp_path: Path) -> None:
    log = render_scene(scene(tmp_path, LOUD), sr=8000).log
    assert "no physics step" in str(why_silent(replace(log, steps=())))
    (faint,) = silence_notes(np.full((1, 8), 1e-6), log)
    assert "threshold of hearing" in faint
    assert "let it fall from higher" in faint
    away = replace(log, sensors=(sb.Microphone((0, 0, 20)),))
    (faint,) = silence_notes(np.full((1, 8), 1e-6), away)
    assert "the nearest microphone is 2" in faint and "m away; move it nearer" in faint
    assert silence_notes(np.full((1, 8), 1e-4), log) == ()  # faint, and nothing took it away
    (unknown,) = silence_notes(np.zeros((1, 8)), log)
    assert "does not say why" in unknown


def test_ground_that_nobody_meets_is_not_named(client: Any) -> None:
    """It makes no sound: the floor of a rope that hangs in the air is no matter."""
    listener = sb.attach(client, microphone=(0, -1, 0.5), sr=8000)
    listener.add(floor(client), material="concrete")
    sounding_box(client, listener, (0, 0, 1))
    client.stepSimulation()
    assert "nothing touched: body 1 met nobody" in str(why_silent(listener.contacts))


def test_a_log_whose_sounding_bodies_are_silenced_says_so(tmp_path: Path) -> None:
    """The floor has a material, but no modes, and never moves: it is no sounding body."""
    log = render_scene(scene(tmp_path, LOUD), sr=8000).log
    concrete = sb.load_material("concrete")
    ground = [replace(body, material=concrete) if body.model is None else body for body in log.bodies]
    assert len(ground) == 2 and why_silent(replace(log, bodies=tuple(ground))) is None
    silenced = replace(log, bodies=tuple(replace(body, silent=body.model is not None) for body in ground))
    (note,) = silence_notes(sb.render_log(silenced), silenced)
    assert "every sounding body that was touched is silenced by --silent: body 1; name fewer" in note


def test_the_command_line_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Of a scene, of a log, and where silence leaves nothing to write."""
    monkeypatch.chdir(tmp_path)
    scene(tmp_path, SCENES["nothing touched"])

    def run(*words: str) -> tuple[int, str]:
        monkeypatch.setattr("sys.argv", ["sonic-bullet", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0), capfd.readouterr().err

    for words in (["scene.py", "--contacts", "log.npz"], ["log.npz"]):
        code, err = run("render", *words, "-o", "a.wav", "--sr", "8000")
        assert code == 0
        assert "note: the render is silent: nothing touched" in err
    code, err = run("render", "log.npz", "-o", "b.wav", "--peak-dbfs", "-1")
    assert code == 2
    assert "nothing touched" in err
    scene(tmp_path, SCENES["there is no microphone"])
    code, err = run("render", "scene.py", "-o", "b.wav")
    assert code == 2
    assert "there is no microphone" in err
    assert not (tmp_path / "b.wav").exists()


def test_write_without_a_microphone_says_so(client: Any, tmp_path: Path) -> None:
    listener = sb.attach(client, microphone=())
    client.stepSimulation()
    with pytest.raises(AudioError, match="no microphone"):
        listener.write(tmp_path / "a.wav")


# --- doctor


def ids(findings: Any) -> list[tuple[str, str]]:
    return [(finding.id, finding.severity) for finding in findings]


def test_a_world_without_bodies_is_not_well(client: Any) -> None:
    assert ids(diagnose_world(client)) == [("no-body", "error")]


def test_a_world_whose_bodies_cannot_touch_is_not_well(client: Any) -> None:
    client.createMultiBody(1)
    client.createMultiBody(0, -1, client.createVisualShape(p.GEOM_BOX, halfExtents=[1, 1, 1]))
    assert ids(diagnose_world(client)) == [("no-shape", "error")]
    floor(client)
    assert ids(diagnose_world(client)) == []


@parametrize_few(
    ("text", "found"),
    [("def build(client):\n    return {}\n", "no-body"), (SCENES["nothing was added"], "nothing-added"), (LOUD, None)],
    (1, 2),
)
def test_doctor_of_a_scene_that_cannot_sound(tmp_path: Path, text: str, found: str | None) -> None:
    errors = [one for one in ids(examine_scene(scene(tmp_path, text), 0.05)) if one[1] == "error"]
    assert errors == ([(found, "error")] if found else [])


def test_doctor_of_a_script_without_bodies(tmp_path: Path) -> None:
    (tmp_path / "plain.py").write_text(
        "import pybullet as p\nme = p.connect(p.GUI)\nfor _ in range(9):\n    p.stepSimulation(physicsClientId=me)\n"
    )
    assert ids(examine_scene(tmp_path / "plain.py", 0.1)) == [("no-body", "error")]
