"""How much memory does a long run take? Each part runs in a process of its own and prints one row.

    python studies/long_runs.py [--hours 1] [--only PART ...]

    listen, listen-kept   an hour of three bars: growth of resident memory, read and thrown away, and by default
    contacts    10 million contacts logged, written, read and rendered from the disk: peak of resident memory
    log         a log past 4 GiB, written and read back
    sound       a WAV past 4 GiB, written and read back

What is kept lies where TMPDIR says; the last two parts need 10 GB there. --hours scales all four.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import sonic_bullet as sb
from sonic_bullet.engine.runtime.replay import render_kept
from sonic_bullet.files import ContactLog, read_log, write_audio, write_log
from sonic_bullet.files.rows.log_steps import StepLog
from sonic_bullet.files.storage.spooled_sound import SoundSpool
from sonic_bullet.records import Body, Microphone
from sonic_bullet.records.contacts import CONTACT, Contacts, Step
from sonic_bullet.simulators import direct_client, disconnect

DT_S, SETTLED_S, EVERY = 1 / 240, 5.0, 24
LENGTH_M, SIDE_M = 0.24, 0.02
CONTACTS, ROWS_A_STEP = 10_000_000, 1000
PAST_BYTES = (1 << 32) + (1 << 26)


def memory_mb(peak: bool = False) -> float:
    """Resident memory of this process in MB, now or at its most."""
    if peak:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def three_bars() -> tuple[Any, list[int]]:
    """Three bars of steel over a floor, and one of them in turn is thrown up every second."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(DT_S)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[LENGTH_M / 2, SIDE_M / 2, SIDE_M / 2])
    mass = 7850 * LENGTH_M * SIDE_M**2
    return client, [client.createMultiBody(mass, shape, basePosition=[0, 0.1 * i, 0.1]) for i in range(3)]


