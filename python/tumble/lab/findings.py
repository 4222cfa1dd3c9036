"""Findings of the measurements: observed orders, costs, and sentences."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tumble.lab.cells import BLEW_UP, SKIPPED, STOPPED, SURVIVED, Cell
from tumble.lab.measure import Results
from tumble.lab.schemes import Scheme

TARGET = 0.01
"""The error that costs are compared at, over the size of the motion."""


@dataclass(frozen=True)
class Cost:
    """Cost of one simulated second."""

    evaluations: float
    seconds: float
    step: float
    estimated: bool = False
    """Whether the order was trusted beyond the steps that were tried."""
    stability: bool = False
    """Whether it is stability that sets the step: the largest that survives is accurate enough."""


def cells(results: Results, scheme: Scheme, outcome: str = SURVIVED) -> list[Cell]:
    """The runs of an integrator with one outcome, from the longest step to the shortest."""
    found = [c for c in results.accuracy if c.scheme is scheme and c.outcome == outcome]
    return sorted(found, key=lambda c: -(c.tolerance or c.step))


def floor(results: Results) -> float:
    """Errors below this say nothing: the reference itself is not better."""
    return 3.0 * results.reference.uncertainty if results.reference else float("inf")


def order(results: Results, scheme: Scheme) -> float:
    """Observed order: slope of the error over the three shortest steps above round-off; nan if there are none."""
    lowest, rate = max(10.0 * floor(results), 1e-11), results.subject.rate
    small = [c for c in cells(results, scheme) if rate == 0 or c.step * rate < 1]
    points = [(c.step, c.error) for c in small if lowest < c.error < 0.2]
    # Round-off grows where the error should fall: what comes after a rise is left out.
    falling = points[:1]
    for point in points[1:]:
        if point[1] > 0.9 * falling[-1][1]:
            break
        falling.append(point)
    if len(falling) < 3:
        return float("nan")
    logs = np.log(np.array(falling[-3:]))
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])


def to_survive(results: Results, scheme: Scheme) -> Cost | None:
    """The cheapest of all runs whose steps survive a hundred periods."""
    if not results.subject.limited:
        return None
    found = results.found.get(scheme.word)
    runs = cells(results, scheme)
    if found is not None:
        if not found.measured > 0:
            return None
        runs = [c for c in [*runs, *found.survivors] if c.step <= found.measured * 1.0001]
    if not runs:
        return None
    cell = min(runs, key=lambda c: c.per_second(c.evaluations))
    return Cost(cell.per_second(cell.evaluations), cell.per_second(cell.seconds), cell.step)


def to_target(results: Results, scheme: Scheme, target: float = TARGET) -> Cost | None:
    """The cheapest way to an error of `target` that also survives a hundred periods."""
    cost, safe = _to_error(results, scheme, target), to_survive(results, scheme)
    found = results.found.get(scheme.word)
    if cost is None or safe is None or found is None or cost.step <= found.measured:
        return cost
    return replace(safe, stability=True)


def _to_error(results: Results, scheme: Scheme, target: float) -> Cost | None:
    """The cheapest way to an error of `target`, between the runs on either side of it."""
    points = [
        (c.error, c.per_second(c.evaluations), c.per_second(c.seconds), c.step)
        for c in reversed(cells(results, scheme))
        if np.isfinite(c.error) and c.error > 0
    ]
    if not points or results.reference is None or results.reference.uncertainty > target / 3:
        return None
    if points[0][0] > target:
        seen = order(results, scheme)
        if not np.isfinite(seen) or seen < 0.5:
            return None
        factor = (points[0][0] / target) ** (1.0 / seen)
        return Cost(points[0][1] * factor, points[0][2] * factor, points[0][3] / factor, estimated=True)
    for good, bad in pairwise(points):
        if bad[0] > target:
            share = np.log(target / good[0]) / np.log(bad[0] / good[0])
            evaluations, time, step = (
                float(a ** (1 - share) * b**share) for a, b in zip(good[1:], bad[1:], strict=True)
            )
            return Cost(evaluations, time, step)
    return Cost(*points[-1][1:])


def blew_up(results: Results, scheme: Scheme) -> Cell | None:
    """A run that broke, to tell about: the one that was watched, or the one with the shortest step."""
    found = results.found.get(scheme.word)
    if found is not None and found.autopsy is not None and found.autopsy.failure:
        return found.autopsy
    if found is not None and found.broken is not None:
        return found.broken
    broken = [*cells(results, scheme, BLEW_UP), *cells(results, scheme, STOPPED)]
    energy = results.energy_cells.get(scheme.word)
    if energy is not None and energy.outcome == BLEW_UP:
        broken.append(energy)
    told = [c for c in broken if c.failure]
    return min(told or broken, key=lambda c: c.step, default=None)


def _evaluations(each: float) -> str:
    """`1 200 force evaluations per simulated second`."""
    if each < 0.995:
        return f"one force evaluation in {seconds(1.0 / each)} of simulated time"
    return f"{number(each, 2)} force evaluations per simulated second"


def skipped(results: Results) -> list[Cell]:
    """Runs that did not fit into the time allowed."""
    all_cells = [*results.accuracy, *results.energy_cells.values()]
    return [c for c in all_cells if c.outcome == SKIPPED]


def number(value: float, digits: int = 3) -> str:
    """A number for people: 1 200, 0.012, 3.4e-05."""
    if not np.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 0.001 <= abs(value) < 1:
        return f"{value:.{digits}g}"
    if 1 <= abs(value) < 1e6:
        value = float(f"{value:.{digits - 1}e}")
        places = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
        return f"{round(value, places):,.{places}f}".replace(",", "\u202f")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa} × 10{_raised(int(exponent))}"


def per_second(evaluations: float) -> str:
    """How many fall on a simulated second: 1 200; or 1 in 39 s, where that is less than one."""
    if not 0 < evaluations < 0.995:
        return number(evaluations)
    return f"1 in {seconds(1.0 / evaluations)}"


def off(share: float, signed: bool = False) -> str:
    """How far something is off the right value, as a share of that: 0.3 %, +12 %, 14 times the right value."""
    if not np.isfinite(share):
        return "not known"
    sign = ("+" if share >= 0 else "−") if signed else ""
    if abs(share) > 1.0:
        return f"{sign}{number(abs(share), 2)} times the right value"
    if 0 < abs(share) < 1e-5:
        return "less than 0.001\u00a0%"
    return f"{sign}{number(100.0 * abs(share), 2)}\u00a0%"


def _raised(n: int) -> str:
    return str(n).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def seconds(value: float) -> str:
    """A time for people: 1.2 s, 3.4 ms, 12 µs."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= size * 0.9995:
            return f"{number(value / size)}\u00a0{unit}"
    return f"{number(value * 1e9)}\u00a0ns" if value > 0 else "0\u00a0s"


