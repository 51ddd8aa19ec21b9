"""What a diagnosis that names something still has to say: what is left beside it, and which places are one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sonic_bullet.diagnosis.selection.thresholds import RULES
from sonic_bullet.diagnosis.unexplained import describe_unexplained, indistinct_places
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.support_damping import SupportDamping
from tests.diagnosis.test_separating_strike import ended
from tests.made.body import SIDE_M


@pytest.mark.parametrize("left_db", [0.5 * RULES.suffices_db, 5.4])
def test_explained_says_what_is_left_beside_the_name(left_db: float) -> None:
    end = ended(ContactTime(4e-4, 0.02))
    end = replace(end, before_db=12.0, after_db=end.floor_db + left_db)
    told = describe_unexplained(end, end.judged)  # type: ignore[arg-type]
    assert bool(told) == (left_db > RULES.suffices_db)
    if told:
        assert told["left_db"] == pytest.approx(left_db) and told["words"].startswith("5.4 dB beside what is named")


def test_places_that_move_alike_are_named_once() -> None:
    a, b = SIDE_M
    place = (5 * a / 22, 4 * b / 14, 0.0)
    image = (a - place[0], b - place[1], 0.0)
    for effect in (SupportDamping((place,), (1.0,)), SupportDamping((place, image), (0.2, 0.8))):
        (told,) = indistinct_places(ended(effect))
        assert f"({image[0]:.3g}, {image[1]:.3g}, 0) m" in told and "divided between them" in told
    assert indistinct_places(ended(SupportDamping(((a / 2, b / 2, 0.0),), (1.0,)))) == []
    assert indistinct_places(ended(ContactTime(4e-4, 0.02))) == []
