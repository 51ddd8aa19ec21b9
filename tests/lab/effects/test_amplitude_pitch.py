"""Modes that glide: where they are at rest, how fast they fall, and that lines of their own are no neighbours."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.amplitude_dependence import amplitude_dependent, fallen, turns_rad
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, with_effects
from sonic_bullet.lab.diagnosis.evidence.small_amplitude import _off_hz, at_rest
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects import amplitude_pitch
from sonic_bullet.lab.effects.amplitude_pitch import _moments, _slopes, propose_amplitude_pitch
from sonic_bullet.lab.effects.amplitude_pitch.degenerate_pitch import BEND_FACTORS, bend_with_axes
from sonic_bullet.lab.effects.common.envelope import Envelopes, alone, envelopes, window_signal
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.lab.diagnosis.test_recording_chain import true_decay
from tests.lab.effects.test_amplitude_damping import PAIR, assert_nearer_than_the_meshs, with_twins
from tests.made.body import GAIN, plate, recorded

BENT = AmplitudePitch(0.35, "velocity")
FAR = 2e-3  # of a frequency: what a linear fit of a mode that glides may be off


@cache
def made(bend: float) -> StruckBody:
    return recorded(AmplitudePitch(bend, "velocity")) if bend else recorded()


@pytest.mark.slow
def test_modes_ring_down_to_where_they_are_at_rest() -> None:
    """Corrections that are off come back to the plate's own frequencies beside the true bend, of all modes that stand
    alone.
    """
    body = made(BENT.bend)
    h = fitted(body)
    told = evidence_of(h, (body,), BAND).observed[0]
    mine = np.concatenate([told.mode[k] for k in alone(told)[0]])
    others = np.setdiff1d(np.arange(len(plate().freq_hz)), mine)
    assert len(mine) > 12 and len(others) > 0
    wrong = replace(h, correction={"plate": np.full(len(plate().freq_hz), FAR)}, effects=(BENT,))
    rested = refit_material(wrong, (body,)).correction
    assert rested is not None
    assert np.abs(rested["plate"][mine]).max() < 0.1 * FAR
    assert rested["plate"][others] == pytest.approx(FAR)
    back = with_effects(replace(wrong, correction=rested), (), (body,)).correction
    assert back is not None and (back["plate"] == body.correction).all(), (
        "without the effect they are the baseline's again"
    )


def test_modes_are_brought_to_rest_by_the_strikes_that_are_left() -> None:
    """Without its first strike, as a fold leaves one out, all modes that stand alone come as near as with it."""
    body = made(BENT.bend)
    h = fitted(body)
    told = evidence_of(h, (body,), BAND).observed[0]
    mine = np.concatenate([told.mode[k] for k in alone(told)[0]])
    wrong = replace(h, correction={"plate": np.full(len(plate().freq_hz), FAR)}, effects=(BENT,))

    def off(strike: tuple[int, ...]) -> float:
        rested = at_rest(wrong, (body,), (replace(told, strike=strike),), every=True).correction
        assert rested is not None
        return float(np.abs(rested["plate"][mine]).max())

    assert off(told.strike[1:]) < 1.2 * off(told.strike) < 0.5 * FAR


def test_what_does_not_glide_stays_where_it_is() -> None:
    body = made(0.0)
    h = fitted(body)
    faint = refit_material(replace(h, effects=(AmplitudePitch(1e-7, "velocity"),)), (body,))
    assert faint.correction is not None and h.correction is not None
    assert (faint.correction["plate"] == h.correction["plate"]).all()


def test_what_a_long_pulse_has_left_faint_does_not_glide() -> None:
    """A mode far above the pulse's own spectrum starts as softly as that has it, and turns by the square of it."""
    body = made(BENT.bend)
    h = fitted(body)
    long = ContactTime(6e-4, 0.02)
    lines = [evidence_of(replace(h, effects=effects), (body,), BAND).observed[0] for effects in ((BENT,), (BENT, long))]
    hard = turns_rad(predict(replace(h, effects=(BENT,)), body), lines[0])
    soft = turns_rad(predict(replace(h, effects=(BENT, long)), body), lines[1])
    one = lines[1]
    pressed = np.stack([one.pressed[:, m].max(axis=1) for m in one.mode], axis=1)
    assert pressed.min() < 0.1
    assert pressed.max() > 0.9
    assert soft == pytest.approx(hard * pressed**2, rel=0.05, abs=1e-6)
    assert (
        0
        < np.count_nonzero(amplitude_dependent(predict(replace(h, effects=(BENT, long)), body), one))
        < len(one.freq_hz)
    )


