"""Command line of the USD reader, run by `hairbake import`.

Exit code: 0 if the file was read; 2 if it has errors, which the header then holds.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from . import exchange, goal, groom, mesh, motion, over
from .errors import InputErrors
from .exchange import FloatArray


def times(text: str) -> mesh.Times:
    """Time codes from `START,STEP,COUNT`."""
    start, step, count = text.split(",")
    return mesh.Times(float(start), float(step), int(count))


def moments(text: str) -> over.Moments:
    """Time codes from `FIRST,COUNT,OFFSET,...`."""
    first, count, *offsets = text.split(",")
    return over.Moments(int(first), int(count), [float(offset) for offset in offsets])


def matrix(text: str) -> FloatArray:
    """A 4 × 4 matrix from 16 numbers, row by row."""
    rows: FloatArray = np.array([float(number) for number in text.split(",")]).reshape(4, 4)
    return rows


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(prog="hairbake_usd", description=__doc__)
    parser.add_argument("what", choices=["strands", "mesh", "motion", "over", "goal"], help="what to read")
    parser.add_argument("file", help="USD file")
    parser.add_argument("--prim", help="path of the prim [default: all prims of the stage]")
    parser.add_argument("--prims", metavar="PATH,PATH,...", help="paths of several prims")
    parser.add_argument(
        "--time", type=float, help="time code [default: the rest pose, else the first sample]"
    )
    parser.add_argument("--out", type=Path, required=True, help="existing folder for the result")
    parser.add_argument(
        "--times", type=times, metavar="START,STEP,COUNT", help="time codes of an animated mesh, or of curves"
    )
    parser.add_argument(
        "--moments",
        type=moments,
        metavar="FIRST,COUNT,OFFSET,...",
        help="time codes at which curves are overridden",
    )
    parser.add_argument("--carrier", help="path of the prim that may carry the mesh rigidly")
    parser.add_argument("--joint", help="path or name of the joint whose motion is read")
    parser.add_argument(
        "--world", action="store_true", help="the rest pose is that in the world of the stage"
    )
    parser.add_argument("--rest-stage", metavar="FILE", help="stage in which the head is at rest")
    parser.add_argument("--groom-stage", metavar="FILE", help="stage of the groom that the motion carries")
    parser.add_argument("--groom-prims", metavar="PATH,PATH,...", help="paths of its curves")
    parser.add_argument(
        "--from-world",
        type=matrix,
        metavar="M00,M01,...",
        help="matrix from world to the rest space of a mesh",
    )
    parser.add_argument(
        "--fields",
        metavar="NAME,NAME,...",
        help="read texture coordinates and parts of a mesh, and these primvars",
    )
    return parser


def main() -> int:
    """Reads the file and writes the result; returns the exit code."""
    options = argument_parser().parse_args()
    layers: list[exchange.Header] = []
    try:
        if options.what == "strands":
            header, arrays = groom.read(options.file, options.prim, options.time)
        elif options.what == "over":
            paths = options.prims.split(",") if options.prims else [options.prim]
            header, arrays, layers = over.read(options.file, paths, options.time, options.moments)
        elif options.what == "goal":
            header, arrays = goal.read(options.file, options.prim, options.times)
        elif options.what == "motion":
            rest = motion.Rest(options.world, options.rest_stage)
            curves = options.groom_stage and motion.GroomCurves(
                options.groom_stage, options.groom_prims.split(",")
            )
            header, arrays = motion.read(options.file, options.prim, options.joint, rest, curves or None)
        else:
            fields = None if options.fields is None else [name for name in options.fields.split(",") if name]
            selection = mesh.Selection(
                options.prim, options.time, options.times, options.carrier, options.from_world, fields
            )
            header, arrays = mesh.read(options.file, selection)
    except InputErrors as found:
        exchange.write_errors(options.out, found.errors)
        return 2
    exchange.write(options.out, header, arrays, layers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
