"""Colliders from animated USD files move: in worlds, runs, checkpoints, branches, stages and pictures."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from test_usd_in import ARM, SPAN, scene, write
from test_usd_moves import COMING, colliders

import tumble
from tumble import Scene, SceneError, World, load_mesh
from tumble.branch import branch
from tumble.pictures import Studio
from tumble.run import simulate

pytest.importorskip("pxr")
pytestmark = pytest.mark.filterwarnings("ignore::tumble.usd.UsdWarning")

FLAT = "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]"
CORNERS = "[(-1, -1, {0}), (1, -1, {0}), (1, 1, {0}), (-1, 1, {0})]"
RISE = """xformOp:translate.timeSamples = { 1: (0, 0, 0), 25: (0, 0, 1) }
uniform token[] xformOpOrder = ["xformOp:translate"]
"""
SKIN = """
    def Skeleton "skel" (prepend apiSchemas = ["SkelBindingAPI"]) {
        uniform token[] joints = ["root"]
        uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))]
        uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))]
        rel skel:animationSource = </top/skel/a>
        def SkelAnimation "a" {
            ANIMATION
        }
    }
"""
SKINNED = """
        rel skel:skeleton = </top/skel>
        int[] primvars:skel:jointIndices = [0,0,0,0] ( elementSize = 1
            interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1,1,1,1] ( elementSize = 1
            interpolation = "vertex" )
"""
SHAPE = """
        uniform token[] skel:blendShapes = ["up"]
        rel skel:blendShapeTargets = </top/m/up>
        def BlendShape "up" {
            uniform vector3f[] offsets = [(0,0,1),(0,0,1),(0,0,1),(0,0,1)]
        }
