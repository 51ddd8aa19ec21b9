"""Changes to bytes, to JSON and to the words of a text, drawn from a `random.Random`: the same draw gives the same
file.
"""

from __future__ import annotations

import copy
import json
import random
import struct
from collections.abc import Callable
from typing import Any

NUMBERS: tuple[Any, ...] = (
    0,
    -1,
    1,
    -0.0,
    1e-320,
    5e-324,
    1e-9,
    1e9,
    1e39,
    1e300,
    1e308,
    -1e308,
    2**31 - 1,
    -(2**31),
    2**32,
    2**63,
    2**64,
    10**30,
)
LONG = "x" * 5000
NODES: tuple[Any, ...] = (
    *NUMBERS,
    None,
    True,
    "",
    LONG,
    "\u0000",
    "../" * 40,
    "\ud800",
    "é" * 3000,
    "a b " * 1500,
    [],
    {},
    [[]],
    [1e308] * 3,
    {LONG: 1},
    float("nan"),
    float("inf"),
)
WORDS: tuple[bytes, ...] = tuple(
    str(x).encode()
    for x in (
        *NUMBERS,
        "nan",
        "inf",
        "-inf",
        "0x10",
        "1e999",
        "9" * 400,
        "",
        "x" * 3000,
        "1/2/3/4",
        "//",
        "-1/-1",
        "1,5",
        "1_0",
        "٣",
    )
)
FIELDS: tuple[bytes, ...] = (
    *(struct.pack("<I", x) for x in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFFE, 1 << 20, 1 << 28)),
    *(struct.pack(">I", x) for x in (1, 0x7FFFFFFF, 1 << 20, 1 << 28)),
    *(struct.pack("<Q", x) for x in (0, 1 << 32, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)),
    *(struct.pack("<H", x) for x in (0, 1, 0x7FFF, 0xFFFF)),
    *(struct.pack(code, x) for code in ("<f", "<d", ">f") for x in (float("nan"), float("inf"), -1.0, 1e30)),
    struct.pack("<d", 1e308),
)
Mutation = Callable[[bytes, random.Random], bytes]


def flipped(data: bytes, draw: random.Random, low: int = 0, high: int | None = None) -> bytes:
    """One to eight bits turned between two places."""
    high = len(data) if high is None else high
    if high <= low:
        return data
    out = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 4, 8))):
        out[draw.randrange(low, high)] ^= 1 << draw.randrange(8)
    return bytes(out)


def overwritten(data: bytes, draw: random.Random, low: int = 0, high: int | None = None) -> bytes:
    """A field of a telling value (a huge count, NaN, -1) laid over what stood there."""
    high = len(data) if high is None else high
    field = draw.choice(FIELDS)
    if high - low < len(field):
        return data
    at = draw.randrange(low, high - len(field) + 1)
    return data[:at] + field + data[at + len(field) :]


def cut(data: bytes, draw: random.Random) -> bytes:
    return data[: draw.randrange(len(data) + 1)]


def swapped(data: bytes, draw: random.Random) -> bytes:
    """Two fields of equal length changed for one another."""
    size = draw.choice((1, 2, 4, 8, 16))
    if len(data) < 2 * size:
        return data
    one, two = sorted(draw.randrange(len(data) - size + 1) for _ in range(2))
    if two - one < size:
        return data
    return data[:one] + data[two : two + size] + data[one + size : two] + data[one : one + size] + data[two + size :]


def spliced(data: bytes, draw: random.Random) -> bytes:
    """A piece left out, doubled, or put in from elsewhere."""
    if not data:
        return data
    start = draw.randrange(len(data))
    stop = min(len(data), start + draw.choice((1, 2, 4, 16, 64, 512)))
    piece = draw.choice((b"", data[start:stop] * 2, draw.randbytes(draw.choice((1, 4, 64))), bytes(stop - start)))
    return data[:start] + piece + data[stop:]


def changed(data: bytes, draw: random.Random) -> bytes:
    """Any of the above, now and then twice."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        data = draw.choice((flipped, flipped, overwritten, overwritten, cut, swapped, spliced))(data, draw)
    return data


def reworded(data: bytes, draw: random.Random) -> bytes:
    """A text with one to three of its words, or a line, changed; what stands between words stays."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        lines = data.split(b"\n")
        row = draw.randrange(len(lines))
        words = lines[row].split(b" ")
        kind = draw.randrange(8)
        if kind < 5:
            words[draw.randrange(len(words))] = (
                draw.choice(WORDS) if draw.random() < 0.7 else draw.choice(b" ".join(lines).split() or [b""])
            )
        elif kind == 5:
            words.append(draw.choice(WORDS))
        elif kind == 6:
            words = words[: draw.randrange(len(words) + 1)]
        lines[row] = b" ".join(words)
        if kind == 7:
            lines.insert(draw.randrange(len(lines)), lines[row])
        data = b"\n".join(lines)
    return data


def restructured(value: Any, draw: random.Random) -> Any:
    """A JSON value with one to three of its nodes replaced, left out, doubled, renamed or exchanged."""
    value = json.loads(json.dumps(value))
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        places = list(_places(value))
        if not places:
            return _node(draw)
        parent, key = draw.choice(places)
        kind = draw.randrange(8)
        if kind < 4:
            parent[key] = _node(draw)
        elif kind == 4:
            del parent[key]
        elif kind == 5 and isinstance(parent, dict):
            parent[draw.choice((LONG, "", "format", str(key).upper(), f"{key}_"))] = parent.pop(key)
        elif kind == 6:
            other, there = draw.choice(places)
            parent[key], other[there] = other[there], parent[key]
            if _depth(value) is None:  # a node put into itself
                return _node(draw)
        elif isinstance(parent[key], (int, float)):
            parent[key] = parent[key] * draw.choice((-1, 0.5, 1e-12, 1e12, 1e100))
        else:
            parent[key] = [parent[key]] * draw.choice((2, 50))
    return value


def _node(draw: random.Random) -> Any:
    """One of NODES, its own copy: what is changed later must not change what another number draws."""
    return copy.deepcopy(draw.choice(NODES))


def _places(value: Any) -> list[tuple[Any, Any]]:
    """(parent, key) of every node below the root."""
    found: list[tuple[Any, Any]] = []
    wait = [value]
    while wait and len(found) < 5000:
        node = wait.pop()
        for key in node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
            found.append((node, key))
            wait.append(node[key])
    return found


def _depth(value: Any) -> int | None:
    """How deep a value is nested; None where it holds itself."""
    try:
        return len(json.dumps(value, ensure_ascii=True))
    except (ValueError, RecursionError):
        return None


def json_changed(seed: Any, draw: random.Random) -> bytes:
    """A JSON document with its structure changed, or its text, or both."""
    if draw.random() < 0.05:
        return draw.choice((b"[" * 100_000, b'{"a":' * 50_000, b"", b"null", b'"' + b"x" * 200_000, b"\xff\xfe{}"))
    text = json.dumps(restructured(seed, draw) if draw.random() < 0.85 else seed).encode()
    return changed(text, draw) if draw.random() < 0.25 else text
