"""Bodies on a wooden board of 24 mm: how long they still ring, mode by mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from sonic_bullet.engine.contact.coupling import (
    ContactSide,
    ContactSpring,
    CoupledModes,
    Region,
    contact_spring,
)
from sonic_bullet.files.presets import load_material
from sonic_bullet.records import Array
from studies.in_place.lines import Line
from studies.in_place.things import Stands, Thing, asset, bar, board, lossless, rod, spring, stand, with_loss

POINT_N_M, POINT_LOSS, ACROSS_N_M = 1.9e6, 0.02, 0.38e6
"""A smooth point of steel on wood, isotropic along its grain, as the proof asks; across the grain."""
AT_M = (0.11, -0.07)
"""Where on the board, from its middle: on none of its axes of symmetry."""
FELT_N_M, RUBBER_N_M, PAD_LOSS = 1e4, 6e4, 0.2
NODE = 0.2242
"""Of a free bar's length: the node of its first mode."""


def both(stands: Stands) -> tuple[tuple[str, Array, Array], ...]:
    """Newton and what runs: name, T60 in s, T60 over free."""
    return tuple(
        (name, stands.t60_s(how), stands.kept(how)) for name, how in (("Newton", stands.newton), ("run", stands.runs))
    )


def percents(values: Array) -> str:
    return " ".join(f"{100 * x:.3g}" for x in np.atleast_1d(values)) + " %"


def poles_hold(stands: Stands) -> str:
    """How far Newton's poles are from the eigenproblem's."""
    return f"poles {np.nanmax(stands.off(stands.newton)):.0e} from exact"


def rod_on_two_points() -> Iterator[Line]:
    one, on = rod(), board()
    for where, x in (("its ends", 0.08), ("0.7 of its half-length", 0.056)):
        points = np.array([[-x, 0, -0.006], [x, 0, -0.006]])
        placed = stand(one, on, points, [spring(POINT_N_M, POINT_LOSS)] * 2, AT_M)
        turned = placed.newton.turn
        vertical = np.array([_vertical(one, turned[:, k]) for k in range(len(one.hz))])
        low = vertical & (one.hz < 8e3)
        figures, holds = [], True
        for name, t60, _ in both(placed):
            figures.append(f"{name} {t60[low].max():.2f}, {t60[one.hz < 15e3].max():.2f} s")
            holds &= bool(t60[low].max() <= 0.5 and t60[one.hz < 15e3].max() <= 1.3)
        free = np.log(1000) / one.mobility.decay_per_s
        yield Line(
            f"rod on two smooth points at {where}: T60 of vertical bending < 8 kHz, of all < 15 kHz "
            f"(free {free[one.hz < 15e3].min():.0f} to {free.max():.0f} s)",
            "<= 0.5, 1.3 s" if x == 0.08 else "",
            "; ".join([*figures, poles_hold(placed)]),
            holds if x == 0.08 else None,
        )


def _vertical(one: Thing, mix: Array) -> bool:
    """Whether a mixture of the rod's modes bends up and down: its surface's mean square motion is more so than not."""
    move = (one.resonator.shape.astype(float) @ mix) ** 2
    return bool(move[:, 2].sum() > 1.2 * move[:, 1].sum() and move[:, 2].sum() > move[:, 0].sum())


def orders(one: Thing) -> Array:
    """(m,) waves round the rim of a body of revolution: of the radial motion of its highest points, largest radius."""
    vertex = one.model.vertex_m
    radius = np.hypot(*vertex[:, :2].T)
    rim = np.abs(np.abs(vertex[:, 2]) - np.abs(vertex[:, 2]).max()) < 0.02 * np.ptp(vertex[:, 2])
    rim &= radius > 0.98 * radius[rim].max()
    if np.sum(rim) < 16:
        raise SystemExit("no rim is found")
    outward = vertex[rim, :2] / radius[rim, None]
    radial = np.einsum("vx,vxm->vm", outward, one.resonator.shape[rim, :2].astype(float))
    angle = np.arctan2(vertex[rim, 1], vertex[rim, 0])
    waves = np.abs(np.exp(-1j * np.arange(12)[:, None] * angle) @ radial)
    return np.asarray(waves.argmax(axis=0))


