"""Emission and removal of 1 % of 4 million particles a frame, against the same frame without them; and how much memory a steady
fountain of two million particles takes, and whether it grows: python emission.py THREADS [FRAMES]."""

import sys
from pathlib import Path

import numpy as np
from common import THREADS, median, show

N = 4_000_000
FPS = 24
LIFE = 100 / FPS


def resident():
    """Memory of this process that is in use [B]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def world(count, emitter):
    import tumble

    source = {
        "name": "p",
        "from": {"sphere": {"radius": 1.0}},
        "speed": 3.0,
        "cone": 20.0,
        "speed_spread": 0.3,
        "jitter": 1.0,
        "most": int(1.05 * count),
    }
    scene = {
        "version": 1,
        "time": {"fps": FPS, "frames": 1_000_000},
        "world": {"memory_limit": 64},
        "system": [{"integrator": "symplectic_euler", "substeps": 1}],
        "force": [{"kind": "drag", "rate": 0.5}],
        "emitter": [source | emitter],
    }
    return tumble.World(scene, threads=THREADS)


def main():
    # Memory of any world: threads and code.
    small = world(1000, {"burst": [{"count": 1000}]})
    small.step(2)
    before = resident()
    fountain = world(N // 2, {"rate": N / 2 / LIFE, "lifetime": LIFE, "lifetime_spread": 0.2})
    fountain.step(150)
    early = resident() - before
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 300
    fountain.step(frames)
    late = resident() - before
    check = f"{early / N * 2:.1f} B a particle after 150 frames, {late / N * 2:.1f} after {150 + frames}"
    show("fountain, memory", "tumble", late / N * 2, "B", check)
    del fountain
    show("fountain, memory", "80 bytes", 80.0, "B", "what is aimed at")
    still = world(N, {"burst": [{"count": N}]})
    without = median(lambda world=still: world.step(1), repeats=9)
    del still
    steady = world(N, {"rate": N / LIFE, "lifetime": LIFE, "lifetime_spread": 0.2})
    steady.step(125)
    ids = steady.frame["p"]["id"]
    assert len(np.unique(ids)) == len(ids) and abs(len(ids) / N - 1) < 0.02
    both = median(lambda world=steady: world.step(1), repeats=9)
    check = f"{len(ids)} live, {N // 100} born and {N // 100} dead a frame"
    show("emission", "tumble", both - without, "s", check)
    show("emission", "update", without, "s", "the frame without births and deaths")


main()
