"""`room`: reflections and reverberation: the same late decay in every band, whatever the object.

    y = x + h * x,   h(t) Gaussian with variance w² 2δ e^{−2δt},
        rt60 = ln(10³)/δ, reverberant level w = energy of h over the direct sound's 1, rooted
        [Schroeder 1965; statistics of the tail: Polack 1988; Kuttruff 2009, ch. 4]

δ is the one rate that makes all lines likeliest as modes that ring on in such a tail (reverberant_tail.py), each with a
decay and a level of its own; lines that of themselves decay faster than the room must agree on it, as in every room and
in no body. h, where several strikes identify it, by least squares with that variance as its prior [Wiener 1949]. With a
room, lines are identified as they would be without it (`dereverberated`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np

from sonic_bullet.effects.common import reverberant_tail
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.protocol import Dereverberates, Evidence, Number, ObjectEvidence, Owner, Sound, Stage
from sonic_bullet.effects.room.shifted_echo import copied
from sonic_bullet.records import Array

RT60 = float(np.log(1e3))
RATES = np.geomspace(1.7, 70.0, 16)  # of δ in 1/s: rt60 of 4 to 0.1 s
FINE = np.linspace(-0.25, 0.25, 9)  # of ln δ about the best of these


class _RoomSearch(NamedTuple):
    """Numbers of the search for a room."""

    lines: int = 24  # the strongest
    faster: float = 1.25  # than the room; lines that are, and of all: who they must be to tell it
    fewest_lines: int = 3
    share: float = 0.35
    # what is heard between the loudest modes comes last; from a response that is nearly right there is less to do; for
    # good
    turns: int = 150
    again: int = 40
    fully: int = 400


ROOM_SEARCH = _RoomSearch()


@dataclass(frozen=True)
class Room(Dereverberates):
    """Reverberation of the room."""

    id: ClassVar[str] = "room"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.ROOM
    reference: ClassVar[str] = "Schroeder 1965; Polack 1988; Kuttruff 2009, ch. 4"

    rt60_s: Annotated[float, Number("time in which the tail falls by 60 dB", least=0.0, free=1)]
    reverberant_level: Annotated[float, Number("w of the module's first equation", least=0.0, free=1, key="wet")]
    seed: int = 0
    response: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    sr: int = 0

    def taps(self, sr: int, n: int) -> Array:
        """Compute the tail (n,) at a sampling rate."""
        if len(self.response) and self.sr == sr:
            return np.asarray(np.concatenate([self.response[:n], np.zeros(max(n - len(self.response), 0))]))
        if len(self.response):
            from scipy.signal import resample_poly

            return Room(
                self.rt60_s,
                self.reverberant_level,
                self.seed,
                np.asarray(resample_poly(self.response, sr, self.sr)) * self.sr / sr,
                sr,
            ).taps(sr, n)
        delta = RT60 / self.rt60_s
        t = np.arange(n) / sr
        return np.asarray(
            self.reverberant_level
            * np.sqrt(2 * delta / sr)
            * np.exp(-delta * t)
            * np.random.default_rng(self.seed).standard_normal(n)
        )

    def apply(self, x: Sound) -> Sound:
        """Add the tail to the sound."""
        if self.reverberant_level == 0 or not len(x.sample):
            return x
        from scipy.signal import fftconvolve

        tail = fftconvolve(x.sample, self.taps(x.sr, len(x.sample)))[: len(x.sample)]
        return replace(x, sample=x.sample + tail)

    def dereverberated(self, observed: ObjectEvidence) -> ObjectEvidence:
        """Return the evidence with its lines as they would be without the room."""
        return reverberant_tail.dereverberated(observed, RT60 / self.rt60_s)

    def identified_from(self, signal: Array, sound: Array, noise: Array, sr: int, *, fully: bool = False) -> Self:
        """Identify the room's response from recordings, starting from the one it has.

        Parameters
        ----------
        signal : (s, n)
            Recordings of strikes.
        sound : (s, n)
            The same without the room, synthesized.
        noise : (s,)
            Rms of the recordings' noise.
        sr : int
            Sampling rate in Hz.
        fully : bool
            Iterate to convergence.
        """
        start = self.response if self.sr == sr and len(self.response) == signal.shape[1] else None
        turns = ROOM_SEARCH.fully if fully else ROOM_SEARCH.turns if start is None else ROOM_SEARCH.again
        return replace(
            self,
            response=identified(signal, sound, noise, sr, RT60 / self.rt60_s, self.reverberant_level, start, turns),
            sr=sr,
        )

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """Identify the reverberation of the object with most lines; None where their late decays are not one."""
        observed = max(evidence.observed, key=lambda h: len(h.freq_hz))
        if (
            observed.signal is None
            or observed.predicted is None
            or len(observed.freq_hz) < ROOM_SEARCH.fewest_lines
            or observed.signal.shape[1] < reverberant_tail.LEAST * reverberant_tail.FRAME_S * observed.sr
        ):
            return None
        if copied(observed.every_hz, observed.every_decay_per_s, observed.every_amplitude) is not None:
            return None  # something moves
        found = late(observed, RT60 / evidence.known.rt60_s if isinstance(evidence.known, cls) else None)
        if found is None:
            return None
        delta, reverberant_level = found
        sound, along = (
            reverberant_tail.direct(observed, delta),
            ForeignMode.propose(replace(evidence, observed=(reverberant_tail.dereverberated(observed, delta),))),
        )
        if along is not None:  # what rings along is heard in the room too
            strikes = zip(sound, observed.level_n_s, strict=True)
            sound = np.stack([along.apply(Sound(x, observed.sr, float(j))).sample for x, j in strikes])
        return cls(RT60 / delta, reverberant_level).identified_from(observed.signal, sound, observed.noise, observed.sr)


def late(h: ObjectEvidence, known: float | None = None) -> tuple[float, float] | None:
    """Estimate δ in 1/s and w; None where the lines' late decays are not one.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    known : float
        δ found in the whole evidence, near which it is estimated again.
    """
    lines = np.sort(np.argsort(-np.abs(h.amplitude).max(axis=0))[: ROOM_SEARCH.lines])
    rates = known * np.exp(2 * FINE[::2]) if known else RATES
    r = reverberant_tail.modes(h, rates, lines, every=1 if known else 2)
    best = int(_agreed(r).argmax())
    if not known:
        if best in (0, len(rates) - 1) or not _one(r, best):
            return None
        r = reverberant_tail.modes(h, rates[best] * np.exp(FINE), lines)
        best = int(_agreed(r).argmax())
    mine = r.decay_per_s[best] > ROOM_SEARCH.faster * r.delta[best]
    return float(r.delta[best]), float(
        np.median(r.reverberant_level[best][mine] if mine.any() else r.reverberant_level[best])
    )


def _agreed(r: reverberant_tail.Read) -> Array:
    """Compute ln likelihood (t,) of each rate, no line's influence larger than cap."""
    cap = 20.0  # of ln likelihood: what one line can speak against a rate
    return np.asarray(np.maximum(r.ln_likelihood - r.ln_likelihood.max(axis=0), -cap).sum(axis=1))


