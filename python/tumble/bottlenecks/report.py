"""What a study has found as files: a table, a picture of the plan, and a page."""

import csv
import io
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tumble.bottlenecks.passages import CELL, ends, gates
from tumble.bottlenecks.runs import Findings, Rank
from tumble.folder import write_whole
from tumble.lab.page import Section, document, table
from tumble.plots import settings
from tumble.style import FAINT, INK, PALETTE
from tumble.sweeps.statistics import Spread

DOTS = 130.0
"""Per inch of a picture."""

WIDE = 9.0
"""Width of a picture [inch]."""

FIXED = "no wall ends at both of its jambs"
"""Why a gate is not made wider."""

_LISTED = ("flow", "peak_flow", "peak_density", "waiting", "lost")


def write(found: Findings, folder: Path) -> list[Path]:
    """Writes bottlenecks.csv, plan.png, waiting.png, exits.png and bottlenecks.html, and hits.csv of a scene with bodies.

    Raises ExportError."""
    folder.mkdir(parents=True, exist_ok=True)
    seeds = len(found.outcomes)
    mean = {what: sum(getattr(run, what) for run in found.outcomes) / seeds for what in ("density", "waiting")}
    pictures = {
        "plan.png": _map(found, mean["density"], "People [s/m²], ranked gates"),
        "waiting.png": _map(found, mean["waiting"], "Waiting [s/m²]"),
        "exits.png": _curves(found),
    }
    for name, picture in pictures.items():
        write_whole(folder / name, picture)
    write_whole(folder / "bottlenecks.csv", _csv(found).encode())
    tables = ["bottlenecks.csv"]
    if found.without:
        write_whole(folder / "hits.csv", _hits(found).encode())
        tables.append("hits.csv")
    write_whole(folder / "bottlenecks.html", _page(found).encode())
    return [folder / name for name in (*tables, *pictures, "bottlenecks.html")]


