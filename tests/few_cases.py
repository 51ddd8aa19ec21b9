"""Of many cases of one claim `make test` runs a few, which stand for the others; `make test-all` runs them all."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import pytest
from _pytest.mark import ParameterSet

Places = int | Collection[int]


def parametrize_few(
    names: str | Sequence[str], cases: Iterable[Any], quick: Places = 1, **options: Any
) -> pytest.MarkDecorator:
    """`pytest.mark.parametrize`, with every case marked slow but the first ``quick``, or those at these places."""
    one = isinstance(names, str) and "," not in names
    places = range(quick) if isinstance(quick, int) else quick
    sets = [case if isinstance(case, ParameterSet) else pytest.param(*([case] if one else case)) for case in cases]
    assert places and max(places) < len(sets), "each claim keeps a case in make test"
    marked = [
        case if place in places else pytest.param(*case.values, marks=[*case.marks, pytest.mark.slow], id=case.id)
        for place, case in enumerate(sets)
    ]
    return pytest.mark.parametrize(names, marked, **options)
