"""Gases in the engine's own, single precision."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import World, grids
from tumble.doubts import of_books
from tumble.export import vdb
from tumble.run import simulate

Tree = dict[str, Any]

PLUME: Tree = {
    "version": 1,
    "time": {"fps": 24, "frames": 8},
    "gas": [
        {
            "name": "air",
            "box": {"size": [1, 1, 1.5], "center": [0, 0, 0.75], "resolution": 48},
            "sides": {"z": ["no_slip", "open"]},
            "smoke": {"weight": 0},
            "temperature": {"ambient": 300},
            "source": [
                {"shape": {"sphere": {"center": [0.01, 0, 0.2], "radius": 0.15}}, "density": 1, "temperature": 400}
            ],
        }
    ],
    "output": {"plot": False, "columns": ["density", "velocity_x", "velocity_y", "velocity_z", "divergence"]},
}
BALL: Tree = {
    "name": "ball",
    "shape": {"sphere": {"center": [0.02, 0.01, 0.7], "radius": 0.2}},
    "motion": {"velocity": [0.3, 0, 0], "spin": [0, 1, 0]},
}


@pytest.mark.parametrize("colliders", [[], [BALL]])
def test_a_frame_in_single_precision_is_free_of_divergence(colliders: list[Tree]) -> None:
    world = World({**copy.deepcopy(PLUME), "collider": colliders})
    for _ in range(8):
        report = world.step()
        assert report["unconverged"] == 0
        assert 0 < report["residual"] <= 1e-5
    frame = world.frame["air"]
    fastest = max(np.abs(frame[f"velocity_{a}"]).max() for a in "xyz")
    left = np.abs(frame["divergence"]).max() * 1.5 / 48 / fastest
    assert fastest > 0.3
    # The tolerance is over the velocity before the projection.
    assert 0 < left < 1.5e-5
    # Smoke is never less than none, nor more than its source holds, but for rounding.
    assert frame["density"].min() >= -1e-6
    assert 0.9 < frame["density"].max() <= 1 + 1e-6


def test_steps_that_are_far_too_long_are_told_once(tmp_path: Path) -> None:
    scene = copy.deepcopy(PLUME)
    scene["gas"][0]["velocity"] = [0, 0, 0]
    scene["gas"][0]["acceleration"] = ["60*sin(pi*z/1.5)", 0, 0]
    scene["gas"][0]["courant"] = 0.5
    free = simulate(scene, tmp_path / "free")
    assert not of_books(free)
    assert 0 < np.nanmax(free.ledger["courant"]) < 1
    held = simulate({**scene, "system": [{"method": "gas", "substeps": 1}]}, tmp_path / "held")
    (told,) = of_books(held)
    assert told["code"] == "courant" and "cells in a step" in told["message"]
    assert np.nanmax(held.ledger["courant"]) > 1


FIRE: Tree = {
    "version": 1,
    "time": {"fps": 30, "frames": 6},
    "gas": [
        {
            "name": "fire",
            "box": {"size": [1, 1, 1.5], "center": [0, 0, 0.75], "resolution": 36},
            "sides": {"x": ["open", "open"], "z": ["no_slip", "open"]},
            "smoke": {"weight": 0},
            "temperature": {"radiation": 1000},
            "fire": {"soot": 0.1, "expansion": 10},
            "source": [
                {"shape": {"sphere": {"center": [0, 0, 0.1], "radius": 0.2}}, "fuel_density": 0.05, "temperature": 900}
            ],
        }
    ],
    "output": {"plot": False, "columns": ["density", "temperature", "fuel"]},
}


@pytest.mark.parametrize("densities", ["boussinesq", "variable"])
def test_a_fire_in_single_precision(densities: str, tmp_path: Path) -> None:
    scene = copy.deepcopy(FIRE)
    scene["gas"][0]["densities"] = densities
    run = simulate(scene, tmp_path / "run")
    assert run.ledger["unconverged"].max() == 0
    assert 0 < np.nanmax(run.ledger["residual"]) <= 1e-5
    table = run.frame(6)["fire"]
    # 0.05 kg/m³ of 4.5e7 J/kg warm 1.2 kg/m³ of 1005 J/(kg K) by 1866 K if it all burns at once; expansion thins it.
    assert 1200 < table["temperature"].max() < 900 + 1866
    # It is as hot as that only where something has burnt, and soot is there.
    hot = table["temperature"] > 1000
    assert hot.sum() > 20 and table["density"][hot].min() > 0
    assert 0 < table["fuel"].max() <= 0.05
    grid = grids.box(run.static["fire"])
    assert grid is not None
    assert vdb.fields(grid, table) == {"density": 1, "temperature": 1, "fuel": 1}
