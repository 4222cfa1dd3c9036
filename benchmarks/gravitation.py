"""Gravitation of 16,384 bodies by the direct sum: pairs a second, both ends of each counted.

numba may fuse multiplications with additions and take approximate roots (fastmath), as may tumble's native tier; the bits of
the portable tier are the same on every machine. All take turns, and the shortest time of each counts. Errors are those of the
velocities after one frame, against the same steps in double precision without any liberties.
"""

import time

import numpy as np
from common import THREADS, show

N = 16_384
STEPS = 10
ROUNDS = 5
H = 1e-4
SOFTENING = 0.02


def start(real):
    numbers = np.random.default_rng(1)
    return numbers.normal(size=(N, 3)).astype(np.float32).astype(real), np.full(N, 1.0 / N, real)


def tumble_case(x, mass, precision, bits):
    import tumble

    scene = {
        "version": 1,
        "precision": precision,
        "bits": bits,
        "time": {"fps": 1.0 / (STEPS * H)},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "symplectic_euler", "substeps": STEPS}],
        "particles": [{"name": "b", "position": x, "mass": mass}],
        "force": [{"kind": "gravitation", "constant": 1.0, "softening": SOFTENING}],
    }
    world = tumble.World(scene, threads=THREADS)
    world.step()
    velocity = world.columns("velocity")["b"]["velocity"].copy()
    # Work per frame (an energy, also a sum over all pairs) is part of the time.
    return world.step, velocity


def numba_case(x, mass, real, fastmath=True):
    import numba

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath=fastmath)
    def steps(x, v, gm, count):
        h, soft = real(H), real(SOFTENING**2)
        for _ in range(count):
            for i in numba.prange(N):
                ax = ay = az = real(0)
                for j in range(N):
                    dx, dy, dz = x[0, j] - x[0, i], x[1, j] - x[1, i], x[2, j] - x[2, i]
                    inverse = real(1) / np.sqrt(dx * dx + dy * dy + dz * dz + soft)
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

    x, v = np.ascontiguousarray(x.T), np.zeros((3, N), real)
    steps(x, v, mass, STEPS)
    velocity = v.T.copy()
    return (lambda: steps(x, v, mass, STEPS)), velocity


def main():
    _, exact = numba_case(*start(np.float64), np.float64, fastmath=False)
    for precision, real in [("single", np.float32), ("double", np.float64)]:
        x, mass = start(real)
        runs = {
            "tumble": tumble_case(x, mass, precision, "portable"),
            "tumble native": tumble_case(x, mass, precision, "native"),
            "numba": numba_case(x, mass, real),
        }
        best = dict.fromkeys(runs, np.inf)
        for _ in range(ROUNDS):
            for who, (work, _) in runs.items():
                begin = time.perf_counter()
                work()
                best[who] = min(best[who], time.perf_counter() - begin)
        for bits, ours in [("portable", "tumble"), ("native", "tumble native")]:
            for who in (ours, "numba"):
                off = np.linalg.norm(runs[who][1] - exact, axis=1) / np.linalg.norm(exact, axis=1)
                check = f"velocities off by {np.sqrt((off**2).mean()):.1e}, at most {off.max():.1e}"
                show(f"direct sum, {precision}, {bits}", who, STEPS * N * N / best[who], "pairs/s", check)


main()
