"""Visible content of a run: its objects, and for each frame what renderers draw of them (`drawn`).

Ropes and anchors become tubes, sheets, blocks and nets meshes, all bodies of an object one mesh, floors
grounds; particles spheres, or, where many come and go, a cloud that `splats` paints over the picture; what lies on grids smoke
or an image that `volumes` paints. Where a link broke, triangle or rope is left out (if `link_strain` is an output column).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tumble import grids
from tumble._engine import ExportError
from tumble.columns import FOG, SIGNED
from tumble.grids import Box
from tumble.looks import CELLS, DRAWN_ON, GLOWING, MAPS, MASSES, SHADE, SHOWN, SOLID, SPRING, TRAIL, Looks
from tumble.pictures.blackbody import developed, glow
from tumble.pictures.drawn import Cloud, Ground, Image, Matter, Mesh, Smoke, Spheres, Thing, Tubes
from tumble.pictures.strands import Skin, Strands, strands
from tumble.pictures.surfaces import Floats, Indices, normals, outward, placed, split
from tumble.style import Rgb, linear

Array = npt.NDArray[Any]
Columns = Mapping[str, Mapping[str, Array]]
"""Object name -> column name -> array."""


class Recording(Protocol):
    """Interface of a run for pictures, films, plots and exports."""

    @property
    def folder(self) -> Path:
        """Folder of the run."""

    @property
    def scene(self) -> Mapping[str, Any]:
        """The resolved scene."""

    @property
    def looks(self) -> Looks:
        """How its objects are drawn."""

    @property
    def static(self) -> Columns:
        """Constant columns: triangles, links, curve, radius; position of colliders [m]."""

    @property
    def n_frames(self) -> int:
        """Frames there are; frame 0 is the start."""

    @property
    def ledger(self) -> Mapping[str, Array]:
        """Books, one row per frame."""

    def frame(self, i: int) -> Columns:
        """Columns of a frame."""

    def time(self, i: int) -> float:
        """Time of a frame [s]."""


@dataclass(frozen=True)
class Object:
    """A thing that the scene names: its look, and what does not change of it."""

    name: str
    form: str
    color: Rgb
    radius: float = 0.01
    """Radius in pictures [m], of points and curves."""
    trail: float = 0.0
    """How much of the way behind points is drawn [s]."""
    few: bool = False
    """Whether it is drawn thicker."""
    leap: float = float("inf")
    """A step farther than this [m] is none: the point has left a square that repeats itself on the other side."""
    triangles: Indices = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    texture: Array | None = None
    """Texture coordinates of the corners of triangles, 3 m x 2, if there are some."""
    links: Indices = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    curve: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    strands: Strands | None = None
    """Hair: the curves that are drawn,"""
    skin: str | None = None
    """and the collider that they are rooted in."""
    position: Floats | None = None
    """Vertices [m] of what does not move."""
    vertices: Floats | None = None
    """Vertices of the mesh that all bodies of an object have [m], in the axes of each."""
    plane: tuple[Floats, Floats] | None = None
    """A point and the unit normal of a ground."""
    grid: Box | None = None
    """Its grid, if any."""


MANY = 2_000
"""An object of more particles than these is drawn as a cloud."""

FINER = 0.6
"""Particles of clouds may be this much thinner than the thinnest."""

DENSE = 0.5
"""A density that is nowhere less than this part of its largest is that of the fluid itself, not of smoke in it."""

LOOKED_AT = 9
"""Frames at which the range of what lies on a grid is taken, at most."""

EXPOSURE = 60.0
"""Light of soot at the highest temperature of a run that hides all behind it; 1 is nearly white."""

BURNING = 0.3
"""Optical depth of a gas that glows, over that of one that does not: flames are seen through."""

THICK = 40.0
"""Optical depth of the thickest smoke of a run across its whole box, the mean of its sides."""

DEEP = 6.0
"""Optical depth, along the view, of the smoke of a run where most of it is in a row, at most."""

BROAD = 0.9
"""Share of the rows with smoke in them that are no deeper than that."""

USUAL = 0.98
"""Share of the cells of a frame that are no farther from rest than the ends of the map of colours,"""

PEAK = 0.1
"""which are no nearer than this share of the farthest."""

SOOT: Rgb = (0.02, 0.02, 0.025)
"""Colour of soot in a plane, where it does not glow."""

DYE = 3.0
"""Optical depth of the thickest dye in a plane."""

THICKER = 3
"""An object of few masses is drawn at least this many times as thick as the thinnest."""

ROOM = 1.8
"""Thickness of a surface over its distance from colliders, at most: they do not show through it."""

HAIR = 0.3
"""Radius of the thinnest strand, over that of the thinnest of other things."""


def objects(run: Recording) -> list[Object]:
    """The objects of a run, in its order; of hair without the curves that are drawn (`with_hair`)."""
    found: list[Object] = []
    for look in run.looks.objects:
        columns = run.static.get(look.object, {})
        found.append(
            Object(
                name=look.object,
                form=look.form,
                color=look.color,
                radius=look.radius,
                trail=look.trail,
                few=look.few,
                leap=float("inf") if look.leap is None else look.leap,
                triangles=_indices(columns, "triangles", 3),
                texture=np.asarray(columns["texture"]).reshape(-1, 2) if "texture" in columns else None,
                links=_indices(columns, "links", 2),
                curve=_indices(columns, "curve", 1).ravel(),
                position=np.asarray(columns["position"], dtype=float).reshape(-1, 3) if "position" in columns else None,
                vertices=np.asarray(columns["vertices"], dtype=float).reshape(-1, 3) if "vertices" in columns else None,
                plane=None if look.plane is None else (np.array(look.plane[0]), np.array(look.plane[1])),
                grid=grids.box(columns) if look.form in CELLS else None,
            )
        )
    return found


def with_hair(run: Recording, found: list[Object]) -> list[Object]:
    """The objects of a run, hair with the curves that are drawn."""
    start = run.frame(0) if run.n_frames else {}
    words = {str(h.get("name")): h for h in run.scene.get("hair", ())}
    known = {o.name: o for o in found}
    out = []
    for thing, look in zip(found, run.looks.objects, strict=True):
        per_strand = int(np.ravel(run.static.get(thing.name, {}).get("curve_points", 0))[0])
        if per_strand > 0 and "position" in start.get(thing.name, {}):
            own = words.get(thing.name, {})
            ground = known.get(str(own.get("on")))
            skin = None
            if ground is not None and ground.position is not None and len(ground.triangles) and look.strands > 1:
                above = own.get("above")
                now = carried(ground, start, ground.position)
                skin = Skin(
                    ground.position,
                    now,
                    ground.triangles,
                    -np.inf if above is None else float(above),
                    groomed=own.get("guides") is not None,
                )
            drawn = strands(positions(start, thing), per_strand, look.strands, skin)
            thing = replace(thing, strands=drawn, skin=None if ground is None or skin is None else ground.name)
        out.append(thing)
    return out


def hair(thing: Object, found: list[Object], columns: Columns) -> Floats:
    """Points of all strands [m] of hair in a frame, m x points x 3."""
    assert thing.strands is not None
    skin = next(
        (carried(o, columns, o.position) for o in found if o.name == thing.skin and o.position is not None), None
    )
    return thing.strands.of(positions(columns, thing), skin)


def moving(found: list[Object]) -> list[Object]:
    """Those whose positions are in the frames."""
    return [o for o in found if o.form in MASSES]


def positions(columns: Columns, thing: Object) -> Floats:
    """Positions [m] of an object in a frame, n x 3. Raises ExportError if the run did not keep them."""
    column = columns.get(thing.name, {}).get("position")
    if column is None:
        raise ExportError(f'"{thing.name}" has no positions in this run: add "position" to output.columns of the scene')
    return np.asarray(column, dtype=float).reshape(-1, 3)


def turns(columns: Columns, thing: Object) -> Floats:
    """Turns of the bodies of an object in a frame, unit quaternions x, y, z, w; n x 4."""
    return np.asarray(columns[thing.name]["turn"], dtype=float).reshape(-1, 4)


def torn(columns: Columns, thing: Object) -> Indices | None:
    """Triangles of a surface that tears, or of a liquid's, as they are in a frame, m x 3; None for any other, whose
    triangles stay."""
    column = columns.get(thing.name, {}).get("triangles")
    return None if column is None else np.asarray(column, dtype=np.int64).reshape(-1, 3)


def carried(thing: Object, columns: Columns, x: Floats) -> Floats:
    """Points [m] of a collider where it is in a frame: its own vertices, or turned and moved as a whole."""
    own = columns.get(thing.name, {})
    if "position" in own and thing.plane is None:
        x = np.asarray(own["position"], dtype=float).reshape(-1, 3)
    if "turn" not in own:
        return x
    turn, shift = (np.asarray(own[name], dtype=float).reshape(1, -1) for name in ("turn", "translation"))
    return np.asarray(placed(x, shift, turn)[0])


def radii(columns: Columns, thing: Object) -> Floats:
    """Radius of each particle of an object in a frame [m]."""
    table = columns.get(thing.name, {})
    if "radius" in table:
        return np.asarray(table["radius"], dtype=float).ravel()
    return np.full(len(table.get("position", ())), thing.radius)


def colors(columns: Columns, thing: Object) -> Floats:
    """Colour of each particle of an object in a frame, in linear light, n x 3."""
    table = columns.get(thing.name, {})
    if "color" in table:
        return np.asarray(table["color"], dtype=float).reshape(-1, 3)
    return np.tile(np.array(thing.color), (len(table.get("position", ())), 1))


def by_night(run: Recording) -> bool:
    """Whether its scene asks for pictures by night."""
    return bool(run.scene.get("camera", {}).get("look") == "night")


class Stage:
    """All that can be seen of a run."""

    def __init__(self, run: Recording, view: Floats | None = None) -> None:
        """`view` is the direction in which the camera looks, +y if not given."""
        self.run = run
        self._view = 1 if view is None else int(np.argmax(np.abs(view)))
        self.flat: str | None = str(run.scene.get("plane", "xz")) if run.scene.get("dimension", 3) == 2 else None
        self.objects = with_hair(run, objects(run))
        self._start: Columns = run.frame(0) if run.n_frames else {}
        edged = ("solid", "container", "body", "instances")
        bodies = {o.name: o for o in self.objects if o.form in edged and len(o.triangles)}
        starts = {name: self._start_of(o) for name, o in bodies.items()}
        self._cuts = {name: split(starts[name], o.triangles) for name, o in bodies.items()}
        self._closed = {name for name, o in bodies.items() if outward(starts[name], o.triangles)}
        self._anchors = run.looks.anchors
        self.night = by_night(run)
        self._ways: dict[tuple[str, int], Floats] = {}
        self._pieces: dict[tuple[str, int], tuple[Floats, Floats]] = {}
        self._ranges: dict[str, tuple[str, float, float] | None] = {}
        self._most: dict[str, float] = {}
        self._holes: dict[str, npt.NDArray[np.bool_]] = {}
        self._hottest: dict[str, float] = {}

    def things(self, i: int, thinnest: float = 0.0) -> list[Thing]:
        """Drawables of frame i. Nothing is thinner than the radius `thinnest` [m]."""
        columns = self.run.frame(i)
        drawn: list[Thing] = []
        for thing in self.objects:
            if thing.plane is not None:
                point, normal = thing.plane
                tip = carried(thing, columns, np.stack([point, point + normal]))
                drawn.append(Ground(thing.name, tip[0], tip[1] - tip[0], thing.color))
            elif thing.grid is not None:
                drawn += self._on_grid(thing, thing.grid, columns, thinnest)
            elif thing.form in ("solid", "container"):
                if thing.position is not None and len(thing.triangles):
                    x = carried(thing, columns, thing.position)
                    if thing.form == "solid":
                        drawn.append(self._mesh(thing, x, thing.triangles))
                    else:
                        drawn.append(self._edges(thing, x, thinnest))
            elif self._is_cloud(thing, columns):
                drawn.append(self._cloud(thing, i, columns, thinnest))
            else:
                drawn += self._moving(thing, columns, thinnest)
                if thing.trail > 0.0 and (way := self._way(thing, i, columns, thinnest)):
                    drawn.append(way)
        if self._anchors:
            known = {o.name: o for o in self.objects}
            ends = [positions(columns, known[name])[index] for pair in self._anchors for name, index in pair]
            counts = np.full(len(self._anchors), 2)
            drawn.append(Tubes("anchors", np.array(ends), counts, max(0.004, thinnest), SOLID))
        return drawn

    def _on_grid(self, thing: Object, grid: Box, columns: Columns, thinnest: float) -> list[Thing]:
        """Smoke; in a plane an image and a line around it."""
        if thing.name not in self._ranges:
            self._ranges[thing.name] = self._range(thing, grid)
        drawn: list[Thing] = []
        found = self._ranges[thing.name]
        if found is not None:
            name, low, high = found
            values = _one_number(grid, columns.get(thing.name, {}), name)
            # As a share of what there is in the whole run.
            share = np.nan_to_num((values - low) / (high - low), nan=1.0, posinf=1.0, neginf=0.0)
            glow = self._glow(thing, grid, columns)
            if grid.flat == 3:
                most = self._most_of(thing, grid, found) * (1.0 if glow is None else BURNING)
                thick = (np.clip(share, 0.0, None) * most).astype(np.float32)
                drawn.append(Smoke(thing.name, grid.origin, grid.spacing, thick, thing.color, glow=glow))
            else:
                if thing.name not in self._holes:
                    self._holes[thing.name] = _holes(self.run.scene, thing.name, grid)
                dye = name in FOG and low == 0.0
                drawn.append(_image(thing, grid, name, share, dye, self._holes[thing.name], glow))
        if grid.flat < 3:
            corners = grid.corners[[[0, 1, 3, 2], [0, 1, 5, 4], [0, 2, 6, 4]][grid.flat]]
            line = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1).reshape(-1, 3)
            drawn.append(Tubes(f"{thing.name} edges", line, np.full(4, 2), max(thinnest, 1e-9), SOLID))
        return drawn

    def extinction(self, name: str) -> tuple[str, float, float, float] | None:
        """Of what an object on a grid in space shows: the column, the value that is clear, the extinction [1/m] per unit above
        it, and the highest temperature [K] if it glows, else 0; in a plane, of a layer one cell thick. None where there is
        nothing to see, or no extinction."""
        thing = next(o for o in self.objects if o.name == name)
        grid = thing.grid
        found = None if grid is None else self._range(thing, grid)
        if grid is None or found is None:
            return None
        column, low, high = found
        if grid.flat < 3:
            return (column, low, DYE / grid.spacing / high, 0.0) if column in FOG and low == 0.0 else None
        glows = self._glow(thing, grid, self._start) is not None
        most = self._most_of(thing, grid, found) * (BURNING if glows else 1.0)
        return column, low, most / (high - low), self._hottest[name] if glows else 0.0

    def _most_of(self, thing: Object, grid: Box, found: tuple[str, float, float]) -> float:
        if thing.name not in self._most:
            self._most[thing.name] = self._thickest(thing, grid, *found)
        return self._most[thing.name]

    def _glow(self, thing: Object, grid: Box, columns: Columns) -> npt.NDArray[np.float32] | None:
        """Light of a hot gas: that of a black body, of which it sends out the share that it takes away (Kirchhoff's law)."""
        if "temperature" not in columns.get(thing.name, {}):
            return None
        if thing.name not in self._hottest:
            looks = np.unique(np.linspace(0, self.run.n_frames - 1, LOOKED_AT).astype(int)).tolist()
            most = [self.run.frame(i).get(thing.name, {}).get("temperature", np.zeros(1)).max() for i in looks]
            self._hottest[thing.name] = float(np.nan_to_num(np.max(most)))
        if self._hottest[thing.name] < GLOWING:
            return None
        values = _one_number(grid, columns[thing.name], "temperature").astype(np.float32)
        return EXPOSURE * glow(values, self._hottest[thing.name])

    def _thickest(self, thing: Object, grid: Box, name: str, low: float, high: float) -> float:
        """Extinction where there is most of it [1/m]: thick, but what it hides along the view shines through."""
        looks = np.unique(np.linspace(0, self.run.n_frames - 1, LOOKED_AT).astype(int)).tolist()
        reach = 0.0
        for i in looks:
            values = _one_number(grid, self.run.frame(i).get(thing.name, {}), name)
            share = np.nan_to_num((values - low) / (high - low), nan=0.0, posinf=1.0, neginf=0.0)
            rows = grid.spacing * np.clip(share, 0.0, None).sum(axis=self._view)
            if (some := rows > 0.02 * rows.max(initial=0.0)).any():
                reach = max(reach, float(np.quantile(rows[some], BROAD)))
        thick = THICK / float(grid.size.mean())
        return min(thick, DEEP / reach) if reach > 0.0 else thick

    def _range(self, thing: Object, grid: Box) -> tuple[str, float, float] | None:
        """Column shown of a grid object and its range; nothing if there is nothing to see."""
        looks = np.unique(np.linspace(0, self.run.n_frames - 1, LOOKED_AT).astype(int)).tolist()
        tables = [self.run.frame(i).get(thing.name, {}) for i in looks]
        for name in SHOWN:
            try:
                values = [_one_number(grid, table, name) for table in tables]
            except ExportError:
                continue
            finite = [v[np.isfinite(v)] for v in values]
            low = min((float(v.min()) for v in finite if v.size), default=0.0)
            high = max((float(v.max()) for v in finite if v.size), default=0.0)
            if not high > low:
                continue
            if name in FOG and low < DENSE * high:
                return name, 0.0, high
            if name in SIGNED:
                most = _far(finite, 0.0)
                return name, 0.0 if grid.flat == 3 else -most, most
            if name == "temperature" and grid.flat == 3:
                low = float(np.median(np.concatenate([v.ravel() for v in finite])))
                return (name, low, high) if high > low else None
            if name == "density":
                # Waves in the fluid itself: both ways from rest.
                rest = float(np.median(np.concatenate([v.ravel() for v in finite])))
                most = _far(finite, rest)
                return name, rest - most, rest + most
            return name, low, high
        return None

    def _is_cloud(self, thing: Object, columns: Columns) -> bool:
        """Whether an object is drawn by `splats`."""
        if thing.form != "points" or len(thing.links):
            return False
        table = columns.get(thing.name, {})
        return self.night or "id" in table or len(table.get("position", ())) > MANY

    def _cloud(self, thing: Object, i: int, columns: Columns, thinnest: float) -> Cloud:
        x = positions(columns, thing)
        r = np.maximum(radii(columns, thing), FINER * (THICKER if thing.few else 1) * thinnest)
        pieces, shades, ages = [np.zeros((0, 2, 3))], [np.zeros((0, 3))], [np.zeros(0)]
        now, k = self.run.time(i), i - 1
        while thing.trail > 0.0 and k >= 0 and self.run.time(k) >= now - thing.trail - 1e-9:
            if (thing.name, k) not in self._pieces:
                after = columns if k + 1 == i else self.run.frame(k + 1)
                self._pieces[thing.name, k] = _piece(thing, self.run.frame(k), after)
            way, shade = self._pieces[thing.name, k]
            pieces.append(way)
            shades.append(shade)
            ages.append(np.full(len(way), (now - self.run.time(k + 1)) / thing.trail))
            k -= 1
        for old in [key for key in self._pieces if key[0] == thing.name and not k < key[1] < i]:
            del self._pieces[old]
        ways, faded = np.concatenate(pieces), np.clip(1 - np.concatenate(ages), 0.0, 1.0)
        return Cloud(thing.name, x, r, colors(columns, thing), ways, np.concatenate(shades), faded)

    def _way(self, thing: Object, i: int, columns: Columns, thinnest: float) -> Tubes | None:
        """Trails of the particles up to frame i."""
        first = i
        while first > 0 and self.run.time(first - 1) >= self.run.time(i) - thing.trail - 1e-9:
            first -= 1
        known = self._ways
        kept = {(thing.name, k): known.get((thing.name, k)) for k in range(first, i + 1)}
        self._ways = {key: x for key, x in known.items() if key[0] != thing.name}
        for (name, k), x in kept.items():
            self._ways[name, k] = positions(columns if k == i else self.run.frame(k), thing) if x is None else x
        frames = range(first, i + 1)
        if len(frames) < 2:
            return None
        way = np.stack([self._ways[thing.name, k] for k in frames], axis=1)
        shade = _darker(thing.color, SHADE)
        # Each way in pieces: the last of a piece is the last of all, or leaps.
        last = np.ones(way.shape[:2], dtype=bool)
        last[:, :-1] = np.linalg.norm(np.diff(way, axis=1), axis=2) > thing.leap
        counts = np.diff(np.flatnonzero(last), prepend=-1)
        way, counts = way.reshape(-1, 3)[np.repeat(counts > 1, counts)], counts[counts > 1]
        return Tubes(f"{thing.name} trail", way, counts, max(TRAIL * thing.radius, thinnest), shade)

    def _moving(self, thing: Object, columns: Columns, thinnest: float) -> list[Thing]:
        x = positions(columns, thing)
        if thing.vertices is not None:
            return [self._instances(thing, thing.vertices, x, turns(columns, thing))]
        if thing.form == "liquid":
            now = torn(columns, thing)
            triangles = now if now is not None else thing.triangles
            return [Mesh(thing.name, x, triangles, normals(x, triangles), thing.color, "liquid", closed=True)]
        broken = self._broken(thing, columns)
        if thing.strands is not None:
            curves = hair(thing, self.objects, columns)
            return [thing.strands.hair(thing.name, curves, max(thing.radius, HAIR * thinnest), thing.color)]
        thing = replace(thing, radius=max(thing.radius, thinnest * (THICKER if thing.few else 1)))
        if thing.form in ("surface", "body"):
            now = torn(columns, thing)
            triangles = _without(thing.triangles, thing.links[broken]) if now is None else now
            shown: list[Thing] = [self._mesh(thing, x, triangles)]
            if self.flat is not None and len(thing.links):
                shade = _darker(thing.color, DRAWN_ON)
                # In front of the surface; seen in parallel, they stay in place.
                front = np.array([0.0, 0.0, 1.0] if self.flat == "xy" else [0.0, -1.0, 0.0]) * 4 * thinnest
                shown.append(_springs(thing, x + front, thing.links[~broken], thinnest, shade))
            return shown
        if thing.form == "curve":
            return _pieces(thing, x, thing.links[broken])
        shown = [Spheres(thing.name, x, np.full(len(x), thing.radius), thing.color)]
        if len(thing.links):
            radius = max(SPRING * thing.radius, thinnest)
            shown.append(_springs(thing, x, thing.links[~broken], radius, _darker(thing.color, SHADE)))
        return shown

    def _mesh(self, thing: Object, x: Floats, triangles: Indices) -> Mesh:
        whole = len(triangles) == len(thing.triangles)
        if whole and thing.name in self._cuts:
            source, triangles = self._cuts[thing.name]
            x = x[source]
        closed = whole and thing.name in self._closed
        matter: Matter = "fabric" if thing.form == "surface" else "plain"
        thick = _thickness(self.run.scene, thing.name)
        return Mesh(thing.name, x, triangles, normals(x, triangles), thing.color, matter, thick, closed)

    def _instances(self, thing: Object, vertices: Floats, x: Floats, turn: Floats) -> Mesh:
        """All bodies of an object."""
        source, triangles = self._cuts[thing.name]
        own = vertices[source]
        corners = placed(own, x, turn).reshape(-1, 3)
        shading = placed(normals(own, triangles), np.zeros_like(x), turn).reshape(-1, 3)
        faces = (triangles + len(own) * np.arange(len(x))[:, None, None]).reshape(-1, 3)
        return Mesh(thing.name, corners, faces, shading, thing.color, closed=thing.name in self._closed)

    def _edges(self, thing: Object, x: Floats, thinnest: float) -> Tubes:
        """The sharp edges of a container; of a round one a few of its rings."""
        faces = np.cross(
            x[thing.triangles[:, 1]] - x[thing.triangles[:, 0]], x[thing.triangles[:, 2]] - x[thing.triangles[:, 0]]
        )
        faces /= np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-300)
        across: dict[tuple[int, int], list[int]] = {}
        for k, triangle in enumerate(thing.triangles.tolist()):
            for a, b in zip(triangle, triangle[1:] + triangle[:1], strict=True):
                across.setdefault((min(a, b), max(a, b)), []).append(k)
        sharp = [e for e, near in across.items() if len(near) != 2 or faces[near[0]] @ faces[near[1]] < 0.7]
        start = np.asarray(thing.position)
        if not sharp:
            middle = 0.5 * (start.min(axis=0) + start.max(axis=0))
            side = (start - middle)[np.array(list(across))]
            sharp = [e for e, s in zip(across, side, strict=True) if any((abs(s[:, k]) < 1e-9).all() for k in range(3))]
        links = np.array(sharp or list(across), dtype=np.int64)
        return Tubes(thing.name, x[links].reshape(-1, 3), np.full(len(links), 2), max(0.006, thinnest), thing.color)

    def _start_of(self, thing: Object) -> Floats:
        fixed = thing.position if thing.vertices is None else thing.vertices
        return positions(self._start, thing) if fixed is None else fixed

    def _broken(self, thing: Object, columns: Columns) -> npt.NDArray[np.bool_]:
        """Which links have broken. Their strain is not a number; nor is that of links without a rest length, ever."""
        strain = columns.get(thing.name, {}).get("link_strain")
        none = np.zeros(len(thing.links), dtype=bool)
        if strain is None or len(strain) != len(thing.links) or not np.isnan(strain).any():
            return none
        start = self._start.get(thing.name, {}).get("link_strain")
        if start is None or len(start) != len(strain):
            return none
        return np.ravel(np.isnan(strain) & ~np.isnan(start))


