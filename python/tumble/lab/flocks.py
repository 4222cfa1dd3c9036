"""A flock under each integrator: it has no conserved energy, but an order, a density and a speed."""

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import FigureBase

from tumble._engine import World
from tumble.lab.cells import BLEW_UP, SURVIVED, Purse, run
from tumble.lab.exact import Floats
from tumble.lab.findings import number, seconds
from tumble.lab.measure import Observed, Results, Tick
from tumble.lab.page import Section
from tumble.lab.schemes import BY_WORD, FAMILIES
from tumble.lab.subject import Subject
from tumble.style import INK

SMALL, LARGE = 0.3, 2.4
"""The common steps, times the flock's highest rate: one that resolves its urges, and one that is too large."""

NAMES = ("polarization", "distance", "speed")
LABELS = ("polarization |mean v/|v||", "nearest neighbour [m]", "mean speed [m/s]")


def birds(subject: Subject, world: World) -> list[str]:
    """Objects that flock."""
    flocks = [force for force in subject.tree["force"] if force["kind"] == "flock"]
    names = subject.objects(world)
    return [n for n in names if any(n in (f.get("on") or _others(names, f)) for f in flocks)]


def _others(names: list[str], force: dict[str, Any]) -> list[str]:
    return [name for name in names if name not in (force.get("predators") or [])]


def observe(x: Floats, v: Floats) -> Floats:
    """|mean of v/|v||, the mean distance to the nearest neighbour [m], and the mean speed [m/s] (flocks.7)."""
    speed = np.linalg.norm(v, axis=1)
    heading = v / np.where(speed > 0, speed, 1.0)[:, None]
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1).mean() if len(x) > 1 else np.nan
    return np.array([np.linalg.norm(heading.mean(axis=0)), nearest, speed.mean()])


def follow(results: Results, purse: Purse, tick: Tick) -> list[Observed]:
    """The flock under all integrators, with a step that resolves its urges and with one that is too large, and once with
    a step so short that it serves as the truth."""
    subject = results.subject
    truth: tuple[list[float], list[Floats]] | None = None
    found = []

    def seen(world: World) -> Floats:
        columns = world.columns("position", "velocity")
        names = birds(subject, world)
        x, v = (np.concatenate([columns[n][c] for n in names]).astype(float) for c in ("position", "velocity"))
        with np.errstate(over="ignore", invalid="ignore"):
            return observe(x, v)

    begin = time.perf_counter()
    start = seen(subject.world(BY_WORD["rk4"], subject.duration, 1, 1))
    purse.left -= time.perf_counter() - begin
    for share, z in ((0.7, SMALL), (1.0, LARGE)):
        rate = subject.rate or 1.0
        length = min(subject.duration, 40.0 / rate)
        h = min(z / rate, length / 4)
        per_frame = max(1, round(length / 100 / h))
        frames = max(2, round(length / (per_frame * h)))
        observed = Observed(h)
        part = Purse(share * purse.left, share * purse.left)
        for rest, word in zip(
            range(len(results.schemes) + 1, 0, -1), ["", *(s.word for s in results.schemes)], strict=True
        ):
            scheme = BY_WORD[word or "rk4"]
            if word:
                tick()
            elif truth is not None:
                observed.times[word], observed.values[word] = np.array(truth[0]), np.array(truth[1])
                continue
            times, values = [0.0], [start]

            def keep(world: World, times: list[float] = times, values: list[Floats] = values) -> bool:
                values.append(seen(world))
                times.append(world.time)
                return bool(np.isfinite(values[-1]).all())

            own = part.part(rest)
            size = results.reference.size if results.reference else subject.extent
            tolerance = 10.0 * z * z * 1e-3 * size if scheme.adaptive else None
            n = per_frame if word else 8 * per_frame
            cell = own.spend(run(subject, scheme, "observed", per_frame * h, frames, n, tolerance, own.left, keep))
            part.settle(own)
            if not word:
                truth = times, values
            else:
                observed.cells[word] = cell
            observed.times[word], observed.values[word] = np.array(times), np.array(values)
        purse.settle(part)
        found.append(observed)
    return found


