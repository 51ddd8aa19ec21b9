"""BakedModel <-> glTF 2.0 with the draft extension KHR_audio_rigid_bodies.

    frequencies, decayRates (m,); positions (p, 3); shapes (m·p, 3) mode-major; indices (3f,)    accessors, float32
    massProperties, acousticMaterials (bulk), acousticSurfaces (roughness; slope of the spectrum -(1 + 2·hurst))
    a node and a mesh for each model; two nodes of one model are two bodies
    extras.sonic_bullet of a model: doubles, pressure at 1 m, contact constants, residual (baked_form.ExtrasForm)

[KHR_audio_rigid_bodies, draft of 2026: Accessor Requirements, Mass Properties, Acoustic Surfaces.] `extras` count where
they agree with the accessors to float32; where these were changed, the accessors count.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.bake.baked_form import FORMAT, ExtrasForm, common_form, model_of
from sonic_bullet.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.files.gltf.checked_accessors import named_triangles, named_values
from sonic_bullet.files.gltf.gltf_tree import GltfTree, read_tree
from sonic_bullet.files.gltf.gltf_writer import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GltfBuffer, write_gltf
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import shown
from sonic_bullet.records.errors import FileError

EXTENSION = "KHR_audio_rigid_bodies"
EXTRAS = "sonic_bullet"
REMEDY = "write it again as glTF 2.0 with that extension"
BULK = {
    "density": "density_kg_m3",
    "youngsModulus": "youngs_pa",
    "poissonRatio": "poisson",
    "alpha": "alpha_per_s",
    "beta": "beta_s",
}
"""The draft's names of a material's numbers -> ours."""


def write_gltf_models(path: str | os.PathLike[str], models: Sequence[BakedModel]) -> None:
    """Write models as a .glb or .gltf, a node each, whole or not at all. Raises FileError."""
    buffer = GltfBuffer()
    audio: dict[str, Any] = {"modalModels": [], "acousticMaterials": [], "acousticSurfaces": []}
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for number, model in enumerate(models):
        entry, primitive = _model_entry(model, buffer, number)
        audio["modalModels"].append(entry)
        bulk = {key: getattr(model.material, name) for key, name in BULK.items()}
        audio["acousticMaterials"].append({"name": model.material.name} | _present(bulk))
        audio["acousticSurfaces"].append(_surface_entry(model.material) | {"material": number})
        node: dict[str, Any] = {"name": model.name}
        if primitive is not None:
            node["mesh"] = len(meshes)
            meshes.append({"name": model.name, "primitives": [primitive]})
        node["extensions"] = {EXTENSION: {"modalModel": number, "acousticSurface": number}}
        nodes.append(node)
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "sonic_bullet"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "extensions": {EXTENSION: audio},
    }
    write_gltf(path, tree | ({"meshes": meshes} if meshes else {}), buffer)


def _present(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _surface_entry(material: BakedMaterial) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": material.name}
    if material.roughness_m:
        entry["roughness"] = material.roughness_m
    if material.hurst is not None:
        entry["spectralSlope"] = -(1 + 2 * material.hurst)
    return entry


def _model_entry(model: BakedModel, buffer: GltfBuffer, number: int) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """Write a model's entry, and the mesh primitive of its surface, None where it has no triangle."""
    positions = buffer.append(model.point_m, target=ARRAY_BUFFER)
    entry: dict[str, Any] = {
        "name": model.name,
        "frequencies": buffer.append(model.freq_hz),
        "decayRates": buffer.append(model.decay_per_s),
        "positions": positions,
        "shapes": buffer.append(model.shape.transpose(2, 0, 1).reshape(-1, 3)),
        "material": number,
    }
    primitive = None
    if len(model.face):
        entry["indices"] = buffer.append(model.face.ravel(), target=ELEMENT_ARRAY_BUFFER)
        primitive = {"attributes": {"POSITION": positions}, "indices": entry["indices"]}
    if model.mass is not None:
        entry["massProperties"] = _mass_entry(model.mass)
    entry["extras"] = {EXTRAS: ExtrasForm(format=FORMAT, **common_form(model))}
    return entry, primitive


def _mass_entry(mass: MassProperties) -> dict[str, Any]:
    from scipy.spatial.transform import Rotation

    moment, axes = np.linalg.eigh((mass.inertia_kg_m2 + mass.inertia_kg_m2.T) / 2)
    axes = axes * np.where(np.linalg.det(axes) < 0, -1, 1)
    return {
        "mass": mass.mass_kg,
        "centerOfMass": mass.centre_m.tolist(),
        "inertiaDiagonal": np.maximum(moment, 0).tolist(),
        "inertiaOrientation": Rotation.from_matrix(axes).as_quat().tolist(),
    }


def read_gltf_models(path: str | os.PathLike[str]) -> tuple[BakedModel, ...]:
    """Read the models of a .gltf or .glb with KHR_audio_rigid_bodies, in its order. Raises FileError, RecordError."""
    tree = read_tree(Path(path), FileError, REMEDY)
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
    try:
        form = msgspec.convert(said, ExtrasForm)
    except msgspec.ValidationError as error:
        raise FileError(f"{name}: extras.{EXTRAS}: {error}", "bake it again, or remove that field") from error
    if form.format != FORMAT:
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
        raise FileError(f"{name}: material is {shown(index)} of {len(known)}", REMEDY)
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
        raise FileError(f"{name}: massProperties without a mass", REMEDY)
    turn = Rotation.from_quat(said.get("inertiaOrientation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    moment = turn @ np.diag(np.array(said.get("inertiaDiagonal", (0.0, 0.0, 0.0)), float)) @ turn.T
    return MassProperties(said["mass"], np.array(said.get("centerOfMass", (0.0, 0.0, 0.0)), float), moment)
