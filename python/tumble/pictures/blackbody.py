"""The light of what is hot: Planck's law, seen by the eye that the CIE agreed on in 1931.

    B(l, T) = 2 h c² / l⁵ / (exp(h c / (l k T)) - 1)                                                        (fire.6)
    X = int x(l) B(l, T) dl,  the same for Y, Z;   linear sRGB = M (X, Y, Z)                                  (fire.7)

x, y, z are the sums of Gaussian lobes of [wyman2013].
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

PLANCK = 6.62607015e-34
"""h [J s]"""

LIGHT = 299792458.0
"""c [m/s]"""

BOLTZMANN = 1.380649e-23
"""k [J/K]"""

VISIBLE = np.arange(360.0, 831.0, 2.0)
"""Wavelengths that are added up [nm]."""

TO_SRGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""Linear sRGB from X, Y, Z."""

TABLE = np.arange(300.0, 6001.0, 10.0)
"""Temperatures between which colours are interpolated [K]."""

CROSSTALK = 0.02
"""Share of the other colours' light that each layer of film sees: what is very bright turns white."""


def planck(wavelength: npt.ArrayLike, temperature: npt.ArrayLike) -> Floats:
    """Spectral radiance of a black body [W/(m² sr m)] at wavelengths [m] and temperatures [K]."""
    wave, t = np.asarray(wavelength, dtype=float), np.asarray(temperature, dtype=float)
    x = np.minimum(PLANCK * LIGHT / (wave * BOLTZMANN * t), 700.0)
    return np.asarray(2 * PLANCK * LIGHT**2 / wave**5 / np.expm1(x))


def matching(nm: npt.ArrayLike) -> Floats:
    """The matching functions x, y, z of the CIE's eye of 1931 at wavelengths [nm]; n x 3."""
    w = np.asarray(nm, dtype=float)

    def lobe(height: float, middle: float, low: float, high: float) -> Floats:
        return np.asarray(height * np.exp(-0.5 * ((w - middle) / np.where(w < middle, low, high)) ** 2))

    x = lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2)
    y = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1)
    z = lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)
    return np.stack([x, y, z], axis=-1)


def seen(temperature: npt.ArrayLike) -> Floats:
    """X, Y and Z of black bodies [W/(m² sr)]; n x 3."""
    t = np.asarray(temperature, dtype=float)
    step = 1e-9 * float(VISIBLE[1] - VISIBLE[0])
    return np.asarray(planck(1e-9 * VISIBLE, t[..., None]) @ matching(VISIBLE) * step)


def chromaticity(temperature: npt.ArrayLike) -> Floats:
    """x and y of black bodies; n x 2."""
    xyz = seen(temperature)
    return np.asarray(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True))


def colors(temperature: npt.ArrayLike) -> Floats:
    """Linear sRGB of black bodies, no part less than none [W/(m² sr)]; n x 3."""
    return np.asarray(np.maximum(seen(temperature) @ TO_SRGB.T, 0.0))


def glow(temperature: npt.NDArray[np.float32], white: float) -> npt.NDArray[np.float32]:
    """The same over the brightest part of one at the temperature `white`, from a table: for every cell of a grid."""
    table = colors(TABLE)
    # Between temperatures light grows by powers.
    table = np.log(np.maximum(table / colors(white).max(), 1e-30))
    t = np.clip(np.nan_to_num(temperature, nan=0.0), TABLE[0], TABLE[-1])
    return np.stack([np.exp(np.interp(t, TABLE, table[:, c])) for c in range(3)], axis=-1).astype(np.float32)


def developed(light: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Light as on film: each of three layers saturates by itself."""
    sum_ = light.sum(axis=-1, keepdims=True)
    return np.asarray(1 - np.exp(-((1 - 3 * CROSSTALK) * light + CROSSTALK * sum_)))
