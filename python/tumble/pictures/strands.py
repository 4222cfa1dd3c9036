"""Hair: strands of equal count of points, and between those that were simulated as many more as the scene asks for."""

from dataclasses import dataclass

import numpy as np

from tumble.pictures.surfaces import Floats, Indices, unit
from tumble.style import Rgb

NEAR = 6
"""Neighbours of a strand among which the two others of a triangle are drawn."""

FAR = 2.0
"""Neighbours farther apart than this many times the usual distance of the last of them have nothing between them."""

SEED = 7
"""Of the places of strands between others: every picture and export has the same."""


@dataclass(frozen=True)
class Hair:
    """Strands, strands x points x 3, that taper."""

    name: str
    curves: Floats
    radii: Floats
    """Of the points of a strand."""
    color: Rgb


@dataclass(frozen=True)
class Strands:
    """Which strands there are to see: each a mean of three that were simulated."""

    points: int
    """Points of a strand."""
    guides: Indices
    """Strands that were simulated, m x 3."""
    weights: Floats
    """How much of each, m x 3; every row has the sum 1."""

    def of(self, x: Floats) -> Floats:
        """Points of all strands from those of the simulated ones, m x points x 3."""
        curves = np.asarray(x).reshape(-1, self.points, 3)
        if len(self.guides) == len(curves):
            return curves
        return np.asarray(np.einsum("mk,mkpc->mpc", self.weights, curves[self.guides]))

    def hair(self, name: str, x: Floats, radius: float, color: Rgb) -> Hair:
        """Drawables of the strands, with this radius at the roots."""
        taper = 1.0 - 0.8 * np.linspace(0.0, 1.0, self.points) ** 2
        return Hair(name, self.of(x), radius * taper, color)


def strands(x: Floats, points: int, render: int) -> Strands:
    """Strands between those whose points are at x in the first frame: `render` for each, itself among them."""
    roots = np.asarray(x, dtype=float).reshape(-1, points, 3)[:, 0]
    n = len(roots)
    own = np.repeat(np.arange(n)[:, None], 3, axis=1)
    only = np.tile([1.0, 0.0, 0.0], (n, 1))
    if render <= 1 or n < 3:
        return Strands(points, own, only)
    near, distance = _nearest(roots, min(NEAR, n - 1))
    usual = np.median(distance[:, -1])
    random = np.random.default_rng(SEED)
    first = np.tile(np.arange(n), render - 1)
    pick = np.argsort(random.random((len(first), near.shape[1])), axis=1)[:, :2]
    others = np.take_along_axis(near[first], pick, axis=1)
    far = np.take_along_axis(distance[first], pick, axis=1) > FAR * usual
    others = np.where(far, first[:, None], others)
    # Even over the triangle.
    a, b = np.sqrt(random.random(len(first))), random.random(len(first))
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    guides = np.concatenate([first[:, None], others], axis=1)
    return Strands(points, np.concatenate([own, guides]), np.concatenate([only, weights]))


def _nearest(x: Floats, k: int) -> tuple[Indices, Floats]:
    """The k nearest others of each point, and how far they are; by cells of a grid that hold some points each."""
    n = len(x)
    low, high = x.min(axis=0), x.max(axis=0)
    size = float(np.linalg.norm(high - low)) or 1.0
    # Roots lie on a surface: cells that hold about 2 k of them.
    edge = size * np.sqrt(2.0 * k / max(n, 1)) * 0.7
    near = np.zeros((n, k), dtype=np.int64)
    distance = np.full((n, k), np.inf)
    todo = np.arange(n)
    while len(todo):
        cells = np.floor((x - low) / edge).astype(np.int64) + 1
        shape = cells.max(axis=0) + 2
        key = (cells[:, 2] * shape[1] + cells[:, 1]) * shape[0] + cells[:, 0]
        order = np.argsort(key, kind="stable")
        sorted_key = key[order]
        steps = np.array(
            [(c * shape[1] + b) * shape[0] + a for c in (-1, 0, 1) for b in (-1, 0, 1) for a in (-1, 0, 1)]
        )
        left = []
        for i in todo.tolist():
            begin = np.searchsorted(sorted_key, key[i] + steps, side="left")
            end = np.searchsorted(sorted_key, key[i] + steps, side="right")
            found = np.concatenate([order[a:b] for a, b in zip(begin.tolist(), end.tolist(), strict=True)])
            d = np.linalg.norm(x[found] - x[i], axis=1)
            best = np.argsort(d, kind="stable")[: k + 1]
            best = best[found[best] != i][:k]
            # Beyond an edge, nearer ones may be in other cells.
            if (len(best) < k or d[best[-1]] > edge) and edge < size:
                left.append(i)
                continue
            near[i, : len(best)], distance[i, : len(best)] = found[best], d[best]
        todo, edge = np.array(left, dtype=np.int64), 2.0 * edge
    return near, distance


def prisms(curves: Floats, radii: Floats) -> tuple[Floats, Indices, Floats]:
    """Strands as tapering prisms of three sides: vertices, triangles and normals. `radii` are of the points of a
    strand."""
    m, n, _ = curves.shape
    tangents = unit(np.gradient(curves, axis=1))
    # A side for each point that turns with the tangent, from an axis that is the same for the whole strand.
    axis = np.eye(3)[np.argmin(np.abs(tangents.mean(axis=1)), axis=1)][:, None]
    side = unit(axis - tangents * np.sum(axis * tangents, axis=-1, keepdims=True))
    up = np.cross(tangents, side)
    angle = 2 * np.pi * np.arange(3) / 3
    out = np.cos(angle)[:, None] * side[:, :, None] + np.sin(angle)[:, None] * up[:, :, None]
    vertices = curves[:, :, None] + radii[None, :, None, None] * out
    s, i, j = np.meshgrid(np.arange(m), np.arange(n - 1), np.arange(3), indexing="ij")
    a, b = (s * n + i) * 3 + j, (s * n + i) * 3 + (j + 1) % 3
    triangles = np.concatenate([np.stack([a, b, b + 3], -1), np.stack([a, b + 3, a + 3], -1)], axis=-2)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3), out.reshape(-1, 3)
