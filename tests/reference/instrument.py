"""The instrument on one page: a contact log becomes pressure at microphones, in plain NumPy.

    contact rows of a step ─► load F of each pair of bodies ─► what lasts: support N;  what is shorter: strikes       1
    strike ─► how much of it has a cause, when it comes, how long its pulse is (Hertz, or a flat punch)               2
    support, sweep ─► heights of both surfaces pass under a nonlinear contact: f − N                                  3
    forces ─► nearest point of either body's surface ─► Uᵀf on its modes                                              4
    support ─► springs at the contact points ─► other poles, and what passes on to the partner                        5
    Uᵀf ─► modes, damped and free ─► pressure at 1 m;  Σf ─► the rigid body's own click                               6
    travel time, 1/r, direction ─► pressure at a microphone that may move                                             7

This page is what the engine means: `tests/reference/test_instrument.py` holds the engine to it, and where they differ
the page decides. Nothing here is fast, and nothing is clever. Where a choice of discretisation decides samples it is
stated in a line that begins with "Stated:". Modes are given (`Body.model`), and so is how they radiate (`radiation`).
Left out: residuals, poles that depend on the level, stated spectra and tracks of surfaces, ears, images, joints.

Symbols as in docs/glossary.md. Sides are 0, the pair's lower body, and 1, the higher. k, t: steps; n: samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import betaincinv, ellipkm1, gamma

from sonic_bullet.files import ContactLog
from sonic_bullet.records import Array, Body, Microphone, ModalModel
from sonic_bullet.records.mounting import loss_factor, radiating_share

Radiation = Callable[[ModalModel], tuple[Array, Array]]
"""Of a model: pressure weights w (m,) complex, in Pa·m per modal velocity, and radiation damping Δd (m,) in 1/s.

p(r̂) = (iωρ₀/4π) ∮ [v + ik (r̂·n) ψ] e^{ik r̂·x} dS at 1 m, v = φ·n, surface pressure iωρ₀ψ   [Pierce 1989, eq. 4-6.4]
|w| = √<|p|²>,  Δd = 2π <|p|²>/ρ₀c,  means over all directions; the phase is that of the loud ones
"""


class NotOnThisPage(ValueError):
    """A log needs what the page leaves out."""


SPAN = 4  # steps that a load must last to be support; one strike takes at most SPAN - 1
KNOWN = SPAN - 1  # steps after the one that sounds that are known by then
BLOCK = 256  # samples, on the grid of absolute time, at whose start poles change
NODES = 24  # least number of parts of a pulse
TAPS = 24  # of the interpolation of arrivals
WAVE_M = 0.1 / 2.0 ** np.arange(14)  # wavelengths of a surface's octaves


# ---- The scene, step by step ------------------------------------------------------------------------------------


class Instrument:
    """Plays a log; keeps what passes along each arrow.

    strikes, frictions: lists of `Strike`, `Friction`; source (b, n): pressure of each body's modes at 1 m, dipole
    (b, 3, n): of its click along each axis, in Pa·m; pressure (c, n).
    """

    def __init__(self, log: ContactLog, radiation: Radiation) -> None:
        if any(type(one) is not Microphone or one.directivity for one in log.sensors) or log.image:
            raise NotOnThisPage("sensors other than plain microphones, or images")
        steps, self.log, self.sr = list(log.steps), log, log.sr
        if any(len(one.motions) for one in steps):
            raise NotOnThisPage("joints")
        self.count, bodies, last = len(steps), len(log.bodies), steps[-1]
        self.bodies = [Sounding(body, log, radiation) for body in log.bodies]
        self.dt_s = [one.dt_s for one in steps] + [last.dt_s] * KNOWN
        self.gravity = [one.gravity_m_s2 for one in steps] + [last.gravity_m_s2] * KNOWN
        self.position, self.turn = np.zeros((len(self.dt_s), bodies, 3)), np.zeros((len(self.dt_s), bodies, 4))
        self.teleported = np.zeros((len(self.dt_s), bodies), bool)
        self.position[:], self.turn[:] = np.nan, [0.0, 0.0, 0.0, 1.0]
        for t in range(len(self.dt_s)):
            one = steps[min(t, self.count - 1)]
            if t:
                self.position[t], self.turn[t] = self.position[t - 1], self.turn[t - 1]  # who left stays where it was
            self.position[t, one.body], self.turn[t, one.body] = one.position_m, one.quaternion_xyzw
            if t < self.count:
                self.teleported[t, one.body] = one.teleported
        for b in range(bodies):  # who comes later is where it will come
            came = np.flatnonzero(np.isfinite(self.position[:, b, 0]))[:1]
            self.position[: came[0] if len(came) else None, b] = self.position[came[0], b] if len(came) else 0.0
            self.turn[: came[0] if len(came) else 0, b] = self.turn[came[0], b] if len(came) else 0.0
        self.rows = [turned_rows(one.contacts.row, self.turn[t]) for t, one in enumerate(steps)] + [[]] * (KNOWN + 1)
        self.pairs: dict[tuple[int, int], Pair] = {}
        for t, rows in enumerate(self.rows):
            for row in rows:
                pair = self.pairs.setdefault(row.pair, Pair(self.count))
                pair.force[t] += row.load
        for t in range(self.count):
            for pair in self.pairs.values():
                pair.force[t] /= self.dt_s[t]
        self.pairs = dict(sorted(self.pairs.items()))
        # exact times: the step that was meant by 1/240, not its nearest double, so that an hour has no drift
        time = [Fraction(0)]
        for dt in self.dt_s:
            near = Fraction(dt).limit_denominator(1_000_000)
            time.append(time[-1] + (near if float(near) == dt else Fraction(dt)))
        self.time_s = [float(one) for one in time]
        self.sample = [int(one * self.sr) for one in time]  # step t: samples sample[t] … sample[t + 1] - 1
        self.late = [float(one * self.sr - int(one * self.sr)) for one in time]
        self.quenches = {event.step for event in log.events if event.kind == "quench"}
        self.strikes: list[Strike] = []
        self.frictions: list[Friction] = []
        samples = self.sample[self.count]
        self.source, self.dipole = np.zeros((bodies, samples)), np.zeros((bodies, 3, samples))
        self.modes = [Modes(one, self.sr) for one in self.bodies]
        self.supports = Supports(bodies)

    def along(self, k: int) -> Array:
        """Where each sample of step k lies between its ends, 0 … 1."""
        n = np.arange(self.sample[k + 1] - self.sample[k])
        return np.clip((n - self.late[k]) / (self.dt_s[k] * self.sr), 0.0, 1.0)

    def play(self) -> Array:
        """Play all of it; pressure (c, n) in Pa."""
        for k in range(self.count):
            if k in self.quenches:
                for modes in self.modes:
                    modes.silence()
            found = find_strikes(self, k, 0) + ([] if k + 1 in self.quenches else find_strikes(self, k + 1, 1))
            rubs = friction_forces(self, k)
            if self.log.supports:
                self.supports.advance(self, k, found, rubs)
            self.ring(k, found, rubs)
            self.strikes += found
            self.frictions += rubs
        self.pressure = hear(self)
        return self.pressure

    def ring(self, k: int, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Play the step's strikes and forces on all bodies."""
        first, stop = self.sample[k], self.sample[k + 1]
        for one in strikes:
            start = max(one.start_s * self.sr, float(first))
            for side, b in enumerate(one.pair):
                impulse = (1.0, -1.0)[side] * one.transmitted * one.impulse
                self.modes[b].enter(start, one, one.transmitted * one.modal_impulse[side], impulse)
        x = self.along(k)
        for b, modes in enumerate(self.modes):
            drive, click = np.zeros((stop - first, len(modes.z))), np.zeros((stop - first, 3))
            for one in rubs:
                if b in one.pair:
                    side = one.pair.index(b)
                    push = one.newton[:, None] / self.sr
                    drive += push * ((1 - x)[:, None] * one.gain[0][side] + x[:, None] * one.gain[1][side])
                    way = (1 - x)[:, None] * one.direction[0] + x[:, None] * one.direction[1]
                    click += (1.0, -1.0)[side] * push * way
            modes.advance(first, stop, drive, click, self.source, self.dipole[b, :, first:stop], b)


def play(log: ContactLog, radiation: Radiation, seconds: float | None = None) -> Array:
    """Play a log: pascals (channels, n), the first ``seconds`` of it where given."""
    pressure = Instrument(log, radiation).play()
    return pressure if seconds is None else pressure[:, : round(seconds * log.sr)]


# ---- 1. Contact rows and loads ---------------------------------------------------------------------------------------


def rotation(q: Array) -> Array:
    """Matrix of a quaternion (x, y, z, w), body to world [Kuipers 1999, sec. 5.15]."""
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])  # fmt: skip


@dataclass
class Row:
    """A contact of a step, turned onto the pair's lower body; point … sweep: of each side."""

    pair: tuple[int, int]
    impulse: Array  # N·s on the lower body, world
    normal: Array  # towards the lower body, world
    load: float  # N·s
    approach: float
    gap: float
    point: Array  # body frames
    arm: Array  # from the centres of mass, world
    outward: Array  # of the surfaces there, body frames
    local_impulse: Array  # on that body, body frames
    sweep: Array
    place: list | None = None  # of each side: face, weights, curvature


def turned_rows(contacts: Array, quaternion: Array) -> list[Row]:
    """Rows of a step by pair, as they came within it. The log's impulse acts on a, its normal points from b to a."""
    rows = []
    for c in contacts:
        sides = [
            (int(c["a"]), c["point_a_m"], c["impulse_n_s"], c["normal"], c["sweep_m_s"][0]),
            (int(c["b"]), c["point_b_m"], -c["impulse_n_s"], -c["normal"], c["sweep_m_s"][1]),
        ]
        body, point, impulse, inward, sweep = zip(*sorted(sides, key=lambda side: side[0]), strict=True)
        turn = [rotation(quaternion[b]) for b in body]
        load, approach, gap = (float(x) for x in (c["impulse_n_s"] @ c["normal"], c["approach_m_s"], c["gap_m"]))
        arm = np.array([turn[side] @ point[side] for side in range(2)])
        outward = np.array([-turn[side].T @ inward[side] for side in range(2)])
        local = np.array([turn[side].T @ impulse[side] for side in range(2)])
        both = np.array(point), arm, outward, local, np.array(sweep)
        rows.append(Row(body, impulse[0], inward[0], max(load, 0.0), approach, gap, *both))
    return sorted(rows, key=lambda row: row.pair)


class Pair:
    """Two bodies that touch: load F and what of it strikes have used (t,); friction; its contact patch."""

    def __init__(self, steps: int) -> None:
        self.force = np.zeros(steps + 3 * SPAN)  # newtons; indices below 0 find the zeros at the end
        self.struck = np.zeros(steps + 3 * SPAN)
        self.voice: Voice | None = None
        self.patch = Patch()

    def opening(self, t: int, known: int) -> float:
        """The part of the load that lasts SPAN steps [Serra 1982, ch. II]. Stated: windows end with what is known."""
        windows = [self.force[np.arange(a, min(a + SPAN, known + 1))] for a in range(t - SPAN + 1, t + 1)]
        return max(float(window.min()) for window in windows)


