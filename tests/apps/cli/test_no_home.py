"""Commands as another user, without a home, on a read-only install; studies/no_home.py has all of them."""

from __future__ import annotations

import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.files.storage import cache, user_folder

REPO = Path(__file__).resolve().parents[3]


@pytest.mark.slow
def test_commands_run_as_another_user_without_a_home_on_a_read_only_install() -> None:
    words = [sys.executable, REPO / "studies" / "no_home.py", "--json", "--commands", "modes"]
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr + done.stdout
    counts = json.loads(done.stdout)
    assert (counts["bad"], counts["good"] + counts["skipped"]) == (0, 3)
    if counts["skipped"]:
        pytest.skip(f"not root: {counts['skipped']} of 3 ways not tried")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("SONIC_BULLET_CACHE", raising=False)
    monkeypatch.setattr(user_folder, "notes", [])
    return tmp_path


def test_the_folder_of_models_is_private_and_made_so(home: Path) -> None:
    (home / "sonic_bullet").mkdir(mode=0o755)
    cache.save("default", "modes-0", {"shape": np.arange(3.0)}, "")
    assert cache.load("default", "modes-0") is not None
    assert [stat.S_IMODE(path.stat().st_mode) for path in (home / "sonic_bullet", home / "sonic_bullet" / "modal")] == [
        0o700
    ] * 2
    assert user_folder.notes == []


def test_another_users_folder_is_not_believed(home: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder away")
    cache.save("default", "modes-0", {"shape": np.arange(3.0)}, "")
    os.chown(home / "sonic_bullet", 54321, 54321)
    assert cache.load("default", "modes-0") is None
    cache.save("default", "modes-1", {"shape": np.arange(3.0)}, "")
    assert not (home / "sonic_bullet" / "modal" / "modes-1.npz").exists()
    assert len(user_folder.notes) == 1  # said once


@pytest.mark.parametrize("what", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
@pytest.mark.timeout(20)
def test_what_is_no_file_in_the_cache_is_a_miss_and_does_not_hang(tmp_path: Path, what: object) -> None:
    what(tmp_path / "modes-0.npz")  # type: ignore[operator]
    assert cache.load(tmp_path, "modes-0") is None
    cache.save(tmp_path, "modes-0", {"shape": np.arange(3.0)}, "")
    assert cache.load(tmp_path, "modes-0") is None


def test_folders_that_are_missing_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no" / "home"))
    cache.save("default", "modes-0", {"shape": np.arange(3.0)}, "")
    assert cache.load("default", "modes-0") is not None
    assert user_folder.notes == []


LACKING = {
    "a file in its place": "file",
    "a file above it": "file/below/it",
    "a disk that cannot be written": "/proc/no",
}


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "SONIC_BULLET_CACHE"])
@pytest.mark.parametrize("place", LACKING.values(), ids=LACKING)
def test_what_cannot_be_kept_is_kept_meanwhile_and_told_once(
    variable: str, place: str, monkeypatch: pytest.MonkeyPatch, home: Path
) -> None:
    (home / "file").touch()
    monkeypatch.setenv(variable, str(home / place))
    monkeypatch.setattr(user_folder, "_reported", set())
    entry = {"shape": np.arange(3.0)}
    cache.save("default", "modes-0", entry, "")
    assert cache.load("default", "modes-0") is None
    with cache.kept_meanwhile():
        meanwhile = cache.folders("default")[-1]
        cache.save("default", "modes-0", entry, "")
        assert cache.holds("default", "modes-0")
        assert cache.load("default", "modes-0") is not None
    assert not meanwhile.exists()
    assert cache.load("default", "modes-0") is None
    assert str(home / place) in (user_folder.unreported_note() or "")
    assert user_folder.unreported_note() is None


def test_no_temporary_folder_stands_in_for_one_that_can_be_written(home: Path) -> None:
    with cache.kept_meanwhile():
        assert cache.folders("default") == [home / "sonic_bullet" / "modal"]


SCRIPT = """
import sys, warnings
import pybullet as p
from pybullet_utils.bullet_client import BulletClient
import sonic_bullet as sb
client = BulletClient(p.DIRECT)
listener, models = sb.attach(client, microphone=(0, -1, 0.5)), []
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always")
    for side in (0.02, 0.03):
        shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.01, side / 4])
        models += listener.add(client.createMultiBody(0.2, shape), material="steel", count=3)
for one in seen:
    print(one.category.__name__, one.message, file=sys.stderr)
print(len(seen), [len(model.freq_hz) for model in models])
"""


def test_a_script_says_once_that_models_are_not_kept_and_sounds_alike(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    kept = {name: value for name, value in os.environ.items() if name not in {"SONIC_BULLET_CACHE", "XDG_CACHE_HOME"}}
    said = {}
    for place in ("file", "not/yet/there"):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=kept | {"XDG_CACHE_HOME": str(tmp_path / place), "PYTHONPATH": str(REPO)},
            check=True,
            capture_output=True,
            text=True,
            timeout=280,
        )
        said[place] = done.stdout.splitlines()[-1], done.stderr.count("CacheWarning computed models are not kept (")
    assert [said["file"][1], said["not/yet/there"][1]] == [1, 0]
    assert said["file"][0].startswith("1 [") and said["not/yet/there"][0].startswith("0 [")
    assert said["file"][0][2:] == said["not/yet/there"][0][2:]
    assert list((tmp_path / "not" / "yet" / "there" / "sonic_bullet" / "modal").glob("modes-*.npz"))


def test_a_relative_cache_means_the_folder_the_run_began_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SONIC_BULLET_CACHE", "models")
    monkeypatch.chdir(tmp_path)
    assert cache.folder("default") == user_folder.start_folder / "models"


def test_a_command_says_once_what_it_costs_that_models_are_not_kept(tmp_path: Path) -> None:
    """Parents that are missing are made; what stands in their place is not removed."""
    (tmp_path / "file").touch()
    kept = {name: value for name, value in os.environ.items() if name not in {"SONIC_BULLET_CACHE", "XDG_CACHE_HOME"}}
    trimesh.creation.box([0.1, 0.02, 0.01]).export(tmp_path / "bar.obj")
    for place, told in (("file/below/it", 1), ("not/yet/there", 0)):
        done = subprocess.run(
            [sys.executable, "-m", "sonic_bullet", "modes", "bar.obj", "--count", "1"],
            cwd=tmp_path, env=kept | {"XDG_CACHE_HOME": str(tmp_path / place), "PYTHONPATH": str(REPO)},
            check=True, capture_output=True, text=True, timeout=280,
        )  # fmt: skip
        lines = [line for line in done.stderr.splitlines() if "are not kept" in line]
        assert len(lines) == told, done.stderr
        for line in lines:
            assert re.search(
                r"file/.*every run computes them anew, of \d+ s of processor time here; XDG_CACHE_HOME", line
            )
    assert list((tmp_path / "not" / "yet" / "there").rglob("modes-*.npz"))
