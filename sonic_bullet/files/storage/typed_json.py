"""Decode JSON from users to a typed form; an error names the key, the value found and the value wanted in one line.

bytes, form -> value of that form
            -> error("WHERE: recordings 1: strike: position is a list of 2, wanted a list of 3", remedy)

msgspec checks the types. Its messages hold a path and the wanted type; the value found is read from the same bytes.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from typing import Any, TypeVar

import msgspec

from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.files.storage.unread import nearest_field, shorten
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import SonicBulletError

Form = TypeVar("Form")
Key = str | int
ANY = "..."
"""Step into an object of free names, which msgspec does not name."""


def decode_json(content: bytes, form: type[Form], where: str, error: type[SonicBulletError], remedy: str) -> Form:
    """Decode JSON of a form that msgspec knows.

    Parameters
    ----------
    content : bytes
        UTF-8 JSON.
    form : type
        Struct, or any other type of msgspec.
    where : str
        Source of the content, in words with its path.
    error : type
        Exception that is raised, with ``remedy``, where it does not fit.

    Raises
    ------
    SonicBulletError
        As ``error``: one line that names the key, the value found and the value wanted.
    """
    try:
        try:
            return msgspec.json.decode(content, type=form)
        except msgspec.ValidationError as wrong:
            raise error(f"{where}{_misfit(_decode_untyped(content), form, str(wrong))}", remedy) from wrong
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
        raise error(f"{where}: {_no_json(content, wrong)}", remedy) from wrong


def convert_json(tree: Any, form: type[Form], where: str, error: type[SonicBulletError], remedy: str) -> Form:
    """Convert decoded JSON to a form, as `decode_json` does text."""
    try:
        return msgspec.convert(tree, form)
    except msgspec.ValidationError as wrong:
        raise error(f"{where}{_misfit(tree, form, str(wrong))}", remedy) from wrong


def _decode_untyped(content: bytes) -> Any:
    """Decode the JSON without a form; None where a number of it has no value."""
    try:
        return msgspec.json.decode(content)
    except msgspec.ValidationError:
        return None


def _no_json(content: bytes, wrong: Exception) -> str:
    """Describe where text is not JSON."""
    if isinstance(wrong, UnicodeDecodeError):
        return "this is no UTF-8 text"
    if isinstance(wrong, RecursionError):
        return "lists and objects are nested too deep"
    found = re.fullmatch(r"JSON is malformed: (.*) \(byte (\d+)\)", str(wrong))
    if found is None:
        return "the JSON ends too early" if content.strip() else "the file is empty, wanted JSON"
    before = content[: int(found[2])]
    line, column = before.count(b"\n") + 1, len(before) - before.rfind(b"\n")
    return f"line {line}, column {column} is no JSON ({found[1]})"


def _misfit(tree: Any, form: Any, message: str) -> str:
    """Describe a validation error: key, value found, value wanted."""
    text, _, path = message.partition(" - at `$")
    keys = _with_names(tree, form, message, [int(i) if i else name or ANY for i, name in _steps(path)])
    key = "".join(f": {shorten(k)}" if isinstance(k, str) else f" {k + 1}" for k in keys)
    kinds = list(_forms_at(msgspec.inspect.type_info(form), keys))
    if found := re.fullmatch("Object missing required field `(.*)`", text):
        return f"{key}: field '{found[1]}' is missing{_name_mistyped(tree, keys, kinds, found[1])}"
    if found := re.fullmatch("Object contains unknown field `(.*)`", text):
        known = [f.encode_name for kind in kinds if isinstance(kind, msgspec.inspect.StructType) for f in kind.fields]
        return f"{key}: field '{shorten(found[1])}' is not known{nearest_field(found[1], tuple(known))}"
    there = _there(tree, keys)
    if text.startswith("Invalid"):
        return f"{key} is {there}, wanted {' or '.join(_choices(msgspec.inspect.type_info(form), keys)) or 'another'}"
    if found := re.fullmatch("Expected (.*?)(, got .*)?", text):
        return f"{key or ': the whole'} is {there}, wanted {_describe_wanted(found[1])}"
    return f"{key}: {text[:1].lower()}{text[1:]}"


def _name_mistyped(tree: Any, keys: list[Key], kinds: list[Any], missing: str) -> str:
    """Name the field there that no form has and that was likely meant."""
    value = _value(tree, keys) if tree is not None else None
    known = {f.encode_name for kind in kinds if isinstance(kind, msgspec.inspect.StructType) for f in kind.fields}
    spare = [name for name in value if name not in known] if isinstance(value, dict) else []
    near = difflib.get_close_matches(missing, spare, n=1, cutoff=0.6)
    return f", and '{shorten(near[0])}' is not known: did you mean '{missing}'?" if near else ""


def _steps(path: str) -> Iterator[tuple[str, str]]:
    """Yield (index, "") or ("", name) for each step of a path; neither for an object's free name."""
    for step in re.finditer(r"\[(\d+)\]|\[\.\.\.\]|\.([^.\[`]+)", path):
        yield step[1] or "", step[2] or ""


