"""Stages opened in Blender itself (`bpy`, in a Python of its own: its OpenUSD and ours do not go together)."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble import Scene
from tumble.bundled import shipped
from tumble.export import blender, usd
from tumble.pictures.things import Stage
from tumble.run import simulate

pytest.importorskip("pxr")

ROOT = Path(__file__).parents[2]
PYTHON = Path(os.environ.get("TUMBLE_BLENDER", ROOT / ".venv-blender" / "bin" / "python"))

needs_blender = pytest.mark.skipif(
    not PYTHON.exists(), reason="no Blender: make validate installs bpy where there is one for this Python"
)


def write(run: Any, folder: Path) -> None:
    usd.write(run, folder)
    blender.write(run, folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Stages of a studio by night, of particles that come and go, of smoke, and of a simulated scene."""
    home = tmp_path_factory.mktemp("blender")
    camera = {"position": None, "target": None, "view_angle": 35.0, "resolution": [160, 90]}
    write(fake_run.studio(camera=camera | {"look": "night"}), home / "night")
    write(fake_run.fountain(), home / "fountain")
    write(fake_run.plume(16), home / "smoke")
    tree = {
        "version": 1,
        "time": {"fps": 29.97, "frames": 4},
        "sheet": [{"name": "sheet", "size": [1, 1], "resolution": [5, 5], "center": [0, 0, 2]}],
        "collider": [{"name": "bat", "shape": {"box": {"size": [1, 1, 1]}}, "motion": {"velocity": [0, 0, 1]}}],
        "output": {"plot": False},
    }
    write(simulate(Scene(tree), home / "run"), home / "real")
    return home


@pytest.fixture(scope="module")
def held(folder: Path) -> dict[str, Any]:
    return opened(folder, [("night", [3], []), ("fountain", [0, 3], [0]), ("smoke", [0, 3], [3]), ("real", [0, 4], [])])


def opened(folder: Path, wanted: list[tuple[str, list[int], list[int]]]) -> dict[str, Any]:
    """What Blender holds of stages below a folder: name, frames that are read, frames that are drawn of each."""
    words = [str(PYTHON), str(ROOT / "python/tests/in_blender.py"), str(folder), json.dumps(wanted)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, env={**os.environ, "PYTHONPATH": ""})
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    found: dict[str, Any] = json.loads((folder / "held.json").read_text())
    return found


@needs_blender
def test_rate_camera_and_light_arrive(held: dict[str, Any]) -> None:
    night = held["night"]
    assert night["fps"] == fake_run.FPS and night["frames"] == [0, 4] and night["resolution"] == [160, 90]
    assert night["camera"] == "camera" and not night["blur"]
    r, g, b, strength = night["world"]
    assert 0 < strength * max(r, g, b) < 0.01
    assert abs(held["real"]["fps"] - 29.97) < 1e-4
    assert held["real"]["world"][3] * max(held["real"]["world"][:3]) > 0.4


@needs_blender
def test_points_velocities_and_ids_are_those_of_the_frame(held: dict[str, Any], folder: Path) -> None:
    run = fake_run.studio()
    at, frame = held["night"]["at"]["3"], run.frame(3)
    for name, prim in (("a sheet", "a_sheet"), ("masses", "masses")):
        assert np.allclose(at[prim]["position"], frame[name]["position"], atol=1e-6)
        assert np.allclose(at[prim]["velocity"], frame[name]["velocity"], atol=1e-6)
    assert at["masses"]["id"] == [0, 1, 2]
    sprayed = held["fountain"]["at"]["3"]["spray"]
    now = fake_run.fountain().frame(3)["spray"]
    assert sprayed["id"] == now["id"].tolist() and np.allclose(sprayed["position"], now["position"], atol=1e-6)
    sheet = held["real"]["at"]["4"]["sheet"]
    assert sheet["sides"] == [4] and sheet["textures"] == ["st"]
    assert np.allclose(held["real"]["at"]["4"]["bat"]["place"], [0, 0, 4 / 29.97], atol=1e-5)
    from tumble import Run

    assert np.allclose(sheet["position"], Run(folder / "run").frame(4)["sheet"]["position"], atol=1e-5)


@needs_blender
def test_every_object_has_its_material(held: dict[str, Any]) -> None:
    found = held["night"]["materials"]
    assert {"a_sheet", "rope", "masses", "masses_springs", "ball", "floor"} <= set(found)
    for name, made in found.items():
        assert len(made) == 1, name
    assert np.allclose(found["a_sheet"][0]["color"], fake_run.BLUE, atol=1e-5)
    # By night particles are lights, and nothing else is.
    assert np.isclose(found["masses"][0]["glow"], 1.2) and found["ball"][0]["glow"] == 0
    assert held["fountain"]["materials"]["spray"][0]["linked"] == ["Base Color"]


@needs_blender
def test_no_points_are_hidden_and_drawn_without_an_error(held: dict[str, Any]) -> None:
    at = held["fountain"]["at"]
    assert at["0"]["spray"]["hidden"] and not at["3"]["spray"]["hidden"]
    assert held["fountain"]["drawn"]["0"][0] > 0.1


@needs_blender
def test_smoke_is_as_thick_as_in_pictures(held: dict[str, Any]) -> None:
    smoke = held["smoke"]
    assert smoke["volumes"] == {"smoke": ["SECOND", "velocity"]}
    assert smoke["at"]["3"]["smoke"]["file"] == "smoke.000003.vdb"
    assert "density" in smoke["at"]["0"]["smoke"]["grids"]
    seen = Stage(fake_run.plume(16)).extinction("smoke")
    assert seen is not None and np.allclose(smoke["materials"]["smoke"][0]["factors"], [seen[2]])
    whole, middle = smoke["drawn"]["3"]
    assert middle < 0.8 * whole, "it hides what is behind it"


@needs_blender
@pytest.mark.long
@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scene_opens_with_velocities(name: str, tmp_path: Path) -> None:
    from pxr import Usd

    run = simulate(Scene.load(name, ["time.frames=2"]), tmp_path / "run")
    write(run, tmp_path / "stage")
    stage = Usd.Stage.Open(str(tmp_path / "stage" / "scene.usda"))
    for prim in stage.GetDefaultPrim().GetChildren():
        points = prim.GetAttribute("points")
        if points and len(points.GetTimeSamples()) > 1:
            assert len(points.Get(2)) == len(prim.GetAttribute("velocities").Get(2)), prim
    held = opened(tmp_path, [("stage", [2], [2])])["stage"]
    assert held["camera"] == "camera" and held["frames"] == [0, 2]
    assert all(len(made) == 1 for thing, made in held["materials"].items() if thing not in held["volumes"])


def test_the_script_is_python_and_stands_beside_the_stage(folder: Path) -> None:
    for name in ("night", "fountain", "smoke", "real"):
        text = (folder / name / "blender.py").read_text()
        compile(text, "blender.py", "exec")
        assert "TABLES" not in text
        tables: dict[str, Any] = {}
        exec(text[text.index("SCENE =") : text.index("def main")], tables)
        assert tables["SCENE"]["frames"][0] == 0
    assert tables["SCENE"]["fps"] == 29.97 and set(tables["LOOKS"]) == {"sheet", "bat"}
