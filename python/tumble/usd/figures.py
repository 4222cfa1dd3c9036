"""A skinned figure of a USD file as GLB, which `shape.character` reads: bones, skin, and its animation as the one clip.

Nodes are y up and in metres, as glTF has them. A vertex keeps its four strongest bones. Meshes without a skin stand where
they are at the start; blend shapes are left out."""

import json
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.usd.motion import Timeline, triangulated
from tumble.usd.stage import Floats, Indices, Reading, open_stage, upright
from tumble.usd.told import note_figure

Parts = tuple[Floats, Floats, Floats]
"""Translation, turn (quaternion x, y, z, w) and scale of a place."""

_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Matrix for rows from z up to y up."""

_BONES = 4
"""Of a vertex, at most."""

_ARRAYS, _ELEMENTS = 34962, 34963
_WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_TYPES = {np.dtype("<f4"): 5126, np.dtype("<u2"): 5123, np.dtype("<u4"): 5125}


def as_glb(path: Path | str) -> bytes:
    """The figure of a file as GLB; what is left out is noted. Raises ValueError if no mesh is bound to a skeleton."""
    from pxr import Usd, UsdSkel

    stage = open_stage(path)
    line, figure, cache = Timeline(stage), _Figure(), UsdSkel.Cache()
    reading, posed = Reading(stage, line.start), Reading(open_stage(path), line.start)
    shown = {surface.path for surface in posed.surfaces()}
    skinned: set[str] = set()
    stage.SetEditTarget(stage.GetSessionLayer())
    for prim in list(stage.Traverse()):
        if prim.IsInstance():
            # What stands in for an instance has no bindings of its own.
            prim.SetInstanceable(False)
    for root in [p for p in stage.Traverse() if p.IsA(UsdSkel.Root)]:
        cache.Populate(UsdSkel.Root(root), Usd.PrimDefaultPredicate)
        for binding in cache.ComputeSkelBindings(UsdSkel.Root(root), Usd.PrimDefaultPredicate):
            query = cache.GetSkelQuery(binding.GetSkeleton())
            targets = [t for t in binding.GetSkinningTargets() if str(t.GetPrim().GetPath()) in shown]
            if query and targets:
                nodes = figure.skeleton(query, line, upright(stage) @ _Y_UP)
                for target in targets:
                    _skin(figure, nodes, query, target, reading)
                skinned |= {str(target.GetPrim().GetPath()) for target in targets}
    if not skinned:
        raise ValueError(
            "no mesh in it is bound to a skeleton; name it in shape.mesh, where it moves as it is animated"
        )
    note_figure(path, posed, skinned)
    for surface in posed.surfaces():
        if surface.path not in skinned:
            used, triangles = triangulated([surface])
            mesh = figure.mesh(surface.points[used] @ _Y_UP[:3, :3], triangles)
            figure.node({"name": surface.path, "mesh": mesh})
    return figure.glb()


def _skin(figure: "_Figure", nodes: list[int], query: Any, target: Any, reading: Reading) -> None:
    """Adds a mesh that is bound to a skeleton."""
    bind = np.array(target.GetGeomBindTransform(reading.time))
    surface = reading.surface(target.GetPrim(), bind)
    if surface is None:
        return
    used, triangles = triangulated([surface])
    found = target.ComputeVaryingJointInfluences(len(surface.points), reading.time)
    if found is None or not len(found[0]):
        raise ValueError(
            f"{surface.path}: its joints and weights do not fit its points; the file is damaged, export it again"
        )
    joints, weights = (np.array(a).reshape(len(surface.points), -1)[used] for a in found)
    own = list(target.GetJointOrder() or query.GetJointOrder())
    order = list(query.GetJointOrder())
    if joints.min() < 0 or joints.max() >= len(own) or any(name not in order for name in own):
        raise ValueError(
            f"{surface.path}: it names joints that its skeleton has not; the file is damaged, export it again"
        )
    joints = np.array([order.index(name) for name in own])[joints]
    # The strongest first.
    best = np.argsort(-weights, axis=1, kind="stable")[:, :_BONES]
    joints, weights = (np.take_along_axis(a, best, axis=1) for a in (joints, weights))
    spare = _BONES - joints.shape[1]
    joints, weights = (np.pad(a, ((0, 0), (0, spare))) for a in (joints, np.maximum(weights, 0.0)))
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1.0), [1.0, 0.0, 0.0, 0.0])
    mesh = figure.mesh(surface.points[used], triangles, joints, weights)
    binds = [np.linalg.inv(np.array(place)) for place in query.GetJointWorldBindTransforms()]
    figure.node({"name": surface.path, "mesh": mesh, "skin": figure.skin(nodes, np.array(binds))})


class _Figure:
    """A glTF file in the making."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.roots: list[int] = []
        self.tables: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("meshes", "skins", "animations", "accessors", "bufferViews")
        }
        self.binary = bytearray()

    def node(self, words: dict[str, Any], parent: int | None = None) -> int:
        """Adds a node and returns its number."""
        self.nodes.append(words)
        own = len(self.nodes) - 1
        if parent is None:
            self.roots.append(own)
        else:
            self.nodes[parent].setdefault("children", []).append(own)
        return own

    def skeleton(self, query: Any, line: Timeline, world: Floats) -> list[int]:
        """Adds the joints of a skeleton, below a node where it stands, and their motion; returns their nodes, in its order."""
        from pxr import Usd, UsdGeom

        prim, order = query.GetPrim(), [str(name) for name in query.GetJointOrder()]
        times = [Usd.TimeCode(code) for code in line.codes()]
        places = [np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)) @ world for time in times]
        track = [_parts([place])[0] for place in places]
        top = self.node({"name": prim.GetName()} | _words(track[0]))
        nodes: list[int] = []
        rest = _parts(query.ComputeJointLocalTransforms(times[0], True) or [])
        if len(rest) != len(order):
            raise ValueError(f"{prim.GetPath()}: its joints have no rest pose; export the skeleton again")
        for name, parent, parts in zip(_leaves(order), query.GetTopology().GetParentIndices(), rest, strict=True):
            nodes.append(self.node({"name": name} | _words(parts), top if parent < 0 else nodes[parent]))
        source = query.GetAnimQuery()
        moves = [_parts(query.ComputeJointLocalTransforms(time)) for time in times] if source else []
        tracks = {top: track} | {node: [frame[k] for frame in moves] for k, node in enumerate(nodes) if moves}
        if len(times) > 1:
            self.clip(
                str(source.GetPrim().GetName()) if source else "motion", [line.time(c) for c in line.codes()], tracks
            )
        return nodes

    def clip(self, name: str, seconds: Sequence[float], tracks: dict[int, list[Parts]]) -> None:
        """Adds motion to the one clip, which has the name of the first."""
        if not self.tables["animations"]:
            self.tables["animations"].append({"name": name, "channels": [], "samplers": []})
        clip, when = self.tables["animations"][0], self.column(np.array(seconds, "<f4")[:, None])
        for node, track in tracks.items():
            for k, path in enumerate(("translation", "rotation", "scale")):
                values = np.array([parts[k] for parts in track])
                if path == "rotation":
                    # The same turn, by the shorter way from the one before.
                    flips = np.where(np.einsum("ij,ij->i", values[1:], values[:-1]) < 0, -1.0, 1.0)
                    values[1:] *= np.cumprod(flips)[:, None]
                clip["samplers"].append({"input": when, "output": self.column(values.astype("<f4"))})
                clip["channels"].append({"sampler": len(clip["samplers"]) - 1, "target": {"node": node, "path": path}})

    def mesh(
        self, points: Floats, triangles: Indices, joints: Indices | None = None, weights: Floats | None = None
    ) -> int:
        """Adds a mesh and returns its number."""
        attributes = {"POSITION": self.column(points.astype("<f4"), _ARRAYS)}
        if joints is not None and weights is not None:
            attributes["JOINTS_0"] = self.column(joints.astype("<u2"), _ARRAYS)
            attributes["WEIGHTS_0"] = self.column(weights.astype("<f4"), _ARRAYS)
        corners = self.column(triangles.reshape(-1, 1).astype("<u4"), _ELEMENTS)
        self.tables["meshes"].append({"primitives": [{"attributes": attributes, "indices": corners}]})
        return len(self.tables["meshes"]) - 1

    def skin(self, nodes: list[int], inverse: Floats) -> int:
        """Adds a skin and returns its number; `inverse` are matrices for rows, which are columns of glTF."""
        binds = self.column(inverse.reshape(-1, 16).astype("<f4"))
        self.tables["skins"].append({"joints": nodes, "inverseBindMatrices": binds})
        return len(self.tables["skins"]) - 1

    def column(self, values: npt.NDArray[Any], target: int | None = None) -> int:
        """Adds numbers, n x width, and returns the number of their accessor."""
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes}
        self.tables["bufferViews"].append(view | ({"target": target} if target else {}))
        self.binary += np.ascontiguousarray(values).tobytes()
        about: dict[str, Any] = {
            "bufferView": len(self.tables["bufferViews"]) - 1,
            "componentType": _TYPES[values.dtype],
            "count": len(values),
            "type": _WIDTHS[values.shape[1]],
        }
        if values.dtype == np.dtype("<f4"):
            about |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.tables["accessors"].append(about)
        return len(self.tables["accessors"]) - 1

    def glb(self) -> bytes:
        """The file."""
        self.binary += bytes(-len(self.binary) % 4)
        tree = {
            "asset": {"version": "2.0", "generator": "tumble"},
            "scene": 0,
            "scenes": [{"nodes": self.roots}],
            "nodes": self.nodes,
            "buffers": [{"byteLength": len(self.binary)}],
        } | {name: table for name, table in self.tables.items() if table}
        text = json.dumps(tree, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        whole = 12 + 8 + len(text) + 8 + len(self.binary)
        head = struct.pack("<4sII", b"glTF", 2, whole)
        return b"".join(
            (
                head,
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(self.binary), b"BIN\0"),
                self.binary,
            )
        )


def _leaves(order: list[str]) -> list[str]:
    """Names of joints without those above them, where that is clear."""
    short = [name.rpartition("/")[2] for name in order]
    return [a if short.count(a) == 1 else name for a, name in zip(short, order, strict=True)]


def _parts(places: Iterable[Any]) -> list[Parts]:
    """What matrices for rows are made of."""
    from pxr import Gf

    found = []
    for place in places:
        matrix = Gf.Matrix4d(np.array(place).tolist())
        _, _, scale, _, move, _ = matrix.Factor()
        spin = matrix.RemoveScaleShear().ExtractRotationQuat().GetNormalized()
        found.append((np.array(move), np.array([*spin.GetImaginary(), spin.GetReal()]), np.array(scale)))
    return found


def _words(parts: Parts) -> dict[str, Any]:
    """Words of a node."""
    return dict(zip(("translation", "rotation", "scale"), (part.tolist() for part in parts), strict=True))
