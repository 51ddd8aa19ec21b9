"""Points of a surface at which shapes are sampled: the user's own vertices, fewer of them, or more.

fewer: farthest-point sampling along the surface [Gonzalez 1985], then the triangles whose corners are nearest to three
    different points: the dual of the points' Voronoi cells
more:  the longest edge is halved, again and again [Rivara 1984]; the user's own vertices stay first, in their order

Distances go along edges (Dijkstra), so the two sides of a thin wall are far from each other. Vertices at one place are
one: STL has each as often as it has triangles there.
"""

from __future__ import annotations

import heapq

import numpy as np

from sonic_bullet.records import Array


def sample_points(vertex_m: Array, face: Array, count: int | None) -> tuple[Array, Array]:
    """Sample points (p, 3) and triangles (f, 3) of a surface; ``count`` None: its own vertices as they are."""
    if count is None or count == len(vertex_m) or not len(face):
        return vertex_m, face
    return _fewer(vertex_m, face, count) if count < len(vertex_m) else _more(vertex_m, face, count)


def _fewer(vertex_m: Array, face: Array, count: int) -> tuple[Array, Array]:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    used = np.unique(face)
    place, first, one = np.unique(vertex_m[used], axis=0, return_index=True, return_inverse=True)
    number = np.full(len(vertex_m), -1)
    number[used] = one.ravel()
    corner = number[face]
    ends = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    ends = np.unique(np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1), axis=0)
    length = np.linalg.norm(place[ends[:, 0]] - place[ends[:, 1]], axis=1)
    graph = coo_array((length, (ends[:, 0], ends[:, 1])), shape=(len(place), len(place))).tocsr()
    start = int(np.argmax(np.linalg.norm(place - place.mean(axis=0), axis=1)))
    chosen, away = [start], np.full(len(place), np.inf)
    owner = np.zeros(len(place), int)
    while True:
        from_last = dijkstra(graph, directed=False, indices=chosen[-1], limit=float(away.max()))
        nearer = from_last < away
        away[nearer], owner[nearer] = from_last[nearer], len(chosen) - 1
        farthest = int(np.argmax(away))
        if len(chosen) >= min(count, len(place)) or away[farthest] <= 0:
            break
        chosen.append(farthest)
    source = used[first[chosen]]
    order = np.argsort(source)  # in the file's own order
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cell = rank[owner[corner]]
    three = cell[(cell[:, 0] != cell[:, 1]) & (cell[:, 1] != cell[:, 2]) & (cell[:, 2] != cell[:, 0])]
    return vertex_m[source[order]], _distinct(three)


def _distinct(face: Array) -> Array:
    """Remove repeated faces of the same corners in the same sense."""
    if not len(face):
        return face
    turn = np.argmin(face, axis=1)
    return np.unique(np.take_along_axis(face, (turn[:, None] + np.arange(3)) % 3, axis=1), axis=0)


def _more(vertex_m: Array, face: Array, count: int) -> tuple[Array, Array]:
    point = [tuple(row) for row in vertex_m.tolist()]
    faces = {i: tuple(row) for i, row in enumerate(face.tolist())}
    on_edge: dict[tuple[int, int], set[int]] = {}
    heap: list[tuple[float, int, int]] = []

    def enter(i: int) -> None:
        a, b, c = faces[i]
        for edge in (_edge(a, b), _edge(b, c), _edge(c, a)):
            if edge not in on_edge:
                on_edge[edge] = set()
                length = float(np.linalg.norm(np.subtract(point[edge[0]], point[edge[1]])))
                heapq.heappush(heap, (-length, *edge))
            on_edge[edge].add(i)

    for i in faces:
        enter(i)
    following = len(faces)
    while len(point) < count and heap:
        _, a, b = heapq.heappop(heap)
        halved = on_edge.pop((a, b), set())
        if not halved:
            continue
        point.append(tuple(((np.array(point[a]) + point[b]) / 2).tolist()))
        middle = len(point) - 1
        for i in sorted(halved):
            corner = faces.pop(i)
            for edge in (_edge(corner[k], corner[(k + 1) % 3]) for k in range(3)):
                on_edge.get(edge, set()).discard(i)
            for away in (a, b):
                faces[following] = tuple(middle if x == away else x for x in corner)
                enter(following)
                following += 1
    return np.array(point), np.array([faces[i] for i in sorted(faces)], np.int32)


def _edge(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)
