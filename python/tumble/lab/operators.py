"""Each grid operator on a known field, and the checkerboard that a grid without staggering leaves."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from tumble.fields import Field, Grid, average, curl, directional, divergence, gradient, laplacian
from tumble.lab.exact import Floats
from tumble.lab.page import Section, write
from tumble.style import INK, PALETTE

Extent = tuple[float, float, float, float]
"""Left, right, bottom, top [m]."""

SIZES = (12, 24, 48, 96)
"""Cells along a side of the square of 1 m."""

SHOWN = 24
"""Cells of the grid that is drawn."""

X, Y = 2 * np.pi, 4.0
"""Wave numbers of the field [1/m]."""


def _f(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.sin(X * x) * np.cos(Y * y))


def _fx(x: Floats, y: Floats) -> Floats:
    return np.asarray(X * np.cos(X * x) * np.cos(Y * y))


def _fy(x: Floats, y: Floats) -> Floats:
    return np.asarray(-Y * np.sin(X * x) * np.sin(Y * y))


def _u(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.sin(3 * x + 1) * np.sin(5 * y))


def _v(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.cos(4 * x) * np.cos(2 * y - 1))


@dataclass
class Shown:
    """An operator on a grid: its result and what calculus says there."""

    name: str
    meaning: str
    field: Field
    exact: Callable[[Floats, Floats], Floats]

    @property
    def error(self) -> float:
        """Root mean square over the inner half of the square, relative to that of the exact field."""
        x, y = self.field.grid.points(self.field.place)
        inside = (np.abs(x - 0.5) < 0.3) & (np.abs(y - 0.5) < 0.3)
        exact = self.exact(x, y)
        return float(np.sqrt(np.mean((self.field.array - exact)[inside] ** 2) / np.mean(exact[inside] ** 2)))


def fields(n: int) -> tuple[Field, tuple[Field, Field]]:
    """The field and the flow that are differentiated, on n x n cells of a square of 1 m."""
    grid = Grid((n, n), 1 / n)
    return grid.field(_f, "cell"), (grid.field(_u, "face x"), grid.field(_v, "face y"))


def shown(n: int) -> list[Shown]:
    """Every operator on n x n cells."""
    f, u = fields(n)
    slope = gradient(f)
    turn: Field = curl(u)
    return [
        Shown("gradient, x", "cell → face x", slope[0], _fx),
        Shown("gradient, y", "cell → face y", slope[1], _fy),
        Shown(
            "divergence",
            "faces → cell",
            divergence(u),
            lambda x, y: 3 * np.cos(3 * x + 1) * np.sin(5 * y) - 2 * np.cos(4 * x) * np.sin(2 * y - 1),
        ),
        Shown(
            "curl",
            "faces → node",
            turn,
            lambda x, y: -4 * np.sin(4 * x) * np.cos(2 * y - 1) - 5 * np.sin(3 * x + 1) * np.cos(5 * y),
        ),
        Shown("Laplacian", "cell → cell", laplacian(f), lambda x, y: -(X**2 + Y**2) * _f(x, y)),
        Shown(
            "directional derivative",
            "faces, cell → cell",
            directional(u, f),
            lambda x, y: _u(x, y) * _fx(x, y) + _v(x, y) * _fy(x, y),
        ),
    ]


@dataclass
class Boards:
    """A pressure that alternates from cell to cell, and what both kinds of grid make of it."""

    pressure: Floats
    collocated: Floats
    """Size of the gradient by differences over two cells [Pa/m]."""
    staggered: Floats
    """Size of the gradient on faces, averaged to cells as a size [Pa/m]."""
    solved: dict[str, Floats]
    """The pressure of a source and a sink of one cell each, by both Laplacians."""

    @property
    def checkers(self) -> dict[str, float]:
        """How much of the solved pressures alternates from cell to cell along x, y or both, of their root mean square."""
        found = {}
        for name, p in self.solved.items():
            modes = np.abs(np.fft.fft2(p)) ** 2
            half = p.shape[0] // 2
            fast = np.minimum(np.arange(2 * half), 2 * half - np.arange(2 * half)) > half / 2
            board = modes[fast][:, ~fast].sum() + modes[~fast][:, fast].sum() + modes[fast][:, fast].sum()
            found[name] = float(np.sqrt(board / modes.sum()))
        return found


def boards(n: int = 24) -> Boards:
    """On a periodic square."""
    grid = Grid((n, n), 1 / n, periodic="xy")
    smooth = grid.field(lambda x, y: np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)).array
    i, j = np.indices((n, n))
    p = grid.field(smooth + 0.4 * (1 - 2 * ((i + j) % 2)))
    ones, none = grid.field(1.0, "face x"), grid.field(0.0, "face x")
    one_y, none_y = grid.field(1.0, "face y"), grid.field(0.0, "face y")
    central = [directional((ones, none_y), p), directional((none, one_y), p)]
    sizes = [average(grid.field(np.abs(s.array), s.place), "cell").array for s in gradient(p)]
    source = np.zeros((n, n))
    source[n // 4, n // 2], source[3 * n // 4, n // 2] = 1.0, -1.0
    # The Laplacians on a wave: div grad of the staggered grid, and twice the difference over two cells.
    k = np.pi * np.fft.fftfreq(n)
    compact = -((2 * n * np.sin(k)) ** 2)
    wide = -((n * np.sin(2 * k)) ** 2)
    solved = {}
    for name, one in (("staggered", compact), ("collocated", wide)):
        symbol = one[:, None] + one[None]
        seen = np.abs(symbol) > 1e-9 * np.abs(symbol).max()
        # The null space of the operator is removed: the smallest sufficient pressure.
        inverse = np.where(seen, 1 / np.where(seen, symbol, 1.0), 0.0)
        solved[name] = np.fft.ifft2(np.fft.fft2(source) * inverse).real
    return Boards(p.array, np.hypot(*(c.array for c in central)), np.hypot(*sizes), solved)


def page(folder: Path) -> Path:
    """Writes operators.html, .png and .csv and returns the first."""
    errors = {n: [s.error for s in shown(n)] for n in SIZES}
    board = boards()
    orders = np.log2(np.array(errors[SIZES[-2]]) / np.array(errors[SIZES[-1]]))
    checkers = board.checkers
    sections = [
        Section(
            "Each operator on a known field",
            f"<p>Above, f = sin(2π x) cos(4 y), its slope, and a flow (u, v), on {SHOWN} × {SHOWN} cells of a square of 1 m, "
            "the frame; below, what the operators make of them. All images lie in the same square: values on faces and nodes "
            "stand half a cell beside those in cells, and reach beyond the frame by as much. The gradient is large where f "
            "changes fast, and red where f rises along the axis; the divergence is red where arrows part, the curl where "
            "they turn to the left. On closed walls the gradient across them is 0 by rule, whatever f is: pale rows at the "
            "rim, and dark ones of the Laplacian.</p>",
            partial(_operators, all_shown=shown(SHOWN)),
            11.4,
            "A field, a flow, and the results of six operators",
        ),
        Section(
            "Errors",
            "<p>Root mean square away from walls, relative to the field. All fall with the square of the spacing.</p>",
            partial(_errors, errors=errors),
            3.6,
            "Errors over spacing",
        ),
        Section(
            "The checkerboard",
            "<p>A pressure that alternates from cell to cell has a large gradient on faces. Differences over two cells, all "
            "that a grid with pressure and velocity at the same points has, see only its smooth part. So they cannot take "
            "the checkerboard away, and where they are to find the pressure of a source and a sink, every second cell knows "
            "nothing of its neighbours.</p>",
            partial(_boards, board=board),
            7.4,
            "Checkerboards",
        ),
    ]
    points = [
        "Orders measured: " + ", ".join(f"{s.name} {o:.2f}" for s, o in zip(shown(SHOWN), orders, strict=True)) + ".",
        "Of the pressure of a source and a sink, waves shorter than four cells hold "
        f"{100 * checkers['staggered']:.0f} % on a staggered grid, {100 * checkers['collocated']:.0f} % on a collocated one.",
    ]
    return write(
        folder,
        "operators",
        "Operators on a staggered grid",
        "What gradient, divergence, curl and Laplacian are on a grid, and why velocities stand on faces.",
        points,
        sections,
        ["Equations: docs/theory/grids.md."],
        _rows(errors),
    )


def _rows(errors: dict[int, list[float]]) -> Iterator[dict[str, Any]]:
    for n, of_all in errors.items():
        for one, error in zip(shown(SIZES[0]), of_all, strict=True):
            yield {"operator": one.name, "cells": n, "relative_error": error}


def _image(
    figure: FigureBase, at: Any, values: Floats, title: str, signed: bool = True, extent: Extent | None = None
) -> Axes:
    """An image; `extent` is where it lies [m]: left, right, bottom, top."""
    axes = figure.add_subplot(at)
    top = float(np.abs(values).max())
    low, colours = (-top, "RdBu_r") if signed else (0.0, "Blues")
    image = axes.imshow(
        values.T, origin="lower", interpolation="nearest", vmin=low, vmax=top, cmap=colours, extent=extent
    )
    axes.set_title(title)
    axes.grid(False)
    axes.set_xticks([])
    axes.set_yticks([])
    figure.colorbar(image, ax=axes, shrink=0.85)
    return axes


def around(field: Field) -> Extent:
    """Where the image of a field lies [m]: each value in the middle of its pixel, so that images of all places agree."""
    half = field.grid.spacing / 2
    x, y = field.grid.points(field.place)
    return float(x.min() - half), float(x.max() + half), float(y.min() - half), float(y.max() + half)


def _placed(figure: FigureBase, at: Any, field: Field, title: str) -> Axes:
    """An image in the square of 1 m, a pixel beyond which may show what lies on its rim."""
    axes = _image(figure, at, field.array, title, extent=around(field))
    rim = field.grid.spacing
    axes.set_xlim(-rim, 1 + rim)
    axes.set_ylim(-rim, 1 + rim)
    axes.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color=INK, lw=0.8)
    return axes


def _arrows(axes: Axes, vectors: tuple[Field, ...], every: int = 2) -> None:
    """Vectors on faces as arrows in the middle of cells."""
    u, v = (average(part, "cell") for part in vectors)
    x, y = u.grid.points("cell")
    cut = (slice(every // 2, None, every),) * 2
    axes.quiver(x[cut], y[cut], u.array[cut], v.array[cut], color=INK, angles="xy", width=0.006, pivot="mid")


def _operators(figure: FigureBase, all_shown: list[Shown]) -> None:
    f, u = fields(SHOWN)
    places = figure.add_gridspec(3, 3)
    _placed(figure, places[0, 0], f, "the field f")
    axes = _placed(figure, places[0, 1], f, "f, and its gradient as arrows")
    _arrows(axes, gradient(f))
    speed = f.grid.field(np.hypot(*(average(part, "cell").array for part in u)), "cell")
    axes = _image(
        figure, places[0, 2], speed.array, "the flow: arrows, and its speed", signed=False, extent=around(speed)
    )
    axes.set_xlim(-f.grid.spacing, 1 + f.grid.spacing)
    axes.set_ylim(-f.grid.spacing, 1 + f.grid.spacing)
    axes.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color=INK, lw=0.8)
    _arrows(axes, u)
    for i, one in enumerate(all_shown):
        _placed(figure, places[1 + i // 3, i % 3], one.field, f"{one.name}   ({one.meaning})")


def _errors(figure: FigureBase, errors: dict[int, list[float]]) -> None:
    axes = figure.add_subplot()
    spacing = [1 / n for n in errors]
    marks = "osv^D*"
    for i, one in enumerate(shown(SIZES[0])):
        axes.loglog(spacing, [e[i] for e in errors.values()], marker=marks[i], color=PALETTE[i], label=one.name)
    first = 0.3 * min(errors[SIZES[0]])
    axes.loglog(
        spacing, [first * (s / spacing[0]) ** 2 for s in spacing], "--", color=INK, linewidth=1.0, label="order 2"
    )
    axes.set_xlabel("spacing [m]")
    axes.set_ylabel("relative error")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def _boards(figure: FigureBase, board: Boards) -> None:
    places = figure.add_gridspec(2, 3)
    _image(figure, places[0, 0], board.pressure, "a smooth pressure and a checkerboard")
    _image(figure, places[0, 1], board.staggered, "its gradient on faces, size", signed=False)
    _image(figure, places[0, 2], board.collocated, "its gradient over two cells, size", signed=False)
    _image(figure, places[1, 0], board.solved["staggered"], "source and sink: staggered pressure")
    _image(figure, places[1, 1], board.solved["collocated"], "source and sink: collocated pressure")
    axes = figure.add_subplot(places[1, 2])
    for ink, (name, p) in zip(PALETTE, board.solved.items(), strict=False):
        axes.plot(p[:, p.shape[1] // 2], marker=".", color=ink, label=name)
    axes.set_title("along the row of source and sink")
    axes.set_xlabel("cell")
    axes.legend()
