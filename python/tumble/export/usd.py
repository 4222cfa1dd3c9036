"""A run as Universal Scene Description: scene.usda, and beside it usd/ with a layer per frame.

    scene.usda              camera, lights, frame rate; refers to objects.usdc; names the frames as value clips
    usd/objects.usdc        what does not change: topology, texture coordinates, ids, widths, colours, colliders; points at
                            the start
    volumes/NAME.FRAME.vdb  what lies on grids; Volume prims in objects.usdc name the files of all frames
    usd/manifest.usda       which attributes the frames hold
    usd/frame.000000.usdc   points, velocities, normals and extents of a frame, at time code 0; and so on; of particles
                            that come and go also ids, widths, colours and all other numbers that they have; of bodies,
                            whose mesh is in objects.usdc, where they are and how they are turned
    blender.py              if asked for: imports it into Blender and sets what a plain import loses

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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tumble._engine import ExportError
from tumble.export import DIGITS, physics, prims, vdb
from tumble.export.parts import ROOT, History, Now, Part, deforms, parts, placement, values, varying, velocities
from tumble.folder import writing
from tumble.pictures.framing import Camera, views
from tumble.pictures.look import NIGHT, key_light
from tumble.pictures.splats import DIM
from tumble.pictures.things import Columns, Recording, by_night, objects, with_hair

SENSOR = 0.36
"""Width of the camera's sensor [tenth of a metre], the unit that USD takes for lenses."""


def write(
    run: Recording,
    folder: str | os.PathLike[str],
    progress: Callable[[int, int], None] | None = None,
    volumes: bool = True,
    camera: str | None = None,
) -> Path:
    """Writes scene.usda and usd/ into a folder and returns the path of scene.usda, which is written last; also volumes/,
    if anything lies on a grid, unless told that it is there. `progress(done, total)` is called after each frame. `camera`,
    FILE or FILE:PRIM, is one of a USD file, which may move, instead of the scene's.
    Positions are single precision, bit for bit those of a run in single precision. Raises ExportError."""
    if run.n_frames < 1:
        raise ExportError("the run has no frames")
    view = views(run, camera)
    goal = Path(folder)
    layers = goal / "usd"
    start = run.frame(0)
    things = with_hair(run, objects(run))
    made, history = parts(run, things, start), History(things)
    beginning = history.ways(run.time(0), start)
    digits = max(DIGITS, len(str(run.n_frames - 1)))
    if volumes and vdb.grids(run):
        vdb.write(run, goal)
    first = None
    with _writing(goal / "scene.usda"):
        layers.mkdir(parents=True, exist_ok=True)
        for old in layers.glob("frame.*.usdc"):
            if not old.name[6:-5].isdigit() or len(old.name) != digits + 11 or int(old.name[6:-5]) >= run.n_frames:
                old.unlink()
        for i, before, columns, after in _frames(run, start, made):
            ways = beginning if i == 0 else history.ways(run.time(i), columns)
            now = Now(columns, ways, before, after, 1.0 / fps(run))
            first = first or now
            _save(_frame(made, now, i), layers / f"frame.{i:0{digits}d}.usdc")
            if progress is not None:
                progress(i + 1, run.n_frames)
        assert first is not None
        _save(_manifest(made, first), layers / "manifest.usda")
        _save(_objects(run, made, first), layers / "objects.usdc")
        scene = goal / "scene.usda"
        _save(_scene(run, "#" * digits, view), scene)
    return scene


def _frames(
    run: Recording, start: Columns, made: list[Part]
) -> Iterator[tuple[int, Columns | None, Columns, Columns | None]]:
    """Number and columns of each frame, and the columns of those beside it, if there is anything without velocities."""
    n = run.n_frames
    lone = Now(start, {})
    wide = n > 1 and any(
        p.kind not in ("Volume", "PointInstancer")
        and not p.trail
        and deforms(p, start)
        and not varying(p, start)
        and velocities(p, lone) is None
        for p in made
    )
    before, columns = None, start
    for i in range(n):
        if not wide:
            yield i, None, start if i == 0 else run.frame(i), None
            continue
        after = run.frame(i + 1) if i + 1 < n else None
        yield i, before, columns, after
        before, columns = columns, after if after is not None else columns


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


