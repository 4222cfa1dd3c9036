"""Flow, density and speed at a gate from the ways of people, as PedPy has them.

N(t) counts who has crossed a line, each person once. The Voronoi cell of a person is what of the floor is nearer to it than to
others and is joined to its place within the cell; its density is one over the area of that (crowds.13) [steffen2010]. Cells are
counted on squares of SIDE: the error of a mean over some seconds is below 1 %.
"""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.bottlenecks.passages import Floats
from tumble.bottlenecks.paths import Walk

SIDE = 0.05
"""Of a square on which Voronoi cells are counted [m]."""

REACH = 2.0
"""Beyond this from its person [m] a Voronoi cell ends."""

BEFORE = 0.5
"""Half the depth of the area at a gate in which density and speed are measured [m]."""

STEP = 5
"""Frames before and after one between which a speed is taken."""

Bools = npt.NDArray[np.bool_]


def crossings(walk: Walk, line: Floats) -> Floats:
    """The first frames behind a line of who crosses it, sorted. `line` is 2 x 2 [m]."""
    if len(walk.x) < 2:
        return np.zeros(0)
    a, b = walk.x[:-1], walk.x[1:]
    p, q = line
    same = (walk.person[1:] == walk.person[:-1]) & (walk.frame[1:] == walk.frame[:-1] + 1)

    def side(u: Floats, v: Floats, w: Floats) -> Floats:
        d, e = v - u, w - u
        return np.asarray(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0])

    before, after = side(p, q, a), side(p, q, b)
    # From one side, or from the line, to another: who stops on it has not crossed yet.
    through = (before * after < 0.0) | ((before == 0.0) & (after != 0.0))
    within = side(a, b, p) * side(a, b, q) <= 0.0
    rows = np.flatnonzero(same & through & within)
    _, first = np.unique(walk.person[rows], return_index=True)
    return np.sort(walk.frame[rows + 1][first]).astype(float)


def n_t(walk: Walk, line: Floats) -> npt.NDArray[np.int64]:
    """How many have crossed a line, at each frame from the first to the last."""
    found = crossings(walk, line)
    frames = np.arange(walk.frame.min(), walk.frame.max() + 1)
    return np.searchsorted(found, frames, side="right")


def flow(walk: Walk, line: Floats) -> float:
    """Persons a second [1/s] from the first to the last who crosses a line; nan of fewer than two."""
    found = crossings(walk, line)
    if len(found) < 2 or found[-1] == found[0]:
        return math.nan
    return float((len(found) - 1) / (found[-1] - found[0]) * walk.fps)


def speeds(walk: Walk, step: int = STEP) -> Floats:
    """The speed of each row [m/s]: of the way from `step` frames before to `step` after, or as many as there are, the same to
    both sides; at the ends of a way to one side."""
    n = len(walk.x)
    found = np.zeros(n)
    starts = np.flatnonzero(np.concatenate([[True], walk.person[1:] != walk.person[:-1]])) if n else np.zeros(0, int)
    for low, high in zip(starts, [*starts[1:], n], strict=True):
        k = np.arange(low, high)
        reach = np.minimum(np.minimum(k - low, high - 1 - k), step)
        first, last = k - reach, k + reach
        alone = reach == 0
        first, last = (
            np.where(alone & (k > low), k - 1, first),
            np.where(alone & (k == low), np.minimum(k + 1, high - 1), last),
        )
        way = np.hypot(*(walk.x[last] - walk.x[first]).T)
        time = (walk.frame[last] - walk.frame[first]) / walk.fps
        found[low:high] = np.where(time > 0.0, way / np.where(time > 0.0, time, 1.0), 0.0)
    return found


class Ground:
    """Squares of a floor around an area, and which of them are joined: no wall runs between them."""

    def __init__(self, walls: Iterable[Floats], area: Floats, reach: float = REACH, side: float = SIDE) -> None:
        """`area` is a convex polygon, n x 2 [m]."""
        # A cell that reaches into the area is that of a person within reach of it, and goes as far beyond.
        low, high = area.min(axis=0) - 2.0 * reach, area.max(axis=0) + 2.0 * reach
        self.side, self.reach = side, reach
        nx, ny = np.ceil((high - low) / side).astype(int)
        # So that squares lie evenly on both sides of the middle of the area.
        self.low = 0.5 * (low + high) - 0.5 * side * np.array([nx, ny])
        x, y = (self.low[a] + side * (np.arange(n) + 0.5) for a, n in ((0, nx), (1, ny)))
        self.x = np.stack(np.meshgrid(x, y), axis=-1)
        self.inside = _inside(self.x, area)
        self.right, self.up = np.ones((ny, nx - 1), bool), np.ones((ny - 1, nx), bool)
        for wall in walls:
            for p, q in pairwise(wall):
                self.right &= ~_cross(self.x[:, :-1], self.x[:, 1:], p, q)
                self.up &= ~_cross(self.x[:-1], self.x[1:], p, q)

    def cells(self, places: Floats) -> npt.NDArray[np.int64]:
        """Whose Voronoi cell each square is in: a row of `places`, or -1."""
        ny, nx, _ = self.x.shape
        owner = np.full((ny, nx), -1)
        if not len(places):
            return owner
        best = np.full((ny, nx), self.reach * self.reach)
        for k, place in enumerate(places):
            low = np.floor((place - self.reach - self.low) / self.side).astype(int).clip(0)
            high = np.ceil((place + self.reach - self.low) / self.side).astype(int).clip(0)
            part = (slice(low[1], high[1]), slice(low[0], high[0]))
            d = self.x[part] - place
            far = d[..., 0] ** 2 + d[..., 1] ** 2
            nearer = far < best[part]
            best[part][nearer], owner[part][nearer] = far[nearer], k
        return np.where(self._joined(places, owner), owner, -1)

    def _joined(self, places: Floats, owner: npt.NDArray[np.int64]) -> Bools:
        """Squares from which a way within the cell leads to its person."""
        ny, nx = owner.shape
        right = self.right & (owner[:, :-1] == owner[:, 1:])
        up = self.up & (owner[:-1] == owner[1:])
        joined = np.zeros((ny, nx), bool)
        at = np.floor((places - self.low) / self.side).astype(int)
        for k, (i, j) in enumerate(at):
            if 0 <= i < nx and 0 <= j < ny and owner[j, i] == k:
                joined[j, i] = True
        while True:
            count = np.count_nonzero(joined)
            for _ in range(8):
                joined[:, 1:] |= joined[:, :-1] & right
                joined[:, :-1] |= joined[:, 1:] & right
                joined[1:] |= joined[:-1] & up
                joined[:-1] |= joined[1:] & up
            if np.count_nonzero(joined) == count:
                return joined


