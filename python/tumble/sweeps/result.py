"""What a sweep found: rows, and their statistics."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble import _engine
from tumble.sweeps.design import Design, number
from tumble.sweeps.measures import Measure
from tumble.sweeps.statistics import Effect, Spread, effect, spread
from tumble.sweeps.store import table_hash
from tumble.sweeps.task import FINISHED


@dataclass(frozen=True, slots=True)
class Row:
    """A run."""

    run: int
    """Its number in the design, from 0."""
    point: int
    parameters: dict[str, str]
    """The same for all runs of a point."""
    seed: int
    key: str
    status: str
    reason: str
    report: dict[str, Any]
    frame: int
    hash: str
    values: dict[str, float]
    seconds: float


@dataclass
class Sweep:
    """The runs of a sweep that are done, in the order of the design, and their statistics."""

    folder: Path
    title: str
    design: Design
    seeds: list[int]
    measures: list[Measure]
    rows: list[Row]
    computed: int = 0
    """Runs that were computed this time; all others were there."""
    manifest: dict[str, Any] = field(default_factory=dict)
    """What sweep.json says."""

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        bad = len(self.failed)
        return f"Sweep({str(self.folder)!r}: {len(self.rows)} runs{f', {bad} failed' if bad else ''}, {self.hash})"

    def _repr_html_(self) -> str:
        found: str = self.to_pandas()._repr_html_()
        return found

    @property
    def head(self) -> list[str]:
        """The columns of sweep.csv."""
        names = [m.name for m in self.measures]
        return ["run", *self.design.paths, "seed", "status", "frame", "hash", *names, "seconds", "version", "reason"]

    def lines(self) -> Iterator[list[Any]]:
        """The rows of sweep.csv."""
        for row in self.rows:
            values = [row.values.get(m.name, math.nan) for m in self.measures]
            own = [
                row.run,
                *(row.parameters[path] for path in self.design.paths),
                row.seed,
                row.status,
                row.frame,
                row.hash,
            ]
            yield [*own, *values, row.seconds, _engine.version, row.reason]

    @cached_property
    def hash(self) -> str:
        """Of all of sweep.csv but for the seconds: 16 hexadecimal digits."""
        return table_hash(self.head, self.lines())

    @property
    def failed(self) -> list[Row]:
        """Runs that did not reach their end."""
        return [row for row in self.rows if row.status != FINISHED]

    def column(self, name: str) -> npt.NDArray[np.float64]:
        """A measure or a parameter, a number for each run; nan where it is none."""
        if name in self.design.paths:
            return np.array([number(row.parameters[name]) for row in self.rows])
        if name == "seconds":
            return np.array([row.seconds for row in self.rows])
        return np.array([row.values[name] for row in self.rows])

    @property
    def table(self) -> Any:
        """A pandas.DataFrame where pandas is installed, else a list with a dict for each run; its columns are those of
        sweep.csv, with numbers where a parameter has numbers."""
        from tumble._engine import ExportError

        try:
            return self.to_pandas()
        except ExportError:
            return self.records()

    def records(self) -> list[dict[str, Any]]:
        """A dict for each run."""
        numeric = [p for p in self.design.paths if not any(math.isnan(number(v)) for v in self.design.values(p))]
        found = [dict(zip(self.head, line, strict=True)) for line in self.lines()]
        for record in found:
            record |= {path: number(record[path]) for path in numeric}
        return found

    def to_pandas(self) -> Any:
        """A pandas.DataFrame, a row for each run. Raises ExportError where pandas is not installed."""
        from tumble.tables import library

        pandas = library("pandas", "to_pandas")
        table = pandas.DataFrame(self.records(), columns=self.head)
        table.attrs["units"] = {m.name: m.unit or "1" for m in self.measures}
        return table

    # Statistics

    @cached_property
    def points(self) -> dict[int, list[Row]]:
        """The runs of each point of the design that has some."""
        found: dict[int, list[Row]] = {}
        for row in self.rows:
            found.setdefault(row.point, []).append(row)
        return found

    def spread(self, point: int, measure: str) -> Spread:
        """Mean, spread and confidence over the seeds of a point."""
        rows = self.points.get(point, [])
        told = " ".join(f"{k}={v}" for k, v in (rows[0].parameters if rows else {}).items())
        return spread([row.values.get(measure, math.nan) for row in rows], f"{measure} {told}")

    @cached_property
    def spreads(self) -> dict[tuple[int, str], Spread]:
        """Of all points and measures."""
        return {(p, m.name): self.spread(p, m.name) for p in self.points for m in self.measures}

    def spreads_of(self, measure: str) -> list[Spread]:
        """Of a measure at all points."""
        return [self.spreads[point, measure] for point in self.points]

    def effect(self, measure: str, path: str) -> Effect:
        """The main effect of a parameter."""
        values = [row.values.get(measure, math.nan) for row in self.rows]
        return effect(path, [row.parameters[path] for row in self.rows], values, measure)

    def effects(self, measure: str) -> list[Effect]:
        """The main effects of all parameters."""
        return [self.effect(measure, path) for path in self.design.paths]

    def summary(self) -> tuple[list[str], list[list[Any]]]:
        """summary.csv: a row for each point and measure."""
        head = [*self.design.paths, "measure", "unit", "runs", "failed", "mean", "std", "low", "high", "min", "max"]
        lines: list[list[Any]] = []
        for point, rows in self.points.items():
            bad = sum(row.status != FINISHED for row in rows)
            for m in self.measures:
                s = self.spreads[point, m.name]
                own = [rows[0].parameters[path] for path in self.design.paths]
                lines.append(
                    [*own, m.name, m.unit or "1", len(rows), bad, s.mean, s.std, s.low, s.high, s.least, s.most]
                )
        return head, lines

    def effects_table(self) -> tuple[list[str], list[list[Any]]]:
        """effects.csv: a row for each measure, parameter and level."""
        lines: list[list[Any]] = []
        for m in self.measures:
            for found in self.effects(m.name):
                for level, s in zip(found.levels, found.spreads, strict=True):
                    lines.append(
                        [m.name, found.path, level, s.n, s.mean, s.std, s.low, s.high, found.size, found.share]
                    )
        return ["measure", "parameter", "level", "runs", "mean", "std", "low", "high", "effect", "share"], lines


def status_counts(rows: Sequence[Row]) -> dict[str, int]:
    """How many runs ended how."""
    found: dict[str, int] = {}
    for row in rows:
        found[row.status] = found.get(row.status, 0) + 1
    return found
