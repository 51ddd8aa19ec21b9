"""Pictures by PyBullet's software renderer (TinyRenderer), in a world that holds only what is drawn.

ColouredMesh -> visual shape of its triangles, a normal a corner -> a body of mass 0, set to a pose for each picture
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.geometry.shape_surfaces import shape_triangles
from sonic_bullet.geometry.triangles import corner_normals
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError, SceneError
from sonic_bullet.simulators.pictures import Camera, ColouredMesh, PlacedLink
from sonic_bullet.simulators.pybullet import body_facts as facts
from sonic_bullet.simulators.pybullet.clients import direct_client, disconnect, links_with_shapes
from sonic_bullet.simulators.pybullet.collision_shapes import shapes_of


class PyBulletPictures:
    """`Pictures` by TinyRenderer, whose time is proportional to pixels.

    Meshes that stay still are drawn once. Of moving ones only the part of the picture that holds them is drawn, and
    merged by depth.
    """

    def __init__(self, meshes: Sequence[ColouredMesh], size: tuple[int, int], shadows: bool, still: Array) -> None:
        self._client, self._size, self._shadow = direct_client(), size, int(shadows)
        self._bodies = [self._made(mesh) for mesh in meshes]
        self._radius_m = np.array([np.linalg.norm(mesh.vertex_m, axis=1).max(initial=0) for mesh in meshes])
        # a shadow falls on still meshes, too
        self._still = still if not shadows else np.zeros(len(still), bool)
        self._backdrop: tuple[Array, Array] | None = None

    def _made(self, mesh: ColouredMesh) -> list[int]:
        """Create a body for every `faces_most` triangles."""
        # most faces of a shape: PyBullet takes 131 072 vertices, and here each face has its own three
        faces_most = 40_000
        vertex, face = reduce_triangles(mesh.vertex_m, mesh.face)
        normals, bodies = corner_normals(vertex, face), []
        for at in range(0, len(face), faces_most):
            corner, normal = vertex[face[at : at + faces_most]], normals[at : at + faces_most]
            shape = self._client.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=corner.reshape(-1, 3).tolist(),
                indices=list(range(3 * len(corner))),
                normals=normal.reshape(-1, 3).tolist(),
                rgbaColor=[*mesh.colour, 1],
            )
            if shape < 0:
                raise SceneError("PyBullet does not draw a mesh", "give it a simpler mesh")
            bodies.append(int(self._client.createMultiBody(0, -1, shape)))
        return bodies

    def picture(self, position_m: Array, quaternion_xyzw: Array, shown: Array, camera: Camera) -> Array:
        """Draw the meshes at poses (k, 3), (k, 4) where shown (k,) is True; (height, width, 3) uint8."""
        poses, whole = (position_m, quaternion_xyzw), (0, 0, *self._size)
        if not self._still.any():
            return self._draw_part(*poses, shown, camera, whole)[0]
        if self._backdrop is None:
            self._backdrop = self._draw_part(*poses, shown & self._still, camera, whole)
        made, moves = self._backdrop[0].copy(), shown & ~self._still
        x0, y0, x1, y1 = part = self._part(position_m[moves], self._radius_m[moves], camera)
        if x0 < x1 and y0 < y1:
            colours, depth = self._draw_part(*poses, moves, camera, part)
            nearer = depth < self._backdrop[1][y0:y1, x0:x1]
            made[y0:y1, x0:x1][nearer] = colours[nearer]
        return made

    def _part(self, position_m: Array, radius_m: Array, camera: Camera) -> tuple[int, int, int, int]:
        """Return left, top, right and bottom of the part of the picture that holds spheres, in whole tiles."""
        # Pixels by which the drawn part grows: the renderer allocates its memory anew for every other size
        picture_tile = 32
        width, height = self._size
        x, y, z = camera.to_camera_axes(position_m).T
        if (z <= 2 * radius_m).any():
            return 0, 0, width, height
        focal = camera.focal(height)
        # a sphere's outline reaches beyond r·f/z: by less than z/√(z²-r²) < 1.16 in angle, and off the middle once more
        wide = 1.5 * focal * radius_m / z * (1 + (x**2 + y**2) / z**2)
        across, down = width / 2 + focal * x / z, height / 2 - focal * y / z
        low = [
            (edge // picture_tile) * picture_tile
            for edge in ((across - wide).min(initial=1e9), (down - wide).min(initial=1e9))
        ]
        high = [
            -(-edge // picture_tile) * picture_tile
            for edge in ((across + wide).max(initial=-1), (down + wide).max(initial=-1))
        ]
        return (
            int(max(low[0], 0)), int(max(low[1], 0)), int(min(high[0], width)), int(min(high[1], height))
        )  # fmt: skip

    def _draw_part(
        self, position_m: Array, quaternion_xyzw: Array, shown: Array, camera: Camera, part: tuple[int, int, int, int]
    ) -> tuple[Array, Array]:
        """Draw a part of the picture: colours (height, width, 3) uint8 and depths (height, width)."""
        light = (0.4, -0.6, 1.2)
        (width, height), (x0, y0, x1, y1) = self._size, part
        far_away = (0.0, 0.0, -1e5)
        for bodies, place, turn, there in zip(
            self._bodies, position_m.tolist(), quaternion_xyzw.tolist(), shown.tolist(), strict=True
        ):
            for body in bodies:
                self._client.resetBasePositionAndOrientation(body, place if there else far_away, turn)
        away = float(np.linalg.norm(camera.target_m - camera.eye_m))
        view = self._client.computeViewMatrix(camera.eye_m.tolist(), camera.target_m.tolist(), camera.up.tolist())
        near = 0.02 * away
        right, top = near * width / 2 / camera.focal(height), near * height / 2 / camera.focal(height)
        edges = [right * (2 * x / width - 1) for x in (x0, x1)] + [top * (1 - 2 * y / height) for y in (y1, y0)]
        projection = self._client.computeProjectionMatrix(*edges, near, max(100.0 * away, 100.0))
        found = self._client.getCameraImage(
            x1 - x0,
            y1 - y0,
            view,
            projection,
            lightDirection=light,
            shadow=self._shadow,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
        )
        colours, depth = np.asarray(found[2], np.uint8), np.asarray(found[3], np.float32)
        return np.ascontiguousarray(colours.reshape(y1 - y0, x1 - x0, 4)[:, :, :3]), depth.reshape(y1 - y0, x1 - x0)

    def close(self) -> None:
        """End the client."""
        disconnect(self._client)


def reduce_triangles(vertex_m: Array, face: Array) -> tuple[Array, Array]:
    """Reduce the triangles of a surface, where it is closed."""
    import manifold3d

    size = float(np.linalg.norm(np.ptp(vertex_m, axis=0)))
    made = manifold3d.Manifold(manifold3d.Mesh(vertex_m.astype(np.float32), face.astype(np.uint32)))
    # deviation of a simplified mesh, relative to its size: less than a pixel of a picture that it fills
    deviation = 0.001
    if made.status() == manifold3d.Error.NoError and not made.is_empty():
        mesh = made.simplify(deviation * size).to_mesh()
        if len(mesh.tri_verts):
            vertex_m, face = np.asarray(mesh.vert_properties, float)[:, :3], np.asarray(mesh.tri_verts, np.int64)
    return vertex_m, face


def list_links(client_id: int) -> tuple[PlacedLink, ...]:
    """List all links that have a shape, at their present poses; without shapes that PyBullet does not report."""
    ask: Any = pybullet
    found = []
    for body, link in links_with_shapes(client_id):
        try:
            vertex, face = surface(shapes_of(client_id, body, link))
        except MeshError:
            continue
        if link < 0:
            position, turn = ask.getBasePositionAndOrientation(body, physicsClientId=client_id)
        else:
            position, turn = ask.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client_id)[:2]
        seen = [x[7] for x in ask.getVisualShapeData(body, physicsClientId=client_id) if x[1] == link]
        colour = tuple(seen[0][:3]) if seen else (0.7, 0.7, 0.7)
        name = facts.link_names(client_id, body)[link + 1]
        found.append(
            PlacedLink(body, link, name, ColouredMesh(vertex, face, colour), np.array(position), np.array(turn))
        )
    return tuple(found)


def surface(shapes: Sequence[Shape]) -> tuple[Array, Array]:
    """Join the vertices (v, 3) and faces (f, 3) of all shapes, body frame.

    Raises
    ------
    MeshError
        There are no shapes.
    """
    vertices, faces, count = [], [], 0
    for shape in shapes:
        vertex, face = shape_triangles(shape)
        turn = np.array(pybullet.getMatrixFromQuaternion(shape.quaternion_xyzw)).reshape(3, 3)
        vertices.append(vertex @ turn.T + shape.position_m)
        faces.append(face + count)
        count += len(vertex)
    if not faces:
        raise MeshError("a link without a shape", "give it one")
    return np.concatenate(vertices), np.concatenate(faces)
