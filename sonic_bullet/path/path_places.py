"""Tables of the sound path: where bodies are and were, and whether their emission can be stored.

A body has a chain of places, by when it came there. Its present position is the last. Those before it, from which it
was teleported, stay until the last of their sound has arrived. A line is one place and one microphone, line place·
channels + c. Its history lies in memory from place.memory_at + c·2·(size + MIRRORED) on: emitted, then delays, both
rings of a power of two with their first MIRRORED elements repeated at their ends, so that reads are always contiguous.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.vector import LANES
from sonic_bullet.path.fractional_delay import INFINITE, TAPS, greatest
from sonic_bullet.records import Array


class _Outcomes(NamedTuple):
    """Results of `hear`: but for ``done`` nothing has changed."""

    done: int = 0
    # it may be called again with longer tables (`path.grow`): a place's size is below its need; one more a body are
    # enough
    memory_short: int = 1
    places_short: int = 2
    too_far: int = 3
    not_finite: int = 4


OUTCOME = _Outcomes()


FARTHEST_M = 1000.0
PATH_BLOCK = 256
MIRRORED = TAPS + LANES

SOURCE = np.dtype(
    [
        ("radius_m", "f8"),
        ("oldest", "i8"),  # place: the first of its chain
        ("main", "i8"),  # its present place, the last of the chain
        ("leaving", "i8"),  # the place it left in step ``left``; -1: none
        ("left", "i8"),  # step in which it was last teleported; -1: none
        ("sounds", "i8"),  # 1: emits something in this call
        ("fresh", "i8"),  # place it gets in this call; -1: none
        ("away_m", "f8"),  # where `hear` says too far: from the farthest microphone; else 0
    ],
    align=True,
)
"""A body that emits sound."""

PLACE = np.dtype(
    [
        ("body", "i8"),  # -1: free
        ("next", "i8"),  # the body's following place; -1: none
        ("rest_m", "f8", (3,)),  # where it lies, once left
        ("size", "i8"),  # samples remembered, a power of two
        ("need", "i8"),  # where `hear` says its memory is short: samples it must remember at least
        ("memory_at", "i8"),
    ],
    align=True,
)
"""A body's present position or one from which it was teleported."""

LINE = np.dtype([("awake", "i8"), ("cursor", "i8"), ("newest", "i8")], align=True)
"""awake: sound is under way; cursor: the emitted sample arrived last; newest: the last emitted that is not zero."""


class PathTables(NamedTuple):
    """The sound path: fields of `Path` (microphone_m, samples_per_m, taps) and of `PathState` (propagation.py)."""

    microphone_m: Array
    samples_per_m: float
    taps: Array
    sources: Array
    places: Array
    lines: Array
    memory: Array


class Emission(NamedTuple):
    """What bodies emit, from column ``first`` on, in Pa·m.

    source (W, ≥ b, ·): of each weight set; dipole (≥ b, 3, ·): along each axis; sets (c,): which each microphone hears.
    """

    source: Array
    dipole: Array
    first: int | np.int64
    sets: Array


class Course(NamedTuple):
    """Where bodies and microphones are in a step.

    Attributes
    ----------
    begin_m, end_m, teleported : (≥ b, 3), (≥ b, 3), (≥ b,)
    x : (·) position of each sample between the step's ends, 0 … 1, from column `Emission.first` on
    aim_m : (2, b, c, 3) place of each microphone when it receives what a body emits at the step's ends; (0, …): as
        microphone_m
    gain : (2, b, c) factor of what a body emits to a microphone at the step's ends; (0, …): 1
    """

    begin_m: Array
    end_m: Array
    teleported: Array
    x: Array
    aim_m: Array
    gain: Array


class Arrivals(NamedTuple):
    """Where pressure goes: out (c, ·) from column ``at`` on; apart 1: bodies are not summed, out is (b·c, …)."""

    out: Array
    at: int
    apart: int


@njit(nogil=True, error_model="numpy")
def _awake(lines, place, channels):  # pragma: no cover - compiled
    """Test whether sound of the place is under way to any microphone."""
    line, stop = place * channels, (place + 1) * channels
    while line < stop and lines[line].awake == 0:
        line += 1
    return line < stop


