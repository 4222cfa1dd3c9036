"""A dam of 94,080 particles that breaks in a tank of 6 m: simulated seconds in a second.

SPlisHSPlasH runs divergence-free and position-based particles of the same distance in the same tank, to a mean excess of the
density of 0.1 %, in steps by its own Courant number. A liquid on a grid has as many particles, eight to a cell. The check
compares how far the water has come, and its middle of mass."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import THREADS, show

SPACING = 0.05
TANK = (6.0, 1.5, 4.0)
"""Along x, across, and up [m]."""
COLUMN = (2.8, 1.5, 2.8)
SECONDS = 0.5
FPS = 50
ERROR = 0.1
"""Mean excess of the density where the solves of SPlisHSPlasH end [%]."""


def world(method, words):
    import tumble

    half = [0.5 * c for c in COLUMN]
    scene = {"version": 1, "time": {"fps": FPS}, "world": {"gravity": [0, 0, -9.81]}, "system": [{"method": method}]}
    if method == "liquid":
        shape = {"box": {"center": half, "size": list(COLUMN)}}
        box = {"size": list(TANK), "center": [0.5 * c for c in TANK], "resolution": round(TANK[0] / SPACING / 2)}
        scene["liquid"] = [{"name": "water", "box": box, "fill": [{"shape": shape}], "surface": False} | words]
    else:
        fluid = {"spacing": SPACING, "fill": [{"center": half, "size": list(COLUMN)}]}
        scene["particles"] = [{"name": "water", "radius": 0.5 * SPACING, "fluid": fluid}]
        shape = {"box": {"center": [0.5 * c for c in TANK], "size": list(TANK)}}
        scene["collider"] = [
            {"name": "tank", "inside": True, "friction": 0.0, "thickness": 0.5 * SPACING, "shape": shape}
        ]
        scene["system"][0].update(words)
    return tumble.World(scene, threads=THREADS)


def bench_tumble(method, words):
    run = world(method, words)
    start = time.perf_counter()
    for _ in range(round(SECONDS * FPS)):
        run.step()
    seconds = time.perf_counter() - start
    x = run.columns("position")["water"]["position"].astype(float)
    return SECONDS / seconds, len(x), x[:, 0].max(), x[:, 2].mean()


PEER = """
import json, sys, time
import pysplishsplash as sph
base = sph.Exec.SimulatorBase()
base.init(sceneFile=sys.argv[1], useGui=False, initialPause=False, outputDir=sys.argv[2])
base.initSimulation()
base.setValueFloat(base.STOP_AT, float(sys.argv[3]))
start = time.perf_counter()
base.runSimulation()
seconds = time.perf_counter() - start
water = sph.Simulation.getCurrent().getFluidModel(0)
x = [water.getPosition(i) for i in range(water.numActiveParticles())]
print("figures", json.dumps([sph.TimeManager.getCurrent().getTime(), seconds, [list(map(float, p)) for p in x]]))
"""
CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACES = "124 143 578 586 156 162 348 387 137 175 268 284"
METHODS = {"splishsplash dfsph": 4, "splishsplash position-based": 3}


def bench_splishsplash(method):
    """y is up there, and its middle is that of the tank."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {' '.join(face)}" for face in FACES.split()]
        (folder / "box.obj").write_text("\n".join(lines) + "\n")
        along, across, up = TANK
        radius = 0.5 * SPACING
        # A block keeps a diameter from its sides: 81,648 particles, which is to the advantage of the peer.
        block = {
            "denseMode": 0,
            "start": [-0.5 * along + radius, radius, -0.5 * across + radius],
            "end": [-0.5 * along + COLUMN[0] - radius, COLUMN[2] - radius, 0.5 * across - radius],
        }
        tank = {
            "geometryFile": str(folder / "box.obj"), "translation": [0, 0.5 * up, 0], "rotationAxis": [1, 0, 0],
            "rotationAngle": 0, "scale": [along, up, across], "isDynamic": False, "isWall": True,
        }  # fmt: skip
        words = {
            "particleRadius": radius, "density0": 1000, "simulationMethod": method, "gravitation": [0, -9.81, 0],
            "timeStepSize": 0.001, "cflMethod": 1, "cflFactor": 1, "cflMaxTimeStepSize": 0.005, "maxError": ERROR,
            "maxErrorV": ERROR, "enableDivergenceSolver": True, "boundaryHandlingMethod": 0,
        }  # fmt: skip
        path = folder / "dam.json"
        path.write_text(json.dumps({"Configuration": words, "RigidBodies": [tank], "FluidBlocks": [block]}))
        command = [sys.executable, "-c", PEER, path, folder / "out", str(SECONDS)]
        # Where the library of OpenGL is not loaded first, importing it may crash.
        library = Path("/lib/x86_64-linux-gnu/libGLdispatch.so.0")
        environment = dict(os.environ) | ({"LD_PRELOAD": str(library)} if library.exists() else {})
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        line = next((line for line in done.stdout.splitlines() if line.startswith("figures")), None)
        if line is None:
            return None
        simulated, seconds, places = json.loads(line.removeprefix("figures"))
    x = np.array(places)
    return simulated / seconds, len(x), x[:, 0].max() + 0.5 * along, x[:, 1].mean()


def check(count, front, middle):
    return f"{count} particles, front at {front:.2f} m, middle of mass at {middle:.3f} m"


def main():
    runs = {
        "dam on a grid": ("tumble, apic", lambda: bench_tumble("liquid", {})),
        "dam by positions": ("tumble, position-based", lambda: bench_tumble("position_based", {"substeps": 8})),
    }
    peers = {who: bench_splishsplash(method) for who, method in METHODS.items()}
    for who in [who for who, found in peers.items() if found is None]:
        print(f"{who} left out", file=sys.stderr)
    for case, (who, work) in runs.items():
        rate, *figures = work()
        show(case, who, rate, "s/s", check(*figures))
        for peer, found in peers.items():
            if found is not None:
                show(case, peer, found[0], "s/s", check(*found[1:]))


main()
