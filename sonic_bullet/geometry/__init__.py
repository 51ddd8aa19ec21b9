"""Triangle surfaces and their connected components, the nearest point on one; inertia of shapes (solids)."""

from sonic_bullet.geometry.components import label_components
from sonic_bullet.geometry.nearest_point import SurfaceIndex, closest_point, nearest, surface_index
from sonic_bullet.geometry.solids import shape_volume_m3, solid_of
from sonic_bullet.geometry.triangles import (
    CREASE_RAD,
    HEAVIEST_STRUCK_KG,
    LARGEST_M,
    area_vectors_m2,
    corner_normals,
    face_areas_m2,
    face_curvature,
    inertia,
    is_closed,
    outward_normals,
    oversize,
    volume_m3,
    weld_vertices,
)

__all__ = [
    "CREASE_RAD",
    "HEAVIEST_STRUCK_KG",
    "LARGEST_M",
    "SurfaceIndex",
    "area_vectors_m2",
    "closest_point",
    "corner_normals",
    "face_areas_m2",
    "face_curvature",
    "inertia",
    "is_closed",
    "label_components",
    "nearest",
    "outward_normals",
    "oversize",
    "shape_volume_m3",
    "solid_of",
    "surface_index",
    "volume_m3",
    "weld_vertices",
]
