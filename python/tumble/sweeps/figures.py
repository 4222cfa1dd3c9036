"""Plots of a sweep: each measure over each parameter, main effects, and maps over two parameters."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tumble import plots
from tumble.style import FAINT, INK, PALETTE
from tumble.sweeps.against import Published
from tumble.sweeps.design import number, short
from tumble.sweeps.measures import Measure
from tumble.sweeps.result import Row, Sweep
from tumble.sweeps.statistics import BINS, Effect, Spread, spread
from tumble.sweeps.task import FINISHED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

CURVES = 12
"""Combinations of other parameters that get a curve each; of more, the mean over them is drawn."""

SPAN = 30.0
"""Ratio of largest to smallest value from which on an axis of positive numbers is logarithmic."""

TALL = 1000.0
"""The same of what is measured."""

MOST = 400
"""Plots, at most: of many measures and parameters, the first."""


@dataclass(frozen=True)
class Plot:
    """A figure that was written."""

    measure: str
    title: str
    path: Path
    width: float
    """[inch]"""


@dataclass(frozen=True)
class Curve:
    """Means over seeds, and their confidence, along a parameter."""

    label: str
    x: list[float]
    spreads: list[Spread]


def slug(text: str) -> str:
    """A name for a file."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-.") or "x"


def draw(found: Sweep, against: Published | None = None) -> list[Plot]:
    """Writes all plots into the folder of the sweep, with values from elsewhere where there are some. Raises ExportError."""
    folder = found.folder / "plots"
    drawn: list[Plot] = []
    names: set[str] = set()

    def keep(figure: "Figure | None", measure: str, title: str, name: str) -> None:
        if figure is None or len(drawn) >= MOST:
            return
        # Two measures may differ in marks alone.
        while name in names:
            name += "-"
        names.add(name)
        drawn.append(Plot(measure, title, plots.save(figure, folder / f"{name}.png"), float(figure.get_figwidth())))

    with plots.settings():
        for measure in found.measures:
            base = slug(measure.name)
            for path in found.design.paths:
                keep(
                    over(found, measure, path, against),
                    measure.name,
                    f"{measure.name} over {path}",
                    f"{base}--{slug(path)}",
                )
            if len(found.design.paths) > 1:
                keep(effects(found, measure), measure.name, f"Main effects on {measure.name}", f"{base}--effects")
                keep(chart(found, measure), measure.name, f"{measure.name} over two parameters", f"{base}--map")
            if not found.design.paths:
                keep(histogram(found, measure), measure.name, f"{measure.name} over seeds", f"{base}--seeds")
    return drawn


# One measure over one parameter


def over(found: Sweep, measure: Measure, path: str, against: Published | None = None) -> "Figure":
    """Curves with bands where there are few combinations of other parameters; else all points, and the mean over them."""
    figure, ax = _figure(3.4)
    values = found.design.values(path)
    axis = Axis(values)
    others = [p for p in found.design.paths if p != path]
    combinations = {tuple(row.parameters[p] for p in others): None for row in found.rows}
    curves: list[Curve] = []
    if len(combinations) <= CURVES and len(values) <= 8 * BINS:
        curves = _curves(found, measure, path, others, axis)
        _draw_curves(ax, curves, axis)
    else:
        _draw_cloud(ax, found, measure, path, axis)
    other = against.beside(path, measure.name) if against else None
    if against and other and axis.numeric:
        ax.plot(*other, "D", markerfacecolor="none", markeredgecolor=INK, markersize=7, label=against.name)
        ax.legend(loc="best")
    axis.apply(ax, path)
    _scale(ax, measure, [s.mean for s in found.spreads_of(measure.name)])
    _mark_failures(ax, found.rows, path, axis)
    by = f", by {', '.join(_short(p) for p in others)}" if len(curves) > 1 else ""
    ax.set_title(measure.name + by, wrap=True)
    _label_curves(ax, curves)
    return figure


def _color(k: int, of: int) -> Any:
    """Of one of several curves: many are in the order of a map."""
    if of <= len(PALETTE):
        return PALETTE[k]
    from matplotlib import colormaps

    return colormaps["viridis"](0.92 * k / (of - 1))


