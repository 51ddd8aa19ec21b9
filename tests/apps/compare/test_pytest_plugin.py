"""The plugin, in a project of its own: what passes, what fails, and what a failure says and leaves."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.apps.compare.made import scene

REPO = Path(__file__).resolve().parents[3]
IMPORT_S = 0.05


def run(place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    return subprocess.run(command, cwd=place, check=False, capture_output=True, text=True, timeout=240)


@pytest.mark.slow
def test_a_scene_that_changed_fails_with_its_cause_and_leaves_a_folder(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "test_it.py").write_text('def test_bar(sonic_scene):\n    sonic_scene("a.py")\n')
    scene(tmp_path, "a.py")
    missing = run(tmp_path)
    assert missing.returncode == 1
    assert "has no baseline; make it: sonic-bullet baseline" in missing.stdout
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@y"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"]):
        subprocess.run([*git, *words], check=True)
    assert run(tmp_path, "--sonic-ref", "HEAD").returncode == 0
    scene(tmp_path, "a.py", ("        0.004,", "        0.0044,"))
    failed = run(tmp_path, "--sonic-ref", "HEAD")
    assert failed.returncode == 1
    assert "ball: mass 0.004 → 0.0044 kg (+10 %): put back, the scene is A to the bit" in failed.stdout
    left = {path.name for path in (tmp_path / "sonic_results" / "a").iterdir()}
    assert left == {"expected.wav", "actual.wav", "difference.wav", "spectrum.png", "result.json"}


def test_loading_the_plugin_is_quick() -> None:
    code = "import pytest, time; s = time.process_time(); import sonic_bullet.apps.compare.pytest_plugin as p;"
    code += "print(time.process_time() - s); import sys; print('numpy' in sys.modules)"
    done = [
        subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=REPO
        ).stdout.split()
        for _ in range(3)
    ]
    assert {loaded for _, loaded in done} == {"False"}
    assert min(float(took) for took, _ in done) < IMPORT_S


def test_the_plugin_is_an_entry_point() -> None:
    text = (REPO / "pyproject.toml").read_text()
    assert re.search(
        r'\[project.entry-points.pytest11\]\nsonic_bullet = "sonic_bullet.apps.compare.pytest_plugin"', text
    )
