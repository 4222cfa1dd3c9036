"""From where a run is seen: one camera for all renderers and the USD file, the scene's or that of a USD file, at the time of
each frame.

Where the scene's camera leaves something open, it stands far enough away for everything to fit in at every frame; where
only its target moves, it moves along.
What must fit are the points that lie farthest out in 26 directions, of each object, in up to 200 frames (fewer where
they are large); of many particles those few that have strayed far from the others need not. Floors need not fit;
colliders far larger than what moves need to fit only near it. A two-dimensional scene is seen head-on in parallel
projection.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from tumble import _engine
from tumble._engine import ExportError, SceneError
from tumble.pictures.surfaces import Floats, placed, unit
from tumble.pictures.things import Object, Recording, moving, objects, positions, turns
from tumble.usd.cameras import Shot
from tumble.usd.cameras import size as of_lens

MARGIN = 1.12
"""Width of the picture over the width of what must fit."""

DIRECTIONS: Floats = unit(np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]))

FROM_FRONT = (0.42, -1.0, 0.40)
"""Direction from which a scene in space is seen."""

MANY = 200
"""Of more particles than these, strays need not fit."""

STRAY = 1.6
"""Distance from the middle of an object, over that within which 95 % of its particles are, beyond which they stray."""

SAMPLE = 5_000
"""Particles of an object that are looked at in a frame, about."""

LOOKED_AT = 200
"""Frames at which the extent is taken, at most."""

READ = 2e7
"""Numbers that are read for it, about."""

SHEER = 1e-6
"""Sine of the angle to the zenith, up to which a view has no upright picture."""


@dataclass(frozen=True)
class Camera:
    """A camera, and the size of the picture it takes."""

    position: Floats
    target: Floats
    up: Floats
    width: float
    """Width of the picture at the target [m]."""
    size: tuple[int, int]
    """Width and height of the picture [pixel]."""
    parallel: bool = False
    lit: "Camera | None" = None
    """The camera by which the light falls, if this one moves and the light stands."""

    @property
    def zenith(self) -> Floats:
        """Where the bright part of the sky is."""
        return self.up if self.lit is None else self.lit.up

    @property
    def distance(self) -> float:
        """From the camera to its target [m]."""
        return float(np.linalg.norm(self.target - self.position))

    @property
    def height(self) -> float:
        """Height of the picture at the target [m]."""
        return self.width * self.size[1] / self.size[0]

    @property
    def view_angle(self) -> float:
        """Horizontal angle of view [°]."""
        return float(np.degrees(2 * np.arctan2(0.5 * self.width, self.distance)))

    @property
    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Unit vectors to the right, up and forward."""
        forward = unit(self.target - self.position)
        right = unit(np.cross(forward, self.up))
        return right, np.cross(right, forward), forward

    @property
    def eye(self) -> Floats:
        """Centre of projection; far away for parallel rays."""
        return self.position - 1e4 * self.distance * self.axes[2] if self.parallel else self.position

    @property
    def pixel(self) -> float:
        """Size of a pixel at the target [m]."""
        return self.width / self.size[0]

    def project(self, points: Floats) -> Floats:
        """Points in the picture: pixels from the left, pixels from the top, distance along the view [m]."""
        right, up, forward = self.axes
        d = np.asarray(points, dtype=float) - self.position
        depth = d @ forward
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = (1.0 if self.parallel else self.distance / depth) / self.pixel
        x = 0.5 * self.size[0] + (d @ right) * scale
        y = 0.5 * self.size[1] - (d @ up) * scale
        return np.stack([x, y, depth], axis=-1)

    def unit(self) -> "Camera":
        """The same picture of a scene that is moved to the origin and scaled: target at 0, camera at distance 1."""
        scale = self.distance
        origin = np.zeros(3)
        return replace(self, position=(self.position - self.target) / scale, target=origin, width=self.width / scale)


def camera(run: Recording, size: tuple[int, int] | None = None, points: Callable[[], Floats] | None = None) -> Camera:
    """The camera of a run at its start, for pictures of that size; without one, the size that the scene asks for. `points`
    stands in for `outline(run)`, and is called only if the scene leaves something open."""
    return views(run, None, size, points)(0)


def views(
    run: Recording, source: str | None, size: tuple[int, int] | None = None, points: Callable[[], Floats] | None = None
) -> Callable[[int], Camera]:
    """The camera at each frame: the scene's, or that of a USD file (`follow`). The light is that of frame 0. Raises
    ExportError."""
    if source is not None:
        return follow(run, source, size, points)
    words: Mapping[str, Any] = run.scene.get("camera", {})
    resolution = words.get("resolution") or (640, 360)
    pixels = size or (int(resolution[0]), int(resolution[1]))
    sights = _sights(run, words)
    plane = run.scene.get("dimension", 3) == 2
    extent = np.zeros((1, 3))
    if plane or sights[0].position is None or sights[0].target is None:
        extent = outline(run) if points is None else points()
    taken = _head_on(run, extent, sights, pixels) if plane else _in_space(extent, sights, pixels)
    first = taken(sights[0])
    if all(sight == sights[0] for sight in sights):
        return lambda _: first
    lit = replace(first, up=first.up if plane else _up(first.target - first.position))
    return lambda i: replace(taken(sights[i]), lit=lit)


