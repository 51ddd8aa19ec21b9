"""Poles to first order beside the exact ones of `tests.made.newton`, and what must hold of them at any strength."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from sonic_bullet._engine import choose_motions
from sonic_bullet.engine.contact.coupling import BodyMobility, BodyPoint, ContactPoint, ContactSpring, first_order
from sonic_bullet.engine.contact.coupling.coupled_modes import collect_springs
from sonic_bullet.engine.contact.coupling.first_order import assign_columns
from sonic_bullet.records import Array
from tests.made.newton import newton_modes


def body(rng: np.random.Generator, modes: int, mass_kg: float, lowest_hz: float) -> BodyMobility:
    """A body of some modes whose spacing is that of a plate's, near enough: even."""
    omega = 2 * np.pi * lowest_hz * (1 + np.arange(modes) + rng.uniform(-0.2, 0.2, modes))
    inertia = mass_kg * np.diag(rng.uniform(1e-4, 1e-3, 3))
    return BodyMobility(omega, rng.uniform(1, 20, modes), mass_kg, inertia)


def place(rng: np.random.Generator, one: BodyMobility) -> BodyPoint:
    size = 1 / np.sqrt(one.mass_kg) if one.mass_kg > 0 else 0.5
    shape = size * rng.normal(size=(3, len(one.omega_rad_s)))
    return BodyPoint(shape, rng.uniform(-0.05, 0.05, 3), np.eye(3))


def scene(
    seed: int, spring_n_m: complex, modes: int = 16
) -> tuple[BodyMobility, list[BodyMobility], list[ContactPoint]]:
    """A body of 0.2 kg on three points of a board that does not move as a whole, and one of a light partner."""
    rng = np.random.default_rng(seed)
    one = body(rng, modes, 0.2, 900.0)
    partners = [body(rng, 24, 0.0, 120.0), body(rng, 5, 0.1, 2300.0)]
    spring = ContactSpring(spring_n_m, 0.8 * spring_n_m)
    touches = [ContactPoint(p, place(rng, one), place(rng, partners[p]), spring) for p in (0, 0, 0, 1)]
    return one, partners, touches


def test_it_is_near_the_exact_poles_where_contacts_are_as_stiff_as_contacts_are() -> None:
    """Over 20 draws: three quarters of the decays within 1 %, nine tenths of the frequencies within 0.1 %."""
    decay, omega = [], []
    for seed in range(20):
        found, exact = (solve(*scene(seed, 3e5 * (1 + 0.03j))) for solve in (first_order, newton_modes))
        kept = exact.newton & found.newton
        assert kept.mean() > 0.6
        decay.append(found.decay_per_s[kept] / exact.decay_per_s[kept])
        omega.append(found.omega_rad_s[kept] / exact.omega_rad_s[kept])
    off = np.abs(np.log(np.concatenate(decay)))
    assert np.quantile(off, 0.75) < 0.01
    assert np.quantile(np.abs(np.log(np.concatenate(omega))), 0.9) < 1e-3


def written_out(
    one: BodyMobility, partners: list[BodyMobility], touches: list[ContactPoint]
) -> tuple[Array, Array, Array, Array]:
    """s (m,), velocities of the partners' modes, forces at the touches, all as `first_order` states them; which turn.

    Of a body without pairs.
    """
    x, row = collect_springs(one, partners, touches)
    m, light = len(one.omega_rad_s), (x.other_lam == 0) & x.other.any(axis=0)
    both, spring = np.hstack([x.own, -x.other[:, light]]), x.spring.real
    value, vector = np.linalg.eigh(np.diag(np.append(x.lam, np.zeros(light.sum()))) + both.T * spring @ both)
    chosen = assign_columns(vector[:m] ** 2)
    force, q = spring[:, None] * (both @ vector), vector[:m, chosen]
    square, s = value[chosen], 1j * np.sqrt(np.maximum(value[chosen], 0))
    modes, f = x.other_lam > 0, force[:, chosen]
    gain = 1 / (x.other_lam[modes, None] + 2 * x.other_decay[modes, None] * s + s**2)
    moved = (x.other[:, modes].T @ f) * gain
    g = (1 / x.spring - 1 / spring)[:, None] * f + x.other[:, modes] @ moved
    work = (f * g).sum(axis=0)
    product, apart = force.T @ g, value[:, None] - square
    product[chosen, np.arange(m)] = 0
    bound = apart**2 + np.abs(product) ** 2
    rho = (spring @ g**2 - (product**2 * apart / np.where(bound > 0, bound, 1)).sum(axis=0)) / work
    delta, slope = work / (1 + rho), -(moved**2).sum(axis=0) / (1 + rho) ** 2
    delta = 2 * delta / (1 + np.sqrt(1 - 4 * slope))
    delta = delta.real + 1j * np.minimum(delta.imag, 0)
    own = (q**2).T @ one.decay_per_s
    new = -own + 1j * np.sqrt(square - delta - own**2)
    turns = ~((s.imag > 2 * np.sqrt(x.lam.max())) | (-new.real > 0.99 * np.abs(new)))
    velocity = np.where(turns, moved / (1 + rho) / (1 + delta / (1 + rho) * gain), 0)
    velocity /= 1 + (np.abs(velocity) ** 2).sum(axis=0)
    lifts = np.zeros((3 * len(touches), m))
    lifts[row] = np.abs(np.where(turns, f / (1 + rho) / s, 0) @ q.T)
    return new, velocity @ q.T, lifts[::3], turns


