"""The Makefile takes any Python that is supported, asks it before it is taken, and says what it looked for."""

from __future__ import annotations

import os
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
MAKE = shutil.which("make")
pytestmark = pytest.mark.skipif(MAKE is None, reason="could not import make")

STAND_IN = "echo 'version is not installed' >&2; exit 127"  # what a version manager puts on PATH


def answering(version: tuple[int, int]) -> str:
    """Shell script that answers what the Makefile asks, as that Python would."""
    supported = 0 if (3, 11) <= version <= (3, 13) else 1
    return f'case "$2" in *print*) echo {version[0]}.{version[1]} ;; *) exit {supported} ;; esac'


def made(folder: Path, *arguments: str, **pythons: str) -> subprocess.CompletedProcess[str]:
    """What ``make -n`` would do in a folder with these Pythons on PATH (3_13: name and script)."""
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(REPO / name, folder)
    found = shutil.which("cat")
    assert found is not None and MAKE is not None
    if not (tools / "cat").exists():
        (tools / "cat").symlink_to(found)
    for name, script in pythons.items():
        write_python(tools / name.replace("_", "."), script)
    environment = {name: x for name, x in os.environ.items() if name not in ("PYTHON", "MAKEFLAGS", "MAKELEVEL")}
    environment["PATH"] = str(tools)
    return subprocess.run([MAKE, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def write_python(path: Path, script: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/bash\n{script}\n")
    path.chmod(0o755)


@pytest.mark.parametrize(
    "taken, pythons",
    [
        ("python3.11", {"python3_11": answering((3, 11)), "python3_13": answering((3, 13))}),
        ("python3.13", {"python3_11": STAND_IN, "python3_12": STAND_IN, "python3_13": answering((3, 13))}),
        ("python3", {"python3": answering((3, 12))}),
        ("python3.12", {"python3": answering((3, 14)), "python3_12": answering((3, 12))}),
    ],
)
def test_the_first_python_that_answers_is_taken(tmp_path: Path, taken: str, pythons: dict[str, str]) -> None:
    said = made(tmp_path, "-n", "demo", **pythons)
    assert f'"{taken}" -m venv --clear .venv' in said.stdout, said.stderr


@pytest.mark.parametrize("pythons", [{}, {"python3": answering((3, 10))}, {"python3_13": STAND_IN}])
def test_none_is_one_line_that_says_what_was_looked_for(tmp_path: Path, pythons: dict[str, str]) -> None:
    said = made(tmp_path, "demo", **pythons)
    line, *rest = said.stderr.splitlines()
    assert "no Python 3.11, 3.12 or 3.13 (looked for: python3.11 python3.12 python3.13 python3)" in line
    assert said.returncode == 2 and all(one.startswith("make: ***") for one in rest)


def test_one_that_is_asked_for_is_taken_or_named(tmp_path: Path) -> None:
    both = {"python3_11": answering((3, 11)), "python3_13": answering((3, 13))}
    assert '"python3.13" -m venv' in made(tmp_path, "-n", "test", "PYTHON=python3.13", **both).stdout
    said = made(tmp_path, "test", "PYTHON=python3.9", **both)
    assert said.returncode == 2 and "looked for: python3.9)" in said.stderr.splitlines()[0]


@pytest.mark.parametrize(
    "there, asked, anew",
    [
        ((3, 11), "", False),
        ((3, 12), "", False),
        ((3, 13), "", False),
        ((3, 10), "", True),
        ((3, 14), "", True),
        ((3, 11), "python3.13", True),
        ((3, 13), "python3.13", False),
    ],
)
def test_an_environment_is_kept_while_it_is_of_the_wanted_python(
    tmp_path: Path, there: tuple[int, int], asked: str, anew: bool
) -> None:
    write_python(tmp_path / ".venv" / "bin" / "python", answering(there))
    (tmp_path / ".venv" / "python.stamp").write_text(f"{tmp_path}\n")
    both = {"python3_11": answering((3, 11)), "python3_13": answering((3, 13))}
    said = made(tmp_path, "-n", "demo", *([f"PYTHON={asked}"] if asked else []), **both)
    assert ("-m venv --clear" in said.stdout) == anew, said.stderr


def test_slow_tests_are_left_out_of_one_target_alone(tmp_path: Path) -> None:
    there = {"python3_12": answering((3, 12))}
    assert (
        'pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"'
        in made(tmp_path, "-n", "test", **there).stdout
    )
    everything = made(tmp_path, "-n", "test-all", **there).stdout
    assert "pytest -n 2" in everything and "not slow" not in everything
    options = tomllib.loads((REPO / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert "slow" not in options["addopts"] and any(one.startswith("slow:") for one in options["markers"])
