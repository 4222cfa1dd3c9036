"""A run as Universal Scene Description: scene.usda, and beside it usd/ with a layer per frame.

    scene.usda              camera, lights, frame rate; refers to objects.usdc; names the frames as value clips
    usd/objects.usdc        what does not change: topology, texture coordinates, ids, widths, colours, colliders; points at
                            the start
    volumes/NAME.FRAME.vdb  what lies on grids; Volume prims in objects.usdc name the files of all frames
    usd/manifest.usda       which attributes the frames hold
    usd/frame.000000.usdc   points, velocities, normals and extents of a frame, at time code 0; and so on; of particles
                            that come and go also ids, widths, colours and all other numbers that they have

Why value clips: sub-layers cannot do it (the strongest layer that has any time sample of an attribute hides the
samples of all others), and one file with all samples keeps them all in memory while it is written. Value clips are
opened when their frame is asked for, and values between two frames are interpolated. They belong to how the USD
library looks up values, so that programs built on it need no support of their own (tried: Blender 4.2 and 5.0). A
program that reads USD in another way may see the start only, which is in objects.usdc.

The clips must be stronger than the points at the start, and defaults beside clips are stronger than these: that is
why objects.usdc is referenced and not a sub-layer.

Volumes name a file for each frame, which is so little that it stands beside what does not change.

Of particles that come and go, a row can be another particle in the next frame: between frames they are where their
velocities take them (`UsdGeom.PointBased.ComputePointsAtTime`), not between equal rows.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.columns import FOG
from tumble.export import DIGITS, vdb
from tumble.folder import writing
from tumble.looks import SPRING, TRAIL
from tumble.pictures.framing import camera
from tumble.pictures.look import key_light
from tumble.pictures.surfaces import normals, split
from tumble.pictures.things import Columns, Object, Recording, colors, hair, objects, positions, radii, torn, with_hair

ROOT = "/scene"
SENSOR = 0.36
"""Width of the camera's sensor [tenth of a metre], the unit that USD takes for lenses."""

KNOWN = ("position", "velocity", "id", "radius", "color", "triangles")
"""Columns that become something else than a primvar of their name."""

Numbers = npt.NDArray[np.float32] | npt.NDArray[np.int64] | npt.NDArray[np.int32]


@dataclass(frozen=True)
class Part:
    """A prim: the whole of an object, or its springs."""

    thing: Object
    path: str
    title: str
    kind: str
    """Points, Mesh, BasisCurves or Volume."""
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


Ways = dict[str, tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]]
"""Object -> points of the ways behind its points, and how many each has."""


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