def _frame(made: list[Part], now: Now, i: int) -> Any:
    """The layer of a frame."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        for part in made:
            where = placement(part, now.columns)
            if where or deforms(part, now.columns):
                prim = Sdf.CreatePrimInLayer(layer, part.path)
            for name, kind, value in where:
                attribute = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
                layer.SetTimeSample(attribute.path, float(i), value)
            if deforms(part, now.columns):
                for name, kind, numbers in values(part, now):
                    attribute = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
                    layer.SetTimeSample(attribute.path, float(i), prims.array(numbers))
    return layer


def _manifest(made: list[Part], start: Now) -> Any:
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    for part in made:
        named = [(name, kind) for name, kind, _ in placement(part, start.columns)]
        if deforms(part, start.columns):
            named += [(name, kind) for name, kind, _ in values(part, start)]
        if named:
            prim = Sdf.CreatePrimInLayer(layer, part.path)
            for name, kind in named:
                Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.Find(kind))
    return layer


def _objects(run: Recording, made: list[Part], start: Now) -> Any:
    """Constant data and the initial state."""
    from pxr import Sdf, Usd, UsdGeom

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    _units(stage)
    stage.SetTimeCodesPerSecond(fps(run))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    prims.fill(stage, run, made, start)
    physics.fill(stage, run, made, start)
    return layer


def _scene(run: Recording, hashes: str, view: Callable[[int], Camera]) -> Any:
    """The root: frame rate, camera, lights, and where the rest is."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    _units(stage)
    rate = fps(run)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(run.n_frames - 1)
    stage.SetMetadata("customLayerData", {"creator": "tumble"})
    root = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    stage.SetDefaultPrim(root)
    if run.scene.get("title"):
        root.SetDisplayName(str(run.scene["title"]))

    _look(UsdGeom.Camera.Define(stage, f"{ROOT}/camera"), [view(i) for i in range(run.n_frames)])
    night = by_night(run)
    key = UsdLux.DistantLight.Define(stage, f"{ROOT}/key_light")
    key.CreateIntensityAttr(DIM if night else 1.0)
    key.CreateNormalizeAttr(True)
    key.CreateAngleAttr(12.0)
    toward = key_light(view(0))
    across = np.cross(view(0).axes[1], toward)
    across /= np.linalg.norm(across)
    key.AddTransformOp().Set(_placed(across, np.cross(toward, across), toward, np.zeros(3)))
    sky = UsdLux.DomeLight.Define(stage, f"{ROOT}/sky")
    strength, color = surroundings(night)
    sky.CreateIntensityAttr(strength)
    sky.CreateColorAttr(Gf.Vec3f(*color))

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


def _look(lens: Any, views: list[Camera]) -> None:
    """Places a camera, at each frame if it moves."""
    from pxr import Gf, UsdGeom

    place = lens.AddTransformOp()
    first, parallel = views[0], views[0].parallel
    sensors = [10 * v.width if parallel else SENSOR for v in views]
    if parallel:
        lens.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
    _set(lens.CreateHorizontalApertureAttr(), sensors)
    _set(lens.CreateVerticalApertureAttr(), [sensor * first.height / first.width for sensor in sensors])
    lens.CreateClippingRangeAttr(Gf.Vec2f(1e-3 * min(v.distance for v in views), 1e3 * max(v.distance for v in views)))
    matrices = [_placed(v.axes[0], v.axes[1], -v.axes[2], v.position) for v in views]
    _set(place, matrices)
    if not parallel:
        _set(lens.CreateFocalLengthAttr(), [float(np.float32(SENSOR * v.distance / v.width)) for v in views])


def _set(attribute: Any, values: list[Any]) -> None:
    """The values of all frames; one for all if they are alike."""
    if all(value == values[0] for value in values):
        attribute.Set(values[0])
        return
    for i, value in enumerate(values):
        attribute.Set(value, float(i))


def surroundings(night: bool) -> tuple[float, tuple[float, float, float]]:
    """Intensity and colour of the light from everywhere; by night that of the background of pictures."""
    if not night:
        return 0.5, (0.95, 1.0, 1.08)
    r, g, b = (0.5 * (low + high) for low, high in zip(*NIGHT, strict=True))
    return 1.0, (r, g, b)


def fps(run: Recording) -> float:
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
