"""Opens a hair cache in Blender, prints its curves as JSON, and renders a frame.

    python pipeline/blender.py cache/hair.usda --frame 1012 -o frame.png
    blender --background --python pipeline/blender.py -- cache/hair.usda --frame 1012 -o frame.png

It needs a Python with `bpy` (PyPI), or Blender's own.
"""

import argparse
import json
import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

CURVES = ("hair", "guides")
"""Prims of a cache with curves."""

ROOT_METADATA = (
    r"^    (?:defaultPrim|metersPerUnit|upAxis|timeCodesPerSecond|framesPerSecond|startTimeCode|endTimeCode)"
    r" = .*$"
)
"""What a root layer has to repeat of a cache's."""

MARGIN = 0.3
"""Width of the space around the hair in which bodies are kept in the picture, over the hair's diagonal."""

Points = NDArray[np.floating[Any]]


def main() -> None:
    """Opens the cache, prints its curves, and renders if asked to."""
    options = parse_options()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with TemporaryDirectory() as folder:
        layer = without_strings(Path(options.cache), Path(folder))
        bpy.ops.wm.usd_import(filepath=str(layer), set_frame_range=True, import_guide=True)
        report(options)


def report(options: argparse.Namespace) -> None:
    """Prints the curves of the scene, and renders if asked to."""
    scene = bpy.context.scene
    first, last = scene.frame_start, scene.frame_end
    hair = [thing for thing in scene.objects if thing.type == "CURVES"]
    curves = {thing.name: describe(thing, first, last) for thing in hair}
    if options.output:
        scene.frame_set(options.frame or (first + last) // 2)
        render(scene, options)
    print(json.dumps({"frames": [first, last], "curves": curves}))


def without_strings(cache: Path, folder: Path) -> Path:
    """Writes a layer over a cache without its primvars of strings, of which Blender warns at every frame."""
    metadata = re.findall(ROOT_METADATA, cache.read_text(), re.MULTILINE)
    block = "    {\n        string[] primvars:groom_group_name = None\n    }"
    blocked = [f'    over "{name}"\n{block}' for name in CURVES]
    head = ["#usda 1.0", "(", *metadata, f"    subLayers = [@{cache.absolute()}@]", ")"]
    layer = folder / "cache.usda"
    layer.write_text("\n".join([*head, 'over "groom"', "{", *blocked, "}", ""]))
    return layer


def parse_options() -> argparse.Namespace:
    """The options; those after `--` if Blender runs the script."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("cache", help="hair.usda of a cache")
    add("--frame", type=int, help="frame to render [default: the middle one]")
    add("-o", "--output", help="picture to write, PNG or JPEG [default: none]")
    add("--size", type=int, default=640, help="width and height in pixels [default: 640]")
    add("--samples", type=int, default=32, help="light samples per pixel [default: 32]")
    add(
        "--azimuth",
        type=float,
        default=35,
        help="direction of the viewer, degrees from the front to the subject's left [default: 35]",
    )
    add(
        "--elevation",
        type=float,
        default=8,
        help="direction of the viewer, degrees above the horizon [default: 8]",
    )
    add("--shutter", type=float, default=0, help="frames of motion blur, from the frame on [default: 0]")
    add("--threads", type=int, default=0, help="render threads [default: one for each core]")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)


def evaluated_curves(thing: bpy.types.Object) -> bpy.types.Curves:
    """The evaluated curves of an object, valid until the frame changes."""
    return thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def world_points(thing: bpy.types.Object, frame: int) -> Points:
    """World positions of all points of an object at a frame, m, `N × 3`."""
    bpy.context.scene.frame_set(frame)
    curves = evaluated_curves(thing)
    flat = np.empty(3 * len(curves.points), np.float32)
    curves.attributes["position"].data.foreach_get("vector", flat)
    matrix = np.array(thing.matrix_world)
    points: Points = flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    return points


def mesh_points(thing: bpy.types.Object) -> Points:
    """World positions of the vertices of a mesh at the current frame, m, `N × 3`."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    matrix = np.array(thing.matrix_world)
    points: Points = flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    return points


def describe(thing: bpy.types.Object, first: int, last: int) -> dict[str, Any]:
    """Counts, widths and motion of curves.

    `widths` are those at root and tip of the first curve, m; `way` is the mean and the largest displacement
    of points from the first frame to the last, m.
    """
    at_first = world_points(thing, first)
    curves = evaluated_curves(thing)
    radius = np.empty(len(curves.points), np.float32)
    curves.attributes["radius"].data.foreach_get("value", radius)
    count, size = len(curves.curves), curves.curves[0].points_length
    # Blender keeps the unit of the file and scales the object.
    widths = 2 * radius * thing.matrix_world.median_scale
    displacement = np.linalg.norm(world_points(thing, last) - at_first, axis=1)
    return {
        "curves": count,
        "points": len(radius),
        "widths": [float(widths[0]), float(widths[size - 1])],
        "first_root": at_first[0].tolist(),
        "way": [float(displacement.mean()), float(displacement.max())],
    }


def hair_material() -> bpy.types.Material:
    """Hair fibres in the display colour of the cache.

    Blender 5.0 ignores the materials that USD binds to curves. A surface material shades fibres as if they
    were flat.
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
    """A matte surface in the display colour of the cache."""
    material = bpy.data.materials.new("body")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = 0.65
    links.new(display_colour(nodes), surface.inputs["Base Color"])
    return material


def display_colour(nodes: bpy.types.Nodes) -> bpy.types.NodeSocket:
    """A shader output with `primvars:displayColor`."""
    attribute = nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "displayColor"
    return attribute.outputs["Color"]


@dataclass(frozen=True)
class Subject:
    """The points in the picture."""

    points: Points
    centre: Vector
    radius: float
    """Largest distance of a point from the centre, m."""

    @classmethod
    def of(cls, scene: bpy.types.Scene) -> "Subject":
        """The hair at the current frame, and what there is of bodies around it."""
        things = [thing for thing in scene.objects if thing.type == "CURVES"]
        hair = np.concatenate([world_points(thing, scene.frame_current) for thing in things])
        low, high = hair.min(axis=0), hair.max(axis=0)
        margin = MARGIN * np.linalg.norm(high - low)
        parts = [hair]
        for thing in scene.objects:
            if thing.type == "MESH":
                vertices = mesh_points(thing)
                near = (vertices > low - margin) & (vertices < high + margin)
                parts.append(vertices[near.all(axis=1)])
        points = np.concatenate(parts)
        centre = Vector((points.min(axis=0) + points.max(axis=0)) / 2)
        return cls(points, centre, float(np.linalg.norm(points - centre, axis=1).max()))


def place(
    scene: bpy.types.Scene,
    thing: bpy.types.Object,
    centre: Vector,
    direction: tuple[float, float],
    distance: float,
) -> None:
    """Adds a camera or light at `distance` from the centre, turned towards it.

    `direction` is azimuth and elevation in degrees, from the front to the subject's left and up.
    """
    turn, rise = (math.radians(angle) for angle in direction)
    outwards = Vector((math.sin(turn) * math.cos(rise), -math.cos(turn) * math.cos(rise), math.sin(rise)))
    thing.rotation_euler = (-outwards).to_track_quat("-Z", "Y").to_euler()
    thing.location = centre + outwards * distance
    scene.collection.objects.link(thing)


def add_materials(scene: bpy.types.Scene) -> None:
    """Assigns materials, and hides guides if there are strands."""
    strands, body = hair_material(), body_material()
    several = sum(thing.type == "CURVES" for thing in scene.objects) > 1
    for thing in scene.objects:
        if thing.type in ("CURVES", "MESH"):
            thing.data.materials.clear()
            thing.data.materials.append(strands if thing.type == "CURVES" else body)
        if thing.type == "CURVES":
            thing.hide_render = "guides" in thing.name and several
        elif thing.type == "MESH":
            thing.data.shade_smooth()


def add_camera(scene: bpy.types.Scene, subject: Subject, direction: tuple[float, float]) -> None:
    """Adds a camera as near as the whole subject fits in the picture."""
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = math.radians(24)
    place(scene, camera, subject.centre, direction, 0)
    # In the axes of the camera: right, up, towards the viewer.
    seen = (subject.points - np.array(subject.centre)) @ np.array(camera.rotation_euler.to_matrix())
    middle = (seen[:, :2].min(axis=0) + seen[:, :2].max(axis=0)) / 2
    seen[:, :2] -= middle
    near = (seen[:, 2] + np.abs(seen[:, :2]).max(axis=1) / math.tan(camera.data.angle / 2)).max()
    camera.location += camera.rotation_euler.to_matrix() @ Vector((*middle, 1.04 * near))
    scene.camera = camera


def add_lights(scene: bpy.types.Scene, subject: Subject, azimuth: float) -> None:
    """Adds a key light, a fill light, a light from behind, and a dim sky."""
    for direction, watts, colour in [
        ((azimuth - 40, 45), 90, (1, 0.95, 0.88)),
        ((azimuth + 60, 10), 20, (0.85, 0.92, 1)),
        ((azimuth + 160, 40), 160, (1, 0.97, 0.92)),
    ]:
        light = bpy.data.lights.new("light", "AREA")
        light.energy, light.size, light.color = watts * subject.radius**2, subject.radius, colour
        thing = bpy.data.objects.new("light", light)
        place(scene, thing, subject.centre, direction, 3.5 * subject.radius)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.16, 0.175, 0.2, 1)


def render(scene: bpy.types.Scene, options: argparse.Namespace) -> None:
    """Renders hair and bodies with Cycles on the CPU."""
    add_materials(scene)
    subject = Subject.of(scene)
    add_camera(scene, subject, (options.azimuth, options.elevation))
    add_lights(scene, subject, options.azimuth)
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = options.samples
    scene.cycles.use_denoising = True
    if options.shutter:
        # The shutter opens at the frame, as in the cache.
        scene.render.use_motion_blur = True
        scene.render.motion_blur_position, scene.render.motion_blur_shutter = "START", options.shutter
    if options.threads:
        scene.render.threads_mode, scene.render.threads = "FIXED", options.threads
    scene.render.resolution_x, scene.render.resolution_y = options.size, options.size
    # Blender resolves a relative name against a folder of its own.
    scene.render.filepath = str(Path(options.output).absolute())
    scene.render.image_settings.file_format = "JPEG" if options.output.endswith((".jpg", ".jpeg")) else "PNG"
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
