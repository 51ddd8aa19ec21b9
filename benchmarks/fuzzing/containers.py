"""npz containers, taken apart and put together again: changed arrays, headers and directories with the right CRC and
sizes.
"""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile

import numpy as np

from benchmarks.fuzzing.mutations import changed, flipped, json_changed, overwritten
from sonic_bullet.files.models import PACKED
from sonic_bullet.records import Array

Entries = list[tuple[str, bytes]]
HEADERS: tuple[bytes, ...] = (
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,), ",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (((((((((3,), }",
    b"{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    b"{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (0, 9223372036854775807), }",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999999, 0), }",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
    b"{'descr': '<f8', 'fortran_order': True, 'shape': (), }",
    b"{'descr': '<f16', 'fortran_order': False, 'shape': (2,), }",
    b"{'descr': '<V8', 'fortran_order': False, 'shape': (2,), }",
    b"'''",
    b"{" * 3000,
    b"(" * 300,
    b"{'a': 1}",
    b"0x",
    b"\xff\xfe",
)


def taken_apart(path: str | io.BytesIO) -> Entries:
    """Names and contents of a zip's entries."""
    with zipfile.ZipFile(path) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def put_together(entries: Entries) -> bytes:
    """A zip as the project writes it: arrays of models are deflated, all else is stored."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, content in entries:
            info = zipfile.ZipInfo(name)
            info.compress_type = zipfile.ZIP_DEFLATED if name.startswith(PACKED) else zipfile.ZIP_STORED
            with archive.open(info, "w", force_zip64=True) as entry:
                entry.write(content)
    return stream.getvalue()


def array_of(content: bytes) -> Array:
    return np.load(io.BytesIO(content), allow_pickle=False)


def npy(array: Array) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
    return stream.getvalue()


def raw_npy(header: bytes, body: bytes, version: tuple[int, int] = (1, 0)) -> bytes:
    """An npy of any header text, its length right."""
    size = struct.pack("<H", len(header) & 0xFFFF) if version == (1, 0) else struct.pack("<I", len(header))
    return b"\x93NUMPY" + bytes(version) + size + header + body


def container_changed(entries: Entries, draw: random.Random) -> bytes:
    """A container with its arrays, its header, an npy header, its directory or its bytes changed."""
    kind = draw.randrange(10)
    if kind < 5:
        for _ in range(draw.choice((1, 1, 2))):
            entries = _other_array(entries, draw)
    elif kind == 5:
        entries = _other_header(entries, draw)
    elif kind == 6:
        entries = _other_npy(entries, draw)
    elif kind == 7:
        return _other_directory(entries, draw)
    elif kind == 8:
        return changed(put_together(entries), draw)
    else:
        return _crc_mended(entries, draw)
    return put_together(entries)


def _other_array(entries: Entries, draw: random.Random) -> Entries:
    """One array of another dtype, shape, order or value; or gone, renamed, or another's."""
    at = draw.randrange(len(entries))
    name, content = entries[at]
    kind = draw.randrange(14)
    if kind == 0:
        return entries[:at] + entries[at + 1 :]
    if kind == 1:
        return [
            *entries[:at],
            (draw.choice(("x" * 4000 + ".npy", "other.npy", name + ".npy", "../a.npy", "a")), content),
            *entries[at + 1 :],
        ]
    if kind == 2:
        return [*entries[:at], (name, draw.choice(entries)[1]), *entries[at + 1 :]]
    array = np.array(array_of(content))
    if kind == 3:
        array = array.astype(draw.choice(("<f4", "<f8", "<i4", "<i8", "|b1", ">f8", "<f2", "|u1", "<u8")))
    elif kind == 4:
        array = draw.choice(
            (
                array.ravel(),
                array[None],
                array[:0],
                array[:1],
                np.concatenate([array, array]) if array.ndim else array,
                array.T,
            )
        )
    elif array.size and array.dtype.kind in "iuf":
        array = _other_numbers(array.ravel(), kind, draw).reshape(array.shape)
    elif array.size:
        return [*entries[:at], (name, flipped(content, draw, len(content) - array.nbytes)), *entries[at + 1 :]]
    return [*entries[:at], (name, npy(array)), *entries[at + 1 :]]


