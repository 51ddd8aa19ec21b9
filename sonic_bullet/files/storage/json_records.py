"""Read and write frozen records as JSON: every format of ours is a record, and comes and goes by this one door.

    record  ->  UTF-8 JSON, whole or not at all                                        `write_record`
    file    ->  size -> format -> every field -> record                                `read_record`
            ->  error("WHAT FILE: KEY is FOUND, wanted WANTED", remedy), one line      `typed_json`

A record is a msgspec.Struct: its fields are the file's keys, with units in their names, types and bounds in their
annotations, and what a field means in `Meta(description=…)`, of which `record_schema` makes its JSON Schema.
"""

from __future__ import annotations

import os
import re
from typing import Any, TypeVar

import msgspec
import numpy as np

from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.storage.json_text import as_json_text, json_bytes
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.files.storage.typed_json import decode_json
from sonic_bullet.files.storage.unread import shorten
from sonic_bullet.records.errors import SonicBulletError

Record = TypeVar("Record", bound=msgspec.Struct)


class _Format(msgspec.Struct):
    format: str


def write_record(path: str | os.PathLike[str], record: msgspec.Struct, *, indent: int | None = None) -> None:
    """Write a record as JSON, whole or not at all. Raises FileError."""
    text = json_bytes(record, indent=indent)
    with replace_file(path) as file:
        file.write(text if indent is not None else text + b"\n")


def read_record(
    path: str | os.PathLike[str],
    form: type[Record],
    what: str,
    error: type[SonicBulletError],
    remedy: str,
    *,
    version: str,
    most_bytes: int = 1 << 20,
) -> Record:
    """Read the record that a JSON file holds.

    Parameters
    ----------
    path : path
    form : type
        The record.
    what : str
        Name of the file's content for messages, such as "preset".
    error : type
        Exception of a file that is none, raised with ``remedy``.
    version : str
        The format that its field `format` must name.
    most_bytes : int
        Size above which it is none.

    Raises
    ------
    SonicBulletError
        As ``error``: one line that names file, key, the value found and the value wanted.
    """
    if os.path.isdir(path):
        raise error(f"cannot read {what} {path}: it is a folder", "name a file inside it")
    with reading_file(path, what, error, remedy):
        content = read_text(path, what, error, remedy, most_bytes)
        return decode_record(content, form, f"{what} {path}", error, remedy, version)


def read_text(
    path: str | os.PathLike[str], what: str, error: type[SonicBulletError], remedy: str, most_bytes: int
) -> bytes:
    """Read a file of at most that many bytes, within `reading_file`; parameters and errors as of `read_record`."""
    try:
        with open(path, "rb") as file:
            small = os.fstat(file.fileno()).st_size <= most_bytes
            content = file.read() if small else b""
    except (OSError, ValueError) as wrong:
        reason = getattr(wrong, "strerror", None) or wrong
        raise error(f"cannot read {what} {path}: {reason}", "check the path") from wrong
    if not small:
        raise error(f"{what} {path} is over {most_bytes >> 20} MiB", remedy)
    return content


def decode_record(
    content: bytes, form: type[Record], where: str, error: type[SonicBulletError], remedy: str, version: str
) -> Record:
    """Decode a record; its format is looked at first, since another's fields are others. Errors: `read_record`."""
    found = decode_json(content, _Format, where, error, remedy).format
    numbered = re.compile(r"(.*\D)([0-9]{1,9})")  # a name and a version
    there, wanted = numbered.fullmatch(found), numbered.fullmatch(version)
    if there and wanted and there[1] == wanted[1] and int(there[2]) < int(wanted[2]):
        raise error(f"{where} has format '{found}', which is no longer read", "make it anew")
    if found != version:
        what = f"{where} has format '{shorten(found)}', wanted '{version}'"
        raise error(what, "use a sonic_bullet that knows that format")
    return decode_json(content, form, where, error, remedy)


def fill_record(form: type[Record], source: object, /, **others: Any) -> Record:
    """Make a record of an object's attributes of the same names; others: fields that it has not, or has otherwise."""
    own = {name: _plain(getattr(source, name)) for name in form.__struct_fields__ if name not in others}
    return form(**own, **others)


def _plain(value: Any) -> Any:
    """Convert a scalar of numpy to what it holds, and a text to one that UTF-8 has."""
    if isinstance(value, np.generic):
        return value.item()
    return as_json_text(value) if isinstance(value, str) else value


def record_schema(form: type[msgspec.Struct], version: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a record that files of that format hold."""
    schema: dict[str, Any] = msgspec.json.decode(json_bytes(msgspec.json.schema(form)))  # its defaults as JSON has them
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": version, **schema}
