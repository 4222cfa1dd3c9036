"""Heat on 512³ cells of an insulated box in single precision, explicit steps at half the limit: 8 B of a cell and step.

All peers take the same steps of the same field; what is left of its slowest mode is compared with its decay (grids.10). numba
and devito, where it is installed, may fuse multiplications with additions; tumble's bits are the same on every machine. The
triad is a = b + s c by numba on columns of the same length, counted as 12 B a number."""

import sys

import numpy as np
from common import THREADS, median, show

N = int(sys.argv[2]) if len(sys.argv) > 2 else 512
STEPS = 20
Z = 1.0 / 12.0
"""kappa h/dx²: half the limit."""


def mode():
    """The slowest mode along z, the axis whose neighbours are farthest in memory."""
    return np.cos(np.pi * (np.arange(N) + 0.5) / N).astype(np.float32)


def left(plane_means, taken):
    """Remaining amplitude of the mode relative to the exact one."""
    m = mode().astype(float)
    amplitude = plane_means.astype(float) @ m / (m @ m)
    return amplitude / (1.0 - 4.0 * Z * np.sin(np.pi / (2 * N)) ** 2) ** taken


def report(who, seconds, part):
    show("heat", who, 8.0 * N**3 / seconds / 1e9, "GB/s", f"mode off by {part - 1.0:.1e}")


def tumble_world(steps):
    """A world whose frames take so many steps."""
    import tumble

    dx = 1.0 / N
    return tumble.World(
        {
            "version": 1,
            "time": {"fps": 1.0 / (steps * Z * dx * dx)},
            "system": [{"name": "s", "method": "heat", "substeps": steps}],
            "heat": [
                {
                    "name": "b", "box": {"size": [1, 1, 1], "center": [0.5, 0.5, 0.5], "resolution": N},
                    "conductivity": 1, "density": 1, "heat_capacity": 1, "scheme": "explicit", "temperature": "cos(pi*z)",
                }
            ],
        },
        threads=THREADS,
    )  # fmt: skip


def bench_tumble():
    # A frame ends with a snapshot and a look at all cells, which belong to no step: two lengths differ by steps alone.
    world = tumble_world(1)
    frame = median(lambda: world.step(), 3)
    del world
    world = tumble_world(STEPS + 1)
    frames = median(lambda: world.step(), 3)
    t = world.columns("temperature")["b"]["temperature"]
    report("tumble", (frames - frame) / STEPS, left(t.mean((0, 1), dtype=float), 4 * (STEPS + 1)))
    show(
        "heat, frames",
        "tumble",
        8.0 * N**3 * (STEPS + 1) / frames / 1e9,
        "GB/s",
        f"{STEPS + 1} steps and all that ends a frame",
    )


def bench_numba():
    import numba

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath=True)
    def step(a, b, z):
        n = a.shape[0]
        for k in numba.prange(n):
            for j in range(n):
                zl, zh, yl, yh = max(k - 1, 0), min(k + 1, n - 1), max(j - 1, 0), min(j + 1, n - 1)
                row, up, down, high, low = a[k, j], a[zh, j], a[zl, j], a[k, yh], a[k, yl]
                out = b[k, j]
                for i in range(1, n - 1):
                    net = row[i - 1] + row[i + 1] + up[i] + down[i] + high[i] + low[i]
                    out[i] = row[i] + z * (net - np.float32(6) * row[i])
                out[0] = row[0] + z * (row[1] + up[0] + down[0] + high[0] + low[0] - np.float32(5) * row[0])
                out[-1] = row[-1] + z * (row[-2] + up[-1] + down[-1] + high[-1] + low[-1] - np.float32(5) * row[-1])

    a = np.ascontiguousarray(np.broadcast_to(mode()[:, None, None], (N, N, N)))
    b = a.copy()
    z = np.float32(Z)

    def work():
        for _ in range(STEPS // 2):
            step(a, b, z)
            step(b, a, z)

    seconds = median(work, 3) / STEPS
    report("numba", seconds, left(a.mean((1, 2), dtype=float), 4 * STEPS))

    @numba.njit(parallel=True, fastmath=True)
    def triad(a, b, c, s):
        for i in numba.prange(a.size):
            a[i] = b[i] + s * c[i]

    flat, other, third = a.ravel(), b.ravel(), a.ravel().copy()
    seconds = median(lambda: triad(flat, other, third, z), 3)
    show("heat", "triad", 12.0 * N**3 / seconds / 1e9, "GB/s", "12 B a number")


def bench_devito():
    from devito import Eq, Grid, Operator, TimeFunction, configuration, solve

    configuration["log-level"] = "ERROR"
    configuration["language"] = "openmp" if THREADS > 1 else "C"
    # Walls by mirrored points beyond them, set before each step.
    grid = Grid((N, N, N), dtype=np.float32, extent=(N - 1.0,) * 3)
    u = TimeFunction(name="u", grid=grid, space_order=2)
    u.data[:] = mode()[:, None, None]
    halo = u.data_with_halo
    halo[:, 0], halo[:, -1] = halo[:, 1], halo[:, -2]
    update = Eq(u.forward, solve(Eq(u.dt, u.laplace), u.forward), subdomain=grid.interior)
    operator = Operator([update])
    seconds = median(lambda: operator.apply(time_M=STEPS - 1, dt=Z), 3) / STEPS
    # Its outermost cells are held: the middle of the box knows nothing of that so soon.
    at = N // 4
    centre = u.data[(4 * STEPS) % 2, at, N // 2, N // 2] / mode()[at]
    report("devito", seconds, float(centre) / (1.0 - 4.0 * Z * np.sin(np.pi / (2 * N)) ** 2) ** (4 * STEPS))


bench_tumble()
bench_numba()
try:
    import devito  # noqa: F401
except ImportError:
    print("devito is not installed", file=sys.stderr)
else:
    bench_devito()
