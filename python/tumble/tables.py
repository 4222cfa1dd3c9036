"""Columns of runs over all frames: as arrays that are read when they are looked at, for xarray and for pandas."""

from collections.abc import Iterable, Iterator, Mapping
from types import ModuleType
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.bundled import unknown
from tumble.columns import COLUMNS
from tumble.folder import LEDGER
from tumble.measures import OF_COLUMN

Array = npt.NDArray[Any]

_EXTRA = "pip install 'tumble[tables]'"
_AXES = "xyzw"


class Stored(Protocol):
    """What is read of a run."""

    @property
    def scene(self) -> Mapping[str, Any]:
        """The resolved scene."""

    @property
    def columns(self) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
        """Object -> column -> unit, shape, dtype, in."""

    @property
    def n_frames(self) -> int:
        """Frames there are."""

    @property
    def ledger(self) -> Mapping[str, Array]:
        """Books, one number a frame."""

    def frame(self, i: int) -> Mapping[str, Mapping[str, Array]]:
        """Columns of a frame."""

    def time(self, i: int) -> float:
        """Time of a frame [s]."""


class Stack:
    """A column over all frames, shape (frames, ...), which reads a frame when it is indexed: `stack[10, :, 2]`, `stack[::5]`,
    `for x in stack`, `np.asarray(stack)`. Raises ExportError where a frame cannot be read, or has other elements than the first
    one."""

    def __init__(self, run: Stored, thing: str, column: str) -> None:
        self._run, self.object, self.column = run, thing, column
        first = run.frame(0)[thing][column]
        self.unit = str(run.columns[thing][column]["unit"])
        """SI unit, "1" for a pure number."""
        self.shape: tuple[int, ...] = (run.n_frames, *first.shape)
        self.dtype = first.dtype

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[Array]:
        return (self._at(i) for i in range(len(self)))

    def __getitem__(self, index: Any) -> Any:
        whole = index if isinstance(index, tuple) else (index,)
        if whole and whole[0] is Ellipsis:
            whole = (slice(None),) * (self.ndim - len(whole) + 1) + whole[1:]
        head, rest = (whole[0], whole[1:]) if whole else (slice(None), ())
        frames = np.arange(len(self))[head]
        if np.ndim(frames) == 0:
            return self._at(int(frames))[rest]
        parts = [self._at(int(i))[rest] for i in frames]
        return np.stack(parts) if parts else np.empty((0, *self._at(0)[rest].shape), self.dtype)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        if copy is False:
            raise ValueError("a stack is read from files, which takes a copy")
        return np.asarray(self[:], dtype)

    def __repr__(self) -> str:
        return f"Stack({self.object}.{self.column} [{self.unit}], {self.dtype} {self.shape})"

    def _at(self, i: int) -> Array:
        found = self._run.frame(i)[self.object][self.column]
        if found.shape != self.shape[1:]:
            text = f"frame {i} has {len(found)} elements and frame 0 {self.shape[1]}"
            raise ExportError(f"{self.object}.{self.column}: {text}; read it frame by frame, or with to_pandas")
        return found


def stack(run: Stored, thing: str, column: str) -> Stack:
    """A column of an object over all frames. Raises ExportError for a name that is not there, and for particles that come and
    go."""
    _known(run, thing, [column])
    if "id" in run.columns[thing]:
        raise ExportError(f"{thing}: its particles come and go, so that no two frames have the same; use to_pandas")
    if _made_anew(run, thing):
        raise ExportError(f"{thing}: it is another mesh in each frame; read it frame by frame, or with to_pandas")
    return Stack(run, thing, column)


