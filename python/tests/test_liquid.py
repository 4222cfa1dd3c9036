"""Liquids on a grid as others see them: their surface as a mesh in runs, stages and pictures, their cells as a level set,
the dam of the laboratory."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from test_vdb import oracle, read

from tumble import Run
from tumble._engine import World
from tumble.export import usd, vdb
from tumble.grids import box
from tumble.pictures.things import Stage
from tumble.run import simulate

__all__ = ["oracle"]

Tree = dict[str, Any]

RADIUS = 0.3


def ball(**words: Any) -> Tree:
    """A ball of water that falls, and does not reach the floor."""
    fill = {"shape": {"sphere": {"center": [0, 0, 0.6], "radius": RADIUS}}, "velocity": [0.5, 0, 0]}
    water = {"name": "water", "box": {"size": [1, 1, 1], "center": [0, 0, 0.5], "resolution": 24}, "fill": [fill]}
    return {
        "version": 1,
        "time": {"fps": 50, "frames": 4},
        "liquid": [water | words],
        "output": {"plot": False, "columns": ["position", "velocity", "distance"]},
    }


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return simulate(ball(), tmp_path_factory.mktemp("liquid") / "run")


def enclosed(x: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = x[triangles].astype(float).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_the_surface_is_closed_smooth_and_as_large_as_the_liquid(run: Run) -> None:
    for i in (0, 4):
        table = run.frame(i)["water.surface"]
        x, triangles = table["position"], table["triangles"].reshape(-1, 3)
        assert len(table["velocity"]) == len(x) > 500
        edges = Counter((int(a), int(b)) for t in triangles for a, b in zip(t, np.roll(t, -1), strict=True))
        assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
        volume = 4 / 3 * np.pi * RADIUS**3
        assert enclosed(x, triangles) == pytest.approx(volume, rel=0.03)
        # A ball, to a tenth of a cell, that falls by g t²/2.
        t = i / 50
        far = np.linalg.norm(x - np.array([0.5 * t, 0, 0.6 - 4.9 * t * t]), axis=1)
        assert np.abs(far - RADIUS).max() < 0.25 / 24 and far.std() < 0.1 / 24
        np.testing.assert_allclose(table["velocity"].mean(axis=0), [0.5, 0, -9.8 * t], atol=0.02)


def test_it_is_drawn_instead_of_the_particles(run: Run) -> None:
    (drawn,) = Stage(run).things(2)
    assert drawn.name == "water.surface" and drawn.matter == "liquid"  # type: ignore[union-attr]
    bare = World(ball(surface=False))
    assert "water.surface" not in bare.frame and "water.surface" in World(ball()).frame


def test_a_stage_has_another_mesh_in_each_frame(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/water_surface"))
    for i in (0, 3):
        table = run.frame(i)["water.surface"]
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get(i))
        assert set(counts) == {3} and 3 * len(counts) == table["triangles"].size
        np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(i), table["triangles"].ravel())
        np.testing.assert_allclose(mesh.GetPointsAttr().Get(i), table["position"], atol=1e-6)
        np.testing.assert_allclose(mesh.GetVelocitiesAttr().Get(i), table["velocity"], atol=1e-6)


def test_spray_is_in_runs_pictures_and_stages(tmp_path: Path) -> None:
    """A ball of water that hits the floor at 5 m/s."""
    fill = {"shape": {"sphere": {"center": [0, 0, 0.4], "radius": RADIUS}}, "velocity": [0, 0, -5]}
    run = simulate(ball(fill=[fill], whitewater={}) | {"time": {"fps": 50, "frames": 8}}, tmp_path / "run")
    first, last = run.frame(0), run.frame(8)
    for name in ("water.spray", "water.foam", "water.bubbles"):
        assert len(first[name]["id"]) == 0 and len(last[name]["id"]) > 20
        assert np.isfinite(last[name]["position"]).all() and last[name]["age"].max() <= 8 / 50
    drawn = {thing.name: thing for thing in Stage(run).things(8) if thing}
    assert {"water.surface", "water.spray", "water.foam", "water.bubbles"} <= set(drawn)
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    points = UsdGeom.Points(stage.GetPrimAtPath("/scene/water_spray"))
    np.testing.assert_allclose(points.GetPointsAttr().Get(8), last["water.spray"]["position"], atol=1e-6)
    np.testing.assert_allclose(points.GetVelocitiesAttr().Get(8), last["water.spray"]["velocity"], atol=1e-6)


@pytest.mark.usefixtures("oracle")
def test_its_cells_are_a_level_set(run: Run, tmp_path: Path) -> None:
    goal = vdb.write(run, tmp_path, tolerance=0.0)
    assert [p.name for p in sorted(goal.iterdir())] == [f"water_cells.{i:06}.vdb" for i in range(5)]
    got = read((goal / "water_cells.000000.vdb").read_bytes(), tmp_path, (0, 0, 0), (24, 24, 24))
    assert [str(w) for w in got["distance"]["words"][:3]] == ["level set", "float", "m"]
    assert got["distance"]["background"] == pytest.approx(1.5 / 24)
    grid = box(run.static["water.cells"])
    assert grid is not None
    x, y, z = np.meshgrid(*(grid.points(a) for a in range(3)), indexing="ij")
    exact = np.sqrt(x**2 + y**2 + (z - 0.6) ** 2) - RADIUS
    near = np.abs(exact) < 1 / 24
    error = 24 * np.abs(got["distance"]["values"] - exact)[near]
    assert error.max() < 0.4 and error.mean() < 0.1, (error.max(), error.mean())
    # Velocities are those of the particles, where there are some.
    inside = exact < -2 / 24
    np.testing.assert_allclose(
        got["velocity"]["values"][inside], np.broadcast_to([0.5, 0, 0], (inside.sum(), 3)), atol=1e-5
    )


def test_a_plane_has_no_surface_that_could_be_asked_for(tmp_path: Path) -> None:
    tree = ball(surface=True) | {"dimension": 2}
    with pytest.raises(Exception, match=r'liquid "water"\.surface: true, but in the plane'):
        World(tree)


@pytest.mark.long
def test_the_surface_is_that_of_another_program(run: Run) -> None:
    """Of particles alone, by the program that studios use: its surface is no farther than half a cell."""
    pysplashsurf = pytest.importorskip("pysplashsurf")
    from scipy.spatial import cKDTree

    frame = run.frame(4)
    x = np.ascontiguousarray(frame["water"]["position"], dtype=np.float64)
    made = pysplashsurf.reconstruct_surface(
        x, particle_radius=0.25 / 24, smoothing_length=2.0, cube_size=0.5, iso_surface_threshold=0.6
    )
    other, own = np.asarray(made.mesh.vertices), frame["water.surface"]["position"].astype(float)
    far = max(cKDTree(other).query(own)[0].max(), cKDTree(own).query(other)[0].max())
    assert far < 0.75 / 24


def test_the_dam_of_the_laboratory(tumble: Callable[..., Answer], tmp_path: Path) -> None:
    done = tumble("lab", "dam", "--cells", 16, "--out", tmp_path / "dam")
    assert done.code == 0, done.err
    page = (tmp_path / "dam/dam.html").read_text(encoding="utf-8")
    for name in ("PIC", "FLIP", "APIC", "affine FLIP", "position-based"):
        assert f"<b>{name}</b>: front" in page
    assert (tmp_path / "dam/dam.png").stat().st_size > 50_000
