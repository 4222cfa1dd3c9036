"""The worlds in which experiments are carried out, and what they have in common."""

from typing import Any

import numpy as np

from tumble._engine import Scene, World
from tumble.lab.exact import Floats

GRAVITY = 9.81
"""[m/s²]"""

Words = dict[str, Any]

BODY, GRAIN = "rigid body", "grain"
KINDS = (BODY, GRAIN)
"""How a ball can be simulated."""


def world(
    things: Words,
    *,
    angle: float = 0.0,
    gravity: float = GRAVITY,
    fps: float = 100.0,
    precision: str = "double",
    step: float | None = None,
    **system: Any,
) -> World:
    """A world of bodies or grains, on a slope of this angle [rad]: z is normal to it, x points down."""
    if step is not None:
        system["step"] = step
    method = "grains" if "grains" in things else "rigid"
    return World(
        Scene(
            {
                "version": 1,
                "precision": precision,
                "time": {"fps": fps},
                "world": {"gravity": [gravity * np.sin(angle), 0.0, -gravity * np.cos(angle)]},
                "system": [{"method": method, **system}],
                "output": {"columns": ["position", "velocity", "angular_velocity"]},
                **things,
            }
        ),
        # Nothing is gained by sharing out a few bodies.
        threads=None if method == "grains" and "fill" in things["grains"][0] else 1,
    )


def floor(friction: float, **more: Any) -> Words:
    """The plane z = 0."""
    return {"name": "floor", "shape": {"floor": {}}, "friction": friction, **more}


def block(name: str, center: list[float], size: list[float], friction: float, **more: Any) -> Words:
    """A box that nothing moves but its keys."""
    return {"name": name, "shape": {"box": {"center": center, "size": size}}, "friction": friction, **more}


def ball(kind: str, radius: float, **more: Any) -> Words:
    """A single ball of the name `ball`, as a body or as a grain, with its surface at z = 0 unless a position is given."""
    words = {"name": "ball", "position": [[0.0, 0.0, radius]], **more}
    if kind == BODY:
        return {"body": [{"shape": {"sphere": {"radius": radius}}, **words}]}
    return {"grains": [{"radius": radius, **words}]}


def now(world: World, column: str, name: str = "ball", index: int = 0) -> Floats:
    """A row of a column of an object."""
    return np.asarray(world.frame[name][column][index], dtype=float)
