"""Cameras of scenes that move: by keys and by formulas, in pictures, films and USD stages."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import fake_run
import numpy as np
import pytest
from conftest import Answer
from test_usd_cameras import TREE, red

from tumble import Scene, SceneError, film
from tumble.pictures import Studio, framing, picture
from tumble.pictures.drawn import Ground, Mesh
from tumble.pictures.look import key_light
from tumble.run import simulate

Command = Callable[..., Answer]

SIZE = (200, 120)
BALL = np.array([0.2, 0.0, 0.4])

WORDS: dict[str, Any] = {
    "resolution": list(SIZE),
    "position": {"keys": [[0, 0, -4, 0.5], [1, 0.6, -5, 0.7]]},
    "target": ["0.1*t", 0, "0.5 - 0.2*t"],
    "view_angle": {"keys": [[0, 50], [1, 30]]},
}
"""Right, back and up within a second, by keys; its target by a formula; zooms in."""


def pinhole(t: float) -> Any:
    """Where a picture has the middle of the ball [pixel], and how wide it sees [rad]: from the words alone."""
    eye = np.array([0.6 * t, -4 - t, 0.5 + 0.2 * t])
    ahead = np.array([0.1 * t, 0, 0.5 - 0.2 * t]) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.array([ahead[1], -ahead[0], 0]) / np.hypot(ahead[0], ahead[1])
    up = np.cross(right, ahead)
    way = BALL - eye
    focus = 0.5 * SIZE[0] / np.tan(np.radians(0.5 * (50 - 20 * t)))
    return np.array([100 + focus * (way @ right) / (way @ ahead), 60 - focus * (way @ up) / (way @ ahead)])


def test_pictures_are_taken_at_the_time_of_each_frame(tmp_path: Path) -> None:
    run = simulate(TREE | {"camera": WORDS}, tmp_path / "run")
    studio = Studio(run, "matplotlib")
    seen = []
    # At both keys, and half-way between them.
    for i in (0, 2, 4):
        meant = pinhole(i / 4)
        view = studio.view(i)
        np.testing.assert_allclose(view.project(BALL)[:2], meant, atol=1e-9)
        assert view.view_angle == pytest.approx(50 - 5 * i)
        image = studio.picture(i)
        np.testing.assert_allclose(red(image), meant, atol=1.5)
        np.testing.assert_array_equal(image, picture(run, i, "matplotlib"))
        seen.append(meant)
    assert min(np.linalg.norm(a - b) for a, b in pairwise(seen)) > 5
    # The light stands.
    np.testing.assert_allclose(key_light(studio.view(4)), key_light(studio.view(0)))


def test_films_follow_it(tmp_path: Path) -> None:
    import imageio_ffmpeg

    run = simulate(TREE | {"camera": WORDS}, tmp_path / "run")
    for processes in (1, 2):
        path = film.film(run, tmp_path / f"{processes}.mp4", "matplotlib", processes=processes)
        pictures = imageio_ffmpeg.read_frames(str(path))
        assert next(pictures)["size"] == SIZE
        shown = [np.frombuffer(p, np.uint8).reshape(*SIZE[::-1], 3) for p in pictures]
        for i in (0, 2, 4):
            assert np.allclose(red(shown[i]), pinhole(i / 4), atol=1.5), (processes, i)


def test_stages_have_its_samples(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from tumble.export import usd as stages
    from tumble.usd.cameras import Shot

    run = simulate(TREE | {"camera": WORDS}, tmp_path / "run")
    shot = Shot(stages.write(run, tmp_path / "out"), "/scene/camera")
    view = Studio(run, "matplotlib").view
    assert shot.moves and shot.end == 4
    for i in range(5):
        lens, meant = shot.at(i / 4), view(i)
        np.testing.assert_allclose(lens.position, meant.position, atol=1e-9)
        np.testing.assert_allclose(lens.up, meant.axes[1], atol=1e-9)
        np.testing.assert_allclose(lens.back, -meant.axes[2], atol=1e-9)
        assert lens.spread == pytest.approx(2 * np.tan(np.radians(25 - 2.5 * i)), rel=1e-6)
        assert lens.ratio == pytest.approx(0.6)
    # A lens that does not zoom has no samples, nor has one whose words never change.
    pans = simulate(TREE | {"camera": WORDS | {"view_angle": 40}}, tmp_path / "pans")
    pan = Shot(stages.write(pans, tmp_path / "pan"), "/scene/camera")
    assert pan.prim.GetAttribute("xformOp:transform").GetNumTimeSamples() == 5
    assert pan.prim.GetAttribute("focalLength").GetNumTimeSamples() == 0
    still = {"position": {"keys": [[0, 0, -4, 0.5]]}, "target": "[0, 0, 0.5]"}
    stands = simulate(TREE | {"camera": still}, tmp_path / "stands")
    assert not Shot(stages.write(stands, tmp_path / "still"), "/scene/camera").moves


def test_in_a_plane_it_pans_and_zooms(tmp_path: Path) -> None:
    """Seen head-on, by parallel rays: the width at the target is that of the angle from the distance."""
    words = {"resolution": list(SIZE), "position": "[0, -2 - 2*t, 0]", "target": "[t, 0, 0.4]", "view_angle": 60}
    run = simulate(TREE | {"dimension": 2, "plane": "xz", "camera": words}, tmp_path / "run")
    studio = Studio(run, "matplotlib")
    for i in (0, 2, 4):
        t = i / 4
        width = 2 * (2 + 2 * t) * np.tan(np.radians(30))
        meant = [100 + (0.2 - t) * 200 / width, 60]
        np.testing.assert_allclose(studio.view(i).project(BALL)[:2], meant, atol=1e-9)
        np.testing.assert_allclose(red(studio.picture(i)), meant, atol=1.5)
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    from tumble.export import usd as stages

    stage = Usd.Stage.Open(str(stages.write(run, tmp_path / "out")))
    lens = UsdGeom.Camera(stage.GetPrimAtPath("/scene/camera"))
    for i in (0, 4):
        # In tenths of a metre.
        assert lens.GetHorizontalApertureAttr().Get(i) == pytest.approx(10 * studio.view(i).width)
        assert lens.GetVerticalApertureAttr().Get(i) == pytest.approx(6 * studio.view(i).width)


def test_the_ground_of_a_plane_is_under_every_picture() -> None:
    """The slab below the line of a floor reaches as far as a camera that has moved away sees."""
    run = fake_run.studio(camera={"resolution": [100, 50], "position": "[0, -3, 0]", "target": "[200*t, 0, 0]"})
    run.scene |= {"dimension": 2, "plane": "xz"}
    studio = Studio(run, "matplotlib")
    for i in (0, run.n_frames - 1):
        slabs = [t for t in studio.things(i) if isinstance(t, Mesh) and t.name == "ground"]
        assert not any(isinstance(t, Ground) for t in studio.things(i))
        for slab in slabs:
            width = studio.view(i).unit().width
            assert slab.vertices[:, 0].min() < -width and slab.vertices[:, 0].max() > width


CONSTANT: list[tuple[dict[str, Any], dict[str, Any]]] = [
    (
        {"position": [3.0, -4.0, 2.0], "target": [0.5, 0.0, 0.5], "view_angle": 50.0},
        {"position": {"keys": [[0, 3, -4, 2]]}, "target": "[0.5, 0, 0.5]", "view_angle": "100/2"},
    ),
    ({"target": [1.5, 0.0, 0.0]}, {"target": {"keys": [[0, 1.5, 0, 0], [1, 1.5, 0, 0]]}}),
    ({"position": [3.0, -4.0, 2.0]}, {"position": "[3, -4, 2]"}),
    # Straight down: y is up.
    ({"position": [0.1, 0.0, 5.0], "target": [0.1, 0.0, 0.0]}, {"position": "[0.1, 0, 5]", "target": "[0.1, 0, 0]"}),
    ({}, {"view_angle": "35"}),
]


@pytest.mark.parametrize(("plain", "words"), CONSTANT)
def test_words_that_never_change_give_the_bits_of_plain_ones(plain: dict[str, Any], words: dict[str, Any]) -> None:
    one, other = (
        Studio(fake_run.studio(camera={"resolution": [96, 54]} | camera), "matplotlib") for camera in (plain, words)
    )
    for i in (0, 3):
        np.testing.assert_array_equal(one.picture(i), other.picture(i))
    assert one.view(3) is one.camera and one.camera.lit is None
    # What it was before cameras could move.
    if "position" in plain and "target" in plain:
        np.testing.assert_array_equal(one.camera.position, plain["position"])
        np.testing.assert_array_equal(one.camera.target, plain["target"])


def test_a_camera_without_a_place_goes_along_with_its_target() -> None:
    run = fake_run.studio(camera={"resolution": [100, 50], "target": "[5*t, 0, 0]", "view_angle": "40 - 20*t"})
    views = [framing.views(run, None)(i) for i in range(run.n_frames)]
    away = views[0].position - views[0].target
    assert run.n_frames > 2 and np.linalg.norm(away) > 0
    for i, view in enumerate(views):
        np.testing.assert_allclose(view.target, [5 * run.time(i), 0, 0], atol=1e-12)
        np.testing.assert_allclose(view.position - view.target, away, atol=1e-9)
        assert view.view_angle == pytest.approx(40 - 20 * run.time(i))
        # Everything is in the picture at every frame.
        rope = view.project(run.frame(i)["rope"]["position"])[:, :2]
        assert (rope > 0).all() and (rope < [100, 50]).all()


def test_on_the_way_to_the_top_it_does_not_flip() -> None:
    """Up to a view straight down, the zenith is up; up in the picture turns by no more than the camera from one frame to the
    next."""
    run = fake_run.studio(camera={"position": "[0, -4*cos(3.9*t), 4*sin(3.9*t)]", "target": [0, 0, 0]})
    views = [framing.views(run, None)(i) for i in range(run.n_frames)]
    assert views[-1].axes[2][2] < -0.9997
    for a, b in pairwise(views):
        assert a.axes[1] @ b.axes[1] == pytest.approx(np.cos(0.39), abs=1e-9)


WRONG = [
    ('camera.position=[0, "x", 1]', 'camera.position: "x": unknown name "x"'),
    ('camera.view_angle="200*t"', "camera.view_angle: 0 ° at t = 0 s, expected > 0 and < 170 °"),
    ("camera.view_angle=170", "camera.view_angle: 170 °, expected > 0 and < 170 °"),
    ("camera.position={keys = [[0, 0, -1, nan]]}", "camera.position.keys[0][3]: NaN, expected a finite number"),
    ("camera.position={keys = [[0, 0, -1]]}", "camera.position.keys[0]: a list of 3, expected a list of 4"),
    ("camera.position={keys = [[1, 0, -1, 0], [0, 0, -2, 0]]}", "camera.position: key 1 at t = 0 s is not later"),
    ('camera.look="t"', "expected one of studio, night"),
]


@pytest.mark.parametrize(("words", "said"), WRONG)
def test_what_is_wrong_is_told_once_with_its_place(
    words: str, said: str, tmp_path: Path, scene_file: Callable[..., Path], tumble: Command
) -> None:
    told = tumble("check", scene_file(TREE), "--set", words)
    assert told.code == 2 and said in told.err, told.err
    assert told.err.count("camera.") - told.err.count("--set camera.") <= 1, told.err


def test_it_is_set_like_any_word(tmp_path: Path) -> None:
    scene = Scene(TREE).replace('camera.position=["sin(t)", -3, 1]', "camera.view_angle={keys = [[0, 30], [1, 60]]}")
    words = scene.to_dict()["camera"]
    assert words["position"] == ["sin(t)", -3.0, 1.0] and words["view_angle"]["interpolation"] == "linear"
    view = framing.views(simulate(scene, tmp_path / "run"), None)
    np.testing.assert_allclose(view(4).position, [np.sin(1.0), -3, 1])
    assert view(2).view_angle == pytest.approx(45)
    with pytest.raises(SceneError, match=r"camera\.position: \[0, 0, 0\] at t = 0 s, which is the target, too"):
        simulate(scene.replace('camera.position=[0, 0, "t"]', "camera.target=[0, 0, 0]"), tmp_path / "no")
