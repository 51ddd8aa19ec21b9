"""Frames go to a card as they are, on time by closed form; what is missing is counted, and a card that goes is said.

The card is asked by hand, so that nothing here depends on how busy a machine is.
"""

from __future__ import annotations

import threading
import time
import warnings

import numpy as np
import pytest

from sonic_bullet.records.errors import AudioError, PlaybackWarning
from sonic_bullet.session.live import Playback, playback, start_playback
from tests.made.sound_cards import HandCard

SR, BLOCK, AHEAD = 8000, 16, 104


def playing(card: HandCard, *, full_scale_pa: float = 1.0, lag_steps: int = 0) -> Playback:
    """A playback whose card has asked once, in vain: it sounds when AHEAD + BLOCK = 120 samples wait."""
    made = Playback(card, full_scale_pa=full_scale_pa, ahead_s=AHEAD / card.sr, lag_steps=lag_steps)
    assert not card.ask(BLOCK).any()
    return made


def frame(count: int, first: int = 1) -> np.ndarray:
    return np.arange(first, first + count)[None] / 1024.0


def all_of(card: HandCard, count: int) -> np.ndarray:
    return np.concatenate([card.ask(BLOCK) for _ in range(count)])[:, 0]


def test_what_is_pushed_is_played_from_when_enough_waits() -> None:
    card = HandCard()
    sound = playing(card, full_scale_pa=2.0)
    sound.push(frame(60), 0.0)
    assert not card.ask(BLOCK).any()
    sound.push(frame(60, 61), 0.0)
    np.testing.assert_array_equal(all_of(card, 7), (frame(112)[0] / 2).astype(np.float32))
    assert sound.report.seconds == 112 / SR
    assert sound.report.underruns == 0


def test_channels_stay_apart() -> None:
    card = HandCard(channels=2)
    sound = playing(card)
    sound.push(np.concatenate([frame(120), -frame(120)]), 0.0)
    out = card.ask(BLOCK)
    np.testing.assert_array_equal(out.T, np.concatenate([frame(16), -frame(16)]).astype(np.float32))


def test_a_step_sounds_when_the_closed_form_says() -> None:
    """Frame k begins at sample 40 k and holds the sound of step k − 3; block j begins at 16 j, sounds at 2 + 16 j/sr.

    Steps 0 … 2 fill the queue before anything sounds. They returned long before and are not counted.
    """
    card = HandCard()
    sound = playing(card, lag_steps=3)
    returned = [0.5 + 0.003 * k if k < 3 else 1.0 + 0.003 * k + 0.0001 * (k % 4) for k in range(41)]
    k = j = 0
    while 40 * k < AHEAD + BLOCK:
        sound.push(frame(40), returned[k])
        k += 1
    while k < 41:
        card.ask(BLOCK, 2.0 + j * BLOCK / SR)
        j += 1
        while 40 * k - BLOCK * j <= AHEAD - 40 and k < 41:
            sound.push(frame(40), returned[k])
            k += 1
    while BLOCK * j < 40 * k:
        card.ask(BLOCK, 2.0 + j * BLOCK / SR)
        j += 1
    latency = [2.0 + 40 * n / SR - returned[n - 3] for n in range(6, 41)]
    assert sound.report.latency_worst_s == pytest.approx(max(latency), abs=1e-12)
    assert sound.report.latency_median_s == pytest.approx(np.median(latency), abs=1e-4)
    assert sound.report.underruns == 0


def test_an_underrun_is_silent_counted_and_waits_until_enough_is_there() -> None:
    card = HandCard()
    sound = playing(card)
    sound.push(frame(120), 0.0)
    out = all_of(card, 9)
    np.testing.assert_array_equal(out[:120], frame(120)[0].astype(np.float32))
    assert not out[120:].any()
    assert sound.report.underruns == 0  # it may be the end
    sound.push(frame(60, 121), 0.0)
    assert not card.ask(BLOCK).any()
    sound.push(frame(60, 181), 0.0)
    assert card.ask(BLOCK)[0, 0] == np.float32(121 / 1024)
    assert sound.report.underruns == 1
    assert sound.report.silent_s == (9 * BLOCK - 120 + BLOCK) / SR
    assert "1 underrun (0.01 s silent)" in str(sound.report)


