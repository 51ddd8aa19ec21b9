"""The command line as a user meets it: real scenes in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.files import read_audio, read_log
from tests.few_cases import parametrize_few

MAIN = "from sonic_bullet.apps.cli import main; main()"
WITHOUT_PYBULLET = "import sys; sys.modules['pybullet'] = None; " + MAIN
SCENE = """
SECONDS = {seconds}
def build(client):
    print("a scene may print")
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    box = client.createMultiBody({mass}, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.01, 0.01]), \
basePosition=[0, 0, 0.03])
    return {{box: "metal"}}
def act(client, time_s):
    {act}
"""


def write_scene(folder: Path, seconds: float = 0.25, mass: str = "0.6", act: str = "pass") -> None:
    (folder / "scene.py").write_text(SCENE.format(seconds=seconds, mass=mass, act=act))


def process(folder: Path, *words: str, code: str = MAIN) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *words], cwd=folder, check=False, capture_output=True, text=True, timeout=250
    )


@pytest.mark.slow
def test_a_scene_renders_and_its_log_renders_the_same_bits_without_pybullet(tmp_path: Path) -> None:
    write_scene(tmp_path)
    done = process(
        tmp_path,
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
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    sound, sr = read_audio(tmp_path / "a.wav")
    log = read_log(tmp_path / "a.npz")
    assert (told["frames"], told["sr"], told["contacts"], told["clipped"]) == (sound.shape[1], sr, len(log), 0)
    assert sound.shape == (1, 12_000)
    assert told["contacts"] > 0
    assert np.abs(sound).max() > 1e-3
    again = process(
        tmp_path, "render", "a.npz", "-o", "b.wav", "--tail", "0", "--contacts", "b.npz", code=WITHOUT_PYBULLET
    )
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "a.wav").read_bytes() == (tmp_path / "b.wav").read_bytes()
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.mark.slow
@parametrize_few(("word", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], 1)
def test_an_interrupted_render_is_a_valid_named_file(tmp_path: Path, word: signal.Signals, code: int) -> None:
    write_scene(
        tmp_path,
        seconds=1000,
        act="open('stepping', 'w').close() if time_s > 0.2 else None; import time; time.sleep(0.001)",
    )
    # a shell's background jobs are started deaf to SIGINT
    awake = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    running = subprocess.Popen(
        [sys.executable, "-c", awake + MAIN, "render", "scene.py", "-o", "a.wav"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        end = time.monotonic() + 200
        while not (tmp_path / "stepping").exists() and running.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        os.kill(running.pid, word)
        said = running.communicate(timeout=100)[1]
    finally:
        running.kill()
    assert running.returncode == code, said
    assert len(said.splitlines()) == 1
    assert said.rstrip().endswith("a.partial.wav")
    sound, _ = read_audio(tmp_path / "a.partial.wav")
    assert sound.shape[1] >= 0.2 * 48_000
    assert np.isfinite(sound).all()
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith("a")) == ["a.partial.wav"]


@pytest.mark.slow
def test_an_interrupt_that_compiled_code_met_is_an_interrupt(tmp_path: Path) -> None:
    write_scene(
        tmp_path,
        act="if time_s > 0.2: raise SystemError('a result with an exception set') from KeyboardInterrupt('terminated')",
    )
    done = process(tmp_path, "render", "scene.py", "-o", "a.wav")
    assert done.returncode == 143, done.stderr
    assert done.stderr.rstrip().endswith("a.partial.wav")
    assert read_audio(tmp_path / "a.partial.wav")[0].shape[1] >= 0.2 * 48_000


@parametrize_few(
    ("options", "words"),
    [
        ({"mass": "float('nan')"}, "mass"),
        ({"act": "1 / 0"}, "scene.py' line 10: ZeroDivisionError"),
        ({"act": "client.disconnect()"}, "detach the listener"),
        ({"act": "syntax error"}, "scene"),
    ],
    (0, 3),
)
def test_a_broken_scene_is_one_line(tmp_path: Path, options: dict[str, str], words: str) -> None:
    write_scene(tmp_path, **options)
    done = process(tmp_path, "render", "scene.py", "-o", "a.wav")
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("sonic-bullet: ")
    assert words in lines[0]
    assert not (tmp_path / "a.wav").exists()


def test_doctor_looks_at_a_scene(tmp_path: Path) -> None:
    write_scene(tmp_path)
    done = process(tmp_path, "doctor", "scene.py", "--seconds", "0.1", "--json")
    assert done.returncode == 0, done.stderr
    assert all({"id", "severity", "what", "remedy"} == set(finding) for finding in json.loads(done.stdout)["findings"])
