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
from sonic_bullet.synth.fractional_delay import AHEAD, FLUSH, KEPT, INFINITE, TAPS, emit, greatest, leading, move, read
from sonic_bullet.synth.vector import LANES

DONE, MEMORY_SHORT, PLACES_SHORT, TOO_FAR, NOT_FINITE = range(5)
"""What `hear` says. But for DONE nothing has changed. After MEMORY_SHORT (a place's size is below its need) and
PLACES_SHORT (one more a body are enough) it may be called again with longer tables: `path.grow`.
"""

FARTHEST_M = 1000.0
BLOCK = 256
MIRRORED = TAPS + LANES
LEAST_ADVANCE = 1.0 / 16.0
"""Sound emitted one sample later arrives at least this much later: a source at or above the speed of sound is not
overtaken by its own sound.
"""
SAFE_ADVANCE = 0.9
"""A delay that falls by less than this much a sample needs no look at LEAST_ADVANCE."""
MARGIN = BLOCK + 64
"""Samples remembered beyond the longest delay: a block is emitted before any of it is listened to."""

SOURCE = np.dtype(
    [
        ("radius_m", "f8"),
        ("oldest", "i8"),  # place: the first of its chain
        ("main", "i8"),  # its present place, the last of the chain
        ("leaving", "i8"),  # the place it left in step ``left``; -1: none
        ("left", "i8"),  # step in which it was last moved by hand; -1: none
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


@njit(nogil=True, error_model="numpy", forceinline=True)
def _judged(values, at, n):  # pragma: no cover - compiled
    """n of the values from element ``at`` on: 0 silent, 1 something sounds, 2 or 3 one of them is not finite."""
    whole = n - n % LANES
    most = greatest(values, at, whole)
    said = 2 if most >= INFINITE else (1 if most > 0 else 0)
    flat = values.reshape(-1)
    for k in range(at + whole, at + n):
        said |= 1 if flat[k] != 0.0 else 0
        said |= 0 if abs(flat[k]) < np.inf else 2
    return said


@njit(nogil=True, error_model="numpy", forceinline=True)
def _awake(lines, place, channels):  # pragma: no cover - compiled
    """Whether sound of the place is under way to any microphone."""
    some = 0
    for c in range(channels):
        some |= lines[place * channels + c].awake
    return some != 0


@njit(nogil=True, error_model="numpy")
def _free_place(places, lines, sources, step, start, channels):  # pragma: no cover - compiled
    """The next place from ``start`` on that nothing is heard from and no body needs; the number of places for none."""
    for p in range(start, len(places)):
        b = places[p].body
        if b < 0:
            return p
        needed = p == sources[b].main or (p == sources[b].leaving and sources[b].left == step)
        if not needed and not _awake(lines, p, channels):
            return p
    return len(places)


@njit(nogil=True, error_model="numpy")
def _farthest(begin_m, end_m, b, first, last, microphone_m):  # pragma: no cover - compiled
    """Greatest distance of body b from any microphone at the step's start (``first``) and end (``last``): on a straight
    way it lies at an end. NaN where one is.
    """
    most = 0.0
    for c in range(len(microphone_m)):
        start, stop = 0.0, 0.0
        for axis in range(3):
            start += (begin_m[b, axis] - microphone_m[c, axis]) ** 2
            stop += (end_m[b, axis] - microphone_m[c, axis]) ** 2
        square = max(start if first else 0.0, stop if last else 0.0) if start < np.inf and stop < np.inf else np.nan
        most = most if square <= most else square
    return np.sqrt(most)


@njit(nogil=True, error_model="numpy", forceinline=True)
def _fits(place, source, away_m, samples_per_m):  # pragma: no cover - compiled
    """DONE, or what is wrong with a place that sounds so far away."""
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


@njit(nogil=True, error_model="numpy")
def _survey(step, n, first, source, pushed, begin_m, end_m, teleported, microphone_m, samples_per_m, sources, places, lines, loud, fresh):  # fmt: skip  # pragma: no cover - compiled
    """Mark which bodies emit anything (b,), find new places (b,) for those moved by hand in this step (-1: none), and
    say what is in the way.

    Silence needs no fade: a body of which nothing is observed keeps its place.
    """
    channels, long = len(microphone_m), source.shape[1]
    free, wrong = 0, DONE
    for b in range(len(sources)):
        said = _judged(source, b * long + first, n)
        for axis in range(3):
            said |= _judged(pushed, (3 * b + axis) * long + first, n)
        if said > 1:
            return NOT_FINITE
        loud[b], fresh[b] = said, -1
        body = sources[b]
        main, stays = body.main, True
        observed = said == 1 or _awake(lines, main, channels)
        if teleported[b] and body.left != step and observed:
            p = _free_place(places, lines, sources, step, free, channels)
            if p == len(places):
                return PLACES_SHORT
            fresh[b], free = p, p + 1
            away_m = _farthest(begin_m, end_m, b, True, False, microphone_m)
            wrong = max(wrong, _fits(places[main], body, away_m, samples_per_m))
            main, stays = p, False
        elif body.left == step:
            if said == 1 or _awake(lines, body.leaving, channels):
                away_m = _farthest(begin_m, end_m, b, True, False, microphone_m)
                wrong = max(wrong, _fits(places[body.leaving], body, away_m, samples_per_m))
            stays = False
        if observed:
            away_m = _farthest(begin_m, end_m, b, stays, True, microphone_m)
            wrong = max(wrong, _fits(places[main], body, away_m, samples_per_m))
    return wrong


@njit(nogil=True, error_model="numpy")
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


@njit(nogil=True, error_model="numpy")
def _steepest(x, first, n):  # pragma: no cover - compiled
    """Greatest step from one x to the next."""
    most = 0.0
    for k in range(first + 1, first + n):
        most = max(most, abs(x[k] - x[k - 1]))
    return most


@njit(nogil=True, error_model="numpy", forceinline=True)
def _emit(b, first, n, source, pushed, x, fade, geometry, tail, emitted, delay):  # pragma: no cover - compiled
    """a and D of body b as `fractional_delay.emit` has them, and its fade: 0 none, 1 in, -1 out, 2 nothing any more.

    tail (5·LANES,): lent, for the samples after the last whole group.
    """
    whole = n - n % LANES
    long = source.shape[1]
    emit(source, b * long + first, pushed, 3 * b * long + first, long, x, first, whole, geometry, emitted, delay, 0)
    if whole < n:
        for k in range(n - whole):
            i = first + whole + k
            tail[k], tail[4 * LANES + k] = source[b, i], x[i]
            for axis in range(3):
                tail[(1 + axis) * LANES + k] = pushed[b, axis, i]
        emit(tail, 0, tail, LANES, LANES, tail, 4 * LANES, LANES, geometry, emitted, delay, whole)
    if fade != 0:
        for i in range(n):
            share = x[first + i] if fade == 1 else (1.0 - x[first + i] if fade == -1 else 0.0)
            value = emitted[i] * share
            emitted[i] = value if abs(value) >= FLUSH else 0.0


@njit(nogil=True, error_model="numpy", forceinline=True)
def _put(memory, at, mask, sample, values, start, stop):  # pragma: no cover - compiled
    """values[start:stop] into the ring at ``at``, values[0] being of the given sample."""
    while start < stop:
        place = (sample + start) & mask
        count = min(stop - start, mask + 1 - place)
        move(values, start, memory, at + place, count)
        if place < MIRRORED:
            move(values, start, memory, at + mask + 1 + place, min(count, MIRRORED - place))
        start += count


@njit(nogil=True, error_model="numpy", forceinline=True)
def _remember(memory, ring_at, late_at, mask, at, start, stop, emitted, delay, before, steep):  # pragma: no cover - compiled
    """Samples at + start … at + stop - 1 into a line's history, ``before``: the delay before them.

    steep: the delays may fall faster than LEAST_ADVANCE allows.
    """
    _put(memory, ring_at, mask, at, emitted, start, stop)
    if steep or delay[start] < before - (1.0 - LEAST_ADVANCE):
        for i in range(start, stop):
            before = max(delay[i], before - (1.0 - LEAST_ADVANCE))
            place = (at + i) & mask
            memory[late_at + place] = before
            if place < MIRRORED:
                memory[late_at + mask + 1 + place] = before
    else:
        _put(memory, late_at, mask, at, delay, start, stop)


@njit(nogil=True, error_model="numpy")
def _forget(memory, ring_at, late_at, mask, n, late):  # pragma: no cover - compiled
    """The samples before n as those of a line that wakes: silent, with its delay."""
    for k in range(n - _HISTORY, n):
        place = k & mask
        memory[ring_at + place], memory[late_at + place] = 0.0, late
        if place < MIRRORED:
            memory[ring_at + mask + 1 + place], memory[late_at + mask + 1 + place] = 0.0, late


@njit(nogil=True, error_model="numpy")
def _newest(emitted, start, stop, none):  # pragma: no cover - compiled
    """The last of emitted[start:stop] that is not zero; ``none`` where all are."""
    for i in range(stop - 1, start - 1, -1):
        if emitted[i] != 0.0:
            return i
    return none


@njit(nogil=True, error_model="numpy", forceinline=True)
def _listen(line, at, n, emitted, delay, heard, memory, ring_at, mask, taps, kept, steep):  # pragma: no cover - compiled
    """Run one line over emitted (n,); what arrives into heard (n,). False where nothing does.

    Samples count from ``at`` in here: i, m, newest.
    """
    late_at = ring_at + mask + 1 + MIRRORED
    awake, m, newest = line.awake != 0, line.cursor - at, line.newest - at
    if awake:
        _remember(memory, ring_at, late_at, mask, at, 0, n, emitted, delay, memory[late_at + ((at - 1) & mask)], steep)
    i, arrives = 0, False
    while i < n:
        if not awake:
            while i < n and emitted[i] == 0.0:
                i += 1
            if i == n:
                break
            awake, m, newest = True, i - AHEAD - 1, i
            _forget(memory, ring_at, late_at, mask, at + i, delay[i])
            _remember(memory, ring_at, late_at, mask, at, i, n, emitted, delay, -np.inf, steep)
        begin = m + int(np.ceil(memory[late_at + ((at + m) & mask)]))
        if begin > i:  # nothing of it has arrived yet
            stop = min(begin, n)
            newest = _newest(emitted, i, stop, newest)
            i = stop
            continue
        if not arrives:
            arrives = True
            for k in range(n):
                heard[k] = 0.0
        # the rule: whole groups of a line that sounds, each sample one further than that before
        while i + LANES <= n and newest >= i - LANES and emitted[i + LANES - 1] != 0.0:
            ring, late = (at + m + 2 - AHEAD) & mask, (at + m + 1) & mask
            if leading(memory, late_at + late, m + 1 - i) != LANES:
                break
            read(memory, ring_at + ring, late_at + late, m + 1 - i, taps, kept, heard, i)
            newest = i + LANES - 1
            i += LANES
            m += LANES
        if i == n:
            break
        base = m + 1
        count = leading(memory, late_at + ((at + base) & mask), base - i)
        if count == 0:
            base = m
            while (base + 1 - i) + memory[late_at + ((at + base + 1) & mask)] <= 0.0:
                base += 1
            count = leading(memory, late_at + ((at + base) & mask), base - i)
        count = min(count, n - i)
        if newest < i - LANES:  # the last of it may arrive within this group
            for k in range(count):
                newest = i + k if emitted[i + k] != 0.0 else newest
                if base + k - (AHEAD - 1) > newest:
                    awake, count = False, k
                    break
        else:
            newest = _newest(emitted, i, i + count, newest)
        read(memory, ring_at + ((at + base - (AHEAD - 1)) & mask), late_at + ((at + base) & mask), base - i, taps, kept, heard, i)  # fmt: skip
        i += count
        m = base + count - 1
        if not awake:
            for k in range(i, min(i + LANES, n)):
                heard[k] = 0.0
            i += 1
    line.awake, line.cursor, line.newest = 1 if awake else 0, at + m, at + newest
    return arrives


@njit(nogil=True, error_model="numpy", forceinline=True)
def _play(at, step, n, first, source, pushed, x, steepest, begin_m, end_m, microphone_m, samples_per_m, body, b, p, loud,
          places, lines, memory, taps, emitted, delay, heard, kept, geometry, tail, out, out_at):  # fmt: skip  # pragma: no cover - compiled
    """One place of body b, to every microphone."""
    place = places[p]
    present, moved = p == body.main, body.left == step
    fade = (1 if present else (-1 if p == body.leaving else 2)) if moved else (0 if present else 2)
    channels, size = len(microphone_m), place.size
    for c in range(channels):
        line = lines[p * channels + c]
        if line.awake == 0 and (fade == 2 or not loud):
            continue
        change = 0.0
        for axis in range(3):
            start, stop = begin_m[b, axis] if fade == 0 else end_m[b, axis], end_m[b, axis]
            if not present:
                start = stop = place.rest_m[axis]
            geometry[axis], geometry[3 + axis] = microphone_m[c, axis] - start, stop - start
            change += geometry[3 + axis] ** 2
        geometry[6], geometry[7] = samples_per_m, 1.0 / body.radius_m
        steep = np.sqrt(change) * samples_per_m * steepest > SAFE_ADVANCE
        ring_at = place.memory_at + c * 2 * (size + MIRRORED)
        for lo in range(0, n, BLOCK):
            count = min(BLOCK, n - lo)
            _emit(b, first + lo, count, source, pushed, x, fade, geometry, tail, emitted, delay)
            if _listen(line, at + lo, count, emitted, delay, heard, memory, ring_at, size - 1, taps, kept, steep):
                here = np.uintp(out_at + lo)  # unsigned: numba looks for no wrapped index
                for i in range(np.uintp(count)):
                    out[c, here + i] += heard[i]


@njit(nogil=True, error_model="numpy")
def hear(at, step, n, first, source, pushed, begin_m, end_m, teleported, x, microphone_m, samples_per_m, sources, places, lines, memory, taps, work, out, out_at):  # fmt: skip  # pragma: no cover - compiled
    """Pressure (Pa) at samples at … at + n - 1 of the step into out (c, ≥ out_at + n) from column out_at on.

    source (≥ b, ·) in Pa·m, pushed (≥ b, 3, ·) in Pa·m along each axis, x (·): where between the step's ends each
    sample lies, 0 … 1; all three from column ``first`` on. begin_m, end_m (≥ b, 3), teleported (≥ b,): moved by hand.
    step ≥ 0: number of the step these samples are (part of). sources (b,) SOURCE, places (t,) PLACE, lines (t·c,) LINE,
    memory: what is under way, changed in place. taps: `tap_polynomials`. work (WORK,): lent. Bodies are summed in order; below 1e-30 Pa: 0.
    """
    source, pushed, begin_m, end_m, x, microphone_m = borrowed(source), borrowed(pushed), borrowed(begin_m), borrowed(end_m), borrowed(x), borrowed(microphone_m)  # fmt: skip
    sources, places, lines, memory, taps, work, out = borrowed(sources), borrowed(places), borrowed(lines), borrowed(memory), borrowed(taps), borrowed(work), borrowed(out)  # fmt: skip
    channels, bodies = len(microphone_m), len(sources)
    loud, fresh = np.empty(bodies, np.int64), np.empty(bodies, np.int64)
    status = _survey(step, n, first, source, pushed, begin_m, end_m, teleported, microphone_m, samples_per_m, sources, places, lines, loud, fresh)  # fmt: skip
    if status != DONE:
        return status
    for c in range(channels):
        out[c, out_at : out_at + n] = 0.0
    emitted, delay, heard = work[:_SPAN], work[_SPAN : 2 * _SPAN], work[2 * _SPAN : 3 * _SPAN]
    geometry, tail, kept = work[3 * _SPAN : 3 * _SPAN + 8], work[3 * _SPAN + 8 : WORK - KEPT], work[WORK - KEPT : WORK]
    kept[TAPS * LANES] = np.nan
    steepest = _steepest(x, first, n)
    for b in range(bodies):
        body = sources[b]
        if fresh[b] >= 0:
            _move(step, sources, places, b, fresh[b])
            for axis in range(3):
                places[body.leaving].rest_m[axis] = begin_m[b, axis]
        p = body.oldest
        while p >= 0:
            if loud[b] == 1 or _awake(lines, p, channels):
                _play(at, step, n, first, source, pushed, x, steepest, begin_m, end_m, microphone_m, samples_per_m, body, b, p, loud[b] == 1,
                      places, lines, memory, taps, emitted, delay, heard, kept, geometry, tail, out, out_at)  # fmt: skip
            p = places[p].next
    for c in range(channels):
        total = out[c, out_at : out_at + n]
        for i in range(n):
            if abs(total[i]) < FLUSH:
                total[i] = 0.0
    return DONE
