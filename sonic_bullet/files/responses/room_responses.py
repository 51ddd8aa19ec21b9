"""Impulse response of a room from a sound file: its channels, of any scale, at its own rate -> RoomResponse."""

from __future__ import annotations

import os
from pathlib import Path

from sonic_bullet.files.recordings import read_audio
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import RoomResponse
from sonic_bullet.records.coerce import as_path
from sonic_bullet.records.errors import FileError


def read_room_response(path: str | os.PathLike[str]) -> RoomResponse:
    """Read the measured impulse response of a room.

    Raises
    ------
    FileError
        The file cannot be read, is silent, holds NaN, or lasts too long.
    """
    name = as_path(path, "path", "name a sound file (.wav)")
    samples, sr = read_audio(name)
    with reading_file(name, "room response", FileError, "give the room's impulse response as a sound file"):
        return RoomResponse(samples, sr, Path(name).name)
