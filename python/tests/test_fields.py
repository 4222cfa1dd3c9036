"""Fields from Python: arrays in and out, the verbs, errors with their cure."""

import numpy as np
import pytest

from tumble import TumbleError
from tumble.fields import (
    Field,
    Grid,
    advect,
    average,
    curl,
    diffuse,
    diffusion_limit,
    directional,
    divergence,
    gradient,
    laplacian,
    project,
    sample,
)

RANDOM = np.random.default_rng(5)


def test_arrays_go_in_and_come_out() -> None:
    space, plane = Grid((4, 3, 2), 0.5), Grid((4, 3), 0.5, plane="xz", periodic="x")
    for grid, shapes in [
        (space, {"cell": (4, 3, 2), "face x": (5, 3, 2), "edge x": (4, 4, 3), "node": (5, 4, 3)}),
        (plane, {"cell": (4, 3), "face x": (4, 3), "face z": (4, 4), "node": (4, 4)}),
    ]:
        for place, shape in shapes.items():
            assert grid.shape(place) == shape
            values = RANDOM.random(shape)
            field = grid.field(values, place, unit="K")
            assert field.place == place and field.unit == "K" and field.array.shape == shape
            assert np.array_equal(field.array, values)
            assert np.array_equal(grid.field(np.asfortranarray(values), place).array, values)
            x = grid.points(place)
            assert len(x) == len(shape) and all(c.shape == shape for c in x)
            assert np.array_equal(grid.field(lambda *x: x[0] + 2 * x[1], place).array, x[0] + 2 * x[1])
    assert np.array_equal(plane.points("face z")[1][0], [0.0, 0.5, 1.0, 1.5])
    assert np.array_equal(space.points("cell")[2][0, 0], [0.25, 0.75])
    assert np.all(space.field(7).array == 7)
    assert Grid((3, 3), 0.1).field(np.ones((3, 3), dtype=np.int32)).array.sum() == 9


def test_the_verbs_are_those_of_calculus() -> None:
    for grid in (Grid((12, 9), 0.1, origin=(1.0, 2.0)), Grid((7, 6, 5), 0.1)):
        axes = "xyz"[: len(grid.cells)]
        f = grid.field(lambda *x: 3 * x[0] - 2 * x[1], unit="K")
        slope = gradient(f)
        assert [s.place for s in slope] == [f"face {a}" for a in axes]
        assert [s.unit for s in slope] == ["K/m"] * len(axes)
        assert np.allclose(slope[0].array[1:-1], 3) and np.allclose(slope[1].array[:, 1:-1], -2)
        assert np.all(slope[0].array[0] == 0), "closed walls"
        u = [
            grid.field(lambda *x, c=c: x[c] ** 2 * (1 + x[1 - c]) if c < 2 else 0 * x[c], f"face {a}", "m/s")
            for c, a in enumerate(axes)
        ]
        x = grid.points("cell")
        # The difference of a square is exact in the middle.
        assert np.allclose(divergence(u).array, 2 * x[0] * (1 + x[1]) + 2 * x[1] * (1 + x[0]))
        assert divergence(u).unit == "1/s"
        turn = curl(u)
        in_plane = turn if isinstance(turn, Field) else turn[2]
        assert in_plane.place == ("node" if len(axes) == 2 else "edge z")
        x = grid.points(in_plane.place)
        inner = (slice(1, -1), slice(1, -1))
        assert np.allclose(in_plane.array[inner], (x[1] ** 2 - x[0] ** 2)[inner])
        back = curl(turn)
        assert np.abs(divergence(back).array).max() < 1e-10 < np.abs(back[0].array).max()
        square = grid.field(lambda *x: x[0] ** 2, unit="K")
        assert np.allclose(laplacian(square).array[1:-1], 2) and laplacian(square).unit == "K/m²"
        along = directional(u, square)
        assert along.place == "cell"
        x = grid.points("cell")
        mean = (x[0] ** 2 + grid.spacing**2 / 4) * (1 + x[1])
        assert np.allclose(along.array[1:-1], (mean * 2 * x[0])[1:-1])
        assert np.allclose(
            average(f, "node").array[inner], grid.field(lambda *x: 3 * x[0] - 2 * x[1], "node").array[inner]
        )
        assert [p.place for p in laplacian(u)] == [p.place for p in u]


