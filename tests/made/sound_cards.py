"""Sound cards for tests: one asked by hand, and the library sounddevice without any card under it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from sonic_bullet.session.live.playback import Fill


class HandCard:
    """Takes a block when the test says so, and says that it sounds when the test says so."""

    name = "by hand"

    def __init__(self, sr: int = 8000, channels: int = 1) -> None:
        self.sr, self.channels = sr, channels
        self.stopped: list[bool] = []
        self.fill: Fill = lambda out, sounds_s, late: None
        self.ended: Callable[[], None] = lambda: None

    def start(self, fill: Fill, ended: Callable[[], None]) -> None:
        self.fill, self.ended = fill, ended

    def ask(self, count: int, sounds_s: float = 0.0, *, late: bool = False) -> np.ndarray:
        """The next block (count, channels)."""
        out = np.full((count, self.channels), np.nan, np.float32)
        self.fill(out, sounds_s, late)
        return out

    def stop(self, *, abort: bool) -> None:
        self.stopped.append(abort)


class PortAudioError(Exception):
    """As sounddevice has it."""


class StandInStream:
    """sounddevice.OutputStream: a thread that asks for blocks in real time until it is stopped, or pulled."""

    latency = 0.01

    def __init__(self, library: StandInLibrary, asked: dict[str, Any]) -> None:
        if library.busy:
            raise PortAudioError("Device unavailable")
        self.library, self.asked = library, asked
        self.taken: list[np.ndarray] = []
        self.going, self.closed = threading.Event(), False
        self.thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self.going.set()
        self.thread.start()

    def _run(self) -> None:
        begin, block_s, held_s = time.perf_counter(), 64 / self.asked["samplerate"], self.library.held_s
        while self.going.is_set():
            out = np.zeros((64, self.asked["channels"]), np.float32)
            now = 0.0 if held_s is None else time.perf_counter() - begin  # a stream's clock begins anywhere
            times = SimpleNamespace(currentTime=now, outputBufferDacTime=now + (held_s or 0.0))
            self.asked["callback"](out, 64, times, SimpleNamespace(output_underflow=False))
            self.taken.append(out)
            time.sleep(block_s)

    def pull(self, *, said: bool) -> None:
        """The card is gone; some systems say so, others ask for nothing more."""
        self.going.clear()
        self.thread.join()
        if said:
            self.asked["finished_callback"]()

    def stop(self) -> None:
        self.pull(said=True)

    def close(self, ignore_errors: bool = True) -> None:
        self.going.clear()
        if self.library.hangs:  # as PortAudio does where the server of a card was killed
            threading.Event().wait()
        self.closed = True


class StandInLibrary:
    """What of sounddevice is used. held_s: between a call and the sound, None where the clocks stay at zero."""

    PortAudioError = PortAudioError

    def __init__(self, *, channels: tuple[int, ...] = (2,), sr: int = 48_000, held_s: float | None = 0.02) -> None:
        self.cards = [
            {"name": f"card {i}", "index": i, "max_output_channels": most, "default_samplerate": float(sr)}
            for i, most in enumerate(channels)
        ]
        self.sr, self.held_s, self.busy, self.hangs = sr, held_s, False, False
        self.streams: list[StandInStream] = []

    def _exit_handler(self) -> None:
        """What sounddevice has called when Python ends."""

    def query_devices(self, device: int | str | None = None, kind: str | None = None) -> Any:
        if kind is None:
            return self.cards
        found = [one for one in self.cards if device in (None, one["index"], one["name"])]
        if not found:
            raise ValueError(f"No output device matching {device!r}")
        return found[0]

    def check_output_settings(self, *, device: int, channels: int, dtype: str, samplerate: int) -> None:
        if samplerate != self.sr:
            raise PortAudioError("Invalid sample rate [PaErrorCode -9997]")

    def OutputStream(self, **asked: Any) -> StandInStream:
        self.streams.append(StandInStream(self, asked))
        return self.streams[-1]
