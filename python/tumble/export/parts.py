"""What a stage consists of: the parts of a run, and what each holds in a frame."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.looks import SPRING, TRAIL
from tumble.pictures.surfaces import normals, placed, split
from tumble.pictures.things import Columns, Object, Recording, colors, hair, positions, radii, torn, turns

ROOT = "/scene"

KNOWN = ("position", "velocity", "id", "radius", "color", "triangles")
"""Columns that become something else than a primvar of their name."""

Numbers = npt.NDArray[np.float32] | npt.NDArray[np.float16] | npt.NDArray[np.int64] | npt.NDArray[np.int32]


Ways = dict[str, tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]]
"""Object -> points of the ways behind its points, and how many each has."""


@dataclass(frozen=True)
class Part:
    """A prim: the whole of an object, or its springs."""

    thing: Object
    path: str
    title: str
    kind: str
    """Points, Mesh, BasisCurves, PointInstancer or Volume."""
    order: npt.NDArray[np.int64] | None = None
    """Masses in the order of the points; without it, all masses in theirs."""
    counts: npt.NDArray[np.int64] | None = None
    """Points of each curve."""
    radius: float = 0.0
    cut: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]] | None = None
    """Result of `surfaces.split` for a solid with sharp edges."""
    taper: npt.NDArray[np.float64] | None = None
    """Radius of each point of a strand of hair."""
    skin: Object | None = None
    """What hair is rooted in."""
    trail: bool = False
    """Whether its curves are the ways of points, as long as `Object.trail` says."""
    squares: npt.NDArray[np.int64] | None = None
    """Of each quadrangle which corners it has of those of all triangles, one after another; m x 4."""
    texture: npt.NDArray[np.float64] | None = None
    """Texture coordinates of the corners of triangles, 3 m x 2, or of roots of strands, n x 2."""
    body: tuple[str, int] | None = None
    """Object and index of the body that it is, which moves as a whole."""
    grows: bool = False
    """Whether its bodies are born during the run."""

    @property
    def name(self) -> str:
        """Name of its prim."""
        return self.path.rpartition("/")[2]


@dataclass(frozen=True)
class Now:
    """A frame, and those beside it, where anything needs velocities that the run did not keep."""

    columns: Columns
    ways: Ways
    before: Columns | None = None
    after: Columns | None = None
    step: float = 0.0
    """Time between frames [s]."""


class History:
    """The last frames of points that leave trails."""

    def __init__(self, things: list[Object]) -> None:
        self.things = [t for t in things if t.form == "points" and t.trail > 0.0]
        self.past: dict[str, list[tuple[float, npt.NDArray[np.int64], npt.NDArray[np.float64]]]] = {}

    def ways(self, time: float, columns: Columns) -> Ways:
        """The ways up to a time [s] that is later than all before."""
        found: Ways = {}
        for thing in self.things:
            x = positions(columns, thing)
            ids = np.asarray(columns.get(thing.name, {}).get("id", np.arange(len(x))), dtype=np.int64)
            past = [p for p in self.past.get(thing.name, []) if p[0] >= time - thing.trail - 1e-9]
            self.past[thing.name] = past = [*past, (time, ids, x)]
            found[thing.name] = _way(past, thing.leap)
        return found


def _way(
    past: list[tuple[float, npt.NDArray[np.int64], npt.NDArray[np.float64]]], leap: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Points of ways, each from its oldest to where it is now, and how many each has; two at least."""
    _, ids, x = past[-1]
    way, there = [x], [np.ones(len(ids), dtype=bool)]
    for _, old, before in reversed(past[:-1]):
        order = np.argsort(old)
        at = np.minimum(np.searchsorted(old[order], ids), max(len(old) - 1, 0))
        if not len(old):
            break
        at = order[at]
        known = there[-1] & (old[at] == ids)
        known &= np.linalg.norm(before[at] - way[-1], axis=1) <= leap
        way.append(before[at])
        there.append(known)
    mask = np.stack(there[::-1], axis=1)
    mask &= mask.sum(axis=1, keepdims=True) > 1
    points = np.stack(way[::-1], axis=1)[mask]
    counts = mask.sum(axis=1)
    return points.astype(np.float32), counts[counts > 0].astype(np.int32)


