"""One way to modes: a scene's and a diagnosis' of one body agree, and are the same bytes whatever the machine does."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import analyse, read_mesh
from sonic_bullet.modal.reduced import family
from sonic_bullet.records import Material, Shape
from tests.few_cases import parametrize_few

AGREE = 1e-3
ASKED = 1e-2  # of elements: each may be as far off as that
BRASS = Material.isotropic("brass", youngs_pa=1.04e11, poisson=0.345, density_kg_m3=8500)
GUESS = (1.25, 0.31)  # E/ρ over the true one, and ν: what a case knows before it is fitted
ASSETS = sorted((Path(__file__).parents[2] / "assets").glob("*.obj"))


def wedge() -> Shape:
    """A bar that tapers: filled by Netgen."""
    box = trimesh.creation.box((0.12, 0.03, 0.02))
    box.vertices[box.vertices[:, 0] > 0, 2] *= 0.6
    return Shape("mesh", vertex_m=box.vertices, face=box.faces)


def crossed() -> Shape:
    """Two bars through one another, not united: a lattice."""
    bars = [trimesh.creation.box(size) for size in ((0.12, 0.03, 0.02), (0.03, 0.12, 0.021))]
    both = trimesh.util.concatenate(bars)
    return Shape("mesh", vertex_m=both.vertices, face=both.faces)


def apart(shape: Shape, to_hz: float, fixed: tuple[tuple[float, float, float, float], ...] = ()) -> float:
    """The largest relative difference in frequency between a scene's modes and a diagnosis'."""
    scene = analyse((shape,), BRASS, to_hz=to_hz, fixed=fixed, cache=None).freq_hz
    gamma = BRASS.youngs_pa / BRASS.density_kg_m3
    whole = family(
        shape, gamma_m2_s2=GUESS[0] * gamma, poisson=GUESS[1], to_hz=1.2 * to_hz, fixed=fixed, cache=None
    ).modes(gamma, BRASS.poisson)[0]
    assert len(scene) > 3 and len(whole) >= len(scene)
    return float(np.abs(np.sqrt(whole[: len(scene)]) / (2 * np.pi) / scene - 1).max())


def test_a_body_of_elements_without_a_mode_in_the_band_has_none() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.015)  # its first mode is near 100 kHz
    assert analyse((Shape("mesh", vertex_m=ball.vertices, face=ball.faces),), BRASS, cache=None).mode_count == 0


@pytest.mark.slow
@parametrize_few("path", ASSETS, 1, ids=lambda path: path.stem)
def test_scene_and_diagnosis_agree_on_what_comes_with_the_project(path: Path) -> None:
    assert apart(read_mesh(path), 10_000.0) < AGREE


@pytest.mark.slow
def test_scene_and_diagnosis_agree_on_a_body_of_elements_as_far_as_is_asked() -> None:
    assert apart(wedge(), 20_000.0) < ASKED


@pytest.mark.slow
def test_scene_and_diagnosis_hold_a_clamped_body_at_the_same_nodes() -> None:
    assert apart(wedge(), 20_000.0, ((-0.06, 0.0, 0.0, 0.02),)) < AGREE


@pytest.mark.slow
@pytest.mark.shared
def test_scene_and_diagnosis_agree_on_a_practice_mesh(shared_path: Path) -> None:
    assert apart(read_mesh(shared_path / "practice/practice-05/slab_porcelain.obj"), 6000.0) < AGREE


CHILD = """
import hashlib, sys
from sonic_bullet.modal import analyse
from tests.modal.test_one_way import BRASS, {body}
model = analyse(({body}(),), BRASS, count=12, edge_m={edge_m}, cache=None)
print(hashlib.sha256(model.freq_hz.tobytes() + model.shape.tobytes() + model.vertex_m.tobytes()).hexdigest())
"""


@pytest.mark.slow
@parametrize_few(("body", "edge_m"), [(wedge, 0.008), (crossed, 0.01)], 1)
def test_the_same_bytes_on_one_thread_or_two_beside_other_processes(body: Callable[[], Shape], edge_m: float) -> None:
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
    try:
        runs = [
            subprocess.Popen(
                [sys.executable, "-c", CHILD.format(body=body.__name__, edge_m=edge_m)],
                env={**os.environ, "OMP_NUM_THREADS": n, "OPENBLAS_NUM_THREADS": n},
                cwd=Path(__file__).parents[2],
                stdout=subprocess.PIPE,
                text=True,
            )
            for n in ("1", "2")
        ]
        said = {run.communicate()[0].strip() for run in runs}
    finally:
        for one in busy:
            one.kill()
            one.wait()
    assert all(run.returncode == 0 for run in runs)
    assert len(said) == 1 and len(said.pop()) == len(hashlib.sha256().hexdigest())
