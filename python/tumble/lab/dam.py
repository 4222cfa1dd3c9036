"""The same dam break by every method for liquids: who carries the liquid, a grid or particles, and what that costs."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from tumble._engine import World
from tumble.lab.exact import Floats
from tumble.lab.page import Section, table, write
from tumble.style import INK, PALETTE

LENGTH, HEIGHT = 4.0, 3.0
"""Of the tank [m]."""
COLUMN = (1.0, 2.0)
"""Width and height of the water [m]."""
ACROSS = 4
"""Cells across the tank: liquids of particles need three dimensions."""
GRAVITY = 9.81
FPS = 50
SECONDS = 1.2
SHOWN = (0.3, 0.6, 0.9, 1.2)
"""Times of the pictures [s]."""
LATE = 0.1 / np.sqrt(2 * GRAVITY / COLUMN[0])
"""A gate takes this time to open [s]."""
CELLS = 64
"""Along the tank."""

MEASURED = np.array(
    [
        (0.0920, 1.128),
        (0.1907, 1.244),
        (0.2663, 1.464),
        (0.3221, 1.695),
        (0.3681, 1.903),
        (0.4140, 2.123),
        (0.4466, 2.365),
        (0.4958, 2.584),
        (0.5219, 2.804),
        (0.5646, 3.034),
        (0.5940, 3.219),
        (0.6366, 3.462),
        (0.6693, 3.704),
    ]
)
"""Time [s] and front [m] of Koshizuka and Oka's experiment (1996), scaled to this column."""


@dataclass(frozen=True)
class Method:
    """A method, and what it makes of the tank."""

    title: str
    who: str
    """What carries the liquid, and what finds the pressure."""
    scene: Callable[[int], dict[str, Any]]
    """The scene, by cells along the tank."""


@dataclass
class Course:
    """What came of a method."""

    method: Method
    times: list[float] = field(default_factory=list)
    fronts: list[float] = field(default_factory=list)
    """[m]"""
    heights: list[float] = field(default_factory=list)
    """Of the water at the wall behind it [m]."""
    energies: list[float] = field(default_factory=list)
    """Kinetic and potential, over that of the start."""
    volumes: list[float] = field(default_factory=list)
    """Over that of the start; empty where the method does not measure it."""
    pictures: list[tuple[Floats, Floats]] = field(default_factory=list)
    """Places [m] and speeds [m/s] at SHOWN."""
    cost: float = 0.0
    """Seconds that a simulated second took."""
    particles: int = 0


def _world(system: dict[str, Any], **things: Any) -> dict[str, Any]:
    return {
        "version": 1,
        "world": {"gravity": [0, 0, -GRAVITY]},
        "time": {"fps": FPS},
        "system": [system],
        **things,
    }


def on_a_grid(words: dict[str, Any], cells: int) -> dict[str, Any]:
    """Particles in cells."""
    (a, b), half, wide = COLUMN, 0.5, ACROSS * LENGTH / cells
    shape = {"box": {"center": [half * a, 0, half * b], "size": [a, wide, b]}}
    box = {"size": [LENGTH, wide, HEIGHT], "center": [half * LENGTH, 0, half * HEIGHT], "resolution": cells}
    water = {"name": "water", "box": box, "fill": [{"shape": shape}], "surface": False}
    return _world({"method": "liquid"}, liquid=[water | words])


def of_particles(cells: int) -> dict[str, Any]:
    """Position-based particles, as far apart as those in cells."""
    (a, b), spacing = COLUMN, 0.5 * LENGTH / cells
    wide = 2 * ACROSS * spacing
    fill = {"center": [0.5 * a, 0, 0.5 * b], "size": [a, wide, b]}
    water = {"name": "water", "fluid": {"spacing": spacing, "fill": [fill]}, "radius": 0.5 * spacing}
    tank = {"box": {"center": [0.5 * LENGTH, 0, 0.5 * HEIGHT], "size": [LENGTH, wide, HEIGHT]}}
    wall = {"name": "tank", "inside": True, "friction": 0.0, "thickness": 0.5 * spacing, "shape": tank}
    return _world({"method": "position_based", "substeps": 8}, particles=[water], collider=[wall])


