"""Grids as OpenVDB files: volumes/NAME.000000.vdb and so on, one for each object and frame.

In each file a grid for each column, under its name: `density` (a fog volume), `temperature`, `pressure`, `velocity`
(vectors, at the middles of cells) and whatever else the frames have; where they have the velocities on faces, also these,
as a staggered grid. Voxel 0, 0, 0 is the first cell; its middle and the size of the voxels are those of the cell, in
metres. A plane is one voxel thick. Single precision, or half.

Only what differs from the background is stored: from zero, of temperatures from their median, of the distance from the
surface of a liquid (a level set) from the farthest.
"""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError, write_vdb
from tumble.columns import FOG, unit
from tumble.export import DIGITS, file_names
from tumble.folder import write_whole, writing
from tumble.grids import Box, box, columns, faces
from tumble.pictures.things import Recording

TOLERANCE = 1e-4
"""Smallest stored difference from the background, relative to the largest of the frame."""


LEVEL = "distance"
"""The column that is a level set."""


def write(
    run: Recording,
    folder: str | PathLike[str],
    progress: Callable[[int, int], None] | None = None,
    half: bool = False,
    zip: bool = False,
    tolerance: float = TOLERANCE,
) -> Path:
    """Writes volumes/ into a folder and returns its path; `progress(done, total)` is called after each frame. `zip`
    packs all but densities; with the tolerance 0 everything is kept, bit for bit. Raises ExportError."""
    boxes = grids(run)
    if not boxes or run.n_frames < 1:
        raise ExportError("the run has nothing on a grid to write as VDB")
    goal = Path(folder) / "volumes"
    files = paths(run)
    with writing(goal):
        goal.mkdir(parents=True, exist_ok=True)
        wanted = {path(files[name], i) for name in boxes for i in range(run.n_frames)}
        for old in goal.glob("*.vdb"):
            stem, _, frame = old.stem.rpartition(".")
            if stem in files.values() and frame.isdigit() and old.name not in wanted:
                old.unlink()
    for i in range(run.n_frames):
        tables = run.frame(i)
        for name, grid in boxes.items():
            write_whole(goal / path(files[name], i), encode(grid, tables.get(name, {}), half, zip, tolerance))
        if progress is not None:
            progress(i + 1, run.n_frames)
    return goal


def grids(run: Recording) -> dict[str, Box]:
    """The grids of objects that have columns on one."""
    found = {name: box(table) for name, table in run.static.items()}
    first = run.frame(0) if run.n_frames else {}
    return {
        name: grid
        for name, grid in found.items()
        if grid is not None and (first.get(name) or any(look.object == name for look in run.looks.objects))
    }


def paths(run: Recording) -> dict[str, str]:
    """Object -> stem of the names of its files."""
    return file_names(list(grids(run)))


def path(stem: str, frame: int) -> str:
    """Name of the file of a frame."""
    return f"{stem}.{frame:0{DIGITS}d}.vdb"


def encode(
    grid: Box,
    table: Mapping[str, npt.NDArray[Any]],
    half: bool = False,
    zip: bool = False,
    tolerance: float = TOLERANCE,
) -> bytes:
    """The file of an object in a frame. Raises ExportError."""
    volumes = []
    for name, array in columns(grid, table):
        what = "fog volume" if name in FOG else "level set" if name == LEVEL else "unknown"
        volumes.append(_volume(grid, name, array, what, half, tolerance))
    staggered = faces(grid, table)
    if staggered is not None:
        name = "velocity_faces" if "velocity" in table else "velocity"
        volumes.append(_volume(grid, name, staggered, "staggered", half, tolerance))
    return write_vdb(volumes, zip)


def fields(grid: Box, table: Mapping[str, npt.NDArray[Any]]) -> dict[str, int]:
    """Grid in the file -> numbers a voxel."""
    found = {name: 1 if array.ndim == 3 else 3 for name, array in columns(grid, table)}
    if faces(grid, table) is not None:
        found["velocity_faces" if "velocity" in table else "velocity"] = 3
    return found


def _volume(grid: Box, name: str, array: npt.NDArray[Any], what: str, half: bool, tolerance: float) -> dict[str, Any]:
    values = np.ascontiguousarray(np.moveaxis(array, (0, 2), (2, 0)), dtype=np.float32)
    background = np.float32(0)
    if name == "temperature":
        background = np.float32(np.median(values))
    elif name == LEVEL:
        background = np.float32(values.max(initial=0.0))
    with np.errstate(invalid="ignore"):
        off = np.abs(values - background)
    most = float(off[np.isfinite(off)].max(initial=0.0))
    return {
        "name": name,
        "unit": unit(name.removesuffix("_faces")),
        "class": what,
        "values": values.ravel(),
        "width": 1 if array.ndim == 3 else 3,
        "points": list(array.shape[:3]),
        "corner": [0, 0, 0],
        "spacing": grid.spacing,
        "origin": (grid.origin + 0.5 * grid.spacing).tolist(),
        "background": float(background),
        "tolerance": tolerance * most,
        "half": half,
    }
