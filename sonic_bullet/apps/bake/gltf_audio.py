"""KHR_audio_rigid_bodies of a document: models, materials and surfaces, each once.

    BakedModel    -> modalModels: accessors, float32; massProperties; what the draft lacks in extras.sonic_bullet
    BakedMaterial -> acousticMaterials (bulk), acousticSurfaces (finish; contact constants in extras.sonic_bullet)

[KHR_audio_rigid_bodies, draft of 2026: Accessor Requirements, Mass Properties, Acoustic Surfaces.] A finish has a
correlation length ℓ, ours goes on to 100 mm: roughness is written as the rms height of what is shorter than the
draft's own ℓ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, ExtrasForm, common_form
from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.files.gltf.gltf_writer import GLTF_TRIANGLES, GLTF_VERTICES, GltfBuffer
from sonic_bullet.files.storage.json_records import fill_record
from sonic_bullet.session.gltf_in.own_words import EXTRAS, OwnSurface, finish_entry

EXTENSION = "KHR_audio_rigid_bodies"
BULK = {
    "density": "density_kg_m3",
    "youngsModulus": "youngs_pa",
    "poissonRatio": "poisson",
    "alpha": "alpha_per_s",
    "beta": "beta_s",
}
"""The draft's names of a material's numbers -> ours."""


@dataclass(frozen=True, slots=True)
class SoundIndices:
    """Numbers of a body's model, surface and mesh in the document; None: it has none."""

    model: int | None
    surface: int | None
    mesh: int | None

    @property
    def node_entry(self) -> dict[str, int]:
        """What a node's extension says of it."""
        return _present({"modalModel": self.model, "acousticSurface": self.surface})


@dataclass(slots=True)
class GltfAudio:
    """The extension's lists, and the meshes of models, in a document with that buffer."""

    buffer: GltfBuffer
    meshes: list[dict[str, Any]] = field(default_factory=list)
    models: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)
    surfaces: list[dict[str, Any]] = field(default_factory=list)

    def add_material(self, material: BakedMaterial) -> int:
        """Write a material and its surface, both of one number, which is returned."""
        bulk = {"name": material.name} | _present({key: getattr(material, name) for key, name in BULK.items()})
        entry = {"name": material.name} | _surface_entry(material)
        for number, (other, surface) in enumerate(zip(self.materials, self.surfaces, strict=True)):
            if other == bulk and surface == entry | {"material": number}:
                return number
        self.materials.append(bulk)
        self.surfaces.append(entry | {"material": len(self.surfaces)})
        return len(self.surfaces) - 1

    def add_model(self, model: BakedModel) -> SoundIndices:
        """Write a model, its material and the mesh of its surface."""
        surface = self.add_material(model.material)
        entry, primitive = self._model_entry(model, surface)
        self.models.append(entry)
        mesh = None
        if primitive is not None:
            mesh = len(self.meshes)
            self.meshes.append({"name": model.name, "primitives": [primitive]})
        return SoundIndices(len(self.models) - 1, surface, mesh)

    def add_mesh(self, name: str, vertex_m: Any, face: Any) -> int:
        """Write a mesh of triangles; return its number."""
        primitive = {
            "attributes": {"POSITION": self.buffer.append(vertex_m, target=GLTF_VERTICES)},
            "indices": self.buffer.append(np.asarray(face).ravel(), target=GLTF_TRIANGLES),
        }
        self.meshes.append({"name": name, "primitives": [primitive]})
        return len(self.meshes) - 1

    def document(self) -> dict[str, Any]:
        """Return the extension's own object, without lists that are empty."""
        lists = {"modalModels": self.models, "acousticMaterials": self.materials, "acousticSurfaces": self.surfaces}
        return {key: entries for key, entries in lists.items() if entries}

    def _model_entry(self, model: BakedModel, material: int) -> tuple[dict[str, Any], dict[str, Any] | None]:
        """Write a model's entry, and the mesh primitive of its surface, None where it has no triangle."""
        buffer = self.buffer
        positions = buffer.append(model.point_m, target=GLTF_VERTICES)
        entry: dict[str, Any] = {
            "name": model.name,
            "frequencies": buffer.append(model.freq_hz),
            "decayRates": buffer.append(model.decay_per_s),
            "positions": positions,
            "shapes": buffer.append(model.shape.transpose(2, 0, 1).reshape(-1, 3)),
            "material": material,
        }
        primitive = None
        if len(model.face):
            entry["indices"] = buffer.append(model.face.ravel(), target=GLTF_TRIANGLES)
            primitive = {"attributes": {"POSITION": positions}, "indices": entry["indices"]}
        if model.mass is not None:
            entry["massProperties"] = mass_entry(model.mass)
        entry["extras"] = {EXTRAS: ExtrasForm(format=BAKED_FORMAT, **common_form(model))}
        return entry, primitive


def _surface_entry(material: BakedMaterial) -> dict[str, Any]:
    """Write a surface's finish, and in extras what the draft has no field for."""
    if material.roughness_m is None or material.hurst is None or material.restitution is None:
        return {}
    own = fill_record(OwnSurface, material)
    return finish_entry(own) | {"extras": {EXTRAS: own}}


def mass_entry(mass: MassProperties) -> dict[str, Any]:
    """Write mass properties by principal axes."""
    from scipy.spatial.transform import Rotation

    moment, axes = np.linalg.eigh((mass.inertia_kg_m2 + mass.inertia_kg_m2.T) / 2)
    axes = axes * np.where(np.linalg.det(axes) < 0, -1, 1)
    return {
        "mass": mass.mass_kg,
        "centerOfMass": mass.centre_m.tolist(),
        "inertiaDiagonal": np.maximum(moment, 0).tolist(),
        "inertiaOrientation": Rotation.from_matrix(axes).as_quat().tolist(),
    }


def _present(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}
