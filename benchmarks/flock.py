"""A flock of 100,000 with 25 neighbours each, found anew at each step: time of a step.

All steer by the same law (flocks.1) in single precision. numba and taichi sort by cell, as tumble does, and may fuse
multiplications with additions; tumble's bits are the same on every machine."""

import numpy as np
from common import THREADS, median, show

N = 100_000
STEPS = 10
H = 1e-3
RADIUS, SPACING = 1.0, 0.5
COHESION, ALIGNMENT, SEPARATION, SPEED, PROPULSION = 1.0, 2.0, 0.5, 2.0, 1.0


def start(n):
    numbers = np.random.default_rng(1)
    side = (n / (25 / (4 / 3 * np.pi * RADIUS**3))) ** (1 / 3)
    x = numbers.uniform(0, side, (n, 3)).astype(np.float32)
    return x, numbers.normal(size=(n, 3)).astype(np.float32)


def scene(x, v, steps, h, integrator="symplectic_euler"):
    return {
        "version": 1,
        "time": {"fps": 1.0 / (steps * h)},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": integrator, "substeps": steps}],
        "particles": [{"name": "b", "position": x, "velocity": v}],
        "force": [
            {
                "kind": "flock", "radius": RADIUS, "spacing": SPACING, "cohesion": COHESION, "alignment": ALIGNMENT,
                "separation": SEPARATION, "speed": SPEED, "propulsion": PROPULSION,
            }
        ],
    }  # fmt: skip


def brute_force(x, v):
    """Accelerations, pair by pair, in double precision."""
    x, v = x.astype(float), v.astype(float)
    a = np.empty_like(x)
    for i in range(len(x)):
        d, dv = x - x[i], v - v[i]
        r_sq = (d * d).sum(1)
        w = np.where(r_sq > 0, np.maximum(1 - r_sq / RADIUS**2, 0) ** 2, 0)
        e_sq = r_sq / SPACING**2
        s = np.maximum(1 - e_sq, 0) ** 2 / (e_sq + 0.01) / SPACING
        mean = (COHESION * (w @ d) + ALIGNMENT * (w @ dv)) / (w.sum() + 0.01)
        a[i] = mean - SEPARATION * (s @ d) + PROPULSION * v[i] * (1 - (v[i] @ v[i]) / SPEED**2)
    return a


def bench_tumble(x, v):
    import tumble

    world = tumble.World(scene(x, v, STEPS, H), threads=THREADS)
    world.step()
    velocity = world.columns("velocity")["b"]["velocity"].copy()
    return median(lambda: world.step()) / STEPS, velocity


def check_tumble(x, v):
    """Largest difference of the accelerations from those of brute force, over the largest acceleration."""
    import tumble

    h = 0.01
    world = tumble.World(scene(x, v, 1, h, "forward_euler"), threads=THREADS)
    world.step()
    a = (world.columns("velocity")["b"]["velocity"].astype(float) - v) / h
    right = brute_force(x, v)
    return np.abs(a - right).max() / np.abs(right).max()


def bench_numba(x0, v0):
    import numba

    numba.set_num_threads(THREADS)
    f = np.float32

    @numba.njit(parallel=True, fastmath=True)
    def step(x, v, a, sx, sv, order, cell, first, low, shape):
        n = len(x)
        nx, ny, nz = shape
        first[:] = 0
        for i in numba.prange(n):
            c = [0, 0, 0]
            for k in range(3):
                c[k] = min(max(int((x[i, k] - low[k]) / f(RADIUS)), 0), shape[k] - 1)
            cell[i] = (c[2] * ny + c[1]) * nx + c[0]
        for i in range(n):
            first[cell[i] + 1] += 1
        for c in range(nx * ny * nz):
            first[c + 1] += first[c]
        for i in range(n - 1, -1, -1):
            # Backwards, so that cells keep their order; first[c + 1] ends as the start of cell c.
            first[cell[i] + 1] -= 1
            order[first[cell[i] + 1]] = i
        for p in numba.prange(n):
            for k in range(3):
                sx[p, k] = x[order[p], k]
                sv[p, k] = v[order[p], k]
        for p in numba.prange(n):
            i = order[p]
            c = cell[i]
            cx, cy, cz = c % nx, c // nx % ny, c // (nx * ny)
            px, py, pz, vx, vy, vz = sx[p, 0], sx[p, 1], sx[p, 2], sv[p, 0], sv[p, 1], sv[p, 2]
            total = mx = my = mz = ux = uy = uz = ax = ay = az = f(0)
            for z in range(max(cz - 1, 0), min(cz + 2, nz)):
                for y in range(max(cy - 1, 0), min(cy + 2, ny)):
                    base = (z * ny + y) * nx
                    # first[c + 1] is where cell c starts.
                    begin, end = first[base + max(cx - 1, 0) + 1], first[base + min(cx + 1, nx - 1) + 2]
                    for q in range(begin, end):
                        dx, dy, dz = sx[q, 0] - px, sx[q, 1] - py, sx[q, 2] - pz
                        r_sq = dx * dx + dy * dy + dz * dz
                        if r_sq < f(RADIUS * RADIUS) and r_sq > f(0):
                            t = f(1) - r_sq * f(1 / RADIUS**2)
                            w = t * t
                            total += w
                            mx += w * dx
                            my += w * dy
                            mz += w * dz
                            ux += w * (sv[q, 0] - vx)
                            uy += w * (sv[q, 1] - vy)
                            uz += w * (sv[q, 2] - vz)
                            e_sq = r_sq * f(1 / SPACING**2)
                            if e_sq < f(1):
                                t = f(1) - e_sq
                                s = t * t / (e_sq + f(0.01)) * f(1 / SPACING)
                                ax -= s * dx
                                ay -= s * dy
                                az -= s * dz
            mean = f(1) / (total + f(0.01))
            drive = f(PROPULSION) * (f(1) - (vx * vx + vy * vy + vz * vz) * f(1 / SPEED**2))
            a[i, 0] = (f(COHESION) * mx + f(ALIGNMENT) * ux) * mean + f(SEPARATION) * ax + drive * vx
            a[i, 1] = (f(COHESION) * my + f(ALIGNMENT) * uy) * mean + f(SEPARATION) * ay + drive * vy
            a[i, 2] = (f(COHESION) * mz + f(ALIGNMENT) * uz) * mean + f(SEPARATION) * az + drive * vz
        for i in numba.prange(n):
            for k in range(3):
                v[i, k] += f(H) * a[i, k]
                x[i, k] += f(H) * v[i, k]

    x, v = x0.copy(), v0.copy()
    low = x.min(0) - f(1.5)
    shape = tuple(int(k) for k in np.ceil((x.max(0) + f(1.5) - low) / RADIUS))
    cells = shape[0] * shape[1] * shape[2]
    a, sx, sv = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    order, cell, first = np.empty(len(x), np.int32), np.empty(len(x), np.int32), np.empty(cells + 2, np.int32)

    def steps():
        for _ in range(STEPS):
            step(x, v, a, sx, sv, order, cell, first, low, shape)

    steps()
    velocity = v.copy()
    return median(steps) / STEPS, velocity


