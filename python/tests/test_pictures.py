"""Pictures, films and plots: what is drawn is where it should be, in its colour, on every machine."""

import importlib.util
import os
import platform
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest
import typer
from needs import missing

import tumble.film
import tumble.pictures
from tumble import ExportError
from tumble.cli.render import look_for
from tumble.cli.run import write_results
from tumble.film import film
from tumble.pictures import Studio, framing, mitsuba_, picture, render, renderers, resolve, surfaces
from tumble.pictures.drawn import Ground, Mesh, Spheres, Tubes
from tumble.pictures.things import Recording, Stage
from tumble.plots import energy, ledger, unit
from tumble.run import simulate
from tumble.slices import slices
from tumble.style import display, linear, rgb

SIZE = (160, 90)
PLAIN = "matplotlib"
OPEN = (0.1, -0.45, 0.0)
"""A point of the floor of `fake_run.studio` with nothing near it."""


@pytest.fixture(params=tumble.pictures.RENDERERS)
def renderer(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    if name not in renderers():
        missing(f"{name} does not work here")
    return name


def hue(color: Any) -> Any:
    """A colour without its brightness."""
    color = np.asarray(color, dtype=float)
    return color / np.linalg.norm(color)


def around(image: Any, studio: Studio, point: Any) -> Any:
    """The mean colour, in linear light, of 3 x 3 pixels around the image of a point."""
    x, y = (int(v) for v in studio.camera.project(np.asarray(point, dtype=float))[:2])
    assert 1 <= x < image.shape[1] - 1 and 1 <= y < image.shape[0] - 1
    return linear(image[y - 1 : y + 2, x - 1 : x + 2] / 255).mean(axis=(0, 1))


# Pictures


def test_objects_are_where_the_camera_says_in_their_colours(renderer: str) -> None:
    run = fake_run.studio()
    studio = Studio(run, renderer, SIZE, samples=4)
    image = studio.picture(2)
    assert image.shape == (90, 160, 3) and image.dtype == np.uint8
    sheet = run.frame(2)["a sheet"]["position"]
    toward = studio.camera.position - fake_run.BALL
    front = fake_run.BALL + fake_run.BALL_RADIUS * toward / np.linalg.norm(toward)
    for point, color in (
        (sheet[fake_run.N * (fake_run.N // 2) + fake_run.N // 2], fake_run.BLUE),
        (run.frame(2)["masses"]["position"][1], fake_run.RED),
        (front, fake_run.GREEN),
    ):
        assert hue(around(image, studio, point)) @ hue(color) > 0.93
    corner = image[2, 2] / 255
    assert corner.min() > 0.8 and np.ptp(corner) < 0.06  # the background
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 500


def test_a_floor_is_shown_in_its_colour(renderer: str) -> None:
    run = fake_run.studio()
    run.scene["collider"][1]["color"] = [0.5, 0.25, 0.1]
    studio = Studio(run, renderer, SIZE, samples=4)
    floor = around(studio.picture(0), studio, OPEN)
    assert hue(floor) @ hue([0.5, 0.25, 0.1]) > 0.97


def test_shadows_fall_on_the_ground(renderer: str) -> None:
    run = fake_run.studio()
    studio = Studio(run, renderer, SIZE, samples=8)
    image = studio.picture(0)
    from tumble.pictures.look import key_light

    light = key_light(studio.camera)
    beneath = fake_run.BALL - light * fake_run.BALL[2] / light[2]
    assert around(image, studio, beneath).mean() < 0.75 * around(image, studio, OPEN).mean()


def test_what_is_near_hides_what_is_far(renderer: str) -> None:
    x = {"far": np.array([[0.0, 1.0, 0.0]]), "near": np.array([[0.0, -1.0, 0.0]])}
    colors = {"far": fake_run.BLUE, "near": fake_run.RED}
    for names in (["near", "far"], ["far", "near"]):
        run = fake_run.FakeRun(
            fake_run.scene(
                particles=[{"name": n, "color": colors[n]} for n in names],
                camera={"position": [0.0, -6.0, 0.0], "target": [0.0, 0.0, 0.0], "resolution": SIZE},
            ),
            {n: {"radius": np.array([0.5])} for n in names},
            lambda t: {n: {"position": x[n]} for n in x},
        )
        studio = Studio(run, renderer, samples=4)
        assert hue(around(studio.picture(0), studio, [0.0, -1.5, 0.0])) @ hue(fake_run.RED) > 0.9


def test_a_plane_scene_is_seen_head_on(renderer: str) -> None:
    run = fake_run.studio(dimension=2)
    studio = Studio(run, renderer, SIZE, samples=4)
    camera = studio.camera
    assert camera.parallel
    np.testing.assert_allclose(np.stack(camera.axes), [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-12)
    image = studio.picture(0)
    assert hue(around(image, studio, run.frame(0)["masses"]["position"][0])) @ hue(fake_run.RED) > 0.93
    assert hue(around(image, studio, fake_run.BALL)) @ hue(fake_run.GREEN) > 0.93
    below = camera.project(np.array([-0.9, 0.0, 0.0]))[1] + 3
    assert image[int(below), 20].mean() < image[int(below) - 12, 20].mean()  # the floor, seen from the side


def test_the_size_is_that_of_the_scene_unless_given() -> None:
    run = fake_run.studio(camera={"resolution": [64, 48], "view_angle": 35.0})
    assert picture(run, 0, PLAIN).shape == (48, 64, 3)
    assert picture(run, 0, PLAIN, size=(40, 60)).shape == (60, 40, 3)


def test_pictures_are_the_same_bytes_again(renderer: str) -> None:
    run = fake_run.studio()
    first, second = (picture(run, 1, renderer, (64, 36)) for _ in range(2))
    assert np.mean(first != second) < 1e-3  # rounding may differ where threads meet


@pytest.mark.skipif((sys.platform, platform.machine()) == ("darwin", "x86_64"), reason="no wheels of mitsuba-oidn")
def test_mitsuba_works() -> None:
    """It needs no library of the system: where it does not, the tests below that skip would pass for nothing."""
    assert "mitsuba" in renderers()


def test_edges_have_no_more_noise_than_surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    if "mitsuba" not in renderers():
        missing("mitsuba does not work here")
    studio = Studio(fake_run.studio(), "mitsuba", (96, 54))
    how = studio.things(2), studio.camera.unit()
    few, more = (render("mitsuba", *how, n).astype(float) for n in (4, 16))
    monkeypatch.setattr(mitsuba_, "denoise", lambda light, colors: light)
    noisy, clean = (render("mitsuba", *how, n).astype(float) for n in (4, 256))
    steps = [np.abs(np.diff(clean, axis=k, append=np.take(clean, [-1], axis=k))).max(axis=2) for k in (0, 1)]
    edge = np.max([*steps, *(np.roll(s, 1, axis=k) for k, s in enumerate(steps))], axis=0) > 60
    assert 150 < edge.sum() < 0.2 * edge.size

    def error(image: Any, where: Any) -> float:
        return float(np.sqrt(np.mean((image - clean)[where] ** 2)))

    assert error(noisy, edge) > 20 and error(noisy, ~edge) > 10  # measured 25.1 and 13.3, of 255
    assert error(few, edge) < 14.5 and error(few, ~edge) < 5  # measured 12.8 and 3.9
    assert error(more, edge) < 9  # measured 7.6


def test_noise_goes_up_to_the_sides_of_the_picture() -> None:
    pytest.importorskip("mitsuba_oidn")
    colors = np.full((90, 160, 3), 0.3) * np.linspace(0.6, 1.0, 160)[:, None]
    light = colors * np.random.default_rng(5).gamma(4.0, 0.25, (90, 160, 1))
    error = np.sqrt(np.mean((mitsuba_.denoise(light, colors) - colors) ** 2, axis=2))
    inner = error[4:-4, 4:-4].mean()
    assert 0 < inner < 0.05 * np.abs(light - colors).mean()  # measured 0.03
    # Measured 1.2; without a mirror beyond the sides 5: pictures whose height 16 does not divide end in dots.
    assert error[-1].mean() < 2 * inner


def test_what_cannot_be_drawn_is_told() -> None:
    run = fake_run.studio()
    with pytest.raises(ExportError, match="frames 0 to 4"):
        picture(run, 5, PLAIN, SIZE)
    with pytest.raises(ExportError, match="no renderer"):
        picture(run, 0, "crayons", SIZE)
    run.n_frames = 0
    with pytest.raises(ExportError, match="no frames"):
        picture(run, 0, PLAIN, SIZE)


# Renderers


@pytest.fixture
def forgetful() -> Iterator[None]:
    """Cached results about renderers do not outlive the test."""
    tumble.pictures._works.cache_clear()
    yield
    tumble.pictures._works.cache_clear()


def test_matplotlib_draws_where_nothing_else_is_installed(monkeypatch: pytest.MonkeyPatch, forgetful: None) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert renderers() == [PLAIN]
    assert resolve("auto") == PLAIN
    assert picture(fake_run.studio(), 0, size=(48, 32)).shape == (32, 48, 3)
    with pytest.raises(ExportError, match="pip install"):
        resolve("mitsuba")


def test_a_library_that_takes_the_process_down_is_not_used(monkeypatch: pytest.MonkeyPatch, forgetful: None) -> None:
    monkeypatch.setattr(tumble.pictures, "PROBES", dict.fromkeys(("mitsuba", "pyvista"), "import os; os.abort()"))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    assert resolve() == PLAIN
    with pytest.raises(ExportError, match="libegl1"):
        resolve("pyvista")


# Framing


def test_everything_is_in_the_picture_at_every_frame() -> None:
    run = fake_run.studio()
    camera = framing.camera(run, SIZE)
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for i in range(run.n_frames):
        points = np.concatenate([*(c["position"] for c in run.frame(i).values()), run.static["ball"]["position"]])
        seen = camera.project(points)
        assert (seen[:, 2] > 0).all()
        low, high = np.minimum(low, seen[:, :2].min(axis=0)), np.maximum(high, seen[:, :2].max(axis=0))
    assert (low > 0).all() and (high < SIZE).all()
    # It fills the picture one way, and is in the middle of it both ways.
    assert ((high - low) / SIZE).max() > 0.8
    np.testing.assert_allclose((low + high) / 2, np.array(SIZE) / 2, atol=0.04 * SIZE[0])


def test_the_camera_of_the_scene_is_used() -> None:
    words = {"position": [3.0, -4.0, 2.0], "target": [0.5, 0.0, 0.5], "view_angle": 50.0, "resolution": [100, 50]}
    camera = framing.camera(fake_run.studio(camera=words))
    np.testing.assert_array_equal(camera.position, words["position"])
    assert camera.view_angle == pytest.approx(50.0)
    np.testing.assert_allclose(camera.project(np.array([0.5, 0.0, 0.5])), [50, 25, camera.distance])
    # A point to the right at the target's distance, at the edge of the angle of view.
    edge = camera.target + camera.axes[0] * camera.distance * np.tan(np.radians(25))
    np.testing.assert_allclose(camera.project(edge)[:2], [100, 25])


def test_a_camera_that_is_told_only_where_to_look_still_sees_all() -> None:
    words = {"position": None, "target": [1.5, 0.0, 0.0], "view_angle": 35.0, "resolution": [100, 50]}
    run = fake_run.studio(camera=words)
    camera = framing.camera(run)
    np.testing.assert_array_equal(camera.target, words["target"])
    seen = camera.project(run.frame(0)["rope"]["position"])
    assert (seen[:, :2] > 0).all() and (seen[:, 0] < 100).all()


def test_a_huge_collider_does_not_make_the_rest_tiny() -> None:
    run = fake_run.studio()
    near = framing.camera(run, SIZE).distance
    run.static["ball"]["position"] = 1000 * run.static["ball"]["position"]
    assert framing.camera(run, SIZE).distance < 8 * near


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e20])
def test_any_scale_can_be_drawn(size: float) -> None:
    x = size * np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    run = fake_run.one("p", "particles", {"radius": np.array([1e-30])}, x, world={"gravity": [0.0, 0.0, 0.0]})
    run.scene["particles"][0]["color"] = fake_run.RED
    studio = Studio(run, PLAIN, (640, 360))
    assert hue(around(studio.picture(0), studio, x[1])) @ hue(fake_run.RED) > 0.9


def test_a_single_mass_that_does_not_move() -> None:
    studio = Studio(fake_run.one("p", "particles", {"radius": np.array([0.0])}, np.zeros((1, 3))), PLAIN, SIZE)
    assert studio.picture(0).std() > 1


# Things


def test_things_of_a_frame() -> None:
    run = fake_run.studio()
    things = {t.name: t for t in Stage(run).things(1)}
    kinds = {"a sheet": Mesh, "rope": Tubes, "masses": Spheres, "masses springs": Tubes, "ball": Mesh, "floor": Ground}
    assert {name: type(t) for name, t in things.items()} == kinds
    rope = things["rope"]
    assert isinstance(rope, Tubes)
    np.testing.assert_allclose(rope.points[0], [-0.8, 0, 1.2], atol=1e-6)  # in the order of the curve
    ball = things["ball"]
    assert isinstance(ball, Mesh) and ball.closed
    np.testing.assert_allclose(ball.normals, (ball.vertices - fake_run.BALL) / fake_run.BALL_RADIUS, atol=0.06)


def test_objects_without_a_colour_get_different_ones() -> None:
    names = [f"p{k}" for k in range(6)]
    run = fake_run.FakeRun(
        fake_run.scene(particles=[{"name": n} for n in names]),
        {n: {"radius": np.array([0.1])} for n in names},
        lambda t: {n: {"position": np.zeros((1, 3))} for n in names},
    )
    assert len({t.color for t in Stage(run).things(0)}) == 6


def grounds(run: Recording) -> list[str]:
    return [t.name for t in Studio(run, PLAIN, SIZE).things(0) if isinstance(t, Ground)]


def test_a_neutral_ground_only_where_there_is_none() -> None:
    assert grounds(fake_run.studio()) == ["floor"]
    x = np.array([[0.0, 0, 0], [1, 0, 0]])
    mass = {"mass": np.ones(2)}
    assert grounds(fake_run.one("p", "particles", mass, x)) == [""]
    assert grounds(fake_run.one("p", "particles", mass, x, world={"gravity": [0.0, 0.0, 0.0]})) == []
    assert grounds(fake_run.one("p", "particles", mass, x, dimension=2)) == []
    assert grounds(fake_run.one("p", "particles", {}, x)) == []  # Tracers do not fall.


@pytest.mark.parametrize(
    ("systems", "falls"),
    [
        ([], True),
        ([{"name": "main"}], True),
        ([{"name": "soft", "method": "position_based"}], True),
        ([{"name": "flow", "method": "tracers", "integrator": "rk4"}], False),
    ],
)
def test_what_is_emitted_has_a_ground_where_it_falls(
    systems: list[dict[str, Any]], falls: bool, tmp_path: Path
) -> None:
    spray = {"name": "p", "from": {"point": {}}, "rate": 100, "velocity": [0, 0, 0] if not falls else [0, 0, 1]}
    tree = {"version": 1, "time": {"fps": 10, "frames": 2}, "system": systems, "emitter": [spray]}
    run = simulate(tree, tmp_path / "run")
    assert grounds(run) == [""] * falls


def test_a_ground_that_the_camera_is_inside_of_is_not_drawn() -> None:
    run = fake_run.studio()
    run.scene["collider"][1]["shape"] = {"plane": {"point": [0, 0, -1], "normal": [0, 0, -2.0]}}
    assert grounds(run) == []


def test_particles_with_a_trail_show_where_they_have_been() -> None:
    run = fake_run.FakeRun(
        fake_run.scene(particles=[{"name": "p", "trail": 0.2}]),
        {"p": {"radius": np.array([0.1])}},
        lambda t: {"p": {"position": np.array([[t, 0.0, 0.0], [0.0, t, 0.0]])}},
    )
    stage = Stage(run)
    assert [type(t) for t in stage.things(0)] == [Spheres]
    for i, known in ((1, 2), (4, 3), (2, 3)):  # Frames are 0.1 s apart; any order will do.
        way = next(t for t in stage.things(i) if isinstance(t, Tubes))
        assert way.counts.tolist() == [known, known]
        np.testing.assert_allclose(way.points[:known, 0], [0.1 * k for k in range(i - known + 1, i + 1)])


def test_a_trail_does_not_cross_the_square_where_a_particle_leaves_it() -> None:
    run = fake_run.FakeRun(
        fake_run.scene(
            particles=[{"name": "p", "system": "main", "trail": 0.4}],
            system=[
                {"name": "main", "method": "vicsek", "vicsek": {"side": 2.0, "radius": 1.0, "speed": 1, "noise": 0}}
            ],
        ),
        {"p": {"radius": np.array([0.1])}},
        # The first leaves at 1 before frame 3; the second stays.
        lambda t: {"p": {"position": np.array([[(t + 1.75) % 2 - 1, 0.0, 0.0], [0.0, t, 0.0]])}},
    )
    way = next(t for t in Stage(run).things(4) if isinstance(t, Tubes))
    assert way.counts.tolist() == [3, 2, 5]
    np.testing.assert_allclose(way.points[:5, 0], [0.75, 0.85, 0.95, -0.95, -0.85])


def test_anchors_are_drawn_between_their_masses() -> None:
    anchor = {"name": "a", "between": ["p 1", "q 0"]}
    run = fake_run.FakeRun(
        fake_run.scene(particles=[{"name": "p"}, {"name": "q"}], anchor=[anchor]),
        {n: {"radius": np.array([0.1])} for n in "pq"},
        lambda t: {"p": {"position": np.eye(3)[:2]}, "q": {"position": np.full((1, 3), t)}},
    )
    (tube,) = (t for t in Stage(run).things(3) if isinstance(t, Tubes))
    np.testing.assert_allclose(tube.points, [[0, 1, 0], [0.3, 0.3, 0.3]])


def torn(kind: str, static: dict[str, Any], x: Any, link: int) -> fake_run.FakeRun:
    """A run in which a link breaks after the start; another one never has a rest length."""

    def columns(t: float) -> fake_run.Columns:
        strain = np.zeros(len(static["links"]))
        strain[-1] = np.nan
        if t > 0:
            strain[link] = np.nan
        return {"thing": {"position": x, "link_strain": strain}}

    return fake_run.FakeRun(fake_run.scene(**{kind: [{"name": "thing"}]}), {"thing": static}, columns)


def test_a_torn_sheet_has_a_hole() -> None:
    x, triangles, links = fake_run.lattice()
    middle = len(links) // 4 + 2
    stage = Stage(torn("sheet", {"triangles": triangles, "links": links}, x, middle))
    before, after = (next(t for t in stage.things(i) if isinstance(t, Mesh)).triangles for i in (0, 1))
    assert len(before) == len(triangles)
    gone = {tuple(t) for t in before.tolist()} - {tuple(t) for t in after.tolist()}
    assert len(gone) == 2 and all(set(links[middle].tolist()) <= set(t) for t in gone)


def test_a_torn_rope_is_in_pieces() -> None:
    x = np.stack([np.arange(6.0), np.zeros(6), np.zeros(6)], 1)
    links = np.stack([np.arange(5), np.arange(1, 6)], 1)
    stage = Stage(torn("rope", {"curve": np.arange(6), "links": links}, x, 2))
    counts = [next(t for t in stage.things(i) if isinstance(t, Tubes)).counts.tolist() for i in (0, 1)]
    assert counts == [[6], [3, 3]]


def test_nothing_is_thinner_than_asked() -> None:
    run = fake_run.studio()
    sizes = {t.name: t.radii.max() for t in Stage(run).things(0, 0.05) if isinstance(t, Spheres)}
    assert sizes == {"masses": pytest.approx(0.15)}  # few masses: three times as thick


# Surfaces


def test_a_cube_is_cut_at_its_edges_and_a_ball_is_not() -> None:
    vertices, triangles = fake_run.cube()
    source, cut = surfaces.split(vertices, triangles.astype(int))
    assert len(source) == 24
    np.testing.assert_array_equal(source[cut], triangles)
    normals = np.abs(surfaces.normals(vertices[source], cut))
    np.testing.assert_allclose(np.sort(normals, axis=1), np.tile([0, 0, 1], (24, 1)), atol=1e-12)
    vertices, triangles = fake_run.ball()
    assert len(surfaces.split(vertices, triangles.astype(int))[0]) == len(vertices)


def test_which_surfaces_are_closed() -> None:
    vertices, triangles = fake_run.cube()
    t = triangles.astype(int)
    assert surfaces.outward(vertices, t)
    assert not surfaces.outward(vertices, t[:, ::-1])
    assert not surfaces.outward(vertices, t[1:])


def test_triangles_are_rounded_but_for_creases_and_planes() -> None:
    vertices, triangles = fake_run.ball(6)
    x = (vertices - fake_run.BALL) / fake_run.BALL_RADIUS

    def flatness(x: Any, t: Any) -> float:
        """How far middles of edges are from the sphere, the root of the mean square."""
        middle = 0.5 * (x[t] + np.roll(x[t], 1, axis=1))
        return float(np.sqrt(np.mean((1 - np.linalg.norm(middle, axis=2)) ** 2)))

    fine, faces = surfaces.rounded(x, triangles.astype(int))
    np.testing.assert_array_equal(fine[: len(x)], x)
    assert len(faces) == 4 * len(triangles) and surfaces.outward(fine, faces)
    assert flatness(x, triangles) > 0.02
    assert flatness(fine, faces) < 0.35 * flatness(x, triangles)  # measured 0.32 of 0.039
    cube, t = fake_run.cube()
    fine, _ = surfaces.rounded(cube, t.astype(int))
    assert len(fine) == 26
    np.testing.assert_allclose(np.abs(fine - cube.mean(axis=0)).max(axis=1), np.abs(cube - cube.mean(axis=0)).max())
    flat, t, _ = fake_run.lattice()
    fine, _ = surfaces.rounded(flat, t)
    np.testing.assert_allclose(np.ptp(fine, axis=0), np.ptp(flat, axis=0), atol=1e-12)


def test_cloth_has_two_sides_and_a_round_rim() -> None:
    x, triangles, _ = fake_run.lattice()
    h = 0.02
    shown, faces, normals = surfaces.thickened(x, triangles.astype(int), h)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    a, b, c = shown[faces].transpose(1, 0, 2)
    side = np.ptp(x, axis=0).max()
    # The sheet and a rim like half of an octagon; whatever is left open would not add up.
    volume = abs(np.sum(a * np.cross(b, c)) / 6)
    rim = 4 * side * h**2 / 2 * np.sqrt(0.5)
    assert volume - h * side**2 == pytest.approx(rim, rel=0.05)
    assert np.ptp(shown, axis=0).max() == pytest.approx(side + h)
    facing = np.sum(surfaces.face_normals(shown, faces) * normals[faces].sum(axis=1), axis=1)
    assert abs(np.sum(np.sign(facing))) == len(faces)
    vertices, t = fake_run.ball()
    assert len(surfaces.thickened(vertices, t.astype(int), h)[0]) == len(
        vertices
    )  # closed: nothing is to be seen of it


def test_cloth_is_as_thick_as_contact_keeps_it_apart() -> None:
    run = fake_run.studio()
    run.scene["sheet"][0]["system"] = "soft"
    run.scene["system"] = [{"name": "soft", "method": "dynamics", "self_contact": {"thickness": 0.01}}]

    def thickness() -> float:
        return next(t.thickness for t in Stage(run).things(0) if isinstance(t, Mesh) and t.matter == "fabric")

    assert thickness() == 0.01
    run.scene["collider"][0]["thickness"] = 0.002
    assert thickness() == pytest.approx(0.0036)
    del run.scene["system"][0]["self_contact"]
    assert thickness() == 0.0


@pytest.mark.parametrize("name", ["mitsuba", "pyvista"])
def test_cloth_is_seen_from_the_side(name: str) -> None:
    if name not in renderers():
        missing(f"{name} does not work here")
    x, triangles, _ = fake_run.lattice()
    run = fake_run.one(
        "cloth", "sheet", {"triangles": triangles}, x - x.mean(axis=0), world={"gravity": [0.0, 0.0, 0.0]}
    )
    run.scene["camera"] |= {"position": [0.0, -4.0, 0.0], "target": [0.0, 0.0, 0.0], "resolution": [128, 72]}
    run.scene["sheet"][0] |= {"color": fake_run.RED, "system": "soft"}
    run.scene["system"][0]["self_contact"] = {"thickness": 0.1}
    image = picture(run, 0, name).astype(float)
    red = image[..., 0] - image[..., 2] > 60
    across = 4 * np.tan(np.radians(17.5)) * 2 / 128
    assert red.any(axis=1).sum() == pytest.approx(0.1 / across, abs=2)  # rows, of a sheet that has its thickness


@pytest.mark.parametrize("shape", ["straight", "circle", "point", "fold"])
def test_tubes_are_closed_and_round(shape: str) -> None:
    s = np.linspace(0, 2 * np.pi, 30)
    line = {
        "straight": np.stack([s, 0 * s, 0 * s], 1),
        "circle": np.stack([np.cos(s), np.sin(s), 0.1 * s], 1),
        "point": np.zeros((3, 3)),
        "fold": np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0.0], [1, 0, 0]]),
    }[shape]
    vertices, triangles, normals = surfaces.tubes(line, np.array([len(line)]), 0.05)
    assert np.isfinite(vertices).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
    away = np.linalg.norm(vertices[:, None] - line, axis=2).min(axis=1)
    np.testing.assert_allclose(away, 0.05, atol=1e-9)
    if shape in ("straight", "circle"):
        facing = np.sum(surfaces.face_normals(vertices, triangles) * normals[triangles].sum(axis=1), axis=1)
        assert (facing > -1e-12).all() and (facing > 1e-9).mean() > 0.9