@pytest.mark.parametrize("spring_n_m", [1e2 * (1 + 0.1j), 3e5 * (1 + 0.03j), 1e8 * (1 + 0.01j)])
def test_the_kernels_compute_what_the_equations_say(spring_n_m: complex) -> None:
    for seed in range(5):
        given = scene(seed, spring_n_m)
        found, (new, velocity, lifts, turns) = first_order(*given), written_out(*given)
        assert (found.newton == turns).all() and turns.any()
        made = -found.decay_per_s + 1j * found.omega_rad_s
        np.testing.assert_allclose(made[turns], new[turns], rtol=1e-11)
        np.testing.assert_allclose(found.decay_per_s[turns], -new.real[turns], rtol=1e-9)
        np.testing.assert_allclose(np.concatenate(found.transmissions), velocity, atol=1e-9 * np.abs(velocity).max())
        np.testing.assert_allclose(found.force_n_s, lifts, atol=1e-9 * lifts.max())


def test_motions_are_chosen_as_the_assignment_with_the_largest_sum_has_them() -> None:
    """Each mode its own best where those differ; where two want the same one, the kernel says so."""
    rng, told = np.random.default_rng(0), 0
    for strength in (0.1, 0.3, 1.0):
        vector = np.linalg.qr(np.eye(12) + strength * rng.normal(size=(12, 12)) / np.sqrt(12))[0]
        chosen = np.empty(10, np.int64)
        choose_motions(vector, np.array([2, 6]), chosen)
        if chosen[0] < 0:
            continue
        share = vector[:10] ** 2
        for pair in (2, 6):
            share[pair] = share[pair + 1] = 0.5 * (share[pair] + share[pair + 1])
        most = share[np.arange(10), assign_columns(share)].sum()
        assert share[np.arange(10), chosen].sum() == pytest.approx(most, rel=1e-12)
        told += 1
    assert told >= 1
    twice = np.full((3, 3), 0.1)
    twice[:, 1] = 0.9
    chosen = np.empty(3, np.int64)
    choose_motions(twice, np.zeros(0, np.int64), chosen)
    assert chosen[0] == -1


def test_a_spring_of_nothing_leaves_a_body_free() -> None:
    one, partners, touches = scene(1, 1e-6 * (1 + 0.1j))
    found = first_order(one, partners, touches)
    assert found.omega_rad_s == pytest.approx(one.omega_rad_s, rel=1e-6)
    assert found.decay_per_s == pytest.approx(one.decay_per_s, rel=1e-6)


@pytest.mark.parametrize("stiff", [1e2, 1e4, 1e6, 1e8, 1e12])
def test_no_mode_gains_and_each_share_is_none_below_zero(stiff: float) -> None:
    for seed in range(20):
        one, partners, touches = scene(seed, stiff * (1 + 0.02j))
        found = first_order(one, partners, touches)
        assert np.isfinite(found.omega_rad_s).all()
        assert (found.omega_rad_s > 0).all()
        assert (found.decay_per_s > 0).all()
        assert (found.shares >= 0).all()
        assert found.shares.sum(axis=1) == pytest.approx(found.decay_per_s)


