"""Lines in a room: what a tail makes of a mode, taken back; and what is told of other effects beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.protocol import Sound, Stage
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, object_evidence, outside
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, whole
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.effects.common import reverberant_tail as tails
from sonic_bullet.lab.effects.foreign_mode import propose_foreign_mode
from sonic_bullet.lab.effects.room import _one, identified_room, late, propose_room
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.lab.lines.joint_lines import noise_rms
from sonic_bullet.signal.log_spectral import Floor, white, with_noise
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import ALPHA, BETA, recorded, truth

RT60 = float(np.log(1e3))


def test_the_covariance_of_a_driven_tail() -> None:
    """`_tail`'s closed form against ten thousand tails drawn tap by tap and rung through the mode."""
    decay, delta, step, n = 40.0, 9.0, 5e-4, 240
    rng = np.random.default_rng(2)
    t = (np.arange(n) + 0.5) * step
    tap = rng.standard_normal((10_000, n)) * np.sqrt(2 * delta * step) * np.exp(-delta * t)
    ring = np.exp(-decay * (t[:, None] - t)) * (t[:, None] >= t)
    r = tap @ ring.T
    start = np.array([0.0, 0.012, 0.03, 0.06, 0.09])
    window = np.hanning(26)[1:-1]
    frame = np.stack([r[:, round(s / step) : round(s / step) + 24] @ (window / window.sum()) for s in start], axis=1)
    drawn = frame.T @ frame / len(frame)
    _, value, turn = tails._tail(tuple(start.tolist()), decay, delta)
    back = np.linalg.inv(turn[:, 1:])
    told = back @ np.diag(value) @ back.T
    assert np.allclose(told, drawn, rtol=0.06, atol=0.02 * drawn.max())


@pytest.mark.slow
def test_modes_read_through_a_room() -> None:
    """Decays and gains that a strong room hides from the lines come back within the spreads said."""
    body = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    observed = object_evidence(predict(truth(), body))
    dry = tails.remove_tail(observed, RT60 / 0.9)
    own = 0.5 * (ALPHA + BETA * dry.omega**2)
    off = np.log(dry.decay_per_s / own)
    assert np.abs(off).mean() < 0.4 * np.abs(np.log(observed.decay_per_s / own)).mean()
    assert np.sqrt(np.mean((off / (dry.decay_sd_per_s / dry.decay_per_s)) ** 2)) < 1.6
    size = np.abs(dry.amplitude).max(axis=0) / np.abs(dry.expected).max(axis=0)
    assert np.exp(np.abs(np.log(size)).mean()) < 1.35
    assert tails.remove_tail(dry, 5.0) is dry  # what is dry stays as it is


@pytest.mark.slow
def test_what_outlasts_a_room_is_left_as_it_was_heard() -> None:
    """By lines and by what they are read to be: a faint line of a mode that dies sooner may beat with the tail, and be
    heard to ring on.
    """
    observed = object_evidence(predict(truth(), recorded(Room(0.15, 0.3, 4), seconds=1.2)))
    own, delta = 0.5 * (ALPHA + BETA * observed.omega**2), RT60 / 0.15
    slow = own < 0.4 * delta
    assert slow.sum() >= 3
    dry = tails.remove_tail(observed, delta)
    assert np.array_equal(dry.decay_per_s[slow], observed.decay_per_s[slow])
    assert np.abs(np.log(dry.decay_per_s / own))[slow].max() < 0.05
    assert np.array_equal(dry.freq_hz[slow], observed.freq_hz[slow])
    fast = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    beats = object_evidence(predict(truth(), fast))
    beats = replace(
        beats, decay_per_s=np.full(len(beats.freq_hz), 2.0), decay_sd_per_s=np.full(len(beats.freq_hz), 0.02)
    )
    assert (tails.remove_tail(beats, RT60 / 0.9).decay_per_s > 4.0).all()


