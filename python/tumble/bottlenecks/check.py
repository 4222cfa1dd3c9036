"""What is wrong with a plan before anybody walks on it: faults with their places, a picture of them, and repair."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from tumble import _engine
from tumble._engine import Scene
from tumble.plots import settings
from tumble.style import FAINT, INK, PALETTE

Tree = Mapping[str, Any]


@dataclass(frozen=True)
class Fault:
    """Something that is wrong with a plan."""

    kind: str
    """One word: size, outside, narrow, closed, crossed, jamb, double, crossing, sliver, gap, link, start, locked, full,
    unused."""
    fatal: bool
    """Whether nobody can walk on such a plan; others change what is measured."""
    places: tuple[tuple[float, float], ...]
    """Where [m]; of many the first."""
    text: str
    cure: str
    by: Literal["repair", "drawing"]
    """Who can mend it: `mended`, or the author of the drawing."""

    def __str__(self) -> str:
        return f"{self.text}; {self.cure}" if self.cure else self.text


def floor(scene: Scene) -> dict[str, Any]:
    """The plan of a scene and its start areas, in metres, as the engine checks them."""
    tree = scene.to_dict()
    plan, scale = tree["plan"][0], float(tree["plan"][0]["scale"])

    def metres(points: Sequence[Sequence[float]]) -> list[list[float]]:
        return [[scale * x, scale * y] for x, y in points]

    def gates(key: str) -> list[dict[str, Any]]:
        return [
            {"name": g["name"], **dict(zip(("from", "to"), metres([g["from"], g["to"]]), strict=True))}
            for g in plan[key]
        ]

    return {
        "walls": [metres(wall) for wall in plan["walls"]],
        "door": gates("door"),
        "exit": gates("exit"),
        "link": [[metres(link["from"]), metres(link["to"])] for link in plan["link"]],
        "start": [_start(crowd) for crowd in tree["crowd"] if crowd["area"]],
        "radius": max((crowd["radius"] * (1.0 + crowd["radius_spread"]) for crowd in tree["crowd"]), default=0.2),
    }


def _start(crowd: Tree) -> dict[str, Any]:
    points = crowd["area"]
    if len(points) == 2:
        (a, b), (c, d) = points
        points = [[a, b], [c, b], [c, d], [a, d]]
    people = None if crowd["count"] is None else float(crowd["count"])
    if people is None and crowd["density"] is not None:
        x, y = np.array(points).T
        people = float(round(crowd["density"] * 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))))
    return {"name": crowd["name"], "points": points, "people": people, "exit": crowd["exit"]}


def faults(scene: Scene) -> list[Fault]:
    """All that is wrong with the plan of a scene, what is fatal first."""
    return [_fault(one) for one in _engine.check_plan(floor(scene))]


def mended(scene: Scene) -> tuple[Scene, list[Fault]]:
    """The scene with its plan mended, in metres, and what was done."""
    new, done = _engine.repair_plan(floor(scene))
    tree = scene.to_dict()
    plan = _metres(tree["plan"][0]) | {"walls": new["walls"]}
    # A mended gate keeps its hours.
    for key in ("door", "exit"):
        plan[key] = [old | gate for old, gate in zip(plan[key], new[key], strict=True)]
    return Scene({**tree, "plan": [plan]}, scene.folder or None), [_fault(one) for one in done]


def _metres(plan: Tree) -> dict[str, Any]:
    """A plan with the places of all that is on it in metres."""
    scale = float(plan["scale"])

    def scaled(x: Any) -> Any:
        return [scaled(part) for part in x] if isinstance(x, list) else scale * x

    places = {"waypoint": ("at",), "stairs": ("area",), "ramp": ("area",), "link": ("from", "to")}
    moved = {
        kind: [{**one, **{key: scaled(one[key]) for key in keys}} for one in plan[kind]]
        for kind, keys in places.items()
    }
    return {**plan, **moved, "scale": 1.0}


def _fault(one: Tree) -> Fault:
    places = tuple((float(x), float(y)) for x, y in one["places"])
    return Fault(one["kind"], one["fatal"], places, one["text"], one["cure"], one["by"])


def picture(floor: Tree, found: Sequence[Fault]) -> bytes:
    """A PNG of the plan with the places of its faults, numbered as in the list."""
    points = np.array([p for wall in floor["walls"] for p in wall] or [[0.0, 0.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    wide, high_ = (max(float(x), 1e-9) for x in high - low)
    with settings():
        figure = Figure(figsize=(9.0, min(max(9.0 * high_ / wide, 2.5), 12.0) + 0.6), layout="constrained")
        axes = figure.add_subplot()
        for wall in floor["walls"]:
            axes.plot(*np.array(wall).T, color=INK, linewidth=1.6, solid_joinstyle="miter")
        for area in floor["start"]:
            axes.fill(*np.array(area["points"]).T, color=PALETTE[1], alpha=0.2, linewidth=0.0)
        for key, color in (("door", PALETTE[0]), ("exit", PALETTE[2])):
            for gate in floor[key]:
                axes.plot(*np.array([gate["from"], gate["to"]]).T, color=color, linewidth=3.0)
        for line in (line for link in floor["link"] for line in link):
            axes.plot(*np.array(line).T, color=PALETTE[3], linewidth=2.0, linestyle="dotted")
        for k, fault in enumerate(found):
            for x, y in fault.places:
                box = {
                    "boxstyle": "circle,pad=0.25",
                    "facecolor": "white",
                    "edgecolor": "red" if fault.fatal else FAINT,
                }
                axes.annotate(
                    str(k + 1), (x, y), (9.0, 9.0), textcoords="offset points", fontsize=7.5, bbox=box,
                    ha="center", va="center",
                    arrowprops={"arrowstyle": "-", "color": "red" if fault.fatal else INK, "linewidth": 0.8},
                )  # fmt: skip
                axes.plot([x], [y], marker="o", markersize=4.0, color="red" if fault.fatal else FAINT)
        axes.set_aspect("equal")
        axes.grid(False)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(f"{len(found)} faults" if len(found) != 1 else "1 fault")
        data = io.BytesIO()
        figure.savefig(data, format="png", dpi=130.0)
        return data.getvalue()
