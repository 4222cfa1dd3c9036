"""Pictures of a run: `picture(run, i)`.

Three renderers draw the same things from the same camera: `mitsuba` (path tracing, the finest), `pyvista`
(rasterization, quick) and `matplotlib` (always there). "auto" takes the finest that works on this machine. Clouds, smoke and
images are painted over what they draw, but for `mitsuba-smoke`, which traces smoke as well, and takes its time.
"""

import functools
import hashlib
import importlib.util
import os
import pickle
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError
from tumble.arguments import whole
from tumble.bundled import unknown
from tumble.looks import GROUND, SOLID
from tumble.pictures import framing, splats, volumes
from tumble.pictures.drawn import Body, Cloud, Ground, Image, Mesh, Smoke, Thing, placed
from tumble.pictures.framing import Camera
from tumble.pictures.pyvista_ import headless
from tumble.pictures.surfaces import Floats, unit
from tumble.pictures.things import Recording, Stage
from tumble.style import display, linear

__all__ = ["RENDERERS", "TRACED", "Studio", "picture", "render", "renderers", "resolve"]

Picture = npt.NDArray[np.uint8]
"""Height x width x 3."""

RENDERERS = ("mitsuba", "pyvista", "matplotlib")
"""The finest first."""

TRACED = "mitsuba-smoke"
"""Mitsuba for smoke, too."""

PROBES = {
    "mitsuba": "import mitsuba, mitsuba_oidn; mitsuba.set_variant('scalar_rgb')",
    "pyvista": "import pyvista as pv; p = pv.Plotter(off_screen=True, window_size=[32, 32]); p.add_mesh(pv.Sphere()); "
    "assert p.screenshot(return_img=True).std() > 0",
}
"""Requirements of a renderer. They are tried in a separate process: without EGL, VTK ends the process."""

SAMPLES = 16
"""Samples per pixel of stills, as mitsuba takes them."""

THINNEST = 0.0015
"""Spheres and tubes are drawn at least this thick, in pictures' widths of radius, so that nothing is lost."""

GAP = 0.03
"""How far below everything a neutral ground lies, in extents of everything."""


def renderers() -> list[str]:
    """The renderers that work on this machine, the finest first."""
    return [name for name in RENDERERS if _works(name)]


def resolve(renderer: str = "auto") -> str:
    """The renderer that "auto" stands for; any other name as it is. Raises ExportError if it does not work here."""
    if renderer == "auto":
        return next(name for name in RENDERERS if _works(name))
    if renderer not in (*RENDERERS, TRACED):
        raise ExportError(unknown("renderer", renderer, ("auto", *RENDERERS, TRACED)))
    if not _works("mitsuba" if renderer == TRACED else renderer):
        cure = "pip install 'tumble[pictures]'"
        if renderer == "pyvista" and importlib.util.find_spec("pyvista"):
            cure = "it needs OpenGL: on Debian, apt install libegl1 libgl1-mesa-dri"
        raise ExportError(f"the renderer {renderer} does not work here ({cure})")
    return renderer


def picture(
    run: Recording,
    i: int,
    renderer: str = "auto",
    size: tuple[int, int] | None = None,
    samples: int = SAMPLES,
    camera: str | None = None,
) -> Picture:
    """A picture of frame i, in sRGB; the size is that of the scene's camera if not given. `samples` per pixel are what
    mitsuba takes. `camera` is one of a USD file, FILE or FILE:PRIM, instead of the scene's. Raises ExportError."""
    return Studio(run, renderer, size, samples, camera).picture(i)


