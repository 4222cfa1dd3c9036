"""The ladder: every solver of the pressure equation on the same systems, over time and over iterations."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import FigureBase

from tumble._engine import TumbleError
from tumble.fields import Field, Grid, Projection, project
from tumble.lab.exact import Floats
from tumble.lab.findings import number, seconds
from tumble.lab.page import Section, table, write
from tumble.style import FAINT, INK, PALETTE

Word = Literal[
    "jacobi",
    "gauss_seidel",
    "sor",
    "conjugate_gradients",
    "incomplete_cholesky",
    "modified_incomplete_cholesky",
    "multigrid",
    "multigrid_gradients",
    "cosine",
]
Precision = Literal["single", "double"]

CELLS = 48
"""Along a side of the cube of 1 m."""

LEVELS = (1e-3, 1e-5)
"""Of max |div u| dx/max |u|, at which methods are compared."""

BUDGET = 20.0
"""Time after which a method is stopped [s]."""

GLANCE = 4
"""Iterations after which the error is shown."""

SHOWN: tuple[Word, ...] = (
    "jacobi",
    "sor",
    "conjugate_gradients",
    "modified_incomplete_cholesky",
    "multigrid_gradients",
)
"""Methods whose error is shown."""

KNOWN: tuple[Word, ...] = ("jacobi", "gauss_seidel", "sor", "conjugate_gradients")
"""Methods whose rate in a box is known."""


@dataclass(frozen=True)
class Rung:
    """A method, its look, and how its iterations should grow with the cells along a side."""

    word: Word
    title: str
    ink: str
    line: str
    growth: float | None


RUNGS = (
    Rung("jacobi", "Jacobi", PALETTE[0], ":", 2.0),
    Rung("gauss_seidel", "Gauss-Seidel", PALETTE[0], "--", 2.0),
    Rung("sor", "SOR", PALETTE[0], "-", 1.0),
    Rung("conjugate_gradients", "CG", PALETTE[1], ":", 1.0),
    Rung("incomplete_cholesky", "CG, IC(0)", PALETTE[1], "--", 1.0),
    Rung("modified_incomplete_cholesky", "CG, MIC(0)", PALETTE[1], "-", 0.5),
    Rung("multigrid", "multigrid", PALETTE[2], "--", 0.0),
    Rung("multigrid_gradients", "CG, multigrid", PALETTE[2], "-", 0.0),
    Rung("cosine", "cosine transform", INK, "", None),
)
"""From the simplest to the fastest; a colour for each idea."""

BY_WORD = {rung.word: rung for rung in RUNGS}
assert tuple(BY_WORD) == get_args(Word)

Distance = Callable[..., Floats]


def _box(*x: Floats) -> Floats:
    return np.full_like(x[0], np.inf)


def _ball(*x: Floats) -> Floats:
    return np.asarray(np.sqrt((x[0] - 0.45) ** 2 + (x[1] - 0.5) ** 2 + (x[2] - 0.55) ** 2) - 0.2)


def _shells(*x: Floats, thickness: float) -> Floats:
    far = [np.sqrt(sum((a - c) ** 2 for a, c in zip(x, centre, strict=True))) for centre in _CENTRES]
    return np.asarray(np.minimum(np.abs(far[0] - 0.15), np.abs(far[1] - 0.15)) - 0.5 * thickness)


_CENTRES = ((0.3, 0.5, 0.35), (0.7, 0.5, 0.65))


@dataclass(frozen=True)
class Case:
    """A system: a velocity between the walls of a cube, and what stands in it."""

    name: str
    grid: Grid
    velocity: tuple[Field, ...]
    open: tuple[Field, ...]


def case(name: str, n: int) -> Case:
    """ "a plain box", "a ball in it" or "two sealed pockets", on n x n x n cells."""
    # A shell three cells thick lets nothing through: closed faces make a band two cells wide.
    distances: dict[str, Distance] = {
        "a plain box": _box,
        "a ball in it": _ball,
        "two sealed pockets": partial(_shells, thickness=3.0 / n),
    }
    away = distances[name]
    grid = Grid((n, n, n), 1.0 / n)
    random = np.random.default_rng(1)
    velocity, share = [], []
    for place in ("face x", "face y", "face z"):
        x = grid.points(place)
        # A column of air that rises, and noise: all wave lengths.
        rise = np.exp(-((x[0] - 0.5) ** 2 + (x[1] - 0.45) ** 2) / 0.02 - ((x[2] - 0.3) / 0.2) ** 2)
        values = random.uniform(-0.3, 0.3, x[0].shape) + (rise if place == "face z" else 0.0)
        velocity.append(grid.field(values, place, "m/s"))
        share.append(grid.field(np.clip(0.5 + away(*x) * n, 0.0, 1.0), place))
    return Case(name, grid, tuple(velocity), tuple(share))


NAMES = ("a plain box", "a ball in it", "two sealed pockets")


@dataclass(frozen=True)
class Run:
    """A method on a case."""

    rung: Rung
    found: Projection | None
    refused: str = ""
    """Why there is no solution."""

    def at(self, level: float) -> int | None:
        """The first iteration after which the residual is below a level."""
        if self.found is None:
            return None
        below = np.flatnonzero(self.found.residuals <= level)
        return int(below[0]) if len(below) else None

    def time(self, level: float) -> float | None:
        """The time until then, set-up left out [s]."""
        at = self.at(level)
        return None if at is None or self.found is None else float(self.found.times[at])

    @property
    def factor(self) -> float:
        """By which an iteration shrinks the residual, over the last half of them; nan of few."""
        if self.found is None or len(self.found.residuals) < 5:
            return float("nan")
        r = np.log(self.found.residuals[len(self.found.residuals) // 2 :])
        # A line through all: single residuals of conjugate gradients jump.
        return float(np.exp(np.polyfit(np.arange(len(r)), r, 1)[0]))


def run(
    subject: Case,
    rung: Rung,
    tolerance: float = LEVELS[-1],
    budget: float = BUDGET,
    precision: Precision = "double",
    iterations: int | None = None,
) -> Run:
    """Solves until the tolerance is met or the budget [s] is spent, or a number of iterations."""

    def solve(most: int) -> Projection:
        return project(subject.velocity, subject.open, rung.word, tolerance, most, precision)

    try:
        if iterations is None:
            found, iterations = solve(20), 20
            # How many the budget allows is known better and better.
            while not found.converged and found.times[-1] < 0.5 * budget and iterations < 1_000_000:
                iterations = int(min(10.0, 0.9 * budget / found.times[-1]) * found.iterations) + 1
                found = solve(iterations)
            return Run(rung, found)
        return Run(rung, solve(iterations))
    except TumbleError as error:
        return Run(rung, None, str(error))


@dataclass(frozen=True)
class Theory:
    """Theory for a plain cube of n³ cells."""

    n: int

    @property
    def smoothest(self) -> float:
        """The least eigenvalue of D^-1 A but zero: that of cos(pi x), by its Rayleigh quotient. At walls D is smaller,
        which makes it larger by 4/(3 n)."""
        return float((1.0 - np.cos(np.pi / self.n)) / 3.0 * (1.0 + 4.0 / (3.0 * self.n)))

    @property
    def condition(self) -> float:
        """Of A without its zero."""
        return float(3.0 / np.tan(0.5 * np.pi / self.n) ** 2)

    def factor(self, word: Word) -> float:
        """By which an iteration shrinks the residual in the end; of conjugate gradients a bound; nan where nothing is known."""
        if word == "jacobi":
            return float(1.0 - 6.0 / 7.0 * self.smoothest)
        if word == "gauss_seidel":
            return float((1.0 - self.smoothest) ** 2)
        if word == "sor":
            mu = 1.0 - (1.0 - np.cos(np.pi / self.n)) / 3.0
            return float(2.0 / (1.0 + np.sqrt(1.0 - mu**2)) - 1.0)
        if word == "conjugate_gradients":
            root = np.sqrt(self.condition)
            return float((root - 1.0) / (root + 1.0))
        return float("nan")


FORMULAS: dict[Word, str] = {
    "jacobi": "1 − 6/7 λ, λ = (1 − cos π/n)/3 · (1 + 4/3n)",
    "gauss_seidel": "(1 − λ)²",
    "sor": "ω − 1, ω = 2/(1 + √(1 − µ²)), µ = 1 − (1 − cos π/n)/3",
    "conjugate_gradients": "at most (√κ − 1)/(√κ + 1), κ = 3/tan²(π/2n)",
}


@dataclass(frozen=True)
class Study:
    """All that is measured."""

    cells: int
    precision: Precision
    runs: dict[str, list[Run]]
    """By the name of the case."""
    sizes: dict[int, list[Run]]
    """Of the plain box, by cells along a side."""
    glances: list[tuple[Rung, Floats]]
    """Errors of the potential after a few iterations, in the middle plane of the case with the ball [m²/s]."""

    def of(self, name: str, word: Word) -> Run:
        """A method on a case."""
        return next(r for r in self.runs[name] if r.rung.word == word)

    def growth(self, word: Word) -> float:
        """The exponent with which iterations grow with the cells along a side, over the last doubling."""
        coarse, fine = sorted(self.sizes)[-2:]
        its = [next(r for r in self.sizes[n] if r.rung.word == word).at(LEVELS[-1]) for n in (coarse, fine)]
        if its[0] is None or its[1] is None:
            return float("nan")
        return float(np.log(its[1] / its[0]) / np.log(fine / coarse))


def study(
    cells: int = CELLS,
    budget: float = BUDGET,
    precision: Precision = "double",
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Solves everything."""
    wanted = [(NAMES[0], cells // 4), (NAMES[0], cells // 2), *((name, cells) for name in NAMES)]
    solved: dict[tuple[str, int], list[Run]] = {}
    for i, (name, n) in enumerate(wanted):
        subject, solved[name, n] = case(name, n), []
        for j, rung in enumerate(RUNGS):
            if progress is not None:
                progress(i * len(RUNGS) + j, len(wanted) * len(RUNGS))
            solved[name, n].append(run(subject, rung, budget=budget, precision=precision))
    if progress is not None:
        progress(len(wanted) * len(RUNGS), len(wanted) * len(RUNGS))
    runs = {name: solved[name, cells] for name in NAMES}
    sizes = {n: solved[NAMES[0], n] for n in (cells // 4, cells // 2, cells)}
    return Study(cells, precision, runs, sizes, _glances(case(NAMES[1], cells), precision))


def _glances(subject: Case, precision: Precision) -> list[tuple[Rung, Floats]]:
    exact = project(subject.velocity, subject.open, tolerance=1e-11).potential.array
    fluid = _ball(*subject.grid.points()) > 0
    found = []
    for word in SHOWN:
        solved = run(subject, BY_WORD[word], 1e-12, precision=precision, iterations=GLANCE).found
        assert solved is not None
        error = solved.potential.array - exact
        error = np.where(fluid, error - error[fluid].mean(), np.nan)
        found.append((BY_WORD[word], error[:, error.shape[1] // 2]))
    return found


def page(
    folder: Path,
    cells: int = CELLS,
    budget: float = BUDGET,
    precision: Precision = "double",
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes pressure.html, .png and .csv and returns the first."""
    seen = study(cells, budget, precision, progress)
    sections = [
        Section(
            "What is left, over time",
            f"<p>Three systems of {cells}³ cells: a closed box; one with a ball that cuts cells; one with two spherical "
            "shells that seal what is inside. The velocity: a column of rising air, and noise of every wave length. Drawn "
            "is max |div u| Δx/max |u| after each iteration; what the cosine transform leaves is lower still. A colour is an "
            "idea: setting cells from their neighbours, conjugate gradients, many grids, a transform.</p>",
            partial(_residuals, seen=seen, over_time=True),
            4.6,
            "Residual over time",
        ),
        Section(
            "What is left, over iterations",
            "<p>The same, counted. An iteration is not the same work everywhere: one of multigrid is several passes over all "
            "cells, one with incomplete factors goes through cells one after the other and leaves all but one core idle.</p>",
            partial(_residuals, seen=seen, over_time=False),
            4.6,
            "Residual over iterations",
        ),
        Section("To 10⁻³ and to 10⁻⁵", "", table=_table(seen)),
        Section(
            "What an iteration cannot see",
            f"<p>The error of the pressure after {GLANCE} iterations, in the middle plane around the ball, each in its own "
            "colours; its root mean square above. News goes one cell an iteration, so Jacobi and CG have taken what is local "
            "and left what is smooth; over-relaxation, which overshoots, leaves both for a while. Coarse grids see a wave as "
            "long as the box at once.</p>",
            partial(_errors, seen=seen),
            3.4,
            "Errors after a few iterations",
        ),
        Section(
            "Twice the cells",
            f"<p>Iterations to 10⁻⁵ in the plain box of {', '.join(str(n) for n in seen.sizes)} cells along a side, and how "
            "they grow. In space a doubling is also eight times the work of an iteration.</p>",
            partial(_growth, seen=seen),
            3.8,
            "Iterations over cells",
        ),
        Section(
            "Rates: theory and measurement",
            "<p>The factor by which an iteration shrinks the residual in the end, in the plain box. λ is the least eigenvalue "
            "of D⁻¹A, that of the longest wave cos πx; κ is the condition number of A.</p>",
            table=_rates(seen),
        ),
    ]
    return write(
        folder,
        "pressure",
        "The ladder of pressure solvers",
        f"Nine ways to make a flow free of divergence, from Jacobi's to multigrid: {cells}³ cells, {precision} precision.",
        lessons(seen),
        sections,
        [
            "Equations: docs/theory/pressure.md. Why this is a projection: docs/theory/projections.md.",
            "Times are of one solution on this machine, with whatever else it did. Set-up, needed again only when solids "
            "move, stands apart in the table; it includes a first iteration.",
        ],
        _rows(seen),
    )


def lessons(seen: Study) -> list[str]:
    """Findings of the measurements, as sentences."""
    box, lines = NAMES[0], []
    runs = {word: seen.of(box, word) for word in BY_WORD}
    slow, best = runs["jacobi"], runs["multigrid_gradients"]
    level = LEVELS[-1]
    if (a := slow.at(level)) and (b := best.at(level)) and (t := slow.time(level)) and (s := best.time(level)):
        lines.append(
            f"<b>From the first rung to the last.</b> Jacobi needs {_count(a)} iterations and {seconds(t)} to 10⁻⁵, "
            f"conjugate gradients with multigrid {b} and {seconds(s)}: {number(t / s, 2)} times less time."
        )
    grown = {w: g for w in BY_WORD if np.isfinite(g := seen.growth(w)) and BY_WORD[w].growth is not None}
    if grown:
        said = ", ".join(f"{BY_WORD[w].title} {2.0**g:.2g}" for w, g in grown.items())
        lines.append(
            f"<b>Twice the cells along a side</b> multiply the iterations by: {said}. What is best at one size need not be so "
            "at the next."
        )
    theory = Theory(seen.cells)
    agree = []
    for word in KNOWN:
        measured, known = runs[word].factor, theory.factor(word)
        if np.isfinite(measured):
            agree.append(f"{BY_WORD[word].title} {measured:.5f} ({known:.5f})")
    if agree:
        lines.append(
            "<b>Theory.</b> Factors of an iteration, measured (predicted): "
            + ", ".join(agree)
            + "; that of CG is a bound."
        )
    plain, factors = runs["conjugate_gradients"], runs["modified_incomplete_cholesky"]
    if (a := plain.at(level)) and (b := factors.at(level)) and (t := plain.time(level)) and (s := factors.time(level)):
        verdict = f"{number(t / s, 2)} times less" if s < t else f"{number(s / t, 2)} times more"
        lines.append(
            f"<b>Iterations are not time.</b> MIC(0) takes CG from {a} iterations to {b}, and {verdict} time: its factors are "
            "solved cell by cell on one core."
        )
    direct = runs["cosine"].time(level)
    if direct and (s := best.time(level)):
        refused = [name for name in NAMES[1:] if seen.of(name, "cosine").refused]
        lines.append(
            f"<b>Where nothing stands in the way</b> the cosine transform solves at once, in {seconds(direct)} against "
            f"{seconds(s)} of multigrid; it cannot with {' or '.join(refused)}."
        )
    inside = [seen.of(name, "multigrid_gradients").at(level) for name in NAMES]
    found = seen.of(NAMES[2], "multigrid_gradients").found
    if all(i is not None for i in inside) and found is not None:
        lines.append(
            f"<b>Solids.</b> Multigrid with CG takes {inside[0]} iterations in the box, {inside[1]} around the ball and "
            f"{inside[2]} with {found.pockets} sealed pockets: each pocket has a pressure of its own but for a constant, "
            "and its mean is taken out apart."
        )
    late = [f"{r.rung.title} ({name})" for name in NAMES for r in seen.runs[name] if r.found and r.at(level) is None]
    if late:
        lines.append("<b>Not done in the time allowed:</b> " + ", ".join(late) + ".")
    return lines


def _count(n: int) -> str:
    return f"{n:,}".replace(",", "\u202f")


def _table(seen: Study) -> str:
    rows: list[list[str]] = []
    groups: list[int] = []
    for name in NAMES:
        groups.append(len(rows))
        times = [t for r in seen.runs[name] if (t := r.time(LEVELS[-1])) is not None]
        for one in seen.runs[name]:
            row = [name if one is seen.runs[name][0] else "", one.rung.title]
            if one.found is None:
                rows.append([*row, *["–"] * 6, one.refused.split(": ")[-1]])
                continue
            for level in LEVELS:
                at, time = one.at(level), one.time(level)
                row += ["–" if at is None else _count(at), "–" if time is None else seconds(time)]
            last = one.time(LEVELS[-1])
            row += [seconds(one.found.set_up), "–" if last is None else number(last / min(times), 2)]
            rows.append([*row, "" if last is not None else f"stopped at {number(one.found.residuals[-1], 2)}"])
    head = [
        "system",
        "method",
        "iterations to 10⁻³",
        "time",
        "iterations to 10⁻⁵",
        "time",
        "set-up",
        "× the fastest",
        "",
    ]
    return table(head, rows, (0, 1, 8), groups)


def _rates(seen: Study) -> str:
    theory, rows = Theory(seen.cells), []
    for rung in RUNGS[:-1]:
        measured, known = seen.of(NAMES[0], rung.word).factor, theory.factor(rung.word)
        ratio = np.log(measured) / np.log(known)
        growth = seen.growth(rung.word)
        rows.append(
            [
                rung.title,
                f"{measured:.5f}" if np.isfinite(measured) else "–",
                f"{known:.5f}" if np.isfinite(known) else "–",
                f"{ratio:.3f}" if np.isfinite(ratio) else "–",
                FORMULAS.get(
                    rung.word, "no closed form; does not depend on n" if rung.growth == 0 else "no closed form"
                ),
                f"{growth:.2f}" if np.isfinite(growth) else "–",
                "" if rung.growth is None else f"{rung.growth:g}",
            ]
        )
    head = ["method", "measured", "theory", "ratio of rates", "", "iterations ~ n to the", "theory"]
    return table(head, rows, (0, 4))


def _rows(seen: Study) -> Iterator[dict[str, Any]]:
    solved = [(name, seen.cells, r) for name in NAMES for r in seen.runs[name]]
    solved += [(NAMES[0], n, r) for n, runs in seen.sizes.items() if n != seen.cells for r in runs]
    for name, n, one in solved:
        yield {
            "system": name,
            "cells": n,
            "method": one.rung.word,
            **{f"iterations_to_{level:g}": one.at(level) for level in LEVELS},
            **{f"seconds_to_{level:g}": one.time(level) for level in LEVELS},
            "set_up": one.found.set_up if one.found else None,
            "factor": one.factor,
            "factor_in_theory": Theory(n).factor(one.rung.word) if name == NAMES[0] else None,
        }


def _residuals(figure: FigureBase, seen: Study, over_time: bool) -> None:
    places = figure.subplots(1, len(NAMES), sharey=True)
    for axes, name in zip(places, NAMES, strict=True):
        for one in seen.runs[name]:
            if one.found is None:
                continue
            r = one.found.residuals
            # The start stands at no time and no iteration, which logarithms do not show: at half the first.
            x = one.found.times if over_time else np.arange(len(r), dtype=float)
            x = np.concatenate([[0.5 * x[1]], x[1:]]) if len(x) > 1 else x
            if one.rung.line:
                axes.loglog(x, r, one.rung.line, color=one.rung.ink, label=one.rung.title, linewidth=1.5)
            else:
                below = np.maximum(r[-1:], 1.6e-7)
                axes.loglog(x[-1:], below, "*", color=one.rung.ink, label=one.rung.title, markersize=10)
        for level in LEVELS:
            axes.axhline(level, color=FAINT, linewidth=0.7)
        axes.set_ylim(1e-7, 3.0)
        axes.set_title(name)
        axes.set_xlabel("time [s]" if over_time else "iterations")
    places[0].set_ylabel("max |div u| Δx/max |u|")
    handles, labels = places[0].get_legend_handles_labels()
    places[-1].legend(handles, labels, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _errors(figure: FigureBase, seen: Study) -> None:
    places = figure.subplots(1, len(seen.glances))
    colours = colormaps["RdBu_r"].with_extremes(bad="#c8c8c8")
    for axes, (rung, error) in zip(places, seen.glances, strict=True):
        top = float(np.nanmax(np.abs(error)))
        axes.imshow(error.T, origin="lower", cmap=colours, vmin=-top, vmax=top, interpolation="nearest")
        axes.set_title(f"{rung.title}: {np.sqrt(np.nanmean(error**2)):.1e} m²/s")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.grid(False)


def _growth(figure: FigureBase, seen: Study) -> None:
    axes = figure.add_subplot()
    sizes = sorted(seen.sizes)
    for rung in RUNGS[:-1]:
        its = [next(r for r in seen.sizes[n] if r.rung is rung).at(LEVELS[-1]) for n in sizes]
        shown = [(n, i) for n, i in zip(sizes, its, strict=True) if i]
        said = f"{rung.title}: n to the {seen.growth(rung.word):.2f} ({rung.growth:g})"
        axes.loglog(*zip(*shown, strict=True), rung.line, marker="o", markersize=4, color=rung.ink, label=said)
    axes.set_xticks(sizes, [str(n) for n in sizes])
    axes.minorticks_off()
    axes.set_xlabel("cells along a side")
    axes.set_ylabel("iterations to 10⁻⁵")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), title="measured (theory)")
