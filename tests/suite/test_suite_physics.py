"""The suite's own physics against closed forms, conservation and the project's other solver."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.suite import bricks, objects, physics
from benchmarks.suite.effects import LISTED, Effect, Scene, blow, body, sound
from benchmarks.suite.sounding import strike_sound

STEEL = objects.MATERIALS["steel"]
BAR = objects.Recipe("test_bar", "steel", (10, 2, 1), lambda u: (u - 0.5) * np.array([0.16, 0.02, 0.008]))
RING = objects.RECIPES["ring_brass"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("modes")


@pytest.fixture(scope="module")
def bar(folder: Path) -> objects.Body:
    return objects.body("test_bar", objects.as_made(objects.solved(BAR, STEEL.poisson, folder), STEEL))


def scene(of: objects.Body, recipe: objects.Recipe, folder: Path) -> Scene:
    strikes = tuple(physics.Strike(v, tuple(-of.normal[v]), 0.02) for v in (3, 40))
    return Scene(recipe, objects.MATERIALS[recipe.material], of, strikes, (7, of.normal[7]), 1.0, 44_100, 4000, folder)


def test_bar_of_bricks_has_the_frequencies_of_a_beam_and_of_the_other_solver(folder: Path) -> None:
    from sonic_bullet.modal import analyse
    from sonic_bullet.records import Material, Shape

    bar = objects.as_made(objects.solved(replace(BAR, cells=(20, 4, 2)), STEEL.poisson, folder), STEEL)
    # Euler and Bernoulli, along z
    first = 22.373 / (2 * np.pi * 0.16**2) * np.sqrt(STEEL.youngs_pa / STEEL.density) * 0.008 / np.sqrt(12)
    assert bar.freq_hz[0] == pytest.approx(first, rel=0.015)
    same = Material.isotropic(
        "steel", youngs_pa=STEEL.youngs_pa, poisson=STEEL.poisson, density_kg_m3=STEEL.density, alpha_per_s=0, beta_s=0
    )
    other = analyse((Shape("box", np.array([0.16, 0.02, 0.008])),), same, cache=None, edge_m=0.004, to_hz=9000)
    assert len(other.freq_hz) >= 5
    assert np.abs(bar.freq_hz[: len(other.freq_hz)] / other.freq_hz - 1).max() < 0.005


def test_modes_are_mass_normalised_and_scale_as_elasticity_says(bar: objects.Body, folder: Path) -> None:
    unit = objects.solved(BAR, STEEL.poisson, folder)
    assert bar.modes.mass_kg == pytest.approx(0.16 * 0.02 * 0.008 * STEEL.density, rel=1e-9)
    twice = objects.as_made(unit, STEEL, 2.0)
    count = len(bar.modes.value)
    assert np.allclose(twice.value[:count] * 4, bar.modes.value)
    assert np.allclose(twice.shape[:, :, :count] * 2**1.5, bar.modes.shape)


def test_a_small_mass_lowers_frequencies_by_rayleighs_quotient(bar: objects.Body, folder: Path) -> None:
    part, vertex = 1e-4, 0
    loaded = objects.as_made(objects.solved(BAR, STEEL.poisson, folder, load={vertex: part}, tag="test"), STEEL)
    kilogram = part * bar.modes.mass_kg
    first_order = -kilogram * (bar.modes.shape[vertex] ** 2).sum(axis=0)
    assert np.allclose(loaded.value / bar.modes.value - 1, first_order, rtol=0.03, atol=2e-6)


def test_a_damping_matrix_keeps_its_trace_and_tends_to_the_diagonal(bar: objects.Body, folder: Path) -> None:
    s = scene(bar, BAR, folder)
    plain = physics.rayleigh(bar.modes.value, STEEL)
    effect = body.support_damping(1, np.random.default_rng(1), s)
    assert effect.damping is not None
    full = effect.damping(bar.modes, plain)
    ring = physics.ring(bar, full, s.strikes[0], s.sensor)
    assert len(ring.pole) == len(plain)
    assert -2 * ring.pole.real.sum() == pytest.approx(np.trace(full), rel=1e-9)
    nearly = plain + 1e-6 * (full - plain)
    one, two = (physics.sounded(physics.ring(bar, d, s.strikes[0], s.sensor), 4000, 44_100) for d in (plain, nearly))
    assert np.abs(one - two).max() < 1e-4 * np.abs(one).max()


def test_what_rings_is_the_declared_response(bar: objects.Body, folder: Path) -> None:
    s = scene(bar, BAR, folder)
    damping = physics.rayleigh(bar.modes.value, STEEL)
    x = physics.sounded(physics.ring(bar, damping, s.strikes[1], s.sensor), 3000, 44_100)
    t, d = np.arange(3000)[:, None] / 44_100, np.diag(damping) / 2
    omega = np.sqrt(bar.modes.value - d**2)
    psi = (np.array(s.strikes[1].direction) @ bar.modes.shape[40]) * (bar.normal[7] @ bar.modes.shape[7])
    direct = (psi * np.exp(-d * t) * (np.cos(omega * t) - d / omega * np.sin(omega * t))).sum(axis=1)
    assert np.abs(x - direct).max() < 1e-9 * np.abs(direct).max()


def test_rates_agree(bar: objects.Body, folder: Path) -> None:
    s = scene(bar, BAR, folder)
    ring = physics.ring(bar, physics.rayleigh(bar.modes.value, STEEL), s.strikes[0], s.sensor)
    slow, fast = physics.sounded(ring, 4410, 44_100), physics.sounded(ring, 4800, 48_000)
    assert np.abs(slow[::147] - fast[::160]).max() < 1e-9 * np.abs(slow).max()  # both at multiples of 1/300 s
    for power in blow.POWERS.values():
        taps = [(blow.pulse(2e-4, rate, power), rate) for rate in (44_100, 48_000)]
        for f in (0.0, 1000.0, 4000.0):
            sent = [abs((h * np.exp(-2j * np.pi * f * np.arange(len(h)) / rate)).sum()) for h, rate in taps]
            assert sent[0] == pytest.approx(sent[1], abs=0.01)


@pytest.mark.parametrize(
    "name", ["amplitude-pitch", "amplitude-damping", "foreign-mode", "room", "support-damping", "mode-splitting"]
)
def test_zero_strength_is_the_plain_case(
    name: str, bar: objects.Body, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (blow, body, sound):
        monkeypatch.setattr(module, "jitter", lambda *_: 0.0)
    s = scene(bar, BAR, folder)
    effect = LISTED[name](2, _Pairs(5) if name == "mode-splitting" else np.random.default_rng(5), s)  # type: ignore[arg-type]
    plain = physics.rayleigh(bar.modes.value, STEEL)
    ring = physics.ring(bar, plain, s.strikes[0], s.sensor)
    dry = 0.02 * physics.sounded(ring, s.n, s.rate)
    now: Any = bar if effect.pairs is None else replace(bar, modes=effect.pairs(bar.modes))
    damping = plain if effect.damping is None else effect.damping(bar.modes, plain)
    ring = physics.ring(now, damping, s.strikes[0], s.sensor)
    x = 0.02 * (effect.ring(ring, 0.02, s.n, s.rate) if effect.ring else physics.sounded(ring, s.n, s.rate))
    x = effect.sound(x, 0.02, s.rate, 0) if effect.sound else x
    assert np.abs(x - dry).max() < 1e-9 * np.abs(dry).max()


class _Pairs:
    """A generator that takes the second of two forms."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def random(self) -> float:
        return 0.9

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rng, name)


