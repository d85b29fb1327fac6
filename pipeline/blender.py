"""Opens a hair cache in Blender, tells what came of it as JSON, and renders a frame. Needs a Python with `bpy` (PyPI), or Blender's own:

python pipeline/blender.py cache/hair.usda --frame 1012 -o frame.png
blender --background --python pipeline/blender.py -- cache/hair.usda --frame 1012 -o frame.png
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cache", help="hair.usda of a cache")
    parser.add_argument("--frame", type=int, help="frame to render [default: the middle one]")
    parser.add_argument("-o", "--output", help="picture to write, PNG or JPEG [default: none]")
    parser.add_argument("--size", type=int, default=640, help="pixels in width and height")
    parser.add_argument("--samples", type=int, default=32, help="light samples a pixel")
    parser.add_argument(
        "--azimuth",
        type=float,
        default=35,
        help="where the viewer stands, degrees from the front to the subject's left",
    )
    parser.add_argument(
        "--elevation", type=float, default=8, help="how high the viewer stands, degrees above the horizon"
    )
    parser.add_argument(
        "--shutter", type=float, default=0, help="motion blur over so many frames from the frame on"
    )
    parser.add_argument("--threads", type=int, default=0, help="threads that render [default: one a core]")
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


def hair_material() -> bpy.types.Material:
    """Hair in the colour that the cache gives it, as fibres, which reflect in a cone about themselves and let light through to each other: a plain surface
    is flat on them. Blender 5.0 gives curves none of the materials that USD binds them to.
    """
    material = bpy.data.materials.new("hair")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    fibre = nodes.new("ShaderNodeBsdfHairPrincipled")
    fibre.parametrization = "COLOR"
    for name, value in [("Roughness", 0.28), ("Radial Roughness", 0.45), ("Random Roughness", 0.3)]:
        fibre.inputs[name].default_value = value
    links.new(display_colour(nodes), fibre.inputs["Color"])
    links.new(fibre.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def body_material() -> bpy.types.Material:
    """Bodies in the colour that the cache gives them, without gloss."""
    material = bpy.data.materials.new("body")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = 0.65
    links.new(display_colour(nodes), surface.inputs["Base Color"])
    return material


def display_colour(nodes) -> bpy.types.NodeSocket:
    """`primvars:displayColor` in a shader."""
    attribute = nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "displayColor"
    return attribute.outputs["Color"]


def render(scene, hair: list, options) -> None:
    """All hair and bodies in the frame, under a key light, a fill, a light from behind and a dim sky, by Cycles on the processor."""
    places = []
    strands, body = hair_material(), body_material()
    for thing in scene.objects:
        if thing.type == "CURVES":
            thing.data.materials.clear()
            thing.data.materials.append(strands)
            thing.hide_render = "guides" in thing.name and len(hair) > 1
            places.append(points(thing, scene.frame_current))
        elif thing.type == "MESH":
            thing.data.materials.clear()
            thing.data.materials.append(body)
            thing.data.shade_smooth()
            places.append(np.array([thing.matrix_world @ Vector(corner) for corner in thing.bound_box]))
    places = np.concatenate(places)
    centre = Vector((places.min(axis=0) + places.max(axis=0)) / 2)
    reach = float(np.linalg.norm(places - centre, axis=1).max())

    def aim(thing, azimuth: float, elevation: float, distance: float) -> None:
        """Puts a camera or a light at angles, degrees from the front to the subject's left and up, and turns it to the subject's centre."""
        turn, rise = math.radians(azimuth), math.radians(elevation)
        way = Vector((math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)))
        thing.rotation_euler = (-way).to_track_quat("-Z", "Y").to_euler()
        thing.location = centre + way * distance
        scene.collection.objects.link(thing)

    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = math.radians(24)
    aim(camera, options.azimuth, options.elevation, 0)
    # As near as all of it fits: right, up and towards the viewer, as the camera sees it.
    seen = (places - np.array(centre)) @ np.array(camera.rotation_euler.to_matrix())
    seen[:, :2] -= (middle := (seen[:, :2].min(axis=0) + seen[:, :2].max(axis=0)) / 2)
    near = (seen[:, 2] + np.abs(seen[:, :2]).max(axis=1) / math.tan(camera.data.angle / 2)).max()
    camera.location += camera.rotation_euler.to_matrix() @ Vector((*middle, 1.04 * near))
    scene.camera = camera
    for azimuth, elevation, watts, colour in [
        (options.azimuth - 40, 45, 90, (1, 0.95, 0.88)),
        (options.azimuth + 60, 10, 20, (0.85, 0.92, 1)),
        (options.azimuth + 160, 40, 160, (1, 0.97, 0.92)),
    ]:
        light = bpy.data.lights.new("light", "AREA")
        light.energy, light.size, light.color = watts * reach * reach, reach, colour
        aim(bpy.data.objects.new("light", light), azimuth, elevation, 3.5 * reach)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.16, 0.175, 0.2, 1)
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = options.samples
    scene.cycles.use_denoising = True
    if options.shutter:
        # As the cache has it: it opens at the frame.
        scene.render.use_motion_blur = True
        scene.render.motion_blur_position, scene.render.motion_blur_shutter = "START", options.shutter
    if options.threads:
        scene.render.threads_mode, scene.render.threads = "FIXED", options.threads
    scene.render.resolution_x, scene.render.resolution_y = options.size, options.size
    # Blender takes a bare name for one of its own folders.
    scene.render.filepath = str(Path(options.output).absolute())
    scene.render.image_settings.file_format = "JPEG" if options.output.endswith((".jpg", ".jpeg")) else "PNG"
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
