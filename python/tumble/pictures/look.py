"""Lighting shared by all renderers: background, key light, the ground's fading and, for plain ones, its shadow.

Cameras and things here are those of `Camera.unit`: target at the origin, camera at distance 1.
"""

import numpy as np

from tumble.pictures.drawn import Body, Ground, Thing, as_triangles
from tumble.pictures.framing import Camera
from tumble.pictures.surfaces import Floats, Indices, joined, unit
from tumble.style import display, rgb

SKY = "#f4f6f8", "#dfe4ea"
"""Background, at the top and at the bottom of the picture."""

NIGHT = (0.0022, 0.003, 0.0062), (0.0045, 0.0052, 0.0085)
"""Background by night in linear light, at the top and at the bottom."""

FADE = (0.75, 2.2)
"""Distances from the camera's target, in pictures' widths, between which the ground fades away."""

SHADOW = 0.5
"""How much of the light a shadow takes away."""


def sky(height: Floats) -> Floats:
    """The background in linear light at heights in the picture, 0 at the bottom and 1 at the top; n x 3."""
    top, bottom = (np.array(rgb(c)) for c in SKY)
    t = np.clip(height, 0.0, 1.0)[..., None]
    return np.asarray(t * top + (1 - t) * bottom)


def background(size: tuple[int, int]) -> Floats:
    """The background in linear light, height x width x 3."""
    rows = sky(1 - (np.arange(size[1]) + 0.5) / size[1])
    return np.repeat(rows[:, None], size[0], axis=1)


def key_light(camera: Camera) -> Floats:
    """Direction to the key light: from the left and above, which brings out folds."""
    camera = camera.lit or camera
    right, up, forward = camera.axes
    if camera.parallel:
        return unit(-0.45 * right + 0.7 * up - 0.8 * forward)
    level = unit(np.cross(camera.up, right))
    return unit(-0.9 * right + 0.85 * camera.up - 0.03 * level)


def fading(away: Floats) -> Floats:
    """How far the ground has faded, 0 to 1, at distances from the camera's target in pictures' widths."""
    t = np.clip((away - FADE[0]) / (FADE[1] - FADE[0]), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def soften(light: Floats) -> Floats:
    """Rolls highlights off instead of clipping them: unchanged up to 0.75, then towards 1."""
    over = np.maximum(light - 0.75, 0.0)
    return np.minimum(light, 0.75) + 0.25 * (1 - np.exp(-over / 0.25))


def foot(ground: Ground, camera: Camera) -> Floats:
    """The point of a ground that is nearest to the camera's target."""
    return camera.target - ground.normal * float((camera.target - ground.point) @ ground.normal)


def painted(ground: Ground, things: list[Thing], camera: Camera, rings: int) -> tuple[Floats, Indices, Floats]:
    """A ground with its shadows and its fading painted on: vertices, triangles and colours (sRGB) of vertices."""
    middle, (a, b) = foot(ground, camera), _across(ground.normal)
    reach = FADE[1] * camera.width
    sectors = 2 * rings
    radius = reach * np.linspace(0.0, 1.0, rings) ** 1.6
    angle = 2 * np.pi * np.arange(sectors) / sectors
    u, v = (radius[:, None] * np.cos(angle)).ravel(), (radius[:, None] * np.sin(angle)).ravel()
    vertices = middle + u[:, None] * a + v[:, None] * b
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sectors), indexing="ij")
    p, q = i * sectors + j, i * sectors + (j + 1) % sectors
    corners = [(p, p + sectors, q + sectors), (p, q + sectors, q)]
    triangles = np.concatenate([np.stack(c, axis=-1).reshape(-1, 3) for c in corners])
    lit = 1 - SHADOW * _shadow(ground, things, camera, u, v)
    fade = fading(np.linalg.norm(vertices - camera.target, axis=1) / camera.width)[:, None]
    behind = sky(1 - camera.project(vertices)[:, 1] / camera.size[1])
    paint = 0.95 * np.array(ground.color) * lit[:, None]
    return vertices, triangles, display((1 - fade) * paint + fade * behind)


def _across(normal: Floats) -> tuple[Floats, Floats]:
    a = unit(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]))
    return a, np.cross(normal, a)


def _shadow(ground: Ground, things: list[Thing], camera: Camera, u: Floats, v: Floats) -> Floats:
    """How dark the shadow is, 0 to 1, at points of a ground: a map of where light is caught, blurred."""
    bodies = joined([as_triangles(t, 1) for t in things if isinstance(t, Body)])
    light = key_light(camera)
    slope = float(light @ ground.normal)
    cells, half = 384, 1.0 * camera.width
    caught = np.zeros((cells, cells))
    if len(bodies[1]) and slope > 0.05:
        middle, (a, b) = foot(ground, camera), _across(ground.normal)
        corners = bodies[0][bodies[1]]
        # Points all over the triangles, close enough together to leave no holes in the map.
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        fine = np.clip(np.ceil(longest / (1.2 * half / cells)), 1, 64).astype(int)
        for n in np.unique(fine):
            x = _spread(corners[fine == n], int(n))
            above = (x - ground.point) @ ground.normal
            x = (x - light * (above / slope)[:, None] - middle)[above > -1e-6]
            k = ((x @ a / half + 1) * 0.5 * cells).astype(int)
            m = ((x @ b / half + 1) * 0.5 * cells).astype(int)
            inside = (k >= 0) & (k < cells) & (m >= 0) & (m < cells)
            caught[k[inside], m[inside]] = 1.0
        for _ in range(3):
            caught = _blur(_blur(caught, 3, 0), 3, 1)
    k = np.clip((u / half + 1) * 0.5 * cells - 0.5, 0, cells - 1.001)
    m = np.clip((v / half + 1) * 0.5 * cells - 0.5, 0, cells - 1.001)
    i, j = k.astype(int), m.astype(int)
    s, t = k - i, m - j
    low = (1 - t) * caught[i, j] + t * caught[i, j + 1]
    high = (1 - t) * caught[i + 1, j] + t * caught[i + 1, j + 1]
    return np.asarray((1 - s) * low + s * high)


def _spread(corners: Floats, n: int) -> Floats:
    """Points on triangles, n + 1 along each edge."""
    i, j = (w[np.add(*np.indices((n + 1, n + 1))) <= n] / n for w in np.indices((n + 1, n + 1)))
    weights = np.stack([i, j, 1 - i - j], axis=1)
    return np.asarray(np.einsum("wk,tkd->twd", weights, corners).reshape(-1, 3))


def _blur(image: Floats, reach: int, axis: int) -> Floats:
    padded = np.pad(image, [(reach + 1, reach) if k == axis else (0, 0) for k in (0, 1)])
    sums = np.cumsum(padded, axis=axis)
    width = 2 * reach + 1
    low, high = np.split(np.arange(sums.shape[axis]), [sums.shape[axis] - image.shape[axis]])
    del low
    return (np.take(sums, high, axis=axis) - np.take(sums, high - width, axis=axis)) / width
