"""Pyramids of 1,015 and 4,900 cubes that stand: time of 1/60 s, against Rapier driven directly.

No cube sleeps. tumble takes its own sub-steps and passes, and in a second case as many as the defaults of Rapier: four
sub-steps, of two passes. The check is how far any cube has moved after two seconds: a pyramid that sinks or creeps is no
pile."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from common import THREADS, median, show

HERE = Path(__file__).parent
EDGE, FRICTION = 0.2, 0.6
FRAME = 1 / 60
SETTLE, STEPS = 100, 20
LAYERS = {1015: 14, 4900: 24}
EFFORTS = {"": {}, ", 4 x 2 passes": {"substeps": 4, "rigid": {"iterations": 2}}}


def pyramid(layers):
    """Each cube on four others, with gaps of a quarter of an edge."""
    pitch = 1.25 * EDGE
    places = []
    for k in range(layers):
        n = layers - k
        at = (np.arange(n) - 0.5 * (n - 1)) * pitch
        x, y = np.meshgrid(at, at)
        places.append(np.stack([x.ravel(), y.ravel(), np.full(n * n, (k + 0.5) * EDGE)], axis=1))
    return np.concatenate(places)


def bench_tumble(x, effort):
    import tumble

    world = tumble.World(
        {
            "version": 1,
            "time": {"fps": 1 / FRAME},
            "world": {"gravity": [0, 0, -9.81]},
            "system": [{"method": "rigid", **effort}],
            "body": [
                {"name": "cube", "shape": {"box": {"size": [EDGE] * 3}}, "position": x.tolist(), "friction": FRICTION}
            ],
            "collider": [{"name": "floor", "shape": {"floor": {"height": 0.0}}, "friction": FRICTION}],
        },
        threads=THREADS,
    )
    world.step(SETTLE)
    seconds = median(lambda: world.step(), STEPS - 1)
    after = world.columns("position")["cube"]["position"].astype(float)
    return seconds, np.linalg.norm(after - x, axis=1).max()


def bench_rapier(x):
    command = ["cargo", "run", "--release", "--quiet", "--manifest-path", HERE / "rapier" / "Cargo.toml"]
    command += ["--target-dir", HERE.parent / ".venv-bench" / "rapier", "--"]
    command += map(str, (THREADS, FRAME, SETTLE, STEPS, EDGE, FRICTION))
    text = "\n".join(" ".join(map(str, place)) for place in x)
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    seconds, moved = map(float, done.stdout.split())
    return seconds, moved


def main():
    for n, layers in LAYERS.items():
        x = pyramid(layers)
        results = {"tumble": {effort: bench_tumble(x, words) for effort, words in EFFORTS.items()}}
        if shutil.which("cargo") is None:
            print("rapier left out", file=sys.stderr)
        else:
            results["rapier"] = dict.fromkeys(EFFORTS, bench_rapier(x))
        for effort in EFFORTS:
            for who, result in results.items():
                seconds, moved = result[effort]
                show(f"pile of {n}{effort}", who, seconds, "s", f"cubes moved by up to {1000 * moved:.1f} mm")


main()