def test_split_twins_stay_twins_of_the_same_space(folder: Path) -> None:
    coarse = replace(RING, cells=(16, 2, 1))
    brass = objects.MATERIALS["brass"]
    ring = objects.body("ring", objects.as_made(objects.solved(coarse, brass.poisson, folder), brass))
    effect = body.mode_splitting(1, _Pairs(3), scene(ring, coarse, folder))  # type: ignore[arg-type]
    assert effect.pairs is not None
    split = effect.pairs(ring.modes)
    twins = np.flatnonzero(np.diff(ring.modes.value) / ring.modes.value[:-1] < 2e-4)
    assert len(twins) >= 3
    apart = np.sqrt(split.value[twins + 1] / split.value[twins]) - 1
    assert (apart > 0.3 * effect.truth["split"]).all()
    for k in twins[:3]:
        before, after = (
            np.einsum("vxm,wym->vxwy", m.shape[:20, :, k : k + 2], m.shape[:20, :, k : k + 2])
            for m in (ring.modes, split)
        )
        assert np.abs(before - after).max() < 1e-9 * np.abs(before).max()


def test_tensors_agree_where_nothing_is_directional() -> None:
    e, nu = 7e10, 0.3
    g = e / 2 / (1 + nu)
    assert np.allclose(bricks.orthotropic((e, e, e), (g, g, g), (nu, nu, nu)), bricks.isotropic(e, nu))


