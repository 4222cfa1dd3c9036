"""Cameras of USD files: as the words of `[camera]` in a scene, and as shots, which pictures follow from frame to frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tumble.usd.stage import Floats, end, names, open_stage, start, upright
from tumble.usd.told import Doubt, is_usd

_WIDTH = 640
"""Width of pictures [pixel]; their height follows from the camera's aperture."""

_LEVEL = 0.5
"""Roll that is not told [°]."""


@dataclass(frozen=True)
class Lens:
    """A camera at one time."""

    position: Floats
    up: Floats
    """Unit vector upwards in the picture."""
    back: Floats
    """Unit vector against the view."""
    spread: float
    """Width of the picture over the distance."""
    ratio: float
    """Height of the picture over its width."""
    focus: float
    """Distance [m] at which it is sharp, 1 if the file does not say."""


class Shot:
    """A camera of a file over time."""

    def __init__(self, source: Path | str, prim: str | None = None) -> None:
        """FILE, or FILE:PRIM; without a prim the only camera of the file. Raises ValueError."""
        path, prim = (str(source), prim) if prim is not None else _parted(str(source))
        if not is_usd(path) or not Path(path).is_file():
            raise ValueError(
                "there is no such USD file; give one that has a camera, as in shot.usda or shot.usda:/cameras/a"
            )
        self.stage = open_stage(path)
        self.prim = _camera(self.stage, prim)
        self.name = str(self.prim.GetPath())
        self.start, self.end = start(self.stage), end(self.stage)
        self.rate = float(self.stage.GetTimeCodesPerSecond())
        self.at(0.0)

    def at(self, time: float) -> Lens:
        """At a time [s], of which 0 is the first frame of the file; it stands before that and after the last. Raises
        ValueError for a camera of parallel rays."""
        from pxr import Usd, UsdGeom

        lens = UsdGeom.Camera(self.prim)
        code = Usd.TimeCode(float(np.clip(self.start + time * self.rate, self.start, max(self.start, self.end))))
        seen = lens.GetCamera(code)
        if seen.projection == seen.Orthographic:
            raise ValueError(
                f"{self.name} is orthographic, and cameras of scenes in space are not; make it a perspective one"
            )
        if not (seen.focalLength > 0 and seen.horizontalAperture > 0 and seen.verticalAperture > 0):
            raise ValueError(
                f"{self.name} has a lens or an aperture without size; the file is damaged, export it again"
            )
        place = np.array(lens.ComputeLocalToWorldTransform(code)) @ upright(self.stage)
        up, back = (row / np.linalg.norm(row) for row in place[1:3, :3])
        focus = float(seen.focusDistance) * float(np.linalg.norm(place[2, :3]))
        spread, ratio = seen.horizontalAperture / seen.focalLength, seen.verticalAperture / seen.horizontalAperture
        return Lens(place[3, :3], up, back, float(spread), float(ratio), focus if focus > 0 else 1.0)

    @property
    def moves(self) -> bool:
        """Whether its place or its lens varies with time."""
        from pxr import UsdGeom

        xforms = [UsdGeom.Xformable(p) for p in _with_parents(self.prim) if p.IsA(UsdGeom.Xformable)]
        lens = UsdGeom.Camera(self.prim)
        zooms = any(
            a.ValueMightBeTimeVarying()
            for a in (lens.GetFocalLengthAttr(), lens.GetHorizontalApertureAttr(), lens.GetVerticalApertureAttr())
        )
        return zooms or any(x.TransformMightBeTimeVarying() for x in xforms)

    def doubts(self) -> list[Doubt]:
        """Code and message of what no picture shows."""
        from pxr import UsdGeom

        lens = UsdGeom.Camera(self.prim)
        shifts = (lens.GetHorizontalApertureOffsetAttr(), lens.GetVerticalApertureOffsetAttr())
        shifted = any(a.ValueMightBeTimeVarying() or a.Get() for a in shifts)
        return [("camera-in", f"the lens of {self.name} is shifted, and is taken as centred")] if shifted else []


def camera(path: Path | str, prim: str | None = None) -> tuple[dict[str, Any], list[Doubt]]:
    """Words of a file's camera at its start, by default of the only one, and code and message of what they cannot say. Raises
    ValueError."""
    shot = Shot(path, prim)
    lens = shot.at(0.0)
    words = {
        "position": [round(float(x), 6) for x in lens.position],
        "target": [round(float(x), 6) for x in lens.position - lens.focus * lens.back],
        "view_angle": round(float(np.degrees(2 * np.arctan2(0.5 * lens.spread, 1.0))), 4),
        "resolution": list(size(lens, _WIDTH)),
    }
    return words, [*_unsaid(shot, lens), *shot.doubts()]


def size(lens: Lens, width: int) -> tuple[int, int]:
    """Width and height of its pictures [pixel], the height even."""
    return width, int(2 * np.clip(round(0.5 * width * lens.ratio), 8, 4096))


def _unsaid(shot: Shot, lens: Lens) -> Iterator[Doubt]:
    """What is lost of a camera in the words of a scene, whose are upright, at its start."""
    level = np.cross([0.0, 0.0, 1.0], lens.back)
    across = float(np.linalg.norm(level))
    # One that looks straight up or down has no roll.
    roll = np.degrees(np.arctan2(lens.up @ level, lens.up @ np.cross(lens.back, level))) if across > 1e-3 else 0.0
    if abs(roll) > _LEVEL:
        yield ("camera-in", f"{shot.name} is rolled by {abs(roll):.3g}°, and cameras of scenes stand upright")
    if shot.moves:
        yield (
            "camera-in",
            f"{shot.name} moves, and is taken as it is at the start; `tumble run`, `tumble render` and `tumble export` "
            "follow it with --camera",
        )


def _parted(source: str) -> tuple[str, str | None]:
    """File and prim of FILE:PRIM."""
    name, colon, prim = source.rpartition(":/")
    return (name, f"/{prim}") if colon and is_usd(name) else (source, None)


def _camera(stage: Any, prim: str | None) -> Any:
    """The prim of a camera, by default of the only one. Raises ValueError."""
    from pxr import Usd, UsdGeom

    found = {
        str(p.GetPath()): p for p in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Camera)
    }
    if not found:
        raise ValueError("there is no camera in it")
    if prim is None and len(found) > 1:
        raise ValueError(f"it has several cameras; name one of {names(list(found))}")
    where = prim or next(iter(found))
    if where not in found:
        raise ValueError(f"it has no camera {where}; there is {names(list(found))}")
    return found[where]


def _with_parents(prim: Any) -> list[Any]:
    found = [prim]
    while found[-1].GetParent():
        found.append(found[-1].GetParent())
    return found
