"""Values from elsewhere, published or measured, that stand in the plots beside those of a sweep."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tumble.arguments import wrong
from tumble.bundled import unknown
from tumble.sweeps.design import number, read


@dataclass(frozen=True)
class Published:
    """A table of numbers."""

    name: str
    """Of its file, without the ending."""
    columns: dict[str, list[float]]
    """Parameter or measure -> a number for each row."""

    def beside(self, path: str, measure: str) -> tuple[list[float], list[float]] | None:
        """Its values of a measure over a parameter, if it has both."""
        if path not in self.columns or measure not in self.columns:
            return None
        return self.columns[path], self.columns[measure]


def published(file: str | os.PathLike[str], paths: Sequence[str], measures: Sequence[str]) -> Published:
    """The table of a CSV file, whose head names parameters and measures of a sweep. Raises SceneError."""
    place = f"--against {file}"
    axis = read(file, place)
    for name in axis.paths:
        if name not in (*paths, *measures):
            raise wrong(place, f"its head has {unknown('parameter or measure', name, [*paths, *measures])}")
    if not (set(axis.paths) & set(paths) and set(axis.paths) & set(measures)):
        raise wrong(place, "expected a column of a parameter and one of a measure, such as the head of sweep.csv has")
    columns = {name: [number(row[k]) for row in axis.rows] for k, name in enumerate(axis.paths)}
    for name, values in columns.items():
        if any(map(math.isnan, values)):
            raise wrong(place, f"{name}: row {[*map(math.isnan, values)].index(True) + 1} has no number there")
    return Published(Path(file).stem, columns)