def to_pandas(run: Stored, thing: str | None = None, columns: Iterable[str] | None = None) -> Any:
    """A pandas.DataFrame of the ledger, a row for each frame; or of an object, a row for each frame and element (of particles
    that come and go: id), a column for each number: position_x. Without `columns`, of an object all that belong to the same
    elements as the first. Units are in `attrs["units"]`. Raises ExportError."""
    pandas = library("pandas", "to_pandas")
    times = np.array([run.time(i) for i in range(run.n_frames)])
    if thing is None:
        known = [name for name in LEDGER[:-1] if name not in ("frame", "time")]
        wanted = known if columns is None else list(columns)
        for name in wanted:
            if name not in known:
                raise ExportError(unknown("column", name, known))
        index = pandas.MultiIndex.from_arrays([np.arange(run.n_frames), times], names=["frame", "time"])
        table = pandas.DataFrame({name: run.ledger[name] for name in wanted}, index=index)
        table.attrs["units"] = {name: _unit_of_books(name) for name in wanted}
        return table
    known = _in_frames(run, thing)
    wanted = [name for name in known if name != "id"] if columns is None else list(columns)
    _known(run, thing, wanted)
    if columns is None:
        # Those of one kind of element: links have rows of their own.
        shapes = {name: run.columns[thing][name]["shape"][: _rank(run, thing, name)] for name in wanted}
        wanted = [name for name in wanted if shapes[name] == shapes[wanted[0]]]
    born = "id" in known
    parts, units = [], {}
    for i in range(run.n_frames):
        found = run.frame(i)[thing]
        flat: dict[str, Array] = {}
        for name in wanted:
            array = found[name]
            rows = array.reshape(-1, *array.shape[_rank(run, thing, name) :])
            for label, values in _numbers(name, rows):
                flat[label], units[label] = values, str(run.columns[thing][name]["unit"])
        if len({len(values) for values in flat.values()}) > 1:
            counts = ", ".join(f"{name} {len(found[name])}" for name in wanted)
            raise ExportError(
                f"{thing}: its columns belong to different things ({counts}); choose some with columns=[...]"
            )
        n = len(next(iter(flat.values()), ()))
        who = found["id"] if born else np.arange(n)
        index = pandas.MultiIndex.from_arrays(
            [np.full(n, i), np.full(n, times[i]), who], names=["frame", "time", "element"]
        )
        parts.append(pandas.DataFrame(flat, index=index))
    table = pandas.concat(parts) if parts else pandas.DataFrame()
    if born:
        table.index = table.index.rename({"element": "id"})
    table.attrs["units"] = units
    return table


def to_xarray(run: Stored, things: Iterable[str] | None = None, columns: Iterable[str] | None = None) -> Any:
    """An xarray.Dataset of the ledger (`energy`) and of the columns of objects (`rope.position`) over time, all of those named
    or all but surfaces of liquids (other meshes in each frame), with units and meanings in `attrs`. Particles that come and go
    have a coordinate `NAME.id`, and nan in frames in which they do not live. Raises ExportError."""
    xarray = library("xarray", "to_xarray")
    there = {name: _in_frames(run, name) for name in run.columns if _in_frames(run, name)}
    wanted = [name for name in there if not _made_anew(run, name)] if things is None else list(things)
    for name in wanted:
        if name not in there:
            raise ExportError(unknown("object", name, there))
        if _made_anew(run, name):
            raise ExportError(f"{name}: it is another mesh in each frame; read it frame by frame, or with to_pandas")
    chosen = None if columns is None else list(columns)
    for name in chosen or ():
        if not any(name in there[thing] for thing in wanted):
            raise ExportError(unknown("column", name, dict.fromkeys(c for thing in wanted for c in there[thing])))
    coordinates: dict[str, Any] = {"time": ("time", [run.time(i) for i in range(run.n_frames)], {"units": "s"})}
    sizes: dict[str, int] = {"time": run.n_frames}
    variables: dict[str, Any] = {}
    for name in LEDGER[:-1]:
        if name not in ("frame", "time"):
            about = {"units": _unit_of_books(name)}
            if name in OF_COLUMN:
                about["long_name"] = OF_COLUMN[name].doc
            variables[name] = ("time", run.ledger[name], about)
    for thing in wanted:
        ids = None
        if "id" in there[thing]:
            ids = np.unique(np.concatenate([run.frame(i)[thing]["id"] for i in range(run.n_frames)]))
            coordinates[f"{thing}.id"] = (f"{thing}.id", ids)
        for column in there[thing]:
            if column == "id" or (chosen is not None and column not in chosen):
                continue
            values = np.asarray(Stack(run, thing, column)) if ids is None else _by_id(run, thing, column, ids)
            names = ["time", *_dimensions(run, thing, column, values.shape[1:], ids is not None, sizes)]
            about = {"units": str(run.columns[thing][column]["unit"])}
            if column in COLUMNS:
                about["long_name"] = COLUMNS[column].doc
            variables[f"{thing}.{column}"] = (names, values, about)
    for name, size in sizes.items():
        if name.startswith("axis") and size <= len(_AXES):
            coordinates[name] = (name, list(_AXES[:size]))
    return xarray.Dataset(variables, coordinates, {"title": str(run.scene.get("title") or "")})


