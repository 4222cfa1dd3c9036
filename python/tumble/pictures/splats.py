"""Clouds of particles, painted over the picture of everything else: thousands to a million in a second or less.

By day (`discs`) each particle is a small lit ball. Balls are found in pixels that are divided 3 x 3: of all that cover
a point the nearest wins, unless the scenery is nearer still. They shade each other and the ground through a map of the
particles between a point and the key light, in layers.

By night (`glow`) particles are lights: Gaussian spots that add up, whatever their order, and bloom. The sum is
compressed by asinh, which keeps colours (Lupton et al. 2004).

Depth is along the view, as `Camera.project` has it; cameras are those of `Camera.unit`.
"""

import numpy as np
import numpy.typing as npt

from tumble.pictures.drawn import Body, Cloud, Ground, Thing, as_triangles
from tumble.pictures.framing import Camera
from tumble.pictures.look import NIGHT, SHADOW, fading, key_light, soften
from tumble.pictures.surfaces import Floats, unit

Ints = npt.NDArray[np.int64]

NEAR = 0.02
"""Nothing nearer to the camera is drawn."""

THIN = 0.02
"""Scenery this much nearer than all around it, within two pixels, is thin; in distances of the camera."""

LONG = 400.0
"""Triangles with longer sides than these, in pixels, are wide."""
WIDE = 100
"""Up to so many wide triangles of a thing are met by each line of sight."""

CHUNK = 1 << 21
"""Pieces of balls that are looked at together."""

CELLS = 192
"""Cells of the map of shadows, each way, and LAYERS of it along the light."""
LAYERS = 16

DIM = 0.012
"""How much of the daylight is left of the scenery by night."""

BRIGHT = 1.2
"""Light in the middle of a glowing particle, over its colour."""

CONTRAST = 3.0
"""Light at which brightness grows logarithmically rather than linearly, as an inverse."""

WHITEST = 6.0
"""Light that is as bright as a screen can be."""

COARSEST = 1.5
"""Larger spots [pixel] are drawn in coarser pictures."""

BLOOM = (0.05, 0.05, 0.035, 0.025)
"""Share of the light that is scattered, over 2, 4, 8 and 16 pixels of a picture 640 pixels wide, about."""


# Scenery


def depths(things: list[Thing], camera: Camera) -> Floats:
    """How far away the scenery is in each pixel, infinite where there is none; height x width."""
    width, height = camera.size
    found = np.full(width * height, np.inf)
    for thing in things:
        if isinstance(thing, Ground):
            rays, start = sights(camera)
            with np.errstate(divide="ignore", invalid="ignore"):
                away = np.sum((thing.point - start) * thing.normal, axis=-1) / (rays @ thing.normal)
            away = away.ravel()
            found = np.where(away > NEAR, np.minimum(found, away), found)
        elif isinstance(thing, Body):
            _hide(found, thing, camera)
    return found.reshape(height, width)


def sights(camera: Camera) -> tuple[Floats, Floats]:
    """Rays of sight through the middles of pixels, of length 1 along the view, and where they start; each height x
    width x 3."""
    width, height = camera.size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width - 0.5, 0.5 - (np.arange(height) + 0.5) / height)
    right, up, forward = camera.axes
    across = x[..., None] * right * camera.width + y[..., None] * up * camera.height
    if camera.parallel:
        return np.broadcast_to(forward, across.shape), camera.position + across
    return forward + across / camera.distance, np.broadcast_to(camera.position, across.shape)


