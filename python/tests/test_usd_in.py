"""USD files that come in: units, axes, what is shown, instances, shapes as polygons, and what is animated."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer

import tumble
from tumble import Scene, SceneError, World, load_mesh, usd
from tumble.run import simulate

pytest.importorskip("pxr")
pytestmark = pytest.mark.filterwarnings("ignore::tumble.usd.UsdWarning")

Command = Callable[..., Answer]

HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n{more})\n'
COUNTS = "int[] faceVertexCounts = [3, 3, 3, 3]"
TETRAHEDRON = """
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
"""


def write(folder: Path, body: str, more: str = "", name: str = "thing.usda") -> Path:
    # A statement ends with its line.
    lines = body.replace("{ ", "{\n").replace(" }", "\n}")
    (folder / name).write_text(HEAD.replace("{more}", more) + lines)
    return folder / name


def volume(file: Path) -> float:
    """Of closed meshes whose faces run counter-clockwise seen from outside [m³]."""
    v, t = load_mesh(file)
    return float(np.einsum("ij,ij->i", v[t[:, 0]], np.cross(v[t[:, 1]], v[t[:, 2]])).sum() / 6)


def codes(file: Path) -> dict[str, str]:
    return dict(usd.doubts(file))


def test_axes_and_units_hold_below_transforms_that_start_anew(tmp_path: Path) -> None:
    """Millimetres with y up; one prim is moved by its parent, one throws away what its parent says."""
    body = f"""
