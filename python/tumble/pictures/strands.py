"""Hair: strands of equal count of points, and between those that were simulated as many more as the scene asks for.

What is drawn is rooted in blue noise on the surface itself: of random points those are taken that keep a distance from
each other, which becomes smaller until there are enough. Its shape is a mean of the simulated strands that are nearest,
on the same side of the surface (hair.7).

Source: [mccool1992], [franke1980].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tumble.pictures.surfaces import Floats, Indices, face_normals, unit
from tumble.style import Rgb

NEAR = 3
"""Simulated strands of which a drawn one is a mean, at most."""

SIDE = 3.0
"""How far away the other side of an ear counts to be, over half the usual distance of simulated strands."""

DARTS = 4
"""Random points for each root that is wanted."""

WIDEST = 0.85
"""Distance of roots that is tried first, over that of a hexagonal lattice, and"""
CLOSER = 0.93
"""by how much it shrinks from one pass to the next."""

AROUND = 6
"""Neighbours of a simulated strand between which others are drawn where there is no surface to root them in,"""
COVER = 0.6
"""How far from a root of a groom others may be, over the distance of its AROUND-th neighbour: a lattice has no gaps then."""

FAR = 2.0
"""unless they are farther apart than this many times the usual distance of the last of them."""

LEAST = -0.1
"""Cosine between the normal of a surface and the strands of a groom on it, at least."""

TRIES = 1000
"""Times as many points as are wanted that are tried on a surface,"""
TRIES_NEAR = 50
"""and around a groom."""

SEED = 7
"""Of the places of strands: every picture and export has the same."""


Flags = npt.NDArray[np.bool_]

Grows = Callable[[Indices, Floats], Flags]
"""Whether hair grows at points of a surface, given corners of their triangles and shares of these."""


@dataclass(frozen=True)
class Hair:
    """Strands, strands x points x 3, that taper."""

    name: str
    curves: Floats
    radii: Floats
    """Of the points of a strand."""
    color: Rgb


@dataclass(frozen=True)
class Skin:
    """What hair grows on."""

    vertices: Floats
    """Without motion [m], n x 3."""
    start: Floats
    """In the first frame [m], n x 3."""
    triangles: Indices
    above: float = -np.inf
    """Least height of roots, without motion [m]."""
    groomed: bool = False
    """Whether hair grows only where simulated strands are near: elsewhere a groom has none."""


@dataclass(frozen=True)
class Strands:
    """Which strands there are to see: each a mean of some that were simulated, on a root of its own."""

    points: int
    """Points of a strand."""
    guides: Indices
    """Strands that were simulated, m x NEAR."""
    weights: Floats
    """How much of each, m x NEAR; every row has the sum 1."""
    corners: Indices
    """Triangle of the root, m x 3: vertices of the skin, or, where there is none, simulated strands."""
    shares: Floats
    """How much of each corner, m x 3; every row has the sum 1."""
    skinned: bool = False
    """Whether there is a skin."""

    def of(self, x: Floats, skin: Floats | None = None) -> Floats:
        """Points of all strands, m x points x 3, from those of the simulated ones and the vertices of the skin where it is."""
        curves = np.asarray(x, dtype=float).reshape(-1, self.points, 3)
        if self.skinned and skin is None:
            raise ValueError("strands on a skin need to know where it is")
        ground = skin if self.skinned and skin is not None else curves[:, 0]
        roots = np.einsum("mk,mkc->mc", self.shares, ground[self.corners])
        return np.asarray(roots[:, None] + self.mean(curves - curves[:, :1]), dtype=float)

    def mean(self, x: Floats) -> Floats:
        """The mean for all strands, m x points x 3, of what the points of the simulated ones have."""
        values = np.asarray(x, dtype=float).reshape(-1, self.points, 3)
        parts = [self.weights[:, k, None, None] * values[self.guides[:, k]] for k in range(NEAR)]
        return np.asarray(np.sum(parts, axis=0), dtype=float)

    def hair(self, name: str, curves: Floats, radius: float, color: Rgb) -> Hair:
        """Drawables of the strands, with this radius at the roots."""
        taper = 1.0 - 0.8 * np.linspace(0.0, 1.0, self.points) ** 2
        return Hair(name, curves, radius * taper, color)


def strands(x: Floats, points: int, render: int, skin: Skin | None = None) -> Strands:
    """Strands between those whose points are at x in the first frame, `render` for each; for 1 they themselves."""
    curves = np.asarray(x, dtype=float).reshape(-1, points, 3)
    roots, n = curves[:, 0], len(curves)
    if render <= 1 or n <= NEAR:
        own, only = np.repeat(np.arange(n)[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (n, 1))
        return Strands(points, own, only, own, only)
    random = np.random.default_rng(SEED)
    if skin is None:
        triangles, start, still, above = _between(roots), roots, roots, -np.inf
    else:
        triangles, start, still, above = skin.triangles, skin.start, skin.vertices, skin.above

    def high(corners: Indices, shares: Floats) -> Flags:
        return np.asarray(np.einsum("mk,mk->m", shares, still[corners, 2]) > above)

    grows: Grows = high
    groomed = skin is not None and skin.groomed
    if groomed:
        triangles, grows = _groomed(curves, start, triangles)
    tries = (TRIES_NEAR if groomed else TRIES) * DARTS * render * n
    corners, shares, area = _scattered(still, triangles, grows, (DARTS * render * n, tries), random)
    if skin is not None and len(corners) < render * n:
        # The groom is off its surface.
        return strands(x, points, render)
    if skin is None:
        area /= AROUND  # Each place is in about as many triangles.
    place = np.einsum("mk,mkc->mc", shares, start[corners])
    usual = np.sqrt(area / n)
    side = SIDE * usual * unit(face_normals(start, corners)) if skin is not None else np.zeros_like(place)
    kept = _apart(place, render * n, np.sqrt(2 / np.sqrt(3) * area / (render * n)))
    there = np.concatenate([place, side], axis=1)
    ways = SIDE * usual * unit(curves[:, 1] - roots) if skin is not None else np.zeros_like(roots)
    below = _nearest(np.concatenate([roots, ways], axis=1), there, 1, usual)[0][:, 0]
    guides, away = _nearest(there[kept], np.concatenate([roots, side[below]], axis=1), NEAR + 1, 2 * usual)
    # They fade to nothing where the next strand comes in (hair.7).
    away = np.maximum(away, 1e-9 * usual)
    weights = (np.maximum(away[:, NEAR:] - away[:, :NEAR], 1e-9 * usual) / away[:, :NEAR]) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    return Strands(points, guides[:, :NEAR], weights, corners[kept], shares[kept], skin is not None)


def _groomed(curves: Floats, vertices: Floats, triangles: Indices) -> tuple[Indices, Grows]:
    """Of the triangles of a surface those that hair may grow on between strands, and where on them it does: near a root, on
    the side to which its strand goes."""
    roots, ways = curves[:, 0], unit(curves[:, 1] - curves[:, 0])
    size = float(np.ptp(roots, axis=0).max() or 1.0)
    cover = COVER * _nearest(roots, roots, min(AROUND, len(roots) - 1) + 1, 1e-3 * size)[1][:, -1]
    # One that stands alone has no more around it than others.
    cover = np.minimum(cover, FAR * np.median(cover))
    corners, reach = vertices[triangles], float(cover.max()) or 1e-3 * size
    low, high = roots.min(axis=0) - reach, roots.max(axis=0) + reach
    near = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)

    def grows(corners: Indices, shares: Floats) -> Flags:
        i, j, away = _pairs(np.einsum("mk,mkc->mc", shares, vertices[corners]), roots, reach)
        along = np.sum(unit(face_normals(vertices, corners))[i] * ways[j], axis=1)
        good = np.zeros(len(corners), dtype=bool)
        good[i[(away <= cover[j]) & (along > LEAST)]] = True
        return good

    return triangles[near], grows


def _between(roots: Floats) -> Indices:
    """Triangles between each root and pairs of its neighbours."""
    k = min(AROUND, len(roots) - 1)
    near, distance = _nearest(roots, roots, k + 1, 1e-3 * float(np.ptp(roots, axis=0).max() or 1.0))
    near, distance = near[:, 1:], distance[:, 1:]
    near = np.where(distance > FAR * np.median(distance[:, -1]), np.arange(len(roots))[:, None], near)
    a, b = np.triu_indices(k, 1)
    own = np.broadcast_to(np.arange(len(roots))[:, None], near[:, a].shape)
    return np.stack([own, near[:, a], near[:, b]], axis=-1).reshape(-1, 3)


def _scattered(
    vertices: Floats, triangles: Indices, grows: Grows, counts: tuple[int, int], random: np.random.Generator
) -> tuple[Indices, Floats, float]:
    """Random points on a surface where it `grows`, as many on each part as it is large: corners of their triangles, shares
    of these, and the area [m²] that they are on. `counts` are how many are wanted and how many are tried at most."""
    count, most = counts
    areas = 0.5 * np.linalg.norm(face_normals(vertices, triangles), axis=1)
    corners, shares = np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3))
    tried = 0
    while len(triangles) and len(corners) < count and tried < most:
        t = (
            random.choice(len(triangles), count, p=areas / areas.sum())
            if areas.any()
            else np.arange(count) % len(areas)
        )
        a, b = np.sqrt(random.random(count)), random.random(count)
        share = np.stack([1 - a, a * (1 - b), a * b], axis=1)
        good = grows(triangles[t], share)
        tried += count
        corners, shares = np.concatenate([corners, triangles[t][good]]), np.concatenate([shares, share[good]])
    area = float(areas.sum()) * len(corners) / max(tried, 1)
    return corners[:count], shares[:count], area


def _apart(x: Floats, count: int, lattice: float) -> Indices:
    """Rows of `count` points that keep as far from each other as they can, of many at random; `lattice` is how far apart
    they would be on a hexagonal one."""
    reach = WIDEST * lattice
    i, j, distance = _pairs(x, x, reach)
    forth = i < j  # Of two points that are too close the one that comes first is taken.
    i, j, distance = i[forth], j[forth], distance[forth]
    free, taken = np.ones(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    while (short := count - int(taken.sum())) > 0 and reach > 0:
        close = distance < reach
        a, b = i[close], j[close]
        free = ~taken
        for one, other in ((a, b), (b, a)):
            free[other[taken[one]]] = False
        chosen = np.zeros(len(x), dtype=bool)
        while free.any():
            both = free[a] & free[b]
            a, b = a[both], b[both]
            first = free.copy()
            first[b] = False
            chosen |= first
            free &= ~first
            free[b[first[a]]] = False
        taken[np.flatnonzero(chosen)[:short]] = True
        reach = CLOSER * reach if reach > 0.2 * lattice else 0.0
    if short > 0:
        taken[np.flatnonzero(~taken)[:short]] = True
    return np.flatnonzero(taken)


def _nearest(x: Floats, y: Floats, k: int, reach: float) -> tuple[Indices, Floats]:
    """The k points of y that are nearest to each point of x, and how far they are; `reach` is about how far."""
    near, distance = np.zeros((len(x), k), dtype=np.int64), np.full((len(x), k), np.inf)
    todo = np.arange(len(x))
    while len(todo):
        i, j, d = _pairs(x[todo], y, reach)
        order = np.lexsort((d, i))
        i, j, d = i[order], j[order], d[order]
        found = np.bincount(i, minlength=len(todo))
        enough = found >= min(k, len(y))
        begin = np.cumsum(found) - found
        rows = begin[enough][:, None] + np.arange(min(k, len(y)))
        near[todo[enough], : rows.shape[1]], distance[todo[enough], : rows.shape[1]] = j[rows], d[rows]
        todo, reach = todo[~enough], 2 * reach
    return near, distance


def _pairs(x: Floats, y: Floats, reach: float) -> tuple[Indices, Indices, Floats]:
    """All pairs of points of x and of y that are no farther apart than `reach`: their rows, and how far they are. Of more
    than three numbers of a point the first three say where it is; all count for the distance."""
    low = np.minimum(x[:, :3].min(axis=0), y[:, :3].min(axis=0))
    here, there = (np.floor((p[:, :3] - low) / reach).astype(np.int64) + 1 for p in (x, y))
    shape = np.maximum(here.max(axis=0), there.max(axis=0)) + 2
    stride = np.array([1, shape[0], shape[0] * shape[1]])
    first, order = (np.argsort(cells @ stride, kind="stable") for cells in (here, there))
    asked, keys = (here @ stride)[first], (there @ stride)[order]
    parts = []
    for step in np.stack(np.meshgrid(*3 * [[-1, 0, 1]]), axis=-1).reshape(-1, 3) @ stride:
        begin, end = (np.searchsorted(keys, asked + step, side) for side in ("left", "right"))
        many = end - begin
        i = np.repeat(first, many)
        j = order[np.arange(len(i)) + np.repeat(begin - (np.cumsum(many) - many), many)]
        distance = np.linalg.norm(x[i] - y[j], axis=1)
        near = distance <= reach
        parts.append((i[near], j[near], distance[near]))
    i, j, distance = (np.concatenate(p) for p in zip(*parts, strict=True))
    return i, j, distance


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
