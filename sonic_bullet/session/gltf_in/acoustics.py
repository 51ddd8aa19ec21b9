"""KHR_audio_rigid_bodies -> materials and modal models of bodies [draft of 2026; sections in brackets].

    material: density, youngsModulus, poissonRatio, alpha, beta; its surface's octaves -> Material
    model: frequencies, decayRates, positions, shapes, indices, scaled by γ      [Node Transforms and Scale]
        ω = √((2πf)² + d²) -> ω/γ;  φ -> γ^(-3/2) φ;  d = (α + βω²)/2 anew, where α and β are known;  f = √(ω² - d²)/2π
    node's frame -> body frame                                                   -> ModalModel

The draft takes a node's scale at the start for the model's own size; its sample scenes, and what they predict, take 1
for it, and masses that go with the cube of the scale. So it is here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.checked_accessors import named_triangles, named_values, one_of
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry import volume_m3
from sonic_bullet.geometry.triangles import face_curvature, is_closed, weld_vertices
from sonic_bullet.records import Array, Material, ModalModel, Residual
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.rigid_scene import PhysicsMaterial
from sonic_bullet.records.roughness import LONGEST_M
from sonic_bullet.session.gltf_in.finishes import relief_octaves, surface_form, surface_octaves
from sonic_bullet.session.gltf_in.node_frames import Nodes
from sonic_bullet.session.gltf_in.own_words import (
    FREE,
    OwnSurface,
    own_model,
    own_surface,
    with_grain,
    without_mounting,
)
from sonic_bullet.session.gltf_in.physics import KHR_AUDIO, BodyFrame


def audio_of(nodes: Nodes) -> Mapping[str, Any]:
    """Return the document's models, materials and surfaces."""
    found: Mapping[str, Any] = nodes.tree.tree.get("extensions", {}).get(KHR_AUDIO, {})
    return found


def said_of(nodes: Nodes, index: int, colliders: list[int], notes: list[str]) -> tuple[dict[str, Any], int]:
    """Model, surface and gain of a body's node and colliders, or of the nearest ancestor that has one; whose it is."""
    found: dict[str, Any] = {}
    owner = index
    for one in (index, *colliders, *nodes.ancestors(index)):
        own = nodes.extension(one, KHR_AUDIO)
        for key in ("modalModel", "acousticSurface"):
            if key in own and key not in found:
                found[key] = own[key]
                if key == "modalModel":
                    owner = one
                    found["gain"] = own.get("gain", 1.0)
            elif key in own and own[key] != found[key] and one in colliders:
                notes.append(f"{nodes.name(index)}: {key} {own[key]} of {nodes.name(one)} is not played beside another")
    return found, owner


def material_of(
    nodes: Nodes, said: Mapping[str, Any], index: int, physics: PhysicsMaterial, notes: list[str]
) -> tuple[Material | None, Mapping[str, Any]]:
    """Make what a body's contacts are made of, None where nothing says it, and the acoustic material's own words."""
    otherwise = "steel"  # Whose elastic constants a body has that rings and does not say what it is made of
    tree, audio, name = nodes.tree, audio_of(nodes), nodes.name(index)
    surface: Mapping[str, Any] = {}
    if "acousticSurface" in said:
        surface = one_of(tree, audio.get("acousticSurfaces", ()), said["acousticSurface"], f"{name}: acousticSurface")
    number = surface.get("material")
    if number is None and "modalModel" in said:
        number = one_of(tree, audio.get("modalModels", ()), said["modalModel"], f"{name}: modalModel").get("material")
    bulk: Mapping[str, Any] = {}
    if number is not None:
        bulk = one_of(tree, audio.get("acousticMaterials", ()), number, f"{name}: material")
    if not surface and not bulk and "modalModel" not in said:
        return None, bulk
    elastic: dict[str, Any] = {key: bulk.get(key) for key in ("youngsModulus", "poissonRatio", "density")}
    if missing := [key for key, value in elastic.items() if value is None]:
        preset = load_material(otherwise)
        usual = {"youngsModulus": preset.youngs_pa, "poissonRatio": preset.poisson, "density": preset.density_kg_m3}
        elastic |= {key: usual[key] for key in missing}
        notes.append(f"{name} says no {' and no '.join(missing)}: that of {otherwise} is taken")
    called = str(surface.get("name") or f"surface of {name}")
    own = own_surface(surface)
    octaves, hurst = surface_octaves(tree, surface, called, [] if own is not None else notes)
    octaves = _with_relief(nodes, surface, index, octaves, called, notes)
    damping = [bulk.get(key) for key in ("alpha", "beta")]
    known = all(x is not None for x in damping)
    both = dict.fromkeys(str(x["name"]) for x in (bulk, surface) if x.get("name"))
    made = Material.isotropic(
        ", ".join(both) or f"material of {name}",
        youngs_pa=elastic["youngsModulus"],
        poisson=elastic["poissonRatio"],
        density_kg_m3=elastic["density"],
        alpha_per_s=damping[0] if known else None,
        beta_s=damping[1] if known else None,
        roughness_m=float(np.sqrt((octaves**2).sum())),
        hurst=hurst,
        restitution=physics.restitution,
        octave_rms_m=octaves,
        form=surface_form(tree, surface, called),
        source=f"{KHR_AUDIO} of a glTF",
    )
    return (made if own is None else _as_ours(made, own)), bulk


