"""Rolling and sliding: silence at rest, the level laws, no buzz of the physics steps, the same bits for any split."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from sonic_bullet._engine import (
    contact_radius_m,
    dissipation_s_m,
    force_vector_level,
    sweep_profile,
    vector_level,
)
from sonic_bullet.records import Array
from tests.made.surfaces import advance, octave_gains, octave_heights, surface_pairs

SR, STEP = 48000, 200

CASES = {  # m* kg, E* Pa, R* m, ζ
    "1 cm steel ball on stone": (0.033, 5e10, 0.01, 0.25),
    "3 cm steel ball on stone": (0.88, 5e10, 0.03, 0.25),
    "2 cm steel ball on wood": (0.26, 1e10, 0.02, 0.25),
    "1 cm steel ball on steel": (0.033, 1.1e11, 0.01, 0.25),
}


def pairs_of(case: tuple[float, float, float, float], roughness_m: Array) -> Array:
    p = len(roughness_m)
    mass, modulus, radius, zeta = (np.full(p, value) for value in case)
    rough = np.stack([np.zeros(p), roughness_m], 1)
    return surface_pairs(
        mass, modulus, radius, zeta, rough, np.full((p, 2), 0.75), 1 + 7919 * np.arange(2 * p).reshape(p, 2)
    )


def between(pairs: Array, before: tuple[Array, Array], after: tuple[Array, Array], x: Array) -> Array:
    """Forces of a step between two loads and sweeps."""
    return advance(pairs, np.stack([before[0], after[0]]), np.stack([before[1], after[1]]), x, SR)


def sounding(pairs: Array, speed_m_s: Array, seconds: float, jitter: float = 0.0) -> Array:
    """Forces (p, n) of pairs that bear their weight while both surfaces sweep; loads and speeds jitter from step to
    step.
    """
    rng = np.random.default_rng(5)

    def loads() -> tuple[Array, Array]:
        shake = 1 + jitter * rng.normal(size=(2, len(pairs)))
        return 9.81 * pairs["mass_kg"] * shake[0], np.repeat((speed_m_s * shake[1])[:, None], 2, 1)

    here, x, out, pairs = loads(), np.arange(STEP) / STEP, [], pairs.copy()
    for _ in range(int(seconds * SR / STEP)):
        there = loads() if jitter else here
        out.append(between(pairs, here, there, x))
        here = there
    return np.concatenate(out, 1)


def rung(force: Array) -> Array:
    """Acceleration of a modal body of 12 modes, 310 Hz … 8.2 kHz, driven by the forces (p, n)."""
    from scipy.signal import lfilter

    total = np.zeros_like(force)
    for f in (310, 480, 740, 1130, 1580, 2100, 2750, 3600, 4400, 5600, 6900, 8200):
        decay = 10 + 1e-7 * (2 * np.pi * f) ** 2
        r = np.exp(-decay / SR)
        total += lfilter([1, -1], [1, -2 * r * np.cos(2 * np.pi * f / SR), r * r], force)
    return total


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_level_follows_the_measured_laws(name: str) -> None:
    """Level ∝ roughness^m speed^n with m in 0.63 … 1.16 and n in 0.5 … 0.96, each independent of the other quantity."""
    speed, rough = np.geomspace(0.1, 1.6, 5), np.geomspace(0.25e-6, 8e-6, 5)
    v, h = (a.ravel() for a in np.meshgrid(speed, rough))
    force = sounding(pairs_of(CASES[name], h), v, 1.2)
    for observed in (force, rung(force)):
        level = np.log(observed[:, SR // 10 :].std(1)).reshape(5, 5)
        n = np.array([np.polyfit(np.log(speed), level[i], 1)[0] for i in range(5)])
        m = np.array([np.polyfit(np.log(rough), level[:, i], 1)[0] for i in range(5)])
        fits = [np.corrcoef(np.log(speed), level[i])[0, 1] ** 2 for i in range(5)] + [
            np.corrcoef(np.log(rough), level[:, i])[0, 1] ** 2 for i in range(5)
        ]
        assert n.min() >= 0.5 and n.max() <= 0.98, n  # 0.96 + the spread of 1.2 s of noise
        assert m.min() >= 0.63 and m.max() <= 1.16, m
        assert abs(n[0] - n[-1]) < 0.15, n
        assert abs(m[0] - m[-1]) < 0.15, m
        assert min(fits) > 0.9


def test_nothing_sounds_at_rest_whatever_the_load_does() -> None:
    pairs = pairs_of(CASES["1 cm steel ball on stone"], np.full(3, 5e-6))
    x, rng = np.arange(STEP) / STEP, np.random.default_rng(2)
    load = rng.uniform(0, 1, (40, 3))
    load[10:12] = 0
    for before, after in itertools.pairwise(load):
        assert not between(pairs, (before, np.zeros((3, 2))), (after, np.zeros((3, 2))), x).any()


def test_a_ball_that_stops_falls_silent_to_exact_zero_and_starts_without_a_click() -> None:
    pairs = pairs_of(CASES["1 cm steel ball on stone"], np.full(1, 2e-6))
    loads = [
        (9.81 * pairs["mass_kg"], np.full((1, 2), v)) for v in [0.4] * 60 + list(np.linspace(0.4, 0, 60)) + [0.0] * 60
    ]
    x = np.arange(STEP) / STEP
    steps = [between(pairs, before, after, x)[0] for before, after in itertools.pairwise(loads)]
    sound = np.concatenate(steps)
    loud = sound[STEP * 20 : STEP * 60].std()
    assert np.abs(sound[:3]).max() < 0.5 * loud
    assert np.abs(np.diff(sound)).max() < 20 * np.diff(sound[STEP * 20 : STEP * 60]).std()
    assert not sound[-10 * STEP :].any()
    assert pairs["depth"][0] == 0 and pairs["separation_speed"][0] == 0
    tiny = np.abs(sound[sound != 0])
    assert tiny.min() > 1e-300
    fade = [np.std(step) for step in steps[60:120:10]]  # continuous as the speed fades: no step up, no sudden end
    assert all(b < 1.5 * a for a, b in itertools.pairwise(fade))


def test_force_is_that_of_the_equations_written_out() -> None:
    """One pair against its differential equations in newton and metres, sample by sample."""
    case, x, v = CASES["1 cm steel ball on stone"], np.arange(STEP) / STEP, 0.4
    mass, modulus, radius, zeta = case
    pairs = pairs_of(case, np.full(1, 1e-6))
    load = 9.81 * mass
    profile = np.zeros(10 * STEP)
    patch = (0.75 * load * radius / modulus) ** (1 / 3)
    _swept(v, np.zeros(10 * STEP), 1 + 7919, pairs["height_m"][0, 1] * octave_gains(v, patch, SR), 1 / SR, profile)
    ends = np.full(1, load), np.array([[0.0, v]])
    force = np.concatenate([between(pairs, ends, ends, x)[0] for _ in range(10)])
    k = 4 / 3 * modulus * np.sqrt(radius)
    rest = (load / k) ** (2 / 3)
    c = 2 * zeta * np.sqrt(mass * 1.5 * k * np.sqrt(rest)) / load
    count = int(pairs["substeps"][0])
    h, z, u, expected = 1 / SR / count, 0.0, profile[0], []
    for rate in profile:
        total = 0.0
        for _ in range(count):
            z += h * (rate - u)
            elastic = k * max(rest + z, 0.0) ** 1.5
            f = max((elastic - load + elastic * c * (rate - u)) / (1 + h / mass * elastic * c), -load)
            u += h / mass * f
            total += f / count
        expected.append(total)
    assert np.abs(force - expected).max() < 1e-9 * np.abs(force).max()


def test_any_split_gives_the_same_bits() -> None:
    most = np.concatenate(
        [
            pairs_of(CASES["3 cm steel ball on stone"], np.array([1e-6, 2e-5, 0.0])),
            pairs_of((1e-5, 1e11, 1e-3, 0.3), np.full(2, 1e-6)),
        ]
    )
    rng = np.random.default_rng(3)
    loads = [(9.81 * most["mass_kg"] * rng.uniform(0, 4, 5), rng.uniform(0, 2, (5, 2))) for _ in range(13)]

    def render(blocks: list[int]) -> bytes:
        pairs, out = most.copy(), list[Array]()
        for before, after in itertools.pairwise(loads):
            at = 0
            while at < STEP:
                n = blocks[len(out) % len(blocks)]
                out.append(between(pairs, before, after, np.arange(at, min(at + n, STEP)) / STEP))
                at += n
        return np.concatenate(out, 1).tobytes() + pairs.tobytes()

    whole = render([STEP])
    assert render([1]) == whole
    assert render([7, 64, 3, 128]) == whole


def test_a_pair_sounds_the_same_alone_and_among_others() -> None:
    pairs = pairs_of(CASES["1 cm steel ball on steel"], np.geomspace(1e-7, 1e-5, 9))
    speed = np.linspace(0.1, 2, 9)
    together = sounding(pairs, speed, 0.05)
    for row in (0, 4, 8):
        assert sounding(pairs[[row]], speed[[row]], 0.05).tobytes() == together[[row]].tobytes()


def test_rolling_and_sliding_differ_in_sweep_alone() -> None:
    """Two surfaces of equal roughness that both sweep are √2 as loud as one; a fading sweep of one leads from the one
    to the other.
    """
    p = 24
    pairs = pairs_of(CASES["2 cm steel ball on wood"], np.full(p, 1e-6))
    pairs["height_m"][:, 0] = pairs["height_m"][:, 1]
    share, x = np.repeat([1.0, 0.3, 0.03, 0.0], 6), np.arange(STEP) / STEP
    loads = 9.81 * pairs["mass_kg"], np.stack([0.5 * share, np.full(p, 0.5)], 1)
    out = [between(pairs, loads, loads, x) for _ in range(240)]
    level = np.sqrt((np.concatenate(out, 1)[:, 4800:] ** 2).mean(1).reshape(4, 6).mean(1))
    assert level[0] / level[3] == pytest.approx(np.sqrt(2), rel=0.1)
    assert (np.diff(level) < 0.02 * level[3]).all()
    assert level[2] == pytest.approx(level[3], rel=0.05)


def test_no_buzz_of_the_physics_steps() -> None:
    """Loads and speeds that jitter by 1 % at 240 Hz: within 5 Hz of 240 Hz and its multiples at most 3 dB above the
    neighbourhood.
    """
    p = 12
    force = sounding(pairs_of(CASES["2 cm steel ball on wood"], np.full(p, 2e-6)), np.full(p, 0.5), 3.0, jitter=0.01)[
        :, 4800:
    ]
    power = (np.abs(np.fft.rfft(force * np.hanning(force.shape[1]), axis=1)) ** 2).mean(0)
    f = np.arange(len(power)) * SR / force.shape[1]
    for line in range(240, 10000, 240):
        near = power[np.abs(f - line) <= 5].mean()
        around = power[(np.abs(f - line) > 15) & (np.abs(f - line) < 100)].mean()
        assert 10 * np.log10(near / around) < 3, line


def test_contact_neither_gains_energy_nor_blows_up() -> None:
    """Free oscillation of a standing contact only loses energy; absurd stiffness, mass, load, speed and roughness stay
    bounded.
    """
    pairs = pairs_of((0.033, 5e10, 0.01, 0.02), np.zeros(1))
    load, x = (9.81 * pairs["mass_kg"], np.zeros((1, 2))), np.arange(STEP) / STEP
    pairs["depth"], pairs["substeps"] = 1e-3, 1
    peaks = [np.abs(between(pairs, load, load, x)).max() for _ in range(40)]
    assert peaks[0] > 0
    assert all(b <= a for a, b in itertools.pairwise(peaks))
    grid = np.array(np.meshgrid([1e-6, 1e4], [1e4, 1e13], [1e-5, 10.0], [0.02, 1.0], [0.0, 1e-3])).reshape(5, -1)
    p = grid.shape[1]
    mass, modulus, radius, zeta = grid[:4]
    wild = surface_pairs(
        mass,
        modulus,
        radius,
        zeta,
        np.stack([grid[4], grid[4]], 1),
        np.full((p, 2), 0.1),
        np.arange(2 * p).reshape(p, 2),
    )
    total = np.zeros(p)
    rng = np.random.default_rng(0)
    for _ in range(60):
        before, after = (
            (rng.choice([0, 1e-9, 1.0, 1e5], p), rng.choice([0, 1e-6, 1.0, 1e9], (p, 2))) for _ in range(2)
        )
        force = between(wild, before, after, x)
        assert np.isfinite(force).all()
        total = np.maximum(total, np.abs(force).max(1))
    assert np.isfinite(wild["depth"]).all()
    assert not total[grid[4] == 0].any()  # nothing rough: nothing heard


def test_mean_of_the_force_is_the_load() -> None:
    """Whatever bounces, the ground bears the weight: the mean of f - N vanishes against its fluctuation."""
    force = sounding(pairs_of(CASES["1 cm steel ball on stone"], np.geomspace(1e-7, 2e-5, 6)), np.full(6, 1.0), 2.0)
    assert (np.abs(force.mean(1)) < 0.01 * force.std(1)).all()
    assert (force.min(1) >= -9.81 * 0.033 * (1 + 1e-12)).all()  # surfaces do not pull


def _swept(speed: float, x: Array, seed: int, height: Array, per_sample_s: float, rate: Array) -> None:
    ends = np.array([height, height])
    sweep_profile(0.0, (speed, speed), x, seed, 0.0, 0.0, ends, per_sample_s, rate)  # endless


def test_profile_is_self_affine_with_the_stated_rms() -> None:
    """Slope of the height's spectrum is -(1 + 2H) within 0.15, its rms the stated one within 10 %."""
    rows, n, hurst, v, sr = 8, 1 << 19, 0.75, 0.1, 48000
    height, x, rate = octave_heights(1e-6, hurst), np.zeros(n), np.zeros((rows, n))
    for row in range(rows):
        _swept(v, x, 2 * row, height, 1 / sr, rate[row])
    h = np.cumsum(rate, 1) / sr
    assert np.sqrt(h.var(1).mean()) == pytest.approx(1e-6, rel=0.1)
    power = (np.abs(np.fft.rfft(h * np.hanning(n), axis=1)) ** 2).mean(0)
    f = np.arange(len(power)) * sr / n
    bands = v / 0.05 * 2.0 ** np.arange(0, 8)  # wavelengths 50 mm … 0.4 mm
    level = [np.log(power[(f >= a) & (f < 2 * a)].mean()) for a in bands]
    assert np.polyfit(np.log(bands), level, 1)[0] == pytest.approx(-(1 + 2 * hurst), abs=0.15)