def write(
    run: Recording,
    folder: str | os.PathLike[str],
    progress: Callable[[int, int], None] | None = None,
    volumes: bool = True,
) -> Path:
    """Writes scene.usda and usd/ into a folder and returns the path of scene.usda, which is written last; also volumes/,
    if anything lies on a grid, unless told that it is there. `progress(done, total)` is called after each frame.
    Positions are single precision, bit for bit those of a run in single precision. Raises ExportError."""
    if run.n_frames < 1:
        raise ExportError("the run has no frames")
    goal = Path(folder)
    layers = goal / "usd"
    start = run.frame(0)
    things = with_hair(run, objects(run))
    parts, history = _parts(things, start), History(things)
    beginning = history.ways(run.time(0), start)
    digits = max(DIGITS, len(str(run.n_frames - 1)))
    if volumes and vdb.grids(run):
        vdb.write(run, goal)
    with _writing(goal / "scene.usda"):
        layers.mkdir(parents=True, exist_ok=True)
        for old in layers.glob("frame.*.usdc"):
            if not old.name[6:-5].isdigit() or len(old.name) != digits + 11 or int(old.name[6:-5]) >= run.n_frames:
                old.unlink()
        for i in range(run.n_frames):
            columns = start if i == 0 else run.frame(i)
            ways = beginning if i == 0 else history.ways(run.time(i), columns)
            _save(_frame(parts, columns, ways, i), layers / f"frame.{i:0{digits}d}.usdc")
            if progress is not None:
                progress(i + 1, run.n_frames)
        _save(_manifest(parts, start, beginning), layers / "manifest.usda")
        _save(_objects(run, parts, start, beginning), layers / "objects.usdc")
        scene = goal / "scene.usda"
        _save(_scene(run, "#" * digits), scene)
    return scene


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turns refusals of the system and of the USD library into an ExportError."""
    try:
        with writing(path):
            yield
    except RuntimeError as error:
        # One line per error, each with the place in the library's source and the reason in quotes.
        reasons = re.findall(r" : '(.*)'", str(error))
        raise ExportError(f"{path}: cannot be written: {reasons[0] if reasons else error}") from error


def _parts(found: list[Object], start: Columns) -> list[Part]:
    from pxr import Tf

    taken = {"camera", "key_light", "sky", "looks"}

    def path(name: str) -> str:
        stem = Tf.MakeValidIdentifier(name)
        free = next(n for n in (stem, *(f"{stem}_{k}" for k in range(2, 1_000_000))) if n not in taken)
        taken.add(free)
        return f"{ROOT}/{free}"

    parts = []
    for thing in found:
        if thing.form == "points":
            parts.append(Part(thing, path(thing.name), thing.name, "Points", radius=thing.radius))
        elif thing.grid is not None:
            parts.append(Part(thing, path(thing.name), thing.name, "Volume"))
        elif thing.strands is not None:
            shown = thing.strands
            counts = np.full(len(shown.guides), shown.points)
            taper = thing.radius * np.sqrt(1.0 - 0.96 * np.linspace(0.0, 1.0, shown.points))
            where = path(thing.name)
            skin = next((t for t in found if t.name == thing.skin), None)
            parts.append(Part(thing, where, thing.name, "BasisCurves", None, counts, thing.radius, None, taper, skin))
        elif thing.form in ("curve", "strands"):
            counts = np.array([len(thing.curve)])
            where = path(thing.name)
            parts.append(Part(thing, where, thing.name, "BasisCurves", thing.curve, counts, thing.radius))
        elif len(thing.triangles):
            cut = None if thing.form == "surface" else split(_places(thing, start), thing.triangles)
            parts.append(Part(thing, path(thing.name), thing.name, "Mesh", cut=cut))
    for thing in found:
        if thing.form == "points" and thing.trail > 0.0:
            title = f"{thing.name} trail"
            parts.append(Part(thing, path(title), title, "BasisCurves", radius=TRAIL * thing.radius, trail=True))
    for thing in found:
        if thing.form == "points" and len(thing.links):
            title = f"{thing.name} springs"
            counts = np.full(len(thing.links), 2)
            where = path(title)
            parts.append(Part(thing, where, title, "BasisCurves", thing.links.ravel(), counts, SPRING * thing.radius))
    return parts


def _places(thing: Object, columns: Columns) -> npt.NDArray[np.float64]:
    """Vertices; of a collider that moves as a whole, before it is turned and moved."""
    still = thing.position
    if still is None or "position" in columns.get(thing.name, {}):
        return positions(columns, thing)
    return still


def _deforms(part: Part, columns: Columns) -> bool:
    """Whether its points differ from frame to frame."""
    own = columns.get(part.thing.name, {})
    return part.kind != "Volume" and (part.thing.position is None or "position" in own)


def _placement(part: Part, columns: Columns) -> list[tuple[str, str, Any]]:
    """Translation and turn of a collider that moves as a whole: attribute, type and value."""
    from pxr import Gf

    own = columns.get(part.thing.name, {})
    if "turn" not in own:
        return []
    x, y, z, w = (float(q) for q in np.ravel(own["turn"]))
    shift = Gf.Vec3d(*(float(c) for c in np.ravel(own["translation"])))
    return [("xformOp:translate", "double3", shift), ("xformOp:orient", "quatd", Gf.Quatd(w, x, y, z))]


def _varying(part: Part, columns: Columns) -> bool:
    """Whether a part is particles that come and go."""
    return part.kind == "Points" and "id" in columns.get(part.thing.name, {})


def _array(values: Numbers) -> Any:
    """Numbers as the library wants them."""
    from pxr import Vt

    if values.dtype == np.int32:
        return Vt.IntArray.FromNumpy(values)
    if values.dtype == np.int64:
        return Vt.Int64Array.FromNumpy(values)
    return Vt.Vec3fArray.FromNumpy(values) if values.ndim == 2 else Vt.FloatArray.FromNumpy(values)


def _values(part: Part, columns: Columns, ways: Ways) -> Iterator[tuple[str, str, Numbers]]:
    """Data of a part in a frame: attribute, type and values."""
    if part.trail:
        points, counts = ways[part.thing.name]
        yield "points", "point3f[]", points
        yield "curveVertexCounts", "int[]", counts
        yield "extent", "float3[]", _extent(points, np.float32(part.radius))
        return
    if part.taper is not None and part.thing.strands is not None:
        shown = part.thing.strands
        curves = hair(part.thing, [part.skin] if part.skin else [], columns)
        points = np.ascontiguousarray(curves.reshape(-1, 3), dtype=np.float32)
        yield "points", "point3f[]", points
        speeds = columns.get(part.thing.name, {}).get("velocity")
        if speeds is not None:
            moved = shown.mean(speeds).reshape(-1, 3)
            yield "velocities", "vector3f[]", np.ascontiguousarray(moved, dtype=np.float32)
        yield "extent", "float3[]", _extent(points, np.float32(part.radius))
        return
    x = _places(part.thing, columns)
    v = columns.get(part.thing.name, {}).get("velocity")
    chosen = slice(None) if part.order is None else part.order
    points = np.ascontiguousarray(x[chosen], dtype=np.float32)
    yield "points", "point3f[]", points
    if v is not None:
        yield "velocities", "vector3f[]", np.ascontiguousarray(np.reshape(v, (-1, 3))[chosen], dtype=np.float32)
    if part.kind == "Mesh":
        now = torn(columns, part.thing)
        if now is not None:
            yield "faceVertexIndices", "int[]", np.ascontiguousarray(now.ravel(), dtype=np.int32)
        source, triangles = part.cut or (np.arange(len(x)), part.thing.triangles if now is None else now)
        n = normals(x[source], triangles)
        yield "normals", "normal3f[]", np.ascontiguousarray(n[triangles.ravel()] if part.cut else n, dtype=np.float32)
    varying = _varying(part, columns)
    radius: Any = np.float32(part.radius)
    if varying:
        table = columns[part.thing.name]
        yield "ids", "int64[]", np.ascontiguousarray(table["id"], dtype=np.int64)
        if "radius" in table:
            radius = radii(columns, part.thing).astype(np.float32)[:, None]
            yield "widths", "float[]", np.ascontiguousarray(2 * radius[:, 0])
        if "color" in table:
            yield "primvars:displayColor", "color3f[]", colors(columns, part.thing).astype(np.float32)
        for name, numbers in table.items():
            if name not in KNOWN and np.shape(numbers) == (len(points),):
                yield f"primvars:{_identifier(name)}", "float[]", np.ascontiguousarray(numbers, dtype=np.float32)
    if len(points) or varying:
        yield "extent", "float3[]", _extent(points, radius)


def _extent(points: npt.NDArray[np.float32], radius: Any) -> npt.NDArray[np.float32]:
    if len(points):
        return np.stack([(points - radius).min(axis=0), (points + radius).max(axis=0)])
    most = np.finfo(np.float32).max
    return np.array([[most] * 3, [-most] * 3], dtype=np.float32)  # The empty range.


def _identifier(name: str) -> str:
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))


def _frame(parts: list[Part], columns: Columns, ways: Ways, i: int) -> Any:
    """The layer of a frame."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        for part in parts:
            placement = _placement(part, columns)
            if placement or _deforms(part, columns):
                prim = Sdf.CreatePrimInLayer(layer, part.path)
            for name, kind, value in placement:
                attribute = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
                layer.SetTimeSample(attribute.path, float(i), value)
            if _deforms(part, columns):
                for name, kind, values in _values(part, columns, ways):
                    attribute = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
                    layer.SetTimeSample(attribute.path, float(i), _array(values))
    return layer


