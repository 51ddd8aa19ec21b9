"""How `room` is looked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import Sound
from sonic_bullet.effects.room import RT60, Room
from sonic_bullet.lab.effects.common import reverberant_tail
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.lab.effects.foreign_mode import propose_foreign_mode
from sonic_bullet.lab.effects.room.shifted_echo import find_copy_ratio
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor, white

RATES = np.geomspace(1.7, 70.0, 16)  # of δ in 1/s: rt60 of 4 to 0.1 s
FINE = np.linspace(-0.25, 0.25, 9)  # of ln δ about the best of these

ROOM_LINES = 24  # the strongest
# than the room; lines that are, and of all: who they must be to tell it
FASTER_THAN_ROOM = 1.25
FEWEST_FASTER_LINES = 3
FASTER_LINES_SHARE = 0.35
# what is heard between the loudest modes comes last; from a response that is nearly right there is less to do; for
# good
ROOM_TURNS = 150
ROOM_TURNS_AGAIN = 40
ROOM_TURNS_FULLY = 400


def without_room(room: Room, observed: ObjectEvidence, *, foreign: bool = True) -> ObjectEvidence:
    """Return the evidence with its lines as they would be without the room; foreign: those that are no mode, too."""
    return reverberant_tail.remove_tail(observed, RT60 / room.rt60_s, foreign=foreign)


def identified_room(room: Room, signal: Array, sound: Array, noise: Floor, sr: int, *, fully: bool = False) -> Room:
    """Identify the room's response from recordings, starting from the one it has.

    Parameters
    ----------
    signal : (s, n)
        Recordings of strikes.
    sound : (s, n)
        The same without the room, synthesized.
    noise : Floor
        The recordings' noise.
    sr : int
        Sampling rate in Hz.
    fully : bool
        Iterate to convergence.
    """
    start = room.response if room.sr == sr and len(room.response) == signal.shape[1] else None
    turns = ROOM_TURNS_FULLY if fully else ROOM_TURNS if start is None else ROOM_TURNS_AGAIN
    return replace(
        room,
        response=identify_tail(signal, sound, noise, sr, RT60 / room.rt60_s, room.reverberant_level, start, turns),
        sr=sr,
    )


def propose_room(evidence: Evidence) -> Room | None:
    """Identify the reverberation of the object with most lines; None where their late decays are not one."""
    observed = max(evidence.observed, key=lambda h: len(h.freq_hz))
    if (
        observed.signal is None
        or observed.predicted is None
        or len(observed.freq_hz) < FEWEST_FASTER_LINES
        or observed.signal.shape[1] < reverberant_tail.LEAST * reverberant_tail.FRAME_S * observed.sr
    ):
        return None
    if find_copy_ratio(observed.every_hz, observed.every_decay_per_s, observed.every_amplitude) is not None:
        return None  # something moves
    found = late(observed, RT60 / evidence.known.rt60_s if isinstance(evidence.known, Room) else None)
    if found is None:
        return None
    delta, reverberant_level = found
    sound, along = (
        reverberant_tail.direct(observed, delta),
        propose_foreign_mode(replace(evidence, observed=(reverberant_tail.remove_tail(observed, delta),))),
    )
    if along is not None:  # what rings along is heard in the room too
        strikes = zip(sound, observed.level_n_s, strict=True)
        sound = np.stack([along.apply(Sound(x, observed.sr, float(j))).sample for x, j in strikes])
    noise = white(float(np.median(observed.noise))) if observed.floor is None else observed.floor
    return identified_room(Room(RT60 / delta, reverberant_level), observed.signal, sound, noise, observed.sr)


def late(h: ObjectEvidence, known: float | None = None) -> tuple[float, float] | None:
    """Estimate δ in 1/s and w; None where the lines' late decays are not one.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    known : float
        δ found in the whole evidence, near which it is estimated again.
    """
    lines = np.sort(np.argsort(-np.abs(h.amplitude).max(axis=0))[:ROOM_LINES])
    rates = known * np.exp(2 * FINE[::2]) if known else RATES
    r = reverberant_tail.modes(h, rates, lines, every=1 if known else 2)
    best = int(_log_likelihood(r).argmax())
    if not known:
        if best in (0, len(rates) - 1) or not _one(r, best):
            return None
        r = reverberant_tail.modes(h, rates[best] * np.exp(FINE), lines)
        best = int(_log_likelihood(r).argmax())
    mine = r.decay_per_s[best] > FASTER_THAN_ROOM * r.delta[best]
    return float(r.delta[best]), float(
        np.median(r.reverberant_level[best][mine] if mine.any() else r.reverberant_level[best])
    )


def _log_likelihood(r: reverberant_tail.TailEstimates) -> Array:
    """Compute ln likelihood (t,) of each rate, no line's influence larger than cap."""
    cap = 20.0  # of ln likelihood: what one line can speak against a rate
    return np.asarray(np.maximum(r.ln_likelihood - r.ln_likelihood.max(axis=0), -cap).sum(axis=1))


