"""`room`: reflections and reverberation: the same late decay in every band, whatever rings.

    y = x + h * x,   h(t) Gaussian with variance w² 2δ e^{−2δt},   rt60 = ln(10³)/δ, wet w = energy of h over the direct sound's 1, rooted
                                                                     [Schroeder 1965; statistics of the tail: Polack 1988; Kuttruff 2009, ch. 4]
    power of a mode in its band:  e^{−2dt} + w² 2δ (e^{−2δt} − e^{−2dt})/(2d − 2δ)

δ and w are read off the bands' power; h, if several strikes tell it, by least squares with that variance as its prior [Wiener 1949].
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.ringing import direct
from sonic_bullet.effects.values import Evidence, Heard, Owner, Sound, Stage
from sonic_bullet.records import Array

RT60 = float(np.log(1e3))
MODEL_ERROR = 0.08  # of the direct sound's spectrum, relative
TURNS = 40
EARLY_S = 6e-3
ALIKE = 0.2  # of ln δ: how far the bands' late decays may lie from one another, by the middle
FASTER, FEWEST, SHARE = 1.5, 4, 0.35  # than the room; bands that are, and of all: who they must be to tell it
SPECKLE, SHAPE = 0.8, 0.5  # of ln power: of a frame in a diffuse tail, of a mode's level


@dataclass(frozen=True)
class Room:
    """rt60_s, wet. response (t,): the tail's taps from the first sample after the direct sound on, at rate sr; empty: noise of that law from ``seed``.

    alpha_per_s, beta_s, gain: the material's and the case's as the first milliseconds tell them, before any echo; the host takes them over.
    """

    id: ClassVar[str] = "room"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.ROOM
    reference: ClassVar[str] = "Schroeder 1965; Polack 1988; Kuttruff 2009, ch. 4"

    rt60_s: float
    wet: float
    seed: int = 0
    response: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    sr: int = 0
    alpha_per_s: float = float("nan")
    beta_s: float = float("nan")
    gain: float = float("nan")

    def taps(self, sr: int, n: int) -> Array:
        """The tail (n,) at a rate."""
        if len(self.response) and self.sr == sr:
            return np.asarray(np.concatenate([self.response[:n], np.zeros(max(n - len(self.response), 0))]))
        if len(self.response):
            from scipy.signal import resample_poly

            return Room(self.rt60_s, self.wet, self.seed, np.asarray(resample_poly(self.response, sr, self.sr)) * self.sr / sr, sr).taps(sr, n)
        delta = RT60 / self.rt60_s
        t = np.arange(n) / sr
        return np.asarray(self.wet * np.sqrt(2 * delta / sr) * np.exp(-delta * t) * np.random.default_rng(self.seed).standard_normal(n))

    def apply(self, x: Sound) -> Sound:
        """The sound with the effect in it."""
        if self.wet == 0 or not len(x.sample):
            return x
        from scipy.signal import fftconvolve

        tail = fftconvolve(x.sample, self.taps(x.sr, len(x.sample)))[: len(x.sample)]
        return replace(x, sample=x.sample + tail)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"rt60_s": self.rt60_s, "wet": self.wet}

    def freedom(self) -> int:
        return 2

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        heard = max(evidence.heard, key=lambda h: len(h.freq_hz))
        if heard.signal is None or heard.predicted is None or len(heard.freq_hz) < 3:
            return None
        found = late(heard, evidence)
        if found is None:
            return None
        delta, wet = found
        alpha, beta, gain = early(heard, evidence)
        sound = gain * direct(heard, alpha, beta)
        tail = identified(heard.signal, sound, heard.noise, heard.sr, delta, wet)
        return cls(RT60 / delta, wet, 0, tail, heard.sr, alpha, beta, gain * evidence.gain)


def late(h: Heard, evidence: Evidence) -> tuple[float, float] | None:
    """δ, w by the power of the bands; None where the bands' late decays are not one."""
    from scipy.optimize import least_squares

    bands = _bands(h)
    if bands is None:
        return None
    t, log_power, weight, line, mean, expected = bands
    omega2 = h.omega[line] ** 2
    fine = np.linspace(0, float(t[-1]) + 0.02, mean.shape[1])

    def curve(p: Array) -> Array:
        alpha, beta, delta, w2 = np.exp(np.clip(p[:4], -40, 40))
        d = ((alpha + beta * omega2) / 2)[:, None]
        gap = 2 * d - 2 * delta
        gap = np.where(np.abs(gap) < 1e-3, 1e-3, gap)
        own = np.exp(-2 * d * fine)
        tail = w2 * 2 * delta * (np.exp(-2 * delta * fine) - own) / gap
        return np.asarray(np.log((own + np.maximum(tail, 0)) @ mean.T + 1e-30))

    def left(p: Array) -> Array:
        off = log_power - expected[:, None] - p[4] - curve(p)
        own = (weight * off).sum(axis=1) / (weight.sum(axis=1) + (SPECKLE / SHAPE) ** 2)  # each band's own level, within what shapes are wrong by
        return np.concatenate([(weight * (off - own[:, None])).ravel() / SPECKLE, own / SHAPE])

    damping = np.log(early(h, evidence)[:2])
    tried = [
        least_squares(lambda p: left(np.concatenate([damping, p])), np.array([np.log(RT60 / rt60), np.log(0.1), 0.0]), loss="soft_l1", f_scale=2.0, max_nfev=60)
        for rt60 in (0.2, 0.6, 2.0)
    ]
    best = min(tried, key=lambda f: f.cost)
    delta, w2 = np.exp(best.x[:2])
    said = 2.5 / float(t[-1]) < delta < 400 and 1e-4 < w2 < 50
    alike = _alike(t, log_power, weight, np.exp(damping), omega2, float(delta))
    return (float(delta), float(np.sqrt(w2))) if said and alike else None