def _manifest(parts: list[Part], start: Columns, ways: Ways) -> Any:
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    for part in parts:
        named = [(name, kind) for name, kind, _ in _placement(part, start)]
        if _deforms(part, start):
            named += [(name, kind) for name, kind, _ in _values(part, start, ways)]
        if named:
            prim = Sdf.CreatePrimInLayer(layer, part.path)
            for name, kind in named:
                Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
    return layer


def _objects(run: Recording, parts: list[Part], start: Columns, ways: Ways) -> Any:
    """Constant data and the initial state."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    _units(stage)
    stage.SetTimeCodesPerSecond(_rate(run))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    UsdGeom.Scope.Define(stage, f"{ROOT}/looks")
    files = vdb.paths(run)
    for part in parts:
        prim = stage.DefinePrim(part.path, part.kind)
        prim.SetDisplayName(part.title)
        if part.kind == "Volume":
            _volume(stage, part, files[part.thing.name], run, start.get(part.thing.name, {}))
            continue
        for name, kind, values in _values(part, start, ways):
            attribute = prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(kind), False)
            attribute.Set(_array(values))
            if name.startswith("primvars:"):
                UsdGeom.Primvar(attribute).SetInterpolation(UsdGeom.Tokens.vertex)
        placement = _placement(part, start)
        if placement:
            order = UsdGeom.Xformable(prim)
            order.AddTranslateOp().Set(placement[0][2])
            order.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(placement[1][2])
        n = len(prim.GetAttribute("points").Get())
        color = Gf.Vec3f(*part.thing.color)
        colored = prim.GetAttribute("primvars:displayColor").HasAuthoredValue()
        if not colored:
            UsdGeom.Gprim(prim).CreateDisplayColorAttr([color])
        if _varying(part, start):
            cloud = UsdGeom.Points(prim)
            if not prim.GetAttribute("widths").HasAuthoredValue():
                cloud.CreateWidthsAttr(Vt.FloatArray(1, 2 * part.radius))
                cloud.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        elif part.kind == "Points":
            cloud = UsdGeom.Points(prim)
            cloud.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.arange(n, dtype=np.int64)))
            cloud.CreateWidthsAttr(Vt.FloatArray(n, 2 * part.radius))
        elif part.kind == "BasisCurves":
            curves = UsdGeom.BasisCurves(prim)
            curves.CreateTypeAttr(UsdGeom.Tokens.linear)
            curves.CreateWrapAttr(UsdGeom.Tokens.nonperiodic)
            if part.trail:
                curves.CreateWidthsAttr(Vt.FloatArray(1, 2 * part.radius))
                curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
            else:
                assert part.counts is not None
                curves.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(part.counts.astype(np.int32)))
                if part.taper is None:
                    widths = Vt.FloatArray(n, 2 * part.radius)
                else:
                    each = np.tile(2 * part.taper, len(part.counts)).astype(np.float32)
                    widths = Vt.FloatArray.FromNumpy(each)
                curves.CreateWidthsAttr(widths)
                curves.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
        else:
            mesh = UsdGeom.Mesh(prim)
            triangles = part.thing.triangles.astype(np.int32)
            mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(triangles), 3))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(triangles.ravel())))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if part.cut else UsdGeom.Tokens.vertex)
            mesh.CreateDoubleSidedAttr(part.thing.form == "surface")
            texture = part.thing.texture
            if texture is not None and len(texture) == 3 * len(triangles):
                st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
                    "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
                )
                st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(texture, dtype=np.float32)))
        look = UsdShade.Material.Define(stage, f"{ROOT}/looks/{part.path[len(ROOT) + 1 :]}")
        shader = UsdShade.Shader.Define(stage, look.GetPath().AppendChild("surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        paint = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        paint.Set(color)
        if colored:
            reader = UsdShade.Shader.Define(stage, look.GetPath().AppendChild("colors"))
            reader.CreateIdAttr("UsdPrimvarReader_float3")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
            out = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
            paint.ConnectToSource(reader.ConnectableAPI(), out.GetBaseName())
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.8 if part.thing.form == "surface" else 0.4)
        look.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(look)
    return layer


def _volume(stage: Any, part: Part, stem: str, run: Recording, table: Mapping[str, Any]) -> None:
    """A volume with a field for each grid of its files."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdVol, Vt

    grid = part.thing.grid
    assert grid is not None
    volume = UsdVol.Volume(stage.GetPrimAtPath(part.path))
    low, high = grid.origin, grid.origin + grid.size
    volume.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())]))
    UsdGeom.Gprim(volume).CreateDisplayColorAttr([Gf.Vec3f(*part.thing.color)])
    for name, width in vdb.fields(grid, table).items():
        field = UsdVol.OpenVDBAsset.Define(stage, f"{part.path}/{_identifier(name)}")
        volume.CreateFieldRelationship(_identifier(name), field.GetPath())
        field.CreateFieldNameAttr(name)
        field.CreateFieldDataTypeAttr("float" if width == 1 else "float3")
        field.CreateVectorDataRoleHintAttr("None" if width == 1 else "Vector")
        if name in FOG:
            field.CreateFieldClassAttr("fogVolume")
        elif width == 3 and (name.endswith("_faces") or "velocity" not in table):
            field.CreateFieldClassAttr("staggered")
        file = field.CreateFilePathAttr()
        file.Set(Sdf.AssetPath(f"../volumes/{vdb.path(stem, 0)}"))
        for i in range(run.n_frames):
            file.Set(Sdf.AssetPath(f"../volumes/{vdb.path(stem, i)}"), Usd.TimeCode(i))


