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

Left out, and refused where a log needs it: bodies that come or go, quenches, modes of nearly one frequency where bodies
are round or supported, poles that depend on the level, stated spectra and tracks of surfaces, ears, images, joints.
Left out silently: residuals, for they are random.

Symbols as in docs/glossary.md. Sides are 0, the pair's lower body, and 1, the higher. k, t: steps; n: samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cache
from itertools import accumulate, chain, pairwise

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv, ellipkm1, gamma

from sonic_bullet.files import ContactLog
from sonic_bullet.records import Array, Body, Material, Microphone, ModalModel, TouchedSurface
from sonic_bullet.records.mounting import loss_factor, radiating_share
from sonic_bullet.records.roughness import ORDINARY_HURST, ORDINARY_ROUGHNESS_M

Radiation = Callable[[ModalModel], tuple[Array, Array]]
"""Of a model: pressure weights w (m,) complex, in Pa·m per modal velocity, and radiation damping Δd (m,) in 1/s.

p(r̂) = (iωρ₀/4π) ∮ [v + ik (r̂·n) ψ] e^{ik r̂·x} dS at 1 m, v = φ·n, surface pressure iωρ₀ψ   [Pierce 1989, eq. 4-6.4]
|w| = √<|p|²>,  Δd = 2π <|p|²>/ρ₀c,  means over all directions; the phase is that of the loud ones
"""

SPAN = 4  # steps that a load must last to be support; one strike takes at most SPAN - 1
KNOWN = SPAN - 1  # steps after the one that sounds that are known by then
BLOCK = 256  # samples, on the grid of absolute time, at whose start poles change
NODES = 24  # least number of parts of a pulse
TAPS = 24  # of the interpolation of arrivals
WAVE_M = 0.1 / 2.0 ** np.arange(14)  # wavelengths of a surface's octaves
SIGN = np.array([1.0, -1.0])  # of a pair's force on its sides


class NotOnThisPage(ValueError):
    """A log needs what the page leaves out."""


# ---- 0. What is given: bodies, steps, and what is made of them -------------------------------------------------------


class Sounding:
    """A body as it sounds: audible modes, their pressure at 1 m, its surface, its elastic constants."""

    def __init__(self, body: Body, log: ContactLog, radiation: Radiation) -> None:
        self.body, self.mass_kg, self.material = body, body.mass_kg, body.material
        self.size_m = max(body.volume_m3, 1e-9) ** (1 / 3)
        epoch = body.epoch if self.material is not None else 0
        who = [log.seed & 0xFFFFFFFF, body.body_id & 0xFFFFFFFF, (body.link + 1) & 0xFFFFFFFF, epoch]
        self.seed = int(np.random.SeedSequence(who).generate_state(1)[0])
        self.modulus_pa, self.restitution = np.inf, np.inf
        self.roughness_m, self.hurst = (ORDINARY_ROUGHNESS_M if self.mass_kg == 0 else 0.0), ORDINARY_HURST
        if self.material is not None:
            if self.material.octave_rms_m is not None or self.material.form is not None:
                raise NotOnThisPage(f"{body.name} has a stated surface")
            soft_pa = softest_pa(self.material) / (1 - self.material.poisson**2)  # boards are pressed across the grain
            usual_pa = self.material.plane_strain_pa
            self.modulus_pa = soft_pa if soft_pa < 0.99 * usual_pa else usual_pa
            self.roughness_m, self.hurst = self.material.roughness_m, self.material.hurst
            self.restitution = self.material.restitution
        self.clicks = self.mass_kg > 0 and body.volume_m3 > 0 and self.material is not None
        self.take_modes(log, radiation)
        self.sounds = len(self.omega) > 0 or self.clicks
        self.cause = self.since = (0.0, -(1 << 40))  # speed and step of strikes so far, see `is_recreated`
        self.undated = 0  # strikes so far, see `date`

    def take_modes(self, log: ContactLog, radiation: Radiation) -> None:
        """ω² + d² = λ;  d = own + what it radiates + ηω₀/2 of its mounting [Cremer et al. 2005, eq. 3.6]."""
        self.omega, self.decay, self.weight = np.zeros(0), np.zeros(0), np.zeros(0, complex)
        self.face, self.radius_m, self.skin, self.touched = np.zeros((0, 3), int), 0.0, None, None
        model, share = self.body.model, radiating_share(self.body.mounting)
        if model is None:
            return
        if model.bend_s2_m2 is not None or model.damping_growth_s_m is not None:
            raise NotOnThisPage(f"{self.body.name} has poles that depend on the level")
        pressure, radiated = radiation(model) if model.mode_count else (self.weight, self.decay)
        decay = np.nan_to_num(model.decay_per_s) + (0.0 if model.includes_radiation else share * radiated)
        decay = decay + loss_factor(self.body.mounting) / 2 * np.sqrt(model.omega0_squared_per_s2)
        omega = np.sqrt(np.maximum(model.omega0_squared_per_s2 - decay**2, 0.0))
        keep = (omega < np.pi * log.sr) & (omega > 1e-3 * decay) & (decay < 2 * log.sr)
        self.omega, self.decay, self.shape = omega[keep], decay[keep], model.shape[:, :, keep].astype(float)
        if (np.diff(self.omega) < 1e-3 * self.omega[1:]).any():
            raise NotOnThisPage(f"{self.body.name} has pairs of modes, as round bodies do")
        self.weight = self.body.sounding_gain * np.sqrt(share) * pressure[keep]
        self.face = model.face
        self.radius_m = float(np.linalg.norm(model.vertex_m, axis=1).max(initial=0.0))
        if len(self.face):
            self.skin = Skin(model)
        if model.touched is not None:
            self.touched = Skin(model.touched)


class Skin:
    """Triangles of a surface, their normals and curvatures."""

    def __init__(self, surface: ModalModel | TouchedSurface) -> None:
        self.corner, self.curvature_per_m = surface.vertex_m[surface.face], surface.curvature_per_m
        edge = self.corner[:, 1:] - self.corner[:, :1]
        cross = np.cross(edge[:, 0], edge[:, 1])
        double_m2 = np.linalg.norm(cross, axis=1)
        self.normal = cross / np.where(double_m2 > 0, double_m2, 1)[:, None]
        six_m3 = ((self.corner[:, 0] - self.corner[0, 0]) * cross).sum()
        diagonal = float(np.linalg.norm(np.ptp(self.corner.reshape(-1, 3), axis=0)))
        self.wall_m = min(4 * abs(six_m3) / 6 / max(double_m2.sum(), 1e-300), 0.03 * diagonal)  # twice 2V/A
        self.tie_m = 1e-7 * diagonal

    def nearest(self, point: Array, outward: Array) -> tuple[int, Array, float]:
        """Face nearest to a point on the side that looks along ``outward``, weights of its corners, distance."""
        weights, away = nearest_in_triangles(point, self.corner)
        looks, face = self.normal @ outward, int(np.argmin(away))
        facing = np.flatnonzero(looks > 1e-6)
        if len(facing):
            tied = facing[away[facing] <= away[facing].min() + self.tie_m]
            best = int(tied[np.argmax(looks[tied])])
            face = best if away[best] <= 2 * away[face] + self.wall_m else face
        return face, weights[face], float(away[face])


def softest_pa(material: Material) -> float:
    """E along the softest axis of a stiffness tensor."""
    return float(1 / np.diag(np.linalg.inv(material.stiffness_pa))[:3].max())


