"""Particles whose number changes, in files: run folder, NPZ, PLY and USD hold what the frames hold."""

import json
import struct
from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble import ExportError, World, expect
from tumble.cli.export import stack
from tumble.export import ply, usd
from tumble.folder import RunFolder, read_columns, write_columns, write_json
from tumble.pictures.things import objects
from tumble.recorder import describe
from tumble.style import display

KINDS = {"float": "f", "int": "i", "uchar": "B"}


def nothing(done: int, total: int) -> None:
    pass


def read_ply(data: bytes) -> dict[str, Any]:
    """A reader that knows the format, and nothing of the writer."""
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode("ascii").split("\n")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    n = int(lines[2].removeprefix("element vertex "))
    fields = [line.split()[1:] for line in lines[3:] if line]
    row = struct.Struct("<" + "".join(KINDS[kind] for kind, _ in fields))
    assert len(body) == n * row.size
    rows = list(row.iter_unpack(body))
    return {name: np.array([r[k] for r in rows]) for k, (_, name) in enumerate(fields)}


# Run folder


def test_frames_of_any_count_come_back(tmp_path: Path) -> None:
    run = fake_run.fountain()
    for i in (0, 3):
        write_columns(tmp_path / "f.npz", run.frame(i))
        found = read_columns(tmp_path / "f.npz")["spray"]
        for name, column in run.frame(i)["spray"].items():
            assert found[name].dtype == column.dtype and found[name].shape == column.shape
            np.testing.assert_array_equal(found[name], column)


def test_columns_say_which_length_varies(tmp_path: Path) -> None:
    run = fake_run.fountain()
    static, frame = {"p": {"mass": np.ones(2)}}, {**run.frame(0), "p": {"position": np.zeros((2, 3))}}
    write_json(tmp_path / "columns.json", describe({"spray": {"age": "s"}}, static, frame))
    found = json.loads((tmp_path / "columns.json").read_text())
    assert found["spray"]["position"] == {"unit": "1", "shape": [None, 3], "dtype": "float32", "in": "frames"}
    assert found["spray"]["age"] == {"unit": "s", "shape": [None], "dtype": "float32", "in": "frames"}
    assert (found["p"]["position"]["shape"], found["p"]["mass"]["shape"]) == ([2, 3], [2])


def test_what_a_run_writes_is_deleted_with_it(tmp_path: Path) -> None:
    ply.write(fake_run.fountain(), tmp_path)
    RunFolder(tmp_path).clear()
    assert not list(tmp_path.iterdir())


class Emitting:
    """A world with particles that come and go."""

    def __init__(self, i: int) -> None:
        self.table = fake_run.fountain().frame(i)["spray"]
        self.topology: fake_run.Columns = {"spray": {}}

    def columns(self, *names: str) -> fake_run.Columns:
        return {"spray": {n: self.table[n] for n in names if n in self.table}, "other": {}}


def test_probes_follow_ids() -> None:
    probe = {"object": "spray", "column": "position", "index": 7, "value": [0.0, 0.0, 0.0], "tolerance": 1.0}
    scene = {"expect": {"probe": [probe]}}
    world: Any = Emitting(3)
    row = list(world.table["id"]).index(7)
    (found,) = expect.probes(world, scene)
    np.testing.assert_array_equal(np.float32(found), world.table["position"][row])
    none: Any = Emitting(0)
    assert np.isnan(expect.probes(none, scene)).all()  # Not born yet: no reason to refuse the scene.


def test_probes_of_a_world_still_go_by_row() -> None:
    scene = {"version": 1, "particles": [{"name": "p", "position": [[0, 0, 1], [0, 0, 2]]}]}
    words = {"object": "p", "index": 1, "value": [0, 0, 2], "tolerance": 1}
    world = World({**scene, "expect": {"probe": [words]}})
    assert expect.probes(world, world.scene.to_dict()) == [[0.0, 0.0, 2.0]]


# NPZ