def test_what_the_card_missed_is_an_underrun() -> None:
    card = HandCard()
    sound = playing(card)
    card.ask(BLOCK, late=True)  # nothing was to sound
    sound.push(frame(120), 0.0)
    card.ask(BLOCK, late=True)
    card.ask(BLOCK, late=True)
    assert sound.report.underruns == 1


def test_clipping_is_counted_and_shown() -> None:
    card = HandCard()
    sound = playing(card, full_scale_pa=0.05)
    sound.push(np.concatenate([frame(117), np.full((1, 3), -2.0)], axis=1), 0.0)
    out = all_of(card, 8)[:120]
    loud = np.concatenate([frame(117)[0], [-2.0] * 3]) / 0.05
    np.testing.assert_array_equal(out, np.clip(loud, -1, 1).astype(np.float32))
    assert sound.report.clipped == int((np.abs(loud) > 1).sum()) > 60
    assert f"{sound.report.clipped} samples clipped" in str(sound.report)


def test_closing_waits_for_what_is_on_its_way() -> None:
    card = HandCard()
    sound = playing(card)
    sound.push(frame(50), 0.0)  # less than it starts with
    heard: list[np.ndarray] = []

    def take() -> None:
        while not sound._draining:
            time.sleep(0.001)
        for _ in range(6):
            heard.append(card.ask(BLOCK))

    thread = threading.Thread(target=take)
    thread.start()
    report = sound.close()
    thread.join()
    np.testing.assert_array_equal(np.concatenate(heard)[:50, 0], frame(50)[0].astype(np.float32))
    assert (report.seconds, report.underruns, report.silent_s) == (50 / SR, 0, 0)
    assert sound.close().seconds == report.seconds
    assert card.stopped == [False]
    sound.push(frame(5000), 0.0)  # does nothing, and waits for nobody
    assert sound.report.seconds == report.seconds


def test_leaving_by_an_error_plays_nothing_more() -> None:
    card = HandCard()
    with pytest.raises(KeyError), playing(card) as sound:
        sound.push(frame(50), 0.0)
        raise KeyError
    assert sound.closed
    assert card.stopped == [True]


@pytest.mark.parametrize("said", [True, False])
def test_a_card_that_goes_is_said_once_and_the_loop_goes_on(said: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(playback, "STALLED_S", 0.05)
    card = HandCard()
    sound = playing(card)
    if said:
        card.ended()
    with pytest.warns(PlaybackWarning, match="by hand takes no more sound; .*physics and log go on") as caught:
        for _ in range(100):
            sound.push(frame(117), 0.0)
    assert len(caught) == 1
    assert isinstance(sound.failure, AudioError)
    sound.close()
    assert card.stopped == [True]


def test_a_card_that_ends_because_it_was_closed_has_not_gone() -> None:
    card = HandCard()
    sound = playing(card)
    sound.close()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        card.ended()
        sound.push(frame(10), 0.0)
    assert sound.failure is None


def test_a_loop_faster_than_real_time_is_paced_and_the_queue_stays_short() -> None:
    sound = start_playback("null", sr=SR, channels=1, lag_steps=0, ahead_s=0.02)
    begin, most = time.perf_counter(), 0
    for _ in range(30):
        sound.push(frame(80), time.perf_counter())
        most = max(most, sound._queue.written - sound._queue.taken)
    spent_s = time.perf_counter() - begin
    sound.close()
    assert spent_s >= 30 * 80 / SR - 0.02 - 2 * 256 / SR
    assert most <= 0.02 * SR + 256  # which the card takes at once
    assert sound.report.seconds == 30 * 80 / SR


def test_a_frame_longer_than_the_queue_is_played_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(playback, "QUEUE_S", 0.2)
    sound = start_playback("null", sr=SR, channels=1, lag_steps=0)
    sound.push(np.zeros((1, round(0.5 * SR))), 0.0)
    assert sound.close().seconds == 0.5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"full_scale_pa": 0}, "full_scale_pa is 0; give a pressure"),
        ({"full_scale_pa": float("nan")}, "full_scale_pa is nan"),
        ({"ahead_s": -1}, "ahead_s is -1"),
        ({"ahead_s": 3}, "ahead_s is 3; give 0 … 2 s"),
        ({"channels": 0}, "there is no microphone"),
    ],
)
def test_what_cannot_be_played_is_said(options: dict[str, float], words: str) -> None:
    with pytest.raises(AudioError, match=words):
        start_playback("null", **{"sr": SR, "channels": 1, "lag_steps": 0, **options})  # type: ignore[arg-type]
