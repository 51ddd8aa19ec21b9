"""Pass frames to a sound card: pushed by the thread that steps, taken by the card's own.

    push(frame) -> SampleQueue -> fill(block), called by the card

A step's sound, pushed after `lag_steps` more steps, sounds at

    t = returned + lag_steps·dt + (samples waiting + one block) / sr + latency of the card

`push` returns when no more than `ahead_s` waits beyond the block that the card takes next: a loop that steps faster
than real time is paced by the card's clock, and no second clock can drift. Sound starts, and starts again after an
underrun, when that much is waiting. Between two blocks the number of samples taken is interpolated in time: the pace is
even for any block size.

The callback takes no lock and never waits for the thread that steps, except for Python's own lock, which that thread
releases while it waits here and in compiled stages of the run time.
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

from sonic_bullet.options.play import AHEAD_S, FULL_SCALE_PA
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, PlaybackWarning
from sonic_bullet.session.live.latencies import Latencies
from sonic_bullet.session.live.sample_queue import SampleQueue

QUEUE_S = 3.0  # room for that and a step of a second
STALLED_S = 2.0
"""Time without a call after which a card is gone: Bluetooth takes up to a second to wake."""

Fill = Callable[[Array, float, bool], None]
"""(block (n, channels) float32 to fill, `time.perf_counter` at which its first sample sounds, whether the card had to
sound nothing before it) -> None. Never raises.
"""


class Card(Protocol):
    """A device that takes samples in real time. sr in Hz; channels: those of its blocks."""

    name: str
    sr: int
    channels: int

    def start(self, fill: Fill, ended: Callable[[], None]) -> None:
        """Call fill from a thread of its own from now on, and ended after the last call; raises AudioError."""

    def stop(self, *, abort: bool) -> None:
        """End the calls; return when all samples taken have sounded, or at once. Raises nothing."""


@dataclass(frozen=True, slots=True)
class PlaybackReport:
    """Report of a playback.

    Parameters
    ----------
    seconds
        Of frames that sounded.
    latency_median_s, latency_worst_s
        From the return of a physics step to the start of its sound as the card states it, the listener's lag included,
        of all steps since the first sound; NaN and 0 without any.
    underruns
        How often the queue was empty or the card was served too late.
    silent_s
        Total time without samples before the last frame.
    clipped
        Samples beyond full scale.
    """

    card: str
    seconds: float
    latency_median_s: float
    latency_worst_s: float
    underruns: int
    silent_s: float
    clipped: int

    def __str__(self) -> str:
        """Return the report in words."""
        runs = format_count(self.underruns, "underrun")
        silent = f" ({self.silent_s:.2f} s silent)" if self.underruns else ""
        late = f"latency {self.latency_median_s * 1e3:.1f} ms (worst {self.latency_worst_s * 1e3:.1f}), "
        clipped = f", {format_count(self.clipped, 'sample')} clipped at full scale" if self.clipped else ""
        return f"{self.seconds:.2f} s played on {self.card}, {late if self.seconds else ''}{runs}{silent}{clipped}"


class Playback:
    """Sound on its way to a card; made by `start_playback`. Usable as a context manager: leaving it closes.

    report: of what was played so far. failure: why playback ended, None while it runs.
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
        card.start(self._fill, self._note_end)

    def push(self, frame: Array, returned_s: float) -> None:
        """Play a frame (channels, n) in Pa; return when there is space for the next.

        returned_s: `time.perf_counter` when the physics step that it came with returned. Does nothing once closed. A
        card that is gone causes one `PlaybackWarning`, and later calls do not wait.
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
        """Wait until at most so many samples are queued, or the card is gone."""
        shortest_wait_s = 2e-4
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
                self._wake.wait(max(early / self._sr, shortest_wait_s))

    def _fill(self, out: Array, sounds_s: float, late: bool) -> None:
        """Fill a block for the card; see `Fill`."""
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
        elif self._pause and count:  # sound continues: the silence was an underrun, not the end
            self._underruns, self._silent, self._pause = self._underruns + 1, self._silent + self._pause, 0
        starts = self._starts
        while starts and starts[0][0] < first + count:
            at, returned_s = starts.popleft()
            self._latencies.add(sounds_s + (at - first) / self._sr - returned_s)

    def _note_end(self) -> None:
        """Note that the card takes no more."""
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
        """Report of what was played so far."""
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
        """Play the queued samples, or none (abort), and release the card; return the report. Can be repeated."""
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
        """Return the playback."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the playback; abort after an error."""
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
    """Open a card that plays what is pushed from now on.

    Parameters
    ----------
    device
        A name or number of `sounddevice.query_devices`, None for the system's own, "null" for none: samples are taken
        in real time without sound. One channel sounds on two where the card has two.
    lag_steps
        Steps by which a frame's sound lags.
    full_scale_pa
        The pressure that is 1.0 to the card.
    ahead_s
        How much sound may wait.

    Raises
    ------
    AudioError
        There is no such card, or it does not take that rate or so many channels.
    """
    longest_ahead_s = 2.0
    scale = as_number(full_scale_pa, "full_scale_pa", "give a pressure in Pa, above 0", above=0, error=AudioError)
    ahead = as_number(
        ahead_s, "ahead_s", f"give 0 … {longest_ahead_s:g} s", least=0, most=longest_ahead_s, error=AudioError
    )
    if not channels:
        raise AudioError("there is no microphone, so there is no sound to play", "attach with microphone=(x, y, z)")
    if device == "null":
        from sonic_bullet.session.live.null_card import NullCard

        card: Card = NullCard(sr, channels)
    else:
        from sonic_bullet.session.live.sound_card import SoundCard

        card = SoundCard(device, sr, channels)
    return Playback(card, full_scale_pa=scale, ahead_s=ahead, lag_steps=lag_steps)