METHODS = (
    Method("PIC", "particles carry, a grid pushes and smooths", partial(on_a_grid, {"transfer": "pic"})),
    Method("FLIP", "particles carry, a grid pushes", partial(on_a_grid, {"transfer": "flip"})),
    Method("APIC", "particles carry, a grid pushes and knows how they turn", partial(on_a_grid, {"transfer": "apic"})),
    Method(
        "affine FLIP",
        "particles carry, and keep some of their own; a grid knows how they turn",
        partial(on_a_grid, {"transfer": "affine_flip"}),
    ),
    Method("APIC, volume not kept", "the same without its second pressure", partial(on_a_grid, {"keep_volume": False})),
    Method("position-based", "particles carry and push each other", of_particles),
)


def run(method: Method, cells: int) -> Course:
    """The course of a dam break."""
    world, course = World(method.scene(cells)), Course(method)
    spacing = 0.5 * LENGTH / cells
    shown = {round(t * FPS) for t in SHOWN}

    def take() -> None:
        x = np.asarray(world.frame["water"]["position"], dtype=float)
        books = world.ledger
        course.times.append(world.time)
        # Single drops that fly ahead are no front.
        course.fronts.append(float(np.quantile(x[:, 0], 1.0 - 0.5 * spacing / COLUMN[1])) + 0.5 * spacing)
        behind = x[x[:, 0] < 4 * spacing, 2]
        course.heights.append(float(np.quantile(behind, 0.95)) / 0.95 if len(behind) else 0.0)
        course.energies.append(float(books["energy"]))
        volume = books["volume"]
        if volume is not None and np.isfinite(volume):
            course.volumes.append(float(volume))
        if round(world.time * FPS) in shown:
            v = np.asarray(world.frame["water"]["velocity"], dtype=float)
            course.pictures.append((x, np.linalg.norm(v, axis=1)))

    take()
    course.particles = len(world.frame["water"]["position"])
    began = time.perf_counter()
    for _ in range(round(SECONDS * FPS)):
        world.step(1)
        take()
    course.cost = (time.perf_counter() - began) / SECONDS
    course.energies = [e / course.energies[0] for e in course.energies]
    course.volumes = [v / course.volumes[0] for v in course.volumes]
    return course


def page(folder: Path, cells: int = CELLS, progress: Callable[[int, int], None] = lambda done, total: None) -> Path:
    """Writes dam.html, .png and .csv and returns the first. Raises ExportError."""
    courses = []
    for k, method in enumerate(METHODS):
        courses.append(run(method, cells))
        progress(k + 1, len(METHODS))
    sections = [
        Section(
            "What it looks like",
            f"<p>A column of {COLUMN[0]:g} m x {COLUMN[1]:g} m falls in a tank of {LENGTH:g} m, with {cells} cells along it, "
            "or particles as far apart as those in cells. A row for each method, a column for each time; light is fast.</p>",
            partial(_pictures, courses=courses),
            1.75 * len(courses),
            "The water of each method at some times",
            raster=True,
        ),
        Section(
            "Front and height",
            "<p>Left: how far the water has come along the floor, against the experiment of Koshizuka and Oka (1996), later by "
            "the time that its gate takes. Without friction along the floor a front is up to a tenth ahead. Right: the height "
            "of the water at the wall that it leaves, for which there is no measurement here.</p>",
            partial(_fronts, courses=courses),
            4.2,
            "Front and height over time",
        ),
        Section(
            "What is kept",
            "<p>Left: kinetic and potential energy. A wave that breaks loses some as heat; what keeps the volume lifts "
            "particles, and gives back a little. Right: the volume below the surface. Particles by themselves have no surface "
            "that would say it.</p>",
            partial(_kept, courses=courses),
            4.2,
            "Energy and volume over time",
        ),
        Section("What it costs", "<p>On this machine, with all its cores.</p>", table=_table(courses)),
    ]
    return write(
        folder,
        "dam",
        "A dam breaks",
        "One column of water, every method for liquids: particles, a grid, or both.",
        [_point(course) for course in courses],
        sections,
        ["Equations: docs/theory/pic.md (particles in cells), docs/theory/liquids.md (particles alone)."],
        _rows(courses),
    )


