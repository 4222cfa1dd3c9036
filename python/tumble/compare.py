"""Comparison of two runs: the first frame, object, column and element whose bits differ."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.arguments import whole
from tumble.folder import Columns, refuse
from tumble.recorder import changed

if TYPE_CHECKING:
    from tumble.reader import Run

Array = npt.NDArray[Any]

CLOCK = "seconds"
"""The column of the ledger that says how long a frame took, which no two runs share."""

LEDGER_OBJECT = "ledger"

_AXES = "xyzw"


@dataclass(frozen=True)
class ColumnDifference:
    """How two arrays differ whose bits are not the same."""

    object: str
    column: str
    unit: str
    count: int
    """Numbers that differ."""
    size: int
    """Numbers in all: of the shorter one where their lengths differ."""
    lengths: tuple[int, int]
    """Elements of each: particles that come and go can be more in one run than in the other."""
    index: tuple[int, ...]
    """The first number that differs; empty where only the lengths do."""
    values: tuple[float, float]
    """That number in each run."""
    ulps: float
    """Numbers that can be said between these two; of runs of two precisions, in the lower one. Inf if one is not finite."""
    largest: float
    """Largest difference of any two numbers."""
    largest_at: tuple[int, ...]
    id: int | None = None
    """Of a particle that comes and goes, its number for life."""

    def place(self, index: tuple[int, ...] | None = None) -> str:
        """`element 17, y`."""
        at = self.index if index is None else index
        if not at:
            return "the number of elements"
        if len(at) == 2 and at[1] < len(_AXES):
            text = f"element {at[0]}, {_AXES[at[1]]}"
        else:
            text = f"element {at[0]}" if len(at) == 1 else f"element [{', '.join(map(str, at))}]"
        return text if self.id is None or index is not None else f"{text} (id {self.id})"


@dataclass(frozen=True)
class Comparison:
    """Result of comparing two runs."""

    runs: tuple[Path, Path]
    frames: tuple[int, int]
    """Frames that each can show."""
    compared: int
    """Frames that both have, up to the one asked for."""
    until: int | None
    """The last frame that was asked for."""
    mixed: bool
    """Whether one is in single and one in double precision: then numbers are compared as single ones, and no hashes."""
    frame: int | None
    """The first frame at which anything differs; None where nothing does."""
    time: float | None
    """Its time [s]."""
    hashes: tuple[str, str] | None
    """The states' hashes there; None where they are the same."""
    columns: list[ColumnDifference] = field(default_factory=list)
    """Differences there, in the order of columns; columns of the ledger belong to the object "ledger". Empty where only the
    hashes differ: what does is not among the columns that are kept."""
    seen: int | None = None
    """The first frame at which a column of an object differs."""
    seen_columns: list[ColumnDifference] = field(default_factory=list)
    """Differences there."""
    unlike: list[str] = field(default_factory=list)
    """Objects and columns that only one of the runs keeps, in words."""
    scenes: str | None = None
    """The first word in which the scenes differ."""
    versions: tuple[str, str] = ("", "")

    @property
    def same(self) -> bool:
        """Whether both are the same bits, from the first frame to the last."""
        return self.frame is None and not self.longer and not self.mixed

    @property
    def longer(self) -> bool:
        """Whether one goes on after the frames that were compared, and was not asked to be left out there."""
        asked = self.until is not None and self.until < min(self.frames)
        return self.frames[0] != self.frames[1] and not asked


