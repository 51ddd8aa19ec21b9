"""Triangle surfaces: areas, volumes, normals, curvature (triangles) and the nearest point on one (nearest_point)."""

from sonic_bullet.geometry.nearest_point import SurfaceIndex, closest_point, nearest, surface_index
from sonic_bullet.geometry.triangles import (
    CREASE_RAD,
    HEAVIEST_KG,
    LARGEST_M,
    corner_normals,
    face_areas_m2,
    face_curvature,
    inertia,
    is_closed,
    outward_normals,
    oversize,
    volume_m3,
    welded,
)

__all__ = [
    "CREASE_RAD",
    "HEAVIEST_KG",
    "LARGEST_M",
    "SurfaceIndex",
    "closest_point",
    "corner_normals",
    "face_areas_m2",
    "face_curvature",
    "inertia",
    "is_closed",
    "nearest",
    "outward_normals",
    "oversize",
    "surface_index",
    "volume_m3",
    "welded",
]
