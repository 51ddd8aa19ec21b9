"""BakedModel <-> glTF 2.0 with the draft extension KHR_audio_rigid_bodies.

    frequencies, decayRates (m,); positions (p, 3); shapes (m·p, 3) mode-major; indices (3f,)    accessors, float32
    gltf_audio writes them; a node and a mesh for each model; two nodes of one model are two bodies
    extras.sonic_bullet of a model: doubles, pressure at 1 m, contact constants, residual (baked_form.ExtrasForm)

[KHR_audio_rigid_bodies, draft of 2026: Accessor Requirements, Mass Properties, Acoustic Surfaces.] `extras` count where
they agree with the accessors to float32; where these were changed, the accessors count.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, ExtrasForm, model_of
from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.apps.bake.gltf_audio import BULK, EXTENSION, GltfAudio
from sonic_bullet.files.gltf.checked_accessors import named_triangles, named_values
from sonic_bullet.files.gltf.gltf_tree import GltfTree, read_tree
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf
from sonic_bullet.files.storage.typed_json import convert_json
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import FileError
from sonic_bullet.session.gltf_in.own_words import EXTRAS

NOT_SO_BAKED = "write it again as glTF 2.0 with that extension"


def write_gltf_models(path: str | os.PathLike[str], models: Sequence[BakedModel]) -> None:
    """Write models as a .glb or .gltf, a node each, whole or not at all. Raises FileError."""
    buffer = GltfBuffer()
    audio = GltfAudio(buffer)
    nodes: list[dict[str, Any]] = []
    for model in models:
        made = audio.add_model(model)
        shown_as = {} if made.mesh is None else {"mesh": made.mesh}
        nodes.append({"name": model.name, **shown_as, "extensions": {EXTENSION: made.node_entry}})
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "sonic_bullet"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "extensions": {EXTENSION: audio.document()},
    }
    write_gltf(path, tree | ({"meshes": audio.meshes} if audio.meshes else {}), buffer)


def read_gltf_models(path: str | os.PathLike[str]) -> tuple[BakedModel, ...]:
    """Read the models of a .gltf or .glb with KHR_audio_rigid_bodies, in its order. Raises FileError, RecordError."""
    tree = read_tree(Path(path), FileError, NOT_SO_BAKED)
    audio = tree.tree.get("extensions", {}).get(EXTENSION, {})
    found = audio.get("modalModels", ())
    if not found:
        used = ", ".join(tree.tree.get("extensionsUsed", ())) or "none"
        raise FileError(
            f"{path} holds no modal model: its extensions are {used}", f"give one with {EXTENSION}, or bake its mesh"
        )
    return tuple(_read_model(tree, audio, number) for number in range(len(found)))


def _read_model(tree: GltfTree, audio: Mapping[str, Any], number: int) -> BakedModel:
    entry = audio["modalModels"][number]
    name = str(entry.get("name") or f"model {number}")
    freq = named_values(tree, entry, "frequencies", name, "SCALAR")[:, 0]
    decay = named_values(tree, entry, "decayRates", name, "SCALAR", len(freq))[:, 0]
    point = named_values(tree, entry, "positions", name, "VEC3")
    shape = named_values(tree, entry, "shapes", name, "VEC3", len(freq) * len(point)).reshape(len(freq), len(point), 3)
    face = np.zeros((0, 3), np.int64)
    if "indices" in entry:
        face = named_triangles(tree, entry, name, len(point))
    body: dict[str, Any] = {
        "name": name, "point_m": point, "face": face, "shape": shape.transpose(1, 2, 0),
    }  # fmt: skip
    own = _extras(entry, freq, decay, name)
    if own is not None:
        return model_of(own, **body)
    return BakedModel(
        freq_hz=freq,
        decay_per_s=decay,
        material=_material(audio, entry, name),
        mass=_mass(entry.get("massProperties"), name),
        **body,
    )


def _extras(entry: Mapping[str, Any], freq_hz: Array, decay_per_s: Array, name: str) -> ExtrasForm | None:
    """Read our extras of a model, where they agree with its accessors."""
    extras = entry.get("extras")
    said = extras.get(EXTRAS) if isinstance(extras, dict) else None
    if said is None:
        return None
    form = convert_json(said, ExtrasForm, f"{name}: extras.{EXTRAS}", FileError, "bake it again, or remove that field")
    if form.format != BAKED_FORMAT:
        return None
    same = all(
        len(ours) == len(theirs) and np.array_equal(np.array(ours, np.float32), theirs.astype(np.float32))
        for ours, theirs in ((form.modes.freq_hz, freq_hz), (form.modes.decay_per_s, decay_per_s))
    )
    return form if same else None


def _material(audio: Mapping[str, Any], entry: Mapping[str, Any], name: str) -> BakedMaterial:
    index, known = entry.get("material"), audio.get("acousticMaterials", ())
    if index is None:
        return BakedMaterial()
    if not isinstance(index, int) or not 0 <= index < len(known):
        raise FileError(f"{name}: material is {quote(index)} of {len(known)}", NOT_SO_BAKED)
    it = known[index]
    numbers = {ours: it.get(theirs) for theirs, ours in BULK.items()}
    young, poisson = numbers["youngs_pa"], numbers["poisson"]
    touched = young / (1 - poisson**2) if young is not None and poisson is not None else None
    return BakedMaterial(name=str(it.get("name", "")), contact_modulus_pa=touched, **numbers)


def _mass(said: Mapping[str, Any] | None, name: str) -> MassProperties | None:
    from scipy.spatial.transform import Rotation

    if said is None:
        return None
    if "mass" not in said:
        raise FileError(f"{name}: massProperties without a mass", NOT_SO_BAKED)
    turn = Rotation.from_quat(said.get("inertiaOrientation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    moment = turn @ np.diag(np.array(said.get("inertiaDiagonal", (0.0, 0.0, 0.0)), float)) @ turn.T
    return MassProperties(said["mass"], np.array(said.get("centerOfMass", (0.0, 0.0, 0.0)), float), moment)