def Xform "top" {{
    double3 xformOp:translate = (0, 3000, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "a" {{ {TETRAHEDRON} }}
    def Mesh "b" {{ {TETRAHEDRON}
        double3 xformOp:translate = (0, 0, 500)
        uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
    }}
}}
"""
    file = write(tmp_path, body)
    file.write_text(file.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.001").replace('"Z"', '"Y"'))
    v, _ = load_mesh(file)
    assert np.allclose(v[0], [0, 0, 3]) and np.allclose(v[4], [0, -0.5, 0])
    assert codes(file) == {}


def test_a_file_that_does_not_say_its_unit_is_told(tmp_path: Path) -> None:
    file = write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON} }}')
    file.write_text(file.read_text().replace("    metersPerUnit = 1\n", "").replace('"Z"', '"X"'))
    v, _ = load_mesh(file)
    # x up becomes z up: what was y is x, what was z is y.
    assert np.allclose(v, [[0, 0, 0], [0, 0, 0.01], [0.01, 0, 0], [0, 0.01, 0]])
    assert "centimetres" in codes(file)["unsaid-units"]


@pytest.mark.parametrize(
    ("words", "exact", "low", "high"),
    [
        ('Sphere "s" { double radius = 0.5 }', np.pi / 6, [-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]),
        ('Cube "s" { double size = 3 }', 27.0, [-1.5, -1.5, -1.5], [1.5, 1.5, 1.5]),
        ('Cylinder "s" { double radius = 1\ndouble height = 4\nuniform token axis = "X" }', 4 * np.pi, [-2, -1, -1], [2, 1, 1]),
        ('Cone "s" { double radius = 1\ndouble height = 3\nuniform token axis = "Y" }', np.pi, [-1, -1.5, -1], [1, 1.5, 1]),
        ('Capsule "s" { double radius = 1\ndouble height = 2 }', 2 * np.pi + 4 * np.pi / 3, [-1, -1, -2], [1, 1, 2]),
    ],
)  # fmt: skip
def test_shapes_are_closed_polygons(
    tmp_path: Path, words: str, exact: float, low: list[float], high: list[float]
) -> None:
    file = write(tmp_path, f"def {words}")
    v, t = load_mesh(file)
    assert np.allclose(v.min(axis=0), low, atol=0.02) and np.allclose(v.max(axis=0), high, atol=0.02)
    assert 0.97 * exact < volume(file) < exact * (1 + 1e-9)
    edges = np.sort(np.stack([t, np.roll(t, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert "/s" in codes(file)["read-as-polygons"]
    # As a collider it holds up what falls on it.
    tree = {
        "version": 1,
        "particles": [{"name": "p", "position": [[0.0, 0.0, high[2] + 0.05]]}],
        "collider": [{"name": "c", "friction": 1.0, "shape": {"mesh": {"path": file.name}}}],
    }
    if "Cone" not in words:
        world = World(Scene(tree, tmp_path))
        world.step(12)
        assert abs(world.frame["p"]["position"][0, 2] - high[2]) < 0.02


def test_a_plane_faces_its_axis(tmp_path: Path) -> None:
    for k, axis in enumerate("XYZ"):
        file = write(
            tmp_path, f'def Plane "p" {{ double width = 2\ndouble length = 4\nuniform token axis = "{axis}" }}'
        )
        v, t = load_mesh(file)
        normal = np.cross(v[t[0, 1]] - v[t[0, 0]], v[t[0, 2]] - v[t[0, 0]])
        assert normal[k] > 0 and np.count_nonzero(normal) == 1
        assert np.ptp(v, axis=0).tolist() == [[0, 4, 2], [2, 0, 4], [2, 4, 0]][k]


def test_what_is_not_shown_is_left_out_and_what_cannot_be_used_is_named(tmp_path: Path) -> None:
    body = f"""
def Xform "root" {{
    def Scope "old" {{ token visibility = "invisible"
        def Mesh "m" {{ {TETRAHEDRON} }} }}
    def Mesh "stand_in" {{ uniform token purpose = "proxy" {TETRAHEDRON} }}
    def Mesh "final" {{ uniform token purpose = "render" {TETRAHEDRON} }}
    def BasisCurves "fur" {{ int[] curveVertexCounts = [2]
        point3f[] points = [(0, 0, 0), (0, 0, 1)] }}
    def Points "dust" {{ point3f[] points = [(0, 0, 0)] }}
    def Volume "smoke" {{ }}
    def Mesh "nothing" {{ point3f[] points = [(0, 0, 0)] }}
}}
"""
    file = write(tmp_path, body)
    assert len(load_mesh(file)[0]) == 4
    told = codes(file)
    assert list(told) == ["unread-prims"]
    for name in ("fur (BasisCurves)", "dust (Points)", "smoke (Volume)", "nothing (Mesh without faces)"):
        assert f"/root/{name}" in told["unread-prims"]
    only = write(tmp_path, 'def Mesh "m" { token visibility = "invisible"' + TETRAHEDRON + "}", name="only.usda")
    with pytest.raises(SceneError, match=r"no mesh in it; left out as invisible, guide or proxy: /m"):
        load_mesh(only)


def test_faces_that_are_holes_and_parts_that_are_missing(tmp_path: Path) -> None:
    file = write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON}\n int[] holeIndices = [3] }}')
    assert len(load_mesh(file)[1]) == 3
    gone = write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON} }}\ndef "n" (references = @gone.usda@) {{ }}', name="g.usda")
    load_mesh(gone)
    assert "gone.usda" in codes(gone)["missing-layers"]


def test_a_subdivision_surface_is_told(tmp_path: Path) -> None:
    file = write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON}\n uniform token subdivisionScheme = "catmullClark" }}')
    assert "/m (catmullClark)" in codes(file)["control-mesh"]
    file.write_text(file.read_text().replace("catmullClark", "none") + " ")
    assert codes(file) == {}


INSTANCER = f"""
def PointInstancer "rocks" {{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel prototypes = [</rocks/kinds/small>, </rocks/kinds/big>]
    int[] protoIndices = [0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0), (6, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (0.7071, 0, 0, 0.7071), (1, 0, 0, 0), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 2, 2), (1, 1, 1)]
    int64[] invisibleIds = [3]
    def Scope "kinds" {{
        def Mesh "small" {{ {TETRAHEDRON} }}
        def Xform "big" {{
            double3 xformOp:scale = (3, 3, 3)
            uniform token[] xformOpOrder = ["xformOp:scale"]
            def Mesh "m" {{ {TETRAHEDRON} }} }}
    }}
}}
"""


def test_instances_of_points_are_placed(tmp_path: Path) -> None:
    file = write(tmp_path, INSTANCER)
    v, t = load_mesh(file)
    assert len(t) == 12 and np.isclose(volume(file), (1 + 27 + 8) / 6, rtol=1e-3)
    assert np.allclose(v[0], [10, 0, 0]) and np.allclose(v[8:].max(axis=0), [16, 2, 2])
    # A quarter turn about z: x becomes y.
    assert np.allclose(v[5], [12, 3, 0], atol=2e-3)
    assert codes(file) == {}
    over = write(tmp_path, INSTANCER.replace('def Scope "kinds"', 'over "kinds"'), name="over.usda")
    assert np.array_equal(load_mesh(over)[0], v)
    damaged = write(tmp_path, INSTANCER.replace("[0, 1, 0, 1]", "[0, 1, 0, 7]"), name="d.usda")
    with pytest.raises(SceneError, match=r"/rocks.*prototypes that are not there"):
        load_mesh(damaged)


def test_instances_without_end_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    itself = write(tmp_path, INSTANCER.replace("[</rocks/kinds/small>, ", "[</rocks>, "), name="itself.usda")
    with pytest.raises(SceneError, match=r"/rocks: is an instance of itself"):
        load_mesh(itself)
    monkeypatch.setattr("tumble.usd.stage.MOST", 11)
    with pytest.raises(SceneError, match=r"more than 11 points, instances included"):
        load_mesh(write(tmp_path, INSTANCER))


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (TETRAHEDRON.replace("[3, 3, 3, 3]", "None"), r"/m: its faces do not fit"),
        (TETRAHEDRON.replace("point3f[] points = [(0, 0, 0)", "point3f[] points = [(nan, 0, 0)"), r"not finite|numbers"),
        (TETRAHEDRON.replace("[3, 3, 3, 3]", "[]"), r"no mesh in it.*/m \(Mesh without faces\)|do not fit"),
        (TETRAHEDRON.replace(COUNTS, 'string[] faceVertexCounts = ["x"]'), r"/m: has a value of the wrong type"),
        (TETRAHEDRON.replace("[0, 2, 1,", "[0, 2, -1,"), r"/m: its faces do not fit"),
        (TETRAHEDRON + 'float xformOp:transform = 3\nuniform token[] xformOpOrder = ["xformOp:transform"]', "OpenUSD cannot"),
    ],
)  # fmt: skip
def test_values_that_do_not_belong_there_are_told(tmp_path: Path, body: str, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        load_mesh(write(tmp_path, f'def Mesh "m" {{ {body} }}'))


def test_an_axis_and_a_rate_that_there_are_not(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"/c: has a value of the wrong type"):
        load_mesh(write(tmp_path, 'def Cone "c" { uniform token axis = "W" }'))
    with pytest.raises(ValueError, match="no numbers"):
        usd.bake(write(tmp_path, ARM, SPAN.replace("= 24\n", "= 0\n")), tmp_path / "a")
    with pytest.raises(ValueError, match="more than 100000 frames"):
        usd.bake(write(tmp_path, ARM, SPAN.replace("= 25", "= 1e9"), "long.usda"), tmp_path / "a")
    # A stage that ends before it starts has one frame.
    assert len(usd.bake(write(tmp_path, ARM, SPAN.replace("= 25", "= -9"), "b.usda"), tmp_path / "a")) == 1


def test_native_instances_are_read(tmp_path: Path) -> None:
    body = f"""
