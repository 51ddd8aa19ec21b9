"""The gate says what a revision changes: equal trees pass, a changed number is named, bad input is one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tools import gate
from tools.gate_values import compare_values

REPO = Path(__file__).resolve().parents[2]
STUB = """
import json, sys
from pathlib import Path
import numpy as np
asked = json.loads(Path(sys.argv[1]).read_text())
name = asked["job"].partition("/")[2]
own = {}
exec((Path(asked["tree"]) / "scenes" / f"{name}.py").read_text(), own)
for probe, place in asked["probes"].items():
    error = ""
    try:
        np.savez(place, frames=np.array(own["sound"](probe.rpartition("/")[2])))
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    print(json.dumps({"probe": probe, "used_s": 0.0, "error": error}), flush=True)
"""
SCENE = "def sound(probe):\n    return [0.25, {number}]\n"
ONE = ("--only", "*/replay", "--jobs", "1")


def run_git(folder: Path, *words: str) -> None:
    who = ("-c", "user.name=n", "-c", "user.email=n@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", "-C", str(folder), *who, *words], check=True, capture_output=True)


def commit(folder: Path, **scenes: str) -> None:
    for name, text in scenes.items():
        (folder / "scenes").mkdir(exist_ok=True)
        (folder / "scenes" / f"{name}.py").write_text(text)
    run_git(folder, "add", "--all")
    run_git(folder, "commit", "--allow-empty", "-m", "next")


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """A probe without the package: a sound is what the scene's file returns."""
    (tmp_path / "stub.py").write_text(STUB)
    return tmp_path / "stub.py"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A repository of one scene in two commits of equal content."""
    folder = tmp_path / "own"
    folder.mkdir()
    run_git(folder, "init", "--quiet")
    commit(folder, bar=SCENE.format(number=0.5))
    commit(folder)
    return folder


def test_equal_trees_pass_and_nothing_is_left(
    root: Path, script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert gate.main(["HEAD~1", *ONE], root, script) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == "scene/bar/replay: equal"
    assert said.out.splitlines()[-1].startswith("1 of 1 probes equal, fit and diagnose skipped: no practice cases")
    assert [line.split()[1:3] for line in said.err.splitlines()[:2]] == [
        ["BASE", "scene/bar/replay:"],
        ["HEAD", "scene/bar/replay:"],
    ]
    assert not list(tmp_path.glob("gate-*"))
    assert len(list_worktrees(root)) == 1


def list_worktrees(root: Path) -> list[str]:
    listed = subprocess.run(["git", "-C", str(root), "worktree", "list"], check=True, capture_output=True, text=True)
    return listed.stdout.splitlines()


def test_a_changed_number_is_named(root: Path, script: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commit(root, bar=SCENE.format(number=np.nextafter(0.5, 1)))
    assert gate.main(["HEAD~1", "HEAD", *ONE], root, script) == 1
    assert capsys.readouterr().out.splitlines() == [
        "scene/bar/replay: differs (max |Δ| 1.11e-16 in 'frames')",
        "0 of 1 probes equal, fit and diagnose skipped: no practice cases in ../shared",
    ]


def test_what_is_missing_or_fails_is_named_and_never_equal(
    root: Path, script: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    commit(root, new=SCENE.format(number=1.0), bar="def sound(probe):\n    raise ValueError('no ' + probe)\n")
    assert gate.main(["HEAD~1", *ONE], root, script) == 1
    assert capsys.readouterr().out.splitlines()[:2] == [
        "scene/bar/replay: failed in HEAD: ValueError: no replay",
        "scene/new/replay: missing in BASE",
    ]


BACKEND = """
import zipfile
def build_wheel(directory, settings=None, metadata=None):
    source = open("src/engine.cpp").read()
    if "fault" in source:
        raise SystemExit("engine.cpp:1: error")
    with zipfile.ZipFile(directory + "/own-1-py3-none-any.whl", "w") as file:
        file.writestr("sonic_bullet/_engine.abi3.so", source + "built")
        file.writestr("sonic_bullet/_engine.pyi", "")
        file.writestr("own-1.dist-info/METADATA", "Metadata-Version: 2.1\\nName: own\\nVersion: 1\\n")
        file.writestr("own-1.dist-info/WHEEL", "Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n")
        file.writestr("own-1.dist-info/RECORD", "")
    return "own-1-py3-none-any.whl"
"""
ENGINE_SCENE = """
from pathlib import Path
import sonic_bullet
def sound(probe):
    return (Path(sonic_bullet.__file__).parent / "_engine.abi3.so").read_bytes()