def lowest_pair(one: Thing, n: int) -> Array:
    """Indices of the two lowest modes of n waves."""
    return np.asarray(np.flatnonzero(orders(one) == n)[:2])


def ring_of(radius: float, z: float, count: int, turn: float = 0.3) -> Array:
    angle = turn + 2 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)])


def heard_s(decay: Array) -> float:
    """T60 of modes struck alike, that beat too fast to tell them apart: their mean power has fallen by 60 dB."""
    low, high = np.log(1000) / decay.max(), np.log(1000) / decay.min()
    return float(brentq(lambda t: np.log10(np.mean(np.exp(-2 * decay * t))) + 6, 0.99 * low, 1.01 * high))


def of_pairs(one: Thing, how: CoupledModes, waves: tuple[int, ...]) -> tuple[Array, str]:
    """T60 kept of the lowest pair of each number of waves, both struck alike; in words, with that of either alone."""
    pairs = [lowest_pair(one, n) for n in waves]
    free, here = one.mobility.decay_per_s, how.decay_per_s
    kept = np.array([heard_s(here[pair]) / heard_s(free[pair]) for pair in pairs])
    either = [
        f"{100 * x:.3g} ({' '.join(f'{100 * y:.3g}' for y in free[p] / here[p])})"
        for x, p in zip(kept, pairs, strict=True)
    ]
    return kept, ", ".join(either) + " %"


def bowl_on_its_foot() -> Iterator[Line]:
    one, on = asset("bowl", load_material("steel")), board()
    foot = float(one.model.vertex_m[:, 2].min())
    for normal_n_m, loss in ((POINT_N_M, POINT_LOSS), (ACROSS_N_M, POINT_LOSS), (POINT_N_M, 0.05)):
        placed = stand(one, on, ring_of(0.03, foot, 3), [spring(normal_n_m, loss)] * 3, AT_M, eigen=False)
        judged = (normal_n_m, loss) == (POINT_N_M, POINT_LOSS)
        for name, how in (("Newton", placed.newton), ("run", placed.runs)):
            kept, words = of_pairs(one, how, (2, 3, 4, 5))
            yield Line(
                f"steel bowl on three points of its foot, {normal_n_m / 1e6:g} MN/m, η {loss:g}, {name}: T60 kept by "
                "the pairs n = 2; 3, 4, 5 (either alone)",
                "<= 25 %; >= 85 %" if judged else "",
                words,
                bool(kept[0] <= 0.25 and kept[1:].min() >= 0.85) if judged else None,
            )
    side = ContactSide.of(load_material("steel")), ContactSide.of(load_material("wood"))
    load_n = one.mobility.mass_kg * 9.81
    whole = contact_spring(Region((0.03, 0.03), (0.0, 0.0)), side, load_n)
    placed = stand(one, on, ring_of(0.03, foot, 24), [whole.share(1 / 24)] * 24, AT_M, eigen=False)
    for name, how in (("Newton", placed.newton), ("run", placed.runs)):
        yield Line(
            f"steel bowl on its ring, one region, {abs(whole.normal_n_m) / 1e6:.2g} MN/m in all, {name}: T60 kept, "
            "n = 2, 3, 4, 5",
            "",
            of_pairs(one, how, (2, 3, 4, 5))[1],
            None,
        )


def bowl_upside_down() -> Iterator[Line]:
    one, on = asset("bowl", load_material("steel"), upside_down=True), board()
    rim = float(one.model.vertex_m[:, 2].min())
    for normal_n_m in (POINT_N_M, ACROSS_N_M):
        placed = stand(one, on, ring_of(0.074, rim, 3), [spring(normal_n_m, POINT_LOSS)] * 3, AT_M, eigen=False)
        low = one.hz < 7e3
        for name, t60, _ in both(placed):
            short = np.mean(t60[low] <= 0.5)
            yield Line(
                f"… upside down on three points of its rim, {normal_n_m / 1e6:g} MN/m, {name}: share of its "
                f"{low.sum()} modes below 7 kHz with T60 <= 0.5 s",
                ">= 70 %" if normal_n_m == POINT_N_M else "",
                f"{short:.0%} (T60 {t60[low].min():.2f} to {t60[low].max():.2f} s)",
                bool(short >= 0.7) if normal_n_m == POINT_N_M else None,
            )


