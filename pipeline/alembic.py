"""Converts Alembic to USD and a cache to Alembic, with Blender's reader and writer.

    python pipeline/alembic.py hair.abc -o hair.usda     # then: hairbake import groom hair.usda -o groom.json
    python pipeline/alembic.py cache/hair.usda -o hair.abc
    blender --background --python pipeline/alembic.py -- cache/hair.usda -o hair.abc

It needs a Python with `bpy` (PyPI), or Blender's own. Points, counts and widths are kept, and a cache's
motion. Ids, groups and velocities are not: Blender does not write them.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import bpy

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}


def main() -> None:
    """Converts a file, and prints frames and numbers of curves as JSON."""
    parser = argument_parser()
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    from_alembic, to_alembic = options.source.suffix == ".abc", options.output.suffix == ".abc"
    if from_alembic == to_alembic:
        parser.error("one of the two files must be Alembic (.abc), the other USD")
    if not options.source.is_file():
        parser.error(f"{options.source}: no such file")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    convert = alembic_to_usd if from_alembic else cache_to_alembic
    print(json.dumps(convert(parser, options)))


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, help="hair.usda of a cache, or an Alembic file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help=".abc file for a cache; .usd, .usda or .usdc file for an Alembic file",
    )
    parser.add_argument(
        "--frame", type=int, help="frame of an Alembic file to convert [default: the first one]"
    )
    parser.add_argument(
        "--units", choices=UNITS, default="m", help="unit of an Alembic file, which has none [default: m]"
    )
    return parser


def alembic_to_usd(parser: argparse.ArgumentParser, options: argparse.Namespace) -> dict[str, Any]:
    """Writes one frame of the curves in an Alembic file as USD, Y up, in metres."""
    bpy.ops.wm.alembic_import(
        filepath=str(options.source.absolute()),
        scale=UNITS[options.units],
        set_frame_range=True,
        as_background_job=False,
    )
    scene = bpy.context.scene
    first, last = scene.frame_start, scene.frame_end
    if options.frame is not None and not first <= options.frame <= last:
        parser.error(f"--frame {options.frame} is not in the file; allowed: {first} to {last}")
    scene.frame_set(first if options.frame is None else options.frame)
    result = {"frame": scene.frame_current, "curves": select_curves(parser)}
    bpy.ops.wm.usd_export(
        filepath=str(options.output.absolute()),
        selected_objects_only=True,
        export_materials=False,
        convert_orientation=True,
        export_global_up_selection="Y",
    )
    return result


def cache_to_alembic(parser: argparse.ArgumentParser, options: argparse.Namespace) -> dict[str, Any]:
    """Writes the render strands of a cache, or its guides if it has none, in its unit, Y up."""
    folder = options.source.parent
    try:
        summary = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["summary"]
        fps, unit, strands = summary["fps"], summary["metres_per_unit"], sum(summary["hair"])
    except (OSError, ValueError, KeyError):
        parser.error(f"{folder} is no finished cache: it has no manifest.json with a summary")
    bpy.ops.wm.usd_import(
        filepath=str(options.source.absolute()), set_frame_range=True, import_guide=not strands
    )
    scene = bpy.context.scene
    # Blender's rate is an integer over a divisor: 23.976 is 24 over 1.001.
    scene.render.fps, scene.render.fps_base = round(fps), round(fps) / fps
    result = {"frames": [scene.frame_start, scene.frame_end], "curves": select_curves(parser)}
    bpy.ops.wm.alembic_export(
        filepath=str(options.output.absolute()),
        selected=True,
        flatten=True,
        global_scale=1 / unit,
        as_background_job=False,
    )
    return result


def select_curves(parser: argparse.ArgumentParser) -> dict[str, int]:
    """Selects all curves objects only, and returns the number of curves in each by name."""
    curves = {thing.name: thing for thing in bpy.context.scene.objects if thing.type == "CURVES"}
    if not curves:
        parser.error("the file holds no curves")
    for thing in bpy.context.scene.objects:
        thing.select_set(thing.name in curves)
    return {name: len(thing.data.curves) for name, thing in curves.items()}


if __name__ == "__main__":
    main()
