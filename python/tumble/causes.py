"""Why the physics broke: what is in sight, the likeliest first."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble import energy, methods
from tumble._engine import World
from tumble.columns import BOUND, on_grids
from tumble.cures import step_used, system, viscous_limit
from tumble.doubts import of_books

if TYPE_CHECKING:
    from tumble.reader import Run

_UNSAFE = re.compile(r"/|\^|\b(sqrt|ln|log10|pow|exp|tan|asin|acos|sinh|cosh|mod)\b")
"""Parts of a formula that may give non-finite numbers."""

_STRETCHED = 1.05
"""Stretch of links at the start that is worth telling."""

_DEEP = 1e-4
"""Depth in a collider at the start that is worth telling [m]."""

_UNLIKE = 1000.0
"""Ratio of masses that is worth telling."""

_GROWN = 0.1
"""Growth of the energy over its scale, before the break, that is worth telling."""


def likely(
    world: World, scene: Mapping[str, Any], report: Mapping[str, Any], run: "Run", near: Sequence[str] = ()
) -> list[str]:
    """Possible causes of a failure, as text with figures, the likeliest first. `world` stands at its last good frame, `run`
    has the frames so far, and `near` tells of masses that came too near each other."""
    found = [str(report["cause"])] if report.get("cause") else []
    found += _too_long(world, scene, report)
    found += _formulas(scene, report)
    found += near
    found += _started(scene, run)
    found += [doubt["message"] for doubt in of_books(run)]
    found += _unlike(scene, report, run)
    if run.n_frames > 1 and run.ledger["mass"].any():
        grown = energy.growth(run.ledger)
        if grown.times > _GROWN:
            found.append(f"the energy had grown by {grown.times:.3g} times its scale before, within the frames kept")
    return found


def _too_long(world: World, scene: Mapping[str, Any], report: Mapping[str, Any]) -> Iterator[str]:
    """Steps against the limits of what is stepped."""
    _, plan = system(scene, report)
    interval = 1.0 / scene["time"]["fps"] / scene["time"]["exchanges"]
    used = step_used(plan, interval, report)
    for thing in scene["particles"]:
        if thing["name"] == report.get("object") and (limit := viscous_limit(thing)) < used:
            yield (
                f"steps of {_seconds(used)} are {used / limit:.3g} times what the explicit viscosity of "
                f'"{thing["name"]}" allows, {_seconds(limit)}'
            )
    if "stable_step" not in report:
        return
    step, stable = float(report["step"]), float(report["stable_step"])
    if stable == 0.0 < step:
        yield f"{report['integrator']} gains energy on this system at any step"
    elif step > stable:
        text = f"steps of {_seconds(step)} are {step / stable:.3g} times the largest stable one, {_seconds(stable)}"
        about = next((s for s in world.stability() if s["system"] == report["system"]), None)
        yield text + (_mode(about, step) if about is not None else "")


def _mode(about: Mapping[str, Any], step: float) -> str:
    """Which mode asks for shorter steps."""
    spring, damping = (about["frequency"] * step) ** 2, 2.0 * about["damping_max"] * step
    where = ""
    if about["culprit"] is not None:
        where = f' at particle {about["culprit"][1]} of "{about["culprit"][0]}"'
    if damping > spring:
        return f", because of a damping of {about['damping_max']:.3g} 1/s"
    if spring > 0.0:
        return f", because of oscillations of {about['frequency']:.3g} rad/s, most{where}" if where else ""
    return ""


def _formulas(scene: Mapping[str, Any], report: Mapping[str, Any]) -> Iterator[str]:
    """Formulas of gravity, of what lies on a grid, and of fields that carry points, that may give no finite number, where
    steps are not too long."""
    if report.get("kind") != "not_finite" or float(report["step"]) > float(report["stable_step"]):
        return
    for path, text in _texts("", scene["world"]["gravity"]):
        if _UNSAFE.search(text):
            yield f'world.gravity{path} = "{text}" may give no finite number between frames'
    if methods.of_system(system(scene, report)[1]).is_carried:
        for i, field in enumerate(scene["field"]):
            for path, text in _texts("", field):
                if _UNSAFE.search(text):
                    yield f'field.{i}{path} = "{text}" may give no finite number where a particle came'
    for kind, thing in on_grids(scene):
        if thing["name"] == report["object"]:
            for path, text in _texts("", thing):
                if _UNSAFE.search(text):
                    yield f'{kind} "{thing["name"]}"{path} = "{text}" may give no finite number between frames'


def _texts(path: str, value: Any) -> Iterator[tuple[str, str]]:
    """The texts in a tree, with their places."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _texts(f"{path}.{key}", item)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _texts(f"{path}[{i}]", item)
    elif isinstance(value, str):
        yield path, value


def _started(scene: Mapping[str, Any], run: "Run") -> Iterator[str]:
    """Faults at the start."""
    start = {key: float(run.ledger[key][0]) for key in ("stretch", "penetration", "intersections")}
    if start["intersections"] > 0.0:
        yield f"surfaces started with {start['intersections']:.0f} edges through triangles"
    if start["penetration"] > _DEEP:
        yield f"masses started up to {start['penetration']:.3g} m deep inside a collider"
    if start["stretch"] > _STRETCHED:
        yield f"links started stretched up to {start['stretch']:.3g} times their rest length"
    columns = run.frame(0)
    for thing in scene["particles"]:
        x = columns.get(thing["name"], {}).get("position")
        if not thing["fluid"] or x is None:
            continue
        # Particles at rest do not share cubes of half their distance.
        cubes = np.floor(x / (0.5 * thing["fluid"]["spacing"]))
        if shared := len(x) - len(np.unique(cubes, axis=0)):
            yield (
                f'{shared} of {len(x)} particles of "{thing["name"]}" started in others: nearer than the spacing, '
                f"{thing['fluid']['spacing']:g} m"
            )


def _unlike(scene: Mapping[str, Any], report: Mapping[str, Any], run: "Run") -> Iterator[str]:
    """Light masses beside heavy ones."""
    names = [thing["name"] for kind in BOUND for thing in scene[kind] if _steps(scene, thing, report)]
    masses = {n: run.static[n]["mass"] for n in names if "mass" in run.static.get(n, {}) and len(run.static[n]["mass"])}
    if not masses or not energy.has_springs(scene):
        return
    lightest = min(masses, key=lambda n: float(masses[n].min()))
    heaviest = max(masses, key=lambda n: float(masses[n].max()))
    low, high = float(masses[lightest].min()), float(masses[heaviest].max())
    if high > _UNLIKE * low > 0.0:
        yield (
            f'masses from {low:.3g} kg in "{lightest}" to {high:.3g} kg in "{heaviest}", a factor of {high / low:.3g}: '
            "light masses shorten the step"
        )


def _steps(scene: Mapping[str, Any], thing: Mapping[str, Any], report: Mapping[str, Any]) -> bool:
    """Whether it may be stepped by the system that broke."""
    return len(scene["system"]) < 2 or thing["system"] in (None, report.get("system"))


def _seconds(value: float) -> str:
    return f"{value:.3g} s"
