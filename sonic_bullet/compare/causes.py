"""Which inputs are the causes: the smallest set whose return in B gives A's samples, to the bit.

    all put back: is it A?  no: something is not put back       one by one: is it A?  yes: that one
    else: all but one, ever fewer, while it is A -> a set of which none can be left out

A run that is not A ends at the first frame that differs, most of them early. A single cause costs one run for each
input; a set of several costs as many again. Where every input only adds to what differs, a set of which none can be left
out is the smallest there is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.compare.call_pairs import Pair
from sonic_bullet.compare.input_differences import Asked
from sonic_bullet.compare.put_back import PutBack
from sonic_bullet.compare.sides import OtherSound, Say, Side, run
from sonic_bullet.files.rows.spool import KeptSound
from sonic_bullet.records.errors import SonicBulletError

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """exact: whether they put back give A; smallest: whether none can be left out; broken: inputs (by index) whose
    return breaks the scene, and how it breaks.
    """

    found: tuple[int, ...]
    exact: bool
    broken: dict[int, str]
    stopped: bool = False


def same_sound(a: KeptSound, b: KeptSound) -> bool:
    """Whether two sounds are the same samples, to the bit."""
    return a.shape == b.shape and all(
        np.array_equal(x.view(np.int64), y.view(np.int64)) for x, y in zip(a.blocks(), b.blocks(), strict=True)
    )


def find_causes(a: Side, b: Side, pairs: Sequence[Pair], asked: Sequence[Asked], tell: Tell) -> Causes:
    """The causes among inputs that differ. Interrupted, what is known."""
    broken: dict[int, str] = {}
    everything = tuple(range(len(asked)))

    def is_a(chosen: Sequence[int]) -> bool:
        try:
            return sounds_as(a, b, pairs, [asked[i] for i in chosen], tell)
        except SonicBulletError as error:
            broken[chosen[0] if len(chosen) == 1 else -1] = str(error)
            return False

    found: tuple[int, ...] = ()
    try:
        for i in everything:
            if is_a((i,)):
                return Causes((i,), True, broken)
        if len(asked) < 2 or not is_a(everything):
            return Causes((), False, broken)
        found = everything
        for i in everything:
            fewer = tuple(x for x in found if x != i)
            if len(fewer) > 1 and is_a(fewer):
                found = fewer
    except KeyboardInterrupt:
        return Causes(found, bool(found), broken, stopped=True)
    return Causes(found, True, broken)


def sounds_as(a: Side, b: Side, pairs: Sequence[Pair], asked: Sequence[Asked], tell: Say) -> bool:
    """Whether B with those inputs of A sounds as A. Raises where the scene breaks."""
    try:
        return same_sound(put_back(a, b, pairs, asked, tell, a.frames).sound, a.sound)
    except OtherSound:
        return False


def put_back(
    a: Side, b: Side, pairs: Sequence[Pair], asked: Sequence[Asked], tell: Say, like: Sequence[bytes] | None = None
) -> Side:
    """B run with those inputs of A. like: frames that it must have, else OtherSound is raised."""
    assert b.scene is not None
    options = {one.option: one.a for one in asked if one.option}
    plan = PutBack(pairs, frozenset(place for one in asked for place in one.places))
    return run(replace(b.scene, **options), "b", plan=plan, like=like, say=tell)