@njit(nogil=True, error_model="numpy")
def _squares(course, microphone_m, b, c):  # pragma: no cover - compiled
    """Compute the square of the distance of body b from microphone c at the step's ends."""
    begin_m, end_m, aim_m = course.begin_m, course.end_m, course.aim_m
    here, there = 0.0, 0.0
    for axis in range(3):
        u, v = begin_m[b, axis] - microphone_m[c, axis], end_m[b, axis] - microphone_m[c, axis]
        if len(aim_m) > 0:
            u, v = begin_m[b, axis] - aim_m[0, b, c, axis], end_m[b, axis] - aim_m[1, b, c, axis]
        here += u * u
        there += v * v
    return here, there


@njit(nogil=True, error_model="numpy")
def _hears(lines, body, c, channels):  # pragma: no cover - compiled
    """Test whether sound of a body's present or last place is under way to microphone c."""
    left = body.leaving >= 0 and lines[body.leaving * channels + c].awake != 0
    return left or lines[body.main * channels + c].awake != 0


@njit(nogil=True, error_model="numpy")
def _fits(place, source, square, samples_per_m):  # pragma: no cover - compiled
    """Return `OUTCOME.done`, or what is wrong with a place that emits at the distance √square."""
    margin = PATH_BLOCK + 64  # samples remembered beyond the longest delay: a block is emitted before any of it is read
    away_m = np.sqrt(square)
    if not away_m < np.inf:
        return OUTCOME.not_finite
    if away_m > FARTHEST_M:
        source.away_m = away_m
        return OUTCOME.too_far
    need = int(away_m * samples_per_m) + 1 + margin
    if need <= place.size:
        return OUTCOME.done
    place.need = need
    return OUTCOME.memory_short


@njit(nogil=True, error_model="numpy")
def _free_place(places, lines, sources, step, p, channels):  # pragma: no cover - compiled
    """Find the next place from p on that no sound comes from and no body needs; the number of places for none."""
    while p < len(places):
        b = places[p].body
        if b < 0:
            break
        needed = p == sources[b].main or (p == sources[b].leaving and sources[b].left == step)
        if not needed and not _awake(lines, p, channels):
            break
        p += 1
    return p


@njit(nogil=True, error_model="numpy")
def survey(step, n, emission, course, path):  # pragma: no cover - compiled
    """Mark which bodies emit, find new places for those teleported in this step, and return what is in the way.

    The distance of what emits is greatest at an end of the step. Silence needs no fade: a silent body keeps its place.
    """
    gain, channels, long = course.gain, len(path.microphone_m), emission.source.shape[2]
    sources, places, lines, first = path.sources, path.places, path.lines, emission.first
    free, wrong = np.int64(0), OUTCOME.done  # a plain 0 has its own type, and each callee would be compiled for it too
    for b in range(len(sources)):
        body = sources[b]
        most = greatest(emission.source, b * long + first, emission.dipole, 3 * b * long + first, long, n)
        if most >= INFINITE:
            return OUTCOME.not_finite
        body.sounds, body.fresh, body.away_m = 1 if most > 0 else 0, -1, 0.0
        start, stop = 0.0, 0.0
        for c in range(channels):
            if len(gain) > 0 and gain[0, b, c] == 0.0 and gain[1, b, c] == 0.0 and not _hears(lines, body, c, channels):
                continue
            here, there = _squares(course, path.microphone_m, b, c)
            start, stop = start if here <= start else here, stop if there <= stop else there
        main, old = body.main, -1
        observed = body.sounds == 1 or _awake(lines, main, channels)
        if body.left == step:
            if body.sounds == 1 or _awake(lines, body.leaving, channels):
                old = body.leaving
        elif course.teleported[b] and observed:
            main, old = _free_place(places, lines, sources, step, free, channels), main
            if main == len(places):
                return OUTCOME.places_short
            body.fresh, free = main, main + 1
        elif start > stop or not start < np.inf:
            stop = start
        for k in range(2):
            p = main if k == 0 else old
            if p >= 0 and (k == 1 or observed):
                said = _fits(places[p], body, stop if k == 0 else start, path.samples_per_m)
                wrong = said if said > wrong else wrong
    return wrong


@njit(nogil=True, error_model="numpy")
def move_body(step, sources, places, b, p):  # pragma: no cover - compiled
    """Give body b the present place p; the one it had becomes a left one."""
    old = places[p].body
    if old >= 0:  # remove it from its former chain
        if sources[old].oldest == p:
            sources[old].oldest = places[p].next
        else:
            before = sources[old].oldest
            while places[before].next != p:
                before = places[before].next
            places[before].next = places[p].next
        if sources[old].leaving == p:
            sources[old].leaving = -1
    places[p].body, places[p].next = b, -1
    places[sources[b].main].next = p
    sources[b].leaving, sources[b].main, sources[b].left = sources[b].main, p, step
