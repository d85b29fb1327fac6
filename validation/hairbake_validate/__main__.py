"""Command line: `python -m hairbake_validate OUT_DIR`."""

import argparse
import json
import os
import re
import sys
from pathlib import Path

from .cache import Unreadable
from .run import CHECKS, PARTS, validate


def frame_list(text: str) -> set[int]:
    """One frame, `A-B` with both ends, every fifth of them `A-Bx5` or `A-B:5`, and lists of these with commas."""
    frames = set()
    for part in text.split(","):
        match = re.fullmatch(r"(-?\d+)(?:-(-?\d+)(?:[x:]0*([1-9]\d*))?)?", part.strip())
        if not match:
            raise argparse.ArgumentTypeError(
                f"{part!r} is no frame or range of frames such as 1001-1010 or 1001-1100x5"
            )
        first = int(match[1])
        frames.update(range(first, int(match[2] or first) + 1, int(match[3] or 1)))
    return frames


def list_checks() -> str:
    """Every check with its tolerance."""
    lines = []
    for check in CHECKS:
        tolerance = f"{check.tolerance:g} {check.unit}" if check.tolerance else ""
        lines.append(f"{check.id:<18} {check.severity.value:<8} {tolerance:<20} {check.description}")
    return "\n".join(lines)


def main() -> int:
    """Runs the checks; 0 passed, 1 failed, 2 wrong usage or no readable cache."""
    parser = argparse.ArgumentParser(prog="hairbake_validate", description="Checks a hair cache.")
    parser.add_argument("directory", type=Path, nargs="?", help="folder of the cache")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the report as JSON")
    parser.add_argument(
        "--frames", type=frame_list, metavar="LIST", help="look at the curves of these frames only"
    )
    parser.add_argument(
        "--only", choices=PARTS, help="check what does not move, or the curves of frames, and nothing else"
    )
    parser.add_argument(
        "--quick", action="store_true", help="look at the curves of a few frames, and at no checksum"
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one for each core)",
    )
    parser.add_argument("--list", action="store_true", help="print the checks and their tolerances, and stop")
    arguments = parser.parse_args()
    if arguments.list:
        print(list_checks())
        return 0
    if arguments.directory is None:
        parser.error("the folder of a cache is needed")
    if arguments.jobs < 1:
        parser.error("--jobs must be at least 1")
    try:
        report = validate(
            arguments.directory, arguments.frames, arguments.quick, arguments.jobs, arguments.only
        )
        if arguments.json:
            arguments.json.write_text(json.dumps(report.as_json(), indent=2) + "\n", encoding="utf-8")
    except (Unreadable, OSError) as error:
        print(f"hairbake_validate: {error}", file=sys.stderr)
        return 2
    print(report.as_text())
    return 0 if report.passed else 1


if __name__ == "__main__":
    sys.exit(main())