def _hide(found: Floats, thing: Body, camera: Camera) -> None:
    """Lowers depths to those of a thing: points all over its triangles, so close together that there is one near the
    middle of each pixel. Others do not count, or edges would hide what is behind the half of a pixel beside them."""
    vertices, triangles, _ = as_triangles(thing, 1)
    if not len(triangles):
        return
    width, height = camera.size
    corners = vertices[triangles]
    seen = camera.project(vertices)[triangles]
    whole = np.asarray((seen[..., 2] > NEAR).all(axis=1))
    sides = np.linalg.norm((np.roll(seen, -1, axis=1) - seen)[..., :2], axis=2)
    # The longest side first: points lie in rows along it.
    turn = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3
    corners, seen = (np.take_along_axis(x, turn[..., None], axis=1) for x in (corners, seen))
    edges = sides.max(axis=1)
    # Points on those that are wider would be too far apart, or too many.
    wide = np.asarray(~whole | (edges > LONG))
    if wide.sum() <= WIDE:
        for triangle in corners[wide]:
            _cut(found, triangle, camera)
        whole, corners, seen, edges = whole[~wide], corners[~wide], seen[~wide], edges[~wide]
    (ax, ay), (bx, by) = (seen[:, 1] - seen[:, 0])[:, :2].T, (seen[:, 2] - seen[:, 0])[:, :2].T
    with np.errstate(invalid="ignore"):
        high = np.nan_to_num(np.abs(ax * by - ay * bx) / np.maximum(edges, 1e-12))
    fine, rows = (
        1 << np.ceil(np.log2(np.where(whole, np.clip(length / 0.45, 1, 1024), 512))).astype(int)
        for length in (edges, high)
    )
    outside = (seen[..., :2].max(axis=1) < 0).any(axis=1) | (seen[..., :2].min(axis=1) > (width, height)).any(axis=1)
    fine[whole & outside] = 0
    fine[(seen[..., 2] <= NEAR).all(axis=1)] = 0
    for n, m in np.unique(np.stack([fine, rows], axis=1)[fine > 0], axis=0).tolist():
        i, j = (w / d for w, d in zip(np.indices((n + 1, m + 1)), (n, m), strict=True))
        if n == m:
            i, j = (w[np.add(*np.indices((n + 1, n + 1))) <= n] for w in (i, j))
            weights = np.stack([i, j, 1 - i - j], axis=1)
        else:
            weights = np.stack([(1 - j) * (1 - i), (1 - j) * i, j], axis=-1).reshape(-1, 3)
        some = corners[(fine == n) & (rows == m)]
        for begin in range(0, len(some), max(CHUNK // len(weights), 1)):
            part = some[begin : begin + max(CHUNK // len(weights), 1)]
            x, y, z = camera.project(np.einsum("wk,tkd->twd", weights, part).reshape(-1, 3)).T
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (z > NEAR)
            inside &= (np.abs(x % 1 - 0.5) < 0.3) & (np.abs(y % 1 - 0.5) < 0.3)
            np.minimum.at(found, y[inside].astype(int) * width + x[inside].astype(int), z[inside])


def _cut(found: Floats, triangle: Floats, camera: Camera) -> None:
    """Lowers depths to where lines of sight go through a triangle."""
    rays, start = (x.reshape(-1, 3) for x in sights(camera))
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = (triangle[0] - start) @ normal / (rays @ normal)
        place = start + rays * away[:, None]
        inside = np.asarray(away > NEAR)
        for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            inside &= (place - a) @ np.cross(normal, b - a) >= 0
    found[inside] = np.minimum(found[inside], away[inside])


# Day


def discs(light: Floats, depth: Floats, clouds: list[Cloud], camera: Camera) -> Floats:
    """A picture in linear light, height x width x 3, with clouds of lit balls added."""
    x, r, color = (np.concatenate([getattr(c, name) for c in clouds]) for name in ("centers", "radii", "colors"))
    shade = Shade(x, r, camera)
    shown = light * shade.on(depth, camera)[..., None]
    shown = _ways(shown, depth, clouds, camera)
    width, height = camera.size
    split = 3 if width * height <= 1_000_000 else 2
    seen = camera.project(x)
    size = _pixels(r, seen[:, 2], camera)
    ahead = (seen[:, 2] > NEAR) & np.isfinite(seen).all(axis=1)
    ahead &= (np.abs(seen[:, 0] - 0.5 * width) < 0.5 * width + size) & (
        np.abs(seen[:, 1] - 0.5 * height) < 0.5 * height + size
    )
    # From the farthest to the nearest, so that of the balls at a point the one with the highest number wins.
    order = np.flatnonzero(ahead)
    order = order[np.argsort(-seen[order, 2], kind="stable")]
    if not len(order):
        return shown
    at, size, x, r, color = seen[order], size[order], x[order], r[order], color[order]
    nearest = _nearest(at, size, r, _inside(depth), split)
    where = np.flatnonzero(nearest)
    ball = nearest[where] - 1
    row, column = np.divmod(where, split * width)
    a = ((column + 0.5) / split - at[ball, 0]) / size[ball]
    b = (at[ball, 1] - (row + 0.5) / split) / size[ball]
    c = np.sqrt(np.maximum(1 - a * a - b * b, 0.0))
    right, up, forward = camera.axes
    lit = shade.at(x)[ball]
    # All directions are fixed, so that facing them takes three products each.
    key = key_light(camera)
    rim = unit(right + 0.55 * forward + 0.4 * up)
    half = unit(key - forward)

    def facing(direction: Floats) -> Floats:
        towards = a * float(direction @ right) + b * float(direction @ up) - c * float(direction @ forward)
        return np.asarray(np.maximum(towards, 0.0))

    bright = 0.34 + 0.1 * b + 0.95 * lit * facing(key) + 0.12 * facing(rim)
    gloss = 0.22 * lit * facing(half) ** 24
    piece = soften(np.maximum(color[ball] * bright[:, None] + gloss[:, None], 0.0))
    pixel = row // split * width + column // split
    share = 1 / split**2
    n = width * height
    cover = np.bincount(pixel, minlength=n) * share
    added = np.stack([np.bincount(pixel, piece[:, k], n) for k in range(3)], axis=1) * share
    return np.asarray(shown * (1 - cover.reshape(height, width, 1)) + added.reshape(height, width, 3))


def _inside(depth: Floats) -> Floats:
    """Depths with edges moved inwards by a pixel, because pixels on an edge show in part what is behind it, which a
    particle must be able to cover. What is too thin for that stays."""
    height, width = depth.shape
    padded = np.pad(depth, 1, mode="edge")
    cross = ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2))
    less = np.max([padded[i : i + height, j : j + width] for i, j in cross], axis=0)
    padded = np.pad(less, 1, mode="edge")
    again = np.min([padded[i : i + height, j : j + width] for i in range(3) for j in range(3)], axis=0)
    return np.where(again > depth + THIN, depth, less)


def _pixels(lengths: Floats, away: Floats, camera: Camera) -> Floats:
    """Lengths across the view, at distances along it, in pixels."""
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 if camera.parallel else camera.distance / away
        return np.asarray(np.where(away > NEAR, lengths * scale / camera.pixel, 0.0))


def _nearest(at: Floats, size: Floats, r: Floats, depth: Floats, split: int) -> Ints:
    """The nearest ball in each part of a pixel, as its number + 1; 0 where there is none."""
    height, width = depth.shape
    found = np.zeros(height * width * split**2, dtype=np.int64)
    reach = split * size
    classes = np.array([2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])
    group = np.searchsorted(classes, np.ceil(reach + 0.5))

    def cover(row: Ints, column: Ints, off: Floats, ball: Ints) -> None:
        bulge = np.sqrt(np.maximum(1 - off / reach[ball] ** 2, 0.0))
        free = at[ball, 2] - r[ball] * bulge < depth[row // split, column // split]
        np.maximum.at(found, (row * split * width + column)[free], ball[free] + 1)

    for big in np.flatnonzero(group == len(classes)).tolist():
        (x, y), k = split * at[big, :2], reach[big] + 1
        rows = np.arange(max(int(y - k), 0), max(min(int(y + k) + 1, split * height), 0))
        columns = np.arange(max(int(x - k), 0), max(min(int(x + k) + 1, split * width), 0))
        off = ((rows + 0.5 - y) ** 2)[:, None] + ((columns + 0.5 - x) ** 2)
        i, j = np.nonzero(off <= reach[big] ** 2)
        cover(rows[i], columns[j], off[i, j], np.full(len(i), big))
    for g in np.unique(group[group < len(classes)]).tolist():
        k = int(classes[g])
        dy, dx = (d.ravel() for d in np.mgrid[-k : k + 1, -k : k + 1])
        round_ = dx * dx + dy * dy <= (k + 1) ** 2
        dx, dy = dx[round_], dy[round_]
        those = np.flatnonzero(group == g)
        step = max(CHUNK // len(dx), 1)
        for begin in range(0, len(those), step):
            balls = those[begin : begin + step]
            x, y = split * at[balls, 0], split * at[balls, 1]
            column, row = np.floor(x).astype(int)[:, None] + dx, np.floor(y).astype(int)[:, None] + dy
            off = (column + 0.5 - x[:, None]) ** 2 + (row + 0.5 - y[:, None]) ** 2
            inside = off <= reach[balls, None] ** 2
            inside &= (column >= 0) & (column < split * width) & (row >= 0) & (row < split * height)
            b, _ = np.nonzero(inside)
            cover(row[inside], column[inside], off[inside], balls[b])
    return found


class Shade:
    """How much key light gets through a cloud to any place: layers of a map across the light, each with all that is
    nearer to the light."""

    def __init__(self, x: Floats, r: Floats, camera: Camera, amount: Floats | None = None) -> None:
        """`amount` is the area that each particle takes from the light, without it that of a ball."""
        self.light = key_light(camera)
        self.a = unit(np.cross(self.light, np.eye(3)[np.argmin(np.abs(self.light))]))
        self.b = np.cross(self.light, self.a)
        near = np.isfinite(x).all(axis=1) & (np.linalg.norm(x - camera.target, axis=1) < 3 * camera.width)
        x, r = x[near], r[near]
        area = np.pi * r * r if amount is None else amount[near]
        self.empty = not len(x) or camera.parallel  # Seen head-on, nothing is below anything else.
        if self.empty:
            return
        axes = np.stack([self.a, self.b, self.light])
        place = x @ axes.T
        room = max(float(np.ptp(place[:, :2], axis=0).max()), 8 * float(r.max()), 1e-12)
        self.middle = 0.5 * (place[:, :2].min(axis=0) + place[:, :2].max(axis=0))
        self.half = 0.5 * room * 1.15
        self.low, self.high = float(place[:, 2].min()), float(place[:, 2].max())
        self.thick = max(self.high - self.low, 1e-9 * room) / LAYERS
        cell = 2 * self.half / CELLS
        column, row = ((place[:, :2] - self.middle) / cell + 0.5 * CELLS - 0.5).T
        layer = np.clip((place[:, 2] - self.low) / self.thick, 0, LAYERS - 1).astype(int)
        caught = np.zeros(LAYERS * CELLS * CELLS)
        taken = np.minimum(area / cell**2, 4.0)
        i, j = np.floor(row).astype(int), np.floor(column).astype(int)
        s, t = row - i, column - j
        for di, dj, w in ((0, 0, (1 - s) * (1 - t)), (0, 1, (1 - s) * t), (1, 0, s * (1 - t)), (1, 1, s * t)):
            k = np.clip(i + di, 0, CELLS - 1) * CELLS + np.clip(j + dj, 0, CELLS - 1)
            caught += np.bincount(layer * CELLS * CELLS + k, taken * w, len(caught))
        layers = caught.reshape(LAYERS, CELLS, CELLS)
        wide = max(1, round(float(np.median(r)) / cell))
        for axis in (1, 2):
            layers = _box(_box(layers, wide, axis), wide, axis)
        # At the upper side of each layer, all that is above it; at the lower side of the lowest, everything.
        self.above = np.concatenate([np.cumsum(layers[::-1], axis=0)[::-1], np.zeros((1, CELLS, CELLS))])

    def at(self, x: Floats) -> Floats:
        """The part of the light that arrives at places, 0 to 1."""
        if self.empty:
            return np.ones(len(x))
        cell = 2 * self.half / CELLS
        column = (x @ self.a - self.middle[0]) / cell + 0.5 * CELLS - 0.5
        row = (x @ self.b - self.middle[1]) / cell + 0.5 * CELLS - 0.5
        inside = (column > 0) & (column < CELLS - 1) & (row > 0) & (row < CELLS - 1)
        column, row = np.clip(column, 0, CELLS - 1.001), np.clip(row, 0, CELLS - 1.001)
        level = np.clip((x @ self.light - self.low) / self.thick, 0, LAYERS - 1e-3)
        i, j, k = row.astype(int), column.astype(int), level.astype(int)
        s, t, u = row - i, column - j, level - k
        total = np.zeros(len(x))
        for dk, wk in ((0, 1 - u), (1, u)):
            for di, dj, w in ((0, 0, (1 - s) * (1 - t)), (0, 1, (1 - s) * t), (1, 0, s * (1 - t)), (1, 1, s * t)):
                total += wk * w * self.above[k + dk, i + di, j + dj]
        return np.where(inside, np.exp(-total), 1.0)

    def on(self, depth: Floats, camera: Camera) -> Floats:
        """Transmittance in front of the scenery, height x width."""
        left = np.ones(depth.shape)
        if not self.empty:
            rays, start = sights(camera)
            hit = np.isfinite(depth)
            left[hit] = 1 - SHADOW * (1 - self.at(start[hit] + rays[hit] * depth[hit][:, None]))
        return left


def _box(values: Floats, reach: int, axis: int) -> Floats:
    """Means over 2 reach + 1 along an axis; zeros beyond the ends."""
    pad = [(reach + 1, reach) if k == axis else (0, 0) for k in range(values.ndim)]
    sums = np.cumsum(np.pad(values, pad), axis=axis)
    n, width = values.shape[axis], 2 * reach + 1
    high, low = np.arange(width, width + n), np.arange(n)
    return np.asarray((np.take(sums, high, axis=axis) - np.take(sums, low, axis=axis)) / width)


def _ways(light: Floats, depth: Floats, clouds: list[Cloud], camera: Camera) -> Floats:
    """The picture with the ways behind particles as thin veils."""
    height, width = depth.shape
    n = width * height
    veil, tint = np.zeros(n), np.zeros((n, 3))
    for cloud in clouds:
        x, y, _, weight, color = _dots(cloud, depth, camera)
        for pixel, w in _corners(x, y, width, height):
            w = 0.35 * w * weight
            veil += np.bincount(pixel, w, n)
            for k in range(3):
                tint[:, k] += np.bincount(pixel, w * color[:, k], n)
    if not veil.any():
        return light
    share = np.where(veil > 0, (1 - np.exp(-veil)) / np.maximum(veil, 1e-12), 0.0)[:, None]
    shown = light.reshape(n, 3) * np.exp(-veil)[:, None] + 0.8 * tint * share
    return np.asarray(shown.reshape(height, width, 3))


def _dots(cloud: Cloud, depth: Floats, camera: Camera) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Ways as dots a pixel apart: x, y, distance, weight, colour."""
    none = np.zeros(0)
    if not len(cloud.ways):
        return none, none, none, none, np.zeros((0, 3))
    height, width = depth.shape
    ends = camera.project(cloud.ways.reshape(-1, 3)).reshape(-1, 2, 3)
    good = (ends[..., 2] > NEAR).all(axis=1) & np.isfinite(ends).all(axis=(1, 2))
    good &= (ends[..., :2].max(axis=1) > 0).all(axis=1) & (ends[..., :2].min(axis=1) < (width, height)).all(axis=1)
    ends = ends[good]
    length = np.linalg.norm((ends[:, 1] - ends[:, 0])[:, :2], axis=1)
    parts = np.clip(np.ceil(length), 1, 2 * (width + height)).astype(int)
    source = np.repeat(np.arange(len(ends)), parts)
    first = np.cumsum(parts) - parts
    t = ((np.arange(len(source)) - first[source]) + 0.5) / parts[source]
    place = ends[source, 0] + t[:, None] * (ends[source, 1] - ends[source, 0])
    x, y, z = place.T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y, z, source = x[inside], y[inside], z[inside], source[inside]
    free = z < depth[y.astype(int), x.astype(int)]
    x, y, z, source = x[free], y[free], z[free], source[free]
    weight = cloud.fading[good][source] * np.minimum(length / parts, 1.0)[source]
    return x, y, z, weight, cloud.way_colors[good][source]


def _corners(x: Floats, y: Floats, width: int, height: int) -> list[tuple[Ints, Floats]]:
    """The four pixels around each point, and their weights."""
    i, j = np.floor(y - 0.5).astype(int), np.floor(x - 0.5).astype(int)
    s, t = y - 0.5 - i, x - 0.5 - j
    return [
        (np.clip(i + di, 0, height - 1) * width + np.clip(j + dj, 0, width - 1), w)
        for di, dj, w in ((0, 0, (1 - s) * (1 - t)), (0, 1, (1 - s) * t), (1, 0, s * (1 - t)), (1, 1, s * t))
    ]


# Night


def glow(light: Floats | None, depth: Floats, things: list[Thing], clouds: list[Cloud], camera: Camera) -> Floats:
    """A picture by night in linear light, height x width x 3: the scenery as it is by day, darkened, and clouds of
    lights."""
    height, width = depth.shape
    shown = darkness(camera)
    if light is not None:
        rays, start = sights(camera)
        hit = np.isfinite(depth)
        away = np.linalg.norm(start[hit] + rays[hit] * depth[hit][:, None] - camera.target, axis=1) / camera.width
        left = (1 - fading(1.6 * away))[:, None] if any(isinstance(t, Ground) for t in things) else 1.0
        shown[hit] = (1 - left) * shown[hit] + left * DIM * light[hit] * np.array([0.75, 0.9, 1.3])
    sum_ = np.zeros((height, width, 3))
    for cloud in clouds:
        seen = camera.project(cloud.centers)
        size = _pixels(cloud.radii, seen[:, 2], camera)
        x, y, z = seen.T
        good = (z > NEAR) & np.isfinite(seen).all(axis=1)
        good &= (np.abs(x - 0.5 * width) < 0.5 * width + 4 * size + 4) & (
            np.abs(y - 0.5 * height) < 0.5 * height + 4 * size + 4
        )
        row = np.clip(np.nan_to_num(y), 0, height - 1).astype(int)
        column = np.clip(np.nan_to_num(x), 0, width - 1).astype(int)
        good &= z - cloud.radii < depth[row, column]
        spot = np.maximum(0.6 * size[good], 0.55)
        # As bright in the middle, however large.
        front = 2 * BRIGHT if len(cloud.ways) else BRIGHT  # The particle itself stands out from its trail.
        sum_ += front * _spots(x[good], y[good], spot, cloud.colors[good], (height, width))
        x, y, _, weight, color = _dots(cloud, depth, camera)
        if len(x):
            lines = np.zeros((height * width, 3))
            for pixel, w in _corners(x, y, width, height):
                w = 0.65 * BRIGHT * weight**2 * w
                for k in range(3):
                    lines[:, k] += np.bincount(pixel, w * color[:, k], len(lines))
            sum_ += lines.reshape(height, width, 3)
    sum_ = _bloom(sum_, width / 640)
    bright = np.maximum(sum_.max(axis=2, keepdims=True), 1e-9)
    curve = np.arcsinh(CONTRAST * bright) / np.arcsinh(CONTRAST * WHITEST)
    shining = sum_ * (curve / bright)
    # Colours brighter than the screen turn white.
    over = np.maximum(shining.max(axis=2, keepdims=True) - 0.9, 0.0)
    shining = shining + 0.6 * over
    return np.asarray(shown * np.maximum(1 - curve, 0.0) + shining)


def darkness(camera: Camera) -> Floats:
    """The background by night in linear light, height x width x 3."""
    t = ((np.arange(camera.size[1]) + 0.5) / camera.size[1])[:, None, None]
    return np.asarray(np.repeat((1 - t) * np.array(NIGHT[0]) + t * np.array(NIGHT[1]), camera.size[0], axis=1))


def _spots(x: Floats, y: Floats, sigma: Floats, color: Floats, shape: tuple[int, int]) -> Floats:
    """Gaussian spots of height 1 times their colours, added; large ones in coarser pictures."""
    height, width = shape
    level = np.maximum(np.ceil(np.log2(np.maximum(sigma, 1e-3) / COARSEST)), 0).astype(int)
    total: Floats | None = None
    top = int(level.max()) if len(level) else 0
    shapes = [(height, width)]
    for _ in range(top):
        shapes.append(((shapes[-1][0] + 1) // 2, (shapes[-1][1] + 1) // 2))
    for k in range(top, -1, -1):
        here = shapes[k]
        layer = np.zeros((*here, 3)) if total is None else _doubled(total, here)
        those = level == k
        if those.any():
            # Every doubling adds 3/4 to the variance, in pixels of the finer picture: together, in coarse ones, this.
            widens = 0.25 * (1 - 0.25**k)
            var = (sigma[those] / 2**k) ** 2
            height_ = (var / (var - widens))[:, None]
            spots = x[those] / 2**k, y[those] / 2**k, np.sqrt(var - widens), height_ * color[those]
            layer = layer + _stamped(*spots, here)
        total = layer
    assert total is not None
    return total


def _stamped(x: Floats, y: Floats, sigma: Floats, color: Floats, shape: tuple[int, int]) -> Floats:
    """Spots of a pixel or two."""
    height, width = shape
    reach = int(np.clip(np.ceil(3.2 * sigma.max()), 2, 5))
    # A frame around the picture catches what falls outside.
    rows, columns = height + 2 * reach, width + 2 * reach
    total = np.zeros((rows * columns, 3))
    offsets = np.arange(-reach, reach + 1)
    step = CHUNK // len(offsets) ** 2 * 2
    for begin in range(0, len(x), step):
        part = slice(begin, begin + step)
        i, j = np.floor(y[part]).astype(int)[:, None] + offsets, np.floor(x[part]).astype(int)[:, None] + offsets
        s = sigma[part, None]
        wy = np.exp(-0.5 * ((i + 0.5 - y[part, None]) / s) ** 2)
        wx = np.exp(-0.5 * ((j + 0.5 - x[part, None]) / s) ** 2)
        i, j = np.clip(i + reach, 0, rows - 1), np.clip(j + reach, 0, columns - 1)
        pixel = (i[:, :, None] * columns + j[:, None, :]).ravel()
        weight = wy[:, :, None] * wx[:, None, :]
        for k in range(3):
            w = weight * color[part, k][:, None, None]
            total[:, k] += np.bincount(pixel, w.ravel(), len(total))
    return total.reshape(rows, columns, 3)[reach:-reach, reach:-reach]


def _bloom(light: Floats, scale: float) -> Floats:
    """Light with a part of it scattered around."""
    shown, coarse = light.copy(), light
    shapes = []
    wide = max(1, round(2 * scale))
    for share in BLOOM:
        shapes.append(coarse.shape[:2])
        coarse = _halved(coarse)
        soft = _box(_box(_box(_box(coarse, wide, 0), wide, 1), wide, 0), wide, 1)
        for shape in reversed(shapes):
            soft = _doubled(soft, shape)
        shown += share * soft
    return shown


def _halved(image: Floats) -> Floats:
    height, width = image.shape[:2]
    padded = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return np.asarray(0.25 * (padded[::2, ::2] + padded[1::2, ::2] + padded[::2, 1::2] + padded[1::2, 1::2]))


def _doubled(image: Floats, shape: tuple[int, int]) -> Floats:
    """An image of twice the size, blended between pixels."""
    for axis in (0, 1):
        before = np.concatenate([image.take([0], axis), np.delete(image, -1, axis)], axis)
        after = np.concatenate([np.delete(image, 0, axis), image.take([-1], axis)], axis)
        both = np.stack([0.75 * image + 0.25 * before, 0.75 * image + 0.25 * after], axis=axis + 1)
        doubled = list(image.shape)
        doubled[axis] *= 2
        image = both.reshape(doubled)
    return np.asarray(image[: shape[0], : shape[1]])
