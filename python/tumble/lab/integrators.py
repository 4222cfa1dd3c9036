"""`tumble lab integrators`: one scene under every integrator, and what that says about accuracy, stability and cost."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from tumble._engine import Scene, SceneError
from tumble.lab import figures, findings, flocks, measure
from tumble.lab.cells import STOPPED, Cell, Purse
from tumble.lab.findings import Cost, number, per_second, seconds
from tumble.lab.limits import largest_steps
from tumble.lab.measure import Results
from tumble.lab.page import Section, colored, table, write
from tumble.lab.schemes import NEEDS_VELOCITIES, SCHEMES, Scheme, chosen
from tumble.lab.subject import PERIODS, subject

DECADES = {"adaptive_euler": (-1, -2, -3, -4, -5, -6), "dormand_prince": (-1, -3, -5, -7, -9, -11)}
"""Tolerances of the adaptive integrators, as powers of ten of the size of the motion: of order 1 a step shrinks like
the root of the tolerance, of order 5 like its fifth root."""


def page(
    scene: Scene,
    folder: Path,
    *,
    steps: Sequence[float] | None = None,
    integrators: Sequence[str] | None = None,
    duration: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    budget: float = 45.0,
) -> Path:
    """Runs a scene under every integrator and writes integrators.html, .png and .csv; returns the first.

    `steps` are sub-steps [s] (each is shortened to divide an eighth of `duration`); without them they are halved from
    above the predicted stability limits. `integrators` names some of them; without it, all that can move the scene.
    `duration` [s] is the length of the runs whose errors are compared. Runs that would not fit into `budget` [s], which
    all experiments share, are left out, and the page says so. Raises SceneError, ExportError, ValueError for an unknown
    integrator.
    """
    results = study(scene, steps, integrators, duration, progress, budget)
    over_time = [flocks.section(results, o) for o in results.observed] or [_energy_section(results)]
    # No energy tells when the step of a flock is too long.
    limits = [] if results.subject.flock else [_limits_section(results)]
    sections = [*over_time, _accuracy_section(results), *limits, _table_section(results)]
    title = str(results.subject.tree["title"]) or "A scene"
    return write(
        Path(folder),
        "integrators",
        f"{title}: every integrator",
        _lead(results),
        findings.headlines(results) + flocks.headlines(results),
        sections,
        _notes(results),
        _rows(results),
        figures.WIDTH,
    )


def study(
    scene: Scene,
    steps: Sequence[float] | None = None,
    integrators: Sequence[str] | None = None,
    duration: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    budget: float = 45.0,
) -> Results:
    """The measurements of a page."""
    end = time.perf_counter() + budget

    def purse(share: float) -> Purse:
        """A share of the budget, or what is left of it."""
        return Purse(max(0.0, min(share * budget, end - time.perf_counter())))

    tested = subject(scene, 0.1 * budget)
    words = list(integrators) if integrators else None
    results = Results(tested, chosen(words, tested.massless))
    _leave_out(results, words)
    given = duration
    if tested.crowded and duration is None:
        given = results.horizon = measure.horizon(tested, purse(0.1))
    results.duration = given or measure.default_duration(tested)
    ladder = [float(h) for h in steps] if steps is not None else measure.default_steps(tested, results.duration)
    adaptive = sum(s.adaptive for s in results.schemes)
    fixed = len(results.schemes) - adaptive
    total = 1 + fixed * (len(ladder) + 3) + adaptive * 7
    done = 0

    def tick() -> None:
        nonlocal done
        done = min(done + 1, total - 1)
        if progress is not None:
            progress(done, total)

    if progress is not None:
        progress(0, total)
    results.reference = measure.reference(tested, results.duration, min(ladder), purse(0.15))
    tick()
    size = results.reference.size if results.reference else tested.extent
    if size == 0:
        raise SceneError("nothing moves in this scene: give it gravity, a velocity, or a spring that is not at rest")
    measure.accuracy(
        results,
        ladder,
        {w: [size * 10.0**k for k in decades] for w, decades in DECADES.items()},
        purse(0.35),
        tick,
    )
    if tested.flock:
        results.observed = flocks.follow(results, purse(0.4), tick)
    else:
        measure.energy(results, 1e-3 * size, purse(0.1), tick)
    results.found = largest_steps(tested, results.schemes, purse(0.4), tick)
    if progress is not None:
        progress(total, total)
    return results


def _leave_out(results: Results, words: list[str] | None) -> None:
    """Leaves out the integrators that cannot move the scene, and keeps why."""
    tested = results.subject
    if words:
        rest = [s.word for s in SCHEMES if s.word not in words]
        results.left_out |= dict.fromkeys(rest, "not asked for")
    if tested.massless:
        stopped = [s.word for s in SCHEMES if s.needs_velocities and s.word not in results.left_out]
        results.left_out |= dict.fromkeys(stopped, f"need {NEEDS_VELOCITIES}")
    able = []
    for scheme in results.schemes:
        try:
            tested.world(scheme, 1.0 / float(tested.tree["time"]["fps"]), 1, 1, 1e-3 * tested.extent)
            able.append(scheme)
        except SceneError as error:
            results.left_out[scheme.word] = str(error)
    if not able:
        raise SceneError(f"no integrator can move this scene: {results.left_out[results.schemes[0].word]}")
    results.schemes = able


def _told_left_out(results: Results) -> list[str]:
    """Which integrators are not on the page, and why."""
    reasons: dict[str, list[str]] = {}
    for word, why in results.left_out.items():
        reasons.setdefault(why, []).append(word)
    return [f"Left out: {', '.join(words)}: {escape(why)}." for why, words in reasons.items()]


def _lead(results: Results) -> str:
    tested = results.subject
    n, words = len(tested.start), ("tracer", "tracers") if tested.massless else ("mass", "masses")
    what = f"{n} {words[n != 1]}"
    if tested.massless:
        mode = (
            f"the field's highest rate is {number(tested.rate)}/s"
            if tested.rate
            else "the field has no rate of its own"
        )
    elif tested.limited:
        period = seconds(2 * np.pi / tested.rate)
        mode = f"the stiffest mode turns at ω = {number(tested.frequency)} rad/s (a period of {period})"
        if tested.damping > 1e-9 * tested.rate:
            mode += f" and is damped at {number(tested.damping)}/s"
        if tested.culprit:
            mode += f", most of it in “{escape(tested.culprit[0])}”, particle {tested.culprit[1]}"
    elif tested.flock:
        mode = f"the fastest urge answers at {number(tested.rate)}/s"
    else:
        mode = "no springs, so nothing limits the step but accuracy"
    return f"{what}, in double precision; {mode}. Errors are taken over {seconds(results.duration)}."


def _energy_section(results: Results) -> Section:
    h, rate = results.common_step, results.subject.rate
    relative = f" (h × highest rate = {number(h * rate, 2)})" if rate > 0 and h > 0 else ""
    title = f"The same step for all, h = {seconds(h)}" if h > 0 else "The same step for all"
    if results.subject.massless:
        text = (
            f"<p>The path of one tracer, every step a dot{relative}. A tangent leaves a circle on the outside and the "
            "next step starts there; implicit Euler, the same step backward, falls inside. The adaptive schemes have a "
            "tolerance of a thousandth of the motion.</p>"
        )
        return Section(title, text, partial(figures.draw_energy, results=results), 3.6, "Paths under each integrator")
    text = (
        f"<p>Energy against that of the true motion{relative}; 1 is right. Where things oscillate, Euler along the "
        "tangent pumps energy in until the run explodes; Runge-Kutta schemes do so far more slowly; symplectic ones "
        "swing about the right value and do not drift; implicit Euler eats energy, which keeps it stable and makes it "
        "wrong, and position-based dynamics, which is implicit Euler if swept until nothing moves, eats as much: on one "
        "spring all but 1/(1 + z²) of it a step, z = h ω. The adaptive schemes have a tolerance of a thousandth of the "
        "motion.</p>"
    )
    return Section(
        title, text, partial(figures.draw_energy, results=results), figures.HEIGHTS["energy"], "Energy over time"
    )


def _accuracy_section(results: Results) -> Section:
    truth = results.reference
    if truth is None:
        source = "No converged solution was found in the time allowed, so there are no errors to show."
    elif not figures.comparable(results):
        source = "Here every run that ended is exact, or lost altogether: there is nothing to draw."
    elif truth.uncertainty > 1e-12:
        source = f"Compared with {truth.how}, which is itself known to {number(truth.uncertainty, 1)} (grey)."
    else:
        source = f"Compared with {truth.how}."
    text = (
        "<p>Halve the step: the error falls by 2<sup>order</sup>, a straight line of that slope. But a step of a "
        f"higher order costs more evaluations, which the right side counts; there, lower left is better. {source}</p>"
    )
    draw = partial(figures.draw_accuracy, results=results) if figures.comparable(results) else None
    return Section("Accuracy, and what it costs", text, draw, figures.HEIGHTS["accuracy"], "Error over step and cost")


def _limits_section(results: Results) -> Section:
    if not results.subject.limited:
        text = "<p>Nothing here pulls back or brakes, so no step explodes; being accurate is all that costs.</p>"
        draw = partial(figures.draw_limits, results=results)
        return Section("What accuracy costs", text, draw, figures.HEIGHTS["limits"], "Costs")
    if results.subject.massless:
        grown = "the squared distance from the true place passes a thousand times the squared size"
    else:
        grown = "the energy grows a thousandfold"
    text = f"<p>A step is too long if {grown} within {PERIODS:.0f} periods of the fastest mode. "
    if any(np.isfinite(f.disturbed) for f in results.found.values()):
        text += (
            "The prediction (diamond) looks at that mode alone, and so does the bar: it shows from which step on a "
            "small disturbance of the mode grows that much. The whole scene (dot) may take longer steps where the "
            "growth is slow and the mode holds only a whisper of the energy: it is not heard in time. "
        )
    text += (
        "On the right the price: open circles are the cheapest way to survive, filled ones the cheapest way to survive "
        "and be within 1 %. Implicit schemes survive for little; being right is what they have to pay for.</p>"
    )
    draw = partial(figures.draw_limits, results=results)
    return Section(
        "The largest step, and what each cure costs", text, draw, figures.HEIGHTS["limits"], "Largest steps, costs"
    )


def _table_section(results: Results) -> Section:
    head = [
        "integrator", "order<br>seen / theory", "largest step<br>predicted", "of the stiffest<br>mode (ratio)",
        "of the scene<br>(ratio)", "to survive:<br>evaluations", "<br>time", "within 1 %:<br>evaluations", "<br>time",
        "what broke, and where",
    ]  # fmt: skip
    rows, groups, family = [], [], None
    for k, scheme in enumerate(results.schemes):
        if family is not None and family is not scheme.family:
            groups.append(k)
        family = scheme.family
        rows.append(_table_row(results, scheme))
    text = (
        "<p>Costs are those of one simulated second, or, where less than one evaluation falls on it, of the time that one "
        "lasts; evaluations of implicit schemes include the products of the linear solver.</p>"
    )
    return Section("In numbers", text, table=table(head, rows, (0, len(head) - 1), groups))


def _table_row(results: Results, scheme: Scheme) -> list[str]:
    none = '<span class="none">–</span>'
    seen = findings.order(results, scheme)
    cells = [
        colored(scheme.word, scheme.ink),
        f"{seen:.2f} / {scheme.order}" if np.isfinite(seen) else f"– / {scheme.order}",
    ]
    found = results.found.get(scheme.word)
    if scheme.adaptive:
        cells += ["chosen", none, none]
    elif found is None:
        cells += [none, none, none]
    else:
        cells.append(_limit(found.predicted))
        for value in (found.disturbed, found.measured):
            sound = 0 < found.predicted < np.inf and 0 < value < np.inf
            cells.append(_limit(value) + (f" ({value / found.predicted:.2f})" if sound else ""))
    for cost in (findings.to_survive(results, scheme), findings.to_target(results, scheme)):
        mark = "≈ " if cost and cost.estimated else ""
        cells += [mark + per_second(cost.evaluations), mark + seconds(cost.seconds)] if cost else [none, none]
    return [*cells, _story(results, findings.blew_up(results, scheme))]


def _limit(value: float) -> str:
    if np.isnan(value):
        return "–"
    return "every one" if value == np.inf else "none" if value == 0 else seconds(value)


def _story(results: Results, cell: Cell | None) -> str:
    if cell is None:
        return "nothing"
    step = f"(h\u00a0=\u00a0{seconds(cell.step)})"
    failure = cell.failure
    if cell.outcome == STOPPED:
        return f"{escape(str(failure.get('kind', 'stopped')))} at {seconds(cell.reached)} {step}"
    if "object" not in failure:
        return f"energy × 1000 by {seconds(cell.reached)} {step}"
    place = f"{escape(str(failure['object']))}, particle {failure['index']}"
    if len(results.subject.tree["system"]) > 1:
        place = f"{escape(str(failure['system']))}: {place}"
    return f"{place}, at {seconds(float(failure['time']))} {step}"


def _notes(results: Results) -> list[str]:
    notes = [*results.subject.notes, *_told_left_out(results)]
    truth = results.reference
    if results.horizon is not None:
        notes.append(
            f"Two runs that begin a little apart are {measure.APART:.0f} times as far apart after {seconds(results.horizon)}. "
            "Errors are compared no longer than that: beyond it they would tell of chaos, not of schemes."
        )
    if results.subject.crowded:
        notes.append(
            "Forces that end at a radius or heed the nearest few have kinks: an order above 2 need not be seen."
        )
    if truth is None:
        notes.append("No reference: the runs that should have served as one did not agree, broke, or took too long.")
    else:
        notes.append(
            f"Errors are root mean squares over all masses, the largest of {measure.SAMPLES} times, over the size of "
            f"the motion, {number(truth.size)} m."
        )
        if truth.uncertainty > 1e-12:
            notes.append(
                f"The reference ({escape(truth.how)}) was run twice, the second time ten times as accurately (or with "
                f"half the step); the two differ by {number(truth.uncertainty, 2)}. Nothing below three times that "
                "is judged."
            )
    if results.subject.discontinuous:
        notes.append(
            "Contact, breaking and pulls between systems happen at the end of a step, which costs every scheme its "
            "order: expect 1."
        )
    left_out = findings.skipped(results)
    if left_out:
        words = ", ".join(dict.fromkeys(c.scheme.word for c in left_out))
        notes.append(f"{len(left_out)} runs did not fit into the time allowed and were left out ({words}).")
    unsolved = sorted({c.scheme.word for c in results.accuracy if c.unconverged})
    if unsolved:
        notes.append(f"Newton's method missed its tolerance in some steps of {', '.join(unsolved)}.")
    for remark in dict.fromkeys(f.note for f in results.found.values() if f.note):
        words = ", ".join(w for w, f in results.found.items() if f.note == remark)
        notes.append(f"Largest steps of {words}: {remark}.")
    notes.append("≈ marks costs beyond the shortest step that was run, by the order seen.")
    notes.append(
        "Times are those of this machine, the shortest of up to three runs. All numbers are in integrators.csv."
    )
    return notes


def _rows(results: Results) -> Iterator[dict[str, Any]]:
    watched = [c for f in results.found.values() for c in (*f.survivors, f.broken, f.autopsy) if c is not None]
    for cell in [*results.accuracy, *results.energy_cells.values(), *watched]:
        failure = cell.failure
        yield {
            "experiment": cell.experiment,
            "integrator": cell.scheme.word,
            "step": cell.step,
            "tolerance": cell.tolerance,
            "duration": cell.duration,
            "outcome": cell.outcome,
            "reached": cell.reached,
            "steps": cell.steps,
            "rejected": cell.rejected,
            "evaluations": cell.evaluations,
            "newton": cell.newton,
            "linear": cell.linear,
            "unconverged": cell.unconverged,
            "seconds": cell.seconds,
            "error": cell.error,
            "system": failure.get("system"),
            "object": failure.get("object"),
            "index": failure.get("index"),
            "time": failure.get("time"),
        }
    for scheme in results.schemes:
        found, cost = results.found.get(scheme.word), findings.to_target(results, scheme)
        yield {
            "experiment": "summary",
            "integrator": scheme.word,
            "order": scheme.order,
            "order_seen": findings.order(results, scheme),
            "usable_predicted": found.predicted if found else None,
            "usable_measured": found.measured if found else None,
            "usable_disturbed": found.disturbed if found else None,
            **_priced("survive", findings.to_survive(results, scheme)),
            **_priced("one_percent", cost),
        }
    yield from flocks.rows(results)
    for word, (times, values) in results.traces.items():
        for t, value in zip(times, values, strict=True):
            row: dict[str, Any] = {"experiment": "trace", "integrator": word, "time": t}
            if np.ndim(value):
                yield row | dict(zip("xyz", (float(v) for v in value), strict=True))
            else:
                yield row | {"energy": float(value)}


def _priced(name: str, cost: Cost | None) -> dict[str, Any]:
    if cost is None:
        return {}
    return {
        f"{name}_evaluations_per_s": cost.evaluations,
        f"{name}_seconds_per_s": cost.seconds,
        f"{name}_step": cost.step,
    }