# ---- 2. Strikes ------------------------------------------------------------------------------------------------------


@dataclass
class Strike:
    """An impact of one pair: its share of the loads of up to three steps, and the pulse it makes.

    impulse (3,): on the lower body, world; modal_impulse: Uᵀj of either body, of all of it; transmitted: fraction that
    bodies that yield let through; start_s: absolute.
    """

    pair: tuple[int, int]
    step: int
    share: list[float]
    rows: list[list[Row]]
    raw: float = 0.0
    impulse: Array = field(default_factory=lambda: np.zeros(3))
    normal: Array = field(default_factory=lambda: np.zeros(3))
    arm: Array = field(default_factory=lambda: np.zeros((2, 3)))
    centre: Array = field(default_factory=lambda: np.zeros(3))
    approach: float = 0.0
    meets_s: float | None = None  # after the start of its step; negative: in the one before
    overlaps: bool = False
    budget: float = 0.0
    accepted: float = 0.0
    audible: bool = False
    length_s: float = 0.0
    flat: bool = False
    transmitted: float = 1.0
    start_s: float = 0.0
    modal_impulse: list[Array] = field(default_factory=list)


def find_strikes(scene: Instrument, t: int, ahead: int) -> list[Strike]:
    """Strikes that begin in step t, which sounds now, or next (ahead = 1: bodies that overlap as it starts met now)."""
    known, struck = t - ahead + KNOWN, []
    for key, pair in scene.pairs.items():
        if pair.force[t] > pair.force[t - 1]:
            share = [0.0] * KNOWN
            for j in range(KNOWN):
                load = pair.force[t + j]
                excess = load - pair.opening(t + j, known) - pair.struck[t + j]
                if not excess > 1e-9 * load:
                    break
                pair.struck[t + j] += excess
                share[j] = excess / load
            if share[0] > 0:
                rows = [[row for row in scene.rows[t + j] if row.pair == key] if share[j] else [] for j in range(KNOWN)]
                struck.append(Strike(key, t, share, rows))
    dt, back, g = scene.dt_s[t], scene.dt_s[max(t - 1, 0)], scene.gravity[t]
    for one in struck:
        gather(one, back, dt)
        low, high = (scene.bodies[b] for b in one.pair)
        # what gravity gives a body at rest in a step is no approach: a tenth more for a solver's remainder,
        # a hundredth in all directions for wedged bodies
        fall = 1.1 * abs(one.normal @ g) * dt + 0.01 * float(np.linalg.norm(g)) * dt
        speed = max(one.approach - max(unheld_steps(scene, b, t, ahead) for b in one.pair) * fall, 0.0)
        if speed > 0 and not is_recreated(scene, low, high, one.pair, one.approach, fall, t):
            one.budget = 2 * effective_mass(scene, one.pair, t, one.arm, one.normal) * speed
    if not any(one.budget > 0 for one in struck):
        return []
    accept(struck, scene.bodies)
    for one in struck:
        if one.accepted > 0:
            make_pulse(scene, one, t)
    date_others(struck, scene.bodies, back, dt)
    for one in struck:
        if one.audible:  # found a step late, it keeps its phase
            late = 0.0 if ahead or one.meets_s >= 0 else back
            one.start_s = scene.time_s[t] + min(one.meets_s + late, dt)
    return [one for one in struck if one.audible]


def unheld_steps(scene: Instrument, b: int, t: int, ahead: int) -> float:
    """Steps for which gravity may have moved a body although it rests: 1 where it carried load, SPAN where placed."""
    if scene.bodies[b].mass_kg <= 0:
        return 0.0
    placed = scene.bodies[b].body.since_step if scene.bodies[b].material is not None else -SPAN
    moved = np.flatnonzero(scene.teleported[1 : t - ahead + 2, b])
    if t - (moved[-1] + 1 if len(moved) else placed) < SPAN:
        return float(SPAN)
    before = np.arange(t - KNOWN, t)
    return float(any((pair.force[before] > 0).any() for key, pair in scene.pairs.items() if b in key))


def last_loaded_step(scene: Instrument, b: int, t: int) -> int:
    """Last step before t in which a body carried load."""
    steps = [np.flatnonzero(pair.force[: max(t, 0)] > 0) for key, pair in scene.pairs.items() if b in key]
    return max((int(one[-1]) for one in steps if len(one)), default=-(1 << 40))


def is_recreated(
    scene: Instrument, low: Sounding, high: Sounding, pair: tuple[int, int], approach: float, fall: float, t: int
) -> bool:
    """Whether gravity and the steps' length alone repeat a strike of a body at rest; else it is the last cause.

    A point that bounces with restitution e on steps of dt stops losing speed at g·dt·e/(1 - e): what comes back no
    faster than three times that, and faster than the last cause leaves it by now, has no other cause. Bounces lose
    g(1 - e)/2e a second [a flight 2ve/g long loses (1 - e)v], of which half is asked. Who leaves at v is back after
    2v/g: the fastest strike since then is then the cause.
    """
    usual = 0.7  # restitution of a body whose log does not give it
    e = min(low.body.dynamics.get("restitution", usual) * high.body.dynamics.get("restitution", usual), 1.0)
    limit, loss = 3.0 * max(1.0, e / max(1 - e, 1e-9)), fall * (1 - e) / (4 * max(e, 1e-9))
    left, recent = 0.0, True
    for b, one in zip(pair, (low, high), strict=True):
        if one.mass_kg > 0:
            if one.since_m_s > 0 and (t - one.cause_step) * fall >= 2 * one.cause_m_s:
                one.cause_m_s, one.cause_step, one.since_m_s = one.since_m_s, one.since_step, 0.0
            left = max(left, one.cause_m_s - loss * max(t - one.cause_step, 0))
            recent = recent and t - last_loaded_step(scene, b, t) <= 2 * limit + 2
    if recent and left < approach <= limit * fall:
        return True
    for one in (low, high):
        if approach >= one.cause_m_s - loss * max(t - one.cause_step, 0):
            one.cause_m_s, one.cause_step, one.since_m_s = approach, t, 0.0
        elif approach >= one.since_m_s - loss * max(t - one.since_step, 0):
            one.since_m_s, one.since_step = approach, t
    return False


def gather(one: Strike, back_s: float, dt_s: float) -> None:
    """Sum a strike's rows by their shares, and date it where gap and approach do.

    It comes gap/approach after its first step's start, of the row with most load times approach, where that lies in
    the step or the one before. A gap of exactly 0 is one that nobody knows.
    """
    for share, rows in zip(one.share, one.rows, strict=True):
        for row in rows:
            load = share * row.load
            one.raw += load
            one.approach = max(one.approach, row.approach)
            one.impulse = one.impulse + share * row.impulse
            one.normal, one.arm = one.normal + load * row.normal, one.arm + load * row.arm
            one.centre = one.centre + load * row.point[0]
    one.centre, one.arm = one.centre / one.raw, one.arm / one.raw
    one.normal = one.normal / max(np.linalg.norm(one.normal), 1e-300)
    most = 0.0
    for row in one.rows[0]:
        one.overlaps = one.overlaps or row.gap < 0
        weight = row.load * one.share[0] * row.approach
        if weight > most and row.gap != 0 and -back_s <= row.gap / row.approach <= dt_s:
            most, one.meets_s = weight, row.gap / row.approach


def accept(strikes: list[Strike], bodies: list[Sounding]) -> None:
    """Bound impulses by their cause: 2m*v of the own approach, or the largest that a struck neighbour takes.

    A solver's flicker between corners has no approach; a body that never moves hands nothing on. An impact travels
    through 8 bodies in a step at most.
    """
    for one in strikes:
        one.accepted = min(one.raw, one.budget)
    for _ in range(8):
        through = dict.fromkeys((b for one in strikes for b in one.pair), 0.0)
        for one in strikes:
            for b in one.pair:
                if bodies[b].mass_kg > 0:
                    through[b] = max(through[b], one.accepted)
        more = [min(one.raw, max(one.budget, *(through[b] for b in one.pair))) for one in strikes]
        if more == [one.accepted for one in strikes]:
            break
        for one, value in zip(strikes, more, strict=True):
            one.accepted = value


def date_others(strikes: list[Strike], bodies: list[Sounding], back_s: float, dt_s: float) -> None:
    """Date what gap and approach do not: half a pulse after the strongest neighbour's that hands it on; else spread.

    Undated strikes of a body come at multiples of the golden ratio of the step [Knuth 1998, vol. 3, sec. 6.4, theorem
    S]: no comb at the step rate, and the same in every run.
    """

    def spread(one: Strike) -> None:
        if one.meets_s is None:
            body = bodies[one.pair[0]] if bodies[one.pair[0]].mass_kg > 0 else bodies[one.pair[1]]
            phase = 0.02 + 0.96 * ((body.seed / 2**32 + 0.6180339887498949 * body.undated) % 1.0)
            one.meets_s = (phase - 1) * back_s if one.overlaps else phase * dt_s
            body.undated += 1

    for one in strikes:
        if 0 < one.accepted <= one.budget:
            spread(one)
    for _ in range(8):
        through: dict[int, tuple[float, float]] = {}
        for one in strikes:
            for b in one.pair:
                if one.meets_s is not None and bodies[b].mass_kg > 0 and one.accepted > through.get(b, (0.0, 0.0))[0]:
                    through[b] = one.accepted, one.meets_s + 0.5 * one.length_s
        grown = False
        for one in strikes:
            low, high = (through.get(b, (0.0, 0.0)) for b in one.pair)
            best = low if low[0] >= high[0] else high
            if one.meets_s is None and one.accepted > 0 and best[0] > 0:
                one.meets_s, grown = best[1], True
        if not grown:
            break
    for one in strikes:
        if one.accepted > 0:
            spread(one)


