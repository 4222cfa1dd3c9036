"""One run of a plan: what passed each gate, and where people were. Workers of a sweep compute it."""

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import Scene, World

Floats = npt.NDArray[np.float64]

SAMPLE = 0.5
"""Time between samples of people and of densities at gates [s]."""

WINDOW = 10.0
"""Over which a peak of flow is a mean [s]."""

CELL = 0.25
"""Side of a cell of the heat maps [m]."""

WAITS = 0.5
"""Of the desired speed, of all people's mean here: who is slower waits."""


@dataclass(frozen=True)
class Passage:
    """A gate in one run."""

    crossed: int
    """How many crossed it, both ways together."""
    flow: float
    """From the first to the last of them [1/s]; nan of fewer than two."""
    peak_flow: float
    """The most over WINDOW [1/s]."""
    peak_density: float
    """The most people over the floor within 1 m of it [1/m²]."""
    waiting: float
    """Person-seconds at less than half the desired speed in its queue."""
    lost: float
    """Person-seconds lost in its queue against walking freely."""
    counts: Floats
    """How many had crossed it, at each sample."""


@dataclass(frozen=True)
class Outcome:
    """One run."""

    seed: int
    passages: tuple[Passage, ...]
    last_out: float
    """When the last left [s]; nan if not all did."""
    left: int
    people: int
    injured: int
    """How many bodies have injured: they do not leave."""
    lost: float
    """Person-seconds lost by all."""
    hits: Floats
    """Who was hit: time of the sample after it [s], crowd, number of the person, 1 for a fall or 2 for an injury, place [m]."""
    times: Floats
    """Of the samples [s]."""
    present: Floats
    """People on the floor at each."""
    density: Floats
    """Person-seconds in each cell of the heat maps, over its area [s/m²]; rows are y."""
    waiting: Floats
    """The same of those who wait."""


def gates(plan: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], bool]]:
    """Doors, then exits, and whether each is an exit: the order of the engine's columns."""
    return [(gate, False) for gate in plan["door"]] + [(gate, True) for gate in plan["exit"]]


def ends(plan: Mapping[str, Any], gate: Mapping[str, Any]) -> Floats:
    """Both jambs of a gate [m]."""
    return float(plan["scale"]) * np.array([gate["from"], gate["to"]])


def box(plan: Mapping[str, Any]) -> tuple[tuple[float, float], tuple[int, int]]:
    """Lowest corner of the heat maps, and cells along x and y."""
    points = float(plan["scale"]) * np.array([p for wall in plan["walls"] for p in wall])
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    cells = np.ceil((high - low) / CELL).astype(int)
    return (float(low[0]), float(low[1])), (int(cells[0]), int(cells[1]))


def run(scene: Scene, limit: float) -> Outcome:
    """Runs a scene until all who can have left or `limit` [s] is over."""
    world, tree = World(scene), scene.to_dict()
    plan, crowds = tree["plan"][0], {crowd["name"]: crowd["speed"] for crowd in tree["crowd"]}
    stride = max(1, round(SAMPLE * tree["time"]["fps"]))
    origin, (nx, ny) = box(plan)
    shape = (ny, nx)
    seconds, waiting = np.zeros(nx * ny), np.zeros(nx * ny)
    times, present, counts, densities = [], [], [], []
    people = int(world.ledger["people"] or 0)
    previous = 0.0
    hits: list[Floats] = []
    lay: dict[tuple[int, int], int] = {}
    while True:
        columns, time = world.columns("position", "velocity"), world.time
        own = columns[plan["name"]]
        for k, (name, desired) in enumerate(crowds.items()):
            hits += _hits(lay, k, columns[name], time)
            x, v = columns[name]["position"], columns[name]["velocity"]
            at = ((x[:, :2] - origin) / CELL).astype(int).clip(0, (nx - 1, ny - 1))
            cell = at[:, 0] + nx * at[:, 1]
            seconds += (time - previous) * np.bincount(cell, minlength=nx * ny)
            slow = np.hypot(v[:, 0], v[:, 1]) < WAITS * desired
            waiting += (time - previous) * np.bincount(cell[slow], minlength=nx * ny)
        previous = time
        here, injured = (int(world.ledger[what] or 0) for what in ("people", "injured"))
        times.append(time)
        present.append(here)
        counts.append(own["crossings"].sum(axis=1))
        densities.append(own["gate_density"].reshape(-1))
        if here == injured or time >= limit:
            break
        world.step(stride)
    series, peaks = np.array(counts, float), np.max(densities, axis=0)
    ledger = world.ledger
    passages = [
        _passage(series[:, g], times, own["crossing_times"][g], peaks[g], own["gate_waiting"], own["gate_lost"], g)
        for g in range(series.shape[1])
    ]
    left = np.isfinite(own["crossing_times"][:, 1]).any() and here == injured
    last = float(np.nanmax(own["crossing_times"][:, 1])) if left else math.nan
    area = CELL * CELL
    return Outcome(
        int(tree["seed"]),
        tuple(passages),
        last,
        int(ledger["left"] or 0),
        people,
        injured,
        float(ledger["lost"] or 0.0),
        np.array(hits).reshape(-1, 6),
        np.array(times),
        np.array(present, float),
        (seconds / area).reshape(shape),
        (waiting / area).reshape(shape),
    )


