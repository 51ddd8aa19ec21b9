"""What was computed of a thing is kept as long as the thing is."""

from __future__ import annotations

import gc

from sonic_bullet.machine.identity_cache import WhileAlive


class Thing:
    """Compared by identity, as records are."""


def test_computed_once_for_each_thing_and_question_and_forgotten_with_it() -> None:
    asked: list[tuple[int, float]] = []

    @WhileAlive
    def answer(of: Thing, factor: int, *, less: float = 0.0) -> list[float]:
        """What it says."""
        asked.append((factor, less))
        return [factor - less]

    one, other = Thing(), Thing()
    assert answer(one, 2) is answer(one, 2)
    assert answer(one, 2) is not answer(other, 2)
    assert answer(one, 2, less=0.5) == [1.5]
    assert asked == [(2, 0.0), (2, 0.0), (2, 0.5)]
    assert answer.__doc__ == "What it says."
    assert len(answer) == 2
    del other
    gc.collect()
    assert len(answer) == 1
    answer.cache_clear()
    assert answer(one, 2) == [2.0]
    assert len(asked) == 4
