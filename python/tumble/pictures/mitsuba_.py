"""Pictures by path tracing (Mitsuba 3, `scalar_rgb`): soft key light, bright surroundings, cloth with a sheen.

Three renders make a picture: the light itself; what covers the ground, by the same samples, so that the ground can
be faded into the background without touching the edges in front of it; and normals and places, which guide `denoise`
in taking out the noise of few samples per pixel.
"""

import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.pictures.denoise import denoise
from tumble.pictures.drawn import Body, Ground, Mesh, Smoke, Spheres, Thing, Tubes, as_triangles
from tumble.pictures.framing import Camera
from tumble.pictures.look import FADE, background, fading, key_light, soften
from tumble.pictures.strands import Hair
from tumble.pictures.surfaces import Floats, Indices, balls, joined, turned, unit
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

PATHS = {"type": "path", "max_depth": 5, "hide_emitters": True}
THROUGH_SMOKE = {"type": "volpath", "max_depth": 24, "rr_depth": 12, "hide_emitters": True}
COVER = {"type": "depth"}
GUIDES = {"type": "aov", "aovs": "normal:sh_normal,place:position"}

Picture = npt.NDArray[np.uint8]


def draw(things: list[Thing], camera: Camera, samples: int) -> Picture:
    """The picture, height x width x 3. Target at the origin, camera at distance 1."""
    import mitsuba as mi

    if mi.variant() != "scalar_rgb":
        mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    grounds = [t for t in things if isinstance(t, Ground)]
    floors = {f"ground {k}": _ground(mi, t, camera) for k, t in enumerate(grounds)}
    bodies = [t for t in things if isinstance(t, Body)]
    with tempfile.TemporaryDirectory() as folder:
        shapes = _shapes(mi, bodies, camera, Path(folder))
        smoke = {f"smoke {k}": _smoke(mi, t) for k, t in enumerate(things) if isinstance(t, Smoke)}
        light = _render(mi, camera, samples, THROUGH_SMOKE if smoke else PATHS, shapes | floors | smoke)
        cover = _render(mi, camera, samples, COVER, shapes)[..., 3:] if grounds else None
    guides = _render(mi, camera, 1, GUIDES, _proxies(mi, bodies) | floors)
    shown = light[..., :3] + (1 - light[..., 3:]) * background(camera.size)
    if cover is not None:
        haze, gone = _haze(grounds, camera)
        shown += (light[..., 3:] - cover) * haze
        shown = np.where(gone & (cover == 0), background(camera.size), shown)
    shown = denoise(shown, unit(guides[..., -6:-3]), guides[..., -3:], camera.pixel)
    return np.round(255 * display(soften(shown))).astype(np.uint8)


def _render(mi: Any, camera: Camera, samples: int, integrator: dict[str, Any], shapes: dict[str, Any]) -> Floats:
    """Layers of a picture. The same samples see the same points of the picture, whatever the integrator."""
    scene = mi.load_dict(_studio(mi, camera, samples, integrator) | shapes)
    return np.array(mi.render(scene, seed=0), dtype=np.float64)


