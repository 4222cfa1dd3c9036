"""1,000 small runs of a scene by `tumble.sweep`, against the same runs in bare loops, one process for each worker.

    python benchmarks/sweeps.py [threads [runs [repeats]]]

The loops do what a run is (build the scene, step, measure) and nothing else; neither their start nor any checks, files or
tables count. A sweep is timed from its call to its tables, without plots. Beside the time stands that of the processors,
which depends less on what else the machine does.
"""

import resource
import subprocess
import sys
import tempfile
import time

import numpy as np
from common import THREADS, show

RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
REPEATS = int(sys.argv[3]) if len(sys.argv) > 3 else 3
SCENE = {
    "version": 1,
    "dimension": 2,
    "time": {"fps": 10, "frames": 200},
    "system": [{"method": "vicsek", "substeps": 4, "vicsek": {"side": 3.1, "radius": 1.0, "speed": 0.3, "noise": 1.0}}],
    "particles": [{"name": "p", "cloud": {"count": 40, "size": [3.1, 0, 3.1]}}],
}
NOISES = 10
MEASURE = "mean probe p.velocity[order]@100.."


def noise(k: int) -> float:
    return 0.5 * (1 + k // (RUNS // NOISES))


def loop(part: int) -> None:
    """Every THREADS-th run; prints the time that it took [s] and the mean of what was measured."""
    import tumble

    scene = tumble.Scene(SCENE)
    start = time.perf_counter()
    found = []
    for k in range(part, RUNS, THREADS):
        world = tumble.World(scene.replace(f"system.0.vicsek.noise={noise(k)}", f"seed={k % (RUNS // NOISES)}"))
        orders = []
        for _ in range(200):
            world.step()
            if world.frame_index >= 100:
                v = world.columns("velocity")["p"]["velocity"].astype(float)
                orders.append(np.linalg.norm((v / np.linalg.norm(v, axis=1)[:, None]).mean(axis=0)))
        found.append(np.mean(orders))
    print(time.perf_counter() - start, np.mean(found))


def bare() -> tuple[float, float]:
    """The longest of the loops [s], and the mean over all runs."""
    words = [sys.executable, __file__, str(THREADS), str(RUNS), "1", "--part"]
    processes = [
        subprocess.Popen([*words, str(part)], stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
        for part in range(THREADS)
    ]
    said = [list(map(float, process.communicate()[0].split())) for process in processes]
    return max(seconds for seconds, _ in said), float(np.mean([mean for _, mean in said]))


def processors() -> float:
    """Time that this process and its children that ended have spent on processors [s]."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def swept(on: str) -> tuple[float, float]:
    import tumble

    design = {"system.0.vicsek.noise": [0.5 * (1 + k) for k in range(NOISES)]}
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        found = tumble.sweep(
            SCENE, design, MEASURE, f"{folder}/sweep", seeds=RUNS // NOISES, on=on, workers=THREADS, plots=False
        )
        seconds = time.perf_counter() - start
        assert len(found) == RUNS and not found.failed
        return seconds, float(found.column(MEASURE).mean())


if __name__ == "__main__":
    import os

    ENVIRONMENT = {**os.environ, "RAYON_NUM_THREADS": "1"}
    if "--part" in sys.argv:
        loop(int(sys.argv[-1]))
    else:
        tried = {who: [] for who in ("loops", "cores", "dask")}
        try:
            import distributed  # noqa: F401
        except ImportError:
            del tried["dask"]
        # One after another, so that each meets the same load of the machine.
        for _ in range(REPEATS):
            for who, times in tried.items():
                before = processors()
                seconds, mean = bare() if who == "loops" else swept(who)
                times.append((seconds, processors() - before, mean))
        found = {who: np.median(np.array(times), axis=0) for who, times in tried.items()}
        for on in [who for who in tried if who != "loops"]:
            for who, name in ((on, "tumble"), ("loops", "bare loops")):
                seconds, busy, mean = found[who].tolist()
                show(f"{RUNS} runs, {on}", name, seconds, "s", f"mean order {mean:.6f}, {busy:.1f} s of processors")