def follow(
    run: Recording, source: str, size: tuple[int, int] | None = None, points: Callable[[], Floats] | None = None
) -> Callable[[int], Camera]:
    """The camera of a USD file, FILE or FILE:PRIM, at each frame of a run, for pictures of that size; without one, as wide as
    the scene asks for and as high as the camera has it. The light is that of frame 0. Raises ExportError."""
    if run.scene.get("dimension", 3) == 2:
        raise ExportError(f"{source}: the scene is two-dimensional, and seen head-on; leave the camera out")
    try:
        shot = Shot(source)
    except ValueError as error:
        raise ExportError(f"{source}: {error}") from None
    extent = outline(run) if points is None else points()
    low, high = extent.min(axis=0), extent.max(axis=0)
    words = run.scene.get("camera", {}).get("resolution") or (640, 360)
    pixels = size or of_lens(shot.at(run.time(0)), int(words[0]))

    def taken(i: int) -> Camera:
        lens = shot.at(run.time(i))
        away = max(float((lens.position - 0.5 * (low + high)) @ lens.back), 0.5 * float(np.linalg.norm(high - low)))
        return Camera(lens.position, lens.position - away * lens.back, lens.up, lens.spread * away, pixels)

    first = taken(0)
    lit = replace(first, up=_up(first.target - first.position))
    return lambda i: replace(taken(i), lit=lit)


@dataclass(frozen=True)
class _Sight:
    """What a scene says of its camera at one time."""

    position: tuple[float, ...] | None
    target: tuple[float, ...] | None
    angle: float
    """Horizontal angle of view [°]."""

    @property
    def slope(self) -> float:
        """Half the width of the picture over the distance."""
        return float(np.tan(np.radians(0.5 * self.angle)))

    def goal(self, middle: Floats) -> Floats:
        """The target, by default the middle of everything."""
        return middle if self.target is None else np.array(self.target)


def _sights(run: Recording, words: Mapping[str, Any]) -> list[_Sight]:
    """The scene's camera at each frame, as the engine says it; at least one. Raises ExportError."""
    own = {key: words[key] for key in ("position", "target", "view_angle") if words.get(key) is not None}
    try:
        *points, angles = _engine.sights(own, [run.time(i) for i in range(run.n_frames)] or [0.0])
    except SceneError as error:
        raise ExportError(str(error)) from None
    positions, targets = ([None] * len(angles) if x is None else [tuple(row) for row in x.tolist()] for x in points)
    return [_Sight(*sight) for sight in zip(positions, targets, angles.tolist(), strict=True)]


def _in_space(extent: Floats, sights: list[_Sight], size: tuple[int, int]) -> Callable[[_Sight], Camera]:
    """The camera of a sight. Without a position it goes along with its target, as far away as the narrowest view needs."""
    middle = 0.5 * (extent.min(axis=0) + extent.max(axis=0))
    if sights[0].position is not None:
        # One that ever looks to the side has the zenith up throughout, so that it does not flip on its way to the top.
        steep = all(_up(np.subtract(*_way(sight, middle)))[1] for sight in sights)

        def placed(sight: _Sight) -> Camera:
            goal, wish = _way(sight, middle)
            up = np.array([0.0, 1.0, 0.0] if steep or _sheer(goal - wish) else [0.0, 0.0, 1.0])
            return Camera(wish, goal, up, 2 * sight.slope * float(np.linalg.norm(goal - wish)), size)

        return placed
    slope = min(sight.slope for sight in sights)
    if sights[0].target is None:
        middle, distance = _fitted(extent, middle, slope, size, shift=True)
    else:
        distance = max(_fitted(extent, np.array(x), slope, size)[1] for x in {sight.target for sight in sights})
    away = distance * unit(np.array(FROM_FRONT))

    def fitted(sight: _Sight) -> Camera:
        goal = sight.goal(middle)
        return Camera(goal + away, goal, np.array([0.0, 0.0, 1.0]), 2 * sight.slope * distance, size)

    return fitted


def _way(sight: _Sight, middle: Floats) -> tuple[Floats, Floats]:
    """Target and position of a sight that has one, apart in any case."""
    goal, wish = sight.goal(middle), np.array(sight.position)
    return (goal if np.linalg.norm(goal - wish) > 0 else wish + np.array([0.0, 1.0, 0.0])), wish


def _fitted(
    extent: Floats, goal: Floats, slope: float, size: tuple[int, int], shift: bool = False
) -> tuple[Floats, float]:
    """The target, shifted if asked so that what is seen lies in the middle of the picture, and the distance [m] from where
    everything is seen."""
    forward = -unit(np.array(FROM_FRONT))
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    up = np.cross(right, forward)
    slopes = np.array([slope, slope * size[1] / size[0]]) / MARGIN
    for _ in range(8):
        d = extent - goal
        depth = d @ forward
        across = np.stack([d @ right, d @ up], axis=1)
        distance = max(float(np.max(np.abs(across) / slopes - depth[:, None])), 1e-9)
        if not shift:
            break
        seen = across / (depth[:, None] + distance)
        move = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) * distance
        goal = goal + move[0] * right + move[1] * up
    return goal, distance


