"""Runs of a plan with several seeds, and what its gates cost."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from tumble._engine import Scene, SceneError, StepError, World
from tumble.bottlenecks.passages import Outcome, box, ends, gates, unpacked
from tumble.bottlenecks.walls import widened
from tumble.sweeps.engines import chosen, opened
from tumble.sweeps.statistics import Spread, spread
from tumble.sweeps.task import FINISHED, INVALID, Context, Task


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
    without: tuple[Outcome, ...]
    """The same seeds without the scene's bodies; empty of a scene that has none."""
    widened: tuple[Widened, ...]
    fixed: tuple[str, ...]
    """Gates that were to be made wider, but at whose jambs no wall ends."""
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
        return [run.seed for run in self.outcomes if run.left + run.injured < run.people]

    @property
    def bodies(self) -> dict[str, tuple[Spread, Spread]]:
        """What the bodies cost: last out [s], time lost [s] and people injured, with and without them."""
        with_and_without = {
            what: tuple(
                spread([float(getattr(run, what)) for run in runs], what) for runs in (self.outcomes, self.without)
            )
            for what in ("last_out", "lost", "injured")
        }
        return {what: (a, b) for what, (a, b) in with_and_without.items()} if self.without else {}


def study(
    scene: Scene,
    seeds: int = 10,
    widen: float = 0.0,
    first: int = 3,
    limit: float = 1800.0,
    on: str = "cores",
    workers: int | None = None,
    tell: Callable[[int, int], None] | None = None,
) -> Findings:
    """Runs a scene of a plan and crowds with so many seeds, counted from its own, until all have left or `limit` [s] is over.

    A scene with bodies is run without them, too, and without their joints. With `widen` [m], each of the `first` gates of the
    ranking is made so much wider, and all seeds are run again. `on` is "cores", "dask" or the address of a Dask scheduler, as
    in `tumble.sweep`; `tell` is called with the runs done and the runs in all. The numbers do not depend on `on` and
    `workers`. Raises SceneError; StepError where a run breaks.
    """
    tree = scene.to_dict()
    if len(tree["plan"]) != 1 or not tree["crowd"]:
        raise SceneError("the scene has no plan with a crowd, expected one [[plan]] and at least one [[crowd]]")
    World(scene, 1)  # Tells what is wrong with it before anything runs.
    plan = tree["plan"][0]
    runs = _Runs(scene, [int(tree["seed"]) + k for k in range(seeds)], limit, on, workers, tell)
    alone = ("body=[]", "joint=[]") if tree["joint"] else ("body=[]",)
    outcomes, *without = runs.of([(), alone] if tree["body"] else [()])
    rows = _ranked(plan, outcomes)
    wider = [(row, widened(plan, row.gate, widen)) for row in rows[:first]] if widen > 0.0 else []
    tried = [(row, new) for row, new in wider if new is not None]
    changed = []
    for (row, _), others in zip(tried, runs.of([_overrides(new) for _, new in tried]), strict=True):
        pairs = list(zip(outcomes, others, strict=True))
        saved = spread([a.lost - b.lost for a, b in pairs], f"saved {row.gate}")
        earlier = spread([a.last_out - b.last_out for a, b in pairs], f"earlier {row.gate}")
        changed.append(Widened(row.gate, widen, saved, earlier))
    fixed = tuple(row.gate for row, new in wider if new is None)
    return Findings(
        str(tree["title"]), plan, tuple(rows), tuple(outcomes), tuple(*without), tuple(changed), fixed, box(plan)[0]
    )


def _overrides(plan: Mapping[str, Any]) -> tuple[str, ...]:
    """What makes the plan of a scene this one, which differs in places of walls and gates alone."""
    gates = [
        f"plan.0.{key}.{k}.{end}={json.dumps(gate[end])}"
        for key in ("door", "exit")
        for k, gate in enumerate(plan[key])
        for end in ("from", "to")
    ]
    return (f"plan.0.walls={json.dumps(plan['walls'])}", *gates)


class _Runs:
    """Runs on an engine of sweeps."""

    def __init__(
        self,
        scene: Scene,
        seeds: list[int],
        limit: float,
        on: str,
        workers: int | None,
        tell: Callable[[int, int], None] | None,
    ) -> None:
        self.seeds, self.tell, self.on, self.workers = seeds, tell, on, workers
        self.context = Context(scene, (), "", "", study="bottlenecks", words={"limit": limit})
        self.memory = float(scene.memory)
        self.done = self.total = 0

    def of(self, variants: Sequence[tuple[str, ...]]) -> list[list[Outcome]]:
        """Outcomes of the scene with each of some overrides, seed by seed. Raises StepError, SceneError."""
        tasks = [Task(f"{v}-{seed}", sets, seed) for v, sets in enumerate(variants) for seed in self.seeds]
        self.total += len(tasks)
        if not tasks:
            return []
        words, _ = chosen(self.on, self.workers, len(tasks), self.memory, None)
        found: dict[str, Outcome] = {}
        with opened(self.context, words) as engine, closing(engine.run(tasks)) as answers:  # type: ignore[type-var]
            for answer in answers:
                if answer.status != FINISHED:
                    seed = answer.key.partition("-")[2]
                    kind = SceneError if answer.status == INVALID else StepError
                    raise kind(f"the run with seed {seed} ended early: {answer.status}: {answer.reason}")
                found[answer.key] = unpacked(answer.archive)
                self.done += 1
                if self.tell:
                    self.tell(self.done, self.total)
        return [[found[f"{v}-{seed}"] for seed in self.seeds] for v in range(len(variants))]


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