def _with_names(tree: Any, form: Any, message: str, keys: list[Key]) -> list[Key]:
    """Replace free names in keys: each by the entry that, alone, is refused with the same message."""
    for at, key in enumerate(keys):
        if key != ANY or tree is None:
            continue
        holder = _value(tree, keys[:at])
        entries = dict(holder) if isinstance(holder, dict) else {}
        for name, inner in entries.items():
            holder.clear()
            holder[name] = inner
            try:
                msgspec.convert(tree, form)
            except msgspec.ValidationError as wrong:
                if str(wrong) == message:
                    keys = [*keys[:at], name, *keys[at + 1 :]]
                    break
            finally:
                holder.clear()
                holder.update(entries)
    return keys


def _value(tree: Any, keys: list[Key]) -> Any:
    """Return the value at a place; LookupError, TypeError where there is none."""
    for key in keys:
        tree = tree[key]
    return tree


def _there(tree: Any, keys: list[Key]) -> str:
    """Describe the value at a place."""
    quoted = 30  # characters of a value from the file
    try:
        value = _value(tree, keys)
    except (LookupError, TypeError):
        return "of another kind"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return f"an object of {format_count(len(value), 'field')}"
    text = json_bytes(value).decode()
    return text if len(text) <= quoted else f"{text[:quoted]}…"


def _describe_wanted(said: str) -> str:
    """Convert msgspec's words for a type and its bounds to plain ones."""
    type_words = {
        "object": "an object {…}",
        "array": "a list [...]",
        "str": "a text",
        "int": "a whole number",
        "float": "a number",
        "bool": "true or false",
        "null": "null",
    }
    bounds = {">=": "of at least", "<=": "of at most", ">": "above", "<": "below"}
    found = re.fullmatch(r"`([^`]*)`(.*)", said)
    if found is None:
        return said.replace("`", "")
    kinds, rest = found[1], found[2].strip()
    if length := re.fullmatch("of length (.*)", rest):
        return f"a list of {length[1]}"
    words = " or ".join(type_words.get(kind, kind) for kind in kinds.split(" | "))
    sign, _, bound = rest.partition(" ")
    return f"{words} {bounds[sign]} {bound.removesuffix('.0')}" if sign in bounds else f"{words} {rest}".strip()


def _forms_at(form: msgspec.inspect.Type, keys: list[Key]) -> Iterator[msgspec.inspect.Type]:
    """Yield the types that a place may have; all types of a union."""
    while isinstance(form, msgspec.inspect.Metadata):  # what a description wraps
        form = form.type
    if isinstance(form, msgspec.inspect.UnionType):
        for kind in form.types:
            yield from _forms_at(kind, keys)
        return
    if not keys:
        yield form
        return
    match form, keys[0]:
        case msgspec.inspect.StructType(fields=fields), str(name):
            for field in fields:
                if field.encode_name == name:
                    yield from _forms_at(field.type, keys[1:])
        case msgspec.inspect.DictType(value_type=kind), str():
            yield from _forms_at(kind, keys[1:])
        case ((msgspec.inspect.ListType(item_type=kind) | msgspec.inspect.VarTupleType(item_type=kind)), int()):
            yield from _forms_at(kind, keys[1:])
        case msgspec.inspect.TupleType(item_types=kinds), int(i) if i < len(kinds):
            yield from _forms_at(kinds[i], keys[1:])


def _choices(form: msgspec.inspect.Type, keys: list[Key]) -> list[str]:
    """List the values that a place may have, where its type lists them."""
    named = [json_bytes(value).decode() for kind in _forms_at(form, keys)
             if isinstance(kind, msgspec.inspect.LiteralType) for value in kind.values]  # fmt: skip
    tagged = [f'"{kind.tag}"' for kind in _forms_at(form, keys[:-1])
              if isinstance(kind, msgspec.inspect.StructType) and keys and kind.tag_field == keys[-1]]  # fmt: skip
    return named + tagged