def _thickness(scene: Mapping[str, Any], name: str) -> float:
    """Thickness of a surface [m]: the room that contact leaves it beside others and over colliders."""
    own = [words for kind in ("sheet", "net", "cloth") for words in scene.get(kind) or () if words.get("name") == name]
    system = [s for s in scene.get("system") or () for words in own if s.get("name") == words.get("system")]
    kept = max((float((s.get("self_contact") or {}).get("thickness") or 0.0) for s in system), default=0.0)
    over = [float(c.get("thickness") or 0.0) for c in scene.get("collider") or ()]
    return min([kept, *(ROOM * t for t in over if t > 0.0)])


def _darker(color: Rgb, by: float) -> Rgb:
    return color[0] * by, color[1] * by, color[2] * by


def _one_number(grid: Box, table: Mapping[str, Array], name: str) -> Floats:
    """A column with one number for each cell: lengths of vectors, and in space, where colours cannot say it, no signs."""
    values = grids.shown(grid, table, name).astype(float)
    if values.ndim == 4:
        return np.asarray(np.linalg.norm(values, axis=-1))
    return np.asarray(np.abs(values) if grid.flat == 3 and name in SIGNED else values)


def _far(values: list[Floats], rest: float) -> float:
    """How far most values are from rest. A few cells beside walls, or at the start, are far off all others."""
    off = [np.abs(v - rest) for v in values if v.size]
    return max(max(float(np.quantile(d, USUAL)), PEAK * float(d.max())) for d in off)


