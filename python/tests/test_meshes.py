"""Mesh files: mended by `tumble check --repair`, garments from their texture, and meshes of USD files."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from runs import Tree

from tumble import Scene, SceneError, World, load_mesh

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

CUBE = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
FACES = [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]]


def obj(faces: list[list[int]]) -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE]
    return "\n".join([*lines, *("f " + " ".join(map(str, face)) for face in faces)]) + "\n"


def with_cube(spring: Tree) -> Tree:
    return spring | {"collider": [{"name": "a.cube", "shape": {"mesh": {"path": "meshes/cube.obj", "resolution": 8}}}]}


def write(folder: Path, text: str) -> Path:
    (folder / "meshes").mkdir(exist_ok=True)
    file = folder / "meshes" / "cube.obj"
    file.write_text(text)
    return file


def test_a_broken_mesh_is_mended_beside_the_original(
    spring: Tree, scene_file: SceneFile, tumble: Command, tmp_path: Path
) -> None:
    # A face inside out, one there twice, and a triangle without area.
    broken = obj([FACES[0][::-1], *FACES[1:], FACES[3], [1, 1, 2]])
    file, scene = write(tmp_path, broken), scene_file(with_cube(spring))
    refused = tumble("check", scene)
    assert refused.code == 2 and "inconsistent edges" in refused.err
    answer = tumble("check", scene, "--repair")
    assert answer.code == 0, answer.err
    assert "2 triangles dropped as duplicates, 1 triangle dropped for having no area, 2 triangles flipped" in answer.out
    new = tmp_path / "meshes" / "cube.repaired.obj"
    assert 'collider "a.cube".shape.mesh.path = "meshes/cube.repaired.obj"' in answer.out
    vertices, triangles = load_mesh(new)
    assert len(vertices) == 8 and len(triangles) == 12
    six = np.einsum(
        "ij,ij->i", vertices[triangles[:, 0]], np.cross(vertices[triangles[:, 1]], vertices[triangles[:, 2]])
    )
    assert abs(six.sum() / 6 - 1) < 1e-12
    assert file.read_text() == broken and sorted(p.name for p in new.parent.iterdir()) == [
        "cube.obj",
        "cube.repaired.obj",
    ]
    # The command that it ends with runs what was mended.
    assert re.search(r"fine: tumble run .*collider\.0\.shape\.mesh\.path=", answer.out), answer.out
    again = tumble("check", scene, "--repair")
    assert again.code == 2 and "--force" in again.err
    new.write_text("")
    assert tumble("check", scene, "--repair", "--force").code == 0 and len(load_mesh(new)[1]) == 12


def test_lines_to_change_are_told(tumble: Command, tmp_path: Path) -> None:
    write(tmp_path, obj([*FACES, FACES[0]]))
    scene = tmp_path / "scene.toml"
    scene.write_text('version = 1\n[[net]]\nname = "n"\nmesh.path = "meshes/cube.obj"\n')
    answer = tumble("check", scene, "--repair")
    assert answer.code == 0 and f'{scene}, line 4: net "n".mesh.path = "meshes/cube.repaired.obj"' in answer.out, (
        answer.out
    )


def test_a_sound_mesh_is_left_alone(spring: Tree, scene_file: SceneFile, tumble: Command, tmp_path: Path) -> None:
    write(tmp_path, obj(FACES))
    answer = tumble("check", scene_file(with_cube(spring)), "--repair")
    assert answer.code == 0 and "nothing to repair" in answer.out
    assert [p.name for p in (tmp_path / "meshes").iterdir()] == ["cube.obj"]
    assert "has no mesh files" in tumble("check", scene_file(spring, "other.json"), "--repair").out


def test_what_is_still_wrong_is_told(spring: Tree, scene_file: SceneFile, tumble: Command, tmp_path: Path) -> None:
    write(tmp_path, obj([*FACES[:5], FACES[0]]))  # a side is missing
    answer = tumble("check", scene_file(with_cube(spring)), "--repair")
    assert answer.code == 2 and "4 edges are still open" in answer.out and "4 open" in answer.err
    write(tmp_path, "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n")
    nothing = tumble("check", scene_file(with_cube(spring)), "--repair", "--force")
    assert nothing.code == 2 and "no triangle has an area" in nothing.err


def quads(n: int, off: float = 0.0) -> str:
    """A square metre of n x n squares with texture, each with vertices of its own, `off` by off in turn."""
    lines, k = [], 0
    for j in range(n):
        for i in range(n):
            for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                k += 1
                lines.append(f"v {a / n + off * (k % 3)!r} {b / n + off * (k % 2)!r} 0\nvt {a / n!r} {b / n!r}")
            lines.append("f " + " ".join(f"{m}/{m}" for m in range(k - 3, k + 1)))
    return "\n".join(lines) + "\n"


def with_net(**words: Any) -> Tree:
    net = {"name": "n", "mesh": {"path": "meshes/cube.obj"}, **words}
    return {"version": 1, "time": {"frames": 2}, "net": [net]}


def test_an_unsound_net_is_told_by_check_and_run(scene_file: SceneFile, tumble: Command, tmp_path: Path) -> None:
    write(tmp_path, obj([*FACES[:5], FACES[0], [2, 6, 8, 4], [1, 1, 2]]) + "v 9 9 9\n")
    scene = scene_file(with_net())
    told = 'net "n".mesh: 2 triangles are duplicates, 1 triangle has no area'
    for verb in ("check", "run"):
        answer = tumble(verb, scene)
        assert answer.code == 0, answer.err
        assert told in answer.err and "1 vertex belongs to no triangle" in answer.err and "--repair" in answer.err, (
            answer.err
        )
        assert answer.err.count('net "n".mesh') == 1
    answer = tumble("check", scene, "--repair")
    assert answer.code == 0 and "warning" not in answer.err and "1 vertex of no triangle dropped" in answer.out, answer
    # The command at its end runs without warnings.
    write(tmp_path, obj(FACES))
    assert 'net "n"' not in tumble("check", scene).err


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-7])
def test_vertices_that_rounding_moved_apart_are_sewn(
    off: float, scene_file: SceneFile, tumble: Command, tmp_path: Path
) -> None:
    file = write(tmp_path, quads(4, off))
    scene = scene_file(with_net())
    assert 'net "n".mesh: 48 open edges coincide with others' in tumble("check", scene).err
    answer = tumble("check", scene, "--repair")
    assert answer.code == 0 and "39 vertices sewn to others" in answer.out and "coincide with others" not in answer.err
    vertices, triangles = load_mesh(file.with_name("cube.repaired.obj"))
    assert len(vertices) == 25 and len(triangles) == 32 and vertices.max() <= 1 + 2 * off


def test_texture_of_nets_arrives_in_usd(scene_file: SceneFile, tumble: Command, tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    write(tmp_path, quads(3))
    scene = scene_file(
        with_net() | {"cloth": [{"name": "c", "panels": [{"name": "a", "outline": [[0, 0], [2, 0], [0, 1]]}]}]}
    )
    assert tumble("run", scene, "--usd").code == 0
    stage = Usd.Stage.Open(str(tmp_path / "out" / "scene" / "scene.usda"))
    for name, factor in (("n", 1.0), ("c", 1.0)):
        prim = stage.GetPrimAtPath(f"/scene/{name}")
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying and str(st.GetTypeName()) == "texCoord2f[]"
        mesh = UsdGeom.Mesh(prim)
        corners = np.array(mesh.GetPointsAttr().Get(0))[np.array(mesh.GetFaceVertexIndicesAttr().Get(0))]
        # Texture is the place: of the net in the xy plane, of the panel, which hangs, in its own.
        assert len(st.Get()) == len(corners) > 0
        np.testing.assert_allclose(
            np.array(st.Get()), factor * corners[:, [0, 1] if name == "n" else [0, 2]], atol=1e-6
        )
    assert not UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/scene/c")).GetPrimvar("other").HasValue()
    # And is read again from there.
    world = World(
        Scene({"version": 1, "net": [{"name": "n", "mesh": {"path": "out/scene/scene.usda"}}]}, folder=tmp_path)
    )
    assert world.topology["n"]["texture"].shape[1:] == (6,)


USDA = """#usda 1.0
(
    upAxis = "Z"
    metersPerUnit = 1
)

