"""VDB files: what OpenVDB reads from them is what was written, bit for bit."""

import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import ExportError
from tumble._engine import write_vdb

READER = Path(__file__).with_name("openvdb_reader.py")
SYSTEM = Path("/usr/bin/python3")
LOW, SIZE = (-20, -20, -20), (64, 64, 64)


def openvdb() -> bool:
    tried = (subprocess.run([SYSTEM, "-c", f"import {m}"], capture_output=True).returncode for m in MODULES)
    return SYSTEM.exists() and any(code == 0 for code in tried)


MODULES = ("pyopenvdb", "openvdb")


@pytest.fixture(scope="module", autouse=True)
def oracle() -> None:
    if not openvdb():
        cure = "apt install python3-openvdb"
        (pytest.fail if Path("/usr/bin/apt-get").exists() else pytest.skip)(f"OpenVDB is missing: {cure}")


def read(
    data: bytes, folder: Path, low: tuple[int, ...] = LOW, size: tuple[int, ...] = SIZE
) -> dict[str, dict[str, Any]]:
    """Grid -> what OpenVDB says of it."""
    file, out = folder / "test.vdb", folder / "read.npz"
    file.write_bytes(data)
    command = [SYSTEM, READER, file, out, *map(str, (*low, *size))]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, Any]] = {}
    with np.load(out) as archive:
        for key in archive.files:
            name, _, what = key.rpartition("/")
            found.setdefault(name, {})[what] = archive[key]
    return found


def volume(values: np.ndarray, **words: Any) -> dict[str, Any]:
    """The words of `write_vdb` for an array of the shape (nx, ny, nz) or (nx, ny, nz, 3)."""
    flat = np.ascontiguousarray(np.moveaxis(values, (0, 2), (2, 0)), dtype=np.float32).ravel()
    known = {
        "name": "g",
        "unit": "K",
        "class": "unknown",
        "corner": [0, 0, 0],
        "spacing": 0.25,
        "origin": [1.0, 2.0, 3.0],
    }
    known |= {"background": 0.0, "tolerance": 0.0, "half": False, "values": flat}
    return known | {"width": 1 if values.ndim == 3 else 3, "points": list(values.shape[:3])} | words


def inside(values: np.ndarray, corner: tuple[int, ...], background: Any, dtype: Any = np.float32) -> np.ndarray:
    """The box of voxels that is read, with an array in it."""
    out = np.full((*SIZE, *values.shape[3:]), background, dtype=dtype)
    begin = np.array(corner) - LOW
    out[tuple(slice(b, b + n) for b, n in zip(begin, values.shape, strict=False))][...] = values
    return out


def same_bits(a: np.ndarray, b: np.ndarray) -> None:
    assert a.shape == b.shape and a.dtype == b.dtype == np.float32
    np.testing.assert_array_equal(a.view(np.uint32), b.view(np.uint32))


RANDOM = np.random.default_rng(4)


@pytest.mark.parametrize("zip", [False, True])
@pytest.mark.parametrize("corner", [(0, 0, 0), (-13, -7, -20), (-3, 5, 8)])
@pytest.mark.parametrize("kind", ["float", "vec3s"])
def test_values_come_back_bit_for_bit(kind: str, corner: tuple[int, ...], zip: bool, tmp_path: Path) -> None:
    shape = (19, 23, 33) if kind == "float" else (19, 23, 33, 3)
    values = RANDOM.standard_normal(shape).astype(np.float32)
    values[:, 10:, :16] = 0.0
    values[0, 0, 0] = -0.0
    values[1, 1, 1] = np.float32(1e-42)
    values[2, 2, 2] = np.inf
    got = read(write_vdb([volume(values, corner=list(corner))], zip), tmp_path)["g"]
    same_bits(got["values"], inside(values, corner, 0.0))
    differ = (values.view(np.uint32) != 0).reshape(*shape[:3], -1).any(axis=-1)
    active = inside(differ, corner, False, bool)
    np.testing.assert_array_equal(got["active"], active)
    assert got["counts"][0] == differ.sum()
    at = np.argwhere(differ) + corner
    np.testing.assert_array_equal(got["extent"], [at.min(axis=0), at.max(axis=0)])
    np.testing.assert_array_equal(got["noted_extent"], got["extent"])
    vector = "none" if kind == "float" else "contravariant relative"
    packed = "zip + active values" if zip else "active values"
    kept = [str(w) for w in got["words"]]
    assert kept[:3] == ["unknown", kind, "K"] and kept[4:] == ["False", packed]
    assert kind == "float" or kept[3] == vector


def test_places_are_those_of_the_cells(tmp_path: Path) -> None:
    got = read(write_vdb([volume(np.ones((2, 3, 4)), spacing=0.3, origin=[0.1, -7.0, 2.5])], False), tmp_path)["g"]
    expected = np.array([0.1, -7.0, 2.5]) + 0.3 * np.array([(0, 0, 0), (1, 0, 0), (-5, 7, 11)])
    np.testing.assert_allclose(got["places"], expected, rtol=0, atol=1e-15)


