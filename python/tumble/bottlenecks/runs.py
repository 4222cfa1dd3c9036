"""Runs of a plan with several seeds, and what its gates cost."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import Scene, SceneError, World
from tumble.bottlenecks.walls import widened
from tumble.sweeps.statistics import Spread, spread

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
    lost: float
    """Person-seconds lost by all."""
    times: Floats
    """Of the samples [s]."""
    present: Floats
    """People on the floor at each."""
    density: Floats
    """Person-seconds in each cell of the heat maps, over its area [s/m²]; rows are y."""
    waiting: Floats
    """The same of those who wait."""


@dataclass(frozen=True)
class Rank:
    """A gate over all seeds."""

    gate: str
    exit: bool
    width: float
    """[m]"""
    crossed: float
    flow: Spread
    """From the first to the last who crosses [1/s]."""
    peak_flow: Spread
    peak_density: Spread
    waiting: Spread
    lost: Spread
    share: float
    """Of all time lost, the part lost here."""
    middle: tuple[float, float]


@dataclass(frozen=True)
class Widened:
    """A gate made wider, with the same seeds."""

    gate: str
    by: float
    """[m]"""
    saved: Spread
    """Person-seconds lost less, of all people, seed by seed."""
    earlier: Spread
    """Seconds by which the last is out earlier."""


@dataclass(frozen=True)
class Findings:
    """What a study has found."""

    title: str
    plan: Mapping[str, Any]
    """The plan of the resolved scene."""
    rows: tuple[Rank, ...]
    """Gates by time lost, the worst first."""
    outcomes: tuple[Outcome, ...]
    """Seed by seed."""
    widened: tuple[Widened, ...]
    origin: tuple[float, float]
    """Of the heat maps [m]."""

    @property
    def last_out(self) -> Spread:
        return spread([run.last_out for run in self.outcomes], "last out")

    @property
    def lost(self) -> Spread:
        return spread([run.lost for run in self.outcomes], "lost")

    @property
    def stuck(self) -> list[int]:
        """Seeds with which not all left in time."""
        return [run.seed for run in self.outcomes if run.left < run.people]


def study(
    scene: Scene,
    seeds: int = 10,
    widen: float = 0.0,
    first: int = 3,
    limit: float = 1800.0,
    workers: int | None = None,
    tell: Callable[[int, int], None] | None = None,
) -> Findings:
    """Runs a scene of a plan and crowds with so many seeds, counted from its own, until all have left or `limit` [s] is over.

    With `widen` [m], each of the `first` gates of the ranking is made so much wider, and all seeds are run again. `tell` is
    called with the runs done and the runs in all. The numbers do not depend on `workers`. Raises SceneError.
    """
    tree = scene.to_dict()
    if len(tree["plan"]) != 1 or not tree["crowd"]:
        raise SceneError("the scene has no plan with a crowd, expected one [[plan]] and at least one [[crowd]]")
    World(scene, 1)  # Tells what is wrong with it before anything runs.
    trees = [{**tree, "seed": tree["seed"] + k} for k in range(seeds)]
    workers = workers or os.cpu_count() or 1
    total, done = seeds, 0

    def all_of(trees: Sequence[Mapping[str, Any]]) -> list[Outcome]:
        nonlocal done
        found = []
        with ThreadPoolExecutor(min(workers, len(trees))) as pool:
            for outcome in pool.map(lambda tree: _run(tree, scene.folder, limit), trees):
                found.append(outcome)
                done += 1
                if tell:
                    tell(done, total)
        return found

    outcomes = all_of(trees)
    plan = tree["plan"][0]
    rows = _ranked(plan, outcomes)
    changed = []
    wider = [(row, widened(plan, row.gate, widen)) for row in rows[:first]] if widen > 0.0 else []
    total += seeds * sum(new is not None for _, new in wider)
    for row, new in wider:
        if new is None:
            continue
        others = all_of([{**tree, "plan": [new]} for tree in trees])
        pairs = list(zip(outcomes, others, strict=True))
        saved = spread([a.lost - b.lost for a, b in pairs], f"saved {row.gate}")
        earlier = spread([a.last_out - b.last_out for a, b in pairs], f"earlier {row.gate}")
        changed.append(Widened(row.gate, widen, saved, earlier))
    return Findings(str(tree["title"]), plan, tuple(rows), tuple(outcomes), tuple(changed), _box(plan)[0])


def gates(plan: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], bool]]:
    """Doors, then exits, and whether each is an exit: the order of the engine's columns."""
    return [(gate, False) for gate in plan["door"]] + [(gate, True) for gate in plan["exit"]]


