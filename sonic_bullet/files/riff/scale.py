"""Full scale of a sound file in pascals, as the file states it.

    full_scale_pa -> "0 dBFS = 63.1 Pa; full_scale_pa=63.09573444801933"
      WAV, RF64  bext description [EBU Tech 3285 v1, sec. 2.3] and iXML NOTE [iXML 3.01, <BWFXML><NOTE>]
      others     the comment that libsndfile writes (FLAC, OGG, AIFF, CAF); films: the container's comment
      W64        nowhere: libsndfile writes no text there, and miscounts the samples before a further chunk

The number has all its digits, so that dividing by it restores the samples, to a rounding. A channel that is not a
pressure (a vibrometer) has its own unit in place of Pa, and the same number.
"""

from __future__ import annotations

import math
import os
import re
import struct
from collections.abc import Iterator


def scale_text(full_scale_pa: float) -> str:
    """Return the text that states a scale."""
    return f"0 dBFS = {full_scale_pa:.3g} Pa; full_scale_pa={full_scale_pa!r}"


def scale_in(text: bytes) -> float | None:
    """Find the full scale in Pa in a text; None where there is no valid one."""
    scale_pattern = re.compile(rb"full_scale_pa=([0-9.]{1,25}(?:e[+-]?[0-9]{1,3})?)(?![0-9.e])")
    found = scale_pattern.search(text)
    try:
        number = float(found[1]) if found else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) and number > 0 else None


def ixml_chunk(full_scale_pa: float) -> bytes:
    """Return the chunk `iXML` of a WAV or RF64."""
    note = scale_text(full_scale_pa)
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    body = f"{head}<BWFXML><IXML_VERSION>1.61</IXML_VERSION><NOTE>{note}</NOTE></BWFXML>".encode()
    return b"iXML" + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)


def read_chunk_scale(fd: int) -> float | None:
    """Read the full scale in Pa from an open WAV or RF64, iXML before bext; None without one; raises OSError."""
    most_bytes = 1 << 16  # of one chunk
    found: dict[bytes, float | None] = {}
    for name, at, size in _chunks(fd):
        if name in (b"iXML", b"bext"):
            found.setdefault(name, scale_in(os.pread(fd, min(size, most_bytes), at)))
    return found.get(b"iXML") or found.get(b"bext")


def _chunks(fd: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield name, offset and bytes of each chunk of a RIFF or RF64."""
    most_chunks = 1000  # of a file
    head, end = os.pread(fd, 12, 0), os.fstat(fd).st_size
    if head[:4] not in (b"RIFF", b"RF64") or head[8:] != b"WAVE":
        return
    at, long = 12, 0
    for _ in range(most_chunks):
        one = os.pread(fd, 8, at)
        if len(one) < 8 or at >= end:
            return
        size = struct.unpack("<I", one[4:])[0]
        if one[:4] == b"ds64":  # where sizes of 32 bits do not suffice [EBU Tech 3306, sec. 3.5]
            long = int.from_bytes(os.pread(fd, 8, at + 16), "little")
        size = long if one[:4] == b"data" and size == 2**32 - 1 else size
        yield one[:4], at + 8, size
        at += 8 + size + size % 2
