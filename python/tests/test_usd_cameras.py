"""Cameras of USD files that move: pictures, films and USD stages follow them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from test_usd_in import write

from tumble import ExportError, Run, film
from tumble.export import usd as stages
from tumble.pictures import Studio
from tumble.pictures.look import key_light
from tumble.run import simulate
from tumble.usd.cameras import Shot

pytest.importorskip("pxr")

Command = Callable[..., Answer]

SPAN = "    startTimeCode = 10\n    endTimeCode = 34\n    timeCodesPerSecond = 24\n"
MOVING = """
def Xform "crane" {
    double3 xformOp:translate.timeSamples = { 10: (0, -400, 50), 34: (60, -500, 70) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Camera "eye" {
        float focalLength.timeSamples = { 10: 35, 34: 70 }
        float horizontalAperture = 36
        float verticalAperture = 18
        float xformOp:rotateX = 90
        float xformOp:rotateZ.timeSamples = { 10: 0, 34: 30 }
        uniform token[] xformOpOrder = ["xformOp:rotateX", "xformOp:rotateZ"]
    }
}
"""
"""In centimetres with z up, looking along y: it goes to the right, back and up, rolls and zooms in within a second."""

TREE: dict[str, Any] = {
    "version": 1,
    "time": {"fps": 4, "frames": 4},
    "world": {"gravity": [0, 0, 0]},
    "camera": {"resolution": [200, 120]},
    "particles": [{"name": "p", "position": [[0.2, 0, 0.4]], "radius": 0.08, "color": [1, 0, 0]}],
    "output": {"plot": False},
}


def shot(folder: Path, body: str = MOVING) -> Path:
    file = write(folder, body, SPAN, "shot.usda")
    file.write_text(file.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01"))
    return file


def red(image: Any) -> Any:
    """Middle of what is red [pixel]."""
    rgb = np.asarray(image, dtype=float)
    rows, columns = np.nonzero(rgb[..., 0] > 1.6 * np.maximum(rgb[..., 1], rgb[..., 2]))
    assert len(rows) > 5
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


def test_pictures_follow_a_camera_that_moves_rolls_and_zooms(tmp_path: Path) -> None:
    run = simulate(TREE, tmp_path / "run")
    studio = Studio(run, "matplotlib", camera=f"{shot(tmp_path)}:/crane/eye")
    assert studio.camera.size == (200, 100)
    ball = np.array([[0.2, 0, 0.4]])
    for i in (0, 2, 4):
        share = i / 4
        view = studio.view(i)
        assert np.allclose(view.position, [0.6 * share, -4 - share, 0.5 + 0.2 * share])
        assert np.isclose(view.view_angle, np.degrees(2 * np.arctan(0.5 * 36 / (35 + 35 * share))))
        roll = np.radians(30 * share)
        assert np.allclose(view.axes[1], [-np.sin(roll), 0, np.cos(roll)], atol=1e-6)
        # By the lens alone: across and down over the distance, turned by the roll.
        right, up = 0.2 - 0.6 * share, -0.1 - 0.2 * share
        seen = np.array([right * np.cos(roll) + up * np.sin(roll), right * np.sin(roll) - up * np.cos(roll)])
        meant = np.array([100, 50]) + 200 * seen * (35 + 35 * share) / 36 / (4 + share)
        assert np.allclose(view.project(ball)[0, :2], meant, atol=1e-3)
        assert np.allclose(red(studio.picture(i)), meant, atol=1.5), i
    # The light stands.
    assert np.allclose(key_light(studio.view(4)), key_light(studio.view(0)))
    assert not np.allclose(studio.view(4).axes[1], studio.view(0).axes[1])


def test_films_are_taken_by_it_frame_by_frame(tmp_path: Path) -> None:
    import imageio_ffmpeg

    run = simulate(TREE, tmp_path / "run")
    source = str(shot(tmp_path))
    for processes in (1, 2):
        path = film.film(run, tmp_path / f"{processes}.mp4", "matplotlib", camera=source, processes=processes)
        pictures = imageio_ffmpeg.read_frames(str(path))
        about = next(pictures)
        assert about["size"] == (200, 100)
        shown = [np.frombuffer(p, np.uint8).reshape(100, 200, 3) for p in pictures]
        studio = Studio(run, "matplotlib", camera=source)
        for i in (0, 4):
            place = studio.view(i).project(np.array([[0.2, 0, 0.4]]))[0, :2]
            assert np.allclose(red(shown[i]), place, atol=1.5), (processes, i)


def test_stages_have_it_animated_and_it_comes_back(tmp_path: Path) -> None:
    run = simulate(TREE, tmp_path / "run")
    source = shot(tmp_path)
    scene = stages.write(run, tmp_path / "out", camera=str(source))
    there, back = Shot(source), Shot(scene, "/scene/camera")
    assert back.moves and back.end == 4
    for i in range(5):
        a, b = there.at(i / 4), back.at(i / 4)
        for one, other in ((a.position, b.position), (a.up, b.up), (a.back, b.back), (a.spread, b.spread)):
            assert np.allclose(one, other, atol=1e-5), i
        assert np.isclose(a.ratio, b.ratio)
    # A camera that stands has no samples, and its lens neither.
    still = Shot(stages.write(run, tmp_path / "still"), "/scene/camera")
    assert not still.moves and not still.prim.GetAttribute("focalLength").GetNumTimeSamples()


def test_commands_look_through_it(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    source, file = f"{shot(tmp_path)}:/crane/eye", scene_file(TREE | {"time": {"fps": 4, "frames": 1}})
    told = tumble("check", file, "--camera", source)
    assert told.code == 0 and "/crane/eye moves" in told.err and "--camera" in told.err
    out = tmp_path / "run"
    done = tumble("run", file, "--out", out, "--usd", "--film", "--renderer", "matplotlib", "--camera", source)
    assert done.code == 0 and "warning" not in done.err, done.err
    assert (out / "film.mp4").stat().st_size > 1000 and Shot(out / "scene.usda").moves
    assert tumble("render", out, "--renderer", "matplotlib", "--camera", source).code == 0
    assert tumble("export", out, "--blender", "--camera", source, "--out", tmp_path / "b").code == 0
    assert "'resolution': (200, 100)" in (tmp_path / "b" / "blender.py").read_text()
    assert Shot(tmp_path / "b" / "scene.usda").at(0.25).spread < Shot(source).at(0).spread


def test_cameras_that_cannot_be_are_refused(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    file = scene_file(TREE | {"time": {"fps": 4, "frames": 1}})
    source = shot(tmp_path)
    idle = tumble("run", file, "--out", tmp_path / "a", "--camera", source)
    assert idle.code == 2 and "--film" in idle.err and not (tmp_path / "a").exists()
    lost = tumble("run", file, "--out", tmp_path / "a", "--film", "--camera", "lost.usda")
    assert lost.code == 2 and "lost.usda: there is no such USD file" in lost.err and not (tmp_path / "a").exists()
    flat = scene_file(TREE | {"dimension": 2, "plane": "xz"}, "flat.json")
    refused = tumble("run", flat, "--out", tmp_path / "a", "--film", "--camera", source)
    assert refused.code == 2 and "two dimensions" in refused.err
    run = simulate(TREE | {"dimension": 2, "plane": "xz"}, tmp_path / "flat")
    with pytest.raises(ExportError, match="head-on"):
        Studio(run, "matplotlib", camera=str(source))
    with pytest.raises(ExportError, match="no camera /x"):
        stages.write(Run(simulate(TREE, tmp_path / "r").folder), tmp_path / "r", camera=f"{source}:/x")
    assert tumble("export", tmp_path / "r", "--npz", "--camera", source).code == 2
    odd = shot(tmp_path, MOVING.replace("focalLength.timeSamples = { 10: 35, 34: 70 }", "focalLength = 0"))
    with pytest.raises(ValueError, match="/crane/eye has a lens or an aperture without size"):
        Shot(odd)


def test_a_shifted_lens_is_told(tmp_path: Path, scene_file: Callable[..., Path], tumble: Command) -> None:
    source = shot(
        tmp_path, MOVING.replace("float verticalAperture", "float horizontalApertureOffset = 4\nfloat verticalAperture")
    )
    done = tumble(
        "run",
        scene_file(TREE | {"time": {"fps": 4, "frames": 1}}),
        "--out",
        tmp_path / "a",
        "--usd",
        "--camera",
        source,
    )
    assert done.code == 0 and "warning[camera-in]" in done.err and "shifted" in done.err