def test_background_stands_for_all_that_is_near_it(tmp_path: Path) -> None:
    values = np.full((20, 20, 20), 300.0, dtype=np.float32)
    values[3, 4, 5], values[4, 4, 5], values[19, 19, 19] = 300.09, 300.11, 299.8
    got = read(write_vdb([volume(values, background=300.0, tolerance=0.1)], False), tmp_path)["g"]
    assert got["background"] == 300.0
    assert got["counts"].tolist() == [2, 2, 2]  # Voxels, leaves, pieces.
    values[3, 4, 5] = 300.0
    same_bits(got["values"], inside(values, (0, 0, 0), 300.0))


def test_equal_blocks_are_tiles(tmp_path: Path) -> None:
    values = np.zeros((32, 32, 32), dtype=np.float32)
    values[8:24, 8:16, 8:16] = 5.0
    values[16, 8, 8] = 6.0
    got = read(write_vdb([volume(values, corner=[-16, -16, -16])], False), tmp_path)["g"]
    same_bits(got["values"], inside(values, (-16, -16, -16), 0.0))
    assert got["counts"][:2].tolist() == [1024, 1]
    # Whole boxes: nothing is left out, not even the background.
    got = read(write_vdb([volume(0 * values, tolerance=None)], False), tmp_path)["g"]
    assert got["counts"].tolist() == [32**3, 0, 64]


def test_halves_are_rounded_to_the_nearest(tmp_path: Path) -> None:
    values = (RANDOM.standard_normal((17, 9, 12)) * 10.0 ** RANDOM.integers(-9, 4, (17, 9, 12))).astype(np.float32)
    # Halfway between two halves: to the even one.
    values[0, 0, :2] = 1 + 2.0**-11, 1 + 3 * 2.0**-11
    for zip in (False, True):
        words = {"half": True, "background": 0.1, "corner": [-9, -9, -9]}
        got = read(write_vdb([volume(values, **words)], zip), tmp_path)["g"]
        background = np.float32(np.float16(0.1))
        assert got["background"] == background and background != np.float32(0.1)
        same_bits(got["values"], inside(values.astype(np.float16).astype(np.float32), (-9, -9, -9), background))
        assert str(got["words"][4]) == "True"
    vectors = np.stack([values, -values, 2 * values], axis=-1)
    got = read(write_vdb([volume(vectors, half=True)], False), tmp_path)["g"]
    same_bits(got["values"], inside(vectors.astype(np.float16).astype(np.float32), (0, 0, 0), 0.0))


def test_several_grids_in_a_file(tmp_path: Path) -> None:
    a, b = RANDOM.random((5, 6, 7)).astype(np.float32), RANDOM.random((4, 4, 4, 3)).astype(np.float32)
    data = write_vdb(
        [
            volume(a, name="density", **{"class": "fog volume"}),
            volume(b, name="velocity", unit="m/s", **{"class": "staggered"}),
            volume(np.zeros((3, 3, 3)), name="nothing"),
        ],
        True,
    )
    assert data == write_vdb(
        [
            volume(a, name="density", **{"class": "fog volume"}),
            volume(b, name="velocity", unit="m/s", **{"class": "staggered"}),
            volume(np.zeros((3, 3, 3)), name="nothing"),
        ],
        True,
    )
    got = read(data, tmp_path)
    assert set(got) == {"density", "velocity", "nothing"}
    same_bits(got["density"]["values"], inside(a, (0, 0, 0), 0.0))
    same_bits(got["velocity"]["values"], inside(b, (0, 0, 0), 0.0))
    assert [str(w) for w in got["density"]["words"]][:3] == ["fog volume", "float", "K"]
    assert [str(w) for w in got["velocity"]["words"]][:3] == ["staggered", "vec3s", "m/s"]
    assert got["nothing"]["counts"].tolist() == [0, 0, 0]


def test_far_from_the_first_nodes(tmp_path: Path) -> None:
    """Across the corners of the largest nodes, 4096 voxels a side."""
    values = RANDOM.random((40, 40, 40)).astype(np.float32)
    for corner in ((4076, -4116, -20), (-8200, 100_000, -1_000_003)):
        got = read(write_vdb([volume(values, corner=list(corner))], False), tmp_path, corner, values.shape)["g"]
        same_bits(got["values"], values)


def test_errors_name_the_grid_and_the_cure() -> None:
    ones = np.ones((2, 2, 2))
    wrong = [
        (volume(ones, points=[2, 2, 3]), r'VDB: "g": 8 numbers, expected 1 for each of \[2, 2, 3\] voxels'),
        (volume(ones, spacing=0.0), "spacing 0 m"),
        (volume(70_000 * ones, half=True), "70000 exceeds the range of half precision, 65504; write single precision"),
        (volume(ones, corner=[2**31 - 2, 0, 0]), "exceed the index range"),
        (volume(ones, width=2), "2 numbers per voxel, expected 1 or 3"),
        (volume(ones, **{"class": "fog"}), 'no class "fog"'),
    ]
    for given, text in wrong:
        with pytest.raises(ExportError, match=text):
            write_vdb([given], False)
    with pytest.raises(ExportError, match="two grids of that name"):
        write_vdb([volume(ones), volume(ones)], False)


def test_the_head_of_the_file() -> None:
    data = write_vdb([volume(np.ones((1, 1, 1)))], False)
    assert struct.unpack("<QIIIB", data[:21]) == (0x56444220, 224, 10, 0, 1)
