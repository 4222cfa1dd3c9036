"""One run of a scene under one integrator with one step: what it took and how it ended."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tumble._engine import StepError, World
from tumble.lab.schemes import Scheme
from tumble.lab.subject import Subject

MOST = 10_000_000
"""Sub-steps that a frame of a scene may have."""

SURVIVED, BLEW_UP, STOPPED, SKIPPED = "survived", "blew up", "stopped", "skipped"


@dataclass
class Cell:
    """A run, whole or not."""

    experiment: str
    scheme: Scheme
    step: float
    """Sub-step [s]; of adaptive integrators the mean one."""
    tolerance: float | None
    duration: float
    """How long it was to be [s]."""
    outcome: str = SURVIVED
    reached: float = 0.0
    """How far it came [s]."""
    steps: int = 0
    rejected: int = 0
    newton: int = 0
    linear: int = 0
    unconverged: int = 0
    seconds: float = 0.0
    """Time on the clock of its steps."""
    spent: float = 0.0
    """Time on the clock of all of it: its world is built, and looked at after each frame."""
    step_range: tuple[float, float] | None = None
    error: float = float("nan")
    """Largest distance from the true solution over the size of the motion."""
    failure: dict[str, Any] = field(default_factory=dict)
    """system, object, index, time, if it blew up and the engine saw it."""

    @property
    def evaluations(self) -> int:
        """Forces computed; for implicit integrators with the products of the linear solver."""
        if self.scheme.implicit:
            return self.newton + self.linear
        return self.scheme.evaluations * (self.steps + self.rejected)

    def per_second(self, amount: float) -> float:
        """Of an amount that the run took, the share of one simulated second."""
        return amount / self.reached if self.reached > 0 else float("nan")


def run(
    subject: Subject,
    scheme: Scheme,
    experiment: str,
    interval: float,
    frames: int,
    substeps: int = 1,
    tolerance: float | None = None,
    patience: float = float("inf"),
    each: Callable[[World], bool] = lambda world: True,
) -> Cell:
    """Runs `frames` of `interval` [s]. After each, `each` may say that it has seen enough: the run then counts as blown
    up. One that takes longer than `patience` [s], from before its world is built, is given up and counts as skipped."""
    start = time.perf_counter()
    h = interval / subject.taken(interval, substeps)
    cell = Cell(experiment, scheme, h, tolerance, interval * frames)
    if substeps > MOST or patience <= 0:
        cell.outcome = SKIPPED
        return cell

    def spent() -> float:
        cell.spent = time.perf_counter() - start
        return cell.spent

    # An adaptive scheme may take very many steps in a frame; it is asked more often whether its time is over.
    parts = 16 if subject.crowded and tolerance is not None and tolerance < 1e-4 * subject.extent else 1
    world = subject.world(scheme, interval / parts, frames * parts, substeps, tolerance)
    try:
        for k in range(frames * parts):
            begin = time.perf_counter()
            try:
                report = world.step(patience=max(patience - spent(), 0.05))
            finally:
                cell.seconds += time.perf_counter() - begin
            _add(cell, report)
            cell.reached = world.time
            if (k + 1) % parts == 0 and not each(world):
                cell.outcome = BLEW_UP
                break
            if spent() > patience:
                cell.outcome = SKIPPED
                break
    except TimeoutError:
        cell.outcome = SKIPPED
    except StepError as error:
        blown = error.report.get("kind") in ("not_finite", "exploded")
        cell.outcome = BLEW_UP if blown else STOPPED
        cell.failure = dict(error.report)
        cell.reached = float(error.report.get("time") or world.time)
    spent()
    if scheme.adaptive and cell.steps:
        cell.step = cell.reached / cell.steps
    return cell


def _add(cell: Cell, report: Mapping[str, Any]) -> None:
    cell.steps += int(report["steps"])
    cell.rejected += int(report["rejected"])
    cell.newton += int(report["newton"])
    cell.linear += int(report["linear"])
    cell.unconverged += int(report["unconverged"])
    # The last step of a frame is cut to end with it; the others were chosen.
    trials = [t["step"] for t in report.get("trials") or [] if t["accepted"]]
    trials = trials[:-1] or trials
    span = (min(trials), max(trials)) if trials else report.get("step_range")
    if span is not None:
        old = cell.step_range or span
        cell.step_range = (min(old[0], span[0]), max(old[1], span[1]))


@dataclass
class Purse:
    """Time that may be spent [s]."""

    left: float
    given: float = 0.0

    def part(self, n: int) -> "Purse":
        """A part for the next of n: twice its share, so that none is left without."""
        share = 2.0 * self.left / (n + 1)
        return Purse(share, share)

    def settle(self, part: "Purse") -> None:
        """Takes what a part has spent."""
        self.left = max(0.0, self.left - (part.given - part.left))

    def pays(self, cost: float) -> bool:
        """Whether a run that is expected to take so long may start."""
        return bool(np.isfinite(cost) and cost <= self.left and self.left > 0)

    def spend(self, cell: Cell) -> Cell:
        self.left -= cell.spent
        return cell
