"""From where a run is seen: one camera for all frames, all renderers and the USD file; or one that moves, from a USD file.

Where the scene's camera leaves something open, it stands far enough away for everything to fit in at every frame.
What must fit are the points that lie farthest out in 26 directions, of each object, in up to 200 frames (fewer where
they are large); of many particles those few that have strayed far from the others need not. Floors need not fit;
colliders far larger than what moves need to fit only near it. A two-dimensional scene is seen head-on in parallel
projection.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from tumble._engine import ExportError
from tumble.pictures.surfaces import Floats, unit
from tumble.pictures.things import Recording, moving, objects, positions
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
    """The camera of a run, for pictures of that size; without one, the size that the scene asks for. `points` stands
    in for `outline(run)`, and is called only if the scene leaves something open."""
    words: Mapping[str, object] = run.scene.get("camera", {})
    resolution = words.get("resolution") or (640, 360)
    width, height = size or (int(resolution[0]), int(resolution[1]))  # type: ignore[index]
    wish = _point(words.get("position"))
    target = _point(words.get("target"))
    plane = run.scene.get("dimension", 3) == 2
    extent = np.zeros((1, 3))
    if plane or wish is None or target is None:
        extent = outline(run) if points is None else points()
    middle = 0.5 * (extent.min(axis=0) + extent.max(axis=0))
    if plane:
        return _head_on(run, extent, middle, wish, target, (width, height), _angle(words))
    tan = np.tan(np.radians(0.5 * _angle(words)))
    if wish is not None:
        goal = middle if target is None else target
        if not np.linalg.norm(goal - wish) > 0:
            goal = wish + np.array([0.0, 1.0, 0.0])
        distance = float(np.linalg.norm(goal - wish))
        return Camera(wish, goal, _up(goal - wish), 2 * tan * distance, (width, height))
    goal = middle if target is None else target
    forward = -unit(np.array(FROM_FRONT))
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    up = np.cross(right, forward)
    slopes = np.array([tan, tan * height / width]) / MARGIN
    for _ in range(8):
        d = extent - goal
        depth = d @ forward
        across = np.stack([d @ right, d @ up], axis=1)
        distance = max(float(np.max(np.abs(across) / slopes - depth[:, None])), 1e-9)
        if target is not None:
            break
        # Move the target so that what is seen lies in the middle of the picture.
        seen = across / (depth[:, None] + distance)
        shift = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) * distance
        goal = goal + shift[0] * right + shift[1] * up
    return Camera(goal - distance * forward, goal, np.array([0.0, 0.0, 1.0]), 2 * tan * distance, (width, height))


def views(
    run: Recording, source: str | None, size: tuple[int, int] | None = None, points: Callable[[], Floats] | None = None
) -> Callable[[int], Camera]:
    """The camera at each frame: the scene's, which stands, or that of a USD file (`follow`)."""
    if source is not None:
        return follow(run, source, size, points)
    still = camera(run, size, points)
    return lambda _: still


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


def _head_on(
    run: Recording,
    extent: Floats,
    middle: Floats,
    wish: Floats | None,
    target: Floats | None,
    size: tuple[int, int],
    angle: float,
) -> Camera:
    xy = run.scene.get("plane", "xz") == "xy"
    up = np.array([0.0, 1.0, 0.0] if xy else [0.0, 0.0, 1.0])
    back = np.array([0.0, 0.0, 1.0] if xy else [0.0, -1.0, 0.0])
    goal = middle if target is None else target
    d = np.abs(extent - goal)
    width = 2 * MARGIN * max(float(d[:, 0].max()), float((d @ up).max()) * size[0] / size[1])
    if wish is not None:
        width = 2 * abs(float((wish - goal) @ back)) * np.tan(np.radians(0.5 * angle)) or width
    width = max(width, 1e-9)
    return Camera(goal + 2 * width * back, goal, up, width, size, parallel=True)


def _angle(words: Mapping[str, object]) -> float:
    angle = words.get("view_angle")
    return float(angle) if isinstance(angle, int | float) else 35.0


def _point(words: object) -> Floats | None:
    return None if words is None else np.array(words, dtype=float)


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


def outline(run: Recording) -> Floats:
    """Points that must be in the picture; at least one."""
    found = objects(run)
    radius = {o.name: o.radius if o.form in ("points", "curve", "strands") else 0.0 for o in found}
    parts = []
    some = {0, run.n_frames // 2, run.n_frames - 1} if run.n_frames else set()
    masses = max((sum(len(positions(run.frame(i), o)) for o in moving(found)) for i in some), default=0)
    looks = int(min(run.n_frames, LOOKED_AT, max(5.0, READ / (3 * masses + 1))))
    for i in np.unique(np.linspace(0, run.n_frames - 1, looks).astype(int)):
        columns = run.frame(int(i))
        for o in moving(found):
            x = positions(columns, o)
            x = x[np.isfinite(x).all(axis=1)]
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
