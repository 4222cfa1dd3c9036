"""Bodies, colliders and joints of a stage as other engines read them, by the parser of the USD library."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Scene
from tumble.export import usd
from tumble.run import simulate

pytest.importorskip("pxr")
from pxr import Gf, Usd, UsdGeom, UsdPhysics

Tree = dict[str, Any]

RIGID: Tree = {
    "version": 1,
    "time": {"frames": 2},
    "world": {"gravity": [0.0, 3.0, -4.0]},
    "system": [{"method": "rigid"}],
    "body": [
        {
            "name": "door",
            "shape": {"box": {"size": [1.0, 0.1, 2.0]}},
            "position": [[0.5, 0.0, 1.0]],
            "rotate": [[0, 0, 20]],
            "mass": 12.0,
            "velocity": [[0.0, 0.25, 0.0]],
            "angular_velocity": [[0.0, 0.0, 0.5]],
            "friction": 0.3,
            "friction_static": 0.6,
            "restitution": 0.25,
        },
        {"name": "top", "shape": {"sphere": {"radius": 0.2}}, "position": [[3, 0, 1]], "inertia": [0.3, 0.2, 0.4]},
        {
            "name": "link",
            "shape": {"capsule": {"radius": 0.05, "length": 0.2}},
            "position": [[-1, 0, 1]],
            "rotate": [[0, 90, 0]],
            "arrange": {"row": {"count": 3, "step": [-0.3, 0, 0]}},
        },
        {"name": "heap", "shape": {"cone": {"radius": 0.1, "height": 0.2}}, "position": [[5, 0, 1], [5, 0, 2]]},
    ],
    "joint": [
        {
            "name": "hinge",
            "between": ["door"],
            "at": [0.0, 0.0, 1.0],
            "kind": {"hinge": {"axis": [0, 0, -2], "limits": [-0.5, 1.0]}},
            "break_force": 500.0,
        },
        {"name": "pins", "between": ["link"], "chain": True, "kind": {"ball": {}}},
        {"name": "nail", "between": ["link 0", "top"], "at": [1, 0, 1], "kind": {"fixed": {}}, "collide": True},
        {"name": "rope", "between": ["link 2"], "kind": {"rope": {"to": [-2.0, 0.0, 3.0]}}},
        {
            "name": "lift",
            "between": ["top"],
            "kind": {
                "slider": {
                    "axis": [0, 0, 1],
                    "motor": {"speed": {"value": {"keys": [[0, 0], [1, 24]]}, "strength": 90.0}},
                }
            },
        },
        {"name": "spring", "between": ["door", "top"], "kind": {"spring": {"stiffness": 7.0}}},
    ],
    "collider": [
        {"name": "floor", "shape": {"box": {"size": [20, 20, 1], "center": [0, 0, -3]}}},
        {
            "name": "piston",
            "shape": {"box": {"size": [1, 1, 1], "center": [8, 0, 0]}},
            "motion": {"velocity": [1, 0, 0]},
            "friction": 0.1,
        },
    ],
    "output": {"columns": ["position", "velocity", "angular_velocity"], "plot": False},
}


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("physics")
    return Usd.Stage.Open(str(usd.write(simulate(Scene(RIGID), folder / "run"), folder)))


def described(stage: Any) -> dict[str, Any]:
    """What the library's own reader of physics makes of the stage: path -> description."""
    # Its name before 26.
    old = getattr(UsdPhysics, "LoadUsdPhysicsFromRange", None)
    read = getattr(UsdPhysics, "UsdPhysicsLoadStageFromPrimRange", old)
    everything = read(stage, [stage.GetPseudoRoot().GetPath()])
    return {str(p): d for paths, all_ in everything.values() for p, d in zip(paths, all_, strict=True)}


def test_the_reader_of_the_library_finds_every_body_and_joint_valid(stage: Any) -> None:
    found = described(stage)
    assert all(d.isValid for d in found.values()), {p: d.isValid for p, d in found.items()}
    kinds: dict[str, int] = {}
    for d in found.values():
        kinds[type(d).__name__] = kinds.get(type(d).__name__, 0) + 1
    for kind, count in {
        "SceneDesc": 1,
        "RevoluteJointDesc": 1,
        "SphericalJointDesc": 2,
        "FixedJointDesc": 1,
        "DistanceJointDesc": 1,
        "PrismaticJointDesc": 1,
    }.items():
        assert kinds.get(kind) == count, kinds
    bodies = {path for path, d in found.items() if isinstance(d, UsdPhysics.RigidBodyDesc)}
    single = {f"/scene/{name}" for name in ("door", "top", "link_0", "link_1", "link_2", "piston")}
    assert single <= bodies, bodies
    world = UsdPhysics.Scene(stage.GetPrimAtPath("/scene/physics"))
    assert world.GetGravityMagnitudeAttr().Get() == 5.0
    assert np.allclose(world.GetGravityDirectionAttr().Get(), [0.0, 0.6, -0.8])


