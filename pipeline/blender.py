"""Opens a hair cache in Blender, tells what came of it as JSON, and renders a frame. Needs a Python with `bpy` (PyPI), or Blender's own:

    python pipeline/blender.py cache/hair.usda --frame 1012 -o frame.png
    blender --background --python pipeline/blender.py -- cache/hair.usda --frame 1012 -o frame.png
"""

import argparse
import json
import math
import sys

import bpy
import numpy as np
from mathutils import Vector


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cache", help="hair.usda of a cache")
    parser.add_argument("--frame", type=int, help="frame to render [default: the middle one]")
    parser.add_argument("-o", "--output", help="PNG to write [default: no picture]")
    parser.add_argument("--size", type=int, default=640, help="pixels in width")
    parser.add_argument("--samples", type=int, default=32, help="light samples a pixel")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=options.cache, set_frame_range=True, import_guide=True)
    scene = bpy.context.scene
    first, last = scene.frame_start, scene.frame_end
    hair = [thing for thing in scene.objects if thing.type == "CURVES"]
    told = {"frames": [first, last], "curves": {thing.name: describe(thing, first, last) for thing in hair}}
    if options.output:
        scene.frame_set(options.frame or (first + last) // 2)
        render(scene, hair, options)
    print(json.dumps(told))


def points(thing, frame: int) -> np.ndarray:
    """World places of all points at a frame."""
    bpy.context.scene.frame_set(frame)
    curves = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(curves.points), np.float32)
    curves.attributes["position"].data.foreach_get("vector", flat)
    matrix = np.array(thing.matrix_world)
    return flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def describe(thing, first: int, last: int) -> dict:
    """Counts, widths (m, at root and tip of the first curve) and motion (mean and largest way of a point from the first frame to the last, m)."""
    at_first = points(thing, first)
    # What is evaluated is gone with the next change of frame.
    curves = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    radius = np.empty(len(curves.points), np.float32)
    curves.attributes["radius"].data.foreach_get("value", radius)
    count, size = len(curves.curves), curves.curves[0].points_length
    # Blender keeps the file's unit and scales the object.
    widths = 2 * radius * thing.matrix_world.median_scale
    way = np.linalg.norm(points(thing, last) - at_first, axis=1)
    return {
        "curves": count,
        "points": len(radius),
        "widths": [float(widths[0]), float(widths[size - 1])],
        "first_root": at_first[0].tolist(),
        "way": [float(way.mean()), float(way.max())],
    }


def render(scene, hair: list, options) -> None:
    """A three-quarter view with a key light, a fill and a sky, by Cycles on the processor."""
    low, high = np.inf, -np.inf
    for thing in hair:
        places = points(thing, scene.frame_current)
        low, high = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
    centre, reach = Vector((low + high) / 2), float(np.linalg.norm(high - low))
    strands = bpy.data.materials.new("hair")
    strands.use_nodes = True
    strands.node_tree.nodes.clear()
    shader = strands.node_tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    out = strands.node_tree.nodes.new("ShaderNodeOutputMaterial")
    strands.node_tree.links.new(shader.outputs[0], out.inputs["Surface"])
    for thing in scene.objects:
        if thing.type == "CURVES":
            thing.data.materials.clear()
            thing.data.materials.append(strands)
            thing.hide_render = "guides" in thing.name
        elif thing.type == "MESH":
            thing.hide_render = False

    def aim(thing, direction: tuple, distance: float) -> None:
        thing.location = centre + Vector(direction).normalized() * distance * reach
        thing.rotation_euler = (centre - thing.location).to_track_quat("-Z", "Y").to_euler()
        scene.collection.objects.link(thing)

    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 60
    aim(camera, (0.7, -1.0, 0.25), 1.5)
    scene.camera = camera
    for direction, strength in [((0.4, -1, 1.2), 60.0), ((-1, -0.4, 0.3), 20.0), ((0.2, 1, 0.8), 40.0)]:
        light = bpy.data.lights.new("light", "AREA")
        light.energy, light.size = strength * reach * reach, reach
        aim(bpy.data.objects.new("light", light), direction, 2.0)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.color = (0.05, 0.055, 0.065)
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = options.samples
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = options.size, math.ceil(0.75 * options.size)
    scene.render.filepath = options.output
    scene.render.image_settings.file_format = "PNG"
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
