"""Command line of the USD reader, run by `hairbake import`.

Exit code: 0 if the file was read; 2 if it has errors, which the header then holds.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from . import exchange, groom, mesh, motion
from .errors import InputErrors
from .exchange import FloatArray


def times(text: str) -> mesh.Times:
    """Time codes from `START,STEP,COUNT`."""
    start, step, count = text.split(",")
    return mesh.Times(float(start), float(step), int(count))


def matrix(text: str) -> FloatArray:
    """A 4 × 4 matrix from 16 numbers, row by row."""
    rows: FloatArray = np.array([float(number) for number in text.split(",")]).reshape(4, 4)
    return rows


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(prog="hairbake_usd", description=__doc__)
    parser.add_argument("what", choices=["strands", "mesh", "motion"], help="what to read")
    parser.add_argument("file", help="USD file")
    parser.add_argument("--prim", help="path of the prim [default: all prims of the stage]")
    parser.add_argument(
        "--time", type=float, help="time code [default: the rest pose, else the first sample]"
    )
    parser.add_argument("--out", type=Path, required=True, help="existing folder for the result")
    parser.add_argument(
        "--times", type=times, metavar="START,STEP,COUNT", help="time codes of an animated mesh"
    )
    parser.add_argument("--carrier", help="path of the prim that may carry the mesh rigidly")
    parser.add_argument("--joint", help="path or name of the joint whose motion is read")
    parser.add_argument(
        "--world", action="store_true", help="the rest pose is that in the world of the stage"
    )
    parser.add_argument("--rest-stage", metavar="FILE", help="stage in which the head is at rest")
    parser.add_argument(
        "--from-world",
        type=matrix,
        metavar="M00,M01,...",
        help="matrix from world to the rest space of a mesh",
    )
    return parser


def main() -> int:
    """Reads the file and writes the result; returns the exit code."""
    options = argument_parser().parse_args()
    try:
        if options.what == "strands":
            header, arrays = groom.read(options.file, options.prim, options.time)
        elif options.what == "motion":
            header, arrays = motion.read(
                options.file, options.prim, options.joint, motion.Rest(options.world, options.rest_stage)
            )
        else:
            selection = mesh.Selection(
                options.prim, options.time, options.times, options.carrier, options.from_world
            )
            header, arrays = mesh.read(options.file, selection)
    except InputErrors as found:
        exchange.write_errors(options.out, found.errors)
        return 2
    exchange.write(options.out, header, arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main())