def headlines(results: Results) -> list[str]:
    """The argument in a few sentences, with this scene's numbers."""
    lines = []
    costs = {s: c for s in results.schemes if (c := to_target(results, s)) is not None}
    if len(costs) > 2:
        best = min(costs, key=lambda s: costs[s].evaluations)
        worst = max(costs, key=lambda s: costs[s].evaluations)
        factor = costs[worst].evaluations / costs[best].evaluations
        lines.append(
            f"<b>Accuracy.</b> An error of 1 % costs {best.word} {_evaluations(costs[best].evaluations)}, and "
            f"{worst.word} {number(factor, 2)} times as many."
        )
    lines += _stability(results)
    ends = {w: e for w, (_, e) in results.traces.items() if e.ndim == 1 and np.isfinite(e[-1])}
    kept = [w for w, e in ends.items() if abs(e[-1] - 1) < 0.1]
    lost = [w for w, e in ends.items() if e[-1] <= 0.9]
    won = [w for w, e in ends.items() if e[-1] >= 1.1]
    if ends:
        parts = [f"{', '.join(won)} gain{'s' * (len(won) == 1)} energy" if won else ""]
        parts.append(f"{', '.join(lost)} lose{'s' * (len(lost) == 1)} it" if lost else "")
        parts.append(f"{'the others keep' if won or lost else 'all keep'} it within a tenth" if kept else "")
        step = seconds(results.common_step)
        lines.append(f"<b>Energy.</b> With h = {step}, {'; '.join(p for p in parts if p)}.")
    return lines


def _stability(results: Results) -> list[str]:
    explicit = {w: f for w, f in results.found.items() if np.isfinite(f.measured) and f.measured > 0}
    free = [w for w, f in results.found.items() if f.measured == np.inf]
    if not explicit:
        return []
    longest = max(explicit, key=lambda w: explicit[w].measured)
    shortest = min(explicit, key=lambda w: explicit[w].measured)
    text = f"<b>Stability.</b> {longest} survives with steps up to {seconds(explicit[longest].measured)}"
    if shortest != longest:
        ratio = explicit[longest].measured / explicit[shortest].measured
        text += f", {number(ratio, 2)} times as long as {shortest} does"
    if free:
        text += f"; {', '.join(free)} with every step that was tried"
    return [text + "."]
