"""From a scene with a gas to files: run folder, VDB, USD, slices, films, resuming."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from runs import assert_same, killed
from test_vdb import oracle, read

from tumble import Run, grids
from tumble.run import simulate

__all__ = ["oracle"]

Tree = dict[str, Any]
Command = Callable[..., Answer]
SceneFile = Callable[..., Path]


@pytest.fixture
def gas() -> Tree:
    """A warm drop of smoke in a small box."""
    return {
        "version": 1,
        "time": {"fps": 24, "frames": 6},
        "camera": {"resolution": [64, 48]},
        "gas": [
            {
                "name": "air",
                "box": {"size": [1.0, 0.5, 1.5], "center": [0, 0, 0.75], "resolution": 12},
                "smoke": {"initial": "smoothstep(0.4, 0.2, hypot(x, y, z - 0.5))"},
                "temperature": {"initial": "293.15 + 80*smoothstep(0.4, 0.2, hypot(x, y, z - 0.5))"},
            }
        ],
        "output": {"plot": False, "columns": ["density", "temperature", "velocity", "pressure", "velocity_x"]},
    }


def test_columns_lie_on_the_grid(gas: Tree, tmp_path: Path) -> None:
    run = simulate(gas, tmp_path / "run")
    grid = grids.box(run.static["air"])
    assert grid is not None and grid.cells == (8, 4, 12) and grid.flat == 3
    assert grid.spacing == pytest.approx(0.125) and grid.origin == pytest.approx([-0.5, -0.25, 0.0])
    table = run.frame(-1)["air"]
    assert {n: a.shape for n, a in table.items()} == {
        "density": (8, 4, 12),
        "temperature": (8, 4, 12),
        "velocity": (8, 4, 12, 3),
        "pressure": (8, 4, 12),
        "velocity_x": (9, 4, 12),
    }
    assert np.abs(table["velocity"][..., 2]).max() > 0.01
    # As x fastest in the file as in the engine: nothing is turned over on the way.
    x, _, z = np.meshgrid(*(grid.points(a) for a in range(3)), indexing="ij")
    start = run.frame(0)["air"]["density"]
    assert abs((start * x).sum() / start.sum()) < 1e-6
    assert (start * z).sum() / start.sum() == pytest.approx(0.5, abs=1e-5)


def test_vdb_by_option_or_by_the_scene(gas: Tree, scene_file: SceneFile, tumble: Command, tmp_path: Path) -> None:
    assert tumble("run", scene_file(gas), "--frames", 2).code == 0
    volumes = Path("out/scene/volumes")
    assert not volumes.exists()
    assert tumble("export", "out/scene", "--vdb").code == 0
    files = [f"air.{i:06}.vdb" for i in range(3)]
    assert sorted(p.name for p in volumes.iterdir()) == files
    frame = Run("out/scene").frame(2)["air"]
    got = read((volumes / files[2]).read_bytes(), tmp_path, (0, 0, 0), (8, 4, 12))
    assert set(got) == {"density", "temperature", "velocity", "pressure"}
    for name in got:
        kept = got[name]["active"]
        np.testing.assert_array_equal(got[name]["values"][kept], frame[name][kept], err_msg=name)
        assert kept.any()
    size = (volumes / files[2]).stat().st_size
    assert tumble("export", "out/scene", "--vdb", "--half", "--zip").code == 0
    assert (volumes / files[2]).stat().st_size < 0.9 * size
    done = tumble("run", scene_file(gas), "--frames", 1, "--set", "output.vdb=true", "--force")
    assert done.code == 0, done.err
    assert sorted(p.name for p in volumes.iterdir()) == files[:2]
    assert tumble("run", scene_file(gas), "--frames", 1, "--no-vdb", "--force").code == 0
    assert not volumes.exists()
    assert tumble("run", scene_file(gas), "--frames", 1, "--usd", "--vdb", "--force").code == 0
    assert sorted(p.name for p in volumes.iterdir()) == files[:2]
    assert Path("out/scene/scene.usda").is_file()
    wrong = tumble("export", "out/scene", "--npz", "--half")
    assert wrong.code == 2 and "--vdb" in wrong.err


def test_exports_that_know_no_grids_still_work(gas: Tree, scene_file: SceneFile, tumble: Command) -> None:
    assert tumble("run", scene_file(gas), "--frames", 2).code == 0
    assert tumble("export", "out/scene", "--npz").code == 0
    with np.load("out/scene/columns.npz") as stacked:
        np.testing.assert_array_equal(stacked["air/velocity"][2], Run("out/scene").frame(2)["air"]["velocity"])
    refused = tumble("export", "out/scene", "--ply")
    assert refused.code == 1 and "no particles" in refused.err
    assert tumble("plot", "out/scene").code == 0


def test_slices_and_pictures_of_a_run(gas: Tree, scene_file: SceneFile, tumble: Command) -> None:
    assert tumble("run", scene_file(gas), "--frames", 2).code == 0
    done = tumble("plot", "out/scene", "--slice", "temperature", "speed", "--frame", 1, "--axis", "x")
    assert done.code == 0 and "slices/000001.png" in done.out
    wrong = tumble("plot", "out/scene", "--slice", "smoke")
    assert wrong.code == 1 and "there are density" in wrong.err
    assert tumble("render", "out/scene", "--renderer", "matplotlib").code == 0
    assert tumble("run", scene_file(gas), "--frames", 1, "--force").code == 0
    assert not Path("out/scene/slices").exists()


def test_a_killed_run_goes_on(gas: Tree, tmp_path: Path) -> None:
    gas["output"]["checkpoint"] = 2
    reference = simulate(gas, tmp_path / "reference")
    folder = killed(gas, tmp_path / "killed", 5)
    assert_same(simulate(gas, folder, resume=True), reference)
