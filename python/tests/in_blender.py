"""Runs in a Python that has bpy: imports stages by their scripts and prints what Blender then holds, as JSON."""

import json
import runpy
import sys
from pathlib import Path

import bpy


def held(folder, frames):
    """What a scene holds after the import, and at some frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    runpy.run_path(str(Path(folder) / "blender.py"), run_name="script")
    scene = bpy.context.scene
    back = next(n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    found = {
        "fps": scene.render.fps / scene.render.fps_base,
        "frames": [scene.frame_start, scene.frame_end],
        "resolution": [scene.render.resolution_x, scene.render.resolution_y],
        "camera": scene.camera.name,
        "blur": scene.camera.data.dof.use_dof,
        "world": [*list(back.inputs["Color"].default_value)[:3], back.inputs["Strength"].default_value],
        "materials": {o.name: materials(o) for o in bpy.data.objects if o.type in KINDS},
        "volumes": {
            o.name: [o.data.velocity_unit, o.data.velocity_grid] for o in bpy.data.objects if o.type == "VOLUME"
        },
        "at": {},
    }
    for frame in frames:
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        found["at"][frame] = {o.name: data(o.evaluated_get(graph)) for o in bpy.data.objects if o.type in KINDS}
    return found


KINDS = ("MESH", "CURVES", "POINTCLOUD", "VOLUME")


def materials(thing):
    """Of each the type of its nodes, the linked inputs of its shader, and the numbers of its factors."""
    made = []
    for material in thing.data.materials:
        nodes = material.node_tree.nodes
        shader = next(n for n in nodes if "Principled" in n.bl_idname)
        made.append(
            {
                "name": material.name,
                "linked": [i.name for i in shader.inputs if i.is_linked],
                "color": [*shader.inputs[0].default_value][:3],
                "glow": shader.inputs["Emission Strength"].default_value,
                "factors": [n.inputs[1].default_value for n in nodes if getattr(n, "operation", "") == "MULTIPLY"],
            }
        )
    return made


def data(thing):
    if thing.type == "VOLUME":
        thing.data.grids.load()
        return {"file": Path(thing.data.grids.frame_filepath).name, "grids": [g.name for g in thing.data.grids]}
    found = {"hidden": thing.hide_render, "place": list(thing.matrix_world.translation)}
    for attribute in thing.data.attributes:
        if attribute.name in ("position", "velocity"):
            found[attribute.name] = [list(item.vector) for item in attribute.data]
        if attribute.name == "id":
            found["id"] = [item.value for item in attribute.data]
    if thing.type == "MESH":
        found["sides"] = sorted({len(p.vertices) for p in thing.data.polygons})
        found["textures"] = [layer.name for layer in thing.data.uv_layers]
    return found


def drawn(frame):
    """A small picture: mean light of its whole and of its middle."""
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 8
    scene.cycles.use_denoising = False
    scene.view_settings.view_transform = "Standard"
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.resolution_x, scene.render.resolution_y = 24, 14
    file = Path(sys.argv[1]) / "drawn.png"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(file))
    pixels = list(image.pixels)
    lights = [sum(c**2.2 for c in pixels[4 * k : 4 * k + 3]) / 3 for k in range(24 * 14)]  # from sRGB
    middle = [lights[24 * j + i] for j in range(5, 9) for i in range(10, 14)]
    bpy.data.images.remove(image)
    return [sum(lights) / len(lights), sum(middle) / len(middle)]


everything = {}
for folder, frames, pictures in json.loads(sys.argv[2]):
    everything[folder] = held(Path(sys.argv[1]) / folder, frames)
    everything[folder]["drawn"] = {frame: drawn(frame) for frame in pictures}
(Path(sys.argv[1]) / "held.json").write_text(json.dumps(everything))
