"""Blocks and balls on slopes: what slides, what rolls, and what slips before it rolls."""

from functools import partial

import numpy as np
from matplotlib.figure import FigureBase

from tumble.lab.contact.figure import Result, near, small
from tumble.lab.contact.worlds import BODY, GRAIN, GRAVITY, KINDS, Words, ball, floor, now, world
from tumble.lab.exact import Floats
from tumble.style import FAINT, INK, PALETTE

MU = 0.5
"""Friction of the block."""
MU_BALL = 0.3
"""Friction of the balls that roll."""
RADIUS = {BODY: 0.1, GRAIN: 0.02}
"""Of balls [m]: grains yield, large ones more of their radius."""
ANGLES = (5.0, 15.0, 25.0, 35.0, 45.0, 60.0)
"""Of slopes [°]."""
SPEED = 2.0
"""Of the ball that starts without a turn [m/s]."""
STYLES = {BODY: ("o", PALETTE[0], 8.0), GRAIN: ("s", PALETTE[1], 4.0)}
"""Marker, colour and size."""

Curve = list[tuple[float, float]]


def sliding(angle: float, friction: float) -> float:
    """Acceleration of what slides down a slope [m/s²]."""
    return float(max(GRAVITY * (np.sin(angle) - friction * np.cos(angle)), 0.0))


def rolling_down(angle: float, friction: float) -> float:
    """Acceleration of a ball: it rolls where tan a <= 7/2 mu, and slips on steeper slopes [m/s²]."""
    rolls = np.tan(angle) <= 3.5 * friction
    return float(5.0 / 7.0 * GRAVITY * np.sin(angle)) if rolls else sliding(angle, friction)


def _block(kind: str, friction: float) -> Words:
    """A block; of grains there are balls alone, and one whose rolling is held slides as a block does."""
    if kind == BODY:
        shape = {"box": {"size": [0.4, 0.4, 0.2]}}
        return {"body": [{"name": "ball", "shape": shape, "position": [[0.0, 0.0, 0.1]], "friction": friction}]}
    return ball(GRAIN, RADIUS[GRAIN], friction=friction, rolling_friction=2.0)


def acceleration(things: Words, degrees: float, friction: float) -> float:
    """Down the slope [m/s²], over a second after 0.3 s in which it settles."""
    slope = world({**things, "collider": [floor(friction)]}, angle=float(np.radians(degrees)), fps=10.0)
    slope.step(3)
    before = now(slope, "velocity")[0]
    slope.step(10)
    return float(now(slope, "velocity")[0] - before)


def creep(things: Words, degrees: float, friction: float, seconds: int = 1) -> float:
    """Way down the slope [m]."""
    slope = world({**things, "collider": [floor(friction)]}, angle=float(np.radians(degrees)), fps=10.0)
    slope.step(10 * seconds)
    return float(now(slope, "position")[0])


def angle_of_friction(things: Words, friction: float) -> float:
    """The angle [°] from which on it slides by more than 2 mm in a second, to 0.03°."""
    low, high = 15.0, 45.0
    for _ in range(10):
        middle = (low + high) / 2
        low, high = (low, middle) if creep(things, middle, friction) > 2e-3 else (middle, high)
    return (low + high) / 2


def block(friction: float = MU) -> Result:
    """A block that slides, or stays. The figures are those of MU, whatever friction it has."""
    figures = []
    curves: dict[str, Curve] = {}
    limit = float(np.degrees(np.arctan(MU)))
    steep = sliding(np.radians(45.0), MU)
    for kind in KINDS:
        things = _block(kind, friction)
        curves[kind] = [(a, acceleration(things, a, friction)) for a in ANGLES]
        name = "block" if kind == BODY else "grain that does not roll"
        figures += [
            near(f"{name}: acceleration at 45°", dict(curves[kind])[45.0], steep, 5e-3, "m/s²"),
            near(f"{name}: angle of friction", angle_of_friction(things, friction), limit, 5e-3, "°"),
        ]
    held = creep(_block(BODY, friction), 25.0, friction, 5)
    figures.append(small("block: creep at 25° in 5 s", 1e3 * held, 0.01, "mm"))
    text = (
        f"<p>A block of 40 × 40 × 20 cm with μ = {MU} on slopes. It stays where tan a ≤ μ, and slides with "
        "g (sin a − μ cos a) where it is steeper. Of grains there are balls alone: one whose rolling friction is larger "
        "than μ does not roll, and slides as a block does.</p>"
    )
    return Result(text, figures, partial(_accelerations, curves=curves, law=partial(sliding, friction=MU), limit=limit))


