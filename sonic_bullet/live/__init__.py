"""Sound out loud: frames of a listener, or of a log, to a sound card while they are made.

    frame (channels, n) in Pa -> / full_scale_pa -> SampleQueue -> the card's callback -> sound
                                    \\-> waits until the card has taken enough: that paces the physics

`playback` joins both sides and measures; `sample_queue` lies between them; `sound_card` is PortAudio's, `null_card` one
that takes samples in real time and sounds nowhere. Nothing here knows who makes the frames.
"""

from __future__ import annotations

from sonic_bullet.live.playback import (
    AHEAD_S,
    FULL_SCALE_PA,
    Card,
    Playback,
    PlaybackReport,
    start_playback,
)

__all__ = ["AHEAD_S", "FULL_SCALE_PA", "Card", "Playback", "PlaybackReport", "start_playback"]
