"""The largest step of the bad solver, predicted and measured, beside Stable Fluids at a hundred times that step."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import FigureBase

from tumble._engine import StepError, World
from tumble.lab.exact import Floats
from tumble.lab.page import Section, write
from tumble.style import INK, PALETTE

SOUND = 340.0
"""Speed of sound of air [m/s]."""

CELLS = 64
"""Along a side of the square of 1 m in which both solvers swirl."""

DURATION = 0.06
"""Of the swirl [s]."""

TIMES = 100
"""Steps of the bad solver in one of Stable Fluids."""


@dataclass
class Case:
    """A gas with noise in a box with joined sides."""

    dimension: int
    flow: tuple[float, ...]
    viscosity: float
    predicted: float = 0.0
    measured: float = 0.0

    @property
    def name(self) -> str:
        flow = ", ".join(f"{u:g}" for u in self.flow)
        return f"{self.dimension}D, flow ({flow}) m/s, viscosity {self.viscosity:g} Pa s"


CASES = (
    *((d, (0.0,) * d, 0.0) for d in (1, 2, 3)),
    (1, (150.0,), 0.0),
    (1, (500.0,), 0.0),
    (2, (100.0, 0.0), 0.0),
    (2, (100.0, -80.0), 0.0),
    (3, (60.0, 50.0, -40.0), 0.0),
    (2, (0.0, 0.0), 8.0),
    (2, (90.0, 30.0), 4.0),
)


def noisy(case: Case, n: int = 8, steps: int = 300, step: float = 1.0) -> World:
    """A world whose frame takes so many steps [s]."""
    size = [1.0 if a < case.dimension else 1.0 / n for a in range(3)]
    velocity = [*case.flow, 0.0, 0.0][:3]
    noise = "sin(9171*x + 3)*cos(7331*y + 1)*sin(5557*z + 2)"
    return World(
        {
            "version": 1,
            "precision": "double",
            "time": {"fps": 1.0 / (steps * step)},
            "world": {"gravity": [0, 0, 0]},
            "system": [{"name": "air", "method": "compressible", "substeps": steps}],
            "compressible": [
                {
                    "name": "air", "box": {"size": size, "resolution": n}, "sound_speed": SOUND, "density": 1.2,
                    "viscosity": case.viscosity, "velocity": velocity, "periodic": [True] * 3,
                    "initial_density": f"1.2*(1 + 1e-9*{noise})",
                }
            ],
        }
    )  # fmt: skip


def _noise(world: World) -> float:
    return float(np.abs(world.columns("density")["air"]["density"] - 1.2).max())


def stays(case: Case, step: float) -> bool:
    """Whether noise stays small over 300 steps."""
    world = noisy(case, step=step)
    before = _noise(world)
    try:
        world.step()
    except StepError:
        return False
    return _noise(world) < 100.0 * before


def measure(case: Case) -> Case:
    """Finds both steps."""
    limits = noisy(case).stability()[0]["limits"]
    case.predicted = float(limits[0]["stable"])
    low, high = 0.5 * case.predicted, 1.5 * case.predicted
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stays(case, middle) else (low, middle)
    case.measured = low
    return case


@dataclass
class Swirl:
    """A vortex in a closed square, by one of the two solvers."""

    name: str
    step: float
    times: Floats
    kinetic: Floats
    speed: Floats
    steps: int


def swirls() -> list[Swirl]:
    """The bad solver at 0.9 of its largest step, Stable Fluids at a hundred times that."""
    velocity = ["sin(pi*x)*cos(pi*y)", "-cos(pi*x)*sin(pi*y)", 0]
    box = {"size": [1, 1, 1], "center": [0.5, 0.5, 0], "resolution": CELLS}
    largest = 1.0 / CELLS / (SOUND * np.sqrt(2.0) + 2.0)
    objects: dict[str, dict[str, Any]] = {
        "compressible": {"sound_speed": SOUND, "density": 1.2},
        "gas": {"fluid_density": 1.2},
    }
    found = []
    for method, step in (("compressible", 0.9 * largest), ("gas", 90.0 * largest)):
        frames = round(DURATION / (90.0 * largest))
        steps = TIMES if method == "compressible" else 1
        world = World(
            {
                "version": 1, "dimension": 2, "plane": "xy", "world": {"gravity": [0, 0, 0]},
                "time": {"fps": 1.0 / (90.0 * largest), "frames": frames},
                "system": [{"name": "s", "method": method, "substeps": steps}],
                method: [{"name": "air", "box": box, "velocity": velocity, **objects[method]}],
            }
        )  # fmt: skip
        times, kinetic = [0.0], [world.ledger["kinetic"]]
        for _ in range(frames):
            world.step()
            times.append(world.time)
            kinetic.append(world.ledger["kinetic"])
        u = world.columns("velocity")["air"]["velocity"]
        title = "the bad solver" if method == "compressible" else "Stable Fluids"
        speed = np.hypot(u[..., 0], u[..., 1])
        found.append(Swirl(title, step, np.array(times), np.array(kinetic), speed, steps * frames))
    return found


def page(folder: Path) -> Path:
    """Writes compressible.html, .png and .csv and returns the first."""
    cases = [measure(Case(*case)) for case in CASES]
    both = swirls()
    worst = max(abs(c.measured / c.predicted - 1.0) for c in cases)
    sections = [
        Section(
            "The largest step",
            f"<p>Noise of 10⁻⁹ in air ({SOUND:g} m/s) on cells of 1/8 m. Predicted: the first step at which "
            "one of all waves grows, by its matrix (compressible.8); at rest that is c h √d/Δx = 1, and a flow, which damps "
            "sound, allows longer steps up to its own limit. Measured: the longest step at which the noise stays below "
            "a hundred times itself for 300 steps.</p>",
            partial(_limits, cases=cases),
            4.0,
            "Predicted and measured steps",
        ),
        Section(
            "The same swirl without sound",
            f"<p>A vortex of 1 m/s in a closed square, {CELLS} × {CELLS} cells. Left: every step must wait for sound. Right: a "
            f"step of Stable Fluids is {TIMES} times as long; what it loses, it loses to interpolation.</p>",
            partial(_swirls, both=both),
            3.6,
            "A vortex by both solvers",
        ),
    ]
    lost = [1.0 - s.kinetic[-1] / s.kinetic[0] for s in both]
    points = [
        f"Measured largest steps are within {100 * worst:.1f} % of the predicted ones.",
        *(
            f"{s.name[0].upper()}{s.name[1:]}: {s.steps} steps of {1e6 * s.step:.4g} µs, {100 * part:.1f} % of the energy lost."
            for s, part in zip(both, lost, strict=True)
        ),
    ]
    return write(
        folder,
        "compressible",
        "The bad solver",
        "Pressure from density needs no linear solver, and steps as short as sound is fast.",
        points,
        sections,
        ["Equations: docs/theory/compressible.md."],
        _rows(cases),
    )


def _rows(cases: list[Case]) -> Iterator[dict[str, Any]]:
    for case in cases:
        yield {"case": case.name, "predicted": case.predicted, "measured": case.measured}


def _limits(figure: FigureBase, cases: list[Case]) -> None:
    axes = figure.add_subplot()
    rows = np.arange(len(cases))
    axes.barh(rows - 0.2, [1e6 * c.predicted for c in cases], 0.38, color=PALETTE[0], label="predicted")
    axes.barh(rows + 0.2, [1e6 * c.measured for c in cases], 0.38, color=PALETTE[1], label="measured")
    for row, case in zip(rows, cases, strict=True):
        end = 1e6 * max(case.measured, case.predicted)
        axes.text(end, float(row), f" {case.measured / case.predicted:.3f}", va="center", color=INK, fontsize=8)
    axes.set_yticks(rows, [case.name for case in cases])
    axes.invert_yaxis()
    axes.set_xlabel("largest step [µs]")
    axes.legend(loc="lower right")


def _swirls(figure: FigureBase, both: list[Swirl]) -> None:
    places = figure.add_gridspec(1, 3)
    for i, swirl in enumerate(both):
        axes = figure.add_subplot(places[0, i])
        image = axes.imshow(swirl.speed.T, origin="lower", vmin=0.0, vmax=1.0, cmap="Blues", interpolation="nearest")
        axes.set_title(f"{swirl.name}: {swirl.steps} steps of {1e6 * swirl.step:.4g} µs")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.grid(False)
        figure.colorbar(image, ax=axes, shrink=0.85, label="speed [m/s]")
    axes = figure.add_subplot(places[0, 2])
    for ink, swirl in zip(PALETTE, both, strict=False):
        axes.plot(swirl.times, swirl.kinetic / swirl.kinetic[0], color=ink, label=swirl.name)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("kinetic energy over the first")
    axes.set_ylim(0.0, 1.1)
    axes.legend()
