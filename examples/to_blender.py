"""Makes curves of Blender from a frame of a cache, without USD, and saves them as a .blend file.

    python examples/to_blender.py out/cache 1012 -o hair.blend

Needs a Python with `bpy` (PyPI), or Blender's own with hairbake installed.
"""

import argparse
from pathlib import Path

import bpy
import numpy as np

import hairbake


def add_curves(cache: hairbake.Cache, frame: int) -> "bpy.types.Object":
    """Adds the render strands of a frame, or the guides if there are none, to the scene, in metres, Z up."""
    curves = cache.curves()
    points = curves.points(frame) * cache.metres_per_unit
    if cache.up_axis == "Y":
        points = points[:, [0, 2, 1]] * np.array([1, -1, 1])
    data = bpy.data.hair_curves.new(curves.name)
    data.add_curves(curves.counts.tolist())
    data.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(points, np.float32).ravel())
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", (0.5 * cache.metres_per_unit * curves.widths).astype(np.float32))
    made = bpy.data.objects.new(curves.name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def main() -> None:
    """Writes the file."""
    parser = argparse.ArgumentParser(description="Save a frame of a cache as a .blend file.")
    parser.add_argument("cache", type=Path)
    parser.add_argument("frame", type=int)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_curves(hairbake.open(options.cache), options.frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(options.output.resolve()))


if __name__ == "__main__":
    main()
