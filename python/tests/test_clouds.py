"""Clouds: many particles, and such that come and go, are where they should be in pictures by day and by night."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import fake_run
import numpy as np
import pytest

from tumble.film import film
from tumble.pictures import Studio, framing, splats
from tumble.pictures.drawn import Cloud, Ground, Mesh, Spheres
from tumble.pictures.framing import Camera
from tumble.pictures.look import key_light
from tumble.pictures.things import Stage
from tumble.style import linear

SIZE = (160, 90)
PLAIN = "matplotlib"
HERE = Camera(np.array([0.0, -1.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0, SIZE)
"""At distance 1 from the middle, which it shows a metre of: 160 pixels."""


def cloud(centers: Any, radii: Any, colors: Any, ways: Any = None, fading: Any = None) -> Cloud:
    x = np.asarray(centers, dtype=float).reshape(-1, 3)
    way = np.zeros((0, 2, 3)) if ways is None else np.asarray(ways, dtype=float)
    shade = np.tile(np.asarray(colors, dtype=float).reshape(-1, 3)[0], (len(way), 1))
    faded = np.ones(len(way)) if fading is None else np.asarray(fading)
    color = np.broadcast_to(np.asarray(colors, dtype=float), (len(x), 3))
    return Cloud("c", x, np.broadcast_to(np.asarray(radii, dtype=float), len(x)), color, way, shade, faded)


def paper(depth: float = np.inf) -> tuple[Any, Any]:
    return np.full((90, 160, 3), 0.8), np.full((90, 160), depth)


def emitted(columns: Callable[[float], Any], **words: Any) -> fake_run.FakeRun:
    static: fake_run.Columns = {"p": {"radius": np.array([0.05])}}
    return fake_run.FakeRun(fake_run.scene(emitter=[{"name": "p", **words}]), static, lambda t: {"p": columns(t)})


# Which objects are clouds


def test_particles_that_come_and_go_or_are_many_are_clouds() -> None:
    (thing,) = Stage(fake_run.fountain()).things(3)
    assert isinstance(thing, Cloud)
    for n, kind in ((2000, Spheres), (2001, Cloud)):
        run = fake_run.one("p", "particles", {"radius": np.array([0.01])}, np.zeros((n, 3)))
        assert [type(t) for t in Stage(run).things(0)] == [kind]


def test_each_has_its_radius_and_its_colour() -> None:
    run = fake_run.fountain()
    (thing,) = Stage(run).things(4)
    assert isinstance(thing, Cloud)
    table = run.frame(4)["spray"]
    for found, column in ((thing.centers, "position"), (thing.radii, "radius"), (thing.colors, "color")):
        np.testing.assert_array_equal(found, table[column])
    (same,) = Stage(fake_run.fountain(color=False, radius=False)).things(4)
    assert isinstance(same, Cloud)
    np.testing.assert_allclose(same.radii, 0.02)
    np.testing.assert_allclose(same.colors, np.tile(fake_run.BLUE, (len(same.centers), 1)))


def test_trails_follow_ids() -> None:
    """Particle 1 dies after the second frame, 5 is born, and rows change places."""
    rows = {0: [0, 1, 2], 1: [2, 1, 0], 2: [5, 2, 0], 3: [0, 5, 2]}

    def columns(t: float) -> Any:
        ids = np.array(rows[round(10 * t)], dtype=np.uint32)
        return {"position": np.stack([np.full(3, t), 1.0 * ids, np.zeros(3)], 1), "id": ids}

    run = emitted(columns, trail=0.2)
    run.n_frames = 4
    stage = Stage(run)
    for i, expected in ((0, []), (3, [(1, 0), (1, 2), (2, 0), (2, 2), (2, 5)]), (2, [(0, 0), (0, 1), (0, 2)])):
        (thing,) = stage.things(i)
        assert isinstance(thing, Cloud)
        np.testing.assert_array_equal(thing.ways[:, 0, 1], thing.ways[:, 1, 1])  # Every particle keeps its lane.
        np.testing.assert_allclose(thing.ways[:, 1, 0] - thing.ways[:, 0, 0], 0.1)
        found = {(round(10 * a), round(y)) for a, y in thing.ways[:, 0, :2].tolist()}
        assert set(expected) <= found and len(thing.ways) == {0: 0, 3: 5, 2: 5}[i]
    np.testing.assert_allclose(np.unique(thing.fading), [0.5, 1.0])


# Framing


def test_strays_need_not_be_in_the_picture() -> None:
    x = np.random.default_rng(3).normal(size=(3000, 3))
    run = fake_run.one("p", "particles", {"radius": np.array([0.01])}, x)
    near = framing.camera(run, SIZE)
    x[:10] *= 1000
    assert framing.camera(run, SIZE).width < 1.1 * near.width
    seen = near.project(x[10:])
    inside = (seen[:, :2] > 0).all(axis=1) & (seen[:, :2] < SIZE).all(axis=1)
    assert inside.mean() > 0.99
    edge = np.random.default_rng(3).uniform(-1, 1, size=(3000, 3))
    assert len(framing.together(edge)) == len(edge)  # Nothing strays from a box.


def test_nothing_at_the_start_is_no_reason_not_to_see_the_rest() -> None:
    run = fake_run.fountain()
    camera = framing.camera(run, SIZE)
    for i in range(1, run.n_frames):
        seen = camera.project(run.frame(i)["spray"]["position"])
        assert (seen[:, :2] > 0).all() and (seen[:, :2] < SIZE).all()
    for look in ("studio", "night"):
        run.scene["camera"]["look"] = look
        assert Studio(run, PLAIN, SIZE).picture(0).shape == (90, 160, 3)
    run.n_frames = 1
    assert Studio(run, PLAIN, SIZE).picture(0).shape == (90, 160, 3)


# The scenery


def test_depths_are_those_of_a_plane_and_a_ball() -> None:
    floor = Ground("", np.array([0.0, 0.0, -0.1]), np.array([0.0, 0.0, 1.0]), (0.8, 0.8, 0.8))
    vertices, triangles = fake_run.ball(40)
    vertices = (vertices - fake_run.BALL) / fake_run.BALL_RADIUS * 0.05
    ball = Mesh("", vertices, triangles.astype(int), vertices, (0.5, 0.5, 0.5))
    depth = splats.depths([floor, ball], HERE)
    assert np.isinf(depth[10]).all()
    assert depth[45, 80] == pytest.approx(0.95, abs=2e-3)
    # Ten pixels below the middle (and a half: rows end there) rays fall by 1/16 + 1/320: the floor is 0.1 below.
    assert depth[80, 20] == pytest.approx(0.1 / (35.5 / 160), rel=1e-3)
    hit = np.abs(depth[:58] - 0.95) < 0.06
    assert np.pi * 8**2 < hit.sum() < np.pi * 8.4**2  # without holes; rims reach 0.3 pixels farther


def test_depths_of_a_wide_triangle_have_no_holes() -> None:
    """Two triangles that go far beyond the picture, behind the camera, too."""
    view = replace(HERE, size=(640, 360))
    corners = np.array([[-9.0, -9, -0.1], [30, -9, -0.1], [30, 30, -0.1], [-9, 30, -0.1]])
    bed = Mesh("", corners, np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, 0, 1], (4, 1)), (0.5, 0.5, 0.5))
    plane = Ground("", corners[0], np.array([0.0, 0.0, 1.0]), (0.8, 0.8, 0.8))
    depth, exact = splats.depths([bed], view), splats.depths([plane], view)
    near = exact < 15
    assert 0.3 < near.mean() < 0.6
    np.testing.assert_allclose(depth[near], exact[near], rtol=1e-9)


# Day


def test_a_ball_covers_its_disc_and_hides_what_is_behind() -> None:
    light, depth = paper()
    far, near = cloud([[0, 0.2, 0]], 0.1, [0, 0, 1]), cloud([[0, 0, 0]], 0.05, [1, 0, 0])
    for clouds in ([far, near], [near, far]):
        shown = splats.discs(light, depth, clouds, HERE)
        assert shown[45, 80].argmax() == 0 and shown[45, 80 + 11].argmax() == 2
        assert np.all(shown[45, 80 + 16] == 0.8)
        red = (shown[..., 0] > shown[..., 2] + 0.1).sum()
        assert red == pytest.approx(np.pi * 8**2, rel=0.1)  # a radius of 8 pixels


@pytest.mark.parametrize("radius", [0.004, 0.02, 0.1, 0.3, 5.0])
def test_balls_of_all_sizes(radius: float) -> None:
    """One in the middle; through the picture of 1 m x 0.5625 m the largest is a wall."""
    glare = np.full((90, 160, 3), 1e6)
    shown = splats.discs(glare, paper()[1], [cloud([[0, radius, 0]], radius, [1, 0, 0])], HERE)
    size = radius / (1 + radius) * 160
    covered = 1 - shown[..., 1] / 1e6
    if size < 45:
        assert covered.sum() == pytest.approx(np.pi * size**2, rel=0.15 if size < 1 else 0.02)
    else:
        assert (covered.mean() > 0.9999) == (radius == 5.0)


def test_the_scenery_hides_particles_and_is_hidden_by_them() -> None:
    light, _ = paper()
    red = cloud([[0, 0, 0]], 0.05, [1, 0, 0])
    assert np.all(splats.discs(light, paper(0.9)[1], [red], HERE)[45, 80, 0] <= 0.8)
    assert splats.discs(light, paper(0.9)[1], [red], HERE)[45, 80, 1] > 0.3
    assert splats.discs(light, paper(0.97)[1], [red], HERE)[45, 80, 1] < 0.3  # It stands out of the wall.


def test_particles_cast_shadows_away_from_the_light() -> None:
    light, depth = np.full((90, 160, 3), 0.8), np.full((90, 160), 1.0)
    key = key_light(HERE)
    x = np.random.default_rng(1).normal(scale=0.01, size=(400, 3)) + 0.1 * key
    shown = splats.discs(light, depth, [cloud(x, 0.004, [0.5, 0.5, 0.5])], HERE)
    # The wall stands across the view through the target; the shadow falls where the light from the cloud meets it.
    beneath = HERE.project((x.mean(axis=0) - key * 0.1)[None])[0]
    assert shown[int(beneath[1]), int(beneath[0])].mean() < 0.75
    assert shown[80, 150].mean() == pytest.approx(0.8, abs=0.01)


def test_ways_are_veils() -> None:
    light, depth = paper()
    way = [[[-0.2, 0, 0.1], [0.2, 0, 0.1]]]
    shown = splats.discs(light, depth, [cloud(np.zeros((0, 3)), 0.01, np.zeros((1, 3)), way)], HERE)
    row = int(45 - 0.1 * 160)
    assert (shown[row - 1 : row + 1, 60:100].min(axis=(0, 2)) < 0.7).all()
    assert shown[row + 4, 80].min() == 0.8 and shown[row, 130].min() == 0.8


# Night


def test_lights_add_up_in_any_order() -> None:
    x = np.random.default_rng(2).normal(scale=0.1, size=(300, 3))
    color = np.random.default_rng(2).uniform(size=(300, 3))
    depth = np.full((90, 160), np.inf)
    first = splats.glow(None, depth, [], [cloud(x, 0.004, color)], HERE)
    parts = [cloud(x[k::2][::-1], 0.004, color[k::2][::-1]) for k in (1, 0)]
    np.testing.assert_allclose(splats.glow(None, depth, [], parts, HERE), first, atol=1e-12)
    assert first.max() > 0.3


@pytest.mark.parametrize("sigma", [0.6, 1.0, 2.7, 9.0])
def test_spots_are_gaussian(sigma: float) -> None:
    """Of height 1 in the middle and 2 π σ² in all, however coarse the picture in which they are drawn."""
    x, y = np.array([80.3]), np.array([45.1])
    image = splats._spots(x, y, np.array([sigma]), np.array([[1.0, 0.5, 0.0]]), (90, 160))
    assert image[..., 0].sum() == pytest.approx(2 * np.pi * sigma**2, rel=0.02)
    np.testing.assert_allclose(image[..., 1], 0.5 * image[..., 0])
    assert not image[..., 2].any()
    row, column = np.mgrid[:90, :160] + 0.5
    middle = [(image[..., 0] * c).sum() / image[..., 0].sum() for c in (column, row)]
    np.testing.assert_allclose(middle, [80.3, 45.1], atol=0.03 * sigma)
    assert image[45, 80, 0] == pytest.approx(np.exp(-0.5 * (0.2**2 + 0.4**2) / sigma**2), rel=0.05)


def test_what_glows_behind_a_wall_is_not_seen() -> None:
    light, depth = paper(0.9)
    wall = splats.glow(light, depth, [], [], HERE)
    lamp = cloud([[0, 0, 0]], 0.005, [1, 1, 1])
    np.testing.assert_array_equal(splats.glow(light, depth, [], [lamp], HERE), wall)
    assert splats.glow(light, np.full((90, 160), 1.1), [], [lamp], HERE)[45, 80].mean() > 0.2
    assert wall.max() < 0.05


def test_by_night_the_background_is_dark_and_nothing_else_is_needed() -> None:
    run = fake_run.fountain()
    run.scene["camera"]["look"] = "night"
    studio = Studio(run, PLAIN, SIZE)
    assert all(isinstance(t, Cloud) for t in studio.things(3))  # no neutral ground
    image = studio.picture(3)
    assert image[2, 2].max() < 40 and image.max() > 150
    table = run.frame(3)["spray"]
    x, y = studio.camera.project(table["position"])[0, :2].astype(int)
    spot = linear(image[y, x] / 255)
    assert spot[0] == pytest.approx(spot[2] * table["color"][0, 0] / table["color"][0, 2], abs=0.25)


# All together


@pytest.mark.parametrize("look", ["studio", "night"])
def test_a_film_of_particles_that_come_and_go(look: str, tmp_path: Any) -> None:
    run = fake_run.fountain()
    run.scene["camera"]["look"] = look
    run.scene["emitter"][0]["trail"] = 0.2
    assert film(run, tmp_path / "f.mp4", PLAIN, size=SIZE, processes=2).stat().st_size > 1000


def test_scenery_that_stays_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    import tumble.pictures

    drawn = []
    original = tumble.pictures._drawn
    monkeypatch.setattr(tumble.pictures, "_drawn", lambda *a: drawn.append(a) or original(*a))
    monkeypatch.setattr(tumble.pictures, "_KEPT", {})
    studio = Studio(fake_run.fountain(), PLAIN, SIZE)
    images = [studio.picture(i) for i in (2, 3, 2)]
    assert len(drawn) == 1
    np.testing.assert_array_equal(images[0], images[2])
    assert (images[0] != images[1]).any()
