"""npz without its holes: arrays and one JSON entry in an uncompressed zip, opened only after every claim has been checked.

    header.npy  (n,) uint8: UTF-8 JSON, first key "format"
    NAME.npy    one array each, little-endian bool, integer or float

Entries are stored, not deflated: floats hardly shrink, and no entry can then be larger than the file it lies in (no zip bombs). An npy
header's shape is compared with the entry's true length before anything is allocated. ``numpy.load(path)`` reads the file too.
"""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec
import numpy as np

from sonic_bullet.files.atomic import cannot, replacing
from sonic_bullet.records import Array
from sonic_bullet.records.errors import LogError

HEADER = "header"
REMEDY = "use the file as sonic-bullet wrote it, or make it again"
Header = TypeVar("Header", bound=msgspec.Struct)


class _Format(msgspec.Struct):
    format: str


def write_container(path: str | os.PathLike[str], header: msgspec.Struct, arrays: Mapping[str, Array]) -> None:
    """Write header and arrays, whole or not at all; equal input gives equal bytes. Raises FileError."""
    entries = {HEADER: np.frombuffer(msgspec.json.encode(header), np.uint8), **arrays}
    with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in entries.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)


def read_container(path: str | os.PathLike[str], kind: type[Header], form: str, what: str) -> tuple[Header, dict[str, Array]]:
    """The header as ``kind`` and all arrays, by name, read-only.

    form: the format id asked for; what: the thing, in words, for messages ("contact log"). Raises FileError where there is no readable
    file, LogError where it is cut, foreign, compressed, pickled or lies about a size.
    """
    try:
        size = os.path.getsize(path)
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > size:
                raise LogError(f"{path} claims more bytes than it has", REMEDY)
            arrays = {_entry_name(info, path): _read_entry(archive, info, size, path) for info in archive.infolist()}
    except OSError as error:
        raise cannot("read", path, error) from error
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, KeyError) as error:
        raise LogError(f"{path} is cut or no {what} ({error})", REMEDY) from error
    if HEADER not in arrays:
        raise LogError(f"{path} is no {what}: it has no header", REMEDY)
    text = arrays.pop(HEADER).tobytes()
    try:
        found = msgspec.json.decode(text, type=_Format).format
        if found != form:
            raise LogError(f"{path} has format '{found}', wanted '{form}'", f"give a {what} of this version")
        return msgspec.json.decode(text, type=kind), arrays
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise LogError(f"{path} is no {what}: {error}", REMEDY) from error


def take(arrays: Mapping[str, Array], name: str, dtype: Any, shape: tuple[int | None, ...], path: object) -> Array:
    """The array ``name`` if it has that dtype and shape (None: any length). Raises LogError."""
    if name not in arrays:
        raise LogError(f"{path}: array '{name}' is missing", REMEDY)
    array = arrays[name]
    if array.dtype != np.dtype(dtype):
        raise LogError(f"{path}: array '{name}' holds {array.dtype}, wanted {np.dtype(dtype)}", REMEDY)
    if array.ndim != len(shape) or any(want is not None and want != have for have, want in zip(array.shape, shape, strict=True)):
        raise LogError(f"{path}: array '{name}' has shape {array.shape}, wanted {shape}", REMEDY)
    return array


def _entry_name(info: zipfile.ZipInfo, path: object) -> str:
    if not info.filename.endswith(".npy"):
        raise LogError(f"{path} holds a foreign entry '{info.filename}'", REMEDY)
    return info.filename[:-4]


def _read_entry(archive: zipfile.ZipFile, info: zipfile.ZipInfo, file_bytes: int, path: object) -> Array:
    """One array, allocated only after its claims agree with the file's true size."""
    where = f"{path}: entry '{info.filename}'"
    if info.compress_type != zipfile.ZIP_STORED:
        raise LogError(f"{where} is compressed, which this format never is", REMEDY)
    if info.file_size != info.compress_size or info.file_size > file_bytes:
        raise LogError(f"{where} claims {info.file_size} bytes in a file of {file_bytes}", REMEDY)
    raw = archive.read(info)
    stream = io.BytesIO(raw)
    try:
        version = np.lib.format.read_magic(stream)
        reader = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, fortran, dtype = reader(stream)
    except (ValueError, KeyError, EOFError) as error:
        raise LogError(f"{where} is no array", REMEDY) from error
    if dtype.hasobject or dtype.kind not in "biuf":
        raise LogError(f"{where} holds {dtype}, only plain numbers are read", REMEDY)
    claimed = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or claimed != len(raw) - stream.tell():
        raise LogError(f"{where} claims {claimed} bytes of numbers and holds {len(raw) - stream.tell()}", REMEDY)
    return np.frombuffer(raw, dtype, offset=stream.tell()).reshape(shape, order="F" if fortran else "C")
