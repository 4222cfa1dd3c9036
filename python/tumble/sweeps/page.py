"""The page of a sweep: what was asked for, what came out, and all its pictures."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from tumble.folder import write_whole
from tumble.lab.page import Section, document, table
from tumble.sweeps.design import short
from tumble.sweeps.figures import Plot
from tumble.sweeps.result import Row, Sweep, status_counts
from tumble.sweeps.sheets import caption
from tumble.sweeps.statistics import CONFIDENCE

DOTS = 86.0
"""Pixels per inch of a plot."""

ROWS = 200
"""Points, and failed runs, that are listed."""


def write(
    found: Sweep, drawn: Sequence[Plot], sheet: Path | None, films: Sequence[tuple[Row, Path]] | None = None
) -> Path:
    """Writes sweep.html into the folder of the sweep; `films` could be drawn, None were not asked for. Raises ExportError."""
    sections: list[tuple[Section, str]] = []
    if sheet is not None:
        text = "<p>The last frame of the first seed at each point.</p>"
        sections.append((Section("Stills", text), _picture(sheet.name, "last frames", "100%")))
    if films is not None:
        text = "<p>Of the first seed at each point.</p>" if films else "<p>No run has the two frames of a film.</p>"
        sections.append((Section("Films", text), _films(found, films)))
    for measure in dict.fromkeys(plot.measure for plot in drawn):
        own = "".join(
            _picture(
                plot.path.relative_to(found.folder).as_posix(), plot.title, f"min(100%, {plot.width * DOTS:.0f}px)"
            )
            for plot in drawn
            if plot.measure == measure
        )
        grid = f'<div style="display:flex; flex-wrap:wrap; gap:0 1.5rem; align-items:flex-start">{own}</div>'
        sections.append((Section(measure, ""), grid))
    sections.append((_values(found), ""))
    if found.failed:
        sections.append((_failures(found), ""))
    goal = found.folder / "sweep.html"
    title = f"Sweep: {found.title}" if found.title else f"Sweep: {found.folder.name}"
    text = document(
        title, _lead(found), _points(found), [s for s, _ in sections], [p for _, p in sections], _notes(found)
    )
    write_whole(goal, text.encode())
    return goal


def _picture(place: str, title: str, width: str = "760px") -> str:
    return f'<img src="{escape(place, quote=True)}" alt="{escape(title, quote=True)}" style="max-width:{width}">'


def _films(found: Sweep, films: Sequence[tuple[Row, Path]]) -> str:
    if not films:
        return ""
    if len(films) > 1:
        listed = "; ".join(escape(caption(row)) for row, _ in films)
        return (
            '<video src="films.mp4" controls loop muted style="max-width:100%"></video>'
            f"<p>In rows from the top left: {listed}.</p>"
        )
    place = films[0][1].relative_to(found.folder).as_posix()
    return f'<video src="{escape(place, quote=True)}" controls loop muted></video>'


def _lead(found: Sweep) -> str:
    ends = ", ".join(f"{n} {end}" for end, n in status_counts(found.rows).items())
    points, seeds = len(found.design), len(found.seeds)
    return f"{points} points, {seeds} seed{'' if seeds == 1 else 's'} each: {len(found.rows)} runs ({escape(ends)})."


def _points(found: Sweep) -> list[str]:
    told = []
    for axis in found.design.axes:
        keys = ", ".join(f"<code>{escape(path)}</code>" for path in axis.paths)
        rows = [escape(", ".join(map(short, row))) for row in axis.rows]
        values = "; ".join(rows) if len(rows) <= 20 else f"{rows[0]} to {rows[-1]}, {len(rows)} values"
        told.append(f"{keys}: {values}")
    if len(found.seeds) > 1:
        told.append(f"seeds {found.seeds[0]} to {found.seeds[-1]}")
    told.append(
        'Runs: <a href="sweep.csv">sweep.csv</a>; over seeds: <a href="summary.csv">summary.csv</a>; main effects: '
        '<a href="effects.csv">effects.csv</a>; what was asked for: <a href="sweep.json">sweep.json</a>'
    )
    return told


def _values(found: Sweep) -> Section:
    """Means over seeds."""
    head = [*map(escape, found.design.paths), "runs"]
    head += [f"{escape(m.name)}{f' [{escape(m.unit)}]' if m.unit else ''}" for m in found.measures]
    lines = []
    for point, rows in list(found.points.items())[:ROWS]:
        line = [*(escape(short(value)) for value in rows[0].parameters.values()), str(len(rows))]
        for m in found.measures:
            s = found.spreads[point, m.name]
            bounds = f" ({s.low:.4g} to {s.high:.4g})" if s.n > 1 and s.low < s.high else ""
            line.append(f"{s.mean:.6g}{bounds}" if s.n else '<span class="none">none</span>')
        lines.append(line)
    text = "<p>Means over seeds, and their confidence intervals.</p>" if len(found.seeds) > 1 else ""
    if len(found.points) > ROWS:
        text += f"<p>The first {ROWS} of {len(found.points)}; all are in summary.csv.</p>"
    return Section("Values", text, table=table(head, lines, ()))


def _failures(found: Sweep) -> Section:
    head = ["run", *map(escape, found.design.paths), "seed", "end", "frame", "reason"]
    lines = [
        [
            str(r.run),
            *(escape(short(v)) for v in r.parameters.values()),
            str(r.seed),
            r.status,
            str(r.frame),
            escape(r.reason),
        ]
        for r in found.failed[:ROWS]
    ]
    more = f"<p>The first {ROWS} of {len(found.failed)}.</p>" if len(found.failed) > ROWS else ""
    return Section("Runs that did not reach their end", more, table=table(head, lines, (len(head) - 1,)))


def _notes(found: Sweep) -> list[str]:
    notes = [
        f"Hash of the table, which all computers and any number of workers should find: <code>{found.hash}</code>."
    ]
    if len(found.seeds) > 1:
        notes.append(f"Bands and intervals: {CONFIDENCE:.0%} confidence of the mean over seeds, by the bootstrap.")
    if len(found.design.paths) > 1:
        notes.append(
            "A main effect is the mean over all values of the other parameters; its share of the variance is the "
            "correlation ratio."
        )
    notes += [escape(note) for note in found.manifest.get("notes", [])]
    return notes
