"""The figure of the integrators page, row by row."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.ticker import LogLocator, NullLocator

from tumble.lab import findings
from tumble.lab.cells import BLEW_UP, SURVIVED, Cell
from tumble.lab.findings import TARGET, number, per_second, seconds
from tumble.lab.measure import Results
from tumble.lab.schemes import FAMILIES, Scheme
from tumble.style import FAINT, GRID, INK

WIDTH = 13.0
"""Of every row [inch]."""

HEIGHTS = {"energy": 3.1, "accuracy": 5.3, "limits": 5.0}


def _spread(wanted: Sequence[float], gap: float, low: float = 0.0, high: float = 1.0) -> list[float]:
    """Places as near as possible to those wanted, at least `gap` apart, between `low` and `high`."""
    rank = np.argsort(wanted)
    gap = min(gap, (high - low) / max(1, len(wanted) - 1))
    places = np.array(wanted, dtype=float)[rank]
    for _ in range(200):
        moved = False
        for i in range(len(places) - 1):
            lack = gap - (places[i + 1] - places[i])
            if lack > 1e-6:
                places[i] -= lack / 2
                places[i + 1] += lack / 2
                moved = True
        if len(places):
            places += max(0.0, low - places[0])
            places -= max(0.0, places[-1] - high)
        if not moved:
            break
    result = np.empty(len(places))
    result[rank] = places
    return [float(p) for p in result]


def _plain_logs(axes: Axes, which: str = "both") -> None:
    for axis in [axes.xaxis] * (which != "y") + [axes.yaxis] * (which != "x"):
        axis.set_major_locator(LogLocator(numticks=9))
        axis.set_minor_locator(NullLocator())


def _label(axes: Axes, scheme: Scheme, text: str, end: tuple[float, float], place: float, x: float, align: str) -> None:
    """A name at height `place` and at x of the axes, both 0 to 1, with a thread to the curve's end."""
    axes.annotate(
        text,
        end,
        (x, place),
        "data",
        "axes fraction",
        color=scheme.ink,
        fontsize=8.5,
        va="center",
        ha=align,
        bbox={"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.6},
        arrowprops={"arrowstyle": "-", "color": scheme.color, "lw": 0.6, "alpha": 0.7, "shrinkA": 1, "shrinkB": 3},
    )


def draw_energy(figure: FigureBase, results: Results) -> None:
    """Energy over time, a panel per family; for massless particles, paths."""
    families = [f for f in FAMILIES if any(s.family is f and s.word in results.traces for s in results.schemes)]
    if not families:
        figure.text(0.05, 0.5, "No energies: nothing moves, or nothing fitted into the time allowed.", color=FAINT)
        return
    shared = not results.subject.massless
    panels = figure.subplots(1, len(families), sharex=shared, sharey=shared, squeeze=False)[0]
    for axes, family in zip(panels, families, strict=True):
        axes.set_title(family.title, color=family.ink, fontsize=10.5)
        schemes = [s for s in results.schemes if s.family is family and s.word in results.traces]
        (_path if results.subject.massless else _energies)(axes, results, schemes)
    if results.subject.massless:
        panels[0].set_ylabel("position [m]")
    else:
        panels[0].set_ylabel("energy, 1 = right")


def _energies(axes: Axes, results: Results, schemes: list[Scheme]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(1e-2, 1e3)
    axes.set_yticks([0.01, 0.1, 1, 10, 100, 1000], ["0.01", "0.1", "1", "10", "100", "1000"])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.axhline(1.0, color=INK, lw=0.8, alpha=0.5, zorder=1)
    sinks = False
    longest = max(t[-1] for t, _ in results.traces.values())
    for scheme in schemes:
        times, values = results.traces[scheme.word]
        cell = results.energy_cells[scheme.word]
        if cell.outcome == BLEW_UP:
            end = f"blew up at {seconds(cell.reached)}"
        elif cell.outcome != SURVIVED:
            end = "not finished"
        else:
            end = f"ends at {_energy_text(values[-1])}"
        sinks |= bool(values[-1] < 0.3)
        axes.plot(
            times,
            np.clip(values, 1e-9, None),
            ls=scheme.line,
            color=scheme.color,
            lw=1.6,
            label=f"{scheme.word}\n{end}",
        )
    axes.set_xlim(0, longest)
    axes.set_xlabel("time [s]")
    rising = any(results.traces[s.word][1][-1] > 5 for s in schemes)
    axes.legend(
        loc="lower right" if rising and not sinks else "upper left", fontsize=7.8, handlelength=2.2, borderaxespad=0.2
    )


def _energy_text(value: float) -> str:
    off = value - 1
    if abs(off) >= 0.1:
        return number(value, 2)
    return f"1 {'+' if off >= 0 else '−'} {number(abs(off), 1)}" if abs(off) > 1e-6 else "1"


def _path(axes: Axes, results: Results, schemes: list[Scheme]) -> None:
    truth = results.true_path
    everything = truth if truth is not None else np.concatenate([p for _, p in results.traces.values()])
    middle = everything.mean(axis=0)
    spans = np.ptp(everything, axis=0)
    plane = np.argsort(-spans)[:2]
    plane.sort()
    reach = 0.95 * max(spans[plane].max(), 1e-6)
    if truth is not None:
        axes.plot(*truth[:, plane].T, color=INK, lw=0.9, alpha=0.55, label="exact")
    for scheme in schemes:
        path = results.traces[scheme.word][1]
        outside = np.abs(path[:, plane] - middle[plane]).max(axis=1) > reach
        path = path[: int(np.argmax(outside)) + 1 if outside.any() else len(path)]
        axes.plot(
            *path[:, plane].T,
            ls=scheme.line,
            color=scheme.color,
            lw=1.3,
            marker=scheme.marker,
            ms=2.5,
            label=scheme.word,
        )
    axes.set_aspect("equal", adjustable="datalim")
    corners = middle[plane] + np.array([[-reach, -reach], [reach, reach]])
    axes.plot(*corners.T, alpha=0.0)
    axes.set_xlabel(f"{'xyz'[plane[0]]} [m]")
    axes.legend(loc="upper left", fontsize=7.8, handlelength=2.2, borderaxespad=0.1)


def comparable(results: Results) -> list[Cell]:
    """Runs whose errors can be drawn."""
    return [c for c in results.accuracy if c.outcome == SURVIVED and 1e-15 < c.error < 8]


def draw_accuracy(figure: FigureBase, results: Results) -> None:
    """Error over the step, and over what it costs."""
    drawn = comparable(results)
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [1.25, 1]})
    lowest = max(min(c.error for c in drawn) / 4, 1e-15)
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(lowest, 150)
        axes.axhline(TARGET, color=INK, lw=0.8, ls=(0, (1, 2)))
        if results.reference and findings.floor(results) > lowest:
            axes.axhspan(lowest, findings.floor(results), color=GRID, alpha=0.7, lw=0)
    shortest, longest = min(c.step for c in drawn), max(c.step for c in results.accuracy)
    left.set_xlim(shortest / (longest / shortest) ** 0.42, longest * 1.4)
    ends_left, ends_right = [], []
    for scheme in results.schemes:
        cells = [c for c in findings.cells(results, scheme) if 0 < c.error < 8]
        for axes, x in ((left, [c.step for c in cells]), (right, [c.per_second(c.evaluations) for c in cells])):
            axes.plot(
                x,
                [c.error for c in cells],
                ls=scheme.line,
                color=scheme.color,
                marker=scheme.marker,
                ms=3.6,
                lw=1.3,
                mew=0,
            )
        broken = findings.cells(results, scheme, BLEW_UP)
        height = 12 * 1.6 ** FAMILIES.index(scheme.family)
        left.plot(
            [c.step for c in broken], [height] * len(broken), ls="", marker="x", color=scheme.color, ms=5, mew=1.4
        )
        if cells:
            ends_left.append((scheme, cells[-1].step, cells[-1].error))
            ends_right.append((scheme, cells[-1].per_second(cells[-1].evaluations), cells[-1].error))
    _names(left, results, ends_left)
    _fan(left, (lowest, 150.0), [(c.step, c.error) for c in drawn])
    left.set_xlabel("sub-step h [s]")
    left.set_ylabel("error / size of the motion")
    left.set_title("Error over the step (with the order seen)", y=1.1)
    right.set_xlabel("force evaluations per simulated second")
    right.set_title("Error over the cost", y=1.1)
    costs = [c.per_second(c.evaluations) for c in drawn]
    right.set_xlim(min(costs) / 1.5, max(costs) * (max(costs) / min(costs)) ** 0.3)
    heights = _spread([_fraction(right, e[2]) for e in ends_right], 0.042, 0.02, 0.97)
    for (scheme, cost, error), place in zip(ends_right, heights, strict=True):
        _label(right, scheme, scheme.word, (cost, error), place, 0.995, "right")
    if lowest < TARGET:
        patch = {"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.6}
        left.text(longest * 1.3, TARGET, "1 %", fontsize=8.5, ha="right", va="center", color=INK, bbox=patch)
    crosses = [c.step for c in results.accuracy if c.outcome == BLEW_UP]
    if crosses:
        left.text(min(crosses) / 1.15, 30, "blew up", fontsize=8.5, ha="right", va="center", color=INK)
    for axes in (left, right):
        _plain_logs(axes)
    if results.subject.rate > 0:
        rate = results.subject.rate
        top = left.secondary_xaxis("top", functions=(lambda h: h * rate, lambda z: z / rate))
        top.set_xlabel("h × highest rate", color=FAINT, fontsize=8.5)
        top.spines["top"].set_visible(False)
        top.tick_params(labelsize=8)


def _fraction(axes: Axes, y: float) -> float:
    low, high = np.log10(axes.get_ylim())
    return float((np.log10(y) - low) / (high - low))


def _names(axes: Axes, results: Results, ends: list[tuple[Scheme, float, float]]) -> None:
    heights = _spread([_fraction(axes, e[2]) for e in ends], 0.042, 0.02, 0.97)
    for (scheme, x, y), place in zip(ends, heights, strict=True):
        seen = findings.order(results, scheme)
        text = f"{scheme.word}  {seen:.2f}" if np.isfinite(seen) else scheme.word
        _label(axes, scheme, text, (x, y), place, 0.012, "left")


def _fan(axes: Axes, span: tuple[float, float], drawn: list[tuple[float, float]]) -> None:
    """Legend of slopes, in the lower right corner if it is empty."""
    decades = np.log10(span[1] / span[0])
    (x0, x1), bottom = np.log10(axes.get_xlim()), np.log10(span[0])
    foot = np.array([x1 - 0.3 * (x1 - x0), bottom + 0.05 * decades])
    points = np.log10(np.array(drawn)) - foot
    if ((points[:, 0] > 0) & (points[:, 1] < 0.34 * decades)).any():
        return
    for p in (1, 2, 4, 5):
        run = min(0.14 * (x1 - x0), 0.3 * decades / p)
        end = foot + np.array([run, p * run])
        axes.plot(*(10.0 ** np.array([foot, end])).T, color=FAINT, lw=1)
        text = f"order {p}" if p == 1 else str(p)
        axes.annotate(text, 10.0**end, (3, 0), textcoords="offset points", fontsize=8, color=FAINT, va="center")


def draw_limits(figure: FigureBase, results: Results) -> None:
    """The largest step that survives, measured and predicted; what that costs, and what 1 % costs."""
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [1.25, 1]})
    rows = {s.word: -float(k) - 0.6 * FAMILIES.index(s.family) for k, s in enumerate(results.schemes)}
    for axes in (left, right):
        axes.set_xscale("log")
        axes.grid(axis="y", visible=False)
        for place in rows.values():
            axes.axhline(place, color=GRID, lw=0.8, zorder=0)
    left.set_yticks(list(rows.values()), list(rows))
    left.set_ylim(min(rows.values()) - 0.7, 1.3)
    for tick, scheme in zip(left.get_yticklabels(), results.schemes, strict=True):
        tick.set_color(scheme.ink)
        tick.set_fontsize(9.5)
    left.tick_params(axis="y", length=0)
    right.tick_params(axis="y", length=0)
    _steps(left, results, rows)
    _costs(right, results, rows)
    for axes in (left, right):
        _plain_logs(axes, "x")


