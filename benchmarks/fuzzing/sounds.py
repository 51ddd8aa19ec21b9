"""Small audio files of every format, and changes after which their checksums are right again.

FLAC: CRC-8 of each frame's header, CRC-16 of each frame [RFC 9639, 9.1.8 and 9.3]. Ogg: CRC-32 of each page, polynomial
04C11DB7 [RFC 3533, 6].
"""

from __future__ import annotations

import io
import random
import struct

import numpy as np
import soundfile

from benchmarks.fuzzing.mutations import changed, cut, flipped, overwritten
from sonic_bullet.records.file_endings import AUDIO_FORMATS

SR = 8000
FRAMES = 700


def seed(suffix: str) -> bytes:
    """A decaying sine of 700 samples."""
    time = np.arange(FRAMES) / SR
    sound = 0.5 * np.exp(-60 * time) * np.sin(2 * np.pi * 1000 * time)
    stream = io.BytesIO()
    container, subtype, *_ = AUDIO_FORMATS[suffix]
    soundfile.write(stream, sound, SR, subtype, format=container)
    return stream.getvalue()


def plain_changed(data: bytes, draw: random.Random) -> bytes:
    """Formats without checksums: mostly their headers."""
    kind = draw.randrange(4)
    if kind == 0:
        return changed(data, draw)
    head = min(len(data), 128)
    for _ in range(draw.choice((1, 1, 2, 3))):
        data = draw.choice((flipped, overwritten))(data, draw, 0, min(head, len(data)))
    return cut(data, draw) if kind == 1 else data


def _table(bits: int, polynomial: int) -> list[int]:
    top, mask = 1 << (bits - 1), (1 << bits) - 1
    table = []
    for byte in range(256):
        value = byte << (bits - 8)
        for _ in range(8):
            value = ((value << 1) ^ polynomial if value & top else value << 1) & mask
        table.append(value)
    return table


CRC8, CRC16, CRC32 = _table(8, 0x07), _table(16, 0x8005), _table(32, 0x04C11DB7)


def _crc(data: bytes, bits: int, table: list[int]) -> int:
    value, mask = 0, (1 << bits) - 1
    for byte in data:
        value = ((value << 8) & mask) ^ table[((value >> (bits - 8)) ^ byte) & 255]
    return value


def flac_frames(data: bytes) -> list[int]:
    """Where the frames start: a sync code whose header's CRC-8 is right.

    A header of these seeds is 6 to 10 bytes long.
    """
    found = []
    for at in range(len(data) - 10):
        if (
            data[at] == 0xFF
            and data[at + 1] & 0xFE == 0xF8
            and any(_crc(data[at : at + n], 8, CRC8) == data[at + n] for n in range(5, 10))
        ):
            found.append(at)
    return found


def flac_changed(data: bytes, draw: random.Random) -> bytes:
    """STREAMINFO or a frame changed; the frame's checksums put right."""
    kind = draw.randrange(6)
    if kind == 0:
        return changed(data, draw)
    if kind <= 2:  # STREAMINFO: block sizes, frame sizes, rate, channels, bits, samples, MD5
        out = draw.choice((flipped, overwritten))(data, draw, 8, 42)
        if draw.random() < 0.3:  # no length, or one of 64 G
            samples = draw.choice((0, (1 << 36) - 1, 1, 10**6))
            word = int.from_bytes(out[18:26], "big") >> 36 << 36 | samples
            out = out[:18] + word.to_bytes(8, "big") + out[26:]
        return out
    starts = flac_frames(data)
    if not starts:
        return changed(data, draw)
    k = draw.randrange(len(starts))
    low, high = starts[k], starts[k + 1] if k + 1 < len(starts) else len(data)
    size = next(n for n in range(5, 10) if _crc(data[low : low + n], 8, CRC8) == data[low + n])
    frame = data[low:high]
    frame = (
        flipped(frame, draw, 2, size)
        if draw.random() < 0.4
        else draw.choice((flipped, overwritten))(frame, draw, size + 1, len(frame) - 2)
    )
    frame = frame[:size] + bytes([_crc(frame[:size], 8, CRC8)]) + frame[size + 1 : -2]
    frame += _crc(frame, 16, CRC16).to_bytes(2, "big")
    return data[:low] + frame * draw.choice((1, 1, 1, 3)) + data[high:]


def ogg_pages(data: bytes) -> list[tuple[int, int]]:
    """(start, stop) of each page that is whole."""
    pages, at = [], 0
    while data[at : at + 4] == b"OggS" and at + 27 <= len(data):
        count = data[at + 26]
        stop = at + 27 + count + sum(data[at + 27 : at + 27 + count])
        if stop > len(data):
            break
        pages.append((at, stop))
        at = stop
    return pages


def ogg_changed(data: bytes, draw: random.Random) -> bytes:
    """A page's header or packets changed, pages doubled or left out; CRCs put right."""
    if draw.random() < 0.15:
        return changed(data, draw)
    pages = [data[low:high] for low, high in ogg_pages(data)]
    at = draw.randrange(len(pages))
    page = pages[at]
    body = 27 + page[26]
    kind = draw.randrange(5)
    if kind == 0:
        page = draw.choice((flipped, overwritten))(page, draw, 4, 22)
    elif kind < 4:
        low = body if at else 0
        page = draw.choice((flipped, overwritten))(
            page, draw, max(low, 27), min(len(page), max(low, 27) + draw.choice((40, 400, 5000)))
        )
    pages[at] = page
    if kind == 4:
        pages = draw.choice((pages[:at] + pages[at + 1 :], pages[: at + 1] + pages[at:], pages[::-1]))
    return b"".join(_sealed(page) for page in pages)


def _sealed(page: bytes) -> bytes:
    bare = page[:22] + bytes(4) + page[26:]
    return bare[:22] + struct.pack("<I", _crc(bare, 32, CRC32)) + bare[26:]