def _studio(mi: Any, camera: Camera, samples: int, integrator: dict[str, Any]) -> dict[str, Any]:
    """Camera and lights."""
    place = mi.ScalarTransform4f
    light = key_light(camera)
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
    return {
        "type": "scene",
        "integrator": integrator,
        "sensor": sensor,
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
    height = 0.5 + 0.5 * (d @ (up if camera.parallel else camera.up))[..., None]
    blue, warm = np.array([0.95, 1.0, 1.08]), np.array([1.0, 0.97, 0.92])
    return np.asarray((0.05 + 0.21 * height) * blue + 0.45 * glow * warm)


def _sphere() -> tuple[Floats, Floats]:
    """Directions of the pixels of the map of surroundings, and their solid angles."""
    rows, columns = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    polar, turn = np.pi * rows, 2 * np.pi * columns
    # The plugin's map, turned to z up.
    d = np.stack([np.sin(polar) * np.sin(turn), np.sin(polar) * np.cos(turn), np.cos(polar)], axis=-1)
    return d, np.sin(polar) * (np.pi / 64) * (2 * np.pi / 128)


def _shapes(mi: Any, bodies: list[Body], camera: Camera, folder: Path) -> dict[str, Any]:
    shapes: dict[str, Any] = {}
    for k, thing in enumerate(bodies):
        found: dict[str, Any] = {}
        if isinstance(thing, Spheres):
            found = _spheres(mi, thing)
        elif isinstance(thing, Tubes):
            found = _tubes(mi, thing, folder / f"{k}.txt")
        elif isinstance(thing, Hair):
            found = _hair(mi, thing, folder / f"{k}")
        elif isinstance(thing, Mesh) and len(thing.triangles):
            look = mi.load_dict(_bsdf(thing.color, thing.fabric))
            found = {"": _mesh(mi, *turned(thing.vertices, thing.triangles, thing.normals, camera.eye), look)}
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


def _proxies(mi: Any, bodies: list[Body]) -> dict[str, Any]:
    """The same shapes as one mesh: the integrator for guides slows down with the number of shapes."""
    vertices, triangles, normals = joined([as_triangles(t) for t in bodies])
    if not len(triangles):
        return {}
    return {"bodies": _mesh(mi, vertices, triangles, normals, mi.load_dict({"type": "diffuse"}))}


def _spheres(mi: Any, thing: Spheres) -> dict[str, Any]:
    look = mi.load_dict(_bsdf(thing.color, False))
    if len(thing.centers) > MANY:
        return {"": _mesh(mi, *balls(thing.centers, thing.radii, 1), look)}
    pairs = zip(thing.centers.tolist(), thing.radii.tolist(), strict=True)
    return {f"{j}": {"type": "sphere", "center": c, "radius": r, "bsdf": look} for j, (c, r) in enumerate(pairs)}


def _tubes(mi: Any, thing: Tubes, file: Path) -> dict[str, Any]:
    starts = np.concatenate([[0], np.cumsum(thing.counts)])
    curves = [thing.points[a:b] for a, b in pairwise(starts.tolist()) if b - a > 1]
    if not curves:
        return {}
    rows = ("\n".join(f"{x:.9g} {y:.9g} {z:.9g} {thing.radius:.9g}" for x, y, z in c.tolist()) for c in curves)
    file.write_text("\n\n".join(rows) + "\n")
    look = mi.load_dict(_bsdf(thing.color, False))
    parts: dict[str, Any] = {"": {"type": "linearcurve", "filename": str(file), "bsdf": look}}
    if len(curves) <= FEW:
        ends = [p for c in curves for p in (c[0].tolist(), c[-1].tolist())]
        for j, p in enumerate(ends):
            parts[f"{j}"] = {"type": "sphere", "center": p, "radius": thing.radius, "bsdf": look}
    return parts


def _hair(mi: Any, thing: Hair, stem: Path) -> dict[str, Any]:
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
        look = mi.load_dict(_bsdf((r * shade, g * shade, b * shade), False))
        parts[f"{j}"] = {"type": "linearcurve", "filename": str(file), "bsdf": look}
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


def _haze(grounds: list[Ground], camera: Camera) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Light to add to the ground so that it fades into the background, and the mask where it has.

    Only the difference between the open ground and the background is added, so that no edge in front of it changes.
    """
    width, height = camera.size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width - 0.5, 0.5 - (np.arange(height) + 0.5) / height)
    right, up, forward = camera.axes
    rays = forward * camera.distance + (x[..., None] * right * camera.width + y[..., None] * up * camera.height)
    nearest = np.full((height, width), np.inf)
    haze = np.zeros((height, width, 3))
    fade = np.ones((height, width, 1))
    for ground in grounds:
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((ground.point - camera.position) @ ground.normal) / (rays @ ground.normal)
        hit = (depth > 0) & (depth < nearest)
        nearest[hit] = depth[hit]
        away = np.linalg.norm(camera.position + rays[hit] * depth[hit][:, None] - camera.target, axis=-1)
        gap = background(camera.size)[hit] - _open_light(ground, camera)
        fade[hit] = fading(away / camera.width)[:, None]
        haze[hit] = fade[hit] * gap
    return haze, fade > 0.9999


def _open_light(ground: Ground, camera: Camera) -> Floats:
    """Light that a ground sends back where nothing shades it."""
    directions, area = _sphere()
    facing = np.maximum(directions @ ground.normal, 0) * area
    around = np.einsum("ijc,ij->c", _surroundings(camera), facing)
    key = KEY * np.pi * KEY_SIZE**2 / (1 + KEY_SIZE**2) * max(float(key_light(camera) @ ground.normal), 0.0)
    return np.asarray(np.array(ground.color) * (around + key) / np.pi)


def _mesh(mi: Any, vertices: Floats, triangles: Indices, normals: Floats, look: Any) -> Any:
    props = mi.Properties()
    props["bsdf"] = look
    mesh = mi.Mesh("mesh", len(vertices), len(triangles), has_vertex_normals=True, props=props)
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["vertex_normals"] = normals.astype(np.float32).ravel()
    values["faces"] = triangles.astype(np.uint32).ravel()
    values.update()
    return mesh


def _bsdf(color: Rgb, fabric: bool) -> dict[str, Any]:
    base = {"type": "rgb", "value": np.clip(color, 0.0, 0.95).tolist()}
    if fabric:
        look = {"roughness": 0.85, "specular": 0.25, "sheen": 0.6, "sheen_tint": 0.6}
    else:
        look = {"roughness": 0.35, "specular": 0.5}
    return {"type": "twosided", "bsdf": {"type": "principled", "base_color": base, **look}}
