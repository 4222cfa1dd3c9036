"""Hair in pictures and exports: strands between those that were simulated."""

from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble.export import usd
from tumble.pictures.drawn import as_triangles
from tumble.pictures.strands import Hair, prisms, strands
from tumble.pictures.things import Stage

POINTS = 5
COUNT = 40


def brush(render: int) -> fake_run.FakeRun:
    """Strands of 0.2 m on a plate of 1 m, all leaning to the side as time goes on."""
    random = np.random.default_rng(1)
    roots = np.concatenate([random.random((COUNT, 2)), np.zeros((COUNT, 1))], axis=1)
    up = 0.2 * np.linspace(0.0, 1.0, POINTS)[:, None] * np.array([0.0, 0.0, 1.0])

    def columns(t: float) -> fake_run.Columns:
        aside = 0.1 * t * (np.linspace(0.0, 1.0, POINTS) ** 2)[:, None] * np.array([1.0, 0.0, 0.0])
        x = (roots[:, None] + up + aside).reshape(-1, 3).astype(np.float32)
        v = np.broadcast_to(aside / max(t, 1e-9), (COUNT, POINTS, 3)).reshape(-1, 3).astype(np.float32)
        return {"h": {"position": x, "velocity": v}}

    static = {
        "h": {
            "curve": np.arange(COUNT * POINTS),
            "curve_points": np.array([POINTS]),
            "radius": np.array([1e-4]),
        }
    }
    words = fake_run.scene(hair=[{"name": "h", "render": render}])
    return fake_run.FakeRun(words, static, columns)


def test_strands_lie_between_those_that_were_simulated() -> None:
    x = brush(1).frame(0)["h"]["position"].astype(float)
    shown = strands(x, POINTS, 6)
    assert shown.guides.shape == (6 * COUNT, 3)
    np.testing.assert_allclose(shown.weights.sum(axis=1), 1.0)
    assert shown.weights.min() >= 0.0
    curves = shown.of(x)
    np.testing.assert_array_equal(curves[:COUNT].reshape(-1, 3), x)
    # Properties common to all strands hold for interpolated ones, too.
    np.testing.assert_allclose(curves[:, -1] - curves[:, 0], np.tile([0.0, 0.0, 0.2], (6 * COUNT, 1)), atol=1e-12)
    # They fill the gaps: the same mean density everywhere, and nothing far away from its guides.
    apart = np.linalg.norm(x.reshape(-1, POINTS, 3)[shown.guides][:, :, 0] - curves[:, None, 0], axis=-1)
    assert apart.max() < 0.6
    assert len(np.unique(curves[:, 0], axis=0)) == 6 * COUNT


def test_neighbours_are_the_nearest() -> None:
    from tumble.pictures.strands import _nearest

    x = np.random.default_rng(2).random((300, 3))
    near, distance = _nearest(x, 5)
    all_of_them = np.linalg.norm(x[:, None] - x[None], axis=-1)
    np.fill_diagonal(all_of_them, np.inf)
    np.testing.assert_array_equal(near, np.argsort(all_of_them, axis=1)[:, :5])
    np.testing.assert_allclose(distance, np.sort(all_of_them, axis=1)[:, :5])


def test_hair_is_drawn_as_strands_that_taper() -> None:
    (hair,) = Stage(brush(3)).things(2, 0.001)
    assert isinstance(hair, Hair)
    assert hair.curves.shape == (3 * COUNT, POINTS, 3)
    assert hair.radii[0] > 2 * hair.radii[-1] > 0
    vertices, triangles, normals = as_triangles(hair)
    assert triangles.max() == len(vertices) - 1
    curves = np.array([[[0.0, 0, 0], [0, 0, 1], [0, 0, 2]]])
    vertices, _, normals = prisms(curves, np.array([0.1, 0.1, 0.05]))
    np.testing.assert_allclose(np.linalg.norm(vertices[:, :2], axis=1), [0.1] * 6 + [0.05] * 3)
    np.testing.assert_allclose(normals[:, 2], 0.0, atol=1e-12)


@pytest.mark.parametrize("render", [1, 4])
def test_usd_has_one_prim_of_curves(tmp_path: Path, render: int) -> None:
    from pxr import Usd, UsdGeom

    run = brush(render)
    stage: Any = Usd.Stage.Open(str(usd.write(run, tmp_path)))
    assert not stage.GetCompositionErrors()
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/scene/h"))
    n = render * COUNT
    assert list(curves.GetCurveVertexCountsAttr().Get()) == [POINTS] * n
    assert (curves.GetTypeAttr().Get(), curves.GetWrapAttr().Get()) == ("linear", "nonperiodic")
    widths = np.array(curves.GetWidthsAttr().Get()).reshape(n, POINTS)
    assert curves.GetWidthsInterpolation() == "vertex"
    np.testing.assert_allclose(widths[:, 0], 2e-4, rtol=1e-6)
    assert (np.diff(widths, axis=1) < 0).all()
    for i in range(run.n_frames):
        points = np.array(curves.GetPointsAttr().Get(i))
        velocities = np.array(curves.GetVelocitiesAttr().Get(i))
        assert points.shape == velocities.shape == (n * POINTS, 3)
        own = COUNT * POINTS
        np.testing.assert_array_equal(points[:own], run.frame(i)["h"]["position"])
        low, high = np.array(curves.GetExtentAttr().Get(i))
        assert (low <= points.min(axis=0)).all() and (high >= points.max(axis=0)).all()
    assert np.abs(np.array(curves.GetPointsAttr().Get(4)) - np.array(curves.GetPointsAttr().Get(0))).max() > 0.03
