"""From frames to a sound card: pushed by the thread that steps, taken by the card's own.

    push(frame) -> SampleQueue -> fill(block), called by the card

A step's sound, pushed when `lag_steps` more steps were taken in, sounds at

    t = returned + lag_steps·dt + (samples waiting + one block) / sr + what the card holds itself

`push` returns when no more than `ahead_s` waits beyond the block that the card takes next: whoever steps faster than
real time is paced by the card's clock, and there is no second one that could drift. Sound starts, and starts again
after an underrun, when that much is there. Between two blocks what the card has taken is interpolated in time: the pace
is even, however large the blocks are.

The callback takes no lock and never waits for the thread that steps, but for Python's own lock, which that thread gives
up while it waits here and in compiled stages of the run time.
"""

from __future__ import annotations

import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol

import numpy as np

from sonic_bullet.live.latencies import Latencies
from sonic_bullet.live.sample_queue import SampleQueue
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, PlaybackWarning

FULL_SCALE_PA = 20.0
"""120 dB SPL: of the package's scenes the table-top and the fall clip less than one sample in a thousand; rolling, the
softest, peaks 46 dB below.
"""
AHEAD_S = 0.018
"""How late a step may be before sound stops. With three steps of 1/240 s, a block of 5 ms and a card that holds 12 ms a
step sounds after 48 ms.
"""
LONGEST_AHEAD_S = 2.0
QUEUE_S = 3.0  # room for that and a step of a second
SHORTEST_WAIT_S = 2e-4
STALLED_S = 2.0
"""A card that asks for nothing so long is gone: Bluetooth takes up to a second to wake."""

Fill = Callable[[Array, float, bool], None]
"""(block (n, channels) float32 to fill, `time.perf_counter` at which its first sample sounds, whether the card had to
sound nothing before it) -> None. Never raises.
"""


class Card(Protocol):
    """What takes samples in real time. sr in Hz; channels: those of its blocks."""

    name: str
    sr: int
    channels: int

    def start(self, fill: Fill, ended: Callable[[], None]) -> None:
        """Call fill from a thread of its own from now on, and ended when no call will follow. Raises AudioError."""

    def stop(self, *, abort: bool) -> None:
        """Call no more; return when all that was taken has sounded, or at once. Raises nothing."""


@dataclass(frozen=True, slots=True)
class PlaybackReport:
    """What was played.

    seconds: of frames that sounded. latency_median_s, latency_worst_s: from the return of a physics step to the time at
    which the card says its sound begins, the listener's lag included, of all steps since the first sound; NaN and 0
    where there were none. underruns: how often there was nothing to sound or the card was served too late. silent_s:
    how long there was nothing, in all, before the last frame. clipped: samples beyond full scale.
    """

    card: str
    seconds: float
    latency_median_s: float
    latency_worst_s: float
    underruns: int
    silent_s: float
    clipped: int

    def __str__(self) -> str:
        runs = format_count(self.underruns, "underrun")
        silent = f" ({self.silent_s:.2f} s silent)" if self.underruns else ""
        late = f"latency {self.latency_median_s * 1e3:.1f} ms (worst {self.latency_worst_s * 1e3:.1f}), "
        clipped = f", {format_count(self.clipped, 'sample')} clipped at full scale" if self.clipped else ""
        return f"{self.seconds:.2f} s played on {self.card}, {late if self.seconds else ''}{runs}{silent}{clipped}"


