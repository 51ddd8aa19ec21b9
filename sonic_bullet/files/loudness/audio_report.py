"""What a sound file that was written is: how long, how loud, and what was done to it."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.files.loudness.meter import Loudness


@dataclass(frozen=True, slots=True)
class AudioReport:
    """What was written: where, how much, how loud.

    gain_per_pa: file units for one pascal. peak_pa, rms_pa: before the gain, over all channels. clipped: samples that
    were cut at full scale. over: samples beyond it in all (equal to clipped except in float files, where the player
    clips). limited_db, limited_s: what a limiter took off, at most and how long. loudness: where it was measured.
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
        return self.frames / self.sr
