"""Ways of people, sampled at each frame, and as files: the text, HDF5 and SQLite forms that PedPy and JuPedSim read.

Whoever leaves stands in no column any more. Its last way is continued by one frame, so that it crosses the exit.
"""

import io
import math
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import Scene, SceneError, World
from tumble.bottlenecks.passages import Floats
from tumble.folder import write_whole

JOINT = 1e-3
"""Ends of walls that are nearer than this are one [m]."""


@dataclass(frozen=True)
class Walk:
    """Ways of people."""

    fps: float
    """Frames a second."""
    person: npt.NDArray[np.int64]
    """Of each row; rows are in the order of persons, then of frames."""
    frame: npt.NDArray[np.int64]
    x: Floats
    """Places [m], rows x 2."""
    floor: tuple[Floats, ...]
    """Outlines of the floor [m]: that around it, then those of obstacles; nothing where walls and gates close none."""

    def sorted(self, frame: int) -> tuple[npt.NDArray[np.int64], Floats]:
        """Persons in a frame, and their places."""
        rows = np.flatnonzero(self.frame == frame)
        return self.person[rows], self.x[rows]


def walked(scene: Scene, limit: float) -> Walk:
    """Runs a scene until all have left or `limit` [s] is over. Raises SceneError, StepError."""
    world, tree = World(scene), scene.to_dict()
    crowds = [crowd["name"] for crowd in tree["crowd"]]
    fps = float(tree["time"]["fps"])
    rows: list[tuple[int, int, float, float]] = []
    base, total = {}, 0
    before: dict[int, tuple[float, ...]] = {}
    while True:
        columns, frame = world.columns("position", "velocity", "id"), world.frame_index
        there: dict[int, tuple[float, ...]] = {}
        for name in crowds:
            own = columns[name]
            if name not in base:
                base[name] = total
                total += len(own["id"])
            for k, (x, y), (u, v) in zip(own["id"], own["position"][:, :2], own["velocity"][:, :2], strict=True):
                there[base[name] + int(k)] = (float(x), float(y), float(u), float(v))
        rows += [(who, frame, state[0], state[1]) for who, state in there.items()]
        for who in before.keys() - there.keys():
            x, y, u, v = before[who]
            rows.append((who, frame, x + u / fps, y + v / fps))
        before = there
        if not there or world.time >= limit:
            break
        world.step()
    rows.sort()
    rows = _parted(rows, _leap(tree["plan"][0]))
    numbers = np.array(rows, dtype=np.float64).reshape(-1, 4)
    ids = numbers[:, :2].astype(np.int64)
    return Walk(fps, ids[:, 0], ids[:, 1], np.ascontiguousarray(numbers[:, 2:]), outlines(tree["plan"][0]))


def _leap(plan: Any) -> float:
    """A step farther than this [m] leads through a link to another floor."""
    middles = [[np.mean(np.array(link[key], float), axis=0) for key in ("from", "to")] for link in plan["link"]]
    return min((0.5 * float(plan["scale"]) * math.dist(a, b) for a, b in middles), default=math.inf)


def _parted(rows: list[tuple[int, int, float, float]], leap: float) -> list[tuple[int, int, float, float]]:
    """Ways, sorted by person and frame, with a new person on each floor: lines between there are not crossed."""
    parted, new, last = [], max((row[0] for row in rows), default=0), (-1, -1)
    for k, row in enumerate(rows):
        if k and rows[k - 1][0] == row[0] and math.dist(rows[k - 1][2:], row[2:]) > leap:
            new += 1
            last = (row[0], new)
        parted.append((last[1] if last[0] == row[0] else row[0], *row[1:]))
    return sorted(parted)


def outlines(plan: Any) -> tuple[Floats, ...]:
    """Closed lines of walls and exits, joined end to end, the largest first; none where nothing is closed."""
    scale = float(plan["scale"])
    lines = [scale * np.array(wall, float) for wall in plan["walls"] if len(wall) > 1]
    lines += [scale * np.array([gate["from"], gate["to"]], float) for gate in plan["exit"]]
    rings: list[Floats] = []
    open_: list[Floats] = []
    for line in lines:
        (rings if len(line) > 3 and np.hypot(*(line[0] - line[-1])) <= JOINT else open_).append(line)
    while open_:
        chain = open_.pop(0)
        while np.hypot(*(chain[0] - chain[-1])) > JOINT:
            k = next((k for k, line in enumerate(open_) if _meets(chain[-1], line) is not None), None)
            if k is None:
                break
            line = open_.pop(k)
            chain = np.concatenate([chain, line[1:] if _meets(chain[-1], line) == 0 else line[-2::-1]])
        if len(chain) > 3 and np.hypot(*(chain[0] - chain[-1])) <= JOINT:
            rings.append(chain)
    rings.sort(key=lambda ring: -abs(_area(ring)))
    return tuple(rings)


