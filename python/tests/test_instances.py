"""Bodies that share one mesh: what pictures, cameras and stages show of them."""

from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble import Scene
from tumble.pictures import Studio, surfaces
from tumble.pictures.drawn import Mesh
from tumble.pictures.framing import outline
from tumble.pictures.things import Recording, Stage
from tumble.run import simulate
from tumble.style import linear

BOXES = {
    "version": 1,
    "time": {"frames": 4},
    "body": [
        {
            "name": "boxes",
            "shape": {"box": {"size": [0.2, 0.2, 0.2]}},
            "position": [[0, 0, 0.1], [0, 0, 0.35]],
            "density": 500,
            "velocity": [[0, 0, 0]],
            "angular_velocity": [[0, 0, 3]],
        }
    ],
    "collider": [{"name": "floor", "shape": {"floor": {}}}],
    "output": {"columns": ["position", "velocity", "angular_velocity"], "plot": False},
}


def corners(run: Recording, i: int) -> Any:
    """Vertices of all bodies in a frame, one body after the other, by the sandwich product of quaternions."""
    table, own = run.frame(i)["boxes"], run.static["boxes"]["vertices"].astype(float)
    found = []
    for position, (x, y, z, w) in zip(table["position"], table["turn"].astype(float), strict=True):
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        found.append(own @ np.array(rows).T + position)
    return np.concatenate(found)


def test_points_are_turned_and_then_moved() -> None:
    third = np.array([[0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0]])
    found = surfaces.placed(np.eye(3), np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]), third)
    # A third of a turn about (1, 1, 1) takes x to y, y to z and z to x.
    np.testing.assert_allclose(found[0], np.eye(3)[[1, 2, 0]] + [1, 2, 3], atol=1e-15)
    np.testing.assert_array_equal(found[1], np.eye(3))


def test_all_bodies_are_one_mesh_with_sharp_edges() -> None:
    run = fake_run.boxes()
    for i in (0, 3):
        mesh = next(t for t in Stage(run).things(i) if t.name == "boxes")
        assert isinstance(mesh, Mesh) and mesh.closed and mesh.matter == "plain"
        assert mesh.vertices.shape == mesh.normals.shape == (48, 3) and mesh.triangles.shape == (24, 3)
        triangles = run.static["boxes"]["triangles"].astype(int)
        both = corners(run, i)[np.concatenate([triangles, triangles + 8])]
        np.testing.assert_allclose(mesh.vertices[mesh.triangles], both, atol=1e-6)
        # Each corner has the normal of its face.
        faces = surfaces.unit(surfaces.face_normals(mesh.vertices, mesh.triangles))
        np.testing.assert_allclose(mesh.normals[mesh.triangles], np.repeat(faces[:, None], 3, axis=1), atol=1e-6)


@pytest.mark.parametrize("far", [0, 1])
def test_the_camera_sees_the_corners_of_bodies(far: int, monkeypatch: pytest.MonkeyPatch) -> None:
    run = fake_run.boxes()
    frames = {i: run.frame(i) for i in range(run.n_frames)}
    frames[2]["boxes"]["position"][far] = np.nan  # does not count
    monkeypatch.setattr(run, "columns", lambda t: frames[round(t * fake_run.FPS)])
    every = np.concatenate([corners(run, i) for i in range(run.n_frames)])
    extent = outline(run)
    for bound in (np.nanmin, np.nanmax):
        np.testing.assert_allclose(bound(extent, axis=0), bound(every, axis=0), atol=1e-6)


def test_bodies_are_seen_where_they_are() -> None:
    run = fake_run.boxes()
    studio = Studio(run, "matplotlib", (160, 90))
    image = linear(studio.picture(2) / 255)
    for top in run.frame(2)["boxes"]["position"] + np.array([0.0, 0.0, 0.5]):
        x, y, _ = studio.camera.project(top)
        shade = image[int(y), int(x)]
        assert shade @ fake_run.GREEN > 0.9 * np.linalg.norm(shade) * np.linalg.norm(fake_run.GREEN)


