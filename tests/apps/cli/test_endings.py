"""However a command ends: with its result, or by a line that says why, soon, and with nothing left behind.

Each command runs in processes of its own, as from a shell.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh

from tests.few_cases import parametrize_few

REPO = Path(__file__).resolve().parents[3]
MAIN = "from sonic_bullet.apps.cli import main; main()"
IMPATIENT = f"import sonic_bullet.machine.supervisor as s; s.IDLE_S = 2.0; {MAIN}"
AWAKE = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {MAIN}"  # shells' jobs may be deaf
END_S = 1.0
HEAD = "import ctypes, os, sys, threading, time\nimport pybullet as p\np.connect(p.DIRECT)\n"
STEPS = (
    "p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.02, 0.02, 0.02]))\n"
    "for k in range(4):\n    p.stepSimulation()\n"
)
COMMANDS = {
    "render": "render {} -o a.wav",
    "film": "film {} -o a.mp4",
    "score": "score {} -o a.wav",
    "play": "play {} --device null",
    "doctor": "doctor {}",
    "baseline": "baseline {} --runs 0",
    "compare": "compare {} {}",
}


def shell(folder: Path, words: str, code: str = MAIN) -> subprocess.CompletedProcess[str]:
    settings = {**os.environ, "PYTHONPATH": str(REPO)}
    return subprocess.run(
        [sys.executable, "-c", code, *words.split()],
        cwd=folder, check=False, capture_output=True, text=True, timeout=200, env=settings,
    )  # fmt: skip


def one_line(done: subprocess.CompletedProcess[str], *words: str) -> None:
    lines = [line for line in done.stderr.splitlines() if line.startswith("sonic-bullet: ") and "note:" not in line]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in lines[0]


@pytest.mark.slow
@parametrize_few("command", COMMANDS, (0, 6))
def test_a_scene_that_ends_the_process_is_named_with_its_line(tmp_path: Path, command: str) -> None:
    (tmp_path / "a.py").write_text(f"{HEAD}{STEPS}os._exit(0)\n")
    done = shell(tmp_path, COMMANDS[command].format("a.py", "a.py"))
    assert done.returncode == 2
    one_line(done, "scene 'a.py' line 7: os._exit(0) ended the process before there was a result")
    assert [path.name for path in tmp_path.iterdir() if path.name != "__pycache__"] == ["a.py"]


@parametrize_few(
    ("text", "words"),
    [
        (f"{HEAD}def fall():\n    ctypes.string_at(0)\nfall()\n", "line 5: the process was ended by SIGSEGV"),
        ("import os\ndef build(client):\n    os.abort()\n", "line 3: the process was ended by SIGABRT"),
        (f"{HEAD}{STEPS}os.kill(os.getpid(), 9)\n", "the process was ended by SIGKILL"),
        (f"{HEAD}one = threading.Thread(target=lambda: os._exit(3))\none.start()\none.join()\n", "line 4: os._exit(3)"),
        (f"{HEAD}{STEPS}ctypes.CDLL(None)._exit(0)\n", "exit(0) ended the process before there was a result"),
        (f"{HEAD}sys.exit()\n", "line 4: SystemExit"),
        (f"{HEAD}{STEPS}sys.exit('no cup')\n", "line 7: SystemExit: no cup"),
    ], (0, 6),
)  # fmt: skip
def test_whatever_ends_the_process_is_exit_2_and_one_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.py").write_text(text)
    done = shell(tmp_path, COMMANDS["render"].format("a.py"))
    assert done.returncode == 2
    one_line(done, "scene 'a.py'", words)
    assert not (tmp_path / "a.wav").exists()


def test_a_script_that_ends_itself_after_its_steps_has_ended(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(f"{HEAD}{STEPS}sys.exit(0)\n")
    assert shell(tmp_path, COMMANDS["doctor"].format("a.py")).returncode == 0


@pytest.mark.slow
@parametrize_few(
    ("text", "line"),
    [
        (f"{HEAD}while True:\n    p.getKeyboardEvents()\n    time.sleep(0.01)\n", (4, 6)),
        (f"{HEAD}{STEPS}while p.isConnected():\n    pass\n", (7, 8)),
        (f"{HEAD}while True:\n    try:\n        time.sleep(1)\n    except BaseException:\n        pass\n", (4, 8)),
        (f"{HEAD}threading.Event().wait()\n", (4, 4)),
        ("def build(client):\n    while True:\n        client.getKeyboardEvents()\n", (2, 3)),
    ],
    (1, 4),
)
def test_a_script_that_never_steps_is_ended(tmp_path: Path, text: str, line: tuple[int, int]) -> None:
    (tmp_path / "a.py").write_text(text)
    done = shell(tmp_path, COMMANDS["render"].format("a.py"), IMPATIENT)
    assert done.returncode == 2
    one_line(done, "s without a physics step", "leave a viewer's loop out")
    said = int(done.stderr.partition("scene 'a.py' line ")[2].partition(":")[0])
    assert line[0] <= said <= line[1]


@pytest.mark.slow
def test_what_we_compute_for_a_script_is_not_its_idling(tmp_path: Path) -> None:
    """Modes that take longer than a script may idle, and an import that does."""
    (tmp_path / "slow.py").write_text("import time\nreal = time.monotonic() + 4\nwhile time.monotonic() < real: pass\n")
    (tmp_path / "a.py").write_text(f"{HEAD}import slow\n{STEPS}")
    done = shell(tmp_path, "doctor a.py", IMPATIENT)
    assert done.returncode == 0, done.stderr


def most_s() -> float:
    """How long a command may take to end: longer where others want the processors too."""
    return END_S * min(max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)), 3.0)


def left_behind(folder: Path) -> list[str]:
    """What a command leaves that has no name, beside its output and in its own temporary folder."""
    partial = [path.name for path in folder.rglob("*sonic-bullet-*.partial")]
    return partial + [path.name for path in (folder / "temporary").iterdir()]


def children(marker: str) -> list[int]:
    """Processes whose environment holds a text."""
    found = []
    for place in Path("/proc").glob("[0-9]*/environ"):
        try:
            if marker.encode() in place.read_bytes():
                found.append(int(place.parent.name))
        except OSError:
            continue
    return found


def stopped(folder: Path, words: str, word: signal.Signals, after_s: float, **settings: str) -> tuple[int, float, str]:
    """Exit code, seconds until it was gone, and what was said, of a command that is told to end."""
    marker = f"{folder}:{time.monotonic()}"
    (folder / "temporary").mkdir()
    places = {"PYTHONPATH": str(REPO), "TMPDIR": str(folder / "temporary")}
    given = {**os.environ, **places, "TEST_MARKER": marker, **settings}
    running = subprocess.Popen(
        [sys.executable, "-c", AWAKE, *words.split()], cwd=folder, text=True, env=given,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        time.sleep(after_s)
        assert running.poll() is None, running.communicate()[1]
        start = time.monotonic()
        running.send_signal(word)
        said = running.communicate(timeout=60)[1]
        took_s = time.monotonic() - start
        assert not children(marker)
    finally:
        running.kill()
    return running.returncode, took_s, said


LOOP = f"{HEAD}{STEPS}while True:\n    p.stepSimulation()\n    [None for _ in range(600_000)]\n"
STOPS = [(signal.SIGINT, 130), (signal.SIGTERM, 143)]


@pytest.mark.slow
@parametrize_few("command", COMMANDS, 1)
@pytest.mark.parametrize(("number", "after_s"), [(0, 1.5), (1, 4.0)])
def test_every_command_ends_within_a_second(tmp_path: Path, command: str, number: int, after_s: float) -> None:
    word, code = STOPS[number]
    (tmp_path / "a.py").write_text(LOOP)
    words = COMMANDS[command].format("a.py", "a.py")
    status, took_s, said = stopped(tmp_path, words, word, after_s)
    assert status == code, said
    assert "mend the scene" not in said
    assert took_s < most_s()
    assert not left_behind(tmp_path)


@pytest.mark.slow
@parametrize_few(("word", "code"), STOPS, 1)
@pytest.mark.parametrize("after_s", [1.5, 3.0])
def test_meshing_and_solving_end_within_a_second(
    tmp_path: Path, word: signal.Signals, code: int, after_s: float
) -> None:
    """Netgen is another process, a factorisation a call of C that hears no signal."""
    trimesh.creation.torus(0.1, 0.03, major_sections=200, minor_sections=100).export(tmp_path / "ring.stl")
    status, took_s, said = stopped(
        tmp_path, "modes ring.stl --count 300 --accuracy 0.001", word, after_s, SONIC_BULLET_CACHE=str(tmp_path / "c")
    )
    assert status == code, said
    assert took_s < most_s()
    assert not left_behind(tmp_path)


@pytest.mark.slow
def test_a_comparison_with_a_revision_that_is_stopped_leaves_no_tree(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(LOOP)
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@y"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"]):
        subprocess.run([*git, *words], check=True)
    status, _, said = stopped(tmp_path, "compare a.py --ref HEAD", signal.SIGTERM, 4.0)
    assert status == 143, said
    assert not left_behind(tmp_path)
    assert subprocess.run([*git, "worktree", "list"], capture_output=True, check=True).stdout.count(b"\n") == 1


def test_a_process_that_is_asked_at_every_moment_where_it_is_does_its_work() -> None:
    """Whoever answers between two bytecodes cannot be met in the middle of a call, as a Python 3.12 or 3.13 was."""
    work = (
        "import sonic_bullet.machine.supervisor as s, sys, time\n"
        "from pathlib import Path\n"
        "from sonic_bullet.machine.worker import running_scene\n"
        "s.ASK_S = 0.0\n"
        "def run():\n"
        "    end = time.monotonic() + 1\n"
        "    with running_scene(Path('a.py')):\n"
        "        while time.monotonic() < end:\n"
        "            compile('def f(x):\\n return [y for y in range(x)]\\n' * 50, 'b', 'exec'), sorted(range(1000))\n"
        "    return 7\n"
        "sys.exit(s.run_supervised(run).code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", work], cwd=REPO, check=False, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 7, done.stderr


def test_a_pool_of_a_scene_ends_its_workers_as_everywhere() -> None:
    """Which it does by a signal that is an interrupt of ours in the scene's own process alone."""
    code = (
        "import signal, sys\n"
        "from multiprocessing import get_context\n"
        "from sonic_bullet.machine.worker import catch_stops\n"
        "catch_stops()\n"
        "before = signal.getsignal(signal.SIGTERM)\n"
        "with get_context('fork').Pool(1) as pool:\n"
        "    assert pool.apply(signal.getsignal, (signal.SIGTERM,)) is signal.SIG_DFL\n"
        "    assert pool.apply(signal.getsignal, (signal.SIGINT,)) is signal.default_int_handler\n"
        "assert signal.getsignal(signal.SIGTERM) is before is not signal.SIG_DFL\n"
    )
    subprocess.run([sys.executable, "-c", AWAKE.replace(MAIN, code)], check=True, timeout=60)