def glass_on_its_foot() -> Iterator[Line]:
    """On smooth points of 5 mm, as its own weight makes them: on isotropic wood, and across a board's grain."""
    one, on = with_loss(asset("tumbler", lossless("glass")), 1e-3), board()
    foot = float(one.model.vertex_m[:, 2].min())
    load_n = one.mobility.mass_kg * 9.81 / 3
    for wood in ("wood", "spruce"):
        k = point_spring("glass", wood, load_n)
        placed = stand(one, on, ring_of(0.03, foot, 3), [k] * 3, AT_M, eigen=False)
        for name, how in (("Newton", placed.newton), ("run", placed.runs)):
            kept = placed.kept(how)[np.concatenate([lowest_pair(one, n) for n in (2, 3, 4)])]
            yield Line(
                f"glass on three points of its foot, η 1e-3 and air, {wood}, {k.normal_n_m.real / 1e6:.2g} MN/m by its "
                f"weight, {name}: T60 kept by each of its rim's pairs n = 2, 3, 4",
                ">= 85 %",
                percents(kept),
                bool(kept.min() >= 0.85),
            )


def point_spring(what: str, wood: str, load_n: float) -> ContactSpring:
    """A smooth point of 5 mm radius, the loss that of wood in its contacts."""
    sides = [replace(ContactSide.of(load_material(name)), roughness_m=0.0, loss_factor=0.0) for name in (what, wood)]
    stiff = contact_spring(Region((0.0, 0.0), (200.0, 200.0)), (sides[0], sides[1]), load_n)
    return ContactSpring(stiff.normal_n_m * (1 + 1j * POINT_LOSS), stiff.tangential_n_m * (1 + 1j * POINT_LOSS))


def pad(stiffness_n_m: float) -> ContactSpring:
    """A short column that does not bulge: EA/h along its height, GA/h across, of Poisson's ratio 0.3."""
    normal = stiffness_n_m * (1 + 1j * PAD_LOSS)
    return ContactSpring(normal, normal / 2.6)


def bar_on_pads() -> Iterator[Line]:
    one, on = bar(), board()
    node, end = 0.3 * (0.5 - NODE), 0.149
    pads = {
        "felt": pad(FELT_N_M),
        "rubber": pad(RUBBER_N_M),
        "hard pegs": spring(POINT_N_M, POINT_LOSS),
    }
    bounds = {"felt": 0.9, "rubber": 0.75}
    for what, k in pads.items():
        placed = stand(one, on, np.array([[-node, 0, -0.003], [node, 0, -0.003]]), [k] * 2, AT_M)
        kept = {name: x[0] for name, _, x in both(placed)}
        off = float(placed.off(placed.newton)[0])
        runs = float(placed.off(placed.runs)[0])
        bound = bounds.get(what)
        yield Line(
            f"steel bar on two {what} at the nodes of mode 1: T60 kept in mode 1",
            f">= {bound:.0%}" if bound else "exact eigenproblem, 1e-6",
            f"Newton {kept['Newton']:.1%}, run {kept['run']:.1%}; poles {off:.0e}, {runs:.0e} from exact",
            bool(min(kept.values()) >= bound) if bound else bool(off <= 1e-6),
        )
    for what, k in pads.items():
        placed = stand(one, on, np.array([[-end, 0, -0.003], [end, 0, -0.003]]), [k] * 2, AT_M)
        kept = {name: x[0] for name, _, x in both(placed)}
        yield Line(
            f"… on two {what} at its ends: T60 kept in mode 1",
            "<= 5 %",
            f"Newton {kept['Newton']:.2%}, run {kept['run']:.2%}",
            bool(max(kept.values()) <= 0.05),
        )
