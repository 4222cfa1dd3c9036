"""Rigid bodies, colliders and joints of a stage by the UsdPhysics schemas: other engines simulate on from the start of a run.

Units as in the schemas: metres, kilograms, seconds, and degrees for all that turns.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.export.parts import ROOT, Now, Part, bodies, joint_end
from tumble.pictures.things import Recording

SHAPES = {"sphere": "boundingSphere", "box": "boundingCube"}
"""Shapes of bodies whose mesh bounds them exactly; of all others the convex hull collides, here as there."""

STIFF = 1e9
"""Damping of a motor that keeps its speed, whatever it takes [N s/m, N m s/rad]."""

DEGREES = 180.0 / math.pi

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where a body is at the start."""

    path: str | None
    """Its prim; None is the world."""
    position: Vector
    turn: Vector
    """Unit quaternion x, y, z, w."""

    def place(self, point: Vector) -> Vector:
        """A point of the world in the axes of the body [m]."""
        return rotated(conjugate(self.turn), point - self.position)


WORLD = Pose(None, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def conjugate(q: Vector) -> Vector:
    return q * [-1.0, -1.0, -1.0, 1.0]


def product(a: Vector, b: Vector) -> Vector:
    """The turn b, then a."""
    v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*v, a[3] * b[3] - a[:3] @ b[:3]])


def rotated(q: Vector, v: Vector) -> Vector:
    t = 2.0 * np.cross(q[:3], v)
    return np.asarray(v + q[3] * t + np.cross(q[:3], t))


def from_x(axis: Vector) -> Vector:
    """A turn that takes the x axis to a direction."""
    e = axis / np.linalg.norm(axis)
    if e[0] < -1.0 + 1e-12:
        return np.array([0.0, 0.0, 1.0, 0.0])
    q = np.array([0.0, -e[2], e[1], 1.0 + e[0]])
    return np.asarray(q / np.linalg.norm(q))


def fill(stage: Any, run: Recording, parts: list[Part], start: Now) -> None:
    """Applies the schemas to the prims of all parts, and defines the joints; nothing where the run has no bodies."""
    from pxr import UsdGeom

    words = bodies(run.scene)
    if not words:
        return
    _world(stage, run)
    colliders = {collider["name"]: collider for collider in run.scene.get("collider", ())}
    for part in parts:
        name = part.thing.name.removesuffix("/mesh")
        prim = stage.GetPrimAtPath(part.path)
        if name in words and part.kind == "Mesh":
            _body(stage, prim, run, part, words[name], start)
        elif name in colliders and part.kind == "Mesh":
            _collider(stage, prim, part, colliders[name], start)
    poses = dict(_poses(parts, start))
    if run.scene.get("joint"):
        UsdGeom.Scope.Define(stage, f"{ROOT}/joints")
    for joint in run.scene.get("joint", ()):
        _joints(stage, run, joint, poses)


def _world(stage: Any, run: Recording) -> None:
    from pxr import Gf, UsdPhysics

    world = UsdPhysics.Scene.Define(stage, f"{ROOT}/physics")
    gravity = run.scene.get("world", {}).get("gravity", [0.0, 0.0, -9.8])
    if isinstance(gravity, list) and all(isinstance(g, int | float) for g in gravity):
        strength = float(np.linalg.norm(gravity))
        world.CreateGravityMagnitudeAttr(strength)
        if strength > 0.0:
            world.CreateGravityDirectionAttr(Gf.Vec3f(*(g / strength for g in gravity)))
    else:
        world.GetPrim().SetDocumentation("The gravity of the scene changes in time; this is that of the schema.")


