"""Frames of an animated file by name: `walk.usda/24.usda` is what walk.usda shows at time code 24, and
`walk.usda/figure.glb` its skinned figure.

Nothing can stand below a file, so that such a name leads to no other file. A resolved scene names the frames of its
colliders in this way, and so do its runs and checkpoints."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tumble.usd.motion import Motion, written
from tumble.usd.stage import Floats, is_animated, open_stage
from tumble.usd.told import STANDS, Key, doubts, is_usd, key, moves, stiff, warn

FIGURE = "figure.glb"
"""Name, below that of a file, of its skinned figure."""

Timing = list[tuple[float, float]]
"""Time [s] and time code of each frame."""

_PLACED = ("scale", "rotate", "translate", "shell")
"""Words of a mesh that an animated one has, too."""

_read: dict[tuple[Key, float], tuple[Floats, str]] = {}
"""Points and faces that `moved` has read, for `frame`, which is asked for them next."""


def parted(path: Path | str) -> tuple[Path, float] | None:
    """File and time code of a frame; None for the name of a whole file."""
    path = Path(path)
    if not (is_usd(path) and is_usd(path.parent)) or path.parent.is_dir():
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
        return written(found[0]) + found[1]
    told = [doubt for doubt in doubts(path) if doubt[0] != STANDS]
    warn(path, told)
    return Motion(path).obj(code)


def moved(colliders: Sequence[Mapping[str, Any]], folder: Path | str, span: float) -> list[tuple[int, dict[str, Any]]]:
    """Number and new shape, an `animated_mesh`, of each collider of a scene of `span` [s] whose mesh is an animated USD file;
    also of one whose frames come from here, for a scene of another span; and a `character` of its figure by name. What cannot
    be read, or cannot move as faces come and go, is left as it is."""
    _read.clear()
    known: dict[Path, tuple[Timing, float]] = {}
    found = []
    for k, collider in enumerate(colliders):
        if is_usd((figure := collider["shape"].get("character", {})).get("path", "")):
            found.append((k, {"character": {**figure, "path": f"{figure['path']}/{FIGURE}"}}))
        words, given = _words(collider["shape"], Path(folder))
        if words is None or not is_usd(words["path"]):
            continue
        file = Path(folder) / words["path"]
        kept = {name: words[name] for name in _PLACED if name in words}
        if given and not file.exists():
            # One fault instead of one for each frame.
            found.append((k, {"mesh": {"path": words["path"]} | kept}))
            continue
        timing, step = known[file] if file in known else known.setdefault(file, _timing(file, span))
        if given and not (len(timing) > 1 and _same(given, timing, step)):
            timing = given
        if timing:
            frames = [{"time": time, "path": named(words["path"], code)} for time, code in timing]
            # All have the content of one file: one fault if it has changed.
            frames[0]["hash"] = words.get("hash")
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


def _same(given: Timing, timing: Timing, step: float) -> bool:
    """Whether frames are those of a file, `step` time codes apart, at its own times, until this or another end, which may be
    between two of them."""
    (t, start), (later, code) = timing[0], timing[-1]
    n = min(len(given), len(timing)) - 1
    meant = [t + (one - start) * (later - t) / (code - start) for _, one in given]
    regular = [one for _, one in given[:n]] == [one for _, one in timing[:n]]
    whole = given[-1][1] - given[-2][1] < 1.001 * step
    return regular and whole and np.allclose([time for time, _ in given], meant, rtol=0, atol=1e-9)


def _timing(file: Path, span: float) -> tuple[Timing, float]:
    """The frames of a file, which are read, and the time codes between two; none if it does not move."""
    try:
        where = key(file)
        stiff.pop(where, None)
        if not (is_animated(open_stage(file)) and moves(file)):
            return [], 0.0
        motion = Motion(file, span)
        codes = motion.line.codes()
        read = [motion.points(code) for code in codes]
    except OSError:
        return [], 0.0
    except ValueError as error:
        # One that cannot be read at all is told when its mesh is.
        stiff[where] = str(error)
        return [], 0.0
    _read.update(((where, code), (points, motion.faces)) for code, points in zip(codes, read, strict=True))
    warn(file, [doubt for doubt in doubts(file) if doubt[0] != STANDS])
    return [(motion.line.time(code), code) for code in codes], motion.line.step
