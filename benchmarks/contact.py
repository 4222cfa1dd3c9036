"""Cost of cloth besides its projections: memory per particle, self-contact, the dress on its dancer.

There is no peer in it. Shown are the bytes that a sheet of 512² holds, by the allocator's own count, and those that stay
resident, with what the allocator keeps of the memory in which it was made; the time that self-contact adds to six layers
that lie on each other, in three sizes; that of a free sheet by its thickness and its speed; and frames of the shipped dress
in three sizes.

python contact.py [threads [part ...]], with the parts memory, layers, free, dress"""

import ctypes
import sys
import tomllib
from math import log
from pathlib import Path

from common import THREADS, median, show

FPS = 60
SUBSTEPS = 10
LAYERS = 6
SIZES = (24, 48, 96)
# A free sheet: points at a side, and its edges [m].
SIDE, EDGE = 64, 0.022
# Edges of the dress's triangles [m]; the last makes 20,000 of them.
EDGES = (0.03, 0.02, 0.0141)


class Mallinfo2(ctypes.Structure):
    """Of malloc.h."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in [
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keepcost",
        ]
    ]


def taken():
    """Bytes of this process that are allocated, and those in memory once the allocator has given back what it can."""
    libc = ctypes.CDLL("libc.so.6")
    libc.malloc_trim(0)
    libc.mallinfo2.restype = Mallinfo2
    info = libc.mallinfo2()
    return info.uordblks + info.hblkhd, int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def sheet(n, bending):
    links = {"structural": 1e4, "shear": 2e3}
    words = {"links": links | {"bend": 200.0}} if bending == "links" else {"links": links, "isometric": 1e-5}
    held = {"name": "sheet", "size": [1.0, 1.0], "resolution": [n, n], "pin": ["corner 0 0", "corner 1 0"]}
    return {
        "version": 1,
        "time": {"fps": FPS},
        "system": [{"method": "position_based", "substeps": SUBSTEPS}],
        "sheet": [held | words],
    }


def memory(bending, n=512):
    """Memory of a world with a sheet beyond another one, per particle: allocated and resident [bytes]."""
    import tumble

    other = tumble.World(sheet(n, bending), threads=THREADS)
    other.step(2)
    before = taken()
    world = tumble.World(sheet(n, bending), threads=THREADS)
    world.step(2)
    return [(b - a) / n**2 for a, b in zip(before, taken(), strict=True)]


def layers(n, touching):
    """Sheets that fall on each other and a floor, all lengths in proportion to the distance of particles."""
    dx = 1.0 / (n - 1)
    sheets = [
        {
            "name": f"s{k}",
            "size": [1.0, 1.0],
            "resolution": [n, n],
            "center": [0.0, 0.0, (1.0 + 0.6 * k) * dx],
            "rotate": [0.0, 0.0, 7.0 * k],
            "links": {"structural": 1e3, "shear": 200.0},
        }
        for k in range(LAYERS)
    ]
    contact = {"self_contact": {"thickness": 0.5 * dx, "friction": 0.3}} if touching else {}
    return {
        "version": 1,
        "time": {"fps": FPS},
        "system": [{"method": "position_based", "substeps": SUBSTEPS} | contact],
        "sheet": sheets,
        "collider": [{"name": "floor", "shape": {"floor": {"height": 0.0}}, "thickness": 0.5 * dx, "friction": 0.5}],
    }


def free(thickness, speed):
    """A sheet that nothing touches but itself, of a thickness in edges; its speed [m/s] is along its plane."""
    length = (SIDE - 1) * EDGE
    held = {
        "name": "sheet",
        "size": [length, length],
        "resolution": [SIDE, SIDE],
        "rotate": [0.0, 0.0, 30.0],
        "velocity": [speed, 0.0, 0.0],
        "links": {"structural": 1e3, "shear": 200.0},
    }
    contact = {"self_contact": {"thickness": thickness * EDGE}}
    return {
        "version": 1,
        "time": {"fps": FPS},
        "world": {"gravity": [0.0, 0.0, 0.0]},
        "system": [{"method": "position_based", "substeps": SUBSTEPS} | contact],
        "sheet": [held],
    }


def frame(scene, warm):
    """Seconds of a frame, after some, and the books."""
    import tumble

    world = tumble.World(scene, threads=THREADS)
    world.step(warm)
    return median(world.step), world


def growth(sizes, seconds):
    """Exponent with which time grows with the count, from the first to the last."""
    return log(seconds[-1] / seconds[0]) / log(sizes[-1] / sizes[0])


def show_memory():
    for bending in ("links", "isometric"):
        held, kept = memory(bending)
        case = f"cloth, memory, {bending}"
        check = f"held by a particle of a sheet of 512² with stretching, shear and bending; {kept:.1f} stay resident"
        show(case, "tumble", held, "B", check)
        show(case, "300 bytes", 300.0, "B", "what it may be")


def show_layers():
    counts, costs = [], []
    for n in SIZES:
        together, world = frame(layers(n, True), 8)
        apart, _ = frame(layers(n, False), 8)
        counts.append(LAYERS * n * n)
        costs.append(together - apart)
        check = (
            f"self-contact alone; {1e3 * together:.1f} ms a frame in all, {world.ledger['intersections']} intersections"
        )
        show(f"layers {LAYERS} x {n}²", "tumble", costs[-1], "s", check)
    check = f"and sub-step; grows with the count to the power of {growth(counts, costs):.2f}"
    show("self-contact, a particle", "tumble", costs[-1] / counts[-1] / SUBSTEPS, "s", check)
    show("self-contact, a particle", f"{LAYERS} x {SIZES[0]}²", costs[0] / counts[0] / SUBSTEPS, "s", "the smallest")


def show_free():
    def one(case, who, thickness, speed):
        seconds, world = frame(free(thickness, speed), 2)
        books = world.ledger
        check = f"a frame; {thickness} edges thick, {books['speed']:.3f} m/s, {books['intersections']} intersections"
        show(case, who, seconds, "s", check)

    for case, thickness in [("sheet, near a diagonal", 0.73), ("sheet, 1.5 edges thick", 1.5)]:
        one(case, "tumble", thickness, 0.0)
        one(case, "0.65 edges", 0.65, 0.0)
    one("sheet at 16 m/s", "tumble", 0.5, 16.0)
    one("sheet at 16 m/s", "at rest", 0.5, 0.0)


def show_dress():
    dress = tomllib.loads((Path(__file__).parent.parent / "python/tumble/scenes/cloth/dress.toml").read_text())
    dress["system"][0].update(substeps=20, position_based={"iterations": 4, "tethers": 1.05})
    counts, costs = [], []
    for edge in EDGES:
        dress["cloth"][0]["resolution"] = edge
        seconds, world = frame(dress, 12)
        counts.append(len(world.topology["dress"]["triangles"]))
        costs.append(seconds)
        books = world.ledger
        check = (
            f"a frame of 1/24 s, 20 sub-steps; stretch {books['stretch']:.3f}, {books['intersections']} intersections"
        )
        show(f"dress, {counts[-1]} triangles", "tumble", seconds, "s", check)
    check = f"a frame; grows with the count to the power of {growth(counts, costs):.2f}"
    show("dress, a triangle", "tumble", costs[-1] / counts[-1], "s", check)
    show("dress, a triangle", "the coarsest", costs[0] / counts[0], "s", f"{counts[0]} triangles")


for part, run in {"memory": show_memory, "layers": show_layers, "free": show_free, "dress": show_dress}.items():
    if part in (sys.argv[2:] or [part]):
        run()
