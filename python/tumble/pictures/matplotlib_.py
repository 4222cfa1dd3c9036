"""Pictures by painting shaded triangles from back to front (Matplotlib): needs nothing else installed.

Triangles are sorted by the distance of their middle, after large ones have been divided; where surfaces cut through
each other, the line of the cut is therefore ragged.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.pictures.drawn import Body, Ground, Mesh, Thing, as_triangles
from tumble.pictures.framing import Camera
from tumble.pictures.look import background, key_light, painted
from tumble.pictures.surfaces import Floats, Indices, joined, turned, unit
from tumble.style import display

FINER = 2
"""Pixels per pixel of the picture, each way, before averaging."""

RINGS = 56
"""Rings of points of the painted ground."""

LARGE = 0.05
"""Triangles with a longer edge, in pictures' widths, are divided."""

BEHIND = 0.012
"""Solids are sorted as if they were this much farther away, in pictures' widths: cloth lies on them."""

NEAR = 0.02
"""Nothing nearer to the camera is drawn."""


def draw(things: list[Thing], camera: Camera) -> npt.NDArray[np.uint8]:
    """The picture, height x width x 3. Target at the origin, camera at distance 1."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = camera.size
    figure = Figure(figsize=(width / 100, height / 100), dpi=100 * FINER, frameon=False)
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.imshow(display(background(camera.size)), extent=(0, width, height, 0), interpolation="nearest", aspect="auto")
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    for ground in (t for t in things if isinstance(t, Ground)):
        vertices, triangles, colors = painted(ground, things, camera, RINGS)
        _paint(axes, camera, vertices, triangles, colors, np.zeros(len(triangles)))
    bodies = [t for t in things if isinstance(t, Body)]
    shaded = [_shaded(t, camera) for t in bodies]
    if shaded:
        behind = [BEHIND * camera.width if isinstance(t, Mesh) and t.matter != "fabric" else 0.0 for t in bodies]
        later = np.concatenate([np.full(len(s[1]), b) for s, b in zip(shaded, behind, strict=True)])
        _paint(axes, camera, *joined(shaded), later)
    canvas.draw()
    fine = np.asarray(canvas.buffer_rgba())[: height * FINER, : width * FINER, :3].astype(float)
    mean = fine.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    return np.asarray(np.round(mean), dtype=np.uint8)


def _paint(axes: Any, camera: Camera, vertices: Floats, triangles: Indices, colors: Floats, behind: Floats) -> None:
    """Draws triangles, the farthest first, with colours that blend from vertex to vertex."""
    from matplotlib.collections import TriMesh
    from matplotlib.tri import Triangulation

    seen = camera.project(vertices)
    shown = (seen[triangles, 2] > NEAR).all(axis=1)
    triangles, behind = triangles[shown], behind[shown]
    if not len(triangles):
        return
    order = np.argsort(-seen[triangles, 2].mean(axis=1) - behind, kind="stable")
    mesh = TriMesh(Triangulation(seen[:, 0], seen[:, 1], triangles[order]))
    mesh.set_facecolor(np.c_[colors, np.ones(len(colors))])
    axes.add_collection(mesh, autolim=False)


def _shaded(thing: Body, camera: Camera) -> tuple[Floats, Indices, Floats]:
    """Vertices, triangles and colours (sRGB) of vertices of a thing, as the light falls on it."""
    vertices, triangles, normals = _divided(*as_triangles(thing), LARGE * camera.width)
    if isinstance(thing, Mesh):
        vertices, triangles, normals = turned(vertices, triangles, normals, camera.eye)
    forward = camera.axes[2]
    sight = np.broadcast_to(forward, vertices.shape) if camera.parallel else unit(vertices - camera.position)
    away = np.sum(normals * sight, axis=1)
    if isinstance(thing, Mesh) and not thing.closed:
        normals = np.where(away[:, None] > 0, -normals, normals)
    else:
        triangles = triangles[(away[triangles] < 0.2).any(axis=1)]
    right, up, _ = camera.axes
    key, rim, fill = key_light(camera), unit(right + 0.55 * forward + 0.4 * up), unit(0.2 * up - forward)
    lit = 0.36 + 0.62 * _facing(normals, key) + 0.25 * _facing(normals, rim) + 0.25 * _facing(normals, fill)
    color = display(np.array(thing.color)) * lit[:, None]
    if not (isinstance(thing, Mesh) and thing.matter == "fabric"):
        gloss = _facing(normals, unit(key - sight)) ** 40
        color = color + 0.3 * gloss[:, None]
    return vertices, triangles, np.clip(color, 0.0, 1.0)


def _facing(normals: Floats, direction: Floats) -> Floats:
    return np.asarray(np.maximum(np.sum(normals * direction, axis=1), 0.0))


def _divided(vertices: Floats, triangles: Indices, normals: Floats, longest: float) -> tuple[Floats, Indices, Floats]:
    """The same surface without long edges."""
    for _ in range(8):
        x = vertices[triangles]
        large = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1) > longest
        if not large.any() or len(triangles) > 500_000:
            break
        t = triangles[large]
        n, m = len(vertices), len(t)
        pairs = [(t[:, k], t[:, (k + 1) % 3]) for k in range(3)]
        vertices = np.concatenate([vertices, *(0.5 * (vertices[a] + vertices[b]) for a, b in pairs)])
        normals = np.concatenate([normals, *(unit(normals[a] + normals[b]) for a, b in pairs)])
        ab, bc, ca = (n + k * m + np.arange(m) for k in range(3))
        parts = [(t[:, 0], ab, ca), (t[:, 1], bc, ab), (t[:, 2], ca, bc), (ab, bc, ca)]
        triangles = np.concatenate([triangles[~large], *(np.stack(p, axis=1) for p in parts)])
    return vertices, triangles, normals