def test_a_bend_by_impulse_is_told_by_what_the_pulse_leaves_of_it() -> None:
    """As it is played: by how hard a mode is pushed, not by the hammer's own impulse."""
    pulse, bend = ContactTime(4e-4, 0.02), 40.0
    body = recorded(pulse, AmplitudePitch(bend, "impulse"))
    found = propose_amplitude_pitch(evidence_of(replace(fitted(body), effects=(pulse,)), (body,), BAND))
    assert found is not None
    assert found.measure == "impulse"
    assert found.bend == pytest.approx(bend, rel=0.15)


@parametrize_few("bend", [0.35, 1.0], 1)
def test_a_level_falls_as_the_linear_mode_does_while_its_lines_do_not(bend: float) -> None:
    bent = AmplitudePitch(bend, "velocity")
    body = made(bend)
    lines = evidence_of(fitted(body), (body,), BAND).observed[0]
    told = fallen(predict(replace(fitted(body), effects=(bent,)), body), lines)
    changed = told.decay_per_s != lines.decay_per_s
    before = np.abs(np.log(lines.decay_per_s / true_decay(lines.freq_hz)))[changed]
    after = np.abs(np.log(told.decay_per_s / true_decay(told.freq_hz)))[changed]
    assert changed.sum() > 12 and np.median(after) < 0.01 and after.max() < 0.1 < before.max()


@pytest.mark.slow
def test_a_gain_is_told_by_what_does_not_glide() -> None:
    body = made(1.0)
    h = replace(fitted(body), effects=(AmplitudePitch(1.0, "velocity"),))
    assert refit_material(h, (body,)).gain == pytest.approx(GAIN, rel=0.02)
    assert abs(refit_material(fitted(body), (body,)).gain / GAIN - 1) > 0.03, (
        "lines of what glides hold but a part of it"
    )


@pytest.mark.slow
def test_gliding_twins_have_their_own_axes() -> None:
    """One of two twins may be loud, and glide away, where the other has hardly been struck; with the mesh's axes both
    would.
    """
    model = with_twins()
    middle = float(model.freq_hz[PAIR[0]])
    bent = AmplitudePitch(0.7, "velocity", (middle,), (0.6,))
    body = recorded(bent, model=model)
    base = refit_material(fitted(body), (body,))
    evidence = evidence_of(base, (body,), BAND)
    found = propose_amplitude_pitch(evidence)
    assert found is not None and found.bend == pytest.approx(0.7, rel=0.05)
    assert found.freq_hz == pytest.approx((middle,), rel=5e-3)
    assert found.turn_rad[0] == pytest.approx(0.6, abs=0.06)
    assert_nearer_than_the_meshs(found, base, body, evidence)


@pytest.mark.slow
def test_axes_of_twins_are_held_on_trial_and_learnt_again_beside_other_effects() -> None:
    """By all fitted strikes, once; but where another effect has moved modes meanwhile, what were twins may be two
    lines, and have no axes to turn.
    """
    model = with_twins()
    body = recorded(AmplitudePitch(0.7, "velocity", (float(model.freq_hz[PAIR[0]]),), (0.6,)), model=model)
    told = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND)
    wrong = AmplitudePitch(0.7, "velocity", (float(model.freq_hz[PAIR[0]]),), (1.2,))
    held, learnt = (propose_amplitude_pitch(replace(told, known=wrong, held_out=trial)) for trial in (True, False))
    assert held is not None and held.turn_rad == (1.2,)
    assert learnt is not None and learnt.turn_rad[0] == pytest.approx(0.6, abs=0.06)
    apart = replace(
        told.observed[0],
        plain=replace(model, freq_hz=np.sort(model.freq_hz * np.linspace(1, 1.05, len(model.freq_hz)))),
    )
    split = propose_amplitude_pitch(replace(told, observed=(apart,), known=wrong))
    assert split is not None and split.turn_rad == ()


