"""Pictures of deformed sheets and blocks, their links coloured by strain."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import FigureBase
from matplotlib.patches import Rectangle
from matplotlib.projections.polar import PolarAxes

from tumble.lab.exact import Floats
from tumble.lab.patterns import Deformation, Measured, Pattern, Thing, thing, young
from tumble.style import FAINT, INK, PALETTE

STRAIN = LinearSegmentedColormap.from_list("strain", ["#1f4e9c", "#7fa6d6", "#b9bec6", "#f0a060", "#d1490c"])
"""Blue compressed, grey at rest, orange stretched."""

_RANGE = Normalize(-0.2, 0.2)
_ROW = 1.1
"""Distance of rows, in cells."""

_GROUND = {"yes": "#e9f2ec", "weakly": "#fdf4dc", "no": "#fbeaea"}


def draw_sheets(figure: FigureBase, rows: list[list[Measured]]) -> None:
    """A row for each pattern, a column for each deformation."""
    _matrix(figure, rows, False)


def draw_blocks(figure: FigureBase, rows: list[list[Measured]]) -> None:
    """A row for each pattern, a column for each deformation."""
    _matrix(figure, rows, True)


def _matrix(figure: FigureBase, rows: list[list[Measured]], block: bool) -> None:
    """All pictures in one set of axes: a cell is 1 wide and high, its picture in the middle."""
    axes = figure.subplots()
    axes.set_axis_off()
    axes.set_aspect("equal")
    n, room = len(rows[0]), 1.02 if block else 0.78
    for i, row in enumerate(rows):
        drawn = thing(row[0].pattern, 2 if block else 4, block)
        scale = 0.46 / (room * float(np.ptp(drawn.rest[:, 0])))
        for j, m in enumerate(row):
            center = np.array([j, -i * _ROW])
            axes.add_patch(Rectangle((j - 0.48, center[1] - 0.56), 0.96, 1.06, fc=_GROUND[m.word], ec="none"))
            _draw(axes, drawn, m.deformation, block, center, scale)
            sure = m.word == "yes"
            axes.text(
                j,
                center[1] - 0.53,
                _caption(m, "Pa" if block else "N/m"),
                ha="center",
                va="bottom",
                fontsize=8.5,
                color=INK if sure else FAINT,
                fontweight="bold" if sure else "normal",
            )
        title = _broken(row[0].pattern.title).replace(", ", ",\n")
        axes.text(-0.56, -i * _ROW, title, ha="right", va="center", fontsize=9.5, color=INK)
    for j, m in enumerate(rows[0]):
        title = m.deformation.title.replace(", ", "\n").replace(" to ", "\nto ").replace("s dia", "s\ndia")
        axes.text(j, 0.55, title, ha="center", va="bottom", fontsize=9, fontweight="bold")
    axes.set_xlim(-1.75, n - 0.5)
    axes.set_ylim(-(len(rows) - 1) * _ROW - 0.58, 0.86)
    bar = figure.colorbar(ScalarMappable(_RANGE, STRAIN), ax=axes, location="bottom", shrink=0.3, aspect=40, pad=0.015)
    bar.set_ticks([-0.2, -0.1, 0, 0.1, 0.2], labels=["−20 %", "−10 %", "at rest", "+10 %", "+20 %"])
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=0, labelsize=8.5)


def _broken(title: str) -> str:
    return title.replace(" + bend", "\n+ bend").replace(" + hinges", "\n+ hinges")


def _caption(m: Measured, unit: str) -> str:
    if m.word == "no":
        return "free"
    if m.word == "weakly":
        return "∝ angle⁴"
    return f"{m.modulus:.3g} {'N m' if m.deformation.fold else unit}"


def _draw(
    axes: Axes, drawn: Thing, deformation: Deformation, block: bool, center: npt.NDArray[np.float64], scale: float
) -> None:
    x = deformation.move(drawn.rest, -deformation.shown if deformation.fold else deformation.shown)
    strains = drawn.strains(x)
    flat, depth = _project(x - x.mean(axis=0), block or deformation.fold)
    flat = center + np.array([0.0, 0.05]) + scale * flat
    ends = drawn.links
    order = np.argsort(depth[ends].mean(axis=1))
    length = np.linalg.norm(drawn.rest[ends[:, 1]] - drawn.rest[ends[:, 0]], axis=1)
    longest = length > 1.9 * length.min()
    if deformation.fold:
        triangles = drawn.world.topology["thing"]["triangles"]
        back = np.argsort(depth[triangles].mean(axis=1))
        axes.add_collection(
            PolyCollection(list(flat[triangles[back]]), facecolors=_shades(x[triangles[back]]), edgecolors="none")
        )
    # Skip-one links lie on the structural ones: they are drawn as faint arcs beside them.
    arcs = [k for k in order if longest[k]]
    straight = [k for k in order if not longest[k]]
    _arcs(axes, flat[ends[arcs]], strains[arcs])
    width = 1.0 if block else 1.3
    axes.add_collection(LineCollection(list(flat[ends[straight]]), colors=STRAIN(_RANGE(strains[straight])), lw=width))
    axes.plot(*flat.T, ls="", marker="o", ms=1.6 if block else 2.0, color=INK, mew=0)


def _shades(triangles: Floats) -> list[str]:
    """Greys of facets in light from the upper left."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = np.abs(normals @ np.array([-0.45, -0.25, 0.86]))
    return [f"{0.62 + 0.38 * float(v):.3f}" for v in light]