def _inside(x: Floats, area: Floats) -> Bools:
    """Which points are in a convex polygon."""
    d = np.roll(area, -1, axis=0) - area
    turns = [d[k, 0] * (x[..., 1] - area[k, 1]) - d[k, 1] * (x[..., 0] - area[k, 0]) for k in range(len(area))]
    return np.asarray(np.all(np.array(turns) >= 0.0, axis=0) | np.all(np.array(turns) <= 0.0, axis=0))


def _cross(a: Floats, b: Floats, p: Floats, q: Floats) -> Bools:
    """Which of many segments a segment crosses, or touches."""

    def side(u: Floats, v: Floats, w: Floats) -> Floats:
        d, e = v - u, w - u
        return np.asarray(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0])

    return (side(p, q, a) * side(p, q, b) <= 0.0) & (side(a, b, p) * side(a, b, q) <= 0.0)


def voronoi(
    walk: Walk,
    walls: Sequence[Floats],
    area: Floats,
    frames: Iterable[int],
    step: int = STEP,
    ground: Ground | None = None,
) -> tuple[Floats, Floats]:
    """Density [1/m²] and speed [m/s] in an area at some frames: the sums of A_i/(A(V_i) A) and v_i A_i/A over persons, A_i
    being what of their cells V_i is in the area A. `walls` are lines, n x 2 [m]."""
    ground = ground or Ground(walls, area)
    own, whole = speeds(walk, step), np.count_nonzero(ground.inside)
    margin = 3.0 * ground.reach
    near = ((walk.x >= area.min(axis=0) - margin) & (walk.x <= area.max(axis=0) + margin)).all(axis=1)
    density, speed = [], []
    for frame in frames:
        rows = np.flatnonzero((walk.frame == frame) & near)
        owner = ground.cells(walk.x[rows])
        n = len(rows)
        sizes = np.bincount(owner[owner >= 0], minlength=n)
        there = np.bincount(owner[ground.inside & (owner >= 0)], minlength=n)
        seen = there > 0
        area_of = whole * ground.side**2
        density.append(float(np.sum(there[seen] / sizes[seen])) / area_of)
        speed.append(float(np.sum(own[rows] * there)) / whole)
    return np.array(density), np.array(speed)


def before(line: Floats, depth: float = BEFORE) -> Floats:
    """The rectangle on both sides of a gate in which density and speed are measured, 4 x 2 [m]."""
    (p, q), along = line, line[1] - line[0]
    across = depth * np.array([-along[1], along[0]]) / np.hypot(*along)
    return np.array([p - across, q - across, q + across, p + across])


@dataclass(frozen=True)
class Series:
    """A gate over time."""

    gate: str
    times: Floats
    """[s]"""
    crossed: npt.NDArray[np.int64]
    density: Floats
    """[1/m²]"""
    speed: Floats
    """[m/s]"""
    flow: float
    """From the first to the last [1/s]."""


def series(walk: Walk, plan: Mapping[str, Any], stride: int) -> list[Series]:
    """N(t), Voronoi density and speed at all doors and exits of a plan, every `stride` frames."""
    scale = float(plan["scale"])
    walls = [scale * np.array(wall, float) for wall in plan["walls"]]
    first, last = (int(walk.frame.min()), int(walk.frame.max())) if len(walk.frame) else (0, 0)
    frames = np.unique([*range(first, last + 1, stride), last])
    found = []
    for gate in [*plan["door"], *plan["exit"]]:
        line = scale * np.array([gate["from"], gate["to"]], float)
        density, speed = voronoi(walk, walls, before(line), frames.tolist())
        crossed = n_t(walk, line)[frames - first]
        found.append(Series(str(gate["name"]), frames / walk.fps, crossed, density, speed, flow(walk, line)))
    return found


def table(found: Sequence[Series]) -> str:
    """Of all gates as CSV: a line for each gate and time."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["gate", "time [s]", "crossed", "density [1/m2]", "speed [m/s]"])
    for own in found:
        rows = zip(own.times.tolist(), own.crossed.tolist(), own.density.tolist(), own.speed.tolist(), strict=True)
        writer.writerows([own.gate, *row] for row in rows)
    return text.getvalue()
