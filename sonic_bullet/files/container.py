"""npz without its holes: arrays and one JSON entry in a zip, opened only after every claim has been checked.

    header.npy  (n,) uint8: UTF-8 JSON, first key "format"
    NAME.npy    one array each, little-endian bool, integer or float

Entries are stored, but for those whose names begin as the caller says: they are deflated. All entries together unpack
to at most `UNPACKED` times the file, else it is refused before anything is unpacked (no zip bombs), and an entry
unpacks to as many bytes as it claims, no more. An npy header's shape is compared with the entry's true length before
anything is allocated. The entries fill the file, each once and as the directory says, so that no part of it can hide.
``numpy.load(path)`` reads the file too.
What is larger than memory is written block by block (`Column`), and stays in the file when it is read
(`RowsOfEntry`).
"""

from __future__ import annotations

import math
import os
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, TypeVar

import msgspec
import numpy as np

from sonic_bullet.files.atomic import replacing
from sonic_bullet.files.reading import reading
from sonic_bullet.files.rows.spool import read_at
from sonic_bullet.files.typed_json import decode_json
from sonic_bullet.machine.json_text import json_bytes
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, LogError

HEADER = "header"
REMEDY = "use the file as sonic-bullet wrote it, or make it again"
Header = TypeVar("Header", bound=msgspec.Struct)

UNPACKED = 64  # times the file's size; models deflate to a third, of a flat plate to a tenth
LOCAL = struct.Struct("<4s5H3I2H")  # an entry's own header [PKWARE APPNOTE 6.3.10, 4.3.7]
EXTRA = struct.Struct("<2H2Q")  # its zip64 field: id, length, size, packed size [4.5.3]
END = struct.Struct("<4s6xH8xH")  # end of the directory: magic, entries in all, length of the comment [4.3.16]
LOADED_BYTES, HEAD_BYTES = 1 << 20, 1 << 16  # entries that may stay in the file are larger; an npy header is shorter
ZIP64, UTF8 = 0xFFFFFFFF, 1 << 11
NPY = re.compile(  # [numpy.lib.format, version 1.0 and 2.0], as numpy writes it
    rb"\{'descr': '(?P<descr>[<>|=][a-zA-Z][0-9]{0,4})', 'fortran_order': (?P<fortran>True|False), 'shape': "
    rb"\((?P<shape>[-0-9, ]{0,400})\), \} *\n"
)


class _Format(msgspec.Struct):
    format: str


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """An entry that is written block by block: dtype, shape, and a call that gives its blocks (·, *shape[1:])."""

    dtype: Any
    shape: tuple[int, ...]
    blocks: Callable[[], Iterable[Array]]


class RowsOfEntry:
    """An array that stays in its file: [start:stop] reads those rows. Its file is open for as long as this is."""

    def __init__(self, file: BinaryIO, at: int, dtype: np.dtype[Any], shape: tuple[int, ...], what: str) -> None:
        self.dtype, self.shape, self.ndim = dtype, shape, len(shape)
        self._file, self._at, self._what = file, at, what

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> Array:
        start, stop, _ = rows.indices(len(self))
        tail = self.shape[1:]
        size = self.dtype.itemsize * math.prod(tail)
        count = max(stop - start, 0)
        raw = read_at(self._file.fileno(), count * size, self._at + start * size, self._what)
        return np.frombuffer(raw, self.dtype).reshape(count, *tail)


def write_container(
    path: str | os.PathLike[str],
    header: msgspec.Struct,
    arrays: Mapping[str, Array | Column],
    packed: str | None = None,
) -> None:
    """Write header and arrays, whole or not at all; equal input gives equal bytes. packed: what the names of entries
    begin with that are deflated, None: none is. Raises FileError.
    """
    entries = {HEADER: np.frombuffer(json_bytes(header), np.uint8), **arrays}
    with replacing(path) as file:
        if _written(file, entries, packed) > UNPACKED * file.tell():  # nothing but zeros: no reader would take it
            file.seek(0)
            file.truncate()
            _written(file, entries, None)


