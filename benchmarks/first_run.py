"""What does a first run cost? Wall time, each in processes of their own: a scene, a log's render.

    empty folder -> sonic-bullet render scenes/tabletop.py         modes, radiation, sound
                    -> its contact log, rendered again by the command with all that is kept

Rows of `benchmarks/run_time.py` (part first).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
CACHES = ("SONIC_BULLET_CACHE", "XDG_CACHE_HOME")


def _environment(caches: Path | None) -> dict[str, str]:
    """This process's, with all caches in a folder; None: where they are."""
    return dict(os.environ) if caches is None else {**os.environ, **{name: str(caches / name) for name in CACHES}}


def _run(command: list[str], caches: Path | None) -> tuple[float, str]:
    """Wall seconds of a command and what it prints. Raises RuntimeError where it fails."""
    begin = time.perf_counter()
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=_environment(caches), cwd=REPO)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)[:80]}: exit {done.returncode}: {done.stderr[-400:]}")
    return time.perf_counter() - begin, done.stdout


def scene_and_log_s(
    scene: str = "scenes/tabletop.py", seconds: float = 5.0, *, empty: bool = True
) -> tuple[float, float, float]:
    """Seconds of a scene's first render, of its log's once all is kept, the least of three, and of the log's sound."""
    with tempfile.TemporaryDirectory() as place:
        folder, caches = Path(place), Path(place) / "caches"
        caches.mkdir()
        kept = caches if empty else None
        program, log, sound = str(Path(sys.executable).with_name("sonic-bullet")), folder / "log.npz", folder / "a.wav"
        first = [program, "render", scene, "-o", str(sound), "--seconds", str(seconds), "--contacts", str(log)]
        again = [program, "render", str(log), "-o", str(sound)]
        scene_s, _ = _run(first, kept)
        _run(again, kept)  # what a log alone needs is kept now, too
        return scene_s, min(_run(again, kept)[0] for _ in range(3)), seconds
