"""Scenes that start with things in each other, or on what moves: nothing is launched, or it is told."""

from typing import Any

import numpy as np
import pytest

from tumble import Scene, TumbleError, World

THICKNESS = 0.01


def two_sheets(apart: float, system: dict[str, Any]) -> World:
    """Two free sheets of 0.6 m above each other, without gravity."""
    sheet = {"size": [0.6, 0.6], "resolution": [13, 13]}
    return World(
        Scene(
            {
                "version": 1,
                "world": {"gravity": [0, 0, 0]},
                "system": [{"self_contact": {"thickness": THICKNESS}, "substeps": 16} | system],
                "sheet": [sheet | {"name": "a"}, sheet | {"name": "b", "center": [0, 0, apart]}],
            }
        )
    )


@pytest.mark.parametrize(
    "system",
    [
        {"method": "position_based"},
        {"integrator": "implicit_euler"},
        {"integrator": "symplectic_euler", "substeps": 100},
    ],
    ids=lambda s: str(next(iter(s.values()))),
)
@pytest.mark.parametrize("apart", [1e-4, 5e-3])
def test_what_starts_too_near_is_parted_and_not_launched(apart: float, system: dict[str, Any]) -> None:
    world = two_sheets(apart, system)
    assert not world.warnings
    world.step(24)
    frame = world.frame
    gap = frame["b"]["position"][:, 2] - frame["a"]["position"][:, 2]
    assert gap.min() > 0.98 * THICKNESS and gap.max() < 1.1 * THICKNESS
    speed = max(np.abs(frame[name]["velocity"]).max() for name in "ab")
    # Before, half the thickness a sub-step: 1.9 m/s.
    assert speed < 1e-3, speed


def test_what_lies_in_each_other_is_told() -> None:
    (told,) = two_sheets(0.0, {"method": "position_based"}).warnings
    assert told["code"] == "tangled-start"
    assert "169 vertices lie exactly where others do; at [" in told["message"] and '"a" lies in "b"' in told["message"]


def hairy(**words: Any) -> Scene:
    return Scene(
        {
            "version": 1,
            "time": {"frames": 24},
            "system": [{"method": "position_based", "substeps": 16}],
            "hair": [{"name": "h", "on": "dancer", "count": 20, "above": 1.5, "length": 0.1, "segments": 8} | words],
            "collider": [{"name": "dancer", "shape": {"mannequin": {"motion": "walk", "travel": True}}}],
        }
    )


def test_hair_on_a_figure_follows_its_bone() -> None:
    world = World(hairy(bone="head"))
    start = np.array(world.frame["h"]["position"]).reshape(20, 9, 3)
    world.step(24)
    x = np.array(world.frame["h"]["position"]).reshape(20, 9, 3)
    roots, before = x[:, 0], start[:, 0]
    # It has walked on, with a head that is rigid: distances between roots are kept.
    assert np.linalg.norm(roots - before, axis=1).min() > 0.3
    apart = [np.linalg.norm(r[:, None] - r[None], axis=2) for r in (roots, before)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-5)
    assert world.ledger["stretch"] < 1.05


def test_hair_without_a_bone_follows_the_skin() -> None:
    world = World(hairy())
    start = np.array(world.frame["h"]["position"]).reshape(20, 9, 3)[:, 0]
    skin = world.frame["dancer"]["position"]
    # Each root stays where it is on the skin: as near to its nearest vertex as at the start, within what the skin stretches.
    vertex = np.linalg.norm(skin[None] - start[:, None], axis=2).argmin(axis=1)
    near = np.linalg.norm(skin[vertex] - start, axis=1)
    world.step(24)
    roots = np.array(world.frame["h"]["position"]).reshape(20, 9, 3)[:, 0]
    skin = world.frame["dancer"]["position"]
    assert np.linalg.norm(roots - start, axis=1).min() > 0.3
    np.testing.assert_allclose(np.linalg.norm(skin[vertex] - roots, axis=1), near, atol=2e-3)
    assert world.ledger["stretch"] < 1.05


def test_a_broken_collider_is_told_once() -> None:
    follow = {"collider": "dancer", "bone": "head"}
    pinned = {"which": "corner 0 0", "follow": follow}
    dancer = {"name": "dancer", "shape": {"lathe": {"profile": [[0, 0], [1, 1], [0, 0.5], [1, 0]]}}}
    tree = {"version": 1, "system": [{"method": "position_based"}], "collider": [dancer]}
    tree["sheet"] = [{"name": "s", "size": [1, 1], "resolution": [3, 3], "pin": [pinned]}]
    with pytest.raises(TumbleError) as refused:
        World(Scene(tree))
    assert "dancer" in str(refused.value) and "to follow" not in str(refused.value)