def test_bodies_have_mass_motion_and_material(stage: Any) -> None:
    door = stage.GetPrimAtPath("/scene/door")
    rigid, mass = UsdPhysics.RigidBodyAPI(door), UsdPhysics.MassAPI(door)
    assert mass.GetMassAttr().Get() == 12.0 and not mass.GetDiagonalInertiaAttr().HasAuthoredValue()
    assert np.allclose(rigid.GetVelocityAttr().Get(), [0, 0.25, 0])
    assert np.allclose(rigid.GetAngularVelocityAttr().Get(), [0, 0, np.degrees(0.5)])
    assert not rigid.GetKinematicEnabledAttr().Get()
    assert UsdPhysics.MeshCollisionAPI(door).GetApproximationAttr().Get() == "boundingCube"
    material = UsdPhysics.MaterialAPI(stage.GetPrimAtPath("/scene/looks/door"))
    told = [material.GetDynamicFrictionAttr(), material.GetStaticFrictionAttr(), material.GetRestitutionAttr()]
    assert np.allclose([a.Get() for a in told], [0.3, 0.6, 0.25])
    top = UsdPhysics.MassAPI(stage.GetPrimAtPath("/scene/top"))
    assert np.allclose(top.GetDiagonalInertiaAttr().Get(), [0.3, 0.2, 0.4])
    heap = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/heap"))
    (path,) = heap.GetPrototypesRel().GetTargets()
    cone = stage.GetPrimAtPath(path)
    assert cone.HasAPI(UsdPhysics.RigidBodyAPI) and len(heap.GetPositionsAttr().Get()) == 2
    volume = np.pi * 0.1**2 * 0.2 / 3
    assert abs(UsdPhysics.MassAPI(cone).GetMassAttr().Get() / (1000 * volume) - 1) < 1e-6
    for name, kinematic in (("floor", None), ("piston", True)):
        solid = stage.GetPrimAtPath(f"/scene/{name}")
        assert solid.HasAPI(UsdPhysics.CollisionAPI) and solid.HasAPI(UsdPhysics.RigidBodyAPI) == bool(kinematic)


@pytest.mark.parametrize("name", ["hinge", "pins_0", "pins_1", "nail", "lift"])
def test_both_frames_of_a_joint_meet_at_the_start(stage: Any, name: str) -> None:
    joint = UsdPhysics.Joint(stage.GetPrimAtPath(f"/scene/joints/{name}"))
    frames = []
    for body, place, turn in (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    ):
        own = Gf.Matrix4d().SetRotate(Gf.Quatd(turn.Get())) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(place.Get()))
        for path in body.GetTargets():
            own = own * UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(0)
        frames.append(np.array(own))
    # Rows are the axes, then the place.
    assert np.allclose(*frames, atol=1e-6), frames
    if name == "hinge":
        assert np.allclose(frames[0][0, :3], [0, 0, -1], atol=1e-6) and np.allclose(frames[0][3, :3], [0, 0, 1])
    if name == "pins_0":
        assert np.allclose(frames[0][3, :3], [-1.15, 0, 1], atol=1e-6)


def test_joints_have_limits_drives_and_what_breaks_them(stage: Any) -> None:
    hinge = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath("/scene/joints/hinge"))
    assert np.allclose([hinge.GetLowerLimitAttr().Get(), hinge.GetUpperLimitAttr().Get()], np.degrees([-0.5, 1.0]))
    assert hinge.GetBreakForceAttr().Get() == 500.0 and not hinge.GetCollisionEnabledAttr().Get()
    assert str(hinge.GetBody1Rel().GetTargets()[0]) == "/scene/door" and not hinge.GetBody0Rel().GetTargets()
    assert UsdPhysics.Joint(stage.GetPrimAtPath("/scene/joints/nail")).GetCollisionEnabledAttr().Get()
    rope = UsdPhysics.DistanceJoint(stage.GetPrimAtPath("/scene/joints/rope"))
    assert abs(rope.GetMaxDistanceAttr().Get() - np.hypot(0.4, 2.0)) < 1e-6
    drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath("/scene/joints/lift"), "linear")
    assert drive.GetMaxForceAttr().Get() == 90.0
    # From 0 to 24 m/s in a second: 1 m/s more each frame.
    assert np.allclose([drive.GetTargetVelocityAttr().Get(i) for i in range(3)], [0, 1, 2], atol=1e-5)
    spring = UsdPhysics.Joint(stage.GetPrimAtPath("/scene/joints/spring"))
    assert not spring.GetJointEnabledAttr().Get() and "stiffness 7" in spring.GetPrim().GetDocumentation()


def test_scenes_without_bodies_have_no_physics(tmp_path: Path) -> None:
    tree = {"version": 1, "time": {"frames": 1}, "sheet": [{"name": "s", "size": [1, 1], "resolution": [3, 3]}]}
    tree["collider"] = [{"name": "ball", "shape": {"sphere": {"radius": 0.3}}}]
    run = simulate(Scene(tree | {"output": {"plot": False}}), tmp_path / "run")
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    assert not [p for p in stage.Traverse() if any("Physics" in str(a) for a in p.GetAppliedSchemas())]
    assert not stage.GetPrimAtPath("/scene/physics")
