"""What stands and what falls: a card house, and an arch of stones."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from tumble._engine import World
from tumble.lab.contact.figure import Result, near, small, within
from tumble.lab.contact.worlds import Words, block, floor, world
from tumble.lab.exact import Floats
from tumble.style import FAINT, INK, PALETTE

CARD, THICK, WIDE = 1.0, 0.02, 0.6
"""Length, thickness and width of a card [m]."""
LEAN = 60.0
"""Of a card, from the floor [°]."""
FRICTIONS = (0.9, 0.97, 1.03, 1.1)
"""Of the cards that are drawn, over the least one."""

STONES = 21
THICKNESSES = (0.09, 0.10, 0.12)
"""Of the arches that are drawn, over the mean radius."""
MANY = 0.107478
"""Least thickness of an arch of very many stones."""
BED = 0.3
"""Height of the blocks on which it stands [m]."""


@dataclass
class Fall:
    """What stands or falls, seen from the side."""

    times: Floats
    heights: Floats
    """Of a centre of mass [m]."""
    early: list[Floats]
    """Outlines of its parts early in the fall [m]."""

    @property
    def stands(self) -> bool:
        """Whether it has sunk by less than a twentieth of its height."""
        return bool(self.heights[-1] > 0.95 * self.heights[0])


def _turns(seen: World, name: str) -> Floats:
    """Matrices of the turns of bodies, from their principal axes to those of the world."""
    turns = []
    for x, y, z, w in seen.columns("turn")[name]["turn"]:
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turns.append(np.eye(3) + 2.0 * (w * cross + cross @ cross))
    return np.array(turns)


def _outlines(seen: World, name: str, sections: Sequence[Floats], start: Floats) -> list[Floats]:
    """Sections of bodies in the plane of x and z, given as they were when their turns were those of `start`."""
    places = seen.frame[name]["position"][:, [0, 2]]
    turned = [(now @ before.T)[np.ix_([0, 2], [0, 2])] for now, before in zip(_turns(seen, name), start, strict=True)]
    return [section @ turn.T + place for section, turn, place in zip(sections, turned, places, strict=True)]


def _least(stands: Callable[[float], bool], low: float, high: float, tries: int) -> float:
    """Where falling turns into standing, between two numbers."""
    for _ in range(tries):
        middle = (low + high) / 2
        low, high = (low, middle) if stands(middle) else (middle, high)
    return (low + high) / 2


# Two cards


def _card() -> tuple[Floats, Floats]:
    """The section of the left card, about its centre of mass, and that centre: cut level at the floor, upright at the top."""
    lean = np.radians(LEAN)
    foot, top = THICK / (2 * np.sin(lean)), THICK / (2 * np.cos(lean))
    x, z = CARD * np.cos(lean), CARD * np.sin(lean)
    corners = np.array([[-foot, 0.0], [foot, 0.0], [x, z - top], [x, z + top]])
    after = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
    centre = ((corners + after) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
    return corners - centre, centre


def least_friction() -> float:
    """At which the house stands. A card begins to fall by turning about the inner edge of its foot and the upper edge of its
    top: there the push of the other one has the longest arm, and the weight the shortest."""
    section, _ = _card()
    return float(-section[1, 0] / (section[3, 1] - section[0, 1]))


def house(friction: float, seconds: float = 2.0) -> Fall:
    """Two cards that lean on each other."""
    section, centre = _card()
    apart = CARD * np.cos(np.radians(LEAN)) - centre[0]
    cards = []
    for name, side in (("left", 1.0), ("right", -1.0)):
        points = [[side * x, y, z] for x, z in section for y in (-WIDE / 2, WIDE / 2)]
        cards.append(
            {
                "name": name, "shape": {"hull": {"points": points}}, "position": [[-side * apart, 0.0, centre[1]]],
                "density": 700.0, "friction": friction,
            }
        )  # fmt: skip
    table = world({"body": cards, "collider": [floor(friction)]}, fps=50.0)
    sections = {"left": section, "right": section * [-1, 1]}
    start = {name: _turns(table, name) for name in sections}
    heights, early = [centre[1]], list[Floats]()
    for frame in range(1, round(50 * seconds) + 1):
        table.step()
        heights.append(float(table.frame["left"]["position"][0, 2]))
        if frame == 30:
            for name, one in sections.items():
                early += _outlines(table, name, [one], start[name])
    return Fall(np.arange(len(heights)) / 50.0, np.array(heights), early)


def cards(share: float = 1.0) -> Result:
    """A card house. Its friction is this share of what it is said to be."""
    exact = least_friction()
    falls = {part: house(share * part * exact) for part in FRICTIONS}
    least = _least(lambda mu: house(share * mu).stands, 0.5 * exact, 1.5 * exact, 7)
    stays = house(share * 1.1 * exact, 10.0)
    last = falls[FRICTIONS[0]].heights
    figures = [
        near("least friction at which it stands", least, exact, 2e-2),
        small(
            "friction 10 % above: centre sinks in 10 s", 1e3 * float(stays.heights[0] - stays.heights[-1]), 1.0, "mm"
        ),
        within("friction 10 % below: final height over initial height", float(last[-1] / last[0]), 0.0, 0.05),
    ]
    text = (
        f"<p>Two cards of {CARD:g} m lean on each other at {LEAN:.0f}° on a floor; their tops are cut upright, "
        "their feet level. Each pushes the other with m g/(2 tan a), which friction has to hold at the feet: thin cards stand "
        f"where μ ≥ 1/(2 tan a) = {0.5 / np.tan(np.radians(LEAN)):.4f}. With the edges of cards {1e3 * THICK:.0f} mm thick it "
        f"is {exact:.4f}. The card house is simulated with frictions around that; the least one is found by bisection.</p>"
    )
    return Result(text, figures, partial(_cards, falls=falls), 4.4)


def _cards(figure: FigureBase, falls: dict[float, Fall]) -> None:
    grid = figure.add_gridspec(2, 4, width_ratios=[1, 1, 0.1, 2.6])
    for k, (part, fall) in enumerate(falls.items()):
        axes = figure.add_subplot(grid[k // 2, k % 2])
        _draw(axes, fall.early, PALETTE[k])
        axes.set_xlim(-0.95, 0.95)
        axes.set_ylim(-0.05, 1.0)
        axes.set_title(f"{100 * (part - 1):+.0f} %".replace("-", "−"), fontsize=9.5)
    over = figure.add_subplot(grid[:, 3])
    for k, (part, fall) in enumerate(falls.items()):
        label = f"{100 * (part - 1):+.0f} % of the least friction".replace("-", "−")
        over.plot(fall.times, fall.heights, color=PALETTE[k], lw=3.6 - 0.7 * k, label=label)
    over.axvline(0.6, color=FAINT, lw=0.8, ls=":")
    over.text(0.6, 0.02, " as drawn", color=FAINT, fontsize=8, transform=over.get_xaxis_transform())
    over.set_ylim(0, 0.62)
    over.set_title("Height of a card's centre")
    over.set_xlabel("time [s]")
    over.set_ylabel("height [m]")
    over.legend(loc="upper right", ncols=2)


def _draw(axes: Axes, outlines: list[Floats], ink: str, ground: tuple[float, float] = (-2.0, 2.0)) -> None:
    """Sections of bodies on the ground."""
    axes.plot(ground, [0, 0], color=INK, lw=1.0)
    for outline in outlines:
        axes.fill(*outline.T, facecolor=ink, edgecolor=INK, lw=0.5, alpha=0.85)
    axes.set_aspect("equal")
    axes.set_axis_off()


# An arch


def least_thickness(stones: int = STONES) -> float:
    """Of a semicircular arch of this many stones without sliding, over its mean radius: the least at which a line of thrust
    lies within all joints [heyman1969]."""
    low, high = 0.05, 0.2
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if _room(middle, stones) > 0 else (middle, high)
    return high


def _room(thickness: float, stones: int) -> float:
    """How much room the line of thrust has within the joints of half an arch, by symmetry; negative if it has none.

    A thrust H at the height M/H of the crown and the weight A of the stones above a joint at the angle a from the upright
    have the moment H s cos a + A s sin a - (moment of A) - M about the point of the joint at the radius s, which must be
    negative at the inner edge and positive at the outer one. The room is concave in H.
    """
    inner, outer = 1 - thickness / 2, 1 + thickness / 2
    count = stones // 2 + stones % 2
    angle = (np.arange(count) + (0.5 if stones % 2 else 1.0)) * np.pi / stones
    area = angle / 2 * (outer**2 - inner**2)
    moment = (outer**3 - inner**3) / 3 * (1 - np.cos(angle))

    def room(thrust: float) -> float:
        below, above = (thrust * s * np.cos(angle) + area * s * np.sin(angle) - moment for s in (inner, outer))
        # Where an even number of stones has a joint at the crown, thrust stays within that as well.
        at_crown = (thrust * inner, thrust * outer) if stones % 2 == 0 else (-np.inf, np.inf)
        return float(min(above.min(), at_crown[1]) - max(below.max(), at_crown[0]))

    low, high = 0.0, 2.0 * thickness
    for _ in range(80):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        low, high = (a, high) if room(a) < room(b) else (low, b)
    return room((low + high) / 2)


def _stone(thickness: float) -> tuple[Floats, float]:
    """The section of a stone about its centre of mass, and the distance of that from the centre of the arch."""
    half = np.pi / STONES / 2
    inner, outer = 1 - thickness / 2, 1 + thickness / 2
    centre = float(2 / 3 * np.cos(half) * (outer**3 - inner**3) / (outer**2 - inner**2))
    corners = [
        [side * s * np.sin(half), s * np.cos(half) - centre]
        for s, side in ((inner, -1), (inner, 1), (outer, 1), (outer, -1))
    ]
    return np.array(corners), centre


def arch_of(thickness: float, seconds: float = 1.5) -> Fall:
    """A semicircular arch of a mean radius of 1 m on two blocks."""
    section, centre = _stone(thickness)
    angles = (np.arange(STONES) - (STONES - 1) / 2) * np.pi / STONES
    stones: Words = {
        "name": "arch", "density": 2000.0, "friction": 1.0,
        "shape": {"hull": {"points": [[x, y, z] for x, z in section for y in (-0.15, 0.15)]}},
        "position": [[centre * np.sin(a), 0.0, centre * np.cos(a) + BED] for a in angles],
        "rotate": [[0.0, float(np.degrees(a)), 0.0] for a in angles],
    }  # fmt: skip
    beds: list[Any] = [block(f"bed {x:g}", [x, 0.0, BED / 2], [0.3, 1.0, BED], 1.0) for x in (-1.0, 1.0)]
    site = world({"body": [stones], "collider": [*beds, floor(1.0)]}, fps=24.0, substeps=80, rigid={"iterations": 32})
    key, start = STONES // 2, _turns(site, "arch")
    # A stone at the angle a from the upright leans by it.
    leans = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in angles]
    sections = [section @ lean for lean in leans]
    heights, early = [centre + BED], list[Floats]()
    for frame in range(1, round(24 * seconds) + 1):
        site.step()
        heights.append(float(site.frame["arch"]["position"][key, 2]))
        if frame == 13:
            early = _outlines(site, "arch", sections, start)
    return Fall(np.arange(len(heights)) / 24.0, np.array(heights), early)


def arch(share: float = 1.0) -> Result:
    """An arch of stones. Its thickness is this share of what it is said to be."""
    exact = least_thickness()
    falls = {t: arch_of(share * t) for t in THICKNESSES}
    least = _least(lambda t: arch_of(share * t).stands, 0.10, 0.12, 4)
    sinks = {t: float(fall.heights[0] - fall.heights[-1]) for t, fall in falls.items()}
    figures = [
        near("least thickness at which it stands, over the radius", least, exact, 3e-2),
        small("t/R = 0.12: keystone sinks in 1.5 s", 1e3 * sinks[0.12], 5.0, "mm"),
        within("t/R = 0.10: keystone sinks", sinks[0.10], 0.5, 1.5, "m"),
        within("t/R = 0.09: keystone sinks", sinks[0.09], 0.5, 1.5, "m"),
    ]
    text = (
        f"<p>A semicircular arch of {STONES} stones without mortar, with so much friction that none slides. It stands if a "
        "line of thrust lies within it (Heyman's theorem), for which its thickness must be at least "
        f"{exact:.4f} of its mean radius; of very many stones it is {MANY:.4f} (Milankovitch). The least thickness is found by "
        "bisection between 0.10 and 0.12. Contacts give way a little while passes converge, so that an arch needs to be "
        "somewhat thicker: with 32 passes it is 0.1106 in sub-steps of 1/960 s, and nearer to statics in those of 1/1920 s, "
        "as here.</p>"
    )
    return Result(text, figures, partial(_arches, falls=falls), 5.2)


def _arches(figure: FigureBase, falls: dict[float, Fall]) -> None:
    grid = figure.add_gridspec(2, len(falls), height_ratios=[1.1, 1])
    for k, (t, fall) in enumerate(falls.items()):
        ink, axes = PALETTE[k], figure.add_subplot(grid[0, k])
        _draw(axes, fall.early, ink)
        for x in (-1.0, 1.0):
            axes.fill([x - 0.15, x + 0.15, x + 0.15, x - 0.15], [0, 0, BED, BED], facecolor=FAINT, lw=0)
        axes.set_xlim(-1.3, 1.3)
        axes.set_ylim(-0.03, 1.45)
        axes.set_title(f"t/R = {t:.2f}", fontsize=9.5)
    axes = figure.add_subplot(grid[1, :])
    for ink, (t, fall) in zip(PALETTE, falls.items(), strict=False):
        axes.plot(fall.times, fall.heights, color=ink, label=f"t/R = {t:.2f}")
    at = 13 / 24
    axes.axvline(at, color=FAINT, lw=0.8, ls=":")
    axes.text(at, 0.9, " as drawn", color=FAINT, fontsize=8, transform=axes.get_xaxis_transform())
    axes.set_title("Height of the keystone")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("height [m]")
    axes.set_ylim(bottom=0)
    axes.legend(loc="center right")