def _alike(t: Array, y: Array, weight: Array, damping: Array, omega2: Array, delta: float) -> bool:
    """Whether bands whose modes of themselves decay faster than δ end with it, all of them alike: what no body does and every room."""
    own = (damping[0] + damping[1] * omega2) / 2
    late_slope = []
    for row, w, d in zip(y, weight, own, strict=True):
        last = int(w.sum())
        first = max(3, last // 4)
        if last - first >= 6 and d > FASTER * delta:  # a mode that outlasts the room ends as it began
            late_slope.append(-np.polyfit(t[first:last], row[first:last], 1)[0] / 2)
    off = np.abs(np.log(np.maximum(late_slope, 1e-3) / delta))
    return bool(len(off) >= FEWEST and len(off) > SHARE * len(own) and np.median(off) < ALIKE and (off < 2.5 * ALIKE).mean() > 0.7)


def early(h: Heard, evidence: Evidence) -> tuple[float, float, float]:
    """α, β and the gain over the one so far, by the waveform of the first milliseconds, before any echo has come back."""
    from scipy.optimize import least_squares

    assert h.signal is not None
    n = max(int(EARLY_S * h.sr), 32)
    t = np.arange(n) / h.sr
    use = h.all_hz < 0.45 * h.sr
    wave = np.exp(2j * np.pi * h.all_hz[use, None] * t)
    push, omega2 = h.push[:, use], (2 * np.pi * h.all_hz[use]) ** 2
    heard = h.signal[:, :n]
    size = np.sqrt((heard**2).mean(axis=1, keepdims=True))

    def left(p: Array) -> Array:
        d = (np.exp(p[0]) + np.exp(p[1]) * omega2) / 2
        made = np.real((push * np.exp(p[2])) @ (wave * np.exp(-d[:, None] * t)))
        return np.concatenate([((heard - made) / size).ravel(), [3.0 * (p[0] - start[0])]])

    found = []
    for factor in (0.2, 1.0, 5.0):
        start = np.log([max(evidence.alpha_per_s, 0.1), max(evidence.beta_s, 1e-11) * factor, 1.0])
        found.append(least_squares(left, start, loss="soft_l1", max_nfev=40))
    best = min(found, key=lambda f: f.cost)
    return float(np.exp(best.x[0])), float(np.exp(best.x[1])), float(np.exp(best.x[2]))


def _bands(h: Heard, frames: int = 160) -> tuple[Array, Array, Array, Array, Array, Array] | None:
    """Frame times (t,), ln power (q, t) of the bands around the strongest lines, summed over strikes, weights, lines (q,), what a frame is the mean of
    (t, fine), and ln of each line's expected power at the onset (q,)."""
    assert h.signal is not None
    n, sr = h.signal.shape[1], h.sr
    strength = np.abs(h.amplitude).max(axis=0)
    order = np.argsort(-strength)
    picked: list[int] = []
    for k in order:
        if all(abs(h.freq_hz[k] - h.freq_hz[j]) > 120.0 for j in picked):
            picked.append(int(k))
        if len(picked) == 20:
            break
    window = int(0.03 * sr)
    hop = max(window // 2, (n - window) // frames)
    starts = np.arange(0, n - window, hop)
    if len(starts) < 8:
        return None
    shape = np.hanning(window)
    frame = np.stack([h.signal[:, s : s + window] for s in starts], axis=1) * shape
    power = np.abs(np.fft.rfft(frame, axis=2)) ** 2
    hz = np.fft.rfftfreq(window, 1 / sr)
    floor = (h.noise**2)[:, None] * (shape**2).sum() if len(h.noise) == len(h.signal) else np.zeros((len(h.signal), 1))
    rows, weights, kept = [], [], []
    for k in picked:
        inside = np.abs(hz - h.freq_hz[k]) < max(60.0, 1.0 * h.decay_per_s[k])
        band = power[:, :, inside].sum(axis=2)
        noise = floor * inside.sum()
        level, least = band.sum(axis=0), 8 * float(noise.sum())
        clear = level > least
        stop = int(np.argmin(clear)) if not clear.all() else len(clear)
        level = level - least / 8
        if stop < 6:
            continue
        weight = np.zeros(len(starts))
        weight[:stop] = 1.0
        rows.append(np.log(np.maximum(level, 1e-300)))
        weights.append(weight)
        kept.append(k)
    if len(kept) < 3:
        return None
    fine = np.linspace(0, (starts[-1] + window / 2) / sr + 0.02, 4000)
    mean = np.array([np.interp(fine, (s + np.arange(window)) / sr, shape**2, left=0, right=0) for s in starts])
    expected = np.log((np.abs(h.expected[:, kept]) ** 2).sum(axis=0) + 1e-300)
    return (starts + window / 2) / sr, np.array(rows), np.array(weights), np.array(kept), mean / mean.sum(axis=1).max(), expected


def identified(signal: Array, sound: Array, noise: Array, sr: int, delta: float, wet: float) -> Array:
    """The tail (n,) that makes the direct sounds (s, n) the recorded ones, by conjugate gradients on the normal equations under its prior."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = signal.shape[1]
    size = next_fast_len(2 * n, real=True)
    x, y = rfft(sound, size, axis=1), rfft(signal - sound, size, axis=1)
    level = np.median(noise) ** 2 * n if np.isfinite(noise).all() else 0.0
    power = (np.abs(x) ** 2).sum(axis=0)
    smooth = np.convolve(power, np.ones(9) / 9, "same")
    trust = 1 / (level + MODEL_ERROR**2 * smooth + 1e-12 * smooth.max())
    root = wet * np.sqrt(2 * delta / sr) * np.exp(-delta * np.arange(n) / sr)  # h = root · g, g of unit variance

    def forward(g: Array) -> Array:
        return np.asarray(rfft(root * g, size))

    def back(spectrum: Array) -> Array:
        return np.asarray(irfft(spectrum, size)[:n] * size * root)

    right = back(trust * (np.conj(x) * y).sum(axis=0)) / 1.0
    g, r = np.zeros(n), right.copy()
    step, size_r = r.copy(), float(r @ r)
    for _ in range(TURNS):
        if size_r <= 1e-10 * float(right @ right):
            break
        turned = back(trust * power * forward(step)) + step * 1.0
        along = size_r / float(step @ turned)
        g += along * step
        r -= along * turned
        fresh = float(r @ r)
        step = r + fresh / size_r * step
        size_r = fresh
    return np.asarray(root * g)