def section(results: Results, observed: Observed) -> Section:
    """Order, density and speed over time, with one step."""
    z = observed.step * results.subject.rate
    fine = z <= 1.01 * SMALL or results.subject.rate == 0
    title = (
        f"{'The same step for all' if fine else 'The same with a step that is too large'}, h = {seconds(observed.step)}"
    )
    text = (
        f"h × highest rate = {number(z, 2)}; the thin black line is rk4 with an eighth of it. "
        if fine
        else f"h × highest rate = {number(z, 2)}: longer than the time in which a bird answers. "
    )
    text += (
        "A flock makes energy, so none is kept; what a scheme has to keep is its order (1: all fly one way), its "
        "density and its speed (flocks.7). Paths drift apart sooner or later under any two schemes, these should not."
        if fine
        else "Speeds overshoot, order is shaken out of the flock, and neighbours are thrown apart; a bounded "
        "acceleration keeps it from exploding. The adaptive schemes have a larger tolerance instead."
    )
    draw = partial(_draw, results=results, observed=observed)
    return Section(title, f"<p>{text}</p>", draw, 6.6, "Order, density and speed over time")


def _draw(figure: FigureBase, results: Results, observed: Observed) -> None:
    families = [f for f in FAMILIES if any(s.family is f and s.word in observed.cells for s in results.schemes)]
    panels = figure.subplots(len(NAMES), max(1, len(families)), sharex=True, sharey="row", squeeze=False)
    for k, label in enumerate(LABELS):
        panels[k][0].set_ylabel(label)
        # The truth decides what is shown, and what is off by less than a few times of it.
        true = observed.values[""][:, k]
        low, high = float(np.nanmin(true)), float(np.nanmax(true))
        top = 1.05 if k == 0 else high + 0.8 * (high - low) + 0.3 * high
        for column, family in enumerate(families):
            axes = panels[k][column]
            axes.plot(observed.times[""], true, color=INK, lw=1.0, alpha=0.7, zorder=1)
            for scheme in (s for s in results.schemes if s.family is family and s.word in observed.cells):
                cell, times = observed.cells[scheme.word], observed.times[scheme.word]
                end = {SURVIVED: "", BLEW_UP: f"\nlost at {seconds(cell.reached)}"}.get(cell.outcome, "\nnot finished")
                values = np.clip(observed.values[scheme.word][:, k], 0, 2 * top)
                axes.plot(times, values, ls=scheme.line, color=scheme.color, lw=1.4, label=scheme.word + end, zorder=2)
            axes.set_ylim(0, top)
            if k == 0:
                axes.set_title(family.title, color=family.ink, fontsize=10.5)
                axes.legend(loc="lower right", fontsize=7.8, handlelength=2.2, borderaxespad=0.2)
            if k == len(NAMES) - 1:
                axes.set_xlabel("time [s]")


def late(observed: Observed, word: str) -> Floats | None:
    """Means over the second half; None of a run that did not come so far."""
    cell = observed.cells.get(word)
    if cell is not None and cell.outcome != SURVIVED:
        return None
    values = observed.values[word]
    return np.asarray(values[len(values) // 2 :].mean(axis=0))


def headlines(results: Results) -> list[str]:
    """Order, density and speed of a flock, one sentence per step."""
    lines = []
    for observed in results.observed:
        true = late(observed, "")
        if true is None:
            continue
        off = {}
        for s in results.schemes:
            means = late(observed, s.word)
            off[s.word] = np.inf if means is None else float(np.abs(means / true - 1).max())
        wrong = [w for w, e in off.items() if e > 0.25]
        text = (
            f"<b>Flock.</b> With h = {seconds(observed.step)} order, spacing and speed of the second half, truly "
            f"{number(true[0])}, {number(true[1])} m and {number(true[2])} m/s, are "
        )
        text += f"off by more than a quarter under {', '.join(wrong)}" if wrong else "kept within a quarter by all"
        right = [w for w in off if w not in wrong]
        lines.append(text + (f"; {', '.join(right)} keep{'s' * (len(right) == 1)} them." if wrong and right else "."))
    return lines


def rows(results: Results) -> Iterator[dict[str, Any]]:
    """For the table of numbers."""
    for observed in results.observed:
        for word, times in observed.times.items():
            for t, values in zip(times, observed.values[word], strict=True):
                row = dict(zip(NAMES, (float(v) for v in values), strict=True))
                yield {
                    "experiment": "observed",
                    "integrator": word or "truth",
                    "step": observed.step,
                    "time": float(t),
                } | row
