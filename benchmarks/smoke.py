"""A step of smoke: MacCormack for smoke and temperature, semi-Lagrangian velocity, buoyancy, and a pressure that leaves at most
1e-5 of divergence (max |div u| dx/max |u|). A swirl of 1 m/s carries two balls of warm smoke round a closed box, two cells of
128 a step.

At 128³ against the same in taichi with conjugate gradients, at 64³ against phiflow with jax; the divergence that is left is
evaluated here, in double precision, for all. What a step costs at 256³, what each of its parts costs, found by leaving it out,
and how many bytes a cell takes."""

import os
import sys
import time
from pathlib import Path

import numpy as np
from common import THREADS, median, show, triad

H = 1.0 / 60.0
"""Step [s]."""
TOLERANCE = 1e-5
STEPS = 4
"""Steps that are timed, after as many that warm up."""
GRAVITY, AMBIENT = 9.8, 300.0
BALLS = ((0.5, 0.5, 0.2, 0.15), (0.25, 0.5, 0.5, 0.1))


def at(n, axis=None):
    """Coordinates of the centres of cells, or of the faces across an axis."""
    points = [np.arange(n + (a == axis)) / n + (0.0 if a == axis else 0.5 / n) for a in range(3)]
    return np.meshgrid(*points, indexing="ij")


def start(n):
    """Velocities and smoke of the beginning; temperature is ambient + 100 smoke."""
    x, _, z = at(n, 0)
    u = np.sin(np.pi * x) * np.cos(np.pi * z)
    v = np.zeros((n, n + 1, n))
    x, _, z = at(n, 2)
    w = -np.cos(np.pi * x) * np.sin(np.pi * z)
    x, y, z = at(n)
    smoke = np.zeros((n, n, n))
    for a, b, c, r in BALLS:
        far = np.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)
        t = np.clip((r + 0.03 - far) / 0.06, 0.0, 1.0)
        smoke += t * t * (3.0 - 2.0 * t)
    return [f.astype(np.float32) for f in (u, v, w, smoke)]


def left(u, v, w):
    """Largest |div u| dx over the largest velocity."""
    u, v, w = (np.asarray(f, np.float64) for f in (u, v, w))
    divergence = np.diff(u, axis=0) + np.diff(v, axis=1) + np.diff(w, axis=2)
    return np.abs(divergence).max() / max(np.abs(f).max() for f in (u, v, w))


def words(n):
    """Of the gas."""
    balls = " + ".join(f"smoothstep({r} + 0.03, {r} - 0.03, hypot(x - {a}, y - {b}, z - {c}))" for a, b, c, r in BALLS)
    return {
        "name": "air",
        "box": {"size": [1, 1, 1], "center": [0.5, 0.5, 0.5], "resolution": n},
        "fluid_density": 1.2,
        "smoke": {"initial": balls},
        "temperature": {"ambient": AMBIENT, "initial": f"{AMBIENT} + 100*({balls})"},
        "velocity": ["sin(pi*x)*cos(pi*z)", 0, "-cos(pi*x)*sin(pi*z)"],
        "pressure": {"tolerance": TOLERANCE},
    }


def tumble_world(n, steps=STEPS, **other):
    """A world whose frames take so many steps."""
    import tumble

    scene = {
        "version": 1,
        "time": {"fps": 1.0 / (steps * H)},
        "world": {"memory_limit": 16},
        "system": [{"name": "s", "method": "gas", "substeps": steps}],
        "gas": [{k: v for k, v in (words(n) | other).items() if v is not None}],
    }
    return tumble.World(scene, threads=THREADS)


def resident():
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def bench_tumble(n, case, runs=3):
    """Seconds of a step, all that ends a frame shared among its steps; the world, and the smoke after the warm-up."""
    before = resident()
    world = tumble_world(n)
    report = world.step()
    bytes_of_cell = (resident() - before) / n**3
    frame = world.columns("density", "velocity_x", "velocity_y", "velocity_z")["air"]
    after = left(*(frame[f"velocity_{a}"] for a in "xyz"))
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        report = world.step()
        times.append(time.perf_counter() - began)
    seconds = float(np.median(times)) / STEPS
    check = f"{1 / seconds:.3g} steps/s, {report['linear'] / STEPS:.1f} iterations, divergence {after:.1e}"
    show(case, "tumble", seconds, "s", check)
    return seconds, bytes_of_cell, frame["density"]