class Studio:
    """Takes pictures of one run; what frames have in common, as the camera's place, is worked out once."""

    def __init__(
        self,
        run: Recording,
        renderer: str = "auto",
        size: tuple[int, int] | None = None,
        samples: int = SAMPLES,
        camera: str | None = None,
    ) -> None:
        """`samples` per pixel are what mitsuba takes; `camera` is one of a USD file, which may move. Raises ExportError if the
        renderer does not work here, there is nothing to draw, or no such camera."""
        if run.n_frames < 1:
            raise ExportError("the run has no frames")
        self.run = run
        self.renderer = resolve(renderer)
        self.samples = whole(samples, "samples", 1, ExportError)
        points = functools.cache(lambda: framing.outline(run))
        self.view = framing.views(run, camera, size, points)
        self.camera = self.view(0)
        self.stage = Stage(run, self.camera.axes[2])
        self._backdrop = self._grounds_below(points)

    def picture(self, i: int) -> Picture:
        """A picture of frame i."""
        return render(self.renderer, self.things(i), self.view(i).unit(), self.samples, self.stage.night)

    def things(self, i: int) -> list[Thing]:
        """Drawables of frame i, moved and scaled for `Camera.unit`."""
        if not 0 <= whole(i, "frame", error=ExportError) < self.run.n_frames:
            raise ExportError(f"there is no frame {i}; there are frames 0 to {self.run.n_frames - 1}")
        camera = self.view(i)
        things = self.stage.things(i, THINNEST * camera.width)
        if self.stage.flat:
            things = [self._slab(t, camera) if isinstance(t, Ground) else t for t in things]
        else:
            # No ground that the camera is inside of.
            things = [
                t
                for t in [*things, *self._backdrop]
                if not isinstance(t, Ground) or float((camera.position - t.point) @ t.normal) > 0
            ]
        return placed(things, camera.target, camera.distance)

    def _falls(self) -> bool:
        """Whether gravity pulls down, or may."""
        gravity = self.run.scene.get("world", {}).get("gravity", (0.0, 0.0, -9.8))
        return not isinstance(gravity, (list, tuple)) or isinstance(gravity[2], str) or gravity[2] < 0

    def _grounds_below(self, points: Callable[[], Floats]) -> list[Ground]:
        """A neutral ground to catch shadows, in scenes in space where things fall and that have no ground of their own."""
        if any(o.plane is not None for o in self.stage.objects):
            return []
        weighs = any("mass" in columns for columns in self.run.static.values())  # Tracers do not.
        weighs = weighs or (
            any("id" in columns for columns in self.run.frame(0).values())
            and any(s.get("method") == "dynamics" for s in self.run.scene.get("system", ()))
        )
        weighs = weighs or any(o.grid is not None for o in self.stage.objects)
        if self.stage.flat or self.stage.night or not self._falls() or not weighs:
            return []
        low, high = points().min(axis=0), points().max(axis=0)
        point = np.array([0.0, 0.0, low[2] - GAP * float(np.max(high - low))])
        return [Ground("", point, np.array([0.0, 0.0, 1.0]), GROUND)]

    def _slab(self, ground: Ground, camera: Camera) -> Thing:
        """A ground of a plane scene, which is seen from the side: what lies below its line."""
        forward = camera.axes[2]
        normal = unit(ground.normal - forward * float(ground.normal @ forward))
        along = np.cross(normal, forward)
        line = camera.target - normal * float((camera.target - ground.point) @ normal) + 0.05 * camera.width * forward
        far = 4 * (camera.width + camera.height)
        corners = line + far * np.array([along, -along, -along - normal, along - normal])
        triangles = np.array([[0, 2, 1], [0, 3, 2]])
        facing = np.broadcast_to(-forward, (4, 3)).copy()
        color = SOLID if ground.color == GROUND else ground.color
        return Mesh(ground.name, corners, triangles, facing, color)


def render(renderer: str, things: list[Thing], camera: Camera, samples: int = SAMPLES, night: bool = False) -> Picture:
    """Draws things with one of the renderers, and clouds, images and smoke over them. Raises ExportError if it fails."""
    clouds = [t for t in things if isinstance(t, Cloud)]
    # Traced light comes from outside: what glows is painted, as is all by night.
    traced = [t for t in things if isinstance(t, Smoke) and renderer == TRACED and not night and t.glow is None]
    smoke = [t for t in things if isinstance(t, Smoke) and not any(t is other for other in traced)]
    images = [t for t in things if isinstance(t, Image)]
    if not (clouds or smoke or images or night):
        return _drawn(renderer, things, camera, samples)
    scenery: list[Thing] = [*(t for t in things if isinstance(t, Body | Ground)), *traced]
    # By night nothing at all is dark, and drawn at once.
    light, depth = (None, np.full(camera.size[::-1], np.inf))
    if scenery or not night:
        light, depth = _scenery(renderer, scenery, camera, samples)
    try:
        if night:
            shown = volumes.images(splats.glow(light, depth, scenery, clouds, camera), depth, images, camera)
        else:
            assert light is not None
            # Particles in a plane lie on it.
            shown = volumes.images(light, depth, images, camera)
            shown = splats.discs(shown, depth, clouds, camera) if clouds else shown
        shown = volumes.smoke(shown, depth, smoke, camera, night)
    except (MemoryError, ValueError) as error:
        raise ExportError(f"particles and smoke cannot be drawn: {error}") from error
    return np.round(255 * display(shown)).astype(np.uint8)


_KEPT: dict[bytes, tuple[Floats, Floats]] = {}


def _scenery(renderer: str, things: list[Thing], camera: Camera, samples: int) -> tuple[Floats, Floats]:
    """The picture of all but clouds in linear light, and how far away it is; that of the last time if nothing moved."""
    key = hashlib.blake2b(pickle.dumps((renderer, things, camera, samples))).digest()
    if key not in _KEPT:
        _KEPT.clear()
        picture = linear(_drawn(renderer, things, camera, samples) / 255)
        _KEPT[key] = picture, splats.depths(things, camera)
    return _KEPT[key]


def _drawn(renderer: str, things: list[Thing], camera: Camera, samples: int) -> Picture:
    try:
        if renderer in ("mitsuba", TRACED):
            from tumble.pictures import mitsuba_

            return mitsuba_.draw(things, camera, samples)
        if renderer == "pyvista":
            from tumble.pictures import pyvista_

            return pyvista_.draw(things, camera)
        from tumble.pictures import matplotlib_

        return matplotlib_.draw(things, camera)
    except (ImportError, MemoryError, OSError, RuntimeError, ValueError) as error:
        raise ExportError(f"the renderer {renderer} failed: {error}") from error


@functools.cache
def _works(renderer: str) -> bool:
    if renderer not in PROBES:
        return True
    if importlib.util.find_spec(renderer) is None:
        return False
    command = [sys.executable, "-c", PROBES[renderer]]
    try:
        probe = subprocess.run(command, capture_output=True, timeout=120, check=False, env=os.environ | headless())
    except (OSError, subprocess.SubprocessError):
        return False
    return probe.returncode == 0
