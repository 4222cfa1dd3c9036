"""Grids as VDB files and USD volumes: read back by OpenVDB and by the USD library."""

from pathlib import Path

import fake_run
import numpy as np
import pytest
from test_vdb import oracle, read

from tumble import ExportError, grids
from tumble.export import usd, vdb

__all__ = ["oracle"]

pxr = pytest.importorskip("pxr")
from pxr import Usd, UsdVol  # noqa: E402


def test_files_hold_the_frames(tmp_path: Path) -> None:
    run = fake_run.plume(12)
    done: list[tuple[int, int]] = []
    (tmp_path / "volumes").mkdir()
    for name in ("smoke.000007.vdb", "other.000007.vdb"):
        (tmp_path / "volumes" / name).touch()
    goal = vdb.write(run, tmp_path, lambda a, b: done.append((a, b)), tolerance=0.0)
    assert done == [(i + 1, 5) for i in range(5)]
    assert sorted(p.name for p in goal.iterdir()) == ["other.000007.vdb", *(f"smoke.00000{i}.vdb" for i in range(5))]
    for i in (0, 4):
        table = run.frame(i)["smoke"]
        got = read((goal / f"smoke.00000{i}.vdb").read_bytes(), tmp_path, (0, 0, 0), (12, 12, 24))
        assert set(got) == set(table)
        for name, array in table.items():
            np.testing.assert_array_equal(got[name]["values"], array, err_msg=name)
        words = {name: [str(w) for w in g["words"][:3]] for name, g in got.items()}
        assert words["density"] == ["fog volume", "float", "kg/m³"]
        assert words["velocity"] == ["unknown", "vec3s", "m/s"]
        first = np.array([-0.5, -0.5, 0.0]) + 0.5 / 12
        np.testing.assert_allclose(got["density"]["places"][:2], [first, first + np.array([1 / 12, 0, 0])], atol=1e-7)
        assert got["temperature"]["background"] == np.median(table["temperature"])


def test_what_is_near_the_background_is_left_out(tmp_path: Path) -> None:
    run = fake_run.plume(12)
    table = run.frame(4)["smoke"]
    grid = grids.box(run.static["smoke"])
    assert grid is not None
    got = read(vdb.encode(grid, table, half=True, zip=True, tolerance=0.01), tmp_path, (0, 0, 0), (12, 12, 24))
    values, most = got["density"]["values"], table["density"].max()
    kept = table["density"] > 0.01 * most
    np.testing.assert_array_equal(got["density"]["active"], kept)
    assert 0 < kept.sum() < kept.size
    np.testing.assert_array_equal(values, np.where(kept, table["density"].astype(np.float16), 0).astype(np.float32))


@pytest.mark.parametrize(("plane", "flat"), [("xy", 2), ("xz", 1)])
def test_a_plane_is_one_voxel_thick(plane: str, flat: int, tmp_path: Path) -> None:
    run = fake_run.ink(plane, 8)
    table, grid = run.frame(2)["dye"], grids.box(run.static["dye"])
    assert grid is not None and grid.flat == flat
    size = (16, 8, 1) if flat == 2 else (16, 1, 8)
    got = read(vdb.encode(grid, table, tolerance=0.0), tmp_path, (0, 0, 0), size)
    np.testing.assert_array_equal(np.squeeze(got["density"]["values"], flat), table["density"])
    velocity = np.squeeze(got["velocity"]["values"], flat)
    np.testing.assert_array_equal(velocity[..., [0, 1] if flat == 2 else [0, 2]], table["velocity"])
    assert not velocity[..., flat].any() and velocity.any()
    place = got["density"]["places"][0]
    assert abs(place[flat]) < 1e-12  # The middle of the plane.


def test_faces_become_a_staggered_grid(tmp_path: Path) -> None:
    grid = grids.box(fake_run.on_grid((3, 4, 5), 3, 0.5, (1.0, 2.0, 3.0)))
    assert grid is not None
    random = np.random.default_rng(1)
    table = {
        f"velocity_{axis}": random.random(shape).astype(np.float32)
        for axis, shape in zip("xyz", [(4, 4, 5), (3, 5, 5), (3, 4, 6)], strict=True)
    }
    got = read(vdb.encode(grid, table, tolerance=0.0), tmp_path, (0, 0, 0), (4, 5, 6))
    assert set(got) == {"velocity"} and str(got["velocity"]["words"][0]) == "staggered"
    values = got["velocity"]["values"]
    np.testing.assert_array_equal(values[:, :4, :5, 0], table["velocity_x"])
    np.testing.assert_array_equal(values[:3, :, :5, 1], table["velocity_y"])
    np.testing.assert_array_equal(values[:3, :4, :, 2], table["velocity_z"])
    # Voxel i has its lower face, component x, half a voxel below its middle: at the wall for i = 0.
    np.testing.assert_allclose(got["velocity"]["places"][0] - [0.25, 0, 0], [1.0, 2.25, 3.25])
    both = vdb.fields(grid, table | {"velocity": np.zeros((3, 4, 5, 3), dtype=np.float32)})
    assert both == {"velocity": 3, "velocity_faces": 3}


def test_usd_volumes_refer_to_the_files(tmp_path: Path) -> None:
    run = fake_run.plume(8)
    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    assert not stage.GetCompositionErrors()
    volume = UsdVol.Volume(stage.GetPrimAtPath("/scene/smoke"))
    assert volume
    np.testing.assert_allclose(volume.GetExtentAttr().Get(), [[-0.5, -0.5, 0.0], [0.5, 0.5, 2.0]])
    found = volume.GetFieldPaths()
    assert set(found) == {"density", "temperature", "pressure", "velocity"}
    for name, path in found.items():
        field = UsdVol.OpenVDBAsset(stage.GetPrimAtPath(path))
        assert field.GetFieldNameAttr().Get() == name
        vector = name == "velocity"
        assert field.GetFieldDataTypeAttr().Get() == ("float3" if vector else "float")
        assert field.GetVectorDataRoleHintAttr().Get() == ("Vector" if vector else "None")
        assert field.GetFieldClassAttr().Get() == ("fogVolume" if name == "density" else None)
        for i in range(run.n_frames):
            asset = field.GetFilePathAttr().Get(i)
            assert Path(asset.resolvedPath) == (tmp_path / f"volumes/smoke.{i:06}.vdb").resolve()
            assert Path(asset.resolvedPath).is_file()
    data = Path(UsdVol.OpenVDBAsset(stage.GetPrimAtPath(found["density"])).GetFilePathAttr().Get(4).resolvedPath)
    got = read(data.read_bytes(), tmp_path, (0, 0, 0), (8, 8, 16))
    kept = np.where(got["density"]["active"], run.frame(4)["smoke"]["density"], 0)
    np.testing.assert_array_equal(got["density"]["values"], kept)


def test_a_run_without_grids_says_so(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="nothing on a grid"):
        vdb.write(fake_run.studio(), tmp_path)