@pytest.mark.slow
def test_what_is_gone_at_once_or_is_not_like_its_mode_tells_no_decay() -> None:
    """Of a lossy body in a room most lines are the room's own: they would bend the material's law to the room's."""
    observed = object_evidence(predict(truth(), recorded(Room(0.9, 0.9, 4), seconds=1.2)))
    assert np.isfinite(tails.remove_tail(observed, RT60 / 0.9).decay_sd_per_s).all()
    other = observed.amplitude.copy()
    other[:, 2] = (
        np.array([1.0, -1.0, 1.0, -1.0, 1.0])
        * np.abs(other[:, 2]).mean()
        * np.sign(observed.expected[:, 2].real)
        * np.array([1, 1, 1, 1, -1])
    )
    other[:, 2] -= (
        (np.conj(observed.expected[:, 2]) @ other[:, 2])
        / (np.abs(observed.expected[:, 2]) ** 2).sum()
        * observed.expected[:, 2]
    )
    told = tails.remove_tail(replace(observed, amplitude=other), RT60 / 0.9).decay_sd_per_s
    assert np.isinf(told[2]) and np.isfinite(np.delete(told, 2)).all()
    lossy = recorded(Room(0.9, 0.9, 4), DampingLaw("constant-loss", eta=0.05), seconds=1.2)
    dry = tails.remove_tail(object_evidence(predict(truth(), lossy)), RT60 / 0.9)
    assert (np.isinf(dry.decay_sd_per_s) >= (dry.decay_per_s > tails.FASTEST)).all() and np.isinf(
        dry.decay_sd_per_s
    ).any()


@pytest.mark.parametrize(
    ("gain", "room"),
    [
        ((20.0,) * 5, True),
        ((20.0,) * 4, False),
        ((150.0,) * 3, True),
        ((600.0, 12.0, 14.0), False),
        ((150.0,) * 2, False),
    ],
)
def test_fewer_lines_will_do_that_tell_a_tail_more_plainly(gain: tuple[float, ...], room: bool) -> None:
    """Of ten or twelve that ring: a long-lived body has few that die sooner than the room; radiation above its knee
    makes a few alike, but hardly like a tail.
    """
    count = 10 if len(gain) == 3 else 12
    told = np.zeros((3, count))
    told[1, : len(gain)] = gain
    decay = np.where(np.arange(count) < len(gain), 60.0, 4.0)
    none = np.zeros((3, count))
    read = tails.TailEstimates(
        np.array([15.0, 20.0, 27.0]), told, np.zeros(count), np.tile(decay, (3, 1)), none, none, none, none, none
    )
    assert _one(read, 1) == room


@pytest.mark.slow
@parametrize_few("rt60", [0.5, 1.6], 1)
def test_the_rate_of_a_room(rt60: float) -> None:
    """Three rooms: how wet one sounds to a dozen lines is a matter of its taps, by a third."""
    found = [
        late(object_evidence(predict(truth(), recorded(Room(rt60, 0.5, seed), seconds=1.2)))) for seed in (7, 8, 9)
    ]
    assert all(one is not None for one in found)
    for delta, _ in (one for one in found if one):
        assert RT60 / delta == pytest.approx(rt60, rel=0.12)
    assert np.median([reverberant_level for _, reverberant_level in (one for one in found if one)]) == pytest.approx(
        0.5, rel=0.25
    )


def test_a_room_is_told_over_a_floor_that_is_not_white() -> None:
    """A floor is 30 dB denser at 100 Hz than at 4 kHz: over its quietest part's density low lines' tails never end."""
    observed = object_evidence(predict(truth(), recorded(Room(0.9, 0.5, 7), seconds=1.2)))
    assert observed.signal is not None
    freq = np.maximum(np.linspace(0, observed.sr / 2, 2049), 50.0)
    level = 0.13 * float(np.abs(observed.signal).max())
    floor = Floor((0.1 * level) ** 2 * (1 + (1000.0 / freq) ** 2.5))
    noisy = np.stack([with_noise(x, floor, i) for i, x in enumerate(observed.signal)])
    told = replace(observed, signal=noisy, noise=noise_rms(noisy, observed.sr), floor=floor)
    found = late(told)
    assert found is not None and RT60 / found[0] == pytest.approx(0.9, rel=0.15)
    white_floor = late(replace(told, floor=None))
    assert white_floor is None or RT60 / white_floor[0] > 1.2 * 0.9


