"""The layer of a stage that holds what does not change, and the state at the start: prims and their materials."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.columns import FOG
from tumble.export import vdb
from tumble.export.parts import (
    ROOT,
    Now,
    Numbers,
    Part,
    corners,
    deforms,
    identifier,
    placement,
    values,
    varying,
)
from tumble.pictures.things import Recording, Stage, by_night

GLOW = 1.2
"""Light of a particle by night, over its colour."""


def array(numbers: Numbers) -> Any:
    """Numbers as the library wants them."""
    from pxr import Vt

    if numbers.dtype == np.int32:
        return Vt.IntArray.FromNumpy(numbers)
    if numbers.dtype == np.int64:
        return Vt.Int64Array.FromNumpy(numbers)
    if numbers.ndim == 2 and numbers.shape[1] == 4:
        # Their memory has the real part last, as ours.
        kind = Vt.QuathArray if numbers.dtype == np.float16 else Vt.QuatfArray
        return kind.FromNumpy(numbers)
    return Vt.Vec3fArray.FromNumpy(numbers) if numbers.ndim == 2 else Vt.FloatArray.FromNumpy(numbers)


def fill(stage: Any, run: Recording, parts: list[Part], start: Now) -> None:
    """Defines the prims of all parts."""
    from pxr import Sdf, UsdGeom

    UsdGeom.Scope.Define(stage, f"{ROOT}/looks")
    files = vdb.paths(run)
    shown = Stage(run) if any(part.kind == "Volume" for part in parts) else None
    for part in parts:
        prim = stage.DefinePrim(part.path, part.kind)
        prim.SetDisplayName(part.title)
        if part.kind == "Volume":
            _volume(stage, part, files[part.thing.name], run, start.columns.get(part.thing.name, {}))
            seen = shown and shown.extinction(part.thing.name)
            if seen and seen[0] in FOG:
                extinction = prim.CreateAttribute("extinction", Sdf.ValueTypeNames.Float)
                extinction.Set(seen[2])
                extinction.SetDocumentation(f"Of the field {seen[0]} in pictures [1/m per unit of the field].")
            continue
        for name, kind, numbers in values(part, start):
            attribute = prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(kind), False)
            attribute.Set(array(numbers))
            if name.startswith("primvars:"):
                UsdGeom.Primvar(attribute).SetInterpolation(UsdGeom.Tokens.vertex)
        if part.kind == "PointInstancer":
            _instancer(prim)
            continue
        _place(prim, part, start)
        _constant(prim, part, start)
        _bind(stage, prim, part, start, by_night(run))
        if part.thing.form == "container":
            # It would hide what it contains.
            UsdGeom.Imageable(prim).CreatePurposeAttr(UsdGeom.Tokens.guide)


def _instancer(prim: Any) -> None:
    """Bodies that all have one mesh, which comes after them (`_mesh`)."""
    from pxr import UsdGeom, Vt

    bodies = UsdGeom.PointInstancer(prim)
    n = len(bodies.GetPositionsAttr().Get())
    bodies.CreateProtoIndicesAttr(Vt.IntArray(n, 0))
    bodies.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.arange(n, dtype=np.int64)))


def _place(prim: Any, part: Part, start: Now) -> None:
    from pxr import UsdGeom

    found = placement(part, start.columns)
    if found:
        order = UsdGeom.Xformable(prim)
        order.AddTranslateOp().Set(found[0][2])
        order.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(found[1][2])


def _constant(prim: Any, part: Part, start: Now) -> None:
    """Topology, widths, texture coordinates, ids and the position at rest."""
    from pxr import Sdf, UsdGeom, Vt

    n = len(prim.GetAttribute("points").Get())
    every = UsdGeom.PrimvarsAPI(prim)
    stays = not part.trail and part.thing.form != "liquid"
    if part.kind in ("Mesh", "BasisCurves") and deforms(part, start.columns) and stays:
        rest = every.CreatePrimvar("rest", Sdf.ValueTypeNames.Point3fArray, UsdGeom.Tokens.vertex)
        rest.Set(prim.GetAttribute("points").Get())
    if part.kind == "Points" and varying(part, start.columns):
        cloud = UsdGeom.Points(prim)
        if not prim.GetAttribute("widths").HasAuthoredValue():
            cloud.CreateWidthsAttr(Vt.FloatArray(1, 2 * part.radius))
            cloud.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    elif part.kind == "Points":
        cloud = UsdGeom.Points(prim)
        cloud.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.arange(n, dtype=np.int64)))
        _ids(every, n, UsdGeom.Tokens.vertex)
        cloud.CreateWidthsAttr(Vt.FloatArray(n, 2 * part.radius))
    elif part.kind == "BasisCurves":
        _curves(prim, part, n)
    else:
        _mesh(prim, part)


def _ids(primvars: Any, n: int, interpolation: str) -> None:
    """Numbers of points or curves as programs read them that know no `ids`."""
    from pxr import Sdf, Vt

    primvar = primvars.CreatePrimvar("id", Sdf.ValueTypeNames.IntArray, interpolation)
    primvar.Set(Vt.IntArray.FromNumpy(np.arange(n, dtype=np.int32)))


def _curves(prim: Any, part: Part, n: int) -> None:
    from pxr import UsdGeom, Vt

    curves = UsdGeom.BasisCurves(prim)
    curves.CreateTypeAttr(UsdGeom.Tokens.linear)
    curves.CreateWrapAttr(UsdGeom.Tokens.nonperiodic)
    if part.trail:
        curves.CreateWidthsAttr(Vt.FloatArray(1, 2 * part.radius))
        curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        return
    assert part.counts is not None
    curves.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(part.counts.astype(np.int32)))
    if part.taper is None:
        widths = Vt.FloatArray(n, 2 * part.radius)
    else:
        widths = Vt.FloatArray.FromNumpy(np.tile(2 * part.taper, len(part.counts)).astype(np.float32))
        _ids(UsdGeom.PrimvarsAPI(prim), len(part.counts), UsdGeom.Tokens.uniform)
        _texture(prim, part.texture, len(part.counts), UsdGeom.Tokens.uniform)
    curves.CreateWidthsAttr(widths)
    curves.SetWidthsInterpolation(UsdGeom.Tokens.vertex)


def _mesh(prim: Any, part: Part) -> None:
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh(prim)
    flat = corners(part, part.thing.triangles).astype(np.int32)
    sides = 3 if part.squares is None else 4
    if part.thing.form != "liquid":
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(flat) // sides, sides))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(flat)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if part.cut else UsdGeom.Tokens.vertex)
    mesh.CreateDoubleSidedAttr(part.thing.form == "surface")
    texture = part.texture
    if texture is not None and part.squares is not None and len(texture) == 3 * len(part.thing.triangles):
        texture = texture[part.squares.ravel()]
    _texture(prim, texture, len(flat), UsdGeom.Tokens.faceVarying)
    if bodies := UsdGeom.PointInstancer(prim.GetParent()):
        bodies.CreatePrototypesRel().SetTargets([prim.GetPath()])


def _texture(prim: Any, texture: npt.NDArray[Any] | None, n: int, interpolation: str) -> None:
    from pxr import Sdf, UsdGeom, Vt

    if texture is None or len(texture) != n:
        return
    st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(texture, dtype=np.float32)))


def _bind(stage: Any, prim: Any, part: Part, start: Now, night: bool) -> None:
    """A material of the object's own; by night its particles are lights."""
    from pxr import Gf, Sdf, UsdGeom, UsdShade

    color = Gf.Vec3f(*part.thing.color)
    colored = prim.GetAttribute("primvars:displayColor").HasAuthoredValue()
    if not colored:
        UsdGeom.Gprim(prim).CreateDisplayColorAttr([color])
    look = UsdShade.Material.Define(stage, f"{ROOT}/looks/{part.path.split('/')[2]}")
    shader = UsdShade.Shader.Define(stage, look.GetPath().AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    paints = [shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)]
    if night and part.thing.form == "points":
        paints.append(shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f))
    for paint in paints:
        paint.Set(color)
        if colored:
            reader = UsdShade.Shader.Define(stage, look.GetPath().AppendChild("colors"))
            reader.CreateIdAttr("UsdPrimvarReader_float3")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
            out = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
            paint.ConnectToSource(reader.ConnectableAPI(), out.GetBaseName())
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness(part))
    if part.thing.form == "liquid":
        shader.CreateInput("ior", Sdf.ValueTypeNames.Float).Set(1.33)
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.15)
    look.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(look)


def roughness(part: Part) -> float:
    """Of its material: cloth is rougher than all else, liquids are smooth."""
    return {"surface": 0.8, "liquid": 0.02}.get(part.thing.form, 0.4)


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
        field = UsdVol.OpenVDBAsset.Define(stage, f"{part.path}/{identifier(name)}")
        volume.CreateFieldRelationship(identifier(name), field.GetPath())
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
