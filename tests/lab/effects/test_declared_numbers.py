"""A parameter is declared once: its range is checked, reports show it by its name, and what was free is counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import pytest

from sonic_bullet.effects.protocol import Effect, Number, Numbers, Owner, Sound, Stage
from sonic_bullet.records.errors import RecordError


@dataclass(frozen=True)
class Made(Effect):
    """An effect of one's own with every sort of declaration."""

    id: ClassVar[str] = "made"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.CHAIN
    reference: ClassVar[str] = "none"

    corner_hz: Annotated[float, Number("corner", least=0.0, most=100.0, free=1)]
    kind: Annotated[str, Number("form", known=("low", "high"))] = "low"
    extra: Annotated[float, Number("where there is one", free=1, key="more", of="extra")] = 0.0
    freq_hz: Annotated[Numbers, Number("(p,)", table="rows", free=1)] = ()
    gain: Annotated[Numbers, Number("(p,)", table="rows")] = ()
    unsaid: Annotated[float, Number("of the host", shown=False)] = float("nan")

    def apply(self, x: Sound) -> Sound:
        return x


def test_what_is_declared_is_reported_and_counted() -> None:
    assert Made(3.0).parameters() == {"corner_hz": 3.0, "kind": "low"}
    assert Made(3.0).freedom() == 1
    full = Made(3.0, "high", 0.5, (1.0, 2.0), (0.1, 0.2))
    rows = [{"freq_hz": 1.0, "gain": 0.1}, {"freq_hz": 2.0, "gain": 0.2}]
    assert full.parameters() == {"corner_hz": 3.0, "kind": "high", "more": 0.5, "rows": rows}
    assert full.freedom() == 4


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((-1.0,), "corner_hz is -1.0"),
        ((100.0,), "corner_hz is 100.0"),
        ((float("nan"),), "corner_hz is nan"),
        ((1.0, "middle"), "kind is 'middle'"),
        ((1.0, "low", float("inf")), "more is inf"),
        ((1.0, "low", 0.0, (1.0,), ()), "freq_hz holds 1, gain holds 0"),
    ],
)
def test_what_no_declaration_allows_is_refused_by_its_name(numbers: tuple[object, ...], message: str) -> None:
    with pytest.raises(RecordError, match=message):
        Made(*numbers)  # type: ignore[arg-type]