def _one(r: reverberant_tail.Read, best: int) -> bool:
    """Decide whether lines that decay faster than the room end with it, all of them alike."""
    # ln likelihood a line gains; of all lines: so few will do where ROOM_SEARCH.fewest_lines tell it as plainly as that
    plainly, less = 100.0, 0.25
    # ln likelihood a line gains with a tail; of ln δ: how far lines may lie from one another, by the middle
    tells, alike = 10.0, 0.3
    gain, delta = r.ln_likelihood[best] - r.plain, r.delta[best]
    mine = (r.decay_per_s[best] > ROOM_SEARCH.faster * delta) & (gain > tells)
    off = np.abs(np.log(r.delta[r.ln_likelihood.argmax(axis=0)] / delta))[mine]
    many = mine.mean() > ROOM_SEARCH.share or (
        mine.mean() > less and (gain[mine] > plainly).sum() >= ROOM_SEARCH.fewest_lines
    )
    return bool(
        mine.sum() >= ROOM_SEARCH.fewest_lines and many and np.median(off) < alike and (off < 2 * alike).mean() > 0.7
    )


def identified(
    signal: Array,
    sound: Array,
    noise: Array,
    sr: int,
    delta: float,
    reverberant_level: float,
    start: Array | None = None,
    turns: int = ROOM_SEARCH.turns,
) -> Array:
    """Estimate the tail (n,) by conjugate gradients on the normal equations under its prior.

    Parameters
    ----------
    signal : (s, n)
        Recordings of strikes.
    sound : (s, n)
        The same without the room, synthesized.
    noise : (s,)
        Rms of the recordings' noise.
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

    n = signal.shape[1]
    size = next_fast_len(2 * n, real=True)
    x, y = rfft(sound, size, axis=1), rfft(signal - sound, size, axis=1)
    level = np.median(noise) ** 2 * n if np.isfinite(noise).all() else 0.0
    power = (np.abs(x) ** 2).sum(axis=0)
    smooth = np.convolve(power, np.ones(9) / 9, "same")
    trust = 1 / (level + model_error**2 * smooth + 1e-12 * smooth.max())
    # h = root · g, g of unit variance
    root = reverberant_level * np.sqrt(2 * delta / sr) * np.exp(-delta * np.arange(n) / sr)

    def forward(g: Array) -> Array:
        return np.asarray(rfft(root * g, size))

    def back(spectrum: Array) -> Array:
        return np.asarray(irfft(spectrum, size)[:n] * size * root)

    def normal(g: Array) -> Array:
        return np.asarray(back(trust * power * forward(g)) + g)

    right = back(trust * (np.conj(x) * y).sum(axis=0))
    g = np.zeros(n) if start is None else start / np.maximum(root, 1e-300)
    r = right.copy() if start is None else right - normal(g)
    step, size_r = r.copy(), float(r @ r)
    for _ in range(turns):
        if size_r <= 1e-10 * float(right @ right):
            break
        turned = normal(step)
        along = size_r / float(step @ turned)
        g += along * step
        r -= along * turned
        fresh = float(r @ r)
        step = r + fresh / size_r * step
        size_r = fresh
    return np.asarray(root * g)
