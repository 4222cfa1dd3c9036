"""What is made of a sweep's table: statistics, plots, pictures, the page."""

from pathlib import Path

from tumble.sweeps import figures, page, sheets
from tumble.sweeps.result import Sweep
from tumble.sweeps.store import Store, write_csv


def write(
    found: Sweep,
    store: Store,
    plots: bool,
    stills: bool,
    films: bool,
    renderer: str = "auto",
    progress: sheets.Told | None = None,
) -> Path:
    """Writes summary.csv, effects.csv, sweep.html, which is returned, and what is asked for of plots, stills and films. Raises
    ExportError."""
    head, lines = found.summary()
    write_csv(store.summary, [head, *lines])
    head, lines = found.effects_table()
    write_csv(store.folder / "effects.csv", [head, *lines])
    drawn = figures.draw(found) if plots else []
    sheet = sheets.stills(found, store, renderer, progress) if stills else None
    made = sheets.films(found, store, renderer, progress) if films else []
    return page.write(found, drawn, sheet, made)
