"""Sound path of one step, or a part of it, as one compiled call: `hear`.

    source, dipole, poses -> is each number finite, does every history reach far enough?  (`path_places.survey`: nothing
        has changed so far)
      -> a teleported body gets a new place, its old one fades out over the step
      -> each body's places, by when it came there, and microphones: emitted (`fractional_delay.emit`) -> histories
      -> what arrives (`fractional_delay.read`), summed in this order -> out

A line sleeps until something is emitted and again when the last of it has arrived. That is decided sample by sample, so
frames do not matter.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.machine.borrowed import borrowed
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.vector import LANES, At
from sonic_bullet.path.fractional_delay import (
    AHEAD,
    KEPT,
    MOST_FALL,
    TAPS,
    add,
    clear,
    emit,
    flush,
    leading,
    move,
    read,
)
from sonic_bullet.path.path_places import MIRRORED, OUTCOME, PATH_BLOCK, move_body, survey
from sonic_bullet.records import Array

_SPAN = PATH_BLOCK + LANES
WORK = 3 * _SPAN + 8 + 5 * LANES + KEPT
"""Doubles of scratch that `hear` uses."""
AT_REST = np.zeros((0, 0, 0, 3))
"""``aim_m`` where no microphone moves."""
ALL_ALIKE = np.zeros((0, 0, 0))
"""``gain`` where all sound reaches each microphone as it is."""


class _Work(NamedTuple):
    """Scratch of `hear`, parts of WORK numbers: a block of one line, its geometry, what does not fill eight, taps."""

    emitted: Array
    delay: Array
    observed: Array
    geometry: Array
    tail: Array
    kept: Array


class _Ring(NamedTuple):
    """History of one line: memory, where the ring of what is emitted begins, where that of delays, size less one."""

    memory: Array
    at: int
    late_at: int
    mask: int


@njit(nogil=True, error_model="numpy")
def _newest(emitted, start, stop, none):  # pragma: no cover - compiled
    """Find the last of emitted[start:stop] that is not zero; ``none`` where all are."""
    i = stop - 1
    while i >= start and emitted[i] == 0.0:
        i -= 1
    return i if i >= start else none


@njit(nogil=True, error_model="numpy")
def _last(emitted, i, stop, newest, behind):  # pragma: no cover - compiled
    """Find the first sample from i on at which the newest that is not zero has arrived, ``stop`` for none.

    behind: from a sample to the first that it is read from.
    """
    while i < stop:
        newest = i if emitted[i] != 0.0 else newest
        if i + behind > newest:
            break
        i += 1
    return i


@njit(nogil=True, error_model="numpy")
def _remember(ring, at, start, n, work, before, steep):  # pragma: no cover - compiled
    """Write samples at + start … at + n - 1, which lie in one piece, into a line's history.

    before: the delay before them; steep: delays fall faster than MOST_FALL.
    """
    memory, ring_at, late_at, mask, delay = ring.memory, ring.at, ring.late_at, ring.mask, work.delay
    place, count = (at + start) & mask, n - start
    again = MIRRORED - place
    again = count if count < again else again
    move(work.emitted, start, memory, ring_at + place, count)
    move(delay, start, memory, late_at + place, count)
    if steep or delay[start] < before - MOST_FALL:
        for i in range(start, n):
            before = delay[i] if delay[i] > before - MOST_FALL else before - MOST_FALL
            memory[late_at + place + i - start] = before
    if again > 0:
        move(memory, ring_at + place, memory, ring_at + mask + 1 + place, again)
        move(memory, late_at + place, memory, late_at + mask + 1 + place, again)


@njit(nogil=True, error_model="numpy")
def _wake(ring, n, late):  # pragma: no cover - compiled
    """Fill the history before sample n with silence at that delay."""
    history = 3 * AHEAD
    memory, ring_at, late_at, mask = ring.memory, ring.at, ring.late_at, ring.mask
    for k in range(n - history, n):
        place = k & mask
        memory[ring_at + place], memory[late_at + place] = 0.0, late
        if place < MIRRORED:
            memory[ring_at + mask + 1 + place], memory[late_at + mask + 1 + place] = 0.0, late


@njit(nogil=True, error_model="numpy")
def _listen(line, at, n, steep, ring, taps, work):  # pragma: no cover - compiled
    """Run one line over work.emitted (n,) and write its arrivals into observed (n,). False where nothing arrives.

    Samples count from ``at`` in here: i, m, newest.
    """
    memory, ring_at, late_at, mask = ring.memory, ring.at, ring.late_at, ring.mask
    emitted, delay, observed = work.emitted, work.delay, work.observed
    awake, m, newest = line.awake != 0, line.cursor - at, line.newest - at
    start = np.int64(0)  # not a plain 0: see path_places.survey
    if awake:
        before = memory[late_at + ((at - 1) & mask)]
        _remember(ring, at, start, n, work, before, steep)
    i, arrives, waits = 0, False, True
    while i < n:
        if not awake:
            while i < n and emitted[i] == 0.0:
                i += 1
            if i == n:
                break
            awake, waits, m, newest = True, True, i - AHEAD - 1, i
            _wake(ring, at + i, delay[i])
            _remember(ring, at, i, n, work, -np.inf, steep)
        if waits:
            waits = False
            begin = m + int(np.ceil(memory[late_at + ((at + m) & mask)]))
            if begin > i:  # none of it has arrived yet
                begin = begin if begin < n else n
                newest = _newest(emitted, i, begin, newest)
                i = begin
                continue
        if not arrives:
            arrives = True
            clear(observed, 0, n)
        base = m + 1  # usual case: a whole group, one sample further
        count = leading(memory, late_at + ((at + base) & mask), base - i)
        if count == 0:
            base = m
            while (base + 1 - i) + memory[late_at + ((at + base + 1) & mask)] <= 0.0:
                base += 1
            count = leading(memory, late_at + ((at + base) & mask), base - i)
        first, late = ring_at + ((at + base + 1 - AHEAD) & mask), late_at + ((at + base) & mask)
        read(memory, first, late, base - i, taps, work.kept, At(observed, i))
        if count == LANES and i + LANES <= n and newest >= i - LANES and emitted[i + LANES - 1] != 0.0:
            newest = i + LANES - 1
            i, m = i + LANES, base + LANES - 1
            continue
        stop = i + count if i + count < n else n
        last = _last(emitted, i, stop, newest, base - (AHEAD - 1) - i)
        awake, newest = last == stop, _newest(emitted, i, last, newest)
        m, i = base + last - 1 - i, last
        if not awake:
            clear(observed, i, LANES)
            i += 1
    line.awake, line.cursor, line.newest = 1 if awake else 0, at + m, at + newest
    return arrives


@njit(nogil=True, error_model="numpy")
def _emit(b, w, first, n, emission, x, fade, work):  # pragma: no cover - compiled
    """Compute a and D of body b, weight set w, as `fractional_delay.emit`, faded; return whether delays fall fast.

    fade: 0 none, 1 in, -1 out, 2 silent from now on. work.tail (5·LANES,): samples after the last whole group.
    """
    source, dipole, tail = emission.source, emission.dipole, work.tail
    whole, bodies, long = n & -LANES, source.shape[1], source.shape[2]
    for k in range(n - whole):
        i = first + whole + k
        tail[k], tail[4 * LANES + k] = source[w, b, i], x[i]
        for axis in range(3):
            tail[(1 + axis) * LANES + k] = dipole[b, axis, i]
    arrays = At(source, (w * bodies + b) * long + first), At(dipole, 3 * b * long + first), At(x, first)
    steep = emit(arrays, long, tail, n, work.geometry, work.emitted, work.delay)
    if fade != 0:
        begin, slope = 1.0 if fade == -1 else 0.0, 0.0 if fade == 2 else float(fade)
        for i in range(n):
            work.emitted[i] *= begin + slope * x[first + i]
        flush(work.emitted, 0, n)
    return steep != 0


@njit(nogil=True, error_model="numpy")
def _weaken(emitted, gains, x, first, n):  # pragma: no cover - compiled
    """Multiply what is emitted by factors that go from one to the other over the step."""
    if gains[0] != 1.0 or gains[1] != 1.0:
        for i in range(n):
            emitted[i] *= gains[0] + (gains[1] - gains[0]) * x[first + i]
        flush(emitted, 0, n)


@njit(nogil=True, error_model="numpy")
def _gains(gain, b, c, fade):  # pragma: no cover - compiled
    """Return the factors at a step's ends of what body b emits to microphone c; fading, it is at one place."""
    if len(gain) == 0:
        return 1.0, 1.0
    begin = gain[1, b, c] if fade == 1 else gain[0, b, c]
    return begin, gain[0, b, c] if fade == -1 else gain[1, b, c]