def bench_taichi(n, case, ours):
    """The same with CG, from the pressure of the last step, as anyone would write it."""
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=THREADS, default_fp=ti.f32, offline_cache=False, log_level=ti.ERROR)
    dx, f32 = 1.0 / n, ti.f32
    shapes = [(n + 1, n, n), (n, n + 1, n), (n, n, n + 1)]
    velocity, next_velocity = ([ti.field(f32, s) for s in shapes] for _ in range(2))
    cells = [ti.field(f32, (n, n, n)) for _ in range(11)]
    smoke, warm, new_smoke, new_warm, there_smoke, there_warm, p, r, d, ad, total = cells
    number = ti.field(ti.f64, ())
    most = ti.field(f32, ())
    u, v, w = velocity

    @ti.func
    def read(f: ti.template(), x, shift: ti.template()):
        """Trilinear; x in cells."""
        q = x - shift
        for a in ti.static(range(3)):
            q[a] = ti.min(ti.max(q[a], 0.0), f.shape[a] - 1.0)
        base = ti.Vector([ti.min(int(q[a]), f.shape[a] - 2) for a in ti.static(range(3))])
        t = q - base
        value = 0.0
        for corner in ti.static(ti.ndrange(2, 2, 2)):
            weight = 1.0
            for a in ti.static(range(3)):
                weight *= t[a] if corner[a] else 1.0 - t[a]
            value += weight * f[base + ti.Vector(corner)]
        return value

    @ti.func
    def range_of(f: ti.template(), x):
        q = x - 0.5
        for a in ti.static(range(3)):
            q[a] = ti.min(ti.max(q[a], 0.0), n - 1.0)
        base = ti.Vector([ti.min(int(q[a]), n - 2) for a in ti.static(range(3))])
        low, high = 1e30, -1e30
        for corner in ti.static(ti.ndrange(2, 2, 2)):
            value = f[base + ti.Vector(corner)]
            low, high = ti.min(low, value), ti.max(high, value)
        return low, high

    X, Y, Z, C = (ti.Vector(s) for s in ([0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.5, 0.5, 0.5]))

    @ti.func
    def speed(x):
        return ti.Vector([read(u, x, X), read(v, x, Y), read(w, x, Z)])

    @ti.func
    def back(x, h):
        """Departure point of the fluid at x over h, by the midpoint rule."""
        return x - h / dx * speed(x - 0.5 * h / dx * speed(x))

    @ti.kernel
    def forward(h: f32):
        for i in ti.grouped(smoke):
            x = back(i + C, h)
            there_smoke[i], there_warm[i] = read(smoke, x, C), read(warm, x, C)

    @ti.kernel
    def corrected(h: f32):
        for i in ti.grouped(smoke):
            x, y = back(i + C, h), back(i + C, -h)
            low, high = range_of(smoke, x)
            value = there_smoke[i] + 0.5 * (smoke[i] - read(there_smoke, y, C))
            new_smoke[i] = ti.min(ti.max(value, low), high)
            low, high = range_of(warm, x)
            value = there_warm[i] + 0.5 * (warm[i] - read(there_warm, y, C))
            new_warm[i] = ti.min(ti.max(value, low), high)

    @ti.kernel
    def carry(f: ti.template(), out: ti.template(), shift: ti.template(), axis: ti.template(), h: f32):
        for i in ti.grouped(f):
            value = read(f, back(i + shift, h), shift)
            out[i] = 0.0 if i[axis] == 0 or i[axis] == n else value

    @ti.kernel
    def rise(h: f32):
        for i, j, k in w:
            if 0 < k < n:
                s = 0.5 * (smoke[i, j, k - 1] + smoke[i, j, k])
                t = 0.5 * (warm[i, j, k - 1] + warm[i, j, k]) - AMBIENT
                w[i, j, k] += h * GRAVITY * (t / AMBIENT - s / 1.2)

    @ti.func
    def product(f: ti.template(), i, j, k):
        value = 0.0
        if i > 0:
            value += f[i, j, k] - f[i - 1, j, k]
        if i < n - 1:
            value += f[i, j, k] - f[i + 1, j, k]
        if j > 0:
            value += f[i, j, k] - f[i, j - 1, k]
        if j < n - 1:
            value += f[i, j, k] - f[i, j + 1, k]
        if k > 0:
            value += f[i, j, k] - f[i, j, k - 1]
        if k < n - 1:
            value += f[i, j, k] - f[i, j, k + 1]
        return value

    @ti.kernel
    def speed_limit() -> f32:
        fastest = 0.0
        for i in ti.grouped(u):
            ti.atomic_max(fastest, ti.abs(u[i]))
        for i in ti.grouped(v):
            ti.atomic_max(fastest, ti.abs(v[i]))
        for i in ti.grouped(w):
            ti.atomic_max(fastest, ti.abs(w[i]))
        return fastest

    @ti.kernel
    def begin() -> ti.f64:
        number[None] = 0.0
        most[None] = 0.0
        for i, j, k in r:
            value = u[i, j, k] - u[i + 1, j, k] + v[i, j, k] - v[i, j + 1, k] + w[i, j, k] - w[i, j, k + 1]
            value = dx * value - product(p, i, j, k)
            r[i, j, k] = value
            d[i, j, k] = value
            number[None] += ti.cast(value, ti.f64) * value
            ti.atomic_max(most[None], ti.abs(value))
        return number[None]

    @ti.kernel
    def curvature() -> ti.f64:
        number[None] = 0.0
        for i, j, k in d:
            value = product(d, i, j, k)
            ad[i, j, k] = value
            number[None] += ti.cast(value, ti.f64) * d[i, j, k]
        return number[None]

    @ti.kernel
    def descend(alpha: f32) -> ti.f64:
        number[None] = 0.0
        most[None] = 0.0
        for i in ti.grouped(p):
            p[i] += alpha * d[i]
            value = r[i] - alpha * ad[i]
            r[i] = value
            number[None] += ti.cast(value, ti.f64) * value
            ti.atomic_max(most[None], ti.abs(value))
        return number[None]

    @ti.kernel
    def turn(beta: f32):
        for i in ti.grouped(d):
            d[i] = r[i] + beta * d[i]

    @ti.kernel
    def subtract():
        for i, j, k in u:
            if 0 < i < n:
                u[i, j, k] -= (p[i, j, k] - p[i - 1, j, k]) / dx
        for i, j, k in v:
            if 0 < j < n:
                v[i, j, k] -= (p[i, j, k] - p[i, j - 1, k]) / dx
        for i, j, k in w:
            if 0 < k < n:
                w[i, j, k] -= (p[i, j, k] - p[i, j, k - 1]) / dx

    @ti.kernel
    def gather():
        for i in ti.grouped(p):
            total[i] += p[i]

    taken = []

    def step():
        forward(H)
        corrected(H)
        for f, out, shift, axis in zip(velocity, next_velocity, (X, Y, Z), range(3), strict=True):
            carry(f, out, shift, axis, H)
        for f, out in zip(velocity, next_velocity, strict=True):
            f.copy_from(out)
        smoke.copy_from(new_smoke)
        warm.copy_from(new_warm)
        rise(H)
        enough = 0.95 * TOLERANCE * dx * speed_limit()
        p.copy_from(total)
        total.fill(0.0)
        taken.append(0)
        # Single precision knows a residual only from the velocity: what it has missed is solved for again.
        for _ in range(4):
            rr = begin()
            while most[None] > enough and taken[-1] < 2000:
                after = descend(rr / curvature())
                turn(after / rr)
                rr = after
                taken[-1] += 1
            subtract()
            gather()
            p.fill(0.0)
            begin()
            if most[None] <= enough:
                break

    for f, values in zip((*velocity, smoke), start(n), strict=True):
        f.from_numpy(values)
    warm.from_numpy((AMBIENT + 100.0 * smoke.to_numpy()).astype(np.float32))
    for _ in range(STEPS):
        step()
    far = float(np.sqrt(np.mean((smoke.to_numpy() - ours) ** 2) / np.mean(ours**2)))
    after = left(*(f.to_numpy() for f in velocity))
    began = time.perf_counter()
    for _ in range(STEPS):
        step()
    ti.sync()
    seconds = (time.perf_counter() - began) / STEPS
    check = f"{np.mean(taken[-STEPS:]):.0f} iterations, divergence {after:.1e}, smoke off tumble's by {100 * far:.1f} %"
    show(case, "taichi", seconds, "s", check)
    ti.reset()


