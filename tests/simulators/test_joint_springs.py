"""Springs of joints: what is no spring is one line that shows one, not a traceback."""

from __future__ import annotations

from typing import Any

import pytest

import sonic_bullet as sb
from sonic_bullet.records.errors import RecordError
from tests.made.jointed import make_arm


@pytest.mark.parametrize(
    ("springs", "named"),
    [((), "None"), (([0, 1],), "[0, 1]"), (({0: 2e4},), "20000.0"), (({"all": [2e4]},), "[20000.0]")],
)
def test_ids_alone_are_told_what_a_spring_is(client: Any, springs: tuple[Any, ...], named: str) -> None:
    arm = make_arm(client)
    listener = sb.attach(client, microphone=())
    with pytest.raises(RecordError) as told:
        listener.world.hold_joints(arm, *springs)
    assert f"is {named}; give" in str(told.value) and "(2e4, 0.05)" in str(told.value)
    assert "\n" not in str(told.value)