def _other_numbers(flat: Array, kind: int, draw: random.Random) -> Array:
    """One number of (n,) or all replaced, scaled or moved along."""
    if flat.dtype.kind == "f":
        value = draw.choice(
            (
                np.nan,
                np.inf,
                -np.inf,
                0.0,
                -0.0,
                -1.0,
                1e-320,
                1e-200,
                1e-30,
                1e15,
                1e30,
                1e38,
                1e150,
                1e200,
                1e308,
                flat[0],
            )
        )
    else:
        low, high = np.iinfo(flat.dtype).min, np.iinfo(flat.dtype).max
        value = draw.choice([x for x in (0, 1, 2, -1, 99, 10**6, low, high) if low <= x <= high])
    if kind > 11:
        return np.roll(flat, draw.randrange(flat.size))
    with np.errstate(all="ignore"):
        if kind == 10 and flat.dtype.kind == "f":
            flat *= value
        elif kind in (9, 11):
            flat[:] = value
        else:
            flat[draw.randrange(flat.size)] = value
    return flat


def _other_header(entries: Entries, draw: random.Random) -> Entries:
    """The JSON entry restructured."""
    known = json.loads(array_of(dict(entries)["header.npy"]).tobytes())
    text = json_changed(known, draw)
    return [
        (name, npy(np.frombuffer(text, np.uint8)) if name == "header.npy" else content) for name, content in entries
    ]


def _other_npy(entries: Entries, draw: random.Random) -> Entries:
    """The text that says what an array is, changed or another."""
    at = draw.randrange(len(entries))
    name, content = entries[at]
    size = struct.unpack("<H", content[8:10])[0]
    header, body = content[10 : 10 + size], content[10 + size :]
    header = changed(header, draw)[:60_000] if draw.random() < 0.5 else draw.choice(HEADERS) + b"\n"
    made = raw_npy(header, body, draw.choice(((1, 0), (1, 0), (1, 0), (2, 0), (3, 0), (9, 9))))
    return [*entries[:at], (name, made), *entries[at + 1 :]]


def _other_directory(entries: Entries, draw: random.Random) -> bytes:
    """A name twice, an entry that the directory hides, another local header, bytes in a gap, before, behind."""
    kind = draw.randrange(6)
    if kind == 0:
        extra = draw.choice(entries)
        return put_together([*entries, (extra[0], npy(np.zeros(3)))])
    whole = put_together(entries)
    end = whole.rindex(b"PK\x05\x06")
    count, size, start = struct.unpack("<HII", whole[end + 10 : end + 20])
    if kind == 1:  # the directory loses its k-th entry, and says so
        at, sizes = start, []
        for _ in range(count):
            name, extra, note = struct.unpack("<HHH", whole[at + 28 : at + 34])
            sizes.append((at, at + 46 + name + extra + note))
            at = sizes[-1][1]
        low, high = draw.choice(sizes)
        tail = bytearray(whole[end:])
        tail[8:20] = struct.pack("<HHII", count - 1, count - 1, size - (high - low), start)
        return whole[:low] + whole[high:end] + bytes(tail)
    if kind == 2:
        local = draw.choice([i for i in range(start) if whole[i : i + 4] == b"PK\x03\x04"])
        return draw.choice((flipped, overwritten))(whole, draw, local, local + 30)
    if kind == 3:
        return draw.randbytes(draw.choice((1, 22, 100))) + whole
    if kind == 4:
        return whole + draw.randbytes(draw.choice((1, 22, 100)))
    return draw.choice((flipped, overwritten))(whole, draw, start)


def _crc_mended(entries: Entries, draw: random.Random) -> bytes:
    """Bytes of one entry changed, its CRC and length put right."""
    at = draw.randrange(len(entries))
    name, content = entries[at]
    return put_together([*entries[:at], (name, changed(content, draw)), *entries[at + 1 :]])
