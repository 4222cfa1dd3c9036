"""Changes that are tried after the physics broke: those of the engine, and others where none of those helped."""

import math
from collections.abc import Mapping
from typing import Any

from tumble import energy
from tumble._engine import World
from tumble.columns import GRIDS

COST = (50.0, 20_000.0)
"""A trial may take so many times the sub-steps of the run that failed, and so many more, as in the engine."""

_SHORTER = (4, 16)
"""How many times as many sub-steps are tried where no limit is known."""


def cures(world: World, scene: Mapping[str, Any], report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """After a StepError: changes, each tried from the start of the scene to two frames beyond the failure: set, survived,
    energy_ratio."""
    k, plan = system(scene, report)
    found = world.cures()
    if any(cure["survived"] for cure in found):
        return found
    known = {cure["set"] for cure in found}
    more = [sets for sets in others(scene, k, plan, report) if " ".join(sets) not in known]
    return found + [energy.attempt(world.scene, sets, world.frame_index + 3) for sets in more]


def others(scene: Mapping[str, Any], k: int, plan: Mapping[str, Any], report: Mapping[str, Any]) -> list[list[str]]:
    """Changes that may help where the engine knows none, as lists of overrides."""
    interval = 1.0 / scene["time"]["fps"] / scene["time"]["exchanges"]
    step = step_used(plan, interval, report)
    now = max(1, round(interval / step))
    most = COST[0] * now + COST[1]
    index = {kind: _index(scene, kind, report.get("object")) for kind in GRIDS}
    found: list[list[str]] = []
    if (i := index["heat"]) is not None and scene["heat"][i]["scheme"] in ("explicit", "trapezoid"):
        found.append([f"heat.{i}.scheme=implicit"])
    liquid = plan["integrator"] == "position_based"
    if math.isinf(float(report.get("stable_step", math.inf))):  # The engine knows no limit.
        counts = {factor * now for factor in _SHORTER}
        limit = min((viscous_limit(thing) for thing in scene["particles"]), default=math.inf) if liquid else math.inf
        if limit < step:
            counts = {math.ceil(interval / (0.7 * limit))}
        word = "step" if plan.get("step") else "substeps"
        for n in sorted(n for n in counts if n <= most):
            found.append([f"system.{k}.{word}={interval / n if word == 'step' else n:.6g}"])
    if (i := index["compressible"]) is not None:
        resolution = int(scene["compressible"][i]["box"]["resolution"])
        coarse = int(0.7 * resolution * float(report.get("stable_step", 0.0)) / step)
        if 2 <= coarse < resolution:
            found.append([f"compressible.{i}.box.resolution={coarse}"])
    if report.get("kind") == "not_finite" and scene["precision"] == "single":
        found.append(["precision=double"])
    return found


def viscous_limit(thing: Mapping[str, Any]) -> float:
    """The largest step [s] of the explicit viscosity of a liquid of particles; inf for anything else."""
    fluid = thing.get("fluid")
    if not fluid or not fluid["viscosity"]:
        return math.inf
    return float(fluid["density"] * fluid["spacing"] ** 2 / (8.0 * fluid["viscosity"]))


def system(scene: Mapping[str, Any], report: Mapping[str, Any]) -> tuple[int, Mapping[str, Any]]:
    """The system that failed: its index and its words."""
    plans = scene["system"]
    k = next((i for i, plan in enumerate(plans) if plan["name"] == report.get("system")), 0)
    return k, plans[k]


def step_used(plan: Mapping[str, Any], interval: float, report: Mapping[str, Any]) -> float:
    """The step that was used [s], as far as it is known."""
    step = float(report.get("step") or plan.get("step") or interval / (plan.get("substeps") or 1))
    return min(step, interval)


def _index(scene: Mapping[str, Any], kind: str, name: Any) -> int | None:
    return next((i for i, thing in enumerate(scene[kind]) if thing["name"] == name), None)
