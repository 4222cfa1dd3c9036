"""Runs that were never simulated, for tests of what reads runs: everything follows a formula of time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.looks import GROUND, SOLID, Look, Looks
from tumble.style import PALETTE, rgb

Array = npt.NDArray[Any]
Columns = dict[str, dict[str, Array]]

FPS = 10.0
GREEN = [0.05, 0.5, 0.1]
RED = [0.6, 0.05, 0.05]
BLUE = [0.05, 0.1, 0.6]
BALL = np.array([0.0, 0.0, 0.3])
BALL_RADIUS = 0.3
RADIUS = 0.06
FORMS = {"rope": "curve", "hair": "strands", "sheet": "surface", "net": "surface", "cloth": "surface", "block": "body"}
FORMS |= {"body": "instances", "collider": "solid"}
N = 9
"""Vertices along each side of the sheet."""


@dataclass
class FakeRun:
    """Has what `tumble.Run` has, as far as pictures and exports read it."""

    scene: dict[str, Any]
    static: Columns
    columns: Callable[[float], Columns]
    n_frames: int = 5
    folder: Path = Path("nowhere")
    manifest: dict[str, Any] = field(default_factory=dict)

    def time(self, i: int) -> float:
        return i / FPS

    def frame(self, i: int) -> Columns:
        if not 0 <= i < self.n_frames:
            raise IndexError(i)
        return self.columns(self.time(i))

    @property
    def looks(self) -> Looks:
        """What the engine would say, if its scene were whole."""
        words = {
            entry["name"]: (section, entry)
            for section, entries in self.scene.items()
            if isinstance(entries, list) and section not in ("system", "anchor")
            for entry in entries
        }
        start = self.frame(0) if self.n_frames else {}
        found: list[Look] = []
        for name, columns in {**{name: {} for name in start if name not in self.static}, **self.static}.items():
            section, entry = words.get(name, ("", {}))
            shape = entry.get("shape", {})
            form = "smoke" if self.scene["dimension"] == 3 else "image"
            if "grid_cells" not in columns:
                form = FORMS.get(section, "points")
            if form == "solid":
                form = (
                    "ground" if "floor" in shape or "plane" in shape else "container" if entry.get("inside") else form
                )
            colors = {"smoke": (0.52, 0.53, 0.56), "solid": SOLID, "container": SOLID, "ground": GROUND}
            color = colors.get(form, rgb(PALETTE[sum(look.form not in colors for look in found) % len(PALETTE)]))
            if entry.get("color") is not None:
                color = tuple(entry["color"])
            plane = None
            if form == "ground":
                up = np.array(shape.get("plane", {}).get("normal", [0.0, 0.0, 1.0]))
                point = shape.get("plane", {}).get("point", [0.0, 0.0, shape.get("floor", {}).get("height", 0.0)])
                plane = tuple(point), tuple((up / np.linalg.norm(up)).tolist())
            own = start.get(name, {})
            few = "id" not in own and len(own.get("position", ())) < 200
            leap = next((0.5 * s["vicsek"]["side"] for s in self.scene["system"] if "vicsek" in s), None)
            radius = float(np.ravel(columns.get("radius", 0.01))[0])
            trail = entry.get("trail", 0.0)
            found.append(Look(name, form, color, radius, trail, leap, plane, entry.get("render", 1), few))
        ends = [[end.rsplit(" ", 1) for end in anchor["between"]] for anchor in self.scene.get("anchor", ())]
        return Looks(tuple(found), tuple(((a, int(i)), (b, int(j))) for (a, i), (b, j) in ends))

    @property
    def ledger(self) -> dict[str, Array]:
        t = np.arange(self.n_frames) / FPS
        kinetic = np.sin(3 * t) ** 2
        books = {"frame": np.arange(self.n_frames), "time": t, "mass": np.full(len(t), 2.0)}
        books |= {f"momentum_{axis}": np.sin(t + k) for k, axis in enumerate("xyz")}
        books |= {"kinetic": kinetic, "elastic": 0.25 - 0.25 * kinetic, "external": 0.75 - 0.75 * kinetic}
        return books | {"stretch": 1 + 0.1 * t, "speed": np.abs(np.cos(t)), "contacts": np.arange(len(t))}


def scene(**words: Any) -> dict[str, Any]:
    """The resolved words that every scene has, and more."""
    return {
        "version": 1,
        "title": "a test",
        "dimension": 3,
        "plane": "xz",
        "time": {"fps": FPS, "frames": 4, "exchanges": 1},
        "world": {"gravity": [0.0, 0.0, -9.8]},
        "system": [{"name": "soft", "method": "dynamics"}],
        "camera": {"position": None, "target": None, "view_angle": 35.0, "resolution": [160, 90]},
    } | words


def ball(n: int = 12) -> tuple[Array, Array]:
    """A sphere around BALL: vertices, triangles that run counter-clockwise seen from outside."""
    polar, turn = np.meshgrid(np.linspace(0, np.pi, n + 1)[1:-1], 2 * np.pi * np.arange(2 * n) / (2 * n), indexing="ij")
    rings = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1).reshape(-1, 3)
    vertices = np.concatenate([[[0, 0, 1.0]], rings, [[0, 0, -1.0]]])
    m, last = 2 * n, len(rings) + 1
    triangles = [(0, 1 + j, 1 + (j + 1) % m) for j in range(m)]
    for i in range(n - 2):
        for j in range(m):
            a, b = 1 + i * m + j, 1 + i * m + (j + 1) % m
            triangles += [(a, a + m, b + m), (a, b + m, b)]
    triangles += [(last, last - m + (j + 1) % m, last - m + j) for j in range(m)]
    return BALL + BALL_RADIUS * vertices, np.array(triangles, dtype=np.uint32)


def cube() -> tuple[Array, Array]:
    """A cube of edge 1 around 0, of 8 vertices."""
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))], dtype=np.uint32)


def lattice() -> tuple[Array, Array, Array]:
    """A flat sheet of side 1: vertices, triangles, links."""
    s = np.linspace(-0.5, 0.5, N)
    vertices = np.stack([*np.meshgrid(s, s, indexing="ij"), np.zeros((N, N))], -1).reshape(-1, 3)
    i = np.arange(N * N).reshape(N, N)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    sides = [(i[:-1], i[1:]), (i[:, :-1], i[:, 1:])]
    links = np.concatenate([np.stack([p.ravel(), q.ravel()], 1) for p, q in sides])
    return vertices, triangles.astype(np.uint32), links.astype(np.uint32)


def studio(**more: Any) -> FakeRun:
    """A sheet that waves beside a ball on a floor, a rope above and masses on springs in front."""
    flat, triangles, links = lattice()
    along = np.linspace(0, 1, 20)
    masses = np.array([[-0.9, -0.6, 0.1], [-0.6, -0.6, 0.1], [-0.3, -0.6, 0.1]])

    def columns(t: float) -> Columns:
        wave, speed = 0.1 * np.sin(6 * flat[:, 0] + 5 * t), 0.5 * np.cos(6 * flat[:, 0] + 5 * t)
        zero = np.zeros_like(wave)
        sheet = np.stack([flat[:, 0] + 1.0, wave, flat[:, 1] + 0.6], 1)
        # The rope's masses are stored from its end to its start.
        rope = np.stack([-0.8 + 1.6 * along, 0 * along, 1.2 - 0.4 * t * along * (1 - along)], 1)[::-1]
        slope = np.stack([0 * along, 0 * along, -0.4 * along * (1 - along)], 1)[::-1]
        return {
            "a sheet": {"position": f32(sheet), "velocity": f32(np.stack([zero, speed, zero], 1))},
            "rope": {"position": f32(rope), "velocity": f32(slope)},
            "masses": {
                "position": masses + np.array([0.0, 0.0, 0.1 * t]),
                "velocity": np.tile([0.0, 0.0, 0.1], (3, 1)),
            },
        }

    position, faces = ball()
    floor = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
    words = scene(
        particles=[{"name": "masses", "radius": RADIUS, "color": RED}],
        rope=[{"name": "rope", "radius": 0.03, "color": None}],
        sheet=[{"name": "a sheet", "color": BLUE}],
        collider=[
            {"name": "ball", "shape": {"sphere": {"center": BALL.tolist(), "radius": BALL_RADIUS}}, "color": GREEN},
            {"name": "floor", "shape": {"floor": {"height": 0.0}}, "color": None},
        ],
    )
    static = {
        "a sheet": {"mass": np.ones(N * N), "triangles": triangles, "links": links},
        "rope": {"mass": np.ones(20), "curve": np.arange(20, dtype=np.uint32)[::-1], "radius": np.array([0.03])},
        "masses": {"mass": np.ones(3), "links": np.array([[0, 1], [1, 2]], np.uint32), "radius": np.array([RADIUS])},
        "ball": {"position": position, "triangles": faces},
        "floor": {"position": floor, "triangles": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)},
    }
    return FakeRun(words | more, static, columns)


def one(name: str, section: str, static: dict[str, Array], position: Array, **words: Any) -> FakeRun:
    """A run of one object that stays where it is."""
    return FakeRun(
        scene(**{section: [{"name": name}]}) | words, {name: static}, lambda t: {name: {"position": position}}
    )


def boxes(spin: float = 3.0, **words: Any) -> FakeRun:
    """Two cubes that turn about the vertical through their centres, the second one rising; on a floor."""
    vertices, triangles = cube()

    def columns(t: float) -> Columns:
        half = 0.5 * spin * t
        position = np.array([[0.0, 0.0, 0.5], [3.0, 0.0, 0.5 + 2.0 * t]])
        turn = np.array([[0.0, 0.0, np.sin(half), np.cos(half)], [0.0, 0.0, -np.sin(half), np.cos(half)]])
        velocity, angular = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]), np.array([[0, 0, spin], [0, 0, -spin]])
        moves = {"position": position, "turn": turn, "velocity": velocity, "angular_velocity": angular}
        return {"boxes": {name: f32(x) for name, x in moves.items()}}

    floor = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
    static: Columns = {
        "boxes": {"vertices": f32(vertices), "triangles": triangles, "mass": np.ones(2)},
        "floor": {"position": floor, "triangles": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)},
    }
    named = scene(body=[{"name": "boxes", "color": GREEN}], collider=[{"name": "floor", "shape": {"floor": {}}}])
    return FakeRun(named | words, static, columns)


def f32(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float32)


def fountain(color: bool = True, radius: bool = True, frames: int = 6) -> FakeRun:
    """Droplets that come and go: none at the start; rows in no order; some live shorter than others."""
    born = np.arange(40) / 80  # Two in the first frame after the start, then eight a frame.
    life = np.where(np.arange(40) % 3 == 0, 0.15, 0.4)
    throw = np.stack([np.cos(2.4 * np.arange(40)), np.sin(2.4 * np.arange(40)), np.full(40, 3.0)], 1)

    def columns(t: float) -> Columns:
        age = t - born
        alive = np.flatnonzero((age > 0) & (age < life))
        alive = alive[np.argsort(alive * 7919 % 41)]
        a = age[alive, None]
        fall = np.array([0.0, 0.0, -9.8])
        table = {
            "position": f32(throw[alive] * a + 0.5 * fall * a**2),
            "velocity": f32(throw[alive] + fall * a),
            "id": alive.astype(np.uint32),
            "age": f32(a[:, 0]),
            "heat": f32(300.0 + alive),
        }
        if radius:
            table["radius"] = f32(0.01 + 0.001 * (alive % 5))
        if color:
            table["color"] = f32(np.stack([alive / 40, 0.5 + 0 * alive, 1 - alive / 40], 1))
        return {"spray": table}

    words = scene(emitter=[{"name": "spray", "color": BLUE}])
    static: Columns = {"spray": {} if radius else {"radius": np.array([0.02])}}
    return FakeRun(words, static, columns, n_frames=frames)


def on_grid(cells: tuple[int, ...], flat: int, spacing: float, origin: tuple[float, float, float]) -> dict[str, Array]:
    """Constant columns of a grid object."""
    return {
        "grid_cells": np.array(cells, dtype=np.uint32),
        "grid_spacing": np.array([spacing], dtype=np.float32),
        "grid_origin": np.array(origin),
        "grid_flat": np.array([flat], dtype=np.uint32),
    }


def middles(cells: tuple[int, ...], spacing: float, corner: tuple[float, ...]) -> list[Array]:
    """Coordinates of the middles of cells."""
    axes = [c + spacing * (np.arange(n) + 0.5) for n, c in zip(cells, corner, strict=True)]
    return np.meshgrid(*axes, indexing="ij")


def plume(n: int = 48, **words: Any) -> FakeRun:
    """Smoke that rises from the floor of a box, turning; warm where it is."""
    cells, spacing, corner = (n, n, 2 * n), 1.0 / n, (-0.5, -0.5, 0.0)
    x, y, z = middles(cells, spacing, corner)

    def columns(t: float) -> Columns:
        top = 0.5 + 2.0 * t
        r = 0.07 + 0.1 * z
        cx, cy = 0.06 * np.sin(7 * z - 9 * t), 0.06 * np.cos(7 * z - 9 * t)
        a, b = (x - cx) / r, (y - cy) / r
        wave = 0.5 + 0.5 * np.sin(25 * x + 9 * t) * np.sin(25 * y) * np.sin(21 * z - 30 * t)
        density = np.exp(-(a**2) - b**2) * wave / (1 + np.exp((z - top) / 0.05))
        velocity = np.stack([-3 * (y - cy), 3 * (x - cx), 1 + 0 * x], axis=-1) * np.exp(-(a**2) - b**2)[..., None]
        smoke = {
            "density": density.astype(np.float32).T.copy().T,
            "temperature": (293 + 80 * density).astype(np.float32),
            "pressure": (40 * (z - 1) * np.exp(-(a**2) - b**2)).astype(np.float32),
            "velocity": velocity.astype(np.float32),
        }
        return {"smoke": smoke}

    return FakeRun(scene(**words), {"smoke": on_grid(cells, 3, spacing, corner)}, columns)


def ink(plane: str = "xz", n: int = 64, **words: Any) -> FakeRun:
    """A dye in a plane, turned by a vortex."""
    flat = 2 if plane == "xy" else 1
    cells, spacing = (2 * n, n), 1.0 / n
    corner = (-1.0, 0.2)
    x, y = middles(cells, spacing, corner)
    low = np.insert(np.array(corner), flat, -0.5 * spacing)

    def columns(t: float) -> Columns:
        r = np.hypot(x + 0.1, y - 0.7)
        angle = np.arctan2(y - 0.7, x + 0.1) - 10 * t * np.exp(-8 * r**2)
        density = np.clip(np.sin(3 * angle) * 4, 0, 1) * np.exp(-((r / 0.4) ** 4))
        turning = 10 * np.exp(-8 * r**2)
        velocity = np.stack([-turning * (y - 0.7), turning * (x + 0.1)], axis=-1)
        own = {"density": density, "velocity": velocity, "pressure": -turning, "temperature": 300 + 20 * density}
        return {"dye": {k: v.astype(np.float32) for k, v in own.items()}}

    still = {"dye": on_grid(cells, flat, spacing, (float(low[0]), float(low[1]), float(low[2])))}
    return FakeRun(scene(dimension=2, plane=plane, **words), still, columns)