def library(name: str, what: str) -> ModuleType:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        raise ExportError(f"{what} needs {name}: {_EXTRA}") from None


def _made_anew(run: Stored, thing: str) -> bool:
    """Whether an object has other elements in each frame, without numbers that they keep: the surface of a liquid."""
    return "id" not in run.columns[thing] and any(
        about["in"] == "frames" and list(about["shape"][:1]) == [None] for about in run.columns[thing].values()
    )


def _in_frames(run: Stored, thing: str) -> list[str]:
    return [name for name, about in run.columns.get(thing, {}).items() if about["in"] == "frames"]


def _known(run: Stored, thing: str, columns: Iterable[str]) -> None:
    """Refuses names that are not there."""
    if not (known := _in_frames(run, thing)):
        raise ExportError(unknown("object", thing, [name for name in run.columns if _in_frames(run, name)]))
    for column in columns:
        if column not in known:
            raise ExportError(unknown(f'column of "{thing}"', column, known))


def _unit_of_books(column: str) -> str:
    return "s" if column == "seconds" else OF_COLUMN[column].unit if column in OF_COLUMN else "1"


def _on_grid(run: Stored, thing: str) -> bool:
    return "grid_cells" in run.columns[thing]


def _rank(run: Stored, thing: str, column: str) -> int:
    """How many axes of a column count elements."""
    if not _on_grid(run, thing):
        return 1
    plane = run.scene.get("dimension") == 2
    return 2 if plane else 3


def _numbers(name: str, rows: Array) -> Iterator[tuple[str, Array]]:
    """The numbers of a column, one array for each component."""
    if rows.ndim == 1:
        yield name, rows
        return
    flat = rows.reshape(len(rows), int(np.prod(rows.shape[1:])))
    for k in range(flat.shape[1]):
        yield f"{name}_{_AXES[k] if flat.shape[1] <= len(_AXES) else k}", flat[:, k]


def _by_id(run: Stored, thing: str, column: str, ids: Array) -> Array:
    """A column with a row for each particle that ever lives."""
    about = run.columns[thing][column]
    values = np.full((run.n_frames, len(ids), *about["shape"][1:]), np.nan, np.result_type(about["dtype"], np.float32))
    for i in range(run.n_frames):
        found = run.frame(i)[thing]
        values[i, np.searchsorted(ids, found["id"])] = found[column]
    return values


def _dimensions(
    run: Stored, thing: str, column: str, shape: tuple[int, ...], born: bool, sizes: dict[str, int]
) -> Iterator[str]:
    """Names of the axes of a column but for time; axes of one name are of one length."""
    rank = _rank(run, thing, column)
    places = COLUMNS[column].places if column in COLUMNS else ("mass",)
    place = "mass" if "mass" in places and shape[0] > 1 else places[0]
    for k, size in enumerate(shape):
        if k >= rank:
            name = "axis" if size == 3 else f"axis_{size}"
        elif born:
            name = f"{thing}.id"
        else:
            name = f"{thing}.{_AXES[k]}" if rank > 1 else f"{thing}.{place}"
        if sizes.setdefault(name, size) != size:
            name = f"{thing}.{column}.{k}"
            sizes[name] = size
        yield name
