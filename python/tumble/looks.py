"""How objects are drawn, as the engine says it: forms, and what all fronts draw alike, are described in looks.rs of
crates/tumble-interface/src/ and nowhere else; which object has which look is said by the methods that move them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tumble import _engine
from tumble.measures import TABLES
from tumble.style import Rgb

Point = tuple[float, float, float]

End = tuple[str, int]
"""A mass: name of the object, and row."""


@dataclass(frozen=True)
class Form:
    """A form in which objects are drawn."""

    name: str
    doc: str
    matter: str
    """What its objects consist of: masses, whose positions are in the frames, cells, solid."""


@dataclass(frozen=True)
class Look:
    """How an object is drawn."""

    object: str
    """Its name."""
    form: str
    """One of FORMS."""
    color: Rgb
    """Its colour, where its parts have none of their own."""
    radius: float = 0.01
    """Radius of points and curves [m], where points have none of their own."""
    trail: float = 0.0
    """How long points leave a trail behind them [s]."""
    leap: float | None = None
    """A step farther than this [m] is none: points leave a periodic square and enter it again, people change floors."""
    plane: tuple[Point, Point] | None = None
    """A point and the unit normal of a ground, where it is not turned or moved."""
    strands: int = 1
    """Strands that are drawn for each that moves."""
    few: bool = False
    """Whether its masses are so few that it is drawn thicker."""


@dataclass(frozen=True)
class Looks:
    """All that is drawn of a scene."""

    objects: tuple[Look, ...]
    """In the order of their columns; colliders last."""
    anchors: tuple[tuple[End, End], ...] = ()
    """The ends of each anchor that pulls."""


FORMS = {row["name"]: Form(**row) for row in TABLES["forms"]}
MASSES = tuple(form.name for form in FORMS.values() if form.matter == "masses")
"""Forms of what has positions in the frames."""
CELLS = tuple(form.name for form in FORMS.values() if form.matter == "cells")
"""Forms of what lies on grids."""

_CONSTANTS = {row["name"]: row["value"] for row in TABLES["looks"]}

SOLID: Rgb = tuple(_CONSTANTS["solid"])
"""Colour of solids that have none, of anchors and of lines around grids."""
GROUND: Rgb = tuple(_CONSTANTS["ground"])
"""Colour of grounds that have none."""
SHOWN: tuple[str, ...] = tuple(_CONSTANTS["shown"])
"""Column shown of a grid: the first of these that is in the frames and not uniform."""
MAPS: dict[str, str] = dict(_CONSTANTS["maps"])
"""Matplotlib's maps of colours for columns of grids; of all others viridis."""
GLOWING: float = _CONSTANTS["glowing"]
"""A gas that gets hotter than this [K] in a run is seen to glow."""
TRAIL: float = _CONSTANTS["trail"]
"""Radius of trails over the radius of the points that leave them."""
SPRING: float = _CONSTANTS["spring"]
"""Radius of springs over the radius of the points that they join."""
SHADE: float = _CONSTANTS["shade"]
"""How bright springs and trails are over the points that they belong to."""
DRAWN_ON: float = _CONSTANTS["drawn_on"]
"""How bright links are over the surface that they are drawn on."""


def of(scene: Mapping[str, Any]) -> Looks:
    """What is drawn of a resolved scene. Raises SceneError where its words are those of another version."""
    found = _engine.looks(dict(scene))
    objects = [Look(**row | {"color": tuple(row["color"]), "plane": _plane(row["plane"])}) for row in found["objects"]]
    anchors = [tuple((name, row) for name, row in ends) for ends in found["anchors"]]
    return Looks(tuple(objects), tuple((a, b) for a, b in anchors))


def _plane(words: Any) -> tuple[Point, Point] | None:
    if words is None:
        return None
    point, normal = words
    return tuple(point), tuple(normal)
