"""Kernels that call kernels: written down where they are called, optimised where Python calls, and by two processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from sonic_bullet.machine import compiled

KERNELS = {
    "inner.py": "SCALE = 3.0",
    "kernels.py": """
import numpy as np
from package.inner import SCALE
from sonic_bullet.machine.compiled import njit

@njit(nogil=True)
def scaled(x, power):
    return SCALE * x ** power

@njit(nogil=True)
def total(values):
    made = np.zeros(3)
    for i in range(len(values)):
        made[i % 3] += scaled(values[i], 2) + scaled(values[i], i)
    return made.sum()
""",
    "handed.py": """
import os, sys
from multiprocessing import get_context
from numba import float64, int64
from package.kernels import scaled, total
from sonic_bullet.machine.whole_program_jit import name_apart, take_in, write, written

def work(pipe):
    name_apart()
    write(scaled, (float64, int64))
    pipe.send_bytes(written(scaled, (float64, int64)))

ours, theirs = get_context("fork").Pipe(duplex=False)
get_context("fork").Process(target=work, args=(theirs,)).start()
take_in(scaled, ours.recv_bytes())
import numpy as np
assert total(np.array([1.0, 2.0])) == 3 * (1 + 1 + 4 + 2)
assert "v1000000" in next(iter(scaled.part.overloads.values())).fndesc.mangled_name
""",
    "kept.py": """
import numpy as np
from package.kernels import scaled, total
print(total(np.array([1.0])), sum(total.stats.cache_hits.values()), len(scaled.part.overloads))
""",
}
FIRST_RUN = """
from sonic_bullet.runtime import driver, first_run
from sonic_bullet.runtime.replay import make_ready
make_ready()
assert driver.advance_steps.stats.cache_misses and not driver.advance_steps.stats.cache_hits
print(*(len(stage.part.overloads) for stage in first_run.STAGES))
"""


def run(folder: Path, code: str) -> str:
    known = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=known, check=False, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "package").mkdir()
    (tmp_path / "cache").mkdir()
    (tmp_path / "package" / "__init__.py").write_text("")
    for name, text in KERNELS.items():
        (tmp_path / "package" / name).write_text(text)
    return tmp_path


@pytest.fixture
def divided(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A kernel of which nothing is kept."""
    monkeypatch.setattr(compiled, "folder", lambda: None)

    @compiled.njit(nogil=True)
    def divided(a, b):  # type: ignore[no-untyped-def]
        return a / b

    return divided


@pytest.fixture
def mean(divided: Any) -> Any:
    """A kernel that calls it."""

    @compiled.njit(nogil=True)
    def mean(values):  # type: ignore[no-untyped-def]
        total = 0.0
        for value in values:
            total += value
        return divided(total, len(values))

    return mean


def test_another_numba_compiles_as_it_does_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "KNOWN_NUMBA", ["0", "1"])
    kernel = compiled.njit(nogil=True)(lambda a, b: a + b)
    assert kernel(1.0, 2.0) == 3.0
    assert not hasattr(kernel, "part")


def test_a_kernel_that_kernels_call_is_only_written_down(divided: Any, mean: Any) -> None:
    assert mean(np.arange(4.0)) == 1.5
    (part,) = divided.part.overloads.values()
    assert part.library.get_pointer_to_function(part.fndesc.llvm_func_name) == 0
    assert not divided.overloads
    assert divided(1.0, 4) == 0.25  # and is one of Python's all the same
    assert len(divided.part.overloads) == 1


def test_what_goes_wrong_within_is_raised_outside(mean: Any) -> None:
    with pytest.raises(ZeroDivisionError):
        mean(np.zeros(0))


def test_a_kernel_that_knows_nothing_of_parts_may_call_them(mean: Any) -> None:
    half = numba.njit(lambda values: mean(values) / 2)
    assert half(np.arange(4.0)) == 0.75


@pytest.mark.slow
def test_machine_code_is_kept_for_the_outermost_and_anew_where_what_it_imports_has_changed(folder: Path) -> None:
    assert [run(folder, KERNELS["kept.py"]) for _ in range(2)] == ["6.0 0 1", "6.0 1 0"]
    assert [path.name.split("-")[0] for path in folder.rglob("*.nbi")] == ["kernels.total"]
    (folder / "package" / "inner.py").write_text("SCALE = 5.0")
    assert run(folder, KERNELS["kept.py"]) == "10.0 0 1"


def test_another_process_may_write_a_part(folder: Path) -> None:
    run(folder, KERNELS["handed.py"])


@pytest.mark.slow
def test_the_run_time_is_made_of_the_stages_that_two_processes_wrote(tmp_path: Path) -> None:
    (tmp_path / "cache").mkdir()
    assert run(tmp_path, FIRST_RUN) == "1 1 1 1 1"
    kept = {path.name.split("-")[0] for path in tmp_path.rglob("*.nbi")}
    assert "driver.advance_steps" in kept
    assert not kept & {"driver.excite", "driver.ring", "driver.finish", "driver.take"}