def test_gains_fall_with_contact_and_alias_and_slowness() -> None:
    free, standing, patch = octave_gains(0.5, 0.0, SR), octave_gains(0.0, 0.0, SR), octave_gains(0.5, 1e-3, SR)
    assert not standing.any()
    assert (patch <= free).all()
    wave = 0.1 / 2.0 ** np.arange(len(free))
    at_radius = np.argmin(np.abs(wave - 1e-3))
    assert patch[at_radius] / free[at_radius] == pytest.approx(np.sqrt(1 / (1 + 1e-3 / wave[at_radius])))
    assert not octave_gains(30.0, 0.0, SR)[wave < 30 / (0.4 * SR)].any()


def test_helpers_at_their_edges() -> None:
    assert [dissipation_s_m(e) for e in (0.0, 0.6, 1.0, np.inf)] == pytest.approx([1.5, 0.6, 0.0, 0.0])
    radii = [contact_radius_m(*pair) for pair in ((100.0, 0.0), (0.0, np.pi * 0.04), (-5.0, 0.0), (0.0, 0.0))]
    assert radii == pytest.approx([0.01, 0.2, 1.0, 1.0])


def test_every_level_of_vector_instructions_gives_the_same_bits() -> None:
    best, sounds = vector_level(), set()
    try:
        for level in range(best + 1):
            force_vector_level(level)
            pairs = pairs_of(CASES["2 cm steel ball on wood"], np.geomspace(1e-7, 1e-5, 11))
            pairs["around"][::2], pairs["stretch"][::2] = 5.0, 0.03  # closed ones and endless ones
            sounds.add(sounding(pairs, np.linspace(0.1, 2, 11), 0.05).tobytes())
    finally:
        force_vector_level(best)
    assert len(sounds) == 1
