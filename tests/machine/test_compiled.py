"""Machine code kept between processes: nobody else can put any there, nothing broken there ends a run, and nowhere to
keep it is no error.
"""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import numba.core.caching
import pytest

from sonic_bullet.machine import compiled
from sonic_bullet.storage import user_folder
from sonic_bullet.storage.user_folder import private_folder
from tests.few_cases import parametrize_few

PACKAGE = Path(__file__).resolve().parents[2] / "sonic_bullet"
KERNEL = """
from sonic_bullet.machine.compiled import njit

@njit(nogil=True)
def twice(x):
    return 2 * x
"""
MAIN = """
import sys
sys.path.insert(0, sys.argv[1])
from kernel import twice
assert twice(21.0) == 42.0
print(sum(twice.stats.cache_hits.values()))
"""


PLACES = ("compiled.py", "whole_program_jit.py")


@pytest.fixture(autouse=True)
def unsaid(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is noted here about folders is not for the commands that later tests run in this process."""
    monkeypatch.setattr(user_folder, "notes", [])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "kernel.py").write_text(KERNEL)
    return tmp_path


def hits(folder: Path, **environment: str) -> int:
    """How many kernels another process found compiled; it computes with them all the same."""
    known = {
        name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
    }
    where = environment or {"NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", MAIN, folder],
        cwd=folder,
        env=known | where,
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return int(done.stdout)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(compiled, "folder", lambda: tmp_path)
    return tmp_path


def twice(x: float) -> float:
    return 2 * x


def found_here() -> int:
    """How many kernels a new dispatcher of this process found compiled; it computes with them all the same."""
    kernel = compiled.njit(nogil=True)(twice)
    assert kernel(21.0) == 42.0
    return int(sum(kernel.stats.cache_hits.values()))


def kept(folder: Path, ending: str) -> Path:
    (found,) = folder.rglob(f"*{ending}")
    return found


@pytest.mark.slow
def test_a_second_process_does_not_compile(folder: Path) -> None:
    (folder / "cache").mkdir()
    assert [hits(folder), hits(folder)] == [0, 1]
    assert not list(folder.rglob("__pycache__/*.nb?"))
    (folder / "kernel.py").write_text(KERNEL + "# changed\n")
    assert hits(folder) == 0


@pytest.mark.slow
def test_code_is_of_all_the_sources_that_it_was_made_of(folder: Path) -> None:
    """What a kernel calls, and numbers that it reads, are in its machine code: two modules further on, too."""
    (folder / "cache").mkdir()
    kernel = "from helper import factor\nfrom inner import (\n    times,\n)\n" + KERNEL.replace(
        "2 * x", "times(factor, x)"
    )
    (folder / "kernel.py").write_text(kernel)
    (folder / "helper.py").write_text("import number\nfactor = number.NUMBER\n")
    (folder / "number.py").write_text("NUMBER = 1\n")
    inner = (
        "from sonic_bullet.machine.compiled import njit\n\n@njit(nogil=True)\ndef times(a, b):\n    return 2 * a * b\n"
    )
    (folder / "inner.py").write_text(inner)
    assert [hits(folder), hits(folder)] == [0, 1]
    (folder / "number.py").write_text("NUMBER = 2\n")
    (folder / "inner.py").write_text(inner.replace("2 * a", "a"))
    assert [hits(folder), hits(folder)] == [0, 1]
    (folder / "unread.py").write_text("NUMBER = 3\n")
    assert hits(folder) == 1


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_a_kept_file_that_is_cut_is_compiled_anew(place: Path, ending: str) -> None:
    assert found_here() == 0
    path = kept(place, ending)
    whole = path.read_bytes()
    for broken in (whole[: len(whole) // 2], b""):
        path.write_bytes(broken)
        assert found_here() == 0
        assert found_here() == 1  # and kept again


def test_a_folder_is_made_this_users_alone(tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    for name in ("open", "new", "above/new", "two/are/missing"):
        assert private_folder(tmp_path / name) == tmp_path / name
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o700


def test_a_folder_that_is_another_users_or_behind_anothers_link_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "folder")
    assert private_folder(tmp_path / "file") is None
    assert len(user_folder.notes) == 1
    assert private_folder(tmp_path / "link") == tmp_path / "link"  # one's own, to another disk say
    if os.geteuid() == 0:
        os.chown(tmp_path / "link", 54321, 54321, follow_symlinks=False)
        assert private_folder(tmp_path / "link") is None
        (tmp_path / "mine").symlink_to(tmp_path / "folder")
        os.chown(tmp_path / "folder", 54321, 54321)
        assert private_folder(tmp_path / "folder") is private_folder(tmp_path / "mine") is None


@parametrize_few("home", ["/dev/null", "", "not/absolute"], 1)
def test_without_a_place_kernels_are_compiled_in_every_process(folder: Path, home: str) -> None:
    before = {path.name for path in folder.iterdir()}
    assert hits(folder, HOME=home, XDG_CACHE_HOME=home or "/proc/none") == 0
    assert {path.name for path in folder.iterdir()} - before <= {"__pycache__"}


def test_a_numba_whose_inner_parts_moved_compiles(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(numba.core.caching.CompileResultCacheImpl, "rebuild")
    monkeypatch.delattr(numba.core.caching.FunctionCache, "_impl_class")
    monkeypatch.setattr(numba.core.caching.Cache, "__init__", None)
    assert [found_here(), found_here()] == [0, 0]


def test_every_kernel_is_compiled_in_the_one_place() -> None:
    found = {path.name: path.read_text() for path in PACKAGE.rglob("*.py") if path.name not in PLACES}
    kernels = sum(len(re.findall(r"^@njit\(", text, re.M)) for text in found.values())
    assert kernels > 60
    assert [
        name for name, text in found.items() if re.search(r"from numba import .*jit|numba\.\w*jit|cache=True", text)
    ] == []
