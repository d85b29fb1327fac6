"""The command line: what to read, from where, and the folder for what was read.

Exit code 0: read; 2: the file is faulty, and the header tells how.
"""

import argparse
import sys
from pathlib import Path

from . import exchange, groom, mesh, motion
from .faults import Faults


def times(text: str) -> mesh.Times:
    start, step, count = text.split(",")
    return mesh.Times(float(start), float(step), int(count))


def main() -> int:
    parser = argparse.ArgumentParser(prog="hairbake_usd", description=__doc__)
    parser.add_argument("what", choices=["strands", "mesh", "motion"])
    parser.add_argument("file")
    parser.add_argument("--prim", help="path of the prim; default: all of the stage")
    parser.add_argument("--time", type=float, help="time code; default: the rest pose, else the earliest")
    parser.add_argument("--out", type=Path, required=True, help="folder that is there")
    parser.add_argument(
        "--times",
        type=times,
        metavar="START,STEP,COUNT",
        help="time codes at which a mesh that moves is read too",
    )
    parser.add_argument("--carrier", help="path of the prim that a mesh may go along with")
    parser.add_argument("--joint", help="joint of a skeleton, by path or name, whose motion is read")
    options = parser.parse_args()
    try:
        if options.what == "strands":
            header, arrays = groom.read(options.file, options.prim, options.time)
        elif options.what == "motion":
            header, arrays = motion.read(options.file, options.prim, options.joint)
        else:
            header, arrays = mesh.read(
                options.file, options.prim, options.time, options.times, options.carrier
            )
    except Faults as found:
        exchange.write_faults(options.out, found.faults)
        return 2
    exchange.write(options.out, header, arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main())