class Axis:
    """Where values of a parameter stand: at their numbers, or side by side."""

    def __init__(self, values: Sequence[str]) -> None:
        numbers = [number(value) for value in values]
        self.numeric = all(map(math.isfinite, numbers))
        self.words = list(values)
        self.place = dict(zip(values, numbers if self.numeric else map(float, range(len(values))), strict=True))
        positive = [x for x in numbers if x > 0]
        self.log = self.numeric and len(positive) == len(numbers) and max(positive) / min(positive) >= SPAN

    def apply(self, ax: "Axes", path: str) -> None:
        ax.set_xlabel(path)
        if self.log:
            ax.set_xscale("log")
        if not self.numeric:
            ax.set_xticks(range(len(self.words)), [_shortened(word) for word in self.words])
        elif len(self.words) <= BINS:
            from matplotlib.ticker import NullLocator

            ax.set_xticks(list(self.place.values()), [short(word) for word in self.words])
            ax.xaxis.set_minor_locator(NullLocator())


def _curves(found: Sweep, measure: Measure, path: str, others: Sequence[str], axis: Axis) -> list[Curve]:
    groups: dict[tuple[str, ...], dict[float, Spread]] = {}
    for point, rows in found.points.items():
        own = rows[0].parameters
        group = groups.setdefault(tuple(own[p] for p in others), {})
        group[axis.place[own[path]]] = found.spreads[point, measure.name]
    curves = []
    for key, group in groups.items():
        x = sorted(group)
        curves.append(Curve(", ".join(_shortened(short(value)) for value in key), x, [group[k] for k in x]))
    return curves


def _draw_curves(ax: "Axes", curves: Sequence[Curve], axis: Axis, bands: bool = True) -> None:
    """`bands` are left out where values of a grid are averaged over: how far they are spread is by choice, not by chance."""
    for k, curve in enumerate(curves):
        color = _color(k, len(curves))
        x, mean = np.array(curve.x), np.array([s.mean for s in curve.spreads])
        low, high = (np.array([getattr(s, name) for s in curve.spreads]) for name in ("low", "high"))
        if axis.numeric:
            ax.plot(x, mean, color=color, marker="o", markersize=4)
            if bands:
                ax.fill_between(x, low, high, color=color, alpha=0.18, linewidth=0)
        else:
            side = (k - (len(curves) - 1) / 2) * 0.8 / max(len(curves), 2)
            bars = np.array([np.nan_to_num(mean - low), np.nan_to_num(high - mean)]) * bands
            ax.errorbar(x + side, mean, bars, color=color, marker="o", markersize=5, linestyle="none", capsize=3)


def _label_curves(ax: "Axes", curves: Sequence[Curve]) -> None:
    """Names beside the ends of curves, once the axes stand."""
    if len(curves) < 2:
        return
    places = []
    for curve in curves:
        ends = [s.mean for s in curve.spreads if math.isfinite(s.mean)]
        shown = ax.transData.transform((1.0 if ax.get_xscale() == "log" else 0.0, ends[-1])) if ends else (0.0, 0.0)
        places.append(float(ax.transAxes.inverted().transform(shown)[1]))
    for k, place in enumerate(plots.apart(places, plots.LABEL / 3.0)):
        color = _color(k, len(curves))
        ax.annotate(curves[k].label, (1.015, place), xycoords="axes fraction", va="center", color=color, fontsize=9)


def _draw_cloud(ax: "Axes", found: Sweep, measure: Measure, path: str, axis: Axis) -> None:
    """Every point of the design, and the mean over all others with its confidence."""
    x = [axis.place[rows[0].parameters[path]] for rows in found.points.values()]
    y = [found.spreads[point, measure.name].mean for point in found.points]
    ax.plot(x, y, ".", color=FAINT, markersize=4, alpha=0.7)
    about = found.effect(measure.name, path)
    levels = [axis.place.get(level, number(level)) for level in about.levels]
    _draw_curves(ax, [Curve("", levels, about.spreads)], axis, found.design.kind != "grid")