def _meets(end: Floats, line: Floats) -> int | None:
    """At which end a line goes on."""
    return next((k for k in (0, -1) if np.hypot(*(line[k] - end)) <= JOINT), None)


def _area(ring: Floats) -> float:
    x, y = ring.T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def polygon(rings: Sequence[Floats]) -> str:
    """Well-known text of a floor; EMPTY where there is none."""
    texts = []
    for ring in rings:
        points = [*ring[:-1], ring[0]]
        texts.append("(" + ", ".join(f"{x:.6f} {y:.6f}" for x, y in points) + ")")
    return f"POLYGON ({', '.join(texts)})" if texts else "POLYGON EMPTY"


def form(path: Path) -> str:
    """The form of a file, by its suffix. Raises SceneError where there is none, or what writes it is not installed."""
    suffix = path.suffix.lower()
    if suffix not in _FORMS:
        raise SceneError(f"--trajectories {path}: no form of this suffix, expected {', '.join(_FORMS)}")
    if suffix in (".h5", ".hdf5"):
        try:
            import h5py  # noqa: F401
        except ImportError:
            text = "HDF5 needs h5py: pip install h5py, or write .txt or .sqlite"
            raise SceneError(f"--trajectories {path}: {text}") from None
    return suffix


def write(walk: Walk, path: Path) -> Path:
    """Writes ways. Raises SceneError for a suffix that is none, ExportError."""
    data = _FORMS[form(path)](walk)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, data)
    return path


def _text(walk: Walk) -> bytes:
    lines = [f"# framerate: {walk.fps:g} fps", "# id frame x/m y/m z/m"]
    rows = zip(walk.person, walk.frame, walk.x, strict=True)
    lines += [f"{who}\t{frame}\t{x:.6f}\t{y:.6f}\t0" for who, frame, (x, y) in rows]
    return ("\n".join(lines) + "\n").encode()


def _sqlite(walk: Walk) -> bytes:
    """As JuPedSim's version 1."""
    low, high = (walk.x.min(axis=0), walk.x.max(axis=0)) if len(walk.x) else (np.zeros(2), np.zeros(2))
    metadata = {"version": "1", "fps": f"{walk.fps:g}"}
    metadata |= {"xmin": low[0], "xmax": high[0], "ymin": low[1], "ymax": high[1]}
    with closing(sqlite3.connect(":memory:")) as base:
        base.execute(
            "CREATE TABLE trajectory_data (frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL, ori_x REAL, ori_y REAL)"
        )
        base.execute("CREATE TABLE metadata (key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL)")
        base.execute("CREATE TABLE geometry (wkt TEXT NOT NULL)")
        ways = directions(walk)
        rows = np.column_stack([walk.frame, walk.person, walk.x, ways]).tolist()
        base.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?)", rows)
        base.executemany("INSERT INTO metadata VALUES (?, ?)", [(key, str(value)) for key, value in metadata.items()])
        base.execute("INSERT INTO geometry VALUES (?)", (polygon(walk.floor),))
        base.execute("CREATE INDEX frame_id_idx ON trajectory_data (frame, id)")
        base.commit()
        return base.serialize()


def directions(walk: Walk) -> Floats:
    """Unit vectors along the ways, rows x 2; 0 of those who stand."""
    step = np.zeros_like(walk.x)
    if len(step) > 1:
        same = walk.person[1:] == walk.person[:-1]
        step[1:][same] = (walk.x[1:] - walk.x[:-1])[same]
        first = np.concatenate([[True], ~same]) & np.concatenate([same, [False]])
        step[first] = (np.roll(walk.x, -1, axis=0) - walk.x)[first]
    length = np.hypot(step[:, 0], step[:, 1])
    return step / np.where(length > 0.0, length, 1.0)[:, None]


def _hdf5(walk: Walk) -> bytes:
    """As the Pedestrian Dynamics Data Archive has it."""
    import h5py

    rows = np.zeros(len(walk.x), [("id", "i8"), ("frame", "i8"), ("x", "f8"), ("y", "f8"), ("z", "f8")])
    rows["id"], rows["frame"], rows["x"], rows["y"] = walk.person, walk.frame, walk.x[:, 0], walk.x[:, 1]
    data = io.BytesIO()
    with h5py.File(data, "w") as file:
        file.attrs["wkt_geometry"] = polygon(walk.floor)
        table = file.create_dataset("trajectory", data=rows)
        table.attrs["fps"] = walk.fps
    return data.getvalue()


_FORMS: dict[str, Callable[[Walk], bytes]] = {".txt": _text, ".sqlite": _sqlite, ".h5": _hdf5, ".hdf5": _hdf5}
"""Suffixes and what writes them."""
