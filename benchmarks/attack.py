"""What an attacker, a crash or an odd machine brings: every row a command, its expected exit and one line.

    python benchmarks/attack.py [NAME]      all rows, or those whose name holds NAME; exit 1 where one is otherwise

Forged logs, files that are none, addresses, folders and pipes in the place of files, streams that are closed or full,
signals in the midst of writing, two processes on one empty cache. Formats are fuzzed by `fuzz.py`, with a grammar each.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

REPO = Path(__file__).resolve().parents[1]
SCENE = (
    "SECONDS = 0.1\ndef build(client):\n    client.setGravity(0, 0, -9.81)\n"
    "    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))\n"
    "    shape = client.createCollisionShape(client.GEOM_SPHERE, radius=0.02)\n"
    "    return {client.createMultiBody(0.1, shape, basePosition=[0, 0, 0.03]): 'steel'}\n"
)


@dataclass(frozen=True)
class Row:
    """name: what is tried; words: of the command line, a shell's; make: puts files into the folder.

    status: expected exit; line: regular expression of the one line on stderr, "" none.
    """

    name: str
    words: str
    status: int
    line: str
    make: Callable[[Path], object] = lambda folder: None


def forged_log(**changes: Callable[[np.ndarray], object]) -> Callable[[Path], object]:
    """Write bad.npz: the log of a scene with arrays changed in place."""

    def make(folder: Path) -> None:
        from sonic_bullet.scene import render_scene

        (folder / "a.py").write_text(SCENE)
        render_scene(folder / "a.py", sr=8000).log.save(folder / "good.npz")
        entries = dict(np.load(folder / "good.npz"))
        for name, change in changes.items():
            entries[name] = np.array(entries[name])
            change(entries[name])
        np.savez(folder / "bad.npz", **entries)

    return make


def fill(value: float) -> Callable[[np.ndarray], object]:
    """Return what sets all numbers of an array."""
    return lambda array: array.fill(value)


def gltf(uri: str, make: Callable[[Path], object] = lambda folder: None) -> Callable[[Path], object]:
    """Write a.gltf with a buffer of that address."""

    def write(folder: Path) -> None:
        tree = {"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 36}]}
        (folder / "a.gltf").write_text(json.dumps(tree))
        make(folder)

    return write


def scene(folder: Path) -> None:
    """Write a.py."""
    (folder / "a.py").write_text(SCENE)


def folder_called(name: str) -> Callable[[Path], object]:
    """Make a folder of that name."""
    return lambda folder: (folder / name).mkdir()


def pipe_called(name: str) -> Callable[[Path], object]:
    """Make a named pipe."""
    return lambda folder: os.mkfifo(folder / name)


def rows() -> Iterator[Row]:
    """Yield all rows."""
    lost = "note: standard output is closed: what would be printed there is lost"
    for words in ("materials", "render a.py -o a.wav --sr 8000", "doctor a.py", "cache", "--version"):
        yield Row(f"closed output: {words}", f"{words} >&-", 0, lost, scene)
    yield Row("closed output and input", "materials >&- <&-", 0, lost)
    yield Row("full output", "materials > /dev/full", 2, "standard output.*No space left on device")
    for words in ("render bad.npz -o o.wav", "film bad.npz -o o.mp4", "play bad.npz --device null"):
        for what, change, line in (
            ("zero quaternions", {"pose_quaternion_xyzw": fill(0)}, "bad.npz: the quaternion of '.*' in step 0 .*zero"),
            ("NaN quaternions", {"pose_quaternion_xyzw": fill(np.nan)}, "quaternion_xyzw holds NaN"),
            ("steps of 1e-300 s", {"step_dt_s": fill(1e-300)}, "dt_s of a physics step is 1e-300"),
            ("steps of 1e9 s", {"step_dt_s": fill(1e9)}, "dt_s of a physics step is 1000000000"),
            ("places of 1e300 m", {"pose_position_m": fill(1e300)}, "position_m holds a number of 1e\\+300"),
            ("infinite impulses", {"contact_impulse_n_s": fill(np.inf)}, "impulse_n_s holds NaN or infinite"),
        ):  # fmt: skip
            yield Row(f"{what}: {words.split()[0]}", words, 2, line, forged_log(**change))
    for words in ("score a.gltf -o o.wav", "render a.gltf -o o.wav", "modes a.gltf"):
        of = words.split()[0]
        yield Row(
            f"pipe beside a glTF: {of}", words, 2, "fifo: it is not a regular file", gltf("fifo", pipe_called("fifo"))
        )
        if of != "modes":
            yield Row(
                f"address in a glTF: {of}", words, 2, "is an address .*nothing is fetched", gltf("http://a.org/b")
            )
            yield Row(f"a glTF that looks outside: {of}", words, 2, "lies outside its folder", gltf("../b.bin"))
    for words in (
        "render x.py -o o.wav", "render x.gltf -o o.wav", "render x.npz -o o.wav", "play x.py --device null",
        "film x.npz -o o.mp4", "score x.glb -o o.wav", "features x.wav", "modes x.obj", "doctor x.py",
        "fit x.wav -o o.json --mesh b.obj --strike 0,0,0 --material steel", "residual x.wav -o o.json --material steel",
        "compare x.wav x.wav", "baseline x.py",
    ):  # fmt: skip
        name = words.split()[1]
        if words.split()[0] not in ("fit", "residual", "compare"):  # where a folder may stand
            yield Row(f"a folder in the place of a file: {words}", words, 2, "is a folder", folder_called(name))
        yield Row(f"a pipe in the place of a file: {words}", words, 2, "not a regular file|no file", pipe_called(name))


def shell(folder: Path, words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run a command of a row."""
    environment = {**os.environ, "PYTHONPATH": str(REPO), "SONIC_BULLET_PROGRESS": "0", **settings}
    return subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -m sonic_bullet {words}'],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def wrong_with(row: Row, folder: Path) -> str:
    """Run a row in an empty folder; return what is not as expected, "" where all is."""
    row.make(folder)
    try:
        done = shell(folder, row.words)
    except subprocess.TimeoutExpired:
        return "it did not end within two minutes"
    lines = [one for one in done.stderr.splitlines() if one.startswith("sonic-bullet: ")]
    told = [one for one in lines if not one.startswith("sonic-bullet: note: ")]
    if row.status == 0:
        told = [one for one in lines if row.line and re.search(row.line, one)]
    if done.returncode != row.status:
        return f"exit {done.returncode}, expected {row.status}: {done.stderr[-300:]}"
    if "Traceback" in done.stderr or len(told) != bool(row.line) or not re.search(row.line, "".join(told)):
        return f"expected one line with {row.line!r}: {done.stderr[-300:]}"
    left = [path.name for path in folder.rglob("*.partial")]
    return f"left {left}" if left else ""


