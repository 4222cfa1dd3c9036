"""How pictures and plots look: one palette and one set of Matplotlib settings.

The palette is Paul Tol's "bright" scheme, which stays distinguishable for every common kind of colour blindness
(https://personal.sran.nl/~pault/). Plots take it as it is, pictures take it as linear light.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Rgb = tuple[float, float, float]
"""Red, green and blue, 0 to 1, in linear light."""

PALETTE = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377")
"""Colours of curves, in the order in which they are handed out; the engine has the same for objects."""

INK = "#22272e"
FAINT = "#8a929c"
GRID = "#e3e6ea"
PAPER = "#ffffff"

RC: dict[str, Any] = {
    "figure.facecolor": PAPER,
    "figure.dpi": 150,
    "savefig.facecolor": PAPER,
    "axes.facecolor": PAPER,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "text.color": INK,
    "font.size": 9.5,
    "font.family": ["DejaVu Sans"],
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
}
"""Matplotlib settings; use with `matplotlib.rc_context(RC)`."""


def linear(display: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Linear light of display values (sRGB, 0 to 1)."""
    s = np.asarray(display, dtype=float)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def display(light: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Display values (sRGB, 0 to 1) of linear light; what is out of range is clipped."""
    c = np.clip(np.asarray(light, dtype=float), 0.0, 1.0)
    return np.asarray(np.where(c <= 0.0031308, c * 12.92, 1.055 * c ** (1 / 2.4) - 0.055))


def rgb(code: str) -> Rgb:
    """Linear light of a colour code such as "#4477aa"."""
    r, g, b = linear([int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)]).tolist()
    return r, g, b
