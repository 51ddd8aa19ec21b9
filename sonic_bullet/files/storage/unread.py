"""Report fields of a JSON file that its typed form does not read, so that mistyped names are found.

JSON, msgspec.Struct -> one line for each field that no struct at that place has, with the nearest known one
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Any

import msgspec

from sonic_bullet.records.counts import format_count

QUOTED = 60  # characters of a name from a file


def unread_fields(content: bytes, form: type[msgspec.Struct], where: str) -> tuple[str, ...]:
    """Return a line for each field of a JSON object that ``form`` lacks, `most` at most, and a count of others."""
    most = 20  # most lines
    lines = list(_unread(msgspec.json.decode(content), msgspec.inspect.type_info(form), where))
    more = len(lines) - most
    many = format_count(more, "more field is", "more fields are")
    return tuple(lines[:most] + ([f"{where}: {many} not known"] if more > 0 else []))


def _unread(value: Any, form: msgspec.inspect.Type, where: str) -> Iterator[str]:
    # Text fields for readers, allowed at any place of a file
    free = frozenset({"note", "source", "licence", "license"})
    match form:
        case msgspec.inspect.Metadata(type=kind):
            yield from _unread(value, kind, where)
        case msgspec.inspect.UnionType(types=kinds):
            for kind in kinds:
                yield from _unread(value, kind, where)
        case msgspec.inspect.StructType(fields=fields) if isinstance(value, dict):
            known = {field.encode_name: field.type for field in fields}
            for name, inner in value.items():
                if name in known:
                    yield from _unread(inner, known[name], f"{where}: {name}")
                elif name not in free:
                    meant = nearest_field(name, tuple(known))
                    yield f"{where}: field '{shorten(name)}' is not known and not read{meant}"
        case msgspec.inspect.DictType(value_type=kind) if isinstance(value, dict):
            for name, inner in value.items():
                yield from _unread(inner, kind, f"{where} '{shorten(name)}'")
        case msgspec.inspect.VarTupleType(item_type=kind) if isinstance(value, list):
            for i, inner in enumerate(value):
                yield from _unread(inner, kind, f"{where} {i + 1}")


def nearest_field(name: str, known: tuple[str, ...]) -> str:
    """Name the nearest known field; list all where none is similar."""
    near = difflib.get_close_matches(name[:QUOTED].lower(), known, n=1, cutoff=0.5)
    return f": did you mean '{near[0]}'?" if near else f" (known here: {', '.join(known)})"


def shorten(text: str) -> str:
    """Shorten a text from a file to one line for a message."""
    line = " ".join(text.split())
    return line if len(line) <= QUOTED else line[:QUOTED] + "…"