def ahead(course: Course) -> Floats:
    """The front over that measured, at the measured times."""
    return np.asarray(np.interp(MEASURED[:, 0] - LATE, course.times, course.fronts) / MEASURED[:, 1])


def _point(course: Course) -> str:
    ratio = ahead(course)[MEASURED[:, 1] > 1.2]
    volume = f", volume {100 * (course.volumes[-1] - 1):+.1f} %" if course.volumes else ""
    return (
        f"<b>{course.method.title}</b>: front {ratio.min():.2f} to {ratio.max():.2f} of the measured one, "
        f"{100 * course.energies[-1]:.0f} % of the energy left after {SECONDS:g} s{volume}; "
        f"{course.cost:.2g} s for a simulated second."
    )


def _table(courses: list[Course]) -> str:
    head = ["method", "who does what", "particles", "s for a simulated second", "energy left", "volume"]
    rows = [
        [
            course.method.title,
            course.method.who,
            f"{course.particles}",
            f"{course.cost:.2f}",
            f"{100 * course.energies[-1]:.1f} %",
            f"{100 * (course.volumes[-1] - 1):+.2f} %" if course.volumes else "not measured",
        ]
        for course in courses
    ]
    return table(head, rows, [0, 1])


def _rows(courses: list[Course]) -> Iterator[dict[str, Any]]:
    for course in courses:
        for i, t in enumerate(course.times):
            yield {
                "method": course.method.title,
                "time": t,
                "front": course.fronts[i],
                "height": course.heights[i],
                "energy": course.energies[i],
                "volume": course.volumes[i] if course.volumes else "",
            }


def _pictures(figure: FigureBase, courses: list[Course]) -> None:
    grid: Any = figure.subplots(len(courses), len(SHOWN), sharex=True, sharey=True, squeeze=False)
    fastest = np.sqrt(2 * GRAVITY * COLUMN[1])
    for row, course in zip(grid, courses, strict=True):
        for axes, (x, speed), t in zip(row, course.pictures, SHOWN, strict=True):
            axes.scatter(x[:, 0], x[:, 2], s=1.2, c=speed, cmap="viridis", vmin=0, vmax=fastest, linewidths=0)
            axes.set_xlim(0, LENGTH)
            axes.set_ylim(0, 2.2)
            axes.set_aspect("equal")
            axes.tick_params(labelsize=7)
            if course is courses[0]:
                axes.set_title(f"{t:g} s", fontsize=9)
        row[0].set_ylabel(course.method.title, fontsize=8)


def _fronts(figure: FigureBase, courses: list[Course]) -> None:
    front, height = figure.subplots(1, 2)
    for ink, course in zip(PALETTE, courses, strict=True):
        front.plot(np.array(course.times) + LATE, course.fronts, color=ink, label=course.method.title)
        height.plot(course.times, course.heights, color=ink, label=course.method.title)
    front.plot(MEASURED[:, 0], MEASURED[:, 1], "o", color=INK, ms=4, label="measured")
    front.set_xlim(0, 0.8)
    _label(front, "front [m]")
    _label(height, "height [m]")
    front.legend(fontsize=8)


def _kept(figure: FigureBase, courses: list[Course]) -> None:
    energy, volume = figure.subplots(1, 2)
    for ink, course in zip(PALETTE, courses, strict=True):
        energy.plot(course.times, course.energies, color=ink, label=course.method.title)
        if course.volumes:
            volume.plot(course.times, course.volumes, color=ink, label=course.method.title)
    _label(energy, "energy over that of the start")
    _label(volume, "volume over that of the start")
    energy.legend(fontsize=8)


def _label(axes: Axes, what: str) -> None:
    axes.set_xlabel("time [s]")
    axes.set_ylabel(what)
