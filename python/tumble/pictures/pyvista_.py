"""Pictures by rasterization (PyVista, VTK), off-screen: quick, with painted soft shadows."""

import importlib
import os
import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.pictures.drawn import Body, Ground, Mesh, Thing, as_triangles, finished
from tumble.pictures.framing import Camera
from tumble.pictures.look import SKY, key_light, painted
from tumble.pictures.surfaces import Floats, Indices
from tumble.style import display

RINGS = 160
"""Rings of points of the painted ground."""


def draw(things: list[Thing], camera: Camera) -> npt.NDArray[np.uint8]:
    """The picture, height x width x 3. Target at the origin, camera at distance 1."""
    os.environ.update(headless())
    pv: Any = importlib.import_module("pyvista")
    plotter = pv.Plotter(off_screen=True, window_size=list(camera.size), lighting="none")
    try:
        plotter.set_background(SKY[1], top=SKY[0])
        _light(pv, plotter, camera)
        for thing in things:
            if isinstance(thing, Ground):
                vertices, triangles, colors = painted(thing, things, camera, RINGS)
                ground = _poly(pv, vertices, triangles)
                ground["paint"] = np.round(255 * colors).astype(np.uint8)
                plotter.add_mesh(ground, scalars="paint", rgb=True, lighting=False)
                continue
            if not isinstance(thing, Body):
                continue
            if isinstance(thing, Mesh) and not camera.parallel:
                thing = finished(thing, camera.pixel)
            vertices, triangles, normals = as_triangles(thing, 3)
            if not len(triangles):
                continue
            surface = _poly(pv, vertices, triangles)
            surface.point_data.active_normals = normals
            gloss = 0.0 if isinstance(thing, Mesh) and thing.matter == "fabric" else 0.35
            color = display(np.array(thing.color)).tolist()
            actor = plotter.add_mesh(surface, color=color, ambient=0.36, diffuse=0.8, specular=gloss, specular_power=40)
            actor.prop.interpolation = "Phong"
        _look(plotter, camera)
        plotter.enable_anti_aliasing("ssaa")
        image = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    return np.ascontiguousarray(image[..., :3], dtype=np.uint8)


def headless() -> dict[str, str]:
    """Environment in which VTK draws without a display."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        return {"VTK_DEFAULT_OPENGL_WINDOW": os.environ.get("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")}
    return {}


def _poly(pv: Any, vertices: Floats, triangles: Indices) -> Any:
    return pv.PolyData.from_regular_faces(vertices.astype(np.float32), triangles)


def _light(pv: Any, plotter: Any, camera: Camera) -> None:
    right, up, forward = camera.axes
    directions = (key_light(camera), 0.75), (right + 0.55 * forward + 0.4 * up, 0.3), (-forward + 0.2 * up, 0.3)
    for direction, intensity in directions:
        light = pv.Light(position=tuple(direction), intensity=intensity, light_type="scene light")
        light.focal_point = (0.0, 0.0, 0.0)
        light.positional = False
        plotter.add_light(light)


def _look(plotter: Any, camera: Camera) -> None:
    plotter.camera.position = tuple(camera.position)
    plotter.camera.focal_point = tuple(camera.target)
    plotter.camera.up = tuple(camera.axes[1])
    if camera.parallel:
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = 0.5 * camera.height
    else:
        plotter.camera.view_angle = float(np.degrees(2 * np.arctan(0.5 * camera.height / camera.distance)))
    plotter.camera.clipping_range = (0.01, 20.0)