@pytest.mark.slow
@parametrize_few("off_per_s", [-5.0, 5.0], 1)
def test_twins_that_glide_and_beat_fall_as_what_is_played_does(off_per_s: float) -> None:
    """By what it is played with that is a third off, their decay is told to 5 %, and by that to 2 %; the line itself is
    farther off.
    """
    model = with_twins()
    middle = float(model.freq_hz[PAIR[0]])
    bent = AmplitudePitch(2.0, "velocity", (middle,), (0.6,))
    body = recorded(bent, model=model)
    h = replace(fitted(body), effects=(bent,))
    lines = evidence_of(replace(h, effects=()), (body,), BAND).observed[0]
    k = int(np.abs(lines.freq_hz / middle - 1).argmin())
    assert len(lines.mode[k]) == 2
    right = float(true_decay(lines.freq_hz[k : k + 1])[0])
    assert abs(lines.decay_per_s[k] / right - 1) > 0.02
    told = right + off_per_s
    for close in (0.05, 0.02):
        alpha = 2 * told - h.beta_s * (2 * np.pi * middle) ** 2
        told = float(fallen(predict(replace(h, alpha_per_s=alpha), body), lines).decay_per_s[k])
        assert told == pytest.approx(right, rel=close)


@pytest.mark.slow
def test_twins_that_are_played_as_two_are_not_turned() -> None:
    """Two modes that corrections have left apart are no pair of one frequency: about other axes they would be two
    others.
    """
    model = with_twins()
    body = recorded(AmplitudePitch(0.7, "velocity", (float(model.freq_hz[PAIR[0]]),), (0.6,)), model=model)
    told = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND)
    one = told.observed[0]
    assert one.model is not None
    freq = one.model.freq_hz.copy()
    freq[PAIR[1]] *= 1 + 9e-4
    apart = replace(one, model=replace(one.model, freq_hz=freq))
    for observed, turned in ((one, 1), (apart, 0)):
        found = propose_amplitude_pitch(replace(told, observed=(observed,)))
        assert found is not None and len(found.turn_rad) == turned


@pytest.mark.slow
def test_a_bend_is_told_with_the_axes_of_twins() -> None:
    """From half as far off as twins, read as one mode, may lead."""
    model = with_twins()
    bent = AmplitudePitch(0.7, "velocity", (float(model.freq_hz[PAIR[0]]),), (0.6,))
    body = recorded(bent, model=model)
    told = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    e = envelopes(told)
    assert e is not None
    assert bend_with_axes(e, told, "velocity", 0.5, BEND_FACTORS) == pytest.approx(0.7, rel=0.04)


def test_in_a_room_no_line_is_one_modes_alone() -> None:
    body = made(BENT.bend)
    told = evidence_of(replace(fitted(body), effects=(Room(0.4, 0.3, 3),)), (body,), BAND).observed[0]
    assert told.dry
    h = replace(fitted(body), effects=(BENT,))
    assert fallen(predict(h, body), told) is told
    assert at_rest(h, (body,), (told,)).correction == h.correction


@parametrize_few("bend", [0.35, 1.0], 1)
def test_lines_of_a_modes_own_chain_are_no_neighbours(bend: float) -> None:
    body = made(bend)
    told = evidence_of(fitted(body), (body,), BAND).observed[0]
    assert len(told.foreign_hz) > 5, "chains"
    assert len(alone(told)[0]) >= 6


def test_phases_are_whole_turns_apart_however_few_the_frames_are() -> None:
    """The loudest modes turn by more than half between two frames where they begin."""
    body = made(1.0)
    told = evidence_of(fitted(body), (body,), BAND).observed[0]
    e = envelopes(told)
    assert e is not None
    assert np.abs(np.exp(1j * e.phase) - e.z / np.abs(e.z))[e.good].max() < 1e-6
    turned = np.abs(np.diff(e.phase, axis=2))[e.good[:, :, 1:] & e.good[:, :, :-1]]
    assert turned.max() > np.pi


