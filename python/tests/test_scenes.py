"""Every scene that ships runs and keeps what it expects; the ones under failures/ fail as they should."""

from pathlib import Path

import pytest

import tumble
from tumble import expect
from tumble.run import simulate

SCENES = Path(tumble.__file__).parent / "scenes"
NAMES = sorted(p.relative_to(SCENES).with_suffix("").as_posix() for p in SCENES.glob("*/*.toml"))


GOOD = [n for n in NAMES if not n.startswith("failures/")]

BEGINNINGS = {
    "cloth/drapes": 3,
    "cloth/dress": 6,
    "cloth/funnel": 12,
    "cloth/hair-on-bunny": 2,
    "cloth/mannequin": 10,
    "cloth/pile": 3,
    "cloth/torn-flag": 10,
    "cloth/twist": 15,
    "cloth/washing-line": 14,
    "coupled/afloat": 12,
    "coupled/curtain": 20,
    "coupled/gust": 12,
    "coupled/sandbox": 20,
    "coupled/trampoline": 32,
    "coupled/washing": 5,
    "crowd/ceiling": 100,
    "crowd/office": 800,
    "crowd/school": 400,
    "drape/clamped-sheet": 32,
    "drape/sheet-on-ball": 16,
    "drape/sheet-on-bunny": 4,
    "gas/ball_in_a_tank": 16,
    "gas/bunny": 12,
    "gas/cavity": 24,
    "gas/fire": 8,
    "gas/flag_in_a_jet": 8,
    "gas/ink": 30,
    "gas/obstacle": 24,
    "gas/plume": 16,
    "gas/vortex_street": 4,
    "grains/clumps": 16,
    "grains/column": 16,
    "grains/heaps": 16,
    "grains/hopper": 16,
    "grains/hourglass": 24,
    "grains/pour": 12,
    "gravity/encounter": 48,
    "gravity/galaxy": 24,
    "heat/finned_plate": 30,
    "liquid/bath": 3,
    "liquid/dam": 6,
    "liquid/drop": 2,
    "liquid/honey": 4,
    "liquid/pour": 2,
    "liquid/raft": 2,
    "liquid/tension": 4,
    "liquid/waterwheel": 3,
    "liquid/wave-tank": 3,
    "particles/flock": 80,
    "particles/fountain": 48,
    "particles/pool": 6,
    "particles/snow": 48,
    "particles/tornado": 48,
    "particles/waterfall": 36,
    "rigid/shatter": 24,
    "structures/blocks": 24,
    "structures/others": 14,
}
"""Frames of scenes that take more than some five seconds of a processor in full, as they do in `make validate`."""

FEWER = {
    "gravity/encounter": ["galaxy.0.stars=2000", "galaxy.1.stars=2000"],
    "gravity/galaxy": ["galaxy.0.stars=4000"],
}
"""Words of beginnings: with fewer stars, for the stable step is estimated from all pairs of them."""


def keeps_what_it_expects(name: str, frames: int | None, folder: Path) -> None:
    scene = tumble.Scene.load(SCENES / f"{name}.toml", FEWER.get(name, []) if frames is not None else [])
    words = scene.to_dict()
    assert expect.count(words), f"{name} expects nothing"
    run = simulate(scene, folder, frames=frames)
    assert run.n_frames == (frames or words["time"]["frames"]) + 1
    assert run.manifest["status"] == "finished"
    broken, warnings = run.manifest["expectations"], run.manifest["warnings"]
    if frames is not None:
        # Probes and the count of what has torn are of the last frame, and stills may be of frames that do not come.
        broken = [bound for bound in broken if bound["name"].startswith("max_")]
        warnings = [warning for warning in warnings if warning["code"] not in ("no-such-frame", "other-end")]
    assert broken == []
    assert warnings == []


@pytest.mark.parametrize("name", sorted(GOOD, key=lambda name: name not in BEGINNINGS))
def test_scene_keeps_what_it_expects(name: str, tmp_path: Path) -> None:
    keeps_what_it_expects(name, BEGINNINGS.get(name), tmp_path / "run")


@pytest.mark.long
@pytest.mark.parametrize("name", BEGINNINGS)
def test_scene_keeps_what_it_expects_to_its_end(name: str, tmp_path: Path) -> None:
    keeps_what_it_expects(name, None, tmp_path / "run")


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


@pytest.mark.parametrize("name", GOOD)
def test_soft_surfaces_are_expected_not_to_pass_through_each_other(name: str) -> None:
    words = tumble.Scene.load(SCENES / f"{name}.toml").to_dict()
    soft = any(words[kind] for kind in ("sheet", "net", "cloth", "block"))
    assert (words["expect"]["max_intersections"] == 0) == soft


def test_there_are_scenes() -> None:
    assert len(NAMES) >= 14
