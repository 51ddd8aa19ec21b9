"""The command line on the real run time: what it makes, and how it ends where the input is bad.

The first in a process of its own, as a shell does it; how a process ends: test_endings.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, read_log, read_model
from tests.apps.cli.called_here import call_here
from tests.few_cases import parametrize_few

MAIN = "from sonic_bullet.apps.cli import main; main()"
Call = Callable[..., subprocess.CompletedProcess[str]]
BUILT = """
SECONDS = 0.2
def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    bar = client.createMultiBody({mass}, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.01, 0.01]), \
basePosition=[0, 0, 0.03])
    {more}
    return {{bar: {how}}}
def act(client, time_s):
    {act}
"""
PLAIN = """
import pybullet as p, time
p.connect(p.GUI)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.02, 0.01]), basePosition=[0, 0, 0.03])
while True:
    p.stepSimulation()
    time.sleep(1 / 240)
"""
BLOCK = """v 0 0 0
v 0.2 0 0
v 0.2 0.02 0
v 0 0.02 0
v 0 0 0.01
v 0.2 0 0.01
v 0.2 0.02 0.01
v 0 0.02 0.01
f 1 3 2
f 1 4 3
f 5 6 7
f 5 7 8
f 1 2 6
f 1 6 5
f 2 3 7
f 2 7 6
f 3 4 8
f 3 8 7
f 4 1 5
f 4 5 8
"""


def scene(
    mass: str = "0.5", how: str = '{"material": "steel", "count": 10}', act: str = "pass", more: str = "pass"
) -> str:
    return BUILT.format(mass=mass, how=how, act=act, more=more)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "scene.py").write_text(scene())
    (tmp_path / "block.obj").write_text(BLOCK)
    return tmp_path


def call(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", MAIN, *words], cwd=folder, check=False, capture_output=True, text=True, timeout=200
    )


def good(folder: Path, *words: str, run: Call = call_here) -> str:
    done = run(folder, *words)
    assert done.returncode == 0, done.stderr
    said = [
        line
        for line in done.stderr.splitlines()
        if not line.startswith(
            ("sonic-bullet: note:", "sonic-bullet: 0 dBFS = ", "a scene may print", "pybullet build time")
        )
    ]
    assert said == []  # no progress in a pipe
    return done.stdout


def refused(folder: Path, *words: str, names: str) -> None:
    """Exit 2, one line that names the thing, no traceback, nothing new in the folder but a file called partial."""
    before = {path.name for path in folder.iterdir()}
    done = call_here(folder, *words)
    assert done.returncode == 2, (done.returncode, done.stderr)
    lines = [line for line in done.stderr.splitlines() if "pybullet build time" not in line]
    assert len(lines) == 1, lines
    assert lines[0].startswith("sonic-bullet: ")
    assert names.lower() in lines[0].lower(), lines[0]
    assert "Traceback" not in done.stdout + done.stderr
    new = {path.name for path in folder.iterdir()} - before - {"__pycache__"}
    assert all(".partial" in name for name in new), new
    for name in new:
        assert read_audio(folder / name)[0].size > 0  # a valid file, and one that the line names
        assert name in lines[0]


@pytest.mark.slow
def test_a_scene_gives_sound_log_picture_and_json_and_its_log_gives_the_same_sound(folder: Path) -> None:
    more = "print('a scene may print'); client.changeDynamics(bar, -1, linearDamping=0.01)"
    (folder / "scene.py").write_text(scene(how='{"material": "steel", "count": 10, "name": "the bar"}', more=more))
    told = json.loads(
        good(
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
            run=call,
        )
    )
    sound, sr = read_audio(folder / "a.wav")
    assert (sound.shape, sr, told["frames"]) == ((1, 9600), 48_000, 9600)
    assert told["peak_pa"] == pytest.approx(np.abs(sound).max(), rel=1e-6)
    assert told["peak_pa"] > 1e-3
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert told["contacts"] == len(read_log(folder / "a.npz")) > 0
    good(folder, "render", "a.npz", "-o", "b.wav", "--tail", "0", "--json", "b.json")
    assert (folder / "b.wav").read_bytes() == (folder / "a.wav").read_bytes()
    again = json.loads((folder / "b.json").read_text())
    assert again["frames"] == 9600
    parts = ("bodies", "engine", "versions", "events", "changes")
    assert {name: again[name] for name in parts} == {name: told[name] for name in parts}
    assert [body["name"] for body in told["bodies"]] == ["the bar", "body 0"]
    assert told["bodies"][0]["options"]["count"] == 10 and told["engine"]["numSolverIterations"] == 50
    assert told["bodies"][0]["dynamics"]["linearDamping"] == 0.01, "as build set it"
    good(
        folder,
        "render",
        "a.npz",
        "-o",
        "c.flac",
        "--sr",
        "44100",
        "--peak-dbfs",
        "-6",
        "--tail",
        "0",
        "--microphone",
        "0,-2,0.5",
        "--microphone",
        "0,2,0.5",
    )
    other, rate = read_audio(folder / "c.flac")
    assert (other.shape, rate) == ((2, 8820), 44_100)
    file = soundfile.read(folder / "c.flac")[0]
    assert np.abs(file).max() == pytest.approx(10 ** (-6 / 20), rel=1e-3)


def test_a_plain_script_with_a_window_and_no_end_sounds(folder: Path) -> None:
    (folder / "plain.py").write_text(PLAIN)
    done = call_here(
        folder, "render", "plain.py", "-o", "plain.wav", "--seconds", "0.2", "--material", "wood", "--tail", "0"
    )
    assert done.returncode == 0, done.stderr
    assert "every body sounds as wood" in done.stderr
    sound, _ = read_audio(folder / "plain.wav")
    assert sound.shape == (1, 9600)
    assert np.abs(sound).max() > 1e-4


def test_modes_of_a_mesh(folder: Path) -> None:
    def modes(*words: str) -> list[dict[str, float | None]]:
        found: list[dict[str, float | None]] = json.loads(good(folder, "modes", "block.obj", *words, "--json"))["modes"]
        return found

    def hz(found: list[dict[str, float | None]]) -> np.ndarray:
        return np.array([mode["freq_hz"] for mode in found], float)

    free = modes("--young", "2e11", "--poisson", "0.3", "--density", "8000", "--count", "6")
    assert len(free) == 6
    assert (np.diff(hz(free)) > 0).all()
    assert all(mode["decay_per_s"] is None for mode in free)
    # Euler-Bernoulli in the thin direction, lowered by shear by less than 2 % [22.373 / 2πL² · √(EI/ρA)]
    assert hz(free)[0] == pytest.approx(
        22.373 / (2 * np.pi * 0.2**2) * np.sqrt(2e11 / 8000) * 0.01 / np.sqrt(12), rel=0.02
    )
    soft = modes("--young", "0.5e11", "--poisson", "0.3", "--density", "8000", "--count", "6")
    assert hz(soft) == pytest.approx(hz(free) / 2, rel=1e-6)
    clamped = modes(
        "--young",
        "2e11",
        "--poisson",
        "0.3",
        "--density",
        "8000",
        "--fix",
        "0,0.01,0.005,0.012",
        "--to-hz",
        "2000",
        "-o",
        "model.npz",
    )
    # a cantilever: 1 cm of 20 is held
    assert hz(clamped)[0] == pytest.approx(3.516 / 22.373 * (0.2 / 0.19) ** 2 * hz(free)[0], rel=0.03)
    assert hz(clamped).max() <= 2000
    assert read_model(folder / "model.npz").mode_count == len(clamped)
    half = modes("--young", "2e11", "--poisson", "0.3", "--density", "8000", "--count", "6", "--scale", "0.5")
    assert hz(half) == pytest.approx(2 * hz(free), rel=1e-3)
    named = modes("--material", "steel", "--count", "3")
    assert all((mode["decay_per_s"] or 0) > 0 for mode in named)


def test_materials_and_doctor(folder: Path) -> None:
    names = {m["name"] for m in json.loads(good(folder, "materials", "--json"))["materials"]}
    assert {"wood", "plastic", "metal", "glass", "porcelain"} <= names
    assert "porcelain" in good(folder, "materials")
    bad = (
        "client.setPhysicsEngineParameter(numSubSteps=4); [client.changeDynamics(body, -1, restitution=0.8) for "
        "body in (floor, bar)]"
    )
    (folder / "bad.py").write_text(scene(more=bad))
    found = json.loads(good(folder, "doctor", "bad.py", "--seconds", "0.05", "--json"))["findings"]
    said = " ".join(finding["id"] for finding in found)
    assert "step" in said
    assert "restitution" in said
    assert all(finding["what"] and finding["remedy"] for finding in found)


@parametrize_few(
    ("words", "names"),
    [
        (("render", "nowhere.py", "-o", "a.wav"), "nowhere.py"),
        (("render", "scene.py", "-o", "a.wav", "--sr", "0"), "sample rate"),
        (("render", "scene.py", "-o", "a.wav", "--sr", "1e9"), "sample rate"),
        (("render", "scene.py", "-o", "nowhere/a.wav"), "nowhere"),
        (("render", "scene.py", "-o", "a.wav", "--material", "unobtainium"), "unobtainium"),
        (("render", "scene.py", "-o", "a.wav", "--seconds", "-1"), "seconds"),
        (("modes", "nowhere.obj"), "nowhere.obj"),
        (("modes", "block.obj", "--material", "unobtainium"), "unobtainium"),
        (("modes", "block.obj", "--young", "-1", "--poisson", "0.3", "--density", "8000"), "young"),
    ],
    (0, 8),
)
def test_a_bad_request_is_one_line(folder: Path, words: tuple[str, ...], names: str) -> None:
    refused(folder, *words, names=names)


@parametrize_few(
    ("name", "content"),
    [
        ("empty.obj", ""),
        ("cut.obj", BLOCK[:90]),
        ("nan.obj", BLOCK.replace("0.2", "nan")),
        ("point.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n"),
    ],
    (1,),
)
def test_a_broken_mesh_is_one_line(folder: Path, name: str, content: str) -> None:
    (folder / name).write_text(content)
    refused(folder, "modes", name, "-o", "m.npz", names=name if name != "point.obj" else "mesh")


@parametrize_few(
    ("how", "names"),
    [
        (scene(act="1 / 0"), "ZeroDivisionError"),
        (scene(mass="float('nan')"), "nan"),
        (scene(how='"unobtainium"'), "unobtainium"),
        (scene(more="client.removeBody(bar)"), "body 1"),
        (scene(act="client.removeBody(1); client.getBasePositionAndOrientation(1)"), "scene.py"),
        ("def build(client):\n    return 3\n", "dictionary"),
        ("def build(client:\n", "scene.py"),
        (scene().replace("bar: {", "bar + 7: {"), "body 8"),
        (scene(act="client.disconnect()"), "connect"),
    ],
    (0, 2),
)
def test_a_broken_scene_is_one_line(folder: Path, how: str, names: str) -> None:
    (folder / "scene.py").write_text(how)
    refused(folder, "render", "scene.py", "-o", "a.wav", "--contacts", "a.npz", names=names)


def test_a_cut_log_is_one_line(folder: Path) -> None:
    good(folder, "render", "scene.py", "-o", "a.wav", "--contacts", "whole.npz", "--seconds", "0.05")
    whole = (folder / "whole.npz").read_bytes()
    for share in (0.0, 0.3, 0.99):
        (folder / "cut.npz").write_bytes(whole[: int(share * len(whole))])
        refused(folder, "render", "cut.npz", "-o", "b.wav", names="cut.npz")
