"""Triangle surfaces for pictures: smooth normals, sharp edges, tubes around curves, balls."""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

SHARP = 40.0
"""Edges that bend more than this [°] are drawn sharp on solids."""


RIM = 0.08
"""Cosine by which normals face the eye at least, at rims."""

RIM_ANGLES = (-90.0, -45.0, 0.0, 45.0, 90.0)
"""Points around the rim of cloth [°], from its lower side to its upper one."""


def unit(v: Floats) -> Floats:
    """Rows scaled to length 1; zero rows stay zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.divide(v, length, out=np.zeros_like(v), where=length > 0))


def placed(vertices: Floats, position: Floats, turn: Floats) -> Floats:
    """Points of a body at each of its places: turned by unit quaternions (x, y, z, w), n x 4, then moved, n x 3; n x m x 3."""
    axis, w = turn[:, None, :3], turn[:, None, 3:]
    t = 2.0 * np.cross(axis, np.eye(3))
    axes = np.eye(3) + w * t + np.cross(axis, t)
    return np.asarray(vertices @ axes + position[:, None], dtype=float)


def face_normals(vertices: Floats, triangles: Indices) -> Floats:
    """Normals of triangles, as long as twice their area; m x 3."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def normals(vertices: Floats, triangles: Indices) -> Floats:
    """Unit normals at vertices: the mean over the triangles around, weighted by area; n x 3."""
    faces = face_normals(vertices, triangles)
    n = len(vertices)
    total = np.empty((n, 3))
    for axis in range(3):
        total[:, axis] = np.bincount(triangles.ravel(), np.repeat(faces[:, axis], 3), n)
    return unit(total)


