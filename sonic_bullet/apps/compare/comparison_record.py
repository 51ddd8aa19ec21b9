"""Result of a comparison: records, and their JSON."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.apps.compare.ensemble import Audibility
    from sonic_bullet.apps.compare.sides import Side
    from sonic_bullet.apps.compare.tolerance import Closeness


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """An input that differs.

    Parameters
    ----------
    who
        The body; "": the engine, sensors, rendering.
    what
        The quantity.
    a, b
        Its values, None where there is none.
    words
        One line.
    cause
        True where it is in the smallest set whose substitution makes A of B, False where it changes no sample, None
        where that is not known.
    share
        Fraction of the difference that it explains, where contacts are equal.
    kept
        Why it cannot be substituted, "" where it can.
    """

    who: str
    what: str
    a: Any
    b: Any
    words: str
    cause: bool | None = None
    share: float | None = None
    kept: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Consequence:
    """Effect of inputs, never a cause.

    Parameters
    ----------
    kind
        contacts, modes, level, onset, decay, loudness, or a change of a recording.
    at_s
        When it begins.
    values
        Numbers by name, units in the names.
    """

    kind: str
    words: str
    at_s: float | None = None
    values: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Result of a comparison of two sides.

    Parameters
    ----------
    same
        Samples are equal, to the bit.
    differences
        Causes first.
    exact
        Whether the causes substituted in B give A to the bit; None: not tried.
    audible
        Whether B differs from an ensemble of A; None: not asked for.
    stopped
        It was interrupted, and is incomplete.
    closeness
        Whether B is within a tolerance of A; None: not asked for.
    """

    a: Side
    b: Side
    same: bool
    differences: tuple[Difference, ...] = ()
    effects: tuple[Consequence, ...] = ()
    exact: bool | None = None
    audible: Audibility | None = None
    notes: tuple[str, ...] = ()
    stopped: bool = False
    closeness: Closeness | None = None

    @property
    def causes(self) -> tuple[Difference, ...]:
        """Inputs whose substitution makes A of B."""
        return tuple(one for one in self.differences if one.cause)

    @property
    def passed(self) -> bool:
        """Whether the two count as the same: samples equal, or within the tolerance or chance that was asked for."""
        from sonic_bullet.apps.compare.tolerance import passes

        return passes(self.same, self.closeness, self.audible)

    @property
    def compared(self) -> str:
        """What was compared, in one line: bodies, events, seconds, tolerance."""
        from sonic_bullet.apps.compare.tolerance import compared_words

        return compared_words(self.b, self.same, self.closeness)

    @property
    def verdict(self) -> str:
        """Verdict in one line."""
        from sonic_bullet.apps.compare.words import verdict

        return verdict(self)

    def lines(self) -> list[str]:
        """Return the whole finding, a line each: verdict, inputs, effects, notes."""
        tag = {True: "cause", False: "changes no sample", None: "input"}
        return [
            self.verdict,
            *(f"  {tag[one.cause]}: {one.words}{f' ({one.kept})' if one.kept else ''}" for one in self.differences),
            *(f"  effect: {one.words}" for one in self.effects),
            *([f"  tolerance: {self.closeness.words}"] if self.closeness is not None and not self.same else []),
            *([f"  audible: {self.audible.words}"] if self.audible is not None else []),
            *([f"  compared: {self.compared}"] if self.passed else []),
            *(f"  note: {one}" for one in self.notes),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as JSON holds it."""
        return {
            "a": self.a.name,
            "b": self.b.name,
            "same": self.same,
            "passed": self.passed,
            "verdict": self.verdict,
            "exact": self.exact,
            "differences": [
                {"who": x.who, "what": x.what, "a": _to_json_value(x.a), "b": _to_json_value(x.b)}
                | {"words": x.words, "cause": x.cause, "share": x.share, "kept": x.kept}
                for x in self.differences
            ],
            "effects": [{"kind": x.kind, "words": x.words, "at_s": x.at_s, "values": x.values} for x in self.effects],
            "audible": None if self.audible is None else self.audible.to_json(),
            "compared": self.compared,
            "tolerance": None if self.closeness is None else asdict(self.closeness),
            "notes": list(self.notes),
            "stopped": self.stopped,
        }  # fmt: skip


def _to_json_value(value: Any) -> Any:
    """Convert a value to one that JSON can hold."""
    if value is None or isinstance(value, (bool, int, str)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    if isinstance(value, (tuple, list)):
        return [_to_json_value(one) for one in value]
    return str(value)[:200]
