"""How fast position-based dynamics converges: sweeps against sub-steps, on a chain whose length is known."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import FigureBase

from tumble._engine import World
from tumble.lab.exact import Floats
from tumble.lab.page import Section, write
from tumble.style import INK, PALETTE

LINKS = 32
LENGTH = 1.0
DENSITY = 0.4
"""Of the chain [kg/m]."""
MODULUS = 100.0
"""Force at which it would be twice as long [N]."""
FPS = 24
FRAMES = 240
"""Until it rests, with a drag."""
WORK = (1, 2, 4, 8, 16, 32, 64, 128, 256)
"""Projections of each link in a frame."""


@dataclass
class Way:
    """A way to spend the projections of a frame."""

    title: str
    plain: bool
    substeps: bool
    """In sub-steps of one sweep, or in sweeps of one sub-step."""
    errors: Floats
    """Of the chain's lengthening, relative, for each amount of work."""


def lengthening(plain: bool, substeps: int, sweeps: int) -> float:
    """By how much the chain is longer when it hangs still [m]."""
    rope = {
        "name": "chain", "from": [0, 0, 0], "to": [0, 0, -LENGTH], "segments": LINKS, "density": DENSITY, "pin": ["start"],
        "links": {"structural": MODULUS},
    }  # fmt: skip
    words = {"iterations": sweeps, "projection": "plain" if plain else "compliant"}
    scene = {
        "version": 1,
        "precision": "double",
        "time": {"fps": FPS},
        "system": [{"method": "position_based", "substeps": substeps, "position_based": words}],
        "force": [{"kind": "drag", "rate": 4.0}],
        "rope": [rope],
    }
    world = World(scene, threads=1)
    world.step(FRAMES)
    return float(-world.frame["chain"]["position"][-1, 2] - LENGTH)


def exact() -> float:
    """Each link is longer by its compliance times the weight below it; the last mass is half of one."""
    part = LENGTH / LINKS
    weights = 9.8 * DENSITY * part * (np.arange(LINKS) + 0.5)
    return float(np.sum(weights) * part / MODULUS)


def measure() -> list[Way]:
    """All four ways."""
    true, found = exact(), []
    for plain in (False, True):
        for substeps in (True, False):
            title = f"{'plain' if plain else 'compliant'}, {'sub-steps of one sweep' if substeps else 'sweeps of one sub-step'}"
            lengths = [lengthening(plain, n if substeps else 1, 1 if substeps else n) for n in WORK]
            found.append(Way(title, plain, substeps, np.abs(np.array(lengths) / true - 1.0)))
    return found


def page(folder: Path) -> Path:
    """Writes positions.html, .png and .csv and returns the first."""
    ways = measure()
    sections = [
        Section(
            "Sub-steps against sweeps",
            f"<p>A chain of {LINKS} links hangs by one end, at {FPS} frames a second. Its links stretch by their compliance "
            f"times the weight below them, together by {1e3 * exact():.3g} mm. Shown is how far off that the chain is when it "
            "rests, against the projections of each link in a frame. Compliant elements (positions.2) come to the right "
            "length both ways, by sub-steps much sooner; plain ones to a chain that does not stretch: an error of 1.</p>",
            partial(_errors, ways=ways),
            4.2,
            "Error of the length over work",
        )
    ]
    by_steps, by_sweeps = ways[0].errors, ways[1].errors
    at = WORK.index(32)
    points = [
        f"With {WORK[at]} projections of each link in a frame the compliant chain is off by {100 * by_steps[at]:.2g} % in "
        f"sub-steps, by {100 * by_sweeps[at]:.2g} % in sweeps.",
        f"Plain: {100 * ways[2].errors[at]:.3g} % and {100 * ways[3].errors[at]:.3g} %, whatever the stiffness.",
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
        for work, error in zip(WORK, way.errors, strict=True):
            yield {"way": way.title, "projections": work, "error": error}


def _errors(figure: FigureBase, ways: list[Way]) -> None:
    axes = figure.add_subplot()
    for way in ways:
        ink = PALETTE[1 if way.plain else 0]
        axes.loglog(
            WORK,
            way.errors,
            "-" if way.substeps else "--",
            marker="o" if way.substeps else "s",
            color=ink,
            label=way.title,
        )
    axes.axhline(0.005, color=INK, lw=0.8, ls=":")
    axes.text(WORK[0], 0.0053, "0.5 %", color=INK, fontsize=8)
    axes.set_xlabel("projections of each link in a frame")
    axes.set_ylabel("error of the lengthening, relative")
    axes.set_xticks(WORK, [str(n) for n in WORK])
    axes.minorticks_off()
    axes.legend()
