"""The sound path of one step, or a part of it, as one compiled call: `hear`.

    source, push, poses -> is each number finite, does every history reach far enough?    nothing has changed so far
      -> a body moved by hand gets a new place, its old one fades out over the step
      -> each body's places, by when it came there, and microphones: emitted (`fractional_delay.emit`) -> histories
      -> what arrives (`fractional_delay.read`), summed in this order -> out

A line is one place and one microphone: line place·channels + c. It sleeps until something is emitted and again when the
last of it has arrived; that is decided sample by sample, so frames do not matter. Its history lies in memory from
place.memory_at + c·2·(size + MIRRORED) on: emitted, then delays, both rings of a power of two with their first MIRRORED
elements once more at their ends, so that what is read is always contiguous.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from sonic_bullet.machine.borrowed import borrowed
from sonic_bullet.machine.compiled import njit
from sonic_bullet.synth.fractional_delay import AHEAD, KEPT, INFINITE, MOST_FALL, TAPS, add, clear, emit, flush, greatest, leading, move, read
from sonic_bullet.synth.vector import LANES

DONE, MEMORY_SHORT, PLACES_SHORT, TOO_FAR, NOT_FINITE = range(5)
"""What `hear` says. But for DONE nothing has changed. After MEMORY_SHORT (a place's size is below its need) and
PLACES_SHORT (one more a body are enough) it may be called again with longer tables: `path.grow`.
"""

FARTHEST_M = 1000.0
BLOCK = 256
MIRRORED = TAPS + LANES
MARGIN = BLOCK + 64
"""Samples remembered beyond the longest delay: a block is emitted before any of it is listened to."""

SOURCE = np.dtype(
    [
        ("radius_m", "f8"),
        ("oldest", "i8"),  # place: the first of its chain
        ("main", "i8"),  # its present place, the last of the chain
        ("leaving", "i8"),  # the place it left in step ``left``; -1: none
        ("left", "i8"),  # step in which it was last moved by hand; -1: none
        ("sounds", "i8"),  # 1: emits something in this call
        ("fresh", "i8"),  # place it gets in this call; -1: none
        ("away_m", "f8"),  # where `hear` says TOO_FAR: from the farthest microphone; else 0
    ],
    align=True,
)
"""A body that sounds."""

PLACE = np.dtype(
    [
        ("body", "i8"),  # -1: free
        ("next", "i8"),  # the body's following place; -1: none
        ("rest_m", "f8", (3,)),  # where it lies, once left
        ("size", "i8"),  # samples remembered, a power of two
        ("need", "i8"),  # where `hear` says MEMORY_SHORT: samples it must remember at least
        ("memory_at", "i8"),
    ],
    align=True,
)
"""A body's present position or one that it was moved away from."""

LINE = np.dtype([("awake", "i8"), ("cursor", "i8"), ("newest", "i8")], align=True)
"""awake: sound is under way; cursor: the emitted sample arrived last; newest: the last emitted that is not zero."""

_HISTORY = 3 * AHEAD
_SPAN = BLOCK + LANES
WORK = 3 * _SPAN + 8 + 5 * LANES + KEPT
"""Doubles that `hear` is lent."""


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _awake(lines, place, channels):  # pragma: no cover - compiled
    """Whether sound of the place is under way to any microphone."""
    line, stop = place * channels, (place + 1) * channels
    while line < stop and lines[line].awake == 0:
        line += 1
    return line < stop


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _fits(place, source, square, samples_per_m):  # pragma: no cover - compiled
    """DONE, or what is wrong with a place that sounds at a distance of such a square."""
    away_m = np.sqrt(square)
    if not away_m < np.inf:
        return NOT_FINITE
    if away_m > FARTHEST_M:
        source.away_m = away_m
        return TOO_FAR
    need = int(away_m * samples_per_m) + 1 + MARGIN
    if need <= place.size:
        return DONE
    place.need = need
    return MEMORY_SHORT


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _free_place(places, lines, sources, step, p, channels):  # pragma: no cover - compiled
    """The next place from p on that nothing is heard from and no body needs; the number of places for none."""
    while p < len(places):
        b = places[p].body
        if b < 0:
            break
        needed = p == sources[b].main or (p == sources[b].leaving and sources[b].left == step)
        if not needed and not _awake(lines, p, channels):
            break
        p += 1
    return p


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _survey(step, n, first, source, pushed, begin_m, end_m, teleported, microphone_m, samples_per_m, sources, places, lines):  # fmt: skip  # pragma: no cover - compiled
    """Mark which bodies emit anything, find new places for those moved by hand in this step, and say what is in the
    way: the distance of what sounds is greatest at an end of the step.

    Silence needs no fade: a body of which nothing is observed keeps its place.
    """
    channels, long = len(microphone_m), source.shape[1]
    free, wrong = np.int64(0), DONE  # a plain 0 is a type of its own, and each callee is compiled for it too
    for b in range(len(sources)):
        body = sources[b]
        most = greatest(source, b * long + first, pushed, 3 * b * long + first, long, n)
        if most >= INFINITE:
            return NOT_FINITE
        body.sounds, body.fresh, body.away_m = 1 if most > 0 else 0, -1, 0.0
        start, stop = 0.0, 0.0
        for c in range(channels):
            here, there = 0.0, 0.0
            for axis in range(3):
                u, v = begin_m[b, axis] - microphone_m[c, axis], end_m[b, axis] - microphone_m[c, axis]
                here += u * u
                there += v * v
            start, stop = start if here <= start else here, stop if there <= stop else there
        main, old = body.main, -1
        observed = body.sounds == 1 or _awake(lines, main, channels)
        if body.left == step:
            if body.sounds == 1 or _awake(lines, body.leaving, channels):
                old = body.leaving
        elif teleported[b] and observed:
            main, old = _free_place(places, lines, sources, step, free, channels), main
            if main == len(places):
                return PLACES_SHORT
            body.fresh, free = main, main + 1
        elif observed and not start <= stop:
            stop = start
        for k in range(2):
            p = main if k == 0 else old
            if p >= 0 and (k == 1 or observed):
                said = _fits(places[p], body, stop if k == 0 else start, samples_per_m)
                wrong = said if said > wrong else wrong
    return wrong


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _move(step, sources, places, b, p):  # pragma: no cover - compiled
    """Give body b the present place p; the one it had is left."""
    old = places[p].body
    if old >= 0:  # out of the chain that it was asleep in
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


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _newest(emitted, start, stop, none):  # pragma: no cover - compiled
    """The last of emitted[start:stop] that is not zero; ``none`` where all are."""
    i = stop - 1
    while i >= start and emitted[i] == 0.0:
        i -= 1
    return i if i >= start else none


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _remember(memory, ring_at, late_at, mask, at, start, n, emitted, delay, before, steep):  # pragma: no cover - compiled
    """Samples at + start … at + n - 1, which lie in one piece, into a line's history, ``before``: the delay before them.

    steep: delays fall faster than MOST_FALL.
    """
    place, count = (at + start) & mask, n - start
    again = MIRRORED - place
    again = count if count < again else again
    move(emitted, start, memory, ring_at + place, count)
    move(delay, start, memory, late_at + place, count)
    if steep or delay[start] < before - MOST_FALL:
        for i in range(start, n):
            before = delay[i] if delay[i] > before - MOST_FALL else before - MOST_FALL
            memory[late_at + place + i - start] = before
    if again > 0:
        move(memory, ring_at + place, memory, ring_at + mask + 1 + place, again)
        move(memory, late_at + place, memory, late_at + mask + 1 + place, again)


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _wake(memory, ring_at, late_at, mask, n, late):  # pragma: no cover - compiled
    """Nothing was emitted before sample n, with that delay."""
    for k in range(n - _HISTORY, n):
        place = k & mask
        memory[ring_at + place], memory[late_at + place] = 0.0, late
        if place < MIRRORED:
            memory[ring_at + mask + 1 + place], memory[late_at + mask + 1 + place] = 0.0, late


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _listen(line, at, n, emitted, delay, heard, memory, ring_at, mask, taps, kept, steep):  # pragma: no cover - compiled
    """Run one line over emitted (n,); what arrives into heard (n,). False where nothing does.

    Samples count from ``at`` in here: i, m, newest.
    """
    late_at = ring_at + mask + 1 + MIRRORED
    awake, m, newest = line.awake != 0, line.cursor - at, line.newest - at
    start = np.int64(0)
    if awake:
        _remember(memory, ring_at, late_at, mask, at, start, n, emitted, delay, memory[late_at + ((at - 1) & mask)], steep)
    i, arrives, waits = 0, False, True
    while i < n:
        if not awake:
            while i < n and emitted[i] == 0.0:
                i += 1
            if i == n:
                break
            awake, waits, m, newest = True, True, i - AHEAD - 1, i
            _wake(memory, ring_at, late_at, mask, at + i, delay[i])
            _remember(memory, ring_at, late_at, mask, at, i, n, emitted, delay, -np.inf, steep)
        if waits:
            waits = False
            begin = m + int(np.ceil(memory[late_at + ((at + m) & mask)]))
            if begin > i:  # nothing of it has arrived yet
                begin = begin if begin < n else n
                newest = _newest(emitted, i, begin, newest)
                i = begin
                continue
        if not arrives:
            arrives = True
            clear(heard, 0, n)
        base = m + 1  # the rule: one sample further than that before, for a whole group
        count = leading(memory, late_at + ((at + base) & mask), base - i)
        if count == 0:
            base = m
            while (base + 1 - i) + memory[late_at + ((at + base + 1) & mask)] <= 0.0:
                base += 1
            count = leading(memory, late_at + ((at + base) & mask), base - i)
        read(memory, ring_at + ((at + base + 1 - AHEAD) & mask), late_at + ((at + base) & mask), base - i, taps, kept, heard, i)  # fmt: skip
        if count == LANES and i + LANES <= n and newest >= i - LANES and emitted[i + LANES - 1] != 0.0:
            newest = i + LANES - 1
            i, m = i + LANES, base + LANES - 1
            continue
        count = count if count < n - i else n - i
        for k in range(count):
            newest = i + k if emitted[i + k] != 0.0 else newest
            if base + k - (AHEAD - 1) > newest:  # the last of it has arrived
                awake, count = False, k
                break
        i, m = i + count, base + count - 1
        if not awake:
            clear(heard, i, LANES)
            i += 1
    line.awake, line.cursor, line.newest = 1 if awake else 0, at + m, at + newest
    return arrives


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _emit(b, first, n, source, pushed, x, fade, geometry, tail, emitted, delay):  # pragma: no cover - compiled
    """a and D of body b as `fractional_delay.emit` has them, and its fade: 0 none, 1 in, -1 out, 2 nothing any more.
    Whether delays fall fast.

    tail (5·LANES,): lent, for the samples after the last whole group.
    """
    whole, long = n & -LANES, source.shape[1]
    for k in range(n - whole):
        i = first + whole + k
        tail[k], tail[4 * LANES + k] = source[b, i], x[i]
        for axis in range(3):
            tail[(1 + axis) * LANES + k] = pushed[b, axis, i]
    steep = emit(source, b * long + first, pushed, 3 * b * long + first, long, x, first, tail, n, geometry, emitted, delay, -np.inf)  # fmt: skip
    if fade != 0:
        begin, slope = 1.0 if fade == -1 else 0.0, 0.0 if fade == 2 else float(fade)
        for i in range(n):
            emitted[i] *= begin + slope * x[first + i]
        flush(emitted, 0, n)
    return steep != 0


@njit(nogil=True, error_model="numpy")
def hear(at, step, n, first, source, pushed, begin_m, end_m, teleported, x, microphone_m, samples_per_m, sources, places, lines, memory, taps, work, out, out_at):  # fmt: skip  # pragma: no cover - compiled
    """Pressure (Pa) at samples at … at + n - 1 of the step into out (c, ≥ out_at + n) from column out_at on.

    source (≥ b, ·) in Pa·m, pushed (≥ b, 3, ·) in Pa·m along each axis, x (·): where between the step's ends each
    sample lies, 0 … 1; all three from column ``first`` on. begin_m, end_m (≥ b, 3), teleported (≥ b,): moved by hand.
    step ≥ 0: number of the step these samples are (part of). sources (b,) SOURCE, places (t,) PLACE, lines (t·c,) LINE,
    memory: what is under way, changed in place. taps: `tap_polynomials`. work (WORK,): lent. Bodies are summed in
    order; below 1e-30 Pa: 0.
    """
    source, pushed, begin_m, end_m, x, microphone_m = borrowed(source), borrowed(pushed), borrowed(begin_m), borrowed(end_m), borrowed(x), borrowed(microphone_m)  # fmt: skip
    sources, places, lines, memory, taps, work, out = borrowed(sources), borrowed(places), borrowed(lines), borrowed(memory), borrowed(taps), borrowed(work), borrowed(out)  # fmt: skip
    status = _survey(step, n, first, source, pushed, begin_m, end_m, teleported, microphone_m, samples_per_m, sources, places, lines)  # fmt: skip
    if status != DONE:
        return status
    channels = len(microphone_m)
    for c in range(channels):
        clear(out, c * out.shape[1] + out_at, n)
    emitted, delay, heard = work[:_SPAN], work[_SPAN : 2 * _SPAN], work[2 * _SPAN : 3 * _SPAN]
    geometry, tail, kept = work[3 * _SPAN : 3 * _SPAN + 8], work[3 * _SPAN + 8 : WORK - KEPT], work[WORK - KEPT : WORK]
    kept[TAPS * LANES] = np.nan
    geometry[6] = samples_per_m
    for b in range(len(sources)):
        body = sources[b]
        if body.fresh >= 0:
            _move(step, sources, places, b, body.fresh)
            for axis in range(3):
                places[body.leaving].rest_m[axis] = begin_m[b, axis]
        geometry[7] = 1.0 / body.radius_m
        p = body.oldest
        while p >= 0:
            place = places[p]
            present, moved = p == body.main, body.left == step
            fade = (1 if present else (-1 if p == body.leaving else 2)) if moved else (0 if present else 2)
            for c in range(channels):
                line = lines[p * channels + c]
                if line.awake == 0 and (fade == 2 or body.sounds == 0):
                    continue
                for axis in range(3):
                    stop = end_m[b, axis] if present else place.rest_m[axis]
                    start = begin_m[b, axis] if fade == 0 else stop
                    geometry[axis], geometry[3 + axis] = microphone_m[c, axis] - start, stop - start
                ring_at, mask, lo = place.memory_at + c * 2 * (place.size + MIRRORED), place.size - 1, 0
                while lo < n:  # a block that lies in one piece
                    count = place.size - ((at + lo) & mask)
                    count = count if count < BLOCK else BLOCK
                    count = count if count < n - lo else n - lo
                    steep = _emit(b, first + lo, count, source, pushed, x, fade, geometry, tail, emitted, delay)
                    if _listen(line, at + lo, count, emitted, delay, heard, memory, ring_at, mask, taps, kept, steep):
                        add(heard, out, c * out.shape[1] + out_at + lo, count)
                    lo += count
            p = place.next
    for c in range(channels):
        flush(out, c * out.shape[1] + out_at, n)
    return DONE