"""
TURNED = 'quatf[] rotations = [(1,0,0,0)]\nhalf3[] scales = [(1,1,1)]\nuniform token[] joints = ["root"]\n'
BONES = SKIN.replace("ANIMATION", TURNED + "float3[] translations.timeSamples = { 1: [(0,0,0)], 25: [(0,0,1)] }")
WEIGHTS = SKIN.replace(
    "ANIMATION",
    TURNED + 'float3[] translations = [(0,0,0)]\nuniform token[] blendShapes = ["up"]\n'
    "float[] blendShapeWeights.timeSamples = { 1: [0], 25: [1] }",
)
STILL = f"point3f[] points = {CORNERS.format(0)}"
BOUND = '(prepend apiSchemas = ["SkelBindingAPI"])'
ROOT = f'def SkelRoot "top" {BOUND} {{{{{{0}}def Mesh "m" {BOUND} {{{{ {{1}} }}}} }}}}'
MOVING = f"point3f[] points.timeSamples = {{ 1: {CORNERS.format(0)}, 25: {CORNERS.format(1)} }}"
LIFTS = {
    "points": f'def Mesh "m" {{ {FLAT}\n{MOVING} }}',
    "transform": f'def Xform "top" {{ double3 {RISE}def Mesh "m" {{ {FLAT}\n{STILL} }} }}',
    "instances": f"""def PointInstancer "top" {{ rel prototypes = [</top/m>]
        int[] protoIndices = [0]
        point3f[] positions.timeSamples = {{ 1: [(0, 0, 0)], 25: [(0, 0, 1)] }}
        def Mesh "m" {{ {FLAT}\n{STILL} }} }}""",
    "skeleton": ROOT.format(BONES, f"{FLAT}\n{STILL}{SKINNED}"),
    "blend shape": ROOT.format(WEIGHTS, f"{FLAT}\n{STILL}{SKINNED}{SHAPE}"),
}
"""Plates of 2 m x 2 m that rise by 1 m in the second from time code 1 to 25."""


def lift(path: str = "thing.usda", **more: Any) -> dict[str, Any]:
    """A mass on a plate."""
    tree = scene(path) | {"particles": [{"name": "p", "position": [[0.3, 0.2, 0.02]]}], "output": {"plot": False}}
    return tree | more


@pytest.mark.parametrize("kind", list(LIFTS))
def test_a_collider_moves_as_its_file_says(tmp_path: Path, kind: str) -> None:
    write(tmp_path, LIFTS[kind], SPAN)
    world = World(Scene(lift(), tmp_path))
    assert world.warnings == []
    for i in (6, 12, 24):
        world.step(i - world.frame_index)
        assert np.allclose(world.frame["c"]["position"][:, 2], i / 24, atol=1e-5), (kind, i)
    # What lies on it is carried.
    assert 0.99 < world.frame["p"]["position"][0, 2] < 1.06


def test_runs_go_on_branch_and_come_back(tmp_path: Path) -> None:
    write(tmp_path, LIFTS["skeleton"], SPAN)
    tree = lift(time={"fps": 24, "frames": 12}, output={"plot": False, "checkpoint": 4})
    run = simulate(Scene(tree, tmp_path), tmp_path / "out" / "run")
    shape = run.scene["collider"][0]["shape"]["animated_mesh"]
    assert shape["frames"][0]["path"] == "thing.usda/1.usda" and len({f["hash"] for f in shape["frames"]}) == 1
    # All that there is in the folder are files of runs.
    assert not list((tmp_path / "out").rglob("*.obj"))
    back = World.restore(tmp_path / "out" / "run" / "checkpoints" / "000008.safetensors")
    back.step(4)
    assert back.hash() == run.hashes[12]
    again = simulate(Scene(tree, tmp_path), tmp_path / "out" / "run", resume=True)
    assert again.hashes == run.hashes
    # A branch that goes on for longer moves for longer.
    longer = branch(run, 8, tmp_path / "out" / "branch", frames=16)
    assert longer.n_frames == 25 and longer.hashes[:9] == run.hashes[:9]
    assert np.allclose(longer.frame(-1)["c"]["position"][:, 2], 1.0, atol=1e-5)
    mesh = tumble.export.usd.write(longer, tmp_path / "stage")
    assert abs(load_mesh(mesh.parent / "scene.usda" / "12.usda")[0][:, 2].max() - 0.5) < 1e-5
    drawn = [Studio(longer, "matplotlib", (96, 54)).picture(i).astype(int) for i in (0, 24)]
    assert (np.abs(drawn[0] - drawn[1]).max(axis=2) > 30).sum() > 20


def test_frames_of_a_file_can_be_named(tmp_path: Path) -> None:
    """At half the speed; and one alone, which stands, in both shapes."""
    write(tmp_path, LIFTS["skeleton"], SPAN)
    slow = [{"time": 0.0, "path": "thing.usda/1.usda"}, {"time": 2.0, "path": "thing.usda/25.usda"}]
    for words in (
        {"animated_mesh": {"frames": slow, "shell": True}},
        {"animated_mesh": {"frames": [{"time": 0.0, "path": "thing.usda/13.usda"}], "shell": True}},
        {"mesh": {"path": "thing.usda/13.usda", "shell": True}},
    ):
        world = World(Scene(lift(collider=[{"name": "c", "thickness": 0.01, "shape": words}]), tmp_path))
        world.step(24)
        table = world.frame.get("c") or world.topology["c"]
        assert np.allclose(table["position"][:, 2], 0.5, atol=1e-5) and world.warnings == []


def test_a_file_that_has_changed_or_is_gone_is_one_fault(tmp_path: Path) -> None:
    file = write(tmp_path, LIFTS["points"], SPAN)
    run = simulate(Scene(lift(time={"fps": 24, "frames": 6}), tmp_path), tmp_path / "run")
    file.write_text(file.read_text().replace("25: ", "24: "))
    with pytest.raises(SceneError) as changed:
        Scene(run.scene, tmp_path)
    assert [issue["path"] for issue in changed.value.issues] == ['collider "c".shape.animated_mesh.frames[0].hash']
    file.unlink()
    with pytest.raises(SceneError, match="there is no file") as gone:
        Scene(run.scene, tmp_path)
    assert [issue["path"] for issue in gone.value.issues] == ['collider "c".shape.mesh.path']


def test_words_of_the_mesh_can_be_overridden(tmp_path: Path, scene_file: Callable[..., Path]) -> None:
    write(tmp_path, LIFTS["points"], SPAN)
    file = scene_file(lift())
    moved = Scene.load(file, ["collider.c.shape.mesh.translate=[0, 0, 5]", "time.frames=12"])
    assert len(moved.to_dict()["collider"][0]["shape"]["animated_mesh"]["frames"]) == 13
    world = World(moved.replace("collider.c.shape.mesh.scale=2"))
    world.step(12)
    assert np.allclose(world.frame["c"]["position"][:, 2], 6.0, atol=1e-5)


def test_what_is_to_be_told_of_a_file_is_among_the_warnings(
    tmp_path: Path, scene_file: Callable[..., Path], tumble: Callable[..., Answer]
) -> None:
    write(tmp_path, LIFTS["points"] + '\ndef Points "dust" { }', SPAN)
    write(tmp_path, COMING, SPAN, "coming.usda")
    tree = lift(time={"fps": 24, "frames": 5})
    tree["collider"] += colliders("coming.usda")
    tree["collider"][1] |= {"name": "d"}
    tree["net"] = [{"name": "n", "mesh": {"path": "thing.usda", "translate": [0, 0, 4]}}]
    world = World(Scene(tree, tmp_path))
    told = [(w["code"], w["path"]) for w in world.warnings]
    assert sorted(told) == [
        ("stands-still", 'collider "d".shape.mesh.path'),
        ("stands-still", 'net "n".mesh.path'),
        ("unread-prims", 'collider "c".shape.mesh.path'),
        ("unread-prims", 'net "n".mesh.path'),
    ]
    messages = {w["path"]: w["message"] for w in world.warnings if w["code"] == "stands-still"}
    assert (
        "it cannot move: /flash: faces or points come and go by time code 5" in messages['collider "d".shape.mesh.path']
    )
    assert "only colliders move" in messages['net "n".mesh.path']
    assert simulate(Scene(tree, tmp_path), tmp_path / "run").manifest["warnings"] == world.warnings
    answer = tumble("check", scene_file(tree))
    assert answer.err.count("warning[stands-still]") == 1 and answer.err.count("warning[unread-prims]") == 1


def test_characters_come_from_usd_files(tmp_path: Path) -> None:
    """Their motion, their bones, what is told of them, and what cannot be a figure."""
    file = write(tmp_path, ARM, SPAN)
    words = {"path": "thing.usda", "shell": True, "settle": 0.0, "repeat": False, "rate": 24.0}
    tree = lift(collider=[{"name": "c", "thickness": 0.01, "shape": {"character": words}}])
    tree["hair"] = [{"name": "h", "on": "c", "bone": "high", "count": 3, "length": 0.02, "above": 1.9, "segments": 2}]
    tree["system"] = [{"name": "main", "method": "position_based"}]
    run = simulate(Scene(tree, tmp_path), tmp_path / "run")
    assert run.scene["collider"][0]["shape"]["character"]["path"] == "thing.usda/figure.glb"
    assert np.allclose(run.frame(24)["c"]["position"][2:], [[1, 0, 1], [1, 0, 0.5]], atol=1e-5)
    assert run.frame(24)["h"]["position"][0, 2] < 1.1 < 1.8 < run.frame(0)["h"]["position"][0, 2]
    [told] = run.manifest["warnings"]
    assert told["code"] == "unread-prims" and told["path"] == 'collider "c".shape.character.path'
    assert "blend shapes" in told["message"] and "/arm/skin" in told["message"]
    back = World.restore(tmp_path / "run" / "checkpoints" / "000020.safetensors")
    back.step(4)
    assert back.hash() == run.hashes[24]
    file.write_text(file.read_text().replace("0.70710678", "0.8", 1))
    with pytest.raises(SceneError, match="has changed since this scene was resolved"):
        Scene(run.scene, tmp_path)
    write(tmp_path, LIFTS["points"], SPAN)
    with pytest.raises(
        SceneError, match=r'"c"\.shape\.character\.path: ".*thing\.usda": no mesh in it is bound to a skeleton'
    ):
        Scene(tree, tmp_path)