def bench_phiflow(n, case, ours):
    """MacCormack smoke and temperature, semi-Lagrangian velocity, CG by jax, compiled as a whole."""
    os.environ.setdefault("XLA_FLAGS", f"--xla_cpu_multi_thread_eigen={'true' if THREADS > 1 else 'false'}")
    from phi.jax import flow as phi

    phi.math.set_global_precision(32)
    box = phi.Box(x=1, y=1, z=1)
    size = {"x": n, "y": n, "z": n}
    wall = phi.extrapolation.combine_sides(x=(0, 0), y=(0, 0), z=(0, 0))
    u, v, w, s = start(n)
    flow = [
        np.ascontiguousarray(f[cut])
        for f, cut in zip((u, v, w), (np.s_[1:-1], np.s_[:, 1:-1], np.s_[:, :, 1:-1]), strict=True)
    ]
    values = phi.math.stack(
        {a: phi.math.tensor(f, phi.spatial("x,y,z")) for a, f in zip("xyz", flow, strict=True)},
        phi.dual(vector="x,y,z"),
    )
    velocity = phi.StaggeredGrid(values, wall, bounds=box, **size)
    smoke = phi.CenteredGrid(
        phi.math.tensor(s, phi.spatial("x,y,z")), phi.extrapolation.ZERO_GRADIENT, bounds=box, **size
    )
    warm = AMBIENT + 100.0 * smoke
    pressure = phi.CenteredGrid(0, phi.extrapolation.ZERO_GRADIENT, bounds=box, **size)

    @phi.math.jit_compile
    def step(velocity, smoke, warm, pressure):
        new_smoke = phi.advect.mac_cormack(smoke, velocity, H)
        new_warm = phi.advect.mac_cormack(warm, velocity, H)
        velocity = phi.advect.semi_lagrangian(velocity, velocity, H)
        push = H * GRAVITY * ((new_warm - AMBIENT) / AMBIENT - new_smoke / 1.2)
        velocity += (push * (0, 0, 1)).at(velocity)
        # fluid.make_incompressible makes a matrix, whose indices overflow at this size.
        solve = phi.Solve("CG", 0.0, TOLERANCE * n, x0=pressure, max_iterations=2000)
        pressure = phi.field.solve_linear(phi.field.laplace, phi.field.divergence(velocity), solve)
        velocity -= phi.field.spatial_gradient(pressure, velocity.boundary, at="face")
        return velocity, new_smoke, new_warm, pressure

    state = (velocity, smoke, warm, pressure)
    for _ in range(STEPS):
        state = step(*state)
    phi.math.copy(state[1].values).numpy("x,y,z")
    parts = [state[0].vector[a].values.numpy("x,y,z") for a in "xyz"]
    padded = [np.pad(f, [(1, 1) if a == b else (0, 0) for b in range(3)]) for a, f in enumerate(parts)]
    far = float(np.sqrt(np.mean((state[1].values.numpy("x,y,z") - ours) ** 2) / np.mean(ours**2)))
    after = left(*padded)
    began = time.perf_counter()
    for _ in range(STEPS):
        state = step(*state)
    state[1].values.numpy("x,y,z")
    seconds = (time.perf_counter() - began) / STEPS
    show(case, "phiflow", seconds, "s", f"divergence {after:.1e}, smoke off tumble's by {100 * far:.1f} %")