CLOSED = {
    "materials": "materials",
    "modes": "modes bar.obj --count 1 --json",
    "render": "render a.py -o a.wav",
    "compare": "compare a.py a.py",
    "doctor": "doctor a.py",
    "cache": "cache",
    "version": "--version",
    "help": "render --help",
    "error": "render nowhere.py -o a.wav",
}


@parametrize_few("command", CLOSED, (0, 8))
@pytest.mark.parametrize("streams", [">&-", ">&- <&-", ">&- 2>&-"])
def test_a_closed_standard_output_is_no_traceback(tmp_path: Path, command: str, streams: str) -> None:
    """What is printed is lost, and told; files are whole, and the streams' numbers are nobody else's."""
    (tmp_path / "a.py").write_text(f"{HEAD}{STEPS}")
    trimesh.creation.box([0.1, 0.02, 0.01]).export(tmp_path / "bar.obj")
    words = f'"{sys.executable}" -c "{MAIN}" {CLOSED[command]} {streams}'
    done = subprocess.run(
        ["sh", "-c", words], cwd=tmp_path, check=False, capture_output=True, text=True, timeout=200,
        env={**os.environ, "PYTHONPATH": str(REPO)},
    )  # fmt: skip
    assert done.returncode == (2 if command == "error" else 0), done.stderr
    assert done.stdout == ""
    if "2>" not in streams:
        told = [line for line in done.stderr.splitlines() if "standard output is closed" in line]
        assert len(told) == 1 and "Traceback" not in done.stderr
    if command == "render":
        assert (tmp_path / "a.wav").read_bytes()[:4] == b"RIFF"
