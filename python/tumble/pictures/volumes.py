"""Smoke and images in a plane, painted over the picture of everything else, which hides them where it is nearer.

Smoke takes light away and scatters some towards the camera. Its grid is gone through slice by slice, across the axis that
is closest to the view, from the front to the back: a ray of sight meets each slice once, where four cells around are
blended. How much of the key light arrives in a cell is known from the slices between it and the light, gone through in the
same way. With L light, T what is left of it, s extinction, j emission, along a ray:

    dL = T (s lit color + j) dx,    dT = -s T dx

Cameras and things here are those of `Camera.unit`.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.pictures.blackbody import developed
from tumble.pictures.drawn import Image, Smoke
from tumble.pictures.framing import Camera
from tumble.pictures.look import key_light
from tumble.pictures.splats import DIM, NEAR, Shade, sights
from tumble.pictures.surfaces import Floats

Array = npt.NDArray[np.float32]

AMBIENT = 0.40
"""Light from everywhere, of a surface that is lit from all around."""

KEY = 0.85
"""Light of the key light where nothing is in between."""

SPREAD = 0.25
"""Share of the key light that is scattered on and so gets farther in: it feels a quarter of the extinction."""

THIN = 0.15
"""Slices of a larger optical depth are divided in two."""

LEFT = 0.004
"""Rays that have less of their light left end."""

DARK = 0.02
"""Light that changes by powers between cells does so evenly where there is less: else edges of flames look like cells."""

COARSE = 48
"""Blocks of cells along each axis in the shadow on other things."""


def smoke(light: Floats, depth: Floats, clouds: list[Smoke], camera: Camera, night: bool = False) -> Floats:
    """A picture in linear light, height x width x 3, with smoke over it; the farthest first."""
    shown = light
    if not night:
        for cloud in clouds:
            shown = shown * _shadow(cloud, depth, camera)[..., None]
    away = [
        float(np.linalg.norm(c.low + 0.5 * c.spacing * np.array(c.extinction.shape) - camera.position)) for c in clouds
    ]
    for k in np.argsort(away)[::-1].tolist():
        shown = _smoke(shown, depth, clouds[k], camera, DIM if night else 1.0)
    return shown


def lit(extinction: Array, spacing: float, direction: Floats) -> Array:
    """Transmittance of light from a direction to each cell centre, 0 to 1."""
    axis = int(np.argmax(np.abs(direction)))
    e = np.moveaxis(extinction, axis, 0)
    if direction[axis] > 0:
        e = e[::-1]
    slope = np.delete(direction, axis) / abs(float(direction[axis]))
    step = np.float32(0.5 * spacing * float(np.sqrt(1 + slope @ slope)))
    depth = np.empty_like(e)
    before = np.zeros(e.shape[1:], dtype=np.float32)
    for k in range(len(e)):
        # Between slices: half of one and half of the other.
        depth[k] = _shifted(before, slope) + step * e[k]
        before = depth[k] + step * e[k]
    if direction[axis] > 0:
        depth = depth[::-1]
    return np.asarray(np.moveaxis(np.exp(-depth), 0, axis))


def _shifted(values: Array, by: Floats) -> Array:
    """values(i + by), between the points blended, nothing outside."""
    for axis in (0, 1):
        whole = int(np.floor(by[axis]))
        part = np.float32(by[axis] - whole)
        values = (1 - part) * _moved(values, whole, axis) + part * _moved(values, whole + 1, axis)
    return values


def _moved(values: Array, by: int, axis: int) -> Array:
    out = np.zeros_like(values)
    n = values.shape[axis]
    if abs(by) < n:
        goal, source = [slice(None)] * 2, [slice(None)] * 2
        goal[axis] = slice(max(-by, 0), n - max(by, 0))
        source[axis] = slice(max(by, 0), n - max(-by, 0))
        out[tuple(goal)] = values[tuple(source)]
    return out


def _filled(cloud: Smoke) -> tuple[slice, ...] | None:
    """The part of the grid in which there is anything."""
    there = cloud.extinction > 1e-4 * max(float(cloud.extinction.max(initial=0.0)), 1e-30)
    if cloud.emission is not None:
        there = there | (cloud.emission > 0).any(axis=-1)
    if not there.any():
        return None
    spans = []
    for axis in range(3):
        some = np.flatnonzero(there.any(axis=tuple(a for a in range(3) if a != axis)))
        spans.append(slice(int(some[0]), int(some[-1]) + 1))
    return tuple(spans)


def _smoke(light: Floats, depth: Floats, cloud: Smoke, camera: Camera, bright: float) -> Floats:
    part = _filled(cloud)
    if part is None:
        return light
    extinction = np.ascontiguousarray(cloud.extinction[part], dtype=np.float32)
    low = cloud.low + cloud.spacing * np.array([s.start for s in part])
    key = lit(extinction, cloud.spacing, key_light(camera))
    sky = lit(extinction, cloud.spacing, camera.axes[1] if camera.parallel else camera.zenith)
    shade = np.float32(bright * KEY) * ((1 - SPREAD) * key + SPREAD * np.sqrt(np.sqrt(key)))
    shade += np.float32(bright * AMBIENT) * (0.35 + 0.65 * np.sqrt(sky))
    rays, start = sights(camera)
    forward = camera.axes[2]
    axis = int(np.argmax(np.abs(forward)))
    u, v = (a for a in range(3) if a != axis)
    # One number for both: the real part takes light away, the imaginary one scatters it.
    both = np.moveaxis(extinction + 1j * (extinction * shade), (axis, u, v), (0, 1, 2)).astype(np.complex64)
    both = np.pad(both, ((0, 0), (1, 1), (1, 1)))
    glow = None
    if cloud.emission is not None:
        glow = np.moveaxis(cloud.emission[part], (axis, u, v), (0, 1, 2)).astype(np.float32)
        glow = np.pad(glow, ((0, 0), (1, 1), (1, 1), (0, 0)))
    powers = None
    if cloud.glow is not None:
        powers = _soft(np.log(np.moveaxis(cloud.glow[part], (axis, u, v), (0, 1, 2)) + np.float32(DARK)))
        powers = np.pad(powers, ((0, 0), (1, 1), (1, 1), (0, 0)), mode="edge")
    n, rows, columns = both.shape
    parts = 2 if powers is not None or float(extinction.max()) * cloud.spacing > THIN else 1
    # In the middles of the parts, in slices.
    slices = (np.arange(parts * n) + 0.5) / parts - 0.5
    if forward[axis] < 0:
        slices = slices[::-1]

    pixels = np.flatnonzero(_seen(low, cloud.spacing * np.array(extinction.shape), camera).ravel())
    d, s = rays.reshape(-1, 3)[pixels], start.reshape(-1, 3)[pixels]
    with np.errstate(divide="ignore", invalid="ignore"):
        per = d / d[:, axis : axis + 1]
    ahead = np.isfinite(per).all(axis=1) & (d[:, axis] * forward[axis] > 0)
    pixels, d, s, per = pixels[ahead], d[ahead], s[ahead], per[ahead]
    # Places in the slices, in cells of the padded ones, at slice 0 and from one slice to the next.
    first = low[axis] + 0.5 * cloud.spacing - s[:, axis]
    at_u = ((s[:, u] + first * per[:, u] - low[u]) / cloud.spacing + 0.5).astype(np.float32)
    at_v = ((s[:, v] + first * per[:, v] - low[v]) / cloud.spacing + 0.5).astype(np.float32)
    by_u, by_v = per[:, u].astype(np.float32), per[:, v].astype(np.float32)
    away, farther = (first / d[:, axis]).astype(np.float32), (cloud.spacing / d[:, axis]).astype(np.float32)
    step = (cloud.spacing / parts * np.linalg.norm(per, axis=1)).astype(np.float32)
    stop = depth.ravel()[pixels].astype(np.float32)
    left = np.ones(len(pixels), dtype=np.float32)
    scattered = np.zeros(len(pixels), dtype=np.float32)
    shining = np.zeros((len(pixels), 3), dtype=np.float32)
    for k in slices.astype(np.float32):
        a, b, z = at_u + k * by_u, at_v + k * by_v, away + k * farther
        some = np.flatnonzero(
            (a > 0)
            & (a < rows - 1)
            & (b > 0)
            & (b < columns - 1)
            & (left > LEFT)
            & (z > NEAR)
            & (z - stop < np.abs(farther))
        )
        if not len(some):
            continue
        a, b, z = a[some], b[some], z[some]
        below, before = np.floor(a), np.floor(b)
        a, b = a - below, b - before
        flat = _between(both, k).ravel()
        corner = below.astype(np.int64) * columns + before.astype(np.int64)
        value = (1 - a) * ((1 - b) * flat[corner] + b * flat[corner + 1])
        value += a * ((1 - b) * flat[corner + columns] + b * flat[corner + columns + 1])
        # The slice in which the ray ends counts in part.
        length = step[some] * np.clip((stop[some] - z) * parts / np.abs(farther[some]) + 0.5, 0.0, 1.0)
        thick = value.real * length
        through = np.exp(-thick)
        ratio = value.imag / np.maximum(value.real, 1e-12)
        scattered[some] += left[some] * (1 - through) * ratio
        if glow is not None:
            cells = _between(glow, k).reshape(-1, 3)
            shine = ((1 - a) * (1 - b))[:, None] * cells[corner] + ((1 - a) * b)[:, None] * cells[corner + 1]
            shine += (a * (1 - b))[:, None] * cells[corner + columns] + (a * b)[:, None] * cells[corner + columns + 1]
            shining[some] += (
                left[some] * length * np.where(thick > 1e-4, (1 - through) / np.maximum(thick, 1e-4), 1.0)
            )[:, None] * shine
        if powers is not None:
            cells = _between(powers, k).reshape(-1, 3)
            shine = ((1 - a) * (1 - b))[:, None] * cells[corner] + ((1 - a) * b)[:, None] * cells[corner + 1]
            shine += (a * (1 - b))[:, None] * cells[corner + columns] + (a * b)[:, None] * cells[corner + columns + 1]
            shining[some] += (left[some] * (1 - through))[:, None] * np.maximum(np.exp(shine) - np.float32(DARK), 0)
        left[some] *= through
    if cloud.glow is not None:
        shining = developed(shining)
    over = np.zeros((depth.size, 4))
    over[:, 0] = 1.0
    over[pixels, 0], over[pixels, 1:] = left, scattered[:, None] * np.array(cloud.color) + shining
    over = _across_edges(over.reshape(*depth.shape, 4), depth, cloud.spacing)
    return np.asarray(light * over[..., :1] + over[..., 1:])


def _across_edges(over: Floats, depth: Floats, step: float) -> Floats:
    """What is over each pixel, where a neighbour is farther away by more than a step a mean with all of them: something of
    what is behind the edge is seen in such pixels, through all that is before it."""
    height, width = depth.shape
    far = np.pad(np.minimum(depth, 1e30), 1, mode="edge")
    around = np.stack([far[i : i + height, j : j + width] for i in range(3) for j in range(3)])
    edge = around.max(axis=0) - around[4] > step
    wide = np.pad(over, [(1, 1), (1, 1), (0, 0)], mode="edge")
    rows = 0.25 * (wide[:-2] + 2 * wide[1:-1] + wide[2:])
    mean = 0.25 * (rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:])
    return np.where(edge[..., None], mean, over)


def _soft(values: Array) -> Array:
    """Each cell with its neighbours, 1/4, 1/2, 1/4 along each axis, but at the ends: flames are as thin as cells, and would
    look like them."""
    for axis in range(3):
        v = np.moveaxis(values, axis, 0)
        blend = v.astype(np.float32)
        blend[1:-1] = np.float32(0.25) * (v[:-2] + v[2:]) + np.float32(0.5) * v[1:-1]
        values = np.moveaxis(blend, 0, axis)
    return values


def _between(slices: npt.NDArray[Any], k: float) -> npt.NDArray[Any]:
    """Value at a position between slices; constant beyond the ends."""
    low = min(max(int(np.floor(k)), 0), len(slices) - 1)
    part = np.float32(k - low)
    if part <= 0 or low + 1 == len(slices):
        return np.asarray(slices[low])
    return np.asarray((1 - part) * slices[low] + part * slices[low + 1])


def _seen(low: Floats, size: Floats, camera: Camera) -> npt.NDArray[np.bool_]:
    """The pixels of the rectangle in which a box is seen."""
    width, height = camera.size
    corners = low + size * np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    seen = camera.project(corners)
    mask = np.zeros((height, width), dtype=bool)
    if (seen[:, 2] <= NEAR).any():
        mask[:] = True
        return mask
    left, top = np.floor(np.clip(seen[:, :2].min(axis=0), 0, (width, height))).astype(int)
    right, bottom = np.ceil(np.clip(seen[:, :2].max(axis=0), 0, (width, height))).astype(int)
    mask[top:bottom, left:right] = True
    return mask


def _shadow(cloud: Smoke, depth: Floats, camera: Camera) -> Floats:
    """Transmittance of smoke in front of the scenery, height x width."""
    part = _filled(cloud)
    if part is None:
        return np.ones(depth.shape)
    e = cloud.extinction[part]
    block = max(1, -(-max(e.shape) // COARSE))
    e = np.pad(e, [(0, -n % block) for n in e.shape])
    n = [m // block for m in e.shape]
    e = e.reshape(n[0], block, n[1], block, n[2], block).mean(axis=(1, 3, 5))
    side = block * cloud.spacing
    low = cloud.low + cloud.spacing * np.array([s.start for s in part])
    there = np.argwhere(e > 1e-3 * e.max())
    amount = e[tuple(there.T)].astype(float) * side**3
    return Shade(low + side * (there + 0.5), np.full(len(there), 0.5 * side), camera, amount).on(depth, camera)


def images(light: Floats, depth: Floats, plates: list[Image], camera: Camera) -> Floats:
    """A picture in linear light, height x width x 3, with images in their planes over it."""
    shown = light.reshape(-1, 3).copy()
    rays, start = (a.reshape(-1, 3) for a in sights(camera))
    far = depth.ravel()
    for plate in plates:
        normal = np.cross(plate.across, plate.up)
        with np.errstate(divide="ignore", invalid="ignore"):
            away = ((plate.corner - start) @ normal) / (rays @ normal)
        hit = np.flatnonzero(np.isfinite(away) & (away > NEAR) & (away < far))
        x = start[hit] + rays[hit] * away[hit][:, None] - plate.corner
        n, m = plate.cover.shape
        a = x @ plate.across / (plate.across @ plate.across) * n - 0.5
        b = x @ plate.up / (plate.up @ plate.up) * m - 0.5
        inside = (a >= -0.5) & (a < n - 0.5) & (b >= -0.5) & (b < m - 0.5)
        hit, a, b = hit[inside], np.clip(a[inside], 0, n - 1), np.clip(b[inside], 0, m - 1)
        i, j = np.minimum(a.astype(int), max(n - 2, 0)), np.minimum(b.astype(int), max(m - 2, 0))
        s, t = (a - i)[:, None], (b - j)[:, None]
        color = np.concatenate([plate.light * plate.cover[..., None], plate.cover[..., None]], axis=-1)
        k, g = np.minimum(i + 1, n - 1), np.minimum(j + 1, m - 1)
        value = (1 - s) * ((1 - t) * color[i, j] + t * color[i, g]) + s * ((1 - t) * color[k, j] + t * color[k, g])
        shown[hit] = shown[hit] * (1 - value[:, 3:]) + value[:, :3]
    return np.asarray(shown.reshape(light.shape))