def _hits(found: Findings) -> str:
    """Who was hit when and where, seed by seed."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["seed", "time [s]", "crowd", "person", "injured", "x [m]", "y [m]"])
    for run in found.outcomes:
        for time, crowd, person, state, x, y in run.hits.tolist():
            writer.writerow([run.seed, time, int(crowd), int(person), int(state > 1), round(x, 3), round(y, 3)])
    return text.getvalue()


def _csv(found: Findings) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = {"flow": "1/s", "peak_flow": "1/s", "peak_density": "1/m2", "waiting": "s", "lost": "s"}
    parts = ("mean", "std", "low", "high")
    head = [f"{name}_{part} [{units[name]}]" for name in _LISTED for part in parts]
    writer.writerow(["rank", "gate", "exit", "width [m]", "crossed", "share_of_lost", *head])
    for k, row in enumerate(found.rows):
        numbers = [getattr(getattr(row, name), part) for name in _LISTED for part in parts]
        writer.writerow([k + 1, row.gate, int(row.exit), row.width, row.crossed, row.share, *numbers])
    return text.getvalue()


def _drawn(figure: Figure) -> bytes:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=DOTS)
    return data.getvalue()


def _map(found: Findings, cells: Any, title: str) -> bytes:
    """The plan with a heat map below it and the ranks of its gates."""
    ny, nx = cells.shape
    x, y = found.origin
    extent = (x, x + nx * CELL, y, y + ny * CELL)
    with settings():
        height = min(max(WIDE * ny / nx, 2.5), 12.0)
        figure = Figure(figsize=(WIDE, height + 0.6), layout="constrained")
        axes = figure.add_subplot()
        top = float(np.quantile(cells[cells > 0], 0.99)) if (cells > 0).any() else 1.0
        shown = np.ma.masked_less_equal(cells, 0.0)
        image = axes.imshow(
            shown, origin="lower", extent=extent, cmap="YlOrRd", vmin=0.0, vmax=top, interpolation="nearest"
        )
        _walls(axes, found)
        axes.set_aspect("equal")
        axes.grid(False)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(title)
        figure.colorbar(image, ax=axes, shrink=0.8)
        return _drawn(figure)


def _walls(axes: Axes, found: Findings) -> None:
    scale = float(found.plan["scale"])
    for wall in found.plan["walls"]:
        points = scale * np.array(wall)
        axes.plot(points[:, 0], points[:, 1], color=INK, linewidth=1.6, solid_joinstyle="miter")
    lines = {gate["name"]: ends(found.plan, gate) for gate, _ in gates(found.plan)}
    for k, row in enumerate(found.rows):
        line = lines[row.gate]
        axes.plot(line[:, 0], line[:, 1], color=PALETTE[2] if row.exit else PALETTE[0], linewidth=3.0)
        box = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": FAINT, "linewidth": 0.8}
        axes.annotate(str(k + 1), row.middle, ha="center", va="center", fontsize=7.5, bbox=box)


def _curves(found: Findings) -> bytes:
    """People on the floor over time, seed by seed, and who has crossed the first gates."""
    with settings():
        figure = Figure(figsize=(WIDE, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2)
        for run in found.outcomes:
            left.plot(run.times, run.present, color=PALETTE[0], alpha=0.5, linewidth=1.0)
        left.set_title("People on the floor")
        order = [str(gate["name"]) for gate, _ in gates(found.plan)]
        for k, row in enumerate(found.rows[:5]):
            for j, run in enumerate(found.outcomes):
                label = f"{k + 1} {row.gate}" if j == 0 else None
                counts = run.passages[order.index(row.gate)].counts
                right.plot(run.times, counts, color=PALETTE[k], alpha=0.6, linewidth=1.0, label=label)
        right.set_title("Crossings so far")
        right.legend(fontsize=8)
        for axes in (left, right):
            axes.set_xlabel("time [s]")
            axes.set_ylim(bottom=0.0)
        return _drawn(figure)


def cells(row: Rank) -> list[str]:
    """A row of the table as text."""
    return [
        row.gate,
        "exit" if row.exit else "door",
        f"{row.width:.2f}",
        f"{row.crossed:.0f}",
        number(row.flow, 2),
        number(row.peak_flow, 2),
        number(row.peak_density, 1),
        number(row.waiting, 0),
        number(row.lost, 0),
        f"{100.0 * row.share:.0f} %",
    ]


HEAD = (
    "gate",
    "kind",
    "width [m]",
    "people",
    "flow [1/s]",
    "peak flow [1/s]",
    "peak density [1/m²]",
    "waiting [s]",
    "lost [s]",
    "share",
)
"""What `cells` holds."""


def number(found: Spread, digits: int) -> str:
    """A mean and its standard deviation over seeds."""
    if not found.n:
        return "none"
    return f"{found.mean:.{digits}f}" + (f" ± {found.std:.{digits}f}" if found.n > 1 else "")


def said(found: Findings, side: int) -> str:
    """How it ended with the bodies (side 0), or without them (1)."""
    last, lost, injured = (found.bodies[what][side] for what in ("last_out", "lost", "injured"))
    text = f"the last is out after {number(last, 1)} s, {number(lost, 0)} person-seconds are lost"
    return f"{text}, {number(injured, 1)} people are injured" if side == 0 else text


def _page(found: Findings) -> str:
    seeds = [run.seed for run in found.outcomes]
    people = found.outcomes[0].people
    worst = found.rows[0]
    points = [
        f"<b>{escape(worst.gate)}</b> costs the most: {number(worst.lost, 0)} person-seconds, "
        f"{100 * worst.share:.0f} % of all time lost",
        f"last person out after {number(found.last_out, 1)} s; {number(found.lost, 0)} person-seconds lost in all",
    ]
    points += [f"made {w.by:g} m wider, {escape(w.gate)} would save {number(w.saved, 0)} person-seconds, and the last "
               f"be out {number(w.earlier, 1)} s earlier" for w in found.widened]  # fmt: skip
    if found.without:
        points.append(
            f"with the bodies {said(found, 0)}; without them {said(found, 1)}. Who was hit when is in "
            '<a href="hits.csv">hits.csv</a>'
        )
    points += [f"{escape(gate)} was not made wider: {FIXED}" for gate in found.fixed]
    points += [f"with seed {seed} not all left in time" for seed in found.stuck]
    pictures = [("Ranked gates", "plan.png"), ("Waiting", "waiting.png"), ("Over time", "exits.png")]
    rows: Sequence[Sequence[str]] = [[str(k + 1), *map(escape, cells(row))] for k, row in enumerate(found.rows)]
    sections = [
        Section(
            "Table",
            "<p>Means and standard deviations over seeds.</p>",
            table=table(["rank", *map(escape, HEAD)], rows, (1, 2)),
        )
    ]
    drawn = [""]
    for title, name in pictures:
        sections.append(Section(title, ""))
        drawn.append(f'<img src="{name}" alt="{escape(title)}" style="max-width:1000px">')
    notes = [
        "Time lost is the time of a way less that of walking it freely at the desired speed. It is charged to the next gate on "
        "the way, or to one beyond it whose queue reaches back through it.",
        "Who walks at less than half the desired speed waits. Densities are of people within 1 m of a gate, over the floor "
        "there.",
    ]
    lead = f"{people} people, seeds {seeds[0]} to {seeds[-1]}."
    title = f"Bottlenecks: {found.title or found.plan['name']}"
    return document(title, lead, points, sections, drawn, notes)