def parts(run: Recording, found: list[Object], start: Columns) -> list[Part]:
    """The prims of a run's objects."""
    from pxr import Tf

    kinds = {thing["name"]: (kind, thing) for kind in ("sheet", "block", "hair") for thing in run.scene.get(kind, ())}

    taken = {"camera", "key_light", "sky", "looks", "physics", "joints"}
    held = jointed(run.scene)
    known = bodies(run.scene)

    def path(name: str) -> str:
        stem = Tf.MakeValidIdentifier(name)
        free = next(n for n in (stem, *(f"{stem}_{k}" for k in range(2, 1_000_000))) if n not in taken)
        taken.add(free)
        return f"{ROOT}/{free}"

    made = []
    for thing in found:
        if thing.form == "points":
            made.append(Part(thing, path(thing.name), thing.name, "Points", radius=thing.radius))
        elif thing.grid is not None:
            made.append(Part(thing, path(thing.name), thing.name, "Volume"))
        elif thing.strands is not None:
            shown = thing.strands
            counts = np.full(len(shown.guides), shown.points)
            taper = thing.radius * np.sqrt(1.0 - 0.96 * np.linspace(0.0, 1.0, shown.points))
            where = path(thing.name)
            skin = next((other for other in found if other.name == thing.skin), None)
            texture = roots(run, kinds[thing.name][1], thing, skin, start) if thing.name in kinds else None
            own = Part(thing, where, thing.name, "BasisCurves", counts=counts, radius=thing.radius)
            made.append(replace(own, taper=taper, skin=skin, texture=texture))
        elif thing.form in ("curve", "strands"):
            counts = np.array([len(thing.curve)])
            where = path(thing.name)
            made.append(Part(thing, where, thing.name, "BasisCurves", thing.curve, counts, thing.radius))
        elif thing.vertices is not None:
            # The columns of frames are not those of the mesh: no object has a name with a slash.
            mesh = replace(thing, name=f"{thing.name}/mesh", position=thing.vertices, vertices=None)
            edges = split(thing.vertices, thing.triangles)
            grows = bool(known.get(thing.name, {}).get("emit"))
            if not grows and ((n := len(positions(start, thing))) == 1 or thing.name in held):
                for k in range(n):
                    title = f"{thing.name} {k}" if n > 1 else thing.name
                    made.append(Part(mesh, path(title), title, "Mesh", cut=edges, body=(thing.name, k)))
                continue
            where, title = path(thing.name), f"{thing.name} mesh"
            inner = where + path(title).removeprefix(ROOT)
            made.append(Part(thing, where, thing.name, "PointInstancer", grows=grows))
            made.append(Part(mesh, inner, title, "Mesh", cut=edges))
        elif thing.form == "liquid":
            made.append(Part(thing, path(thing.name), thing.name, "Mesh"))
        elif len(thing.triangles):
            kind, words = kinds.get(thing.name, ("", {}))
            cut = None if thing.form == "surface" else split(places(thing, start), thing.triangles)
            fixed = torn(start, thing) is None
            made.append(
                Part(
                    thing,
                    path(thing.name),
                    thing.name,
                    "Mesh",
                    cut=cut,
                    squares=squares(thing.triangles) if kind in ("sheet", "block") and fixed else None,
                    texture=lattice(words, thing) if "resolution" in words and kind == "sheet" else thing.texture,
                )
            )
    for thing in found:
        if thing.form == "points" and thing.trail > 0.0:
            title = f"{thing.name} trail"
            made.append(Part(thing, path(title), title, "BasisCurves", radius=TRAIL * thing.radius, trail=True))
    for thing in found:
        if thing.form == "points" and len(thing.links):
            title = f"{thing.name} springs"
            counts = np.full(len(thing.links), 2)
            where = path(title)
            made.append(Part(thing, where, title, "BasisCurves", thing.links.ravel(), counts, SPRING * thing.radius))
    return made