def _one(r: reverberant_tail.TailEstimates, best: int) -> bool:
    """Decide whether lines that decay faster than the room end with it, all of them alike."""
    # ln likelihood a line gains; of all lines: so few will do where FEWEST_FASTER_LINES tell it as plainly as that
    plainly, less = 100.0, 0.25
    # ln likelihood a line gains with a tail; of ln δ: how far lines may lie from one another, by the middle
    tells, alike = 10.0, 0.3
    gain, delta = r.ln_likelihood[best] - r.plain, r.delta[best]
    mine = (r.decay_per_s[best] > FASTER_THAN_ROOM * delta) & (gain > tells)
    off = np.abs(np.log(r.delta[r.ln_likelihood.argmax(axis=0)] / delta))[mine]
    many = mine.mean() > FASTER_LINES_SHARE or (
        mine.mean() > less and (gain[mine] > plainly).sum() >= FEWEST_FASTER_LINES
    )
    return bool(
        mine.sum() >= FEWEST_FASTER_LINES and many and np.median(off) < alike and (off < 2 * alike).mean() > 0.7
    )


def identify_tail(
    signal: Array,
    sound: Array,
    noise: Floor,
    sr: int,
    delta: float,
    reverberant_level: float,
    start: Array | None = None,
    turns: int = ROOM_TURNS,
) -> Array:
    """Estimate the tail (n,) by conjugate gradients on the normal equations under its prior.

    Parameters
    ----------
    signal : (s, n)
        Recordings of strikes.
    sound : (s, n)
        The same without the room, synthesized.
    noise : Floor
        The recordings' noise.
    sr : int
        Sampling rate in Hz.
    delta : float
        δ in 1/s.
    reverberant_level : float
        w.
    start : (n,)
        Tail to start from, none where None.
    turns : int
        Iterations at most.
    """
    model_error = 0.03  # of the direct sound's spectrum, relative: what shapes and pulses get wrong
    from scipy.fft import irfft, next_fast_len, rfft
    from scipy.sparse.linalg import LinearOperator, cg

    n = signal.shape[1]
    size = next_fast_len(2 * n, real=True)
    x, y = rfft(sound, size, axis=1), rfft(signal - sound, size, axis=1)
    level = noise.at(size // 2 + 1) * n
    power = (np.abs(x) ** 2).sum(axis=0)
    smooth = np.convolve(power, np.ones(9) / 9, "same")
    trust = 1 / (level + model_error**2 * smooth + 1e-12 * smooth.max())
    # h = root · g, g of unit variance
    root = reverberant_level * np.sqrt(2 * delta / sr) * np.exp(-delta * np.arange(n) / sr)

    def back(spectrum: Array) -> Array:
        return np.asarray(irfft(spectrum, size)[:n] * size * root)

    def normal(g: Array) -> Array:
        return np.asarray(back(trust * power * rfft(root * g, size)) + g)

    right = back(trust * (np.conj(x) * y).sum(axis=0))
    begin = None if start is None else start / np.maximum(root, 1e-300)
    equations = LinearOperator((n, n), matvec=normal, dtype=float)
    return np.asarray(root * cg(equations, right, begin, rtol=1e-5, maxiter=turns)[0])