def _as_ours(material: Material, own: OwnSurface) -> Material:
    """Make a material that a file of ours says more of."""
    octaves = own.octave_rms_m
    return replace(
        material,
        stiffness_pa=with_grain(material, own),
        roughness_m=own.roughness_m,
        hurst=own.hurst,
        restitution=own.restitution,
        octave_rms_m=None if octaves is None else np.array(octaves),
        form=own.form,
    )


def _with_relief(
    nodes: Nodes, surface: Mapping[str, Any], index: int, octaves: Array, name: str, notes: list[str]
) -> Array:
    """Octaves with what a normal map adds, the surface's own or the render material's [Mesoscale Structure]."""
    tree, number = nodes.tree, nodes.entry[index].get("mesh")
    meshes, materials = tree.tree.get("meshes", ()), tree.tree.get("materials", ())
    mesh = None if number is None else one_of(tree, meshes, number, f"{nodes.name(index)}: mesh")
    texture = surface.get("normalTexture")
    if texture is None and mesh is not None:
        used = [part["material"] for part in mesh.get("primitives", ()) if "material" in part]
        texture = materials[used[0]].get("normalTexture") if used and used[0] < len(materials) else None
    if texture is None:
        return octaves
    scale = float(np.mean(nodes.place_node(index).scale))
    notes.append(f"{name}: its normal map is played by its spectrum, to {1e3 * LONGEST_M:.0f} mm waves")
    return np.hypot(octaves, relief_octaves(tree, texture, mesh, scale, name))


