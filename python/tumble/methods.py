"""Methods of systems, as the engine describes them: each in its file of crates/tumble/src/scene/methods, and nowhere else."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tumble.measures import TABLES


@dataclass(frozen=True)
class Method:
    """What the front needs to know of a method."""

    words: tuple[str, ...]
    """Its words in scenes, the main one first."""
    kinds: tuple[str, ...]
    """Kinds of objects that it can move."""
    noun: str
    """The word for one of its points."""
    own_scheme: str | None
    """Why integrators do not step it; None if they do."""
    has_masses: bool
    """Whether forces move its points."""
    theory: tuple[tuple[str, tuple[str, ...]], ...]
    """Pages of theory, with the equations shown first."""

    @property
    def is_carried(self) -> bool:
        """Whether fields of velocity move its points, under an integrator."""
        return self.own_scheme is None and not self.has_masses


METHODS = [Method(**{**row, "words": tuple(row["words"]), "kinds": tuple(row["kinds"])}) for row in TABLES["methods"]]
"""All methods. Where several can move a kind of objects, the first is its default."""

_BY_WORD = {word: method for method in METHODS for word in method.words}


def of_system(plan: Mapping[str, Any]) -> Method:
    """The method of a system of a resolved scene."""
    return _BY_WORD[plan["method"]]


def of_object(tree: Mapping[str, Any], name: str) -> Method | None:
    """The method that moves an object of a resolved scene; None if none does."""
    things = (thing for method in METHODS for kind in method.kinds for thing in tree[kind] if thing["name"] == name)
    system = next((thing["system"] for thing in things), None)
    return next((of_system(plan) for plan in tree["system"] if plan["name"] == system), None)