def compare(a: "Run", b: "Run", until: int | None = None, deep: bool = False) -> Comparison:
    """Compares two runs frame by frame, up to the frame `until`.

    Frames whose states have the same hash are taken for the same, so that only those are read where states differ; `deep`
    reads all of them, and so finds files that were changed or damaged afterwards. Books are compared at every frame, but for
    the time that computing them took.

    Raises SceneError if the runs are not of the same things; ExportError if a frame cannot be read.
    """
    unlike = _alike(a, b)
    n = min(a.n_frames, b.n_frames)
    n = n if until is None else min(n, whole(until, "until", 0) + 1)
    # Hashes of states in two precisions say nothing: then columns alone do.
    mixed = a.scene["precision"] != b.scene["precision"]
    frame, columns = _first(a, b, n, deep or mixed, mixed)
    seen, there = frame, [column for column in columns if column.object != LEDGER_OBJECT]
    if frame is not None and not there:
        seen = None
        for i in range(frame + 1, n):
            if there := list(_columns_differ(a, b, i)):
                seen = i
                break
    told = None if frame is None or mixed or a.hashes[frame] == b.hashes[frame] else (a.hashes[frame], b.hashes[frame])
    return Comparison(
        runs=(a.folder, b.folder),
        frames=(a.n_frames, b.n_frames),
        compared=n,
        until=until,
        mixed=mixed,
        frame=frame,
        time=None if frame is None else a.time(frame),
        hashes=told,
        columns=columns,
        seen=seen,
        seen_columns=there,
        unlike=unlike,
        scenes=changed(a.scene, b.scene),
        versions=(str(a.manifest.get("tumble")), str(b.manifest.get("tumble"))),
    )


def at(a: "Run", b: "Run", frame: int) -> list[ColumnDifference]:
    """The columns that differ at a frame."""
    return list(_columns_differ(a, b, frame))


def _alike(a: "Run", b: "Run") -> list[str]:
    """Columns stored by only one of them, as text. Refuses runs of different objects."""
    if a.fps != b.fps:
        raise refuse(
            b.folder, f"has {b.fps:g} frames per second, {a.folder} has {a.fps:g}: their frames are at different times"
        )
    mine, theirs = a.columns, b.columns
    for here, there, run, other in ((mine, theirs, a, b), (theirs, mine, b, a)):
        lost = [name for name in here if name not in there]
        if lost:
            names = ", ".join(f'"{name}"' for name in lost)
            text = f"has no {names}, which {run.folder} has: these are runs of different scenes"
            raise refuse(other.folder, text)
    unlike = []
    for name, table in mine.items():
        for column in dict.fromkeys([*table, *theirs[name]]):
            if column not in table or column not in theirs[name]:
                where = a.folder if column in table else b.folder
                unlike.append(f'{column} of "{name}" is stored only in {where}')
                continue
            one, other = table[column]["shape"], theirs[name][column]["shape"]
            if one != other:
                text = f'{column} of "{name}" is {_shape(other)}, in {a.folder} {_shape(one)}'
                raise refuse(b.folder, f"{text}: the runs differ in resolution and cannot be compared by element")
    return unlike


def _shape(shape: list[int | None]) -> str:
    return " x ".join("any" if n is None else str(n) for n in shape) or "one number"


def _first(a: "Run", b: "Run", n: int, deep: bool, mixed: bool) -> tuple[int | None, list[ColumnDifference]]:
    """The first frame before `n` that differs, and what differs there among what is kept."""
    if n == 0:
        return None, []
    if found := list(_tables_differ(a.static, b.static, a.columns)):
        return 0, found
    off = [i for i in range(n) if a.hashes[i] != b.hashes[i] and not mixed]
    books, entries = (None, []) if mixed else _books_differ(a, b, n)
    first = min([*off[:1], *([] if books is None else [books])], default=None)
    for i in range(n if first is None else first + 1) if deep else [] if first is None else [first]:
        if found := list(_columns_differ(a, b, i)):
            return i, [*found, *(entries if i == books else [])]
    return first, entries if first == books else []


def _columns_differ(a: "Run", b: "Run", frame: int) -> Iterator[ColumnDifference]:
    return _tables_differ(a.frame(frame), b.frame(frame), a.columns)


def _tables_differ(a: Columns, b: Columns, about: Mapping[str, Mapping[str, Any]]) -> Iterator[ColumnDifference]:
    for name, table in a.items():
        others = b.get(name, {})
        ids = table.get("id") if "id" in others else None
        for column, one in table.items():
            if column in others:
                unit = about.get(name, {}).get(column, {}).get("unit", "1")
                found = _differ(name, column, unit, one, others[column], ids)
                if found is not None:
                    yield found


