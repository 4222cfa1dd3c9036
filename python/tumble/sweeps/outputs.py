"""What is made of a sweep's table: statistics, plots, pictures, the page."""

from pathlib import Path

from tumble.sweeps import figures, page, sheets
from tumble.sweeps.against import Published
from tumble.sweeps.options import Options
from tumble.sweeps.result import Sweep
from tumble.sweeps.store import Store, write_csv


def write(
    found: Sweep, store: Store, options: Options, against: Published | None = None, progress: sheets.Told | None = None
) -> Path:
    """Writes summary.csv, effects.csv, sweep.html, which is returned, and what is asked for of plots, stills and films. Raises
    ExportError."""
    head, lines = found.summary()
    write_csv(store.summary, [head, *lines])
    head, lines = found.effects_table()
    write_csv(store.folder / "effects.csv", [head, *lines])
    drawn = figures.draw(found, against) if options.plots else []
    sheet = sheets.stills(found, store, options.renderer, progress) if options.stills else None
    made = sheets.films(found, store, options.renderer, progress) if options.films else None
    return page.write(found, drawn, sheet, made)
