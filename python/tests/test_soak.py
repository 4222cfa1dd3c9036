"""A hundred thousand frames of a mixed scene: memory stays where it was, and so do the work and the time of a frame.

Time is that of the processor, and bounds the longest run alone: short ones are as noisy as the machine.
"""

import gc
import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from counts import note
from needs import missing
from nursery import status
from runs import Tree

from tumble import Scene, World
from tumble.run import simulate

MIXED: Tree = {
    "version": 1,
    "time": {"fps": 24, "frames": 100_000},
    "system": [
        {"name": "spray", "integrator": "symplectic_euler", "substeps": 2},
        {"name": "soft", "method": "position_based", "substeps": 4, "self_contact": {"thickness": 0.02}},
        {"name": "stiff", "integrator": "implicit_euler", "substeps": 2},
        {"name": "warmth", "method": "heat"},
        {"name": "air", "method": "gas"},
    ],
    "emitter": [
        {
            "name": "spray",
            "system": "spray",
            "rate": 400,
            "jitter": 1,
            "speed": 2,
            "cone": 30,
            "lifetime": 0.5,
            "lifetime_spread": 0.5,
            "from": {"disk": {"center": [2, 0, 0], "radius": 0.1}},
            "kill": [{"outside": {"box": {"center": [2, 0, 0], "size": [1, 1, 1]}}}],
        }
    ],
    "sheet": [
        {
            "name": "flag",
            "system": "soft",
            "size": [1, 1],
            "resolution": [8, 8],
            "center": [0, 0, 0.4],
            "pin": ["corner 0 0"],
        }
    ],
    "rope": [
        {"name": "rope", "system": "soft", "from": [0, 1, 1], "to": [0.6, 1, 1], "segments": 12, "pin": ["start"]},
        {
            "name": "rod",
            "system": "stiff",
            "from": [0, 2, 1],
            "to": [0.5, 2, 1],
            "segments": 8,
            "density": 0.1,
            "radius": 0.012,
            "rod": {"stretch": 5000, "bend": 0.2, "damping": 0.02},
            "pin": ["start"],
        },
    ],
    "gas": [
        {
            "name": "smoke",
            "system": "air",
            "box": {"center": [-2, 0, 0], "size": [1, 1, 1], "resolution": 8},
            "smoke": {"weight": 1, "dissipation": 0.5},
            "source": [{"shape": {"sphere": {"center": [-2, 0, -0.3], "radius": 0.2}}, "density": 1}],
        }
    ],
    "heat": [
        {
            "name": "plate",
            "system": "warmth",
            "box": {"size": [1, 1, 1], "resolution": 8},
            "temperature": 300,
            "conductivity": 1,
            "density": 1000,
            "heat_capacity": 1000,
        }
    ],
    # A wind that turns, so that nothing comes to rest.
    "force": [
        {"kind": "wind", "rate": 1, "air": [{"kind": "formula", "velocity": "[2*sin(t), 2*cos(0.7*t), 0]"}]},
    ],
    "collider": [{"name": "ball", "shape": {"sphere": {"radius": 0.3}}}],
    "output": {"plot": False},
}


@dataclass
class Soak:
    """Cost of a run, by tenths: memory at their end [bytes], time of the processor [s], sub-steps a frame, most particles of
    the spray."""

    memory: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    works: list[float] = field(default_factory=list)
    masses: list[int] = field(default_factory=list)

    def tenth(self, begin: float, steps: float, most: int) -> None:
        self.seconds.append(time.process_time() - begin)
        gc.collect()
        self.memory.append(status("VmRSS:"))
        self.works.append(steps)
        self.masses.append(most)