def model_of(
    nodes: Nodes,
    number: Any,
    owner: int,
    frame: BodyFrame,
    body_mass_kg: float | None,
    bulk: Mapping[str, Any],
    mounting: Mounting,
    notes: list[str],
) -> tuple[ModalModel, Residual | None]:
    """Read a node's modal model, at its scale, in its body's frame, and its residual; raises the tree's error.

    Its decays are all that the body loses but for that of its mounting.
    """
    mass_off = 0.01
    tree, audio, node = nodes.tree, audio_of(nodes), nodes.name(owner)
    entry = one_of(tree, audio.get("modalModels", ()), number, f"{node}: modalModel")
    name = str(entry.get("name") or f"model {number}")
    freq = named_values(tree, entry, "frequencies", name, "SCALAR")[:, 0]
    decay = named_values(tree, entry, "decayRates", name, "SCALAR", len(freq))[:, 0]
    point = named_values(tree, entry, "positions", name, "VEC3")
    shape = named_values(tree, entry, "shapes", name, "VEC3", len(freq) * len(point)).reshape(len(freq), len(point), 3)
    if not (freq > 0).all() or (decay < 0).any():
        raise tree.error(f"{name}: a frequency is not above 0, or a decay rate below it", tree.remedy)
    placed = nodes.place_node(owner)
    if not placed.uniform:
        raise tree.error(f"{node} rings and is scaled unevenly", "apply the scale and solve its modes anew")
    scale = float(placed.scale[0])
    face = named_triangles(tree, entry, name, len(point)) if "indices" in entry else _hull(nodes, point, name, notes)
    ours = own_model(entry, freq, decay)
    more: dict[str, Any] = {}  # by what level bends
    if ours is not None:
        modes = ours.modes
        freq, decay = np.array(modes.freq_hz), np.array(modes.decay_per_s)
        if mounting != FREE:
            freq, decay = without_mounting(freq, decay, mounting)
        if abs(scale - 1) < 1e-6:
            bent = {"bend_s2_m2": modes.bend_s2_m2, "damping_growth_s_m": modes.damping_growth_s_m}
            more = {key: np.array(values) for key, values in bent.items() if values is not None}
    freq, decay = scaled_modes(freq, decay, scale, bulk)
    own = (frame.turn.T @ placed.turn).T  # rows are vectors
    vertex = (placed.position_m + (point * scale) @ placed.turn.T - frame.centre_m) @ frame.turn
    mass, volume, face = _solid(entry, vertex, face, scale, body_mass_kg, bulk)
    stated = entry.get("massProperties", {}).get("mass")
    if body_mass_kg and stated and abs(stated * scale**3 / body_mass_kg - 1) > mass_off:
        notes.append(f"{node} weighs {body_mass_kg:.4g} kg, its model {stated * scale**3:.4g} kg: shapes stay as given")
    order = np.argsort(freq, kind="stable")
    more = {key: values[order] for key, values in more.items()}
    if more and ours is not None:
        more["damping_growth_power"] = ours.modes.damping_growth_power
    turned = shape[order].astype(float) @ own * scale**-1.5
    made = ModalModel(
        freq_hz=freq[order],
        decay_per_s=decay[order],
        shape=np.ascontiguousarray(turned.transpose(1, 2, 0), np.float32),
        vertex_m=vertex,
        face=face,
        curvature_per_m=face_curvature(vertex, face),
        volume_m3=volume,
        mass_kg=mass,
        note=f"{name} of a glTF" + (f", scaled by {scale:.4g}" if abs(scale - 1) > 1e-6 else ""),
        includes_radiation=True,
        **more,
    )
    return made, None if ours is None else ours.residual_called(name)


def scaled_modes(freq_hz: Array, decay_per_s: Array, scale: float, bulk: Mapping[str, Any]) -> tuple[Array, Array]:
    """Frequencies and decays of a body so many times as large: the module's third line."""
    if abs(scale - 1) < 1e-6:
        return freq_hz, decay_per_s
    omega = np.sqrt((2 * np.pi * freq_hz) ** 2 + decay_per_s**2) / scale
    alpha, beta = bulk.get("alpha"), bulk.get("beta")
    decay = decay_per_s if alpha is None or beta is None else (alpha + beta * omega**2) / 2
    decay = np.minimum(decay, 0.999 * omega)
    return np.sqrt(omega**2 - decay**2) / (2 * np.pi), decay


def _hull(nodes: Nodes, point: Array, name: str, notes: list[str]) -> Array:
    """Triangles (f, 3) of the hull of a model's points, which has none of its own."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        shell = ConvexHull(point)
    except (QhullError, ValueError):
        raise nodes.tree.error(f"{name} has no indices, and its points lie in a plane", "give it triangles") from None
    notes.append(f"{name} has no indices: it is touched on the hull of its points")
    face = shell.simplices.astype(np.int64)
    a, b, c = (point[face[:, k]] for k in range(3))
    inward = np.einsum("fx,fx->f", np.cross(b - a, c - a), shell.equations[:, :3]) < 0
    face[inward] = face[inward][:, ::-1]
    return np.asarray(face)


def _solid(
    entry: Mapping[str, Any],
    vertex: Array,
    face: Array,
    scale: float,
    body_mass_kg: float | None,
    bulk: Mapping[str, Any],
) -> tuple[float, float, Array]:
    """Mass and volume of a model's solid, and its faces, outward."""
    stated = entry.get("massProperties", {}).get("mass")
    mass = body_mass_kg or (None if stated is None else as_number(stated, "mass", "give kg", above=0) * scale**3)
    volume = volume_m3(vertex, face) if is_closed(weld_vertices(vertex, face)[1]) else 0.0
    if volume < 0:
        volume, face = -volume, face[:, ::-1].copy()
    density = bulk.get("density")
    if not volume and mass and density:
        volume = mass / density
    if not mass:
        mass = volume * density if density else 0.0
    return mass, volume, face
