"""Split pairs are told from the recordings alone: whatever corrections have made of the pair's order, or of E/ρ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.mode_splitting import propose_mode_splitting
from sonic_bullet.records import ModalModel
from tests.few_cases import parametrize_few
from tests.made.body import plate, recorded, truth

BAND = (50.0, 7_500.0)
PAIRS = ((3, 4), (9, 10))


def degenerate() -> ModalModel:
    """The plate, two pairs of its modes at one frequency each."""
    model = plate()
    freq = model.freq_hz.copy()
    for a, b in PAIRS:
        freq[b] = freq[a]
    return replace(model, freq_hz=freq)


def split() -> ModeSplitting:
    freq = degenerate().freq_hz
    return ModeSplitting(tuple(float(freq[a]) for a, _ in PAIRS), (0.012, 0.009), (0.5, 2.0))


def told(body: StruckBody, correction: dict[int, float]) -> ModeSplitting:
    """What is proposed where the baseline has corrected some modes."""
    ratio = np.zeros(body.model.mode_count)
    for k, r in correction.items():
        ratio[k] = r
    found = propose_mode_splitting(evidence_of(replace(truth(), correction={"plate": ratio}), (body,), BAND))
    assert found is not None
    return found


@pytest.mark.slow
@parametrize_few("correction", [{}, {3: 0.006, 4: -0.006}, {3: -0.006, 4: 0.006, 9: 0.0045}], (2,))
def test_the_turn_is_the_meshs_whatever_corrections_say(correction: dict[int, float]) -> None:
    found = told(recorded(split(), model=degenerate(), seconds=1.0), correction)
    assert found.split == pytest.approx((0.012, 0.009), rel=0.02)
    assert found.turn_rad == pytest.approx((0.5, 2.0), abs=0.03)


@pytest.mark.slow
def test_pairs_are_found_where_elasticity_was_fitted_to_one_line_of_each() -> None:
    """All modes of the mesh 1 % high, and splits that add 0.6 %: the pairs agree on the scale between them."""
    body = recorded(split(), model=degenerate(), seconds=1.0)
    high = replace(body, model=replace(body.model, freq_hz=1.01 * body.model.freq_hz))
    found = told(high, {})
    assert len(found.split) == 2
    assert found.turn_rad == pytest.approx((0.5, 2.0), abs=0.03)


@pytest.mark.slow
def test_no_correction_sets_twins_apart() -> None:
    """What a mesh leaves together shares the mesh's error: corrections learnt again would else pass for the splitting
    itself, and a true one earn nothing.
    """
    body = recorded(split(), model=degenerate(), seconds=1.0)
    again = refit_material(truth(), (body,), anew=True).correction
    assert again is not None
    for a, b in PAIRS:
        assert again["plate"][a] == pytest.approx(again["plate"][b], abs=1e-12)
    alone = np.setdiff1d(np.arange(len(again["plate"])), np.array(PAIRS).ravel())
    assert np.abs(again["plate"][alone]).max() < 2e-3


def test_a_split_pair_sounds_as_two_modes_that_fill_the_same_space() -> None:
    """φφᵀ of the pair summed over both is the same, whatever the turn."""
    model = degenerate()
    after = split().apply(model)
    for a, b in PAIRS:
        before, now = model.shape[:, 2, [a, b]].astype(float), after.shape[:, 2, [a, b]].astype(float)
        assert np.allclose(before @ before.T, now @ now.T, atol=1e-6 * np.abs(before @ before.T).max())
        assert after.freq_hz[b] / after.freq_hz[a] - 1 == pytest.approx(0.012 if a == 3 else 0.009, rel=0.01)


def test_a_pair_that_one_strike_shows_is_no_single_mode_without_it() -> None:
    """Left out of the evidence, that strike leaves one line of the pair under the noise: the lines are there all the
    same, and the other strikes tell the turn.
    """
    body = recorded(split(), model=degenerate())
    whole = propose_mode_splitting(evidence_of(truth(), (body,), BAND))
    assert whole is not None
    assert body.recorded is not None
    less = thin_evidence(evidence_of(truth(), (body,), BAND), (body.recorded, 1), 1.0, np.random.default_rng(0))
    observed = less.observed[0]
    faint = np.abs(observed.freq_hz - whole.freq_hz[0] * (1 + whole.split[0] / 2)).argmin()
    sd = observed.amplitude_sd.copy()
    sd[:, faint] = np.abs(observed.amplitude[:, faint])
    less = replace(less, observed=(replace(observed, amplitude_sd=sd),))
    alone = propose_mode_splitting(less)
    assert alone is not None
    assert len(alone.freq_hz) == len(whole.freq_hz) - 1
    again = propose_mode_splitting(replace(less, known=whole))
    assert again is not None
    assert again.freq_hz == pytest.approx(whole.freq_hz, rel=1e-6)
    assert again.split == pytest.approx(whole.split, rel=1e-3)
    assert np.abs(np.sin(np.subtract(again.turn_rad, whole.turn_rad))).max() < 0.06


def test_lines_of_twins_go_to_their_own_modes_though_the_mesh_is_off_by_half_a_split() -> None:
    """The lower line of a pair lies on the mesh's upper twin then; the pair is where it was heard."""
    body = recorded(split(), model=degenerate())
    effect = split()
    off = body.model.freq_hz.copy()
    off[list(PAIRS[0])] /= 1.0095
    shifted = replace(body, model=replace(body.model, freq_hz=off))
    h = refit_material(truth(effect), (shifted,))
    got = np.sort(predict(h, shifted).model.freq_hz)
    want = np.sort(predict(truth(effect), body).model.freq_hz)
    assert np.abs(got / want - 1).max() < 1e-3


