"""16 million free particles with gravity and drag, and with a vortex, too: bytes moved a second, against the machine's triad
bandwidth.

A step must read and write positions and velocities once: rows of four float32 each, 64 bytes a particle. Gravity and drag
need the mass, 4 bytes more to read; its inverse is in the row."""

import numpy as np
from common import THREADS, median, show

N = 16_000_000
BYTES = 64 + 4


def bench_tumble(exchanges, forces):
    import tumble

    scene = {
        "version": 1,
        "time": {"exchanges": exchanges},
        "world": {"memory_limit": 64},
        "system": [{"integrator": "symplectic_euler", "substeps": 1}],
        "sheet": [{"name": "p", "size": [1.0, 1.0], "resolution": [4000, 4000], "links": {}}],
        "force": forces,
    }
    return tumble.World(scene, threads=THREADS)


def error(world, passes):
    """Largest difference of a thousand velocities after a frame from the formulas in double precision, step by step."""
    rows = np.arange(0, N, N // 1000)
    x = world.frame["p"]["position"][rows].astype(float)
    v = np.zeros_like(x)
    world.step(1)
    h = 1.0 / 24 / passes
    for _ in range(passes):
        r_sq = x[:, 0] ** 2 + x[:, 1] ** 2
        s = 2 * 0.2 / (r_sq + 0.2**2)
        a = np.stack([s * (-x[:, 1] * 1.5 - x[:, 0] * 0.5), s * (x[:, 0] * 1.5 - x[:, 1] * 0.5), 0.0 * r_sq], 1)
        a[:, 2] = 2.0 * 0.2**2 / (r_sq + 0.2**2) - 9.8
        v += h * (a - 0.5 * v)
        x += h * v
    return np.abs(world.frame["p"]["velocity"][rows] - v).max()


def main():
    import numba

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath=True)
    def triad(a, b, c):
        for i in numba.prange(len(a)):
            a[i] = b[i] + 3.0 * c[i]

    a, b, c = (np.ones(40_000_000, np.float64) for _ in range(3))
    seconds = median(lambda: triad(a, b, c))
    bandwidth = 24 * len(a) / seconds / 1e9
    # Every exchange interval is one pass over memory; sixteen of them a frame make what a frame adds (snapshot, books) small.
    passes = 16
    drag = {"kind": "drag", "rate": 0.5}
    world = bench_tumble(passes, [drag])
    seconds = median(lambda: world.step(1), repeats=3) / passes
    # Symplectic Euler in closed form: v' = (1 - c h) v - g h.
    h, v, z = 1.0 / 24 / passes, 0.0, 0.0
    for _ in range(world.frame_index * passes):
        v += h * (-9.8 - 0.5 * v)
        z += h * v
    off = abs(world.frame["p"]["position"][0, 2] / z - 1.0)
    rate = f"{N / seconds / 1e6:.0f} M particles/s, z off by {off:.1e}"
    show("particles", "tumble", BYTES * N / seconds / 1e9, "GB/s", rate)
    show("particles", "triad", bandwidth, "GB/s", "numba, float64, no non-temporal stores")
    vortex = {"kind": "vortex", "core": 0.2, "swirl": 1.5, "inward": 0.5, "lift": 2.0}
    world = bench_tumble(passes, [drag, vortex])
    off = error(world, passes)
    seconds = median(lambda: world.step(1), repeats=3) / passes
    check = f"{N / seconds / 1e6:.0f} M particles/s, velocities of the first frame off by {off:.1e} m/s"
    show("particles, vortex", "tumble", BYTES * N / seconds / 1e9, "GB/s", check)
    show("particles, vortex", "triad", bandwidth, "GB/s", "numba, float64, no non-temporal stores")


main()