def _steps(axes: Axes, results: Results, rows: dict[str, float]) -> None:
    values = [
        v for f in results.found.values() for v in (f.predicted, f.disturbed, f.measured) if np.isfinite(v) and v > 0
    ]
    ranges = {
        s: [c.step_range for c in findings.cells(results, s) if c.step_range] for s in results.schemes if s.adaptive
    }
    values += [v for spans in ranges.values() for span in spans for v in span]
    if values:
        axes.set_xlim(min(values) / 2.5, max(values) * 4)
    low, high = axes.get_xlim()
    for scheme in results.schemes:
        y, found = rows[scheme.word], results.found.get(scheme.word)
        if scheme.adaptive and ranges[scheme]:
            span = (min(a for a, _ in ranges[scheme]), max(b for _, b in ranges[scheme]))
            axes.plot(span, (y, y), color=scheme.color, lw=5, alpha=0.45, solid_capstyle="butt")
            axes.text(span[0], y + 0.26, "steps chosen", fontsize=8, color=scheme.ink, va="bottom")
        elif found is None:
            free = not results.subject.limited
            remark = "no spring, no limit: only accuracy counts" if free else "the time allowed was over"
            axes.text(
                low * 1.2,
                y + 0.14,
                remark,
                fontsize=8,
                color=FAINT,
                va="bottom",
            )
        elif found.measured == np.inf:
            axes.annotate("", (high, y), (low, y), arrowprops={"arrowstyle": "-|>", "color": scheme.color, "lw": 1.8})
            text = f"every step tried, up to {seconds(found.largest_tried)}"
            axes.text(low * 1.2, y + 0.14, text, fontsize=8, color=scheme.ink, va="bottom")
        else:
            if np.isfinite(found.predicted) and found.predicted > 0:
                axes.plot(found.predicted, y, "D", ms=8, mfc="none", mec=INK, mew=1.1, zorder=3)
            if np.isfinite(found.disturbed) and found.disturbed > 0:
                axes.plot(found.disturbed, y, "|", ms=13, mew=1.8, color=scheme.color, zorder=4)
            if np.isfinite(found.measured) and found.measured > 0:
                axes.plot(found.measured, y, "o", ms=6.5, color=scheme.color, zorder=4)
                right = max(v for v in (found.predicted, found.measured, found.disturbed) if np.isfinite(v))
                axes.annotate(
                    seconds(found.measured),
                    (right, y),
                    (9, 0),
                    textcoords="offset points",
                    fontsize=8,
                    color=scheme.ink,
                    va="center",
                )
            else:
                axes.text(low * 1.2, y + 0.14, found.note or "no step survives", fontsize=8, color=FAINT, va="bottom")
    axes.set_xlabel("sub-step h [s]")
    axes.set_title("Largest step that survives 100 periods")
    if any(np.isfinite(f.predicted) and f.predicted > 0 for f in results.found.values()):
        axes.plot([], [], "D", ms=8, mfc="none", mec=INK, mew=1.1, label="predicted")
        if any(np.isfinite(f.disturbed) for f in results.found.values()):
            axes.plot([], [], "|", ms=13, mew=1.8, color=FAINT, label="small disturbance of the stiffest mode")
            axes.plot([], [], "o", ms=6.5, color=FAINT, label="the whole scene")
        else:
            axes.plot([], [], "o", ms=6.5, color=FAINT, label="measured")
        axes.legend(loc="upper left", ncols=3, columnspacing=1.2, fontsize=8.5, handletextpad=0.2, borderaxespad=0.0)