def _arcs(axes: Axes, pairs: Floats, strains: Floats) -> None:
    if not len(pairs):
        return
    t = np.linspace(0, 1, 9)
    a, b = pairs[:, 0, None], pairs[:, 1, None]
    normal = np.stack([-(b - a)[..., 1], (b - a)[..., 0]], axis=-1)
    curves = a + (b - a) * t[None, :, None] + 0.22 * normal * (t * (1 - t))[None, :, None]
    axes.add_collection(LineCollection(list(curves), colors=STRAIN(_RANGE(strains)), lw=0.7, alpha=0.8))


def _project(x: Floats, oblique: bool) -> tuple[Floats, Floats]:
    """Places on paper, and how near they are."""
    if not oblique:
        return x[:, :2], x[:, 2]
    turn, tilt = np.radians(-28.0), np.radians(36.0)
    right = np.cos(turn) * x[:, 0] + np.sin(turn) * x[:, 1]
    away = -np.sin(turn) * x[:, 0] + np.cos(turn) * x[:, 1]
    up = np.sin(tilt) * away + np.cos(tilt) * x[:, 2]
    return np.stack([right, up], axis=1) * 0.92, np.cos(tilt) * -away + np.sin(tilt) * x[:, 2]


def draw_directions(figure: FigureBase, patterns: Sequence[Pattern], matrices: Sequence[Floats]) -> None:
    """Young's modulus over direction."""
    panels = figure.subplots(1, len(patterns), subplot_kw={"projection": "polar"}, squeeze=False)[0]
    angles: npt.NDArray[np.float64] = np.linspace(0, 2 * np.pi, 721)
    highest = max(float(young(m, angles).max()) for m in matrices)
    for axes, pattern, matrix in zip(panels, patterns, matrices, strict=True):
        assert isinstance(axes, PolarAxes)
        measured, exact = young(matrix, angles), young(pattern.stiffness, angles)
        axes.fill(angles, measured, color=PALETTE[0], alpha=0.25, lw=0)
        axes.plot(angles, measured, color=PALETTE[0], lw=1.8, label="measured")
        axes.plot(angles, exact, color=INK, lw=0.9, ls=(0, (2, 3)), label="closed form")
        axes.set_ylim(0, 1.05 * highest)
        axes.set_yticks([50, 100, 150, 200], ["50", "", "150", ""], fontsize=7, color=FAINT)
        axes.set_xticks(np.arange(8) * np.pi / 4, ["→", "↗", "↑", "", "", "", "", ""])
        axes.spines["polar"].set_visible(False)
        low, high = float(measured.min()), float(measured.max())
        kind = f"{low:.0f} to {high:.0f} N/m" if high > 1.005 * low else f"{high:.0f} N/m all round"
        axes.set_title(_broken(pattern.title), loc="center", fontsize=9.5)
        axes.set_xlabel(kind, fontsize=8.5, color=FAINT, labelpad=4)
