"""`tumble lab fabric`: measured fabrics pulled, hung over an edge and draped over a disk, beside what their records say."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import FigureBase

from tumble._engine import World, load_fabric
from tumble.lab.exact import Floats
from tumble.lab.findings import off
from tumble.lab.page import Section, table, write
from tumble.style import FAINT, INK, PALETTE

SHIPPED = ("denim", "interlock", "tablecloth")
ANGLES = (0, 45, 90)
"""Of the strips, to the warp [degrees]."""
GRAVITY = 9.8
CHORD = np.tan(np.radians(41.5))
"""Height over width of a strip that hangs as the cantilever test wants it."""
STRETCHES = (1.0, 1.005, 1.01, 1.02, 1.04, 1.06, 1.08, 1.1)
SEGMENTS = 24
"""Of a strip that hangs."""
WIDTH = 0.025
"""Of it [m]."""
DISK, SUPPORT = 0.15, 0.09
"""Radii of Cusick's specimen and of the disk under it [m]."""
EDGE = 0.0075
"""Of the triangles of a specimen [m]."""

Words = dict[str, Any]
LOOSE: Words = {"solver": {"newton_tolerance": 1e-3, "linear_tolerance": 0.1}}
"""Enough where only the rest at the end counts."""
Record = dict[str, Any]
Tick = Callable[[], None]


@dataclass
class Measured:
    """Results of the three tests of a fabric."""

    name: str
    record: Record
    pulled: dict[int, Floats] = field(default_factory=dict)
    """For each angle: stretches, forces per width [N/m], and those of the record."""
    hung: dict[int, tuple[float, float, float, float]] = field(default_factory=dict)
    """For each angle: twice the bending length of B(0), overhang at 41.5 degrees of the elastica and of the simulation [m];
    B(0) [N m]."""
    coefficient: float = 0.0
    """Of the drape."""
    drape: tuple[Floats, Any] = (np.zeros((0, 3)), np.zeros((0, 3), int))


def words(fabric: str, **more: Any) -> Words:
    """How a scene says it."""
    is_file = fabric.endswith((".toml", ".json"))
    return {"path" if is_file else "name": str(Path(fabric).resolve()) if is_file else fabric, **more}


def moment(samples: Floats, kappa: Floats) -> Floats:
    """Moment per width [N] at curvatures [1/m]: (fabrics.9) with (fabrics.10), written anew."""
    b = np.maximum(samples, 0.0)
    for i in range(3):
        b[i + 1] = max(b[i + 1], b[i] * (i + 1) / (i + 2))
    falls = b[4] < 0.8 * b[3]
    bending = np.interp(kappa, [0, 10, 20, 30, 40], [*b[:4], b[3] * 0.75 if falls else b[4]])
    found = bending * kappa
    return np.asarray(np.where(kappa > 30, np.maximum(30 * b[3], b[4] * kappa), found)) if falls else found


def overhang(samples: Floats, density: float, chord: float = float(CHORD)) -> float:
    """Length [m] at which the elastica with these moments hangs with this height over width: integrated from its tip for many
    angles there."""
    kappa = np.linspace(0.0, 3000.0, 60_001)
    moments = moment(np.array(samples), kappa)
    # For a constant moment any curvature will do: the least.
    moments = np.maximum.accumulate(moments) + 1e-12 * kappa
    scale = float((samples[0] / (density * GRAVITY)) ** (1 / 3))
    step = scale / 800
    angle = np.linspace(0.3, 1.45, 300)
    length, x, z, m = (np.zeros_like(angle) for _ in range(4))
    for _ in range(4000):
        on = angle > 0
        if not on.any():
            break
        m += on * density * GRAVITY * (length + step / 2) * np.cos(angle) * step
        x += on * np.cos(angle) * step
        z += on * np.sin(angle) * step
        length += on * step
        angle = np.where(on, angle - step * np.interp(m, moments, kappa), angle)
    chords = z / x
    order = np.argsort(chords)
    return float(np.interp(chord, chords[order], length[order]))


def stress(record: Record, e: Floats) -> Floats:
    """Stress [N/m] of the record itself for a Green strain e11, e22, 2 e12 in its axes, as [narain2012] reads it: linear in
    angle and stretch."""
    e11, e22, shear = e
    values, vectors = np.linalg.eigh(np.array([[e11, shear / 2], [shear / 2, e22]]))
    stretch = np.sqrt(max(1 + 2 * values[1], 0.0))
    v = np.clip(6 * (stretch - 1), 0, 1)
    at = np.clip(np.degrees(np.arctan2(abs(vectors[1, 1]), abs(vectors[0, 1]))) / 22.5, 0, 4)
    rows = np.array(record["stretching"])
    own = np.array([np.interp(at, range(5), rows[1:, i]) for i in range(4)])
    c = 2 * np.maximum(rows[0] + v * (own - rows[0]), 0.0)
    return np.array([c[0] * e11 + c[1] * e22, c[2] * e22 + c[1] * e11, c[3] * shear / 4])


