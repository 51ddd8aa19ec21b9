"""Names of links: one living link's alone, a number given once."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.names import Names


def test_the_same_default_is_numbered_in_order_of_appearance() -> None:
    names = Names()
    assert [names.of(code, "cube") for code in (7, 3, 5)] == ["cube", "cube 2", "cube 3"]
    assert names.of(3, "cube") == names.of(3, "other") == "cube 2"


def test_a_number_is_never_given_anew_and_a_name_by_hand_is() -> None:
    names = Names()
    names.of(1, "cube"), names.of(2, "cube")
    names.forget([1, 2, 9])
    assert names.of(1, "cube") == "cube 3"
    names.call(4, "cup")
    names.forget([4])
    assert names.of(5, "cup") == "cup 2", "by hand it may be given again, by itself it is another's"
    names.call(6, "cup")
    assert names.name_link(6, "x") == "cup" and names.name_link(7, "x") == "x"


def test_numbers_pass_over_names_given_by_hand() -> None:
    names = Names()
    names.call(1, "cube 2")
    names.call(1, "cube 2")
    assert [names.of(code, "cube") for code in (2, 3)] == ["cube", "cube 3"]
    with pytest.raises(SceneError, match="'cube' is another body's"):
        names.call(3, "cube")
    assert names.name_link(3, "") == "cube 3"


def test_names_given_by_hand_are_handed_over_and_no_others() -> None:
    names, anew = Names(), Names()
    names.call(3, "cup"), names.call(4, "gone")
    assert [names.of(code, "cube") for code in (1, 2)] == ["cube", "cube 2"]
    names.hand_over([2, 3], anew)
    assert [anew.of(code, "cube") for code in (2, 3, 1)] == ["cube", "cup", "cube 2"]
    anew.call(5, "gone")
    assert set(anew.codes) == {1, 2, 3, 5}


CODES = st.integers(0, 5)
DEFAULTS = st.sampled_from(["a", "a 2", "b"])


@given(st.lists(st.tuples(st.sampled_from(["of", "call", "forget"]), CODES, DEFAULTS), max_size=40))
def test_no_two_living_links_have_one_name_whatever_is_done(steps: list[tuple[str, int, str]]) -> None:
    names, living = Names(), dict[int, str]()
    for what, code, name in steps:
        if what == "of":
            expected = living.get(code)
            living[code] = names.of(code, name)
            assert expected in (None, living[code])
        elif what == "forget":
            names.forget([code])
            living.pop(code, None)
        elif name in {other for bearer, other in living.items() if bearer != code}:
            with pytest.raises(SceneError):
                names.call(code, name)
        else:
            names.call(code, name)
            living[code] = name
        assert len(set(living.values())) == len(living)
        assert all(names.name_link(bearer, "") == one for bearer, one in living.items())