def jointed(scene: Mapping[str, Any]) -> set[str]:
    """Names of the objects that joints hold: each of their bodies is a prim of its own, which a joint can name."""
    names = {joint_end(scene, text)[0] for joint in scene.get("joint", ()) for text in joint["between"]}
    return names | {name for name, body in bodies(scene).items() if body["name"] in names}


def bodies(scene: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Words of the bodies of a scene by the names of their objects in frames: those that break are their pieces."""
    found: dict[str, Mapping[str, Any]] = {}
    for body in scene.get("body", ()):
        fracture = body.get("fracture")
        count = 0 if not fracture else fracture.get("pieces") or len(fracture.get("sites", ()))
        for name in [f"{body['name']}.{k + 1}" for k in range(count)] or [body["name"]]:
            found[name] = body
    return found


def joint_end(scene: Mapping[str, Any], text: str) -> tuple[str, int | None]:
    """Object and index of an end of a joint, "NAME" or "NAME INDEX"."""
    if any(body["name"] == text for body in scene.get("body", ())):
        return text, None
    name, _, index = text.rpartition(" ")
    return name, int(index)


def places(thing: Object, columns: Columns) -> npt.NDArray[np.float64]:
    """Vertices; of a collider that moves as a whole, before it is turned and moved."""
    still = thing.position
    if still is None or "position" in columns.get(thing.name, {}):
        return positions(columns, thing)
    return still


def velocities(part: Part, now: Now) -> npt.NDArray[np.float64] | None:
    """Velocities [m/s] of the masses or vertices of a part, from those beside it in time where the run did not keep them."""
    name = part.thing.name
    own = now.columns.get(name, {}).get("velocity")
    if own is not None:
        return np.asarray(own, dtype=float).reshape(-1, 3)
    other = varying(part, now.columns) or part.thing.form == "liquid"
    if part.body is not None or other or np.isfinite(part.thing.leap):
        return None
    if now.before is None and now.after is None:
        return None
    x = places(part.thing, now.columns)
    first, last = (x if c is None else places(part.thing, c) for c in (now.before, now.after))
    span = now.step * ((now.before is not None) + (now.after is not None))
    v = (last - first) / span
    changed, earlier = torn(now.columns, part.thing), torn(now.before or {}, part.thing)
    if changed is not None and earlier is not None:
        # What a tear has made was elsewhere, if anywhere.
        fresh = np.setdiff1d(changed, earlier)
        v[fresh] = 0.0 if now.after is None else (last[fresh] - x[fresh]) / now.step
    return np.asarray(v, dtype=float)


def squares(triangles: npt.NDArray[np.int64]) -> npt.NDArray[np.int64] | None:
    """Pairs of triangles, one after another, as quadrangles whose fans they are: places of their corners among all; None
    unless all are pairs."""
    if len(triangles) % 2:
        return None
    one, other = triangles[0::2], triangles[1::2]
    first = 6 * np.arange(len(one))
    found = np.full((len(one), 4), -1)
    for i in range(3):
        for j in range(3):
            # The edge from i on, and backwards the one from j on.
            same = (one[:, i] == other[:, (j + 1) % 3]) & (one[:, (i + 1) % 3] == other[:, j])
            turn = [i, 3 + (j + 2) % 3, (i + 1) % 3, (i + 2) % 3]
            found[same] = (first[:, None] + turn)[same]
    return None if (found < 0).any() else found


def corners(part: Part, triangles: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Vertices of all corners of the faces of a part."""
    flat = triangles.ravel()
    return np.asarray(flat if part.squares is None else flat[part.squares.ravel()])


def lattice(words: Mapping[str, Any], thing: Object) -> npt.NDArray[np.float64]:
    """Texture coordinates of a sheet [m]: along its sides, from its first vertex on; for the corners of triangles."""
    (a, b), (n, m) = words["size"], words["resolution"]
    u, v = np.meshgrid(np.linspace(0.0, a, n), np.linspace(0.0, b, m))
    return np.asarray(np.stack([u, v], axis=-1).reshape(-1, 2)[thing.triangles.ravel()])


def roots(
    run: Recording, words: Mapping[str, Any], thing: Object, skin: Object | None, start: Columns
) -> npt.NDArray[np.float64] | None:
    """Texture coordinates of the roots of hair, where the collider that it grows on has some."""
    table = run.static.get(words.get("on") or "", {})
    if "texture" not in table or "position" not in table or thing.strands is None:
        return None
    points = hair(thing, [skin] if skin else [], start)[:, 0]
    vertices = np.asarray(table["position"], dtype=float).reshape(-1, 3)
    triangles = np.asarray(table["triangles"], dtype=np.int64).reshape(-1, 3)
    texture = np.asarray(table["texture"], dtype=float).reshape(-1, 3, 2)
    return on_surface(points, vertices, triangles, texture)


def on_surface(
    points: npt.NDArray[np.float64],
    vertices: npt.NDArray[np.float64],
    triangles: npt.NDArray[np.int64],
    texture: npt.NDArray[np.float64],
) -> npt.NDArray[np.float64]:
    """Texture coordinates, m x 3 x 2 of the corners of triangles, at points on or near them."""
    found = np.zeros((len(points), 2))
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    e, f = b - a, c - a
    ee, ef, ff = (e * e).sum(1), (e * f).sum(1), (f * f).sum(1)
    area = np.maximum(ee * ff - ef * ef, 1e-300)
    for k, p in enumerate(points):
        d = p - a
        de, df = (d * e).sum(1), (d * f).sum(1)
        u = np.clip((ff * de - ef * df) / area, 0.0, 1.0)
        v = np.clip((ee * df - ef * de) / area, 0.0, 1.0)
        over = np.maximum(u + v, 1.0)
        u, v = u / over, v / over
        near = int(np.argmin(((d - u[:, None] * e - v[:, None] * f) ** 2).sum(1)))
        weights = np.array([1.0 - u[near] - v[near], u[near], v[near]])
        found[k] = weights @ texture[near]
    return found


def deforms(part: Part, columns: Columns) -> bool:
    """Whether its points differ from frame to frame."""
    own = columns.get(part.thing.name, {})
    return part.kind != "Volume" and (part.thing.position is None or "position" in own)


def placement(part: Part, columns: Columns) -> list[tuple[str, str, Any]]:
    """Translation and turn of a collider or body that moves as a whole: attribute, type and value."""
    from pxr import Gf

    name, row = part.body or (part.thing.name, 0)
    own = columns.get(name, {})
    shifts = own.get("position" if part.body else "translation")
    if shifts is None:
        return []
    x, y, z, w = (float(q) for q in np.reshape(own["turn"], (-1, 4))[row])
    shift = Gf.Vec3d(*(float(c) for c in np.reshape(shifts, (-1, 3))[row]))
    return [("xformOp:translate", "double3", shift), ("xformOp:orient", "quatd", Gf.Quatd(w, x, y, z))]


def varying(part: Part, columns: Columns) -> bool:
    """Whether a part is particles that come and go."""
    return part.kind == "Points" and "id" in columns.get(part.thing.name, {})


def values(part: Part, now: Now) -> Iterator[tuple[str, str, Numbers]]:
    """Data of a part in a frame: attribute, type and values."""
    columns = now.columns
    if part.thing.vertices is not None:
        yield from _bodies(part.thing, part.thing.vertices, columns)
        if part.grows:
            count = len(positions(columns, part.thing))
            yield "protoIndices", "int[]", np.zeros(count, dtype=np.int32)
            yield "ids", "int64[]", np.arange(count, dtype=np.int64)
        return
    if part.trail:
        points, counts = now.ways[part.thing.name]
        yield "points", "point3f[]", points
        yield "curveVertexCounts", "int[]", counts
        # What was passed stays where it is.
        yield "velocities", "vector3f[]", np.zeros_like(points)
        yield "extent", "float3[]", _extent(points, np.float32(part.radius))
        return
    if part.taper is not None and part.thing.strands is not None:
        shown = part.thing.strands
        curves = hair(part.thing, [part.skin] if part.skin else [], columns)
        points = np.ascontiguousarray(curves.reshape(-1, 3), dtype=np.float32)
        yield "points", "point3f[]", points
        speeds = velocities(part, now)
        if speeds is not None:
            moved = shown.mean(speeds).reshape(-1, 3)
            yield "velocities", "vector3f[]", np.ascontiguousarray(moved, dtype=np.float32)
        yield "extent", "float3[]", _extent(points, np.float32(part.radius))
        return
    x = places(part.thing, columns)
    v = velocities(part, now)
    chosen = slice(None) if part.order is None else part.order
    points = np.ascontiguousarray(x[chosen], dtype=np.float32)
    yield "points", "point3f[]", points
    if v is not None:
        yield "velocities", "vector3f[]", np.ascontiguousarray(v[chosen], dtype=np.float32)
    if part.kind == "Mesh":
        changed = torn(columns, part.thing)
        if changed is not None:
            if part.thing.form == "liquid":
                yield "faceVertexCounts", "int[]", np.full(len(changed), 3, dtype=np.int32)
            yield "faceVertexIndices", "int[]", np.ascontiguousarray(changed.ravel(), dtype=np.int32)
        source, triangles = part.cut or (np.arange(len(x)), part.thing.triangles if changed is None else changed)
        n = normals(x[source], triangles)
        if part.cut:
            n = n[corners(part, triangles)]
        yield "normals", "normal3f[]", np.ascontiguousarray(n, dtype=np.float32)
    born = varying(part, columns)
    radius: Any = np.float32(part.radius)
    if born:
        table = columns[part.thing.name]
        yield "ids", "int64[]", np.ascontiguousarray(table["id"], dtype=np.int64)
        yield "primvars:id", "int[]", np.ascontiguousarray(table["id"], dtype=np.int32)
        if "radius" in table:
            radius = radii(columns, part.thing).astype(np.float32)[:, None]
            yield "widths", "float[]", np.ascontiguousarray(2 * radius[:, 0])
        if "color" in table:
            yield "primvars:displayColor", "color3f[]", colors(columns, part.thing).astype(np.float32)
        for name, numbers in table.items():
            if name not in KNOWN and np.shape(numbers) == (len(points),):
                yield f"primvars:{identifier(name)}", "float[]", np.ascontiguousarray(numbers, dtype=np.float32)
    if len(points) or born:
        yield "extent", "float3[]", _extent(points, radius)


def _bodies(thing: Object, vertices: npt.NDArray[np.float64], columns: Columns) -> Iterator[tuple[str, str, Numbers]]:
    """Places of the bodies of an object, and how they move where the run kept it."""
    x, turn = positions(columns, thing), turns(columns, thing)
    yield "positions", "point3f[]", np.ascontiguousarray(x, dtype=np.float32)
    # Some programs read only the former, of half precision.
    yield "orientations", "quath[]", np.ascontiguousarray(turn, dtype=np.float16)
    yield "orientationsf", "quatf[]", np.ascontiguousarray(turn, dtype=np.float32)
    for column, name, unit in (("velocity", "velocities", 1.0), ("angular_velocity", "angularVelocities", 180 / np.pi)):
        if column in columns[thing.name]:
            v = unit * np.reshape(columns[thing.name][column], (-1, 3)).astype(float)
            yield name, "vector3f[]", np.ascontiguousarray(v, dtype=np.float32)
    corners = placed(vertices, x, turn).reshape(-1, 3).astype(np.float32)
    yield "extent", "float3[]", _extent(corners, np.float32(0.0))


def _extent(points: npt.NDArray[np.float32], radius: Any) -> npt.NDArray[np.float32]:
    if len(points):
        return np.stack([(points - radius).min(axis=0), (points + radius).max(axis=0)])
    most = np.finfo(np.float32).max
    return np.array([[most] * 3, [-most] * 3], dtype=np.float32)  # The empty range.


def identifier(name: str) -> str:
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))