def split(vertices: Floats, triangles: Indices) -> tuple[Indices, Indices]:
    """Divides vertices along sharp edges.

    Returns the vertex that each new vertex is a copy of, and triangles over the new vertices. Corners of triangles
    belong together if they meet at a vertex and an edge that is not sharp leads from one to the other.
    """
    m = len(triangles)
    edges = _sides(triangles)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = np.all(edges[order][1:] == edges[order][:-1], axis=1)
    first, second = order[:-1][same], order[1:][same]
    directions = unit(face_normals(vertices, triangles))
    smooth = np.sum(directions[first // 3] * directions[second // 3], axis=1) > np.cos(np.radians(SHARP))
    if smooth.all():
        return np.arange(len(vertices)), triangles
    first, second = first[smooth], second[smooth]
    corners = triangles.ravel()
    label = np.arange(3 * m)
    # The two ends of each smooth edge, as corners of the one triangle and of the other.
    ends = [first, first // 3 * 3 + (first + 1) % 3]
    others = [second, second // 3 * 3 + (second + 1) % 3]
    pairs = []
    for end in ends:
        for other in others:
            meet = corners[end] == corners[other]
            pairs.append(np.stack([end[meet], other[meet]]))
    a, b = np.concatenate(pairs, axis=1)
    while True:
        low = np.minimum(label[a], label[b])
        before = label.copy()
        np.minimum.at(label, a, low)
        np.minimum.at(label, b, low)
        label = label[label]
        if np.array_equal(label, before):
            break
    roots, fresh = np.unique(label, return_inverse=True)
    return corners[roots], fresh.reshape(-1, 3)


def rounded(vertices: Floats, triangles: Indices) -> tuple[Floats, Indices]:
    """Each triangle as four that lie on a smooth surface through the same vertices; vertices that there were come first.

    Middles of edges are those of curved point-normal triangles; edges stay straight where the normals of their ends are
    far from those of their triangles, as beside creases. Source: [vlachos2001].
    """
    edges, edge, _ = _edges(triangles)
    ab, bc, ca = len(vertices) + edge.reshape(-1, 3).T
    a, b = vertices[edges].transpose(1, 0, 2)
    around = normals(vertices, triangles)
    n, m = around[edges].transpose(1, 0, 2)
    lift = n * np.sum((b - a) * n, axis=1, keepdims=True) + m * np.sum((a - b) * m, axis=1, keepdims=True)
    leaning = np.einsum("mkc,mc->mk", around[triangles], unit(face_normals(vertices, triangles)))
    most = np.ones(len(edges))
    np.minimum.at(most, edge, np.minimum(leaning, np.roll(leaning, -1, axis=1)).ravel())
    lift[most < np.cos(np.radians(SHARP))] = 0.0
    i, j, k = triangles.T
    parts = [(i, ab, ca), (j, bc, ab), (k, ca, bc), (ab, bc, ca)]
    return np.concatenate([vertices, 0.5 * (a + b) - lift / 8]), np.concatenate([np.stack(p, axis=1) for p in parts])


def thickened(vertices: Floats, triangles: Indices, thickness: float) -> tuple[Floats, Indices, Floats]:
    """An open surface with half of a thickness on either side and a round rim: vertices, triangles and normals. A closed
    one, whose thickness cannot be seen, as it is."""
    n = normals(vertices, triangles)
    _, edge, count = _edges(triangles)
    rim = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)[count[edge] == 1]
    if not len(rim) or not thickness > 0.0:
        return vertices, triangles, n
    # Outward at the rim: across its edges, along the surface.
    across = np.cross(vertices[rim[:, 1]] - vertices[rim[:, 0]], n[rim[:, 0]] + n[rim[:, 1]])
    ends, place = np.unique(rim, return_inverse=True)
    start, stop = place.reshape(-1, 2).T
    out = np.zeros((len(ends), 3))
    for end in (start, stop):
        np.add.at(out, end, across)
    out = unit(out)
    angles = np.radians(RIM_ANGLES)
    ring = np.sin(angles)[:, None, None] * n[ends] + np.cos(angles)[:, None, None] * out
    around = vertices[ends] + 0.5 * thickness * ring
    k, first = len(ends), 2 * len(vertices)
    strips = []
    for row in range(len(angles) - 1):
        p, q = first + row * k + start, first + row * k + stop
        strips += [np.stack([p, q, q + k], axis=1), np.stack([p, q + k, p + k], axis=1)]
    up = 0.5 * thickness * n
    shown = np.concatenate([vertices + up, vertices - up, around.reshape(-1, 3)])
    faces = np.concatenate([triangles, triangles[:, ::-1] + len(vertices), *strips])
    return shown, faces, np.concatenate([n, -n, ring.reshape(-1, 3)])


def _edges(triangles: Indices) -> tuple[Indices, Indices, Indices]:
    """Edges, n x 2; which of them each side of a triangle is; and how many triangles each has."""
    sides = _sides(triangles)
    size = int(triangles.max(initial=0)) + 1
    keys, index, count = np.unique(sides[:, 0] * size + sides[:, 1], return_inverse=True, return_counts=True)
    return np.stack([keys // size, keys % size], axis=1), index, count


def _sides(triangles: Indices) -> Indices:
    """The edges of triangles, one after the other, each from its lower vertex to its higher one."""
    return np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)


def turned(vertices: Floats, triangles: Indices, shading: Floats, eye: Floats) -> tuple[Floats, Indices, Floats]:
    """The same surface, its normals turned where they contradict what is seen from `eye`.

    At the rim of a smooth surface some triangles face the eye while the normals of their corners do not; they would
    be drawn black. Such corners become vertices of their own, with the normal that is nearest to theirs and faces
    the eye.
    """
    x = vertices[triangles]
    front = np.sign(np.sum(face_normals(vertices, triangles) * (eye - x.mean(axis=1)), axis=1))
    sight = unit(eye - x)
    seen = front[:, None] * np.sum(shading[triangles] * sight, axis=2)
    wrong = (seen < RIM) & (seen > -0.5)
    if not wrong.any():
        return vertices, triangles, shading
    t, k = np.nonzero(wrong)
    better = unit(shading[triangles[t, k]] + (front[t] * (RIM - seen[t, k]))[:, None] * sight[t, k])
    triangles = triangles.copy()
    fresh = len(vertices) + np.arange(len(t))
    source = triangles[t, k]
    triangles[t, k] = fresh
    return np.concatenate([vertices, vertices[source]]), triangles, np.concatenate([shading, better])


def outward(vertices: Floats, triangles: Indices) -> bool:
    """Whether a surface is closed and its triangles run counter-clockwise seen from outside."""
    n = len(vertices)
    from_, to = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    forth, back = np.sort(from_ * n + to), np.sort(to * n + from_)
    closed = np.array_equal(forth, back) and bool((np.diff(forth) > 0).all())
    x = (vertices - vertices.mean(axis=0))[triangles]
    return closed and float(np.sum(x[:, 0] * np.cross(x[:, 1], x[:, 2]))) > 0


def tubes(points: Floats, counts: Indices, radius: float, sides: int = 10) -> tuple[Floats, Indices, Floats]:
    """Tubes around polygonal curves, one after the other, closed by round caps: vertices, triangles and normals."""
    starts = np.concatenate([[0], np.cumsum(counts)])
    parts = [_tube(points[a:b], radius, sides) for a, b in pairwise(starts.tolist()) if b - a > 1]
    return joined(parts)


def balls(centers: Floats, radii: Floats, finer: int = 2) -> tuple[Floats, Indices, Floats]:
    """Balls as triangles, an icosahedron divided `finer` times: vertices, triangles and normals."""
    directions, faces = _icosphere(finer)
    k, n = len(directions), len(centers)
    vertices = (centers[:, None] + radii[:, None, None] * directions).reshape(-1, 3)
    triangles = (faces + k * np.arange(n)[:, None, None]).reshape(-1, 3)
    return vertices, triangles, np.tile(directions, (n, 1))


def joined(parts: list[tuple[Floats, Indices, Floats]]) -> tuple[Floats, Indices, Floats]:
    """Several surfaces as one."""
    if not parts:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3))
    offsets = np.cumsum([0] + [len(p[0]) for p in parts[:-1]])
    triangles = [p[1] + offset for p, offset in zip(parts, offsets, strict=True)]
    return np.concatenate([p[0] for p in parts]), np.concatenate(triangles), np.concatenate([p[2] for p in parts])


def _tube(line: Floats, radius: float, sides: int) -> tuple[Floats, Indices, Floats]:
    tangents = unit(np.gradient(line, axis=0))
    still = np.linalg.norm(tangents, axis=1) == 0
    tangents[still] = (0.0, 0.0, 1.0)
    # A frame carried along the curve without twisting (double reflection would be finer than pictures need).
    across = np.empty_like(line)
    side = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    for k, t in enumerate(tangents):
        side = side - t * (side @ t)
        length = np.linalg.norm(side)
        if length < 1e-6:
            side = np.eye(3)[np.argmin(np.abs(t))]
            side = side - t * (side @ t)
            length = np.linalg.norm(side)
        side = side / length
        across[k] = side
    up = np.cross(tangents, across)
    # Rings: a cap of three at either end, one at each point between.
    lean = np.radians([90, 60, 30])
    rings = np.concatenate([np.zeros(3, int), np.arange(len(line)), np.full(3, len(line) - 1)])
    tilt = np.concatenate([-lean, np.zeros(len(line)), lean[::-1]])
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.cos(angle)[None, :, None] * across[rings][:, None] + np.sin(angle)[None, :, None] * up[rings][:, None]
    direction = np.cos(tilt)[:, None, None] * circle + np.sin(tilt)[:, None, None] * tangents[rings][:, None]
    vertices = line[rings][:, None] + radius * direction
    i, j = np.meshgrid(np.arange(len(rings) - 1), np.arange(sides), indexing="ij")
    a, b = i * sides + j, i * sides + (j + 1) % sides
    triangles = np.concatenate([np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1)])
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3), direction.reshape(-1, 3)


def _icosphere(finer: int) -> tuple[Floats, Indices]:
    g = (1 + 5**0.5) / 2
    corners: list[Any] = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = "0b5 051 017 07a 0ab 159 5b4 ba2 a76 718 394 342 326 368 389 495 24b 62a 867 981"
    points = unit(np.array(corners, dtype=float))
    triangles = np.array([[int(c, 16) for c in face] for face in faces.split()])
    for _ in range(finer):
        points, triangles = rounded(points, triangles)
        points = unit(points)
    return points, triangles