def _scene(run: Recording, hashes: str) -> Any:
    """The root: frame rate, camera, lights, and where the rest is."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    _units(stage)
    rate = _rate(run)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(run.n_frames - 1)
    stage.SetMetadata("customLayerData", {"creator": "tumble"})
    root = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    stage.SetDefaultPrim(root)
    if run.scene.get("title"):
        root.SetDisplayName(str(run.scene["title"]))

    view = camera(run)
    lens = UsdGeom.Camera.Define(stage, f"{ROOT}/camera")
    lens.AddTransformOp().Set(_placed(view.axes[0], view.axes[1], -view.axes[2], view.position))
    sensor = 10 * view.width if view.parallel else SENSOR
    if view.parallel:
        lens.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
    else:
        lens.CreateFocalLengthAttr(sensor * view.distance / view.width)
    lens.CreateHorizontalApertureAttr(sensor)
    lens.CreateVerticalApertureAttr(sensor * view.height / view.width)
    lens.CreateFocusDistanceAttr(view.distance)
    lens.CreateClippingRangeAttr(Gf.Vec2f(1e-3 * view.distance, 1e3 * view.distance))

    key = UsdLux.DistantLight.Define(stage, f"{ROOT}/key_light")
    key.CreateIntensityAttr(1.0)
    key.CreateNormalizeAttr(True)
    key.CreateAngleAttr(12.0)
    toward = key_light(view)
    across = np.cross(view.axes[1], toward)
    across /= np.linalg.norm(across)
    key.AddTransformOp().Set(_placed(across, np.cross(toward, across), toward, np.zeros(3)))
    sky = UsdLux.DomeLight.Define(stage, f"{ROOT}/sky")
    sky.CreateIntensityAttr(0.5)
    sky.CreateColorAttr(Gf.Vec3f(0.95, 1.0, 1.08))

    # Last, and beneath the stage, which would look for the files while they have no place yet.
    del stage
    spec = layer.GetPrimAtPath(ROOT)
    spec.referenceList.Prepend(Sdf.Reference("./usd/objects.usdc"))
    clips = {
        "primPath": ROOT,
        "manifestAssetPath": Sdf.AssetPath("./usd/manifest.usda"),
        "templateAssetPath": f"./usd/frame.{hashes}.usdc",
        "templateStartTime": 0.0,
        "templateEndTime": float(run.n_frames - 1),
        "templateStride": 1.0,
    }
    spec.SetInfo("clips", {"default": clips})
    return layer


def _rate(run: Recording) -> float:
    """Frames, and so time codes, a second: a layer that says otherwise is stretched."""
    return float(run.scene.get("time", {}).get("fps", 24.0))


def _units(stage: Any) -> None:
    from pxr import UsdGeom, UsdPhysics

    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)


def _placed(x: Any, y: Any, z: Any, origin: Any) -> Any:
    """The matrix that takes the axes to x, y, z and 0 to the origin; USD multiplies from the left with rows."""
    from pxr import Gf

    rows = np.eye(4)
    rows[:3, :3] = np.stack([x, y, z])
    rows[3, :3] = origin
    return Gf.Matrix4d(rows.tolist())


def _save(layer: Any, path: Path) -> None:
    """Writes a layer under a temporary name, then renames it."""
    unfinished = path.with_name(f"{path.stem}.part{path.suffix}")
    try:
        if not layer.Export(str(unfinished)):
            raise OSError(f"{path.name} could not be written")
        unfinished.replace(path)
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
