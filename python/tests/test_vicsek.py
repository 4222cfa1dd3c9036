"""The model of Vicsek in a scene: the order that was published, and a state that can be saved."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Scene, SceneError, World

Tree = dict[str, Any]


def crowd(noise: float, seed: int, frames: int, **vicsek: Any) -> Tree:
    """40 points in a square of 3.1 m; a frame is five steps of 0.03 m."""
    return {
        "version": 1,
        "seed": seed,
        "dimension": 2,
        "time": {"fps": 1, "frames": frames},
        "system": [
            {
                "method": "vicsek",
                "substeps": 5,
                "vicsek": {"side": 3.1, "radius": 1.0, "speed": 0.15, "noise": noise} | vicsek,
            }
        ],
        "particles": [{"name": "p", "cloud": {"count": 40, "size": [3.1, 0, 3.1]}}],
    }


def order(world: World) -> float:
    v = world.columns("velocity")["p"]["velocity"].astype(float)
    return float(np.linalg.norm((v / np.linalg.norm(v, axis=1)[:, None]).mean(axis=0)))


@pytest.mark.parametrize(
    ("noise", "published"), [(1.0, 0.9568), (3.0, 0.6475), (2 * math.pi, math.sqrt(math.pi / 160))]
)
def test_order_falls_with_noise_as_published(noise: float, published: float) -> None:
    blocks = []
    for seed in (1, 2, 3):
        world = World(Scene(crowd(noise, seed, 1100)))
        world.step(100)
        orders = [(world.step(), order(world))[1] for _ in range(1000)]
        blocks += [float(np.mean(part)) for part in np.split(np.array(orders), 5)]
    # Four standard errors of the mean of fifteen blocks of 1000 steps, and as the table has a scatter of its own (a mean
    # over three seeds), 0.003.
    error = float(np.std(blocks, ddof=1)) / math.sqrt(len(blocks))
    assert error < 0.01
    assert abs(np.mean(blocks) - published) < 4 * error + 0.003, (np.mean(blocks), error)


def test_all_stay_in_the_square_and_go_at_their_speed() -> None:
    world = World(Scene(crowd(1.0, 1, 30)))
    before = world.columns("position")["p"]["position"].astype(float)
    moved = 0
    for _ in range(30):
        world.step()
        columns = world.columns("position", "velocity")["p"]
        x, v = columns["position"].astype(float), columns["velocity"].astype(float)
        assert np.abs(x).max() <= 1.55 + 1e-6
        assert np.all(x[:, 1] == 0)
        assert np.linalg.norm(v, axis=1) == pytest.approx(np.full(40, 0.15), rel=1e-6)
        # Nobody goes farther than five steps, but for those who come in at the other side.
        step = (x - before + 1.55) % 3.1 - 1.55
        step[:, 1] = 0
        length = np.linalg.norm(step, axis=1)
        assert length.max() <= 0.15 + 1e-5
        moved += int((length > 0.1).sum())
        before = x
    assert moved > 600
    books = world.ledger
    assert (books["kinetic"], books["elastic"], books["mass"], books["energy"]) == (0, 0, 0, 0)
    assert books["speed"] == 0.15


def test_without_noise_directions_given_by_velocities_are_averaged() -> None:
    tree = crowd(0.0, 1, 1)
    tree["system"][0]["substeps"] = 1
    tree["particles"] = [
        {
            "name": "p",
            "position": [[-1.5, 0, 0], [1.5, 0, 0.2], [0.2, 0, 0]],
            "velocity": [[2, 0, 0], [0, 0, 1], [0, 0, -3]],
        }
    ]
    world = World(Scene(tree))
    world.step()
    columns = world.columns("position", "velocity")["p"]
    # The first two are neighbours across the border and go halfway between their directions; the third is alone.
    r = math.sqrt(0.5) * 0.15
    expected = np.array([[r, 0, r], [r, 0, r], [0, 0, -0.15]])
    assert columns["velocity"] == pytest.approx(expected, abs=1e-6)
    start = np.array(tree["particles"][0]["position"])
    assert columns["position"] == pytest.approx((start + expected + 1.55) % 3.1 - 1.55 + [0, start[0, 1], 0], abs=1e-6)


def test_a_saved_state_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    whole, halved = (World(Scene(crowd(2.0, 7, 40))) for _ in range(2))
    whole.step(40)
    halved.step(20)
    halved.save(tmp_path / "half.tumble")
    again = World.restore(tmp_path / "half.tumble", threads=1)
    assert again.hash() == halved.hash()
    again.step(20)
    assert again.hash() == whole.hash()
    assert World(Scene(crowd(2.0, 8, 40))).hash() != World(Scene(crowd(2.0, 7, 40))).hash()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dimension": 3}, "set dimension = 2"),
        ({"system": [{"method": "vicsek"}]}, r"vicsek: missing, expected side"),
        ({"system": [{"vicsek": {"side": 1, "radius": 0.1, "speed": 1, "noise": 0}}]}, "leave it out, or set method"),
        ({"system": [{**crowd(1, 1, 1)["system"][0], "integrator": "rk4"}]}, "no integrator"),
        (crowd(1.0, 1, 1, radius=1.6), r"vicsek\.radius: 1\.6 m, expected at most half the side"),
        ({"force": [{"kind": "drag", "rate": 1, "on": ["p"]}]}, "no force"),
        ({"particles": [{"name": "p", "position": [[0, 0, 0]], "mass": [2.0]}]}, r"p\"\.mass: .*no mass"),
    ],
)
def test_what_does_not_fit_is_told(change: Tree, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        World(Scene(crowd(1.0, 1, 1) | change))
