"""JSON output by one encoder: strict, and the same for every command and every record.

value -> built-in types (numpy's scalars and arrays as what they hold) -> UTF-8 JSON; NaN and infinities -> null

JSON has no NaN (RFC 8259, section 6): a number that is not known is null, as in JavaScript's own `JSON.stringify`.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np


def json_bytes(value: Any, *, indent: int | None = None) -> bytes:
    """Encode a value as strict JSON.

    Parameters
    ----------
    value : dict, list, str, number, bool, None, struct, dataclass, numpy scalar or array
        What to write, nested in any way.
    indent : int, optional
        Spaces a level, with a line's end behind all; without it one line, and no end.

    Raises
    ------
    TypeError
        For what has no form in JSON, such as a function: naming its type.
    """
    text = msgspec.json.encode(value, enc_hook=_built_in)
    return text if indent is None else msgspec.json.format(text, indent=indent) + b"\n"


def as_json_text(text: str) -> str:
    """Make a text valid in JSON: lone surrogates, as undecodable names carry them, become question marks."""
    return text if text.isascii() else text.encode("utf-8", "replace").decode()


def _built_in(value: Any) -> Any:
    """Convert a numpy value to built-in types for msgspec."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} has no form in JSON")
