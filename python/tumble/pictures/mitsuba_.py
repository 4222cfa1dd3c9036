"""Pictures by path tracing (Mitsuba 3, `scalar_rgb`): soft key light, bright surroundings, cloth with a sheen.

Two renders make a picture: the light itself; and colours and cover of all but the ground, by the same samples. By the
cover the ground is faded into the background without touching the edges in front of it; the colours tell the denoiser
(Intel Open Image Denoise) what is an edge and what is the noise of few samples per pixel.
"""

import functools
import tempfile
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.pictures.drawn import Body, Ground, Matter, Mesh, Smoke, Spheres, Thing, Tubes, finished
from tumble.pictures.framing import Camera
from tumble.pictures.look import FADE, background, fading, key_light, soften
from tumble.pictures.strands import Hair
from tumble.pictures.surfaces import Floats, Indices, balls, turned, unit
from tumble.style import Rgb, display

MANY = 20_000
"""More spheres than these are drawn as triangles."""

SHADES = (0.75, 1.0, 1.2, 0.9)
"""Brightness of strands of hair, one after the other."""

FEW = 5_000
"""More curves than these end flat."""

KEY = np.array([26.5, 25.5, 24.0])
"""Radiance of the key light."""

KEY_SIZE = 0.2
"""Radius of the key light over its distance."""

KEY_DISTANCE = 1000.0

WATERY = {"type": "path", "max_depth": 16, "rr_depth": 8, "hide_emitters": True}
PATHS = {"type": "path", "max_depth": 5, "hide_emitters": True}
THROUGH_SMOKE = {"type": "volpath", "max_depth": 24, "rr_depth": 12, "hide_emitters": True}
COLORS = {"type": "path", "max_depth": 1}

MIRROR = 16
"""Pixels that the denoiser is shown of a picture beyond its sides; its network halves sizes four times."""

Picture = npt.NDArray[np.uint8]

Look = Callable[[Rgb, Matter], dict[str, Any]]
"""What shapes of a colour and a matter are made with."""


def draw(things: list[Thing], camera: Camera, samples: int) -> Picture:
    """The picture, height x width x 3. Target at the origin, camera at distance 1."""
    import mitsuba as mi

    if mi.variant() != "scalar_rgb":
        mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    grounds = [t for t in things if isinstance(t, Ground)]
    floors = {f"ground {k}": _ground(mi, t, camera) for k, t in enumerate(grounds)}
    bodies = [_seen(t, camera) if isinstance(t, Mesh) else t for t in things if isinstance(t, Body)]
    with tempfile.TemporaryDirectory() as folder:
        shapes = _shapes(mi, bodies, Path(folder), _matter)
        smoke = {f"smoke {k}": _smoke(mi, t) for k, t in enumerate(things) if isinstance(t, Smoke)}
        watery = any(isinstance(t, Mesh) and t.matter == "liquid" for t in bodies)
        integrator = THROUGH_SMOKE if smoke else WATERY if watery else PATHS
        light = _render(mi, _studio(mi, camera, samples, integrator) | shapes | floors | smoke)
        glowing = _shapes(mi, bodies, Path(folder), _glowing)
        colors = _render(mi, _sight(mi, camera, samples, COLORS) | glowing)
    sky = background(camera.size)
    behind = 1 - light[..., 3:]
    shown, seen = light[..., :3] + behind * sky, colors[..., :3] + behind * sky
    if grounds:
        haze, paint, gone = _haze(grounds, camera)
        cover = colors[..., 3:]
        shown += (light[..., 3:] - cover) * haze
        seen += (light[..., 3:] - cover) * paint
        shown = np.where(gone & (cover == 0), sky, shown)
    return np.round(255 * display(soften(denoise(shown, seen)))).astype(np.uint8)


def denoise(light: Floats, colors: Floats) -> Floats:
    """The picture without noise. `colors` are those of what is seen, noisy, too, where edges run through pixels; both are
    height x width x 3."""
    import mitsuba_oidn as oidn

    height, width, _ = light.shape
    # The network sees black beyond the sides, and leaves dots there: it gets a mirror instead.
    beyond = [(MIRROR, MIRROR + -n % MIRROR) for n in (height, width)]
    image, albedo = (
        np.pad(np.asarray(x, dtype=np.float32), [*beyond, (0, 0)], mode="symmetric")
        for x in (light, np.clip(colors, 0.0, 1.0))
    )
    # The same processor for all pictures, whatever else there is: others round differently.
    clean = oidn.denoise(image, albedo, hdr=True, device=_processor())
    return np.asarray(clean[MIRROR:][:height, MIRROR:][:, :width], dtype=np.float64)


