"""Explicit springs on a 256 x 256 sheet with structural, shear and bend links: springs evaluated a second, each counted once.

All three step the same springs with symplectic Euler, in single precision, and must end in the same place."""

import numpy as np
from common import THREADS, median, show

N = 256
STEPS = 64
H = 1e-4
SCENE = {
    "version": 1,
    "time": {"fps": 1.0 / (STEPS * H)},
    "system": [{"integrator": "symplectic_euler", "substeps": STEPS}],
    "sheet": [
        {
            "name": "s",
            "size": [1.0, 1.0],
            "resolution": [N, N],
            "pin": ["corner 0 0", "corner 1 0"],
            "links": {
                "structural": {"modulus": 100.0, "damping": 0.001},
                "shear": {"modulus": 50.0, "damping": 0.001},
                "bend": {"modulus": 5.0, "damping": 0.001},
            },
        }
    ],
}


def sheet():
    """Positions, masses, springs and their constants as float32, from the scene's own rule."""
    dx = 1.0 / (N - 1)
    i, j = np.meshgrid(np.arange(N), np.arange(N))
    x = np.stack([i.ravel() * dx - 0.5, j.ravel() * dx - 0.5, np.zeros(N * N)], 1)
    rim = lambda a: np.where((a == 0) | (a == N - 1), 0.5, 1.0)  # noqa: E731
    mass = (0.2 * dx * dx * rim(i) * rim(j)).ravel()
    index = np.arange(N * N).reshape(N, N)
    ends, k, b = [], [], []
    for family, (a, c), part in [
        ("structural", (1, 0), 1.0), ("structural", (0, 1), 1.0), ("shear", (1, 1), 0.5), ("shear", (1, -1), 0.5),
        ("bend", (2, 0), 1.0), ("bend", (0, 2), 1.0),
    ]:  # fmt: skip
        settings = SCENE["sheet"][0]["links"][family]
        rows = index[max(0, -c) : N - max(0, c), : N - a]
        other = index[max(0, -c) + c : N - max(0, c) + c, a:]
        share = np.full(rows.shape, part * dx * dx)
        if a == 0:
            share = share * rim(i)[rows // N, rows % N]
        if c == 0:
            share = share * rim(j)[rows // N, rows % N]
        l0_sq = (a * a + c * c) * dx * dx
        ends.append(np.stack([rows.ravel(), other.ravel()], 1))
        k.append((settings["modulus"] * share / l0_sq).ravel())
        b.append((settings["damping"] * share / l0_sq).ravel())
    ends = np.concatenate(ends).astype(np.int32)
    rest = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    inverse = 1.0 / mass
    inverse[[0, N - 1]] = 0.0
    single = [np.ascontiguousarray(a, np.float32) for a in (x, inverse, np.concatenate(k), np.concatenate(b), rest)]
    return ends, *single


def bench_tumble():
    import tumble

    world = tumble.World(SCENE, threads=THREADS)
    springs = len(world.topology["s"]["links"])
    world.step(4)
    end = world.frame["s"]["position"].copy()
    seconds = median(lambda: world.step(4))
    return springs, springs * STEPS * 4 / seconds, end


def bench_numba(ends, x0, inverse, k, b, rest):
    import numba

    numba.set_num_threads(THREADS)
    # Gather: each mass sums over its springs, so that no two threads write the same place.
    n = len(x0)
    order = np.argsort(np.concatenate([ends[:, 0], ends[:, 1]]), kind="stable")
    spring = np.concatenate([np.arange(len(ends))] * 2)[order].astype(np.int32)
    other = np.concatenate([ends[:, 1], ends[:, 0]])[order]
    start = np.searchsorted(np.concatenate([ends[:, 0], ends[:, 1]])[order], np.arange(n + 1)).astype(np.int32)

    @numba.njit(parallel=True, fastmath=True)
    def steps(x, v, f, count):
        h = np.float32(H)
        for _ in range(count):
            for p in numba.prange(n):
                fx = fy = fz = np.float32(0)
                for s in range(start[p], start[p + 1]):
                    q, e = other[s], spring[s]
                    dx, dy, dz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
                    length = np.sqrt(dx * dx + dy * dy + dz * dz)
                    nx, ny, nz = dx / length, dy / length, dz / length
                    speed = nx * (v[q, 0] - v[p, 0]) + ny * (v[q, 1] - v[p, 1]) + nz * (v[q, 2] - v[p, 2])
                    pull = k[e] * (length - rest[e]) + b[e] * speed
                    fx += pull * nx
                    fy += pull * ny
                    fz += pull * nz
                f[p, 0], f[p, 1], f[p, 2] = fx, fy, fz
            for p in numba.prange(n):
                w = inverse[p]
                g = np.float32(-9.8) if w > 0 else np.float32(0)
                v[p, 0] += h * w * f[p, 0]
                v[p, 1] += h * w * f[p, 1]
                v[p, 2] += h * (w * f[p, 2] + g)
                x[p, 0] += h * v[p, 0]
                x[p, 1] += h * v[p, 1]
                x[p, 2] += h * v[p, 2]

    x, v, f = x0.copy(), np.zeros_like(x0), np.zeros_like(x0)
    steps(x, v, f, 4 * STEPS)
    end = x.copy()
    seconds = median(lambda: steps(x, v, f, 4 * STEPS))
    return len(ends) * STEPS * 4 / seconds, end


def bench_taichi(ends, x0, inverse, k, b, rest):
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=THREADS, default_fp=ti.f32, offline_cache=False, log_level=ti.ERROR)
    n, m = len(x0), len(ends)
    # As numba: from both ends. Scattering with atomics is slower (it is timed, too).
    order = np.argsort(np.concatenate([ends[:, 0], ends[:, 1]]), kind="stable")
    spring_of = np.concatenate([np.arange(m)] * 2)[order].astype(np.int32)
    other_of = np.concatenate([ends[:, 1], ends[:, 0]])[order].astype(np.int32)
    start_of = np.searchsorted(np.concatenate([ends[:, 0], ends[:, 1]])[order], np.arange(n + 1)).astype(np.int32)
    x, v, f = (ti.Vector.field(3, ti.f32, n) for _ in range(3))
    w, start = ti.field(ti.f32, n), ti.field(ti.i32, n + 1)
    spring, other = ti.field(ti.i32, 2 * m), ti.field(ti.i32, 2 * m)
    stiffness, damping, length0 = (ti.field(ti.f32, m) for _ in range(3))
    pair = ti.Vector.field(2, ti.i32, m)
    for field, array in [
        (w, inverse), (start, start_of), (spring, spring_of), (other, other_of), (stiffness, k), (damping, b), (length0, rest),
        (pair, ends),
    ]:  # fmt: skip
        field.from_numpy(array)

    @ti.func
    def pull(p, q, e):
        d = x[q] - x[p]
        length = d.norm()
        direction = d / length
        return (stiffness[e] * (length - length0[e]) + damping[e] * direction.dot(v[q] - v[p])) * direction

    @ti.kernel
    def gather():
        for p in range(n):
            total = ti.Vector([0.0, 0.0, 0.0])
            for s in range(start[p], start[p + 1]):
                total += pull(p, other[s], spring[s])
            f[p] = total

    @ti.kernel
    def scatter():
        for p in f:
            f[p] = ti.Vector([0.0, 0.0, 0.0])
        for e in pair:
            force = pull(pair[e][0], pair[e][1], e)
            f[pair[e][0]] += force
            f[pair[e][1]] -= force

    @ti.kernel
    def move():
        for p in range(n):
            if w[p] > 0:
                v[p] += H * (w[p] * f[p] + ti.Vector([0.0, 0.0, -9.8]))
                x[p] += H * v[p]

    def steps(forces):
        for _ in range(4 * STEPS):
            forces()
            move()
        ti.sync()

    results = {}
    for name, forces in (("gather", gather), ("scatter", scatter)):
        x.from_numpy(x0)
        v.fill(0.0)
        steps(forces)
        end = x.to_numpy()
        seconds = median(lambda forces=forces: steps(forces), repeats=3)
        results[name] = (m * STEPS * 4 / seconds, end)
    return results


def main():
    springs, rate, end = bench_tumble()
    data = sheet()
    assert springs == len(data[0]), (springs, len(data[0]))
    moved = np.abs(end[:, 2]).max()
    off = lambda other: f"{springs} springs, differs by {np.abs(end - other).max() / moved:.1e} of the way"  # noqa: E731
    show("springs", "tumble", rate, "springs/s", f"{springs} springs")
    rate, other = bench_numba(*data)
    show("springs", "numba", rate, "springs/s", off(other))
    for name, (rate, other) in bench_taichi(*data).items():
        show("springs", "taichi" if name == "gather" else "taichi (atomics)", rate, "springs/s", off(other))


main()
