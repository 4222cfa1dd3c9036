"""A camera of a USD file as the words of `[camera]` in a scene."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tumble.usd.stage import names, open_stage, start, upright

_WIDTH = 640
"""Width of pictures [pixel]; their height follows from the camera's aperture."""

_LEVEL = 0.5
"""Roll that is not told [°]."""


def camera(path: Path | str, prim: str | None = None) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Words of a file's camera at its start, by default of the only one, and code and message of what they cannot say. Raises
    ValueError."""
    from pxr import Usd, UsdGeom

    stage = open_stage(path)
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
    lens = UsdGeom.Camera(found[where])
    time = Usd.TimeCode(start(stage))
    seen = lens.GetCamera(time)
    if seen.projection == seen.Orthographic:
        raise ValueError(f"{where} is orthographic, and cameras of scenes in space are not; make it a perspective one")
    place = np.array(lens.ComputeLocalToWorldTransform(time)) @ upright(stage)
    up, back = (row / np.linalg.norm(row) for row in place[1:3, :3])
    away = float(seen.focusDistance) * float(np.linalg.norm(place[2, :3]))
    position = place[3, :3]
    wide, high = seen.horizontalAperture, seen.verticalAperture
    words = {
        "position": [round(float(x), 6) for x in position],
        "target": [round(float(x), 6) for x in position - (away if away > 0 else 1.0) * back],
        "view_angle": round(float(np.degrees(2 * np.arctan2(0.5 * wide, seen.focalLength))), 4),
        "resolution": [_WIDTH, int(2 * np.clip(round(0.5 * _WIDTH * high / wide), 8, 4096))],
    }
    return words, list(_doubts(found[where], up, back))


def _doubts(prim: Any, up: Any, back: Any) -> Iterator[tuple[str, str]]:
    """What a camera of a scene, which is upright and stands, is not."""
    from pxr import UsdGeom

    level = np.cross([0.0, 0.0, 1.0], back)
    across = float(np.linalg.norm(level))
    # One that looks straight up or down has no roll.
    roll = np.degrees(np.arctan2(up @ level, up @ np.cross(back, level))) if across > 1e-3 else 0.0
    if abs(roll) > _LEVEL:
        yield ("camera-in", f"{prim.GetPath()} is rolled by {abs(roll):.3g}°, and cameras of scenes stand upright")
    xforms = [UsdGeom.Xformable(p) for p in _with_parents(prim) if p.IsA(UsdGeom.Xformable)]
    zooms = UsdGeom.Camera(prim).GetFocalLengthAttr().ValueMightBeTimeVarying()
    if zooms or any(x.TransformMightBeTimeVarying() for x in xforms):
        yield ("camera-in", f"{prim.GetPath()} moves, and cameras of scenes stand: it is taken as it is at the start")


def _with_parents(prim: Any) -> list[Any]:
    found = [prim]
    while found[-1].GetParent():
        found.append(found[-1].GetParent())
    return found