class Instrument:
    """Plays a log; keeps what passes along each arrow.

    strikes, frictions: lists of `Strike`, `Friction`; source (b, n): pressure of each body's modes at 1 m, dipole
    (b, 3, n): of its click along each axis, in Pa·m; pressure (c, n).
    """

    def __init__(self, log: ContactLog, radiation: Radiation) -> None:
        self.log, self.sr, self.count = log, log.sr, len(log.steps)
        steps = [*log.steps, *[log.steps[-1]] * KNOWN]  # after the last step bodies stay
        if any(type(one) is not Microphone or one.directivity for one in log.sensors) or log.image:
            raise NotOnThisPage("sensors other than plain microphones, or images")
        if any(len(one.motions) or len(one.body) < len(log.bodies) for one in steps):
            raise NotOnThisPage("joints, or bodies that come or go")
        if any(event.kind == "quench" for event in log.events):
            raise NotOnThisPage("quenches")
        self.bodies = [Sounding(body, log, radiation) for body in log.bodies]
        self.dt_s, self.gravity = [one.dt_s for one in steps], [one.gravity_m_s2 for one in steps]
        self.position = np.array([one.position_m for one in steps])
        turn = np.array([one.quaternion_xyzw for one in steps])
        self.turn = Rotation.from_quat(turn.reshape(-1, 4)).as_matrix().reshape(*turn.shape[:2], 3, 3)  # body to world
        self.teleported = np.array([one.teleported for one in steps])
        self.teleported[self.count :] = False
        # exact times: the step that was meant by 1/240, not its nearest double, so that an hour has no drift
        time = [Fraction(0), *accumulate(Fraction(dt).limit_denominator(1_000_000) for dt in self.dt_s)]
        self.time_s = np.array([float(one) for one in time])
        self.sample = [int(one * self.sr) for one in time]  # step t: samples sample[t] … sample[t + 1] - 1
        self.late = [float(one * self.sr - int(one * self.sr)) for one in time]
        contact = np.concatenate([one.contacts.row for one in log.steps])
        step = np.repeat(np.arange(self.count), [len(one.contacts) for one in log.steps])
        keys = np.sort(np.stack([contact["a"], contact["b"]], axis=1), axis=1)
        self.pairs = [Pair(self, key, contact[of], step[of])
                      for key in np.unique(keys, axis=0) for of in [(keys == key).all(axis=1)]]  # fmt: skip

    def along(self, k: int) -> Array:
        """Where each sample of step k lies between its ends, 0 … 1 (n, 1)."""
        n = np.arange(self.sample[k + 1] - self.sample[k])
        return np.clip((n - self.late[k]) / (self.dt_s[k] * self.sr), 0.0, 1.0)[:, None]

    def play(self) -> Array:
        """Play all of it; pressure (c, n) in Pa."""
        struck = [find_strikes(self, k, 0) + find_strikes(self, k + 1, 1) for k in range(self.count)]
        rubs = [friction_forces(self, k) for k in range(self.count)]
        self.strikes, self.frictions = list(chain(*struck)), list(chain(*rubs))
        self.source = np.zeros((len(self.bodies), self.sample[self.count]))
        self.modes = [Modes(self, b) for b in range(len(self.bodies))]
        self.supports = Supports(self)
        for k in range(self.count):
            if self.log.supports:
                self.supports.advance(k, struck[k], rubs[k])
            for modes in self.modes:
                modes.advance(k, struck[k], rubs[k])
        self.dipole = np.array([click(self, b) for b in range(len(self.bodies))])
        self.pressure = hear(self)
        return self.pressure


# ---- 1. Contact rows and loads ---------------------------------------------------------------------------------------


@dataclass
class Rows:
    """Contacts of one pair, turned onto its lower body; of both sides (n, 2, …), in body frames but for the arms."""

    step: Array
    load: Array  # N·s
    approach: Array
    gap: Array
    impulse: Array  # N·s on the lower body, world
    normal: Array  # towards the lower body, world
    sweep: Array
    point: Array
    arm: Array  # from the centres of mass, world
    outward: Array  # of the surfaces there
    modal: Array  # Uᵀj on the lower body's modes, then on the higher's
    curvature: Array  # of both together

    def __getitem__(self, index: Array) -> Rows:
        return Rows(*(getattr(self, one.name)[index] for one in fields(self)))

    def __len__(self) -> int:
        return len(self.load)


class Pair:
    """Two bodies that touch: their rows, their load F and what of it strikes have used (t,); friction; patch."""

    def __init__(self, scene: Instrument, key: Array, contact: Array, step: Array) -> None:
        self.key, self.both = (int(key[0]), int(key[1])), [scene.bodies[b] for b in key]
        self.omega = np.concatenate([one.omega for one in self.both])
        self.modes = [slice(0, len(self.both[0].omega)), slice(len(self.both[0].omega), None)]  # of either side
        with np.errstate(divide="ignore"):
            self.modulus_pa = float(1 / np.sum([1 / one.modulus_pa for one in self.both]))  # [Johnson 1985, eq. 4.24]
        self.size_m = min((one.size_m for one in self.both if one.body.volume_m3 > 0), default=0.1)
        self.rows = self.turned_rows(scene, contact, step)
        self.force = np.zeros(scene.count + 3 * SPAN)  # newtons; indices below 0 find the zeros at the end
        np.add.at(self.force, step, self.rows.load / np.array(scene.dt_s)[step])
        self.struck = np.zeros_like(self.force)
        self.voice: Voice | None = None
        self.patch = Patch()

    def turned_rows(self, scene: Instrument, contact: Array, step: Array) -> Rows:
        """Turn rows: the log's impulse acts on its body a, its normal points from b to a."""
        flip = contact["a"] != self.key[0]
        sign, turn = np.where(flip, -1.0, 1.0)[:, None], scene.turn[step][:, self.key]
        impulse, normal = sign * contact["impulse_n_s"], sign * contact["normal"]
        sweep, point = contact["sweep_m_s"].copy(), np.stack([contact["point_a_m"], contact["point_b_m"]], axis=1)
        sweep[flip], point[flip] = sweep[flip, ::-1], point[flip, ::-1]
        load = np.maximum((impulse * normal).sum(axis=1), 0.0)
        local = np.einsum("s,nsyx,ny->nsx", SIGN, turn, impulse)
        outward = np.einsum("s,nsyx,ny->nsx", -SIGN, turn, normal)
        arm = np.einsum("nsxy,nsy->nsx", turn, point)
        modal, curvature = np.zeros((len(step), len(self.omega))), np.zeros(len(step))
        for i in range(len(step)):
            for side, one in enumerate(self.both):
                shape, bent, _ = surface_at(one, point[i, side], outward[i, side])
                modal[i, self.modes[side]] = local[i, side] @ shape
                curvature[i] += bent
        state = contact["approach_m_s"], contact["gap_m"]
        return Rows(step, load, *state, impulse, normal, sweep, point, arm, outward, modal, curvature)

    def at(self, t: int) -> Rows:
        return self.rows[self.rows.step == t]

    def opening(self, t: int, known: int) -> float:
        """The part of the load that lasts SPAN steps [Serra 1982, ch. II]. Stated: windows end with what is known."""
        windows = [self.force[np.arange(a, min(a + SPAN, known + 1))] for a in range(t - SPAN + 1, t + 1)]
        return max(float(window.min()) for window in windows)


# ---- 2. Strikes ------------------------------------------------------------------------------------------------------


@dataclass
class Strike:
    """An impact of one pair: its share of the loads of up to three steps, and the pulse it makes.

    impulse (3,): on the lower body, world; modal: Uᵀj of both bodies.
    """

    pair: Pair
    step: int
    rows: Rows
    share: Array  # of each row
    raw: float  # N·s
    mass: float
    spread: float
    curvature: float
    approach: float
    meets_s: float | None  # after the start of its step; negative: in the one before
    budget: float = 0.0
    accepted: float = 0.0
    length_s: float = 0.0  # 0: no sound
    flat: bool = False
    impulse: Array = field(default_factory=lambda: np.zeros(3))
    modal: Array = field(default_factory=lambda: np.zeros(0))
    start_n: float = 0.0  # in samples, absolute


def find_strikes(scene: Instrument, t: int, ahead: int) -> list[Strike]:
    """Strikes that begin in step t, which sounds now, or next (ahead = 1: bodies that overlap as it starts met now)."""
    dt, back = scene.dt_s[t], scene.dt_s[max(t - 1, 0)]
    struck = [one for pair in scene.pairs if (one := split_off(scene, pair, t, ahead, back)) is not None]
    if not any(one.budget > 0 for one in struck):
        return []
    accept(struck)
    for one in struck:
        if one.accepted > 0:
            make_pulse(one)
    date(struck, back, dt)
    audible = [one for one in struck if one.length_s > 0]
    for one in audible:  # found a step late, it keeps its phase
        late = 0.0 if ahead or one.meets_s >= 0 else back
        one.start_n = max((scene.time_s[t] + min(one.meets_s + late, dt)) * scene.sr, float(scene.sample[t - ahead]))
    return audible


