"""One log with its models gives the same bits with whatever instructions a machine has, and whatever libraries choose.

A scene with strikes, sliding, rolling, a body at rest on another and a residual is rendered by processes of their own,
whose engine, libm, NumPy or OpenBLAS are told to use other instructions, or other threads. How modes radiate is
computed once, before, and kept: docs/start/supported.md, "Bits".
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest
from pybullet_utils.bullet_client import BulletClient

import sonic_bullet as sb
from sonic_bullet import _engine
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, WOOD, ball_body, box_model
from tests.made.worlds import ball, box

pytestmark = pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the promise is x86-64's")
ROOT = Path(__file__).parents[3]
CHOICES = ("SONIC_BULLET_VECTORS", "GLIBC_TUNABLES", "NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE")
LEVELS = ("baseline", "avx2", "avx512")
NO_VARIANTS = "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX_Usable,-AVX2_Usable,-FMA_Usable,-FMA4_Usable"


def scene() -> Any:
    """The contact log: four bodies on a board, for a quarter of a second."""
    client = BulletClient(p.DIRECT)
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=(0, -1, 0.5), seed=3)
    steel, wood = replace(STEEL, roughness_m=2e-6), replace(WOOD, roughness_m=5e-6)
    edges, slim, bar = (0.8, 0.6, 0.024), (0.08, 0.06, 0.04), (0.1, 0.03, 0.02)
    board = client.createMultiBody(
        0,
        client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in edges]),
        basePosition=[0, 0, -edges[2] / 2],
    )
    listener.add(board, material=wood, model=box_model(edges, (90.0, 210.0, 480.0, 1100.0), WOOD))
    slider = box(client, (-0.25, 0.1, 0.0201), edges=slim, mass=0.13, turn=(0, 0, 0.2))
    client.resetBaseVelocity(slider, (0.9, 0.1, 0))
    listener.add(slider, material=wood, model=box_model(slim, (900.0, 2300.0, 4100.0, 7700.0), WOOD))
    roller = ball(client, (-0.2, 0.22, 0.02), mass=0.26)
    client.resetBaseVelocity(roller, (1.0, 0, 0), (0, 50.0, 0))
    listener.add(roller, material=steel, model=ball_body(0.02).model)
    # pairs of almost one frequency, as round bodies have them: they turn to the contacts at which it comes to rest
    plate = box_model((0.2, 0.1, 0.01), (740.0, 741.0, 1230.0, 1232.5, 2950.0, 5210.0), STEEL)
    listener.add(box(client, (0.1, -0.1, 0.012), turn=(0.02, 0.01, 0.0)), material=steel, model=plate)
    noisy = box(client, (0.1, -0.12, 0.1), edges=bar, mass=0.1)
    listener.add(noisy, material="ceramic-mug", model=box_model(bar, np.linspace(1500, 15000, 12), STEEL))
    for _ in range(60):
        client.stepSimulation()
    log = listener.contacts
    listener.detach()
    client.disconnect()
    return log


def rendered(folder: Path, **choices: str) -> dict[str, Any]:
    """What `tests.made.renderings` prints in a process with these environment variables."""
    environment = {name: value for name, value in os.environ.items() if name not in CHOICES}
    environment |= {"SONIC_BULLET_CACHE": str(folder / "cache"), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "tests.made.renderings", str(folder / "log.npz")],
        env=environment | choices, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log, and a cache."""
    made = tmp_path_factory.mktemp("bits")
    scene().save(made / "log.npz")
    return made


@pytest.fixture(scope="module")
def plain(folder: Path) -> dict[str, Any]:
    """The rendering with what this machine chooses."""
    return rendered(folder)


@parametrize_few("level", LEVELS, (1,))
def test_each_vector_level(folder: Path, plain: dict[str, Any], level: str) -> None:
    if LEVELS.index(level) > _engine.best_vector_level():
        pytest.skip(f"this processor has no {level}")
    found = rendered(folder, SONIC_BULLET_VECTORS=level)
    assert found["facts"]["vector level"] == LEVELS.index(level)
    assert found["sound"] == plain["sound"]


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has variants that can be turned off")
def test_without_the_variants_of_glibc(folder: Path, plain: dict[str, Any]) -> None:
    found = rendered(folder, GLIBC_TUNABLES=NO_VARIANTS)
    print("libm's own bits are", "other" if found["facts"]["libm"] != plain["facts"]["libm"] else "the same")
    assert found["sound"] == plain["sound"]


@pytest.mark.slow
def test_without_the_vector_instructions_of_numpy(folder: Path, plain: dict[str, Any]) -> None:
    known = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])  # type: ignore[index,union-attr]
    if not known:
        pytest.skip("NumPy uses no more than its baseline here")
    found = rendered(folder, NPY_DISABLE_CPU_FEATURES=" ".join(known))
    assert found["facts"]["numpy"] != plain["facts"]["numpy"], "nothing was turned off"
    assert found["sound"] == plain["sound"]


@pytest.mark.slow
@pytest.mark.parametrize("core", ["Nehalem", "Sandybridge", "Haswell", "Zen"])
def test_each_core_of_openblas(folder: Path, plain: dict[str, Any], core: str) -> None:
    if plain["facts"]["blas"] is None:
        pytest.skip("NumPy's BLAS is no OpenBLAS")
    found = rendered(folder, OPENBLAS_CORETYPE=core)
    if found["facts"]["blas"] != core:
        pytest.skip(f"OpenBLAS has no {core} here")
    assert found["sound"] == plain["sound"]


def test_two_threads(folder: Path, plain: dict[str, Any]) -> None:
    found = rendered(folder, OMP_NUM_THREADS="2", OPENBLAS_NUM_THREADS="2")
    assert found["sound"] == plain["sound"]


def test_all_of_it_at_once(folder: Path, plain: dict[str, Any]) -> None:
    """Engine, libm, NumPy and OpenBLAS; each alone is one more case."""
    found = rendered(
        folder, SONIC_BULLET_VECTORS="baseline", GLIBC_TUNABLES=NO_VARIANTS, OPENBLAS_CORETYPE="Nehalem",
        NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX2 FMA3",
    )  # fmt: skip
    assert found["sound"] == plain["sound"]


def test_an_unknown_vector_level_is_refused() -> None:
    environment = {**os.environ, "SONIC_BULLET_VECTORS": "sse9"}
    done = subprocess.run(
        [sys.executable, "-c", "import sonic_bullet._engine"],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0 and "SONIC_BULLET_VECTORS is 'sse9'" in done.stderr


@pytest.mark.skipif(platform.system() != "Linux", reason="reads an ELF file's symbols")
def test_the_engine_calls_no_elementary_function_of_libm() -> None:
    """Names of functions that are not exact; fmod, floor, sqrt and their like are."""
    inexact = (
        "sin cos tan sincos asin acos atan atan2 sinh cosh tanh exp exp2 exp10 expm1 log log2 log10 log1p pow cbrt"
    )
    inexact += " hypot erf erfc tgamma lgamma cexp clog cpow cabs csqrt fma"
    names = {f"{name}{kind}" for name in inexact.split() for kind in ("", "f", "l")}
    content = Path(_engine.__file__).read_bytes()
    wanted = {one.decode() for one in re.findall(rb"(?<=\0)[a-z][a-z0-9]*(?=\0)", content)}
    assert "fmod" in wanted, "the symbols were not read"
    assert not names & wanted
