"""Slices of grids: one picture for each column, with its colours and its unit.

>>> import tumble
>>> run = tumble.simulate(tumble.Scene.load("finned_plate"), "out/plate", frames=2)
>>> tumble.slices.slices(run, "slice.png").name          # everything that the last frame has
'slice.png'
>>> tumble.slices.slices(run, "start.png", ["temperature"], frame=0).name
'start.png'
"""

import os
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble import grids
from tumble._engine import ExportError
from tumble.arguments import whole
from tumble.bundled import unknown
from tumble.columns import SIGNED
from tumble.grids import Box, Floats
from tumble.looks import MAPS
from tumble.pictures.things import Recording
from tumble.plots import figure_title, save, settings
from tumble.style import FAINT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = ("density", "temperature", "fuel", "speed", "pressure", "vorticity", "divergence")
"""Default columns, as far as the frame has them; then all others."""

AXES = "xyz"

WIDTH = 3.4
"""Width of a picture [inch]; the height follows from the box."""


def slices(
    run: Recording,
    path: str | os.PathLike[str],
    columns: Sequence[str] = (),
    frame: int = -1,
    axis: str = "y",
    at: float | None = None,
    thing: str | None = None,
) -> Path:
    """Draws columns of an object on a grid in the plane across an axis at a place [m], the middle if not given; those of
    a plane scene lie in one already. `speed` and `vorticity` follow from `velocity`; of the vorticity in space the part
    across the plane is drawn, of other vectors the length. Between cells, values are blended. Raises ExportError."""
    if not -run.n_frames <= whole(frame, "frame", error=ExportError) < run.n_frames:
        raise ExportError(f"there is no frame {frame}; there are frames 0 to {run.n_frames - 1}")
    frame %= run.n_frames
    name, grid = _object(run, thing)
    if grid.flat == 3 and axis not in AXES:
        raise ExportError(unknown("axis", axis, AXES))
    across = AXES.index(axis) if grid.flat == 3 else grid.flat
    place, where = _place(grid, across, at)
    table = run.frame(frame).get(name, {})
    wanted = list(columns) or _all(grid, table)
    if not wanted:
        raise ExportError(f'frame {frame} has nothing on the grid of "{name}": see output.columns of the scene')
    cuts = [(column, cut(grid, grids.shown(grid, table, column), column, across, place)) for column in wanted]
    with settings():
        from matplotlib.figure import Figure

        a, b = (k for k in range(3) if k != across)
        tall = float(np.clip(grid.size[b] / grid.size[a], 0.2, 3.0))
        n_columns = min(len(cuts), 3 if tall > 0.8 else 2)
        n_rows = -(-len(cuts) // n_columns)
        size = (WIDTH * n_columns + 0.4, (tall * (WIDTH - 1.1) + 0.75) * n_rows + 0.5)
        figure = Figure(figsize=size, layout="compressed")
        all_axes = figure.subplots(n_rows, n_columns, squeeze=False)
        for (row, k), ax in zip(product(range(n_rows), range(n_columns)), all_axes.ravel(), strict=True):
            if row * n_columns + k < len(cuts):
                _draw(figure, ax, grid, (a, b), *cuts[row * n_columns + k])
            else:
                ax.set_axis_off()
        plane = f", {AXES[across]} = {where:.3g} m" if grid.flat == 3 else ""
        figure.suptitle(figure_title(run, f"{name} at {run.time(frame):.3g} s{plane}"), x=0.01, ha="left", wrap=True)
        return save(figure, path, bbox_inches="tight")


def cut(grid: Box, values: Any, name: str, across: int, place: float) -> Floats:
    """Values in the plane across an axis, `place` cells above the middle of the first; one number for each point."""
    n = grid.cells[across]
    low = min(int(place), max(n - 2, 0))
    part = place - low
    layers = np.moveaxis(np.asarray(values, dtype=float), across, 0)
    layer = layers[low] if part == 0.0 else (1 - part) * layers[low] + part * layers[low + 1]
    if layer.ndim == 3:
        layer = layer[..., across] if name == "vorticity" else np.linalg.norm(layer, axis=-1)
    return np.asarray(layer)


def _object(run: Recording, thing: str | None) -> tuple[str, Box]:
    found = {name: grid for name, table in run.static.items() if (grid := grids.box(table)) is not None}
    if not found:
        raise ExportError("the run has nothing on a grid to cut through")
    name = next(iter(found)) if thing is None else thing
    if name not in found:
        raise ExportError(unknown("object on a grid", name, found))
    return name, found[name]


def _place(grid: Box, across: int, at: float | None) -> tuple[float, float]:
    """Position of the plane, in cells above the centre of the first one, and in metres."""
    low, high = float(grid.origin[across]), float(grid.origin[across] + grid.size[across])
    if grid.flat < 3 or at is None:
        at = round(0.5 * (low + high) / grid.spacing, 3) * grid.spacing
    if not low <= at <= high:
        raise ExportError(f"at: {at:g} m, expected {low:g} to {high:g} m, the sides of the box along {AXES[across]}")
    return float(np.clip((at - low) / grid.spacing - 0.5, 0.0, grid.cells[across] - 1)), at


def _all(grid: Box, table: grids.Table) -> list[str]:
    known = [name for name, _ in grids.columns(grid, table)]
    if "velocity" in known:
        known = [*(name for name in known if name != "velocity"), "speed", "vorticity"]
    known = list(dict.fromkeys(known))
    return [name for name in ORDER if name in known] + [name for name in known if name not in ORDER]


def _draw(figure: Any, ax: "Axes", grid: Box, axes: tuple[int, int], name: str, values: Floats) -> None:
    import matplotlib

    a, b = axes
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if name in SIGNED:
        # A few cells beside walls are far off the rest; equal colours on both sides of zero.
        high = float(np.quantile(np.abs(finite), 0.998)) if finite.size else 1.0
        high = high or max(float(np.abs(finite).max(initial=0.0)), 1e-30)
        low = -high
    elif name in ("density", "fuel", "speed"):
        low = min(low, 0.0)
    if not high > low:
        high = low + max(abs(low) * 1e-6, 1e-30)
    ends = [(float(grid.origin[k]), float(grid.origin[k] + grid.size[k])) for k in axes]
    colors = matplotlib.colormaps[MAPS.get(name, "viridis")].with_extremes(bad=FAINT)
    image = ax.imshow(
        values.T, origin="lower", extent=(*ends[0], *ends[1]), cmap=colors, vmin=low, vmax=high, interpolation="nearest"
    )
    ax.grid(False)
    ax.set_xlabel(f"{AXES[a]} [m]")
    ax.set_ylabel(f"{AXES[b]} [m]")
    bar = figure.colorbar(image, ax=ax, fraction=0.06, pad=0.03, aspect=18 * float(grid.size[b] / grid.size[a]))
    bar.outline.set_visible(False)
    bar.set_label(f"{name.replace('_', ' ')} [{grids.unit(name)}]")
