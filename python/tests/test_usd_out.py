"""What other programs need of a stage: quadrangles, texture coordinates, ids, rest, velocities, lights."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest
from conftest import Answer

from tumble import Run, Scene
from tumble.export import usd
from tumble.export.parts import on_surface, squares
from tumble.run import simulate

pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdLux, UsdShade

Tree = dict[str, Any]


def stage_of(tree: Tree, folder: Path) -> Any:
    run = simulate(Scene({"version": 1, "output": {"plot": False}} | tree, folder), folder / "run")
    return Usd.Stage.Open(str(usd.write(run, folder)))


def primvar(stage: Any, path: str, name: str, time: float = 0) -> tuple[Any, str]:
    found = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(path)).GetPrimvar(name)
    return np.array(found.Get(time)), str(found.GetInterpolation())


SHEET = {"name": "s", "size": [0.6, 0.3], "resolution": [7, 4], "rotate": [90, 0, 30], "center": [1, 2, 3]}


@pytest.mark.parametrize("more", [{}, {"fabric": "denim"}])
def test_sheets_are_quadrangles_with_texture_in_metres(tmp_path: Path, more: Tree) -> None:
    """Whichever way the diagonals of its triangles run."""
    stage = stage_of({"time": {"frames": 2}, "sheet": [SHEET | more]}, tmp_path)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/s"))
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {4} and len(mesh.GetFaceVertexCountsAttr().Get()) == 18
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    st, interpolation = primvar(stage, "/scene/s", "st")
    assert interpolation == "faceVarying" and len(st) == len(corners)
    # Texture is as long as the sheet, in every direction, and each point has one.
    points = np.array(mesh.GetPointsAttr().Get(0))[corners].reshape(-1, 4, 3)
    flat = st.reshape(-1, 4, 2)
    for k in range(4):
        lengths = (np.linalg.norm(a[:, k] - a[:, k - 1], axis=1) for a in (points, flat))
        assert np.allclose(*lengths, atol=1e-6)
    # Counter-clockwise, as the triangles are.
    e, f = flat[:, 1] - flat[:, 0], flat[:, 3] - flat[:, 0]
    assert np.allclose(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0], 0.01)
    assert st.min() == 0 and np.allclose(st.max(axis=0), [0.6, 0.3])
    assert len({(int(c), *np.round(t, 6)) for c, t in zip(corners, st.tolist(), strict=True)}) == 28
    # Fans around the first corners are the triangles that were simulated.
    fans = corners.reshape(-1, 4)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    simulated = Run(tmp_path / "run").static["s"]["triangles"].reshape(-1, 3)
    assert {frozenset(t) for t in fans.tolist()} == {frozenset(t) for t in simulated.tolist()}
    rest, interpolation = primvar(stage, "/scene/s", "rest", 2)
    assert interpolation == "vertex" and np.array_equal(rest, np.array(mesh.GetPointsAttr().Get(0)))
    assert not np.array_equal(rest, np.array(mesh.GetPointsAttr().Get(2)))


def test_blocks_are_quadrangles_with_normals_of_their_sides(tmp_path: Path) -> None:
    block = {"name": "b", "size": [1, 1, 1], "resolution": [3, 3, 3], "material": {"young": 1e5, "poisson": 0.3}}
    stage = stage_of({"time": {"frames": 1}, "block": [block]}, tmp_path)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/b"))
    assert list(mesh.GetFaceVertexCountsAttr().Get()) == [4] * 24
    x = np.array(mesh.GetPointsAttr().Get(0))[np.array(mesh.GetFaceVertexIndicesAttr().Get())].reshape(-1, 4, 3)
    faces = np.cross(x[:, 1] - x[:, 0], x[:, 3] - x[:, 0]) / 0.25
    assert np.allclose(np.array(mesh.GetNormalsAttr().Get(0)).reshape(-1, 4, 3), faces[:, None], atol=1e-6)
    # They are those of a closed surface, seen from outside.
    assert np.isclose(np.einsum("ij,ij->i", x.mean(axis=1), faces).sum() * 0.25 / 3, 1.0)


def test_triangles_that_are_no_pairs_stay_triangles() -> None:
    assert squares(np.array([[0, 1, 2], [3, 4, 5]])) is None
    assert squares(np.array([[0, 1, 2], [0, 2, 1]])) is not None  # two sides of one
    assert squares(np.array([[0, 1, 2]])) is None
    found = squares(np.array([[0, 1, 2], [2, 1, 3]]))
    assert found is not None and np.array([0, 1, 2, 2, 1, 3])[found[0]].tolist() == [1, 3, 2, 0]


def test_ids_are_whole_numbers_that_all_programs_read(tmp_path: Path) -> None:
    run = fake_run.fountain()
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    for i in range(1, run.n_frames):
        ids, interpolation = primvar(stage, "/scene/spray", "id", i)
        assert ids.dtype == np.int32 and interpolation == "vertex"
        np.testing.assert_array_equal(ids, run.frame(i)["spray"]["id"])
    still = Usd.Stage.Open(str(usd.write(fake_run.studio(), tmp_path / "still")))
    assert primvar(still, "/scene/masses", "id")[0].tolist() == [0, 1, 2]


def test_strands_have_ids_rest_and_the_texture_of_their_roots(tmp_path: Path) -> None:
    """On a square of 2 m whose texture is turned by a quarter."""
    (tmp_path / "skin.obj").write_text(
        "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3 4/4\n"
    )
    tree = {
        "time": {"frames": 1},
        "hair": [{"name": "fur", "on": "skin", "count": 40, "length": 0.1, "segments": 3, "render": 2}],
        "collider": [{"name": "skin", "thickness": 0.001, "shape": {"mesh": {"path": "skin.obj", "shell": True}}}],
    }
    stage = stage_of(tree, tmp_path)
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/fur"))
    n = len(curves.GetCurveVertexCountsAttr().Get())
    assert n == 80
    ids, interpolation = primvar(stage, "/scene/fur", "id")
    assert interpolation == "uniform" and ids.tolist() == list(range(n)) and ids.dtype == np.int32
    rest, interpolation = primvar(stage, "/scene/fur", "rest")
    assert interpolation == "vertex" and len(rest) == 4 * n
    st, interpolation = primvar(stage, "/scene/fur", "st")
    assert interpolation == "uniform"
    assert np.allclose(st, np.stack([rest[::4, 1] / 2, 1 - rest[::4, 0] / 2], axis=1), atol=1e-5)


def test_texture_at_points_beside_a_surface() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    texture = np.array([[[0.0, 0], [1, 0], [0, 1]]])
    points = np.array([[0.25, 0.5, 0.1], [-1, -1, 0], [2, 0, 0]])
    found = on_surface(points, corners, np.array([[0, 1, 2]]), texture)
    assert np.allclose(found, [[0.25, 0.5], [0, 0], [1, 0]])


def test_what_deforms_has_velocities_though_the_run_kept_none(tmp_path: Path) -> None:
    """A plate whose corners rise at 0.5 m/s and a rope that falls, whose velocities are not kept."""
    for i, z in enumerate((0.0, 0.5)):
        (tmp_path / f"p.{i}.obj").write_text(f"v 0 0 0\nv 1 0 {z}\nv 0 1 {z}\nf 1 2 3\n")
    frames = [{"time": float(i), "path": f"p.{i}.obj"} for i in range(2)]
    tree = {
        "time": {"fps": 8, "frames": 10},
        "rope": [{"name": "r", "from": [3, 0, 3], "to": [4, 0, 3], "segments": 4}],
        "collider": [{"name": "p", "thickness": 0.01, "shape": {"animated_mesh": {"frames": frames, "shell": True}}}],
        "output": {"columns": ["position"], "plot": False},
    }
    stage = stage_of(tree, tmp_path)
    plate = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/p")).GetVelocitiesAttr()
    rises = [[0, 0, 0], [0, 0, 0.5], [0, 0, 0.5]]
    for i in (0, 3, 7):
        assert np.allclose(plate.Get(i), rises, atol=1e-5), i
    # It stops at 1 s: half of the way between the frames beside it, and then nothing.
    assert np.allclose(np.array(plate.Get(8)), np.array(rises) / 2, atol=1e-5) and np.abs(plate.Get(10)).max() < 1e-6
    rope = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/r")).GetVelocitiesAttr()
    for i in range(1, 10):
        assert np.allclose(np.array(rope.Get(i))[:, 2], -9.80665 * i / 8, rtol=0.02), i


def test_what_a_tear_makes_does_not_fly_in_from_afar(tmp_path: Path) -> None:
    flat, triangles, _ = fake_run.lattice()
    spare = np.concatenate([flat, np.full((1, 3), 50.0)])
    n = len(flat)

    def columns(t: float) -> Any:
        i = round(t * fake_run.FPS)
        x, faces = spare + np.array([0, 0, 0.3 * i / fake_run.FPS]), triangles.copy()
        if i >= 2:
            faces[0, 0] = n
            x[n] = x[triangles[0, 0]] + [0.1 * (i - 2) / fake_run.FPS, 0, 0]
        return {"s": {"position": fake_run.f32(x), "triangles": faces}}

    run = fake_run.FakeRun(fake_run.scene(sheet=[{"name": "s"}]), {"s": {"triangles": triangles}}, columns)
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/s"))
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    for i in range(5):
        v = np.array(mesh.GetVelocitiesAttr().Get(i))
        assert np.allclose(v[:n], [0, 0, 0.3], atol=1e-4)
        if i >= 2:
            assert np.allclose(v[n], [0.1, 0, 0.3], atol=1e-4), i


def test_cameras_have_no_depth_of_field_and_nights_stay_dark(tmp_path: Path) -> None:
    camera = {"position": None, "target": None, "view_angle": 35.0, "resolution": [160, 90]}
    found = {}
    for look in ("studio", "night"):
        run = fake_run.studio(camera=camera | {"look": look})
        stage = Usd.Stage.Open(str(usd.write(run, tmp_path / look)))
        lens = UsdGeom.Camera(stage.GetPrimAtPath("/scene/camera"))
        assert not lens.GetFocusDistanceAttr().HasAuthoredValue() and not lens.GetFStopAttr().HasAuthoredValue()
        sky = UsdLux.DomeLight(stage.GetPrimAtPath("/scene/sky"))
        key = UsdLux.DistantLight(stage.GetPrimAtPath("/scene/key_light"))
        shader, _, _ = UsdShade.Material(stage.GetPrimAtPath("/scene/looks/masses")).ComputeSurfaceSource()
        glow = shader.GetInput("emissiveColor")
        found[look] = (
            sky.GetIntensityAttr().Get() * max(sky.GetColorAttr().Get()),
            key.GetIntensityAttr().Get(),
            list(glow.Get()) if glow else None,
        )
    assert found["studio"][0] > 0.5 and found["studio"][1] == 1 and found["studio"][2] is None
    assert 0 < found["night"][0] < 0.01 and 0 < found["night"][1] < 0.05
    assert np.allclose(found["night"][2], fake_run.RED, atol=1e-6)


def test_volumes_say_the_extinction_of_pictures(tmp_path: Path) -> None:
    from tumble.pictures.drawn import Image, Smoke
    from tumble.pictures.things import Stage

    run = fake_run.plume(16)
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    factor = stage.GetPrimAtPath("/scene/smoke").GetAttribute("extinction").Get()
    drawn = next(t for t in Stage(run).things(3) if isinstance(t, Smoke))
    density = run.frame(3)["smoke"]["density"]
    assert np.isclose(drawn.extinction.max(), factor * density.max(), rtol=1e-4) and factor > 1
    # Dye in a plane lets through what it does in pictures, in one cell.
    ink = fake_run.ink(n=16)
    seen = Stage(ink).extinction("dye")
    assert seen is not None and seen[:2] == ("density", 0.0) and seen[3] == 0.0
    most = max(float(ink.frame(i)["dye"]["density"].max()) for i in range(ink.n_frames))
    image = next(t for t in Stage(ink).things(2) if isinstance(t, Image))
    through = 1 - np.exp(-seen[2] * float(ink.frame(2)["dye"]["density"].max()) / 16)
    assert most > 0.5 and np.isclose(image.cover.max(), through, atol=1e-4)


def test_containers_are_guides_and_ways_stand(tmp_path: Path) -> None:
    tree = {
        "time": {"frames": 4},
        "particles": [{"name": "p", "position": [[0, 0, 0]], "velocity": [[1, 0, 0]], "trail": 1.0}],
        "collider": [
            {"name": "room", "inside": True, "shape": {"box": {"size": [4, 4, 4]}}},
            {"name": "ball", "shape": {"sphere": {"center": [0, 0, -1], "radius": 0.2}}},
        ],
    }
    stage = stage_of(tree, tmp_path)
    purposes = {n: UsdGeom.Imageable(stage.GetPrimAtPath(f"/scene/{n}")).ComputePurpose() for n in ("room", "ball")}
    assert purposes == {"room": "guide", "ball": "default"}
    way = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/p_trail"))
    assert len(way.GetPointsAttr().Get(4)) == len(way.GetVelocitiesAttr().Get(4)) == 5
    assert not np.any(way.GetVelocitiesAttr().Get(4))


def test_export_writes_the_script_for_blender(tmp_path: Path, tumble: Callable[..., Answer]) -> None:
    tree = {"time": {"frames": 1}, "sheet": [SHEET], "output": {"plot": False}, "version": 1}
    simulate(Scene(tree), tmp_path / "out" / "run")
    answer = tumble("export", "run", "--blender", "--out", tmp_path / "there")
    assert answer.code == 0, answer.err
    assert [Path(line).name for line in answer.out.split()] == ["scene.usda", "blender.py"]
    assert "'s':" in (tmp_path / "there" / "blender.py").read_text()
    assert "--blender" in tumble("export", "run").err
