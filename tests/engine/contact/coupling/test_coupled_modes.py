"""Poles of a bar in place against its own matrices, limits, what passes, and energy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh, null_space

from sonic_bullet.engine.contact.coupling import BodyMobility, BodyPoint, ContactPoint, ContactSpring, CoupledModes
from sonic_bullet.records import Array
from tests.made.bars import AXES, Bar, bar, exact_poles, stood
from tests.made.newton import newton_modes

NOTHING = BodyMobility(np.zeros(0), np.zeros(0))
STRENGTHS = np.geomspace(1e1, 1e10, 10)  # N/m: from 1e-5 of the first mode's own stiffness to a wall


@pytest.fixture(scope="module")
def steel() -> Bar:
    return bar()


def poles_of(found: CoupledModes) -> Array:
    return -found.decay_per_s + 1j * found.omega_rad_s


@pytest.mark.parametrize("node", [0, 3])
@pytest.mark.parametrize("plate_m_n_s", [0.0, 1 / 2000, 1 / 20])
def test_a_spring_and_a_dashpot_at_a_point(steel: Bar, node: int, plate_m_n_s: float) -> None:
    """A spring with loss, a dashpot behind it: the exact complex eigenvalues, each once, at any strength."""
    compared = 0
    for k in STRENGTHS * (1 + 0.02j):
        found = newton_modes(
            steel.mobility(),
            [BodyMobility(np.zeros(0), np.zeros(0), plate_m_n_s=plate_m_n_s)],
            stood(steel, (node,), k),
        )
        want, got = exact_poles(steel, node, k, plate_m_n_s), poles_of(found)[found.newton]
        off = np.abs(got[:, None] - want) / np.abs(got)[:, None]
        assert off.min(axis=1).max() < 1e-6, k
        assert len(set(off.argmin(axis=1))) == len(got)
        compared += len(got)
    assert compared > 0.9 * len(STRENGTHS) * (len(steel.lam) - 2)


def test_no_strength_is_free(steel: Bar) -> None:
    body = steel.mobility()
    found = newton_modes(body, [NOTHING], stood(steel, (0, 5), 1e-6 * (1 + 0.1j)))
    np.testing.assert_allclose(found.omega_rad_s, body.omega_rad_s, rtol=1e-9)
    np.testing.assert_allclose(found.decay_per_s, body.decay_per_s, rtol=1e-6)
    np.testing.assert_allclose(found.turn, np.eye(len(found.turn)), atol=1e-6)


def test_without_touches_nothing_changes(steel: Bar) -> None:
    body = steel.mobility()
    found = newton_modes(body, [], [])
    assert np.array_equal(poles_of(found), poles_of(newton_modes(body, [NOTHING], stood(steel, (0,), 0.0))))
    assert np.array_equal(found.omega_rad_s, body.omega_rad_s) and np.array_equal(found.turn, np.eye(len(found.turn)))


def test_a_wall_constrains(steel: Bar) -> None:
    """K -> ∞: the modes in the null space of BΦ; with all of them, the elements with that node held."""
    body = steel.mobility(loss=0.0)
    touches = stood(steel, (3,), 1e16)
    found = newton_modes(body, [NOTHING], touches)
    motions = body.moves([touches[0].own])[:1]
    basis = null_space(motions)
    held = eigh(basis.T @ np.diag(body.lam) @ basis, eigvals_only=True)
    free = np.delete(np.arange(len(steel.lam)), 6)
    elements = eigh(steel.stiffness[np.ix_(free, free)], steel.mass[np.ix_(free, free)], eigvals_only=True)
    got = np.sort(found.omega_rad_s[found.newton] ** 2)
    for want in (held, elements):
        near = np.abs(got[:, None] / want[want > 1e3] - 1).min(axis=1)
        assert near.max() < 1e-6
    assert len(got) >= len(body.omega_rad_s) - 1


def test_more_modes_come_nearer_to_the_held_node(steel: Bar) -> None:
    free = np.delete(np.arange(len(steel.lam)), 6)
    want = np.sqrt(eigh(steel.stiffness[np.ix_(free, free)], steel.mass[np.ix_(free, free)], eigvals_only=True)[1:3])
    off = []
    for modes in (4, 6, 8, 12, 16):
        found = newton_modes(steel.mobility(0.0, modes), [NOTHING], stood(steel, (3,), 1e14, modes))
        got = found.omega_rad_s[found.newton]
        off.append(np.abs(got[:, None] / want - 1).min(axis=0).max())
    assert (np.diff(off) < 0).all() and off[-1] < 1e-5 < off[0]


def pair(rng: np.random.Generator, ours: int, theirs: int, spring_n_m: complex, touches: int = 1, mass: float = 0.5):
    """Two free bodies of random modes, and the touches between them as either sees them."""
    mobility = []
    for count, kg in ((ours, 0.2), (theirs, mass)):
        root = np.sort(rng.uniform(500, 5e4, count))
        mobility.append(BodyMobility(root, rng.uniform(1e-4, 1e-2, count) * root, kg, kg * 1e-3 * np.diag([1, 2, 2.5])))
    there, back = [], []
    for _ in range(touches):
        spot = [
            BodyPoint(rng.normal(size=(3, count)) / np.sqrt(kg), rng.normal(size=3) * 0.05, AXES)
            for count, kg in ((ours, 0.2), (theirs, mass))
        ]
        spring = ContactSpring(spring_n_m, 0.8 * spring_n_m)
        there.append(ContactPoint(0, spot[0], spot[1], spring))
        back.append(ContactPoint(0, spot[1], spot[0], spring))
    return mobility, there, back


@pytest.mark.parametrize("k", [1e3, 1e5, 1e7])
def test_two_bodies_at_once(k: float) -> None:
    """Poles and what passes against the eigenproblem of both, in their modes and rigid motions."""
    (a, b), there, _ = pair(np.random.default_rng(3), 5, 4, k * (1 + 0.03j), touches=2)
    found = newton_modes(a, [b], there)
    both = np.hstack([a.moves([t.own for t in there]), -b.moves([t.other for t in there])])
    spring = np.array([[t.spring.normal_n_m, *2 * [t.spring.tangential_n_m]] for t in there]).ravel()
    lam, decay = np.append(a.lam, b.lam), np.append(a.decay, b.decay)
    n = len(lam)
    s, vector = np.linalg.eig(
        np.block(
            [[np.zeros((n, n)), np.eye(n)], [-np.diag(lam) - both.T @ (spring[:, None] * both), -2 * np.diag(decay)]]
        )
    )
    got = poles_of(found)
    near = np.abs(got[:, None] - s).argmin(axis=1)
    np.testing.assert_allclose(got, s[near], rtol=1e-6)
    assert len(set(near)) == len(got)
    q = vector[:n, near]
    transmitted = q[11:] / (found.turn * q[:5]).sum(axis=0)
    want = transmitted[:4] / (1 + (np.abs(transmitted) ** 2).sum(axis=0))
    np.testing.assert_allclose(found.transmissions[0], want, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(found.shares.sum(axis=1), found.decay_per_s, rtol=1e-9)


def test_what_passes_is_reciprocal() -> None:
    """Mode j's answer to mode k is minus that of k to j, K φ_j φ_k/(λ_j − λ_k): but for what is of second order in K,
    which falls as K does.
    """
    off = []
    for k in (1.0, 10.0, 100.0):
        (a, b), there, back = pair(np.random.default_rng(5), 4, 3, k)
        a, b = (BodyMobility(x.omega_rad_s, 0 * x.decay_per_s, x.mass_kg, x.inertia_kg_m2) for x in (a, b))
        one, other = newton_modes(a, [b], there).transmissions[0], newton_modes(b, [a], back).transmissions[0]
        assert np.abs(one).min() > 0
        off.append(np.abs(one / other.T + 1).max())
    assert off[0] < 1e-4
    np.testing.assert_allclose(np.diff(np.log10(off)), 1, atol=0.05)


def test_two_of_one_frequency_share_by_halves() -> None:
    """Equal oscillators on a weak spring move alike and against each other: half of one's sound is the other's."""
    root, shape = np.array([6000.0]), np.array([[0.0], [0.0], [1.0]])
    body = BodyMobility(root, np.zeros(1))
    spot = BodyPoint(shape, np.zeros(3), AXES)
    found = newton_modes(body, [body], [ContactPoint(0, spot, spot, ContactSpring(1e3, 0.0))])
    np.testing.assert_allclose(np.abs(found.transmissions[0]), 0.5, rtol=1e-9)


def test_a_touch_of_more_force_than_load() -> None:
    """force_n_s: a mode's velocity on a spring against a wall, F = K φ z/ω."""
    root, shape = np.array([6000.0]), np.array([[0.0], [0.0], [3.0]])
    spot, wall = BodyPoint(shape, np.zeros(3), AXES), BodyPoint(np.zeros((3, 0)), np.zeros(3), AXES)
    found = newton_modes(
        BodyMobility(root, np.zeros(1)), [NOTHING], [ContactPoint(0, spot, wall, ContactSpring(1e5, 0.0))]
    )
    assert found.omega_rad_s[0] == pytest.approx(np.sqrt(6000.0**2 + 9 * 1e5), rel=1e-12)
    assert found.force_n_s[0, 0] == pytest.approx(3 * 1e5 / found.omega_rad_s[0], rel=1e-12)


