"""Sound card without a device, clocked in real time.

Block j is called for at start + j·B/sr and sounds two blocks later. The card is as strict as one with a ring of three
blocks: a block delivered after its time is counted as late, and all later ones sound that much later.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from sonic_bullet.session.live.playback import Fill


class NullCard:
    """A sound card without a device; see the module."""

    CARD_BLOCK = 256  # samples: 5.3 ms at 48 kHz

    HELD_BLOCKS = 2  # blocks between the call and the sound

    name = "null"

    def __init__(self, sr: int, channels: int) -> None:
        self.sr, self.channels = sr, channels
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, fill: Fill, ended: Callable[[], None]) -> None:
        """Call for blocks from now on, in a thread of its own."""
        self._thread = threading.Thread(target=self._run, args=(fill,), name="null sound card", daemon=True)
        self._thread.start()

    def _run(self, fill: Fill) -> None:
        out, asked_s, late = np.zeros((self.CARD_BLOCK, self.channels), np.float32), time.perf_counter(), False
        block_s = self.CARD_BLOCK / self.sr
        while not self._stop.wait(max(asked_s - time.perf_counter(), 0.0)):
            sounds_s = asked_s + self.HELD_BLOCKS * block_s
            fill(out, sounds_s, late)
            over_s = time.perf_counter() - sounds_s
            late = over_s > 0
            asked_s += block_s + max(over_s, 0.0)

    def stop(self, *, abort: bool) -> None:
        """Call for no more; return when the blocks taken would have sounded, or at once."""
        self._stop.set()
        if not abort:
            threading.Event().wait((self.HELD_BLOCKS + 1) * self.CARD_BLOCK / self.sr)
        if self._thread is not None:
            self._thread.join(1.0)
