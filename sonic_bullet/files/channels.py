"""Which channel of a recording is listened to: the one that is asked for, else the first, and a line that says so."""

from __future__ import annotations

from sonic_bullet.records.arrays import Array
from sonic_bullet.records.errors import FileError


def channel_of(samples: Array, channel: int, name: object) -> Array:
    """One channel (n,) of samples (channels, n), counted from 0.

    Raises FileError where the file ``name`` has no such channel.
    """
    if not 0 <= channel < len(samples):
        known = "1 channel, 0" if len(samples) == 1 else f"{len(samples)} channels, 0 to {len(samples) - 1}"
        raise FileError(f"{name} has no channel {channel}", f"it has {known}")
    one: Array = samples[channel]
    return one


def channel_words(count: int, channel: int | None) -> str:
    """Which channel of a file of ``count`` is used, in words; empty where it has but one."""
    if count < 2:
        return ""
    return f"{count} channels: " + (
        "the first is used, channel 0" if channel is None else f"channel {channel} is used, counted from 0"
    )
