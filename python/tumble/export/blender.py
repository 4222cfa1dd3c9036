"""A script for Blender beside a stage, blender.py: it imports scene.usda and sets what a plain import loses or gets wrong.

These are the frame rate, the camera, the size of pictures, the light of the world, materials of curves, points and
volumes, and the unit of time of the velocities of volumes. The script needs nothing but Blender (4.2 or later).
"""

import pprint
from os import PathLike
from pathlib import Path
from typing import Any

from tumble.columns import FOG
from tumble.export.parts import Part, parts, varying
from tumble.export.prims import GLOW, roughness
from tumble.export.usd import fps, surroundings
from tumble.folder import write_whole
from tumble.pictures.framing import views
from tumble.pictures.things import EXPOSURE, Recording, Stage, by_night, objects, with_hair

_DEVELOPED = 0.2
"""Light of a flame in Blender over that in pictures, whose film gathers more before it turns white."""

_SCRIPT = Path(__file__).with_name("in_blender.py.txt")
"""The script without its first lines, which hold what differs from run to run."""


def write(run: Recording, folder: str | PathLike[str], camera: str | None = None) -> Path:
    """Writes blender.py into the folder of scene.usda and returns its path; `camera` as scene.usda has it. Raises
    ExportError."""
    goal = Path(folder) / "blender.py"
    tables = {"SCENE": _scene(run, camera), "LOOKS": _looks(run), "VOLUMES": _volumes(run)}
    lines = [f"{name} = {pprint.pformat(table, width=110, sort_dicts=False)}" for name, table in tables.items()]
    text = _SCRIPT.read_text(encoding="utf-8").replace("# TABLES\n", "\n".join(lines) + "\n")
    write_whole(goal, text.encode())
    return goal


def _scene(run: Recording, camera: str | None) -> dict[str, Any]:
    strength, color = surroundings(by_night(run))
    return {
        "fps": fps(run),
        "frames": (0, run.n_frames - 1),
        "resolution": views(run, camera)(0).size,
        "world": (*color, strength),
    }


def _parts(run: Recording) -> list[Part]:
    return parts(run, with_hair(run, objects(run)), run.frame(0))


def _looks(run: Recording) -> dict[str, dict[str, Any]]:
    """Prim -> colour in linear light, roughness, light that it sends out over its colour, whether its points have colours of
    their own, and from which frames on there are any points or none."""
    night, start, made = by_night(run), run.frame(0), _parts(run)
    born = [part.thing.name for part in made if varying(part, start)]
    there = {name: list[tuple[int, bool]]() for name in born}
    for i in range(run.n_frames if born else 0):
        columns = run.frame(i)
        for name, turns in there.items():
            some = len(columns[name]["id"]) > 0
            if not turns or turns[-1][1] != some:
                turns.append((i, some))
    return {
        part.name: {
            "color": tuple(round(float(c), 6) for c in part.thing.color),
            "roughness": roughness(part),
            "glow": GLOW if night and part.thing.form == "points" else 0.0,
            "colors": varying(part, start) and "color" in start.get(part.thing.name, {}),
            "there": there[part.thing.name] if varying(part, start) else [],
        }
        for part in made
        if part.kind not in ("Volume", "PointInstancer")
    }


def _volumes(run: Recording) -> dict[str, dict[str, Any]]:
    """Prim -> colour, the grid that is seen, the value that is clear, the extinction [1/m] per unit above it, the highest
    temperature [K] if it glows, and the grid of velocities."""
    volumes = [part for part in _parts(run) if part.kind == "Volume"]
    stage = Stage(run) if volumes else None
    found: dict[str, dict[str, Any]] = {}
    for part in volumes:
        seen = stage and stage.extinction(part.thing.name)
        column, low, factor, hottest = seen or ("density", 0.0, 0.0, 0.0)
        table = run.frame(0).get(part.thing.name, {})
        found[part.name] = {
            "color": tuple(round(float(c), 6) for c in part.thing.color),
            "grid": column,
            "clear": float(low) if column not in FOG else max(float(low), 0.0),
            "extinction": float(factor),
            "hottest": float(hottest),
            "exposure": _DEVELOPED * EXPOSURE,
            "velocity": "velocity" if "velocity" in table or "velocity_x" in table else "",
        }
    return found
