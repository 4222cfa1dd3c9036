"""Gravitation of 16,384 bodies by the direct sum: pairs a second, both ends of each counted.

numba may fuse multiplications with additions and take approximate roots; tumble's bits are the same on every machine."""

import numpy as np
from common import THREADS, median, show

N = 16_384
STEPS = 4
H = 1e-4
SOFTENING = 0.02


def start():
    numbers = np.random.default_rng(1)
    return numbers.normal(size=(N, 3)).astype(np.float32), np.full(N, 1.0 / N, np.float32)


def bench_tumble(x, mass):
    import tumble

    scene = {
        "version": 1,
        "time": {"fps": 1.0 / (STEPS * H)},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "symplectic_euler", "substeps": STEPS}],
        "particles": [{"name": "b", "position": x, "mass": mass}],
        "force": [{"kind": "gravitation", "constant": 1.0, "softening": SOFTENING}],
    }
    world = tumble.World(scene, threads=THREADS)
    world.step()
    velocity = world.columns("velocity")["b"]["velocity"].copy()
    # What a frame adds (an energy, which is a sum over all pairs, too) is part of the time.
    return median(lambda: world.step(), repeats=3), velocity


def bench_numba(x, mass):
    import numba

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath=True)
    def steps(x, v, gm, count):
        h, soft = np.float32(H), np.float32(SOFTENING**2)
        for _ in range(count):
            for i in numba.prange(N):
                ax = ay = az = np.float32(0)
                for j in range(N):
                    dx, dy, dz = x[0, j] - x[0, i], x[1, j] - x[1, i], x[2, j] - x[2, i]
                    inverse = np.float32(1) / np.sqrt(dx * dx + dy * dy + dz * dz + soft)
                    pull = gm[j] * inverse * inverse * inverse
                    ax += pull * dx
                    ay += pull * dy
                    az += pull * dz
                v[0, i] += h * ax
                v[1, i] += h * ay
                v[2, i] += h * az
            for i in numba.prange(N):
                for c in range(3):
                    x[c, i] += h * v[c, i]

    x, v = np.ascontiguousarray(x.T), np.zeros((3, N), np.float32)
    steps(x, v, mass, STEPS)
    velocity = v.T.copy()
    return median(lambda: steps(x, v, mass, STEPS), repeats=3), velocity


def main():
    x, mass = start()
    seconds, velocity = bench_tumble(x, mass)
    show(
        "gravitation", "tumble", STEPS * N * N / seconds, "pairs/s", f"{N} bodies, with the energy of every fourth step"
    )
    seconds, other = bench_numba(x, mass)
    off = np.abs(velocity - other).max() / np.abs(other).max()
    show("gravitation", "numba", STEPS * N * N / seconds, "pairs/s", f"fused, velocities differ by {off:.1e}")


main()
