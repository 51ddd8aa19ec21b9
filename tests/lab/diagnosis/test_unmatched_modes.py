"""Unmatched modes find their frequencies in the recordings; noise that falls with frequency is taken as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import place_unmatched
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor, floor_between, with_noise
from tests.few_cases import parametrize_few
from tests.made.body import plate, recorded, struck, truth


@parametrize_few("off", [0.004, -0.007], 1)
def test_a_mode_without_a_line_is_put_where_it_sounds(off: float) -> None:
    """The mesh has the fourth mode elsewhere, and its line is missing: it comes back to a hundredth of its half width;
    modes with lines stay.
    """
    body = recorded()
    freq = body.model.freq_hz.copy()
    freq[3] *= 1 + off
    line = body.line.copy()
    line[3] = -1
    wrong = replace(body, model=replace(body.model, freq_hz=freq), line=line)
    (right,) = place_unmatched(replace(truth(), correction={"plate": wrong.correction}), (wrong,))
    width = (30.0 + 4e-8 * (2 * np.pi * freq[3]) ** 2) / (4 * np.pi)
    assert abs(freq[3] * (1 + right.correction[3]) - plate().freq_hz[3]) < 0.3 * width
    assert np.all(np.delete(right.correction, 3) == np.delete(wrong.correction, 3))


def test_a_twin_that_a_mesh_has_torn_off_goes_back_to_its_line() -> None:
    """Two modes of one frequency sound as one line, which was given to one of them alone."""
    model = plate()
    freq = model.freq_hz.copy()
    freq[4] = freq[3]
    body = recorded(model=replace(model, freq_hz=freq))
    split_apart = freq.copy()
    split_apart[4] *= 1.002
    line = body.line.copy()
    line[4] = -1
    wrong = replace(body, model=replace(body.model, freq_hz=split_apart), line=line)
    (right,) = place_unmatched(replace(truth(), correction={"plate": wrong.correction}), (wrong,))
    assert right.line[4] == right.line[3]
    assert split_apart[4] * (1 + right.correction[4]) == pytest.approx(freq[3], rel=3e-4)


def test_what_the_recordings_do_not_want_elsewhere_stays() -> None:
    """A mode farther off than 1 % is left where it is, and so is one that nobody hears under a soft hammer."""
    body = recorded(ContactTime(1.2e-3, 0.016, 0.0, "half-sine"))
    freq = body.model.freq_hz.copy()
    freq[2] *= 1.02 if freq[2] * 1.02 < freq[3] else 0.98
    line = body.line.copy()
    line[2] = line[-1] = -1
    wrong = replace(body, model=replace(body.model, freq_hz=freq), line=line)
    (right,) = place_unmatched(
        replace(truth(ContactTime(1.2e-3, 0.016, 0.0, "half-sine")), correction={"plate": wrong.correction}), (wrong,)
    )
    assert right.correction[2] == 0
    assert right.correction[-1] == 0


@pytest.mark.parametrize(("reach", "outside"), [(1.004, True), (1.03, False)])
def test_a_mode_at_the_bands_edge_that_nobody_hears_lies_outside(reach: float, outside: bool) -> None:
    """The mesh has the highest mode inside the band by less than its error; one farther inside is not silenced so,
    whatever is not heard of it.
    """
    model = plate()
    shape = model.shape.copy()
    shape[:, :, -1] = 0.0
    observed = recorded(model=replace(model, shape=shape)).recorded
    assert observed is not None
    edge = float(model.freq_hz[-1]) * reach
    wrong = replace(struck(model, observed.lines, observed.signals), band_hz=(50.0, edge))
    assert wrong.line[-1] == -1
    (right,) = place_unmatched(replace(truth(), correction={"plate": wrong.correction}), (wrong,))
    assert (model.freq_hz[-1] * (1 + right.correction[-1]) > edge) == outside
    assert (right.correction[:-1] == wrong.correction[:-1]).all()


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0])
def test_noise_of_any_slope_is_its_own_floor(slope: float) -> None:
    """White, pink and brown, in windows of any length; a hum 23 dB over it in its bins is no part of it."""
    sr, n = 48_000, 72_000
    density = 1e-8 / np.maximum(np.arange(4097) / 4, 1.0) ** slope
    takes = [with_noise(np.zeros(n), Floor(density), seed) for seed in range(5)]
    found = floor_between(takes)
    band = slice(20, 3500)
    assert np.median(np.abs(10 * np.log10(found.at(4097)[band] / density[band]))) < 0.6
    for wide in (257, 1025):
        takes_in = np.mean([_periodogram(take, 2 * (wide - 1)) for take in takes], axis=0)
        assert np.abs(10 * np.log10(found.at(wide)[1:8] / takes_in[1:8])).max() < 1.5 + 2 * slope
    hum = np.sqrt(0.04 * density[10]) * np.sin(2 * np.pi * 60 * np.arange(n) / sr)
    with_hum = floor_between([take + hum for take in takes])
    assert np.abs(10 * np.log10(with_hum.at(4097)[6:16] / found.at(4097)[6:16])).max() < 3 + slope


def _periodogram(sound: Array, window: int) -> Array:
    """Welch's (b,), variance of white noise of the same density."""
    shape = np.hanning(window)
    frames = np.lib.stride_tricks.sliding_window_view(sound, window)[:: window // 2] * shape
    return np.asarray((np.abs(np.fft.rfft(frames, axis=1)) ** 2).mean(axis=0) / (shape**2).sum())
