"""Where stderr is no terminal, whoever waits is told what is done and how far: first within 2 s, then every 5 s."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import trimesh

from sonic_bullet.machine.progress import CALL_QUIET_S, ProgressLines, report_progress, show_progress, status
from tests.few_cases import parametrize_few

EVERY_S = 4.0
BETWEEN_STAGES_S = 1.0

REPO = Path(__file__).resolve().parents[3]
COMMAND = [sys.executable, "-m", "sonic_bullet"]
FIRST_S, GAP_S = 2.0, 5.0
START_S = 0.5  # of a Python on a machine that has nothing else to do
LINE = re.compile(r"\[\d+ s\] ")
FOUR_LINES = """import pybullet as p, pybullet_data as d
p.connect(p.DIRECT), p.setAdditionalSearchPath(d.getDataPath()), p.setGravity(0, 0, -9.81)
p.loadURDF("plane.urdf"), p.loadURDF("cube_small.urdf", [0, 0, 0.5])
while True: p.stepSimulation()
"""
ADD = """import sys, pybullet as p, sonic_bullet as sb
from sonic_bullet.simulators import direct_client
client = direct_client()
box = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.03])
listener = sb.attach(client, microphone=(0, -1, 0.5))
listener.add(client.createMultiBody(1, box), material="steel", mesh="bowl.obj", name="bowl", accuracy=0.005)
"""


@dataclass(frozen=True, slots=True)
class Heard:
    """A run. lines: (seconds since it was started, what stderr said)."""

    code: int
    lines: list[tuple[float, str]]
    took_s: float
    stdout: str

    @property
    def progress(self) -> list[tuple[float, str]]:
        return [(at, line) for at, line in self.lines if LINE.match(line)]

    @property
    def text(self) -> str:
        return "\n".join(f"{at:6.2f} {line}" for at, line in self.lines)


def heard(folder: Path, words: list[str], **settings: str) -> Heard:
    known = {name: text for name, text in os.environ.items() if name != "SONIC_BULLET_PROGRESS"}
    begin = time.monotonic()
    with (
        open(folder / "stdout", "w") as out,
        subprocess.Popen(
            words,
            cwd=folder,
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            env={**known, "PYTHONPATH": str(REPO), **settings},
        ) as process,
    ):
        assert process.stderr is not None
        lines = [(time.monotonic() - begin, line.rstrip("\n")) for line in process.stderr]
    took_s = time.monotonic() - begin
    return Heard(process.returncode, lines, took_s, (folder / "stdout").read_text())


def start_s() -> float:
    """What this machine takes now to start a Python, beyond what one at rest does."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-c", "import sonic_bullet.apps.cli"], check=True, cwd=REPO)
    return max(0.0, time.monotonic() - begin - START_S)


def check(run: Heard, *, first_s: float, least_s: float = 0.0) -> None:
    """The run told what it did from first_s on without a gap; least_s: it lasted so long that this says something."""
    assert run.took_s > least_s, run.text
    times = [at for at, _ in run.progress]
    assert times and times[0] <= first_s, run.text
    gaps = [b - a for a, b in zip([0.0, *times], [*times, run.took_s], strict=True)]
    print(f"first line {times[0]:.2f} s, largest gap {max(gaps):.2f} s, {len(times)} lines in {run.took_s:.1f} s")
    assert max(gaps[1:]) <= GAP_S, run.text


def bowl(folder: Path) -> None:
    """A mesh that takes seconds: neither a box nor of revolution."""
    ring = trimesh.creation.torus(0.1, 0.03, major_sections=40, minor_sections=20)
    ring.vertices[:, 2] *= 1 + 3 * ring.vertices[:, 0]
    ring.export(folder / "bowl.obj")


@pytest.mark.slow
def test_a_first_render_with_empty_caches_is_never_silent(tmp_path: Path) -> None:
    """Modes are solved, and how they radiate: the longest that a newcomer waits."""
    (tmp_path / "four.py").write_text(FOUR_LINES)
    empty = {"SONIC_BULLET_CACHE": str(tmp_path / "models")}
    late_s = start_s()
    run = heard(tmp_path, [*COMMAND, "render", "four.py", "-o", "a.wav"], **empty)
    assert run.code == 0, run.text
    check(run, first_s=FIRST_S + late_s)
    assert any("modes of cube" in line for _, line in run.progress), run.text


