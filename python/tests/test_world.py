"""Looks inside a frame."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Scene, SceneError, StepError, World

Tree = dict[str, Any]

TWO: Tree = {
    "version": 1,
    "time": {"fps": 10},
    "system": [{"name": "fine", "substeps": 4}, {"name": "coarse", "substeps": 2}],
    "particles": [
        {"name": "a", "system": "fine", "position": [[0, 0, 0]]},
        {"name": "b", "system": "coarse", "position": [[0, 0, 0]]},
    ],
}


def test_systems_go_one_after_the_other_and_the_world_stays_where_it_is() -> None:
    world = World(TWO)
    start = world.hash()
    heights = []
    for n in range(1, 6):
        columns, about = world.inside(n, "position") or pytest.fail(f"no sub-step {n}")
        assert about["system"] == ("fine" if n <= 4 else "coarse")
        assert about["step"] == pytest.approx(0.1 / (4 if n <= 4 else 2))
        assert about["time"] == pytest.approx(0.025 * n if n <= 4 else 0.05)
        assert about["ledger"]["mass"] == 2
        heights.append([columns[name]["position"][0, 2] for name in "ab"])
    assert np.all(np.diff(np.array(heights)[:4, 0]) < 0)
    assert [height[1] < 0 for height in heights] == [False] * 4 + [True]
    # The sixth makes the frame whole: that is a step.
    assert world.inside(6, "position") is None
    assert (world.hash(), world.frame_index) == (start, 0)
    world.step()
    assert world.columns("position")["a"]["position"][0, 2] == heights[3][0]


def test_what_breaks_inside_a_frame_is_told() -> None:
    rope = {
        "name": "rope",
        "from": [0, 0, 0],
        "to": [1, 0, 0],
        "segments": 8,
        "links": {"structural": 1e5},
        "pin": ["start"],
    }
    world = World({"version": 1, "system": [{"integrator": "forward_euler", "substeps": 30}], "rope": [rope]})
    with pytest.raises(StepError):
        for n in range(1, 30):
            world.inside(n)
    with pytest.raises(SceneError, match="expected a whole number >= 1"):
        world.inside(0)


@pytest.mark.parametrize("scheme", ["implicit_euler", "implicit_midpoint", "bdf2"])
def test_what_breaks_leaves_nothing_behind(scheme: str, tmp_path: Path) -> None:
    """Numbers that overflow in a solve are gone with the state that held them."""
    rope: Tree = {"name": "rope", "from": [0, 0, 1], "to": [1, 0, 1], "segments": 8, "pin": ["start"]}
    rope["links"] = {"structural": {"modulus": 1000.0}}
    system = [{"integrator": scheme, "substeps": 2}]
    world = World({"version": 1, "system": system, "rope": [rope]}, threads=1)
    world.step(2)
    world.save(tmp_path / "state.safetensors")
    world.step()
    after, broke = world.hash(), 0
    for far in 10.0 ** np.arange(6, 31, 2):
        world.load(tmp_path / "state.safetensors")
        position = np.array(world.frame["rope"]["position"])
        position[3, 1] = far
        world.write("rope", "position", position)
        try:
            world.step()
        except StepError:
            broke += 1
        world.load(tmp_path / "state.safetensors")
        world.step()
        assert world.hash() == after, f"after {far:.0e} m"
    assert broke > 1


def test_an_explosion_can_be_watched() -> None:
    """A stiff spring in steps far too long: an error by default; without it the masses fly apart, and further in each frame."""
    tree = {
        "version": 1,
        "time": {"frames": 40},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "symplectic_euler", "substeps": 1}],
        "particles": [
            {
                "name": "p",
                "position": [[0, 0, 0], [1.1, 0, 0]],
                "mass": [1],
                "spring": [{"between": [0, 1], "stiffness": 2000, "rest_length": 1}],
            }
        ],
    }
    with pytest.raises(StepError, match="exploded"):
        World(Scene(tree)).step(12)
    world = World(Scene(tree))
    assert world.stop_on_explosion
    world.stop_on_explosion = False
    reach = []
    for _ in range(12):
        world.step()
        reach.append(float(np.abs(world.frame["p"]["position"]).max()))
    assert reach[-1] > 1e3
    assert all(b > a for a, b in itertools.pairwise(reach[4:]))
    # What is no number any more is an error all the same.
    with pytest.raises(StepError, match="finite"):
        world.step(1000)


def test_the_stable_step_that_is_told_is_that_of_the_state_that_broke() -> None:
    """Two masses that fall onto each other: far apart, long steps would do; where they meet, the step is too long."""
    tree = {
        "version": 1,
        "precision": "double",
        "time": {"frames": 60},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "velocity_verlet", "substeps": 133}],
        "particles": [
            {"name": "p", "position": [[-1, 0, 0], [1, 0, 0]], "velocity": [[0, -0.01, 0], [0, 0.01, 0]], "mass": [1]}
        ],
        "force": [{"kind": "gravitation", "constant": 1}],
    }
    with pytest.raises(StepError) as raised:
        World(Scene(tree)).step(60)
    step, stable = (
        float(re.search(p, str(raised.value))[1])
        for p in (r"step ([\d.e+-]+) s", r"stable step by estimate: ([\d.e+-]+) s")
    )  # type: ignore[index]
    assert step == pytest.approx(1 / 24 / 133, rel=1e-3)
    assert stable < step