def test_fields_are_sampled_carried_and_diffused() -> None:
    grid = Grid((16, 8), 0.25, periodic="xy")
    f = grid.field(RANDOM.random((16, 8)))
    points = np.stack([c.ravel() for c in grid.points()], axis=1)
    for interpolation in ("linear", "cubic", "monotone"):
        assert np.allclose(sample(f, points, interpolation), f.array.ravel(), atol=1e-14)
    u = [grid.field(0.5, "face x", "m/s"), grid.field(-0.25, "face y", "m/s")]
    moved = advect(f, u, 1.0, interpolation="cubic", corrected=True)
    assert np.array_equal(moved.array, np.roll(f.array, (2, -1), axis=(0, 1)))
    both = advect(u, u, 1.0, trace="rk3", substeps=2, turning=True)
    assert np.allclose(both[0].array, 0.5) and both[1].place == "face y"
    smooth = diffuse(f, 0.1, 50.0)
    assert np.allclose(smooth.array, f.array.mean(), atol=1e-3) and np.ptp(f.array) > 0.5
    assert diffusion_limit(grid, 0.1) == pytest.approx(0.25**2 / 0.4)
    # Between walls of 1 and 3, a straight line.
    bar = Grid((10, 2), 0.1).field(0.0, sides={"x-": ("value", 1.0), "x+": ("value", 3.0)})
    assert np.allclose(diffuse(bar, 1.0, 5.0).array[:, 0], 1 + 2 * (np.arange(10) + 0.5) / 10)


def test_errors_name_the_place_and_the_cure() -> None:
    grid = Grid((4, 4), 0.1)
    cell, node = grid.field(0.0), grid.field(0.0, "node")
    u = (grid.field(1.0, "face x"), grid.field(1.0, "face y"))
    cases = [
        (lambda: gradient(node), ['"node"', '"cell"', "interpolate"]),
        (lambda: divergence((u[1], u[0])), ['"face y"', '"face x"']),
        (lambda: divergence(u[:1]), ["1 components", "expected 2"]),
        (lambda: directional(u, Grid((5, 4), 0.1).field(0.0)), ["different grids"]),
        (lambda: grid.field(np.zeros((3, 4)), "face x"), ["[3, 4]", "[5, 4]", "face x"]),
        (lambda: grid.field("red"), ["cell", "numbers"]),
        (lambda: grid.field(0.0, "face z"), ["face z", "plane"]),
        (lambda: grid.field(0.0, "middle"), ["middle", '"cell"']),
        (lambda: grid.field(0.0, sides=("value", "high")), ["sides", "closed"]),
        (lambda: grid.field(0.0, sides={"z": "closed"}), ['"z"', "axis"]),
        (lambda: Grid((4, 4), 0.1, periodic="x").field(0.0, sides={"x": "closed"}), ["periodic"]),
        (lambda: Grid((0, 4), 0.1), ["cells: 0", ">= 1", "expected"]),
        (lambda: Grid((9999, 9999, 9999), 0.1), ["9999", "expected"]),
        (lambda: Grid((4,), 0.1), ["cells", "two"]),
        (lambda: Grid((4, 4), -1.0), ["-1", "> 0"]),
        (lambda: Grid((4, 4), 0.1, plane="yx"), ["yx", '"xz"']),
        (lambda: sample(cell, [[1.0, 2.0, 3.0]]), ["n x 2"]),
        (lambda: advect(cell, u, 0.1, interpolation="smooth"), ["smooth", "cubic"]),  # type: ignore[arg-type, call-overload]
        (lambda: advect(cell, u, float("nan")), ["finite"]),
        (lambda: advect(cell, [cell, cell], 0.1), ['"cell"', '"face x"']),
        (lambda: diffuse(cell, -1.0, 1.0), ["diffusion"]),
        (lambda: laplacian(3), ["expected a field"]),  # type: ignore[call-overload]
    ]
    for bad, words in cases:
        with pytest.raises(TumbleError) as error:
            bad()
        for word in words:
            assert word in str(error.value), f"{word!r} is not in {error.value}"


def around_a_ball(n: int = 16) -> tuple[Grid, tuple[Field, ...]]:
    """A cube, and which shares of its faces a ball leaves open."""
    grid = Grid((n, n, n), 0.25)
    shares = []
    for place in ("face x", "face y", "face z"):
        x = [c / 0.25 / n for c in grid.points(place)]
        far = np.sqrt((x[0] - 0.45) ** 2 + (x[1] - 0.5) ** 2 + (x[2] - 0.55) ** 2) - 0.25
        shares.append(grid.field(np.floor(np.clip(0.5 + far * n, 0, 1) * 127 + 0.5) / 127, place))
    return grid, tuple(shares)


def inner(a: tuple[Field, ...], b: tuple[Field, ...], shares: tuple[Field, ...]) -> float:
    """In the metric of the masses that faces stand for; walls have none."""
    total = 0.0
    for axis, (f, g, w) in enumerate(zip(a, b, shares, strict=True)):
        inside = tuple(slice(1, -1) if k == axis else slice(None) for k in range(3))
        total += float((w.array * f.array * g.array)[inside].sum())
    return total


def flow(grid: Grid, u: tuple[Field, ...], shares: tuple[Field, ...]) -> np.ndarray:
    """The divergence of what passes through the open parts, times dx."""
    return sum(np.diff(f.array * w.array, axis=axis) for axis, (f, w) in enumerate(zip(u, shares, strict=True)))  # type: ignore[return-value]