def make_pulse(scene: Instrument, one: Strike, t: int) -> None:
    """Length, shape and transmitted share of a strike's pulse, and Uᵀj summed over its rows.

    Bodies that yield take 1/(1 + m*/j² Σ (Uᵀj |F̂(fτ)|)²) of a rigid body's impulse: a mode that moves within the
    pulse is one more mass 1/g² in series with m*, g = Uᵀj/j [Stronge 2000, sec. 7.1, with modes as further motions].
    """
    low, high = (scene.bodies[b] for b in one.pair)
    mass = effective_mass(scene, one.pair, t, one.arm, one.normal)
    steep = np.linalg.norm(one.impulse) > 10 * one.raw  # a contact that Bullet drops in a step keeps its friction
    if not (low.sounds or high.sounds) or steep or mass <= 0 or not one.accepted > 1e-6 * mass:
        return
    one.audible, scale, most, bent, spread = True, one.accepted / one.raw, -1.0, 0.0, 0.0
    one.modal_impulse = [np.zeros(len(low.omega)), np.zeros(len(high.omega))]
    for share, rows in zip(one.share, one.rows, strict=True):
        for row in rows:
            load, places = row.load * share, contact_places(scene, row)
            for side in range(2):
                one.modal_impulse[side] += share * scale * modal_impulse(scene, row, side)
            if load > most:
                most, bent = load, places[0][2] + places[1][2]
            spread += load / one.raw * ((row.point[0] - one.centre) ** 2).sum()
    area = flat_area_m2(scene, one.pair, np.sqrt(spread), bent, 0.02)
    speed = max(one.approach if one.approach > 0 else one.accepted / (1.5 * mass), 1e-6)
    one.length_s, one.flat = pulse_length(mass, contact_modulus_pa(scene, one.pair), bent, area, speed)
    given = 0.0
    for side, b in enumerate(one.pair):
        one.modal_impulse[side] = scene.modes[b].turned(one.modal_impulse[side])
        hz = scene.bodies[b].omega / (2 * np.pi)
        given += float(((one.modal_impulse[side] * pulse_spectrum(hz * one.length_s, one.flat)) ** 2).sum())
    one.transmitted = 1 / (1 + mass * given / one.accepted**2)
    one.impulse = scale * one.impulse


def pulse_length(
    mass_kg: float, modulus_pa: float, curvature_per_m: float, area_m2: float, speed: float
) -> tuple[float, bool]:
    """τ and whether it is flat, 1 µs … 50 ms: the longer of both, for no contact is stiffer than its area's punch.

    curved  τ = 2.868 (m*²κ/(E*²v))^{1/5}                        [Johnson 1985, eq. 11.24]
    flat    τ = π √(m*/k),  k = 2E*√(A/π)                        [Johnson 1985, eq. 3.36]
    """
    curved = 2.868 * (mass_kg**2 * curvature_per_m / (modulus_pa**2 * speed)) ** 0.2 if curvature_per_m > 0 else 0.0
    punch = np.pi * np.sqrt(mass_kg / (2 * modulus_pa * np.sqrt(area_m2 / np.pi))) if area_m2 > 0 else 0.0
    if curvature_per_m <= 0 and area_m2 <= 0:
        return 50e-3, False
    longer = max(curved, punch)
    return float(np.clip(50e-3 if np.isnan(longer) else longer, 1e-6, 50e-3)), bool(punch >= curved)


def hertz_depth(s: Array) -> Array:
    """(δ/δ_max)^{5/2} at fractions s of a Hertz pulse.

    δ'' = -δ^{3/2}, so δ'²/v² = 1 - (δ/δ_max)^{5/2}, and time is an incomplete beta function of that.
    """
    return betaincinv(0.4, 0.5, np.clip(1 - np.abs(2 * np.asarray(s) - 1), 0, 1))


def pulse_force(s: Array, flat: bool) -> Array:
    """Force at fractions s of a pulse, mean 1: ∝ δ^{3/2} of Hertz' law, a half-sine of flat faces."""
    s = np.asarray(s, float)
    if flat:
        return np.where((s >= 0) & (s <= 1), np.pi / 2 * np.sin(np.pi * s), 0.0)
    half = 1.25**0.4 * 0.4 * np.sqrt(np.pi) * gamma(0.4) / gamma(0.9)  # of the duration, for v = 1
    return np.where((s > 0) & (s < 1), half * 1.25**0.6 * hertz_depth(s) ** 0.6, 0.0)


def cumulated_force(s: Array, flat: bool) -> Array:
    """Q(s) = ∫F: half the change of velocity so far, (1 - δ'/v)/2."""
    s = np.clip(s, 0, 1)
    if flat:
        return 0.5 - 0.5 * np.cos(np.pi * s)
    left = 0.5 * (1 - np.sqrt(1 - hertz_depth(s)))
    return np.where(s < 0.5, left, 1 - left)


F_TAU = np.arange(321) / 40
_MIDDLE = (np.arange(4096) + 0.5) / 4096
SPECTRUM = [
    np.abs(np.exp(-2j * np.pi * np.outer(F_TAU, _MIDDLE)) @ pulse_force(_MIDDLE, flat)) / 4096 for flat in (False, True)
]


def pulse_spectrum(f_tau: Array, flat: bool) -> Array:
    """|F̂(f)/F̂(0)| of a pulse. Stated: linear between multiples of 1/40 of fτ, 0 from fτ = 8 on."""
    return np.interp(f_tau, F_TAU, SPECTRUM[flat] / SPECTRUM[flat][0], right=0.0)


# ---- 3. Rolling and sliding ------------------------------------------------------------------------------------------


UNIT_RMS = np.sqrt(3.0 * 315 / 151)  # lattice values on ±1 have 1/3, the mean square of the B-spline is 151/315
LATTICE = 0.30  # an octave's lattice over its wavelength: most of the spectrum at λ = Δ/0.30


@dataclass
class Voice:
    """The contact oscillator of a pair, while its support lasts. Of the step's end: load, sweep, direction, gain.

    mass, modulus, radius: m*, E*, R*; loss: c at least; heights, around, stretch: of either surface's octaves.
    """

    load: float = 0.0
    sweep: Array = field(default_factory=lambda: np.zeros(2))
    direction: Array | None = None
    gain: list[Array] | None = None
    mass: float = 0.0
    modulus: float = 0.0
    radius: float = 0.0
    loss: float = 0.0
    height: list[Array] = field(default_factory=list)
    around: list[float] = field(default_factory=list)
    stretch: list[float] = field(default_factory=list)
    z: float = 0.0  # penetration beyond the resting one
    u: float = 0.0  # speed of separation
    begun: bool = False
    swept: Array = field(default_factory=lambda: np.zeros(2))


@dataclass
class Friction:
    """f - N of one pair in one step: newtons (n,) along ``direction`` on the lower body; gain: Uᵀ a newton.

    gain[end][side], direction[end]: at the step's two ends, linear between.
    """

    pair: tuple[int, int]
    step: int
    newton: Array
    gain: list[list[Array]]
    direction: list[Array]


def friction_forces(scene: Instrument, k: int) -> list[Friction]:
    """Forces of rolling and sliding in step k: from what the step before ended with to what the next one's rows say.

    A manifold's points flicker: gains and directions follow them with 20 ms. Sweeps below 0.2 mm/s are none.
    """
    found, follow, x = [], 1 - np.exp(-scene.dt_s[k] / 0.02), scene.along(k)
    for key, pair in scene.pairs.items():
        target, low, high = pair.opening(k + 1, k + KNOWN), scene.bodies[key[0]], scene.bodies[key[1]]
        fresh = pair.voice is None
        if fresh:
            if target <= 0 or not (low.sounds or high.sounds) or low.mass_kg + high.mass_kg <= 0:
                continue
            pair.voice = Voice()
        voice = pair.voice
        rows = [row for row in scene.rows[k + 1] if row.pair == key]
        total, along = sum(row.load for row in rows), sum((row.impulse for row in rows), np.zeros(3))
        if not (total > 0 and 10 * total >= np.linalg.norm(along)):
            rows = []
        loads, sweep, direction = (voice.load, target), [voice.sweep, np.zeros(2)], [voice.direction] * 2
        if rows:
            aim_at = along / total
            direction[0] = aim_at if voice.direction is None else voice.direction
            direction[1] = direction[0] + follow * (aim_at - direction[0])
            mean = sum(row.load * row.sweep for row in rows) / total
            sweep[1] = np.where(mean < 2e-4, 0.0, np.minimum(mean, 50.0))
        moves = voice.z != 0 or voice.u != 0 or sweep[0].any() or sweep[1].any()
        moves = moves and (loads[0] > 0 or target > 0)
        if fresh:
            begin_voice(scene, voice, key, rows, k + 1)
        if moves:
            newton = sound_voice(scene, voice, key, loads, sweep, x)
        if moves and (rows or voice.gain is not None):
            aims = [sum(modal_impulse(scene, row, side) for row in rows) / total if rows else None for side in range(2)]
            aims = [None if one is None else scene.modes[b].turned(one) for one, b in zip(aims, key, strict=True)]
            start = aims if voice.gain is None else voice.gain
            end = [a + follow * (b - a) for a, b in zip(start, aims, strict=True)] if rows else start
            voice.gain = end
            found.append(Friction(key, k, newton, [start, end], direction))
        voice.load, voice.sweep, voice.direction = target, sweep[1], direction[1]
        if target <= 0:
            pair.voice = None
    return [one for one in found if one.newton.any()]


def begin_voice(scene: Instrument, voice: Voice, key: tuple[int, int], rows: list[Row], t: int) -> None:
    """Constants of a contact oscillator, by the manifold with which it begins: m*, E*, R*, both surfaces.

    A flat face rests on its highest spots, each a cap as blunt as the face is wide. c is at least 3/2 (1 - e), e of
    the less elastic body at 1 m/s, by e = 1 - αv and c = 3/2 α [Hunt & Crossley 1975].
    """
    low, high = (scene.bodies[b] for b in key)
    voice.modulus, e = contact_modulus_pa(scene, key), min(low.restitution, high.restitution)
    voice.loss = 1.5 * (1 - e) if e < 1 else 0.0
    voice.mass, curvature, spread = 1 / sum(1 / one.mass_kg for one in (low, high) if one.mass_kg > 0), 0.0, 0.0
    if rows:
        total = sum(row.load for row in rows)
        normal, arm, point = (
            sum(row.load / total * value for row, value in zip(rows, values, strict=True))
            for values in ([r.normal for r in rows], [r.arm for r in rows], [r.point[0] for r in rows])
        )
        voice.mass = effective_mass(scene, key, t, arm, normal / np.linalg.norm(normal))
        spread = np.sqrt(sum(row.load / total * ((row.point[0] - point) ** 2).sum() for row in rows))
        strongest = max(rows, key=lambda row: row.load)
        curvature = sum(side[2] for side in contact_places(scene, strongest))
    area = flat_area_m2(scene, key, spread, curvature, 0.25)
    blunt = np.sqrt(area / np.pi) if area > 0 else 1.0
    voice.radius = 1 / curvature if curvature * blunt > 1 else blunt
    made = [octave_heights(one) for one in (low, high)]
    voice.height, voice.around, voice.stretch = (list(values) for values in zip(*made, strict=True))


def sound_voice(
    scene: Instrument, voice: Voice, key: tuple[int, int], loads: tuple[float, float], sweep: list[Array], x: Array
) -> Array:
    """f - N of a contact in one step."""
    patch = [(0.75 * load * voice.radius / voice.modulus) ** (1 / 3) for load in loads]  # Hertz' a
    rate = np.zeros(len(x))
    for side, b in enumerate(key):
        here = np.array([sweep[0][side], sweep[1][side]])
        if here.any():
            gains = [octave_gains(v, a, scene.sr) for v, a in zip(here, patch, strict=True)]
            rate += profile_rate(voice, side, scene.bodies[b].seed, here, x, gains, scene.sr)
    still = not (sweep[0].any() or sweep[1].any())
    return oscillate(voice, loads, rate, x, still, scene.sr)


