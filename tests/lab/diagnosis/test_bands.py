"""A small mean distance is no comfort where one band is off: what stands above the noise is compared band by band
before a verdict `none`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import EFFECTS
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.band_levels import CENTRE_HZ, HALF_BAND, BandOff, in_words, off_in, over_db
from sonic_bullet.lab.diagnosis.selection.stepwise import SelectionEnd, select_effects
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained
from sonic_bullet.lab.lines.joint_lines import Lines
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import white, with_noise
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import SR, plate, recorded, struck

LOUDER = 4  # of the plate's modes: 1320 Hz, alone in its third octave


def lines_and_signals(body: StruckBody) -> tuple[Lines, Array]:
    assert body.recorded is not None and body.recorded.signals is not None
    return body.recorded.lines, body.recorded.signals


def one_band_louder() -> StruckBody:
    """The plate, recorded where a band's modes are twice as loud as the mesh says at every strike: an error of the
    sensor's response, say.
    """
    model = plate()
    shape = model.shape.copy()
    shape[-1, :, LOUDER] *= 2.0
    return struck(model, *lines_and_signals(recorded(model=replace(model, shape=shape))))


def one_mode_more(hz: float = 5600.0, decay_per_s: float = 120.0) -> StruckBody:
    """The plate and, in every strike, a mode that the model has not, and no line either."""
    body = recorded()
    lines, signals = lines_and_signals(body)
    assert plate().freq_hz.max() < 0.8 * hz
    t = np.arange(signals.shape[1]) / SR
    rng = np.random.default_rng(3)
    level = 0.01 * np.abs(signals).max(axis=1) * rng.choice([-1, 1], len(signals))
    return struck(plate(), lines, signals + level[:, None] * np.exp(-decay_per_s * t) * np.cos(2 * np.pi * hz * t))


@parametrize_few(("made", "from_hz", "to_hz"), [
    (one_band_louder, 1.1e3, 1.6e3),
    (one_mode_more, 4.4e3, 7.1e3),
], (1,), ids=["one band 6 dB louder", "a mode that is nobody's line"])  # fmt: skip
def test_what_a_mean_distance_blurs_is_no_comfort(made: Callable[[], StruckBody], from_hz: float, to_hz: float) -> None:
    """By the mean alone both are `none`, the model suffices."""
    body = made()
    takes = takes_of((body,))
    end = select_effects(fitted(body), (body,), takes, (), BAND)
    assert isinstance(end, SelectionEnd)
    assert end.before_db - end.floor_db < RULES.suffices_db
    assert end.verdict == "unexplained" and end.added == () and end.bands
    assert all(
        from_hz < b.from_hz < b.to_hz < to_hz and b.recorded_over_played_db > 3.0 and b.strikes == 5 for b in end.bands
    )
    words = describe_unexplained(end, takes)
    assert words["words"].startswith("recorded ") and " dB more than played between " in words["words"]
    assert words["bands_off"][0]["strikes"] == 5


@parametrize_few("seed", [6, 7], 1)
def test_nothing_is_off_where_nothing_lacks(seed: int) -> None:
    body = recorded(seed=seed)
    end = select_effects(fitted(body), (body,), takes_of((body,)), (), BAND)
    assert isinstance(end, SelectionEnd) and end.verdict == "none" and end.bands == ()


def test_no_effect_is_looked_for_where_comfort_alone_is_taken_away(monkeypatch: pytest.MonkeyPatch) -> None:
    from sonic_bullet.lab.diagnosis.selection import stepwise as loop

    asked: list[int] = []
    body = one_mode_more()
    monkeypatch.setattr(loop, "cross_validated", lambda *_, **__: asked.append(1) or [])
    monkeypatch.setattr(loop, "pairwise", lambda *_, **__: asked.append(2))
    end = select_effects(fitted(body), (body,), takes_of((body,)), EFFECTS, BAND)
    assert end.verdict == "unexplained"
    rounds = len(asked)
    monkeypatch.setattr(loop, "bands_off", lambda *_: ())
    end = select_effects(fitted(body), (body,), takes_of((body,)), EFFECTS, BAND)
    assert end.verdict == "none" and len(asked) == 2 * rounds


def tone(hz: float, level: float = 1.0, seconds: float = 0.5, decay_per_s: float = 20.0) -> Array:
    t = np.arange(round(seconds * SR)) / SR
    return np.asarray(level * np.exp(-decay_per_s * t) * np.sin(2 * np.pi * hz * t))


def over(recorded: Array, played: Array, noise: float = 1e-4) -> Array:
    floor = white(noise)
    return over_db(with_noise(recorded, floor, 3), played, SR, floor, BAND)


def test_a_tone_twice_as_loud_is_6_db_more_in_its_bands_early_and_late_and_nowhere_else() -> None:
    found = over(tone(2000, 2.0), tone(2000))
    mine = np.abs(np.log2(CENTRE_HZ / 2000)) < 1 / 6 - 0.01
    assert mine.sum() == 1
    assert found[:, mine] == pytest.approx(20 * np.log10(2), abs=0.1)
    assert np.nanmax(np.abs(found[:, np.abs(np.log2(CENTRE_HZ / 2000)) > 0.6]), initial=0.0) < 1.0


def test_early_and_late_are_told_apart() -> None:
    """A decay three times as fast: as loud at first, silent later."""
    found = over(tone(2000, decay_per_s=20), tone(2000, decay_per_s=60))
    b = int(np.abs(CENTRE_HZ - 2000).argmin())
    assert abs(found[0, b]) < 7.0 and found[1, b] > 15.0


def test_a_tone_on_a_bands_edge_belongs_to_either_side() -> None:
    """As far off as corrections go: it leaves one band for the next, and neither lacks it."""
    edges = CENTRE_HZ[(CENTRE_HZ > 400) & (CENTRE_HZ < 6000)][::3] * HALF_BAND
    for hz in edges:
        for off in (0.008, -0.008):
            found = over(tone(hz), tone(hz * (1 + off)), noise=0.01)
            assert np.isfinite(found).any() and np.nanmax(np.abs(found)) < 1.0, (hz, off)


def test_below_the_noise_nothing_is_compared() -> None:
    floor = white(1.0)
    quiet = np.array(
        [over_db(with_noise(tone(2000, 0.02), floor, s), tone(2000, 0.01), SR, floor, BAND) for s in range(40)]
    )
    assert np.isnan(quiet).mean() > 0.99 and off_in(quiet) == ()


def test_noise_alone_takes_no_comfort_away() -> None:
    """A tone 13 dB above the noise in its bands at most, and five strikes: of 12 draws none is off."""
    floor = white(1.0)
    draws = [
        [
            over_db(
                with_noise(tone(2000, 1.5, decay_per_s=4), floor, 100 * k + s),
                tone(2000, 1.5, decay_per_s=4),
                SR,
                floor,
                BAND,
            )
            for s in range(5)
        ]
        for k in range(12)
    ]
    told = np.array(draws)
    assert np.isfinite(told).any()
    assert not any(off_in(one) for one in told)


def table(*strikes: list[float]) -> Array:
    """Recorded over played (s, 2, b): the given bands in the first part, the others nothing."""
    made = np.full((len(strikes), 2, len(CENTRE_HZ)), np.nan)
    for row, values in zip(made, strikes, strict=True):
        row[0, 10 : 10 + len(values)] = values
    return made


@pytest.mark.parametrize(("strikes", "off"), [
    (([4.0], [4.5], [5.0], [4.2]), True),
    (([2.0], [3.5], [2.5], [3.2]), False),  # under 3 dB
    (([-1.0], [16.0], [0.5], [1.5]), False),  # one strike alone, which is no evidence
    (([4.0, 0.1, 0.0], [4.1, 0.0, -0.2]), True),
    (([4.0, 5.0, -5.0], [4.0, -5.0, 5.0]), False),  # two may agree by chance: other bands' strikes do not
    (([9.0, 0.3, -0.4, 0.1, 0.2, -0.3, 0.0],), True),  # a single strike: one band of many
    (([4.0, 3.0, -4.0, 3.5, 2.0, -3.0, 1.0],), False),  # a single strike that is off everywhere, either way
    (([9.0],), False),  # a single number has no spread
])  # fmt: skip
def test_a_mean_is_off_by_3_db_and_by_what_strikes_agree_on(strikes: tuple[list[float], ...], off: bool) -> None:
    found = off_in(table(*strikes))
    assert [b.from_hz for b in found] == ([pytest.approx(CENTRE_HZ[10] / HALF_BAND)] if off else [])


def test_bands_in_words() -> None:
    one = BandOff(1800.0, 2200.0, True, 5.21, 0.4, 8)
    assert str(one) == "recorded 5.2 dB more than played between 1.8 and 2.2 kHz in the first 50 ms, 8 strikes"
    wide = (one, BandOff(2000.0, 2500.0, True, 4.0, 0.4, 8), BandOff(500.0, 630.0, False, -7.0, 0.5, 1))
    assert in_words(wide) == (
        "recorded 7.0 dB less than played between 0.5 and 0.63 kHz after the first 50 ms, 1 strike; "
        "recorded up to 5.2 dB more than played between 1.8 and 2.5 kHz in the first 50 ms, 8 strikes"
    )
