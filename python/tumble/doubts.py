"""Warnings about the files of a scene and about the ledger of a run; docs/warnings.md lists the codes."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble import energy, expect

if TYPE_CHECKING:
    from tumble._engine import Scene
    from tumble.reader import Run

_COURANT = 2.0
"""Cells that a fluid passes in a step, over what was asked for, that are worth telling."""

_GAINS = ("forward_euler", "modified_euler", "midpoint", "heun")
"""Integrators that gain energy of oscillations at any step."""


def of_files(
    scene: "Scene", figures: Sequence[tuple[str, str]] = (), guides: Sequence[tuple[str, str]] = ()
) -> list[dict[str, str]]:
    """Code, path and message of what is not as it seems in the USD files of a scene, and of its characters and the guides of
    hair, of which `figures` and `guides` have place and path; `World.warnings` asks for it."""
    from tumble.usd import told
    from tumble.usd.frames import FIGURE, parted

    found: dict[str, list[dict[str, str]]] = {}
    for place, _, path in scene.mesh_files:
        file = Path(scene.folder) / path
        frame = parted(file)
        # The scene has the file as a mesh; its frames are all alike.
        place = re.sub(r"animated_mesh\.frames\[\d+\]", "mesh", place) if frame else place
        if not told.is_usd(file) or place in found:
            continue
        file = file if frame is None else frame[0]
        with suppress(OSError, ValueError):  # Files may be gone that were there when the scene was read.
            doubts = [doubt for doubt in told.doubts(file) if frame is None or doubt[0] != told.STANDS]
            start = "" if place.startswith("collider ") else _START
            found[place] = [
                {"code": code, "path": place, "message": message + (start if code == told.STANDS else "")}
                for code, message in doubts
            ]
    for place, path in figures:
        if Path(path).name == FIGURE and told.is_usd(file := (Path(scene.folder) / path).parent):
            with suppress(OSError):
                found[place] = [{"code": code, "path": place, "message": text} for code, text in told.of_figure(file)]
    for place, path in guides:
        if told.is_usd(file := Path(scene.folder) / path):
            with suppress(OSError):
                found[place] = [{"code": code, "path": place, "message": text} for code, text in told.of_strands(file)]
    return [warning for some in found.values() for warning in some]


_START = "; only colliders move as their file says"


def of_books(run: "Run") -> list[dict[str, str]]:
    """Code, path and message of each doubt."""
    found = (*_grew(run), *_unconverged(run), *_too_fast(run), *_other_end(run)) if run.n_frames else ()
    return [{"code": code, "path": "", "message": message} for code, message in found]


@dataclass(frozen=True)
class Remedy:
    """Advice against energy growth without a source: the observation, its likely cause, and the change."""

    text: str
    changes: list[str]


def remedy(run: "Run") -> Remedy | None:
    """None where no energy came from nowhere."""
    grown = energy.from_nowhere(run)
    if grown is None:
        return None
    plans = run.scene["system"]
    k = next((i for i, plan in enumerate(plans) if plan["method"] == "dynamics"), 0)
    plan: Mapping[str, Any] = plans[k]
    step = float(run.ledger["largest_step"][grown.frame])
    if not 1e-18 < step < math.inf:
        return None
    met = energy.encounters(run, range(grown.frame - 2, grown.frame + 1), step)
    own = plan["integrator"]
    if met:
        cause, changes = "; ".join(map(energy.told, met)), energy.changes(run.scene, met, k)
    elif energy.joined(run.scene):
        exchanges = 4 * run.scene["time"]["exchanges"]
        cause, changes = "systems exchange impulses too rarely", [f"time.exchanges={exchanges}"]
    elif own in _GAINS:
        cause, changes = f"{own} gains energy where things oscillate", [f"system.{k}.integrator=symplectic_euler"]
    elif own in energy.ADAPTIVE:
        tolerance = 0.01 * plan["adaptive"]["tolerance"]
        cause, changes = "the tolerance is too coarse", [f"system.{k}.adaptive.tolerance={tolerance:.1e}"]
    else:
        n = math.ceil(4.0 / run.fps / run.scene["time"]["exchanges"] / step)
        shorter = f"step={step / 4.0:.2g}" if plan.get("step") else f"substeps={n}"
        cause, changes = f"steps of {step:.2e} s are too long", [f"system.{k}.{shorter}"]
    text = (
        f"the energy grew by {grown.times:.3g} times its scale, from frame {grown.frame} on, and nothing in the scene adds "
        f"any: {cause}. Try {' '.join(changes)}"
    )
    return Remedy(text, changes)


def _grew(run: "Run") -> Iterator[tuple[str, str]]:
    """Energy from nowhere."""
    if (found := remedy(run)) is not None:
        yield (
            "energy-grew",
            found.text,
        )


def _unconverged(run: "Run") -> Iterator[tuple[str, str]]:
    """Steps of Newton's method that were given up."""
    if unconverged := int(run.ledger["unconverged"].sum()):
        worst = float(np.fmax.reduce(run.ledger["residual"]))
        yield (
            "unconverged",
            f"{unconverged} of {int(run.ledger['steps'].sum())} steps stopped before Newton's method converged, at a residual "
            f"of up to {worst:.1e} of the first: raise solver.newton_iterations, or take a smaller step",
        )


def _too_fast(run: "Run") -> Iterator[tuple[str, str]]:
    """Steps that were given and let a fluid pass far more cells than its Courant number."""
    given = any(s["method"] == "gas" and (s.get("substeps") or s.get("step")) for s in run.scene["system"])
    asked = max((float(gas["courant"]) for gas in run.scene.get("gas", [])), default=math.inf)
    reached = float(np.fmax.reduce(run.ledger["courant"]))
    if given and reached > _COURANT * asked:
        yield (
            "courant",
            f"the fluid passed up to {reached:.3g} cells in a step, courant is {asked:.3g}: such steps smear; take more "
            "substeps, or leave substeps and step out",
        )


def _other_end(run: "Run") -> Iterator[tuple[str, str]]:
    """Expectations at the end of runs that were asked to end elsewhere."""
    if n := expect.skipped(run):
        frames, meant = run.manifest["frames"], run.manifest["whole_frames"]
        what = "1 expectation is not checked: it is" if n == 1 else f"{n} expectations are not checked: they are"
        yield (
            "other-end",
            f"{what} meant for frame {meant}, the last of the scene, and this run ends with frame {frames}",
        )
