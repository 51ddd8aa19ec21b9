"""What costs nothing to know of a scene and would spoil its sound: said before anything is solved.

    shapes, material, mass of each link that is to be solved -> size, density, ground that falls -> a line each
    settings of the engine                                   -> bounces that never end

`doctor` finds the same, and more, once a scene has run (`simulators.pybullet.doctor`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence

import numpy as np

from sonic_bullet.geometry import LARGEST_M, oversize, solid_of
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import DensityWarning, SizeWarning
from sonic_bullet.session.body_requests import SIZE_REMEDY, BodyRequest
from sonic_bullet.simulators.world import World

DENSITY_RATIO = 3.0
"""Of a body's mass and that of a solid of its material, from which on one of the two is not what was meant: hollow
things and rounded masses stay below, other units are at 1000."""


def warn_before_solving(world: World, wanted: Sequence[BodyRequest], stacklevel: int) -> None:
    """Warn of the links whose modes are to be computed and whose size, mass or place is hardly what was meant."""
    for category, words in _findings(world, wanted):
        warnings.warn(words, category, stacklevel=stacklevel + 1)


def _findings(world: World, wanted: Sequence[BodyRequest]) -> Iterator[tuple[type[Warning], str]]:
    odd: list[str] = []
    for one in wanted:
        if one.model is not None:
            continue
        for link, (name, shapes) in zip(one.links, one.parts, strict=True):
            solid_kg = one.material.density_kg_m3 * solid_of(shapes)[0]
            if large := oversize(_corners_m(shapes), solid_kg):
                yield SizeWarning, f"{name} {large}; {SIZE_REMEDY}"
            mass_kg = world.mass_of(one.body, link)
            if mass_kg and solid_kg > 0 and not 1 / DENSITY_RATIO <= mass_kg / solid_kg <= DENSITY_RATIO:
                odd.append(f"{name} weighs {mass_kg:.3g} kg, a solid of {one.material.name} {solid_kg:.3g} kg")
            elif mass_kg and is_ground(shapes):
                remedy = "give it mass 0, or load it with useFixedBase=True"
                yield SizeWarning, f"{name} is ground by its shape and weighs {mass_kg:.3g} kg, so it falls; {remedy}"
    if odd:
        more = f", and {len(odd) - 1} more bodies are like it" if len(odd) > 1 else ""
        yield DensityWarning, f"{odd[0]}{more}; set masses with changeDynamics, or check the scale of meshes"


def is_ground(shapes: Sequence[Shape]) -> bool:
    """Tell whether a static body is ground: a plane, flat and longer than ground_m, or larger than any struck body."""
    ground_m = 5.0  # length above which a static, flat body is ground: no board that is struck to sound is as long
    flattest = 0.5  # largest thickness of a flat body over its second side: pybullet_data's planes are 200 x 200 x 10 m
    if any(shape.kind == "plane" for shape in shapes):
        return True
    thin, middle, long = sorted(sides_m(shapes))
    return bool((long > ground_m and thin <= flattest * middle) or long > LARGEST_M)


def sides_m(shapes: Sequence[Shape]) -> Array:
    """Return the sides (3,) of the bounding box of all shapes, each in its own axes."""
    return np.asarray(np.ptp(_corners_m(shapes), axis=0)) if shapes else np.zeros(3)


def _corners_m(shapes: Sequence[Shape]) -> Array:
    """Return vertices of meshes, and corners of the boxes around other shapes, (k, 3); planes have none."""
    corners = [np.zeros((0, 3))]
    for shape in shapes:
        if shape.kind == "mesh":
            corners.append(np.asarray(shape.vertex_m))
        elif shape.kind != "plane":
            size = np.asarray(shape.size_m, float)
            half = size / 2 if shape.kind == "box" else np.array([size[0], size[0], size[0] + size[1] / 2])
            corners.append(np.array([shape.position_m - half, shape.position_m + half]))
    return np.concatenate(corners)