class "kind" {{ def Mesh "m" {{ {TETRAHEDRON} }} }}
def Xform "a" (instanceable = true
    inherits = </kind>) {{ }}
def Xform "b" (instanceable = true
    inherits = </kind>) {{
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    v, _ = load_mesh(write(tmp_path, body))
    assert len(v) == 8 and v[4:, 2].min() == 5
    # What is animated within them moves, over the time of its samples.
    moves = 'def Mesh "m" {\ndouble3 xformOp:translate.timeSamples = { 12: (0, 0, 0), 36: (1, 0, 0) }\n'
    moves += 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    frames = usd.bake(write(tmp_path, body.replace('def Mesh "m" {', moves), name="moves.usda"), tmp_path / "moves")
    assert len(frames) == 25 and np.allclose(load_mesh(frames[-1][1])[0] - v, [1, 0, 0])


ARM = """
def SkelRoot "arm" (prepend apiSchemas = ["SkelBindingAPI"]) {
    def Skeleton "skel" (prepend apiSchemas = ["SkelBindingAPI"]) {
        uniform token[] joints = ["low", "low/high"]
        uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)),
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,1,1))]
        uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)),
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,1,1))]
        rel skel:animationSource = </arm/skel/wave>
        def SkelAnimation "wave" {
            uniform token[] joints = ["low", "low/high"]
            float3[] translations = [(0,0,0),(0,0,1)]
            half3[] scales = [(1,1,1),(1,1,1)]
            quatf[] rotations.timeSamples = { 1: [(1,0,0,0),(1,0,0,0)], 25: [(1,0,0,0),(0.70710678,0,0.70710678,0)] }
            uniform token[] blendShapes = ["fat"]
            float[] blendShapeWeights.timeSamples = { 1: [0], 25: [1] }
        }
    }
    def Mesh "skin" (prepend apiSchemas = ["SkelBindingAPI"]) {
        rel skel:skeleton = </arm/skel>
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 3, 2]
        point3f[] points = [(0,0,0),(0.5,0,0),(0,0,2),(0.5,0,2)]
        int[] primvars:skel:jointIndices = [0,0,1,1] ( elementSize = 1
            interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1,1,1,1] ( elementSize = 1
            interpolation = "vertex" )
        uniform token[] skel:blendShapes = ["fat"]
        rel skel:blendShapeTargets = </arm/skin/fat>
        def BlendShape "fat" {
            uniform vector3f[] offsets = [(0,-1,0),(0,-1,0)]
            uniform int[] pointIndices = [0,1]
        }
    }
}
"""
SPAN = "    startTimeCode = 1\n    endTimeCode = 25\n    timeCodesPerSecond = 24\n"


def scene(path: str, **more: Any) -> dict[str, Any]:
    return {
        "version": 1,
        "time": {"fps": 24, "frames": 24},
        "particles": [{"name": "p", "position": [[0.5, 0.5, 9]]}],
        "collider": [{"name": "c", "thickness": 0.01, "shape": {"mesh": {"path": path, "shell": True}}, **more}],
    }


def test_the_motion_of_skeletons_and_blend_shapes_is_written_as_meshes(
    tmp_path: Path, scene_file: Callable[..., Path], tumble: Command
) -> None:
    write(tmp_path, ARM, SPAN)
    file = scene_file(scene("thing.usda"))
    moving = tumble("check", file)
    assert moving.code == 0 and "warning" not in moving.err
    answer = tumble("check", file, "--bake")
    assert answer.code == 0 and "warning" not in answer.err, answer.err
    baked = tmp_path / "scene.baked.json"
    assert f"fine: tumble run {baked}" in answer.out
    run = simulate(Scene.load(baked), tmp_path / "run")
    rest = [[0, 0, 0], [0.5, 0, 0], [0, 0, 2], [0.5, 0, 2]]
    assert np.allclose(run.frame(0)["c"]["position"], rest, atol=1e-6)
    # A blend shape moves the lower points, a quarter turn about y the upper ones.
    late = [[0, -1, 0], [0.5, -1, 0], [1, 0, 1], [1, 0, 0.5]]
    assert np.allclose(run.frame(24)["c"]["position"], late, atol=1e-5)
    half = np.sqrt(0.5)
    assert np.allclose(run.frame(12)["c"]["position"][2], [half, 0, 1 + half], atol=1e-5)
    again = tumble("check", file, "--bake")
    assert again.code == 2 and "--force" in again.err
    assert tumble("check", file, "--bake", "--force").code == 0


@pytest.mark.parametrize(("rate", "count"), [("24", 25), ("25", 25), ("60", 25), ("24\n    framesPerSecond = 36", 37)])
def test_poses_come_at_their_times_at_any_rate(tmp_path: Path, rate: str, count: int) -> None:
    """The weight of a blend shape goes from 0 to 1 in 24 time codes; so does a point, times -1."""
    file = write(tmp_path, ARM, SPAN.replace("= 24\n", f"= {rate}\n"))
    per_second = float(rate.split("\n")[0])
    frames = usd.bake(file, tmp_path / "arm")
    assert len(frames) == count and abs(frames[-1][0] - 24 / per_second) < 1e-9
    for time, path in frames:
        assert abs(load_mesh(path)[0][0, 1] + time * per_second / 24) < 1e-5, time


def test_the_last_moment_of_a_file_is_taken(tmp_path: Path) -> None:
    """Though it is on no frame."""
    file = write(tmp_path, ARM, SPAN.replace("= 24\n", "= 24\n    framesPerSecond = 7\n"))
    times = [time for time, _ in usd.bake(file, tmp_path / "arm")]
    assert np.allclose(times, [0, 1 / 7, 2 / 7, 3 / 7, 4 / 7, 5 / 7, 6 / 7, 1])
    file = write(tmp_path, ARM, SPAN.replace("= 24\n", "= 24\n    framesPerSecond = 5\n").replace("= 25", "= 24"))
    assert np.allclose([time for time, _ in usd.bake(file, tmp_path / "a")], [0, 0.2, 0.4, 0.6, 0.8, 23 / 24])


def test_points_and_transforms_over_time_carry_what_lies_on_them(tmp_path: Path) -> None:
    """A lift whose points rise 0.5 m and whose parent rises another 0.5 m within a second, in centimetres with y up."""
    corners = "[(-100, {0}, -100), (100, {0}, -100), (100, {0}, 100), (-100, {0}, 100)]"
    body = f"""
def Xform "shaft" {{
    double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 12: (0, 50, 0) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "lift" {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 3, 2, 1]
        point3f[] points.timeSamples = {{ 0: {corners.format(0)}, 12: {corners.format(50)} }}
    }}
}}
"""
    file = write(tmp_path, body, "    timeCodesPerSecond = 12\n    framesPerSecond = 12\n")
    file.write_text(file.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01").replace('"Z"', '"Y"'))
    frames = usd.bake(file, tmp_path / "lift")
    assert [round(12 * time) for time, _ in frames] == list(range(13))
    words = [{"time": time, "path": str(path)} for time, path in frames]
    tree = scene("") | {
        "particles": [{"name": "p", "position": [[0.2, 0.1, 0.01]]}],
        "collider": [{"name": "c", "thickness": 0.01, "shape": {"animated_mesh": {"frames": words, "shell": True}}}],
    }
    world = World(Scene(tree))
    world.step(24)
    assert np.allclose(world.frame["c"]["position"][:, 2], 1.0, atol=1e-5)
    assert 0.99 < world.frame["p"]["position"][0, 2] < 1.06
    # What is cut off at the end of the scene is not written.
    assert len(usd.bake(file, tmp_path / "short", 0.25)) == 4 and len(list((tmp_path / "short").iterdir())) == 4


def test_faces_that_come_and_go_are_refused(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    body = f"""def Mesh "a" {{ {TETRAHEDRON} }}
def Mesh "flash" {{ token visibility.timeSamples = {{ 1: "inherited", 5: "invisible" }} {TETRAHEDRON} }}
"""
    write(tmp_path, body, SPAN)
    answer = tumble("check", scene_file(scene("thing.usda")), "--bake")
    assert answer.code == 2 and "/flash: faces or points come and go by time code 5" in answer.err
    assert not (tmp_path / "scene.baked.json").exists()


def test_nothing_to_bake_is_said_and_a_net_starts_from_the_first_time(
    tmp_path: Path, scene_file: Callable[..., Path], tumble: Command
) -> None:
    write(tmp_path, ARM, SPAN)
    tree = {"version": 1, "time": {"frames": 1}, "net": [{"name": "n", "mesh": {"path": "thing.usda"}}]}
    answer = tumble("check", scene_file(tree), "--bake")
    assert answer.code == 0 and "no collider of the scene is a USD file that moves" in answer.out
    assert "only colliders move" in answer.err and "--bake`" not in answer.err
    run = simulate(Scene(tree, tmp_path), tmp_path / "run")
    assert [w["code"] for w in run.manifest["warnings"]].count("stands-still") == 1


def test_python_is_warned(tmp_path: Path) -> None:
    file = write(tmp_path, f'def Mesh "m" {{ {TETRAHEDRON} }}\ndef Points "dust" {{ }}')
    with pytest.warns(usd.UsdWarning, match=r"left out.*: /dust \(Points\);"):
        tumble.load_mesh(file)
    with pytest.warns(usd.UsdWarning, match=r"animated.*: /arm/skin; tumble\.usd\.bake writes their motion"):
        tumble.load_mesh(write(tmp_path, ARM, SPAN, "arm.usda"))


def test_a_camera_of_a_file_is_the_scene_s(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    """In centimetres with y up: 3 m before the origin and 1 m above the ground, level, looking along the file's -z."""
    body = """
def Xform "rig" {
    double3 xformOp:translate = (20, 100, 300)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Camera "eye" {
        float focalLength = 30
        float horizontalAperture = 36
        float verticalAperture = 18
        float focusDistance = 250
    }
    def Camera "rolled" {
        float xformOp:rotateZ.timeSamples = { 1: 20, 5: 40 }
        uniform token[] xformOpOrder = ["xformOp:rotateZ"]
    }
}
"""
    file = write(tmp_path, body)
    file.write_text(file.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01").replace('"Z"', '"Y"'))
    scene = scene_file({"version": 1, "time": {"frames": 1}, "particles": [{"name": "p", "position": [[0, 0, 0]]}]})
    answer = tumble("check", scene, "--camera", f"{file}:/rig/eye")
    assert answer.code == 0 and "warning" not in answer.err, answer.err
    assert "position = [0.2, -3.0, 1.0]" in answer.out and "target = [0.2, -0.5, 1.0]" in answer.out
    assert "view_angle = 61.9275" in answer.out and "resolution = [640, 320]" in answer.out
    assert "--set 'camera.position=[0.2, -3.0, 1.0]'" in answer.out
    rolled = tumble("check", scene, "--camera", f"{file}:/rig/rolled")
    assert "rolled by 20°" in rolled.err and "1 more of" not in rolled.err and "moves" in rolled.err
    assert "several cameras; name one of /rig/eye, /rig/rolled" in tumble("check", scene, "--camera", file).err
    assert "no camera /rig/x" in tumble("check", scene, "--camera", f"{file}:/rig/x").err
    assert "no such USD file" in tumble("check", scene, "--camera", "gone.usda").err


@pytest.mark.parametrize("roll", [0.0, 30.0, 150.0, 180.0, -120.0])
def test_rolls_of_cameras_are_told(tmp_path: Path, roll: float) -> None:
    body = f"""
def Camera "eye" {{
    float focalLength = 30
    float xformOp:rotateZ = {roll}
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]
}}
"""
    file = write(tmp_path, body)
    file.write_text(file.read_text().replace('"Z"', '"Y"'))
    _, doubts = usd.camera(file)
    assert [message for _, message in doubts] == [
        message for message in [f"/eye is rolled by {abs(roll):.3g}°, and cameras of scenes stand upright"] if roll
    ]


def test_the_camera_of_a_run_comes_back(tmp_path: Path, scene_file: Callable[..., Path]) -> None:
    from tumble.export.usd import write as export

    tree = {
        "version": 1,
        "time": {"frames": 1},
        "camera": {"position": [1.5, -4, 2], "target": [0, 0.25, 0.5], "view_angle": 40, "resolution": [320, 200]},
        "particles": [{"name": "p", "position": [[0, 0, 0]]}],
    }
    words, doubts = usd.camera(export(simulate(tree, tmp_path / "run"), tmp_path))
    assert doubts == [] and np.allclose(words["position"], [1.5, -4, 2], atol=1e-5)
    along = np.array(words["target"]) - words["position"]
    meant = np.array([-1.5, 4.25, -1.5])
    assert np.allclose(along / np.linalg.norm(along), meant / np.linalg.norm(meant), atol=1e-5)
    assert abs(words["view_angle"] - 40) < 1e-3 and words["resolution"] == [640, 400]


def test_a_repair_keeps_the_motion(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    """A tetrahedron that moves, one of whose faces has points of its own and one of which is there twice, inside out."""
    body = """
def Mesh "m" {
    int[] faceVertexCounts = [3, 3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 4, 5, 6, 6, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 25: (0, 0, 2) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    write(tmp_path, body, SPAN)
    tree = scene("thing.usda")
    tree["collider"][0] = {"name": "c", "shape": {"mesh": {"path": "thing.usda"}}}
    file = scene_file(tree)
    assert tumble("check", file).code == 2
    # All frames are mended alike, which takes files, whether they are asked for or not.
    answer = tumble("check", file, "--repair")
    assert answer.code == 0 and "nothing to repair" not in answer.out, answer
    assert tumble("check", file, "--bake", "--repair").code == 2
    assert tumble("check", file, "--bake", "--repair", "--force").code == 0
    world = World(Scene.load(tmp_path / "scene.baked.json"))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    for frame in (0, 12, 24):
        x = world.frame["c"]["position"]
        assert np.allclose(sorted(x.tolist()), sorted((corners + np.array([0, 0, frame / 12])).tolist()), atol=1e-5)
        world.step(12)
