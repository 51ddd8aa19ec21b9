"""A bar with a spring and a dashpot, its limits, what passes both ways, and energy: against matrices of their own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import eigh, null_space

from sonic_bullet.engine.contact.coupling import (
    BodyMobility,
    BodyPoint,
    ContactPoint,
    ContactSide,
    ContactSpring,
    CoupledModes,
    Region,
    contact_spring,
    first_order,
)
from sonic_bullet.records import Array
from studies.in_place.lines import Line
from tests.made.bars import AXES, bar, exact_poles, stood
from tests.made.newton import newton_modes

NOTHING = BodyMobility(np.zeros(0), np.zeros(0))
STRENGTHS = np.geomspace(1e1, 1e10, 19)
"""N/m: from 1e-5 of the first mode's own stiffness to a wall."""
DASHPOTS = (0.0, 1e-4, 1 / 2000, 1 / 200, 1 / 20)
"""m/(N·s): none, and from a wall's to that of a sheet."""
DRAWS = 10_000


def poles_of(found: CoupledModes) -> Array:
    return -found.decay_per_s + 1j * found.omega_rad_s


def spring_and_dashpot() -> Iterator[Line]:
    steel = bar()
    worst, compared, possible, near = 0.0, 0, 0, []
    for node in (0, 3):
        for plate in DASHPOTS:
            under = [BodyMobility(np.zeros(0), np.zeros(0), plate_m_n_s=plate)]
            for k in STRENGTHS * (1 + 0.02j):
                touches = stood(steel, (node,), k)
                want = exact_poles(steel, node, k, plate)
                found = newton_modes(steel.mobility(), under, touches)
                got = poles_of(found)[found.newton]
                worst = max(worst, (np.abs(got[:, None] - want).min(axis=1) / np.abs(got)).max())
                compared, possible = compared + len(got), possible + len(steel.lam) - 2
                fast = first_order(steel.mobility(), under, touches)
                got = poles_of(fast)[fast.newton]
                nearest = want[np.abs(got[:, None] - want).argmin(axis=1)]
                near += np.abs(np.log(got.real / nearest.real)).tolist()
    yield Line(
        "bar, a spring with loss and a dashpot at a point, 10 to 1e10 N/m: poles beside the exact ones",
        "<= 1e-6",
        f"{worst:.1e} ({compared} poles; {possible - compared} are stopped)",
        bool(worst <= 1e-6),
    )
    yield Line(
        "the same, poles as they run (first order): decay beside the exact one",
        "",
        f"median {np.median(near):.1%}, nine in ten {np.quantile(near, 0.9):.0%}",
        None,
    )


def limits() -> Iterator[Line]:
    steel = bar()
    body = steel.mobility()
    worst = 0.0
    for solve in (newton_modes, first_order):
        found = solve(body, [NOTHING], stood(steel, (0, 5), 1e-6 * (1 + 0.1j)))
        worst = max(worst, np.abs(poles_of(found) / poles_of(newton_modes(body, [], [])) - 1).max())
    yield Line("K → 0: free poles", "<= 1e-6", f"{worst:.1e}", bool(worst <= 1e-6))
    body, touches = steel.mobility(0.0), stood(steel, (3,), 1e15)
    basis = null_space(body.moves([touches[0].own])[:1])
    held = np.sqrt(np.abs(eigh(basis.T @ np.diag(body.lam) @ basis, eigvals_only=True)))  # rigid: 0, nearly
    free = np.delete(np.arange(len(steel.lam)), 6)
    elements = np.sqrt(
        np.abs(eigh(steel.stiffness[np.ix_(free, free)], steel.mass[np.ix_(free, free)], eigvals_only=True))
    )
    for name, solve in (("", newton_modes), (", as they run", first_order)):
        found = solve(body, [NOTHING], touches)
        got = found.omega_rad_s[found.newton]
        for what, want in (
            ("the basis with that motion constrained", held),
            ("the elements with that node held", elements),
        ):
            off = np.abs(got[:, None] / want[want > 30] - 1).min(axis=1).max()
            yield Line(f"K = 1e15 N/m, all modes: {what}{name}", "<= 1e-6", f"{off:.1e}", bool(off <= 1e-6))
    offs, counts = [], (4, 6, 8, 12, 16)
    for modes in counts:
        found = newton_modes(steel.mobility(0.0, modes), [NOTHING], stood(steel, (3,), 1e14, modes))
        got = found.omega_rad_s[found.newton]
        offs.append(np.abs(got[:, None] / elements[1:3] - 1).min(axis=0).max())
    yield Line(
        f"… as modes are added ({', '.join(map(str, counts))}): two lowest beside the elements",
        "falls",
        ", ".join(f"{off:.1e}" for off in offs),
        bool((np.diff(offs) < 0).all()),
    )


