"""Curves of a run's books: energy, and any columns of the ledger."""

import contextlib
import os
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from tumble import measures
from tumble._engine import ExportError
from tumble.bundled import unknown
from tumble.expect import energy_changes
from tumble.folder import writing
from tumble.pictures.things import Recording
from tumble.style import FAINT, INK, PALETTE, RC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]


class Refined(Protocol):
    """What is drawn of a scene at several resolutions."""

    @property
    def runs(self) -> Sequence[Recording | None]:
        """The run of each level; None where it broke."""

    @property
    def measures(self) -> Sequence[Any]:
        """Names, and values at each level."""

    @property
    def levels(self) -> int:
        """How many there are."""


ROW = 1.4
"""Height of a pair of axes [inch], times its share."""

LONGEST = 150
"""Characters of a scene's title that stand over a figure, at most; and of a word in it, so that lines can be broken."""
WORD = 30

LABEL = 0.15
"""From one label beside a curve to the next [inch]."""

ENERGIES = {"kinetic": PALETTE[0], "elastic": PALETTE[2], "external": PALETTE[3]}


def energy(run: Recording, path: str | os.PathLike[str]) -> Path:
    """Plots kinetic, elastic, external and total energy, and below them how far the total has drifted from the start,
    over the largest energy so far, as `[expect]` measures it. Raises ExportError."""
    t = _column(run, "time")
    parts = {name: _column(run, name) for name in ENERGIES}
    total = np.sum(list(parts.values()), axis=0)
    with settings():
        figure, (upper, lower) = _figure([3.0, 1.0])
        curves = [(name, parts[name], color) for name, color in ENERGIES.items() if np.any(parts[name] != 0)]
        _draw(upper, 3.0, t, [*curves, ("total", total, INK)])
        upper.set_ylabel("energy [J]")
        upper.set_title(figure_title(run, "energy"), wrap=True)
        drift = energy_changes({**parts, "energy": total})
        lower.axhline(0.0, color=FAINT, linewidth=0.8)
        lower.plot(t, drift, color=INK, linewidth=1.3)
        lower.set_ylabel("drift /\nlargest")
        lower.set_xlabel("time [s]")
        return save(figure, path)


def ledger(run: Recording, columns: str | Sequence[str], path: str | os.PathLike[str]) -> Path:
    """Plots columns of the ledger over time; those of one unit share a pair of axes. A vector's name stands for its
    three columns. Raises ExportError."""
    wanted = [columns] if isinstance(columns, str) else list(columns)
    names = [n for name in wanted for n in _expanded(run, name)]
    if not names:
        raise ExportError("no columns to plot")
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(unit(name), []).append(name)
    t = _column(run, "time")
    with settings():
        share = 2.0 if len(groups) == 1 else 1.0
        figure, axes = _figure([share] * len(groups))
        for ax, (symbol, members) in zip(axes, groups.items(), strict=True):
            curves = [(n, _column(run, n), PALETTE[k % len(PALETTE)]) for k, n in enumerate(members)]
            _draw(ax, share, t, curves)
            ax.set_ylabel(_label(members, symbol))
        axes[0].set_title(figure_title(run, ""), wrap=True)
        axes[-1].set_xlabel("time [s]")
        return save(figure, path)