def _head_on(run: Recording, extent: Floats, sights: list[_Sight], size: tuple[int, int]) -> Callable[[_Sight], Camera]:
    """The camera of a sight in a plane. Without a position everything fits at all times."""
    xy = run.scene.get("plane", "xz") == "xy"
    up = np.array([0.0, 1.0, 0.0] if xy else [0.0, 0.0, 1.0])
    back = np.array([0.0, 0.0, 1.0] if xy else [0.0, -1.0, 0.0])
    middle = 0.5 * (extent.min(axis=0) + extent.max(axis=0))

    def fitting(goal: Floats) -> float:
        d = np.abs(extent - goal)
        return 2 * MARGIN * max(float(d[:, 0].max()), float((d @ up).max()) * size[0] / size[1])

    whole = max(fitting(goal) for goal in {sight.target: sight.goal(middle) for sight in sights}.values())

    def taken(sight: _Sight) -> Camera:
        goal, width = sight.goal(middle), whole
        if sight.position is not None:
            width = 2 * abs(float((np.array(sight.position) - goal) @ back)) * sight.slope or width
        width = max(width, 1e-9)
        return Camera(goal + 2 * width * back, goal, up, width, size, parallel=True)

    return taken


def _sheer(forward: Floats) -> bool:
    return bool(np.linalg.norm(np.cross(unit(forward), [0.0, 0.0, 1.0])) <= SHEER)


def _up(forward: Floats) -> Floats:
    steep = abs(unit(forward)[2]) > 0.999
    return np.array([0.0, 1.0, 0.0] if steep else [0.0, 0.0, 1.0])


def together(x: Floats) -> Floats:
    """Positions of many particles without those that have strayed; a regular sample of very many."""
    if len(x) <= MANY:
        return x
    x = x[:: max(len(x) // SAMPLE, 1)]
    # Half of the directions: the others are opposite to them.
    off = np.abs((d := x @ DIRECTIONS[:13].T) - np.median(d, axis=0))
    near: Floats = x[(off <= STRAY * np.quantile(off, 0.95, axis=0)).all(axis=1)]
    return near


def _corners(thing: Object) -> int:
    """Points that are looked at for each of its positions."""
    return 1 if thing.vertices is None else len(thing.vertices)


def _outermost(vertices: Floats, x: Floats, turn: Floats) -> Floats:
    """Vertices [m] of those bodies that may lie farthest out in a direction: no body reaches farther than its radius, and each
    at least as far as its centre of mass."""
    out = x @ DIRECTIONS.T
    radius = np.linalg.norm(vertices, axis=1).max()
    some = (out >= out.max(axis=0) - radius).any(axis=1)
    return placed(vertices, x[some], turn[some]).reshape(-1, 3)


def outline(run: Recording) -> Floats:
    """Points that must be in the picture; at least one."""
    found = objects(run)
    radius = {o.name: o.radius if o.form in ("points", "curve", "strands") else 0.0 for o in found}
    parts = []
    some = {0, run.n_frames // 2, run.n_frames - 1} if run.n_frames else set()
    masses = max((sum(len(positions(run.frame(i), o)) * _corners(o) for o in moving(found)) for i in some), default=0)
    looks = int(min(run.n_frames, LOOKED_AT, max(5.0, READ / (3 * masses + 1))))
    for i in np.unique(np.linspace(0, run.n_frames - 1, looks).astype(int)):
        columns = run.frame(int(i))
        for o in moving(found):
            x = positions(columns, o)
            finite = np.isfinite(x).all(axis=1)
            x = x[finite]
            if o.vertices is not None and len(x):
                x = _outermost(o.vertices, x, turns(columns, o)[finite])
            if o.form == "points" and not len(o.links):
                x = together(x)
            if len(x):
                parts.append(x[np.argmax(x @ DIRECTIONS.T, axis=0)] + radius[o.name] * DIRECTIONS)
    bodies = [
        o.position for o in found if o.form in ("solid", "container") and o.position is not None and len(o.position)
    ]
    if parts:
        moved = np.concatenate(parts)
        low, high = moved.min(axis=0), moved.max(axis=0)
        room = np.linalg.norm(high - low)
        bodies = [np.clip(b, low - room, high + room) for b in bodies]
    parts += [b[np.argmax(b @ DIRECTIONS.T, axis=0)] for b in bodies]
    parts += [o.grid.corners for o in found if o.grid is not None]
    extent = np.concatenate(parts) if parts else np.zeros((1, 3))
    if np.ptp(extent, axis=0).max() == 0:
        extent = extent[:1] + 0.5 * DIRECTIONS
    return extent
