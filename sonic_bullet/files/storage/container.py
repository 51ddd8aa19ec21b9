"""npz files of arrays and one JSON entry.

    header.npy  (n,) uint8: UTF-8 JSON, first key "format"
    NAME.npy    one array each, little-endian bool, integer or float

Entries are stored; those with a given prefix are deflated. Nothing is pickled, and the shape in an npy header is
compared with the entry's true length before anything is allocated. ``numpy.load(path)`` reads the file too. Arrays
larger than memory are written block by block (`Column`), and stay in the file when it is read (`RowsOfEntry`).
"""

from __future__ import annotations

import io
import math
import os
import struct
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, TypeVar

import msgspec
import numpy as np

from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.storage.json_records import decode_record
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.files.storage.spool import read_at
from sonic_bullet.records import Array
from sonic_bullet.records.errors import LogError

HEADER = "header"
REMEDY = "use the file as sonic-bullet wrote it, or make it again"
Header = TypeVar("Header", bound=msgspec.Struct)

LOADED_BYTES = 1 << 20  # entries that may stay in the file are larger; an npy header is shorter


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """An entry that is written block by block: dtype, shape, and a function that yields its blocks (·, *shape[1:])."""

    dtype: Any
    shape: tuple[int, ...]
    blocks: Callable[[], Iterable[Array]]


class RowsOfEntry:
    """An array that stays in its open file: [start:stop] reads those rows."""

    def __init__(self, file: BinaryIO, at: int, dtype: np.dtype[Any], shape: tuple[int, ...], what: str) -> None:
        self.dtype, self.shape, self.ndim = dtype, shape, len(shape)
        self._file, self._at, self._what = file, at, what

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.shape[0]

    def __getitem__(self, rows: slice) -> Array:
        """Read rows start … stop-1."""
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
    """Write header and arrays, whole or not at all; equal input gives equal bytes.

    Parameters
    ----------
    packed
        Prefix of the entries that are deflated; None: none.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    entries = {HEADER: np.frombuffer(json_bytes(header), np.uint8), **arrays}
    with replace_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in entries.items():
            info = zipfile.ZipInfo(f"{name}.npy")
            if packed is not None and name.startswith(packed):
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


def read_container(
    path: str | os.PathLike[str],
    kind: type[Header],
    form: str,
    what: str,
    lazy: Collection[str] = (),
) -> tuple[Header, dict[str, Array]]:
    """Read the header as ``kind`` and all arrays, by name, read-only.

    Parameters
    ----------
    form
        Format id that the file must have.
    what
        Name of the file's content for messages ("contact log").
    lazy
        Arrays that stay in the file where they are stored and have over `LOADED_BYTES` (`RowsOfEntry`).

    Raises
    ------
    FileError
        There is no readable file.
    LogError
        It is cut, foreign, damaged or pickled.
    """
    with reading_file(path, what, LogError, REMEDY):
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            arrays = {name: _array(archive, info, file, name in lazy) for name, info in _entries(archive)}
        if HEADER not in arrays:
            raise LogError(f"{path} is no {what}: it has no header", REMEDY)
        text = arrays.pop(HEADER).tobytes()
        return decode_record(text, kind, f"{what} {path}", LogError, REMEDY, form), arrays


def take(arrays: Mapping[str, Array], name: str, dtype: Any, shape: tuple[int | None, ...], path: object) -> Array:
    """Return the array ``name`` of that dtype and shape (None: any length).

    Raises
    ------
    LogError
        It is missing or of another dtype or shape.
    """
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
    """Return the different objects by content, in order of appearance, and the index of each; None stays None."""
    kept: dict[Any, int] = {}
    by_identity = {id(thing): key(thing) for thing in things if thing is not None}
    index = [None if thing is None else kept.setdefault(by_identity[id(thing)], len(kept)) for thing in things]
    firsts = [next(thing for thing, i in zip(things, index, strict=True) if i == number) for number in range(len(kept))]
    return firsts, index


def _entries(archive: zipfile.ZipFile) -> Iterator[tuple[str, zipfile.ZipInfo]]:
    for info in archive.infolist():
        if not info.filename.endswith(".npy"):
            raise LogError(f"there is a foreign entry '{info.filename}'", REMEDY)
        yield info.filename[:-4], info


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, file: BinaryIO, lazy: bool) -> Any:
    """Read the array of an entry, or its rows in the file; zipfile compares checksums at an entry's end."""
    head_bytes = 1 << 16  # an npy header is shorter
    local_bytes = 30  # of an entry's own header, without its name and extra field [PKWARE APPNOTE 6.3.10, 4.3.7]
    where = f"entry '{info.filename}'"
    with archive.open(info) as entry:
        head = entry.read(head_bytes)
        dtype, shape, fortran, at = _npy_head(head, info.file_size, where)
        stays = lazy and info.file_size > LOADED_BYTES and info.compress_type == zipfile.ZIP_STORED
        if not stays or (fortran and len(shape) > 1):  # in Fortran's order rows are not contiguous
            numbers = np.frombuffer(head + entry.read(), dtype, offset=at)
            return numbers.reshape(shape, order="F" if fortran else "C")
        while entry.read(LOADED_BYTES):
            pass
    file.seek(info.header_offset + local_bytes - 4)
    start = info.header_offset + local_bytes + sum(struct.unpack("<2H", file.read(4))) + at
    own = os.fdopen(os.dup(file.fileno()), "rb", buffering=0)  # for as long as the rows are
    return RowsOfEntry(own, start, dtype, shape, f"{file.name}, {where}")


def _npy_head(raw: bytes, entry_bytes: int, where: str) -> tuple[np.dtype[Any], tuple[int, ...], bool, int]:
    """Parse dtype, shape, Fortran order, and the offset of the numbers from the first bytes of an npy file."""
    stream = io.BytesIO(raw)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
    except (ValueError, TypeError, OverflowError) as error:
        raise LogError(f"{where} is no array", REMEDY) from error
    if dtype.kind not in "biuf":
        raise LogError(f"{where} holds {dtype}, only plain numbers are read", REMEDY)
    claimed, held = math.prod(shape) * dtype.itemsize, entry_bytes - stream.tell()
    if min(shape, default=0) < 0 or claimed != held:
        raise LogError(f"{where} claims {claimed} bytes of numbers and holds {held}", REMEDY)
    return dtype, shape, fortran, stream.tell()