def beside(
    runs: Mapping[str, Recording],
    columns: Sequence[str],
    path: str | os.PathLike[str],
    starts: Mapping[str, float] | None = None,
) -> Path:
    """Plots columns of several runs over time, a pair of axes for each column, a curve for each run with its name beside it.
    A vector's name stands for its three columns; without columns, the energies. The curve of a branch begins where `starts`
    says [s], at a line. Raises ExportError."""
    first = next(iter(runs.values()))
    wanted = [n for name in columns for n in _expanded(first, name)]
    if not wanted:
        wanted = [n for n in ENERGIES if any(np.any(_column(run, n) != 0) for run in runs.values())] + ["energy"]
    begins = starts or {}
    share = 2.0 if len(wanted) == 1 else 1.4
    with settings():
        figure, axes = _figure([share] * len(wanted))
        for ax, name in zip(axes, wanted, strict=True):
            curves, times = [], []
            for k, (label, run) in enumerate(runs.items()):
                t = _column(run, "time")
                shown = t >= begins.get(label, -np.inf)
                times.append(t[shown])
                curves.append((label, _column(run, name)[shown], PALETTE[k % len(PALETTE)]))
            for moment in sorted(set(begins.values())):
                ax.axvline(moment, color=FAINT, linewidth=0.8, linestyle=(0, (3, 3)))
            _draw(ax, share, times, curves)
            for line in ax.lines[len(set(begins.values())) + len(PALETTE) :]:
                line.set_linestyle((0, (4, 1.5)))
            ax.set_ylabel(_label([name], unit(name)))
        axes[0].set_title(figure_title(first, ""), wrap=True)
        axes[-1].set_xlabel("time [s]")
        return save(figure, path)


def convergence(study: Refined, path: str | os.PathLike[str]) -> Path:
    """Plots the first measure of the ledger over time at every level, and below it how much each measure changes from one
    level to the next, over its size, beside slopes of order 1, 2 and 4. Raises ExportError."""
    from matplotlib.ticker import NullLocator

    columns = [m.name.partition("@")[0] for m in study.measures if "." not in m.name]
    runs = {f"level {k}": run for k, run in enumerate(study.runs) if run is not None}
    with settings():
        figure, axes = _figure([1.8, 2.6] if columns else [2.6], sharex=False)
        if columns:
            name = columns[0]
            times = [_column(run, "time") for run in runs.values()]
            curves = [(k, _column(run, name), PALETTE[i % len(PALETTE)]) for i, (k, run) in enumerate(runs.items())]
            _draw(axes[0], 1.8, times, curves)
            axes[0].set_ylabel(_label([name], unit(name)))
            axes[0].set_xlabel("time [s]")
        axes[0].set_title(figure_title(next(iter(runs.values())), "refined"), wrap=True)
        ax = axes[-1]
        ends: list[tuple[str, float, str]] = []
        finest, top = study.levels - 1, 0.0
        for i, m in enumerate(study.measures):
            values = np.array(m.values)
            size = np.max(np.abs(values[np.isfinite(values)]), initial=0.0)
            changes = np.abs(np.diff(values)) / size if size else np.zeros(finest)
            shown = np.isfinite(changes) & (changes > 0)
            if shown.any():
                color = PALETTE[i % len(PALETTE)]
                ax.plot(np.arange(1, finest + 1)[shown], changes[shown], color=color, marker="o", markersize=4)
                ends.append((m.name, float(changes[shown][-1]), color))
                top = max(top, float(changes[shown][0]))
        for order in (1, 2, 4) if top else ():
            ax.plot(
                [1, finest],
                [top, top * 2.0 ** (-order * (finest - 1))],
                color=FAINT,
                linewidth=0.8,
                linestyle=(0, (3, 3)),
            )
            ends.append((f"order {order}", top * 2.0 ** (-order * (finest - 1)), FAINT))
        ax.set_yscale("log")
        ax.set_xticks(range(1, finest + 1), [f"{k - 1} to {k}" for k in range(1, finest + 1)])
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_xlabel("level")
        ax.set_ylabel("relative change")
        low, high = np.log(ax.get_ylim())
        places = apart([(np.log(value) - low) / (high - low) for _, value, _ in ends], LABEL / (ROW * 2.6))
        for (label, _, color), place in zip(ends, places, strict=True):
            ax.annotate(label, (1.015, place), xycoords="axes fraction", va="center", color=color, fontsize=9)
        return save(figure, path)


def unit(column: str) -> str:
    """The unit of a column of the ledger; nothing for counts."""
    if column == "seconds":
        return "s"
    measure = measures.OF_COLUMN.get(column)
    return "" if measure is None or measure.shape in ("whole", "trials") else measure.unit