def measure(frames: int, keep: bool, slower: bool) -> Soak:
    world, soak, kept = World(Scene(MIXED), threads=1), Soak(), []
    if slower:
        world.add_force(delay, system="spray")
    tenth = frames // 10
    for _ in range(10):
        begin, steps, most = time.process_time(), 0, 0
        for _ in range(tenth):
            steps += world.step()["steps"]
            frame = world.frame
            most = max(most, len(frame["spray"]["position"]))
            if keep:
                kept.append(frame)
        soak.tenth(begin, steps / tenth, most)
        assert len(world.hash()) == 16
    return soak


def delay(t: float, x: np.ndarray, *_: object) -> np.ndarray:
    """A force that does nothing, and takes 10 us more in each frame."""
    end = time.process_time() + 1e-5 * 24 * t
    while time.process_time() < end:
        pass
    return np.zeros_like(x)


def measure_run(frames: int) -> Soak:
    """The same through the files of a run: a frame each, books, checkpoints, the manifest."""
    soak, begin, tenth = Soak(), time.process_time(), frames // 10
    with tempfile.TemporaryDirectory() as folder:
        place, last = Path(folder) / "run", 0

        def progress(done: int, _: int) -> None:
            nonlocal begin, last
            if done and done % tenth == 0 and done > last:
                last = done
                soak.tenth(begin, 0, 0)
                begin = time.process_time()
            # Frames that were written are of no more use here, and 100 MB.
            if done > 2 * tenth:
                (place / f"frames/{done - 2 * tenth:06}.npz").unlink(missing_ok=True)

        simulate(MIXED, place, frames=frames, threads=1, progress=progress)
    return soak


def soak(work: Callable[..., Soak], frames: int, *arguments: object, timed: bool = False) -> None:
    # In a process of its own, where nothing that others have freed is taken again.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        took = pool.submit(work, frames, *arguments).result()
    if not took.memory[-1]:
        missing("this system does not tell how much memory is taken")
    grown = (took.memory[-1] - took.memory[0]) / 2**20
    each = [round(10_000 * s / frames, 2) for s in took.seconds]
    print(
        f"\nsoak: {frames} frames, {sum(took.seconds):.0f} s, {statistics.median(took.works):.2f} sub-steps a frame;"
        f" by tenths: memory {[round(m / 2**20, 1) for m in took.memory]} MiB, {each} ms a frame,"
        f" at most {took.masses} particles"
    )
    pace = {"ms a frame at first": each[1], "at last": each[-1]}
    note("soak", work.__name__.replace("_", " "), cases=frames, growth=f"{grown:.1f} MiB", **pace)
    # Freed memory may be reused in other pieces, and a run keeps the hash of each frame: measured, 0.1 and 0.7 MiB.
    assert grown < 4, f"{grown:.1f} MiB more after the last tenth than after the first"
    assert took.works[1:] == [took.works[1]] * 9
    # Through the files of a run nobody looks at them.
    assert work is not measure or max(took.masses) < 1.2 * took.masses[0]
    if timed:
        # After the first, in which things fall and caches fill. Measured: 0.98, on a busy machine.
        ratio = took.seconds[-1] / statistics.median(took.seconds[1:4])
        assert ratio < 1.5, f"frames of the last tenth take {ratio:.2f} times as long as those of the first"


def test_two_thousand_frames_take_no_more_and_more() -> None:
    soak(measure, 2000, False, False)


@pytest.mark.long
def test_a_hundred_thousand_frames_take_no_more_and_more() -> None:
    soak(measure, 100_000, False, False, timed=True)


def test_a_run_of_many_frames_takes_no_more_and_more() -> None:
    soak(measure_run, 400)


@pytest.mark.long
def test_a_run_of_five_thousand_frames_takes_no_more_and_more() -> None:
    soak(measure_run, 5000)


def test_what_is_kept_would_be_noticed() -> None:
    with pytest.raises(AssertionError, match="MiB more after the last tenth"):
        soak(measure, 2000, True, False)


def test_frames_that_take_longer_and_longer_would_be_noticed() -> None:
    with pytest.raises(AssertionError, match="frames of the last tenth take"):
        soak(measure, 300, False, True, timed=True)