def test_balls_are_round_and_outward() -> None:
    centers = np.array([[0.0, 0, 0], [5, 0, 0]])
    vertices, triangles, _ = surfaces.balls(centers, np.array([1.0, 2.0]))
    n = len(vertices) // 2
    np.testing.assert_allclose(np.linalg.norm(vertices[n:] - centers[1], axis=1), 2.0)
    assert surfaces.outward(vertices[:n], triangles[: len(triangles) // 2])


def test_rims_are_turned_to_the_eye() -> None:
    vertices, triangles = fake_run.ball()
    t, eye = triangles.astype(int), np.array([0.0, -4.0, 0.3])
    shading = surfaces.normals(vertices, t)

    def contradictions(v: Any, f: Any, n: Any) -> int:
        front = np.sum(surfaces.face_normals(v, f) * (eye - v[f].mean(axis=1)), axis=1) > 0
        return int((np.sum(n[f] * (eye - v[f]), axis=2) < 0)[front].sum())

    assert contradictions(vertices, t, shading) > 10
    turned = surfaces.turned(vertices, t, shading, eye)
    assert contradictions(*turned) == 0
    np.testing.assert_array_equal(turned[0][turned[1]], vertices[t])


def test_display_and_linear_are_inverse() -> None:
    levels = np.arange(256) / 255
    np.testing.assert_allclose(display(linear(levels)), levels, atol=1e-12)
    np.testing.assert_allclose(rgb("#ff0080"), [1.0, 0.0, 0.2158605], atol=1e-6)


# Films


def test_stills_are_written_before_the_film(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[Any] = []
    monkeypatch.setattr("tumble.cli.render.film", lambda run, path, *how, **more: done.append((path.name, more)))
    monkeypatch.setattr("tumble.cli.render.still", lambda run, i, *how, **more: done.append((i, more)))
    asked = dict.fromkeys(("usd", "ply", "vdb", "plot"), False) | {"film": True}
    assert write_results(fake_run.studio(), asked, [0, 2, 9], PLAIN, 7, "a.usda") == []  # type: ignore[arg-type]
    how = {"samples": 7, "camera": "a.usda"}
    assert done == [(0, how), (2, how), ("film.mp4", how)]


def test_samples_are_those_of_mitsuba(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    monkeypatch.setattr(tumble.pictures, "_drawn", lambda renderer, things, camera, samples: taken.append(samples))
    run = fake_run.studio()
    picture(run, 0, PLAIN, SIZE)
    picture(run, 0, PLAIN, SIZE, samples=99)
    assert taken == [tumble.pictures.SAMPLES, 99]
    with pytest.raises(ExportError, match="samples"):
        picture(run, 0, PLAIN, SIZE, samples=0)
    with pytest.raises(typer.BadParameter, match="only mitsuba takes samples"):
        look_for(PLAIN, 4)


def decoded(path: Path) -> tuple[dict[str, Any], list[Any]]:
    """Metadata and pictures of a film."""
    import imageio_ffmpeg

    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    width, height = meta["size"]
    return meta, [np.frombuffer(f, dtype=np.uint8).reshape(height, width, 3) for f in reader]


def test_a_film_shows_every_frame_in_order(tmp_path: Path) -> None:
    run = fake_run.studio()
    calls: list[tuple[int, int]] = []
    path = film(run, tmp_path / "new" / "film.mp4", PLAIN, size=SIZE, progress=lambda *c: calls.append(c), processes=2)
    assert calls == [(k, 5) for k in range(1, 6)]
    meta, pictures = decoded(path)
    assert meta["size"] == SIZE and meta["fps"] == pytest.approx(fake_run.FPS)
    assert meta["pix_fmt"].startswith("yuv420p") and meta["codec"] == "h264"
    assert len(pictures) == 5
    stills = [picture(run, i, PLAIN, SIZE).astype(float) for i in range(5)]
    apart = np.array([[np.abs(p - s).mean() for s in stills] for p in pictures])
    assert (apart.argmin(axis=1) == np.arange(5)).all()
    assert apart.diagonal().max() < 3.0
    assert [p.name for p in path.parent.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize(("fps", "played"), [(10000.0, 24.0), (0.15, 24.0), (12.0, 12.0), (60.0, 60.0)])
def test_films_play_at_rates_that_can_be_watched(fps: float, played: float, tmp_path: Path) -> None:
    run = fake_run.studio()
    run.scene["time"]["fps"] = fps
    meta, pictures = decoded(film(run, tmp_path / "film.mp4", PLAIN, size=(32, 18), processes=1))
    assert meta["fps"] == pytest.approx(played) and len(pictures) == 5


def test_odd_sizes_and_fewer_frames(tmp_path: Path) -> None:
    path = film(fake_run.studio(), tmp_path / "film.mp4", PLAIN, every=2, size=(81, 45), processes=1)
    meta, pictures = decoded(path)
    assert meta["size"] == (82, 46) and meta["fps"] == pytest.approx(fake_run.FPS / 2)
    assert len(pictures) == 3


def test_a_film_by_another_renderer(renderer: str, tmp_path: Path) -> None:
    run = fake_run.studio()
    run.n_frames = 2
    _, pictures = decoded(film(run, tmp_path / "film.mp4", renderer, size=(64, 36), processes=2))
    assert len(pictures) == 2 and np.std(pictures[0]) > 5


def test_a_script_without_a_guard_can_make_films(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import sys; sys.path[:0] = sys.argv[1].split(';')\n"
        "import fake_run\n"
        "from tumble.film import film\n"
        "film(fake_run.studio(), 'film.mp4', 'matplotlib', size=(32, 18), processes=2)\n"
    )
    here = [str(Path(fake_run.__file__).parent), str(Path(tumble.film.__file__).parents[1])]
    subprocess.run([sys.executable, script, ";".join(here)], cwd=tmp_path, check=True, timeout=120)
    assert len(decoded(tmp_path / "film.mp4")[1]) == 5


def test_what_ffmpeg_says_when_it_fails_is_told(tmp_path: Path) -> None:
    (tmp_path / ".film.mp4.part").mkdir()
    with pytest.raises(ExportError, match=r"film\.mp4: ffmpeg failed: .*directory"):
        film(fake_run.studio(), tmp_path / "film.mp4", PLAIN, size=(32, 18), processes=1)


def test_a_picture_that_fails_leaves_no_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise ExportError("no paint")

    monkeypatch.setattr(tumble.film, "render", fail)
    with pytest.raises(ExportError, match="no paint"):
        film(fake_run.studio(), tmp_path / "film.mp4", PLAIN, size=(32, 18), processes=1)
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_dies_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tumble.film, "_draw", _die)
    with pytest.raises(ExportError, match="died"):
        film(fake_run.studio(), tmp_path / "film.mp4", PLAIN, size=(32, 18), processes=2)
    assert list(tmp_path.iterdir()) == []


def _die(*arguments: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_film_is_not_written_over_before_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(b"old")

    def stop(done: int, total: int) -> None:
        assert path.read_bytes() == b"old"
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film(fake_run.studio(), path, PLAIN, size=(32, 18), progress=stop, processes=1)
    assert path.read_bytes() == b"old" and [p.name for p in tmp_path.iterdir()] == ["film.mp4"]


# Plots


def test_plots_are_pictures(tmp_path: Path) -> None:
    from matplotlib.image import imread

    run = fake_run.studio()
    for path in (energy(run, tmp_path / "a" / "energy.png"), ledger(run, ["momentum", "speed"], tmp_path / "l.png")):
        image = imread(path)
        assert image.shape[0] > 300 and image.shape[1] > 800 and image[..., :3].std() > 0.02
    assert ledger(run, "contacts", tmp_path / "l.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    "title", ["A dress", "A title longer than a figure is wide, as those of scenes are" * 2, "W " * 300, "M" * 99]
)
def test_titles_fit_the_figure(title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    drawn: list[Figure] = []
    write = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda figure, *a, **k: (write(figure, *a, **k), drawn.append(figure)))
    run, smoke = fake_run.studio(), fake_run.plume(8)
    run.scene["title"] = smoke.scene["title"] = title
    energy(run, tmp_path / "energy.png")
    ledger(run, ["speed"], tmp_path / "ledger.png")
    slices(smoke, tmp_path / "slices.png")
    assert len(drawn) == 3
    for figure in drawn:
        (shown,) = (t for t in figure.findobj(Text) if t.get_text().startswith(title[:7]))
        box = shown.get_window_extent()
        assert box.width > 0.1 * figure.bbox.width and (len(title) < 60 or box.height > 40)  # of several lines
        assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 + 1 and box.y0 >= 0 and box.y1 <= figure.bbox.y1


def test_the_total_energy_and_its_drift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(tumble.plots, "save", lambda figure, path: figures.append(figure))
    run = fake_run.studio()
    energy(run, "energy.png")
    upper, lower = figures[0].axes
    labels = [text.get_text() for text in upper.texts]
    assert labels == ["kinetic", "elastic", "external", "total"]
    assert upper.get_ylabel() == "energy [J]" and lower.get_xlabel() == "time [s]"
    np.testing.assert_allclose(upper.lines[3].get_ydata(), 1.0)
    np.testing.assert_allclose(lower.lines[1].get_ydata(), 0.0, atol=1e-12)
    places = sorted(text.get_position()[1] for text in upper.texts)
    assert (np.diff(places) > 0.03).all()


def test_a_vector_stands_for_its_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(tumble.plots, "save", lambda figure, path: figures.append(figure))
    ledger(fake_run.studio(), ["momentum", "speed", "kinetic", "elastic", "contacts", "stretch"], "x.png")
    labels = ["momentum [kg m/s]", "speed [m/s]", "[J]", "contacts", "stretch [1]"]
    assert [ax.get_ylabel() for ax in figures[0].axes] == labels
    assert len(figures[0].axes[0].lines) == 3
    assert (unit("angular_momentum_y"), unit("contacts")) == ("kg m²/s", "")


def test_a_column_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="'sped'; did you mean speed"):
        ledger(fake_run.studio(), "sped", tmp_path / "x.png")
    with pytest.raises(ExportError, match="nope"):
        energy(fake_run.studio(), tmp_path / "x.nope")
    assert list(tmp_path.iterdir()) == []


def test_a_render_of_nothing_is_the_background(renderer: str) -> None:
    camera = framing.camera(fake_run.studio(), (32, 18)).unit()
    image = render(renderer, [], camera, 4)
    assert image.min() > 200 and image.shape == (18, 32, 3)