def _column(run: Recording, name: str) -> Floats:
    books = run.ledger
    if name not in books and name == "energy":
        return np.asarray(np.sum([_column(run, part) for part in ENERGIES], axis=0))
    if name not in books:
        raise ExportError(unknown("column", name, books))
    return np.asarray(books[name], dtype=float)


def _expanded(run: Recording, name: str) -> list[str]:
    parts = [f"{name}_{axis}" for axis in "xyz"]
    return parts if name not in run.ledger and all(p in run.ledger for p in parts) else [name]


def _label(names: Sequence[str], symbol: str) -> str:
    """Label of an axis: a column, or the vector whose parts they are; of several, only the unit."""
    stems = {name[:-2] if name.endswith(("_x", "_y", "_z")) else name for name in names}
    words = stems.pop().replace("_", " ") if len(stems) == 1 else "" if symbol else "count"
    return f"{words} [{symbol}]".strip() if symbol else words


def figure_title(run: Recording, subject: str) -> str:
    """The title of the scene, shortened if it is very long, and the subject; Matplotlib wraps it to the figure."""
    words = str(run.scene.get("title") or "").split()
    title = " ".join(part for word in words for part in textwrap.wrap(word, WORD))
    if len(title) > LONGEST:
        title = f"{title[:LONGEST].rsplit(' ', 1)[0]} …"
    return f"{title}: {subject}" if title and subject else title or subject


@contextlib.contextmanager
def settings() -> Iterator[None]:
    """Matplotlib as `style.RC` has it."""
    import matplotlib

    settings: Any = RC
    with matplotlib.rc_context(settings):
        yield


def _figure(heights: Sequence[float], sharex: bool = True) -> tuple["Figure", list["Axes"]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 0.9 + ROW * sum(heights)), layout="constrained")
    grid = figure.subplots(len(heights), 1, sharex=sharex, squeeze=False, height_ratios=list(heights))
    axes: list[Axes] = list(grid[:, 0])
    figure.align_ylabels(axes)
    return figure, axes


def _draw(ax: "Axes", share: float, t: Floats | Sequence[Floats], curves: Sequence[tuple[str, Floats, str]]) -> None:
    """Curves with their names beside their ends, moved apart where they would meet; `share` is the height in rows. `t` is one
    for all, or a list with one for each."""
    times = t if isinstance(t, list) else [t] * len(curves)
    for when, (_, values, color) in zip(times, curves, strict=True):
        ax.plot(when, values, color=color)
    if not any(len(when) for when in times):
        return
    ends = [(float(v[np.isfinite(v)][-1]) if np.isfinite(v).any() else 0.0) for _, v, _ in curves]
    ax.margins(x=0.01)
    low, high = ax.get_ylim()
    places = apart([(e - low) / (high - low) for e in ends], LABEL / (ROW * share))
    for (name, _, color), place in zip(curves, places, strict=True):
        label = name.replace("_", " ")
        ax.annotate(label, (1.015, place), xycoords="axes fraction", va="center", color=color, fontsize=9)


def apart(wanted: Sequence[float], gap: float) -> list[float]:
    """Places near the wanted ones, at least `gap` from each other."""
    order = sorted(range(len(wanted)), key=lambda k: wanted[k])
    places = list(wanted)
    for _ in range(50):
        moved = False
        for a, b in pairwise(order):
            short = gap - (places[b] - places[a])
            if short > 1e-9:
                places[a] -= short / 2
                places[b] += short / 2
                moved = True
        if not moved:
            break
    return places


def save(figure: "Figure", path: str | os.PathLike[str], **words: Any) -> Path:
    """Writes a figure under a temporary name, then renames it. The ending of the name says the format; `words` are those
    of `savefig`."""
    goal = Path(path)
    unfinished = goal.with_name(f".{goal.stem}.part{goal.suffix or '.png'}")
    try:
        with writing(goal):
            goal.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(unfinished, **words)
            unfinished.replace(goal)
    except ValueError as error:
        raise ExportError(f"{goal}: cannot be written: {error}") from error
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)
    return goal