"""


def commit_engine(root: Path, source: str) -> None:
    """A package whose engine is built by a backend of the tree, and holds its own source."""
    for name, text in {
        "pyproject.toml": '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["."]\n',
        "backend.py": BACKEND,
        "CMakeLists.txt": "",
        "sonic_bullet/__init__.py": "",
        "src/engine.cpp": source,
    }.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text)
    commit(root, bar=ENGINE_SCENE)


def test_each_tree_gets_the_engine_of_its_sources(root: Path, script: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An editable install of the checkout, which is how this test runs, is not what the trees import."""
    commit_engine(root, "one")
    (root / "sonic_bullet" / "__init__.py").write_text("# only Python differs\n")
    commit(root)
    assert gate.main(["HEAD~1", *ONE], root, script) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == "scene/bar/replay: equal"
    assert said.err.count("building the engine") == 1
    commit_engine(root, "another")
    assert gate.main(["HEAD~1", *ONE], root, script) == 1
    said = capsys.readouterr()
    assert said.out.startswith("scene/bar/replay: differs") and said.err.count("building the engine") == 2
    commit_engine(root, "fault")
    assert gate.main(["HEAD~1", *ONE], root, script) == 2
    assert "gate: the engine of HEAD was not built: pip ended with 1" in capsys.readouterr().err


def test_a_process_that_ends_early_is_no_equality(root: Path, script: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commit(root, bar="import os\nos._exit(3)\n")
    assert gate.main(["HEAD", *ONE], root, script) == 1
    assert "failed in BASE: the process ended with 3" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "no revision 'nowhere'"),
        (["HEAD", "nowhere"], "no revision 'nowhere'"),
        (["HEAD", "--only", "nothing"], "no probe matches 'nothing'"),
        (["HEAD", "--jobs", "0"], "--jobs"),
        ([], "BASE"),
    ],
)
def test_bad_input_is_one_line(
    root: Path, script: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert gate.main(arguments, root, script) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gate: ") and said in line


def test_results_of_a_commit_are_taken_up(
    root: Path, script: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keep = ("--keep", str(tmp_path / "kept"))
    assert gate.main(["HEAD~1", *ONE, *keep], root, script) == 0
    capsys.readouterr()
    assert gate.main(["HEAD~1", *ONE, *keep], root, script) == 0
    assert capsys.readouterr().err.count("kept") == 2
    assert gate.main(["HEAD", "HEAD", *ONE, *keep], root, script) == 0
    assert capsys.readouterr().err.count("kept") == 1, "a commit is not its own second run"


def test_an_interrupt_tells_what_is_done_and_removes_the_trees(root: Path, script: Path, tmp_path: Path) -> None:
    slow = "import time\ndef sound(probe):\n    if probe == 'replay':\n        time.sleep(60)\n    return [1.0]\n"
    commit(root, bar=slow)
    place = tmp_path / "tmp"
    place.mkdir()
    code = f"""
import signal, sys; sys.path.insert(0, {str(REPO)!r})
from pathlib import Path
from tools import gate
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a script started in the background
raise SystemExit(gate.main(["HEAD", "--only", "*/[br][le]*[1y]"], Path({str(root)!r}), Path({str(script)!r})))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code], env={**os.environ, "TMPDIR": str(place)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    for _ in range(2):  # blocks-1 of both sides
        assert "blocks-1: done" in process.stderr.readline()
    start = time.monotonic()
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    assert time.monotonic() - start < 20
    assert out.splitlines()[:2] == [
        "scene/bar/blocks-1: equal",
        "scene/bar/replay: stopped in BASE; stopped in HEAD",
    ]
    assert not list(place.iterdir())


def test_differences_are_told_by_kind() -> None:
    one = {"a": np.array([0.0, 1.0]), "b": np.array(["x=1", "y=2"])}
    assert compare_values(one, dict(one)) == "equal"
    assert compare_values(one, {**one, "a": np.array([-0.0, 1.0])}) == "differs (max |Δ| 0 in 'a')"
    assert compare_values(one, {**one, "a": np.array([np.nan, 1.0])}) == "differs (max |Δ| inf in 'a')"
    assert compare_values(one, {**one, "a": np.zeros(3)}) == "differs (shape of 'a': (2,), (3,))"
    assert compare_values(one, {**one, "b": np.array(["x=1", "y=3"])}) == "differs ('y=2' is 'y=3')"
    listed = {"r: numbers": np.array([1.0, 2.0]), "r: paths of numbers": np.array(["r/a", "r/b"])}
    assert compare_values(listed, {**listed, "r: numbers": np.array([1.0, 4.0])}) == "differs (max |Δ| 2 in 'r/b')"
    bytes_of = {"c": np.array([1, 2], np.uint8)}
    assert compare_values(bytes_of, {"c": np.array([1, 3], np.uint8)}) == "differs (whole numbers of 'c')"
    assert compare_values(one, {"a": one["a"]}) == "differs ('b' only in BASE)"


def test_every_scene_and_mesh_of_the_project_has_its_probes(tmp_path: Path) -> None:
    files = frozenset(str(path.relative_to(REPO)) for name in ("scenes", "assets") for path in (REPO / name).iterdir())
    jobs, skipped = gate.list_jobs(files, tmp_path)
    names = {probe for job in jobs for probe in job.probes}
    assert {f"scene/{path.stem}/blocks-7" for path in (REPO / "scenes").glob("*.py")} <= names
    assert {f"modes/assets/{path.name}" for path in (REPO / "assets").glob("*.obj")} <= names
    assert len(names) > 90 and skipped == 2


def test_every_probe_of_a_scene_is_one_that_the_script_has() -> None:
    from tools import gate_probe

    for name in gate.SCENE_PROBES:
        assert callable(getattr(gate_probe.SceneJob, "probe_" + name.replace("-", "_")))