@njit(nogil=True, error_model="numpy")
def hear(at, step, n, emission, course, path, scratch, arrivals):  # noqa: PLR0912  # pragma: no cover - compiled
    """Compute the pressure (Pa) at samples at … at + n - 1 of the step into an `Arrivals`.

    Bodies are summed in order; below 1e-30 Pa: 0. Returns `OUTCOME.done`, or what is in the way.

    Parameters
    ----------
    step : ≥ 0, number of the step that these samples are (part of)
    emission, course, path, arrivals : groups of `path_places`; the path's tables are changed in place
    scratch : (WORK,)
    """
    emission, course, path, arrivals = borrowed(emission), borrowed(course), borrowed(path), borrowed(arrivals)
    scratch = borrowed(scratch)
    status = survey(step, n, emission, course, path)
    if status != OUTCOME.done:
        return status
    begin_m, end_m, aim_m, out, apart = course.begin_m, course.end_m, course.aim_m, arrivals.out, arrivals.apart
    sources, places, microphone_m, first = path.sources, path.places, path.microphone_m, emission.first
    channels, moves = len(microphone_m), len(aim_m) > 0
    rows = channels * (len(sources) if apart else 1)
    for row in range(rows):
        clear(out, row * out.shape[1] + arrivals.at, n)
    geometry = scratch[3 * _SPAN : 3 * _SPAN + 8]
    work = _Work(
        scratch[:_SPAN], scratch[_SPAN : 2 * _SPAN], scratch[2 * _SPAN : 3 * _SPAN], geometry,
        scratch[3 * _SPAN + 8 : WORK - KEPT], scratch[WORK - KEPT : WORK],
    )  # fmt: skip
    work.kept[TAPS * LANES] = np.nan
    geometry[6] = path.samples_per_m
    for b in range(len(sources)):
        body = sources[b]
        if body.fresh >= 0:
            move_body(step, sources, places, b, body.fresh)
            for axis in range(3):
                places[body.leaving].rest_m[axis] = begin_m[b, axis]
        geometry[7] = 1.0 / body.radius_m
        p = body.oldest
        while p >= 0:
            place = places[p]
            present, moved = p == body.main, body.left == step
            fade = (1 if present else (-1 if p == body.leaving else 2)) if moved else (0 if present else 2)
            for c in range(channels):
                line, gains = path.lines[p * channels + c], _gains(course.gain, b, c, fade)
                if line.awake == 0 and (fade == 2 or body.sounds == 0 or (gains[0] == 0.0 and gains[1] == 0.0)):
                    continue
                for axis in range(3):
                    stop = end_m[b, axis] if present else place.rest_m[axis]
                    start = begin_m[b, axis] if fade == 0 else stop
                    geometry[axis], geometry[3 + axis] = microphone_m[c, axis] - start, stop - start
                    if moves:
                        here, there = aim_m[0, b, c, axis], aim_m[1, b, c, axis]
                        geometry[axis], geometry[3 + axis] = here - start, (stop - start) - (there - here)
                ring_at, mask, lo = place.memory_at + c * 2 * (place.size + MIRRORED), place.size - 1, 0
                ring = _Ring(path.memory, ring_at, ring_at + place.size + MIRRORED, mask)
                while lo < n:  # a block that lies in one piece
                    count = place.size - ((at + lo) & mask)
                    count = count if count < PATH_BLOCK else PATH_BLOCK
                    count = count if count < n - lo else n - lo
                    steep = _emit(b, emission.sets[c], first + lo, count, emission, course.x, fade, work)
                    _weaken(work.emitted, gains, course.x, first + lo, count)
                    if _listen(line, at + lo, count, steep, ring, path.taps, work):
                        row = (b * channels if apart else 0) + c
                        add(work.observed, out, row * out.shape[1] + arrivals.at + lo, count)
                    lo += count
            p = place.next
    for row in range(rows):
        flush(out, row * out.shape[1] + arrivals.at, n)
    return OUTCOME.done