def _costs(axes: Axes, results: Results, rows: dict[str, float]) -> None:
    for scheme in results.schemes:
        y = rows[scheme.word]
        survive, target = findings.to_survive(results, scheme), findings.to_target(results, scheme)
        if survive and target:
            axes.plot((survive.evaluations, target.evaluations), (y, y), color=scheme.color, lw=1.4, alpha=0.6)
        if survive:
            axes.plot(survive.evaluations, y, "o", ms=6.5, mfc="white", mec=scheme.color, mew=1.5, zorder=3)
        if target:
            axes.plot(target.evaluations, y, "o", ms=6.5, color=scheme.color, zorder=4)
            text = f"{'≈ ' if target.estimated else ''}{per_second(target.evaluations)}"
            axes.annotate(
                text,
                (target.evaluations, y),
                (9, 0),
                textcoords="offset points",
                fontsize=8,
                color=scheme.ink,
                va="center",
            )
    axes.set_xlabel("force evaluations per simulated second")
    axes.set_title("What that costs, and what 1 % costs")
    low, high = axes.get_xlim()
    axes.set_xlim(low, high * (high / low) ** 0.12)
    axes.plot([], [], "o", ms=6.5, mfc="white", mec=FAINT, mew=1.5, label="to survive")
    axes.plot([], [], "o", ms=6.5, color=FAINT, label="to be within 1 %")
    axes.legend(loc="upper left", ncols=2, fontsize=8.5, handletextpad=0.2, borderaxespad=0.0)


ROWS = {"energy": draw_energy, "accuracy": draw_accuracy, "limits": draw_limits}
