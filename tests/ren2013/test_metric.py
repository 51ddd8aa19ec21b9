"""The closed-form image against Fourier transforms, and the match ratio product's invariances."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.records import Array
from sonic_bullet.records.errors import RecordError
from studies.ren2013.hybrid.image import Image, distance, image
from studies.ren2013.hybrid.matching import match_ratio_product, points
from studies.ren2013.plain_image import plain_distance
from tests.few_cases import parametrize_few

pytestmark = pytest.mark.slow  # it compiles the study's loops, 10 s of processor a process
SR = 48000


def sounding(freq_hz: Array, decay_per_s: Array, amplitude: Array, seconds: float = 0.6) -> Array:
    time = np.arange(int(seconds * SR)) / SR
    return np.asarray(
        sum(
            a * np.exp(-d * time) * np.sin(2 * np.pi * f * time)
            for f, d, a in zip(freq_hz, decay_per_s, amplitude, strict=True)
        )
    )


def some_modes(count: int, seed: int = 0) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    signs = rng.choice([-1.0, 1.0], count)
    return (
        np.sort(rng.uniform(150, 16000, count)),
        10 ** rng.uniform(0.5, 2.9, count),
        10 ** rng.uniform(-3, -1, count) * signs,
    )


def observed(freq_hz: Array, decay_per_s: Array, amplitude: Array) -> Features:
    none = np.full(len(freq_hz), np.nan)
    return Features(
        freq_hz, decay_per_s, np.abs(amplitude), np.where(amplitude < 0, np.pi, 0.0), none, none, none, 0.0, -200.0, SR
    )


def image_of(modes: tuple[Array, Array, Array], full_scale_db_spl: float = 94.0) -> Image:
    return image(sounding(*modes), SR, 0.0, full_scale_db_spl)


@parametrize_few("full_scale", [74.0, 94.0, 114.0], 1)
def test_closed_form_equals_synthesis(full_scale: float) -> None:
    modes = some_modes(100)
    seen = image_of(modes, full_scale)
    assert distance(seen, *modes) < 1e-8
    for factor in (1.003, 1.03, 1.3):
        moved = (modes[0] * factor, modes[1] * factor**2, modes[2] * factor)
        assert distance(seen, *moved) == pytest.approx(plain_distance(seen, *moved), rel=1e-5, abs=1e-7)


def test_close_pairs_beat() -> None:
    freq_hz, decay, one = np.array([2000.0, 2004.0]), np.array([3.0, 3.0]), np.array([0.1, 0.1])
    seen = image_of((freq_hz, decay, one))
    other = one * np.array([1, -1])
    assert distance(seen, freq_hz, decay, one) < 1e-8
    assert distance(seen, freq_hz, decay, other) > 0.01
    assert distance(seen, freq_hz, decay, other) == pytest.approx(plain_distance(seen, freq_hz, decay, other), rel=1e-5)


def test_modes_that_ring_in_a_sample_or_never_are_no_trouble() -> None:
    freq_hz, decay, amplitude = (
        np.array([50.0, 500.0, 0.0, 23000.0, 6000.0]),
        np.array([0.0, 3e4, 10.0, 5.0, 900.0]),
        np.array([0.1, 0.1, 0.0, 0.1, 0.1]),
    )
    seen = image_of((freq_hz, decay, amplitude))
    assert distance(seen, freq_hz, decay, amplitude) < 1e-6
    silent = distance(seen, freq_hz, decay, 0 * amplitude)
    assert silent == pytest.approx(1.0, rel=1e-12)


def test_onset_between_samples() -> None:
    modes = some_modes(20, 3)
    late = 0.37 / SR
    time = np.arange(int(0.5 * SR)) / SR
    after = np.maximum(time - 0.1 - late, 0)
    signal = sum(a * np.exp(-d * after) * np.sin(2 * np.pi * f * after) for f, d, a in zip(*modes, strict=True))
    assert distance(image(np.asarray(signal), SR, 0.1 + late, 94.0), *modes) < 1e-7


def test_too_short_or_silent_recordings_are_refused() -> None:
    with pytest.raises(RecordError, match="samples follow the onset"):
        image(np.ones(300), SR, 0.0, 94.0)
    with pytest.raises(RecordError, match="nothing is heard"):
        image(np.full(SR, 1e-9), SR, 0.0, 94.0)


def test_match_ratio_product() -> None:
    modes = some_modes(40, 1)
    known = points(observed(*modes))
    assert match_ratio_product(known, *modes) == pytest.approx(-1, abs=0.03)
    order = np.random.default_rng(0).permutation(40)
    assert match_ratio_product(known, *(part[order] for part in modes)) == pytest.approx(
        match_ratio_product(known, *modes), rel=1e-12
    )
    # one common factor on the amplitudes tells nothing of the material
    assert match_ratio_product(known, modes[0], modes[1], 7 * modes[2]) == pytest.approx(
        match_ratio_product(known, *modes), rel=1e-12
    )
    scores = [match_ratio_product(known, modes[0] * factor, modes[1], modes[2]) for factor in (1.0, 1.005, 1.02)]
    assert scores == sorted(scores)
    inaudible = [np.append(part, extra) for part, extra in zip(modes, (21000.0, 5.0, 1.0), strict=True)]
    assert match_ratio_product(known, *inaudible) == pytest.approx(match_ratio_product(known, *modes), rel=1e-12)
    # a mode nobody recorded, and a mode that is missing, both cost
    foreign = [np.append(part, extra) for part, extra in zip(modes, (60.0, 5.0, 1.0), strict=True)]
    assert match_ratio_product(known, *foreign) > match_ratio_product(known, *modes)
    assert match_ratio_product(known, *(part[:20] for part in modes)) > match_ratio_product(known, *modes)
    assert match_ratio_product(known, *(0 * part for part in modes)) == 0
