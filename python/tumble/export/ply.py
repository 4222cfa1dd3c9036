"""The particles of a run as PLY files: ply/NAME.000000.ply and so on, binary, little-endian.

Properties of a vertex: x y z [m], vx vy vz [m/s], id, radius [m], red green blue (sRGB, 0 to 255) and every other number
that particles have, under its name. Written by hand, because plyfile is under the GPL and meshio writes no colours.
"""

import re
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.export import DIGITS, file_names
from tumble.folder import write_whole, writing
from tumble.pictures.things import Object, Recording, colors, objects, positions, radii
from tumble.style import display

TYPES = {"<f4": "float", "<i4": "int", "|u1": "uchar"}
"""Types of the format; readers, as Blender's, skip properties that are `uint`."""

_OWN = ("position", "velocity", "id", "radius", "color")


def write(run: Recording, folder: str | PathLike[str], progress: Callable[[int, int], None] | None = None) -> Path:
    """Writes ply/ into a folder and returns its path; `progress(done, total)` is called after each frame. Raises
    ExportError."""
    clouds = [o for o in objects(run) if o.form == "points"]
    if not clouds or run.n_frames < 1:
        raise ExportError("the run has no particles to write as PLY")
    goal = Path(folder) / "ply"
    names = file_names([o.name for o in clouds])
    digits = max(DIGITS, len(str(run.n_frames - 1)))
    with writing(goal):
        goal.mkdir(parents=True, exist_ok=True)
        for old in goal.glob("*.ply"):
            stem, _, frame = old.stem.rpartition(".")
            if stem in names.values() and frame.isdigit() and (len(frame) != digits or int(frame) >= run.n_frames):
                old.unlink()
    for i in range(run.n_frames):
        columns = run.frame(i)
        for thing in clouds:
            write_whole(goal / f"{names[thing.name]}.{i:0{digits}d}.ply", encode(thing, columns))
        if progress is not None:
            progress(i + 1, run.n_frames)
    return goal


def encode(thing: Object, columns: Mapping[str, Mapping[str, npt.NDArray[Any]]]) -> bytes:
    """The file of an object in a frame."""
    x = positions(columns, thing)
    n = len(x)
    table = columns[thing.name]
    parts: list[tuple[str, str, Any]] = [(axis, "<f4", x[:, k]) for k, axis in enumerate("xyz")]
    if "velocity" in table:
        v = np.reshape(table["velocity"], (-1, 3))
        parts += [(f"v{axis}", "<f4", v[:, k]) for k, axis in enumerate("xyz")]
    parts.append(("id", "<i4", table.get("id", np.arange(n))))
    parts.append(("radius", "<f4", radii(columns, thing)))
    shown = np.round(255 * display(colors(columns, thing))).astype(np.uint8)
    parts += [(name, "|u1", shown[:, k]) for k, name in enumerate(("red", "green", "blue"))]
    parts += [(_word(c), "<f4", a) for c, a in table.items() if c not in _OWN and np.shape(a) == (n,)]
    rows = np.zeros(n, dtype=[(name, kind) for name, kind, _ in parts])
    for name, _, values in parts:
        rows[name] = values
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {n}"]
    lines += [f"property {TYPES[kind]} {name}" for name, kind, _ in parts]
    return "\n".join([*lines, "end_header", ""]).encode("ascii") + rows.tobytes()


def _word(name: str) -> str:
    """A name that the format can hold."""
    return re.sub(r"[^!-~]", "_", name)
