"""Report of a sound file that was written: duration, level, clipping and limiting."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.files.loudness.meter import Loudness


@dataclass(frozen=True, slots=True)
class AudioReport:
    """Report of a sound file that was written.

    Parameters
    ----------
    gain_per_pa
        File units for one pascal.
    peak_pa, rms_pa
        Before the gain, over all channels.
    clipped
        Samples that were cut at full scale.
    over
        Samples above full scale, equal to clipped except in float files, where the player clips.
    limited_db, limited_s
        Largest reduction by a limiter, and its duration.
    loudness
        Where it was measured.
    """

    path: str
    format: str
    subtype: str
    sr: int
    channels: int
    frames: int
    gain_per_pa: float
    peak_pa: float
    rms_pa: float
    clipped: int
    over: int
    limited_db: float = 0.0
    limited_s: float = 0.0
    loudness: Loudness | None = None

    @property
    def seconds(self) -> float:
        """Duration of the file."""
        return self.frames / self.sr
