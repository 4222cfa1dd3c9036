"""Frames of an animated file by name: `walk.usda/24.usda` is what walk.usda shows at time code 24.

Nothing can stand below a file, so that such a name leads to no other file. A resolved scene names the frames of its
colliders in this way, and so do its runs and checkpoints."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tumble.usd.motion import Motion, written
from tumble.usd.stage import Floats, Indices, is_animated, open_stage
from tumble.usd.told import STANDS, Key, doubts, is_usd, key, moves, stiff, warn

Timing = list[tuple[float, float]]
"""Time [s] and time code of each frame."""

_PLACED = ("scale", "rotate", "translate", "shell")
"""Words of a mesh that an animated one has, too."""

_read: dict[tuple[Key, float], tuple[Floats, Indices]] = {}
"""Points and triangles that `moved` has read, for `frame`, which is asked for them next."""


def parted(path: Path | str) -> tuple[Path, float] | None:
    """File and time code of a frame; None for the name of a whole file."""
    path = Path(path)
    if not (is_usd(path) and is_usd(path.parent) and path.parent.is_file()):
        return None
    try:
        code = float(path.stem)
    except ValueError:
        return None
    return (path.parent, code) if math.isfinite(code) else None


def named(path: str, code: float) -> str:
    """Name of a frame of a file."""
    return f"{path}/{int(code) if code.is_integer() else code!r}{Path(path).suffix}"


def frame(path: Path, code: float) -> str:
    """The mesh of a file at a time code, in the triangles of its start, as OBJ in metres, z up. Raises ValueError."""
    if (found := _read.pop((key(path), code), None)) is not None:
        return written(*found)
    told = [doubt for doubt in doubts(path) if doubt[0] != STANDS]
    warn(path, told)
    return Motion(path).obj(code)


def moved(colliders: Sequence[Mapping[str, Any]], folder: Path | str, span: float) -> list[tuple[int, dict[str, Any]]]:
    """Number and new shape, an `animated_mesh`, of each collider of a scene of `span` [s] whose mesh is an animated USD file;
    also of one whose frames come from here, for a scene of another span. What cannot be read, or cannot move as faces come
    and go, is left as it is."""
    _read.clear()
    known: dict[Path, Timing] = {}
    found = []
    for k, collider in enumerate(colliders):
        words, given = _words(collider["shape"], Path(folder))
        if words is None or not is_usd(words["path"]):
            continue
        file = Path(folder) / words["path"]
        timing = known[file] if file in known else known.setdefault(file, _timing(file, span))
        if not timing or (given and not _same(given, timing)):
            continue
        kept = {name: words[name] for name in _PLACED if name in words}
        frames = [
            {"time": time, "path": named(words["path"], code), "hash": words.get("hash")} for time, code in timing
        ]
        found.append((k, {"animated_mesh": {"frames": frames} | kept}))
    return found


def _words(shape: Mapping[str, Any], folder: Path) -> tuple[Mapping[str, Any] | None, Timing]:
    """Words of the mesh that may move, and the frames that it has already, if it has."""
    if words := shape.get("mesh"):
        return words, []
    frames = shape.get("animated_mesh", {}).get("frames", [])
    parts = [(one, parted(folder / one["path"])) for one in frames]
    # A single one is a pose, which stands.
    if len(frames) < 2 or any(part is None or part[0] != folder / _file(frames[0]) for _, part in parts):
        return None, []
    timing = [(float(one["time"]), part[1]) for one, part in parts if part is not None]
    return shape["animated_mesh"] | {"path": _file(frames[0]), "hash": frames[0].get("hash")}, timing


def _file(frame: Mapping[str, Any]) -> str:
    return str(frame["path"]).rpartition("/")[0]


def _same(given: Timing, timing: Timing) -> bool:
    """Whether frames are those of a file at its own times, of which the last may be that of another end."""
    n = max(min(len(given), len(timing)) - 1, 1)
    return all(a[1] == b[1] and abs(a[0] - b[0]) < 1e-9 for a, b in zip(given[:n], timing[:n], strict=True))


def _timing(file: Path, span: float) -> Timing:
    """The frames of a file, which are read; none if it does not move."""
    try:
        where = key(file)
        stiff.pop(where, None)
        if not (is_animated(open_stage(file)) and moves(file)):
            return []
        motion = Motion(file, span)
        codes = motion.codes()
        read = [motion.points(code) for code in codes]
    except OSError:
        return []
    except ValueError as error:
        # One that cannot be read at all is told when its mesh is.
        stiff[where] = str(error)
        return []
    _read.update(((where, code), (points, motion.triangles)) for code, points in zip(codes, read, strict=True))
    warn(file, [doubt for doubt in doubts(file) if doubt[0] != STANDS])
    return [(motion.time(code), code) for code in codes]