def test_npz_has_the_rows_of_all_frames(tmp_path: Path) -> None:
    run: Any = fake_run.fountain()
    progress: Any = nothing
    with np.load(stack(run, tmp_path, progress)) as stacked:
        first = stacked["spray/first"]
        assert len(first) == run.n_frames + 1 and first[1] == 0 < first[-1] == len(stacked["spray/id"])
        for i in range(run.n_frames):
            for name, column in run.frame(i)["spray"].items():
                np.testing.assert_array_equal(stacked[f"spray/{name}"][first[i] : first[i + 1]], column)


# PLY


def test_ply_holds_every_frame(tmp_path: Path) -> None:
    run = fake_run.fountain()
    folder = ply.write(run, tmp_path)
    assert sorted(p.name for p in folder.iterdir()) == [f"spray.{i:06}.ply" for i in range(run.n_frames)]
    for i in range(run.n_frames):
        found, table = read_ply((folder / f"spray.{i:06}.ply").read_bytes()), run.frame(i)["spray"]
        assert list(found) == ["x", "y", "z", "vx", "vy", "vz", "id", "radius", "red", "green", "blue", "age", "heat"]
        if not len(table["id"]):
            assert not len(found["x"])
            continue
        np.testing.assert_array_equal(np.stack([found[a] for a in "xyz"], 1), table["position"])
        np.testing.assert_array_equal(np.stack([found["v" + a] for a in "xyz"], 1), table["velocity"])
        for name in ("id", "radius", "age", "heat"):
            np.testing.assert_array_equal(found[name], table[name])
        seen = np.stack([found[c] for c in ("red", "green", "blue")], 1)
        np.testing.assert_array_equal(seen, np.round(255 * display(table["color"])))


def test_ply_of_masses_and_of_a_shorter_run(tmp_path: Path) -> None:
    run = fake_run.studio()
    ply.write(run, tmp_path)
    run.n_frames = 2
    folder = ply.write(run, tmp_path)
    assert sorted(p.name for p in folder.iterdir()) == ["masses.000000.ply", "masses.000001.ply"]
    found = read_ply((folder / "masses.000001.ply").read_bytes())
    assert found["id"].tolist() == [0, 1, 2]
    np.testing.assert_allclose(found["radius"], fake_run.RADIUS)
    assert found["red"].tolist() == [round(255 * float(display(0.6)))] * 3


def test_ply_is_what_another_program_reads(tmp_path: Path) -> None:
    pv = pytest.importorskip("pyvista")
    folder = ply.write(fake_run.fountain(), tmp_path)
    table = fake_run.fountain().frame(4)["spray"]
    np.testing.assert_array_equal(pv.read(folder / "spray.000004.ply").points, table["position"])


def test_no_ply_without_particles(tmp_path: Path) -> None:
    vertices, triangles = fake_run.cube()
    with pytest.raises(ExportError, match="no particles"):
        ply.write(fake_run.one("jelly", "block", {"triangles": triangles}, vertices), tmp_path)


# USD


def read_usd(run: fake_run.FakeRun, folder: Path) -> Any:
    from pxr import Usd

    stage = Usd.Stage.Open(str(usd.write(run, folder)))
    assert not stage.GetCompositionErrors()
    return stage


def test_usd_holds_every_frame(tmp_path: Path) -> None:
    from pxr import UsdGeom

    run = fake_run.fountain()
    stage = read_usd(run, tmp_path)
    prim = stage.GetPrimAtPath("/scene/spray")
    assert prim.GetTypeName() == "Points"
    seen = {
        "points": "position",
        "velocities": "velocity",
        "ids": "id",
        "primvars:displayColor": "color",
        "primvars:age": "age",
        "primvars:heat": "heat",
    }
    for i in range(run.n_frames):
        table = run.frame(i)["spray"]
        for attribute, column in seen.items():
            found = np.array(prim.GetAttribute(attribute).Get(i))
            np.testing.assert_array_equal(found.reshape(table[column].shape), table[column], f"{attribute} {i}")
        np.testing.assert_array_equal(np.array(prim.GetAttribute("widths").Get(i)), 2 * table["radius"])
        low, high = prim.GetAttribute("extent").Get(i)
        if not len(table["id"]):
            assert all(a > b for a, b in zip(low, high, strict=True))  # the empty range
            continue
        r = table["radius"][:, None]
        np.testing.assert_allclose(low, (table["position"] - r).min(axis=0), atol=1e-6)
        np.testing.assert_allclose(high, (table["position"] + r).max(axis=0), atol=1e-6)
    assert prim.GetAttribute("ids").GetTypeName() == "int64[]"
    for name in ("displayColor", "age"):
        assert UsdGeom.PrimvarsAPI(prim).GetPrimvar(name).GetInterpolation() == "vertex"


