"""The largest step that survives, by bisection, beside the predicted one."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tumble._engine import StepError, World
from tumble.lab.cells import BLEW_UP, MOST, SKIPPED, STOPPED, SURVIVED, Cell, Purse, run
from tumble.lab.exact import Floats, is_constant
from tumble.lab.schemes import BY_WORD, Scheme
from tumble.lab.subject import GROWTH, PERIODS, Subject

PRECISION = 1.015
"""Bisection ends when the two sides are within this ratio."""


@dataclass
class Found:
    """The largest step of an integrator that survives [s]."""

    predicted: float
    """0: none, inf: every one, nan: no prediction."""
    measured: float = float("nan")
    """Of the scene as it is. inf: no step that was tried blew up."""
    disturbed: float = float("nan")
    """The largest step at which a small disturbance of the stiffest mode does not grow as much."""
    largest_tried: float = 0.0
    survivors: list[Cell] = field(default_factory=list)
    broken: Cell | None = None
    """The run with the shortest step that did not survive."""
    autopsy: Cell | None = None
    """A run with a step too long, which the engine watched."""
    note: str = ""


def largest_steps(
    subject: Subject, schemes: Sequence[Scheme], purse: Purse, tick: Callable[[], None]
) -> dict[str, Found]:
    """The largest step of every integrator, by bisection: the energy (without masses: the squared distance from the true
    place) must not grow a thousandfold within a hundred periods of the stiffest mode."""
    fixed = [s for s in schemes if not s.adaptive]
    results: dict[str, Found] = {}
    if not subject.limited or not fixed:
        return results
    begin = time.perf_counter()
    mode = stiffest_mode(subject, 0.2 * purse.left)
    purse.left -= time.perf_counter() - begin
    for rest, scheme in zip(range(len(fixed), 0, -1), fixed, strict=True):
        tick()
        part = purse.part(rest)
        limits = subject.limits.get(scheme.word)
        found = results[scheme.word] = Found(limits.usable if limits else float("nan"))
        if scheme.implicit:
            _climb(subject, scheme, found, part)
        else:
            _search(subject, scheme, found, mode, part)
        tick()
        if 0 < found.measured < np.inf and not subject.massless and not scheme.implicit:
            found.autopsy = _autopsy(subject, scheme, found, limits is not None and limits.stable == 0, part)
        purse.settle(part)
    return results


def _search(subject: Subject, scheme: Scheme, found: Found, mode: Floats | None, purse: Purse) -> None:
    """Explicit schemes: from the prediction on, up or down. The disturbance takes two runs at a time, and is left out
    if one alone took most of the time allowed."""
    half = Purse(0.6 * purse.left if mode is not None else purse.left)
    given = half.left
    found.measured, found.note = _bisect(
        subject.rate, found.predicted, lambda h: _survives(subject, scheme, found, half, h)
    )
    purse.left -= given - half.left
    if mode is not None and half.left > 0.5 * (given - half.left):
        found.disturbed, _ = _bisect(subject.rate, found.predicted, lambda h: _calm(subject, scheme, mode, purse, h))


def _frames(subject: Subject, h: float) -> tuple[int, int]:
    """Sub-steps in a frame, and frames, that make up the hundred periods."""
    length = 2 * np.pi * PERIODS / subject.rate
    per_frame = max(1, int(np.ceil(length / 50 / h)))
    return per_frame, int(np.ceil(length / (per_frame * h) * (1 - 1e-9)))


def _survives(subject: Subject, scheme: Scheme, found: Found, purse: Purse, h: float) -> bool | None:
    """Whether the scene as it is does; None if there is no time to find out."""
    per_frame, frames = _frames(subject, h)
    before = found.survivors[-1] if found.survivors else None
    if not purse.pays(before.seconds * before.step / h + before.spent - before.seconds if before else 0.0):
        return None
    begin = time.perf_counter()
    grown = _growth(subject)
    purse.left -= time.perf_counter() - begin
    cell = purse.spend(run(subject, scheme, "limit", per_frame * h, frames, per_frame, None, purse.left, grown))
    found.largest_tried = max(found.largest_tried, h)
    if cell.outcome == SURVIVED:
        found.survivors.append(cell)
    if cell.outcome == BLEW_UP and (found.broken is None or h < found.broken.step):
        found.broken = cell
    return None if cell.outcome in (SKIPPED, STOPPED) else cell.outcome == SURVIVED


def _climb(subject: Subject, scheme: Scheme, found: Found, purse: Purse) -> None:
    """Implicit schemes are tried with ever longer steps."""
    for h in (1.0, 10.0, 78.0):
        if _survives(subject, scheme, found, purse, h / subject.rate) is not True:
            found.note = "longer steps blew up" if found.broken else "the time allowed was over"
            found.measured = max((c.step for c in found.survivors), default=float("nan"))
            return
    found.measured = np.inf


def _bisect(rate: float, predicted: float, survives: Callable[[float], bool | None]) -> tuple[float, str]:
    """The largest h that survives, and a remark."""
    h = 0.95 * (predicted if 0 < predicted < np.inf else 1.0 / rate)
    low = high = 0.0
    for ratio in [1.12, 1.5] + 22 * [2.0]:
        fine = survives(h)
        if fine is None:
            return (low or float("nan")), "the time allowed was over"
        low, high = (h, high) if fine else (low, h)
        if low and high:
            break
        if low * rate > 100:
            return np.inf, ""
        h *= ratio if fine else 1.0 / ratio
    while low and high / low > PRECISION:
        middle = float(np.sqrt(low * high))
        fine = survives(middle)
        if fine is None:
            return low, "rough, the time allowed was over"
        low, high = (middle, high) if fine else (low, middle)
    return low, ""


def _growth(subject: Subject) -> Callable[[World], bool]:
    """Says no when a world has grown a thousandfold."""
    first: Mapping[str, Any] = {}
    scale, extent = 0.0, subject.extent
    if subject.massless:
        solution = subject.solution
        if solution is not None:
            extent = max(extent, float(np.abs(solution.at(np.pi / subject.rate) - subject.start).max()) / 2)
    else:
        first = subject.world(BY_WORD["rk4"], 1.0, 1, 1).ledger
        gravity = subject.tree["world"]["gravity"]
        gravity = float(np.linalg.norm(gravity)) if is_constant(gravity) else 9.8
        scale = max(first["kinetic"], first["elastic"], first["mass"] * gravity * 2 * extent)

    def fine(world: World) -> bool:
        with np.errstate(over="ignore", invalid="ignore"):
            if subject.massless:
                if subject.solution is None:
                    return True
                off = np.abs(subject.positions(world) - subject.solution.at(world.time)).max()
                return bool(off * off <= GROWTH * extent * extent)
            energy = world.ledger["energy"]
            return bool(energy - first["energy"] <= GROWTH * scale) if scale > 0 else bool(np.isfinite(energy))

    return fine


def stiffest_mode(subject: Subject, patience: float = np.inf) -> Floats | None:
    """Displacements n x 3 in the stiffest mode, of length 1; None if there is none, or it takes longer than `patience` [s].

    By power iteration: a step of symplectic Euler from rest leaves the velocities h a(x), so that two of them, from x
    and from x + u, show what the stiffness matrix makes of u.
    """
    if subject.massless or subject.frequency <= 0:
        return None
    h, size = 1e-3 / subject.rate, 1e-6 * subject.extent
    world = subject.world(BY_WORD["symplectic_euler"], h, 1, 1)
    rest = np.zeros_like(subject.start)
    end = time.perf_counter() + patience

    def push(x: Floats) -> Floats:
        subject.write(world, "position", x)
        subject.write(world, "velocity", rest)
        world.step(patience=max(end - time.perf_counter(), 0.0))
        return subject.velocities(world)

    try:
        still = push(subject.start)
        u = np.random.default_rng(1).standard_normal(subject.start.shape)
        for _ in range(80):
            u = push(subject.start + size * u / np.linalg.norm(u)) - still
            if not np.linalg.norm(u) > 0:
                return None
    except (StepError, TimeoutError):
        return None
    return np.asarray(u / np.linalg.norm(u))


def _calm(subject: Subject, scheme: Scheme, mode: Floats, purse: Purse, h: float) -> bool | None:
    """Whether a small disturbance of the stiffest mode stays below a thousand times its energy: two runs, one of them
    struck, side by side."""
    per_frame, frames = _frames(subject, h)
    if per_frame > MOST:
        return None
    begin = time.perf_counter()
    plain, struck = (subject.world(scheme, per_frame * h, frames, per_frame) for _ in range(2))
    frequency, size = subject.frequency, 1e-7 * subject.extent
    subject.write(struck, "velocity", subject.velocities(struck) + size * frequency * mode)
    masses = np.concatenate([struck.topology[name]["mass"] for name in subject.objects(struck)])[:, None]

    def energy() -> float:
        dx = subject.positions(struck) - subject.positions(plain)
        dv = subject.velocities(struck) - subject.velocities(plain)
        return float(np.sum(masses * (dv * dv + (frequency * dx) ** 2)))

    first = energy()
    for _ in range(frames):
        purse.left -= time.perf_counter() - begin
        if purse.left <= 0:
            return None
        begin = time.perf_counter()
        try:
            plain.step(patience=purse.left)
            struck.step(patience=purse.left)
        except TimeoutError:
            purse.left = 0.0
            return None
        except StepError:
            purse.left -= time.perf_counter() - begin
            return False
        with np.errstate(over="ignore", invalid="ignore"):
            if not energy() <= GROWTH * first:
                purse.left -= time.perf_counter() - begin
                return False
    purse.left -= time.perf_counter() - begin
    return True


def _autopsy(subject: Subject, scheme: Scheme, found: Found, weak: bool, purse: Purse) -> Cell | None:
    """A run with a step that is too long, in one frame: the engine then finds the first that broke. Growth just beyond
    the limit of a scheme that is never stable is slow, so those are tried farther out."""
    cell = None
    for h in (found.measured * (2.0 if weak else 1.25), found.measured * 4.0):
        steps = int(np.ceil(2 * np.pi * PERIODS / (subject.rate * h)))
        last = found.survivors[-1] if found.survivors else None
        if last is None or last.seconds / max(1, last.steps) * steps > max(purse.left, 0.1):
            return cell
        patience = max(purse.left, 0.1)
        cell = purse.spend(run(subject, scheme, "breakdown", h * steps, 1, steps, patience=patience))
        if cell.outcome == BLEW_UP:
            return cell
    return cell
