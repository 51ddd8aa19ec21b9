"""Impacts spread over many steps become one strike, and no impulse is lost or made."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records.contacts import CONTACT
from sonic_bullet.simulators.tables.soft_impacts import LONGEST_IMPACT_S, SoftImpacts

G, DT, MASS_KG = 9.81, 0.002, 0.1


def contact(a: int, b: int, impulse: float, approach: float, point: float = 0.0) -> np.ndarray:
    row = np.zeros(1, CONTACT)
    row["a"], row["b"], row["approach_m_s"] = a, b, approach
    row["normal"][0, 2], row["impulse_n_s"][0, 2], row["point_a_m"][0, 0] = 1, impulse, point
    return row


def given_out(steps: list[np.ndarray], dt: float = DT, g: float = G) -> list[np.ndarray]:
    soft = SoftImpacts()
    return [soft.collect(row, dt, (0, 0, -g), np.full(len(row), MASS_KG)) for row in steps]


def bounce(damping: float, *, speed: float = 1.0, omega: float = 120.0, steps: int = 120) -> list[np.ndarray]:
    """A mass falls on a spring and a damper without gravity: m x'' = -F, F = max(k x + c x', 0)."""
    x, v, rows = 0.0, speed, []
    for _ in range(steps):
        force = max(omega**2 * x + 2 * damping * omega * v, 0.0) * MASS_KG if x >= 0 else 0.0
        rows.append(contact(1, 0, force * DT, v) if force > 0 else np.zeros(0, CONTACT))
        v -= force / MASS_KG * DT
        x += v * DT
    return rows


@pytest.mark.parametrize("damping", [0.0, 0.3, 1.0, 3.0])
def test_a_bounce_is_one_strike_of_its_impulse_and_speed(damping: float) -> None:
    """Elastic, damped, critical and crawling: what the one row gives is what the spring gave, but for 5 %."""
    steps = bounce(damping)
    made = given_out(steps, g=1e-9)
    total = sum(row["impulse_n_s"][:, 2].sum() for row in steps)
    strikes = [row for row in made if len(row) and row["impulse_n_s"][:, 2].max() > 0.1 * total]
    assert len(strikes) == 1
    strike = strikes[0][np.argmax(strikes[0]["impulse_n_s"][:, 2])]
    assert strike["approach_m_s"] == 1.0
    assert strike["impulse_n_s"][2] == pytest.approx(total, rel=0.05)
    assert sum(row["impulse_n_s"][:, 2].sum() for row in made) == pytest.approx(total, rel=1e-12)


def test_what_rests_passes_to_the_bit() -> None:
    steps = [contact(1, 0, MASS_KG * G * DT * (1 + 0.3 * (i % 3)), 0.01 * (-1) ** i) for i in range(50)]
    for one, row in zip(given_out(steps), steps, strict=True):
        assert one.tobytes() == row.tobytes()


def test_a_support_stays_while_another_corner_strikes() -> None:
    rest = MASS_KG * G * DT
    steps = [contact(1, 0, rest, 0.0)] * 5 + [
        np.concatenate([contact(1, 0, rest, 0), contact(1, 0, 0.01, 0.5, 0.1)])
    ] * 8
    steps += [contact(1, 0, rest, 0.0)] * 30
    made = given_out(steps)
    assert all(len(row) for row in made)
    load = np.array([row["impulse_n_s"][:, 2].sum() for row in made])
    assert load[:12] == pytest.approx(rest)
    assert np.sum(load > 2 * rest) == 1
    struck = made[int(np.argmax(load))]
    assert struck["point_a_m"][np.argmax(struck["impulse_n_s"][:, 2]), 0] == pytest.approx(0.1, abs=0.02)
    assert load.sum() == pytest.approx(sum(row["impulse_n_s"][:, 2].sum() for row in steps))


def test_a_cushion_ends_and_pairs_do_not_mix() -> None:
    steps = [np.concatenate([contact(1, 0, 0.01, 1.0), contact(2, 1, 0.02, 0.0)]) for _ in range(200)]
    made = given_out(steps)
    for row in made:
        assert row["impulse_n_s"][row["a"] == 2, 2].sum() == 0.02
    out = [i for i, row in enumerate(made) if row["impulse_n_s"][row["a"] == 1, 2].sum() > 0.1]
    assert out[0] * DT == pytest.approx(LONGEST_IMPACT_S, abs=2 * DT)


@pytest.mark.parametrize("seed", range(5))
def test_no_impulse_is_lost_or_made(seed: int) -> None:
    """Random rows of random pairs, also without normal load; in the end nothing touches."""
    rng = np.random.default_rng(seed)
    steps = []
    for _ in range(80):
        k = int(rng.integers(0, 6))
        row = np.zeros(k, CONTACT)
        row["a"], row["b"] = rng.integers(2, 4, k), rng.integers(0, 2, k)
        row["normal"] = [0, 0, 1]
        row["impulse_n_s"], row["approach_m_s"] = rng.normal(size=(k, 3)), rng.normal(size=k)
        row["point_a_m"], row["point_b_m"] = rng.normal(size=(k, 3)), rng.normal(size=(k, 3))
        steps.append(row)
    steps.append(np.zeros(0, CONTACT))
    made = given_out(steps)
    for a in (2, 3):
        owed, paid = (sum(row["impulse_n_s"][row["a"] == a].sum(axis=0) for row in rows) for rows in (steps, made))
        assert np.allclose(owed, paid, atol=1e-12)
    assert all(np.isfinite(row["point_a_m"]).all() and np.isfinite(row["normal"]).all() for row in made)