def test_stages_instance_one_mesh(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdGeom, UsdShade

    from tumble.export import usd

    run = fake_run.boxes()
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    bodies = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/boxes"))
    assert bodies.GetPrototypesRel().GetTargets() == ["/scene/boxes/boxes_mesh"]
    assert list(bodies.GetProtoIndicesAttr().Get(2)) == [0, 0] and list(bodies.GetIdsAttr().Get(2)) == [0, 1]
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/boxes/boxes_mesh"))
    assert not mesh.GetPointsAttr().ValueMightBeTimeVarying() and mesh.GetNormalsInterpolation() == "faceVarying"
    points = np.array(mesh.GetPointsAttr().Get())
    np.testing.assert_array_equal(points, run.static["boxes"]["vertices"])
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    shader, _, _ = material.ComputeSurfaceSource()
    assert material.GetPath() == "/scene/looks/boxes"
    np.testing.assert_allclose(shader.GetInput("diffuseColor").Get(), fake_run.GREEN, atol=1e-6)
    for i in range(run.n_frames):
        matrices = bodies.ComputeInstanceTransformsAtTime(i, i)
        shown = np.concatenate([[m.Transform(Gf.Vec3d(*p)) for p in points.tolist()] for m in matrices])
        np.testing.assert_allclose(shown, corners(run, i), atol=1e-6)
        extent = [shown.min(axis=0), shown.max(axis=0)]
        np.testing.assert_allclose(bodies.GetExtentAttr().Get(i), extent, atol=1e-6)
        x, y, z, w = run.frame(i)["boxes"]["turn"][0].tolist()
        half = bodies.GetOrientationsAttr().Get(i)[0]
        # Half precision has 11 bits.
        np.testing.assert_allclose([*half.GetImaginary(), half.GetReal()], [x, y, z, w], atol=2**-11)


def test_between_frames_bodies_go_on_as_they_move(tmp_path: Path) -> None:
    """Velocities are per second, of turns in degrees."""
    pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdGeom

    from tumble.export import usd

    stage = Usd.Stage.Open(str(usd.write(fake_run.boxes(spin=4.0), tmp_path)))
    bodies = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/boxes"))
    matrix = bodies.ComputeInstanceTransformsAtTime(2.5, 2)[1]
    t = 2.5 / fake_run.FPS
    expected = [3 + np.cos(-4 * t), np.sin(-4 * t), 0.5 + 2 * t]
    np.testing.assert_allclose(matrix.Transform(Gf.Vec3d(1, 0, 0)), expected, atol=1e-5)


def test_bodies_of_a_simulation(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    from tumble.export import blender, usd

    run = simulate(Scene(BOXES, tmp_path), tmp_path / "run")
    assert [(look.object, look.form) for look in run.looks.objects] == [("boxes", "instances"), ("floor", "ground")]
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    bodies = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/boxes"))
    scene = Stage(run)
    for i in range(run.n_frames):
        mesh = next(t for t in scene.things(i) if t.name == "boxes")
        assert isinstance(mesh, Mesh) and mesh.closed
        found = np.array(bodies.GetExtentAttr().Get(i))
        np.testing.assert_allclose(found, [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], atol=1e-6)
        np.testing.assert_array_equal(bodies.GetPositionsAttr().Get(i), run.frame(i)["boxes"]["position"])
        turning = np.degrees(run.frame(i)["boxes"]["angular_velocity"])
        np.testing.assert_allclose(bodies.GetAngularVelocitiesAttr().Get(i), turning, rtol=1e-6, atol=1e-6)
    assert "'boxes_mesh': {" in blender.write(run, tmp_path).read_text()


def test_bodies_that_are_born_or_break_are_in_pictures_and_stages(tmp_path: Path) -> None:
    """Two are born one after the other; a box falls apart into four pieces, which are objects of their own."""
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    from tumble.export import usd

    box = {"box": {"size": [0.2, 0.2, 0.2]}}
    emit = {"rate": 12, "count": 2, "velocity": [3, 0, 0], "from": {"point": {"at": [0, 0, 2]}}}
    fracture = {"pieces": 4, "strength": 1e3}
    scene = {
        "version": 1,
        "time": {"frames": 6},
        "body": [
            {"name": "rocks", "shape": box, "emit": emit},
            {"name": "vase", "shape": box, "position": [[0, 0, 0.15]], "velocity": [[0, 0, -5]], "fracture": fracture},
        ],
        "joint": [{"name": "pin", "between": ["vase"], "kind": {"rope": {"length": 9, "to": [0, 0, 9]}}}],
        "collider": [{"name": "floor", "shape": {"floor": {}}}],
    }
    run = simulate(Scene(scene, tmp_path), tmp_path / "run")
    pieces = [f"vase.{k}" for k in range(1, 5)]
    assert [look.object for look in run.looks.objects] == ["rocks", *pieces, "pin", "floor"]
    counts = [len(run.frame(i)["rocks"]["position"]) for i in range(run.n_frames)]
    assert counts[0] == 0 and counts[-1] == 2 and 1 in counts
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    bodies = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/rocks"))
    shown = Stage(run)
    for i, n in enumerate(counts):
        assert len(bodies.GetPositionsAttr().Get(i)) == len(bodies.GetProtoIndicesAttr().Get(i)) == n
        assert list(bodies.GetIdsAttr().Get(i)) == list(range(n)) and len(bodies.GetOrientationsAttr().Get(i)) == n
        meshes = {thing.name: thing for thing in shown.things(i) if isinstance(thing, Mesh)}
        assert len(meshes["rocks"].triangles) == 12 * n and all(len(meshes[name].triangles) for name in pieces)
    places = np.concatenate([run.frame(run.n_frames - 1)[name]["velocity"] for name in pieces])
    assert np.ptp(places, axis=0).max() > 0.1
    assert all(stage.GetPrimAtPath(f"/scene/vase_{k}").IsValid() for k in range(1, 5))