def bench_stages(n, bandwidth):
    """Cost of a part: a step less one without it. Bytes are the minimum of its passes over memory."""

    def seconds(**words):
        # Two lengths of frames differ by steps alone.
        lengths = []
        for steps in (1, 1 + STEPS):
            world = tumble_world(n, steps, **words)
            lengths.append(median(lambda world=world: world.step(), 3))
            iterations = world.step()["linear"] / steps
        return (lengths[1] - lengths[0]) / STEPS, iterations

    whole, iterations = seconds()
    # The velocity is looked at, and stays as advection and forces left it.
    unsolved, _ = seconds(pressure={"tolerance": 1e3})
    of_all = words(n)
    unforced, _ = seconds(smoke=of_all["smoke"] | {"weight": 0}, temperature=of_all["temperature"] | {"expansion": 0})
    viscous, steps = seconds(viscosity=1e-3)
    for part, cost, moved, check in (
        (
            "projection",
            whole - unsolved,
            69 * iterations + 100,
            f"{iterations:.1f} iterations of 69 B, 100 B around them",
        ),
        ("forces", whole - unforced, 2 * 12, "two pushes of one component"),
        (
            "viscosity",
            viscous - whole,
            52 * (steps - iterations),
            f"{steps - iterations:.1f} iterations of all components, 52 B each",
        ),
        (
            "advection",
            unsolved - (whole - unforced),
            2 * 12 + 2 * 8 + 2 * 16 + 12 + 24,
            "u thrice, smoke and warmth there and back",
        ),
    ):
        share = f"{moved * n**3 / cost / bandwidth:.2f} of the triad" if cost > 0.02 * whole else "too little to tell"
        show(f"smoke {n}, {part}", "tumble", cost, "s", f"{moved:.0f} B a cell, {share}: {check}")


def main():
    bandwidth = triad()
    costs = {}
    # The largest first, while the memory of this process is its own.
    for n in [int(a) for a in sys.argv[2:]] or [256, 128, 64]:
        case = f"smoke {n}"
        seconds, memory, smoke = bench_tumble(n, case)
        costs[n] = seconds / n**3
        if n == 256:
            show("smoke, memory", "tumble", memory, "B", "of a cell, all in: what a world of 256³ adds to the process")
            show("smoke, memory", "80 bytes", 80.0, "B", "what is aimed at")
        if n == 128:
            bench_stages(n, bandwidth)
            bench_taichi(n, case, smoke)
        if n == 64:
            bench_phiflow(n, case, smoke)
    if 256 in costs and 128 in costs:
        show("smoke, a cell", "tumble", costs[256], "s", "of a step at 256³")
        show("smoke, a cell", "tumble at 128³", costs[128], "s", "")


if __name__ == "__main__":
    main()