def octave_heights(one: Sounding) -> tuple[Array, float, float]:
    """A_j ∝ λ_j^H of a self-affine surface, Σ A_j² = rms² [Mandelbrot; Persson 2005], for lattice values on ±1.

    A round body's profile closes on itself: a whole number of points, 4 to 7 of the coarsest octave that has as many,
    go round; coarser waves only carry it. Returns points of octave 0 round it (0: endless), the lattice's stretch.
    """
    height = WAVE_M**one.hurst
    height = one.roughness_m * height / np.sqrt((height**2).sum()) * UNIT_RMS
    if not one.body.curvature_per_m > 0:
        return height, 0.0, 0.0
    points, j = 2 * np.pi / one.body.curvature_per_m / (WAVE_M[0] * LATTICE), 0
    while points < 4 and j < len(height) - 1:
        height[j] = 0.0
        points, j = 2 * points, j + 1
    whole = np.floor(points + 0.5)
    return height, whole / 2.0**j, whole / points - 1


def octave_gains(speed: float, patch_m: float, sr: int) -> Array:
    """Gains of the octaves at a sweep speed.

    patch (1 + a/λ)^{-1/2}, a: Hertz' radius: a rough contact rests on 1 + a/λ spots and follows their mean;
    1 below 0.2 sr at v/λ, 0 from 0.4 sr on; 1 above 16 Hz, 0 below 8 Hz: slow waves only lift the body.
    """
    f = speed / WAVE_M
    return np.clip((0.4 - f / sr) / 0.2, 0, 1) * np.clip(f / 8 - 1, 0, 1) / np.sqrt(1 + patch_m / WAVE_M)


def lattice_noise(seed: int, octave: int, point: Array, around: float) -> Array:
    """Values on ±1 at lattice points, counted round ``around`` of them: a 32-bit mix [Wellons 2018, "lowbias32"]."""
    start = ((seed * 0x9E3779B97F4A7C15) % 2**64 >> 33) + 0x3C6EF372 * octave
    if around > 0:
        point = point % int(around * 2**octave)
    h = (point + start) % 2**32
    h = ((h ^ (h >> 16)) * 0x7FEB352D) % 2**32
    h = ((h ^ (h >> 15)) * 0x846CA68B) % 2**32
    h ^= h >> 16
    return np.where(h >= 2**31, h - 2**32, h) / 2.0**31


def profile_rate(voice: Voice, side: int, seed: int, sweep: Array, x: Array, gains: list[Array], sr: int) -> Array:
    """dh/dt (n,) = v Σ_j g_j A_j n_j'(s/Δ_j)/Δ_j at the distance s that a surface has swept.

    n_j: cubic B-spline on lattice values, Δ_j = 0.3 λ_j. Only dh/dt counts, so a gain that changes moves no surface.
    """
    v = sweep[0] + (sweep[1] - sweep[0]) * x
    s = voice.swept[side] + np.cumsum(v) / sr
    voice.swept[side] = s[-1]
    rate = np.zeros(len(x))
    for j, height in enumerate(voice.height[side]):
        amplitude = height * (gains[0][j] + (gains[1][j] - gains[0][j]) * x)
        if amplitude.any():
            inverse = 2.0**j / (WAVE_M[0] * LATTICE) * (1 + voice.stretch[side])
            cell = np.floor(s * inverse).astype(np.int64)
            t = s * inverse - cell
            c = [lattice_noise(seed, j, cell + i, voice.around[side]) for i in (-1, 0, 1, 2)]
            slope = (1 - t) ** 2 / 2 * (c[1] - c[0]) + (t * (1 - t) + 0.5) * (c[2] - c[1]) + t**2 / 2 * (c[3] - c[2])
            rate += v * amplitude * slope * inverse
    return rate


def oscillate(voice: Voice, loads: tuple[float, float], rate: Array, x: Array, still: bool, sr: int) -> Array:
    """f - N (n,) in newtons, of heights that pass at dh/dt = rate.

    dz/dt = dh/dt - u,  m* du/dt = f - N,  δ = δ₀(N) + z
    f = k δ^{3/2} (1 + c (dh/dt - u)), never below 0   [Hunt & Crossley 1975, eq. 12; clamped: micro-collisions]
    N = k δ₀^{3/2},  k = 4/3 E*√R*;  c = 2ζ√(m* dN/dδ₀)/N, ζ = 0.25: waves into both bodies; at least that of e
    Stated: semi-implicit Euler, damping implicit, 1 … 8 substeps h a sample: half a radian of the resonance at rest;
    beyond the depth at which 1.5 k√δ is m*/h² the law goes on as a straight line. δ₀ and c run linearly over the step.
    """
    m, k = voice.mass, 4 / 3 * voice.modulus * np.sqrt(voice.radius)
    soft = 1.5 * k ** (2 / 3)  # dN/dδ₀ = soft N^{1/3}
    substeps = int(np.clip(np.ceil(2 * np.sqrt(soft * max(loads) ** (1 / 3) / m) / sr), 1, 8))
    h = 1 / (sr * substeps)
    limit = (m / (1.5 * k * h**2)) ** 2

    def elastic(depth: float) -> float:
        low = min(depth, limit)
        return k * low * np.sqrt(low) + m / h**2 * (depth - low)

    def depth_of(load: float) -> float:
        at_limit = k * limit**1.5
        return (load / k) ** (2 / 3) if load <= at_limit else limit + (load - at_limit) * h**2 / m

    least = 1e-3 * 9.81 * m
    loss = [max(voice.loss, 0.5 * np.sqrt(m * soft) * max(load, least) ** (-5 / 6)) for load in loads]
    depth = [depth_of(load) for load in loads]
    if not voice.begun:  # it starts with the profile's velocity
        voice.begun, voice.u = True, rate[0]
    force, z, u = np.zeros(len(x)), voice.z, voice.u
    for n in range(len(x)):
        rest, c = depth[0] + (depth[1] - depth[0]) * x[n], loss[0] + (loss[1] - loss[0]) * x[n]
        load = elastic(rest)
        for _ in range(substeps):
            z += (rate[n] - u) * h
            pressed = elastic(max(rest + z, 0.0))
            f = (pressed - load + pressed * c * (rate[n] - u)) / (1 + pressed * c * h / m)
            f = max(f, -load)
            u += f / m * h
            force[n] += f / substeps
        if still and abs(z) <= 1e-9 * rest and abs(u) * h <= 1e-9 * rest:  # at rest to the bit
            z, u, force[n] = 0.0, 0.0, 0.0
    voice.z, voice.u = z, u
    return force


# ---- 4. Two bodies at a contact --------------------------------------------------------------------------------------


def effective_mass(scene: Instrument, pair: tuple[int, int], t: int, arm: Array, normal: Array) -> float:
    """1/m* = Σ [1/m + (r × n)·I⁻¹(r × n)] [Johnson 1985, sec. 11.1]; 0 where neither moves."""
    mobility = 0.0
    for side, b in enumerate(pair):
        body = scene.bodies[b].body
        if body.mass_kg > 0:
            turn = rotation(scene.turn[t, b]).T @ np.cross(arm[side], normal)
            mobility += 1 / body.mass_kg
            if np.linalg.det(body.inertia_kg_m2) != 0:  # point masses do not turn
                mobility += turn @ np.linalg.solve(body.inertia_kg_m2, turn)
    return 1 / mobility if mobility > 0 else 0.0


def contact_modulus_pa(scene: Instrument, pair: tuple[int, int]) -> float:
    """1/E* = Σ (1 - ν²)/E [Johnson 1985, eq. 4.24]."""
    with np.errstate(divide="ignore"):
        return float(1 / np.float64(sum(1 / scene.bodies[b].modulus_pa for b in pair)))


def pair_size_m(scene: Instrument, pair: tuple[int, int]) -> float:
    """Size of the smaller body, 0.1 m where neither has a volume."""
    return min((scene.bodies[b].size_m for b in pair if scene.bodies[b].body.volume_m3 > 0), default=0.1)


def flat_area_m2(
    scene: Instrument, pair: tuple[int, int], spread_m: float, curvature_per_m: float, least: float
) -> float:
    """Area of the disc that the points of a flat contact span, of radius ``least`` of the size at least; else 0."""
    size = pair_size_m(scene, pair)
    return 0.0 if curvature_per_m * size > 0.1 else np.pi * max(spread_m, least * size) ** 2


def contact_places(scene: Instrument, row: Row) -> list:
    """Face, barycentric weights and curvature of a row on either body.

    A normal more than 20° from the face's touches an edge: edges are round, by 0.5 % of the body's size.
    """
    if row.place is None:
        row.place = []
        for side, b in enumerate(row.pair):
            one, face, weights = scene.bodies[b], -1, np.zeros(3)
            bent = one.body.curvature_per_m
            if len(one.face):
                face, weights, _ = nearest_face(one, row.point[side], row.outward[side])
                bent = bent if np.isfinite(bent) else face_curvature(one, face, row.outward[side])
            row.place.append((face, weights, bent if np.isfinite(bent) else 0.0))
    return row.place


def face_curvature(one: Sounding, face: int, outward: Array) -> float:
    """Curvature of a face, or of an edge."""
    leans = one.normal[face] @ outward < np.cos(np.radians(20.0))
    return 1 / max(0.005 * one.size_m, 2e-4) if leans else float(one.face_curvature_per_m[face])


def modal_impulse(scene: Instrument, row: Row, side: int) -> Array:
    """Uᵀj of a row on one body: shapes linear in the face, times the impulse, friction included."""
    one, (face, weights, _) = scene.bodies[row.pair[side]], contact_places(scene, row)[side]
    if face < 0:
        return np.zeros(len(one.omega))
    return np.einsum("k,kxm,x->m", weights, one.shape[one.face[face]], row.local_impulse[side])


def nearest_face(one: Sounding, point: Array, outward: Array) -> tuple[int, Array, float]:
    """Find face, weights and distance of the surface's point nearest to a contact, on the side that it presses.

    A solver's hull is not the surface: of faces that look along ``outward`` the nearest is taken, the one that looks
    along it most among equals, if it is at most twice as far as the nearest of all and a wall's thickness.
    """
    weights = nearest_in_triangles(point, one.corner)
    away = np.linalg.norm(np.einsum("fk,fkx->fx", weights, one.corner) - point, axis=1)
    looks = one.normal @ outward
    any_face = int(np.argmin(away))
    facing = np.flatnonzero(looks > 1e-6)
    if len(facing):
        tied = facing[away[facing] <= away[facing].min() + one.tie_m]
        best = int(tied[np.argmax(looks[tied])])
        if away[best] <= 2 * away[any_face] + one.wall_m:
            return best, weights[best], float(away[best])
    return any_face, weights[any_face], float(away[any_face])


