"""An echo of something that moves: every line twice, and no room's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from scipy.signal import resample

from sonic_bullet.effects.protocol import Effect, Number, Owner, Sound, Stage
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.effects.room import propose_room
from sonic_bullet.lab.effects.room.shifted_echo import FEWEST_ECHO_PAIRS, find_copy_ratio
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import recorded


@dataclass(frozen=True)
class Moving(Effect):
    """x(t) + r x((1 − 2v/c)t − T): a reflector that goes away at v."""

    id: ClassVar[str] = "moving"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.ROOM
    reference: ClassVar[str] = "Pierce 1989, ch. 9"
    speed_m_s: Annotated[float, Number("of the reflector", free=3)]

    def apply(self, x: Sound) -> Sound:
        n = len(x.sample)
        when = np.arange(n) * (1 - 2 * self.speed_m_s / 343) - 0.01 * x.sr
        return replace(
            x, sample=x.sample + 0.6 * np.interp(when, np.arange(16 * n) / 16, resample(x.sample, 16 * n), left=0.0)
        )


def test_the_ratio_of_a_moving_echo_is_told_and_no_room_proposed() -> None:
    body = recorded(Moving(7.0))
    assert body.recorded is not None
    lines = body.recorded.lines
    assert find_copy_ratio(lines.freq_hz, lines.decay_per_s, lines.amplitude) == pytest.approx(
        1 / (1 - 14 / 343), rel=2e-4
    )
    assert propose_room(evidence_of(refit_material(fitted(body), (body,)), (body,), BAND)) is None


@parametrize_few("more", [(), (Room(0.9, 0.8, 11),)], 1)
def test_what_stands_still_brings_no_copies(more: tuple[Room, ...]) -> None:
    body = recorded(*more)
    assert body.recorded is not None
    lines = body.recorded.lines
    assert find_copy_ratio(lines.freq_hz, lines.decay_per_s, lines.amplitude) is None


def some(count: int, seed: int = 0) -> tuple[np.ndarray[Any, Any], ...]:
    rng = np.random.default_rng(seed)
    return np.sort(rng.uniform(300, 9_000, count)), rng.uniform(5, 50, count), rng.standard_normal((5, count)) + 0j


def test_copies_are_those_of_one_ratio_of_frequency_and_decay_and_of_one_pattern() -> None:
    f, d, a = some(9)

    def twice(ratio: float = 1.03, slower: float = 1.03, other: float = 0.0, scatter: float = 0.0) -> float | None:
        rng = np.random.default_rng(1)
        apart = ratio * np.exp(scatter * rng.standard_normal(9))
        like = a + other * np.abs(a).mean() * rng.standard_normal(a.shape)
        return find_copy_ratio(
            np.concatenate([f, f * apart]), np.concatenate([d, d * slower]), np.concatenate([a, 0.3j * like], axis=1)
        )

    assert twice() == pytest.approx(1.03, rel=1e-6)
    assert (
        twice(slower=1.5) is None
        and twice(other=1.0) is None
        and twice(scatter=0.01) is None
        and twice(ratio=1.0005) is None
    )


@pytest.mark.parametrize(("lines", "copies"), [(40, FEWEST_ECHO_PAIRS - 1), (90, FEWEST_ECHO_PAIRS + 2)])
def test_few_copies_or_few_among_many_lines_are_chance(lines: int, copies: int) -> None:
    f, d, a = some(lines)
    few = slice(0, copies)
    again = (
        np.concatenate([f, 1.03 * f[few]]),
        np.concatenate([d, 1.03 * d[few]]),
        np.concatenate([a, a[:, few]], axis=1),
    )
    assert find_copy_ratio(*again) is None


def test_one_strike_tells_no_copies() -> None:
    f, d, a = some(40)
    twice = np.concatenate([f, 1.03 * f]), np.concatenate([d, 1.03 * d]), np.concatenate([a, a], axis=1)
    assert find_copy_ratio(*twice) == pytest.approx(1.03)
    assert find_copy_ratio(twice[0], twice[1], twice[2][:1]) is None


def test_pairs_split_by_one_share_and_struck_at_one_place_are_no_copies() -> None:
    """There all lines are alike over the strikes, and patterns tell none apart."""
    f, d, a = some(16)
    level = np.array([1.0, 2.0, 3.0, 4.0, 5.0])[:, None] * a[:1]
    twice = np.concatenate([f, 1.004 * f]), np.concatenate([d, 1.004 * d])
    assert find_copy_ratio(*twice, np.concatenate([a, a], axis=1)) == pytest.approx(1.004)
    assert find_copy_ratio(*twice, np.concatenate([level, level], axis=1)) is None