@parametrize_few(("reach_hz", "off_hz"), [(7.5, 0.0), (20.0, 15.0)], (1,))
def test_a_mode_at_rest_is_not_taken_for_its_neighbour(reach_hz: float, off_hz: float) -> None:
    """What is played there may be the neighbour's alone, 15 Hz away: with less than that in reach nothing is moved, nor
    to the end of the reach.
    """
    t = np.linspace(0.01, 0.5, 96)[None]
    observed, good = np.exp(2j * np.pi * 15 * t)[None], np.ones((1, 1, 96), bool)
    recording = Envelopes(
        t, observed, good, np.zeros(1, int), np.full((1, 1), 1e-3), np.angle(observed), np.full(1, 0.02)
    )
    assert _off_hz(recording, replace(recording, z=np.ones_like(observed)), 0, reach_hz) == pytest.approx(
        off_hz, abs=0.02
    )


def test_a_bend_that_one_lone_mode_alone_tells_is_told_by_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three modes without a twin, but two of them hardly move: the pairs have to say it, too."""
    body = made(BENT.bend)
    told = evidence_of(fitted(body), (body,), BAND).observed[0]
    e = envelopes(told)
    assert e is not None
    assert _slopes(e, told, None)["velocity"].single
    lone = e.line[:3]

    def still(e: Envelopes, h: ObjectEvidence, level: np.ndarray, q: int) -> tuple[float, float, float] | None:
        """Two of the three hardly move: what a bend would turn is a thousandth of what there is."""
        xx, xy, yy = _moments(e, h, level, q) or (0.0, 0.0, 0.0)
        return (1e-6 * xx, 1e-3 * xy, yy) if q < 2 else (xx, xy, yy)

    monkeypatch.setattr(amplitude_pitch, "degenerate", lambda _, k: k not in lone)
    monkeypatch.setattr(amplitude_pitch, "_moments", still)
    found = _slopes(e, told, None)["velocity"]
    assert not found.single
    assert found.bend == pytest.approx(BENT.bend, rel=0.15)
    assert not _slopes(e, told, AmplitudePitch(-BENT.bend)), "the other way is another bend"


@pytest.mark.slow
def test_a_bend_is_told_by_the_levels_that_the_pulse_leaves() -> None:
    """A long contact hardly drives high modes: it is their own velocity they bend with, not what the impulse alone
    would give them.
    """
    pulse, bent = ContactTime(6e-4, 0.016, 0.0), AmplitudePitch(0.7, "velocity")
    body = recorded(pulse, bent, noise=2e-6)
    told = evidence_of(refit_material(replace(fitted(body), effects=(pulse,)), (body,)), (body,), BAND)
    assert told.observed[0].pressed.min() < 0.2 and told.observed[0].pressed.max() > 0.9
    found = propose_amplitude_pitch(told)
    assert found is not None and found.measure == "velocity"
    assert found.bend == pytest.approx(0.7, rel=0.1)


@pytest.mark.parametrize("length", [5, 401, 1_999])
def test_a_mode_shifted_to_zero_is_what_the_window_says(length: int) -> None:
    """Running sums of three exponentials are the window's sum, sample by sample, at both ends too, whatever came
    before.
    """
    rng = np.random.default_rng(length)
    n, omega = 6_000, 0.37
    y = rng.standard_normal(n) * np.exp(-np.arange(n) / 300.0)
    at = np.array([0, 1, length // 2, 1_500, 3_300, n - 2, n - 1])
    window = np.hanning(length + 2)[1:-1]
    padded = np.concatenate([np.zeros(length), y * np.exp(-1j * omega * np.arange(n)), np.zeros(length)])
    direct = np.array(
        [
            2 * (padded[length + m - length // 2 : length + m + length // 2 + 1] * window).sum() / window.sum()
            for m in at
        ]
    )
    assert np.allclose(window_signal(y, omega, length, at), direct, rtol=1e-6, atol=1e-12 * np.abs(direct).max())
