"""Numbers that an extension's object names by accessor, held against what the extension wants of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.gltf_tree import GltfTree
from sonic_bullet.files.gltf.gltf_writer import GLTF_FLOAT32
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote


def named_values(
    tree: GltfTree,
    entry: Mapping[str, Any],
    key: str,
    name: str,
    kind: str,
    count: int | None = None,
    whole: bool = False,
) -> Array:
    """(n, width) of an accessor that an entry names by ``key``, as the draft wants it. Raises the tree's error.

    name: whose it is, in words; kind: SCALAR, VEC3; count: of how many; whole: indices.
    """
    index_types = (5123, 5125)
    index, all_of_them = entry.get(key), tree.tree.get("accessors", ())
    if index is None:
        raise tree.error(f"{name} has no {key}", tree.remedy)
    if not isinstance(index, int) or not 0 <= index < len(all_of_them):
        raise tree.error(f"{name}: {key} is accessor {quote(index)} of {len(all_of_them)}", tree.remedy)
    it = all_of_them[index]
    types = index_types if whole else (GLTF_FLOAT32,)
    if it.get("type") != kind or it.get("componentType") not in types:
        raise tree.error(
            f"{name}: {key} are {it.get('type')} of component type {it.get('componentType')}, wanted {kind} of "
            f"{' or '.join(map(str, types))}",
            tree.remedy,
        )
    found = tree.accessor(index)
    if count is not None and len(found) != count:
        raise tree.error(f"{name} has {len(found)} {key}, wanted {count}", tree.remedy)
    if not np.isfinite(found).all():
        raise tree.error(f"{name}: {key} hold numbers that are none", tree.remedy)
    return found


def named_triangles(tree: GltfTree, entry: Mapping[str, Any], name: str, points: int) -> Array:
    """(f, 3) of an entry's `indices`. Raises the tree's error."""
    index = named_values(tree, entry, "indices", name, "SCALAR", whole=True)[:, 0]
    if len(index) % 3 or index.max(initial=0) >= points:
        raise tree.error(f"{name}: indices are no triangles of its {points} points", tree.remedy)
    return index.reshape(-1, 3)


def one_of(tree: GltfTree, entries: Any, index: Any, what: str) -> Mapping[str, Any]:
    """Pick the object of that number among ``entries``; raises the tree's error."""
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
        raise tree.error(f"{what} is {quote(index)} of {len(entries)}", tree.remedy)
    found: Mapping[str, Any] = entries[index]
    return found