def test_reciprocity_of_what_passes() -> None:
    """A mode of one body and one of another, through one lossless spring: the forces that one's velocity puts on the
    other are the same both ways; far from each other's frequency the velocities go as 1/(λ − ω²).
    """
    rng = np.random.default_rng(3)
    one, other = BodyMobility(np.array([3e3]), np.array([1.0])), BodyMobility(np.array([9e3]), np.array([2.0]))
    spring, a, b = ContactSpring(2e3 + 0j, 1e3 + 0j), place(rng, one), place(rng, other)
    there = first_order(one, [other], [ContactPoint(0, a, b, spring)]).transmissions[0][0, 0]
    back = first_order(other, [one], [ContactPoint(0, b, a, spring)]).transmissions[0][0, 0]
    assert there * (9e3**2 - 3e3**2) == pytest.approx(back * (3e3**2 - 9e3**2), rel=0.02)


def test_each_mode_goes_on_as_the_one_that_is_most_like_it() -> None:
    share = np.array([[0.6, 0.3, 0.1], [0.9, 0.05, 0.02], [0.3, 0.2, 0.4]])
    assert assign_columns(share).tolist() == [1, 0, 2]
    turned: Array = np.eye(30)[np.random.default_rng(0).permutation(30)]
    assert (turned[np.arange(30), assign_columns(turned)] == 1).all()
    assert assign_columns(np.ones((4, 6))).tolist() == [0, 1, 2, 3], "equal ones stay"


@pytest.mark.parametrize("shape", [(1, 1), (7, 7), (12, 30), (30, 12), (60, 66)])
def test_the_assignment_is_the_one_with_the_largest_sum(shape: tuple[int, int]) -> None:
    """As SciPy's, which is another program; squares of the rows of an orthogonal matrix, as those of motions are."""
    rng, sides = np.random.default_rng(sum(shape)), max(shape)
    for strength in (0.3, 1.0, 10.0):
        vector = np.linalg.qr(np.eye(sides) + strength * rng.normal(size=(sides, sides)) / np.sqrt(sides))[0]
        weight = vector[: shape[0], : shape[1]] ** 2
        row, column = linear_sum_assignment(weight, maximize=True)
        chosen = assign_columns(weight)
        assert np.flatnonzero(chosen >= 0).tolist() == row.tolist()
        assert chosen[row].tolist() == column.tolist()


def test_what_passes_is_reciprocal_mode_by_mode() -> None:
    """Bodies of several modes, which an eigensolver gives any sign: what is left goes with K."""
    off = []
    for stiff in (1.0, 10.0, 100.0):
        rng = np.random.default_rng(5)
        a, b = (
            BodyMobility(np.sort(rng.uniform(500, 5e4, n)), np.zeros(n), kg, 1e-3 * np.eye(3))
            for n, kg in ((4, 0.2), (3, 0.5))
        )
        spring, own, other = ContactSpring(stiff + 0j, stiff + 0j), place(rng, a), place(rng, b)
        there = first_order(a, [b], [ContactPoint(0, own, other, spring)]).transmissions[0]
        back = first_order(b, [a], [ContactPoint(0, other, own, spring)]).transmissions[0]
        off.append(np.abs(there / back.T + 1).max())
    assert off[0] < 1e-3
    assert np.diff(np.log10(off)) == pytest.approx([1.0, 1.0], abs=0.1)


def test_a_foot_on_a_board_that_resonates() -> None:
    """One touch, as a fork's: a body's own mass holds against what yields. Growth of the lowest mode's decay within 1 %
    of the exact one over 20 boards; of Rayleigh's quotient alone it is off by a factor.
    """
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        fork, board = body(rng, 8, 0.1, 430.0), body(rng, 60, 0.0, 60.0)
        fork = BodyMobility(fork.omega_rad_s, np.full(8, 0.1), fork.mass_kg, fork.inertia_kg_m2)
        board = BodyMobility(board.omega_rad_s, 0.015 * board.omega_rad_s)
        small = BodyPoint(0.005 * rng.normal(size=(3, 8)) / np.sqrt(0.025), np.array([0, 0, -0.085]), np.eye(3))
        touch = ContactPoint(0, small, place(rng, board), ContactSpring(1.9e6 * (1 + 0.02j), 0j))
        fast, exact = (solve(fork, [board], [touch]).decay_per_s[0] for solve in (first_order, newton_modes))
        found.append((fast - fork.decay_per_s[0]) / (exact - fork.decay_per_s[0]))
    assert found == pytest.approx(np.ones(20), abs=0.01)


