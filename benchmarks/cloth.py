"""Position-based cloth: constraints projected a second, on sheets hung by two corners from level, 10 sub-steps of one sweep
in 1/60 s.

taichi runs the same constraints by the same algorithm, coloured by hand. pyPBD has a mesh of its own (distances along edges,
isometric bending), about as many constraints. tumble has tethers beside, whose time is in its figure. newton is left out: its
solver sums the corrections of all constraints of a particle, and at 10 sweeps a frame the sheet of 128² is stretched 230 times
and more at any stiffness (1.8.0). All are timed in turn, so that a slow spell of the machine is theirs alike.
Beside it counts how far each is stretched at the same late frame: the largest edge over its rest length, shown with the 99.9 %
quantile and the mean. A peer that diverges is left out, with a line that says so.

python cloth.py [threads [size ...]]"""

import statistics
import sys
import time

import numpy as np
from common import THREADS, show

FPS = 60
SUBSTEPS = 10
LATE = 120  # frame at which stretch is compared
DIVERGED = 10.0  # a largest stretch that no sheet under its own weight has
ROUNDS = 7
SIZES = [int(n) for n in sys.argv[2:]] or [128, 256]
MODULUS = {"structural": 1e4, "shear": 2e3, "bend": 200.0}


def scene(n, name="cloth"):
    return {
        "version": 1,
        "time": {"fps": FPS},
        "system": [{"method": "position_based", "substeps": SUBSTEPS, "position_based": {"tethers": 1.01}}],
        "sheet": [
            {
                "name": name,
                "size": [1.0, 1.0],
                "resolution": [n, n],
                "pin": ["corner 0 0", "corner 1 0"],
                "links": {family: {"modulus": m} for family, m in MODULUS.items()},
            }
        ],
    }


def stretch(x, edges, rest):
    """Largest, 99.9 % quantile and mean of length over rest length of the edges of the lattice."""
    ratio = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1) / rest
    return ratio.max(), np.quantile(ratio, 0.999), ratio.mean()


def diverged(found):
    """Whether a stretch is that of a simulation that flew apart, or is no number."""
    return not found[0] < DIVERGED


def lattice(n):
    """Positions, inverse masses, ends, compliances and rest lengths, from the scene's own rule."""
    dx = 1.0 / (n - 1)
    i, j = np.meshgrid(np.arange(n), np.arange(n))
    x = np.stack([i.ravel() * dx - 0.5, j.ravel() * dx - 0.5, np.zeros(n * n)], 1)
    rim = lambda a: np.where((a == 0) | (a == n - 1), 0.5, 1.0)  # noqa: E731
    inverse = 1.0 / (0.2 * dx * dx * rim(i) * rim(j)).ravel()
    inverse[[0, n - 1]] = 0.0
    index = np.arange(n * n).reshape(n, n)
    ends, k = [], []
    for family, (a, c), part in [
        ("structural", (1, 0), 1.0), ("structural", (0, 1), 1.0), ("shear", (1, 1), 0.5), ("shear", (1, -1), 0.5),
        ("bend", (2, 0), 1.0), ("bend", (0, 2), 1.0),
    ]:  # fmt: skip
        rows = index[max(0, -c) : n - max(0, c), : n - a]
        other = index[max(0, -c) + c : n - max(0, c) + c, a:]
        share = np.full(rows.shape, part * dx * dx)
        if a == 0:
            share = share * rim(i)[rows // n, rows % n]
        if c == 0:
            share = share * rim(j)[rows // n, rows % n]
        ends.append(np.stack([rows.ravel(), other.ravel()], 1))
        k.append((MODULUS[family] * share / ((a * a + c * c) * dx * dx)).ravel())
    ends = np.concatenate(ends).astype(np.int32)
    rest = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    return x, inverse, ends, 1.0 / np.concatenate(k), rest, 2 * n * (n - 1)


def bench_tumble(n, edges, rest):
    import tumble

    world = tumble.World(scene(n), threads=THREADS)
    count = len(world.topology["cloth"]["links"])
    world.step(LATE)
    return count, world.step, stretch(world.frame["cloth"]["position"], edges, rest)


def colored(ends, n):
    """Ends sorted by colour, greedily, and the ranges of the colours."""
    used = np.zeros(n, np.uint64)
    color = np.zeros(len(ends), np.int64)
    for e, (a, b) in enumerate(ends.tolist()):
        taken = int(used[a] | used[b])
        free = ((~taken) & (taken + 1)).bit_length() - 1
        color[e] = free
        used[a] |= np.uint64(1 << free)
        used[b] |= np.uint64(1 << free)
    order = np.lexsort((ends[:, 0], color))
    return order, np.searchsorted(color[order], np.arange(color.max() + 2))


def bench_taichi(x0, inverse, ends, soft, rest):
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=THREADS, default_fp=ti.f32, offline_cache=False, log_level=ti.ERROR)
    n, m, h = len(x0), len(ends), 1.0 / (FPS * SUBSTEPS)
    order, ranges = colored(ends, n)
    x, old, v = (ti.Vector.field(3, ti.f32, n) for _ in range(3))
    w = ti.field(ti.f32, n)
    pair, alpha, length = ti.Vector.field(2, ti.i32, m), ti.field(ti.f32, m), ti.field(ti.f32, m)
    for field, array in [
        (x, x0), (w, inverse), (pair, ends[order]), (alpha, soft[order] / h**2), (length, rest[order]),
    ]:  # fmt: skip
        field.from_numpy(array.astype(np.int32 if field is pair else np.float32))

    @ti.kernel
    def predict():
        for p in x:
            if w[p] > 0:
                v[p] += h * ti.Vector([0.0, 0.0, -9.8])
            old[p] = x[p]
            x[p] += h * v[p]

    @ti.kernel
    def project(a: ti.i32, b: ti.i32):
        for e in range(a, b):
            i, j = pair[e][0], pair[e][1]
            d = x[j] - x[i]
            size = d.norm()
            move = -(size - length[e]) / (w[i] + w[j] + alpha[e]) * d / size
            x[i] -= w[i] * move
            x[j] += w[j] * move

    @ti.kernel
    def follow():
        for p in x:
            v[p] = (x[p] - old[p]) / h

    def frame():
        for _ in range(SUBSTEPS):
            predict()
            for a, b in zip(ranges[:-1].tolist(), ranges[1:].tolist(), strict=True):
                project(a, b)
            follow()
        ti.sync()

    for _ in range(LATE):
        frame()
    return frame, x.to_numpy()


def bench_pypbd(n):
    import pypbd as pbd

    simulation = pbd.Simulation.getCurrent()
    simulation.initDefault()
    model = simulation.getModel()
    # Its gravity is along -y, and its sheet in the plane of x and y: turned level.
    model.addRegularTriangleModel(n, n, [0, 0, 0], np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), [1.0, 1.0])
    cloth = model.getTriangleModels()[0]
    particles = model.getParticles()
    for i in range(particles.getNumberOfParticles()):
        particles.setMass(i, 0.2 / (n * n))
    particles.setMass(0, 0.0)
    particles.setMass(n - 1, 0.0)
    # Methods 4 and 3: XPBD distances, XPBD isometric bending.
    model.addClothConstraints(cloth, 4, 1e6, 1e6, 1e6, 1e6, 0.3, 0.3, False, False)
    model.addBendingConstraints(cloth, 3, 1e-3)
    pbd.TimeManager.getCurrent().setTimeStepSize(1.0 / FPS)
    step = simulation.getTimeStep()
    step.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, SUBSTEPS)
    step.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, 1)
    count = len(model.getConstraints())
    place = lambda: np.array(particles.getVertices()).reshape(-1, 3)[: n * n]  # noqa: E731
    start = place().copy()
    for _ in range(LATE):
        step.step(model)
    end = place().copy()
    index = np.arange(n * n).reshape(n, n)
    edges = np.concatenate(
        [
            np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()], 1),
            np.stack([index[:-1].ravel(), index[1:].ravel()], 1),
        ]
    )
    frame = lambda: step.step(model)  # noqa: E731
    return count, frame, stretch(end, edges, np.linalg.norm(start[edges[:, 1]] - start[edges[:, 0]], axis=1))


