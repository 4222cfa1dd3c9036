"""The motion of a USD file as a sequence of meshes, which `shape.animated_mesh` takes."""

import math
import tempfile
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tumble._engine import load_mesh, repair_mesh
from tumble.folder import write_whole
from tumble.usd.stage import Floats, Indices, Reading, Surface, end, names, obj, open_stage, pose, start

DIGITS = 6
"""Digits of the number of a mesh in the name of its file."""

_MOST = 100_000
"""Meshes that are written of a file, at most."""


def bake(path: Path | str, folder: Path, duration: float, mended: bool = False) -> list[tuple[float, Path]]:
    """Writes the meshes of a file into a folder, one for each of its frames from its start on, until it ends or `duration`
    [s] is over, and returns time [s] and file of each; `mended` as `repair_mesh` would the first. Raises ValueError, also
    where faces come and go."""
    motion = Motion(path, duration, mended)
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.obj"):
        if old.stem.isdigit():
            old.unlink()
    frames = []
    for k, code in enumerate(motion.line.codes()):
        file = folder / f"{k:0{DIGITS}d}.obj"
        write_whole(file, motion.obj(code).encode("ascii"))
        frames.append((motion.line.time(code), file))
    return frames


class Timeline:
    """The time codes of the frames of a stage, from its start on."""

    def __init__(self, stage: Any, duration: float = math.inf) -> None:
        """Until the stage ends or `duration` [s] is over. Raises ValueError."""
        self.start = start(stage)
        self.rate = float(stage.GetTimeCodesPerSecond())
        said = stage.HasAuthoredMetadata("framesPerSecond") and stage.GetFramesPerSecond() > 0
        self.step = self.rate / float(stage.GetFramesPerSecond()) if said else 1.0
        self.last = max(self.start, min(end(stage), self.start + duration * self.rate))
        if not (self.rate > 0.0 and all(map(math.isfinite, (self.rate, self.step, self.start, self.last)))):
            raise ValueError(
                "its time codes a second or its range of time are no numbers; the file is damaged, export it again"
            )
        if (self.last - self.start) / self.step > _MOST:
            raise ValueError(f"its motion has more than {_MOST} frames; shorten it, or simulate less")

    def time(self, code: float) -> float:
        """Time [s] of a time code, from the start."""
        return (code - self.start) / self.rate

    def codes(self) -> list[float]:
        """The time codes of all frames, and of the end."""
        n = int((self.last - self.start) / self.step + 1e-6) + 1
        codes = [self.start + k * self.step for k in range(n)]
        return [*codes, self.last] if self.last - codes[-1] > 1e-3 * self.step else codes


class Motion:
    """The meshes of an animated file: triangles that are the same at all time codes, and points that move."""

    def __init__(self, path: Path | str, duration: float = math.inf, mended: bool = False) -> None:
        """Until the file ends or `duration` [s] is over; `mended` as `repair_mesh` would the mesh at the start. Raises
        ValueError."""
        self.stage = open_stage(path)
        self.line = Timeline(self.stage, duration)
        pose(self.stage, self.line.start, self.line.last)
        self.first = Reading(self.stage, self.line.start)
        self.first.obj()  # Raises where there is none.
        make = _mended if mended else triangulated
        self.used, self.triangles = make(self.first.surfaces())

    def points(self, code: float) -> Floats:
        """Points [m] at a time code, n x 3. Raises ValueError where faces come and go."""
        now = Reading(self.stage, code)
        _alike(self.first, now)
        return _points(now)[self.used]

    @cached_property
    def faces(self) -> str:
        """The triangles as lines of an OBJ."""
        return "".join(f"f {a} {b} {c}\n" for a, b, c in (self.triangles + 1).tolist())

    def obj(self, code: float) -> str:
        """The mesh at a time code as an OBJ. Raises ValueError where faces come and go."""
        return written(self.points(code)) + self.faces


def written(points: Floats) -> str:
    """Points as lines of an OBJ."""
    return "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())


def _points(reading: Reading) -> Floats:
    return np.concatenate([s.points for s in reading.surfaces()] or [np.zeros((0, 3))])


def triangulated(surfaces: list[Surface]) -> tuple[Indices, Indices]:
    """The points of surfaces that are used, and the triangles between those that the engine makes of the polygons."""
    _, triangles = _loaded(obj(surfaces))
    # The engine drops what no polygon uses, and keeps the order; points at one place may part later.
    used = np.unique(np.concatenate([s.corners + at for s, at in _each(surfaces)]))
    return used.astype(np.int64), triangles


def _mended(surfaces: list[Surface]) -> tuple[Indices, Indices]:
    """The same, mended as `repair_mesh` does it."""
    vertices, triangles = _loaded(obj(surfaces), mended=True)
    points = np.concatenate([s.points for s in surfaces])
    # Vertices that were sewn are at one place, and so are those that were split.
    where = {tuple(x): k for k, x in reversed(list(enumerate(points.tolist())))}
    nearest = (where.get(tuple(x)) for x in vertices.tolist())
    found = [
        int(np.argmin(((points - x) ** 2).sum(axis=1))) if k is None else k
        for x, k in zip(vertices, nearest, strict=True)
    ]
    return np.array(found, dtype=np.int64), triangles


def _loaded(text: str, mended: bool = False) -> tuple[Floats, Indices]:
    """Vertices and triangles that the engine reads of an OBJ."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mesh.obj"
        file.write_text(text, encoding="ascii")
        if mended and (better := repair_mesh(file)[0]) is not None:
            file.write_text(better, encoding="ascii")
        vertices, triangles = load_mesh(file)
    return vertices, triangles.astype(np.int64)


def _each(surfaces: list[Surface]) -> Iterator[tuple[Surface, int]]:
    """Surfaces, and how many points come before."""
    at = 0
    for surface in surfaces:
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
