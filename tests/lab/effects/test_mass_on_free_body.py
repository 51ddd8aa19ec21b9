"""A mass on a free body moves it as a whole; and what a mass has bent, ν, is found along with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, with_effects
from sonic_bullet.lab.effects import added_mass
from sonic_bullet.lab.effects.added_mass import propose_added_mass
from sonic_bullet.lab.effects.evidence import Poisson
from sonic_bullet.records import Array, ModalModel
from tests.made.body import plate, recorded, truth

FREE = np.append([4.730041, 7.853205, 10.995608], (np.arange(4, 15) + 0.5) * np.pi)  # cosh βL cos βL = 1
HINGED = 3.926602  # tan βL = tanh βL
BAND = (50.0, 7_500.0)
MASS = AddedMass((0.0477, 0.0371, 0.0), 0.03)


def bar() -> ModalModel:
    """A thin free bar of 1 m and 1 kg along x, its bending modes along z alone; the last vertex is a weight without a
    place.
    """
    x = np.linspace(0, 1, 81)
    ring = 0.001 * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
    vertex = np.concatenate([np.column_stack([np.full(4, at), ring]) for at in x])
    face = [(4 * i + a, 4 * i + b, 4 * i + 4 + b) for i in range(80) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    face += [(4 * i + a, 4 * i + 4 + b, 4 * i + 4 + a) for i in range(80) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    face += [(0, 2, 1), (0, 3, 2), (320, 321, 322), (320, 322, 323)]
    turned = np.array(face)[:, ::-1]
    k = FREE[:, None]
    share = np.where(np.arange(len(FREE))[:, None] % 2, 1, -1)  # odd and even modes about the middle
    y = k * (x - 0.5)
    motion = np.where(
        share > 0,
        np.cos(y) / np.cos(k / 2) + np.cosh(y) / np.cosh(k / 2),
        np.sin(y) / np.sin(k / 2) + np.sinh(y) / np.sinh(k / 2),
    )
    motion *= 2 / np.abs(motion[:, -1:])  # unit mass: 2 at the ends
    shape = np.zeros((len(vertex) + 1, 3, len(FREE)))
    shape[:-1, 2] = np.repeat(motion.T, 4, axis=0)
    shape[-1, 0] = 1.0
    inside = np.einsum("fi,fi->", vertex[turned[:, 0]], np.cross(vertex[turned[:, 1]], vertex[turned[:, 2]])) / 6
    turned = turned if inside > 0 else turned[:, ::-1]
    none = np.zeros(len(FREE))
    return ModalModel(
        100 * (FREE / FREE[0]) ** 2,
        none,
        shape,
        np.concatenate([vertex, [[0.5, 0, 0]]]),
        turned,
        np.zeros(len(turned)),
        abs(inside),
        1.0,
    )


def test_a_free_bar_gives_four_times_as_much_at_its_end_as_in_its_middle() -> None:
    body = FreeBody.of(bar())
    assert body is not None
    end, middle = np.array([1.0, 0, 0]), np.array([0.5, 0, 0])
    gives = body.gives(np.stack([end, middle, 1 - end]), end)
    assert gives[:, 2, 2] == pytest.approx([4.0, 1.0, -2.0], rel=1e-3, abs=1e-3)
    assert gives[0, 0, 0] == pytest.approx(1.0, rel=1e-3)


def test_a_bar_with_a_heavy_end_is_hinged_there() -> None:
    """Pinned by a mass of a hundred bars, it swings and bends as a hinged and free one: only with its rigid motions
    does it.
    """
    x = bar()
    heavy = AddedMass((1.0, 0.0, 0.001), 100.0).apply(x)
    assert heavy.freq_hz[0] == pytest.approx(100 * (HINGED / FREE[0]) ** 2, rel=0.02)
    moved = np.abs(heavy.shape[[2, 322], 2, 0])
    assert moved[1] < 0.02 * moved[0]
    assert (heavy.shape[-1, 1:] == 0).all()  # what has no place does not move with the body


def test_a_held_body_and_an_open_surface_do_not_move_as_a_whole() -> None:
    x = bar()
    shape = x.shape.copy()
    shape[:4] = 0
    assert FreeBody.of(replace(x, shape=shape)) is None
    assert FreeBody.of(plate()) is None


@pytest.mark.slow
def test_a_ratio_of_poisson_that_a_mass_had_bent_is_found_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every other mode goes with ν, which the fit had left 0.06 too high."""
    monkeypatch.setattr(added_mass, "POINTS", 16)
    monkeypatch.setattr(added_mass, "SEARCH_RESTARTS", 3)
    true, fitted = 0.24, 0.30
    body = recorded(MASS)
    own = body.model.freq_hz
    slope = np.where(np.arange(len(own)) % 2, -0.5, 0.1)

    def at(ratio: float) -> tuple[Array, Array]:
        freq = own * (1 + slope * (ratio - true))
        return np.sort(freq), np.eye(len(own))[:, np.argsort(freq)]

    def other(ratio: float) -> ModalModel:
        freq, sums = at(ratio)
        return replace(body.model, freq_hz=freq, shape=body.model.shape @ sums.astype(np.float32))

    low = other(fitted)
    sums = at(fitted)[1]
    told = Poisson(fitted, 0.22, 0.04, lambda ratio: (at(ratio)[0], sums.T @ at(ratio)[1]))
    off = replace(body, model=low, line=np.full(len(own), -1), other=other, poisson=told)
    found = propose_added_mass(evidence_of(truth(), (off,), BAND))
    assert found is not None and found.poisson_ratio is not None
    assert found.mass_kg == pytest.approx(0.03, rel=0.1)
    assert found.poisson_ratio == pytest.approx(true, abs=0.01)
    h = refit_material(replace(truth(), effects=(found,)), (off,))
    assert h.poisson == found.poisson_ratio
    assert with_effects(h, (), (off,)).poisson is None
