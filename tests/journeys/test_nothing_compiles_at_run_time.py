"""Nothing is compiled when it runs: the six scenes sound where no generator of code can be had."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.few_cases import parametrize_few

REPO = Path(__file__).resolve().parents[2]
SCENES = ("bar", "drop", "tabletop", "rolling", "sliding", "robot_arm")
WITHOUT = """
import sys


class Refused:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("numba", "llvmlite", "torch", "jax", "cffi", "Cython"):
            raise ImportError(f"{name} is not to be had here")


sys.meta_path.insert(0, Refused())
import os, subprocess  # a compiler started as a process is found out, too

run = subprocess.Popen.__init__


def watched(self, args, *more, **how):
    words = args if isinstance(args, str) else " ".join(map(os.fsdecode, args))
    assert not any(word in words for word in ("cc1", "g++", "clang", "ziglang", "ninja", "cmake")), words
    run(self, args, *more, **how)


subprocess.Popen.__init__ = watched
from sonic_bullet.apps.cli import main

sys.argv = ["sonic-bullet", *sys.argv[1:]]
main()
"""


@parametrize_few("scene", SCENES)
def test_a_scene_sounds_without_a_generator_of_code(scene: str, tmp_path: Path) -> None:
    out = tmp_path / "sound.wav"
    words = ["render", str(REPO / "scenes" / f"{scene}.py"), "-o", str(out), "--seconds", "0.4"]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, *words], check=False, capture_output=True, text=True, timeout=300, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 10_000
