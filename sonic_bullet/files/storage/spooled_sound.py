"""Sound of any length: frames in a spool, the last ones in memory, read by blocks under one gain curve.

    blocks (channels, n) -> SoundSpool -> kept -> KeptSound -> read(start, stop) times its GainCurve

The curve is common to all channels and to all stems of a mix, so that the stems still add up to it:
fade(t) = (1 - cos πt/T)/2, half a Hann window, whose slope is zero at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.files.storage.spool import Spool
from sonic_bullet.records import Array

READ_FRAMES = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class GainCurve:
    """Factor per frame of a sound.

    Parameters
    ----------
    frames
        Of the sound.
    fade_in, fade_out
        In frames.
    limiter : Array, shape (frames,)
        Factors; None: ones.
    gain
        Of all frames.
    """

    frames: int
    fade_in: int = 0
    fade_out: int = 0
    limiter: Array | None = None
    gain: float = 1.0

    def read(self, start: int, stop: int) -> Array:
        """Return the factors of the frames start … stop - 1, fewer at the end."""
        frame = np.arange(start, min(stop, self.frames))
        factor = np.full(len(frame), self.gain)
        if self.limiter is not None:
            factor *= self.limiter[start:stop]
        if self.fade_in:
            factor *= _half_hann(frame / self.fade_in)
        if self.fade_out:
            factor *= _half_hann((self.frames - 1 - frame) / self.fade_out)
        return factor


def _half_hann(share: Array) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0)))


class SoundSpool(Spool):
    """A `Spool` of frames of so many channels, float64."""

    def __init__(self, channels: int, instead: str = "") -> None:
        super().__init__(float, (channels,), what="sound", instead=instead)

    def add(self, block: Array) -> None:
        """Append (channels, n); FileError where the disk takes no more, after which all can still be read."""
        self.append(np.ascontiguousarray(block.T))
        self.spill()

    def finish(self) -> KeptSound:
        """Return the sound appended so far."""
        return KeptSound(self, len(self), np.zeros((*self.tail, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class KeptSound:
    """Sound of any length, (channels, n) float64.

    Parameters
    ----------
    spool, count
        The first ``count`` frames, in rows (channels,); frames appended later do not belong to the sound.
    rest : Array, shape (channels, ·)
        The frames after them, in memory.
    curve
        Factor per frame, which `read` applies; None: ones.
    """

    spool: SoundSpool
    count: int
    rest: Array
    curve: GainCurve | None = None

    @classmethod
    def of(cls, samples: Array) -> KeptSound:
        """Wrap samples (channels, n) that are in memory."""
        return cls(SoundSpool(len(samples)), 0, samples)

    @property
    def shape(self) -> tuple[int, int]:
        """Channels and frames."""
        return len(self.rest), self.count + self.rest.shape[1]

    def with_curve(self, curve: GainCurve | None) -> KeptSound:
        """Return the same sound with another curve."""
        return replace(self, curve=curve)

    def with_limiter(self, factor: Array) -> KeptSound:
        """Return the same sound with factors (frames,) in addition to its fades."""
        return self.with_curve(replace(self.curve or GainCurve(self.shape[1]), limiter=factor))

    def times(self, gain: float) -> KeptSound:
        """Return the same sound times a gain."""
        return self.with_curve(replace(self.curve or GainCurve(self.shape[1]), gain=gain))

    def read(self, start: int, stop: int) -> Array:
        """Read (channels, stop - start) of the frames start … stop-1, fewer at the end; raises FileError."""
        block = self._read(start, stop)
        return block if self.curve is None else block * self.curve.read(start, stop)

    def _read(self, start: int, stop: int) -> Array:
        first = self.spool[start : min(stop, self.count)].T
        if stop <= self.count:
            return first
        rest = self.rest[:, max(start - self.count, 0) : stop - self.count]
        return rest if start >= self.count else np.concatenate([first, rest], axis=1)

    def blocks(self, frames: int = READ_FRAMES) -> Iterator[Array]:
        """Iterate over the sound in blocks (channels, ≤ frames)."""
        for start in range(0, self.shape[1], frames):
            yield self.read(start, start + frames)

    def samples(self) -> Array:
        """Read the whole sound (channels, n)."""
        made = np.empty(self.shape)
        at = 0
        for block in self.blocks():
            made[:, at : at + block.shape[1]] = block
            at += block.shape[1]
        return made

    def peaks(self) -> Array:
        """Return the largest magnitude (channels,) of each channel; NaN where a sample is NaN."""
        peak = np.zeros(self.shape[0])
        for block in self.blocks():
            peak = np.maximum(peak, np.abs(block).max(axis=1))
        return peak
