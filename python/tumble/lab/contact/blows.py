"""Blows: Newton's cradle, and a ball that bounces until it rests."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import FigureBase

from tumble.lab.contact.figure import Figure, Result, near, small
from tumble.lab.contact.worlds import BODY, GRAIN, GRAVITY, ball, floor, now, world
from tumble.lab.exact import Floats
from tumble.style import FAINT, PALETTE

BALLS = 5
"""Of the cradle."""
LENGTH, BALL = 1.0, 0.05
"""Of the pendulums, and the radius of their balls [m]."""
GAP = 1e-4
"""Between balls at rest [m]."""
ASIDE = 20.0
"""Of the pendulums that are let go [°]."""
LETS_GO = (1, 2, 3)
"""How many of them."""

HEIGHT = 1.0
"""From which the ball falls [m]."""
RESTITUTIONS = (0.5, 0.8, 0.9)
DROP = {BODY: 0.1, GRAIN: 0.02}
"""Radius of the ball that falls [m]."""
YOUNG, STEP = 1e9, 8e-6
"""Of the grain that falls [Pa, s]: stiff, and in a quarter of the default step, since its bounces are of first order in it."""


@dataclass
class Swing:
    """A cradle in motion: a column for each ball."""

    times: Floats
    along: Floats
    """Way from its place at rest, along the row [m]."""
    heights: Floats
    """[m]"""
    speeds: Floats
    """[m/s]"""


def cradle_of(count: int, restitution: float = 1.0) -> Swing:
    """A cradle whose first `count` balls are let go; 1.7 s, in which those at the other end go up and come back."""
    aside = np.radians(ASIDE)
    pitch = 2 * BALL + GAP
    rest = [k * pitch for k in range(BALLS)]
    drawn = [[x - LENGTH * np.sin(aside), 0.0, LENGTH * (1 - np.cos(aside))] for x in rest[:count]]
    row = {
        "name": "ball", "shape": {"sphere": {"radius": BALL}}, "density": 7800.0, "friction": 0.0,
        "restitution": restitution, "position": drawn + [[x, 0.0, 0.0] for x in rest[count:]],
    }  # fmt: skip
    hung = [
        {"name": f"pivot {k}", "between": [f"ball {k}"], "at": [x, 0.0, LENGTH], "kind": {"hinge": {"axis": [0, 1, 0]}}}
        for k, x in enumerate(rest)
    ]
    moving = world({"body": [row], "joint": hung})
    seen = []
    for _ in range(170):
        moving.step()
        x, v = moving.frame["ball"]["position"], moving.frame["ball"]["velocity"]
        seen.append((x[:, 0] - rest, x[:, 2], np.hypot(v[:, 0], v[:, 2])))
    along, heights, speeds = np.array(seen, dtype=np.float64).transpose(1, 0, 2)
    return Swing(0.01 * np.arange(1, 171, dtype=np.float64), along, heights, speeds)


def cradle(restitution: float = 1.0) -> Result:
    """As many balls leave as come in, as fast, and rise as high. The figures are those of elastic balls."""
    swings = {count: cradle_of(count, restitution) for count in LETS_GO}
    top = LENGTH * (1 - np.cos(np.radians(ASIDE)))
    fastest = float(np.sqrt(2 * GRAVITY * top))
    figures: list[Figure] = []
    for count, swing in swings.items():
        # Balls meet after a quarter of a period, 0.5 s, and those that leave have their highest place at half a period.
        after = (swing.times > 0.6) & (swing.times < 1.4)
        leaves = swing.heights[after][:, BALLS - count :].max(axis=0)
        figures.append(near(f"{count} in: height of the lowest ball out", float(leaves.min()), top, 1e-2, "m"))
        stays = swing.along[after][:, : BALLS - count]
        figures.append(small(f"{count} in: displacement of the others", 1e3 * float(np.abs(stays).max()), 5.0, "mm"))
    first = swings[1]
    at = (first.times > 0.52) & (first.times < 0.7)
    kinetic = first.speeds[at, -1] ** 2 + 2 * GRAVITY * first.heights[at, -1]
    figures.append(near("1 in: speed of the ball out", float(np.sqrt(kinetic.max())), fastest, 1e-2, "m/s"))
    text = (
        f"<p>{BALLS} elastic balls hang side by side, {1e3 * GAP:.1g} mm apart, on pendulums of {LENGTH:g} m. One, two or "
        f"three are let go {ASIDE:.0f}° aside. As many leave at the other end, as fast, and rise to the same height.</p>"
    )
    return Result(text, figures, partial(_cradle, swings=swings, top=top))


@dataclass
class Bounces:
    """A ball that falls on a floor, and its way."""

    times: Floats
    heights: Floats
    """Of its lowest point [m]."""
    tops: list[float]
    """How high it gets after each bounce [m]."""
    rest: float
    """From when on it is slower than 1 mm/s [s]."""


def drop(kind: str, restitution: float, seconds: float) -> Bounces:
    """Lets a ball fall from HEIGHT, so long."""
    radius = DROP[kind]
    grain = {"young": YOUNG} if kind == GRAIN else {}
    words = ball(kind, radius, restitution=restitution, friction=0.0, position=[[0.0, 0.0, HEIGHT + radius]], **grain)
    step = STEP if kind == GRAIN else None
    air = world({**words, "collider": [floor(0.0, restitution=0.0)]}, fps=200.0, step=step)
    z, v = [HEIGHT], [0.0]
    for _ in range(round(200.0 * seconds)):
        air.step()
        z.append(float(now(air, "position")[2]) - radius)
        v.append(float(now(air, "velocity")[2]))
    heights, speeds = np.array(z), np.array(v)
    # In flight z + v²/(2 g) is the height of the top; frames in which it turns from falling to rising begin a flight.
    top = heights + speeds**2 / (2 * GRAVITY)
    begins = np.flatnonzero((speeds[:-1] < 0) & (speeds[1:] > 0)) + 1
    tops = [float(top[a:b].max()) for a, b in zip(begins, [*begins[1:], len(top)], strict=True)]
    moves = np.flatnonzero(np.abs(speeds) > 1e-3)
    return Bounces(np.arange(len(z)) / 200.0, heights, tops, float(moves[-1] + 1) / 200.0 if len(moves) else 0.0)


def total(restitution: float) -> float:
    """Time until it rests [s]."""
    return float(np.sqrt(2 * HEIGHT / GRAVITY) * (1 + restitution) / (1 - restitution))


def bounce(restitutions: Sequence[float] = RESTITUTIONS) -> Result:
    """A ball bounces until it rests. The figures are those of RESTITUTIONS, in their order."""
    figures: list[Figure] = []
    falls: dict[float, Bounces] = {}
    for e, own in zip(RESTITUTIONS, restitutions, strict=True):
        falls[e] = drop(BODY, own, 1.15 * total(e))
        tops = [*falls[e].tops, *[float("nan")] * 3]
        figures += [
            near(f"rigid body, e = {e:g}: height of the third bounce", tops[2], HEIGHT * e**6, 5e-3, "m"),
            near(f"rigid body, e = {e:g}: time until it rests", falls[e].rest, total(e), 2e-2, "s"),
        ]
    for e, own in zip(RESTITUTIONS, restitutions, strict=True):
        tops = [*drop(GRAIN, own, 0.6).tops, float("nan")]
        figures.append(near(f"grain, e = {e:g}: speed after a bounce over before", (tops[0] / HEIGHT) ** 0.5, e, 1e-2))
    text = (
        f"<p>A ball falls from {HEIGHT:g} m. Its bounces have heights e², e⁴, e⁶ … of that, and it rests after "
        "√(2h/g) (1 + e)/(1 − e), the sum of all of them. Grains: their first bounce, with a Young's modulus of 1 GPa and a "
        "quarter of the default step. In the default step, at 10 MPa, a grain with e = 0.5 loses 3 % more of its speed.</p>"
    )
    return Result(text, figures, partial(_bounce, falls=falls))


def _cradle(figure: FigureBase, swings: dict[int, Swing], top: float) -> None:
    panels = figure.subplots(1, len(swings), sharey=True)
    for axes, (count, swing) in zip(panels, swings.items(), strict=True):
        axes.axhline(top, color=FAINT, lw=0.8, ls=":")
        for k in range(BALLS):
            # Balls that go together lie on one curve: the later ones are thinner.
            axes.plot(swing.times, swing.heights[:, k], color=PALETTE[k], lw=4.0 - 0.7 * k, label=f"ball {k + 1}")
        axes.set_title(f"{count} in, {count} out")
        axes.set_xlabel("time [s]")
        axes.set_ylim(top=1.45 * top)
        axes.legend(loc="upper center", fontsize=7.5, ncols=BALLS, handlelength=1.0, columnspacing=0.8)
    panels[0].set_ylabel("height [m]")
    panels[0].text(0.0, top, "start", color=FAINT, fontsize=8, va="bottom")


def _bounce(figure: FigureBase, falls: dict[float, Bounces]) -> None:
    axes, beside = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.7, 1]})
    for (e, fall), ink in zip(falls.items(), PALETTE, strict=False):
        shown = fall.times < 4.5
        axes.plot(fall.times[shown], fall.heights[shown], color=ink, lw=1.3, label=f"e = {e:g}")
        if total(e) < 4.5:
            axes.axvline(total(e), color=ink, lw=0.9, ls=":")
        numbers = np.arange(1, min(sum(top > 1e-4 for top in fall.tops), 12) + 1)
        beside.semilogy(numbers, HEIGHT * e ** (2.0 * numbers), color=ink, lw=1.0)
        beside.semilogy(numbers, fall.tops[: len(numbers)], "o", color=ink, ms=4, label=f"e = {e:g}")
    axes.set_title("Rigid body: height; dotted, when it is to rest")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("height [m]")
    axes.legend(loc="upper right")
    beside.set_title("Heights of bounces; lines: exact")
    beside.set_xlabel("number of the bounce")
    beside.set_ylabel("height [m]")
    beside.legend(loc="lower left")