def _body(stage: Any, prim: Any, run: Recording, part: Part, words: Mapping[str, Any], start: Now) -> None:
    """A body, or the mesh that many bodies share: these have their speeds in the instancer."""
    from pxr import Gf, UsdPhysics

    rigid = UsdPhysics.RigidBodyAPI.Apply(prim)
    if part.body is not None:
        name, row = part.body
        for column, unit, create in (
            ("velocity", 1.0, rigid.CreateVelocityAttr),
            ("angular_velocity", DEGREES, rigid.CreateAngularVelocityAttr),
        ):
            own = start.columns.get(name, {}).get(column)
            # As the scene says, one for all or one each, where the run did not keep them.
            all_ = np.reshape(words.get(column) or [[0.0] * 3] if own is None else own, (-1, 3))
            create(Gf.Vec3f(*(unit * float(v) for v in all_[row if len(all_) > 1 else 0])))
    weight = UsdPhysics.MassAPI.Apply(prim)
    masses = np.ravel(run.static[part.thing.name.removesuffix("/mesh")]["mass"])
    weight.CreateMassAttr(float(masses[part.body[1] if part.body is not None else 0]))
    weight.CreateCenterOfMassAttr(Gf.Vec3f(0.0))
    if words.get("inertia"):
        weight.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, words["inertia"])))
    shape = "" if words.get("fracture") else next(iter(words.get("shape", ())), "")
    _collides(stage, prim, SHAPES.get(shape, "convexHull"), words)


def _collider(stage: Any, prim: Any, part: Part, words: Mapping[str, Any], start: Now) -> None:
    """A solid that stands, or moves as a whole: others follow its motion. What deforms has no schema."""
    from pxr import UsdPhysics

    own = start.columns.get(part.thing.name, {})
    if "position" in own:
        return
    if "translation" in own:
        UsdPhysics.RigidBodyAPI.Apply(prim).CreateKinematicEnabledAttr(True)
    _collides(stage, prim, "none", words)


def _collides(stage: Any, prim: Any, approximation: str, words: Mapping[str, Any]) -> None:
    """Collision with its mesh, and friction and restitution at its material."""
    from pxr import UsdPhysics, UsdShade

    UsdPhysics.CollisionAPI.Apply(prim)
    UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(approximation)
    bound = UsdShade.MaterialBindingAPI(prim).GetDirectBinding().GetMaterial()
    material = UsdPhysics.MaterialAPI.Apply(bound.GetPrim())
    friction = words.get("friction", 0.0)
    if isinstance(friction, int | float):
        material.CreateDynamicFrictionAttr(float(friction))
        resting = words.get("friction_static")
        material.CreateStaticFrictionAttr(float(resting if isinstance(resting, int | float) else friction))
    material.CreateRestitutionAttr(float(words.get("restitution") or 0.0))


def _poses(parts: list[Part], start: Now) -> Iterator[tuple[tuple[str, int], Pose]]:
    for part in parts:
        if part.body is not None:
            name, row = part.body
            own = start.columns[name]
            x, q = np.reshape(own["position"], (-1, 3))[row], np.reshape(own["turn"], (-1, 4))[row]
            yield part.body, Pose(part.path, x.astype(float), q.astype(float))


def _joints(stage: Any, run: Recording, words: Mapping[str, Any], poses: Mapping[tuple[str, int], Pose]) -> None:
    """A joint of the scene, or each of a chain. The first of its bodies is `body1`, whose motion against the other counts."""
    ends = [joint_end(run.scene, text) for text in words["between"]]
    at = words.get("at")
    pieces = [name for name, body in bodies(run.scene).items() if body["name"] == ends[0][0]]
    if words.get("chain"):
        last = max(row for name, row in poses if name in pieces)
        pairs = [(_pose(run, poses, ends[0][0], k + 1, at), _pose(run, poses, ends[0][0], k, at)) for k in range(last)]
    else:
        two = [_pose(run, poses, name, row or 0, at) for name, row in ends]
        pairs = [(two[0], two[1] if len(two) > 1 else WORLD)]
    for k, pair in enumerate(pairs):
        stem = f"{words['name']} {k}" if words.get("chain") else words["name"]
        _joint(stage, run, stem, words, *pair)


def _pose(run: Recording, poses: Mapping[tuple[str, int], Pose], name: str, row: int, at: Any) -> Pose:
    """A body, of one that breaks the piece whose centre is nearest to a point of the world, or to the middle of all."""
    own = [poses[other, row] for other, body in bodies(run.scene).items() if body["name"] == name]
    point = np.mean([pose.position for pose in own], axis=0) if at is None else np.asarray(at, dtype=float)
    return min(own, key=lambda pose: float(np.linalg.norm(pose.position - point)))