@pytest.mark.slow
def test_a_render_says_what_it_does_and_sounds_the_same(tmp_path: Path) -> None:
    (tmp_path / "four.py").write_text(FOUR_LINES)
    words = [*COMMAND, "render", "four.py", "--seconds", "2", "-o"]
    late_s = start_s()
    run = heard(tmp_path, [*words, "a.wav"], SONIC_BULLET_CACHE=str(tmp_path / "models"))
    assert run.code == 0, run.text
    check(run, first_s=FIRST_S + late_s)
    silent = heard(tmp_path, [*words, "b.wav"], SONIC_BULLET_PROGRESS="0")
    assert silent.code == 0 and not silent.progress, silent.text
    assert (tmp_path / "a.wav").read_bytes() == (tmp_path / "b.wav").read_bytes()


@pytest.mark.slow
def test_modes_announce_the_mesh_and_leave_json_clean(tmp_path: Path) -> None:
    bowl(tmp_path)
    late_s = start_s()
    words = [*COMMAND, "modes", "bowl.obj", "--accuracy", "0.005", "--json"]
    run = heard(tmp_path, words, SONIC_BULLET_CACHE=str(tmp_path / "models"))
    assert run.code == 0, run.text
    check(run, first_s=FIRST_S + late_s, least_s=2.0)
    assert any("modes bowl.obj: " in line and "unknowns" in line for _, line in run.progress), run.text
    assert json.loads(run.stdout)["modes"]


@pytest.mark.slow
@pytest.mark.shared
def test_a_fit_says_what_it_listens_to(tmp_path: Path, shared_path: Path) -> None:
    late_s = start_s()
    case = shared_path / "practice" / "practice-01"
    run = heard(tmp_path, [*COMMAND, "fit", str(case), "-o", "p.json"], SONIC_BULLET_CACHE=str(tmp_path / "models"))
    assert run.code in (0, 1), run.text
    check(run, first_s=FIRST_S + late_s, least_s=2.0)
    assert any("listening to 5 recordings" in line for _, line in run.progress), run.text


@pytest.mark.slow
def test_add_in_a_script_names_the_body_that_takes_long(tmp_path: Path) -> None:
    """No command and no supervisor: a thread speaks, from 2 s on."""
    bowl(tmp_path)
    (tmp_path / "add.py").write_text(ADD)
    run = heard(tmp_path, [sys.executable, "add.py"], SONIC_BULLET_CACHE=str(tmp_path / "models"))
    assert run.code == 0, run.text
    late_s = run.took_s  # the imports before it are the script's
    check(run, first_s=late_s, least_s=CALL_QUIET_S)
    assert all("modes of bowl" in line or "bowl radiate" in line for _, line in run.progress[:1]), run.text
    quick = heard(tmp_path, [sys.executable, "add.py"], SONIC_BULLET_CACHE=str(tmp_path / "models"))
    assert quick.code == 0 and len(quick.progress) <= 1, quick.text  # kept; one line on a machine that is very busy