def _hits(lay: dict[tuple[int, int], int], crowd: int, columns: Mapping[str, Any], time: float) -> list[Floats]:
    """Who of a crowd lies now and was on its feet, or only lay, at the last sample."""
    found = []
    for row, state in enumerate(columns["fallen"].tolist() if "fallen" in columns else ()):
        person = int(columns["id"][row])
        if state > lay.get((crowd, person), 0):
            x, y, _ = columns["position"][row]
            found.append(np.array([time, crowd, person, state, x, y]))
        lay[crowd, person] = state
    return found


def _passage(
    counts: Floats, times: Sequence[float], span: Floats, peak: float, waiting: Floats, lost: Floats, g: int
) -> Passage:
    n, (start, end) = int(counts[-1]), (float(span[0]), float(span[1]))
    flow = (n - 1) / (end - start) if n > 1 and end > start else math.nan
    window = max(1, round(WINDOW / SAMPLE))
    most = float(np.max(counts[window:] - counts[:-window])) / WINDOW if len(counts) > window else math.nan
    return Passage(n, flow, most, float(peak), float(waiting.reshape(-1)[g]), float(lost.reshape(-1)[g]), counts)


def outcome(scene: Scene, words: Mapping[str, float]) -> bytes:
    """What a worker answers: the outcome of a run, packed. `words` has the limit [s]."""
    return packed(run(scene, words["limit"]))


_NUMBERS = ("crossed", "flow", "peak_flow", "peak_density", "waiting", "lost")


def packed(found: Outcome) -> bytes:
    """An outcome as arrays of NumPy's format, without objects: what comes from another machine is read, never run."""
    numbers = np.array([[float(getattr(p, name)) for name in _NUMBERS] for p in found.passages])
    data = io.BytesIO()
    np.savez_compressed(
        data,
        whole=np.array([found.seed, found.left, found.people, found.injured]),
        parts=np.array([found.last_out, found.lost]),
        numbers=numbers.reshape(-1, len(_NUMBERS)),
        hits=found.hits,
        counts=np.array([p.counts for p in found.passages]).reshape(len(found.passages), -1),
        times=found.times,
        present=found.present,
        density=found.density,
        waiting=found.waiting,
    )
    return data.getvalue()


def unpacked(data: bytes) -> Outcome:
    """Raises ValueError where that is none."""
    with np.load(io.BytesIO(data)) as kept:
        arrays = {name: kept[name] for name in kept.files}
    seed, left, people, injured = map(int, arrays["whole"])
    last_out, lost = map(float, arrays["parts"])
    passages = []
    for row, counts in zip(arrays["numbers"].tolist(), arrays["counts"], strict=True):
        crossed, flow, peak_flow, peak_density, waiting, lost_there = row
        passages.append(Passage(int(crossed), flow, peak_flow, peak_density, waiting, lost_there, counts))
    return Outcome(
        seed,
        tuple(passages),
        last_out,
        left,
        people,
        injured,
        lost,
        *(arrays[name] for name in ("hits", "times", "present", "density", "waiting")),
    )
