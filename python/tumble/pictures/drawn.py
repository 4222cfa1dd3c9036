"""Drawables of renderers: meshes, spheres, tubes, strands and grounds with colours, clouds that `splats` paints over
the picture, smoke and images that `volumes` paints. They know nothing of scenes; `things` makes them of a run."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from tumble.pictures.strands import Hair, prisms
from tumble.pictures.surfaces import Floats, Indices, balls, rounded, thickened, tubes
from tumble.style import Rgb

ROUND = 8.0
"""Pixels that a side of a triangle of fabric is long, at most,"""
MOST = 150_000
"""as long as there are no more triangles than these, both sides of it counted."""

THIN = 0.8
"""Pixels that fabric is thick, at least."""


Matter = Literal["plain", "fabric", "liquid"]
"""What light meets. The colour of a liquid is that of the light that comes through."""


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles, seen from both sides."""

    name: str
    vertices: Floats
    triangles: Indices
    normals: Floats
    color: Rgb
    matter: Matter = "plain"
    thickness: float = 0.0
    """Of fabric; half of it on either side."""
    closed: bool = False
    """Whether only the side to which the normals point can be seen."""


@dataclass(frozen=True)
class Spheres:
    """Balls."""

    name: str
    centers: Floats
    radii: Floats
    color: Rgb


@dataclass(frozen=True)
class Tubes:
    """Round curves: `counts` says how many of the points each one takes."""

    name: str
    points: Floats
    counts: Indices
    radius: float
    color: Rgb


@dataclass(frozen=True)
class Ground:
    """A plane that ends out of sight."""

    name: str
    point: Floats
    normal: Floats
    color: Rgb


@dataclass(frozen=True)
class Cloud:
    """Many small balls, or lights by night, and the ways behind them."""

    name: str
    centers: Floats
    radii: Floats
    colors: Floats
    """Of each one, n x 3."""
    ways: Floats
    """Straight pieces of the ways, m x 2 x 3."""
    way_colors: Floats
    fading: Floats
    """1 for pieces that end now, 0 for those that are as old as the trail is long."""


@dataclass(frozen=True)
class Smoke:
    """An absorbing, scattering or emitting medium on a grid of cubic cells."""

    name: str
    low: Floats
    """Lowest corner."""
    spacing: float
    extinction: npt.NDArray[np.float32]
    """Share of the light that is taken away, over a length; nx x ny x nz."""
    color: Rgb
    """Share of that which is scattered."""
    emission: npt.NDArray[np.float32] | None = None
    """Light that is sent out over a length, nx x ny x nz x 3."""
    glow: npt.NDArray[np.float32] | None = None
    """Light of what hides all behind it, nx x ny x nz x 3, seen as on film. Between cells it changes by powers."""


@dataclass(frozen=True)
class Image:
    """A picture in a plane."""

    name: str
    corner: Floats
    across: Floats
    """Its lower side, and its left one."""
    up: Floats
    light: Floats
    """Colours, n x m x 3: n across, m up."""
    cover: Floats
    """How much it hides, n x m."""


Body = Mesh | Spheres | Tubes | Hair
Thing = Body | Ground | Cloud | Smoke | Image


def placed(things: list[Thing], origin: Floats, scale: float) -> list[Thing]:
    """The same things with `origin` moved to 0 and lengths divided by `scale`."""
    out: list[Thing] = []
    for t in things:
        if isinstance(t, Mesh):
            out.append(replace(t, vertices=(t.vertices - origin) / scale, thickness=t.thickness / scale))
        elif isinstance(t, Spheres):
            out.append(replace(t, centers=(t.centers - origin) / scale, radii=t.radii / scale))
        elif isinstance(t, Tubes):
            out.append(replace(t, points=(t.points - origin) / scale, radius=t.radius / scale))
        elif isinstance(t, Hair):
            out.append(replace(t, curves=(t.curves - origin) / scale, radii=t.radii / scale))
        elif isinstance(t, Cloud):
            ways = (t.ways - origin) / scale
            out.append(replace(t, centers=(t.centers - origin) / scale, radii=t.radii / scale, ways=ways))
        elif isinstance(t, Smoke):
            glow = None if t.emission is None else t.emission * np.float32(scale)
            thick = t.extinction * np.float32(scale)
            low = (t.low - origin) / scale
            out.append(replace(t, low=low, spacing=t.spacing / scale, extinction=thick, emission=glow))
        elif isinstance(t, Image):
            out.append(replace(t, corner=(t.corner - origin) / scale, across=t.across / scale, up=t.up / scale))
        else:
            out.append(replace(t, point=(t.point - origin) / scale))
    return out


def finished(thing: Mesh, pixel: float) -> Mesh:
    """Fabric, round to the size of a pixel and with its thickness; any other mesh as it is."""
    if thing.matter != "fabric" or not len(thing.triangles):
        return thing
    x, triangles = thing.vertices, thing.triangles
    corners = x[triangles]
    side = float(np.mean(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
    while side > ROUND * pixel and 8 * len(triangles) <= MOST:
        x, triangles = rounded(x, triangles)
        side /= 2
    x, triangles, n = thickened(x, triangles, max(thing.thickness, THIN * pixel))
    return replace(thing, vertices=x, triangles=triangles, normals=n)


def as_triangles(thing: Body, finer: int = 2) -> tuple[Floats, Indices, Floats]:
    """Vertices, triangles and normals of a thing, for renderers that have nothing rounder. Balls are icosahedra that
    are divided `finer` times, fewer if there are many."""
    if isinstance(thing, Mesh):
        return thing.vertices, thing.triangles, thing.normals
    if isinstance(thing, Spheres):
        many = sum(len(thing.centers) > limit for limit in (500, 5_000, 50_000))
        return balls(thing.centers, thing.radii, max(finer - many, 0))
    if isinstance(thing, Hair):
        return prisms(thing.curves, thing.radii)
    return tubes(thing.points, thing.counts, thing.radius)
