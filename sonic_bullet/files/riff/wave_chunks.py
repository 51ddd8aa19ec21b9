"""Chunks of a WAV file that name places and give its start on a longer timeline.

    cue  (places)  + LIST adtl (labl: a name, ltxt: duration)    [IBM and Microsoft, Multimedia Programming Interface
                                                                 and Data Specifications 1.0 (1991), ch. 3]
    bext (description, time reference in samples)               [EBU Tech 3285 v1, sec. 2.3]

They follow the samples, where readers of RIFF find chunks in any order. They hold no time of day: equal sound, equal
bytes.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence

from sonic_bullet.records.coerce import as_items, quote
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.errors import RecordError


def wave_chunks(cues: Sequence[Cue], *, description: str = "", time_reference: int = 0) -> bytes:
    """Make the chunks `bext`, `cue ` and `LIST adtl` of a file. Cues beyond `last_sample` are left out.

    time_reference: first sample of the file, counted from the start of its timeline.

    Raises
    ------
    RecordError
        Cues or time reference are not valid.
    """
    remedy = "give a list of cues (sonic_bullet.records.cues.Cue)"
    listed = as_items(cues, "cues", remedy)
    for cue in listed:
        if not isinstance(cue, Cue):
            raise RecordError(f"a cue is {quote(cue)}", remedy)
    last_sample = 2**32 - 1  # last sample of a cue, which has 32 bits: a day at 48 kHz
    kept = [cue for cue in listed if cue.sample <= last_sample]
    points = [
        struct.pack("<II4sIII", number, cue.sample, b"data", 0, 0, cue.sample) for number, cue in enumerate(kept, 1)
    ]
    notes = []
    for number, cue in enumerate(kept, 1):
        notes.append(_chunk(b"labl", struct.pack("<I", number) + _text(cue.label) + b"\0"))
        if cue.samples:
            length = min(cue.samples, last_sample)
            notes.append(_chunk(b"ltxt", struct.pack("<II4sHHHH", number, length, b"rgn ", 0, 0, 0, 0)))
    places = _chunk(b"cue ", struct.pack("<I", len(points)) + b"".join(points)) + _chunk(
        b"LIST", b"adtl" + b"".join(notes)
    )
    return _bext(description, time_reference) + (places if kept else b"")


def _bext(description: str, time_reference: int) -> bytes:
    """Make a `bext` of version 1: 602 bytes, without date and time."""
    body = struct.pack(
        "<256s32s32s10s8sQH64s190s", _text(description, 255), b"sonic_bullet", b"", b"", b"", time_reference, 1, b"",
        b"",
    )  # fmt: skip
    return _chunk(b"bext", body)


def _chunk(name: bytes, body: bytes) -> bytes:
    return name + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)


def _text(text: str, most: int = 200) -> bytes:
    """Encode a text for a chunk: UTF-8, without NUL."""
    return text.replace("\0", " ").encode("utf-8", "replace")[:most].decode("utf-8", "ignore").encode()


def append_chunks(fd: int, chunks: bytes) -> None:
    """Append chunks to an open, whole WAV or RF64 file; raises OSError."""
    size = os.lseek(fd, 0, os.SEEK_END)
    left = memoryview(b"\0" * (size % 2) + chunks)
    while left:
        left = left[os.write(fd, left) :]
    whole = os.lseek(fd, 0, os.SEEK_CUR) - 8
    os.lseek(fd, 0, os.SEEK_SET)
    is_long = os.read(fd, 4) == b"RF64"  # its size is in the chunk ds64 [EBU Tech 3306, sec. 3.5]
    os.lseek(fd, 20 if is_long else 4, os.SEEK_SET)
    os.write(fd, struct.pack("<Q" if is_long else "<I", whole))


def forget_time(fd: int) -> None:
    """Zero the time of day that libsndfile writes to the PEAK chunk of float files: equal sound, equal bytes.

    The chunk holds id, size, version, time.
    """
    os.lseek(fd, 0, os.SEEK_SET)
    head = os.read(fd, 512)
    found = head.split(b"data")[0].split(b"SSND")[0].find(b"PEAK")
    if found >= 0:
        os.lseek(fd, found + 12, os.SEEK_SET)
        os.write(fd, bytes(4))
