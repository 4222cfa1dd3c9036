"""The motion of a USD file as a sequence of meshes, which `shape.animated_mesh` takes."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tumble._engine import load_mesh
from tumble.folder import write_whole
from tumble.usd.stage import Floats, Indices, Reading, Surface, end, names, open_stage, pose, start

DIGITS = 6
"""Digits of the number of a mesh in the name of its file."""

_MOST = 100_000
"""Meshes that are written of a file, at most."""


def bake(path: Path | str, folder: Path, duration: float) -> list[tuple[float, Path]]:
    """Writes the meshes of a file into a folder, one for each of its frames from its start on, until it ends or `duration`
    [s] is over, and returns time [s] and file of each. Raises ValueError, also where faces come and go."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.obj"):
        if old.stem.isdigit():
            old.unlink()
    frames = []
    for k, (time, points, triangles) in enumerate(meshes(path, duration)):
        file = folder / f"{k:0{DIGITS}d}.obj"
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
        write_whole(file, ("\n".join(lines) + "\n").encode("ascii"))
        frames.append((time, file))
    return frames


def meshes(path: Path | str, duration: float) -> Iterator[tuple[float, Floats, Indices]]:
    """Time [s], points [m] and triangles, the same in all, of each frame. Raises ValueError."""
    stage = open_stage(path)
    first, last = start(stage), end(stage)
    per_second = float(stage.GetTimeCodesPerSecond())
    said = stage.HasAuthoredMetadata("framesPerSecond") and stage.GetFramesPerSecond() > 0
    step = per_second / float(stage.GetFramesPerSecond()) if said else 1.0
    last = min(last, first + duration * per_second)
    n = int((last - first) / step + 1e-6) + 1
    if n > _MOST:
        raise ValueError(f"its motion has {n} frames, {_MOST} are taken at most; shorten it, or simulate less")
    codes = [first + k * step for k in range(n)]
    if last - codes[-1] > 1e-3 * step:
        codes.append(last)
    pose(stage, first, last)
    whole = Reading(stage, first)
    triangles = _triangles(whole)
    used = np.unique(np.concatenate([s.corners + at for s, at in _each(whole)]))
    for code in codes:
        now = Reading(stage, code)
        _alike(whole, now)
        yield (code - first) / per_second, np.concatenate([s.points for s in now.surfaces()])[used], triangles


def _triangles(reading: Reading) -> Indices:
    """The triangles that the engine makes of the polygons, of the points that they use."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "first.obj"
        file.write_text(reading.obj(), encoding="ascii")
        return load_mesh(file)[1].astype(np.int64)


def _each(reading: Reading) -> Iterator[tuple[Surface, int]]:
    """Surfaces, and how many points come before."""
    at = 0
    for surface in reading.surfaces():
        yield surface, at
        at += len(surface.points)


def _alike(first: Reading, now: Reading) -> None:
    """Raises ValueError if two frames are not made of the same faces."""

    def faces(reading: Reading) -> dict[tuple[int, str], tuple[int, bytes, bytes]]:
        found = enumerate(reading.surfaces())
        return {(k, s.path): (len(s.points), s.counts.tobytes(), s.corners.tobytes()) for k, s in found}

    old, new = faces(first), faces(now)
    if old != new:
        changed = [path for k, path in {**old, **new} if old.get((k, path)) != new.get((k, path))]
        raise ValueError(
            f"{names(list(dict.fromkeys(changed)))}: faces or points come and go by time code {now.code:g}; a solid that moves "
            "keeps those it has: hold them fixed in the file, or leave these prims out"
        )
