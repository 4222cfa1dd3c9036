"""Balls and sheets that a gas moves, in the engine's own precision: the same bits, and what is refused."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import SceneError, World

Tree = dict[str, Any]

TANK: Tree = {
    "version": 1,
    "time": {"fps": 24, "frames": 4, "exchanges": 2},
    "gas": [
        {
            "name": "water",
            "box": {"size": [1, 1, 1], "center": [0, 0, 0], "resolution": 20},
            "fluid_density": 1000,
            "bodies": ["balls"],
            "sheet": [{"object": "cloth"}],
        }
    ],
    "particles": [
        {"name": "balls", "position": [[-0.2, 0, 0], [0.2, 0.1, 0]], "mass": [0.5, 30], "radius": 0.12},
    ],
    "sheet": [
        {
            "name": "cloth",
            "size": [0.4, 0.4],
            "resolution": [9, 9],
            "center": [0, 0, -0.3],
            "density": 3,
            "pin": ["edge x-"],
        }
    ],
    "output": {"plot": False, "columns": ["position", "velocity", "force"]},
}


def test_a_tank_has_the_same_bits_on_any_threads_and_restored(tmp_path: Path) -> None:
    world = World(TANK, threads=1)
    world.step(2)
    world.save(tmp_path / "half.ckpt")
    world.step(2)
    other = World(TANK, threads=2)
    other.step(4)
    back = World.restore(tmp_path / "half.ckpt", threads=2)
    back.step(2)
    assert world.hash() == other.hash() == back.hash()
    # The light one rises and the heavy one sinks; of the force on each there is a row.
    frame = world.frame["balls"]
    assert frame["velocity"][0, 2] > 0.3 and frame["velocity"][1, 2] < -0.3
    assert frame["force"].shape == (2, 3)
    assert np.isfinite(world.frame["cloth"]["position"]).all()


def test_balls_without_walls_are_told_of() -> None:
    tank = {"name": "tank", "inside": True, "shape": {"box": {"center": [0, 0, 0], "size": [1, 1, 1]}}}
    told = World(TANK).warnings
    assert any("no obstacle to bodies" in warning["message"] for warning in told), told
    assert not any("obstacle" in warning["message"] for warning in World(TANK | {"collider": [tank]}).warnings)


@pytest.mark.parametrize("ratio", [1e-2, 1e-4, 1e-6])
def test_no_ball_is_too_light(ratio: float) -> None:
    radius = 0.12
    scene: Tree = {
        "version": 1,
        "time": {"fps": 100, "frames": 5},
        "gas": [
            {"name": "water", "box": {"size": [1, 1, 1], "resolution": 32}, "fluid_density": 1000, "bodies": ["b"]}
        ],
        "particles": [
            {
                "name": "b",
                "position": [[0.01, 0.02, 0]],
                "mass": [ratio * 4000 / 3 * np.pi * radius**3],
                "radius": radius,
            }
        ],
        "output": {"columns": ["velocity"]},
    }
    world = World(scene)
    assert world.step(5)["unconverged"] == 0
    # In the open a ball without mass starts with 2 g; the walls hold it back a little, the cells of its surface push it: 0.950,
    # 0.977, 0.993 m/s.
    v = world.frame["b"]["velocity"][0]
    assert v[2] == pytest.approx(2 * 9.8 * 0.05, rel=0.05) and abs(v[0]) + abs(v[1]) < 0.05


@pytest.mark.parametrize(
    ("change", "place", "message"),
    [
        ({"bodies": ["ballz"]}, 'gas "water".bodies[0]', 'no object "ballz"; did you mean "balls"'),
        ({"bodies": ["cloth"], "sheet": []}, 'gas "water".bodies[0]', "no object of [[body]], nor of [[particles]]"),
        ({"bodies": ["water"]}, 'gas "water".bodies[0]', "a fluid moves masses of dynamics"),
        (
            {"box": {"size": [1, 1, 1], "resolution": 10}},
            'gas "water".bodies',
            "radius of 0.12 m, expected >= 1.5 cells",
        ),
        ({"pressure": {"method": "sor"}}, 'gas "water".pressure.method', "expected a method of gradients"),
        (
            {"bodies": [], "sheet": [{"object": "balls"}]},
            'gas "water".sheet[0].object',
            "has no triangles and is no curve",
        ),
        ({"bodies": ["balls", "balls"]}, 'gas "water".bodies[1]', '"balls" is named more than once'),
        ({"densities": "variable"}, 'gas "water".densities', "sheets know one density alone"),
        ({"sheet": [{"object": "cloth", "resistance": -1}]}, 'gas "water".sheet[0].resistance', "expected >= 0"),
    ],
)
def test_what_a_gas_cannot_move_is_told(change: Tree, place: str, message: str) -> None:
    scene = copy.deepcopy(TANK)
    scene["gas"][0].update(change)
    with pytest.raises(SceneError) as caught:
        World(scene)
    assert place in str(caught.value) and message in str(caught.value)


def test_rigid_bodies_in_a_gas_are_no_smaller_than_its_cells_and_come_after_it() -> None:
    scene: Tree = {
        "version": 1,
        "gas": [{"name": "air", "box": {"size": [1, 1, 1], "resolution": 20}, "bodies": ["plate"]}],
        "body": [{"name": "plate", "shape": {"box": {"size": [0.1, 0.1, 0.01]}}, "position": [[0, 0, 0]]}],
    }
    with pytest.raises(
        SceneError, match=r'body of "plate" has a radius of 0.0709.* m, expected >= 1.5 cells = 0.075 m'
    ):
        World(scene)
    scene["body"][0]["shape"]["box"]["size"] = [0.3, 0.3, 0.01]
    assert not any(warning["code"] == "unfelt" for warning in World(scene).warnings)
    systems = [{"name": "solid", "method": "rigid"}, {"name": "wet", "method": "gas"}]
    with pytest.raises(SceneError, match='put \\[\\[system\\]\\] "wet" first'):
        World({**scene, "system": systems})


def test_what_a_gas_moves_comes_after_it() -> None:
    systems = [{"name": "soft"}, {"name": "wet", "method": "gas"}]
    with pytest.raises(SceneError, match='put \\[\\[system\\]\\] "wet" first'):
        World({**TANK, "system": systems})
    World({**TANK, "system": systems[::-1]})


def test_a_frame_says_where_moving_colliders_are_whatever_it_is_asked_for() -> None:
    scene = copy.deepcopy(TANK)
    scene["collider"] = [
        {
            "name": "paddle",
            "shape": {"sphere": {"center": [0, 0, 0.3], "radius": 0.1}},
            "motion": {"velocity": [1, 0, 0]},
        }
    ]
    scene["output"]["columns"] = ["pressure"]
    world = World(scene)
    world.step()
    assert world.frame["paddle"]["translation"].ravel() == pytest.approx([1 / 24, 0, 0])