def Xform "body"
{
    double3 xformOp:translate = (0, 0, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Mesh "sheet"
    {
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0.625, 0), (1, 0), (1, 0.5), (0.625, 0.5)] (
            interpolation = "faceVarying"
        )
    }
}
"""


def test_meshes_of_usd_files(tmp_path: Path) -> None:
    from pxr import Usd

    (tmp_path / "sheet.usda").write_text(USDA)
    Usd.Stage.Open(str(tmp_path / "sheet.usda")).Export(str(tmp_path / "sheet.usdc"))
    for name in ("sheet.usda", "sheet.usdc"):
        vertices, triangles = load_mesh(tmp_path / name)
        assert vertices.tolist() == [[x, y, 2] for y in (0, 1) for x in (0, 1, 2)]
        assert triangles.tolist() == [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    # Left-handed ones, and such that a transform mirrors, are turned; both at once are not.
    scale = USDA.replace("double3 xformOp:translate = (0, 0, 2)", "double3 xformOp:scale = (-1, 1, 1)")
    scale = scale.replace("xformOp:translate", "xformOp:scale")
    left = 'int[] faceVertexCounts = [4, 4]\n        uniform token orientation = "leftHanded"'
    for text, first in (
        (scale, [0, 3, 4]),
        (USDA.replace("int[] faceVertexCounts = [4, 4]", left), [0, 3, 4]),
        (scale.replace("int[] faceVertexCounts = [4, 4]", left), [0, 1, 4]),
    ):
        (tmp_path / "turned.usda").write_text(text)
        assert load_mesh(tmp_path / "turned.usda")[1][0].tolist() == first


def test_a_garment_from_usd_is_that_from_obj(tmp_path: Path) -> None:
    (tmp_path / "sheet.usda").write_text(USDA)
    flat = [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0.625, 0), (1, 0), (1, 0.5), (0.625, 0.5)]
    lines = [f"v {x} {y} 2" for y in (0, 1) for x in (0, 1, 2)] + [f"vt {u} {v}" for u, v in flat]
    lines += ["f 1/1 2/2 5/3 4/4", "f 2/5 3/6 6/7 5/8"]
    (tmp_path / "sheet.obj").write_text("\n".join(lines))
    hashes = []
    for name in ("sheet.usda", "sheet.obj"):
        net = {"name": "n", "mesh": {"path": name}, "pattern": {"scale": 2.0}, "fabric": "denim"}
        world = World(Scene({"version": 1, "net": [net]}, tmp_path))
        # The second panel is 3/4 as wide as the mesh.
        assert world.ledger["elastic"] > 1.0
        world.step()
        hashes.append(world.hash())
    assert hashes[0] == hashes[1]


def test_usd_files_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bad.usda").write_text("#usda 1.0\nnonsense")
    with pytest.raises(SceneError, match=r"bad\.usda.*cannot open"):
        load_mesh(tmp_path / "bad.usda")
    (tmp_path / "empty.usda").write_text("#usda 1.0\n")
    with pytest.raises(SceneError, match=r"empty\.usda.*no mesh"):
        load_mesh(tmp_path / "empty.usda")
    (tmp_path / "odd.usda").write_text(USDA.replace("[4, 4]", "[4, 5]"))
    with pytest.raises(SceneError, match=r"/body/sheet.*do not fit"):
        load_mesh(tmp_path / "odd.usda")
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(SceneError, match=r"usd-core.*not installed.*OBJ"):
        load_mesh(tmp_path / "empty.usda")
