"""USD: what is read back is what the run holds."""

from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble import ExportError
from tumble.export import usd
from tumble.pictures.framing import camera

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade  # noqa: E402

SHEET, ROPE, MASSES, BALL = "/scene/a_sheet", "/scene/rope", "/scene/masses", "/scene/ball"


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = usd.write(fake_run.studio(), tmp_path_factory.mktemp("usd"))
    assert path.name == "scene.usda"
    return Usd.Stage.Open(str(path))


def values(stage: Any, path: str, attribute: str, time: float) -> Any:
    return np.array(stage.GetPrimAtPath(path).GetAttribute(attribute).Get(time))


def test_stage(stage: Any) -> None:
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == fake_run.FPS
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 4.0)
    assert stage.GetDefaultPrim().GetPath() == "/scene"
    assert not stage.GetCompositionErrors()
    kinds = {str(p.GetPath()): str(p.GetTypeName()) for p in stage.GetDefaultPrim().GetChildren()}
    assert kinds == {
        SHEET: "Mesh",
        ROPE: "BasisCurves",
        MASSES: "Points",
        "/scene/masses_springs": "BasisCurves",
        BALL: "Mesh",
        "/scene/floor": "Mesh",
        "/scene/camera": "Camera",
        "/scene/key_light": "DistantLight",
        "/scene/sky": "DomeLight",
        "/scene/looks": "Scope",
    }


def test_points_and_velocities_are_those_of_every_frame(stage: Any) -> None:
    run = fake_run.studio()
    order = run.static["rope"]["curve"]
    for i in range(run.n_frames):
        frame = run.frame(i)
        for column, attribute in (("position", "points"), ("velocity", "velocities")):
            for path, expected in (
                (SHEET, frame["a sheet"][column]),
                (ROPE, frame["rope"][column][order]),
                (MASSES, frame["masses"][column].astype(np.float32)),
                ("/scene/masses_springs", frame["masses"][column].astype(np.float32)[[0, 1, 1, 2]]),
            ):
                found = values(stage, path, attribute, i)
                assert found.dtype == np.float32
                np.testing.assert_array_equal(found, expected, err_msg=f"{path} {attribute} {i}")
    assert not np.array_equal(values(stage, SHEET, "points", 0), values(stage, SHEET, "points", 4))
    assert stage.GetPrimAtPath(SHEET).GetAttribute("points").GetTimeSamples() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_between_frames_points_are_interpolated(stage: Any) -> None:
    a, b = (values(stage, SHEET, "points", t) for t in (2, 3))
    np.testing.assert_allclose(values(stage, SHEET, "points", 2.25), 0.75 * a + 0.25 * b, atol=1e-6)


def test_what_does_not_change(stage: Any) -> None:
    run = fake_run.studio()
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SHEET))
    np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), run.static["a sheet"]["triangles"].ravel())
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert mesh.GetDoubleSidedAttr().Get()
    assert len(mesh.GetNormalsAttr().Get(3)) == fake_run.N**2
    points = UsdGeom.Points(stage.GetPrimAtPath(MASSES))
    assert list(points.GetIdsAttr().Get()) == [0, 1, 2]
    np.testing.assert_allclose(points.GetWidthsAttr().Get(), [2 * fake_run.RADIUS] * 3)
    rope = UsdGeom.BasisCurves(stage.GetPrimAtPath(ROPE))
    assert (rope.GetTypeAttr().Get(), rope.GetWrapAttr().Get()) == ("linear", "nonperiodic")
    assert list(rope.GetCurveVertexCountsAttr().Get()) == [20]
    np.testing.assert_allclose(rope.GetWidthsAttr().Get(), [0.06] * 20)
    springs = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/masses_springs"))
    assert list(springs.GetCurveVertexCountsAttr().Get()) == [2, 2]
    ball = stage.GetPrimAtPath(BALL).GetAttribute("points")
    assert not ball.ValueMightBeTimeVarying()
    np.testing.assert_array_equal(ball.Get(), run.static["ball"]["position"].astype(np.float32))


def test_extents_hold_all(stage: Any) -> None:
    for path, radius in ((SHEET, 0.0), (ROPE, 0.03), (MASSES, fake_run.RADIUS)):
        points, extent = values(stage, path, "points", 2), values(stage, path, "extent", 2)
        np.testing.assert_allclose(extent, [points.min(axis=0) - radius, points.max(axis=0) + radius], atol=1e-6)


