r"""Playback: frames of a listener, or of a log, to a sound card while they are made.

    frame (channels, n) in Pa -> / full_scale_pa -> SampleQueue -> the card's callback -> sound
                                    \-> waits until the card has taken enough: that paces the physics

`playback` joins both sides and measures; `sample_queue` is between them; `sound_card` is PortAudio's, `null_card` takes
samples in real time without a device. The package does not depend on the source of the frames.
"""

from __future__ import annotations

from sonic_bullet.options.play import AHEAD_S, FULL_SCALE_PA
from sonic_bullet.session.live.playback import (
    Card,
    Playback,
    PlaybackReport,
    start_playback,
)

__all__ = ["AHEAD_S", "FULL_SCALE_PA", "Card", "Playback", "PlaybackReport", "start_playback"]