@parametrize_few(
    "effect",
    [
        DampingLaw("constant-loss", 6e-3),
        ForeignMode((1000.0, 2610.0), (11.0, 25.0), (1.2, 0.9), (0.3, -1.0)),
        MeasurementChain(hum_hz=50.0, hum_amplitude=(0.01, 0.005), hum_phase_rad=(0.0, 1.0)),
    ],
    1,
    ids=lambda e: e.id,
)
def test_no_room_where_none_is(effect: object) -> None:
    body = recorded(effect)  # type: ignore[arg-type]
    assert late(object_evidence(predict(refit_material(fitted(body), (body,)), body))) is None


@pytest.mark.slow
@parametrize_few(
    ("other", "parameter", "within"),
    [(ContactTime(4e-4, 0.016, 0.0, "half-sine"), "tau_s", 0.15), (DampingLaw("constant-loss", 8e-3), "eta", 0.2)],
    1,
    ids=["contact-time", "damping-law"],
)
def test_another_effect_is_told_beside_a_room(other: ContactTime | DampingLaw, parameter: str, within: float) -> None:
    """From lines as the room made them it is not, or not with its own number."""
    body = recorded(other, Room(0.9, 0.8, 11), seconds=1.2)
    base = refit_material(fitted(body), (body,))
    room = propose_room(evidence_of(base, (body,), BAND))
    assert room is not None
    assert room.rt60_s == pytest.approx(0.9, rel=0.12)
    beside = refit_material(replace(base, effects=(room,)), (body,), evidence_of(base, (body,), BAND).observed)
    found = propose(type(other), evidence_of(beside, (body,), BAND))
    assert found is not None
    assert found.parameters()[parameter] == pytest.approx(other.parameters()[parameter], rel=within)


def test_what_rings_along_is_heard_in_the_room_and_both_through_the_chain() -> None:
    """However they were found: a sound takes its own way."""
    chain, room, lodger = (
        MeasurementChain(high_pass_hz=900.0),
        Room(0.5, 0.5, 3),
        ForeignMode((1000.0,), (9.0,), (1.0,), (0.0,)),
    )
    assert [e.id for e in truth(chain, room, lodger).at(Stage.SOUND)] == ["foreign-mode", "room", "measurement-chain"]


def test_lines_are_dried_once() -> None:
    body = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    h = truth(Room(0.9, 0.9, 4))
    observed = object_evidence(predict(h, body))
    assert observed.dry
    assert outside(h, observed) is observed


def test_what_the_model_says_nothing_of_stays_as_it_was_heard() -> None:
    """A line whose mode is out of the band has no amplitude to be told against; it is not made silent, nor is
    the gain.
    """
    body = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    observed = object_evidence(predict(truth(), body))
    push = observed.push.copy()
    push[:, observed.mode[0]] = 0.0
    dry = tails.remove_tail(replace(observed, push=push), RT60 / 0.9)
    assert np.array_equal(dry.amplitude[:, 0], observed.amplitude[:, 0])
    assert np.isfinite(dry.amplitude).all()


@pytest.mark.slow
def test_what_rings_along_in_a_room_is_told_once() -> None:
    """A room makes several lines of one; outside it they are one, and as steady over the strikes as it was struck."""
    lodger = ForeignMode((1000.0, 2710.0), (9.0, 14.0), (1.2, 0.9), (0.0, 0.0))
    body = recorded(Room(0.9, 0.9, 4), lodger, seconds=1.2)
    evidence = evidence_of(truth(Room(0.9, 0.9, 4)), (body,), (50.0, 7_500.0))
    assert evidence.observed[0].dry
    found = propose_foreign_mode(evidence)
    assert found is not None
    assert found.freq_hz == pytest.approx((1000.0, 2710.0), rel=2e-3)


