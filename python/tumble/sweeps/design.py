"""Designs: which values the parameters of a scene take, point by point.

A design is a product of axes; each axis moves one parameter, or several together. Points are numbered with the last axis
fastest, and made when they are asked for, so that a design of a million of them takes no memory.
"""

import csv
import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tumble._engine import SceneError
from tumble.arguments import whole, wrong
from tumble.folder import plain

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER})(?::([^:]*))?(?::(log))?")

_MOST = 1_000_000
"""Values of one range."""

SCIPY = "needs scipy: pip install scipy"


@dataclass(frozen=True)
class Axis:
    """Parameters that change together."""

    paths: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    """A value of each of them, as the text of an override."""


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, both included."""

    low: float
    high: float
    n: int | None = None
    """How many; None where a design draws them."""
    log: bool = False
    """Whether they are spaced by their ratios."""
    whole: bool = False
    """Whether both ends were written as whole numbers; those that a design draws are then whole."""

    def values(self) -> list[str]:
        """Evenly spaced."""
        make = np.geomspace if self.log else np.linspace
        numbers = [float(f"{x:.12g}") for x in make(self.low, self.high, self.n or 2)]
        exact = self.whole and all(x == round(x) for x in numbers)
        return [str(round(x)) if exact else repr(x) for x in numbers]

    def at(self, share: float) -> str:
        """The number at a share of the way, 0 to 1."""
        span = self.high - self.low
        x = self.low * (self.high / self.low) ** share if self.log else self.low + span * share
        if self.whole:
            # Ends get as much as the others.
            n = math.floor(self.high) - math.ceil(self.low) + 1
            return str(round(x)) if self.log else str(math.ceil(self.low) + min(int(share * n), n - 1))
        return repr(float(f"{x:.6g}"))


@dataclass(frozen=True)
class Design:
    """Points in the space of parameters."""

    kind: str
    """grid, latin, sobol or table."""
    axes: tuple[Axis, ...]

    @property
    def paths(self) -> tuple[str, ...]:
        """The parameters, as keys of the scene."""
        return tuple(path for axis in self.axes for path in axis.paths)

    def __len__(self) -> int:
        return math.prod(len(axis.rows) for axis in self.axes)

    def point(self, i: int) -> dict[str, str]:
        """Parameter -> value, as the text of an override."""
        found: dict[str, str] = {}
        for axis in reversed(self.axes):
            i, k = divmod(i, len(axis.rows))
            found = dict(zip(axis.paths, axis.rows[k], strict=True)) | found
        return found

    def values(self, path: str) -> list[str]:
        """All values of a parameter, each once, in the order in which they come first."""
        axis = next(axis for axis in self.axes if path in axis.paths)
        return list(dict.fromkeys(row[axis.paths.index(path)] for row in axis.rows))

    def covering(self, most: int = 1000) -> list[int]:
        """Points in which every row of every axis occurs: all of them where they are few, at most `most`."""
        if len(self) <= most:
            return list(range(len(self)))
        strides = [math.prod(len(axis.rows) for axis in self.axes[k + 1 :]) for k in range(len(self.axes))]
        found = [j * s for axis, s in zip(self.axes, strides, strict=True) for j in range(len(axis.rows))]
        found = sorted({*found, len(self) - 1})
        return found if len(found) <= most else [found[round(k)] for k in np.linspace(0, len(found) - 1, most)]

    @property
    def repeats(self) -> bool:
        """Whether some points are the same: drawn whole numbers may be."""
        return any(len(set(axis.rows)) < len(axis.rows) for axis in self.axes)

    def to_dict(self) -> dict[str, Any]:
        """For sweep.json."""
        return {
            "kind": self.kind,
            "axes": [{"paths": list(a.paths), "rows": [list(r) for r in a.rows]} for a in self.axes],
        }


def override(path: str, value: str) -> str:
    """As `--set` takes it."""
    return f"{path}={value}"


def located(scene: Mapping[str, Any], path: str) -> tuple[str | int, ...]:
    """The parts of a key, with indices in place of names: a key may be written in several ways."""
    found: list[str | int] = []
    node: Any = scene
    for part in path.split("."):
        step: str | int = part
        if isinstance(node, list):
            names = [item.get("name") if isinstance(item, Mapping) else None for item in node]
            step = int(part) if part.isdigit() else names.index(part) if part in names else part
            node = node[step] if isinstance(step, int) and step < len(node) else None
        else:
            node = node.get(part) if isinstance(node, Mapping) else None
        found.append(step)
    return tuple(found)


def number(value: str) -> float:
    """The number that a value is; nan where it is none."""
    try:
        return float(value)
    except ValueError:
        return math.nan


def short(value: str) -> str:
    """A value for people: numbers with six digits."""
    x = number(value)
    return value if math.isnan(x) or len(value) <= 8 else f"{x:.6g}"


# From Python


def grid(values: Mapping[str, Any]) -> Design:
    """All combinations: key of the scene -> values, or text such as "10,20,40" or "-9.8:-1.6:5". Raises SceneError."""
    return Design(
        "grid", tuple(Axis((path,), tuple((v,) for v in listed(path, given))) for path, given in values.items())
    )


def zipped(values: Mapping[str, Any]) -> Design:
    """The first value of every key together, then the second, and so on. Raises SceneError where they are not as many."""
    return Design("grid", (together({path: listed(path, given) for path, given in values.items()}),))


def latin(ranges: Mapping[str, Any], samples: int) -> Design:
    """A Latin hypercube: key of the scene -> (low, high), or text such as "1:10" or "1:1e4:log". Whole numbers as both ends
    give whole numbers. Raises SceneError."""
    return drawn("latin", {path: interval(path, given) for path, given in ranges.items()}, samples)


def sobol(ranges: Mapping[str, Any], samples: int) -> Design:
    """A scrambled sequence of Sobol, as `latin`; powers of two as `samples` are balanced best. Raises SceneError."""
    return drawn("sobol", {path: interval(path, given) for path, given in ranges.items()}, samples)


def table(file: str | os.PathLike[str]) -> Design:
    """The rows of a CSV file, whose head names keys of the scene. Raises SceneError."""
    return Design("table", (points(file),))


def product(first: Design, *others: Design) -> Design:
    """All combinations of the points of several designs. Raises SceneError where two of them move one parameter."""
    axes = tuple(axis for design in (first, *others) for axis in design.axes)
    paths = [path for axis in axes for path in axis.paths]
    if twice := next((path for path in paths if paths.count(path) > 1), None):
        raise wrong(twice, "is varied twice; name each key once")
    return Design(next((d.kind for d in (first, *others) if d.kind != "grid"), "grid"), axes)


# Values of a parameter


def listed(path: str, given: Any) -> list[str]:
    """Values as texts of overrides, from a list, a number, or text as `--vary` takes it. Raises SceneError."""
    if isinstance(given, str):
        return spread(path, given)
    if isinstance(given, Range):
        return given.values()
    if not isinstance(given, Iterable) or isinstance(given, Mapping):
        given = [given]
    return _distinct(path, [_text(value) for value in given])


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(plain(value))


def _distinct(path: str, values: list[str]) -> list[str]:
    if not values:
        raise wrong(path, "no value, expected some, e.g. 10,20,40")
    if twice := next((v for v in values if values.count(v) > 1), None) if len(values) < 10_000 else None:
        raise wrong(path, f"{twice} is there twice; name each value once, and use --seeds to repeat runs")
    return values


def spread(path: str, text: str) -> list[str]:
    """The values of `a,b,c` or `LO:HI:N` (`LO:HI:N:log`). Raises SceneError."""
    if (found := _range(path, text)) is None:
        return _distinct(path, _split(path, text))
    if found.n is None:
        raise wrong(path, f"{text}: a range without a count, expected LO:HI:N, e.g. {text.removesuffix(':log')}:5")
    return _distinct(path, found.values())


def interval(path: str, given: Any) -> Range:
    """The bounds of `LO:HI` (`LO:HI:log`) or of a pair. Raises SceneError."""
    if isinstance(given, Range):
        return given
    if not isinstance(given, str):
        try:
            low, high = given
            given = f"{_text(low)}:{_text(high)}"
        except (TypeError, ValueError):
            raise wrong(path, f"{given!r}, expected (low, high)") from None
    found = _range(path, given)
    if found is None:
        raise wrong(path, f"{given}: expected LO:HI, two numbers between which the design draws")
    if found.n is not None:
        raise wrong(path, f"{given}: a count, but --samples says how many the design draws; expected LO:HI")
    return found


def _range(path: str, text: str) -> Range | None:
    """A range, if the text is one."""
    if (match := _RANGE.fullmatch(text.strip())) is None:
        return None
    low, high, n = match[1], match[2], match[3]
    log = match[4] is not None or n == "log"
    count = None
    if n is not None and n != "log":
        if not re.fullmatch(r"[0-9]{1,9}", n) or not 2 <= int(n) <= _MOST:
            raise wrong(path, f"{text}: {n!r} is no count, expected LO:HI:N with N from 2 to {_MOST:,}")
        count = int(n)
    a, b = float(low), float(high)
    if not (math.isfinite(a) and math.isfinite(b) and a != b):
        raise wrong(path, f"{text}: expected two different, finite ends")
    if log and (a <= 0.0 or b <= 0.0):
        raise wrong(path, f"{text}: expected ends > 0 for a range by ratios")
    if count is None and a > b:
        a, b = b, a
    return Range(a, b, count, log, all(re.fullmatch(r"[-+]?[0-9]+", end) for end in (low, high)))


def _split(path: str, text: str) -> list[str]:
    """The parts between commas that stand in no brackets and no quotes."""
    parts, depth, quote = [""], 0, ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        if c == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += c
    parts = [part.strip() for part in parts]
    if not all(parts):
        raise wrong(path, f"{text!r} has an empty value, expected e.g. 10,20,40 or 1:10:5")
    return parts


# Axes


def together(values: Mapping[str, Sequence[str]]) -> Axis:
    """Parameters that change together. Raises SceneError where they have not as many values."""
    counts = {path: len(given) for path, given in values.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{path} has {n}" for path, n in counts.items())
        raise wrong("--zip", f"{told}: expected as many values of each")
    return Axis(tuple(values), tuple(zip(*values.values(), strict=True)))


def points(file: str | os.PathLike[str]) -> Axis:
    """The points of a table. Raises SceneError, also where two are the same."""
    axis = read(file)
    first: dict[tuple[str, ...], int] = {}
    for i, row in enumerate(axis.rows, 1):
        if row in first:
            text = f"row {i}: {','.join(row)}: is the same as row {first[row]}"
            raise wrong(f"--table {Path(file)}", f"{text}; leave one of both out, and use --seeds to repeat runs")
        first[row] = i
    return axis


def read(file: str | os.PathLike[str], place: str | None = None) -> Axis:
    """The rows of a CSV file. Raises SceneError, at `place`."""
    path = Path(file)
    place = place or f"--table {path}"
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            found = [[word.strip() for word in row] for row in csv.reader(lines) if any(map(str.strip, row))]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise wrong(place, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(found) < 2:
        raise wrong(place, "has no rows, expected a head, and a row for each point")
    head, rows = found[0], found[1:]
    if len(head) == 1 and (sign := next((c for c in ";\t" if c in head[0]), "")):
        told = "semicolons" if sign == ";" else "tabs"
        raise wrong(place, f"line 1: {head[0]}: {told} between the columns, expected commas")
    if not all(head) or len(set(head)) < len(head):
        raise wrong(place, f"line 1: {','.join(head)}: expected a different name over each column")
    for i, row in enumerate(rows):
        if len(row) != len(head) or not all(row):
            raise wrong(
                place, f"row {i + 1}: {','.join(row)}: expected {len(head)} values, one for each of {', '.join(head)}"
            )
    return Axis(tuple(head), tuple(map(tuple, rows)))


def drawn(kind: str, ranges: Mapping[str, Range], samples: int) -> Design:
    """A design of points drawn between bounds, the same each time. Raises SceneError."""
    samples = whole(samples, "--samples", 2)
    if samples > _MOST:
        raise wrong("--samples", f"{samples}, expected at most {_MOST:,}")
    if not ranges:
        raise wrong(f"--design {kind}", "nothing to draw, expected --vary KEY=LO:HI")
    try:
        from scipy.stats import qmc
    except ImportError:
        raise wrong(f"--design {kind}", SCIPY) from None
    makers = {"latin": qmc.LatinHypercube, "sobol": qmc.Sobol}
    import warnings

    try:
        with warnings.catch_warnings(action="ignore"):  # Of numbers that are no powers of two.
            unit = makers[kind](len(ranges), seed=0).random(samples)
    except ValueError as error:
        raise wrong(f"--design {kind}", str(error)) from None
    rows = tuple(
        tuple(bounds.at(float(u)) for bounds, u in zip(ranges.values(), row, strict=True)) for row in unit.tolist()
    )
    return Design(kind, (Axis(tuple(ranges), rows),))


def asked(given: Any) -> Design:
    """A design, or a mapping taken as a grid. Raises SceneError."""
    if isinstance(given, Design):
        return given
    if isinstance(given, Mapping):
        return grid(given)
    raise SceneError(f"design: {given!r}, expected a mapping of keys to values, or one of tumble.sweeps.design")
