"""Compare two scenes, logs or recordings: what differs, what follows from it, and which input is the cause."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sonic_bullet.compare.causes import Causes, find_causes, same_sound
from sonic_bullet.compare.comparison import Comparison, Difference, Effect
from sonic_bullet.compare.input_differences import Asked, asked_differences
from sonic_bullet.compare.sides import SceneSide, Side, as_side
from sonic_bullet.compare.words import difference_words
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records.coerce import as_call

Given = str | Path | SceneSide | ContactLog | Side


def compare(a: Given, b: Given, *, say: Callable[[str], None] | None = None) -> Comparison:
    """What of B is other than of A, and why.

    a, b: a scene's file or a `SceneSide`, a contact log or its file, a recording's file. say: is told what is being
    done. Raises SonicBulletError: what cannot be run, read or compared.
    """
    tell = as_call(say, "say") or (lambda text: None)
    tell("A")
    one = as_side(a, "a", say)
    tell("B")
    other = as_side(b, "b", say)
    return compared(one, other, tell)


def compared(a: Side, b: Side, tell: Callable[[str], None]) -> Comparison:
    """Two sides that are known."""
    same = a.sr == b.sr and same_sound(a.sound, b.sound)
    effects: tuple[Effect, ...] = ()
    pairs, asked = asked_differences(a, b) if a.scene and b.scene else ([], [])
    causes = Causes((), False, {}) if same or not asked else find_causes(a, b, pairs, asked, tell)
    differences = [_difference(a, b, one, i, causes, same) for i, one in enumerate(asked)]
    differences.sort(key=lambda one: {True: 0, None: 1, False: 2}[one.cause])
    return Comparison(
        a, b, same, tuple(differences), effects, exact=causes.exact if asked and not same else None,
        stopped=causes.stopped,
    )  # fmt: skip


def _difference(a: Side, b: Side, one: Asked, number: int, causes: Causes, same: bool) -> Difference:
    cause = True if number in causes.found else False if same or causes.exact else None
    who, words = difference_words(a, b, one)
    return Difference(who, one.what, one.a, one.b, words, cause, kept=causes.broken.get(number, ""))