def split_off(scene: Instrument, pair: Pair, t: int, ahead: int, back_s: float) -> Strike | None:
    """Take a strike from the loads of steps t … t + 2, what of each exceeds its opening, and bound it by its cause.

    It comes gap/approach after its first step's start, of the row with most load times approach, where that lies in
    the step or the one before. A gap of exactly 0 is one that nobody knows.
    """
    share = np.zeros(KNOWN)
    for j in range(KNOWN if pair.force[t] > pair.force[t - 1] else 0):
        load = pair.force[t + j]
        excess = load - pair.opening(t + j, t - ahead + KNOWN) - pair.struck[t + j]
        if not excess > 1e-9 * load:
            break
        pair.struck[t + j] += excess
        share[j] = excess / load
    if share[0] == 0:
        return None
    rows = pair.rows[(pair.rows.step >= t) & (pair.rows.step < t + np.count_nonzero(share))]
    part = share[rows.step - t]
    normal, mass, spread, curvature = manifold(scene, pair, rows, part * rows.load, t)
    approach, first = max(float(rows.approach.max()), 0.0), pair.at(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = first.gap / first.approach
    dated = (first.gap != 0) & (first.approach > 0) & (-back_s <= meets) & (meets <= scene.dt_s[t]) & (first.load > 0)
    best = np.argmax(np.where(dated, first.load * first.approach, -1.0))
    met = float(meets[best]) if dated[best] else None
    one = Strike(pair, t, rows, part, float(part @ rows.load), mass, spread, curvature, approach, met)
    # what gravity gives a body at rest in a step is no approach: a tenth more for a solver's remainder,
    # a hundredth in all directions for wedged bodies
    g = scene.gravity[t]
    fall = (1.1 * abs(normal @ g) + 0.01 * np.linalg.norm(g)) * scene.dt_s[t]
    speed = approach - max(unheld_steps(scene, b, t, ahead) for b in pair.key) * fall
    if speed > 0 and not is_recreated(scene, pair, approach, fall, t):
        one.budget = 2 * mass * speed
    return one


def unheld_steps(scene: Instrument, b: int, t: int, ahead: int) -> float:
    """Steps for which gravity may have moved a body although it rests: 1 where it carried load, SPAN where placed."""
    one = scene.bodies[b]
    placed = one.body.since_step if one.material is not None else -SPAN
    placed = max([*np.flatnonzero(scene.teleported[1 : t - ahead + 2, b]) + 1, placed])
    if one.mass_kg > 0 and t - placed < SPAN:
        return SPAN
    return float(one.mass_kg > 0 and any(pair.force[np.arange(t - KNOWN, t)].any() for pair in pairs_of(scene, b)))


def pairs_of(scene: Instrument, b: int) -> list[Pair]:
    return [pair for pair in scene.pairs if b in pair.key]


def is_recreated(scene: Instrument, pair: Pair, approach: float, fall: float, t: int) -> bool:
    """Whether gravity and the steps' length alone repeat a strike of a body at rest; else it is the last cause.

    A point that bounces with restitution e on steps of dt stops losing speed at g·dt·e/(1 - e): what comes back no
    faster than three times that, and faster than the last cause leaves it by now, has no other cause. Bounces lose
    g(1 - e)/2e a second [a flight 2ve/g long loses (1 - e)v], of which half is asked. Who leaves at v is back after
    2v/g: the fastest strike since then is then the cause.
    """
    usual = 0.7  # restitution of a body whose log does not give it
    e = min(float(np.prod([one.body.dynamics.get("restitution", usual) for one in pair.both])), 1.0)
    limit, loss = 3.0 * max(1.0, e / max(1 - e, 1e-9)), fall * (1 - e) / (4 * max(e, 1e-9))

    def left_of(cause: tuple[float, int]) -> float:
        return cause[0] - loss * max(t - cause[1], 0)

    left, recent = 0.0, True
    for b, one in zip(pair.key, pair.both, strict=True):
        if one.mass_kg > 0:
            if one.since[0] > 0 and (t - one.cause[1]) * fall >= 2 * one.cause[0]:
                one.cause, one.since = one.since, (0.0, one.since[1])
            left = max(left, left_of(one.cause))
            loaded = [np.flatnonzero(other.force[:t]) for other in pairs_of(scene, b)]
            recent = recent and t - max(np.concatenate(loaded), default=-(1 << 40)) <= 2 * limit + 2
    if recent and left < approach <= limit * fall:
        return True
    for one in pair.both:
        if approach >= left_of(one.cause):
            one.cause, one.since = (approach, t), (0.0, one.since[1])
        elif approach >= left_of(one.since):
            one.since = approach, t
    return False


def neighbours(one: Strike, strikes: list[Strike]) -> list[Strike]:
    """Strikes that share a body with one, itself too. A body that never moves hands nothing on."""
    moving = {b for b, body in zip(one.pair.key, one.pair.both, strict=True) if body.mass_kg > 0}
    return [other for other in strikes if moving & {*other.pair.key}]


def accept(strikes: list[Strike]) -> None:
    """Bound impulses by their cause: 2m*v of the own approach, or the largest that a struck neighbour takes.

    A solver's flicker between corners has no approach. An impact travels through 8 bodies in a step at most.
    """
    for _ in range(9):
        through = [max((other.accepted for other in neighbours(one, strikes)), default=0.0) for one in strikes]
        for one, most in zip(strikes, through, strict=True):
            one.accepted = min(one.raw, max(one.budget, most))


def date(strikes: list[Strike], back_s: float, dt_s: float) -> None:
    """Date what gap and approach do not: half a pulse after the strongest neighbour's that hands it on; else spread.

    Undated strikes of a body come at multiples of the golden ratio of the step [Knuth 1998, vol. 3, sec. 6.4, theorem
    S]: no comb at the step rate, and the same in every run.
    """

    def spread(one: Strike) -> None:
        body = next(body for body in one.pair.both if body.mass_kg > 0)
        phase = 0.02 + 0.96 * ((body.seed / 2**32 + 0.6180339887498949 * body.undated) % 1.0)
        overlaps = (one.rows.gap[one.rows.step == one.step] < 0).any()
        one.meets_s, body.undated = (phase - 1) * back_s if overlaps else phase * dt_s, body.undated + 1

    for one in strikes:
        if 0 < one.accepted <= one.budget and one.meets_s is None:
            spread(one)
    undated = [one for one in strikes if one.accepted > 0 and one.meets_s is None]
    for _ in range(8):
        dated = [one for one in strikes if one.accepted > 0 and one.meets_s is not None]
        for one in undated:
            if one.meets_s is None and (near := neighbours(one, dated)):
                first = max(near, key=lambda other: other.accepted)
                one.meets_s = first.meets_s + 0.5 * first.length_s
    for one in undated:
        if one.meets_s is None:
            spread(one)


def make_pulse(one: Strike) -> None:
    """Length, shape and transmitted share of a strike's pulse, and Uᵀj summed over its rows.

    Bodies that yield take 1/(1 + m*/j² Σ (Uᵀj |F̂(fτ)|)²) of a rigid body's impulse: a mode that moves within the
    pulse is one more mass 1/g² in series with m*, g = Uᵀj/j [Stronge 2000, sec. 7.1, with modes as further motions].
    """
    steep = np.linalg.norm(one.share @ one.rows.impulse) > 10 * one.raw
    if not any(body.sounds for body in one.pair.both) or steep or not one.accepted > 1e-6 * one.mass > 0:
        return  # steep: a contact that Bullet drops in a step keeps its friction
    one.impulse, one.modal = (one.accepted / one.raw * (one.share @ of) for of in (one.rows.impulse, one.rows.modal))
    speed = max(one.approach if one.approach > 0 else one.accepted / (1.5 * one.mass), 1e-6)
    one.length_s, one.flat = pulse_length(one, speed)
    f_tau = one.pair.omega / (2 * np.pi) * one.length_s
    moved = one.modal * np.interp(f_tau, np.arange(321) / 40, pulse_spectrum(one.flat), right=0.0)
    transmitted = 1 / (1 + one.mass * (moved @ moved) / one.accepted**2)
    one.impulse, one.modal = transmitted * one.impulse, transmitted * one.modal


def pulse_length(one: Strike, speed: float) -> tuple[float, bool]:
    """τ and whether it is flat, 1 µs … 50 ms: the longer of both, for no contact is stiffer than its area's punch.

    curved  τ = 2.868 (m*²κ/(E*²v))^{1/5}                        [Johnson 1985, eq. 11.24]
    flat    τ = π √(m*/k),  k = 2E*√(A/π)                        [Johnson 1985, eq. 3.36]
    """
    area, modulus = flat_area_m2(one.pair, one.spread, one.curvature, 0.02), one.pair.modulus_pa
    curved = 2.868 * (one.mass**2 * max(one.curvature, 0.0) / (modulus**2 * speed)) ** 0.2
    punch = np.pi * np.sqrt(one.mass / (2 * modulus * np.sqrt(area / np.pi))) if area > 0 else 0.0
    return float(np.clip(max(curved, punch) or 50e-3, 1e-6, 50e-3)), bool(punch >= curved)


def pulse_shape(s: Array, flat: bool) -> tuple[Array, Array]:
    """Force F at fractions s of a pulse, mean 1, 0 outside, and Q = ∫F, half the change of velocity so far.

    flat    half a sine
    curved  δ'' = -δ^{3/2}: F ∝ δ^{3/2}, Q = (1 - δ'/v)/2, δ'²/v² = 1 - (δ/δ_max)^{5/2}, and time is an incomplete beta
            function of that
    """
    s = np.clip(s, 0, 1)
    if flat:
        return np.pi / 2 * np.sin(np.pi * s), 0.5 - 0.5 * np.cos(np.pi * s)
    depth = betaincinv(0.4, 0.5, 1 - np.abs(2 * s - 1))  # (δ/δ_max)^{5/2}
    half = 1.25 * 0.4 * np.sqrt(np.pi) * gamma(0.4) / gamma(0.9)  # of the duration, for v = 1
    return half * depth**0.6, 0.5 + 0.5 * np.sign(s - 0.5) * np.sqrt(1 - depth)


@cache
def pulse_spectrum(flat: bool) -> Array:
    """|F̂/F̂(0)| of a pulse at multiples of 1/40 of fτ. Stated: linear between these, 0 from fτ = 8 on."""
    middle = (np.arange(4096) + 0.5) / 4096
    force = np.abs(np.exp(-2j * np.pi * np.outer(np.arange(321) / 40, middle)) @ pulse_shape(middle, flat)[0])
    return force / force[0]


# ---- 3. Rolling and sliding ------------------------------------------------------------------------------------------


UNIT_RMS = np.sqrt(3.0 * 315 / 151)  # lattice values on ±1 have 1/3, the mean square of the B-spline is 151/315
LATTICE = 0.30  # an octave's lattice over its wavelength: most of the spectrum at λ = Δ/0.30


@dataclass
class Friction:
    """f - N of one pair in one step: newtons (n,) along ``direction`` on the lower body; gain: Uᵀ a newton, of both.

    direction[end], gain[end]: at the step's two ends, linear between.
    """

    pair: Pair
    step: int
    newton: Array
    direction: list[Array]
    gain: list[Array]


@dataclass
class Voice:
    """The contact oscillator of a pair, while its support lasts. load … gain: at the end of the last step.

    mass, modulus, radius: m*, E*, R*; loss: c at least; octaves: of either surface, see `octave_heights`.
    """

    mass: float
    modulus: float
    radius: float
    loss: float
    octaves: list[tuple[Array, float, float]]
    load: float = 0.0
    sweep: Array = field(default_factory=lambda: np.zeros(2))
    direction: Array | None = None
    gain: Array | None = None
    z: float = 0.0  # penetration beyond the resting one
    u: float | None = None  # speed of separation
    swept: Array = field(default_factory=lambda: np.zeros(2))


def friction_forces(scene: Instrument, k: int) -> list[Friction]:
    """Forces of rolling and sliding in step k: from what the step before ended with to what the next one's rows say.

    A manifold's points flicker: gains and directions follow them with 20 ms. Sweeps below 0.2 mm/s are none.
    """
    found, follow, x = [], 1 - np.exp(-scene.dt_s[k] / 0.02), scene.along(k)[:, 0]
    for pair in scene.pairs:
        target, rows = pair.opening(k + 1, k + KNOWN), pair.at(k + 1)
        if not 10 * rows.load.sum() >= np.linalg.norm(rows.impulse.sum(axis=0)):
            rows = rows[:0]
        if pair.voice is None:
            moves = any(one.sounds for one in pair.both) and any(one.mass_kg > 0 for one in pair.both)
            if target <= 0 or not moves:
                continue
            if not len(rows):
                raise NotOnThisPage("a contact that begins with more friction than load")
            pair.voice = begin_voice(scene, pair, rows, k + 1)
            pair.voice.load = target  # at rest under it
        voice, total = pair.voice, rows.load.sum()
        loads, sweep = (voice.load, target), [voice.sweep, np.zeros(2)]
        direction, gain = [voice.direction] * 2, [voice.gain] * 2
        if total > 0:
            mean = rows.load @ rows.sweep / total
            sweep[1] = np.where(mean < 2e-4, 0.0, np.minimum(mean, 50.0))
            direction = followed(voice.direction, rows.impulse.sum(axis=0) / total, follow)
        if (loads[0] > 0 or target > 0) and (voice.z != 0 or voice.u or np.any(sweep)):
            if total > 0:
                gain = followed(voice.gain, rows.modal.sum(axis=0) / total, follow)
            newton = oscillate(voice, loads, height_rate(pair, sweep, loads, x, scene.sr), x, np.any(sweep), scene.sr)
            if gain[0] is not None and newton.any():
                found.append(Friction(pair, k, newton, direction, gain))
        voice.load, voice.sweep, voice.direction, voice.gain = target, sweep[1], direction[1], gain[1]
        if target <= 0:
            pair.voice = None
    return found


def followed(before: Array | None, now: Array, follow: float) -> list[Array]:
    """Values at both ends of a step of what follows ``now``, and begins with it."""
    start = now if before is None else before
    return [start, start + follow * (now - start)]


def begin_voice(scene: Instrument, pair: Pair, rows: Rows, t: int) -> Voice:
    """Constants of a contact oscillator, by the manifold with which it begins: m*, E*, R*, both surfaces.

    A flat face rests on its highest spots, each a cap as blunt as the face is wide. c is at least 3/2 (1 - e), e of
    the less elastic body at 1 m/s, by e = 1 - αv and c = 3/2 α [Hunt & Crossley 1975].
    """
    e = min(one.restitution for one in pair.both)
    _, mass, spread, curvature = manifold(scene, pair, rows, rows.load, t)
    area = flat_area_m2(pair, spread, curvature, 0.25)
    blunt = np.sqrt(area / np.pi) if area > 0 else 1.0
    radius = 1 / curvature if curvature * blunt > 1 else blunt
    octaves = [octave_heights(one) for one in pair.both]
    return Voice(mass, pair.modulus_pa, radius, max(1.5 * (1 - e), 0.0), octaves)


def octave_heights(one: Sounding) -> tuple[Array, float, float]:
    """A_j ∝ λ_j^H of a self-affine surface, Σ A_j² = rms² [Mandelbrot; Persson 2005], for lattice values on ±1.

    A round body's profile closes on itself: a whole number of points, 4 to 7 of the coarsest octave that has as many,
    go round; coarser waves only carry it. Returns points of octave 0 round it (0: endless), the lattice's stretch.
    """
    height = WAVE_M**one.hurst
    height = one.roughness_m * height / np.sqrt((height**2).sum()) * UNIT_RMS
    if not one.body.curvature_per_m > 0:
        return height, 0.0, 0.0
    points = 2 * np.pi / one.body.curvature_per_m / (WAVE_M * LATTICE)
    coarsest = int(np.argmax(points >= 4)) if (points >= 4).any() else len(points) - 1
    height[:coarsest] = 0.0
    whole = np.floor(points[coarsest] + 0.5)
    return height, whole / 2.0**coarsest, whole / points[coarsest] - 1


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


def height_rate(pair: Pair, sweep: list[Array], loads: tuple[float, float], x: Array, sr: int) -> Array:
    """dh/dt (n,) = Σ v Σ_j g_j A_j n_j'(s/Δ_j)/Δ_j of both surfaces, at the distances s that these have swept.

    n_j: cubic B-spline on lattice values, Δ_j = 0.3 λ_j. Only dh/dt counts, so a gain that changes moves no surface.
    """
    voice, rate = pair.voice, np.zeros(len(x))
    patch = [(0.75 * load * voice.radius / voice.modulus) ** (1 / 3) for load in loads]  # Hertz' a
    for side, (height, around, stretch) in enumerate(voice.octaves):
        ends = [v[side] for v in sweep]
        v = ends[0] + (ends[1] - ends[0]) * x
        s = voice.swept[side] + np.cumsum(v) / sr
        voice.swept[side] = s[-1]
        gain = [octave_gains(speed, a, sr) for speed, a in zip(ends, patch, strict=True)]
        for j in np.flatnonzero(height * (gain[0] + gain[1])):
            inverse = 2.0**j / (WAVE_M[0] * LATTICE) * (1 + stretch)
            cell = np.floor(s * inverse).astype(np.int64)
            t = s * inverse - cell
            c = [lattice_noise(pair.both[side].seed, int(j), cell + i, around) for i in (-1, 0, 1, 2)]
            slope = (1 - t) ** 2 / 2 * (c[1] - c[0]) + (t * (1 - t) + 0.5) * (c[2] - c[1]) + t**2 / 2 * (c[3] - c[2])
            rate += v * height[j] * (gain[0][j] + (gain[1][j] - gain[0][j]) * x) * slope * inverse
    return rate


def oscillate(voice: Voice, loads: tuple[float, float], rate: Array, x: Array, sweeps: bool, sr: int) -> Array:
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
        return k * low**1.5 + m / h**2 * (depth - low)

    least = 1e-3 * 9.81 * m
    loss = [max(voice.loss, 0.5 * np.sqrt(m * soft) * max(load, least) ** (-5 / 6)) for load in loads]
    depth = [min(load / k, limit**1.5) ** (2 / 3) + max(load - k * limit**1.5, 0.0) * h**2 / m for load in loads]
    force, z, u = np.zeros(len(x)), voice.z, rate[0] if voice.u is None else voice.u
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
        if not sweeps and abs(z) <= 1e-9 * rest and abs(u) * h <= 1e-9 * rest:  # at rest to the bit
            z, u, force[n] = 0.0, 0.0, 0.0
    voice.z, voice.u = z, u
    return force


# ---- 4. Two bodies at a contact --------------------------------------------------------------------------------------


def manifold(scene: Instrument, pair: Pair, rows: Rows, load: Array, t: int) -> tuple[Array, float, float, float]:
    """Rows as one contact: mean normal by loads, m* there, spread of points, curvature where the load is largest.

    1/m* = Σ [1/m + (r × n)·I⁻¹(r × n)] [Johnson 1985, sec. 11.1]; 0 where neither moves. Point masses do not turn.
    """
    part = load / load.sum()
    normal, arm, middle = part @ rows.normal, np.einsum("n,nsx->sx", part, rows.arm), part @ rows.point[:, 0]
    normal = normal / max(np.linalg.norm(normal), 1e-300)
    spread, mobility = np.sqrt(part @ ((rows.point[:, 0] - middle) ** 2).sum(axis=1)), 0.0
    for b, one, r in zip(pair.key, pair.both, arm, strict=True):
        if one.mass_kg > 0:
            lever, inertia = np.cross(r, normal) @ scene.turn[t, b], one.body.inertia_kg_m2
            mobility += 1 / one.mass_kg + (lever @ np.linalg.solve(inertia, lever) if np.linalg.det(inertia) else 0.0)
    mass = 1 / mobility if mobility > 0 else 0.0
    return normal, mass, float(spread), float(rows.curvature[np.argmax(load)])


def flat_area_m2(pair: Pair, spread_m: float, curvature_per_m: float, least: float) -> float:
    """Area of the disc that the points of a flat contact span, of radius ``least`` of the size at least; else 0."""
    return 0.0 if curvature_per_m * pair.size_m > 0.1 else np.pi * max(spread_m, least * pair.size_m) ** 2


def surface_at(one: Sounding, point: Array, outward: Array) -> tuple[Array, float, float]:
    """Shapes (3, m), curvature and distance of the surface's point nearest to a contact, on the side that it presses.

    A solver's hull is not the surface: of faces that look along ``outward`` the nearest is taken, the one that looks
    along it most among equals, if it is at most twice as far as the nearest of all and a wall's thickness. Shapes are
    linear in a face. A normal more than 20° from the face's touches an edge: edges are round, by 0.5 % of the size. How
    it is curved the surface as given says, where elements lean from it.
    """
    bent = one.body.curvature_per_m
    if one.skin is None:
        return np.zeros((3, len(one.omega))), bent if np.isfinite(bent) else 0.0, 0.0
    face, weights, away = one.skin.nearest(point, outward)
    if not np.isfinite(bent):
        on, at = (one.skin, face) if one.touched is None else (one.touched, one.touched.nearest(point, outward)[0])
        edge = on.normal[at] @ outward < np.cos(np.radians(20.0))
        bent = 1 / max(0.005 * one.size_m, 2e-4) if edge else float(on.curvature_per_m[at])
    return np.einsum("k,kxm->xm", weights, one.shape[one.face[face]]), bent, away


def nearest_in_triangles(point: Array, corner: Array) -> tuple[Array, Array]:
    """Barycentric coordinates (f, 3) of each triangle's point nearest to a point, and its distance (f,).

    In the triangle's plane where that lies inside, else on an edge.
    """
    u, v, w = (corner[:, 1] - corner[:, 0]), (corner[:, 2] - corner[:, 0]), point - corner[:, 0]
    uu, uv, vv, uw, vw = ((a * b).sum(1) for a, b in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * uw - uv * vw) / det, (uu * vw - uv * uw) / det
    weights = np.zeros((4, len(corner), 3))
    weights[0] = np.stack([1 - second - third, second, third], axis=1)
    for edge, (i, j) in enumerate(((0, 1), (1, 2), (2, 0)), 1):
        along = corner[:, j] - corner[:, i]
        t = ((point - corner[:, i]) * along).sum(1) / np.maximum((along * along).sum(1), 1e-300)
        weights[edge, :, j] = np.clip(t, 0, 1)
        weights[edge, :, i] = 1 - weights[edge, :, j]
    away = np.linalg.norm(np.einsum("cfk,fkx->cfx", weights, corner) - point, axis=2)
    away[0, (weights[0] < 0).any(axis=1)] = np.inf
    best = np.argmin(away, axis=0), np.arange(len(corner))
    return weights[best], away[best]


# ---- 5. Support: other poles, and what passes on ---------------------------------------------------------------------


class Patch:
    """Contact patch of a pair: up to 4 tracked points on both bodies, their smoothed loads, and both surfaces' normals.

    A solver's points flicker; only their sum and moment are reliable. used: points and loads of the present poles.
    """

    def __init__(self) -> None:
        self.point, self.load, self.outward = np.zeros((0, 2, 3)), np.zeros(0), np.zeros((2, 3))
        self.used: tuple[Array, Array] = self.point, self.load
        self.used_s = 0.0

    def track(self, rows: Rows, newton: Array, near: float, follow: float) -> None:
        """Move points and loads towards those of a step: each row to the tracked point near it, or a new one."""
        begins, which = not len(self.load), np.zeros(len(rows), int)
        for i, point in enumerate(rows.point):
            off = np.linalg.norm(self.point - point, axis=2).min(axis=1)
            if len(off) < 4 and not (off <= near).any():
                which[i] = len(off)
                self.point, self.load = np.concatenate([self.point, point[None]]), np.append(self.load, 0.0)
            else:
                which[i] = np.argmin(off)
        target, moment = np.zeros(len(self.load)), np.zeros_like(self.point)
        np.add.at(target, which, newton)
        np.add.at(moment, which, newton[:, None, None] * rows.point)
        lean = np.einsum("n,nsx->sx", newton, rows.outward)
        for side, length in enumerate(np.linalg.norm(lean, axis=1)):
            if begins:
                self.outward[side] = rows.outward[np.argmax(newton), side]
            if length > 0 and length >= 0.02 * target.sum():
                self.outward[side] += (1.0 if begins else follow) * (lean[side] / length - self.outward[side])
                self.outward[side] /= np.linalg.norm(self.outward[side])
        self.load += follow * (target - self.load)
        here = target > 0  # a place enters with its load, so the moment is smoothed as the load is
        part = (follow * target[here] / self.load[here])[:, None, None]
        self.point[here] += part * (moment[here] / target[here][:, None, None] - self.point[here])
        kept = here | (self.load >= max(0.02 * self.load.sum(), 1e-9))
        self.point, self.load = self.point[kept], self.load[kept]

    def differs(self, near: float) -> bool:
        """Whether points, or loads by a factor of 1.6 (1.1 after 0.2 s), differ from those of the present poles."""
        point, load = self.used
        if len(load) != len(self.load):
            return True
        factor, off = np.abs(np.log(self.load / load)), np.linalg.norm(self.point - point, axis=2)
        return bool((factor > np.log(1.1 if self.used_s > 0.2 else 1.6)).any() or (off > near).any())


class Supports:
    """Which bodies get new poles, and when.

    Stated: a body that sounds and whose patches differ from those of its poles gets new ones, at most each 20 ms, the
    one that waits longest first, moving ones before fixed ones. 1.5 % of simulated time may go into poles, by the
    price 0.125 ms + 0.0375 ms a point + 0.05 µs (m + 6)²; up to 7.5 ms of it are saved.
    """

    def __init__(self, scene: Instrument) -> None:
        self.scene, self.credit_s = scene, 0.0075
        self.stale, (self.stale_s, self.wait_s) = np.zeros(len(scene.bodies), bool), np.zeros((2, len(scene.bodies)))

    def advance(self, k: int, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Track the patches of step k, and give new poles to who needs them. Loads follow with 30 ms."""
        scene, dt = self.scene, self.scene.dt_s[k]
        for pair in scene.pairs:
            support, patch, near = pair.opening(k, k + KNOWN), pair.patch, 0.15 * pair.size_m
            if not len(patch.load) and support <= 0:
                continue
            if not pair.force[k : k + SPAN].any():
                self.stale[list(pair.key)] |= len(patch.used[1]) > 0
                pair.patch = Patch()
                continue
            rows = pair.at(k)
            rows = rows[rows.load > 0] if support > 0 else rows[:0]
            newton = rows.load / dt * min(support / max(pair.force[k], 1e-300), 1.0)
            patch.track(rows, newton, near, 1 - np.exp(-dt / 0.03))
            patch.used_s += dt
            if patch.differs(near):
                patch.used, patch.used_s = (patch.point.copy(), patch.load.copy()), 0.0
                self.stale[list(pair.key)] = True
        moved = {b for one in (*strikes, *rubs) for b in one.pair.key}
        self.credit_s, self.wait_s = min(self.credit_s + 0.015 * dt, 0.0075), np.maximum(self.wait_s - dt, 0.0)
        self.stale_s = np.where(self.stale, self.stale_s + dt, 0.0)
        loud = [modes.sounds_from(scene.sample[k]) for modes in scene.modes]
        waiting = [b for b in np.flatnonzero(self.stale & (self.wait_s == 0)) if b in moved or loud[b]]
        for b in sorted(waiting, key=lambda b: (scene.bodies[b].mass_kg <= 0, -self.stale_s[b])):
            if self.credit_s > 0 and len(scene.bodies[b].omega):
                points = sum(len(pair.patch.load) for pair in pairs_of(scene, b))
                self.credit_s -= (1.25e-4 + 3.75e-5 * points + 5e-8 * (len(scene.bodies[b].omega) + 6) ** 2) * (
                    points > 0
                )
                self.stale[b], self.stale_s[b], self.wait_s[b] = False, 0.0, 0.02
                self.give_poles(b, k, loud[b])

    def give_poles(self, b: int, k: int, loud: bool) -> None:
        """Give a body the poles of its contacts, from its next block on, at once where it is silent.

        What its modes move of a partner sounds if it is at least 0.3 of what they send themselves. Pressure is iωρ₀
        times velocity, so it goes with the frequency at which a partner's mode is moved. On the mean over directions
        it neither adds to what the body sends nor cancels it, whatever their signs: it is a quarter of a turn from it.
        """
        scene, one, modes = self.scene, self.scene.bodies[b], self.scene.modes[b]
        block = -(-scene.sample[k] // BLOCK)
        for passed in modes.passed:
            passed.falls = min(passed.falls, block)
        modes.passed = [passed for passed in modes.passed if loud and passed.falls > passed.rises]
        modes.coming, own = modes.free, np.abs(one.weight) / one.body.gain
        quarter = np.where(own > 0, 1j * one.weight / np.maximum(np.abs(one.weight), 1e-300), 1j)
        touching = [pair for pair in pairs_of(scene, b) if len(pair.patch.load) and any(p.material for p in pair.both)]
        if touching:
            partners = [pair.key[1 - pair.key.index(b)] for pair in touching]
            springs = [contact_springs(scene, pair, b, k) for pair in touching]
            s, moved = coupled_modes(one, [scene.bodies[p] for p in partners], springs)
            modes.coming = playable(s / scene.sr, modes.free)
            for p, each in zip(partners, moved, strict=True):
                partner = scene.bodies[p]
                weight = quarter * np.abs(s.imag * (partner.weight / partner.omega @ each))
                if (np.abs(weight) / partner.body.gain > np.maximum(0.3 * own, 1e-3 * own.max())).any():
                    modes.passed.append(Passed(p, weight, block if loud else -1))
        if not loud:
            modes.take_poles()


@dataclass
class Passed:
    """What a body's modes move of a partner: its sound gains Re(weight z), fading over a block in and out."""

    to: int
    weight: Array
    rises: int  # block
    falls: float = np.inf

    def ramp(self, block: int, x: float) -> float:
        rise = x if block == self.rises else float(block > self.rises)
        return rise * ((1 - x) if block == self.falls else float(block < self.falls))


def contact_springs(scene: Instrument, pair: Pair, b: int, k: int) -> tuple[Array, list[Array]]:
    """Springs (3p,) of a pair's p points along n, t₁, t₂, and how modes and rigid motions of b and partner move them.

    One region where all between the points touches: where they spread by more than 2 % of the size and their middle is
    within 2 % of that of both surfaces: a line (curved) or a face. Else each is a region: a flat of 2 % of the size, or
    a curved one.
    """
    patch, turn, size = pair.patch, scene.turn[k, list(pair.key)], pair.size_m
    x, y, z = normal = turn[0] @ patch.outward[0]
    first = np.array([0.0, z, -y] if abs(x) < 0.6 else [-z, 0.0, x])
    first /= np.linalg.norm(first)
    axes = np.array([normal, first, np.cross(normal, first)]) @ turn
    curvature, far, motion = np.zeros(len(patch.load)), 0.0, []
    for side, one in enumerate(pair.both):
        point, outward = patch.point[:, side], patch.outward[side]
        found = [surface_at(one, each, outward) for each in point]
        curvature += [bent for _, bent, _ in found]
        far = max(far, surface_at(one, point.mean(axis=0), outward)[2])
        moves = [np.hstack([found[i][0], rigid_motions(one, each)]) for i, each in enumerate(point)]
        motion.append(np.concatenate([axes[side] @ each for each in moves]))
    middle, whole = patch.point[:, 0] - patch.point[:, 0].mean(axis=0), patch.load.sum()
    spread = np.linalg.norm(np.ptp(middle, axis=0))
    if spread >= 0.02 * size and far <= 0.02 * spread:
        half, bent = np.abs(middle @ np.linalg.svd(middle)[2].T).max(axis=0), float(curvature.mean())
        narrow = 0.0 if bent * size > 0.1 else max(half[1], 0.1 * half[0])
        spring = np.outer(patch.load / whole, region_spring(pair, (half[0], narrow), 2 * bent, whole))
    else:
        spring = np.array([
            region_spring(pair, (0.02 * size,) * 2 if bent * size <= 0.1 else (0.0, 0.0), bent, load)
            for load, bent in zip(patch.load, curvature, strict=True)
        ])  # fmt: skip
    return spring.ravel(), motion if pair.key[0] == b else motion[::-1]


def rigid_motions(one: Sounding, point: Array) -> Array:
    """Motion (3, 6) at a point of six rigid motions, mass-normalised as modes are: 1/√m, (r ×) J^{-1/2}."""
    if one.mass_kg <= 0:
        return np.zeros((3, 6))
    value, vector = np.linalg.eigh(one.body.inertia_kg_m2)
    root = vector / np.sqrt(np.maximum(value, max(1e-12 * value.max(), 1e-300)))
    return np.hstack([np.eye(3) / np.sqrt(one.mass_kg), np.cross(root.T, point).T])


def region_spring(pair: Pair, half_m: tuple[float, float], curvature: float, load: float) -> Array:
    """K of a region under a load along n, t₁, t₂, complex.

    1/K = (1/K_c + 1/K_r)/(1 + jη);  K_c = π E* a/𝐊(e), e² = 1 - (b/a)²   flat ellipse [Green & Sneddon 1950]
    point: a = b = (3N/4E*κ)^{1/3}; line: b = √(4N/πE*Lκ) [Johnson 1985, eq. 4.28, 4.43]; a rectangle as the ellipse of
    its area.  K_r = N/u₀, u₀ = half the rms roughness [Persson 2007];  η by each one's part of the compliance
    K_t/K = 2(1 - ν)/(2 - ν) [Mindlin 1949]; without friction 1e-9
    """
    known = [one.material for one in pair.both if one.material is not None]
    part = np.array([(1 - one.poisson**2) / softest_pa(one) for one in known])  # (1 - ν²)/E across the grain
    loss = part @ [2 * np.sqrt((one.alpha_per_s or 0.0) * (one.beta_s or 0.0)) for one in known] / part.sum()
    poisson = part @ [one.poisson for one in known] / part.sum()
    modulus, square, (a, b) = 1 / part.sum(), 2 / np.sqrt(np.pi), half_m
    if a == 0:
        a = b = (3 * load / (4 * modulus * curvature)) ** (1 / 3)
    else:
        b = np.sqrt(2 * load / (np.pi * modulus * a * curvature)) if b == 0 else b
        a, b = square * max(a, b), square * min(a, b)
    smooth = np.pi * a * modulus / ellipkm1((b / a) ** 2)
    layer_m = 0.5 * np.hypot(*(0.0 if one.material is None else one.roughness_m for one in pair.both))
    slips = any(one.body.dynamics.get("lateralFriction") == 0 for one in pair.both)  # μ is a product
    sideways = 1e-9 if slips else 2 * (1 - poisson) / (2 - poisson)
    return (1 + 1j * loss) / (1 / smooth + layer_m / load) * np.array([1.0, sideways, sideways])


def coupled_modes(
    one: Sounding, others: list[Sounding], springs: list[tuple[Array, list[Array]]]
) -> tuple[Array, list[Array]]:
    """Poles s (m,) in 1/s of a body on springs whose other ends its partners move: springs exactly, losses and partners
    in one step. Also of each partner (m_p, m) the velocity of its modes per velocity of each of the body's.

    (Λ + Bᵀ Re(K) B) q = ω² q,  B = (Φ, -Φ_r)      the body's modes and rigid motions, partners' rigid motions
    F_n = Re(K) B q_n,  s = jω_k                    forces at the springs
    g = Y F_k,  Y = 1/K - 1/Re K + Σ_j φ_j φ_jᵀ/(λ_j + 2 d_j s + s²)      what yields beside the springs
    x = F_kᵀg,  ρ = gᵀRg/x,  R = Re K - Σ_{n≠k} F_n F_nᵀ/(ω_n² - ω_k²)    what all other motions hold against it
    δ = x/(1 + ρ),  ε = dδ/ds²;   s² + 2 s qᵀDq + ω² - 2δ/(1 + √(1 - 4ε)) = 0
    Each mode takes the pole of the motion that most resembles it. Partners are as they are free.
    """
    if (np.diff(one.omega) < 0.01 * one.omega[1:]).any():
        raise NotOnThisPage(f"{one.body.name} has modes of nearly one frequency, which turn to a contact")
    m, k = len(one.omega), np.concatenate([spring for spring, _ in springs])
    own = np.concatenate([motion[0] for _, motion in springs])
    shapes, rigid = (block_diag(*[motion[1][:, of] for _, motion in springs]) for of in (slice(0, -6), slice(-6, None)))
    both = np.hstack([own, -rigid[:, rigid.any(axis=0)]])
    lam = np.append(one.omega**2 + one.decay**2, np.zeros(both.shape[1] - m))
    value, vector = np.linalg.eigh(np.diag(lam) + both.T @ (k.real[:, None] * both))
    force = k.real[:, None] * (both @ vector)
    chosen = linear_sum_assignment(vector[:m] ** 2, maximize=True)[1]
    motion, square = vector[:m, chosen], np.maximum(value[chosen], 0.0)
    other_omega, other_decay = (np.concatenate([getattr(p, of) for p in others]) for of in ("omega", "decay"))
    poles, moved = np.zeros(m, complex), np.zeros((len(other_omega), m), complex)
    for n in range(m):
        w, f = np.sqrt(square[n]), force[:, chosen[n]]
        yields = 1 / (other_omega**2 + other_decay**2 - square[n] + 2j * other_decay * w)
        along = yields * (shapes.T @ f)
        g = (1 / k - 1 / k.real) * f + shapes @ along
        x, apart, mutual = f @ g, value - value[chosen[n]], force.T @ g
        bound = apart**2 + np.abs(mutual) ** 2  # two of nearly one frequency would each need the other's
        held = g @ (k.real * g) - (mutual**2 * apart / np.where(bound > 0, bound, 1)).sum()
        part = 1 / (1 + held / (x if x != 0 else 1.0))
        off = part * x * 2 / (1 + np.sqrt(1 + 4 * part**2 * (along**2).sum()))
        off = off.real if off.imag > 0 else off  # no mode gains
        damped = motion[:, n] ** 2 @ one.decay
        s = -damped + 1j * np.sqrt(complex(square[n] - off - damped**2))
        if w <= 2 * np.sqrt(lam[:m].max()) and -s.real <= 0.99 * abs(s) and s.imag > 0:
            each = along * part / (1 + off * part * yields)
            moved[:, n] = each / (1 + (np.abs(each) ** 2).sum())  # at most ½: of two that meet, each has half of both
        else:
            s = complex(-w, 0.0)  # a touch stops it, see `playable`
        poles[n] = min(s.real, 0.0) + 1j * s.imag
    ends = np.cumsum([len(p.omega) for p in others])[:-1]
    return poles, np.split(moved @ motion.T, ends)


def playable(s: Array, free: Array) -> Array:
    """Poles a sample that can be played: a mode that contacts stop, or make too fast, is gone within a block."""
    stopped = np.minimum(free.real, -0.05) + 1j * np.minimum(free.imag, 3.0)
    return np.where(~np.isfinite(s) | (s.imag > 3.0) | (s.imag <= 1e-6) | (-s.real > s.imag), stopped, s)


# ---- 6. What rings ---------------------------------------------------------------------------------------------------


class Modes:
    """State of a body's modes.

    q̈ + 2d q̇ + (ω² + d²) q = Uᵀf   [Meirovitch 2001, eq. 7.113];  s = -d + iω,  q̇ = Re z:
        an impulse j at u adds (1 + i d/ω) Uᵀj e^{s(n - u)};   pressure at 1 m: Σ Re(w (z - y))
    y: all that the force about sample n adds to z, over all samples, Σ_n (1 + i d/ω) Uᵀj e^{s(n - u)}. So what lasts
        sends nothing, as w is air that moves. Where ω is far below the rate y = i Uᵀf/ω, and what is sent
        Re(w) q̇ + Im(w) (q̈ + d q̇)/ω: with w = i|w|, as of a small body that swells, the law of acceleration
        [Pierce 1989, sec. 4-1]; with z alone, it would be Im(w) of the displacement, and the pulse below all modes
    ½|z|² is a mode's energy whatever its pole: z goes on as it is where poles change, so no change adds any.
    """

    def __init__(self, scene: Instrument, b: int) -> None:
        self.scene, self.b, self.one = scene, b, scene.bodies[b]
        self.s = self.free = (-self.one.decay + 1j * self.one.omega) / scene.sr  # of a sample
        self.coming: Array | None = None  # poles from the next block on
        self.z = np.zeros(len(self.s), complex)
        self.hits, self.whole = np.zeros((2, scene.sample[scene.count], len(self.s)), complex)  # of strikes: z, and y
        self.passed: list[Passed] = []

    def sounds_from(self, first: int) -> bool:
        """Whether anything moves, or will by strikes that came before sample ``first``."""
        return bool(self.z.any() or self.hits[first:].any())

    def take_poles(self) -> None:
        self.s, self.coming = self.s if self.coming is None else self.coming, None

    def hit(self, strike: Strike) -> None:
        """Enter a strike's pulse. It keeps the poles with which it begins.

        Stated: the pulse acts at the middles of cells that divide each sample into whole, 24 a pulse and 2 a sample at
        least, each with the force there; their sum is the impulse. At a sample all has acted that is over, no more, so
        a slow pulse moves a fast mode by its slope alone. What it adds in all is told apart by Q, half a sample to
        either side of each.
        """
        modal, length = strike.modal[strike.pair.modes[strike.pair.key.index(self.b)]], strike.length_s * self.scene.sr
        cells = max(2, int(np.ceil(NODES / length)))
        u = (np.arange(np.floor(strike.start_n * cells), np.ceil((strike.start_n + length) * cells)) + 0.5) / cells
        force, n = pulse_shape((u - strike.start_n) / length, strike.flat)[0], np.ceil(u).astype(int)
        heard = n < len(self.hits)
        each = (force / force.sum())[:, None] * np.exp(self.s * (n - u)[:, None])
        each = (1 - 1j * self.s.real / self.s.imag) * modal * each
        np.add.at(self.hits, n[heard], each[heard])
        near = np.arange(np.ceil(strike.start_n - 0.5), min(strike.start_n + length + 0.5, len(self.hits))).astype(int)
        edge = np.append(near, near[-1:] + 1) - 0.5
        part = np.diff(pulse_shape((edge - strike.start_n) / length, strike.flat)[1])
        self.whole[near] += part[:, None] * self.lasting(each.sum(axis=0))

    def lasting(self, impulse: Array) -> Array:
        """Sum what an impulse adds over all samples to come."""
        return impulse / (1 - np.exp(self.s))

    def advance(self, k: int, strikes: list[Strike], rubs: list[Friction]) -> None:
        """Play step k. What is silent as a block begins is zero; new poles begin there."""
        first, stop, x = self.scene.sample[k], self.scene.sample[k + 1], self.scene.along(k)
        drive = np.zeros((stop - first, len(self.z)))
        for strike in strikes:
            if self.b in strike.pair.key and len(self.z):
                self.hit(strike)
        for rub in rubs:
            if self.b in rub.pair.key:
                start, end = (gain[rub.pair.modes[rub.pair.key.index(self.b)]] for gain in rub.gain)
                drive += rub.newton[:, None] / self.scene.sr * ((1 - x) * start + x * end)
        if not (self.z.any() or drive.any() or self.hits[first:stop].any() or self.whole[first:stop].any()):
            return
        for n in range(first, stop):
            self.z = self.z * np.exp(self.s)
            if n % BLOCK == 0:
                self.z[np.abs(self.z) < 1e-15] = 0.0
                self.take_poles()
            force = (1 - 1j * self.s.real / self.s.imag) * drive[n - first]
            self.z = self.z + self.hits[n] + force
            heard = self.z - self.whole[n] - self.lasting(force)
            self.scene.source[self.b, n] += (self.one.weight @ heard).real
            for passed in self.passed:
                part = passed.ramp(n // BLOCK, n % BLOCK / BLOCK)
                self.scene.source[passed.to, n] += part * (passed.weight @ heard).real


def click(scene: Instrument, b: int) -> Array:
    """What a rigid body sends along each axis as forces move it (3, n), in Pa·m.

    A sphere whose velocity jumps by U: p = ρ₀c U (a/r) cosθ e^{-wt}(cos wt - sin wt), w = c/a [Kirchhoff 1876]. That is
    a mode of decay and frequency w for each axis. Its coefficient is the compact law's, 2Kw²/m with K = 3ρ₀V/8πc
    [Chadwick, Zheng, James 2012, eq. 9]; w is at most 0.6 of half the rate.
    Stated: forces act evenly over the sample before; pulses by Q over cells of a sample, 4 to its 1/w at least.
    """
    one, air, sr, total = scene.bodies[b], scene.log.air, scene.sr, scene.sample[scene.count]
    moved = np.zeros((total, 3), complex)
    if not one.clicks:
        return moved.real.T
    volume = one.body.volume_m3
    w = min(air.sound_speed_m_s / (3 * volume / (4 * np.pi)) ** (1 / 3), 0.6 * np.pi * sr)
    weight = one.body.sounding_gain * 3 * air.density_kg_m3 * volume / (4 * np.pi * air.sound_speed_m_s) * w**2
    s = complex(-w, w) / sr
    for rub in (rub for rub in scene.frictions if b in rub.pair.key):
        x, here = scene.along(rub.step), slice(scene.sample[rub.step], scene.sample[rub.step + 1])
        push = rub.newton[:, None] / sr * ((1 - x) * rub.direction[0] + x * rub.direction[1])
        moved[here] += SIGN[rub.pair.key.index(b)] * push * (1 + 1j) * np.expm1(s) / s
    for strike in (strike for strike in scene.strikes if b in strike.pair.key):
        start, length = strike.start_n, strike.length_s * sr
        cells = max(int(np.ceil(4 * -s.real)), int(np.ceil(min(NODES / length, 4096))))
        n = np.arange(int(np.floor(start)) + 1, min(int(np.ceil(start + length)) + 1, total))
        edge = n[:, None] - 1 + np.arange(cells + 1) / cells
        part = np.diff(pulse_shape((edge - start) / length, strike.flat)[1], axis=1)
        part = part @ np.exp(s / cells * np.arange(cells - 1, -1, -1)) * (1 + 1j) * np.expm1(s / cells) / (s / cells)
        moved[n] += SIGN[strike.pair.key.index(b)] * part[:, None] * strike.impulse
    return weight / one.mass_kg * lfilter([1], [1, -np.exp(s)], moved, axis=0).real.T


# ---- 7. From bodies to microphones -----------------------------------------------------------------------------------


def hear(scene: Instrument) -> Array:
    """p(t) = Σ_b (s_b + n̂·j_b)(t_e)/r,  t_e + r(t_e)/c = t    [Pierce 1989, sec. 4-3; Chadwick et al. 2012, eq. 9].

    n̂, r: from the body to the microphone as the sound leaves, places linear within a step; r at least the body's
    radius, the travel time at least 12 samples. A body that is teleported in a step fades from one place to the other.
    """
    edge, air = np.arange(scene.count + 1), scene.log.air
    out = np.zeros((len(scene.log.sensors), scene.sample[scene.count]))
    for c, microphone in enumerate(scene.log.sensors):
        for b in np.flatnonzero(scene.source.any(axis=1) | scene.dipole.any(axis=(1, 2))):
            away = aim(scene, microphone, b)[edge]
            for came, left in pairwise([-1, *np.flatnonzero(scene.teleported[1:, b]), scene.count]):
                stays = (came < edge) & (edge <= left)
                ends = np.column_stack([away - scene.position[np.clip(edge, came + 1, left), b], stays])
                x = [scene.along(k) for k in range(scene.count)]
                line = np.concatenate([(1 - x[k]) * ends[k] + x[k] * ends[k + 1] for k in range(scene.count)])
                r, level = np.linalg.norm(line[:, :3], axis=1), line[:, 3]
                sent = scene.source[b] + (line[:, :3].T * scene.dipole[b]).sum(axis=0) / np.maximum(r, 1e-12)
                sent = level * sent / np.maximum(r, max(scene.bodies[b].radius_m, 1e-12))
                out[c] += arrive(sent, np.maximum(r * scene.sr / air.sound_speed_m_s, TAPS / 2))
    return out


def arrive(sent: Array, delay: Array) -> Array:
    """What is heard of a line at each sample: a(u) with u + D(u) = n, D linear between samples.

    Between samples by 24 taps of a Kaiser-windowed sinc, β = 9.5, sum 1 [Laakso et al. 1996, sec. 3.2].
    Stated: a line of which all has arrived has, before the next sample it sends, that sample's delay. Only the taps'
    12 samples before an onset hang on it.
    """
    before, delay = 2 * TAPS + int(delay[0]), delay.copy()
    for last, first in pairwise([-before, *np.flatnonzero(np.abs(sent) >= 1e-30)]):
        if first - last > delay[first] + TAPS / 2:
            delay[max(first - 3 * TAPS // 2, 0) : first] = delay[first]
    m = np.arange(-before, len(sent))
    arrival = m + np.concatenate([np.full(before, delay[0]), delay])
    arrival = np.maximum.accumulate(arrival - m / 16) + m / 16  # faster than sound: no sound overtakes another
    u = np.interp(np.arange(len(sent)), arrival, m)
    floor = np.floor(u).astype(int)
    padded = np.concatenate([np.zeros(before + TAPS), sent, np.zeros(TAPS)])
    index = floor[:, None] + np.arange(TAPS) - (TAPS // 2 - 1) + before + TAPS
    away = np.arange(TAPS) - (TAPS // 2 - 1) - (u - floor)[:, None]
    taps = np.sinc(away) * np.i0(9.5 * np.sqrt(np.maximum(0, 1 - (away / (TAPS // 2)) ** 2)))
    return (padded[index] * taps).sum(axis=1) / taps.sum(axis=1)


def aim(scene: Instrument, microphone: Microphone, b: int) -> Array:
    """Where (t, 3) a microphone will be when it hears what body b sends at each step's start: |M* - x| = cD.

    By a fixed point, each round of which leaves |v|/c of the error. A body's later poses are not known: its microphone
    flies on as the step begins.
    """
    time, late = scene.time_s[:-1], np.zeros(len(scene.dt_s))
    place, velocity = np.broadcast_to(microphone.position_m, (len(time), 3)), np.zeros(3)
    if microphone.body_id is not None:
        lead = [(one.body_id, one.link) for one in scene.log.bodies].index((microphone.body_id, microphone.link))
        place = scene.position[:, lead] + scene.turn[:, lead] @ microphone.position_m
        velocity = np.diff(place, axis=0) / np.diff(time)[:, None]
        velocity = np.concatenate([velocity, velocity[-1:]])
    for _ in range(9):
        found = place + velocity * late[:, None]
        if microphone.path is not None:
            path = microphone.path
            found = np.stack([np.interp(time + late, path.time_s, one) for one in path.position_m.T], axis=1)
        late = np.linalg.norm(found - scene.position[:, b], axis=1) / scene.log.air.sound_speed_m_s
    return found
