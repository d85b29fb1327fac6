"""Command line: `python -m hairbake_validate OUT_DIR`."""

import argparse
import json
import os
import re
import sys
from pathlib import Path

from .cache import CacheError
from .run import CHECKS, PARTS, validate


def frame_list(text: str) -> set[int]:
    """Frames of a comma-separated list of `A`, `A-B`, and `A-BxN` or `A-B:N` for every Nth frame."""
    frames: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"(-?\d+)(?:-(-?\d+)(?:[x:]0*([1-9]\d*))?)?", part.strip())
        if not match:
            raise argparse.ArgumentTypeError(f"{part!r} is no frame or range; write 1001-1010 or 1001-1100x5")
        first = int(match[1])
        frames.update(range(first, int(match[2] or first) + 1, int(match[3] or 1)))
    return frames


def list_checks() -> str:
    """Every check with its severity and tolerance, one a line."""
    lines = []
    for check in CHECKS:
        tolerance = "" if check.counts else f"{check.tolerance:g} {check.unit}"
        lines.append(f"{check.id:<22} {check.severity.value:<8} {tolerance:<22} {check.description}")
    return "\n".join(lines)


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="hairbake_validate",
        description="Validate a hair cache with Pixar's USD.",
        epilog="Exit code: 0 passed (warnings allowed), 1 a check failed, 2 usage error or unreadable cache.",
    )
    parser.add_argument("directory", type=Path, nargs="?", help="folder of the cache")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the report as JSON")
    parser.add_argument(
        "--frames",
        type=frame_list,
        metavar="LIST",
        help="check the curves of these frames only: 1001-1010, 1001-1100x5",
    )
    parser.add_argument("--only", choices=PARTS, help="check static data only, or the curves of frames only")
    parser.add_argument(
        "--goals", type=Path, metavar="ANIM", help="compare guides with the goals of this animation"
    )
    parser.add_argument(
        "--quick", action="store_true", help="check the curves of a few frames, and no checksums"
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of processes [default: one for each core]",
    )
    parser.add_argument("--list", action="store_true", help="list the checks and their tolerances")
    return parser


def main() -> int:
    """Runs the checks and prints the report; returns the exit code."""
    parser = argument_parser()
    options = parser.parse_args()
    if options.list:
        print(list_checks())
        return 0
    if options.directory is None:
        parser.error("name the folder of a cache")
    if options.jobs < 1:
        parser.error(f"--jobs is {options.jobs}; it must be at least 1")
    try:
        report = validate(
            options.directory, options.frames, options.quick, options.jobs, options.only, options.goals
        )
        if options.json:
            options.json.write_text(json.dumps(report.as_json(), indent=2) + "\n", encoding="utf-8")
    except (CacheError, OSError) as error:
        print(f"hairbake_validate: {error}", file=sys.stderr)
        return 2
    print(report.as_text())
    return 0 if report.passed else 1


if __name__ == "__main__":
    sys.exit(main())
