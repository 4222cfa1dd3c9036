"""Animated USD files as frames, which the engine is given for colliders."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_usd_in import ARM, SPAN, TETRAHEDRON, scene, write

from tumble import SceneError, load_mesh, usd

pytest.importorskip("pxr")
pytestmark = pytest.mark.filterwarnings("ignore::tumble.usd.UsdWarning")

RISING = f"""
def Mesh "m" {{ {TETRAHEDRON}
    double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 25: (0, 0, 2) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
COMING = f"""
def Mesh "rest" {{ {TETRAHEDRON} }}
def Mesh "flash" {{ token visibility.timeSamples = {{ 1: "inherited", 5: "invisible" }} {TETRAHEDRON} }}
"""


def colliders(path: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = scene(path)["collider"]
    return found


def frames(shape: dict[str, Any]) -> list[tuple[float, str]]:
    return [(frame["time"], frame["path"]) for frame in shape["animated_mesh"]["frames"]]


def test_frames_of_a_file_are_what_baking_writes(tmp_path: Path) -> None:
    file = write(tmp_path, ARM, SPAN)
    ball = {"name": "b", "shape": {"sphere": {"radius": 1.0}}}
    placed = colliders("thing.usda")[0]
    placed["shape"]["mesh"] |= {"scale": 2.0, "hash": "abc", "resolution": 96}
    [(number, shape)] = usd.moved([ball, placed], tmp_path, 1.0)
    assert number == 1 and {k: v for k, v in shape["animated_mesh"].items() if k != "frames"} == {
        "scale": 2.0,
        "shell": True,
    }
    assert [frame.get("hash") for frame in shape["animated_mesh"]["frames"]] == ["abc", *[None] * 24]
    baked = usd.bake(file, tmp_path / "baked")
    assert len(frames(shape)) == len(baked) == 25
    for (time, name), (meant, mesh) in zip(frames(shape), baked, strict=True):
        assert time == meant and usd.as_obj(tmp_path / name) == mesh.read_text()
    # Once more, now that nothing is kept ready.
    assert usd.as_obj(tmp_path / "thing.usda" / "13.usda") == baked[12][1].read_text()
    with pytest.raises(SceneError):
        load_mesh(tmp_path / "thing.usda" / "nan.usda")


def test_frames_last_as_long_as_the_scene_and_change_with_it(tmp_path: Path) -> None:
    write(tmp_path, RISING, SPAN)
    [(_, short)] = usd.moved(colliders("thing.usda"), tmp_path, 0.3)
    assert [path for _, path in frames(short)][-2:] == ["thing.usda/8.usda", "thing.usda/8.2.usda"]
    resolved = [{"name": "c", "shape": short}]
    [(_, long)] = usd.moved(resolved, tmp_path, 9.0)
    assert len(frames(long)) == 25 and frames(long)[-1] == (1.0, "thing.usda/25.usda")
    [(_, again)] = usd.moved([{"name": "c", "shape": long}], tmp_path, 0.3)
    assert again == short
    # At times of somebody else's they are left as they are; a single one is a pose.
    few = [{"time": 0.0, "path": "thing.usda/1.usda"}, {"time": 1.0, "path": "thing.usda/25.usda"}]
    [(_, kept)] = usd.moved([{"name": "c", "shape": {"animated_mesh": {"frames": few}}}], tmp_path, 9.0)
    assert len(frames(kept)) == 2
    slow = [{"time": 2 * time, "path": path} for time, path in frames(short)]
    [(_, kept)] = usd.moved([{"name": "c", "shape": {"animated_mesh": {"frames": slow}}}], tmp_path, 9.0)
    assert frames(kept) == [(2 * time, path) for time, path in frames(short)]
    assert usd.moved([{"name": "c", "shape": {"animated_mesh": {"frames": slow[:1]}}}], tmp_path, 9.0) == []
    assert usd.moved(colliders("thing.usda/13.usda"), tmp_path, 9.0) == []
    assert "v 0.0 0.0 1.0\n" in usd.as_obj(tmp_path / "thing.usda" / "13.usda")


def test_what_does_not_move_or_cannot_is_left(tmp_path: Path) -> None:
    write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON} }}', name="still.usda")
    write(tmp_path, COMING, SPAN, "coming.usda")
    (tmp_path / "broken.usda").write_text("no USD")
    (tmp_path / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for name in ("still.usda", "coming.usda", "broken.usda", "gone.usda", "ball.obj"):
        assert usd.moved(colliders(name), tmp_path, 1.0) == []
    told = dict(usd.doubts(tmp_path / "coming.usda"))["stands-still"]
    assert "/flash" in told and "it cannot move: /flash: faces or points come and go by time code 5" in told
    # A scene that ends before that moves, and says nothing.
    assert len(usd.moved(colliders("coming.usda"), tmp_path, 0.1)) == 1
    assert "cannot move" not in dict(usd.doubts(tmp_path / "coming.usda"))["stands-still"]


@pytest.mark.parametrize("code", [4, 7.5])
def test_a_file_that_starts_between_two_samples_is_posed(tmp_path: Path, code: float) -> None:
    """The weight of its blend shape goes from 0 to 1 between the time codes 1 and 25."""
    file = write(tmp_path, ARM, SPAN.replace("startTimeCode = 1", f"startTimeCode = {code}").replace("= 25", "= 20"))
    assert abs(load_mesh(file)[0][0, 1] + (code - 1) / 24) < 1e-5
    first, *_, last = usd.bake(file, tmp_path / "arm")
    assert abs(load_mesh(first[1])[0][0, 1] + (code - 1) / 24) < 1e-5
    assert abs(load_mesh(last[1])[0][0, 1] + 19 / 24) < 1e-5 and np.isclose(last[0], (20 - code) / 24)


def test_characters_name_the_figure_of_a_file(tmp_path: Path) -> None:
    figure = {"path": "thing.usda", "hash": "abc", "scale": 2.0}
    found = usd.moved([{"name": "c", "shape": {"character": figure}}], tmp_path, 1.0)
    assert found == [(0, {"character": figure | {"path": "thing.usda/figure.glb"}})]
    assert usd.moved([{"name": "c", "shape": found[0][1]}], tmp_path, 1.0) == []
    assert usd.moved([{"name": "c", "shape": {"character": {"path": "a.glb"}}}], tmp_path, 1.0) == []
