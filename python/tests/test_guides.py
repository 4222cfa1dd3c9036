"""Hair from grooms: curves of USD and OBJ files as strands."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tumble
from tumble import Scene, SceneError, World, usd
from tumble.pictures.strands import Skin, strands
from tumble.pictures.things import Stage
from tumble.run import simulate

SEGMENTS = 24
BEZIER = np.array([[0, 10, 0], [0, 13, 0], [4, 14, 1], [4, 8, 2], [4, 5, 2.5], [2, 4, 3], [0, 4, 3]], dtype=float)
"""Two spans in centimetres, y up."""

TRIANGLE = """def Mesh "skin" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
"""


def tree(path: str, more: dict[str, Any] | None = None, **words: Any) -> dict[str, Any]:
    hair = {"name": "h", "guides": {"path": path, **(more or {})}, "segments": SEGMENTS} | words
    return {"version": 1, "precision": "double", "system": [{"method": "position_based"}], "hair": [hair]}


def grown(folder: Path, path: str, more: dict[str, Any] | None = None, **words: Any) -> Any:
    """Points of the strands at the start, strands x points x 3."""
    world = World(Scene(tree(path, more, **words), folder))
    return world.frame["h"]["position"].reshape(-1, SEGMENTS + 1, 3)


def prim(points: Any, counts: list[int], kind: str = "BasisCurves", **attributes: str) -> str:
    said = "".join(f'    uniform token {name} = "{value}"\n' for name, value in attributes.items())
    listed = ", ".join(f"({x!r}, {y!r}, {z!r})" for x, y, z in np.asarray(points, dtype=float).tolist())
    return f'def {kind} "strands" {{\n{said}    int[] curveVertexCounts = {counts}\n    point3f[] points = [{listed}]\n}}\n'


def write(folder: Path, body: str, unit: float = 1.0, up: str = "Z", name: str = "groom.usda") -> str:
    (folder / name).write_text(f'#usda 1.0\n(\n    metersPerUnit = {unit}\n    upAxis = "{up}"\n)\n{body}')
    return name


def spans(points: Any, u: Any) -> Any:
    """Points of Bézier spans, from Bernstein's polynomials."""
    b = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3], axis=1)
    return np.concatenate([b @ points[k : k + 4] for k in range(0, len(points) - 3, 3)])


def apart(x: Any, y: Any) -> float:
    """How far the farthest point of x is from the nearest one of y."""
    return float(np.linalg.norm(x[:, None] - y[None], axis=-1).min(axis=1).max())


