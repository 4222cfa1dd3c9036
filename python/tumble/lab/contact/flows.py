"""Grains in bulk: what flows out of a silo, and how far a column runs when its wall is taken away."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import FigureBase

from tumble.lab.contact.figure import Figure, Result, near, within
from tumble.lab.contact.worlds import Words, block, floor, world
from tumble.lab.exact import Floats
from tumble.style import FAINT, INK, PALETTE

RADIUS = 0.0025
"""Mean radius of grains, which differ by up to a tenth [m]."""
DENSITY, YOUNG, PACKED = 2500.0, 5e5, 0.6
"""Of grains [kg/m³, Pa], and their part of the volume where they are packed."""
FPS = 50

ORIFICES = (4.0, 5.5, 7.5)
"""Widths of the square orifice, in diameters of a grain."""
SILOS = {4.0: (0.05, 1200), 5.5: (0.06, 1600), 7.5: (0.08, 2400)}
"""Width of the silo for each [m], and the number of grains."""
LOST = 1.4
"""Of the width, at whose rim no grains pass, in diameters [beverloo1961]."""
TALL = (5.5, 2)
"""The silo that is filled to several times its height as well, and how many."""
LETS_OUT = 0.3
"""Part of the grains that flow out."""
BELOW = -0.06
"""Height of the shelf for grains that have left it [m]."""
SETTLES = 0.3
"""For so long orifices and gates are closed [s]."""


def _sand(friction: float, fill: Words, **more: float) -> Words:
    return {
        "name": "sand", "radius": RADIUS, "radius_spread": 0.1, "density": DENSITY, "young": YOUNG, "friction": friction,
        "fill": [fill], **more,
    }  # fmt: skip


@dataclass
class Flow:
    """Grains that leave a silo."""

    width: float
    """Of the orifice [m]."""
    height: float
    """To which it is filled at the start [m]."""
    times: Floats
    counts: Floats
    """How many have left."""
    rate: float
    """[1/s]"""


def flow(diameters: float, fill: int = 1, friction: float = 0.5) -> Flow:
    """Lets grains out of a silo with a flat bottom and a square orifice. It is filled to so many times the usual height."""
    wide, grains = SILOS[diameters][0], fill * SILOS[diameters][1]
    width = 2 * RADIUS * diameters
    side, offset, thick = (wide - width) / 2, (wide + width) / 4, 0.01
    loose = grains * 4 / 3 * np.pi * RADIUS**3 / 0.25 / wide**2 + 4 * RADIUS
    box = {"center": [0.0, 0.0, loose / 2], "size": [wide, wide, loose], "count": grains}
    opens = {"keys": [{"time": SETTLES}, {"time": SETTLES + 1e-3, "translate": [0.0, 0.0, -0.5]}]}
    plates: Sequence[tuple[list[float], list[float]]] = (
        ([offset, 0.0], [side, wide]),
        ([-offset, 0.0], [side, wide]),
        ([0.0, offset], [width, side]),
        ([0.0, -offset], [width, side]),
    )
    solids = [
        block(f"plate {k}", [*center, -thick / 2], [*size, thick], friction) for k, (center, size) in enumerate(plates)
    ]
    away = (wide + thick) / 2
    for k, (x, y) in enumerate(((away, 0.0), (-away, 0.0), (0.0, away), (0.0, -away))):
        plan = [thick, wide + 2 * thick] if x else [wide + 2 * thick, thick]
        solids.append(block(f"wall {k}", [x, y, 0.15], [*plan, 0.34], friction))
    solids.append(block("gate", [0.0, 0.0, -thick / 2], [width, width, thick], friction, motion=opens))
    solids.append(block("shelf", [0.0, 0.0, BELOW - thick / 2], [1.0, 1.0, thick], friction))
    silo = world({"grains": [_sand(friction, box)], "collider": solids}, fps=FPS, precision="single")
    silo.step(round(SETTLES * FPS))
    z = np.sort(silo.frame["sand"]["position"][:, 2])
    times, counts = [0.0], [0.0]
    aside = np.zeros(grains, bool)
    while counts[-1] < LETS_OUT * SILOS[diameters][1] and times[-1] < 2.0:
        silo.step()
        places, speeds = (silo.frame["sand"][name].astype(float) for name in ("position", "velocity"))
        left = places[:, 2] < -thick
        times.append(times[-1] + 1 / FPS)
        counts.append(float((left | aside).sum()))
        # They are put aside on the shelf: grains that fall fast take long.
        new = np.flatnonzero(left & ~aside)
        n = int(aside.sum()) + np.arange(len(new))
        aside[new] = True
        grid = np.column_stack([n % 40 - 20, n // 40 - 20, np.zeros(len(n))])
        places[new] = 2.5 * RADIUS * grid + [0.0, 0.0, BELOW + 1.1 * RADIUS]
        speeds[new] = 0.0
        silo.write("sand", "position", places)
        silo.write("sand", "velocity", speeds)
    t, gone = np.array(times), np.array(counts)
    steady = gone > 0.15 * gone[-1]
    rate = float(np.polyfit(t[steady], gone[steady], 1)[0]) if steady.sum() > 2 else float("nan")
    return Flow(width, float(z[-len(z) // 50]), t, gone, rate)


def hopper(friction: float = 0.5) -> Result:
    """Flow out of a silo over the width of its orifice, and over the height of its filling."""
    flows = {d: flow(d, friction=friction) for d in ORIFICES}
    tall = flow(*TALL, friction=friction)
    widths, rates = np.array(ORIFICES), np.array([f.rate for f in flows.values()])
    power, scale = np.polyfit(np.log(widths - LOST), np.log(rates), 1)
    usual = flows[TALL[0]]
    figures = [
        within(f"power of (D − {LOST:g} d) in the flow", float(power), 2.2, 2.8),
        near(
            f"flow at {tall.height / usual.height:.1f} times the height, relative to before",
            tall.rate / usual.rate,
            1.0,
            0.1,
        ),
    ]
    text = (
        f"<p>Grains of a diameter d of {2e3 * RADIUS:g} mm flow out of silos with a flat bottom through a square orifice of "
        f"the width D. Beverloo's law: the flow is in proportion to (D − {LOST:g} d)<sup>5/2</sup>, since no grains pass at "
        "the rim, and does not depend on the height of the filling; that of a liquid grows as its root. Flow: the slope of the "
        f"number of grains that have left, up to {100 * LETS_OUT:.0f} % of all.</p>"
    )
    draw = partial(_flows, flows=flows, tall=tall, law=(float(power), float(np.exp(scale))))
    return Result(text, figures, draw)


def _flows(figure: FigureBase, flows: dict[float, Flow], tall: Flow, law: tuple[float, float]) -> None:
    axes, beside = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.4, 1]})
    for (d, one), ink in zip(flows.items(), PALETTE, strict=False):
        axes.plot(one.times, one.counts, color=ink, label=f"D = {d:g} d")
        beside.loglog(d - LOST, one.rate, "o", color=ink)
    again = PALETTE[list(flows).index(TALL[0])]
    axes.plot(tall.times, tall.counts, "--", color=again, label=f"D = {TALL[0]:g} d, filled {TALL[1]} times as high")
    beside.loglog(TALL[0] - LOST, tall.rate, "s", color=again, mfc="none", ms=9)
    axes.set_title("Grains that have left")
    axes.set_xlabel("time since it was opened [s]")
    axes.set_ylabel("number")
    axes.legend(loc="lower right")
    fine = np.geomspace(ORIFICES[0] - LOST, ORIFICES[-1] - LOST, 20)
    beside.plot(fine, law[1] * fine ** law[0], color=INK, lw=1.2, label=f"fit: power {law[0]:.2f}")
    middle = np.sqrt(fine[0] * fine[-1])
    for power, line in ((2.2, ":"), (2.8, "--")):
        through = law[1] * middle ** law[0] * (fine / middle) ** power
        beside.plot(fine, through, line, color=FAINT, lw=1.0, label=f"power {power:g}")
    beside.set_title("Flow")
    beside.set_yticks([300, 500, 1000, 2000, 3000], ["300", "500", "1000", "2000", "3000"])
    beside.set_xlabel(f"D/d − {LOST:g}")
    beside.set_ylabel("grains a second")
    ticks = [round(d - LOST, 1) for d in ORIFICES]
    beside.set_xticks(ticks, [f"{t:g}" for t in ticks])
    beside.minorticks_off()
    beside.legend(loc="upper left")


# A column that collapses

COLUMN, DEEP = 0.05, 0.015
"""Width of the column, and distance of the panes [m]."""
ASPECTS = (1.0, 2.0, 3.0)
"""Heights of the columns over their width, about."""
GLASS = (0.3, 0.0)
"""Friction and rolling friction of grains that run out as measured."""
ANGULAR = (0.5, 0.3)
"""Of grains that run less far."""


@dataclass
class Collapse:
    """A column before and after."""

    aspect: float
    """Height over width when it has settled."""
    runout: float
    """Way of its edge over the width before."""
    height: float
    """At the end, over the width before."""
    before: Floats
    after: Floats
    """Places of grains [m]."""


def collapse(aspect: float, friction: float, rolling: float) -> Collapse:
    """A column between two panes, whose gate is pulled away when it has settled."""
    tall = aspect * COLUMN
    grains = round(PACKED * tall * COLUMN * DEEP / (4 / 3 * np.pi * RADIUS**3))
    box = {"center": [COLUMN / 2, 0.0, 1.5 * tall], "size": [COLUMN, DEEP, 3 * tall], "count": grains}
    opens = {"keys": [{"time": SETTLES}, {"time": SETTLES + 0.04, "translate": [0.0, 0.0, 0.6]}]}
    solids = [
        floor(max(friction, 0.3)),
        block("gate", [COLUMN + 0.01, 0.0, 0.3], [0.02, 0.1, 0.6], 0.0, motion=opens),
        block("panes", [0.5, 0.0, 0.5], [1.0, DEEP, 1.2], 0.0, inside=True),
    ]
    sand = _sand(friction, box, rolling_friction=rolling)
    bench = world({"grains": [sand], "collider": solids}, fps=FPS, precision="single")
    bench.step(round(SETTLES * FPS))
    before = bench.frame["sand"]["position"].astype(float)
    bench.step(round(0.8 * FPS))
    after = bench.frame["sand"]["position"].astype(float)
    return Collapse(_top(before) / COLUMN, _edge(after) / COLUMN - 1.0, _top(after) / COLUMN, before, after)


def _top(places: Floats) -> float:
    """Height of what lies there [m], without single grains on top."""
    return float(np.quantile(places[:, 2], 0.99)) + RADIUS


def _edge(places: Floats, bin_width: float = 0.01) -> float:
    """Up to where it is a grain deep [m]: beyond lie single ones that have rolled on."""
    edges = np.arange(0.0, 1.0 + bin_width / 2, bin_width)
    counts, _ = np.histogram(places[:, 0], edges)
    depth = counts * 4 / 3 * np.pi * RADIUS**3 / (PACKED * bin_width * DEEP)
    return float(edges[np.flatnonzero(depth > 2 * RADIUS).max(initial=0) + 1])


def band(aspect: float) -> tuple[float, float]:
    """Run-outs of columns of this aspect that were measured between walls: [lube2005] finds the smaller ones, proportional to
    the aspect until somewhere between 1.8 and 2.8, then to its power 2/3; [lajeunesse2005] the larger ones, to 3."""
    slow, fast = 1.9 * aspect ** (2 / 3), 2.3 * aspect ** (2 / 3)
    low = 1.2 * aspect if aspect < 1.8 else min(1.2 * aspect, slow) if aspect < 2.8 else slow
    return float(low), float(1.8 * aspect if aspect < 3.0 else fast)


def column(friction: float = GLASS[0], rolling: float = GLASS[1]) -> Result:
    """Columns of several aspects. What is said to be glass has this friction."""
    columns = [collapse(aspect, friction, rolling) for aspect in ASPECTS]
    smooth, angular = collapse(2.0, 0.0, 0.0), collapse(2.0, *ANGULAR)
    figures: list[Figure] = []
    for one in columns:
        figures.append(
            within(f"glass, height {one.aspect:.2f} times the width: run-out", one.runout, *band(one.aspect))
        )
    figures += [
        within(f"glass, {columns[1].aspect:.2f} times: final height over the width", columns[1].height, 0.8, 1.7),
        within("control, no friction: run-out is longer", smooth.runout, band(smooth.aspect)[1], np.inf),
        within("control, angular grains: run-out is shorter", angular.runout, -np.inf, band(angular.aspect)[0]),
    ]
    text = (
        f"<p>Columns of grains, {COLUMN / (2 * RADIUS):.0f} diameters wide between two panes, collapse when a gate is pulled "
        "away. The run-out is the advance of the front, where the deposit is one grain deep, over the width of the column. "
        f"Glass has μ = {GLASS[0]:g}. The band lies between the laws that Lube et al. and Lajeunesse et al. "
        "fitted to their measurements. Controls must lie outside it: grains without friction, and angular ones with "
        f"μ = {ANGULAR[0]:g} and rolling friction {ANGULAR[1]:g}.</p>"
    )
    named = {"glass": columns[1], "no friction": smooth, "angular": angular}
    return Result(text, figures, partial(_columns, columns=columns, named=named), 6.2)


def _columns(figure: FigureBase, columns: list[Collapse], named: dict[str, Collapse]) -> None:
    grid = figure.add_gridspec(len(named), 2, width_ratios=[1.3, 1])
    marks = dict(zip(named, ("o", "^", "s"), strict=True))
    for k, (name, one) in enumerate(named.items()):
        axes = figure.add_subplot(grid[k, 0])
        for places, ink, when in ((one.before, FAINT, "before"), (one.after, PALETTE[k], "after 0.8 s")):
            axes.plot(*(100 * places[:, [0, 2]]).T, ".", color=ink, ms=3.5, mew=0, label=when)
        axes.set_title(f"{name[0].upper()}{name[1:]}", fontsize=9.5)
        axes.set_xlim(-0.5, 36)
        axes.set_ylim(0, 14)
        axes.set_aspect("equal")
        axes.legend(loc="upper right", ncols=2, markerscale=2.5)
        axes.set_ylabel("z [cm]")
        axes.tick_params(labelbottom=k == len(named) - 1)
    axes.set_xlabel("x [cm]")
    over = figure.add_subplot(grid[:, 1])
    fine = np.linspace(0.6, 3.5, 200)
    low, high = np.array([band(a) for a in fine]).T
    over.fill_between(fine, low, high, color=FAINT, alpha=0.25, lw=0, label="measured: Lube, Lajeunesse")
    over.plot([c.aspect for c in columns], [c.runout for c in columns], marks["glass"], color=PALETTE[0], label="glass")
    for k, name in enumerate(named):
        if name != "glass":
            over.plot(named[name].aspect, named[name].runout, marks[name], color=PALETTE[k], label=name)
    over.set_yscale("log")
    over.set_yticks([0.5, 1, 2, 5, 10, 20], ["0.5", "1", "2", "5", "10", "20"])
    over.minorticks_off()
    over.set_title("Run-out over the width")
    over.set_xlabel("height over width before")
    over.set_ylabel("run-out")
    over.set_ylim(0.5, 40)
    over.legend(loc="upper left", fontsize=8)
