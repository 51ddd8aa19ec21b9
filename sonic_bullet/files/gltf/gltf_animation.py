"""glTF animations of nodes: samplers, and transforms in time [Khronos, glTF 2.0, 2021, sec. 3.5.3, 3.11, C.1-C.5]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.gltf_tree import GltfTree
from sonic_bullet.records import Array

STRETCH = 1e-3
"""Relative change of a scale, or obliqueness of the axes of a transform, that is still rounding."""
REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True, slots=True, eq=False)
class Sampler:
    """Keys (k,) in s and values (k, w), or (3k, w) of a cubic spline: in-tangent, value, out-tangent of each."""

    time_s: Array
    value: Array
    interpolation: str
    turns: bool

    def at(self, time_s: Array) -> Array:
        """Interpolate (t, w) at these times, held before the first and after the last key [C.1 … C.5]."""
        key, x = self.time_s, np.clip(time_s, self.time_s[0], self.time_s[-1])
        i = np.clip(np.searchsorted(key, x + 1e-6, side="right") - 1, 0, max(len(key) - 2, 0))
        j = np.minimum(i + 1, len(key) - 1)
        width = np.maximum(key[j] - key[i], 1e-12)
        s = np.clip((x - key[i]) / width, 0, 1)[:, None]
        if self.interpolation == "CUBICSPLINE":
            knots = self.value.reshape(len(key), 3, -1)
            a, b = knots[i], knots[j]
            found = (
                (2 * s**3 - 3 * s**2 + 1) * a[:, 1] + width[:, None] * (s**3 - 2 * s**2 + s) * a[:, 2]
                + (3 * s**2 - 2 * s**3) * b[:, 1] + width[:, None] * (s**3 - s**2) * b[:, 0]
            )  # fmt: skip
        elif self.interpolation == "STEP":
            found = np.where(s >= 1, self.value[j], self.value[i])
        elif self.turns:
            found = _slerp(self.value[i], self.value[j], s)
        else:
            found = self.value[i] + s * (self.value[j] - self.value[i])
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True) if self.turns else found)


def _slerp(a: Array, b: Array, s: Array) -> Array:
    """Interpolate quaternions on the sphere [C.4], Shoemake 1985."""
    dot = (a * b).sum(axis=1, keepdims=True)
    b, dot = np.where(dot < 0, -b, b), np.minimum(np.abs(dot), 1.0)
    angle = np.arccos(dot)
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    return np.asarray(np.where(small, a + s * (b - a), (np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / sine))


def read_channels(file: GltfTree) -> dict[int, dict[str, Sampler]]:
    """Read the samplers of each animated node, of all animations; of two on one path the first counts.

    Raises the file's error.
    """
    found: dict[int, dict[str, Sampler]] = {}
    for animation in file.tree.get("animations", ()):
        for channel in animation.get("channels", ()):
            node, path = channel["target"].get("node"), channel["target"]["path"]
            if node is None or path not in REST or path in found.get(node, {}):
                continue
            sampler = animation["samplers"][channel["sampler"]]
            time_s = file.accessor(sampler["input"])[:, 0].astype(float)
            value = file.accessor(sampler["output"]).astype(float)
            how = sampler.get("interpolation", "LINEAR")
            if len(value) != len(time_s) * (3 if how == "CUBICSPLINE" else 1) or (np.diff(time_s) <= 0).any():
                raise file.error("a sampler has not one value a key, or keys out of order", file.remedy)
            if value.shape[1] != len(REST[path]):
                raise file.error(f"a sampler of {path} has values of {value.shape[1]} numbers", file.remedy)
            if not (np.isfinite(time_s).all() and np.isfinite(value).all()):
                raise file.error("a sampler holds numbers that are none", file.remedy)
            found.setdefault(node, {})[path] = Sampler(time_s, value, how, path == "rotation")
    return found


def local_transforms(node: Mapping[str, Any], own: Mapping[str, Sampler], at_s: Array) -> Array:
    """Compute the transform (t, 4, 4) of a node in its parent [3.5.3]."""
    from scipy.spatial.transform import Rotation

    if "matrix" in node and not own:
        return np.broadcast_to(np.array(node["matrix"], float).reshape(4, 4).T, (len(at_s), 4, 4))
    part = {
        path: own[path].at(at_s)
        if path in own
        else np.broadcast_to(np.array(node.get(path, rest), float), (len(at_s), len(rest)))
        for path, rest in REST.items()
    }
    made = np.zeros((len(at_s), 4, 4))
    made[:, :3, :3] = Rotation.from_quat(part["rotation"]).as_matrix() * part["scale"][:, None, :]
    made[:, :3, 3], made[:, 3, 3] = part["translation"], 1.0
    return made
