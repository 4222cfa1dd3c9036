"""Smoke and images in pictures: light that is left, shadows, what hides what."""

from pathlib import Path

import fake_run
import numpy as np
import pytest

from tumble import ExportError, grids, looks, pictures
from tumble.film import film
from tumble.pictures import Studio, volumes
from tumble.pictures.drawn import Image, Smoke, Spheres
from tumble.pictures.framing import Camera
from tumble.pictures.things import DEEP, Stage, _within
from tumble.slices import cut, slices
from tumble.style import display, linear

X, Y, Z = np.eye(3)
FAR = np.inf


def camera(direction: np.ndarray, parallel: bool = False) -> Camera:
    up = Y if abs(direction[2]) > 0.9 else Z
    return Camera(-direction / np.linalg.norm(direction), np.zeros(3), up, 0.8, (64, 48), parallel)


def block(n: int = 20, tau: float = 1.5, color: float = 0.0) -> Smoke:
    """A cube of side 0.4 around the origin through which, straight, the optical depth is tau."""
    e = np.full((n, n, n), tau / 0.4, dtype=np.float32)
    return Smoke("", np.full(3, -0.2), 0.4 / n, e, (color, color, color))


@pytest.mark.parametrize("direction", [X, -X, Y, -Z, Z])
@pytest.mark.parametrize("parallel", [True, False])
def test_light_that_is_left_behind_a_block(direction: np.ndarray, parallel: bool) -> None:
    """Beer's law: in the middle of the picture exp(-tau), whatever the number of slices."""
    white, depth = np.ones((48, 64, 3)), np.full((48, 64), FAR)
    for n in (5, 20):
        got = volumes.smoke(white, depth, [block(n)], camera(direction, parallel), night=True)[24, 32]
        assert got == pytest.approx(np.exp(-1.5), abs=2e-3)  # 0.2231 by all ways.


def test_slanted_rays_have_a_longer_way() -> None:
    """Through a slab that is wide, along a ray with slopes (a, b): exp(-tau sqrt(1 + a² + b²))."""
    e = np.full((60, 10, 60), 6.0, dtype=np.float32)
    slab = Smoke("", np.array([-0.6, -0.1, -0.6]), 0.02, e, (0.0, 0.0, 0.0))
    view = camera(Y)
    got = volumes.smoke(np.ones((48, 64, 3)), np.full((48, 64), FAR), [slab], view, night=True)[..., 0]
    rays, _ = volumes.sights(view)
    expected = np.exp(-1.2 * np.linalg.norm(rays, axis=-1))
    np.testing.assert_allclose(got, expected, atol=2e-4)  # 3e-7
    assert np.ptp(expected) > 0.02


def test_what_is_in_front_is_not_dimmed_and_what_is_inside_in_part() -> None:
    """The slice at depth z counts as far as it is in front: exp(-tau share), within a tenth of a slice's own."""
    view = camera(Y)
    for share in (0.0, 0.25, 0.525, 1.0):
        depth = np.full((48, 64), 0.8 + 0.4 * share)
        got = volumes.smoke(np.ones((48, 64, 3)), depth, [block(20)], view, night=True)[24, 32, 0]
        assert got == pytest.approx(np.exp(-1.5 * share), abs=2e-3)