@pytest.mark.parametrize("name", list(objects.RECIPES))
def test_surfaces_are_closed_without_degenerate_faces_and_face_outward(name: str) -> None:
    laid = objects.laid(objects.RECIPES[name])
    vertex, face = laid.node_m[laid.skin], laid.face
    area = np.cross(vertex[face[:, 1]] - vertex[face[:, 0]], vertex[face[:, 2]] - vertex[face[:, 0]]) / 2
    size = np.linalg.norm(area, axis=1)
    assert size.min() > 1e-3 * size.max()
    directed = face[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    once, count = np.unique(directed, axis=0, return_counts=True)
    assert count.max() == 1
    assert np.array_equal(once, np.unique(directed[:, ::-1], axis=0))
    assert np.einsum("fi,fi->", vertex[face[:, 0]], area) / 3 > 0
    assert np.isfinite(
        objects.body(
            name,
            bricks.Modes(np.ones(1), np.zeros((len(vertex), 3, 1)), np.zeros((len(vertex), 3, 6)), vertex, face, 1.0),
        ).normal
    ).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in objects.RECIPES if name != "angle_plastic"])  # cut along its cells
def test_the_truth_does_not_go_with_its_mesh(name: str, tmp_path: Path) -> None:
    recipe = objects.RECIPES[name]
    made = objects.MATERIALS[recipe.material]
    a, b, c = recipe.cells
    coarse, fine = (
        objects.as_made(objects.solved(replace(recipe, cells=cells), made.poisson, tmp_path), made).value
        for cells in (recipe.cells, (4 * a // 3, 4 * b // 3, c + 1))
    )
    n = min(len(coarse), len(fine))
    assert abs(len(coarse) - len(fine)) <= 1
    assert np.abs(np.sqrt(coarse[:n] / fine[:n]) - 1).max() < 2e-3


def test_a_mode_bends_by_the_level_that_a_half_sine_leaves(bar: objects.Body, folder: Path) -> None:
    """|P(f)| of a half sine of unit area is |cos(pi f tau) / (1 - (2 f tau)^2)|."""
    tau, levels = 4e-4, []

    def spied(r: physics.Ring, impulse: float, n: int, rate: float) -> Any:
        levels.append(r.level)
        return physics.sounded(r, n, rate)

    where = scene(bar, BAR, folder)
    bend = Effect("amplitude-pitch", "object", {}, ring=spied)
    soft = Effect("contact-time", "striker", {}, pulse=lambda impulse, rate: blow.pulse(tau, rate, 1.0))
    for effects in ((bend,), (bend, soft)):
        strike_sound(where, bar, where.strikes[0], where.sensor, effects, 0)
    f = np.sqrt(bar.modes.value) / (2 * np.pi)
    low = f < 6000
    assert np.allclose(
        (levels[1] / levels[0])[low], np.abs(np.cos(np.pi * f * tau) / (1 - (2 * f * tau) ** 2))[low], atol=0.01
    )
