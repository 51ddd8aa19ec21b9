"""The draft's surfaces -> octaves of our rough surfaces [KHR_audio_rigid_bodies, draft of 2026, Acoustic Surfaces].

    roughness σ, correlationLength ℓ, spectralSlope p, shortWavelength λs -> records.roughness.finish_octaves
    profile, sampleSpacing -> its very heights, round and round; track_octaves of them where only heights count
    waviness, wavinessLength -> SurfaceForm
    normalTexture -> slopes along both texture axes -> heights by wavelength, added in power; scaled with the node

waviness decides how much of two faces bears: in the draft by the slope W/L, here by the curvature of the waves' crests,
on which faces rest. Its heights are swept as all others are.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote

import numpy as np

from sonic_bullet.files.gltf.checked_accessors import named_values, one_of
from sonic_bullet.files.gltf.gltf_tree import GltfTree
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.roughness import OCTAVES, WAVE_M, finish_octaves, octave_sums, track_octaves
from sonic_bullet.records.touching.surface_form import SurfaceForm

# the draft's defaults: its machined finish
DRAFT_ROUGHNESS_M = 2e-6
DRAFT_CORRELATION_M = 5e-5
DRAFT_SLOPE = -2.4
DRAFT_WAVINESS_M = 2e-6
DRAFT_WAVINESS_LENGTH_M = 2e-3


def surface_octaves(tree: GltfTree, said: Mapping[str, Any], name: str, notes: list[str]) -> tuple[Array, float]:
    """Rms heights (OCTAVES,) in m of an acoustic surface's finish, and its Hurst exponent."""
    short_share = 1 / 16

    def length(key: str, otherwise: float) -> float:
        return as_number(said.get(key, otherwise), f"{name}: {key}", "give metres above 0", above=0)

    rms, correlation = (
        length("roughness", DRAFT_ROUGHNESS_M),
        length("correlationLength", DRAFT_CORRELATION_M),
    )
    slope = as_number(said.get("spectralSlope", DRAFT_SLOPE), f"{name}: spectralSlope", "give 0 or less", most=0)
    hurst = float(np.clip(-(1 + slope) / 2, 0.01, 0.99))
    if "profile" in said:
        height = named_values(tree, said, "profile", name, "SCALAR")[:, 0]
        if len(height) < 2:
            raise tree.error(f"{name}: profile has one height", "give two at least")
        if "sampleSpacing" not in said:
            raise tree.error(f"{name}: profile without a sampleSpacing", "give metres between its heights")
        return track_octaves(height, length("sampleSpacing", 1.0)), hurst
    short = length("shortWavelength", correlation * short_share)
    if short < WAVE_M[-1] / 2**0.5:
        words = f"finishes finer than {WAVE_M[-1] * 1e6:.0f} µm are left out of what rolls and slides"
        if words not in notes:
            notes.append(words)
    return finish_octaves(rms, correlation, slope, min(short, correlation)), hurst


def surface_form(tree: GltfTree, said: Mapping[str, Any], name: str) -> SurfaceForm:
    """Waviness of an acoustic surface, and its measured track where it has one; raises RecordError."""
    waves = {"waviness_m": said.get("waviness", DRAFT_WAVINESS_M)}
    waves["waviness_length_m"] = said.get("wavinessLength", DRAFT_WAVINESS_LENGTH_M)
    if "profile" not in said:
        return SurfaceForm(**waves)
    height = named_values(tree, said, "profile", name, "SCALAR")[:, 0].astype(float)
    return SurfaceForm(**waves, track_m=height - height.mean(), track_spacing_m=said["sampleSpacing"])


def relief_octaves(
    tree: GltfTree, texture: Mapping[str, Any], mesh: Mapping[str, Any] | None, scale: float, name: str
) -> Array:
    """Find rms heights (OCTAVES,) in m of a normal map on a mesh; zeros where that has no texture coordinates."""
    along_m = None if mesh is None else _texture_sides_m(tree, mesh, int(texture.get("texCoord", 0)))
    if along_m is None:
        return np.zeros(OCTAVES)
    slopes = _slopes(tree, texture, name)
    total = np.zeros(OCTAVES)
    for axis in range(2):
        slope, side_m = slopes[axis], along_m[axis] * scale
        track = slope if axis == 0 else slope.T
        n = track.shape[1]
        power = (np.abs(np.fft.rfft(track, axis=1) / n) ** 2).mean(axis=0)
        power[1 : (n + 1) // 2] *= 2
        frequency = np.fft.rfftfreq(n, side_m / n)
        turns = 2 * np.pi * np.maximum(frequency, 1e-30)
        height = np.where(frequency > 0, power / turns**2, 0.0)  # h' = slope: H = S/(2πq)²
        total += octave_sums(frequency, height) ** 2 / 2
    return np.asarray(np.sqrt(total))


def _texture_sides_m(tree: GltfTree, mesh: Mapping[str, Any], which: int) -> Array | None:
    """Metres (2,) that one unit of either texture coordinate is long, mean by area; None without coordinates."""
    part = next((x for x in mesh.get("primitives", ()) if f"TEXCOORD_{which}" in x.get("attributes", {})), None)
    if part is None:
        return None
    vertex = tree.accessor(part["attributes"]["POSITION"]).astype(float)
    at = tree.accessor(part["attributes"][f"TEXCOORD_{which}"]).astype(float)
    index = tree.accessor(part["indices"])[:, 0] if "indices" in part else np.arange(len(vertex))
    corner, uv = vertex[index.reshape(-1, 3)], at[index.reshape(-1, 3)]
    edge, step = corner[:, 1:] - corner[:, :1], uv[:, 1:] - uv[:, :1]  # (f, 2, 3), (f, 2, 2)
    area = np.linalg.norm(np.cross(edge[:, 0], edge[:, 1]), axis=1)
    good = (np.abs(np.linalg.det(step)) > 1e-18) & (area > 0)
    if not good.any():
        return None
    along = np.linalg.norm(np.linalg.solve(step[good], edge[good]), axis=2)  # ∂x/∂(u, v)
    return np.asarray(np.average(along, axis=0, weights=area[good]))


def _slopes(tree: GltfTree, texture: Mapping[str, Any], name: str) -> Array:
    """Slopes (2, h, w) of a normal map, of height over length along u and v [glTF 2.0, sec. 3.9.3]."""
    pixels_most = 1 << 24
    from PIL import Image

    known = one_of(tree, tree.tree.get("textures", ()), texture.get("index"), f"{name}: normalTexture")
    image = one_of(tree, tree.tree.get("images", ()), known.get("source"), f"{name}: its image")
    uri = image.get("uri")
    if "bufferView" in image:
        view = tree.tree["bufferViews"][image["bufferView"]]
        start = int(view.get("byteOffset", 0))
        data = tree.buffer[view["buffer"]][start : start + int(view["byteLength"])]
    elif isinstance(uri, str) and uri.startswith("data:"):
        data = base64.b64decode(uri.split(",", 1)[1])
    else:
        data = tree.neighbour(unquote(str(uri)))
    with Image.open(io.BytesIO(data)) as picture:
        if picture.width * picture.height > pixels_most:
            raise tree.error(f"{name}: its normal map is too large", "give at most 4096 x 4096 pixels")
        colour = np.asarray(picture.convert("RGB"), float)
    normal = colour / 255 * 2 - 1
    scale = as_number(texture.get("scale", 1.0), f"{name}: scale of normalTexture", "give a number")
    up = np.maximum(normal[..., 2], 1e-3)
    return np.stack([-scale * normal[..., 0] / up, -scale * normal[..., 1] / up])
