"""Meshes of USD files, by OpenUSD (package usd-core), as text that the engine reads.

Lengths become metres (`metersPerUnit`), z points up (`upAxis`). What is shown is read: polygon meshes, the shapes that
USD names (Sphere, Cube and so on) as polygons, native instances and those of a PointInstancer, skinned meshes in their
pose. What is invisible, or of purpose guide or proxy, is left out. What else there is to tell is in `doubts`.
"""

import warnings
from pathlib import Path
from typing import Any

from tumble.usd.stage import Reading, open_stage

__all__ = ["SUFFIXES", "UsdWarning", "as_obj", "bake", "camera", "doubts", "is_usd", "moves"]

_told: dict[tuple[str, int, int], list[tuple[str, str]]] = {}
"""Doubts about files, by path, time of change and size."""

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


class UsdWarning(UserWarning):
    """What a USD file holds and is not as it seems in a scene."""


def as_obj(path: Path | str) -> str:
    """All meshes of a file at its start time, as one OBJ in metres, z up. Warns of what is not used. Raises ValueError."""
    reading = Reading(open_stage(path))
    text = reading.obj()
    told = _told[_key(path)] = reading.doubts()
    for code, message in told:
        cure = "; tumble.usd.bake writes their motion" if code == "stands-still" else ""
        warnings.warn(f"{path}: {message}{cure}", UsdWarning, stacklevel=2)
    return text


def doubts(path: Path | str) -> list[tuple[str, str]]:
    """Code, as in docs/warnings.md, and message of all that is to be told of a file. Raises ValueError."""
    key = _key(path)
    if key not in _told:
        reading = Reading(open_stage(path))
        reading.surfaces()
        _told[key] = reading.doubts()
    return _told[key]


def bake(
    path: Path | str, folder: Path | str, duration: float = float("inf"), mended: bool = False
) -> list[tuple[float, Path]]:
    """Writes the meshes of an animated file into a folder, one for each frame of the file until `duration` [s] is over,
    and returns time [s] and file of each, as `shape.animated_mesh` takes them; `mended` as `repair_mesh` does it, all
    alike. Raises ValueError."""
    from tumble.usd.motion import bake

    return bake(path, Path(folder), duration, mended)


def camera(path: Path | str, prim: str | None = None) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """The words of `[camera]` for a file's camera at its start, by default for the only one, and code and message of what
    they cannot say. Raises ValueError."""
    from tumble.usd.cameras import camera

    return camera(path, prim)


def moves(path: Path | str) -> bool:
    """Whether what a file shows is animated. Raises ValueError."""
    return any(code == "stands-still" for code, _ in doubts(path))


def is_usd(path: Path | str) -> bool:
    """Whether a file has one of the suffixes of USD."""
    return Path(path).suffix.lower() in SUFFIXES


def _key(path: Path | str) -> tuple[str, int, int]:
    about = Path(path).stat()
    return str(Path(path).resolve()), about.st_mtime_ns, about.st_size
