"""Meshes and curves of USD files, by OpenUSD (package usd-core), as text that the engine reads.

Lengths become metres (`metersPerUnit`), z points up (`upAxis`). What is shown is read: polygon meshes, the shapes that
USD names (Sphere, Cube and so on) as polygons, native instances and those of a PointInstancer, skinned meshes in their
pose. What is invisible, or of purpose guide or proxy, is left out. What else there is to tell is in `doubts`.
"""

from pathlib import Path
from typing import Any

from tumble.usd.stage import Reading, open_stage
from tumble.usd.told import SUFFIXES, UsdWarning, doubts, is_usd, moves, note, warn

__all__ = [
    "SUFFIXES",
    "UsdWarning",
    "as_curves",
    "as_glb",
    "as_obj",
    "bake",
    "camera",
    "doubts",
    "is_usd",
    "moved",
    "moves",
]


def as_obj(path: Path | str) -> str:
    """All meshes of a file at its start time, or of FILE/CODE.usd at a time code, as one OBJ in metres, z up. Warns of what is
    not used. Raises ValueError."""
    from tumble.usd import frames

    if (part := frames.parted(path)) is not None:
        return frames.frame(*part)
    reading = Reading(open_stage(path))
    text = reading.obj()
    note(path, reading)
    warn(path, doubts(path), "tumble.usd.bake writes their motion")
    return text


def as_curves(path: Path | str) -> str:
    """All BasisCurves of a file at its start time, as polylines of one OBJ in metres, z up, for `hair.guides`. Warns of what is
    not used. Raises ValueError."""
    from tumble.usd.curves import Strands
    from tumble.usd.told import note_strands, of_strands

    reading = Strands(open_stage(path))
    text = reading.obj()
    note_strands(path, reading)
    warn(path, of_strands(path))
    return text


def as_glb(path: Path | str) -> bytes:
    """The skinned figure of a file, with its bones and its animation, as GLB, which `shape.character` reads. Raises
    ValueError."""
    from tumble.usd.figures import as_glb

    return as_glb(path)


def bake(
    path: Path | str, folder: Path | str, duration: float = float("inf"), mended: bool = False
) -> list[tuple[float, Path]]:
    """Writes the meshes of an animated file into a folder, one for each frame of the file until `duration` [s] is over,
    and returns time [s] and file of each, as `shape.animated_mesh` takes them; `mended` as `repair_mesh` does it, all
    alike. Raises ValueError."""
    from tumble.usd.motion import bake

    return bake(path, Path(folder), duration, mended)


def camera(path: Path | str, prim: str | None = None) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """The words of `[camera]` for a file's camera at its start, and code and message of what they cannot say. The camera is
    `prim`, or that of FILE:PRIM, by default the only one. Raises ValueError."""
    from tumble.usd.cameras import camera

    return camera(path, prim)


def moved(colliders: list[dict[str, Any]], folder: Path | str, span: float) -> list[tuple[int, dict[str, Any]]]:
    """Number and shape of each collider of a scene that lasts for `span` [s] whose mesh is an animated USD file, an
    `animated_mesh` of its frames; and of each `character` of one. The engine asks for it when it reads a scene."""
    from tumble.usd.frames import moved

    return moved(colliders, folder, span)