def _mark_failures(ax: "Axes", rows: Sequence[Row], path: str, axis: Axis) -> None:
    """Crosses at the bottom where runs did not reach their end, with how many of how many."""
    counts: dict[float, list[int]] = {}
    for row in rows:
        count = counts.setdefault(axis.place[row.parameters[path]], [0, 0])
        count[0] += row.status != FINISHED
        count[1] += 1
    bad = {x: count for x, count in counts.items() if count[0]}
    if not bad:
        return
    _make_room(ax)
    trans = ax.get_xaxis_transform()
    ax.plot(list(bad), [0.03] * len(bad), "x", color=PALETTE[1], markersize=6, transform=trans, clip_on=False)
    if len(counts) <= 2 * BINS:
        for x, (n, of) in bad.items():
            ax.annotate(
                f"{n} of {of}",
                (x, 0.07),
                xycoords=trans,
                ha="center",
                va="bottom",
                color=PALETTE[1],
                fontsize=8,
                rotation=90 if len(counts) > BINS else 0,
            )
    ax.annotate(
        "x  did not reach the end",
        (1.0, 1.01),
        xycoords="axes fraction",
        ha="right",
        va="bottom",
        color=PALETTE[1],
        fontsize=8,
    )


def _make_room(ax: "Axes") -> None:
    """Of a sixth of the height below what is drawn."""
    low, high = ax.get_ylim()
    if ax.get_yscale() == "log":
        ax.set_ylim(low * (low / high) ** 0.2, high)
    else:
        ax.set_ylim(low - 0.2 * (high - low), high)


# All parameters at once