def pull_of_record(record: Record, stretch: float, angle: float) -> float:
    """Force per width [N/m] at a stretch of a strip, whose sides are free, by the stress of the record."""
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    along = (stretch * stretch - 1) / 2
    turn = np.array([[cos, -sin], [sin, cos]])

    def in_strip(free: Floats) -> Floats:
        own = turn.T @ np.array([[along, free[1]], [free[1], free[0]]]) @ turn
        s = stress(record, np.array([own[0, 0], own[1, 1], 2 * own[0, 1]]))
        return np.asarray(turn @ np.array([[s[0], s[2]], [s[2], s[1]]]) @ turn.T)

    free = np.zeros(2)
    for _ in range(60):
        s = in_strip(free)
        residual = np.array([s[1, 1], s[0, 1]])
        h = 1e-7
        slopes = np.array([in_strip(free + h * unit)[[1, 0], [1, 1]] - residual for unit in np.eye(2)]).T / h
        free = free - 0.7 * np.linalg.lstsq(slopes, residual, rcond=None)[0]
    return float(stretch * in_strip(free)[0, 0])


def _scene(system: Words, drag: float, gravity: float = GRAVITY, **things: Any) -> Words:
    return {
        "version": 1,
        "precision": "double",
        "time": {"fps": 25},
        "world": {"gravity": [0, 0, -gravity]},
        "system": [{"integrator": "implicit_euler", **system}],
        "force": [{"kind": "drag", "rate": drag}],
        **things,
    }


def pull(fabric: str, record: Record, angle: int) -> Floats:
    """Pulls a strip of 20 x 5 cm by its ends: from the energy at rest at each stretch, the force between two of them."""
    size, count = (0.2, 0.05), (33, 9)
    energies = []
    for stretch in STRETCHES:
        sheet = {
            "name": "strip", "size": size, "resolution": count, "pin": ["edge x-", "edge x+"],
            "fabric": words(fabric, angle=angle),
        }  # fmt: skip
        world = World(_scene(LOOSE, 30.0, 0.0, sheet=[sheet]), threads=1)
        x = world.frame["strip"]["position"].copy()
        x[:, 0] *= stretch
        world.write("strip", "position", x)
        world.step(40)
        energies.append(world.ledger["elastic"])
    stretches = np.array(STRETCHES)
    middle = (stretches[1:] + stretches[:-1]) / 2
    forces = np.diff(energies) / (np.diff(stretches) * size[0]) / size[1]
    return np.array([middle, forces, [pull_of_record(record, w, angle) for w in middle]])


