"""One implicit Euler step of a stiff 128 x 128 sheet, h = 1/60 s: one Newton step, its linear system to a relative residual of
1e-4, against scipy's CG (with the same block-Jacobi preconditioner) and sparse LU on the same matrix.

The peers get their matrix and right-hand side for nothing: only the solve is timed. tumble's time is that of the whole step."""

import numpy as np
from common import THREADS, median, show

N = 128
MODULUS = 1e4
H = 1.0 / 60
MASS = 1.2e-3
TOLERANCE = 1e-4
DAMPING = 0.0


def scene():
    size = 1.0
    dx = size / (N - 1)
    links = {"structural": MODULUS, "shear": 2 * MODULUS, "bend": 4 * MODULUS}
    return {
        "version": 1,
        "time": {"fps": 60},
        "system": [
            {
                "integrator": "implicit_euler",
                "substeps": 1,
                "solver": {"linearized": True, "linear_tolerance": TOLERANCE, "linear_iterations": 5000},
            }
        ],
        "sheet": [
            {
                "name": "s",
                "size": [size, size],
                "resolution": [N, N],
                "density": MASS / (dx * dx),
                "pin": ["corner 0 0", "corner 1 0"],
                "links": links,
            }
        ],
    }


def assemble(x, ends, stiffness, rest, mass):
    """M/h² + K (each spring's indefinite part left out) as a block matrix, in double precision."""
    import scipy.sparse as sp

    n = len(x)
    d = x[ends[:, 1]] - x[ends[:, 0]]
    length = np.linalg.norm(d, axis=1)
    direction = d / length[:, None]
    across = np.maximum(0.0, stiffness * (1.0 - rest / length))
    along = stiffness[:, None, None] * direction[:, :, None] * direction[:, None, :]
    block = along + across[:, None, None] * (np.eye(3) - direction[:, :, None] * direction[:, None, :])
    i, j = ends[:, 0], ends[:, 1]
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
    data = np.concatenate([block, block, -block, -block])
    r = (3 * rows[:, None, None] + np.arange(3)[None, :, None]).repeat(3, 2)
    c = (3 * columns[:, None, None] + np.arange(3)[None, None, :]).repeat(3, 1)
    k = sp.coo_matrix((data.ravel(), (r.ravel(), c.ravel())), shape=(3 * n, 3 * n)).tocsc()
    return k + sp.diags(np.repeat(mass / H**2, 3)).tocsc()


def main():
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    import tumble

    world = tumble.World(scene(), threads=THREADS)
    ends = world.topology["s"]["links"].astype(np.int64)
    mass = world.topology["s"]["mass"].astype(np.float64)
    world.step(6)
    x, v = (world.frame["s"][c].astype(np.float64) for c in ("position", "velocity"))

    # The same step again and again, from the same state.
    reports = []

    def step():
        world.write("s", "position", x)
        world.write("s", "velocity", v)
        reports.append(world.step())

    def only_write():
        world.write("s", "position", x)
        world.write("s", "velocity", v)

    seconds = median(step) - median(only_write)
    step()
    ours = world.frame["s"]["position"].astype(np.float64)

    flat = np.array([[i * 1.0 / (N - 1), j * 1.0 / (N - 1), 0.0] for j in range(N) for i in range(N)])
    rest = np.linalg.norm(flat[ends[:, 1]] - flat[ends[:, 0]], axis=1)
    stiffness = spring_constants(ends, rest)
    free = np.ones(3 * len(x), bool)
    free[world.topology["s"]["pinned"][:, None] * 3 + np.arange(3)] = False
    guess = x + H * v
    a = assemble(guess, ends, stiffness, rest, mass)[free][:, free]
    force = spring_forces(guess, ends, stiffness, rest) + mass[:, None] * np.array([0.0, 0.0, -9.8])
    b = force.ravel()[free]
    blocks = block_inverse(a)

    iterations = [0]

    def cg():
        iterations[0] = 0
        return spl.cg(a, b, rtol=TOLERANCE, M=blocks, callback=lambda _: iterations.__setitem__(0, iterations[0] + 1))[
            0
        ]

    solution = cg()
    theirs = guess.copy().ravel()
    theirs[free] += solution
    off = np.abs(theirs.reshape(-1, 3) - ours).max() / np.abs(solution).max()
    residual = np.linalg.norm(a @ solution - b) / np.linalg.norm(b)
    show(
        "implicit",
        "tumble",
        seconds,
        "s",
        f"{reports[-1]['linear']} iterations, whole step; differs from scipy by {off:.1e} of the correction",
    )
    show("implicit", "scipy cg", median(cg, 3), "s", f"{iterations[0]} iterations, solve only, residual {residual:.1e}")
    show("implicit", "scipy spsolve", median(lambda: spl.spsolve(a, b), 1), "s", "solve only")
    del sp


def spring_constants(ends, rest):
    """modulus x share / l0², as docs/theory/structures.md has it."""
    dx = 1.0 / (N - 1)
    i, j = ends % N, ends // N
    a, c = np.abs(i[:, 1] - i[:, 0]), np.abs(j[:, 1] - j[:, 0])
    rim = lambda index: np.where((index == 0) | (index == N - 1), 0.5, 1.0)  # noqa: E731
    share = np.full(len(ends), dx * dx)
    share = np.where(a == 0, share * rim(i[:, 0]), share)
    share = np.where(c == 0, share * rim(j[:, 0]), share)
    share = np.where((a == 1) & (c == 1), share * 0.5, share)
    modulus = np.where(a + c == 1, MODULUS, np.where((a == 1) & (c == 1), 2 * MODULUS, 4 * MODULUS))
    return modulus * share / rest**2


def spring_forces(x, ends, stiffness, rest):
    d = x[ends[:, 1]] - x[ends[:, 0]]
    length = np.linalg.norm(d, axis=1)
    f = (stiffness * (length - rest) / length)[:, None] * d
    total = np.zeros_like(x)
    np.add.at(total, ends[:, 0], f)
    np.subtract.at(total, ends[:, 1], f)
    return total


def block_inverse(a):
    """Block Jacobi, as a sparse matrix."""
    import scipy.sparse as sp

    n = a.shape[0] // 3
    diagonal = np.zeros((n, 3, 3))
    for r in range(3):
        for c in range(3):
            diagonal[:, r, c] = np.asarray(a[np.arange(n) * 3 + r, np.arange(n) * 3 + c]).ravel()
    inverse = np.linalg.inv(diagonal)
    return sp.bsr_matrix((inverse, np.arange(n), np.arange(n + 1)), shape=a.shape).tocsr()


main()
