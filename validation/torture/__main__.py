"""Command line: `python -m torture --hairbake target/release/hairbake`."""

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hairbake_validate.cache import Cache
from hairbake_validate.crossing_check import Count, Event, count
from physics.program import Hairbake

from .scenes import FPS, SCENES

STEPS = (5, 4, 3, 2, 1)
"""Steps per film frame."""
HEADER = (
    "scene       steps   body pairs  strand pairs  body crossings  strand crossings  unreported  cut short"
    "  unconverged  unseen  deepest, mm"
)


@dataclass(frozen=True)
class Result:
    """The outcome of one bake."""

    found: Count
    """Pairs tested and crossings found, at every step of the solver."""
    unreported: list[Event]
    """Crossings in frames for which hairbake's own record reports none."""
    totals: dict[str, Any]
    """hairbake's own totals."""
    unseen: int
    """Crossings between the ends of steps that a guide divided: its motion within is not written."""


def torture(hairbake: Hairbake, name: str, steps: int, seconds: float = 1.0, contact: str = "full") -> Result:
    """Bakes a scene with this many steps per film frame, and counts its crossings.

    Crossings of strands count with rigid guides only.
    """
    with tempfile.TemporaryDirectory() as folder:
        scene = SCENES[name](Path(folder))
        rate = FPS * steps
        settings = {**scene.settings, "contact": contact, "curves": "steps"}
        scene = replace(
            scene, fps=rate, substeps=1, frames=round(seconds * rate), preroll=0.25, settings=settings
        )
        cache = Cache(hairbake.bake_into(Path(folder), scene))
        found = count(cache)
        figures = {frame["frame"]: frame["figures"] for frame in cache.record["frames"]}
        counted = [e for e in found.events if contact == "full" or e.what != "strands"]
        seen = [e for e in counted if not set(e.curves) & set(figures[e.frame]["divided"])]
        found.events = seen
        unreported = [event for event in found.events if not figures[event.frame]["crossings"]]
        return Result(found, unreported, cache.record["totals"], len(counted) - len(seen))


def line(name: str, steps: int, result: Result) -> str:
    """One line of the table."""
    found, totals = result.found, result.totals
    strands = sum(event.what == "strands" for event in found.events)
    return (
        f"{name:<10}  {steps:>5}  {found.body_pairs:>11}  {found.strand_pairs:>12}"
        f"  {len(found.events) - strands:>14}  {strands:>16}  {len(result.unreported):>10}"
        f"  {totals['shortened']:>9}  {totals['unconverged']:>11}  {result.unseen:>6}"
        f"  {1e3 * totals['penetration_m']:>11.3f}"
    )


def main() -> int:
    """Prints a line for each bake. Exit code: 0 for no crossings, else 1."""
    parser = argparse.ArgumentParser(
        prog="torture", description="Bake scenes that provoke crossings, and count the crossings."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument(
        "--contact",
        default="full",
        choices=("full", "volume"),
        help="rigid guides, or hair as a volume, where only crossings of bodies count [default: full]",
    )
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help=f"{', '.join(SCENES)} [default: all of them]"
    )
    options = parser.parse_args()
    unknown = set(options.scenes) - set(SCENES)
    if unknown:
        parser.error(f"no such scene: {', '.join(sorted(unknown))}; choose from {', '.join(SCENES)}")
    hairbake = Hairbake(options.hairbake.resolve())
    print(HEADER)
    pairs = crossings = unreported = 0
    for name in options.scenes or SCENES:
        for steps in STEPS:
            result = torture(hairbake, name, steps, contact=options.contact)
            pairs += result.found.body_pairs + result.found.strand_pairs
            crossings += len(result.found.events)
            unreported += len(result.unreported)
            print(line(name, steps, result), flush=True)
    print(f"{crossings} crossings in {pairs} pairs, {unreported} of them not reported by hairbake")
    return 1 if crossings else 0


if __name__ == "__main__":
    sys.exit(main())