def hang(fabric: str, length: float, angle: int) -> float:
    """Height over width of the chord of a strip that hangs over an edge."""
    # A fold stands for half a segment to either side: the clamp is half a segment before the last held masses.
    d = length / (SEGMENTS + 0.5)
    rows = 2 * round(WIDTH / d / 2) + 1
    pins = [f"vertex {i} {j}" for i in range(2) for j in range(rows)]
    sheet = {
        "name": "strip", "size": [d * (SEGMENTS + 1), d * (rows - 1)], "resolution": [SEGMENTS + 2, rows], "pin": pins,
        "fabric": words(fabric, angle=angle),
    }  # fmt: skip
    world = World(_scene({"substeps": 2, **LOOSE}, 12.0, sheet=[sheet]), threads=1)
    world.step(75)
    x = world.frame["strip"]["position"].reshape(rows, SEGMENTS + 2, 3)[rows // 2]
    return float((x[1, 2] - x[-1, 2]) / (x[-1, 0] - x[1, 0] + d / 2))


def cantilever(fabric: str, record: Record, angle: int) -> tuple[float, float, float, float]:
    """Peirce's test: overhangs of a strip whose tip is 41.5 degrees below the edge."""
    samples = np.array(record["bending"][2 - angle // 45])
    twice = 2 * float((samples[0] / (record["density"] * GRAVITY)) ** (1 / 3))
    exact = overhang(samples, record["density"])
    lengths = np.array([0.95, 1.05]) * exact
    chords = [hang(fabric, float(length), angle) for length in lengths]
    found = np.exp(np.interp(np.log(CHORD), np.log(chords), np.log(lengths)))
    if not chords[0] < CHORD < chords[1]:
        slope = np.diff(np.log(lengths))[0] / np.diff(np.log(chords))[0]
        found = lengths[0] * (CHORD / chords[0]) ** slope
    return twice, exact, float(found), float(samples[0])


def drape(fabric: Words, *, edge: float = EDGE, frames: int = 75) -> tuple[Floats, Any]:
    """Points and triangles of a disk of cloth on a smaller one (Cusick's test), which holds it."""
    turn = 2 * np.pi * np.arange(96) / 96
    outline = (DISK * np.stack([np.cos(turn), np.sin(turn)], axis=1)).tolist()
    cloth = {
        "name": "cloth", "panels": [{"name": "disk", "outline": outline, "up": [0, 1, 0]}], "resolution": edge,
        "fabric": fabric, "pin": [{"center": [0, 0, 0], "radius": SUPPORT}],
    }  # fmt: skip
    # A flat strip would stay flat: a breath from one side.
    breath = {"kind": "acceleration", "value": "[0, 0, 2*sin(40*x)*cos(34*y + 1)*(1 - smoothstep(0, 0.4, t))]"}
    # Looser, folds of soft cloth explode.
    scene = _scene({"substeps": 4, "solver": {"newton_tolerance": 1e-3, "linear_tolerance": 0.03}}, 3.0, cloth=[cloth])
    scene["force"].append(breath)
    world = World(scene)
    world.step(frames)
    return world.frame["cloth"]["position"], world.topology["cloth"]["triangles"]


def shadow(points: Floats, triangles: Any, cell: float = 0.0005) -> float:
    """Area of what triangles hide from above [m²], counted in cells."""
    n = int(np.ceil(2.2 * DISK / cell))
    hit = np.zeros((n, n), bool)
    flat = points[:, :2] / cell + n / 2
    for a, b, c in flat[triangles]:
        low = np.floor(np.minimum(np.minimum(a, b), c)).astype(int)
        high = np.ceil(np.maximum(np.maximum(a, b), c)).astype(int) + 1
        (i0, j0), (i1, j1) = np.maximum(low, 0), np.minimum(high, n)
        x, y = np.meshgrid(np.arange(i0, i1) + 0.5, np.arange(j0, j1) + 0.5, indexing="ij")

        def side(p: Floats, q: Floats, x: Floats = x, y: Floats = y) -> Floats:
            return np.asarray((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]))

        s = [side(a, b), side(b, c), side(c, a)]
        hit[i0:i1, j0:j1] |= np.minimum.reduce(s) >= 0
        hit[i0:i1, j0:j1] |= np.maximum.reduce(s) <= 0
    return float(hit.sum() * cell * cell)


def drape_coefficient(points: Floats, triangles: Any) -> float:
    """How much of the ring around the support the drape hides."""
    support, flat = np.pi * SUPPORT**2, np.pi * DISK**2
    return (shadow(points, triangles) - support) / (flat - support)


def measure(fabric: str, tick: Tick) -> Measured:
    """All tests of one fabric."""
    found = Measured(fabric, load_fabric(fabric))
    for angle in ANGLES:
        found.pulled[angle] = pull(fabric, found.record, angle)
        tick()
        found.hung[angle] = cantilever(fabric, found.record, angle)
        tick()
    found.drape = drape(words(fabric))
    found.coefficient = drape_coefficient(*found.drape)
    tick()
    return found


def page(folder: Path, fabrics: list[str], *, progress: Callable[[int, int], None] | None = None) -> tuple[Path, str]:
    """Writes fabric.html, .png and .csv; returns the first, and a table to print. Raises ExportError, SceneError."""
    done, total = 0, 7 * len(fabrics) + 1

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    found = [measure(fabric, tick) for fabric in fabrics]
    sections = [
        Section(
            "Pulled",
            "<p>Strips of 20 x 5 cm, cut at an angle to the warp and pulled by their clamped ends: force per width over "
            "strain. Dots: simulated. Lines: the stress of the record, its sides free (fabrics.2).</p>",
            partial(_pulled, found=found),
            3.6,
            "Force per width over strain",
        ),
        Section(
            "Hung over an edge",
            "<p>The cantilever test of Peirce and ASTM D1388: the overhang whose tip is 41.5 degrees below the edge. Twice the "
            "bending length c = (B/(ρg))<sup>1/3</sup> is what it would be with the stiffness at no curvature; the elastica "
            "takes the moments of the whole record.</p>",
            table=_hung(found),
        ),
        Section(
            "Draped",
            "<p>Cusick's test: a disk of 30 cm on one of 18 cm, from above. The drape coefficient is the part of the ring "
            "around the support that is in the shadow.</p>",
            partial(_drapes, found=found),
            13.0 / len(found) if len(found) > 1 else 6.0,
            "Drapes from above",
            raster=True,
        ),
    ]
    worst = max(abs(m.hung[a][2] / m.hung[a][1] - 1) for m in found for a in ANGLES)
    points = [
        f"Overhangs of simulated strips are off by {off(worst)} at most from those of the elastica with the moments "
        "of the record.",
        "Drape coefficients: " + ", ".join(f"{m.name} {100 * m.coefficient:.0f} %" for m in found) + ".",
    ]
    sources = dict.fromkeys(m.record["source"] for m in found if m.record["source"])
    written = write(
        folder,
        "fabric",
        "Measured fabrics",
        ", ".join(f"{m.name} ({m.record['composition'] or 'composition unknown'})" for m in found),
        points,
        sections,
        ["Equations: docs/theory/fabrics.md.", *sources],
        _rows(found),
    )
    tick()
    return written, text(found)


def text(found: list[Measured]) -> str:
    """The figures as lines for a console."""
    heads = [
        ("fabric", "cut", "B(0)", "2c", "elastica", "simulated", "pull at 5 %", "record", "drape"),
        ("", "°", "µN m", "cm", "cm", "cm", "N/m", "N/m", "%"),
    ]
    widths = (14, 4, 8, 7, 9, 10, 12, 8, 6)

    def line(cells: Sequence[str]) -> str:
        return " ".join(f"{c:>{w}}" if i else f"{c:<{w}}" for i, (c, w) in enumerate(zip(cells, widths, strict=True)))

    lines = [line(head) for head in heads]
    for m in found:
        for a in ANGLES:
            twice, exact, simulated, b = m.hung[a]
            w, force, record = m.pulled[a]
            at, of_record = np.interp(1.05, w, force), np.interp(1.05, w, record)
            numbers = (1e6 * b, 100 * twice, 100 * exact, 100 * simulated, at, of_record)
            name, last = (m.name, f"{100 * m.coefficient:.1f}") if a == 0 else ("", "")
            lines.append(line([name, str(a), *(f"{x:.2f}" for x in numbers), last]).rstrip())
    return "\n".join(lines)


def _hung(found: list[Measured]) -> str:
    head = ["Fabric", "cut at", "B(0) [µN m]", "2c [cm]", "elastica [cm]", "simulated [cm]", "off by"]
    rows = []
    for m in found:
        for a in ANGLES:
            twice, exact, simulated, b = m.hung[a]
            numbers = [f"{1e6 * b:.2f}", f"{100 * twice:.2f}", f"{100 * exact:.2f}", f"{100 * simulated:.2f}"]
            rows.append([m.name, f"{a}°", *numbers, off(simulated / exact - 1, signed=True)])
    return table(head, rows, [0], range(0, len(rows), len(ANGLES)))


def _rows(found: list[Measured]) -> Iterator[dict[str, Any]]:
    for m in found:
        for a in ANGLES:
            cut = {"fabric": m.name, "angle": a}
            for w, force, record in m.pulled[a].T:
                yield {**cut, "test": "pulled", "strain": w - 1, "force": force, "record": record}
            twice, exact, simulated, b = m.hung[a]
            yield {**cut, "test": "hung", "stiffness": b, "twice": twice, "elastica": exact, "overhang": simulated}
        yield {"fabric": m.name, "test": "draped", "coefficient": m.coefficient}


def _pulled(figure: FigureBase, found: list[Measured]) -> None:
    for k, m in enumerate(found):
        axes = figure.add_subplot(1, len(found), k + 1)
        for a, ink in zip(ANGLES, PALETTE, strict=False):
            w, force, record = m.pulled[a]
            axes.plot(100 * (w - 1), record, color=ink, lw=1.2)
            axes.plot(100 * (w - 1), force, "o", color=ink, ms=4, label=f"{a}°")
        axes.set_title(m.name)
        axes.set_xlabel("strain [%]")
        axes.set_ylim(bottom=0)
        if k == 0:
            axes.set_ylabel("force per width [N/m]")
            axes.legend()


def _drapes(figure: FigureBase, found: list[Measured]) -> None:
    for k, m in enumerate(found):
        axes = figure.add_subplot(1, len(found), k + 1)
        points, triangles = m.drape
        corners = points[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        normals *= np.sign(normals[:, 2:])
        light = np.clip(normals @ np.array([-0.45, 0.35, 0.82]), 0.0, 1.0)[:, None]
        ink = np.array([int(PALETTE[k % len(PALETTE)][i : i + 2], 16) / 255 for i in (1, 3, 5)])
        order = np.argsort(corners[:, :, 2].mean(axis=1))
        shade = 0.12 + 0.88 * light * ink + 0.1 * light**8
        axes.add_collection(
            PolyCollection(
                100 * corners[order][:, :, :2],
                facecolors=np.clip(shade[order], 0, 1),
                edgecolors="face",
                linewidths=0.3,
            )
        )
        turn = np.linspace(0, 2 * np.pi, 200)
        axes.plot(100 * DISK * np.cos(turn), 100 * DISK * np.sin(turn), color=FAINT, lw=0.8, ls=":")
        axes.plot(100 * SUPPORT * np.cos(turn), 100 * SUPPORT * np.sin(turn), color=INK, lw=0.8, ls="--")
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(f"{m.name}: {100 * m.coefficient:.0f} %")