@functools.cache
def _processor() -> Any:
    import mitsuba_oidn as oidn

    return oidn.Device(oidn.DeviceType.CPU)


def _render(mi: Any, scene: dict[str, Any]) -> Floats:
    """Layers of a picture. The same samples see the same points of the picture, whatever the integrator."""
    return np.array(mi.render(mi.load_dict(scene), seed=0), dtype=np.float64)


def _sight(mi: Any, camera: Camera, samples: int, integrator: dict[str, Any]) -> dict[str, Any]:
    """Camera without lights."""
    place = mi.ScalarTransform4f
    to_world = place().look_at(
        origin=camera.position.tolist(), target=camera.target.tolist(), up=camera.axes[1].tolist()
    )
    sensor: dict[str, Any] = {"type": "perspective", "fov": camera.view_angle, "fov_axis": "x"}
    if camera.parallel:
        half = 0.5 * camera.width
        sensor = {"type": "orthographic"}
        to_world = to_world @ place().scale([half, half, 1.0])
    sensor |= {
        "to_world": to_world,
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "film": {
            "type": "hdrfilm",
            "width": camera.size[0],
            "height": camera.size[1],
            "pixel_format": "rgba",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter" if samples > 1 else "independent", "sample_count": samples},
    }
    return {"type": "scene", "integrator": integrator, "sensor": sensor}


def _studio(mi: Any, camera: Camera, samples: int, integrator: dict[str, Any]) -> dict[str, Any]:
    """Camera and lights."""
    place = mi.ScalarTransform4f
    light = key_light(camera)
    return _sight(mi, camera, samples, integrator) | {
        "surroundings": {
            "type": "envmap",
            "bitmap": mi.Bitmap(_surroundings(camera).astype(np.float32)),
            # The plugin's y axis is up.
            "to_world": place().rotate([1, 0, 0], 90),
        },
        "key": {
            "type": "disk",
            "to_world": place().look_at(origin=(KEY_DISTANCE * light).tolist(), target=[0, 0, 0], up=[0.1, 0.2, 1])
            @ place().scale([KEY_DISTANCE * KEY_SIZE, KEY_DISTANCE * KEY_SIZE, 1.0]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": KEY.tolist()}},
        },
    }


def _surroundings(camera: Camera) -> Floats:
    """Light from everywhere: bright above, darker below, and a broad glow from behind on the right; 64 x 128 x 3."""
    d, _ = _sphere()
    right, up, forward = camera.axes
    glow = np.clip(d @ unit(right + 0.55 * forward + 0.5 * up), 0, 1)[..., None] ** 6
    height = 0.5 + 0.5 * (d @ (up if camera.parallel else camera.zenith))[..., None]
    blue, warm = np.array([0.95, 1.0, 1.08]), np.array([1.0, 0.97, 0.92])
    return np.asarray((0.05 + 0.21 * height) * blue + 0.45 * glow * warm)


def _sphere() -> tuple[Floats, Floats]:
    """Directions of the pixels of the map of surroundings, and their solid angles."""
    rows, columns = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    polar, turn = np.pi * rows, 2 * np.pi * columns
    # The plugin's map, turned to z up.
    d = np.stack([np.sin(polar) * np.sin(turn), np.sin(polar) * np.cos(turn), np.cos(polar)], axis=-1)
    return d, np.sin(polar) * (np.pi / 64) * (2 * np.pi / 128)


def _seen(thing: Mesh, camera: Camera) -> Mesh:
    """A mesh as fine as its picture, without normals that contradict what is seen."""
    if not camera.parallel:  # Seen head-on, in a plane, cloth is a line.
        thing = finished(thing, camera.pixel)
    if not len(thing.triangles) or thing.matter == "liquid":
        return thing
    x, triangles, n = turned(thing.vertices, thing.triangles, thing.normals, camera.eye)
    return replace(thing, vertices=x, triangles=triangles, normals=n)


def _shapes(mi: Any, bodies: list[Body], folder: Path, look: Look) -> dict[str, Any]:
    shapes: dict[str, Any] = {}
    for k, thing in enumerate(bodies):
        found: dict[str, Any] = {}
        if isinstance(thing, Spheres):
            found = _spheres(mi, thing, look)
        elif isinstance(thing, Tubes):
            found = _tubes(thing, folder / f"{k}.txt", look)
        elif isinstance(thing, Hair):
            found = _hair(thing, folder / f"{k}", look)
        elif isinstance(thing, Mesh) and len(thing.triangles):
            surface = thing.vertices, thing.triangles, thing.normals
            found = {"": _mesh(mi, *surface, look(thing.color, thing.matter))}
        shapes |= {f"{k} {name}": shape for name, shape in found.items()}
    return shapes


def _smoke(mi: Any, thing: Smoke) -> dict[str, Any]:
    """A box without a surface, and in it what takes light away and scatters the same share of it everywhere."""
    n = np.array(thing.extinction.shape)
    place = mi.ScalarTransform4f().translate(thing.low.tolist()).scale((thing.spacing * n).tolist())
    # The plugin's order: z slowest.
    numbers = np.ascontiguousarray(np.transpose(thing.extinction, (2, 1, 0))[..., None], dtype=np.float32)
    grid = {"type": "gridvolume", "grid": mi.VolumeGrid(numbers), "to_world": place, "filter_type": "trilinear"}
    return {
        "type": "cube",
        "to_world": place @ mi.ScalarTransform4f().translate([0.5, 0.5, 0.5]).scale([0.5, 0.5, 0.5]),
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "sigma_t": grid,
            "albedo": {"type": "rgb", "value": np.clip(thing.color, 0.0, 0.999).tolist()},
            "scale": 1.0,
        },
    }


def _spheres(mi: Any, thing: Spheres, look: Look) -> dict[str, Any]:
    made = look(thing.color, "plain")
    if len(thing.centers) > MANY:
        return {"": _mesh(mi, *balls(thing.centers, thing.radii, 1), made)}
    pairs = zip(thing.centers.tolist(), thing.radii.tolist(), strict=True)
    return {f"{j}": {"type": "sphere", "center": c, "radius": r, **made} for j, (c, r) in enumerate(pairs)}


def _tubes(thing: Tubes, file: Path, look: Look) -> dict[str, Any]:
    starts = np.concatenate([[0], np.cumsum(thing.counts)])
    curves = [thing.points[a:b] for a, b in pairwise(starts.tolist()) if b - a > 1]
    if not curves:
        return {}
    rows = ("\n".join(f"{x:.9g} {y:.9g} {z:.9g} {thing.radius:.9g}" for x, y, z in c.tolist()) for c in curves)
    file.write_text("\n\n".join(rows) + "\n")
    made = look(thing.color, "plain")
    parts: dict[str, Any] = {"": {"type": "linearcurve", "filename": str(file), **made}}
    if len(curves) <= FEW:
        ends = [p for c in curves for p in (c[0].tolist(), c[-1].tolist())]
        for j, p in enumerate(ends):
            parts[f"{j}"] = {"type": "sphere", "center": p, "radius": thing.radius, **made}
    return parts


def _hair(thing: Hair, stem: Path, look: Look) -> dict[str, Any]:
    """Strands in a few shades, as curves."""
    parts: dict[str, Any] = {}
    for j, shade in enumerate(SHADES):
        curves = thing.curves[j :: len(SHADES)]
        if not len(curves):
            continue
        rows = np.concatenate([curves, np.broadcast_to(thing.radii[:, None], (*curves.shape[:2], 1))], axis=-1)
        line = "%.7g %.7g %.7g %.7g\n" * curves.shape[1] + "\n"
        file = stem.with_name(f"{stem.name}-{j}.txt")
        file.write_text("".join(line % tuple(strand) for strand in rows.reshape(len(rows), -1).tolist()))
        r, g, b = thing.color
        made = look((r * shade, g * shade, b * shade), "plain")
        parts[f"{j}"] = {"type": "linearcurve", "filename": str(file), **made}
    return parts


def _ground(mi: Any, thing: Ground, camera: Camera) -> dict[str, Any]:
    """A disc below the camera's target, large enough for its rim to have faded away."""
    foot = _foot(thing, camera)
    up = [0.0, 1.0, 0.0] if abs(thing.normal[2]) > 0.9 else [0.0, 0.0, 1.0]
    radius = 1.1 * FADE[1] * camera.width + float(np.linalg.norm(foot - camera.target))
    to_world = mi.ScalarTransform4f().look_at(origin=foot.tolist(), target=(foot + thing.normal).tolist(), up=up)
    return {
        "type": "disk",
        "to_world": to_world @ mi.ScalarTransform4f().scale([radius, radius, 1.0]),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(thing.color)}},
    }


