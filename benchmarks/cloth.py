"""Position-based cloth: constraints projected a second, on sheets hung by two corners, 10 sub-steps of a sweep in 1/60 s.

taichi runs the same constraints by the same algorithm, coloured by hand, and newton by its XPBD solver, which sums
corrections and uses one thread; tumble has tethers beside, whose time is in its figure. pyPBD has its own mesh
(distances along edges, isometric bending) and 10 iterations of a step of 1/60 s. Shown beside is how far each is
stretched at the same late frame: the largest edge over its rest length, and the 99.9 % quantile."""

import numpy as np
from common import THREADS, median, show

FPS = 60
SUBSTEPS = 10
LATE = 60  # frame at which stretch is compared
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
    """Largest and 99.9 % quantile of length over rest length of the edges of the lattice."""
    ratio = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1) / rest
    return ratio.max(), np.quantile(ratio, 0.999)


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
    structural = 2 * n * (n - 1)
    return x, inverse, ends, 1.0 / np.concatenate(k), rest, structural


def bench_tumble(n, edges, rest):
    import tumble

    world = tumble.World(scene(n), threads=THREADS)
    count = len(world.topology["cloth"]["links"])
    world.step(LATE)
    x = world.frame["cloth"]["position"]
    seconds = median(lambda: world.step(10)) / 10
    return count, seconds, stretch(x, edges, rest)


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
    end = x.to_numpy()
    return median(lambda: [frame() for _ in range(10)], repeats=3) / 10, end


def bench_pypbd(n):
    import pypbd as pbd

    simulation = pbd.Simulation.getCurrent()
    simulation.initDefault()
    model = simulation.getModel()
    model.addRegularTriangleModel(n, n, [0, 0, 0], np.identity(3), [1.0, 1.0])
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
    step.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, 1)
    step.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, SUBSTEPS)
    count = len(model.getConstraints())
    place = lambda: np.array(particles.getVertices()).reshape(-1, 3)[: n * n]  # noqa: E731
    start = place().copy()
    for _ in range(LATE):
        step.step(model)
    end = place().copy()
    seconds = median(lambda: [step.step(model) for _ in range(5)], repeats=3) / 5
    index = np.arange(n * n).reshape(n, n)
    edges = np.concatenate(
        [
            np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()], 1),
            np.stack([index[:-1].ravel(), index[1:].ravel()], 1),
        ]
    )
    return count, seconds, stretch(end, edges, np.linalg.norm(start[edges[:, 1]] - start[edges[:, 0]], axis=1))


def bench_newton(x0, inverse, ends, soft, rest):
    import newton
    import warp as wp

    wp.config.quiet = True
    builder = newton.ModelBuilder(up_axis="Z", gravity=(0.0, 0.0, -9.8))
    for place, w in zip(x0.tolist(), inverse.tolist(), strict=True):
        builder.add_particle(place, (0.0, 0.0, 0.0), 1.0 / w if w else 0.0, radius=1e-4)
    for (i, j), alpha in zip(ends.tolist(), soft.tolist(), strict=True):
        builder.add_spring(i, j, 1.0 / alpha, 0.0, 0)
    model = builder.finalize(device="cpu")
    model.spring_rest_length.assign(rest.astype(np.float32))
    # The solver multiplies corrections by this; 1 is the method as it is written.
    solver = newton.solvers.SolverXPBD(model, iterations=1, soft_body_relaxation=1.0)
    states, control = [model.state(), model.state()], model.control()

    def frame():
        for _ in range(SUBSTEPS):
            states[0].clear_forces()
            solver.step(states[0], states[1], control, None, 1.0 / (FPS * SUBSTEPS))
            states.reverse()

    for _ in range(LATE):
        frame()
    end = states[0].particle_q.numpy()
    return median(lambda: [frame() for _ in range(3)], repeats=3) / 3, end


def main():
    for n in (128, 256):
        x0, inverse, ends, soft, rest, structural = lattice(n)
        edges, lengths = ends[:structural], rest[:structural]

        def told(seconds, count, found):
            most, usual = found
            return f"{1e3 * seconds:.1f} ms a frame, {count} constraints, stretch {most:.3f} ({usual:.3f})"

        count, seconds, found = bench_tumble(n, edges, lengths)
        assert count == len(ends), (count, len(ends))
        show(f"cloth {n}", "tumble", SUBSTEPS * count / seconds, "solves/s", told(seconds, count, found))
        seconds, end = bench_taichi(x0, inverse, ends, soft, rest)
        show(
            f"cloth {n}",
            "taichi",
            SUBSTEPS * count / seconds,
            "solves/s",
            told(seconds, count, stretch(end, edges, lengths)),
        )
        seconds, end = bench_newton(x0, inverse, ends, soft, rest)
        found = stretch(end, edges, lengths)
        show(f"cloth {n}", "newton", SUBSTEPS * count / seconds, "solves/s", told(seconds, count, found))
        count, seconds, found = bench_pypbd(n)
        show(f"cloth {n}", "pypbd", SUBSTEPS * count / seconds, "solves/s", told(seconds, count, found))


main()
