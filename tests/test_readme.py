"""What the README shows runs as it stands: its Python, and every line of its shell block."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, read_log
from sonic_bullet.simulators import disconnect

REPO = Path(__file__).parents[1]
README = (REPO / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.S)


def commands() -> list[list[str]]:
    """Each line of the shell block that begins with sonic-bullet, in order."""
    return [
        shlex.split(line, comments=True)[1:]
        for block in blocks("sh")
        for line in block.splitlines()
        if line.startswith("sonic-bullet ")
    ]


def run_block(source: str, folder: Path) -> dict[str, Any]:
    names: dict[str, Any] = {}
    before = Path.cwd()
    os.chdir(folder)
    try:
        exec(compile(source, "README.md", "exec"), names)
    finally:
        os.chdir(before)
    return names


def test_the_first_example_makes_sound_and_log(tmp_path: Path) -> None:
    source = blocks("python")[0]
    assert "range(480)" in source
    names = run_block(source.replace("range(480)", "range(120)"), tmp_path)  # the bar lands after 57 steps
    sound, sr = read_audio(tmp_path / "bar.wav")
    assert (sound.shape, sr) == ((1, 24_000), 48_000)
    assert names["frame"].shape == (1, 200)
    first = int(0.9 * 48_000 * np.sqrt(2 * 0.28 / 9.81))
    assert np.abs(sound[:, :first]).max() == 0
    assert np.abs(sound[:, first:]).max() > 1e-3
    log = read_log(tmp_path / "bar.npz")
    assert {body.material.name for body in log.bodies if body.material is not None} == {"wood", "steel"}
    assert names["client"].isConnected()
    disconnect(names["client"])


def test_the_gymnasium_example_hears_the_hidden_steps() -> None:
    pytest.importorskip("panda_gym")
    page = (REPO / "docs" / "how-to" / "listen-in-an-environment.md").read_text(encoding="utf-8")
    source = re.findall(r"```python\n(.*?)```", page, re.S)[0]
    assert "env.step" in source
    names = run_block(source.split("listener.detach()")[0], REPO)
    steps = len(names["listener"].contacts.steps)
    assert steps >= 20
    assert names["sound"].shape == (1, names["listener"].contacts.sr * steps // 500)
    names["listener"].detach()
    names["env"].close()


def test_the_shell_block_names_what_there_is() -> None:
    words = [word for command in commands() for word in command]
    assert len(commands()) == 6
    for word in words:
        if word.startswith(("scenes/", "assets/")):
            assert (REPO / word).is_file(), word
    scenes = README[README.index("Six come along.") : README.index("## From recordings")]
    assert {path.name for path in (REPO / "scenes").glob("*.py")} == set(re.findall(r"`(\w+\.py)`", scenes))


@pytest.mark.slow
def test_every_line_of_the_shell_block_runs(tmp_path: Path) -> None:
    """In the README's order and one folder; the table-top, which is long, is replaced by the bar, and each run is
    short.
    """
    for name in ("scenes", "assets"):
        shutil.copytree(REPO / name, tmp_path / name)  # commands write beside scenes
    told = []
    for command in commands():
        words = [word.replace("scenes/tabletop.py", "scenes/bar.py") for word in command]
        if words[0] == "doctor" or words[-1:] == ["0,0,0,0.02"] or "assets/bowl.obj" in words:
            words += {"doctor": ["--seconds", "0.05"], "modes": ["--count", "5"] if "--to-hz" not in words else []}[
                words[0]
            ]
        if words[:2] == ["render", "scenes/bar.py"]:
            words += ["--seconds", "0.2"]
        done = subprocess.run(
            [sys.executable, "-c", "from sonic_bullet.apps.cli import main; main()", *words],
            cwd=tmp_path,
            check=False,
            capture_output=True,
            text=True,
            timeout=200,
        )
        assert done.returncode == 0, (words, done.stderr)
        assert "Traceback" not in done.stderr
        told.append(done.stdout)
    ran = [command[0] for command in commands()]
    first, again = ((tmp_path / name).read_bytes() for name in ("table.wav", "again.wav"))
    assert first == again  # equal options
    assert np.abs(soundfile.read(tmp_path / "table.wav")[0]).max() == pytest.approx(10 ** (-1 / 20), abs=1e-6)
    modes = json.loads(told[ran.index("modes")])["modes"]
    assert all(0 < mode["freq_hz"] <= 8000 for mode in modes)
    assert "same: all samples are equal" in told[ran.index("compare")]
