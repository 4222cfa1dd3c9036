"""The pressure equation to a relative residual of 1e-5: around a solid sphere with cut cells against pyamg with conjugate
gradients, and in a plain box against scipy's cosine transform.

Every residual is evaluated here, in double precision, with the weights that the engine uses. Ours include the refinement in
double precision that smooth right-hand sides need. With TUMBLE_BENCH_LARGE=1, pyamg solves 256³ cells, too, which takes
minutes and 10 GiB; else its time at 256³ is the one that was measured once, on two cores, beside 0.52 s of ours.
"""

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from common import THREADS, median, show, triad

ROOT = Path(__file__).parent.parent
TOLERANCE = 1e-5
# Bytes that a cell moves in an iteration, in four passes over memory.
BYTES = 69
QUOTED = 51.7


def weights(n, sphere):
    """Open parts of 127 of lower faces, axes z, y, x; those of the box closed."""
    found = []
    for axis in range(3):
        z, y, x = np.meshgrid(*[np.arange(n) + (0.0 if a == axis else 0.5) for a in (2, 1, 0)], indexing="ij")
        far = np.sqrt((x - 0.45 * n) ** 2 + (y - 0.5 * n) ** 2 + (z - 0.55 * n) ** 2) - 0.2 * n
        w = (
            np.floor(np.clip(0.5 + far, 0, 1) * 127 + 0.5).astype(np.uint8)
            if sphere
            else np.full((n, n, n), 127, np.uint8)
        )
        w[tuple(0 if a == axis else slice(None) for a in (2, 1, 0))] = 0
        found.append(w)
    return found


def product(w, q):
    """A q in double precision."""
    out = np.zeros_like(q)
    for axis, lower in enumerate(w):
        of = 2 - axis
        flow = np.diff(q, axis=of) * (np.delete(lower, 0, of) / 127.0)
        first, last = [
            tuple(s if a == of else slice(None) for a in range(3)) for s in (slice(None, -1), slice(1, None))
        ]
        out[first] -= flow
        out[last] += flow
    return out


def right(w, kind):
    """A right-hand side without a mean over the cells that have an open face."""
    n = w[0].shape[0]
    if kind == "random":
        b = np.random.default_rng(1).uniform(-0.5, 0.5, (n, n, n))
    else:
        # Hot air that rises from the floor: a source above, a sink below.
        z, y, x = np.meshgrid(*[(np.arange(n) + 0.5) / n] * 3, indexing="ij")
        b = (z - 0.25) * np.exp(-((x - 0.5) ** 2 + (y - 0.45) ** 2 + (z - 0.25) ** 2) / (2 * 0.08**2))
    fluid = np.zeros((n, n, n), bool)
    for axis, lower in enumerate(w):
        fluid |= (lower > 0) | np.roll(lower > 0, -1, 2 - axis)
    b[~fluid] = 0
    b[fluid] -= b[fluid].mean()
    return b.astype(np.float32), fluid


def residual(w, q, b, fluid):
    left = (b - product(w, q))[fluid]
    left -= left.mean()
    return float(np.linalg.norm(left) / np.linalg.norm(b))


def ours(w, b, method, how, runs=5):
    """The engine's report and solution."""
    n = b.shape[0]
    program = ROOT / "target/release/examples/pressure_file"
    with tempfile.TemporaryDirectory() as folder:
        for axis, column in enumerate(w):
            column.tofile(f"{folder}/w{axis}")
        b.tofile(f"{folder}/b")
        command = [program, folder, str(n), method, str(runs), how]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return json.loads(done.stdout), np.fromfile(f"{folder}/q", np.float64).reshape(b.shape)


class Pyamg:
    """Smoothed aggregation, made once, in front of conjugate gradients."""

    def __init__(self, w, fluid):
        import pyamg
        import scipy.sparse as sparse

        n = fluid.shape[0]
        number = np.full((n, n, n), -1, np.int32)
        number[fluid] = np.arange(fluid.sum())
        rows, columns, values = [], [], []
        for axis, lower in enumerate(w):
            of = 2 - axis
            open_ = lower > 0
            i, j, v = number[open_], np.roll(number, 1, of)[open_], lower[open_] / 127.0
            rows += [i, j, i, j]
            columns += [j, i, i, j]
            values += [-v, -v, v, v]
        # One cell is held, because a preconditioner of a matrix with a constant to spare turns indefinite. That changes no
        # gradient: b has no mean, so nothing flows through what holds it.
        rows, columns, values = [*rows, [0]], [*columns, [0]], [*values, [1.0]]
        m = int(fluid.sum())
        matrix = sparse.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (m, m))
        del rows, columns, values, number
        start = time.perf_counter()
        self.levels = pyamg.smoothed_aggregation_solver(matrix)
        self.set_up = time.perf_counter() - start
        self.fluid = fluid

    def solve(self, b):
        """Its time, iterations and the solution."""
        steps = []
        right = b[self.fluid].astype(float)
        start = time.perf_counter()
        x = self.levels.solve(right, tol=TOLERANCE, accel="cg", residuals=steps)
        seconds = time.perf_counter() - start
        q = np.zeros(b.shape)
        q[self.fluid] = x
        return seconds, len(steps) - 1, q


def cosine_case(b):
    """One solution by scipy's transforms in single precision."""
    from scipy.fft import dctn, idctn

    n = b.shape[0]
    e = (4 * np.sin(np.pi * np.arange(n) / (2 * n)) ** 2).astype(np.float32)
    e = e[:, None, None] + e[:, None] + e
    e[0, 0, 0] = 1

    def solve():
        f = dctn(b, workers=THREADS)
        f /= e
        f[0, 0, 0] = 0
        return idctn(f, workers=THREADS, overwrite_x=True)

    return solve


def main():
    build = ["cargo", "build", "--release", "--quiet", "-p", "tumble", "--example", "pressure_file"]
    subprocess.run(build, cwd=ROOT, check=True)
    bandwidth = triad()
    for n in (128, 256):
        w = weights(n, sphere=True)
        peer = None
        for kind in ("random", "plume"):
            case = f"pressure {n}, {kind}"
            b, fluid = right(w, kind)
            info, q = ours(w, b, "CG with multigrid", "refined")
            part = BYTES * n**3 * info["iterations"] / info["seconds"] / bandwidth
            check = f"{info['iterations']} iterations, {info['refinements']} refinements, "
            check += f"residual {residual(w, q, b, fluid):.1e}, "
            show(
                case, "tumble", info["seconds"], "s", check + f"set-up {info['set_up']:.3f} s, {part:.2f} of the triad"
            )
            show(case, "10 iterations", 10.0 * info["seconds"] / info["iterations"], "s", "what ten of them would take")
            if n == 128 or os.environ.get("TUMBLE_BENCH_LARGE"):
                peer = peer or Pyamg(w, fluid)
                seconds, steps, q = peer.solve(b)
                check = f"{steps} iterations, residual {residual(w, q, b, fluid):.1e}, set-up {peer.set_up:.1f} s"
                show(case, "pyamg", seconds, "s", check)
            else:
                show(case, "pyamg", QUOTED, "s", "as measured once: random, 10 iterations, residual 4.0e-06")
        del peer
        w = weights(n, sphere=False)
        b, fluid = right(w, "random")
        info, q = ours(w, b, "cosine transform", "once")
        show(f"box {n}", "tumble", info["seconds"], "s", f"residual {residual(w, q, b, fluid):.1e}")
        solve = cosine_case(b)
        show(
            f"box {n}", "scipy.fft", median(solve), "s", f"residual {residual(w, solve().astype(float), b, fluid):.1e}"
        )


main()