def ends(plan: Mapping[str, Any], gate: Mapping[str, Any]) -> Floats:
    """Both jambs of a gate [m]."""
    return float(plan["scale"]) * np.array([gate["from"], gate["to"]])


def _box(plan: Mapping[str, Any]) -> tuple[tuple[float, float], tuple[int, int]]:
    """Lowest corner of the heat maps, and cells along x and y."""
    points = float(plan["scale"]) * np.array([p for wall in plan["walls"] for p in wall])
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    cells = np.ceil((high - low) / CELL).astype(int)
    return (float(low[0]), float(low[1])), (int(cells[0]), int(cells[1]))


def _run(tree: Mapping[str, Any], folder: str, limit: float) -> Outcome:
    """One seed, on one thread."""
    world = World(Scene(dict(tree), folder or None), 1)
    plan, crowds = tree["plan"][0], {crowd["name"]: crowd["speed"] for crowd in tree["crowd"]}
    stride = max(1, round(SAMPLE * tree["time"]["fps"]))
    origin, (nx, ny) = _box(plan)
    shape = (ny, nx)
    seconds, waiting = np.zeros(nx * ny), np.zeros(nx * ny)
    times, present, counts, densities = [], [], [], []
    people = int(world.ledger["people"] or 0)
    previous = 0.0
    while True:
        columns, time = world.columns("position", "velocity"), world.time
        own = columns[plan["name"]]
        for name, desired in crowds.items():
            x, v = columns[name]["position"], columns[name]["velocity"]
            at = ((x[:, :2] - origin) / CELL).astype(int).clip(0, (nx - 1, ny - 1))
            cell = at[:, 0] + nx * at[:, 1]
            seconds += (time - previous) * np.bincount(cell, minlength=nx * ny)
            slow = np.hypot(v[:, 0], v[:, 1]) < WAITS * desired
            waiting += (time - previous) * np.bincount(cell[slow], minlength=nx * ny)
        previous = time
        here = int(world.ledger["people"] or 0)
        times.append(time)
        present.append(here)
        counts.append(own["crossings"].sum(axis=1))
        densities.append(own["gate_density"].reshape(-1))
        if here == 0 or time >= limit:
            break
        world.step(stride)
    series, peaks = np.array(counts, float), np.max(densities, axis=0)
    ledger = world.ledger
    passages = [
        _passage(series[:, g], times, own["crossing_times"][g], peaks[g], own["gate_waiting"], own["gate_lost"], g)
        for g in range(series.shape[1])
    ]
    last = float(np.nanmax(own["crossing_times"][:, 1])) if here == 0 else math.nan
    area = CELL * CELL
    return Outcome(
        int(tree["seed"]),
        tuple(passages),
        last,
        int(ledger["left"] or 0),
        people,
        float(ledger["lost"] or 0.0),
        np.array(times),
        np.array(present, float),
        (seconds / area).reshape(shape),
        (waiting / area).reshape(shape),
    )


def _passage(
    counts: Floats, times: Sequence[float], span: Floats, peak: float, waiting: Floats, lost: Floats, g: int
) -> Passage:
    n, (start, end) = int(counts[-1]), (float(span[0]), float(span[1]))
    flow = (n - 1) / (end - start) if n > 1 and end > start else math.nan
    window = max(1, round(WINDOW / SAMPLE))
    most = float(np.max(counts[window:] - counts[:-window])) / WINDOW if len(counts) > window else math.nan
    return Passage(n, flow, most, float(peak), float(waiting.reshape(-1)[g]), float(lost.reshape(-1)[g]), counts)


def _ranked(plan: Mapping[str, Any], outcomes: Sequence[Outcome]) -> list[Rank]:
    """All gates, by the mean of the time lost at each."""
    rows = []
    everything = sum(run.lost for run in outcomes)
    for g, (gate, exit_) in enumerate(gates(plan)):
        own = [run.passages[g] for run in outcomes]
        line = ends(plan, gate)
        middle = line.mean(axis=0)
        name = str(gate["name"])
        lost = spread([p.lost for p in own], f"{name} lost")
        rows.append(
            Rank(
                name,
                exit_,
                float(np.hypot(*(line[1] - line[0]))),
                float(np.mean([p.crossed for p in own])),
                spread([p.flow for p in own], f"{name} flow"),
                spread([p.peak_flow for p in own], f"{name} peak flow"),
                spread([p.peak_density for p in own], f"{name} density"),
                spread([p.waiting for p in own], f"{name} waiting"),
                lost,
                sum(p.lost for p in own) / everything if everything > 0.0 else 0.0,
                (float(middle[0]), float(middle[1])),
            )
        )
    return sorted(rows, key=lambda row: (-row.lost.mean, row.gate))