def _image(
    thing: Object,
    grid: Box,
    name: str,
    share: Floats,
    dye: bool,
    holes: npt.NDArray[np.bool_],
    glow: npt.NDArray[np.float32] | None = None,
) -> Image:
    """A 2D grid: dye in the object's colour, a gas that glows in its own light, all else in a map of colours."""
    import matplotlib

    a, b = grid.axes
    share = np.squeeze(share, axis=grid.flat)
    corner, sides = grid.corners[0], np.diag(grid.size)
    if dye:
        cover = 1 - np.exp(-DYE * np.clip(share, 0.0, None))
        light = np.broadcast_to(np.array(thing.color if glow is None else SOOT), (*share.shape, 3))
        if glow is not None:
            light = light + developed(np.squeeze(glow, axis=grid.flat))
    else:
        cover = np.ones(share.shape)
        light = linear(matplotlib.colormaps[MAPS.get(name, "viridis")](share)[..., :3])
    cover = np.where(np.squeeze(holes, axis=grid.flat), 0.0, cover)
    return Image(thing.name, corner, sides[a], sides[b], np.asarray(light, dtype=float), cover)


def _holes(scene: Mapping[str, Any], name: str, grid: Box) -> npt.NDArray[np.bool_]:
    """The cells that are no part of a heated body."""
    holes = np.zeros(grid.cells, dtype=bool)
    body: Mapping[str, Any] = next((b for b in scene.get("heat") or () if b.get("name") == name), {})
    regions = body.get("region") or ()
    if regions:
        x = np.stack(np.meshgrid(*(grid.points(a) for a in range(3)), indexing="ij"), axis=-1)
        if grid.flat < 3:
            x[..., grid.flat] = grid.origin[grid.flat] + 0.5 * grid.spacing
        for region in regions:  # Of several at one place the last counts.
            holes[_within(region["shape"], x)] = region.get("hole") is not None
    return holes