def bench_taichi(x0, v0):
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=THREADS, default_fp=ti.f32, offline_cache=False, log_level=ti.ERROR)
    n = len(x0)
    low = x0.min(0) - np.float32(1.5)
    nx, ny, nz = (int(k) for k in np.ceil((x0.max(0) + np.float32(1.5) - low) / RADIUS))
    x, v, a, sx, sv = (ti.Vector.field(3, ti.f32, n) for _ in range(5))
    order, cell, first = ti.field(ti.i32, n), ti.field(ti.i32, n), ti.field(ti.i32, nx * ny * nz + 2)
    corner, shape = ti.Vector(low.tolist()), ti.Vector([nx, ny, nz])

    @ti.kernel
    def sort():
        for c in first:
            first[c] = 0
        for i in x:
            at = ti.math.clamp(ti.cast((x[i] - corner) / RADIUS, ti.i32), 0, shape - 1)
            cell[i] = (at[2] * ny + at[1]) * nx + at[0]
        ti.loop_config(serialize=True)
        for i in range(n):
            first[cell[i] + 1] += 1
        ti.loop_config(serialize=True)
        for c in range(nx * ny * nz):
            first[c + 1] += first[c]
        ti.loop_config(serialize=True)
        for k in range(n):
            i = n - 1 - k
            first[cell[i] + 1] -= 1
            order[first[cell[i] + 1]] = i
        for p in sx:
            sx[p] = x[order[p]]
            sv[p] = v[order[p]]

    @ti.kernel
    def steer():
        for p in sx:
            i = order[p]
            cx, cy, cz = cell[i] % nx, cell[i] // nx % ny, cell[i] // (nx * ny)
            here, velocity = sx[p], sv[p]
            total = 0.0
            m, u, apart = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
            for z in range(ti.max(cz - 1, 0), ti.min(cz + 2, nz)):
                for y in range(ti.max(cy - 1, 0), ti.min(cy + 2, ny)):
                    base = (z * ny + y) * nx
                    begin, end = first[base + ti.max(cx - 1, 0) + 1], first[base + ti.min(cx + 1, nx - 1) + 2]
                    for q in range(begin, end):
                        d = sx[q] - here
                        r_sq = d.dot(d)
                        if 0.0 < r_sq < RADIUS * RADIUS:
                            t = 1.0 - r_sq * (1 / RADIUS**2)
                            w = t * t
                            total += w
                            m += w * d
                            u += w * (sv[q] - velocity)
                            e_sq = r_sq * (1 / SPACING**2)
                            if e_sq < 1.0:
                                t = 1.0 - e_sq
                                apart -= t * t / (e_sq + 0.01) * (1 / SPACING) * d
            drive = PROPULSION * (1.0 - velocity.dot(velocity) * (1 / SPEED**2))
            a[i] = (COHESION * m + ALIGNMENT * u) / (total + 0.01) + SEPARATION * apart + drive * velocity

    @ti.kernel
    def move():
        for i in x:
            v[i] += H * a[i]
            x[i] += H * v[i]

    x.from_numpy(x0)
    v.from_numpy(v0)

    def steps():
        for _ in range(STEPS):
            sort()
            steer()
            move()
        ti.sync()

    steps()
    velocity = v.to_numpy()
    return median(steps) / STEPS, velocity


def main():
    small = check_tumble(*start(2000))
    x, v = start(N)
    seconds, velocity = bench_tumble(x, v)
    show(
        "flock", "tumble", seconds, "s", f"{N} boids a step; accelerations of 2000 differ from all pairs by {small:.1e}"
    )
    for who, bench in [("numba", bench_numba), ("taichi", bench_taichi)]:
        seconds, other = bench(x, v)
        off = np.abs(velocity - other).max() / np.abs(other).max()
        show("flock", who, seconds, "s", f"fused, velocities differ by {off:.1e}")


main()