def rolling(friction: float = MU_BALL) -> Result:
    """A ball that rolls down a slope, or slips."""
    figures = []
    curves: dict[str, Curve] = {}
    for kind in KINDS:
        things = ball(kind, RADIUS[kind], friction=friction)
        curves[kind] = [(a, acceleration(things, a, friction)) for a in ANGLES]
        for a, how in ((25.0, "rolls"), (60.0, "slips")):
            exact = rolling_down(np.radians(a), MU_BALL)
            figures.append(near(f"{kind} {how}: acceleration at {a:.0f}°", dict(curves[kind])[a], exact, 5e-3, "m/s²"))
    text = (
        f"<p>A ball with μ = {MU_BALL} on slopes. It rolls with 5/7 g sin a where tan a ≤ 7/2 μ, and slips with "
        "g (sin a − μ cos a) where it is steeper.</p>"
    )
    limit = float(np.degrees(np.arctan(3.5 * MU_BALL)))
    law = partial(rolling_down, friction=MU_BALL)
    return Result(text, figures, partial(_accelerations, curves=curves, law=law, limit=limit))


def thrown(kind: str, friction: float) -> Floats:
    """Times [s], speeds [m/s] and speeds of the surface by its turn [m/s] of a ball that starts without one."""
    radius = RADIUS[kind]
    level = world(
        {**ball(kind, radius, friction=friction, velocity=[[SPEED, 0.0, 0.0]]), "collider": [floor(friction)]},
        fps=500.0,
    )
    rows = [(0.0, SPEED, 0.0)]
    for _ in range(175):
        level.step()
        rows.append((level.time, now(level, "velocity")[0], radius * now(level, "angular_velocity")[1]))
    return np.array(rows).T


def slipping(friction: float = MU_BALL) -> Result:
    """A ball that is thrown along the floor without a turn."""
    exact = 2 * SPEED / (7 * MU_BALL * GRAVITY)
    figures = []
    curves = {kind: thrown(kind, friction) for kind in KINDS}
    for kind, (t, v, turn) in curves.items():
        slip = v - turn
        # Where it falls in proportion to time: the line through it, to where there is none.
        falls = (slip > 0.1 * SPEED) & (slip < 0.8 * SPEED)
        slope, start = np.polyfit(t[falls], slip[falls], 1)
        figures += [
            near(f"{kind}: speed when it rolls", float(v[-1]), 5.0 / 7.0 * SPEED, 5e-3, "m/s"),
            near(f"{kind}: time until it rolls", float(-start / slope), exact, 1e-2, "s"),
        ]
    text = (
        f"<p>A ball starts with {SPEED:g} m/s and without a turn on a level floor, μ = {MU_BALL}. It slips for "
        "2v/(7μg), and then rolls with 5/7 of its speed. The time is where a line through its slip, between 80 % and 10 % "
        "of the speed at the start, comes to zero.</p>"
    )
    return Result(text, figures, partial(_thrown, curves=curves, exact=exact))


def _accelerations(figure: FigureBase, curves: dict[str, Curve], law: partial[float], limit: float) -> None:
    axes, beside = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.5, 1]})
    fine = np.linspace(0.0, 65.0, 400)
    axes.plot(fine, [law(float(np.radians(a))) for a in fine], color=INK, lw=1.2, label="exact")
    axes.axvline(limit, color=FAINT, lw=0.8, ls=":")
    axes.text(limit, 0.98, f" {limit:.1f}°", color=FAINT, fontsize=8, transform=axes.get_xaxis_transform(), va="top")
    for kind, curve in curves.items():
        marker, ink, size = STYLES[kind]
        angles, found = np.array(curve).T
        axes.plot(angles, found, marker, color=ink, ms=size, label=kind)
        exact = np.array([law(float(np.radians(a))) for a in angles])
        moves = exact > 0
        beside.plot(angles[moves], 100 * (found[moves] / exact[moves] - 1), marker, color=ink, ms=size, label=kind)
    axes.set_title("Acceleration down the slope")
    axes.set_ylabel("acceleration [m/s²]")
    axes.legend(loc="upper left")
    beside.axhspan(-0.5, 0.5, color=FAINT, alpha=0.15, lw=0, label="bound")
    beside.set_title("Deviation of what moves")
    beside.set_ylabel("deviation [%]")
    beside.set_xlim(axes.get_xlim())
    beside.legend(loc="lower left")
    for each in (axes, beside):
        each.set_xlabel("angle of the slope [°]")


def _thrown(figure: FigureBase, curves: dict[str, Floats], exact: float) -> None:
    panels = figure.subplots(1, 2, sharey=True)
    panels[0].set_ylabel("speed [m/s]")
    for axes, (kind, (t, v, turn)) in zip(panels, curves.items(), strict=True):
        end = float(t[-1])
        axes.plot([0, exact, end], [SPEED, *[5 / 7 * SPEED] * 2], color=INK, lw=3.0, alpha=0.25, label="exact")
        axes.plot([0, exact], [0, 5 / 7 * SPEED], color=INK, lw=3.0, alpha=0.25)
        axes.plot(t, v, color=PALETTE[0], lw=1.4, label="speed of the centre")
        axes.plot(t, turn, color=PALETTE[1], lw=1.4, label="radius times angular velocity")
        axes.axvline(exact, color=FAINT, lw=0.8, ls=":")
        axes.set_title(f"{kind[0].upper()}{kind[1:]}")
        axes.set_xlabel("time [s]")
        axes.legend(loc="lower right")
