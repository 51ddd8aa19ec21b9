"""What does a first run cost? Processor seconds of whole processes, their children's included.

    import                                                                      sonic_bullet alone
    the README's first example, to its first frame and to its end               empty caches, then all kept
    sonic-bullet render SCENE                                                   empty caches
    the scene's contact log by the same command                                 all kept

Rows of `benchmarks/run_time.py` (part first).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

REPO = Path(__file__).resolve().parents[1]
FIRST_FRAME = "    frame = listener.frame"


class FirstRun(NamedTuple):
    """Processor seconds."""

    import_s: float
    example_s: float
    frame_kept_s: float
    scene_s: float
    log_kept_s: float


def example() -> str:
    """Return the README's first block of Python."""
    found = re.search(r"```python\n(.*?)```", (REPO / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    if found is None or FIRST_FRAME not in found[1]:
        raise RuntimeError("README.md has no example that reads a frame")
    return found[1]


def processor_s(command: list[str], caches: Path, folder: Path) -> float:
    """Return the processor seconds of a command and of the processes it started. Raises RuntimeError where it fails."""
    variables = os.environ | {"SONIC_BULLET_CACHE": str(caches / "models"), "XDG_CACHE_HOME": str(caches)}
    before = os.times()
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=variables, cwd=folder)
    after = os.times()
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)[:80]}: exit {done.returncode}: {done.stderr[-400:]}")
    return (after.children_user + after.children_system) - (before.children_user + before.children_system)


def first_run(scene: str = "scenes/tabletop.py", seconds: float = 5.0, *, empty: bool = True) -> FirstRun:
    """Measure all of it, the scene rendered for so many seconds. empty: else with what a first pass has kept."""
    python, program = sys.executable, str(Path(sys.executable).with_name("sonic-bullet"))
    with tempfile.TemporaryDirectory() as place:
        folder, caches = Path(place), Path(place) / "caches"
        caches.mkdir()
        head, loop, tail = example().partition(FIRST_FRAME)
        (folder / "example.py").write_text(head + loop + tail, encoding="utf-8")
        (folder / "frame.py").write_text(f"{head}{loop}\n    raise SystemExit\n", encoding="utf-8")
        render = [program, "render", str(REPO / scene), "-o", "a.wav", "--seconds", str(seconds), "--contacts", "a.npz"]
        again = [program, "render", "a.npz", "-o", "b.wav"]
        if not empty:
            for command in ([python, "example.py"], render):
                processor_s(command, caches, folder)
        import_s = min(processor_s([python, "-c", "import sonic_bullet"], caches, folder) for _ in range(3))
        example_s = processor_s([python, "example.py"], caches, folder)
        frame_s = min(processor_s([python, "frame.py"], caches, folder) for _ in range(3))
        scene_s = processor_s(render, caches, folder)
        log_s = min(processor_s(again, caches, folder) for _ in range(2))
        return FirstRun(import_s, example_s, frame_s, scene_s, log_s)


if __name__ == "__main__":
    for name, value in first_run()._asdict().items():
        print(f"{name:14s} {value:6.2f}")