def rough(body: StruckBody, f: float, gain: list[float]) -> Evidence:
    """What is heard, amplitudes of lines about f off by a factor a strike, as shapes on a slope are."""
    every = evidence_of(replace(truth(), correction={"plate": np.zeros(body.model.mode_count)}), (body,), BAND)
    one, by = every.observed[0], np.array(gain)[:, None]
    near, strange = (np.abs(x / f - 1) < 0.01 for x in (one.freq_hz, one.foreign_hz))
    amplitude, foreign = (
        np.where(near, by * one.amplitude, one.amplitude),
        np.where(strange, by * one.foreign_amplitude, one.foreign_amplitude),
    )
    return replace(every, observed=(replace(one, amplitude=amplitude, foreign_amplitude=foreign),))


@pytest.mark.slow
@parametrize_few("plain", [1, 3], (1,))
def test_beside_three_plain_pairs_another_may_be_less_so(plain: int) -> None:
    """The plate with two or four pairs, of which the second's patterns are its modes' but for a factor of 0.35 at one
    strike and 1.7 at another.
    """
    places = ((9, 10), (3, 4), (6, 7), (14, 15))[: plain + 1]
    model = plate()
    freq = model.freq_hz.copy()
    for a, b in places:
        freq[b] = freq[a]
    model = replace(model, freq_hz=freq)
    apart = ModeSplitting(
        tuple(float(freq[a]) for a, _ in places),
        (0.012, 0.009, 0.01, 0.008)[: plain + 1],
        (0.5, 2.0, 1.0, 2.5)[: plain + 1],
    )
    body = recorded(apart, model=model, seconds=1.0)
    less = apart.freq_hz[1]
    found = propose_mode_splitting(rough(body, less, [1.0, 1.0, 1.0, 0.35, 1.7]))
    assert found is not None
    assert len(found.freq_hz) == (plain + 1 if plain == 3 else plain)
    assert (np.abs(np.array(found.freq_hz) / less - 1) < 5e-3).any() == (plain == 3)


@pytest.mark.slow
def test_neighbours_by_chance_that_the_mesh_has_too_near_are_no_split_pair() -> None:
    """Two modes 0.4 % apart in the mesh and 0.9 % in truth swing about the mesh's own axes; turned, or twins of the
    mesh, they are a pair.
    """
    model = plate()
    freq = model.freq_hz.copy()
    for a, b in PAIRS:
        freq[b] = 1.004 * freq[a]
    mesh = replace(model, freq_hz=freq)
    middle = tuple(float((freq[a] + freq[b]) / 2) for a, b in PAIRS)

    def found(turn: float) -> ModeSplitting | None:
        body = recorded(ModeSplitting(middle, (0.009, 0.009), (turn, turn)), model=mesh, seconds=1.0)
        return propose_mode_splitting(
            evidence_of(replace(truth(), correction={"plate": np.zeros(model.mode_count)}), (body,), BAND)
        )

    assert found(0.0) is None
    turned = found(0.6)
    assert turned is not None and turned.turn_rad == pytest.approx((0.6, 0.6), abs=0.05)