@parametrize_few("word", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL], (2,))
def test_nobody_stays_behind_a_script_that_is_ended(tmp_path: Path, word: signal.Signals) -> None:
    """What speaks is gone with what it speaks of: the pipe is closed."""
    bowl(tmp_path)
    (tmp_path / "add.py").write_text(ADD)
    settings = {**os.environ, "PYTHONPATH": str(REPO), "SONIC_BULLET_CACHE": str(tmp_path / "models")}
    settings.pop("SONIC_BULLET_PROGRESS", None)
    with subprocess.Popen(
        [sys.executable, "add.py"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env=settings,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if LINE.match(line):
                break
        process.send_signal(word)
        process.wait(200)  # a call of C hears no signal
        began = time.monotonic()
        process.stderr.read()  # ends when nobody holds the pipe any more
        assert time.monotonic() - began < 5.0


@parametrize_few("words", [["materials"], ["--version"], ["features", "missing.wav"]], 1)
def test_what_is_quick_says_nothing(tmp_path: Path, words: list[str]) -> None:
    late_s = start_s()
    run = heard(tmp_path, [*COMMAND, *words])
    assert not run.progress or (late_s > 0 and words[0] == "features"), run.text


# ---- when a line is due, by a clock of its own


def told(messages: list[tuple[float, str]], until_s: float, quiet_s: float = 1.0) -> list[tuple[float, str]]:
    lines, out, waiting = ProgressLines("render", 0.0, quiet_s), [], list(messages)
    for k in range(round(until_s / 0.05)):
        now_s = 0.05 * k
        while waiting and waiting[0][0] <= now_s:
            lines.take(waiting.pop(0)[1])
        if line := lines.due(now_s):
            out.append((now_s, line))
    return out


def said(process: int, text: str, label: str = "a.py") -> str:
    return f"{process}\t{label}\t{text}"


@pytest.mark.parametrize(
    "messages",
    [
        [],
        [(0.0, said(1, "modes of cup"))],
        [(0.1 * k, said(1, f"{k // 10} %")) for k in range(600)],
        [(0.01 * k, said(1, f"modes of link{k}")) for k in range(3000)],
        [(0.5, said(1, "A")), (3.0, said(2, "B")), (9.0, said(1, "", "")), (30.0, said(2, "", ""))],
    ],
    ids=["nothing", "one stage", "percent", "many bodies", "two processes"],
)
def test_lines_are_neither_late_nor_many(messages: list[tuple[float, str]]) -> None:
    times = [at for at, _ in told(messages, 60.0)]
    assert times[0] == pytest.approx(1.0, abs=0.06)
    gaps = [b - a for a, b in zip(times, [*times[1:], 60.0], strict=True)]
    assert max(gaps) < EVERY_S + 0.1
    assert min(gaps[:-1]) > BETWEEN_STAGES_S - 0.01


def test_a_line_says_who_does_what_and_how_far() -> None:
    lines = told([(0.5, said(1, "modes of cup: 10 modes found")), (1.5, said(2, "radiation"))], 9.0)
    assert lines[0] == (pytest.approx(1.0), "[1 s] render a.py: modes of cup: 10 modes found")
    assert lines[1][1] == "[2 s] render a.py: modes of cup: 10 modes found; radiation"
    assert "render a.py: 37 %" in told([(0.0, said(1, "37 %"))], 2.0)[0][1]
    assert told([], 2.0)[0][1] == "[1 s] render: starting"
    assert told([(0.0, said(1, "A")), (0.5, said(1, "", ""))], 2.0)[0][1] == "[1 s] render: working"


def test_a_thread_speaks_and_is_gone(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delenv("SONIC_BULLET_PROGRESS", raising=False)
    monkeypatch.setattr("sonic_bullet.machine.progress.CALL_QUIET_S", 0.2)
    before = set(threading.enumerate())
    names: list[Any] = ["cup\x1b[2J", "two\nlines", "Ж" * 999]
    for name in names:
        with status("sonic_bullet"):
            report_progress(f"modes of {name}")
            time.sleep(0.6)
    assert set(threading.enumerate()) == before
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(names) and all(len(line) <= 300 for line in lines)
    assert lines[0].endswith("modes of cup?[2J") and lines[1].endswith("modes of two lines")


def test_a_caller_who_listens_is_told_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """progress=… of `listener.add` in place of lines: nothing on stderr."""
    monkeypatch.delenv("SONIC_BULLET_PROGRESS", raising=False)
    monkeypatch.setattr("sonic_bullet.machine.progress.CALL_QUIET_S", 0.2)
    seen: list[str] = []
    for mine in (seen.append, None):
        with show_progress(mine):
            report_progress("modes of cup")
            time.sleep(0.6)
    assert seen == ["modes of cup"]
    assert "modes of cup" in capsys.readouterr().err