def test_colours(stage: Any) -> None:
    for path, color in ((SHEET, fake_run.BLUE), (MASSES, fake_run.RED), (BALL, fake_run.GREEN)):
        prim = stage.GetPrimAtPath(path)
        np.testing.assert_allclose(UsdGeom.Gprim(prim).GetDisplayColorAttr().Get(), [color], atol=1e-6)
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader, _, _ = material.ComputeSurfaceSource()
        np.testing.assert_allclose(shader.GetInput("diffuseColor").Get(), color, atol=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_camera_sees_what_pictures_show(dimension: int, tmp_path: Path) -> None:
    run = fake_run.studio(dimension=dimension)
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/scene/camera")).GetCamera(0).frustum
    matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    framing = camera(run)
    width, height = framing.size
    for point in np.array([[0.2, 0.1, 0.3], [1.0, -0.2, 0.9], [-0.8, 0.0, 0.1]]):
        x, y, _ = matrix.Transform(Gf.Vec3d(*point.tolist()))
        seen = [0.5 * width * (1 + x), 0.5 * height * (1 - y)]
        np.testing.assert_allclose(seen, framing.project(point)[:2], atol=1e-3)


def test_names_become_valid_and_stay_apart(tmp_path: Path) -> None:
    names = ["a b", "a_b", "größe", "1", "camera"]
    run = fake_run.FakeRun(
        fake_run.scene(particles=[{"name": n} for n in names]),
        {n: {"mass": np.ones(1), "radius": np.array([0.1])} for n in names},
        lambda t: {n: {"position": np.full((1, 3), k + t)} for k, n in enumerate(names)},
    )
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    found = {p.GetDisplayName(): p for p in stage.GetDefaultPrim().GetChildren() if p.GetTypeName() == "Points"}
    assert list(found) == names
    assert len({str(p.GetPath()) for p in found.values()}) == len(names)
    for k, n in enumerate(names):
        assert Sdf.Path.IsValidIdentifier(found[n].GetName())
        np.testing.assert_array_equal(found[n].GetAttribute("points").Get(1), np.full((1, 3), k + 0.1, np.float32))


def test_solids_keep_their_sharp_edges(tmp_path: Path) -> None:
    vertices, triangles = fake_run.cube()
    run = fake_run.one("jelly", "block", {"triangles": triangles}, vertices)
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/jelly"))
    assert mesh.GetNormalsInterpolation() == "faceVarying"
    normals = np.abs(mesh.GetNormalsAttr().Get(1))
    np.testing.assert_allclose(np.sort(normals, axis=1), np.tile([0, 0, 1], (24, 1)), atol=1e-6)


def test_no_frame_stays_in_memory(tmp_path: Path) -> None:
    most = 0

    def count(done: int, total: int) -> None:
        nonlocal most
        most = max(most, sum(not layer.empty for layer in Sdf.Layer.GetLoadedLayers() if layer.anonymous))

    before = sum(not layer.empty for layer in Sdf.Layer.GetLoadedLayers() if layer.anonymous)
    run = fake_run.studio()
    run.n_frames = 30
    usd.write(run, tmp_path, count)
    assert most <= before + 1


def test_progress_and_a_shorter_run_in_the_same_place(tmp_path: Path) -> None:
    calls: list[tuple[int, int]] = []
    run = fake_run.studio()
    usd.write(run, tmp_path, lambda done, total: calls.append((done, total)))
    assert calls == [(k, 5) for k in range(1, 6)]
    run.n_frames = 2
    usd.write(run, tmp_path)
    names = ["frame.000000.usdc", "frame.000001.usdc", "manifest.usda", "objects.usdc"]
    assert sorted(p.name for p in (tmp_path / "usd").iterdir()) == names
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scene.usda", "usd"]


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=r"scene\.usda"):
        usd.write(fake_run.studio(), tmp_path / "file")


def test_what_the_usd_library_complains_about_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(layer: object, path: Path) -> None:
        raise RuntimeError("\n\tError in 'Write' at line 78 in file x.cpp : 'No space left on device'")

    monkeypatch.setattr(usd, "_save", full)
    with pytest.raises(ExportError, match="No space left on device"):
        usd.write(fake_run.studio(), tmp_path)
    assert not (tmp_path / "scene.usda").exists()


def test_a_run_without_positions(tmp_path: Path) -> None:
    run = fake_run.FakeRun(fake_run.scene(particles=[{"name": "p"}]), {"p": {"mass": np.ones(1)}}, lambda t: {"p": {}})
    with pytest.raises(ExportError, match=r"output\.columns"):
        usd.write(run, tmp_path)