def test_what_is_seen_beside_an_edge_is_behind_the_smoke() -> None:
    """A black wall before black smoke covers half of a white picture, and 3/4 of a column of pixels: the rest is as dim."""
    view, cloud = camera(np.array([0.0, 1.0, 0.0])), block()
    height, width = view.size[1], view.size[0]
    column = width // 2
    light, depth = np.ones((height, width, 3)), np.full((height, width), np.inf)
    light[:, :column], light[:, column] = 0.0, 0.25
    depth[:, : column + 1] = 0.1
    shown = volumes.smoke(light, depth, [cloud], view, night=True)[height // 2, :, 0]
    beyond = shown[column + 1]
    assert shown[column - 1] == 0.0 and 0.1 < beyond < 0.5
    assert shown[column] == pytest.approx(0.25 * (0.75 + 0.25 * beyond), rel=0.02)  # without the mean 0.25, a bead


@pytest.mark.parametrize("direction", [X, -Y, Z, X + 0.4 * Y - 0.3 * Z, -0.9 * X + 0.85 * Z - 0.03 * Y])
def test_key_light_in_a_block(direction: np.ndarray) -> None:
    """exp(-s d), d the way from the middle of a cell to the side of the block towards the light."""
    light = direction / np.linalg.norm(direction)

    def off(n: int) -> float:
        cube = block(n, tau=2.0)
        middle = -0.2 + cube.spacing * (np.arange(n) + 0.5)
        x = np.stack(np.meshgrid(middle, middle, middle, indexing="ij"), axis=-1)
        with np.errstate(divide="ignore"):
            way = np.where(light > 0, (0.2 - x) / light, np.where(light < 0, (-0.2 - x) / light, np.inf)).min(axis=-1)
        expected = np.exp(-5.0 * way)
        assert np.ptp(expected) > 0.5
        return float(np.abs(volumes.lit(cube.extinction, cube.spacing, light) - expected).mean())

    if np.count_nonzero(direction) == 1:
        assert off(24) < 1e-6  # 1e-8
    else:
        # Light is blended from slice to slice, which makes edges of shadows softer by some cells: of first order or less.
        coarse, fine = off(24), off(48)
        assert fine < 0.02 and fine < 0.8 * coarse  # 0.0078, 0.58; 0.0019, 0.76


def test_emission_adds_up_and_is_dimmed_by_what_is_in_front() -> None:
    """j (1 - exp(-tau)) / s behind smoke, j times the way without."""
    view, dark, depth = camera(Y), np.zeros((48, 64, 3)), np.full((48, 64), FAR)
    cube = block(20)
    glow = np.broadcast_to(np.array([3.0, 2.0, 1.0], dtype=np.float32), (20, 20, 20, 3))
    got = volumes.smoke(dark, depth, [Smoke("", cube.low, cube.spacing, cube.extinction, cube.color, glow)], view)
    expected = np.array([3.0, 2.0, 1.0]) * (1 - np.exp(-1.5)) / (1.5 / 0.4)
    np.testing.assert_allclose(got[24, 32], expected, rtol=2e-3)
    got = volumes.smoke(dark, depth, [Smoke("", cube.low, cube.spacing, 0 * cube.extinction, cube.color, glow)], view)
    np.testing.assert_allclose(got[24, 32], np.array([3.0, 2.0, 1.0]) * 0.4, rtol=2e-3)


def test_the_side_towards_the_light_is_brighter() -> None:
    cube = block(24, tau=12.0, color=0.8)
    view = camera(Y)
    shown = volumes.smoke(np.zeros((48, 64, 3)), np.full((48, 64), FAR), [cube], view)[..., 0]
    left, right = shown[24, 20:24].mean(), shown[24, 40:44].mean()  # The key light comes from the left and above.
    assert left > 1.25 * right > 0.1  # 0.200 and 0.143


def test_smoke_shades_the_ground() -> None:
    run = fake_run.plume(16)
    studio = Studio(run, "matplotlib")
    with_smoke = studio.picture(4).astype(int)
    things = [t for t in studio.things(4) if not isinstance(t, Smoke)]
    from tumble.pictures import render

    without = render("matplotlib", things, studio.camera.unit()).astype(int)
    darker = (without - with_smoke).sum(axis=-1)
    smoke = next(t for t in studio.things(4) if isinstance(t, Smoke))
    outside = ~volumes._seen(smoke.low, smoke.spacing * np.array(smoke.extinction.shape), studio.camera.unit())
    assert darker.max() > 60  # The smoke itself,
    assert darker[outside].max() > 15  # and its shadow beside it.
    assert np.abs(darker[:10]).max() < 3  # The sky stays.


def test_an_image_lies_where_its_plane_is() -> None:
    """Each half of an image in its own colour, cut where the plane is hidden."""
    light = np.zeros((2, 4, 3))
    light[0] = [0.8, 0.1, 0.1]
    light[1] = [0.1, 0.1, 0.8]
    plate = Image("", np.array([-0.2, 0.0, -0.1]), 0.4 * X, 0.2 * Z, light, np.ones((2, 4)))
    view = camera(Y, parallel=True)
    depth = np.full((48, 64), FAR)
    depth[:, 44:] = 0.5  # Something nearer.
    shown = volumes.images(np.ones((48, 64, 3)), depth, [plate], view)
    # 80 pixels a metre: columns 16 to 48, rows 16 to 32.
    np.testing.assert_allclose(shown[24, 20], [0.8, 0.1, 0.1])
    np.testing.assert_allclose(shown[24, 42], [0.1, 0.1, 0.8])
    hidden = np.ones((48, 64), dtype=bool)
    hidden[16:32, 16:44] = False
    np.testing.assert_array_equal((shown == 1).all(axis=-1), hidden)


@pytest.mark.parametrize("plane", ["xy", "xz"])
def test_ink_in_a_plane(plane: str) -> None:
    run = fake_run.ink(plane, 16)
    studio = Studio(run, "matplotlib")
    shown = linear(studio.picture(3) / 255)
    grid = grids.box(run.static["dye"])
    assert grid is not None
    a, b = grid.axes
    density = run.frame(3)["dye"]["density"]
    for i, j in ((14, 4), (15, 12), (2, 2), (28, 8)):
        point = grid.origin + 0.5 * grid.spacing
        point[a], point[b] = grid.points(a)[i], grid.points(b)[j]
        x, y, _ = studio.camera.project(point)
        seen = shown[int(y), int(x)]
        blue = seen[2] - seen[0]
        assert (blue > 0.12) == (density[i, j] > 0.4), (i, j, seen, density[i, j])
    assert any(isinstance(t, Image) for t in studio.things(3))


def test_films_of_smoke(tmp_path: Path) -> None:
    path = film(fake_run.plume(8), tmp_path / "film.mp4", "matplotlib", every=2, processes=2)
    assert path.stat().st_size > 1000


def test_only_grids_can_be_drawn_with_bodies() -> None:
    """A run in which some have positions and others a grid."""
    run = fake_run.plume(8)
    run.static["p"] = {"mass": np.ones(1), "radius": np.array([0.1])}
    before = run.columns
    run.columns = lambda t: before(t) | {"p": {"position": np.array([[0.0, -0.3, 0.4]])}}
    things = Studio(run, "matplotlib").things(2)
    assert {Smoke, Spheres} <= {type(t) for t in things}


def test_smoke_is_seen_through_as_much_from_the_front_as_from_above() -> None:
    """A layer that is wide and thin: along the view, whatever it is, an optical depth of DEEP where it is thickest."""
    run = fake_run.plume(16)
    layer = np.zeros((16, 16, 32), dtype=np.float32)
    layer[:, :, 10:20] = 3.0
    run.columns = lambda t: {"smoke": {"density": layer}}
    for view, rows in ((Y, 16), (-Z, 10)):
        thing = next(t for t in Stage(run, view).things(0) if isinstance(t, Smoke))
        assert thing.extinction.max() * rows * thing.spacing == pytest.approx(DEEP, rel=1e-5)
    # Little of it stays as thin as anything of that density in a box of that size.
    layer[:, :, 11:] = 0.0
    thing = next(t for t in Stage(run, -Z).things(0) if isinstance(t, Smoke))
    assert thing.extinction.max() == pytest.approx(40.0 / (4 / 3), rel=1e-5)


def test_dye_in_a_liquid_has_a_colour() -> None:
    for density, grey in ((1.2, True), (1000.0, False)):
        gas = {"name": "g", "box": {"size": [1, 1, 1], "resolution": 8}, "smoke": {}, "fluid_density": density}
        (look,) = looks.of({"version": 1, "gas": [gas]}).objects
        assert (
            look.form == "smoke" and (len(set(look.color)) == 3 and max(look.color) < 0.6 < 2 * min(look.color)) == grey
        )


@pytest.mark.parametrize("night", [False, True])
def test_what_glows_is_painted_where_smoke_is_traced(night: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    got: list[list[object]] = []

    def drawn(renderer: str, things: list[object], view: Camera, samples: int) -> np.ndarray:
        got.append(things)
        return np.zeros((48, 64, 3), dtype=np.uint8)

    monkeypatch.setattr(pictures, "_drawn", drawn)
    monkeypatch.setattr(pictures, "_KEPT", {})
    cold = block(8)
    glow = np.ones((8, 8, 8, 3), dtype=np.float32)
    hot = Smoke("", cold.low - 0.45 * X, cold.spacing, cold.extinction, cold.color, glow=glow)
    seen = pictures.render(pictures.TRACED, [cold, hot], camera(Y), 1, night)
    assert seen[24, 4].min() > 100
    # By night there is nothing to trace by.
    assert got == ([] if night else [[cold]])


def test_holes_of_a_heated_body_show_what_is_behind() -> None:
    """Two holes, and a part in one of them that is none."""
    box = {"center": [-0.5, 0, 0.7], "size": [0.4, 1, 0.6], "rotate": [0, 0, 0]}
    part = {"center": [-0.5, 0, 0.7], "radius": 0.1}
    run = fake_run.ink("xz", 20)
    run.scene["heat"] = [
        {
            "name": "dye",
            "region": [
                {"shape": {"box": box}, "hole": {"temperature": 300.0}},
                {"shape": {"sphere": part}, "hole": None},
                {"shape": {"capsule": {"from": [0.5, 0, 0.5], "to": [0.5, 0, 0.9], "radius": 0.15}}, "hole": {}},
            ],
        }
    ]
    warm = run.columns
    run.columns = lambda t: {"dye": {"temperature": warm(t)["dye"]["temperature"]}}
    plate = next(t for t in Stage(run).things(2) if isinstance(t, Image))
    x = -1 + (np.arange(40)[:, None] + 0.5) / 20
    z = 0.2 + (np.arange(20)[None, :] + 0.5) / 20
    hole = (np.abs(x + 0.5) < 0.2) & (np.abs(z - 0.7) < 0.3) & (np.hypot(x + 0.5, z - 0.7) > 0.1)
    hole |= np.hypot(x - 0.5, np.maximum(np.abs(z - 0.7) - 0.2, 0)) < 0.15
    np.testing.assert_array_equal(plate.cover, np.where(hole, 0.0, 1.0))


def test_points_in_a_box_that_is_turned() -> None:
    """A rod along x, turned about x, y and z in turn: along the third column of turns that is computed by hand."""
    rod = {"center": [0.1, 0.2, 0.3], "size": [2.0, 0.02, 0.02], "rotate": [70.0, 30.0, 40.0]}
    b, c = np.radians([30.0, 40.0])
    along = np.array([np.cos(c) * np.cos(b), np.sin(c) * np.cos(b), -np.sin(b)])
    points = np.array([0.1, 0.2, 0.3]) + along * np.array([-1.01, -0.99, 0.0, 0.99, 1.01])[:, None]
    np.testing.assert_array_equal(_within({"box": rod}, points), [False, True, True, True, False])
    np.testing.assert_array_equal(_within({"floor": {"height": 0.0}}, np.outer([-1, 1], Z)), [True, False])


def test_fire_in_a_plane_glows() -> None:
    run = fake_run.ink("xz", 16)
    cold = run.columns

    def columns(t: float) -> dict[str, dict[str, np.ndarray]]:
        own = cold(t)["dye"]
        return {"dye": {"density": own["density"], "temperature": (293 + 1500 * own["density"]).astype(np.float32)}}

    run.columns = columns
    plate = next(t for t in Stage(run).things(3) if isinstance(t, Image))
    density = run.frame(3)["dye"]["density"]
    hot, none = plate.light[density > 0.97], plate.light[density < 1e-3]
    assert (hot[:, 0] > 0.9).all() and (hot[:, 0] > 1.2 * hot[:, 2]).all()  # 1.02 and 0.69 to 0.79: yellow,
    assert none.max() < 0.05  # and black.


def test_waves_in_a_fluid_are_seen_though_they_start_as_a_bang() -> None:
    """The range of 98 % of the cells of a frame is covered by the colours, both ways from rest."""
    run = fake_run.ink("xz", 20)
    x = np.arange(40)[:, None] + 0 * np.arange(20)
    bang = 1.2 + np.where(x == 20, 0.1, 0.0) * (np.arange(20) == 10)
    wave = 1.2 + 0.015 * np.sin(x)
    run.columns = lambda t: {"dye": {"density": bang if t == 0 else wave}}
    grid, stage = grids.box(run.static["dye"]), Stage(run)
    assert grid is not None
    found = stage._range(stage.objects[0], grid)
    assert found is not None
    name, low, high = found
    assert name == "density" and low + high == pytest.approx(2.4, abs=1e-3)
    assert 0.0145 < 0.5 * (high - low) < 0.0151  # A tenth of the bang would be 0.01.


# Slices


def test_cuts_blend_between_cells() -> None:
    run = fake_run.plume(6)
    grid = grids.box(run.static["smoke"])
    assert grid is not None
    x = grid.points(0)[:, None, None] + 0 * grid.points(1)[:, None] + 3 * grid.points(2)
    for place in (0.0, 2.5, 5.0):
        np.testing.assert_allclose(
            cut(grid, x, "pressure", 0, place)[2], grid.points(0)[0] + place / 6 + 3 * grid.points(2)
        )
    vectors = np.stack([x, 0 * x, 2 * x], axis=-1)
    np.testing.assert_allclose(cut(grid, vectors, "vorticity", 2, 1.0), 2 * x[..., 1])
    np.testing.assert_allclose(cut(grid, vectors, "velocity", 2, 1.0), np.sqrt(5) * np.abs(x[..., 1]))


def test_vorticity_follows_from_the_velocity() -> None:
    """A rigid turn (a, b, c) has the vorticity 2 (a, b, c); differences are exact for it."""
    grid = grids.box(fake_run.on_grid((5, 6, 7), 3, 0.5, (0.0, 1.0, 2.0)))
    assert grid is not None
    x = np.stack(np.meshgrid(*(grid.points(a) for a in range(3)), indexing="ij"), axis=-1)
    turn = np.array([0.3, -1.0, 2.0])
    got = grids.shown(grid, {"velocity": np.cross(turn, x)}, "vorticity")
    np.testing.assert_allclose(got, np.broadcast_to(2 * turn, got.shape), atol=1e-12)
    for flat in (0, 1, 2):
        cells = (5, 6)
        plane = grids.box(fake_run.on_grid(cells, flat, 0.5, (0.0, 1.0, 2.0)))
        assert plane is not None
        a, b = plane.axes
        y = np.zeros((*cells, 3))
        y[..., a], y[..., b] = np.meshgrid(plane.points(a), plane.points(b), indexing="ij")
        velocity = np.cross(np.eye(3)[flat], y)[..., [a, b]]
        got = grids.shown(plane, {"velocity": velocity}, "vorticity")
        np.testing.assert_allclose(np.squeeze(got, flat), np.full(cells, 2.0), atol=1e-12)
        np.testing.assert_allclose(
            np.squeeze(grids.shown(plane, {"velocity": velocity}, "speed"), flat), np.hypot(y[..., a], y[..., b])
        )


def test_slices_are_drawn(tmp_path: Path) -> None:
    for run in (fake_run.plume(8), fake_run.ink("xy", 8), fake_run.ink("xz", 8)):
        path = slices(run, tmp_path / "slice.png")
        assert path.stat().st_size > 5000
    path = slices(fake_run.plume(8), tmp_path / "one.png", ["vorticity"], frame=2, axis="z", at=1.9)
    assert path.is_file()


def test_slices_say_what_is_wrong(tmp_path: Path) -> None:
    run, path = fake_run.plume(8), tmp_path / "slice.png"
    for words, text in (
        ({"columns": ["smoke"]}, "no column on the grid 'smoke'; there are density, temperature"),
        ({"at": 7.0, "axis": "z"}, "at: 7 m, expected 0 to 2 m, the sides of the box along z"),
        ({"axis": "w"}, "no axis 'w'; there are x, y, z"),
        ({"frame": 9}, "there is no frame 9; there are frames 0 to 4"),
        ({"thing": "fire"}, "'fire'; there are smoke"),
    ):
        with pytest.raises(ExportError, match=text):
            slices(run, path, **words)  # type: ignore[arg-type]
    with pytest.raises(ExportError, match="nothing on a grid"):
        slices(fake_run.studio(), path)
    assert not path.exists()


def test_colours_are_seen_as_they_are() -> None:
    np.testing.assert_allclose(linear(display(np.array([0.2, 0.5]))), [0.2, 0.5])
