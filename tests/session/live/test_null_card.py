"""The card that sounds nowhere keeps real time, and is as strict as one that sounds."""

from __future__ import annotations

import time

import numpy as np
import pytest

from sonic_bullet.session.live.null_card import NullCard

CARD_BLOCK = 256
HELD_BLOCKS = 2

SR = 48_000


def asked(seconds: float, slow_s: float = 0.0) -> tuple[list[float], list[float], list[bool]]:
    """When blocks were asked for, when they sound, and whether the one before was late."""
    card, when, sounds, lates = NullCard(SR, 2), [], [], []

    def fill(out: np.ndarray, sounds_s: float, late: bool) -> None:
        assert out.shape == (CARD_BLOCK, 2)
        when.append(time.perf_counter())
        sounds.append(sounds_s)
        lates.append(late)
        if len(when) == 5:
            time.sleep(slow_s)

    card.start(fill, lambda: None)
    time.sleep(seconds)
    card.stop(abort=True)
    return when, sounds, lates


def test_blocks_follow_each_other_in_real_time() -> None:
    when, sounds, lates = asked(0.5)
    gaps = np.diff(sounds) - CARD_BLOCK / SR
    assert len(when) >= 20
    assert gaps.min() > -1e-9
    assert ((gaps > 1e-9) == np.array(lates[1:])).all()  # what is late shifts all that follows; nothing else does
    assert (np.array(sounds) - when <= HELD_BLOCKS * CARD_BLOCK / SR).all()


def test_a_block_handed_over_late_is_counted_and_shifts_the_rest() -> None:
    _, sounds, lates = asked(0.3, slow_s=0.05)
    assert lates[5]
    assert sounds[5] - sounds[4] == pytest.approx(0.05 - (HELD_BLOCKS - 1) * CARD_BLOCK / SR, abs=0.02)


def test_it_stops_when_all_has_sounded() -> None:
    card = NullCard(SR, 1)
    card.start(lambda out, sounds_s, late: None, lambda: None)
    begin = time.perf_counter()
    card.stop(abort=False)
    assert time.perf_counter() - begin >= HELD_BLOCKS * CARD_BLOCK / SR
