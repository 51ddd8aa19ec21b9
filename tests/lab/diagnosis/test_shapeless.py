"""A body without a mesh: the lines that `fit` plays for modes, places as loud and in phase as they were recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.lab.diagnosis.evidence.strike_levels import with_levels
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody, shapeless
from sonic_bullet.lab.fit.held_out_takes import predicted_take
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.records import Array
from tests.few_cases import parametrize_few
from tests.made.body import SR, recorded

FLAT = Hypothesis(30.0, 4e-8, 1.0)


def evidence(change: Any = lambda r, i: r) -> RecordedObject:
    """The plate's strikes, changed one by one, as of an object without a mesh."""
    g = recorded().recorded
    assert g is not None
    return replace(g, recordings=tuple(change(r, i) for i, r in enumerate(g.recordings)))


def body_of(g: RecordedObject, more: tuple[CaseRecording, ...] = ()) -> StruckBody:
    case = SimpleNamespace(recordings=(*g.recordings, *more), band_hz=(20.0, 8000.0))
    return shapeless(cast(Any, SimpleNamespace(case=case)), g)


def told(body: StruckBody, freq_hz: Array) -> Array:
    """Complex amplitudes over impulse (s, k) of the model, by lines."""
    assert body.own_phase is not None
    which = np.abs(body.model.freq_hz[None] / freq_hz[:, None] - 1).argmin(axis=1)
    shape = body.model.shape[:, 0].astype(float)
    return np.asarray(shape[:-1] * shape[-1] * body.own_phase)[:, which]


def observed(g: RecordedObject) -> Array:
    """Amplitudes over impulse (s, k) as they were recorded."""
    return g.lines.amplitude / np.array([r.impulse_n_s or 1.0 for r in g.recordings])[:, None]


def test_every_place_is_as_loud_and_in_phase_as_it_is_heard() -> None:
    g = evidence()
    assert np.allclose(told(body_of(g), g.lines.freq_hz), observed(g), rtol=1e-5)


def test_strikes_at_one_place_or_at_places_not_told_share_amplitudes() -> None:
    g = evidence(lambda r, i: replace(r, position_m=(0.0, 0.0, 0.0)) if i < 2 else r)
    found, heard = np.abs(told(body_of(g), g.lines.freq_hz)), np.abs(observed(g))
    assert np.allclose(found[:2], np.sqrt(heard[0] * heard[1]), rtol=1e-5)
    assert np.allclose(found[2:], heard[2:], rtol=1e-5)
    g = evidence(lambda r, i: replace(r, position_m=None))
    heard = np.abs(observed(g))
    assert np.allclose(np.abs(told(body_of(g), g.lines.freq_hz)), np.exp(np.log(heard).mean(axis=0)), rtol=1e-5)


def test_a_held_out_strike_is_its_place_or_the_mean_over_all() -> None:
    g = evidence()
    again = replace(g.recordings[3], split="holdout")
    away = replace(again, position_m=(0.001, 0.002, 0.0))
    body = body_of(g, (again, away))
    here, there = np.abs(told(body, g.lines.freq_hz))[-2:]
    heard = np.abs(observed(g))
    assert here == pytest.approx(heard[3], rel=1e-5)
    assert body.impulse_n_s[-2] == again.impulse_n_s
    # of no known level where none was struck: the mean of what was recorded, not of that over its impulse
    assert np.isnan(body.impulse_n_s[-1])
    assert there == pytest.approx(np.exp(np.log(np.abs(g.lines.amplitude)).mean(axis=0)), rel=1e-5)


@parametrize_few("place", ["each its own", "one", "unknown"], (0, 2))
@pytest.mark.parametrize("impulse", ["known", "unknown"])
@pytest.mark.parametrize("rise_s", [0.0, 0.003])
def test_what_a_diagnosis_begins_from_is_what_fit_plays(place: str, impulse: str, rise_s: float) -> None:
    def change(r: CaseRecording, _: int) -> CaseRecording:
        r = r if place == "each its own" else replace(r, position_m=None if place == "unknown" else (0.0, 0.0, 0.0))
        return r if impulse == "known" else replace(r, impulse_n_s=None)

    g = evidence(change)
    g = replace(g, lines=replace(g.lines, rise_s=np.full(len(g.recordings), rise_s)))
    found = cast(Any, SimpleNamespace(plays_modes=lambda _: False))
    body, n = body_of(g), 4000
    for i, r in enumerate(g.recordings):
        fitted, free = predicted_take(found, g, r, n, SR)
        assert free == (impulse == "unknown") == bool(np.isnan(body.impulse_n_s[i]))
        assert predict(FLAT, body).sound(i, n, SR) == pytest.approx(fitted, abs=1e-5 * np.abs(fitted).max())


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0, 1.0, 1.0), (1.0, 3.0, 0.1, 20.0, 5.0), (0.2, 0.2, 2.0, 0.2, 0.2)])
def test_strikes_of_unknown_impulse_compare_as_loud_as_they_are_recorded(gains: tuple[float, ...]) -> None:
    """One strike, five times, each at a gain of its own."""
    g = evidence(lambda r, i: replace(r, position_m=None, impulse_n_s=None))
    one = g.lines.amplitude[:1] * np.array(gains)[:, None]
    body = with_levels(body_of(replace(g, lines=replace(g.lines, amplitude=one))), 1.0)
    assert body.level_n_s / body.level_n_s[0] == pytest.approx(np.array(gains) / gains[0], rel=1e-3)
    assert np.log(body.level_n_s).mean() == pytest.approx(0.0, abs=1e-6)
