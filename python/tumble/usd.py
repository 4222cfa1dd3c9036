"""Meshes of USD files, by OpenUSD (package usd-core), as text that the engine reads."""

from pathlib import Path
from typing import Any


def as_obj(path: Path | str) -> str:
    """All meshes of a file at its first time, as one OBJ: placed as the file says, left-handed ones turned, with the texture
    coordinates `st`, `UVMap` or else the first that there are. Axes and units stay as they are. Raises ValueError."""
    try:
        from pxr import Gf, Tf, Usd, UsdGeom
    except ImportError:
        raise ValueError(
            "reading USD needs the package usd-core, which is not installed; "
            "pip install usd-core, or export the mesh as OBJ, PLY or GLB"
        ) from None
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        stage = None
    if stage is None:
        raise ValueError("OpenUSD cannot open it; it is damaged or no USD file, export it again")
    time = Usd.TimeCode.EarliestTime()
    cache = UsdGeom.XformCache(time)
    lines: list[str] = []
    first, first_texture = 1, 1
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh) or UsdGeom.Imageable(prim).ComputePurpose() in ("guide", "proxy"):
            continue
        mesh = UsdGeom.Mesh(prim)
        points = mesh.GetPointsAttr().Get(time) or []
        counts = list(mesh.GetFaceVertexCountsAttr().Get(time) or [])
        corners = list(mesh.GetFaceVertexIndicesAttr().Get(time) or [])
        if sum(counts) != len(corners) or any(not 0 <= i < len(points) for i in corners):
            raise ValueError(f"{prim.GetPath()}: its faces do not fit its points; the file is damaged, export it again")
        place: Any = cache.GetLocalToWorldTransform(prim)
        for point in points:
            x, y, z = place.Transform(Gf.Vec3d(point))
            lines.append(f"v {x!r} {y!r} {z!r}")
        texture, by_corner = _texture(prim, time, len(corners), len(points))
        lines += [f"vt {u!r} {v!r}" for u, v in texture]
        mirrored = (mesh.GetOrientationAttr().Get(time) == "leftHanded") != (place.GetDeterminant() < 0)
        start = 0
        for n in counts:
            face = list(range(start, start + n))
            start += n
            if n < 3:
                continue
            if mirrored:
                face = [face[0], *reversed(face[1:])]
            words = []
            for k in face:
                t = f"/{first_texture + (k if by_corner else corners[k])}" if texture else ""
                words.append(f"{first + corners[k]}{t}")
            lines.append("f " + " ".join(words))
        first += len(points)
        first_texture += len(texture)
    if first == 1:
        raise ValueError("there is no mesh in it; export a polygon mesh")
    return "\n".join(lines) + "\n"


def _texture(prim: Any, time: Any, n_corners: int, n_points: int) -> tuple[list[tuple[float, float]], bool]:
    """Texture coordinates of a mesh, and whether they are by corner or by point; none if there are none that fit."""
    from pxr import UsdGeom

    all_of = UsdGeom.PrimvarsAPI(prim)
    named = [all_of.GetPrimvar(name) for name in ("st", "UVMap")]
    others = [p for p in all_of.GetPrimvarsWithValues() if str(p.GetTypeName()).startswith("texCoord2")]
    for primvar in [*named, *others]:
        values = primvar.ComputeFlattened(time) if primvar and primvar.HasValue() else None
        if values is None:
            continue
        pairs = [(float(value[0]), float(value[1])) for value in values]
        if primvar.GetInterpolation() == UsdGeom.Tokens.faceVarying and len(pairs) == n_corners:
            return pairs, True
        if primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(pairs) == n_points:
            return pairs, False
    return [], False
