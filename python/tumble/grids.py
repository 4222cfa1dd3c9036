"""Grid objects in a run: position of the grid, kinds of columns, and derived columns.

Columns lie on the cells, in arrays of the shape (nx, ny, nz) or (nx, ny, nz, width), without the flat axis in a plane;
`velocity_x` and so on lie on the faces of their axis. Everything here is given with three axes: a plane is one cell thick.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.bundled import unknown
from tumble.columns import FACES
from tumble.columns import unit as described

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Table = Mapping[str, Array]

FOLLOWS = {"speed": "m/s", "residual": "1/s"}
"""What pictures make of columns, with units."""


def unit(name: str) -> str:
    """The unit of a column, or of what follows from one."""
    return FOLLOWS.get(name) or described(name)


@dataclass(frozen=True)
class Box:
    """A box of cubic cells."""

    cells: tuple[int, int, int]
    """Along x, y and z; 1 across a plane."""
    spacing: float
    """Side of a cell [m]."""
    origin: Floats
    """Lowest corner [m]."""
    flat: int
    """The axis across a plane; 3 in space."""

    @property
    def axes(self) -> tuple[int, ...]:
        """The axes that are not flat."""
        return tuple(a for a in range(3) if a != self.flat)

    @property
    def size(self) -> Floats:
        """Lengths of the sides [m]."""
        return self.spacing * np.array(self.cells)

    @property
    def corners(self) -> Floats:
        """The eight corners [m]; those of a plane lie in its middle."""
        low, high = self.origin.copy(), self.origin + self.size
        if self.flat < 3:
            low[self.flat] = high[self.flat] = 0.5 * (low + high)[self.flat]
        return np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)

    def points(self, axis: int) -> Floats:
        """Positions of the cell centres along an axis [m]."""
        return np.asarray(self.origin[axis] + self.spacing * (np.arange(self.cells[axis]) + 0.5), dtype=float)

    def holds(self, array: Array) -> bool:
        """Whether an array lies on the cells."""
        return array.shape[: len(self.axes)] == tuple(self.cells[a] for a in self.axes)

    def scalar(self, array: Array) -> Array:
        """One number a cell, with three axes."""
        return np.expand_dims(array, self.flat) if self.flat < 3 else array

    def vector(self, array: Array) -> Array:
        """Three numbers a cell, with three axes; nothing points out of a plane."""
        if self.flat == 3:
            return array
        out = np.zeros((*self.cells, 3), dtype=array.dtype)
        out[..., list(self.axes)] = np.expand_dims(array, self.flat)
        return out


def box(static: Table) -> Box | None:
    """The grid of an object that lies on one, from what does not change of it."""
    if "grid_cells" not in static:
        return None
    flat = int(np.ravel(static["grid_flat"])[0])
    axes = [a for a in range(3) if a != flat]
    cells = [1, 1, 1]
    for axis, n in zip(axes, np.ravel(static["grid_cells"]).tolist(), strict=True):
        cells[axis] = int(n)
    spacing = float(np.ravel(static["grid_spacing"])[0])
    origin = np.array(np.ravel(static["grid_origin"]), dtype=float)
    return Box((cells[0], cells[1], cells[2]), spacing, origin, flat)


def columns(grid: Box, table: Table) -> Iterator[tuple[str, Array]]:
    """The columns on cells, with three axes: scalars, and vectors of three."""
    rank = len(grid.axes)
    for name, array in table.items():
        if name in FACES or not grid.holds(array):
            continue
        if array.ndim == rank:
            yield name, grid.scalar(array)
        elif array.ndim == rank + 1 and array.shape[-1] in (rank, 3):
            yield name, grid.vector(array) if array.shape[-1] == rank else np.expand_dims(array, grid.flat)


def faces(grid: Box, table: Table) -> Array | None:
    """Velocities on the lower faces of cells, one cell more than there are along each axis; if the run kept them."""
    names = [FACES[a] for a in grid.axes]
    if any(name not in table for name in names):
        return None
    points = [n if a == grid.flat else n + 1 for a, n in enumerate(grid.cells)]
    out = np.zeros((*points, 3), dtype=np.float32)
    for axis, name in zip(grid.axes, names, strict=True):
        own = grid.scalar(table[name])
        i, j, k = own.shape
        out[:i, :j, :k, axis] = own
    return out


def shown(grid: Box, table: Table, name: str) -> Array:
    """A column on cells, or what follows from the velocity: `speed`, `vorticity`. Raises ExportError."""
    known = dict(columns(grid, table))
    if name in known:
        return known[name]
    if name in ("speed", "vorticity") and "velocity" in known:
        return np.asarray(_speed(known["velocity"]) if name == "speed" else _curl(grid, known["velocity"]))
    follows = ["speed", "vorticity"] if "velocity" in known else []
    there = dict.fromkeys([*known, *follows])
    raise ExportError(f"{unknown('column on the grid', name, there)} (see output.columns of the scene)")


def _speed(velocity: Array) -> Floats:
    return np.asarray(np.linalg.norm(velocity.astype(float), axis=-1))


def _curl(grid: Box, velocity: Array) -> Floats:
    """Central differences, one-sided at the walls: in a plane the component across it, in space all three."""
    v = velocity.astype(float)

    def slope(component: int, axis: int) -> Floats:
        if grid.cells[axis] < 2:
            return np.zeros(v.shape[:3])
        return np.asarray(np.gradient(v[..., component], grid.spacing, axis=axis))

    parts = [slope((a + 2) % 3, (a + 1) % 3) - slope((a + 1) % 3, (a + 2) % 3) for a in range(3)]
    return parts[grid.flat] if grid.flat < 3 else np.stack(parts, axis=-1)
