"""Scene, baseline, change, report: as a user walks it, in a folder of his own, by the command line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.apps.cli.called_here import call_here
from tests.apps.compare.made import scene

REPO = Path(__file__).resolve().parents[2]
TEST = 'def test_bar(sonic_scene):\n    sonic_scene("scenes/bar.py")\n'


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    settings = {**os.environ, "PYTHONPATH": str(REPO)}
    return subprocess.run(words, cwd=folder, check=False, capture_output=True, text=True, timeout=250, env=settings)


def git(folder: Path, *words: str) -> None:
    subprocess.run(["git", "-C", str(folder), "-c", "user.name=x", "-c", "user.email=x@y", *words], check=True)


def test_a_scene_its_baseline_a_change_and_the_report(tmp_path: Path) -> None:
    for name in ("scenes", "tests"):
        (tmp_path / name).mkdir()
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "tests" / "test_scenes.py").write_text(TEST)
    bar = scene(tmp_path / "scenes", "bar.py")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "A bar is struck")
    pytest = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")

    kept = call_here(tmp_path, "baseline", "scenes/bar.py", "--runs", "0", "--reason", "as tuned")
    assert kept.returncode == 0, kept.stderr
    passes = run(tmp_path, *pytest)
    assert passes.returncode == 0, passes.stdout
    assert "scenes/bar.py: 2 bodies (bar, ball), 1 event, 0.1208 s, to the bit" in passes.stdout

    scene(bar.parent, "bar.py", ("        0.004,", "        0.0041,"))
    fails = run(tmp_path, *pytest)
    assert fails.returncode == 1, fails.stdout
    assert "ball: mass 0.004 → 0.0041 kg (+2.5 %): put back, the scene is A to the bit" in fails.stdout
    close = run(tmp_path, *pytest, "--tolerance-db", "1")
    assert close.returncode == 0, close.stdout
    assert "2 bodies (bar, ball), 1 event, 0.1208 s, tolerance 1 dB" in close.stdout

    words = ("compare", "scenes/bar.py", "--ref", "HEAD")
    told = call_here(tmp_path, *words, "--report", "bar.html", "--json", "bar.json")
    assert told.returncode == 1, told.stderr
    assert "ball: mass 0.004 → 0.0041 kg" in told.stdout
    assert "ball: mass" in (tmp_path / "bar.html").read_text("utf-8")
    (pair,) = json.loads((tmp_path / "bar.json").read_text())["pairs"]
    assert [one["what"] for one in pair["differences"] if one["cause"]] == ["mass"]
    within = call_here(tmp_path, *words, "--tolerance-db", "1")
    assert within.returncode == 0, within.stdout
    assert "within 1 dB: octave levels differ most at" in within.stdout
    assert "compared: 2 bodies (bar, ball), 1 event" in within.stdout