def test_usd_has_trails_as_curves_by_id(tmp_path: Path) -> None:
    from pxr import UsdGeom

    run = fake_run.fountain()
    run.scene["emitter"][0]["trail"] = 2.5 / fake_run.FPS
    stage = read_usd(run, tmp_path)
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/spray_trail"))
    assert curves.GetTypeAttr().Get() == "linear"
    longest = 0
    for i in range(run.n_frames):
        tables = [run.frame(k)["spray"] for k in range(max(0, i - 2), i + 1)]
        expected, counts = [], []
        for number in tables[-1]["id"]:
            way: list[np.ndarray] = []
            for table in tables[::-1]:
                (row,) = np.nonzero(table["id"] == number)
                if not len(row):
                    break
                way.insert(0, table["position"][row[0]])
            if len(way) > 1:
                expected += way
                counts.append(len(way))
        np.testing.assert_array_equal(np.array(curves.GetCurveVertexCountsAttr().Get(i)), counts)
        points = np.array(curves.GetPointsAttr().Get(i)).reshape(-1, 3)
        np.testing.assert_allclose(points, np.array(expected).reshape(-1, 3), atol=1e-6)
        longest = max([longest, *counts])
    assert longest == 3


def test_usd_between_frames_particles_go_on_with_their_velocities(tmp_path: Path) -> None:
    from pxr import UsdGeom

    run = fake_run.fountain()
    stage = read_usd(run, tmp_path)
    cloud = UsdGeom.Points(stage.GetPrimAtPath("/scene/spray"))
    table = run.frame(3)["spray"]
    found = np.array(cloud.ComputePointsAtTime(3.5, 3.0))
    np.testing.assert_allclose(found, table["position"] + 0.5 / fake_run.FPS * table["velocity"], atol=1e-6)


def test_usd_of_one_colour_and_one_radius(tmp_path: Path) -> None:
    from pxr import UsdGeom, UsdShade

    stage = read_usd(fake_run.fountain(color=False, radius=False), tmp_path)
    prim = stage.GetPrimAtPath("/scene/spray")
    np.testing.assert_allclose(prim.GetAttribute("widths").Get(4), [0.04])
    assert UsdGeom.Points(prim).GetWidthsInterpolation() == "constant"
    np.testing.assert_allclose(prim.GetAttribute("primvars:displayColor").Get(4), [fake_run.BLUE], atol=1e-7)
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    assert not material.ComputeSurfaceSource()[0].GetInput("diffuseColor").HasConnectedSource()


def test_usd_colours_reach_the_material(tmp_path: Path) -> None:
    from pxr import UsdShade

    stage = read_usd(fake_run.fountain(), tmp_path)
    prim = stage.GetPrimAtPath("/scene/spray")
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    source = material.ComputeSurfaceSource()[0].GetInput("diffuseColor").GetConnectedSource()[0]
    assert UsdShade.Shader(source.GetPrim()).GetInput("varname").Get() == "displayColor"


def test_particles_without_anything_static_are_found() -> None:
    """A file of arrays has no place for an object without any."""
    run = fake_run.fountain()
    run.static.clear()
    (spray,) = objects(run)
    assert (spray.name, spray.form, spray.color) == ("spray", "points", tuple(fake_run.BLUE))