def effects(found: Sweep, measure: Measure) -> "Figure":
    """A measure over each parameter alone, side by side, with one axis: what matters is steep."""
    from matplotlib.figure import Figure

    paths = found.design.paths
    across = min(len(paths), 4)
    down = math.ceil(len(paths) / across)
    figure = Figure(figsize=(max(2.4 * across, 4.8), 0.7 + 2.2 * down), layout="constrained")
    grid = figure.subplots(down, across, sharey=True, squeeze=False)
    for k in range(down * across):
        ax = grid[k // across, k % across]
        if k >= len(paths):
            ax.set_visible(False)
            continue
        _draw_effect(ax, found.effect(measure.name, paths[k]), paths[k], found.design.kind != "grid")
        if k % across == 0:
            ax.set_ylabel(_quantity(measure))
    _scale(grid[0, 0], measure, [s.mean for s in found.spreads_of(measure.name)], label=False)
    figure.suptitle(f"Main effects on {measure.name}", x=0.01, ha="left", fontsize=11, fontweight="bold")
    return figure


def _draw_effect(ax: "Axes", about: Effect, path: str, bands: bool) -> None:
    axis = Axis(about.levels)
    _draw_curves(ax, [Curve("", [axis.place[level] for level in about.levels], about.spreads)], axis, bands)
    axis.apply(ax, path)
    ax.set_xlabel(_wrapped(path), fontsize=8)
    if axis.numeric and len(about.levels) > 4:
        from matplotlib.ticker import NullLocator

        levels = sorted(axis.place, key=axis.place.__getitem__)
        few = [levels[0], levels[len(levels) // 2], levels[-1]]
        ax.set_xticks([axis.place[level] for level in few], [short(level) for level in few])
        ax.xaxis.set_minor_locator(NullLocator())
    share = "" if math.isnan(about.share) else f"{about.share:.0%} of the variance"
    ax.set_title(share, fontsize=8.5, fontweight="normal")


def chart(found: Sweep, measure: Measure) -> "Figure | None":
    """A map over the two parameters with most values, the mean over all others; None where they have fewer than three."""
    from matplotlib.colors import LogNorm

    grids = [a.paths[0] for a in found.design.axes if len(a.paths) == 1 and len(a.rows) >= 3]
    numeric = [p for p in grids if Axis(found.design.values(p)).numeric]
    if found.design.kind != "grid" or len(numeric) < 2:
        return None
    x_path, y_path = sorted(numeric, key=lambda p: -len(found.design.values(p)))[:2]
    xs, ys = (sorted(found.design.values(p), key=number) for p in (x_path, y_path))
    cells: dict[tuple[int, int], list[Row]] = {}
    for row in found.rows:
        cells.setdefault((ys.index(row.parameters[y_path]), xs.index(row.parameters[x_path])), []).append(row)
    means = np.full((len(ys), len(xs)), np.nan)
    for (j, i), rows in cells.items():
        means[j, i] = spread([row.values[measure.name] for row in rows], "").mean
    figure, ax = _figure(3.6)
    shown = means[np.isfinite(means)]
    log = shown.size > 0 and shown.min() > 0 and shown.max() / shown.min() >= SPAN
    how: dict[str, Any] = {"norm": LogNorm()} if log else {}
    mesh = ax.pcolormesh(np.arange(len(xs) + 1) - 0.5, np.arange(len(ys) + 1) - 0.5, np.ma.masked_invalid(means), **how)
    for (j, i), rows in cells.items():
        if any(row.status != FINISHED for row in rows):
            ax.plot(i, j, "x", color=PALETTE[1], markersize=6)
    if shown.size:
        bar = figure.colorbar(mesh, ax=ax)
        bar.set_label(_quantity(measure))
        bar.outline.set_visible(False)
    _tick(ax.set_xticks, xs)
    _tick(ax.set_yticks, ys)
    ax.grid(False)
    ax.set_xlabel(x_path)
    ax.set_ylabel(_wrapped(y_path))
    crossed = any(row.status != FINISHED for row in found.rows)
    ax.set_title(measure.name + (" (x: did not reach the end)" if crossed else ""), wrap=True)
    return figure


def _tick(place: Any, values: Sequence[str]) -> None:
    step = max(1, math.ceil(len(values) / 12))
    place(range(0, len(values), step), [f"{number(value):.4g}" for value in values[::step]])


def histogram(found: Sweep, measure: Measure) -> "Figure":
    """How a measure is spread over seeds alone, with the mean and its confidence."""
    figure, ax = _figure(2.4)
    values = np.array([row.values[measure.name] for row in found.rows])
    values = values[np.isfinite(values)]
    if values.size:
        ax.hist(values, bins=min(30, max(5, round(math.sqrt(values.size)))), color=PALETTE[0], alpha=0.8)
        s = found.spread(0, measure.name)
        ax.axvline(s.mean, color=INK)
        if math.isfinite(s.low):
            ax.axvspan(s.low, s.high, color=INK, alpha=0.15, linewidth=0)
    ax.set_ylabel("runs")
    ax.set_xlabel(_quantity(measure))
    ax.set_title(f"{measure.name}: mean, and its confidence", wrap=True)
    return figure


# Looks


def _figure(rows: float) -> "tuple[Figure, Axes]":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 0.9 + rows), layout="constrained")
    return figure, figure.subplots()


def _scale(ax: "Axes", measure: Measure, means: Sequence[float], label: bool = True) -> None:
    """A logarithmic axis where all is positive and differs by much."""
    values = [x for x in means if math.isfinite(x)]
    most = SPAN if ax.get_xscale() == "log" else TALL
    if values and min(values) > 0 and max(values) / min(values) >= most:
        ax.set_yscale("log")
    if label:
        ax.set_ylabel(_quantity(measure))


def _quantity(measure: Measure) -> str:
    """Label of an axis."""
    name = measure.column if measure.source == "ledger" else measure.name.partition("@")[0].replace("probe ", "")
    return f"{name.replace('_', ' ')}{f' [{measure.unit}]' if measure.unit else ''}"


def _short(path: str) -> str:
    return path.rsplit(".", 1)[-1] if not path.rsplit(".", 1)[-1].isdigit() else ".".join(path.split(".")[-2:])


def _wrapped(path: str) -> str:
    """A long key on two lines."""
    words = path.split(".")
    if len(path) < 24:
        return path
    half = next(k for k in range(1, len(words) + 1) if len(".".join(words[:k])) >= len(path) / 2)
    return ".".join(words[:half]) + (".\n" + ".".join(words[half:]) if half < len(words) else "")


def _shortened(text: str) -> str:
    return text if len(text) <= 22 else text[:21] + "…"


def told(values: Mapping[str, str]) -> str:
    """Parameters in words: `substeps 10, gravity.2 -9.8`."""
    return ", ".join(f"{_short(path)} {_shortened(short(value))}" for path, value in values.items())
