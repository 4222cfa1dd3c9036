"""A stage read at one time: its surfaces, placed in metres with z up, and what of it cannot be used."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.usd.shapes import AROUND, SHAPES, polygons

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_NAMED = 6
"""Prims that are named in a message; of more the number is told."""

MOST = 20_000_000
"""Points that are read of a file, at most: a few words can place instances of instances without end."""

_SHOWN = ("default", "render")
"""Purposes of what is read."""


@dataclass(frozen=True)
class Surface:
    """Polygons of a prim: `counts` corners of each, `corners` into points [m], counter-clockwise seen from outside."""

    path: str
    points: Floats
    counts: Indices
    corners: Indices
    texture: Floats
    """Texture coordinates n x 2, of corners or of points; empty if there are none."""
    by_corner: bool = False


def open_stage(path: Path | str) -> Any:
    """The stage of a file. Raises ValueError."""
    try:
        from pxr import Tf, Usd
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
    return stage


def upright(stage: Any) -> Floats:
    """Matrix for rows, 4 x 4, from the units and axes of a stage to metres with z up."""
    from pxr import UsdGeom

    matrix = np.eye(4)
    up = UsdGeom.GetStageUpAxis(stage)
    if up == UsdGeom.Tokens.y:
        matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    elif up == UsdGeom.Tokens.x:
        matrix[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    matrix[:3] *= UsdGeom.GetStageMetersPerUnit(stage)
    return matrix


def start(stage: Any) -> float:
    """Time code at which the stage begins, which is t = 0 of a scene: the one that it names, else its first sample."""
    if stage.HasAuthoredTimeCodeRange():
        return float(stage.GetStartTimeCode())
    return float(min((t for t, _ in _spans(stage)), default=0.0))


def end(stage: Any) -> float:
    """Time code at which the stage ends: the one that it names, else its last sample."""
    if stage.HasAuthoredTimeCodeRange():
        return float(stage.GetEndTimeCode())
    return float(max((t for _, t in _spans(stage)), default=0.0))


def is_animated(stage: Any) -> bool:
    """Whether any value of a stage, seen or not, varies with time."""
    return next(_spans(stage), None) is not None


def _spans(stage: Any) -> Iterator[tuple[float, float]]:
    """Time codes of the first and the last sample of each attribute that has several."""
    for attribute in _varying(stage):
        if times := attribute.GetTimeSamples():
            yield times[0], times[-1]


def _varying(stage: Any) -> Iterator[Any]:
    """All attributes that vary with time."""
    from pxr import Usd

    # Prototypes may stand below what is no more than an "over".
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)):
        yield from (a for a in prim.GetAttributes() if a.ValueMightBeTimeVarying())


class Reading:
    """What a stage shows at a time code, by default its start."""

    wanted, words = "polygon meshes", "mesh"
    """What is read, and which words of a scene take it."""

    def __init__(self, stage: Any, time: float | None = None) -> None:
        from pxr import Usd, UsdGeom

        self.stage = stage
        self.code = start(stage) if time is None else time
        self.time = Usd.TimeCode(self.code)
        self.places = UsdGeom.XformCache(self.time)
        self.unused: list[str] = []
        self.shaped: list[str] = []
        self.smooth: list[str] = []
        self.hidden: list[str] = []
        self.moving: list[str] = []
        self.found: list[Surface] | None = None
        self.points = 0
        self._within: list[str] = []

    def surfaces(self) -> list[Surface]:
        """All that has polygons, in the order of the file. Raises ValueError."""
        if self.found is None:
            try:
                pose(self.stage, self.code)
                self.found = list(self._walk(self.stage.GetPseudoRoot(), upright(self.stage), False))
            except RuntimeError as error:  # of the library
                reasons = str(error).strip().splitlines()[-1].partition(" : ")[2].strip("'")
                raise ValueError(
                    f"OpenUSD cannot read it: {reasons or error}; it is damaged, export it again"
                ) from None
        return self.found

    def obj(self) -> str:
        """The surfaces as one OBJ. Raises ValueError if there are none."""
        if not self.surfaces():
            left = f"; what is in it cannot be used: {names(self.unused)}" if self.unused else ""
            left += f"; left out as invisible, guide or proxy: {names(self.hidden)}" if self.hidden else ""
            if any(name.endswith("(BasisCurves)") for name in self.unused):
                left += "; hair takes curves as guides = { path = ... }"
            raise ValueError(f"there is no mesh in it{left}; export a polygon mesh that is visible")
        return obj(self.surfaces())

    def doubts(self) -> list[tuple[str, str]]:
        """Code and message of all that is to be told, once the surfaces have been read."""
        return list(self._doubts())

    def _doubts(self) -> Iterator[tuple[str, str]]:
        from pxr import UsdGeom

        if self.unused:
            yield (
                "unread-prims",
                f"left out, as they are no {self.wanted}: {names(self.unused)}; convert them if they matter",
            )
        if self.shaped:
            yield (
                "read-as-polygons",
                f"read as polygons, {AROUND} around: {names(self.shaped)}; a collider with a shape of its own is exact",
            )
        if self.smooth:
            yield (
                "control-mesh",
                f"subdivision surfaces, read as their control meshes, which are larger: {names(self.smooth)}; subdivide them "
                "before the export",
            )
        if not UsdGeom.StageHasAuthoredMetersPerUnit(self.stage):
            yield (
                "unsaid-units",
                'its lengths are read as centimetres, as OpenUSD has it for files without "metersPerUnit"; where they are '
                f"metres, give the {self.words} scale = 100, or add metersPerUnit = 1 to the file",
            )
        if broken := sorted({str(error) for error in self.stage.GetCompositionErrors()}):
            yield (
                "missing-layers",
                f"parts that it refers to cannot be read and are left out: {broken[0]}",
            )
        if self.moving:
            yield (
                "stands-still",
                f"animated in the file, and taken as at its start, time code {self.code:g}: {names(self.moving)}",
            )

    def _walk(self, prim: Any, place: Floats, moved: bool) -> Iterator[Surface]:
        """Surfaces of a prim and all below it; `place` is the matrix of what it is in, `moved` whether that moves."""
        from pxr import Usd, UsdGeom

        if prim.IsA(UsdGeom.Imageable):
            sight = UsdGeom.Imageable(prim).GetVisibilityAttr()
            if (
                sight.Get(self.time) == UsdGeom.Tokens.invisible
                or UsdGeom.Imageable(prim).ComputePurpose() not in _SHOWN
            ):
                if any(p.IsA(UsdGeom.Gprim) for p in Usd.PrimRange(prim)):
                    self.hidden.append(str(prim.GetPath()))
                return
            moved = moved or sight.ValueMightBeTimeVarying()
        if prim.IsA(UsdGeom.Xformable):
            own, alone = self.places.GetLocalTransformation(prim)
            place = np.array(own) @ (upright(self.stage) if alone else place)
            moved = moved or UsdGeom.Xformable(prim).TransformMightBeTimeVarying()
        if prim.IsA(UsdGeom.PointInstancer):
            yield from self._instances(UsdGeom.PointInstancer(prim), place, moved)
            return
        try:
            surface = self.surface(prim, place, moved)
        except (TypeError, KeyError):
            raise ValueError(
                f"{prim.GetPath()}: has a value of the wrong type; the file is damaged, export it again"
            ) from None
        if surface is not None:
            yield surface
        # Prototypes may stand below what is no more than an "over".
        there = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract if self._within else Usd.PrimDefaultPredicate
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(there)):
            yield from self._walk(child, place, moved)

    def _instances(self, instancer: Any, place: Floats, moved: bool) -> Iterator[Surface]:
        """What a PointInstancer places."""
        path = str(instancer.GetPath())
        kinds = np.array(instancer.GetProtoIndicesAttr().Get(self.time) or [])
        prims = [self.stage.GetPrimAtPath(p) for p in instancer.GetPrototypesRel().GetForwardedTargets()]
        if kinds.dtype.kind not in "iu":
            kinds = np.zeros(0, dtype=int)
        if not len(kinds) or not prims:
            self.unused.append(f"{path} (PointInstancer without instances)")
            return
        if max(kinds) >= len(prims) or min(kinds) < 0 or not all(prims):
            raise ValueError(
                f"{path}: its instances name prototypes that are not there; the file is damaged, export it again"
            )
        # The mask is applied to both alike; without the transform of the prototype itself, which `_walk` applies.
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, instancer.ExcludeProtoXform, instancer.IgnoreMask
        )
        mask = instancer.ComputeMaskAtTime(self.time) or [True] * len(kinds)
        if len(matrices) != len(kinds) or len(mask) != len(kinds):
            raise ValueError(f"{path}: its positions do not fit its indices; the file is damaged, export it again")
        if path in self._within:
            raise ValueError(f"{path}: is an instance of itself; the file is damaged, export it again")
        moved = moved or any(a.ValueMightBeTimeVarying() for a in instancer.GetPrim().GetAttributes())
        self._within.append(path)
        for kind, matrix, there in zip(kinds, matrices, mask, strict=True):
            if there:
                yield from self._walk(prims[int(kind)], np.array(matrix) @ place, moved)
        self._within.pop()

    def surface(self, prim: Any, place: Floats, moved: bool = False) -> Surface | None:
        """The polygons of a prim itself, placed; None if it has none."""
        from pxr import UsdGeom

        kind, path = str(prim.GetTypeName()), str(prim.GetPath())
        if not prim.IsA(UsdGeom.Gprim):
            return None
        if kind in SHAPES:
            points, counts, corners = polygons(prim, kind, self.time)
            texture, by_corner, left = np.zeros((0, 2)), False, False
            note(self.shaped, f"{path} ({kind})")
            attributes = prim.GetAttributes()
        elif prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            points, counts, corners = _polygons(mesh, self.time)
            if not len(corners):
                note(self.unused, f"{path} (Mesh without faces)")
                return None
            texture, by_corner = _texture(prim, self.time, len(corners), len(points))
            left = mesh.GetOrientationAttr().Get(self.time) == UsdGeom.Tokens.leftHanded
            scheme = mesh.GetSubdivisionSchemeAttr()
            if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none:
                note(self.smooth, f"{path} ({scheme.Get()})")
            attributes = [mesh.GetPointsAttr(), mesh.GetFaceVertexIndicesAttr()]
        else:
            note(self.unused, f"{path} ({kind})")
            return None
        if moved or any(a.ValueMightBeTimeVarying() for a in attributes) or is_posed(prim):
            note(self.moving, path)
        self.points += len(points)
        if self.points > MOST:
            raise ValueError(f"it has more than {MOST} points, instances included; export fewer, or simplify the mesh")
        points = points @ place[:3, :3] + place[3, :3]
        kept = counts >= 3
        if mesh_holes := _holes(prim, self.time):
            kept[[i for i in mesh_holes if 0 <= i < len(counts)]] = False
        order = _order(counts, kept, left != (np.linalg.det(place[:3, :3]) < 0))
        return Surface(path, points, counts[kept], corners[order], texture[order] if by_corner else texture, by_corner)


def obj(surfaces: list[Surface]) -> str:
    """Surfaces as one OBJ."""
    lines: list[str] = []
    first, first_texture = 1, 1
    for s in surfaces:
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in s.points.tolist()]
        lines += [f"vt {u!r} {v!r}" for u, v in s.texture.tolist()]
        words = [f"{first + k}" for k in s.corners.tolist()]
        if len(s.texture):
            seams = range(len(s.corners)) if s.by_corner else s.corners.tolist()
            words = [f"{word}/{first_texture + k}" for word, k in zip(words, seams, strict=True)]
        at = 0
        for n in s.counts.tolist():
            lines.append("f " + " ".join(words[at : at + n]))
            at += n
        first += len(s.points)
        first_texture += len(s.texture)
    return "\n".join(lines) + "\n"


def note(where: list[str], what: str) -> None:
    """Of prototypes that are placed many times once."""
    if what not in where:
        where.append(what)


def names(paths: list[str]) -> str:
    """Prims in a message."""
    more = f" and {len(paths) - _NAMED} more" if len(paths) > _NAMED else ""
    return ", ".join(paths[:_NAMED]) + more


def _polygons(mesh: Any, time: Any) -> tuple[Floats, Indices, Indices]:
    """Points, and the polygons of a mesh. Raises ValueError if they do not fit."""
    try:
        points = np.array(mesh.GetPointsAttr().Get(time) or [], dtype=float).reshape(-1, 3)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int64).ravel()
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int64).ravel()
    except ValueError as error:
        raise TypeError from error
    if counts.sum() != len(corners) or (counts < 0).any() or ((corners < 0) | (corners >= len(points))).any():
        raise ValueError(f"{mesh.GetPath()}: its faces do not fit its points; the file is damaged, export it again")
    return points, counts, corners


def _holes(prim: Any, time: Any) -> list[int]:
    """Faces that a mesh leaves out."""
    from pxr import UsdGeom

    return list(UsdGeom.Mesh(prim).GetHoleIndicesAttr().Get(time) or []) if prim.IsA(UsdGeom.Mesh) else []


def _order(counts: Indices, kept: npt.NDArray[np.bool_], turned: bool) -> Indices:
    """Corners of the faces that are kept, face by face; if they are turned, backwards from the second on."""
    n = counts[kept]
    first = (np.cumsum(counts) - counts)[kept]
    which = np.repeat(np.arange(len(n)), n)
    k = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
    if turned:
        k = (n[which] - k) % n[which]
    return np.asarray(first[which] + k)


def _texture(prim: Any, time: Any, n_corners: int, n_points: int) -> tuple[Floats, bool]:
    """Texture coordinates of a mesh, and whether they are by corner or by point; none if there are none that fit."""
    from pxr import UsdGeom

    all_of = UsdGeom.PrimvarsAPI(prim)
    named = [all_of.FindPrimvarWithInheritance(name) for name in ("st", "UVMap")]
    others = [p for p in all_of.GetPrimvarsWithValues() if str(p.GetTypeName()).startswith("texCoord2")]
    for primvar in [*named, *others]:
        values = primvar.ComputeFlattened(time) if primvar and primvar.HasValue() else None
        pairs = np.array(values if values is not None else [], dtype=float)
        if pairs.ndim != 2 or pairs.shape[1] != 2:
            continue
        if primvar.GetInterpolation() == UsdGeom.Tokens.faceVarying and len(pairs) == n_corners:
            return pairs, True
        if primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(pairs) == n_points:
            return pairs, False
    return np.zeros((0, 2)), False


def has_shapes(prim: Any) -> bool:
    """Whether a mesh has blend shapes."""
    from pxr import UsdSkel

    return bool(UsdSkel.BindingAPI(prim).GetBlendShapesAttr().Get())


def is_posed(prim: Any) -> bool:
    """Whether a skeleton or blend shapes that are animated deform a mesh."""
    from pxr import UsdSkel

    skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
    if not skeleton:
        return False
    source = UsdSkel.BindingAPI(skeleton.GetPrim()).GetInheritedAnimationSource()
    return bool(source) and any(a.ValueMightBeTimeVarying() for a in source.GetAttributes())


def pose(stage: Any, first: float, last: float | None = None) -> None:
    """Puts skinned meshes and blend shapes into their poses at a time code, or in an interval: points and transforms in the
    session layer, which no file gets."""
    from pxr import Gf, Usd, UsdSkel

    roots = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdSkel.Root)]
    if not roots:
        return
    # A layer of another rate would stretch what is written to it.
    stage.GetSessionLayer().timeCodesPerSecond = stage.GetTimeCodesPerSecond()
    stage.SetEditTarget(stage.GetSessionLayer())
    for prim in list(stage.Traverse()):
        if prim.IsInstance() and any(p.IsA(UsdSkel.Root) for p in Usd.PrimRange(prim, Usd.TraverseInstanceProxies())):
            # What stands in for an instance cannot be written to.
            prim.SetInstanceable(False)
    span = Gf.Interval(*_around(stage, first, first if last is None else last))
    for root in [p for p in stage.Traverse() if p.IsA(UsdSkel.Root)]:
        UsdSkel.BakeSkinning(UsdSkel.Root(root), span)


def _around(stage: Any, first: float, last: float) -> tuple[float, float]:
    """The interval from the last samples before to the first ones after: where it holds none, nothing is posed."""
    low, high = first, last
    for attribute in _varying(stage):
        low = min([low, *attribute.GetBracketingTimeSamples(first)[:1]])
        high = max([high, *attribute.GetBracketingTimeSamples(last)[1:2]])
    return low, high
