"""A body without a mesh: its lines for modes, places as loud as they were recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sonic_bullet.diagnosis.prediction.struck_bodies import Struck, shapeless
from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.records import Array
from tests.made.body import recorded


def made(change: Any = lambda r, i: r, more: tuple[CaseRecording, ...] = ()) -> tuple[Struck, Array, Array]:
    """The body, and its lines' frequencies (k,) and amplitudes over impulse (s, k)."""
    g = recorded().recorded
    assert g is not None
    g = replace(g, recordings=tuple(change(r, i) for i, r in enumerate(g.recordings)))
    found = SimpleNamespace(case=SimpleNamespace(recordings=(*g.recordings, *more)))
    return (
        shapeless(cast(Any, found), g),
        g.lines.freq_hz,
        g.lines.amplitude / np.array([r.impulse_n_s for r in g.recordings])[:, None],
    )


def told(body: Struck, freq_hz: Array) -> Array:
    """Amplitudes over impulse (s, k) of the model, by lines."""
    which = np.abs(body.model.freq_hz[None] / freq_hz[:, None] - 1).argmin(axis=1)
    shape = body.model.shape[:, 0].astype(float)
    return np.asarray(shape[:-1] * shape[-1])[:, which]


def test_every_place_is_as_loud_as_it_is_heard() -> None:
    body, freq, observed = made()
    assert np.allclose(told(body, freq), observed.real, rtol=1e-3, atol=0.05 * np.abs(observed).max())
    assert np.allclose(np.abs(told(body, freq)), np.abs(observed), rtol=1e-5)


def test_strikes_at_one_place_or_at_places_not_told_share_amplitudes() -> None:
    body, freq, observed = made(lambda r, i: replace(r, position_m=(0.0, 0.0, 0.0)) if i < 2 else r)
    both = np.sqrt((np.abs(observed[:2]) ** 2).mean(axis=0))
    assert np.allclose(np.abs(told(body, freq)[:2]), both, rtol=1e-5)
    assert np.allclose(np.abs(told(body, freq)[2:]), np.abs(observed[2:]), rtol=1e-5)
    body, freq, observed = made(lambda r, i: replace(r, position_m=None))
    assert np.allclose(told(body, freq), np.sqrt((np.abs(observed) ** 2).mean(axis=0)), rtol=1e-5)


def test_a_held_out_strike_is_its_place_or_the_rms_over_all() -> None:
    g = recorded().recorded
    assert g is not None
    again = replace(g.recordings[3], split="holdout")
    away = replace(again, position_m=(0.001, 0.002, 0.0))
    body, freq, observed = made(more=(again, away))
    here, there = told(body, freq)[-2:]
    assert np.abs(here) == pytest.approx(np.abs(observed[3]), rel=1e-5)
    assert there == pytest.approx(np.sqrt((np.abs(observed) ** 2).mean(axis=0)), rel=1e-5)
