"""A body that turns without a torque: Dzhanibekov's wing nut, against Jacobi's elliptic functions."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import FigureBase

from tumble.lab.contact.figure import Result, near, small
from tumble.lab.contact.worlds import world
from tumble.lab.exact import Floats
from tumble.style import FAINT, INK, PALETTE

INERTIA = (1.0, 2.0, 3.0)
"""About the body's own axes [kg m²]."""
START = (0.01, 1.0, 0.0)
"""Angular velocity in its own axes [rad/s]."""
ZERO, PERIOD = 10.3773049, 41.5092195
"""First zero of the angular velocity about the middle axis, and the period [s]."""
FPS = 25
FRAMES = 1080


def quarter(m: float) -> float:
    """The complete elliptic integral K of the parameter m = k², by the arithmetic-geometric mean."""
    a, b = 1.0, float(np.sqrt(1.0 - m))
    while abs(a - b) > 1e-15 * a:
        a, b = (a + b) / 2, float(np.sqrt(a * b))
    return float(np.pi / (2 * a))


def jacobi(u: Floats, m: float) -> tuple[Floats, Floats, Floats]:
    """sn, cn and dn of the parameter m = k², by descending Landen transformations."""
    a, b, c = [1.0], float(np.sqrt(1.0 - m)), [float(np.sqrt(m))]
    while c[-1] > 1e-16 and len(a) < 40:
        c.append((a[-1] - b) / 2)
        a, b = [*a, (a[-1] + b) / 2], float(np.sqrt(a[-1] * b))
    phi = 2.0 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        phi = (phi + np.arcsin(np.clip(c[n] / a[n] * np.sin(phi), -1.0, 1.0))) / 2
    sn, cn = np.sin(phi), np.cos(phi)
    return sn, cn, np.sqrt(1.0 - m * sn * sn)


def exact(times: Floats) -> Floats:
    """Angular velocity in the body's own axes [rad/s], a row for each time.

    Where L² < 2 E I2, Euler's equations are solved by w1 = a dn, w2 = b sn, w3 = c cn of the argument p t + u; the start, with
    w3 = 0, is at u = K. a, b and c follow from the energy E and the angular momentum L, which do not change.
    """
    one, two, three = INERTIA
    energy = one * START[0] ** 2 + two * START[1] ** 2
    spin_sq = (one * START[0]) ** 2 + (two * START[1]) ** 2
    assert spin_sq < energy * two and START[2] == 0.0
    w1 = np.sqrt((energy * three - spin_sq) / (one * (three - one)))
    w2 = np.sqrt((spin_sq - energy * one) / (two * (two - one)))
    w3 = np.sqrt((spin_sq - energy * one) / (three * (three - one)))
    rate = np.sqrt((two - one) * (energy * three - spin_sq) / (one * two * three))
    m = (three - two) * (spin_sq - energy * one) / ((two - one) * (energy * three - spin_sq))
    sn, cn, dn = jacobi(rate * times + quarter(m), m)
    return np.column_stack([w1 * dn, w2 * sn, w3 * cn])


def tumble(start: Sequence[float] = START) -> tuple[Floats, Floats, Floats]:
    """Times [s], angular velocities in the body's own axes [rad/s], and kinetic energies [J] of the simulated body."""
    nut = {
        "name": "nut", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "inertia": list(INERTIA),
        "angular_velocity": [list(start)],
    }  # fmt: skip
    void = world({"body": [nut]}, gravity=0.0, fps=FPS, substeps=4)
    spins, energies = [np.array(start)], [float(void.ledger["kinetic"])]
    for _ in range(FRAMES):
        void.step()
        columns = void.columns("turn", "angular_velocity")["nut"]
        q, w = columns["turn"][0], columns["angular_velocity"][0]
        # Back from the axes of the world to its own: by the conjugate of q.
        spins.append(w + 2.0 * np.cross(-q[:3], np.cross(-q[:3], w) + q[3] * w))
        energies.append(float(void.ledger["kinetic"]))
    return np.arange(FRAMES + 1) / FPS, np.array(spins), np.array(energies)


def zeros(times: Floats, values: Floats) -> Floats:
    """Where values change sign, by the cubic through the four around each."""
    found = []
    for i in np.flatnonzero(values[:-1] * values[1:] < 0):
        near = slice(max(0, i - 1), i + 3)
        roots = np.roots(np.polyfit(times[near] - times[i], values[near], 3))
        real = roots[np.abs(roots.imag) < 1e-9].real
        found.append(float(times[i] + min(real, key=lambda t: abs(t - 0.5 / FPS))))
    return np.array(found)


def wing_nut(start: Sequence[float] = START) -> Result:
    """A body that is started about its middle axis turns over, and back. The figures are those of START."""
    times, spins, energies = tumble(start)
    at = [*zeros(times, spins[:, 1]), *[float("nan")] * 2]
    whole = exact(times)
    figures = [
        near("first zero of ω₂", at[0], ZERO, 1e-3, "s"),
        # It turns over twice in a period, and half a period lies between both.
        near("period", 2.0 * (at[1] - at[0]), PERIOD, 1e-3, "s"),
        small("largest deviation of ω in a period", float(np.abs(spins - whole).max()), 1e-3, "rad/s"),
        small("largest change of the energy, relative", float(np.abs(energies / energies[0] - 1.0).max()), 1e-5),
    ]
    text = (
        "<p>Dzhanibekov's wing nut: a body with the moments of inertia 1, 2 and 3 kg m² turns without a torque, at the "
        "start with (0.01, 1, 0) rad/s about its own axes, which is close to the middle axis. It turns over and back. Exact: "
        "Jacobi's functions, evaluated by the arithmetic-geometric mean. Sub-steps of 1/100 s.</p>"
    )
    return Result(text, figures, partial(_components, times=times, spins=spins, whole=whole))


def _components(figure: FigureBase, times: Floats, spins: Floats, whole: Floats) -> None:
    axes, beside = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.7, 1]})
    for k, name in enumerate(("ω₁, least moment", "ω₂, middle", "ω₃, greatest")):
        axes.plot(times, whole[:, k], color=INK, lw=4.0, alpha=0.2, label="exact" if k == 0 else None)
        axes.plot(times, spins[:, k], color=PALETTE[k], lw=1.4, label=name)
        beside.plot(times, 1e3 * (spins - whole)[:, k], color=PALETTE[k], lw=1.2, label=name)
    axes.axvline(ZERO, color=FAINT, lw=0.8, ls=":")
    axes.set_title("Angular velocity in its own axes")
    axes.set_ylabel("angular velocity [rad/s]")
    axes.set_ylim(-1.2, 1.7)
    axes.legend(loc="upper right", ncols=4, fontsize=8)
    beside.set_title("Simulated less exact")
    beside.set_ylabel("deviation [mrad/s]")
    beside.legend(loc="lower left", fontsize=8)
    for each in (axes, beside):
        each.set_xlabel("time [s]")
