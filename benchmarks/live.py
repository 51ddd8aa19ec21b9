"""Does it play without a gap? Boxes of 64 modes on the null card in real time, another process on the second core.

    python benchmarks/live.py [--seconds 60] [--boxes 20] [--no-load] [--weight]

One line: seconds played, latency (median and worst, from the return of a physics step to the time at which the card
says that it sounds), underruns; and a line on how late a process that does nothing but sleep was woken meanwhile, for
what a busy machine does to everybody is not this package's. --weight: where others compute on the same machine (Linux,
as root), gives this session the highest weight of all, so that the result is that of a machine of its own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import sonic_bullet as sb
from benchmarks.run_time import DT, box_model, pile
from sonic_bullet.session.live import PlaybackReport
from sonic_bullet.simulators import disconnect

BURN = "while True: pass"
WATCH = """
import time
worst, end = 0.0, time.perf_counter() + {seconds}
while time.perf_counter() < end:
    begin = time.perf_counter()
    time.sleep(0.002)
    worst = max(worst, time.perf_counter() - begin - 0.002)
print(worst)
"""


def played(boxes: int, seconds: float) -> tuple[PlaybackReport, float]:
    """The report of a pile that falls and settles, and the processor time it took over what it lasted."""
    client = pile(boxes)
    listener = sb.attach(client)
    model = None
    for body in range(1, client.getNumBodies()):
        model = box_model(client, body, listener, model)
    client.stepSimulation()
    begin = time.process_time()
    with listener.play("null") as playback:
        for _ in range(round(seconds / DT)):
            client.stepSimulation()
    spent = time.process_time() - begin
    listener.detach()
    disconnect(client)
    return playback.report, spent / seconds


def main() -> None:
    """Print two lines; exit with 1 where there was a gap, or a step sounded after more than 50 ms."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--seconds", type=float, default=60.0)
    asked.add_argument("--boxes", type=int, default=20)
    asked.add_argument("--no-load", action="store_true")
    asked.add_argument("--weight", action="store_true")
    how = asked.parse_args()
    if how.weight:
        if os.getpid() != os.getpgrp():  # else a session of its own already
            os.setsid()
        Path("/proc/self/autogroup").write_text("-20")
    load = None if how.no_load else subprocess.Popen([sys.executable, "-c", BURN])
    code = WATCH.format(seconds=how.seconds)
    watch = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        report, share = played(how.boxes, how.seconds)
    finally:
        if load is not None:
            load.kill()
    woken_ms = 1e3 * float(watch.communicate()[0])
    print(f"{how.boxes} boxes of 64 modes: {report}; {share:.2f} of a core")
    print(f"a process that sleeps woke up to {woken_ms:.1f} ms too late")
    sys.exit(report.underruns > 0 or report.latency_worst_s > 0.050)


if __name__ == "__main__":
    main()