class Playback:
    """Sound on its way to a card; made by `start_playback`. Usable as a context manager: leaving it closes.

    report: what was played so far. failure: why nothing is played any more, None while it is.
    """

    def __init__(self, card: Card, *, full_scale_pa: float, ahead_s: float, lag_steps: int) -> None:
        self._card, self._full_scale, self._sr = card, full_scale_pa, card.sr
        self._ahead = round(ahead_s * card.sr)
        self._queue = SampleQueue(card.channels, round(QUEUE_S * card.sr))
        self._returned: deque[float | None] = deque([None] * (lag_steps + 1))  # None: before any sound, which is no lag
        self._starts: deque[tuple[int, float]] = deque()  # a frame's first sample, when the step it sounds returned
        self._latencies = Latencies()
        self._filling, self._draining, self._said, self.closed = True, False, False, False
        self._underruns = self._silent = self._pause = self._clipped = 0
        self._last = (time.perf_counter(), 0, 0)  # when a block was taken, samples taken by then, its size
        self._wake = threading.Event()
        self.failure: AudioError | None = None
        card.start(self._fill, self._ended)

    def push(self, frame: Array, returned_s: float) -> None:
        """Play a frame (channels, n) in Pa; returns when there is room for the next.

        returned_s: `time.perf_counter` when the physics step that it came with returned. Does nothing once closed. A
        card that is gone is said once, as a `PlaybackWarning`, and nothing waits any more.
        """
        if self.closed or not frame.shape[1]:
            return
        if self.failure is not None:
            return self._say()
        self._returned.popleft()
        self._returned.append(returned_s if self._queue.taken else None)
        if self._returned[0] is not None:
            self._starts.append((self._queue.written, self._returned[0]))
        samples = frame.T / self._full_scale
        if max(samples.max(), -samples.min()) > 1:
            self._clipped += int((np.abs(samples) > 1).sum())
            samples = samples.clip(-1, 1)
        at = 0
        while at < len(samples) and self.failure is None:
            at += self._queue.write(samples[at:])
            self._wait(self._ahead)

    def _say(self) -> None:
        """Warn of the failure, once."""
        if not self._said:
            self._said = True
            warnings.warn(f"{self.failure}; physics and log go on, silent and unpaced", PlaybackWarning, stacklevel=4)

    def _wait(self, most: int) -> None:
        """Until no more than so many samples wait, or nothing takes them any more."""
        while self.failure is None:
            now = time.perf_counter()
            when, taken, block = self._last
            between = 0 if self._draining else min((now - when) * self._sr, block)
            early = self._queue.written - most - taken - between
            if early <= 0:
                return
            if now - when > STALLED_S:
                self._fail()
            else:
                self._wake.wait(max(early / self._sr, SHORTEST_WAIT_S))

    def _fill(self, out: Array, sounds_s: float, late: bool) -> None:
        """What the card calls for a block; see `Fill`."""
        queue = self._queue
        first = queue.taken
        waiting = queue.written - first
        self._filling = self._filling and waiting < self._ahead + len(out) and not self._draining
        count = 0 if self._filling else queue.take(out)
        out[count:] = 0
        self._last = (time.perf_counter(), queue.taken, len(out))
        if late and first and not self._pause:
            self._underruns += 1
        if count < len(out) and first + count and not self._draining:
            self._filling, self._pause = True, self._pause + len(out) - count
        elif self._pause and count:  # it goes on: what was silent was no end
            self._underruns, self._silent, self._pause = self._underruns + 1, self._silent + self._pause, 0
        starts = self._starts
        while starts and starts[0][0] < first + count:
            at, returned_s = starts.popleft()
            self._latencies.add(sounds_s + (at - first) / self._sr - returned_s)

    def _ended(self) -> None:
        """What the card calls when it takes no more."""
        if not self.closed:
            self._fail()

    def _fail(self) -> None:
        self.failure = AudioError(
            f"{self._card.name} takes no more sound",
            "connect it again and play anew",
        )
        self._wake.set()

    @property
    def report(self) -> PlaybackReport:
        """What was played so far."""
        return PlaybackReport(
            self._card.name,
            self._queue.taken / self._sr,
            self._latencies.median_s,
            self._latencies.worst_s,
            self._underruns,
            self._silent / self._sr,
            self._clipped,
        )

    def close(self, *, abort: bool = False) -> PlaybackReport:
        """Play what is on its way, or nothing more (abort), and let the card go; the report. Twice is once."""
        if not self.closed:
            self._draining = not abort
            try:
                if not abort:
                    self._wait(0)
            finally:
                self.closed = True
                self._card.stop(abort=abort or self.failure is not None)
        return self.report

    def __enter__(self) -> Playback:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(abort=kind is not None)


def start_playback(
    device: str | int | None,
    *,
    sr: int,
    channels: int,
    lag_steps: int,
    full_scale_pa: float = FULL_SCALE_PA,
    ahead_s: float = AHEAD_S,
) -> Playback:
    """A card that plays what is pushed from now on.

    device: a name or number of `sounddevice.query_devices`, None for the system's own, "null" for none: samples are
    taken in real time and sound nowhere. One channel sounds on two where the card has two. lag_steps: how many steps a
    frame's sound lags. full_scale_pa: the pressure that is 1.0 to the card. ahead_s: how much sound may wait. Raises
    AudioError where there is no such card, or it takes no such rate or so many channels.
    """
    scale = as_number(full_scale_pa, "full_scale_pa", "give a pressure in Pa, above 0", above=0, error=AudioError)
    ahead = as_number(
        ahead_s, "ahead_s", f"give 0 … {LONGEST_AHEAD_S:g} s", least=0, most=LONGEST_AHEAD_S, error=AudioError
    )
    if not channels:
        raise AudioError("there is no microphone, so there is no sound to play", "attach with microphone=(x, y, z)")
    if device == "null":
        from sonic_bullet.live.null_card import NullCard

        card: Card = NullCard(sr, channels)
    else:
        from sonic_bullet.live.sound_card import SoundCard

        card = SoundCard(device, sr, channels)
    return Playback(card, full_scale_pa=scale, ahead_s=ahead, lag_steps=lag_steps)