def listen(hours: float, keep: bool) -> str:
    """Growth of resident memory while three bars are listened to, after the first seconds."""
    client, bars = three_bars()
    listener = sb.attach(client, keep_log=keep, keep_sound=keep)
    listener.add_all(dict.fromkeys(bars, "steel"))
    first, growth, begin = 0.0, 0.0, time.perf_counter()
    settled, steps = round(SETTLED_S / DT_S), round(hours * 3600 / DT_S)
    for number in range(settled + steps):
        if number % 240 == 0:
            client.resetBaseVelocity(bars[number // 240 % 3], [0, 0, 1.5], [3, 0, 0])
        client.stepSimulation()
        if number % EVERY == 0:
            listener.read()
        if number == settled:
            first = memory_mb()
        if number % 2400 == 0 and first:
            growth = max(growth, memory_mb() - first)
    growth = max(growth, memory_mb() - first)
    took = time.perf_counter() - begin
    begin = time.perf_counter()
    said = f"{growth:.1f} MB ({listener.time_s / 3600:.3f} h in {took:.0f} s"
    if keep:
        log = listener.contacts
        said += f", {len(log):,} contacts; a snapshot {1e3 * (time.perf_counter() - begin):.2f} ms"
    disconnect(client)
    return said + ")"


def logged(contacts: int, a_step: int) -> ContactLog:
    """A log of random contacts between a silent floor and a silent block, a thousand a step."""
    rng = np.random.default_rng(0)
    kept, still = StepLog(), np.array([[0, 0, 0, 1.0]] * 2)
    for _ in range(contacts // a_step):
        row = np.zeros(a_step, CONTACT)
        row["b"], row["normal"] = 1, (0, 0, 1)
        row["point_a_m"], row["impulse_n_s"][:, 2] = rng.normal(size=(a_step, 3)), rng.random(a_step)
        row.flags.writeable = False
        kept.append(
            Step.of_trusted(
                DT_S, np.zeros((2, 3)), still.copy(), np.zeros(2, bool), Contacts.of_trusted(row), np.zeros(3)
            )
        )
    bodies = tuple(Body(i, -1, 0, f"block {i}", float(i), np.eye(3) * i) for i in range(2))
    return ContactLog(bodies, kept.steps(), (Microphone(np.array([0.0, -1, 0.5])),), 48_000, 0)


def contacts(hours: float) -> str:
    """Many contacts, to the disk and back and to sound."""
    before, begin = memory_mb(), time.perf_counter()
    count = round(CONTACTS * min(hours, 1.0)) // ROWS_A_STEP * ROWS_A_STEP
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        write_log(path, logged(count, ROWS_A_STEP))
        log = read_log(path)
        assert len(log) == count
        sound = render_kept(log)
        write_audio(Path(folder) / "a.wav", sound, log.sr)
        size = path.stat().st_size / 1e9
    return f"{memory_mb(peak=True) - before:.0f} MB ({len(log):,} contacts, {size:.2f} GB, {_took(begin)})"


def log(hours: float) -> str:
    """A log past 4 GiB: its first and last rows, and its count, come back."""
    before, begin = memory_mb(), time.perf_counter()
    count = round(PAST_BYTES * min(hours, 1.0)) // CONTACT.itemsize // ROWS_A_STEP * ROWS_A_STEP
    written = logged(count, ROWS_A_STEP)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        write_log(path, written)
        read, size = read_log(path), path.stat().st_size
        pairs = zip(written.blocks(), read.blocks(), strict=True)
        same = all(one.contact.tobytes() == other.contact.tobytes() for one, other in pairs)
    assert same and len(read) == count and (hours < 1 or size > 1 << 32)
    return f"right, {size / 2**30:.2f} GiB, {memory_mb(peak=True) - before:.0f} MB ({_took(begin)})"


def sound(hours: float) -> str:
    """A WAV past 4 GiB, which is RF64 then: each frame is its own number."""
    import soundfile

    before, begin = memory_mb(), time.perf_counter()
    frames, block = round(PAST_BYTES * min(hours, 1.0)) // 8, 1 << 20
    spool = SoundSpool(2)
    for start in range(0, frames, block):
        spool.add(_counted(start, min(start + block, frames)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.wav"
        report = write_audio(path, spool.finish(), 48_000)
        size, at = path.stat().st_size, 0
        with soundfile.SoundFile(path) as file:
            assert len(file) == frames == report.frames
            while len(read := file.read(block, dtype="float32", always_2d=True)):
                assert (_counted(at, at + len(read)).astype(np.float32) == read.T).all()
                at += len(read)
    assert at == frames and (hours < 1 or size > 1 << 32)
    return f"right, {report.format}, {size / 2**30:.2f} GiB, {memory_mb(peak=True) - before:.0f} MB ({_took(begin)})"


def _counted(start: int, stop: int) -> np.ndarray:
    ramp = np.arange(start, stop) % (1 << 20) / (1 << 20)
    return np.stack([ramp, -ramp])


def _took(begin: float) -> str:
    return f"{time.perf_counter() - begin:.0f} s"


ROWS: dict[str, tuple[str, str, Callable[[float], str]]] = {
    "listen": ("an hour of three bars, nothing kept, growth", "< 5 MB", lambda hours: listen(hours, False)),
    "listen-kept": ("the same, log and sound kept", "< 55 MB", lambda hours: listen(hours, True)),
    "contacts": ("10 M contacts logged, read and rendered, peak", "", contacts),
    "log": ("a log past 4 GiB", "right", log),
    "sound": ("a WAV past 4 GiB", "right", sound),
}


def main() -> int:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--only", nargs="+", choices=list(ROWS), default=list(ROWS), metavar="PART")
    parser.add_argument("--alone", action="store_true", help="in this process")
    asked = parser.parse_args()
    if asked.alone:
        what, limit, run = ROWS[asked.only[0]]
        print(f"| {what} | {limit} | {run(asked.hours)} |")
        return 0
    print("| what | must hold | measured |\n|---|---|---|", flush=True)
    command = [sys.executable, __file__, "--alone", "--hours", str(asked.hours), "--only"]
    return max(subprocess.run([*command, name], check=False).returncode for name in asked.only)


if __name__ == "__main__":
    raise SystemExit(main())
