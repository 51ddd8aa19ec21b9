"""The system's sound cards, through PortAudio (the library sounddevice).

PortAudio states for each block when its first sample sounds, by the stream's own clock. It is converted to
`time.perf_counter` by the readings of both clocks when the block is called for.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import AudioError
from sonic_bullet.session.live.playback import Fill

CARD_CLOSE_S = 1.0
"""Longest time to close a stream: a hundred times what it plays then."""


class SoundCard:
    """An output stream of one of the system's cards.

    device: its name or number, None for the system's own. Raises AudioError where there is none, or it does not take
    that rate or so many channels.
    """

    def __init__(self, device: str | int | None, sr: int, channels: int) -> None:
        # Latency requested of the card: a callback may be that late. Half of what PortAudio calls a high latency.
        card_s = 0.012
        self._library = library = portaudio()
        known = found_card(library, device)
        self.name = str(known["name"])
        most = int(known["max_output_channels"])
        if channels > most:
            what = f"{self.name} has {most} channels, and there are {channels} microphones"
            raise AudioError(what, f"attach with {most} microphones at most, or name another card")
        self.sr, self.channels = sr, 2 if channels == 1 and most >= 2 else channels
        asked = {"device": known["index"], "channels": self.channels, "dtype": "float32", "samplerate": sr}
        try:
            library.check_output_settings(**asked)
        except Exception as error:
            own = f"{known['default_samplerate']:g}"
            raise AudioError(
                f"{self.name} does not take {sr} Hz on {self.channels} channels: {error}",
                f"attach with sr={own}, its own rate, or name another card",
            ) from error
        self._asked = {**asked, "latency": card_s, "clip_off": True, "dither_off": True}
        self._stream: Any = None

    def start(self, fill: Fill, ended: Callable[[], None]) -> None:
        """Open the stream; AudioError where the card refuses."""

        def callback(out: Array, frames: int, times: Any, status: Any) -> None:
            held_s = times.outputBufferDacTime - times.currentTime
            if not 0 < held_s < 10:  # some systems leave the clocks at zero
                held_s = self._stream.latency
            fill(out, time.perf_counter() + held_s, bool(status.output_underflow))

        try:
            self._stream = self._library.OutputStream(**self._asked, callback=callback, finished_callback=ended)
            self._stream.start()
        except Exception as error:
            raise AudioError(f"{self.name} cannot be opened: {error}", "close what uses it, or name another") from error

    def stop(self, *, abort: bool) -> None:
        """Close the stream, after the samples taken have sounded or at once.

        PortAudio may wait minutes for a card that is gone: neither this call nor Python's exit waits for it.
        """

        def close() -> None:
            with suppress(self._library.PortAudioError):
                if not abort:
                    self._stream.stop()
            self._stream.close(ignore_errors=True)

        closing = threading.Thread(target=close, daemon=True)
        closing.start()
        closing.join(CARD_CLOSE_S)
        if closing.is_alive():
            with suppress(AttributeError):  # sounddevice's own exit handler would wait as well
                atexit.unregister(self._library._exit_handler)


def portaudio() -> Any:
    """Import the library sounddevice; AudioError where it, or PortAudio under it, is not installed."""
    install = "pip install 'sonic_bullet[live]'"
    try:
        import sounddevice
    except ImportError as error:
        raise AudioError("sound cards need the library sounddevice", f"{install}; or play to 'null'") from error
    except OSError as error:  # its wheel brings PortAudio on Windows and macOS alone
        remedy = "install the package libportaudio2 (Debian, Ubuntu) or portaudio; or play to 'null'"
        raise AudioError("sound cards need PortAudio, which is not installed", remedy) from error
    return sounddevice


def found_card(library: Any, device: str | int | None) -> Any:
    """Return PortAudio's data of an output card; AudioError where there is none of that name or number."""
    cards = [one for one in library.query_devices() if one["max_output_channels"] > 0]
    if not cards:
        raise AudioError("this machine has no sound card", "connect one, or play to 'null'")
    if device is not None and not (isinstance(device, (str, int)) and not isinstance(device, bool)):
        raise AudioError(f"device is {quote(device)}", "give a card's name or number, or leave it out")
    try:
        known = library.query_devices(device, "output")
    except Exception as error:
        names = ", ".join(f"{one['index']} {one['name']}" for one in cards)
        raise AudioError(f"no sound card {quote(device)}: {error}", f"name one of: {names}") from error
    return known
