"""What is made of a sweep's table: statistics, plots, pictures, the page."""

from tumble.sweeps.result import Sweep
from tumble.sweeps.store import Store, write_csv


def write(found: Sweep, store: Store, stills: bool, films: bool) -> None:
    head, lines = found.summary()
    write_csv(store.summary, [head, *lines])
    head, lines = found.effects_table()
    write_csv(store.folder / "effects.csv", [head, *lines])