def _within(shape: Mapping[str, Any], x: Floats) -> npt.NDArray[np.bool_]:
    """Which points lie in a shape that is no mesh."""
    ((kind, words),) = shape.items()
    if kind == "sphere":
        return np.asarray(np.linalg.norm(x - np.array(words.get("center", (0, 0, 0))), axis=-1) <= words["radius"])
    if kind == "box":
        d = x - np.array(words.get("center", (0, 0, 0)))
        for axis, angle in reversed(list(enumerate(np.radians(words.get("rotate", (0, 0, 0)))))):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            # Back from turned to not turned.
            u, v = d[..., a].copy(), d[..., b].copy()
            d[..., a], d[..., b] = np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u
        return np.asarray((np.abs(d) <= 0.5 * np.array(words["size"])).all(axis=-1))
    if kind == "capsule":
        start, end = np.array(words["from"], dtype=float), np.array(words["to"], dtype=float)
        along = end - start
        t = np.clip((x - start) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        return np.asarray(np.linalg.norm(x - start - t[..., None] * along, axis=-1) <= words["radius"])
    plane = _plane(shape)
    if plane is None:
        return np.zeros(x.shape[:-1], dtype=bool)
    return np.asarray((x - plane[0]) @ plane[1] <= 0.0)


def _piece(thing: Object, before: Columns, after: Columns) -> tuple[Floats, Floats]:
    """The ways of particles from one frame to the next, m x 2 x 3, and their colours; of those that are in both."""
    x, y, shade = positions(before, thing), positions(after, thing), colors(after, thing)
    old, new = before[thing.name].get("id"), after[thing.name].get("id")
    if old is not None and new is not None:
        _, k, m = np.intersect1d(old, new, assume_unique=True, return_indices=True)
        x, y, shade = x[k], y[m], shade[m]
    near = ~(np.linalg.norm(y - x, axis=1) > thing.leap)
    x, y, shade = x[near], y[near], shade[near]
    return np.stack([x, y], axis=1), shade


def _indices(columns: Mapping[str, Array], name: str, width: int) -> Indices:
    return np.asarray(columns.get(name, ()), dtype=np.int64).reshape(-1, width)


def _plane(shape: object) -> tuple[Floats, Floats] | None:
    if not isinstance(shape, Mapping):
        return None
    if "floor" in shape:
        return np.array([0.0, 0.0, float((shape["floor"] or {}).get("height", 0.0))]), np.array([0.0, 0.0, 1.0])
    if "plane" in shape:
        normal = np.array(shape["plane"]["normal"], dtype=float)
        return np.array(shape["plane"].get("point", (0, 0, 0)), dtype=float), normal / np.linalg.norm(normal)
    return None


def _springs(thing: Object, x: Floats, links: Indices, radius: float, color: Rgb) -> Tubes:
    return Tubes(f"{thing.name} springs", x[links].reshape(-1, 3), np.full(len(links), 2), radius, color)


def _pieces(thing: Object, x: Floats, torn: Indices) -> list[Thing]:
    """A rope, in pieces where it is torn."""
    cuts = {(int(a), int(b)) for a, b in np.sort(torn, axis=1)}
    ends = [
        k + 1
        for k, (a, b) in enumerate(zip(thing.curve[:-1].tolist(), thing.curve[1:].tolist(), strict=True))
        if (min(a, b), max(a, b)) in cuts
    ]
    counts = np.diff([0, *ends, len(thing.curve)])
    return [Tubes(thing.name, x[thing.curve], counts, thing.radius, thing.color)]


def _without(triangles: Indices, torn: Indices) -> Indices:
    """Triangles that have no torn link as an edge."""
    if not len(torn):
        return triangles
    size = int(max(triangles.max(), torn.max())) + 1
    low, high = np.sort(torn, axis=1).T
    keys = low * size + high
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1)
    return triangles[~np.isin(edges[..., 0] * size + edges[..., 1], keys).any(axis=1)]
