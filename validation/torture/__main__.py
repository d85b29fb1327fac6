"""Command line: `python -m torture --hairbake target/release/hairbake`."""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from hairbake_validate.cache import Cache
from hairbake_validate.crossing_check import Count, Event, count
from physics.scene import Hairbake

from .scenes import FPS, SCENES

STEPS = (5, 4, 3, 2, 1)
"""Steps a film frame."""


def torture(
    hairbake: Hairbake, name: str, steps: int, seconds: float = 1.0
) -> tuple[Count, list[Event], dict]:
    """Bakes a scene with so many steps a film frame; what was looked at, at every moment to which the solver brought the guides, and what crossed; what of that
    is in a frame of which hairbake's own record tells no crossing; and hairbake's own totals.
    """
    with tempfile.TemporaryDirectory() as folder:
        scene = SCENES[name](Path(folder))
        rate = FPS * steps
        settings = {**scene.settings, "contact": "full", "curves": "steps"}
        scene = replace(
            scene, fps=rate, substeps=1, frames=round(seconds * rate), preroll=0.25, settings=settings
        )
        cache = Cache(hairbake.bake_into(Path(folder), scene))
        found = count(cache)
        figures = {f["frame"]: f["figures"] for f in cache.record["frames"]}
        if any(f["divided"] for f in figures.values()):
            raise RuntimeError("a guide took a step in parts by itself: its way is not known")
        untold = [event for event in found.events if not figures[event.frame]["crossings"]]
        return found, untold, cache.record["totals"]


def main() -> int:
    """Prints a line for each bake; 1 where something crossed."""
    parser = argparse.ArgumentParser(
        prog="torture", description="Counts what passes through what under torture."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}; default: all")
    arguments = parser.parse_args()
    unknown = set(arguments.scenes) - set(SCENES)
    if unknown:
        parser.error(f"no such scene: {', '.join(sorted(unknown))}")
    hairbake = Hairbake(arguments.hairbake.resolve())
    print(
        "scene       steps   body pairs  strand pairs  body crossings  strand crossings  untold  cut short  unconverged  deepest, mm"
    )
    looked_at = crossings = unseen = 0
    for name in arguments.scenes or SCENES:
        for steps in STEPS:
            found, untold, totals = torture(hairbake, name, steps)
            strands = sum(e.what == "strands" for e in found.events)
            looked_at += found.body_pairs + found.strand_pairs
            crossings += len(found.events)
            unseen += len(untold)
            print(
                f"{name:<10}  {steps:>5}  {found.body_pairs:>11}  {found.strand_pairs:>12}  {len(found.events) - strands:>14}"
                f"  {strands:>16}  {len(untold):>6}  {totals['shortened']:>9}  {totals['unconverged']:>11}  {1e3 * totals['penetration_m']:>11.3f}"
            )
    print(
        f"{crossings} crossings in {looked_at} pairs, {unseen} of them in frames of which the record tells none"
    )
    return 1 if crossings else 0


if __name__ == "__main__":
    sys.exit(main())
