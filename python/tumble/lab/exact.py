"""Exact solutions of linear scenes, y' = G y + b: springs of rest length zero, and particles in fields."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import World

Floats = npt.NDArray[np.float64]
Tree = dict[str, Any]


def exponential(matrix: Floats) -> Floats:
    """exp(A), by Taylor's series of A/2^k, squared k times."""
    size = float(np.abs(matrix).sum(axis=1).max(initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(size))) + 2) if size > 0 else 0
    small = matrix / 2.0**halvings
    term = total = np.eye(len(matrix))
    for k in range(1, 19):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


@dataclass(frozen=True)
class Linear:
    """The solution of y' = G y + b from `start`; a column of y for each coordinate, or each tracer."""

    generator: Floats
    """G and below it a row of zeros for each column of b."""
    start: Floats
    """y, and below it the constants that b multiplies."""
    rest: Floats
    """Positions n x 3; those that do not move stay as they are."""
    moving: npt.NDArray[np.intp]
    by_column: bool
    """Whether a tracer is a column of y, not a row."""

    def at(self, t: float) -> Floats:
        """Positions [m] at time t [s], n x 3."""
        y = exponential(self.generator * t) @ self.start
        x = self.rest.copy()
        x[self.moving] = y[:3].T if self.by_column else y[: len(self.moving)]
        return x


def field_matrix(fields: list[Tree]) -> tuple[Floats, Floats] | None:
    """A and b of u(x) = A x + b (integrators.15); None where a field is not linear."""
    a, b = np.zeros((3, 3)), np.zeros(3)
    for field in fields:
        kind = field["kind"]
        if kind not in ("uniform", "swirl", "sink") or not is_constant(
            field["velocity" if kind == "uniform" else "rate"]
        ):
            return None
        if kind == "uniform":
            b += field["velocity"]
            continue
        center = np.asarray(field.get("center") or [0.0] * 3, dtype=float)
        rate = float(field["rate"])
        if kind == "swirl":
            axis = np.asarray(field.get("axis") or [0.0, 0.0, 1.0], dtype=float)
            w = rate * axis / np.linalg.norm(axis)
            part = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        else:
            part = -rate * np.eye(3)
        a += part
        b -= part @ center
    return a, b


def is_constant(value: Any) -> bool:
    """Whether an animated value is a number, or a vector of numbers, and neither formula nor keyframes."""
    parts = value if isinstance(value, list) else [value]
    return all(isinstance(part, int | float) for part in parts)


def carried(fields: list[Tree], positions: Floats) -> Linear | None:
    """The paths of massless particles in linear fields."""
    matrix = field_matrix(fields)
    if matrix is None:
        return None
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = matrix
    start = np.vstack([positions.T, np.ones(len(positions))])
    return Linear(generator, start, positions, np.arange(len(positions)), True)


def springs(tree: Tree, world: World) -> Linear | None:
    """The motion of one object of undamped springs of rest length zero, f = k (b - a) (springs.1), under gravity,
    uniform accelerations and drag; None where anything of the scene is not linear."""
    things = [len(tree[kind]) for kind in ("rope", "sheet", "block", "net", "cloth", "anchor", "collider")]
    if any(things) or len(tree["particles"]) != 1 or tree["dimension"] != 3 or len(world.systems) != 1:
        return None
    if any(system.get("clamp") for system in tree["system"]):
        return None
    thing = tree["particles"][0]
    if not all(_is_linear(s) for s in thing["spring"]) or len(thing["position"]) > 64:
        return None
    name = thing["name"]
    columns, topology = world.columns("position", "velocity")[name], world.topology[name]
    x, v = (np.asarray(columns[c], dtype=float) for c in ("position", "velocity"))
    mass = np.asarray(topology["mass"], dtype=float)
    pinned = np.zeros(len(x), dtype=bool)
    pinned[np.asarray(topology.get("pinned", []), dtype=int)] = True
    moving = np.flatnonzero(~pinned)
    if not is_constant(tree["world"]["gravity"]) or thing["load"] or thing["point_mass"]:
        return None
    constant = np.tile(np.asarray(tree["world"]["gravity"], dtype=float), (len(x), 1))
    drag = np.zeros(len(x))
    for force in tree["force"]:
        if force.get("on") is not None and name not in force["on"]:
            continue
        if (
            force["kind"] == "drag"
            and not force.get("quadratic")
            and is_constant([force["coefficient"], force["rate"]])
        ):
            drag += force["coefficient"] / mass + force["rate"]
        elif force["kind"] == "acceleration" and is_constant(force["value"]):
            constant = constant + np.asarray(force["value"], dtype=float)
        else:
            return None
    stiffness = np.zeros((len(x), len(x)))
    for spring in thing["spring"]:
        i, j = spring["between"]
        stiffness[[i, j, i, j], [i, j, j, i]] += spring["stiffness"] * np.array([1.0, 1.0, -1.0, -1.0])
    rates = -stiffness / mass[:, None]
    constant = constant + rates[:, pinned] @ x[pinned]
    n = len(moving)
    generator = np.zeros((2 * n + 3, 2 * n + 3))
    generator[:n, n : 2 * n] = np.eye(n)
    generator[n : 2 * n, :n] = rates[np.ix_(moving, moving)]
    generator[n : 2 * n, n : 2 * n] = -np.diag(drag[moving])
    generator[n : 2 * n, 2 * n :] = constant[moving]
    start = np.vstack([x[moving], v[moving], np.eye(3)])
    return Linear(generator, start, x, moving, False)


def _is_linear(spring: Tree) -> bool:
    plain = not (spring["damping"] or spring["hardening"] or spring["tension_only"] or spring["break_strain"])
    return plain and spring["rest_length"] == 0
