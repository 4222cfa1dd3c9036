"""The experiments on integrators: error over the step, energy over time."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tumble._engine import StepError, World
from tumble.lab.cells import BLEW_UP, SKIPPED, SURVIVED, Cell, Purse, run
from tumble.lab.exact import Floats
from tumble.lab.limits import Found
from tumble.lab.schemes import BY_WORD, Scheme
from tumble.lab.subject import GROWTH, Subject, rms

SAMPLES = 8
"""Times at which positions are compared."""


@dataclass
class Reference:
    """The solution that others are compared with."""

    how: str
    positions: list[Floats]
    """At the ends of SAMPLES intervals [m]."""
    size: float
    """Size of the motion: largest root mean square displacement [m]."""
    uncertainty: float
    """Its own error, over the size of the motion."""


@dataclass
class Observed:
    """A flock over time, under every integrator with one step."""

    step: float
    times: dict[str, Floats] = field(default_factory=dict)
    values: dict[str, Floats] = field(default_factory=dict)
    """Polarization, mean distance of nearest neighbours [m], mean speed [m/s]; a row for each time. Of "" the truth."""
    cells: dict[str, Cell] = field(default_factory=dict)


@dataclass
class Results:
    """All that was measured."""

    subject: Subject
    schemes: list[Scheme]
    duration: float = 0.0
    horizon: float | None = None
    """Time after which runs that began close are far apart [s], if that is what limits `duration`."""
    reference: Reference | None = None
    accuracy: list[Cell] = field(default_factory=list)
    common_step: float = 0.0
    traces: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)
    """Times [s], and energies over the true ones (without masses: the path of one)."""
    energy_cells: dict[str, Cell] = field(default_factory=dict)
    true_path: Floats | None = None
    observed: list[Observed] = field(default_factory=list)
    """Of flocks."""
    found: dict[str, Found] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    """Integrators that are not compared, and why."""


Tick = Callable[[], None]


def default_duration(subject: Subject) -> float:
    """The scene's length, at most about 60 periods of its stiffest mode; not a whole number, so that samples see all
    phases."""
    return min(subject.duration, 2 * np.pi * 57.9 / subject.rate) if subject.rate > 0 else subject.duration


APART = 10.0
"""Growth of a small disturbance beyond which positions of many that push each other say nothing about a scheme."""


def horizon(subject: Subject, purse: Purse) -> float | None:
    """The time within which two runs that begin 1e-8 of the size apart have come ten times as far apart; None if they
    do not within the default duration."""
    duration = default_duration(subject)
    parts = 64
    interval = duration / parts
    n = max(1, round(interval * subject.rate / 0.2)) if subject.rate > 0 else 4
    begin = time.perf_counter()
    worlds = [subject.world(BY_WORD["rk4"], interval, parts, n) for _ in range(2)]
    noise = np.random.default_rng(1).standard_normal(subject.start.shape)
    noise[:, np.ptp(subject.start, axis=0) == 0] = 0.0
    noise *= 1e-8 * subject.extent / rms(noise)
    subject.write(worlds[1], "position", subject.start + noise)
    first = rms(noise)
    for k in range(parts):
        try:
            for world in worlds:
                world.step(patience=max(purse.left - (time.perf_counter() - begin), 0.0))
            subject.consider(worlds[0], max(purse.left - (time.perf_counter() - begin), 0.0))
        except StepError:
            return interval * k or interval
        except TimeoutError:
            subject.notes.append("There was no time to see how soon paths drift apart over the whole length.")
            purse.left = 0.0
            return interval * max(k, 1)
        spent = time.perf_counter() - begin
        if rms(subject.positions(worlds[1]) - subject.positions(worlds[0])) > APART * first:
            purse.left -= spent
            return interval * (k + 1)
        if spent > purse.left:
            subject.notes.append("There was no time to see how soon paths drift apart over the whole length.")
            purse.left = 0.0
            return interval * (k + 1)
    purse.left -= time.perf_counter() - begin
    return None


def default_steps(subject: Subject, duration: float) -> list[float]:
    """Halved again and again, from one step per sample to h rate = 0.01, and eleven at least."""
    interval = duration / SAMPLES
    enough = int(np.ceil(np.log2(max(interval * subject.rate, 1.0) / 0.015)))
    return [interval / 2**k for k in range(max(11, enough))]


def reference(subject: Subject, duration: float, finest: float, purse: Purse) -> Reference | None:
    """The exact solution, or one that has converged: two runs, of which the second is ten times as accurate, agree."""
    interval = duration / SAMPLES
    if subject.solution is not None:
        exact = [subject.solution.at(interval * (k + 1)) for k in range(SAMPLES)]
        size = max(rms(x - subject.start) for x in exact)
        return Reference("the exact solution", exact, size, 1e-13)
    # Contact and breaking happen at the end of a step: there only a short step is accurate, whatever the tolerance.
    if not subject.discontinuous and not subject.flock:
        for tolerance in (1e-12 * subject.extent, 1e-9 * subject.extent, 1e-6 * subject.extent):
            loose, sharp = (
                _positions(subject, "dormand_prince", interval, 1, t, purse, purse.left / 3)
                for t in (10 * tolerance, tolerance)
            )
            if loose and sharp:
                return _agreed(subject, f"dormand_prince with a tolerance of {tolerance:.1g}", loose, sharp)
    best: tuple[int, list[Floats], list[Floats]] | None = None
    loose, n, cost = None, max(1, round(interval / finest) // 8), 0.0
    while n <= 2 * interval / finest and 2.2 * cost < purse.left:
        before = purse.left
        sharp = _positions(subject, "rk4", interval, n, None, purse, purse.left)
        if loose and sharp:
            best = n, loose, sharp
        loose, n, cost = sharp, 2 * n, before - purse.left
    return _agreed(subject, f"rk4 with h = {interval / best[0]:.3g} s", best[1], best[2]) if best else None


def _positions(
    subject: Subject, word: str, interval: float, n: int, tolerance: float | None, purse: Purse, patience: float
) -> list[Floats] | None:
    """Positions at the samples; None if the run broke or took too long."""
    positions: list[Floats] = []

    def keep(world: World) -> bool:
        positions.append(subject.positions(world))
        return True

    if patience <= 0.0:
        return None
    cell = purse.spend(run(subject, BY_WORD[word], "reference", interval, SAMPLES, n, tolerance, patience, keep))
    return positions if cell.outcome == SURVIVED else None


def _agreed(subject: Subject, how: str, loose: list[Floats], sharp: list[Floats]) -> Reference:
    size = max(rms(x - subject.start) for x in sharp)
    off = max(rms(a - b) for a, b in zip(loose, sharp, strict=True))
    return Reference(how, sharp, size, max(off / size if size > 0 else 0.0, 1e-13))


def accuracy(
    results: Results, steps: Sequence[float], tolerances: Mapping[str, Sequence[float]], purse: Purse, tick: Tick
) -> None:
    """Every integrator with every step (every one of its tolerances), against the reference."""
    interval = results.duration / SAMPLES
    for rest, scheme in zip(range(len(results.schemes), 0, -1), results.schemes, strict=True):
        part = purse.part(rest)
        cost, usual = 0.0, float("inf")
        for knob in sorted(tolerances[scheme.word] if scheme.adaptive else steps, reverse=True):
            substeps = 1 if scheme.adaptive else max(1, round(interval / knob))
            tolerance = knob if scheme.adaptive else None
            tick()
            if not part.pays(cost):
                cell = Cell("accuracy", scheme, interval / substeps, tolerance, results.duration, SKIPPED)
                results.accuracy.append(cell)
                continue
            cell, each = _compared(results, scheme, interval, substeps, tolerance, usual, part)
            results.accuracy.append(cell)
            usual = min(usual, each)
            # Halving the step doubles the work; so, about, does a hundredth of the tolerance.
            again = 2.2 * cell.seconds + cell.spent - cell.seconds
            cost = {SURVIVED: again, SKIPPED: float("inf")}.get(cell.outcome, 0.0)
        purse.settle(part)


def _compared(
    results: Results,
    scheme: Scheme,
    interval: float,
    substeps: int,
    tolerance: float | None,
    usual: float,
    purse: Purse,
) -> tuple[Cell, float]:
    """A run and its time per evaluation. It is timed again, and the shortest time kept, if it was short or took longer
    than `usual` per evaluation: something else had the processor."""
    subject, truth = results.subject, results.reference
    errors: list[float] = []

    def compare(world: World) -> bool:
        if truth is None or truth.size == 0:
            return True
        with np.errstate(over="ignore", invalid="ignore"):
            errors.append(rms(subject.positions(world) - truth.positions[len(errors)]) / truth.size)
        return bool(np.isfinite(errors[-1]) and errors[-1] < 1e9)

    cell = purse.spend(run(subject, scheme, "accuracy", interval, SAMPLES, substeps, tolerance, purse.left, compare))
    if cell.outcome == SURVIVED and errors:
        cell.error = max(errors)
    for _ in range(2):
        work = max(1, cell.evaluations)
        suspect = cell.seconds < 0.01 or cell.seconds > 2 * usual * work
        if cell.outcome == SURVIVED and suspect and purse.pays(cell.spent):
            again = run(subject, scheme, "accuracy", interval, SAMPLES, substeps, tolerance, purse.left)
            if purse.spend(again).outcome == SURVIVED:
                cell.seconds = min(cell.seconds, again.seconds)
    return cell, cell.seconds / max(1, cell.evaluations)


def energy(results: Results, tolerance: float, purse: Purse, tick: Tick) -> None:
    """All integrators with one step: their energy over the true one, or without masses the path of the one that goes
    farthest."""
    subject = results.subject
    if subject.rate > 0:
        periods = 2 * np.pi / subject.rate
        length = max(20 * periods, min(subject.duration, 120 * periods))
        h = 0.3 / subject.rate
        if subject.massless:
            length, h = 1.6 * periods, 0.35 / subject.rate
    else:
        length, h = subject.duration, subject.duration / 64
    per_frame = 1 if subject.massless else max(1, round(length / 240 / h))
    interval = per_frame * h
    frames = max(2, round(length / interval))
    results.common_step = h
    truth: list[tuple[float, float]] = []
    scale = 0.0
    which = (
        int(np.argmax(np.linalg.norm(subject.start - subject.start.mean(axis=0), axis=1))) if subject.massless else 0
    )
    first: Mapping[str, Any] = {}

    def books(world: World) -> tuple[float, float]:
        nonlocal scale, first
        ledger = world.ledger
        first = first or ledger
        scale = max(scale, ledger["kinetic"], ledger["elastic"], abs(ledger["external"] - first["external"]))
        return world.time, float(ledger["energy"])

    fine = BY_WORD["rk4"]
    if subject.massless:
        solution, turn = subject.solution, np.linspace(0.0, interval * frames, 400)
        results.true_path = np.array([solution.at(float(t))[which] for t in turn]) if solution is not None else None
    else:
        truth.append(books(subject.world(fine, interval, frames, 1)))

        def keep(world: World) -> bool:
            truth.append(books(world))
            return True

        purse.spend(run(subject, fine, "energy", interval, frames, 8 * per_frame, None, purse.left / 4, keep))
    for rest, scheme in zip(range(len(results.schemes), 0, -1), results.schemes, strict=True):
        tick()
        part = purse.part(rest)
        points: list[Floats] = [subject.start[which]] if subject.massless else [np.array([0.0, 1.0])]

        def follow(world: World, points: list[Floats] = points) -> bool:
            if subject.massless:
                points.append(subject.positions(world)[which])
                return True
            k = len(points)
            energy = world.ledger["energy"]
            if k < len(truth) and scale > 0:
                points.append(np.array([world.time, 1.0 + (energy - truth[k][1]) / scale]))
            return scale == 0 or energy - truth[0][1] < 10 * GROWTH * scale

        knob = tolerance if scheme.adaptive else None
        cell = run(subject, scheme, "energy", interval, frames, per_frame, knob, part.left, follow)
        results.energy_cells[scheme.word] = purse.spend(cell)
        if cell.outcome == BLEW_UP and not subject.massless:
            points.append(np.array([cell.reached, 10 * GROWTH]))
        if len(points) > 1:
            path = np.array(points)
            times = (np.arange(len(path)) * interval).astype(float)
            results.traces[scheme.word] = (times, path) if subject.massless else (path[:, 0], path[:, 1])
