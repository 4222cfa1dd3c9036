"""The browser's engine in headless Chromium, whose registers have 128 bits, against the native one held to 256 bits, on one
thread; and what a tab can do in real time. Needs `make web` and Chromium."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from common import THREADS, show

ROOT = Path(__file__).parent.parent
REPEATS = 7

SWIRL = "sin(pi*x)*cos(pi*z)", "0", "-cos(pi*x)*sin(pi*z)"


def gas(resolution: int, rate: float, **words) -> dict:
    """Smoke in a swirl in a closed square of one metre."""
    return {
        "version": 1,
        "dimension": 2,
        "time": {"fps": rate},
        "system": [{"name": "gas", "method": "gas", "substeps": 1}],
        "gas": [
            {
                "name": "air",
                "box": {"size": [1, 1, 1], "center": [0.5, 0, 0.5], "resolution": resolution},
                "velocity": list(SWIRL),
                "smoke": {"initial": "smoothstep(0.2, 0.1, hypot(x - 0.5, z - 0.3))"},
                **words,
            }
        ],
    }


def sheet(resolution: int, substeps: int, rate: float, softer: float = 1.0) -> dict:
    """A sheet with structural, shear and bend links that hangs from two corners."""
    families = {"structural": 100.0, "shear": 50.0, "bend": 5.0}
    return {
        "version": 1,
        "time": {"fps": rate},
        "system": [{"integrator": "symplectic_euler", "substeps": substeps}],
        "sheet": [
            {
                "name": "s",
                "size": [1.0, 1.0],
                "resolution": [resolution, resolution],
                "pin": ["corner 0 0", "corner 1 0"],
                "links": {name: {"modulus": k / softer, "damping": 0.001 / softer} for name, k in families.items()},
            }
        ],
    }


BALLISTIC = {
    "version": 1,
    "time": {"fps": 60},
    "system": [{"integrator": "symplectic_euler", "substeps": 1}],
    "particles": [{"name": "p", "cloud": {"shape": "box", "count": 1_000_000, "size": [1, 1, 1]}}],
}

FIXED = {"tolerance": 1e-30, "on_failure": "warn"}
KERNELS = {
    "springs": sheet(256, 16, 1 / (16 * 1e-4)),
    "pressure": gas(256, 240, pressure={"method": "multigrid_gradients", "iterations": 20, **FIXED}),
    "advection": gas(
        512,
        240,
        pressure={"method": "jacobi", "iterations": 1, **FIXED},
        advection={"velocity": {"corrected": True}, "scalars": {"corrected": True}},
    ),
}
"""Scenes for comparing the browser's engine: nearly all of a frame is one kind of kernel."""
TASKS = {
    "fluid 256² to 1e-3": (gas(256, 60, pressure={"tolerance": 1e-3}), 60),
    "sheet 128², 10 sub-steps": (sheet(128, 10, 60, 50), 60),
    "1e6 ballistic particles": (BALLISTIC, 60),
}
"""Real-time targets of a tab: a scene, and frames per second."""


def native() -> dict[str, float]:
    """Seconds a frame, by name: the fastest of some, as there is no other thread to wait for."""
    import tumble

    seconds = {}
    for name, scene in KERNELS.items():
        world = tumble.World(tumble.Scene(scene), threads=1)
        world.step(2)
        times = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            world.step(2)
            times.append((time.perf_counter() - start) / 2)
        seconds[name] = min(times)
    return seconds


def node(script: str, words: str = "") -> Any:
    """What a script of the browser's tests prints, as JSON."""
    command = ["node", "--import", "tsx", f"tests/{script}.ts", str(REPEATS)]
    done = subprocess.run(command, cwd=ROOT / "web", input=words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    return json.loads(done.stdout)


def browser(scenes: dict[str, dict]) -> dict[str, float]:
    """The same in Chromium."""
    return node("bench", json.dumps({name: json.dumps(scene) for name, scene in scenes.items()}))


def main() -> None:
    if THREADS != 1:
        return
    if not (ROOT / "web" / "src" / "engine" / "pkg" / "single.js").exists():
        raise SystemExit("make web comes first")
    environment = {**os.environ, "TUMBLE_REGISTERS": "256", "RAYON_NUM_THREADS": "1"}
    rounds = []
    for _ in range(3):
        command = [sys.executable, __file__, "1", "native"]
        ours = json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
        rounds.append((ours, browser(KERNELS)))
    for name in KERNELS:
        here, there = (min(both[i][name] for both in rounds) for i in (1, 0))
        show(f"web {name}", "tumble in Chromium", here, "s", "a frame")
        show(f"web {name}", "native, 256 bits", there, "s", "a frame")
    tasks = browser({name: scene for name, (scene, _) in TASKS.items()})
    for name, (_, rate) in TASKS.items():
        show(f"web {name}", "tumble in Chromium", tasks[name], "s", f"{1 / tasks[name]:.0f} frames/s")
        show(f"web {name}", "real time", 1 / rate, "s", f"{rate} frames/s")
    show("web first picture", "tumble in Chromium", node("first") / 1000, "s", "nothing in the cache")
    show("web first picture", "what a visitor waits for", 3.0, "s", "aim")


if sys.argv[2:] == ["native"]:
    print(json.dumps(native()))
else:
    main()