def _foot(thing: Ground, camera: Camera) -> Floats:
    return camera.target - thing.normal * float((camera.target - thing.point) @ thing.normal)


def _haze(grounds: list[Ground], camera: Camera) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Light to add to the ground so that it fades into the background, its colours as it fades, and the mask where it has.

    Only the difference between the open ground and the background is added, so that no edge in front of it changes.
    """
    width, height = camera.size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width - 0.5, 0.5 - (np.arange(height) + 0.5) / height)
    right, up, forward = camera.axes
    rays = forward * camera.distance + (x[..., None] * right * camera.width + y[..., None] * up * camera.height)
    sky = background(camera.size)
    nearest = np.full((height, width), np.inf)
    haze, paint = np.zeros((height, width, 3)), sky.copy()
    fade = np.ones((height, width, 1))
    for ground in grounds:
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((ground.point - camera.position) @ ground.normal) / (rays @ ground.normal)
        hit = (depth > 0) & (depth < nearest)
        nearest[hit] = depth[hit]
        away = np.linalg.norm(camera.position + rays[hit] * depth[hit][:, None] - camera.target, axis=-1)
        fade[hit] = fading(away / camera.width)[:, None]
        haze[hit] = fade[hit] * (sky[hit] - _open_light(ground, camera))
        paint[hit] = fade[hit] * sky[hit] + (1 - fade[hit]) * np.array(ground.color)
    return haze, paint, fade > 0.9999


def _open_light(ground: Ground, camera: Camera) -> Floats:
    """Light that a ground sends back where nothing shades it."""
    directions, area = _sphere()
    facing = np.maximum(directions @ ground.normal, 0) * area
    around = np.einsum("ijc,ij->c", _surroundings(camera), facing)
    key = KEY * np.pi * KEY_SIZE**2 / (1 + KEY_SIZE**2) * max(float(key_light(camera) @ ground.normal), 0.0)
    return np.asarray(np.array(ground.color) * (around + key) / np.pi)


def _mesh(mi: Any, vertices: Floats, triangles: Indices, normals: Floats, look: dict[str, Any]) -> Any:
    props = mi.Properties()
    for name, part in look.items():
        props[name] = mi.load_dict(part) if isinstance(part, dict) else part
    mesh = mi.Mesh("mesh", len(vertices), len(triangles), has_vertex_normals=True, props=props)
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["vertex_normals"] = normals.astype(np.float32).ravel()
    values["faces"] = triangles.astype(np.uint32).ravel()
    values.update()
    return mesh


def _matter(color: Rgb, matter: Matter) -> dict[str, Any]:
    """What scatters light: one for all shapes of a thing."""
    import mitsuba as mi

    base = {"type": "rgb", "value": np.clip(color, 0.0, 0.95).tolist()}
    if matter == "liquid":
        # Light crosses the surface twice.
        through = {"type": "rgb", "value": np.sqrt(np.clip(color, 0.0, 1.0)).tolist()}
        return {"bsdf": mi.load_dict({"type": "dielectric", "int_ior": 1.33, "specular_transmittance": through})}
    if matter == "fabric":
        look = {"roughness": 0.85, "specular": 0.25, "sheen": 0.6, "sheen_tint": 0.6}
    else:
        look = {"roughness": 0.35, "specular": 0.5}
    bsdf = {"type": "principled", "base_color": base, **look}
    return {"bsdf": mi.load_dict({"type": "twosided", "bsdf": bsdf})}


def _glowing(color: Rgb, matter: Matter) -> dict[str, Any]:
    """What is seen in its colour without any light: one for each shape."""
    return {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": np.clip(color, 0.0, 1.0).tolist()}}}