def killed_while_it_writes(folder: Path, words: str, output: str, **settings: str) -> str:
    """Kill a command with SIGKILL when its unfinished file is there, and run it again; return what is wrong."""
    environment = {**os.environ, "PYTHONPATH": str(REPO), "SONIC_BULLET_PROGRESS": "0", **settings}
    running = subprocess.Popen(
        [sys.executable, "-m", "sonic_bullet", *words.split()], cwd=folder, env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    end = time.monotonic() + 100
    while (
        time.monotonic() < end
        and running.poll() is None
        and not list(folder.glob("*.partial")) + list(folder.glob(".*.partial"))
    ):
        time.sleep(0.002)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    seen = [path.name for path in folder.iterdir() if path.name.endswith(".partial") and not path.name.startswith(".")]
    if seen:
        return f"visible beside the output: {seen}"
    done = shell(folder, words, **settings)
    left = [path.name for path in folder.iterdir() if path.name.endswith(".partial")]
    if done.returncode or left or not (folder / output).is_file():
        return f"again: exit {done.returncode}, left {left}: {done.stderr[-300:]}"
    return ""


def main() -> int:
    """Run the rows, and say which are not as expected."""
    part, bad = sys.argv[1] if len(sys.argv) > 1 else "", 0
    for row in rows():
        if part in row.name:
            with tempfile.TemporaryDirectory() as folder:
                wrong: Any = wrong_with(row, Path(folder))
            bad += bool(wrong)
            print(f"{'BAD ' if wrong else 'good'} {row.name}{': ' if wrong else ''}{wrong}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
