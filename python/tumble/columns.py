"""Columns and kinds of objects, as the engine describes them: each is described in columns.rs and kinds.rs of
crates/tumble-interface/src/ and nowhere else."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tumble.measures import TABLES


@dataclass(frozen=True)
class Column:
    """A column of an object."""

    name: str
    unit: str
    """SI unit, "1" for a pure number."""
    doc: str
    places: tuple[str, ...]
    """What its rows belong to: object, mass, link, triangle, frame, cell, face."""
    width: int
    """Numbers a row; on a grid a vector has as many as the grid has axes."""
    signed: bool
    in_frames: bool
    """Whether frames have it; else it is part of what does not change."""
    asked: bool
    """Whether `output.columns` must ask for it."""
    fog: bool
    """Whether it is an amount of matter in a volume."""


@dataclass(frozen=True)
class Kind:
    """A kind of objects."""

    name: str
    """Its table in a scene."""
    doc: str
    matter: str
    """What it consists of: masses, cells, solid."""
    bound: bool
    """Whether elements bind its masses, always or where asked for."""
    surface: bool
    """Whether it is a surface of masses."""
    resolution: str | None
    """The word that says how finely it is divided."""
    amounts: tuple[str, ...]
    """Words for amounts of what it consists of."""


COLUMNS = {row["name"]: Column(**{**row, "places": tuple(row["places"])}) for row in TABLES["columns"]}
KINDS = {row["name"]: Kind(**{**row, "amounts": tuple(row["amounts"])}) for row in TABLES["kinds"]}

OBJECTS = tuple(kind.name for kind in KINDS.values() if kind.matter != "solid")
"""Kinds that systems move."""

GRIDS = tuple(kind.name for kind in KINDS.values() if kind.matter == "cells")
"""Kinds that lie on grids."""

BOUND = tuple(kind.name for kind in KINDS.values() if kind.bound)
"""Kinds that are made of masses and what binds them."""

FACES = tuple(column.name for column in COLUMNS.values() if "face" in column.places)
SIGNED = tuple(
    column.name for column in COLUMNS.values() if column.signed and column.width == 1 and "cell" in column.places
)
"""Numbers on cells that are shown around zero."""
FOG = tuple(column.name for column in COLUMNS.values() if column.fog)


def unit(name: str) -> str:
    """The unit of a column; of a user's own "1"."""
    return COLUMNS[name].unit if name in COLUMNS else "1"


def on_grids(scene: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Kind and words of each object of a scene that lies on a grid."""
    return [(kind, thing) for kind in GRIDS for thing in scene[kind]]
