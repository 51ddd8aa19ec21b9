"""A residual follows the modes: the same body, a larger one, a node, another shape; and back to samples."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.engine.residual.invert import (
    INVERSION_ITERATIONS,
    INVERSION_OVERLAP,
    RESIDUAL_WINDOW,
    invert,
    magnitude_of,
    noise_phases,
)
from sonic_bullet.engine.residual.offline import clip_residual, synthesize_lines
from sonic_bullet.engine.residual.transfer import StruckModes, come_from, pair, shifted_hz, transfer
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.spectrogram import Power, inverse, power, transform
from tests.few_cases import parametrize_few
from tests.made.residuals import SR, banded, modes

REPO = Path(__file__).resolve().parents[3]
PLATE = np.array([402.0, 611.0, 890.0, 1210.0, 1700.0, 2350.0, 3120.0, 4260.0, 6020.0, 8300.0])


def snr_db(wanted: np.ndarray, got: np.ndarray) -> float:
    return float(10 * np.log10((wanted**2).sum() / ((wanted - got) ** 2).sum()))


def clip(seconds: float = 0.5, seed: int = 3) -> tuple[np.ndarray, np.ndarray, StruckModes]:
    """A recorded strike: modes, two foreign lines, a burst of noise; and what of it the modes represent."""
    n = round(seconds * SR)
    random = np.random.default_rng(seed)
    found = modes(PLATE, 0.5 * (6 + 2e-8 * (2 * np.pi * PLATE) ** 2), random.uniform(0.05, 1.0, len(PLATE)))
    represented = synthesize_lines(found.freq_hz, found.decay_per_s, found.amplitude, n, SR)
    foreign = synthesize_lines(np.array([1450.0, 5100.0]), np.array([15.0, 25.0]), np.array([0.2, 0.3j]), n, SR)
    burst = 0.1 * random.normal(size=n) * np.exp(-60 * np.arange(n) / SR)
    return represented + foreign + burst, represented, found


@pytest.mark.parametrize("moved", [0.0, 1e-6, -1e-6])
def test_the_same_source_gives_its_residual_back(moved: float) -> None:
    """≥ 40 dB before inversion, for the same modes and for modes moved by a millionth: there is no shortcut to find."""
    recorded, represented, found = clip()
    left, _ = clip_residual(recorded, represented, SR)
    there = StruckModes(found.freq_hz * (1 + moved), found.decay_per_s * (1 + moved), found.amplitude * (1 + moved))
    assert snr_db(left.per_hz, transfer(left, found, there, left.freq_hz, left.time_s)) >= 40.0


def test_the_inversion_starts_from_the_sources_phase() -> None:
    """Where nothing is represented, magnitudes and phases are those of the recording, and it comes back; the ten turns
    keep it.
    """
    recorded, _, found = clip()
    left, start = clip_residual(recorded, np.zeros(len(recorded)), SR)
    magnitude = magnitude_of(transfer(left, found, found, left.freq_hz, left.time_s), SR)
    for turns in (0, 10):
        assert snr_db(recorded, invert(magnitude, start, len(recorded), iterations=turns, overlap=4)) >= 40.0


def test_what_is_represented_is_taken_off() -> None:
    """Represented in full: what is left is the power of the rest, in its bands; in part: in between; more than all:
    never below zero.
    """
    recorded, represented, _ = clip()
    rest = power(recorded - represented, SR).per_hz.sum()
    levels = [clip_residual(recorded, share * represented, SR)[0].per_hz for share in (0.0, 0.5, 1.0, 2.0)]
    assert all((level >= 0).all() for level in levels)
    sums = [level.sum() for level in levels]
    assert sums[0] > sums[1] > sums[2] > sums[3]
    assert sums[2] == pytest.approx(rest, rel=0.5)


@pytest.mark.parametrize(
    ("words", "recorded", "represented", "rate"),
    [
        ("empty", np.zeros(0), np.zeros(0), SR),
        ("NaN", np.full(4096, np.nan), np.zeros(4096), SR),
        ("of 44100 Hz beside", np.ones(4096), np.ones(4096), 44_100),
        ("represented", np.ones(4096), np.ones(4000), SR),
    ],
)
def test_clips_that_do_not_fit_are_one_line(
    words: str, recorded: np.ndarray, represented: np.ndarray, rate: int
) -> None:
    with pytest.raises(AudioError, match=words) as caught:
        clip_residual(recorded, represented, SR, rate)
    assert "\n" not in str(caught.value)


def centroid_hz(per_hz: np.ndarray, freq_hz: np.ndarray) -> float:
    weight = per_hz.sum(axis=1)
    return float((weight * freq_hz).sum() / weight.sum())


@parametrize_few("band", [1210.0, 1450.0, 2350.0, 3700.0], (0, 3))
@pytest.mark.parametrize("size", [2.0, 0.5])
def test_a_larger_body_sounds_lower_and_longer(band: float, size: float) -> None:
    """Bands at or between modes go to f/s; they last as the modes' decays say; residual and modes keep the ratio of
    their energies.
    """
    source = modes(PLATE, 0.5 * (6 + 4e-8 * (2 * np.pi * PLATE) ** 2), np.linspace(1, 0.3, len(PLATE)))
    target = modes(PLATE / size, 0.5 * (6 + 4e-8 * (2 * np.pi * PLATE / size) ** 2), source.amplitude)
    left = banded(band, 30.0, 10.0)
    freq, time = np.linspace(0, 24_000, 4801), np.linspace(0, 3.0, 1500)
    got = transfer(left, source, target, freq, time)
    assert centroid_hz(got, freq) == pytest.approx(band / size, rel=0.01)
    j = int(np.argmin(np.abs(PLATE - band)))
    rate = target.decay_per_s[j] / source.decay_per_s[j]
    row = got[int(np.argmax(got[:, 0]))]
    observed = row > 1e-3 * row[0]
    slope = -np.polyfit(time[observed], np.log(row[observed]), 1)[0] / 2
    assert slope == pytest.approx(10.0 * rate, rel=0.02)
    energy = [
        np.trapezoid(np.trapezoid(p, t, axis=1), f)
        for p, t, f in ((left.per_hz, left.time_s, left.freq_hz), (got, time, freq))
    ]
    between = band not in PLATE  # then the band's halves belong to two modes, whose rates differ
    assert energy[1] / energy[0] == pytest.approx(1 / rate, rel=0.15 if between else 0.02)  # a²/4d grows as much


def test_a_strike_at_a_node_takes_its_neighbourhood_down() -> None:
    """One mode's amplitude at zero: its neighbourhood falls by 17 dB or more at the mode; the others stay within half a
    decibel at theirs.
    """
    source = modes(PLATE)
    still = np.ones(len(PLATE))
    still[5] = 0.0
    at = PLATE
    flat = Power(np.linspace(0, 24_000, 50), np.linspace(0, 1, 20), np.ones((50, 20)))
    change = 10 * np.log10(transfer(flat, source, modes(PLATE, 20.0, still), at, np.zeros(1))[:, 0])
    assert change[5] < -17.0
    assert np.abs(np.delete(change, 5)).max() < 0.5
    half = 10 * np.log10(transfer(flat, source, modes(PLATE, 20.0, 0.5), at, np.zeros(1))[:, 0])
    assert half == pytest.approx(-6.02, abs=0.01)


def test_neighbourhoods_meet_without_a_step() -> None:
    """The map of frequencies and the scale are continuous, and the map ascends, for pairs as unlike as can be."""
    random = np.random.default_rng(5)
    source, target = (
        modes(np.sort(random.uniform(100, 15_000, 40)), 20.0, random.uniform(0.1, 1, 40)) for _ in range(2)
    )
    pairs = pair(source, target)
    freq = np.linspace(1.0, 20_000.0, 20_001)
    here, slope, _ = come_from(pairs, freq)
    assert (np.diff(here) > 0).all()
    assert np.abs(np.diff(here)).max() <= slope.max() * 1.0001
    assert np.allclose(shifted_hz(pairs, here), freq, rtol=1e-9)
    assert come_from(pairs, pairs.target_hz)[0] == pytest.approx(pairs.source_hz, rel=1e-12)


BUNNY_EDGE_M = 0.025  # of 0.26 m: coarse, for its modes need only be some body's


@pytest.fixture(scope="module")
def bodies() -> tuple[StruckModes, StruckModes]:
    """A porcelain plate and a porcelain bunny, each struck somewhere: frequency, decay, |φ| at a vertex."""
    import pybullet_data

    from sonic_bullet.files.presets import load_material
    from sonic_bullet.modal import analyse, read_mesh

    porcelain = load_material("porcelain")
    made = []
    bunny = Path(pybullet_data.getDataPath()) / "bunny.obj"
    for path, scale, edge_m in ((REPO / "assets" / "plate.obj", 1.0, None), (bunny, 0.1, BUNNY_EDGE_M)):
        model = analyse((read_mesh(str(path), scale),), porcelain, count=24, edge_m=edge_m)
        made.append(
            StruckModes(
                model.freq_hz,
                model.decay_per_s,
                np.abs(model.shape[len(model.vertex_m) // 3, 2].astype(float)),
            )
        )
    return made[0], made[1]


@pytest.mark.slow
def test_a_plates_residual_on_a_bunny_follows_its_modes(bodies: tuple[StruckModes, StruckModes]) -> None:
    """Other shapes: dominant modes in pairs from low to high; finite; in each neighbourhood the residual's energy is to
    the mode's as it was.
    """
    plate, bunny = bodies
    n = SR // 2
    recorded = synthesize_lines(plate.freq_hz, plate.decay_per_s, plate.amplitude, n, SR)
    left, _ = clip_residual(
        recorded + 0.02 * np.random.default_rng(1).normal(size=n) * np.exp(-20 * np.arange(n) / SR), recorded, SR
    )
    pairs = pair(plate, bunny)
    assert not pairs.natural
    assert (np.diff(pairs.source_hz) > 0).all() and (np.diff(pairs.target_hz) > 0).all()
    assert len(pairs.target_hz) > 10
    freq, time = np.linspace(0, 24_000, 3001), np.linspace(0, 4.0, 2000)
    got = transfer(left, plate, bunny, freq, time)
    assert np.isfinite(got).all() and (got >= 0).all() and got.any()
    louder = StruckModes(bunny.freq_hz, bunny.decay_per_s, 3 * bunny.amplitude)
    assert np.allclose(transfer(left, plate, louder, freq, time), 9 * got, rtol=1e-9, atol=0)
    edge = np.concatenate([[0], (pairs.target_hz[1:] + pairs.target_hz[:-1]) / 2, [1e9]])

    def energy(power_per_hz: np.ndarray) -> np.ndarray:
        whole = np.trapezoid(power_per_hz, time, axis=1)
        return np.array([whole[(freq >= lo) & (freq < hi)].sum() for lo, hi in itertools.pairwise(edge)])

    before = energy(got)

    def louder_by(j: int) -> np.ndarray:
        amplitude = np.where(pairs.group == j, 2.0, 1.0) * bunny.amplitude
        return energy(transfer(left, plate, StruckModes(bunny.freq_hz, bunny.decay_per_s, amplitude), freq, time))

    came = np.array([louder_by(j) - before for j in range(len(pairs.target_hz))])
    assert came.sum() == pytest.approx(3 * before.sum(), rel=1e-9)  # every part is one mode's, as its amplitude squared
    near = np.abs(np.log2(pairs.target_hz / pairs.target_hz[:, None])) < 1 / 6
    assert came[near].sum() > 0.75 * came.sum()  # and lies near it


def test_a_plates_residual_on_other_sizes(bodies: tuple[StruckModes, StruckModes]) -> None:
    """The same plate at 0.6 … 1.5 of its size: natural pairs, all of them, and bands where the modes have gone."""
    plate, _ = bodies
    for size in (0.6, 1.5):
        other = StruckModes(plate.freq_hz / size, plate.decay_per_s, plate.amplitude * size**-1.5)
        pairs = pair(plate, other)
        assert pairs.natural
        assert pairs.target_hz == pytest.approx(pairs.source_hz / size, rel=1e-9)
        got = transfer(banded(2500.0, 40.0, 10.0), plate, other, np.linspace(0, 24_000, 4801), np.linspace(0, 1, 100))
        assert centroid_hz(got, np.linspace(0, 24_000, 4801)) == pytest.approx(2500.0 / size, rel=0.02)


def test_close_modes_count_as_one_and_modes_of_a_shaken_list_still_pair() -> None:
    doubled = np.sort(np.concatenate([PLATE, PLATE * 1.0003]))
    pairs = pair(modes(PLATE), modes(doubled))
    assert pairs.natural and len(pairs.target_hz) == len(PLATE)
    assert (np.bincount(pairs.group) == 2).all()


def test_inversion_settles_and_keeps_seeds_apart() -> None:
    """Four turns bring the inconsistency of shaped noise below 0.15, each turn lowers it; the same seed, the
    same bits.
    """
    n = SR // 2
    time = np.arange(n) / SR
    per_hz = np.exp(-20 * np.arange(95) * 256 / SR)[None] * np.exp(-np.arange(257) / 60)[:, None] * 1e-6
    magnitude = magnitude_of(per_hz, SR)
    sounds = [invert(magnitude, noise_phases(n, 1), n, iterations=turns) for turns in range(5)]
    off = [np.abs(transform(x, RESIDUAL_WINDOW, INVERSION_OVERLAP)) - magnitude for x in sounds]
    apart = [np.linalg.norm(one) / np.linalg.norm(magnitude) for one in off]
    assert (np.diff(apart) < 0).all()
    assert apart[INVERSION_ITERATIONS] < 0.15
    assert (invert(magnitude, noise_phases(n, 1), n) == sounds[INVERSION_ITERATIONS]).all()
    other = invert(magnitude, noise_phases(n, 2), n)
    assert abs(np.corrcoef(other, sounds[-1])[0, 1]) < 0.1
    level = [20 * np.log10(np.sqrt((x[time < 0.1] ** 2).mean())) for x in (other, sounds[-1])]
    assert abs(level[0] - level[1]) < 0.5
    with pytest.raises(ValueError, match="0 to 10"):
        invert(magnitude, noise_phases(n, 1), n, iterations=11)


@pytest.mark.parametrize("overlap", [2, 4])
def test_the_transform_and_its_inverse_are_one(overlap: int) -> None:
    sound = np.random.default_rng(0).normal(size=20_011)
    assert snr_db(sound[600:-600], inverse(transform(sound, 512, overlap), len(sound), 512, overlap)[600:-600]) > 100
    white = power(np.random.default_rng(1).normal(size=200_000), SR)
    assert white.per_hz[5:-5, 5:-5].mean() == pytest.approx(1 / SR, rel=0.02)
