"""Takes the noise out of a path-traced picture.

Edge-avoiding à-trous wavelets: five passes of a 3 x 3 kernel whose taps move apart, 1, 2, 4, 8 and 16 pixels. A tap
counts less the more it differs in direction, in distance from the surface's tangent plane, and in brightness against
the noise there; the noise is estimated once from the neighbourhood and carried along. Surfaces are of one colour
each, so there is no texture to protect.

Source: Dammertz et al. 2010, with the variance guide of Schied et al. 2017 (without its history of frames: every
frame stands alone, so that frames can be rendered in any order).
"""

from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]

PASSES = 5

BRIGHTNESS = 6.0
"""Standard deviations of noise over which the weight of a difference in brightness falls by e."""

TAPS = [(dy, dx, (2 - abs(dy)) * (2 - abs(dx))) for dy, dx in product((-1, 0, 1), repeat=2)]
LUMINANCE = np.array([[0.2126], [0.7152], [0.0722]], dtype=np.float32)


def denoise(
    light: npt.NDArray[Any], normal: npt.NDArray[Any], place: npt.NDArray[Any], pixel: float
) -> npt.NDArray[np.float64]:
    """The picture without noise. All height x width x 3; `normal` is 0 where nothing is seen; `place` and the size
    `pixel` of a pixel are in the same unit."""
    shown = np.asarray(light, dtype=np.float32)
    n = np.asarray(normal, dtype=np.float32)
    p = np.asarray(place, dtype=np.float32)
    # Pixels on an edge of a shape hold a mixture, which must neither be smoothed nor spread.
    jumps = [_jump(n, p, dy, dx, pixel) for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0))]
    inner = np.asarray(~np.any(jumps, axis=0), dtype=np.float32)
    noise = _noise(shown, inner)
    for level in range(PASSES):
        shown, noise = _pass(shown, noise, inner, n, p, 1 << level, pixel)
    return np.where(inner > 0, shown.astype(np.float64), light)


def _shifted(image: Image, dy: int, dx: int) -> Image:
    """The image moved; what comes in from outside repeats the edge."""
    rows = np.clip(np.arange(image.shape[0]) + dy, 0, image.shape[0] - 1)
    columns = np.clip(np.arange(image.shape[1]) + dx, 0, image.shape[1] - 1)
    return image[rows][:, columns]


def _dot(a: Image, b: Image) -> Image:
    return np.asarray(np.einsum("ijk,ijk->ij", a, b)[..., None])


def _alike(normal: Image, place: Image, dy: int, dx: int, length: float) -> Image:
    """How much a pixel and a neighbour lie on one smooth surface, 0 to 1."""
    facing = np.maximum(_dot(normal, _shifted(normal, dy, dx)), 0)
    apart = np.abs(_dot(normal, place - _shifted(place, dy, dx))) / np.float32(length)
    return facing**32 * np.exp(-apart)


def _jump(normal: Image, place: Image, dy: int, dx: int, pixel: float) -> npt.NDArray[np.bool_]:
    """Whether a neighbour lies off the tangent plane by more than two pixels, or faces elsewhere by 70°."""
    facing = _dot(normal, _shifted(normal, dy, dx))
    apart = np.abs(_dot(normal, place - _shifted(place, dy, dx)))
    return (facing < 0.34) | (apart > 2 * pixel)


def _noise(shown: Image, inner: Image) -> Image:
    """Variance of brightness, from second differences within surfaces, over 7 x 7 pixels.

    Second differences cancel slopes of light; of independent noise their mean square is 6 variances.
    """
    bright = shown @ LUMINANCE
    total = np.zeros_like(bright)
    weight = np.full_like(bright, 1e-6)
    for dy, dx in ((0, 1), (1, 0)):
        curve = _shifted(bright, dy, dx) - 2 * bright + _shifted(bright, -dy, -dx)
        inside = _shifted(inner, dy, dx) * inner * _shifted(inner, -dy, -dx)
        total += inside * curve**2 / 6
        weight += inside
    return _box(total, 3) / _box(weight, 3)


def _box(image: Image, reach: int) -> Image:
    for axis in (0, 1):
        steps = range(-reach, reach + 1)
        image = np.sum([_shifted(image, *((k, 0) if axis == 0 else (0, k))) for k in steps], axis=0, dtype=np.float32)
    return image


def _pass(
    shown: Image, noise: Image, inner: Image, normal: Image, place: Image, step: int, pixel: float
) -> tuple[Image, Image]:
    bright = shown @ LUMINANCE
    spread = BRIGHTNESS * np.sqrt(np.maximum(noise, 0)) + np.float32(1e-4)
    total = 4 * shown
    variance = 16 * noise
    weight = np.full_like(noise, 4)
    for dy, dx, w in TAPS:
        if dy == 0 and dx == 0:
            continue
        there = _shifted(bright, step * dy, step * dx)
        here = w * _shifted(inner, step * dy, step * dx) * np.exp(-np.abs(bright - there) / spread)
        here *= _alike(normal, place, step * dy, step * dx, step * pixel)
        total += here * _shifted(shown, step * dy, step * dx)
        variance += here**2 * _shifted(noise, step * dy, step * dx)
        weight += here
    return total / weight, variance / weight**2