def _books_differ(a: "Run", b: "Run", n: int) -> tuple[int | None, list[ColumnDifference]]:
    """The first frame whose books differ, and in what."""
    names = [name for name in a.ledger if name != CLOCK and name in b.ledger]
    rows = [np.flatnonzero(_unequal(a.ledger[name][:n], b.ledger[name][:n])) for name in names]
    frame = min((int(off[0]) for off in rows if off.size), default=None)
    if frame is None:
        return None, []
    there = slice(frame, frame + 1)
    found = (_differ(LEDGER_OBJECT, name, "", a.ledger[name][there], b.ledger[name][there], None) for name in names)
    return frame, [column for column in found if column is not None]


def _differ(name: str, column: str, unit: str, a: Array, b: Array, ids: Array | None) -> ColumnDifference | None:
    """How two arrays differ, if they do."""
    lengths = (len(a), len(b)) if a.ndim and b.ndim else (1, 1)
    n = min(lengths)
    a, b = (np.atleast_1d(a)[:n], np.atleast_1d(b)[:n])
    if a.shape != b.shape:
        raise ExportError(
            f'{column} of "{name}" is {a.shape} in one frame file and {b.shape} in the other; one was changed'
        )
    unequal = _unequal(a, b)
    count = int(np.count_nonzero(unequal))
    if not count and lengths[0] == lengths[1]:
        return None
    index: tuple[int, ...] = ()
    largest_at: tuple[int, ...] = ()
    values = (float(lengths[0]), float(lengths[1]))
    ulps, largest = 0.0, 0.0
    if count:
        index = tuple(int(i) for i in np.unravel_index(int(np.argmax(unequal)), a.shape))
        values = float(a[index]), float(b[index])
        ulps = _ulps(a[index], b[index])
        with np.errstate(all="ignore"):
            off = np.abs(a.astype(np.float64) - b.astype(np.float64))
        off = np.where(unequal, np.where(np.isnan(off), np.inf, off), 0.0)
        largest_at = tuple(int(i) for i in np.unravel_index(int(np.argmax(off)), a.shape))
        largest = float(off[largest_at])
    who = int(ids[index[0]]) if ids is not None and index and index[0] < len(ids) else None
    return ColumnDifference(
        name, column, unit, count, int(a.size), lengths, index, values, ulps, largest, largest_at, who
    )


def _unequal(a: Array, b: Array) -> npt.NDArray[np.bool_]:
    """Mask of differing bits; for numbers in two precisions, in the lower one."""
    if a.dtype != b.dtype and a.dtype.kind == b.dtype.kind == "f":
        lower = min(a.dtype, b.dtype, key=lambda kind: kind.itemsize)
        with np.errstate(over="ignore"):
            a, b = a.astype(lower), b.astype(lower)
    if a.dtype == b.dtype and a.dtype.kind == "f":
        bits = np.dtype(f"u{a.dtype.itemsize}")
        return np.asarray(np.ascontiguousarray(a).view(bits) != np.ascontiguousarray(b).view(bits))
    return np.asarray(a != b)


def _ulps(a: Any, b: Any) -> float:
    """How many numbers of the less precise type lie between two, counting one end."""
    if np.asarray(a).dtype.kind != "f" or np.asarray(b).dtype.kind != "f":
        return float(abs(int(a) - int(b)))
    kind = min(np.asarray(a).dtype, np.asarray(b).dtype, key=lambda d: d.itemsize)
    if not np.isfinite(a) or not np.isfinite(b):
        return np.inf
    with np.errstate(over="ignore"):
        return float(abs(_rank(kind.type(a)) - _rank(kind.type(b))))


def _rank(x: Any) -> int:
    """The place of a number among all of its type; both zeros have the same."""
    bits = np.asarray(x)
    whole = int(bits.view(f"i{bits.dtype.itemsize}"))
    return whole if whole >= 0 else -(whole & ((1 << (8 * bits.dtype.itemsize - 1)) - 1))