def pair(
    rng: np.random.Generator, spring_n_m: complex, touches: int, mass_kg: float, counts: tuple[int, int] = (6, 3)
) -> tuple[list[BodyMobility], list[ContactPoint], list[ContactPoint]]:
    """Two free bodies of random modes, and the touches between them as either sees them."""
    mobility = []
    for count, kg in zip(counts, (0.2, mass_kg), strict=True):
        root = np.sort(rng.uniform(500, 5e4, count))
        mobility.append(BodyMobility(root, rng.uniform(1e-4, 1e-2, count) * root, kg, kg * 1e-3 * np.diag([1, 2, 2.5])))
    there, back = [], []
    for _ in range(touches):
        own, other = (
            BodyPoint(rng.normal(size=(3, count)) / np.sqrt(kg), rng.normal(size=3) * 0.05, AXES)
            for count, kg in zip(counts, (0.2, mass_kg), strict=True)
        )
        spring = ContactSpring(spring_n_m, 0.8 * spring_n_m)
        there.append(ContactPoint(0, own, other, spring))
        back.append(ContactPoint(0, other, own, spring))
    return mobility, there, back


def reciprocity() -> Iterator[Line]:
    """Mode j's answer to mode k is minus that of k to j, K φ_j φ_k/(λ_j − λ_k), up to second order in K."""
    for name, solve in (("Newton", newton_modes), ("as they run", first_order)):
        offs = []
        for k in (1.0, 10.0, 100.0):
            (a, b), there, back = pair(np.random.default_rng(5), k, 1, 0.5, (4, 3))
            a, b = (replace(x, decay_per_s=0 * x.decay_per_s) for x in (a, b))
            offs.append(
                np.abs(solve(a, [b], there).transmissions[0] / solve(b, [a], back).transmissions[0].T + 1).max()
            )
        slope = np.diff(np.log10(offs))
        yield Line(
            f"reciprocity of what passes, {name}: what is left at K = 1, 10, 100 N/m",
            "<= 1e-4, goes with K",
            ", ".join(f"{off:.1e}" for off in offs),
            bool(offs[0] <= 1e-4 and (slope > 0.9).all()),
        )


def passive() -> Iterator[Line]:
    """Each draw another body's contacts: none to four points, 10 to 1e9 N/m, loss 1e-4 to 1, a partner of 0.01 to
    100 kg. ½|z|² is the body's energy and that of its springs.
    """
    for name, solve in (("Newton", newton_modes), ("as they run", first_order)):
        rng = np.random.default_rng(0)
        body = pair(rng, 1.0, 0, 0.5)[0][0]
        z = rng.normal(size=6) + 1j * rng.normal(size=6)
        begun, worst, now = np.linalg.norm(z) ** 2, -np.inf, np.eye(6)
        slowest = float(np.inf)
        for _ in range(DRAWS):
            k = 10 ** rng.uniform(1, 9) * (1 + 10 ** rng.uniform(-4, 0) * 1j)
            (_, partner), there, _ = pair(rng, k, int(rng.integers(0, 5)), 10 ** rng.uniform(-2, 2))
            placed = solve(body, [partner], there)
            slowest = float(np.min([slowest, placed.decay_per_s.min(), placed.shares.min()]))
            before = np.linalg.norm(z) ** 2
            z, now = placed.turn.T @ now @ z, placed.turn
            worst = float(np.maximum(worst, (np.linalg.norm(z) ** 2 - before) / begun))
            z = z * np.exp(-placed.decay_per_s * 1e-9)  # decays for so short that what is left can still show a gain
        yield Line(
            f"passive, {name}: energy that a change adds, {DRAWS} draws of contacts that come and go",
            "< 1e-9 of its start",
            f"{worst:.0e}, least decay or share {slowest:.1e}/s",
            bool(worst < 1e-9 and slowest >= 0),
        )


def loads() -> Iterator[Line]:
    steel, oak = ContactSide(2e11, 0.3, 3e-4, 0.0), ContactSide(1.1e9, 0.35, 0.02, 0.0)
    points = {"ball": Region((0.0, 0.0), (200.0, 200.0)), "ellipse": Region((0.0, 0.0), (50.0, 700.0))}
    newton = np.geomspace(0.01, 100, 41)

    def slopes(region: Region, sides: tuple[ContactSide, ContactSide]) -> Array:
        stiff = [abs(contact_spring(region, sides, n).normal_n_m) for n in newton]
        return np.asarray(np.diff(np.log(stiff)) / np.diff(np.log(newton)))

    off = max(np.abs(slopes(region, (steel, oak)) - 1 / 3).max() for region in points.values())
    yield Line("K ∝ N^(1/3), smooth points, 0.01 to 100 N", "± 0.02", f"± {off:.1e}", bool(off <= 0.02))
    by_roughness = [
        slopes(points["ball"], (steel, replace(oak, roughness_m=h)))[len(newton) // 2]
        for h in (0, 1e-6, 1e-5, 1e-4, 1e-3)
    ]
    yield Line(
        "… exponent at 1 N, rms roughness 0, 1, 10, 100, 1000 µm",
        "rises to 1",
        ", ".join(f"{x:.2f}" for x in by_roughness),
        bool((np.diff(by_roughness) > 0).all() and by_roughness[-1] > 0.98),
    )
