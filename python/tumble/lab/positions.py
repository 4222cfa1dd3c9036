"""How fast position-based dynamics converges: sweeps against sub-steps, on a chain whose length is known."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from tumble._engine import World
from tumble.lab.exact import Floats
from tumble.lab.findings import off
from tumble.lab.page import Section, write
from tumble.style import INK, PALETTE

LINKS = 32
LENGTH = 1.0
DENSITY = 0.4
"""Of the chain [kg/m]."""
MODULUS = 100.0
"""Force at which it would be twice as long [N]."""
FPS = 24
RATES = (FPS, 60, 120)
"""Frames a second that are compared."""
SECONDS = 10
"""Until it rests, with a drag."""
WORK = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
"""Projections of each link in a frame."""


@dataclass
class Way:
    """A way to spend the projections of a frame."""

    plain: bool
    substeps: bool
    """In sub-steps of one sweep, or in sweeps of one sub-step."""
    rate: int
    """Frames a second."""
    errors: Floats
    """Of the chain's lengthening, relative, for each amount of work."""

    @property
    def title(self) -> str:
        spent = "sub-steps of one sweep" if self.substeps else "sweeps of one sub-step"
        return f"{'plain' if self.plain else 'compliant'}, {spent}"


def lengthening(plain: bool, substeps: int, sweeps: int, rate: int = FPS) -> float:
    """By how much a chain of single springs is longer when it hangs still [m]; a rope's links would be solved as a whole."""
    part = LENGTH / LINKS
    springs = [{"between": [i, i + 1], "stiffness": MODULUS / part, "rest_length": part} for i in range(LINKS)]
    chain = {
        "name": "chain",
        "position": [[0, 0, -i * part] for i in range(LINKS + 1)],
        "mass": [DENSITY * part] * LINKS + [DENSITY * part / 2],
        "pin": ["vertex 0"],
        "spring": springs,
    }
    words = {"iterations": sweeps, "projection": "plain" if plain else "compliant"}
    scene = {
        "version": 1,
        "precision": "double",
        "time": {"fps": rate},
        "system": [{"method": "position_based", "substeps": substeps, "position_based": words}],
        "force": [{"kind": "drag", "rate": 4.0}],
        "particles": [chain],
    }
    world = World(scene, threads=1)
    world.step(SECONDS * rate)
    return float(-world.frame["chain"]["position"][-1, 2] - LENGTH)


def exact() -> float:
    """Each link is longer by its compliance times the weight below it; the last mass is half of one."""
    part = LENGTH / LINKS
    weights = 9.8 * DENSITY * part * (np.arange(LINKS) + 0.5)
    return float(np.sum(weights) * part / MODULUS)


def error(plain: bool, substeps: bool, work: int, rate: int = FPS) -> float:
    """Of the lengthening, relative: above zero where the chain is too long."""
    return lengthening(plain, *((work, 1) if substeps else (1, work)), rate) / exact() - 1.0


def measure() -> list[Way]:
    """All four ways at FPS, then the compliant ones at the other rates."""
    ways = [(plain, substeps, FPS) for plain in (False, True) for substeps in (True, False)]
    ways += [(False, substeps, rate) for rate in RATES[1:] for substeps in (True, False)]
    return [Way(*way, np.abs([error(*way[:2], work, way[2]) for work in WORK])) for way in ways]


def page(folder: Path) -> Path:
    """Writes positions.html, .png and .csv and returns the first."""
    ways = measure()
    sections = [
        Section(
            "Sub-steps against sweeps",
            f"<p>A chain of {LINKS} springs hangs by one end. They stretch by their compliance times the weight below them, "
            f"together by {1e3 * exact():.3g} mm. Shown is how far off that the chain is when it rests. Left: against the "
            f"projections of each link in a frame, {FPS} frames a second. Compliant elements (positions.2) come to the right "
            "length both ways: in sub-steps with the square of their number, in sweeps with their number only, until they are "
            "enough to carry the weight along the whole chain. Plain ones pass it on the way to a chain that does not stretch: "
            "an error of 1. Right: the compliant ones at several frame rates, against the projections in a second. The rate "
            "does not matter in sub-steps, since their length alone counts; sweeps need the fewer the shorter frames are. "
            "(The links of a rope are one linear system (positions.7), and right at once.)</p>",
            partial(_errors, ways=ways),
            4.8,
            "Error of the length over work",
        )
    ]
    by_steps, by_sweeps, plain_steps, plain_sweeps = (way.errors for way in ways[:4])
    few, many = WORK.index(32), WORK.index(512)
    points = [
        f"The lengthening of the compliant chain, against the right one: with {WORK[few]} projections of each link in a frame "
        f"the error is {off(by_steps[few])} in sub-steps and {off(by_sweeps[few])} in sweeps; with {WORK[many]} it is "
        f"{off(by_steps[many])} and {off(by_sweeps[many])}.",
        f"Plain, with {WORK[many]}: {off(plain_steps[many])} and {off(plain_sweeps[many])}, whatever the stiffness.",
    ]
    return write(
        folder,
        "positions",
        "Position-based dynamics",
        "How many projections until a stiffness is obeyed.",
        points,
        sections,
        ["Equations: docs/theory/positions.md."],
        _rows(ways),
    )


def _rows(ways: list[Way]) -> Iterator[dict[str, Any]]:
    for way in ways:
        for work, relative in zip(WORK, way.errors, strict=True):
            yield {"way": way.title, "frames a second": way.rate, "projections": work, "error": relative}


def _errors(figure: FigureBase, ways: list[Way]) -> None:
    frame, second = figure.subplots(1, 2, sharey=True)
    for way in ways[:4]:
        ink = PALETTE[1 if way.plain else 0]
        _line(frame, way, np.array(WORK), ink, way.title)
    # Markers within each other, for the curves of sub-steps are one.
    for ink, rate, size in zip(PALETTE, RATES, (9, 6, 3), strict=False):
        for way in ways:
            if way.rate == rate and not way.plain:
                spent = "sub-steps" if way.substeps else "sweeps"
                _line(second, way, rate * np.array(WORK), ink, f"{rate} frames a second, {spent}", size)
    frame.set_title(f"{FPS} frames a second")
    frame.set_xlabel("projections of each link in a frame")
    frame.set_ylabel("error of the lengthening, relative")
    frame.set_xticks(WORK, [str(n) for n in WORK])
    second.set_title("compliant")
    second.set_xlabel("projections of each link in a second")
    for axes in (frame, second):
        axes.axhline(0.005, color=INK, lw=0.8, ls=":")
        axes.minorticks_off()
        axes.set_ylim(1e-6, 2e3)
        axes.legend(fontsize=7, loc="lower left")
    frame.text(WORK[0], 0.0053, "0.5 %", color=INK, fontsize=8)


def _line(axes: Axes, way: Way, work: Any, ink: str, label: str, size: float = 4) -> None:
    line, marker = ("-", "o") if way.substeps else ("--", "s")
    axes.loglog(work, way.errors, line, marker=marker, ms=size, color=ink, label=label)