def seconds_a_frame(frames):
    """Median times of a frame, all measured in every round, each for a quarter of a second or for one frame."""
    times = {who: [] for who in frames}
    counts = {who: max(1, round(0.25 / once(frame, 1))) for who, frame in frames.items()}
    for _ in range(ROUNDS):
        for who, frame in frames.items():
            times[who].append(once(frame, counts[who]))
    return {who: statistics.median(found) for who, found in times.items()}


def once(frame, count):
    start = time.perf_counter()
    for _ in range(count):
        frame()
    return (time.perf_counter() - start) / count


def main():
    for n in SIZES:
        x0, inverse, ends, soft, rest, structural = lattice(n)
        edges, lengths = ends[:structural], rest[:structural]
        found = {"tumble": bench_tumble(n, edges, lengths)}
        assert found["tumble"][0] == len(ends), (found["tumble"][0], len(ends))
        frame, end = bench_taichi(x0, inverse, ends, soft, rest)
        found["taichi"] = len(ends), frame, stretch(end, edges, lengths)
        found["pypbd"] = bench_pypbd(n)
        for who in [who for who, (_, _, end) in found.items() if diverged(end)]:
            print(f"cloth {n}: {who} diverged to a stretch of {found.pop(who)[2][0]:.3g}, left out", file=sys.stderr)
        assert "tumble" in found, "tumble diverged"
        seconds = seconds_a_frame({who: frame for who, (_, frame, _) in found.items()})
        rates = {who: SUBSTEPS * count / seconds[who] for who, (count, _, _) in found.items()}
        for who, (count, _, _) in found.items():
            show(f"cloth {n}", who, rates[who], "solves/s", f"{1e3 * seconds[who]:.1f} ms a frame, {count} constraints")
        for who, (_, _, (most, many, mean)) in found.items():
            show(f"cloth {n}, stretch", who, float(most), "1", f"at frame {LATE}; 99.9 %: {many:.3f}, mean {mean:.4f}")
        fastest = max((who for who in found if who != "tumble"), key=lambda who: rates[who])
        show(f"cloth {n}, stretch", "the fastest peer", float(found[fastest][2][0]), "1", fastest)


main()
