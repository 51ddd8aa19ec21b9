"""Say whether two sides of a probe have the same values, to the bit, and by how much they differ where not.

npz, npz -> SHA-256 of names, types, shapes and bytes -> "equal" | "differs (max |Δ| 1.2e-07 in frames)"
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[np.generic]]
LONGEST_NAME = 60


def read_values(path: Path) -> Arrays:
    """Read the arrays of a probe, by name."""
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in sorted(arrays.files)}


def hash_values(values: Arrays) -> str:
    """Sum names, types, shapes and bytes with SHA-256; the file's own time stamps are not among them."""
    found = hashlib.sha256()
    for name in sorted(values):
        array = np.ascontiguousarray(values[name])
        found.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        found.update(array.tobytes())
    return found.hexdigest()


def compare_values(base: Arrays, head: Arrays) -> str:
    """Say "equal", or what differs: the largest difference of numbers, else the first thing that is not comparable."""
    if hash_values(base) == hash_values(head):
        return "equal"
    others: list[str] = []
    largest, where = -1.0, ""
    for name in sorted({*base, *head}):
        if name not in base or name not in head:
            others.append(f"'{shorten(name)}' only in {'HEAD' if name not in base else 'BASE'}")
            continue
        a, b = base[name], head[name]
        if hash_values({"": a}) == hash_values({"": b}):
            continue
        if a.dtype.str != b.dtype.str or a.dtype.kind == "U":
            others.append(describe_texts(name, a, b))
        elif a.shape != b.shape:
            others.append(f"shape of '{shorten(name)}': {a.shape}, {b.shape}")
        elif a.dtype.kind not in "fc":  # numbers of things, and bytes, in which files keep numbers: no size to state
            others.append(f"whole numbers of '{shorten(name)}'")
        else:
            delta = difference(a, b)
            if (size := float(delta.max(initial=0.0))) > largest:
                paths = base.get(name.removesuffix("numbers") + "paths of numbers", np.zeros(0))
                largest, where = size, str(paths[delta.argmax()]) if len(paths) == len(delta) else name
    said = [f"max |Δ| {largest:.3g} in '{shorten(where)}'"] if where else []
    more = f", and {len(others) - 1} more" if len(others) > 1 else ""
    return f"differs ({'; '.join([*said, *(one + more for one in others[:1])])})"


def difference(a: NDArray[np.generic], b: NDArray[np.generic]) -> NDArray[np.float64]:
    """Give |a - b|; infinity where one is a number and the other none, 0 where only signs of zero differ."""
    one, other = (np.asarray(x, complex if x.dtype.kind == "c" else float) for x in (a, b))
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        delta = np.where(same, 0.0, np.abs(one - other))
    return np.where(np.isnan(delta), np.inf, delta)


def describe_texts(name: str, a: NDArray[np.generic], b: NDArray[np.generic]) -> str:
    """Name the first text that is not in both, or the types."""
    if a.dtype.kind != "U" or b.dtype.kind != "U":
        return f"type of '{shorten(name)}': {a.dtype}, {b.dtype}"
    own, other = list(map(str, a.ravel())), list(map(str, b.ravel()))
    first = next((pair for pair in zip(own, other, strict=False) if pair[0] != pair[1]), None)
    if first is None:
        return f"{len(own)} and {len(other)} of '{shorten(name)}'"
    return f"'{shorten(first[0])}' is '{shorten(first[1])}'"


def shorten(text: str) -> str:
    """Cut a long name in its middle."""
    half = LONGEST_NAME // 2
    return text if len(text) <= LONGEST_NAME else f"{text[:half]}…{text[-half:]}"
