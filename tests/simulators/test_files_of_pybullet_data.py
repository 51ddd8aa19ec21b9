"""Robots and worlds that others made, each in a process of its own: none dies, and who stays silent is named."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.few_cases import parametrize_few
from tests.made.robots import CANNOT_BE_LOADED, ONE_A_KIND, STEPS, all_files

BOUND_S, CODE_S, BOUND_MB = 60, 120, 2000
"""Of processor and memory, a body; for what is not a body's: once a process. Two bodies are solved at
a time.
"""
LONGEST_S = 3600


def heard(name: str, *how: str) -> None:
    command = [sys.executable, "-m", "tests.made.robots", name, *how]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, errors="replace", check=False)
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
    assert done.returncode == CANNOT_BE_LOADED.get(name, 0), done.stderr[-2000:]
    if not done.returncode:
        told = json.loads(done.stdout.splitlines()[-1])
        assert told["steps"] == STEPS
        assert all("silent partner" in note for note in told["notes"])
        assert told["processor_s"] <= BOUND_S * told["links"] + CODE_S
        assert told["memory_mb"] <= BOUND_MB * min(max(told["links"], 1), 2)


@pytest.mark.slow
@parametrize_few("name", ONE_A_KIND, (3, 7, 11))
def test_one_file_a_kind(name: str) -> None:
    heard(name)


def test_there_are_136_and_20() -> None:
    names = all_files()
    assert len(names) == len(set(names)) == 156
    assert set(ONE_A_KIND) | set(CANNOT_BE_LOADED) <= set(names)


@pytest.mark.slow
@pytest.mark.parametrize("name", all_files())
def test_every_file(name: str) -> None:
    heard(name, "sound")