@pytest.mark.parametrize(("plate", "half_space"), [(1e-3, 0.0), (0.0, 3e-12)])
def test_what_lies_under_a_contact_and_has_neither_modes_nor_mass(plate: float, half_space: float) -> None:
    """A mode on a spring on a wide plate or a half-space: the root of s² + 2ds + λ + φ²s/(s/K + y₀ − y₂s²) = 0."""
    one, spring, shape = BodyMobility(np.array([9e3]), np.array([3.0])), 4e4 * (1 + 0.01j), 8.0
    under = BodyMobility(np.zeros(0), np.zeros(0), plate_m_n_s=plate, half_space_m_s_n=half_space)
    touch = ContactPoint(
        0,
        BodyPoint(np.array([[shape], [0.0], [0.0]]), np.zeros(3), np.eye(3)),
        BodyPoint(np.zeros((3, 0)), np.zeros(3), np.eye(3)),
        ContactSpring(spring, 0j),
    )
    free = np.array([1, 2 * 3.0, 9e3**2 + 3.0**2])
    root = np.roots(np.polyadd(np.polymul(free, [-half_space, 1 / spring, plate]), [shape**2, 0]))
    exact = root[np.abs(root - 9e3j).argmin()]
    newton, runs = newton_modes(one, [under], [touch]), first_order(one, [under], [touch])
    assert -newton.decay_per_s[0] + 1j * newton.omega_rad_s[0] == pytest.approx(exact, rel=1e-9)
    assert runs.decay_per_s[0] == pytest.approx(-exact.real, rel=0.01)
    assert -exact.real > 3.1


def test_what_twins_pass_on_does_not_hang_on_the_choice_of_their_basis() -> None:
    """Two modes of one frequency and a third: told in a basis turned by an angle, the same turned by that angle."""
    rng = np.random.default_rng(8)
    one = BodyMobility(np.array([3e3, 3e3, 9e3]), np.array([2.0, 2.0, 5.0]))
    on, spring = body(rng, 12, 0.0, 200.0), ContactSpring(2e3 * (1 + 0.02j), 1e3 + 0j)
    places = [(place(rng, one), place(rng, on)) for _ in range(3)]
    angle = 0.7
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    told, turned = (
        first_order(
            one, [on], [ContactPoint(0, BodyPoint(a.shape @ by, a.arm_m, a.axes), b, spring) for a, b in places]
        )
        for by in (np.eye(3), turn)
    )
    told_free, turned_free = (found.transmissions[0] @ found.turn.T for found in (told, turned))
    assert np.abs(turned_free - told_free @ turn).max() < 0.02 * np.abs(told_free).max()


@pytest.mark.parametrize("angle", [0.3, np.pi / 4, 1.2, 2.0])
def test_which_two_modes_a_pair_is_of_does_not_count(angle: float) -> None:
    """Poles and turned shapes are the same whatever the angle of the free pair, but for order and sign."""
    rng = np.random.default_rng(8)
    one = BodyMobility(np.array([3e3, 3e3, 7e3, 9e3]), np.full(4, 2.0), 0.4, np.diag([2e-4, 3e-4, 4e-4]))
    other = body(rng, 12, 0.0, 120.0)
    touches = [ContactPoint(0, place(rng, one), place(rng, other), ContactSpring(4e5 + 2e4j, 0j))]
    mix = np.eye(4)
    mix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    found = []
    for turn in (np.eye(4), mix):
        mine = [replace(t, own=replace(t.own, shape=t.own.shape @ turn)) for t in touches]
        placed = first_order(one, [other], mine)
        order = np.argsort(placed.decay_per_s[:2])
        shape = np.concatenate([t.own.shape @ placed.turn for t in mine])[:, :2][:, order]
        found.append((placed.decay_per_s, placed.omega_rad_s, np.einsum("rk,sk->krs", shape, shape)))
        found[-1][0][:2], found[-1][1][:2] = placed.decay_per_s[:2][order], placed.omega_rad_s[:2][order]
    assert found[0][0][0] < 0.5 * found[0][0][1], "one is held more than the other"
    for was, now in zip(*found, strict=True):
        assert now == pytest.approx(was, rel=1e-6, abs=1e-9 * np.abs(was).max())
