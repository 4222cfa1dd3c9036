"""Measures of a run: one number each, of its books, of an element of an object, or of the estimate of stability.

    [HOW] ledger.COLUMN[@WHEN]
    [HOW] probe OBJECT.COLUMN[WHICH][.AXIS][@WHEN]
    stability.stable | stability.usable | stability.step

HOW over frames: max, min, mean, std, sum. WHEN: last, first, a frame (12), a time (3s), or frames from one to another
(100.., 1s..3s). WHICH: an index (of particles that come and go, an id), or mean, min, max, sum, count, order over all.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble import expect, plots
from tumble._engine import SceneError, World
from tumble.arguments import wrong
from tumble.bundled import near, unknown
from tumble.columns import COLUMNS
from tumble.folder import LEDGER
from tumble.recorder import ledger_row

Floats = npt.NDArray[np.float64]

HOWS: dict[str, Callable[[Floats], Any]] = {
    "max": np.max,
    "min": np.min,
    "mean": np.mean,
    "std": np.std,
    "sum": np.sum,
}
"""Over frames, of those in which it is measured."""

WHICH: dict[str, Callable[[Floats], Any]] = {"mean": np.mean, "min": np.min, "max": np.max, "sum": np.sum}
"""Over elements; vectors count with their lengths, unless an axis is named."""

_WORDS = (*WHICH, "count", "order")

LIMITS = ("stable", "usable", "step")
"""Of the estimate at the start [s]: the largest step that does not grow, that does not blow up, and the one taken."""

_FORM = "expected [max|min|mean|std|sum] ledger.COLUMN[@WHEN], probe OBJECT.COLUMN[INDEX].x[@WHEN] or stability.stable"

_BOOKS = [column for column in LEDGER if column not in ("frame", "hash", "seconds")]


@dataclass(frozen=True)
class Moment:
    """A frame: by its number, by its time [s], or the last one."""

    frame: int | None = None
    time: float | None = None

    def at(self, fps: float, frames: int) -> int:
        """The number of the frame, which may be beyond the last."""
        if self.time is not None:
            return round(self.time * fps)
        return frames if self.frame is None else self.frame


@dataclass(frozen=True)
class Measure:
    """What is measured of a run."""

    name: str
    """As it was typed, with single blanks: the head of its column."""
    source: str
    """ledger, probe or stability."""
    column: str
    how: str
    """Over the frames from `begin` to `end`; empty where they are one."""
    begin: Moment
    end: Moment
    thing: str = ""
    which: int | str = ""
    axis: str = ""

    @property
    def unit(self) -> str:
        """SI unit, empty for pure numbers."""
        if self.source == "stability":
            return "s"
        if self.source == "ledger":
            unit = plots.unit(self.column)
        elif self.which in ("count", "order"):
            unit = ""
        else:
            unit = COLUMNS[self.column].unit if self.column in COLUMNS else ""
        return "" if unit == "1" else unit

    def frames(self, fps: float, frames: int) -> range:
        """The frames at which it is looked at, in a run of so many. Raises SceneError where some are beyond the end."""
        begin, end = self.begin.at(fps, frames), self.end.at(fps, frames)
        if max(begin, end) > frames:
            raise wrong(
                self.name, f"frame {max(begin, end)}, but the run ends with frame {frames} ({frames / fps:.6g} s)"
            )
        if begin > end:
            raise wrong(self.name, f"from frame {begin} to {end}: the first comes after the last")
        return range(begin, end + 1)


# Reading


def read(text: str) -> Measure:
    """The measure of a text. Raises SceneError, which does not know the scene."""
    name = " ".join(text.split())
    head, _, when = name.partition("@")
    words = head.split()
    how = words.pop(0) if len(words) > 1 and words[0] != "probe" else ""
    if how and how not in HOWS:
        raise wrong(name, f"{unknown('value over frames', how, HOWS)}; {_FORM}")
    explicit = bool(words) and words[0] == "probe"
    if explicit:
        words.pop(0)
    if len(words) != 1:
        raise wrong(name or "--measure", _FORM)
    place = words[0]
    if place.startswith("stability.") and not explicit:
        return _limit(name, place.removeprefix("stability."), how, when)
    begin, end = _when(name, when, how)
    if place.startswith("ledger.") and not explicit:
        return Measure(name, "ledger", place.removeprefix("ledger."), how, begin, end)
    return _probe(name, place, how, begin, end)


def _limit(name: str, word: str, how: str, when: str) -> Measure:
    if word not in LIMITS:
        raise wrong(name, unknown("estimate of stability", word, LIMITS))
    if how or when:
        raise wrong(name, f"is of the start alone, expected stability.{word}")
    return Measure(name, "stability", word, "", Moment(0), Moment(0))


def _probe(name: str, place: str, how: str, begin: Moment, end: Moment) -> Measure:
    match = re.fullmatch(r"(.+)\.([A-Za-z_0-9]+)\[([^\]]*)\](?:\.(\w+))?", place)
    if match is None:
        hint = near(place, [f"ledger.{column}" for column in _BOOKS])
        raise wrong(name, f"{place!r} is no measure{hint or f'; {_FORM}'}")
    thing, column, which, axis = match[1], match[2], match[3], match[4] or ""
    if not re.fullmatch(r"[0-9]{1,18}", which) and which not in _WORDS:
        raise wrong(name, f"[{which}], expected the index of an element, or {', '.join(_WORDS)}")
    if axis and axis not in list("xyzw"):
        raise wrong(name, f".{axis}, expected .x, .y, .z or .w")
    if axis and which in ("count", "order"):
        raise wrong(name, f"[{which}] has no .{axis}; leave it out")
    return Measure(name, "probe", column, how, begin, end, thing, int(which) if which.isdigit() else which, axis)


def _when(name: str, text: str, how: str) -> tuple[Moment, Moment]:
    if not text:
        return (Moment(0), Moment()) if how else (Moment(), Moment())
    first, dots, last = text.partition("..")
    begin = _moment(name, first) if first or not dots else Moment(0)
    end = (_moment(name, last) if last else Moment()) if dots else begin
    if bool(dots) != bool(how):
        one, many = f"{how} of one frame", f"more than one frame, expected one of {', '.join(HOWS)} before it"
        raise wrong(name, f"@{text}: {one}; expected frames such as @100.. or @1s..3s" if how else f"@{text}: {many}")
    return begin, end


def _moment(name: str, text: str) -> Moment:
    if text in ("last", "first"):
        return Moment() if text == "last" else Moment(0)
    if re.fullmatch(r"[0-9]{1,9}", text):
        return Moment(int(text))
    if re.fullmatch(r"[0-9]*\.?[0-9]+s|[0-9]+\.s", text):
        return Moment(time=float(text[:-1]))
    raise wrong(name, f"@{text}: no moment, expected @last, @first, a frame such as @12 or a time such as @3s")


# Checking


def check(measure: Measure, world: World) -> None:
    """Raises SceneError if there is nothing to measure in a world that stands at its start."""
    time = world.scene.to_dict()["time"]
    measure.frames(float(time["fps"]), int(time["frames"]))
    if measure.source == "ledger":
        _check_books(measure)
    elif measure.source == "stability":
        if not world.stability():
            raise wrong(measure.name, "no system of this scene has an estimate of stability")
    else:
        _check_probe(measure, world)


def _check_books(measure: Measure) -> None:
    column = measure.column
    if column == "seconds":
        raise wrong(
            measure.name, "is a time on the clock, not of the scene; the table has a column seconds of each run"
        )
    if column not in _BOOKS:
        parts = [name for name in _BOOKS if name.startswith(f"{column}_")]
        hint = f"; it has the columns {', '.join(parts)}" if parts else ""
        raise wrong(measure.name, f"no column {column!r} of the ledger{hint}" if hint else _unknown_column(column))


def _unknown_column(column: str) -> str:
    return unknown("column of the ledger", column, _BOOKS)


def _check_probe(measure: Measure, world: World) -> None:
    there = world.columns(*(column.name for column in COLUMNS.values() if column.in_frames))
    for thing, columns in world.frame.items():
        there[thing] = there.get(thing, {}) | columns
    if measure.thing not in there:
        raise wrong(measure.name, unknown("object", measure.thing, there))
    if measure.column not in there[measure.thing]:
        raise wrong(measure.name, unknown(f'column of "{measure.thing}"', measure.column, there[measure.thing]))
    _value(measure, world)


# Measuring


class Watch:
    """Looks at a world frame by frame, and keeps what the measures need."""

    def __init__(self, measures: Sequence[Measure], fps: float, frames: int) -> None:
        self.measures = list(measures)
        self._frames = [measure.frames(fps, frames) for measure in measures]
        self._seen: list[list[float]] = [[] for _ in measures]

    def look(self, world: World, report: Mapping[str, Any]) -> None:
        """Looks at the frame at which the world is; `report` says what it took."""
        frame = world.frame_index
        wanted = [k for k, frames in enumerate(self._frames) if frame in frames]
        if not wanted:
            return
        books: Mapping[str, Any] = {}
        if any(self.measures[k].source == "ledger" for k in wanted):
            books = _books(world, report)
        for k in wanted:
            measure = self.measures[k]
            self._seen[k].append(float(books[measure.column]) if measure.source == "ledger" else _value(measure, world))

    def values(self) -> dict[str, float]:
        """What was measured, once the run is over; nan where nothing was, or where it ended before all was seen."""
        found = zip(self.measures, self._frames, self._seen, strict=True)
        return {m.name: _over(m, seen) if len(seen) == len(frames) else math.nan for m, frames, seen in found}


def nothing(measures: Sequence[Measure]) -> dict[str, float]:
    """The values of a run that did not reach its end."""
    return {measure.name: math.nan for measure in measures}


def _over(measure: Measure, seen: Sequence[float]) -> float:
    values = np.array([x for x in seen if not math.isnan(x)])
    if not values.size:
        return math.nan
    return float(HOWS[measure.how](values)) if measure.how else float(values[-1])


def _books(world: World, report: Mapping[str, Any]) -> Mapping[str, Any]:
    """A row of the ledger."""
    from tumble import measures

    took = measures.cells(measures.REPORT, report) if report else {}
    if report:
        took = {"tried": len(report["trials"]), **took}
    return dict(zip(LEDGER, ledger_row(world.frame_index, world.ledger, took, 0.0, ""), strict=True))


def _value(measure: Measure, world: World) -> float:
    """Of a probe or of the estimate of stability, now."""
    if measure.source == "stability":
        return _step(measure.column, world)
    if isinstance(measure.which, int):
        wanted = {"object": measure.thing, "column": measure.column, "index": measure.which}
        try:
            found = expect.probes(world, {"expect": {"probe": [wanted]}})[0]
        except SceneError as error:
            raise wrong(measure.name, str(error).split(": ", 1)[1]) from None
        if measure.axis:
            k = "xyzw".index(measure.axis)
            if k >= len(found) and not math.isnan(found[0]):
                raise wrong(measure.name, f".{measure.axis}, but {measure.column} has {len(found)} numbers")
            return found[k] if k < len(found) else math.nan
        return found[0] if len(found) == 1 else float(np.linalg.norm(found))
    return _of_all(measure, np.asarray(world.columns(measure.column)[measure.thing][measure.column], dtype=np.float64))


def _of_all(measure: Measure, array: Floats) -> float:
    """Over all elements of an object."""
    column = COLUMNS.get(measure.column)
    vectors = array.ndim > 1 and (array.shape[-1] == (column.width if column else 0) != 1 or array.ndim == 2)
    if measure.which == "count":
        return float(len(array))
    if measure.which == "order":
        return _order(measure, array) if vectors else _no_vectors(measure)
    if measure.axis:
        k = "xyzw".index(measure.axis)
        if not vectors or k >= array.shape[-1]:
            raise wrong(measure.name, f".{measure.axis} is no part of {measure.column}, which is {array.shape}")
        array = array[..., k]
    elif vectors:
        array = np.linalg.norm(array, axis=-1)
    return float(WHICH[str(measure.which)](array)) if array.size else math.nan


def _order(measure: Measure, array: Floats) -> float:
    """The length of the mean of unit vectors, P of (flocks.7)."""
    # Once a frame: the plainest operations are the fastest for few elements.
    lengths = np.sqrt((array * array).sum(axis=-1))
    if not lengths.size or not lengths.all():
        array, lengths = array[lengths > 0], lengths[lengths > 0]
    if not lengths.size:
        return math.nan
    mean = (array / lengths[..., None]).sum(axis=0) / len(lengths)
    return math.sqrt(float((mean * mean).sum()))


def _no_vectors(measure: Measure) -> float:
    raise wrong(measure.name, f"[order] is of vectors, and {measure.column} has one number each")


def _step(word: str, world: World) -> float:
    """The shortest of all systems [s]; nan where no limit is known."""
    found: list[float] = []
    for about in world.stability():
        if word == "step":
            found.append(float(about["step"]))
        else:
            found += [float(at[word]) for at in about["limits"] if at["integrator"] == about["integrator"]]
    return min(found, default=math.nan)