def test_the_projection_of_velocities_is_the_nearest_in_the_metric_of_masses() -> None:
    grid, shares = around_a_ball()
    noise = np.random.default_rng(8)
    places = ("face x", "face y", "face z")

    def some() -> tuple[Field, ...]:
        return tuple(grid.field(noise.uniform(-1, 1, grid.shape(p)), p, "m/s") for p in places)

    a, b = some(), some()
    pa, pb = (project(u, shares, tolerance=1e-11) for u in (a, b))
    assert pa.converged and pa.iterations < 30 and pa.pockets == 0
    assert np.abs(flow(grid, pa.velocity, shares)).max() < 2e-11  # by an evaluation of our own
    assert np.abs(flow(grid, a, shares)).max() > 1
    assert pa.residuals[0] > 1 and pa.residuals[-1] < 1e-11 and len(pa.times) == pa.iterations + 1
    # Walls and solids are at rest.
    assert all(np.all(u.array[w.array == 0] == 0) for u, w in zip(pa.velocity, shares, strict=True))
    assert np.all(pa.velocity[0].array[0] == 0) and np.all(pa.velocity[2].array[:, :, -1] == 0)
    size = inner(a, a, shares)
    # Once is enough.
    again = project(pa.velocity, shares, tolerance=1e-13)
    change = [grid.field(u.array - v.array, u.place) for u, v in zip(pa.velocity, again.velocity, strict=True)]
    assert inner(tuple(change), tuple(change), shares) < 1e-20 * size
    # Symmetric: <a, P b> = <P a, b>; both are no small number.
    left, right = inner(a, pb.velocity, shares), inner(pa.velocity, b, shares)
    assert abs(left - right) < 1e-9 * size and abs(left) > 1e-3 * size
    # The change is orthogonal to all that has no divergence, so that nothing else is as near.
    change = [grid.field(u.array - v.array, u.place) for u, v in zip(a, pa.velocity, strict=True)]
    assert abs(inner(tuple(change), pb.velocity, shares)) < 1e-9 * size
    kept, lost = inner(pa.velocity, pa.velocity, shares), inner(tuple(change), tuple(change), shares)
    assert abs(size - kept - lost) < 1e-9 * size and 0.5 * size < kept < 0.8 * size  # 2/3: two of three directions
    # The removed part is the gradient of the potential.
    slope = gradient(pa.potential)
    open_ = shares[1].array > 0
    open_[:, 0] = open_[:, -1] = False
    assert np.allclose(change[1].array[open_], slope[1].array[open_], atol=1e-12)


def test_every_method_projects_to_the_same_velocity() -> None:
    grid, shares = around_a_ball()
    noise = np.random.default_rng(9)
    u = tuple(grid.field(noise.uniform(-1, 1, grid.shape(p)), p, "m/s") for p in ("face x", "face y", "face z"))
    best = project(u, shares, tolerance=1e-10).velocity
    for method in (
        "jacobi",
        "gauss_seidel",
        "sor",
        "conjugate_gradients",
        "incomplete_cholesky",
        "modified_incomplete_cholesky",
        "multigrid",
    ):
        for precision, tolerance in (("double", 1e-8), ("single", 1e-5)):
            found = project(u, shares, method, tolerance, 20_000, precision)  # type: ignore[arg-type]
            assert found.converged and found.residuals[-1] <= tolerance, (method, precision, found)
            off = max(np.abs(f.array - g.array).max() for f, g in zip(found.velocity, best, strict=True))
            # Smooth errors of the velocity are up to n/pi times the divergence.
            assert off < 20 * tolerance, (method, precision, off)
    box = project(u, method="cosine")
    assert box.iterations == 1 and box.residuals[-1] < 1e-12
    around = Grid((8, 6), 0.5, periodic="x")
    v = (around.field(noise.random((8, 6)), "face x", "m/s"), around.field(noise.random((8, 7)), "face y", "m/s"))
    turned = project(v, tolerance=1e-10).velocity
    assert np.abs(divergence(turned).array).max() < 1e-9
    assert np.abs(turned[0].array.mean() - v[0].array.mean()) < 1e-12  # a uniform stream has no divergence


def test_what_cannot_be_projected_is_told() -> None:
    grid, shares = around_a_ball(8)
    u = tuple(grid.field(1.0, p) for p in ("face x", "face y", "face z"))
    for wrong, text in [
        (lambda: project(u, method="magic"), "expected one of"),  # type: ignore[arg-type]
        (lambda: project(u, shares, "cosine"), "cosine transform cannot solve this"),
        (lambda: project(u, tolerance=0.0), "tolerance: 0, expected > 0"),
        (lambda: project(u, precision="half"), "precision"),  # type: ignore[arg-type]
        (lambda: project(u[:2]), "velocity"),
        (lambda: project(u, tuple(grid.field(2.0, f.place) for f in u)), "expected 0 to 1"),
        (lambda: project(tuple(grid.field(0.0, f.place) for f in u)), "something finite that moves"),
        (lambda: project(tuple(grid.field(np.nan, f.place) for f in u)), "finite"),
    ]:
        with pytest.raises(TumbleError, match=text):
            wrong()
