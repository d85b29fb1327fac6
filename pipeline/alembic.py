"""Alembic by Blender's reader and writer: a groom to import, or a cache for what reads no USD. Needs a Python with `bpy` (PyPI), or Blender's own:

    python pipeline/alembic.py hair.abc -o hair.usda                 then: hairbake import groom hair.usda -o groom.json
    python pipeline/alembic.py cache/hair.usda -o hair.abc
    blender --background --python pipeline/alembic.py -- cache/hair.usda -o hair.abc

Points, counts and widths come through, and motion out. Ids, groups and velocities do not: Blender writes none.
"""

import argparse
import json
import sys
from pathlib import Path

import bpy

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, help="hair.usda of a cache, or an Alembic file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help=".abc of a cache, .usd, .usda or .usdc of an Alembic file",
    )
    parser.add_argument(
        "--frame", type=int, help="of an Alembic file, the frame that is the groom [default: its first]"
    )
    parser.add_argument(
        "--units",
        choices=UNITS,
        default="m",
        help="unit of an Alembic file, which does not tell [default: m]",
    )
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    suffixes = (options.source.suffix == ".abc", options.output.suffix == ".abc")
    if suffixes[0] == suffixes[1]:
        parser.error("one of the two files is to be Alembic (.abc), the other USD")
    if not options.source.is_file():
        parser.error(f"{options.source} is not there")

    bpy.ops.wm.read_factory_settings(use_empty=True)
    source, output = (str(path.absolute()) for path in (options.source, options.output))
    if suffixes[0]:
        bpy.ops.wm.alembic_import(
            filepath=source, scale=UNITS[options.units], set_frame_range=True, as_background_job=False
        )
        scene = bpy.context.scene
        if options.frame is not None and not scene.frame_start <= options.frame <= scene.frame_end:
            parser.error(f"--frame {options.frame}: the file has {scene.frame_start} to {scene.frame_end}")
        scene.frame_set(scene.frame_start if options.frame is None else options.frame)
        told = {"frame": scene.frame_current, "curves": select_curves(parser)}
        bpy.ops.wm.usd_export(
            filepath=output,
            selected_objects_only=True,
            export_materials=False,
            convert_orientation=True,
            export_global_up_selection="Y",
        )
    else:
        told = to_alembic(parser, options.source, source, output)
    print(json.dumps(told))


def to_alembic(parser: argparse.ArgumentParser, cache: Path, source: str, output: str) -> dict:
    """The render strands of a cache, or its guides where it has no others, in its own unit, Y up, at its frames."""
    try:
        summary = json.loads((cache.parent / "manifest.json").read_text(encoding="utf-8"))["summary"]
        fps, unit, strands = summary["fps"], summary["metres_per_unit"], sum(summary["hair"])
    except (OSError, ValueError, KeyError):
        parser.error(
            f"{cache.parent} is no finished cache: it has no manifest.json that tells frames and unit"
        )
    bpy.ops.wm.usd_import(filepath=source, set_frame_range=True, import_guide=not strands)
    scene = bpy.context.scene
    # A whole number, divided by another: 23.976 is 24 by 1.001.
    scene.render.fps, scene.render.fps_base = round(fps), round(fps) / fps
    told = {"frames": [scene.frame_start, scene.frame_end], "curves": select_curves(parser)}
    bpy.ops.wm.alembic_export(
        filepath=output, selected=True, flatten=True, global_scale=1 / unit, as_background_job=False
    )
    return told


def select_curves(parser: argparse.ArgumentParser) -> dict[str, int]:
    """Selects all curves and nothing else; their names, and how many are in each."""
    curves = {thing.name: thing for thing in bpy.context.scene.objects if thing.type == "CURVES"}
    if not curves:
        parser.error("there are no curves in the file")
    for thing in bpy.context.scene.objects:
        thing.select_set(thing.name in curves)
    return {name: len(thing.data.curves) for name, thing in curves.items()}


if __name__ == "__main__":
    main()