def _written(file: BinaryIO, entries: Mapping[str, Array | Column], packed: str | None) -> int:
    """Write all entries. Returns how many bytes they are when they are unpacked."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in entries.items():
            info = zipfile.ZipInfo(f"{name}.npy")
            if _is_packed(name, packed):
                info.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(info, "w", force_zip64=True) as entry:
                if isinstance(array, Column):
                    descr = np.lib.format.dtype_to_descr(np.dtype(array.dtype))
                    head = {"descr": descr, "fortran_order": False, "shape": array.shape}
                    np.lib.format.write_array_header_1_0(entry, head)
                    for block in array.blocks():
                        entry.write(np.ascontiguousarray(block, array.dtype).tobytes())
                else:
                    np.lib.format.write_array(entry, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
        return sum(info.file_size for info in archive.infolist())


def _is_packed(name: str, packed: str | None) -> bool:
    return packed is not None and name.startswith(packed)


def read_container(
    path: str | os.PathLike[str],
    kind: type[Header],
    form: str,
    what: str,
    packed: str | None = None,
    lazy: Collection[str] = (),
) -> tuple[Header, dict[str, Array]]:
    """The header as ``kind`` and all arrays, by name, read-only.

    form: the format id asked for; what: the thing, in words, for messages ("contact log"); packed: what the names of
    entries begin with that may be deflated; lazy: arrays that stay in the file where they have over `LOADED_BYTES`
    (`RowsOfEntry`: checked like the others, by blocks, and then used like them by [start:stop]).

    Raises FileError where there is no readable file, LogError where it is cut, foreign, pickled, holds another
    compressed entry, one twice or beside its directory, or lies about a size.
    """
    with reading(path, what, LogError, REMEDY):
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):  # a pipe would be waited for without end
            raise FileError(f"cannot read {path}: it is not a regular file", f"name a {what}")
        size = status.st_size
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            if sum(info.file_size for info in archive.infolist()) > (1 if packed is None else UNPACKED) * size:
                raise LogError(f"{path} claims more bytes than it has", REMEDY)
            arrays: dict[str, Array] = {}
            for info, start in _entries(archive, file, size, packed):
                name = _entry_name(info)
                if name in arrays:
                    raise LogError(f"entry '{info.filename}' is there twice", REMEDY)
                where = f"entry '{info.filename}'"
                rows = _rows(archive, info, file, size, where) if name in lazy else None
                arrays[name] = _array(_unpacked(file, info, start), where, UNPACKED * size) if rows is None else rows
        if HEADER not in arrays:
            raise LogError(f"{path} is no {what}: it has no header", REMEDY)
        text = arrays.pop(HEADER).tobytes()
        where = f"{path} is no {what}"
        found = decode_json(text, _Format, where, LogError, REMEDY).format
        if _is_older(found, form):
            raise LogError(f"{path} is a {what} of format '{found}', which is no longer read", "make it anew")
        if found != form:
            raise LogError(f"{path} has format '{found}', wanted '{form}'", f"give a {what} of this version")
        return decode_json(text, kind, where, LogError, REMEDY), arrays


def _is_older(found: str, form: str) -> bool:
    """Whether a format is ``form`` with a lower number."""
    (kind, _, number), (known, _, latest) = found.rpartition("/"), form.rpartition("/")
    return kind == known and number.isdecimal() and int(number) < int(latest)


def take(arrays: Mapping[str, Array], name: str, dtype: Any, shape: tuple[int | None, ...], path: object) -> Array:
    """The array ``name`` if it has that dtype and shape (None: any length). Raises LogError."""
    if name not in arrays:
        raise LogError(f"{path}: array '{name}' is missing", REMEDY)
    array = arrays[name]
    if array.dtype != np.dtype(dtype):
        raise LogError(f"{path}: array '{name}' holds {array.dtype}, wanted {np.dtype(dtype)}", REMEDY)
    if array.ndim != len(shape) or any(
        want is not None and want != have for have, want in zip(array.shape, shape, strict=True)
    ):
        raise LogError(f"{path}: array '{name}' has shape {array.shape}, wanted {shape}", REMEDY)
    return array


def distinct(things: list[Any], key: Any) -> tuple[list[Any], list[int | None]]:
    """The different things by content, in order of appearance, and the index of each; None stays None."""
    kept: dict[Any, int] = {}
    by_identity = {id(thing): key(thing) for thing in things if thing is not None}
    index = [None if thing is None else kept.setdefault(by_identity[id(thing)], len(kept)) for thing in things]
    firsts = [next(thing for thing, i in zip(things, index, strict=True) if i == number) for number in range(len(kept))]
    return firsts, index


def _entries(
    archive: zipfile.ZipFile, file: BinaryIO, file_bytes: int, packed: str | None
) -> Iterator[tuple[zipfile.ZipInfo, int]]:
    """The entries in the file's order and where the bytes of each begin, once it is known that they fill it: from its
    first byte to the directory, and that to its end.

    So nothing lies where the directory does not tell of it, and each entry is what its own local header says it is.
    Raises LogError.
    """
    infos = sorted(archive.infolist(), key=lambda info: info.header_offset)
    at, starts = 0, []
    for info in infos:
        stored = info.compress_type == zipfile.ZIP_STORED
        if not stored and not (info.compress_type == zipfile.ZIP_DEFLATED and _is_packed(info.filename, packed)):
            raise LogError(f"entry '{info.filename}' is compressed, which this format never is", REMEDY)
        if (stored and info.file_size != info.compress_size) or info.compress_size > file_bytes:
            raise LogError(f"entry '{info.filename}' claims {info.file_size} bytes in a file of {file_bytes}", REMEDY)
        file.seek(at)
        head = file.read(LOCAL.size)
        if info.header_offset != at or len(head) < LOCAL.size:
            raise LogError("its directory does not tell of all that lies in it", REMEDY)
        magic, _, flags, method, _, _, crc, packed_size, size, name_bytes, extra_bytes = LOCAL.unpack(head)
        name, extra = file.read(name_bytes), file.read(extra_bytes)
        if packed_size == size == ZIP64 and len(extra) == EXTRA.size:
            *_, size, packed_size = EXTRA.unpack(extra)
        said = (magic, flags & ~UTF8, method, crc, packed_size, size, name)
        if said != (
            b"PK\x03\x04",
            0,
            info.compress_type,
            info.CRC,
            info.compress_size,
            info.file_size,
            info.filename.encode(),
        ):
            raise LogError(f"entry '{info.filename}' is another in the directory", REMEDY)
        starts.append(at + LOCAL.size + name_bytes + extra_bytes)
        at = starts[-1] + info.compress_size
    file.seek(max(file_bytes - END.size, 0))
    magic, count, comment_bytes = END.unpack(file.read(END.size))
    if at != archive.start_dir or magic != b"PK\x05\x06" or comment_bytes or count != min(len(infos), 0xFFFF):
        raise LogError("its directory does not tell of all that lies in it", REMEDY)
    yield from zip(infos, starts, strict=True)


def _unpacked(file: BinaryIO, info: zipfile.ZipInfo, start: int) -> bytes:
    """The bytes of an entry, as many as it claims, whose checksum is right. Raises LogError."""
    file.seek(start)
    raw = file.read(info.compress_size)
    whole = True
    if info.compress_type == zipfile.ZIP_DEFLATED:
        stream = zlib.decompressobj(-zlib.MAX_WBITS)
        raw = stream.decompress(raw, info.file_size + 1)  # one more than is claimed is enough to know
        whole = stream.eof and not stream.unused_data
    if len(raw) != info.file_size or not whole:
        raise LogError(f"entry '{info.filename}' is not as long as it claims", REMEDY)
    if zlib.crc32(raw) != info.CRC:
        raise LogError(f"entry '{info.filename}' is damaged", REMEDY)
    return raw


def _entry_name(info: zipfile.ZipInfo) -> str:
    if not info.filename.endswith(".npy"):
        raise LogError(f"there is a foreign entry '{info.filename}'", REMEDY)
    return info.filename[:-4]


def _rows(archive: zipfile.ZipFile, info: zipfile.ZipInfo, file: BinaryIO, file_bytes: int, where: str) -> Any:
    """A large entry as `RowsOfEntry`, its checksum and flags compared by blocks; None where it is to be loaded."""
    if info.file_size <= LOADED_BYTES:
        return None
    with archive.open(info) as entry:
        head = entry.read(HEAD_BYTES)
        dtype, shape, fortran, at = _npy_head(head, info.file_size, where, file_bytes)
        if fortran and len(shape) > 1:
            return None  # as numpy may save it: its rows do not lie together
        block = head[at:]
        while block:  # to its end, where zipfile compares the checksum
            _check_flags(np.frombuffer(block, np.uint8), dtype, where)
            block = entry.read(LOADED_BYTES)
    file.seek(info.header_offset + LOCAL.size - 4)
    name_bytes, extra_bytes = struct.unpack("<2H", file.read(4))
    start = info.header_offset + LOCAL.size + name_bytes + extra_bytes + at
    stays = os.fdopen(os.dup(file.fileno()), "rb", buffering=0)  # for as long as the rows are
    return RowsOfEntry(stays, start, dtype, shape, f"{file.name}, {where}")


def _npy_head(raw: bytes, entry_bytes: int, where: str, file_bytes: int) -> tuple[Any, tuple[int, ...], bool, int]:
    """dtype, shape, whether in Fortran's order, and where the numbers begin, of an npy file that begins like ``raw``;
    nothing of it is evaluated: a header says descr, order and shape as numpy writes them, or it is none.
    """
    size_bytes = {b"\x93NUMPY\x01\x00": 2, b"\x93NUMPY\x02\x00": 4}.get(raw[:8], 0)
    start = 8 + size_bytes
    stop = start + int.from_bytes(raw[8:start], "little")
    found = NPY.fullmatch(raw[start:stop]) if size_bytes and stop <= len(raw) else None
    if found is None:
        raise LogError(f"{where} is no array", REMEDY)
    descr = found["descr"].decode()
    if descr[0] not in "<>|=" or descr[1] not in "biuf":
        raise LogError(f"{where} holds {descr}, only plain numbers are read", REMEDY)
    dtype, shape = np.dtype(descr), tuple(int(word) for word in found["shape"].split(b",") if word.strip())
    claimed = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or claimed != entry_bytes - stop or max(shape, default=0) > file_bytes:
        raise LogError(f"{where} claims {claimed} bytes of numbers and holds {entry_bytes - stop}", REMEDY)
    return dtype, shape, found["fortran"] == b"True", stop


def _array(raw: bytes, where: str, file_bytes: int) -> Array:
    """The array of an npy file."""
    dtype, shape, fortran, at = _npy_head(raw, len(raw), where, file_bytes)
    array = np.frombuffer(raw, dtype, offset=at).reshape(shape, order="F" if fortran else "C")
    _check_flags(array, dtype, where)
    return array


def _check_flags(numbers: Array, dtype: np.dtype[Any], where: str) -> None:
    """Raise LogError where what should be flags (or their bytes) is neither 0 nor 1."""
    if dtype.kind == "b" and numbers.view(np.uint8).max(initial=0) > 1:
        raise LogError(f"{where} holds numbers that are neither true nor false", REMEDY)
