"""16 million free particles with gravity and drag: bytes moved a second, against the machine's triad bandwidth.

A step must read and write positions and velocities once: rows of four float32 each, 64 bytes a particle. Gravity and drag
need mass and its inverse, 8 bytes more to read."""

import numpy as np
from common import THREADS, median, show

N = 16_000_000
BYTES = 64 + 8


def bench_tumble(exchanges):
    import tumble

    scene = {
        "version": 1,
        "time": {"exchanges": exchanges},
        "world": {"memory_limit": 64},
        "system": [{"integrator": "symplectic_euler", "substeps": 1}],
        "sheet": [{"name": "p", "size": [1.0, 1.0], "resolution": [4000, 4000], "links": {}}],
        "force": [{"kind": "drag", "rate": 0.5}],
    }
    return tumble.World(scene, threads=THREADS)


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
    world = bench_tumble(passes)
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


main()