def _joint(stage: Any, run: Recording, name: str, words: Mapping[str, Any], first: Pose, second: Pose) -> None:
    from pxr import Gf, Tf, UsdPhysics

    (kind, own), *_ = words["kind"].items()
    schema = {
        "fixed": UsdPhysics.FixedJoint,
        "ball": UsdPhysics.SphericalJoint,
        "hinge": UsdPhysics.RevoluteJoint,
        "slider": UsdPhysics.PrismaticJoint,
        "rope": UsdPhysics.DistanceJoint,
        "spring": UsdPhysics.Joint,
    }[kind]
    joint = schema.Define(stage, f"{ROOT}/joints/{Tf.MakeValidIdentifier(name)}")
    at = words.get("at")
    if at is None:
        at = 0.5 * (first.position + second.position) if words.get("chain") else first.position
    at = np.asarray(at, dtype=float)
    other = np.asarray(own.get("to") or (second.position if kind in ("rope", "spring") else at), dtype=float)
    turn = from_x(np.asarray(own["axis"], dtype=float)) if "axis" in own else WORLD.turn
    for pose, point, targets, place, rotation in (
        (second, other, joint.CreateBody0Rel, joint.CreateLocalPos0Attr, joint.CreateLocalRot0Attr),
        (first, at, joint.CreateBody1Rel, joint.CreateLocalPos1Attr, joint.CreateLocalRot1Attr),
    ):
        if pose.path is not None:
            targets().SetTargets([pose.path])
        place(Gf.Vec3f(*pose.place(point).tolist()))
        x, y, z, w = product(conjugate(pose.turn), turn).tolist()
        rotation(Gf.Quatf(w, x, y, z))
    joint.CreateCollisionEnabledAttr(bool(words.get("collide")))
    for key, create in (("break_force", joint.CreateBreakForceAttr), ("break_torque", joint.CreateBreakTorqueAttr)):
        if words.get(key) is not None:
            create(float(words[key]))
    if kind in ("hinge", "slider"):
        joint.CreateAxisAttr("X")
        unit = DEGREES if kind == "hinge" else 1.0
        if own.get("limits"):
            low, high = own["limits"]
            joint.CreateLowerLimitAttr(unit * low)
            joint.CreateUpperLimitAttr(unit * high)
        if own.get("motor"):
            _motor(joint.GetPrim(), run, "angular" if kind == "hinge" else "linear", own["motor"], unit)
    elif kind == "rope":
        joint.CreateMaxDistanceAttr(float(own.get("length") or np.linalg.norm(at - other)))
    elif kind == "spring":
        joint.CreateJointEnabledAttr(False)
        told = ", ".join(
            f"{key} {own[key]:g}" for key in ("stiffness", "damping", "length") if own.get(key) is not None
        )
        joint.GetPrim().SetDocumentation(f"A spring between two points, which the schemas have no word for: {told}.")


def _motor(prim: Any, run: Recording, freedom: str, motor: Mapping[str, Any], unit: float) -> None:
    """A drive: force = stiffness (target - position) + damping (target speed - speed), per degree where it turns."""
    from pxr import UsdPhysics

    (drive, own), *_ = motor.items()
    made = UsdPhysics.DriveAPI.Apply(prim, freedom)
    made.CreateTypeAttr("force")
    if own.get("strength") is not None:
        made.CreateMaxForceAttr(float(own["strength"]))
    if drive == "speed":
        made.CreateDampingAttr(STIFF / unit)
        _set(made.CreateTargetVelocityAttr(), run, own["value"], unit)
    else:
        made.CreateStiffnessAttr(own["stiffness"] / unit)
        made.CreateDampingAttr((own.get("damping") or 0.0) / unit)
        _set(made.CreateTargetPositionAttr(), run, own.get("value", 0.0), unit)


def _set(attribute: Any, run: Recording, value: Any, unit: float) -> None:
    """A number, or one of each frame; a formula is told, not evaluated."""
    if isinstance(value, int | float):
        attribute.Set(unit * value)
    elif isinstance(value, Mapping) and value.get("interpolation", "linear") == "linear":
        times, numbers = np.transpose(value["keys"])
        for i in range(run.n_frames):
            attribute.Set(unit * float(np.interp(run.time(i), times, numbers)), float(i))
    else:
        attribute.GetPrim().SetDocumentation(f"{attribute.GetName()} follows {value!r} in the scene.")
