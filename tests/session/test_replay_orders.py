"""Random orders of add, remove, reset, save, restore, quench, disconnect …: the replay is what was heard.

A thousand: studies/replay_orders.py.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sonic_bullet.session import Listener
from studies.replay_orders import Tally, play, run


def test_random_orders_replay_bit_for_bit() -> None:
    tally = run(15, 7)
    print(tally)
    assert tally.orders >= 15
    assert tally.sounding >= 5
    assert tally.framed >= 5
    assert tally.off_without_events >= 2, "without its events a replay is another sound: the comparison can fail"


def test_the_comparison_can_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log that loses its events is caught."""
    order = [("add", 0, 3), ("steps", 5, 5), ("quench", 0, 0), ("steps", 5, 5)]
    play(order, Tally(), tmp_path)
    whole = Listener.contacts.fget
    monkeypatch.setattr(Listener, "contacts", property(lambda listener: replace(whole(listener), events=())))
    with pytest.raises(AssertionError, match="the log's replay is up to"):
        play(order, Tally(), tmp_path)