def test_cubic_curves_below_a_transform_land_where_they_should(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    other = BEZIER + np.array([1.0, 0.5, -2.0])
    inner = prim(np.concatenate([BEZIER, other]), [7, 7], type="cubic", basis="bezier")
    body = (
        'def Xform "groom" {\n    double3 xformOp:translate = (0, 100, 0)\n    float xformOp:rotateY = 90\n'
        f'    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]\n{inner}}}\n'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = grown(tmp_path, write(tmp_path, body, 0.01, "Y"))

    def placed(p: Any) -> Any:
        # About y by 90 degrees: (x, y, z) becomes (z, y, -x); then y up becomes z up: (x, y, z) becomes (x, -z, y).
        turned = np.stack([p[:, 2], p[:, 1] + 100, -p[:, 0]], axis=1)
        return 0.01 * np.stack([turned[:, 0], -turned[:, 2], turned[:, 1]], axis=1)

    for curve, own in zip((BEZIER, other), found, strict=True):
        np.testing.assert_allclose(own[[0, -1]], placed(curve[[0, -1]]), atol=1e-8)  # points are floats in the file
        exact = placed(spans(curve, np.linspace(0, 1, 4000)))
        length = np.linalg.norm(np.diff(exact, axis=0), axis=1).sum()
        assert apart(own, exact) < 1e-4 * length  # measured 2e-5
        pieces = np.linalg.norm(np.diff(own, axis=0), axis=1)
        assert abs(pieces.sum() / length - 1) < 0.01 and pieces.std() < 0.02 * pieces.mean()
    # The same as polylines of an OBJ, and where the scene moves them.
    (tmp_path / "groom.obj").write_text(usd.as_curves(tmp_path / "groom.usda"))
    np.testing.assert_array_equal(grown(tmp_path, "groom.obj"), found)
    moved = grown(tmp_path, "groom.obj", {"scale": 2, "translate": [1, 0, 0]})
    np.testing.assert_allclose(moved, 2 * found + [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("basis", ["bspline", "catmullRom"])
@pytest.mark.parametrize("wrap", ["nonperiodic", "pinned"])
def test_splines_are_those_of_their_basis(tmp_path: Path, basis: str, wrap: str) -> None:
    pytest.importorskip("pxr")
    from scipy.interpolate import BSpline

    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 2], [1, 1, 3], [0, 1, 3.5]], dtype=float)
    found = grown(tmp_path, write(tmp_path, prim(points, [5], type="cubic", basis=basis, wrap=wrap)))[0]
    c = points if wrap == "nonperiodic" else np.concatenate([[-points[1]], points, [2 * points[4] - points[3]]])
    if basis == "bspline":
        u = np.linspace(3, len(c), 5000)
        exact = BSpline(np.arange(len(c) + 4), c, 3)(u)
    else:
        # Hermite pieces whose slopes are those of the chords beside them.
        bezier = [
            [c[i], c[i] + (c[i + 1] - c[i - 1]) / 6, c[i + 1] - (c[i + 2] - c[i]) / 6] for i in range(1, len(c) - 2)
        ]
        exact = spans(np.concatenate([np.concatenate(bezier), c[-2:-1]]), np.linspace(0, 1, 2500))
    np.testing.assert_allclose(found[[0, -1]], exact[[0, -1]], atol=1e-6)
    if wrap == "pinned":
        np.testing.assert_allclose(found[[0, -1]], points[[0, -1]], atol=1e-6)
    assert apart(found, exact) < 1e-3  # the points of the exact curve are 1 mm apart
    assert apart(exact, found) > 1e-2


def test_straight_curves_are_exact_and_what_cannot_be_used_is_named(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    line = [[0, 0, 0], [0, 0, 1], [0, 1, 1]]
    closed = prim(line, [3], type="linear", wrap="periodic").replace("strands", "ring")
    nurbs = prim(line, [3], kind="NurbsCurves").replace("strands", "nurbs")
    hidden = prim(line, [3], type="linear", purpose="proxy").replace("strands", "proxy")
    name = write(tmp_path, prim(line, [3], type="linear") + closed + nurbs + hidden + TRIANGLE)
    with pytest.warns(usd.UsdWarning, match="periodic"):
        scene = Scene(tree(name), tmp_path)
    world = World(scene)
    x = world.frame["h"]["position"]
    np.testing.assert_allclose(x[:: SEGMENTS // 2], line, atol=1e-12)
    (told,) = world.warnings
    assert told["code"] == "unread-prims" and told["path"] == 'hair "h".guides.path'
    for part in ("/ring (BasisCurves, periodic: closed curves have no root)", "/nurbs (NurbsCurves)"):
        assert part in told["message"]
    assert "proxy" not in told["message"] and "skin" not in told["message"]
    # The hash is that of the file, and a resolved scene is a scene.
    assert len(scene.to_dict()["hair"][0]["guides"]["hash"]) == 16
    with pytest.warns(usd.UsdWarning, match="periodic"):
        again = World(Scene(scene.to_dict(), tmp_path))
    np.testing.assert_array_equal(again.frame["h"]["position"], x)


def test_bad_grooms_are_told_with_their_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pxr")
    line = [[0, 0, 0], [0, 0, 1]]
    cases = [
        (
            TRIANGLE,
            "there are no curves in it; export the strands as BasisCurves that are visible, or let hair grow on a mesh",
        ),
        (
            prim(line, [2], type="linear", wrap="periodic"),
            "what is in it cannot be used: /strands (BasisCurves, periodic",
        ),
        (
            prim(line, [2], type="linear", visibility="invisible").replace("uniform token vis", "token vis"),
            "left out as invisible",
        ),
        (prim(line, [2]), "/strands: curve 1 has 2 points, a bezier curve has 4, 7, 10 and so on"),
        (
            prim([*line, *line], [2, 1, 1], type="linear"),
            "/strands: curve 2 has 1 points, a linear curve has 2 or more",
        ),
        (prim(line, [3], type="linear"), "/strands: its curves do not fit its points"),
        (
            prim([*line, *line], [2, 2], type="linear").replace("(0.0, 0.0, 1.0)]", "(nan, 0, 1)]"),
            "/strands: curve 2 goes through",
        ),
        (prim([*line, [1, 1, 1], [1, 1, 1]], [2, 2], type="linear"), "curve 2 has no length"),
        ("", "there are no curves in it"),
    ]
    for body, expected in cases:
        with pytest.raises(SceneError) as caught:
            Scene(tree(write(tmp_path, body)), tmp_path)
        message = str(caught.value)
        assert expected in message and 'hair "h".guides.path' in message, message
    monkeypatch.setattr("tumble.usd.curves.MOST", 20)
    with pytest.raises(SceneError, match="its curves need more than 20 points; export fewer"):
        Scene(tree(write(tmp_path, prim(BEZIER, [7], type="cubic", basis="bezier"))), tmp_path)
    with pytest.raises(SceneError, match=r"none\.usda"):
        Scene(tree("none.usda"), tmp_path)
    # Curves are no mesh.
    name = write(tmp_path, prim(line, [2], type="linear"))
    with pytest.raises(
        SceneError,
        match=r"there is no mesh in it; what is in it cannot be used: /strands .*hair takes curves as guides",
    ):
        Scene({"version": 1, "net": [{"name": "n", "mesh": {"path": name}}]}, tmp_path)
    (tmp_path / "skin.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match="it has faces and no curves"):
        Scene(tree("skin.obj"), tmp_path)


def fringe(folder: Path, count: int) -> str:
    """Strands that stand on the upper part of a ball of 0.1 m at [0, 0, 1], and bend to the side."""
    random = np.random.default_rng(3)
    z = 0.6 + 0.4 * random.random(count)
    angle = 2 * np.pi * random.random(count)
    out = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)
    s = np.linspace(0, 1, 9)[:, None]
    lines, n = [], 0
    for o in out:
        points = [0, 0, 1] + 0.1 * o + 0.08 * s * o + 0.04 * s**2 * np.array([1.0, 0, -0.5])
        lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in points]
        lines.append("l " + " ".join(str(n + k) for k in range(1, 10)))
        n += 9
    (folder / "fringe.obj").write_text("\n".join(lines))
    return "fringe.obj"


def test_strands_in_pictures_grow_where_guides_are_near(tmp_path: Path) -> None:
    words = tree(fringe(tmp_path, 300), on="ball", render=10, segments=8) | {
        "time": {"fps": 24, "frames": 1},
        "collider": [{"name": "ball", "shape": {"sphere": {"center": [0, 0, 1], "radius": 0.1}}}],
        "output": {"columns": ["position"]},
    }
    run = simulate(Scene(words, tmp_path), tmp_path / "run")
    (hair,) = [thing for thing in Stage(run).things(0) if hasattr(thing, "curves")]
    roots = hair.curves[:, 0] - [0, 0, 1]
    assert hair.curves.shape == (3000, 9, 3)
    np.testing.assert_allclose(np.linalg.norm(roots, axis=1), 0.1, atol=2e-3)
    # On the cap of the groom and about a strand's spacing of 9 mm around it, and nowhere else; all of the cap is covered.
    assert roots[:, 2].min() > 0.045 and 0.0 < (roots[:, 2] < 0.06).mean() < 0.15
    heights = np.histogram(roots[:, 2], np.linspace(0.062, 0.099, 5))[0]
    assert heights.min() > 0.8 * heights.mean()
    # They bend as the groom does: to the side of x.
    tips = hair.curves[:, -1] - hair.curves[:, 0] - 0.8 * roots
    np.testing.assert_allclose(tips, np.tile([0.04, 0, -0.02], (3000, 1)), atol=0.012)


def test_a_groom_off_its_surface_is_drawn_between_its_strands() -> None:
    random = np.random.default_rng(5)
    roots = np.concatenate([random.random((50, 2)), np.full((50, 1), 3.0)], axis=1)
    x = (roots[:, None] + np.linspace(0, 1, 5)[:, None] * np.array([0, 0, 0.2])).reshape(-1, 3)
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    skin = Skin(square, square, np.array([[0, 1, 2], [0, 2, 3]]), groomed=True)
    shown = strands(x, 5, 6, skin)
    assert not shown.skinned
    np.testing.assert_allclose(shown.of(x)[:, 0, 2], 3.0)


def test_as_curves_is_part_of_the_package() -> None:
    assert "as_curves" in usd.__all__ and tumble.Scene.schema()["$defs"]["Guides"]["required"] == ["path"]
