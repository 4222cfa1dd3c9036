"""Skinned figures of USD files as GLB: bones, skin and animation, against the skinning of OpenUSD itself."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_usd_in import ARM, SPAN, TETRAHEDRON, write

from tumble import Scene, World, usd
from tumble.usd.motion import Motion
from tumble.usd.told import of_figure

pytest.importorskip("pxr")
from pxr import Gf, Usd, UsdGeom, UsdSkel


def rows(*numbers: float) -> Any:
    return Gf.Matrix4d().SetTranslate(Gf.Vec3d(*numbers))


def worm(file: Path, sides: int = 6, rings: int = 9) -> Path:
    """A tube of 40 cm along y, in centimetres with y up, bound to three of four joints in an order of its own, beside where
    it is bound; the joints bend and grow, and the whole walks."""
    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetStartTimeCode(3)
    stage.SetEndTimeCode(15)
    stage.SetTimeCodesPerSecond(12)
    root = UsdSkel.Root.Define(stage, "/worm")
    walk = root.AddTranslateOp()
    walk.Set((0, 0, 0), 3)
    walk.Set((0, 10, 50), 15)
    root.AddRotateYOp().Set(30)
    skeleton = UsdSkel.Skeleton.Define(stage, "/worm/skel")
    skeleton.CreateJointsAttr(["foot", "foot/a", "foot/a/b", "foot/spare"])
    skeleton.CreateBindTransformsAttr([rows(0, 0, 0), rows(0, 13, 0), rows(0, 26, 0), rows(9, 0, 0)])
    skeleton.CreateRestTransformsAttr([rows(0, 0, 0), rows(0, 13, 0), rows(0, 13, 0), rows(9, 0, 0)])
    bend = UsdSkel.Animation.Define(stage, "/worm/skel/crawl")
    bend.CreateJointsAttr(["foot/a/b", "foot/a"])
    moves, turns, sizes = bend.CreateTranslationsAttr(), bend.CreateRotationsAttr(), bend.CreateScalesAttr()
    for code in range(3, 16):
        share = (code - 3) / 12
        turn = Gf.Quatf(float(np.cos(share)), Gf.Vec3f(float(np.sin(share)), 0, 0))
        moves.Set([Gf.Vec3f(0, 13 + 4 * share, 0), Gf.Vec3f(share, 13, 0)], code)
        turns.Set([turn, Gf.Quatf(float(np.cos(share / 2)), Gf.Vec3f(0, 0, float(np.sin(share / 2))))], code)
        sizes.Set([Gf.Vec3h(1 + share, 1, 1), Gf.Vec3h(1, 1, 1)], code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/worm/skel/crawl"])
    mesh = UsdGeom.Mesh.Define(stage, "/worm/skin")
    y = np.repeat(np.linspace(0, 40, rings), sides)
    angle = np.tile(2 * np.pi * np.arange(sides) / sides, rings)
    # As it stands in the file, 5 cm beside its place.
    mesh.CreatePointsAttr(
        [Gf.Vec3f(*map(float, x)) for x in np.stack([3 * np.cos(angle) - 5, y, 3 * np.sin(angle)], 1)]
    )
    at = [[r * sides + k, (r + 1) * sides + k, (r + 1) * sides + (k + 1) % sides, r * sides + (k + 1) % sides]
          for r in range(rings - 1) for k in range(sides)]  # fmt: skip
    mesh.CreateFaceVertexIndicesAttr([i for quad in at for i in quad])
    mesh.CreateFaceVertexCountsAttr([4] * len(at))
    skin = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    skin.CreateSkeletonRel().SetTargets(["/worm/skel"])
    skin.CreateGeomBindTransformAttr(rows(5, 0, 0))
    skin.CreateJointsAttr(["foot/a/b", "foot", "foot/a"])
    near = np.maximum(1 - np.abs(y[:, None] - np.array([33.0, 5.0, 19.0])) / 16, 0.05)
    near /= near.sum(axis=1, keepdims=True)
    skin.CreateJointIndicesPrimvar(False, 3).Set([0, 1, 2] * len(y))
    skin.CreateJointWeightsPrimvar(False, 3).Set(near.ravel().tolist())
    stage.Save()
    return file


def tree_of(glb: bytes) -> dict[str, Any]:
    assert glb[:4] == b"glTF" and struct.unpack("<II", glb[4:12]) == (2, len(glb))
    found: dict[str, Any] = json.loads(glb[20 : 20 + struct.unpack("<I", glb[12:16])[0]])
    return found


def walker(folder: Path, glb: bytes, **more: Any) -> World:
    """A world of the figure, from the start of its motion."""
    (folder / "figure.glb").write_bytes(glb)
    words = {"path": "figure.glb", "shell": True, "settle": 0.0, "repeat": False, "rate": 12.0}
    tree = {
        "version": 1,
        "time": {"fps": 12, "frames": 12},
        "particles": [{"name": "p", "position": [[5, 5, 5]]}],
        "collider": [{"name": "c", "thickness": 0.001, "shape": {"character": words}}],
    }
    return World(Scene(tree | more, folder))


def test_figures_move_as_openusd_skins_them(tmp_path: Path) -> None:
    file = worm(tmp_path / "worm.usda")
    world, motion = walker(tmp_path, usd.as_glb(file)), Motion(file)
    for i in (0, 3, 7, 12):
        world.step(i - world.frame_index)
        meant = motion.points(3 + i)
        assert np.allclose(world.frame["c"]["position"], meant, atol=2e-6), i
    # It moves far.
    assert np.abs(motion.points(15) - motion.points(3)).max() > 0.4


def test_bones_have_the_names_of_joints_and_carry_hair(tmp_path: Path) -> None:
    glb = usd.as_glb(worm(tmp_path / "worm.usda"))
    tree = tree_of(glb)
    assert [node["name"] for node in tree["nodes"]] == ["skel", "foot", "a", "b", "spare", "/worm/skin"]
    assert [animation["name"] for animation in tree["animations"]] == ["crawl"]
    hair = {"name": "h", "on": "c", "bone": "b", "count": 5, "length": 0.02, "above": 0.38, "segments": 2}
    world = walker(tmp_path, glb, hair=[hair], system=[{"method": "position_based", "substeps": 20}])
    start = world.frame["h"]["position"][0]
    world.step(12)
    assert np.linalg.norm(world.frame["h"]["position"][0] - start) > 0.1


def test_what_bones_do_not_carry_is_told(tmp_path: Path) -> None:
    lamp = f"""def Mesh "lamp" {{ {TETRAHEDRON}
    double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 3), 25: (0, 0, 9) }}
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Points "dust" {{ }}
"""
    file = write(tmp_path, ARM + lamp, SPAN)
    world = walker(tmp_path, usd.as_glb(file))
    told = of_figure(file)
    assert [code for code, _ in told] == ["unread-prims", "unread-prims", "stands-still"]
    assert "/dust (Points)" in told[0][1] and "blend shapes" in told[1][1] and "/arm/skin" in told[1][1]
    assert "/lamp" in told[2][1]
    # The lamp stands where it is at the start.
    world.step(12)
    assert np.allclose(world.frame["c"]["position"][4:], Motion(file).points(1)[4:], atol=1e-6)


def test_files_without_a_skeleton_and_damaged_skins_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no mesh in it is bound to a skeleton"):
        usd.as_glb(write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON} }}'))
    for old, new, told in (
        ("jointIndices = [0,0,1,1]", "jointIndices = [0,0,1,7]", "joints that its skeleton has not"),
        ("jointWeights = [1,1,1,1]", "jointWeights = [1,1]", "do not fit"),
    ):
        with pytest.raises(ValueError, match=rf"/arm/skin: .*{told}"):
            usd.as_glb(write(tmp_path, ARM.replace(old, new), SPAN, f"{len(told)}.usda"))