def test_equal_frequencies_part_as_the_touch_wants() -> None:
    """Of a pair at one frequency, the combination with its node at the touch stays free, the other takes all loss."""
    angle = 0.7
    body = BodyMobility(np.full(2, 5000.0), np.full(2, 1.0))
    shape = np.zeros((3, 2))
    shape[2] = 2 * np.cos(angle), 2 * np.sin(angle)
    spot, wall = BodyPoint(shape, np.zeros(3), AXES), BodyPoint(np.zeros((3, 0)), np.zeros(3), AXES)
    found = newton_modes(body, [NOTHING], [ContactPoint(0, spot, wall, ContactSpring(1e4 * (1 + 0.1j), 0.0))])
    still, moved = np.argsort(found.decay_per_s)
    assert found.decay_per_s[still] == pytest.approx(1.0, rel=1e-9)
    assert found.omega_rad_s[still] == pytest.approx(5000.0, rel=1e-9)
    assert found.decay_per_s[moved] == pytest.approx(1 + 0.1 * 1e4 * 4 / (2 * 5000), rel=1e-2)
    np.testing.assert_allclose(shape[2] @ found.turn[:, still], 0, atol=1e-6)


def test_energy_never_grows_whatever_comes_and_goes() -> None:
    """10 000 changes among random touches of random partners: ½|z|² after each, decays between them."""
    rng = np.random.default_rng(0)
    mobility, _, _ = pair(rng, 6, 3, 1.0)
    body, states = mobility[0], []
    for _ in range(150):
        k = 10 ** rng.uniform(1, 9) * (1 + 10 ** rng.uniform(-4, 0) * 1j)
        (_, partner), there, _ = pair(rng, 6, 3, k, int(rng.integers(1, 5)), 10 ** rng.uniform(-2, 2))
        states.append(newton_modes(body, [partner], there))
    assert all((one.decay_per_s >= 0).all() and (one.shares >= 0).all() for one in states)
    turns = np.array([np.eye(6), *(one.turn for one in states)])
    decays = np.array([np.zeros(6), *(one.decay_per_s for one in states)])
    worst, order = 0.0, rng.integers(0, len(turns), (10, 1000))
    for draw in order:
        z = rng.normal(size=6) + 1j * rng.normal(size=6)
        begun, now = np.linalg.norm(z) ** 2, turns[0]
        for state in draw:
            before = np.linalg.norm(z) ** 2
            z, now = turns[state].T @ now @ z, turns[state]
            worst = max(worst, (np.linalg.norm(z) ** 2 - before) / begun)
            z = z * np.exp(-decays[state] * rng.uniform(0, 1e-7))
    assert worst < 1e-9