@pytest.mark.slow
def test_what_is_read_to_ring_far_longer_than_it_is_heard_to_is_a_neighbour(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tail prolongs; of a strong slow mode close by, what is left between the patterns outlasts any lodger."""
    lodger = ForeignMode((1000.0, 2710.0), (60.0, 14.0), (1.2, 0.9), (0.0, 0.0))
    observed = object_evidence(predict(truth(), recorded(Room(0.9, 0.5, 4), lodger, seconds=1.2)))
    k = int(np.abs(observed.foreign_hz - 1000.0).argmin())
    read = tails.estimate_rates

    def deceived(*given: Any, **more: Any) -> tails.TailEstimates:
        told = read(*given, **more)
        slow, moved = told.decay_per_s.copy(), told.shift_hz.copy()
        slow[0, k], moved[0, k] = observed.foreign_decay_per_s[k] / 20, -7.0
        return replace(told, decay_per_s=slow, shift_hz=moved)

    honest = tails.remove_tail(observed, RT60 / 0.9)
    monkeypatch.setattr(tails, "estimate_rates", deceived)
    dry = tails.remove_tail(observed, RT60 / 0.9)
    assert dry.foreign_hz[k] == observed.foreign_hz[k] and dry.foreign_decay_per_s[k] == observed.foreign_decay_per_s[k]
    assert np.array_equal(dry.foreign_amplitude[:, k], observed.foreign_amplitude[:, k])
    others = np.arange(len(observed.foreign_hz)) != k
    assert np.array_equal(dry.foreign_hz[others], honest.foreign_hz[others])


def test_a_gain_beside_a_room_is_the_lines_of_modes_alone() -> None:
    """Lines that the room leaves next to a mode's are no part of it."""
    body = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    observed = object_evidence(predict(truth(Room(0.9, 0.9, 4)), body))
    beside = replace(
        observed,
        foreign_hz=observed.freq_hz * 1.001,
        foreign_decay_per_s=observed.decay_per_s,
        foreign_amplitude=5 * observed.amplitude,
        foreign_sd=observed.amplitude_sd,
    )
    assert np.array_equal(whole(beside), observed.amplitude)
    assert np.abs(whole(replace(beside, dry=False))).max() > np.abs(observed.amplitude).max()


def test_a_mode_that_is_hardly_struck_is_not_read_more_surely() -> None:
    """What the model says nothing of, a tail's echoes make as unsure as anything else they touch."""
    body = recorded(Room(0.9, 0.9, 4), seconds=1.2)
    observed = object_evidence(predict(truth(), body))
    push = observed.push.copy()
    push[0] *= 1e-6
    dry = tails.remove_tail(replace(observed, push=push), RT60 / 0.9)
    assert (dry.amplitude_sd[0] > 0.09 * np.abs(dry.amplitude[0])).all()


@pytest.mark.slow
def test_a_snippet_has_no_tail() -> None:
    """Shorter than a few frames: no room is told, and nothing breaks."""
    observed = object_evidence(predict(truth(), recorded(Room(0.9, 0.9, 4))))
    assert observed.signal is not None
    short = replace(observed, signal=observed.signal[:, :300])
    assert tails.remove_tail(short, 7.0) is short


def test_a_mode_that_dies_as_the_room_does() -> None:
    """The covariance goes over into its limit 2δt e^{−2δt}."""
    time = (0.0, 0.012, 0.03, 0.06)
    level = [np.sort(tails._tail(time, 5.0, rate)[1]) for rate in (5.0, 5.0002, 5.01)]
    assert np.allclose(level[0], level[2], rtol=0.01)
    assert np.allclose(level[1], level[2], rtol=0.01)


def test_a_response_is_told_to_the_end_and_sought_on_from_where_it_was() -> None:
    """By what no strike had told: another sound in the same room.

    White sounds hold all frequencies, so the response itself is told, within the noise.
    """
    rng = np.random.default_rng(8)
    n, sr, noise = 8_000, 8_000, 1e-3
    fade = np.exp(-3.0 * np.arange(n) / sr)
    sound = rng.standard_normal((4, n)) * fade
    room = Room(0.6, 0.4, seed=1)
    signal = np.stack([room.apply(Sound(x, sr, 1.0, 0)).sample for x in sound]) + noise * rng.standard_normal((4, n))
    once = identified_room(Room(0.6, 0.4), signal[:3], sound[:3], white(noise), sr)
    again = identified_room(once, signal[:3], sound[:3], white(noise), sr)

    def off(x: Room) -> float:
        made = x.apply(Sound(sound[3], sr, 1.0, 0)).sample
        return float(((signal[3] - made) ** 2).sum() / ((signal[3] - sound[3]) ** 2).sum())

    assert off(once) < 0.05
    assert off(again) <= off(once) * 1.01  # nothing is lost, though it takes a quarter of the steps
    elsewhere = replace(once, response=once.response[: n // 2])  # of another length: from the beginning
    assert np.array_equal(identified_room(elsewhere, signal[:3], sound[:3], white(noise), sr).response, once.response)
