"""Every scene that ships runs in full and keeps what it expects; the ones under failures/ fail as they should."""

from pathlib import Path

import pytest

import tumble
from tumble import expect
from tumble.run import simulate

SCENES = Path(tumble.__file__).parent / "scenes"
NAMES = sorted(p.relative_to(SCENES).with_suffix("").as_posix() for p in SCENES.glob("*/*.toml"))


@pytest.mark.parametrize("name", [n for n in NAMES if not n.startswith("failures/")])
def test_scene_keeps_what_it_expects(name: str, tmp_path: Path) -> None:
    scene = tumble.Scene.load(SCENES / f"{name}.toml")
    words = scene.to_dict()
    assert expect.count(words), f"{name} expects nothing"
    run = simulate(scene, tmp_path / "run")
    assert run.n_frames == words["time"]["frames"] + 1
    assert run.manifest["status"] == "finished"
    assert run.manifest["expectations"] == []
    assert run.manifest["warnings"] == []


@pytest.mark.parametrize("name", [n for n in NAMES if n.startswith("failures/")])
def test_failure_is_explained_and_cured(name: str) -> None:
    world = tumble.World(tumble.Scene.load(SCENES / f"{name}.toml"))
    with pytest.raises(tumble.StepError) as caught:
        world.step(world.scene.to_dict()["time"]["frames"])
    assert caught.value.report["kind"] in ("exploded", "not_finite")
    cures = world.cures()
    assert any(cure["survived"] for cure in cures)
    helped = next(cure for cure in cures if cure["survived"])
    cured = tumble.World(world.scene.replace(*helped["set"].split()))
    cured.step(world.scene.to_dict()["time"]["frames"])


@pytest.mark.parametrize("name", [n for n in NAMES if not n.startswith("failures/")])
def test_soft_surfaces_are_expected_not_to_pass_through_each_other(name: str) -> None:
    words = tumble.Scene.load(SCENES / f"{name}.toml").to_dict()
    soft = any(words[kind] for kind in ("sheet", "net", "cloth", "block"))
    assert (words["expect"]["max_intersections"] == 0) == soft


def test_there_are_scenes() -> None:
    assert len(NAMES) >= 14
