"""glTF's nodes -> where each is in the world [Khronos, glTF 2.0 Specification, 2021, sec. 3.5.3].

glTF has y up, here z is up: (x, -z, y), as the scores of animations have it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.gltf_tree import GltfTree
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""World of glTF -> world with z up."""


@dataclass(frozen=True, slots=True, eq=False)
class NodePlacement:
    """A node in the world, z up: position_m (3,), turn (3, 3), scale (3,)."""

    position_m: Array
    turn: Array
    scale: Array

    @property
    def uniform(self) -> bool:
        """Whether its scale is the same along all axes."""
        uneven = 1e-4  # share by which a scale may differ between axes and be rounding
        return bool(np.ptp(self.scale) <= uneven * self.scale.max())


class Nodes:
    """The nodes of a tree, by number: names, parents, places."""

    def __init__(self, tree: GltfTree) -> None:
        self.tree = tree
        self.entry: list[Mapping[str, Any]] = list(tree.tree.get("nodes", ()))
        self.parent = {child: i for i, node in enumerate(self.entry) for child in node.get("children", ())}
        self._matrix: dict[int, Array] = {}
        self._names: dict[int, str] = {}
        taken: set[str] = set()
        for i, node in enumerate(self.entry):
            own = name = str(node.get("name") or f"node {i}")
            count = 1
            while name in taken:
                count += 1
                name = f"{own} {count}"
            taken.add(name)
            self._names[i] = name

    def name(self, index: int) -> str:
        """Its name, another's never."""
        return self._names[index]

    def extension(self, index: int, name: str) -> Mapping[str, Any]:
        """Return what an extension says of a node; empty where it says nothing."""
        found: Mapping[str, Any] = self.entry[index].get("extensions", {}).get(name, {})
        return found

    def in_scene(self) -> list[int]:
        """Numbers of the nodes of the default scene, or of all where there is none, ascending."""
        scenes = self.tree.tree.get("scenes", ())
        if not scenes:
            return list(range(len(self.entry)))
        found: set[int] = set()
        ahead = list(scenes[self.tree.tree.get("scene", 0)].get("nodes", ()))
        while ahead:
            one = ahead.pop()
            if one in found:
                continue
            if not isinstance(one, int) or not 0 <= one < len(self.entry):
                raise self.tree.error(f"node {quote(one)} of {len(self.entry)}", self.tree.remedy)
            found.add(one)
            ahead += self.entry[one].get("children", ())
        return sorted(found)

    def ancestors(self, index: int) -> Iterator[int]:
        """Those that a node hangs on, the nearest first. Raises the tree's error where it hangs on itself."""
        seen = {index}
        while index in self.parent:
            index = self.parent[index]
            if index in seen:
                raise self.tree.error("its nodes hang on themselves", self.tree.remedy)
            seen.add(index)
            yield index

    def _global(self, index: int) -> Array:
        """(4, 4) of a node, glTF's world."""
        if index not in self._matrix:
            made = np.eye(4)
            for one in (index, *self.ancestors(index)):
                made = _local(self.entry[one]) @ made
            self._matrix[index] = made
        return self._matrix[index]

    def place_node(self, index: int) -> NodePlacement:
        """Place a node in the world; raises the tree's error for a scale that is 0, negative or oblique."""
        matrix = self._global(index)
        frame = matrix[:3, :3]
        scale = np.linalg.norm(frame, axis=0)
        if not np.isfinite(matrix).all() or not scale.min() > 1e-9 or np.linalg.det(frame) <= 0:
            raise self.tree.error(f"{self.name(index)} has a scale of 0, or a negative one", "give scales above 0")
        turn = frame / scale
        if np.abs(turn.T @ turn - np.eye(3)).max() > 1e-3:
            raise self.tree.error(f"{self.name(index)} is sheared", "apply scales before turning")
        return NodePlacement(UPRIGHT @ matrix[:3, 3], UPRIGHT @ turn, scale)

    def camera_pose(self, index: int) -> tuple[Array, Array]:
        """Return place (3,) and turn (3, 3), x ahead, y left, z up, of a camera, which looks along -z [3.10]."""
        matrix = self._global(index)
        ahead, up = -UPRIGHT @ matrix[:3, 2], UPRIGHT @ matrix[:3, 1]
        left = np.cross(up, ahead)
        axes = np.stack([ahead, left, np.cross(ahead, left)], axis=1)
        length = np.linalg.norm(axes, axis=0)
        if not np.isfinite(matrix).all() or not length.min() > 0:
            raise self.tree.error(f"{self.name(index)} has a scale of 0", "give scales above 0")
        return UPRIGHT @ matrix[:3, 3], axes / length


def _local(node: Mapping[str, Any]) -> Array:
    """(4, 4) of a node in its parent."""
    from scipy.spatial.transform import Rotation

    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    made = np.eye(4)
    turn = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    made[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    made[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return made