def nearest_in_triangles(point: Array, corner: Array) -> Array:
    """Barycentric coordinates (f, 3) of each triangle's point nearest to a point: in its plane, else on an edge."""
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    u, v, w = b - a, c - a, point - a
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    uw, vw = (u * w).sum(1), (v * w).sum(1)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * uw - uv * vw) / det, (uu * vw - uv * uw) / det
    inside = np.stack([1 - second - third, second, third], axis=1)
    best = np.where((inside >= 0).all(1)[:, None], inside, np.nan)
    least = np.where((inside >= 0).all(1), ((np.einsum("fk,fkx->fx", inside, corner) - point) ** 2).sum(1), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge = corner[:, j] - corner[:, i]
        t = np.clip(((point - corner[:, i]) * edge).sum(1) / np.maximum((edge * edge).sum(1), 1e-300), 0, 1)
        square = ((corner[:, i] + t[:, None] * edge - point) ** 2).sum(1)
        nearer = square < least
        weights = np.zeros((len(t), 3))
        weights[:, i], weights[:, j] = 1 - t, t
        best[nearer], least[nearer] = weights[nearer], square[nearer]
    return best


# ---- 5. Support: other poles, and what passes on ---------------------------------------------------------------------


@dataclass
class Patch:
    """Contact patch of a pair: up to 4 tracked points on both bodies, their smoothed loads, and both surfaces' normals.

    A solver's points flicker; only their sum and moment are reliable. used: points and loads of the present poles.
    """

    point: list[Array] = field(default_factory=list)  # (2, 3) each, body frames
    load: list[float] = field(default_factory=list)
    outward: Array = field(default_factory=lambda: np.zeros((2, 3)))
    used: list[tuple[Array, float]] = field(default_factory=list)
    used_s: float = 0.0

    def track(self, rows: list[Row], share: float, near: float, follow: float) -> None:
        """Move points and loads towards those of a step: each row to the tracked point near it, or a new one.

        near: 0.15 of the smaller body's size. share: newtons of support per N·s.
        """
        begins = not self.point
        target, moment = [0.0] * len(self.point), [np.zeros((2, 3)) for _ in self.point]
        lean, most = np.zeros((2, 3)), 0.0
        for row in rows:
            load = row.load * share
            if load <= 0:
                continue
            off = [np.linalg.norm(point - row.point, axis=1).min() for point in self.point]
            i = int(np.argmin(off)) if off else 0
            if (not off or off[i] > near) and len(self.point) < 4:
                i = len(self.point)
                self.point.append(row.point.copy())
                self.load.append(0.0)
                target.append(0.0)
                moment.append(np.zeros((2, 3)))
            if begins and load > most:
                most, self.outward = load, row.outward.copy()
            target[i] += load
            moment[i] += load * row.point
            lean += load * row.outward
        for side in range(2):
            length = np.linalg.norm(lean[side])
            if sum(target) > 0 and length >= 0.02 * sum(target):
                self.outward[side] += (1.0 if begins else follow) * (lean[side] / length - self.outward[side])
                self.outward[side] /= np.linalg.norm(self.outward[side])
        for i, load in enumerate(target):
            self.load[i] += follow * (load - self.load[i])
            if load > 0:  # a place enters with its load, so the moment is smoothed as the load is
                self.point[i] = self.point[i] + follow * load / self.load[i] * (moment[i] / load - self.point[i])
        least = max(0.02 * sum(self.load), 1e-9)
        kept = [i for i in range(len(self.point)) if self.load[i] >= least or target[i] > 0]
        self.point, self.load = [self.point[i] for i in kept], [self.load[i] for i in kept]

    def differs(self, near: float) -> bool:
        """Whether points, or loads by a factor of 1.6 (1.1 after 0.2 s), differ from those of the present poles."""
        off = 1.1 if self.used_s > 0.2 else 1.6
        return len(self.used) != len(self.point) or any(
            not used / off <= load <= used * off or np.linalg.norm(point - place, axis=1).max() > near
            for (place, used), point, load in zip(self.used, self.point, self.load, strict=True)
        )


class Supports:
    """Which bodies get new poles, and when.

    Stated: a body that sounds and whose patches differ from those of its poles gets new ones, at most each 20 ms, the
    one that waits longest first, moving ones before fixed ones. 6 % of simulated time may go into poles, by the price
    0.5 ms + 0.15 ms a point + 0.2 µs (m + 6)²; up to 30 ms of it are saved.
    """

    def __init__(self, bodies: int) -> None:
        self.stale, self.stale_s, self.wait_s, self.credit_s = [False] * bodies, [0.0] * bodies, [0.0] * bodies, 0.03

    def advance(self, scene: Instrument, k: int, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Track the patches of step k, and give new poles to who is chosen. Loads follow with 30 ms."""
        dt = scene.dt_s[k]
        for key, pair in scene.pairs.items():
            support, patch = pair.opening(k, k + KNOWN), pair.patch
            if not patch.point and support <= 0:
                continue
            if not (pair.force[k : k + SPAN] > 0).any():
                for b in key:
                    self.stale[b] = self.stale[b] or bool(patch.used)
                pair.patch = Patch(outward=patch.outward)
                continue
            share = min(support / pair.force[k], 1.0) / dt if pair.force[k] > 0 else 0.0
            near = 0.15 * pair_size_m(scene, key)
            rows = [row for row in scene.rows[k] if row.pair == key]
            patch.track(rows, share, near, 1 - np.exp(-dt / 0.03))
            patch.used_s += dt
            if patch.differs(near):
                patch.used, patch.used_s = list(zip(patch.point, patch.load, strict=True)), 0.0
                for b in key:
                    self.stale[b] = True
        for b in self.choose(scene, dt, strikes, rubs):
            self.update(scene, b, k, strikes, rubs)

    def choose(self, scene: Instrument, dt: float, strikes: list[Strike], rubs: list[Friction]) -> list[int]:
        """Bodies that get new poles before this step sounds, ascending."""
        count = len(self.stale)
        self.credit_s = min(self.credit_s + 0.06 * dt, 0.03)
        for b in range(count):
            self.wait_s[b] = max(self.wait_s[b] - dt, 0.0)
            self.stale_s[b] += dt if self.stale[b] else 0.0
        moved = {b for one in (*strikes, *rubs) for b in one.pair}
        waiting = [
            b for b in range(count)
            if self.stale[b] and self.wait_s[b] == 0 and len(scene.bodies[b].omega)
            and (b in moved or scene.modes[b].active)
        ]  # fmt: skip
        chosen = []
        while waiting and self.credit_s > 0:
            best = max(waiting, key=lambda b: (scene.bodies[b].mass_kg > 0, self.stale_s[b]))
            waiting.remove(best)
            self.stale[best], self.stale_s[best], self.wait_s[best] = False, 0.0, 0.02
            points = sum(len(pair.patch.point) for key, pair in scene.pairs.items() if best in key)
            if points:
                self.credit_s -= 5e-4 + 1.5e-4 * points + 2e-7 * (len(scene.bodies[best].omega) + 6) ** 2
            chosen.append(best)
        return sorted(chosen)

    def update(self, scene: Instrument, b: int, k: int, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Give a body the poles of its contacts, from its next block on, at once where it is silent."""
        modes, one = scene.modes[b], scene.bodies[b]
        touches = touches_of(scene, b, k)
        partners = list(dict.fromkeys(touch.partner for touch in touches))
        loud = modes.active
        for passed in modes.passed:
            passed.leave()
        modes.passed = [passed for passed in modes.passed if loud and passed.phase != "off"]
        if not touches:
            self.turn(scene, b, None, strikes, rubs)
            modes.coming = modes.free
        else:
            found = coupled_modes(one, [scene.bodies[p] for p in partners], partners, touches, modes.turn)
            self.turn(scene, b, found.turn, strikes, rubs)
            modes.coming = playable((-found.decay + 1j * found.omega) / scene.sr, modes.free)
            own = np.abs(one.weight @ found.turn) / one.body.gain
            for i, p in enumerate(partners):
                partner = scene.bodies[p]
                if len(partner.omega):
                    # pressure is iωρ₀ times velocity, so it goes with the frequency at which a mode is moved
                    weight = found.omega * (partner.weight / partner.omega @ found.moved[i] @ found.motion.T)
                    if (np.abs(weight) / partner.body.gain > np.maximum(0.3 * own, 1e-3 * own.max())).any():
                        modes.passed.append(Passed(p, weight, "coming" if loud else "steady"))
        if not loud:
            modes.take_poles()

    def turn(self, scene: Instrument, b: int, turn: Array | None, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Turn pairs of modes of one frequency to the contact's axes, with all that has a number for each mode.

        ψ' = ψR, z' = Rᵀz, (Uᵀj)' = Rᵀ Uᵀj: ½|z|² and Σ w z stay. A turn by less than 0.05 changes nothing.
        Stated: what rang as the block began turns at its end, what was driven since at once.
        """
        modes = scene.modes[b]
        same = np.eye(len(modes.z))
        step = (same if modes.turn is None else modes.turn).T @ (same if turn is None else turn)
        if not (step - np.diag(np.diag(step))).any() or (turn is not None and np.abs(step - same).max() < 0.05):
            return
        modes.turn, modes.driven, modes.weight = turn, step.T @ modes.driven, modes.weight @ step
        modes.late = step if modes.late is None else modes.late @ step
        for passed in modes.passed:
            passed.weight = passed.weight @ step
        for pulse in modes.pulses:
            pulse.hits = pulse.hits @ step if len(pulse.hits) else pulse.hits
        for one in strikes:
            one.modal_impulse = [step.T @ j if p == b else j for j, p in zip(one.modal_impulse, one.pair, strict=True)]
        for rub in rubs:
            rub.gain = [[step.T @ g if p == b else g for g, p in zip(end, rub.pair, strict=True)] for end in rub.gain]
        for key, pair in scene.pairs.items():
            if b in key and pair.voice is not None and pair.voice.gain is not None:
                side = key.index(b)
                pair.voice.gain = [step.T @ g if s == side else g for s, g in enumerate(pair.voice.gain)]


def touches_of(scene: Instrument, b: int, k: int) -> list[Touch]:
    """Tracked points of all of a body's pairs, each with its spring."""
    found = []
    for key, pair in scene.pairs.items():
        if b not in key or not pair.patch.point:
            continue
        patch, side = pair.patch, key.index(b)
        both = [scene.bodies[p] for p in key]
        if all(one.material is None for one in both):
            continue  # both rigid: their materials are unknown
        turns = [rotation(scene.turn[k, p]) for p in key]
        normal = turns[0] @ patch.outward[0]
        x, y, z = normal
        first = np.array([0.0, z, -y] if abs(x) < 0.6 else [-z, 0.0, x])
        first /= np.linalg.norm(first)
        world = np.array([normal, first, np.cross(normal, first)])
        moves: list[list[Array]] = [[], []]
        curvature, far = np.zeros(len(patch.point)), 0.0
        for s, one in enumerate(both):
            axes = world @ turns[s]
            bent = one.body.curvature_per_m
            for i, point in enumerate(patch.point):
                shape = np.zeros((3, len(one.omega)))
                if len(one.face):
                    face, weights, _ = nearest_face(one, point[s], patch.outward[s])
                    shape = np.einsum("k,kxm->xm", weights, one.shape[one.face[face]])
                    curvature[i] += bent if np.isfinite(bent) else face_curvature(one, face, patch.outward[s])
                elif np.isfinite(bent):
                    curvature[i] += bent
                moves[s].append(axes @ np.concatenate([shape, rigid_motions(one, point[s])], axis=1))
            if len(one.face):
                middle = np.mean([point[s] for point in patch.point], axis=0)
                far = max(far, nearest_face(one, middle, patch.outward[s])[2])
        springs = contact_springs(scene, key, patch, curvature, far)
        for i, (normal_n_m, tangential_n_m) in enumerate(springs):
            found.append(
                Touch(key[1 - side], moves[side][i], moves[1 - side][i], normal_n_m, tangential_n_m, patch.load[i])
            )
    return found


def rigid_motions(one: Sounding, point: Array) -> Array:
    """Motion (3, 6) at a point of six rigid motions, mass-normalised as modes are: 1/√m, (r ×) J^{-1/2}."""
    if one.mass_kg <= 0:
        return np.zeros((3, 6))
    value, vector = np.linalg.eigh(one.body.inertia_kg_m2)
    root = vector / np.sqrt(np.maximum(value, max(1e-12 * value.max(), 1e-300)))
    lever = np.cross(root.T, point).T  # J^{-1/2} × r
    return np.concatenate([np.eye(3) / np.sqrt(one.mass_kg), lever], axis=1)


def contact_springs(
    scene: Instrument, key: tuple[int, int], patch: Patch, curvature: Array, far: float
) -> list[tuple[complex, complex]]:
    """Springs (normal, tangential) of a pair's points: of one region where all between them touches, else each its own.

    Between points that spread by more than 2 % of the size, whose middle is within 2 % of that of both surfaces, lies a
    line (curved) or a face; else each point is a region: a flat of 2 % of the size, or a curved one.
    """
    both, size = [scene.bodies[b] for b in key], pair_size_m(scene, key)
    slips = any(one.body.dynamics.get("lateralFriction") == 0 for one in both)  # μ is a product; nothing holds sideways
    middle = np.array([point[0] for point in patch.point])
    middle = middle - middle.mean(axis=0)
    spread = np.linalg.norm(np.ptp(middle, axis=0))
    if spread >= 0.02 * size and far <= 0.02 * spread:
        half, bent = np.abs(middle @ np.linalg.svd(middle)[2].T).max(axis=0), float(curvature.mean())
        narrow = 0.0 if bent * size > 0.1 else max(half[1], 0.1 * half[0])
        whole = sum(patch.load)
        spring = contact_spring(both, (half[0], narrow), 2 * bent, whole, slips)
        return [(spring[0] * load / whole, spring[1] * load / whole) for load in patch.load]
    return [
        contact_spring(both, (0.02 * size,) * 2 if bent * size <= 0.1 else (0.0, 0.0), bent, load, slips)
        for load, bent in zip(patch.load, curvature, strict=True)
    ]


def contact_spring(
    both: list[Sounding], half_m: tuple[float, float], curvature: float, load: float, slips: bool
) -> tuple[complex, complex]:
    """K of a region under a load, normal and tangential, complex.

    1/K = (1/K_c + 1/K_r)/(1 + jη);  K_c = π E* a/𝐊(e), e² = 1 - (b/a)²   flat ellipse [Green & Sneddon 1950]
    point: a = b = (3N/4E*κ)^{1/3}; line: b = √(4N/πE*Lκ) [Johnson 1985, eq. 4.28, 4.43]; a rectangle as the ellipse of
    its area.  K_r = N/u₀, u₀ = half the rms roughness [Persson 2007];  η by each one's part of the compliance
    K_t/K = 2(1 - ν)/(2 - ν) [Mindlin 1949]; without friction 1e-9
    """
    known = [one.material for one in both if one.material is not None]
    part = np.array([(1 - one.poisson**2) / softest_pa(one) for one in known])  # (1 - ν²)/E across the grain
    rayleigh = [(one.alpha_per_s, one.beta_s) for one in known]
    loss = part @ [0.0 if None in one else 2 * np.sqrt(one[0] * one[1]) for one in rayleigh] / part.sum()
    poisson = part @ [one.poisson for one in known] / part.sum()
    modulus, square = 1 / part.sum(), 2 / np.sqrt(np.pi)
    a, b = half_m
    if a == 0:
        a = b = (3 * load / (4 * modulus * curvature)) ** (1 / 3)
    else:
        b = np.sqrt(2 * load / (np.pi * modulus * a * curvature)) if b == 0 else b
        a, b = square * max(a, b), square * min(a, b)
    smooth = np.pi * a * modulus / ellipkm1((b / a) ** 2)
    layer_m = 0.5 * np.hypot(both[0].roughness_m, both[1].roughness_m)
    normal = (1 + 1j * loss) / (1 / smooth + layer_m / load)
    return normal, normal * (1e-9 if slips else 2 * (1 - poisson) / (2 - poisson))


@dataclass
class Touch:
    """A point at which a body touches a partner: motion of each mode and rigid motion of both along (n, t₁, t₂)."""

    partner: int
    own: Array  # (3, m + 6)
    other: Array
    normal_n_m: complex
    tangential_n_m: complex
    load: float


@dataclass
class Coupled:
    """Poles of a body in contact; turn (m, m) of its pairs; motion (m, m): free modes in each new one, by columns;
    moved: of each partner (m_p, m) the velocity of its modes per velocity of each motion.
    """

    omega: Array
    decay: Array
    turn: Array
    motion: Array
    moved: list[Array]


def coupled_modes(  # noqa: PLR0915 - equations one after another
    one: Sounding, others: list[Sounding], partners: list[int], touches: list[Touch], before: Array | None
) -> Coupled:
    """Poles of a body on springs whose other ends its partners move: springs exactly, losses and partners in one step.

    (Λ + Bᵀ Re(K) B) q = ω² q,  B = (Φ, -Φ_r)      the body's modes and rigid motions, partners' rigid motions
    F_n = Re(K) B q_n,  s = jω_k                    forces at the springs
    g = Y F_k,  Y = 1/K - 1/Re K + Σ_j φ_j φ_jᵀ/(λ_j + 2 d_j s + s²)      what yields beside the springs
    x = F_kᵀg,  ρ = gᵀRg/x,  R = Re K - Σ_{n≠k} F_n F_nᵀ/(ω_n² - ω_k²)    what all other motions hold against it
    δ = x/(1 + ρ),  ε = dδ/ds²;   s² + 2 s qᵀDq + ω² - 2δ/(1 + √(1 - 4ε)) = 0
    Chains are not claimed: partners are as they are free.
    """
    m = len(one.omega)
    k = np.array([value for t in touches for value in (t.normal_n_m, t.tangential_n_m, t.tangential_n_m)])
    own = np.concatenate([t.own for t in touches])
    other = [np.zeros((len(k), len(p.omega) + 6)) for p in others]
    for i, touch in enumerate(touches):
        other[partners.index(touch.partner)][3 * i : 3 * i + 3] = touch.other
    shapes = np.concatenate([phi[:, :-6] for phi in other], axis=1)
    rigid = np.concatenate([phi[:, -6:] for phi in other], axis=1)
    both = np.concatenate([own, -rigid[:, rigid.any(axis=0)]], axis=1)
    lam = np.zeros(both.shape[1])
    lam[:m] = one.omega**2 + one.decay**2
    value, vector = np.linalg.eigh(np.diag(lam) + both.T @ (k.real[:, None] * both))
    force = k.real[:, None] * (both @ vector)
    pairs = alike_pairs(one.omega)
    share = vector[:m] ** 2  # each mode takes the pole of the motion that most resembles it, a pair of both
    share[pairs] = share[pairs + 1] = 0.5 * (share[pairs] + share[pairs + 1])
    chosen = linear_sum_assignment(share, maximize=True)[1]
    turn = np.eye(m)
    for i in pairs:
        old = np.eye(2) if before is None else before[i : i + 2, i : i + 2]
        left, _, right = np.linalg.svd(vector[i : i + 2, chosen[i : i + 2]])
        made = left @ right  # the nearest orthogonal matrix [Schönemann 1966], as it resembles the turn before
        alike = np.abs(old.T @ made)
        if alike[0, 1] + alike[1, 0] > alike[0, 0] + alike[1, 1]:
            made, chosen[i : i + 2] = made[:, ::-1], chosen[i : i + 2][::-1].copy()
        turn[i : i + 2, i : i + 2] = made * np.where(np.diag(old.T @ made) < 0, -1, 1)
    motion = turn.T @ vector[:m, chosen]
    square = np.maximum(value[chosen], 0.0)
    other_lam = np.concatenate([p.omega**2 + p.decay**2 for p in others])
    other_decay = np.concatenate([p.decay for p in others])
    omega, decay, moved = np.zeros(m), np.zeros(m), np.zeros((len(other_lam), m), complex)
    for n in range(m):
        w, f = np.sqrt(square[n]), force[:, chosen[n]]
        yields = 1 / (other_lam - square[n] + 2j * other_decay * w)
        along = yields * (shapes.T @ f)
        g = (1 / k - 1 / k.real) * f + shapes @ along
        x, apart, mutual = f @ g, value - value[chosen[n]], force.T @ g
        bound = apart**2 + np.abs(mutual) ** 2  # two of nearly one frequency would each need the other's
        held = g @ (k.real * g) - (mutual**2 * apart / np.where(bound > 0, bound, 1)).sum()
        part = 1 / (1 + held / (x if abs(x) > 0 else 1.0))
        slope = -(part**2) * (along**2).sum()
        off = part * x * 2 / (1 + np.sqrt(1 - 4 * slope))
        off = off.real if off.imag > 0 else off  # no mode gains
        damped = motion[:, n] ** 2 @ one.decay
        s = -damped + 1j * np.sqrt(complex(square[n] - off - damped**2))
        moves = w <= 2 * np.sqrt(lam[:m].max()) and -s.real <= 0.99 * abs(s) and s.imag > 0
        if moves:
            each = along * part / (1 + off * part * yields)
            moved[:, n] = each / (1 + (np.abs(each) ** 2).sum())  # at most ½: of two that meet, each has half of both
        else:  # a touch stops it
            s = np.sqrt(lam[n]) * complex(-0.99, np.sqrt(1 - 0.99**2))
        omega[n], decay[n] = s.imag, max(-s.real, 0.0)
    ends = np.cumsum([len(p.omega) for p in others])[:-1]
    return Coupled(omega, decay, turn, motion, np.split(moved, ends))


def playable(s: Array, free: Array) -> Array:
    """Poles a sample that can be played: a mode that contacts stop, or make too fast, is gone within a block."""
    stopped = np.minimum(free.real, -0.05) + 1j * np.minimum(free.imag, 3.0)
    wrong = ~np.isfinite(s) | (s.imag > 3.0) | (s.imag <= 1e-6) | (-s.real > s.imag)
    return np.where(wrong, stopped, np.minimum(s.real, 0.0) + 1j * s.imag)


@dataclass
class Passed:
    """What a body's modes move of a partner: the partner's sound gains Re(weight z), fading over a block."""

    to: int
    weight: Array
    phase: str  # coming, rising, steady, leaving, falling, brief (rises, then falls), off

    def move_on(self) -> None:
        after = {"coming": "rising", "rising": "steady", "leaving": "falling", "brief": "falling", "falling": "off"}
        self.phase = after.get(self.phase, self.phase)

    def leave(self) -> None:
        after = {"steady": "leaving", "coming": "off", "rising": "brief"}
        self.phase = after.get(self.phase, self.phase)

    def ramp(self, x: float) -> float:
        return {"coming": 0.0, "off": 0.0, "rising": x, "brief": x, "falling": 1 - x}.get(self.phase, 1.0)


# ---- 6. What rings ---------------------------------------------------------------------------------------------------


class Sounding:
    """A body as it sounds: audible modes, their pressure at 1 m, its surface, its elastic constants, its click."""

    def __init__(self, body: Body, log: ContactLog, radiation: Radiation) -> None:
        self.body, self.mass_kg, self.material = body, body.mass_kg, body.material
        self.size_m = max(body.volume_m3, 1e-9) ** (1 / 3)
        who = [log.seed & 0xFFFFFFFF, body.body_id & 0xFFFFFFFF, (body.link + 1) & 0xFFFFFFFF, body.epoch]
        self.seed = int(np.random.SeedSequence(who).generate_state(1)[0])
        self.modulus_pa, self.roughness_m, self.hurst, self.restitution = np.inf, 0.0, 0.7, np.inf
        if self.material is not None:
            if self.material.octave_rms_m is not None or self.material.form is not None:
                raise NotOnThisPage(f"{body.name} has a stated surface")
            soft_pa = softest_pa(self.material) / (1 - self.material.poisson**2)  # boards are pressed across the grain
            usual_pa = self.material.plane_strain_pa
            self.modulus_pa = soft_pa if soft_pa < 0.99 * usual_pa else usual_pa
            self.roughness_m, self.hurst = self.material.roughness_m, self.material.hurst
            self.restitution = self.material.restitution
        self._take_modes(body.model, log, radiation)
        self._take_click(log)
        # what strikes have done to it so far, see `is_recreated` and `spread`
        self.cause_m_s, self.cause_step, self.since_m_s, self.since_step = 0.0, -(1 << 40), 0.0, -(1 << 40)
        self.undated = 0

    def _take_modes(self, model: ModalModel | None, log: ContactLog, radiation: Radiation) -> None:
        """ω² + d² = λ;  d = own + what it radiates + ηω₀/2 of its mounting [Cremer et al. 2005, eq. 3.6]."""
        none = np.zeros(0)
        self.omega, self.decay, self.weight = none, none, none.astype(complex)
        self.corner, self.face, self.shape, self.radius_m = np.zeros((0, 3, 3)), none, np.zeros((0, 3, 0)), 0.0
        if model is None:
            return
        if model.bend_s2_m2 is not None or model.damping_growth_s_m is not None:
            raise NotOnThisPage(f"{self.body.name} has poles that depend on the level")
        pressure, radiated = radiation(model) if model.mode_count else (none, none)
        lam, share = model.omega0_squared_per_s2, radiating_share(self.body.mounting)
        decay = np.nan_to_num(model.decay_per_s) + (0.0 if model.includes_radiation else share * radiated)
        decay = decay + loss_factor(self.body.mounting) / 2 * np.sqrt(lam)
        omega = np.sqrt(np.maximum(lam - decay**2, 0.0))
        keep = (omega < np.pi * log.sr) & (omega > 1e-3 * decay) & (decay < 2 * log.sr)
        self.omega, self.decay, self.shape = omega[keep], decay[keep], model.shape[:, :, keep].astype(float)
        pressure = np.sqrt(share) * pressure[keep]
        solved = np.ones(len(pressure), bool) if model.stands_for is None else model.stands_for[keep] <= 1
        self.weight = self.body.sounding_gain * in_quadrature(self.omega, pressure, self.shape, model.vertex_m, solved)
        self.face, self.corner = model.face, model.vertex_m[model.face]
        self.face_curvature_per_m = model.curvature_per_m
        self.radius_m = float(np.linalg.norm(model.vertex_m, axis=1).max(initial=0.0))
        if not len(self.face):
            return
        twice = np.cross(self.corner[:, 1] - self.corner[:, 0], self.corner[:, 2] - self.corner[:, 0])
        double_m2 = np.linalg.norm(twice, axis=1)
        self.normal = twice / np.where(double_m2 > 0, double_m2, 1)[:, None]
        diagonal = float(np.linalg.norm(np.ptp(self.corner.reshape(-1, 3), axis=0)))
        six = (
            (self.corner[:, 0] - self.corner[0, 0]) * np.cross(*(self.corner[:, 1:] - self.corner[0, 0]).swapaxes(0, 1))
        ).sum()
        self.wall_m = min(4 * abs(six) / 6 / max(double_m2.sum(), 1e-300), 0.03 * diagonal)  # twice 2V/A
        self.tie_m = 1e-7 * diagonal

    def _take_click(self, log: ContactLog) -> None:
        """A sphere whose velocity jumps by U: p = ρ₀c U (a/r) cosθ e^{-wt}(cos wt - sin wt), w = c/a [Kirchhoff 1876].

        That is a mode of decay and frequency w for each axis. Its coefficient is the compact law's, 2Kw²/m with
        K = 3ρ₀V/8πc [Chadwick, Zheng, James 2012, eq. 9]; w is at most 0.6 of half the rate.
        """
        air, volume = log.air, self.body.volume_m3
        self.clicks = self.mass_kg > 0 and volume > 0 and self.material is not None
        if self.clicks:
            w = min(air.sound_speed_m_s / (3 * volume / (4 * np.pi)) ** (1 / 3), 0.6 * np.pi * log.sr)
            jerk = 3 * air.density_kg_m3 * volume / (8 * np.pi * air.sound_speed_m_s)
            self.click_s = complex(-w, w) / log.sr  # a sample
            self.click_weight = self.body.sounding_gain * 2 * jerk * w**2 / self.mass_kg

    @property
    def sounds(self) -> bool:
        return len(self.omega) > 0 or self.clicks


def softest_pa(material: object) -> float:
    """E along the softest axis of a stiffness tensor."""
    return float(1 / np.diag(np.linalg.inv(material.stiffness_pa))[:3].max())


def alike_pairs(omega: Array) -> Array:
    """Find neighbouring modes within 1 % of one another, by the first of each; the nearest pair up first."""
    apart, found = np.abs(np.diff(omega)) / omega[1:], set()
    for k in np.argsort(apart, kind="stable").tolist():
        if apart[k] < 0.01 and not found & {k - 1, k + 1}:
            found.add(k)
    return np.array(sorted(found), int)


def in_quadrature(omega: Array, pressure: Array, shape: Array, vertex_m: Array, solved: Array) -> Array:
    """Give both modes of a round body's pair weights a quarter of a turn apart: over all directions they do not
    interfere.

    w₁ = |w₁| u e^{-jψ}, w₂ = j |w₂| u e^{-jψ},  e^{jψ} ∝ c₁ + j c₂,  c = ∫ g a·φ, g a spot about the direction a.
    """
    pairs = alike_pairs(omega)
    one, other = np.abs(pressure[pairs]), np.abs(pressure[pairs + 1])
    round_ = (np.diff(omega)[pairs] < 1e-3 * omega[pairs]) & (np.abs(other - one) < 0.1 * np.maximum(one, other))
    pairs = pairs[round_ & solved[pairs] & solved[pairs + 1]]
    if not len(pairs):
        return pressure
    axis = np.array([0.8, 0.6, 0.4]) / np.linalg.norm([0.8, 0.6, 0.4])
    cosine = vertex_m @ axis / np.maximum(np.linalg.norm(vertex_m, axis=1), 1e-300)
    spot, turned = np.exp(40.0 * (cosine - cosine.max())), pressure.copy()
    for k in pairs:
        c1, c2 = spot @ (axis @ shape[:, :, k : k + 2]).reshape(len(spot), 2)
        shared = np.sqrt(pressure[k] ** 2 + pressure[k + 1] ** 2)
        phase = shared * (-1 if shared.real < 0 else 1) * (c1 - 1j * c2)
        unit = phase / abs(phase) if abs(phase) > 0 else 1
        turned[k], turned[k + 1] = abs(pressure[k]) * unit, 1j * abs(pressure[k + 1]) * unit
    return turned


@dataclass
class Pulse:
    """A strike under way on one body: hits (q, m) of samples first, first + 1, …, and (q', 3) on its click."""

    first: int
    hits: Array
    click_first: int
    click: Array

    @property
    def last(self) -> int:
        return max(self.first + len(self.hits), self.click_first + len(self.click)) - 1


class Modes:
    """State of a body's modes and of its click.

    q̈ + 2d q̇ + (ω² + d²) q = Uᵀf   [Meirovitch 2001, eq. 7.113];  s = -d + iω,  q̇ = Re z:
        an impulse j at u adds (1 + i d/ω) Uᵀj e^{s(n - u)};   pressure at 1 m: Σ Re(w z)
    ½|z|² is a mode's energy whatever its pole: z goes on as it is where poles change, so no change adds any.
    """

    def __init__(self, one: Sounding, sr: int) -> None:
        self.one, self.sr = one, sr
        self.free = (-one.decay + 1j * one.omega) / sr  # s of a sample
        self.s, self.quadrature = self.free, one.decay / one.omega
        self.weight = one.weight
        self.turn: Array | None = None  # of pairs of modes at a contact, see Supports
        self.coming: Array | None = None  # poles from the next block on
        self.passed: list[Passed] = []
        self.silence()

    def silence(self) -> None:
        self.z, self.driven = np.zeros((2, len(self.free)), complex)  # rung since the block's start, driven since then
        self.click, self.late = np.zeros(3, complex), None
        self.pulses: list[Pulse] = []
        self.passed = [one for one in self.passed if one.phase in ("steady", "coming", "rising")]  # contacts stay
        for one in self.passed:
            one.phase = "steady"

    @property
    def active(self) -> bool:
        return bool(self.z.any() or self.driven.any()) or len(self.pulses) > 0

    @property
    def whole(self) -> Array:
        """All that moves, in the modes as they are now turned."""
        return self.driven + (self.z if self.late is None else self.late.T @ self.z)

    def turned(self, modal: Array) -> Array:
        return modal if self.turn is None else self.turn.T @ modal

    def enter(self, start: float, strike: Strike, gain: Array, impulse: Array) -> None:
        """Enter a strike's pulse, from sample ``start`` on. It keeps the poles with which it begins.

        Stated: the pulse acts at the middles of cells that divide each sample into whole, 24 a pulse and 2 a sample at
        least, each with the force there; their sum is the impulse. At a sample all has acted that is over, no more, so
        a slow pulse moves a fast mode by its slope alone. The click's cells: evenly, by Q, 4 to its 1/w at least.
        """
        length = strike.length_s * self.sr
        hits, first = np.zeros((0, len(gain)), complex), 0
        if np.abs(gain).max(initial=0.0) >= 1e-30:
            whole = max(2, int(np.ceil(NODES / length)))
            begin, end = int(np.floor(start * whole)), int(np.ceil((start + length) * whole))
            u = (np.arange(begin, end) + 0.5) / whole
            force = pulse_force((u - start) / length, strike.flat)
            n = np.maximum(np.ceil(u), np.ceil(u[0])).astype(int)
            first, hits = n[0], np.zeros((n[-1] - n[0] + 1, len(gain)), complex)
            each = (force / force.sum())[:, None] * np.exp(self.s * (n - u)[:, None])
            np.add.at(hits, n - first, (1 + 1j * self.quadrature) * gain * each)
        click, click_first = np.zeros((0, 3), complex), 0
        if self.one.clicks and impulse.any():
            s = self.one.click_s
            cells = max(int(np.ceil(4 * -s.real)), int(np.ceil(min(NODES / length, 4096))))
            n = np.arange(
                int(np.floor(start * cells)) // cells + 1, (int(np.ceil((start + length) * cells)) - 1) // cells + 2
            )
            edge = n[:, None] - 1 + np.arange(cells + 1) / cells
            part = np.diff(cumulated_force((edge - start) / length, strike.flat), axis=1)
            onset = (1 + 1j * (-s.real / s.imag)) * np.expm1(s / cells) / (s / cells)
            click_first, response = n[0], onset * (part @ np.exp(s / cells * np.arange(cells - 1, -1, -1)))
            click = response[:, None] * impulse
        if len(hits) or len(click):
            self.pulses.append(Pulse(first, hits, click_first, click))

    def advance(self, first: int, stop: int, drive: Array, push: Array, source: Array, dipole: Array, b: int) -> None:
        """Play samples first … stop - 1. drive (n, m), push (n, 3): impulses of forces on modes and click."""
        begins = any(len(one.hits) and one.first < stop for one in self.pulses)
        if len(self.z) and (self.z.any() or self.driven.any() or drive.any() or begins):
            total = drive * (1 + 1j * self.quadrature)
            for one in self.pulses:
                add_part(total, first, one.hits, one.first)
            for n in range(first, stop):
                self.z, self.driven = self.z * np.exp(self.s), self.driven * np.exp(self.s)
                if n % BLOCK == 0:
                    quadrature = self.quadrature
                    self.open_block()
                    if self.quadrature is not quadrature:  # forces act on the new poles
                        total[n - first :] += 1j * (self.quadrature - quadrature) * drive[n - first :]
                self.driven = self.driven + total[n - first]
                source[b, n] += (self.weight * self.whole).real.sum()
                for one in self.passed:
                    source[one.to, n] += one.ramp((n % BLOCK) / BLOCK) * (one.weight * self.whole).real.sum()
        if self.one.clicks:
            s = self.one.click_s
            total = push * ((1 + 1j * (-s.real / s.imag)) * np.expm1(s) / s)  # evenly over the sample before
            for one in self.pulses:
                add_part(total, first, one.click, one.click_first)
            if self.click.any() or total.any():
                for n in range(stop - first):
                    self.click = self.click * np.exp(s) + total[n]
                    dipole[:, n] = self.one.click_weight * self.click.real
        self.pulses = [one for one in self.pulses if one.last >= stop]

    def take_poles(self) -> None:
        """Take the poles that were to come."""
        if self.coming is not None:
            self.s, self.coming = self.coming, None
            self.quadrature = np.where(self.s == self.free, self.one.decay / self.one.omega, -self.s.real / self.s.imag)

    def open_block(self) -> None:
        """At each multiple of 256 samples: what is silent is zero, new poles begin, transmissions fade in and out."""
        self.z, self.driven, self.late = self.whole, np.zeros(len(self.z), complex), None
        self.z[np.abs(self.z) < 1e-15] = 0.0
        self.take_poles()
        for one in self.passed:
            one.move_on()
        self.passed = [one for one in self.passed if one.phase != "off"]


def add_part(total: Array, first: int, values: Array, at: int) -> None:
    """Add to total, which begins at sample first, what of values, which begin at sample at, lies in it."""
    begin, end = max(first, at), min(first + len(total), at + len(values))
    if end > begin:
        total[begin - first : end - first] += values[begin - at : end - at]


# ---- 7. From bodies to microphones -----------------------------------------------------------------------------------


def hear(scene: Instrument) -> Array:
    """p(t) = Σ_b (s_b + n̂·j_b)(t_e)/r,  t_e + r(t_e)/c = t    [Pierce 1989, sec. 4-3; Chadwick et al. 2012, eq. 9].

    n̂, r: from the body to the microphone as the sound leaves, places linear within a step; r at least the body's
    radius, the travel time at least 12 samples. A body that is teleported in a step fades from one place to the other.
    """
    total = scene.sample[scene.count]
    out = np.zeros((len(scene.log.sensors), total))
    for c, microphone in enumerate(scene.log.sensors):
        for b, one in enumerate(scene.bodies):
            if not scene.source[b].any() and not scene.dipole[b].any():
                continue
            target = aim(scene, microphone, b)
            for where, envelope in stays(scene, b):
                away = np.concatenate([
                    (1 - x)[:, None] * (target[k] - where[k, 0]) + x[:, None] * (target[k + 1] - where[k, 1])
                    for k in range(scene.count) for x in [scene.along(k)]
                ])  # fmt: skip
                r = np.linalg.norm(away, axis=1)
                spread = 1 / np.maximum(np.maximum(r, one.radius_m), 1e-12)
                sent = (scene.source[b] + (away * scene.dipole[b].T).sum(1) / np.maximum(r, 1e-12)) * spread
                delay = np.maximum(r * scene.sr / scene.log.air.sound_speed_m_s, TAPS / 2)
                edges = sorted({0, total, *(scene.sample[q] for q in scene.quenches if q < scene.count)})
                for begin, end in pairwise(edges):  # a quench stops what travels, too
                    out[c, begin:end] += arrive((sent * envelope)[begin:end], delay[begin:end])
    return out


def stays(scene: Instrument, b: int) -> list[tuple[Array, Array]]:
    """Each place between a body's teleports: where (k, 2, 3) it is at both ends of each step, and its envelope (n,)."""
    count, position = scene.count, scene.position[:, b]
    moved = [k for k in range(count) if scene.teleported[k + 1, b]]
    found = []
    for i in range(len(moved) + 1):
        where = np.stack([position[:count], position[1 : count + 1]], axis=1)
        envelope = np.ones(scene.sample[count])
        if i > 0:
            came = moved[i - 1]
            envelope[: scene.sample[came]] = 0.0
            envelope[scene.sample[came] : scene.sample[came + 1]] = scene.along(came)
            where[: came + 1] = position[came + 1]
        if i < len(moved):
            left = moved[i]
            envelope[scene.sample[left] : scene.sample[left + 1]] *= 1 - scene.along(left)
            envelope[scene.sample[left + 1] :] = 0.0
            where[left:] = position[left]
        found.append((where, envelope))
    return found


def arrive(sent: Array, delay: Array) -> Array:
    """What is heard of a line at each sample: a(u) with u + D(u) = n, D linear between samples.

    Stated: a line of which all has arrived has, before the next sample it sends, that sample's delay. Only the taps'
    12 samples before an onset hang on it.
    """
    before, delay = 2 * TAPS + int(delay[0]), delay.copy()
    sends = np.flatnonzero(np.abs(sent) >= 1e-30)
    for last, first in pairwise([-before, *sends]):
        if first - last > delay[first] + TAPS / 2:
            delay[max(first - 3 * TAPS // 2, 0) : first] = delay[first]
    m = np.arange(-before, len(sent))
    arrival = m + np.concatenate([np.full(before, delay[0]), delay])
    arrival = np.maximum.accumulate(arrival - m / 16) + m / 16  # faster than sound: no sound overtakes another
    u = np.interp(np.arange(len(sent)), arrival, m)
    floor = np.floor(u).astype(int)
    padded = np.concatenate([np.zeros(before + TAPS), sent, np.zeros(TAPS)])
    index = floor[:, None] + np.arange(TAPS) - (TAPS // 2 - 1) + before + TAPS
    return (padded[index] * arrival_taps(u - floor)).sum(axis=1)


def arrival_taps(fraction: Array) -> Array:
    """Weights (n, 24) of samples m - 11 … m + 12 at m + fraction: a Kaiser-windowed sinc, β = 9.5, sum 1
    [Laakso et al. 1996, sec. 3.2].
    """
    away = np.arange(TAPS) - (TAPS // 2 - 1) - fraction[:, None]
    taps = np.sinc(away) * np.i0(9.5 * np.sqrt(np.maximum(0, 1 - (away / (TAPS // 2)) ** 2)))
    return taps / taps.sum(axis=1, keepdims=True)


def aim(scene: Instrument, microphone: Microphone, b: int) -> Array:
    """Where (t, 3) a microphone will be when it hears what body b sends at each step's start: |M* - x| = cD.

    By a fixed point, each round of which leaves |v|/c of the error. A body's later poses are not known: its microphone
    flies on as the step begins.
    """
    place, velocity = microphone_places(scene, microphone)
    found, time = place.copy(), np.array(scene.time_s[: len(place)])
    for _ in range(8 if microphone.moves else 0):
        late = np.linalg.norm(found - scene.position[:, b], axis=1) / scene.log.air.sound_speed_m_s
        if microphone.path is not None:
            path = microphone.path
            for axis in range(3):
                found[:, axis] = np.interp(time + late, path.time_s, path.position_m[:, axis])
        else:
            found = place + velocity * late[:, None]
    return found


def microphone_places(scene: Instrument, microphone: Microphone) -> tuple[Array, Array]:
    """Place and velocity of a microphone at each step's start (t, 3)."""
    time = np.array(scene.time_s[: len(scene.dt_s)])
    if microphone.path is not None:
        path = microphone.path
        place = np.stack([np.interp(time, path.time_s, path.position_m[:, axis]) for axis in range(3)], axis=1)
    elif microphone.body_id is not None:
        lead = next(
            b for b, one in enumerate(scene.log.bodies)
            if (one.body_id, one.link) == (microphone.body_id, microphone.link)
        )  # fmt: skip
        turns = np.array([rotation(q) @ microphone.position_m for q in scene.turn[:, lead]])
        place = scene.position[:, lead] + turns
    else:
        place = np.broadcast_to(microphone.position_m, (len(time), 3))
    velocity = np.diff(place, axis=0) / np.diff(time)[:, None]
    return place, np.concatenate([velocity, velocity[-1:]])
