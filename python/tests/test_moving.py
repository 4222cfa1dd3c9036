"""Colliders that move: what frames, pictures and USD stages say of them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tumble
from tumble import SceneError
from tumble.export import usd
from tumble.pictures.drawn import Ground, Mesh, Tubes
from tumble.pictures.things import Stage
from tumble.run import simulate

PLATE = "v {x} 0 0\nv 1 0 {z}\nv 0 1 {z}\nf 1 2 3\n"


def scene(folder: Path, **more: Any) -> tumble.Scene:
    for i, z in enumerate((0.0, 0.5)):
        (folder / f"plate.{i}.obj").write_text(PLATE.format(x=0, z=z))
    frames = [{"time": 0.0, "path": "plate.0.obj"}, {"time": 1.0, "path": "plate.1.obj"}]
    tree = {
        "version": 1,
        "time": {"fps": 8, "frames": 4},
        "particles": [{"name": "p", "position": [[0, 0, 3]]}],
        "collider": [
            {
                "name": "bat",
                "shape": {"box": {"center": [1, 0, 0], "size": [1, 1, 1]}},
                "motion": {"spin": [0, 0, np.pi], "velocity": [0, 0, 2]},
            },
            {"name": "room", "inside": True, "shape": {"sphere": {"radius": 5}}},
            {"name": "lift", "shape": {"floor": {"height": -9}}, "motion": {"velocity": [0, 0, 1]}},
            {"name": "flap", "thickness": 0.01, "shape": {"animated_mesh": {"frames": frames, "shell": True}}},
        ],
    }
    tree.update(more)
    path = folder / "scene.json"
    path.write_text(json.dumps(tree))
    return tumble.Scene.load(path)


def test_frames_and_pictures_show_where_colliders_are(tmp_path: Path) -> None:
    run = simulate(scene(tmp_path), tmp_path / "run")
    last = run.frame(4)  # 0.5 s: a quarter turn, 1 m up
    turn = np.ravel(last["bat"]["turn"])
    assert np.allclose(turn, [0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    assert np.allclose(np.ravel(last["bat"]["translation"]), [0, 0, 1])
    assert "room" not in last
    assert np.allclose(last["flap"]["position"], [[0, 0, 0], [1, 0, 0.25], [0, 1, 0.25]])
    things = {t.name: t for t in Stage(run).things(4)}
    bat, lift, flap = things["bat"], things["lift"], things["flap"]
    assert isinstance(bat, Mesh)
    assert np.allclose(bat.vertices.mean(axis=0), [0, 1, 1])
    assert isinstance(lift, Ground)
    assert np.allclose(lift.point, [0, 0, -8.5])
    assert np.allclose(lift.normal, [0, 0, 1])
    assert isinstance(flap, Mesh)
    assert np.isclose(flap.vertices[:, 2].max(), 0.25)
    assert isinstance(things["room"], Tubes), "what is inside must be seen"


def test_usd_moves_them(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    run = simulate(scene(tmp_path), tmp_path / "run")
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path / "usd")))
    bat = UsdGeom.Xformable(stage.GetPrimAtPath("/scene/bat"))
    for frame, middle in ((0, (1, 0, 0)), (2, (np.sqrt(0.5), np.sqrt(0.5), 0.5)), (4, (0, 1, 1))):
        moved = bat.ComputeLocalToWorldTransform(frame).Transform((1.0, 0.0, 0.0))
        assert np.allclose(moved, middle), frame
    flap = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/flap")).GetPointsAttr()
    assert np.allclose(np.array(flap.Get(4))[:, 2], [0, 0.25, 0.25])
    assert np.allclose(np.array(flap.Get(0))[:, 2], 0)


def test_the_scene_keeps_the_hash_of_every_frame(tmp_path: Path) -> None:
    words = scene(tmp_path).to_dict()
    frames = words["collider"][3]["shape"]["animated_mesh"]["frames"]
    assert frames[0]["hash"] != frames[1]["hash"]
    assert all(len(f["hash"]) == 16 for f in frames)


def test_frames_of_an_animated_mesh_have_the_same_triangles(tmp_path: Path) -> None:
    good = scene(tmp_path)
    (tmp_path / "plate.1.obj").write_text(PLATE.format(x=0, z=0) + "v 3 3 3\nf 2 3 4\n")
    with pytest.raises(SceneError, match=r"flap.*frames\[1\].*4 vertices instead of 3"):
        tumble.World(tumble.Scene.load(tmp_path / "scene.json"))
    assert good.to_dict()["collider"][3]["name"] == "flap"


CORNERS = [[x, y, z] for z in (0, 0.4) for y in (-0.2, 0.2) for x in (-0.2, 0.2)]
SIDES = [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]]


def passages(a: np.ndarray, b: np.ndarray, corners: np.ndarray) -> int:
    """How many of the segments from a to b pass how many of the triangles, [n, 3, 3]."""
    p, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    way, from_p = (b - a)[:, None], a[:, None] - p
    across = np.cross(way, f)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / np.sum(e * across, axis=-1)
        u, turned = np.sum(from_p * across, axis=-1) * scale, np.cross(from_p, e)
        v, t = np.sum(way * turned, axis=-1) * scale, np.sum(f * turned, axis=-1) * scale
        return int(np.sum((u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)))


@pytest.mark.parametrize("edged", [False, True])
def test_a_net_that_follows_a_box_keeps_its_corners_out_of_coarse_cloth(tmp_path: Path, edged: bool) -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["f " + " ".join(map(str, side)) for side in SIDES]
    (tmp_path / "box.obj").write_text("\n".join(lines))
    mesh = {"path": str(tmp_path / "box.obj")}
    follows = {"center": [0, 0, 0.2], "radius": 1, "follow": {"collider": "box"}}
    net = {"net": [{"name": "edges", "mesh": mesh, "pin": [follows]}]} if edged else {}
    world = tumble.World(
        tumble.Scene(
            {
                "version": 1,
                "system": [{"method": "position_based", "self_contact": {"thickness": 0.006, "friction": 0.3}}],
                "sheet": [{"name": "cloth", "size": [1, 1], "resolution": [10, 10], "center": [0.03, 0.02, 0.45]}],
                "collider": [
                    {"name": "box", "shape": {"mesh": mesh}, "thickness": 0.003, "motion": {"spin": [0, 0, 1]}}
                ],
                **net,
            }
        )
    )
    cloth, found = world.topology["cloth"]["triangles"], 0
    box = np.array([[a, *pair] for a, *rest in SIDES for pair in (rest[:2], rest[1:])]) - 1
    for _ in range(48):
        world.step()
        x = world.frame["cloth"]["position"].astype(float)
        cos, sin = np.cos(world.time), np.sin(world.time)
        solid = np.array(CORNERS) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        for (a, one), (b, other) in [((x, cloth), (solid, box)), ((solid, box), (x, cloth))]:
            ends = a[one[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
            found += passages(ends[:, 0], ends[:, 1], b[other])
    print(f"edges that pass faces, in 48 frames: {found}")
    assert (found == 0) == edged
