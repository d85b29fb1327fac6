"""Command line: `python -m over --hairbake target/release/hairbake`."""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from hairbake_validate.cache import Cache
from hairbake_validate.checks_over import chosen_curves, distances, in_world, sampled
from hairbake_validate.geometry import FloatArray, transformed
from hairbake_validate.overs import Overs, stage_to_metres
from hairbake_validate.run import validate
from hairbake_validate.window import Reference, Window

from .character import CHARACTER, FIRST, HAIR, INSTANCE, LAST, Drawn, write

DRAWN = [
    Drawn("bspline", "pinned"),
    Drawn("bspline", "nonperiodic"),
    Drawn("catmullRom", "pinned"),
    Drawn("catmullRom", "nonperiodic"),
    Drawn("bezier", "nonperiodic"),
    Drawn("linear", "nonperiodic"),
]
QUICK = ("--preroll", "0.25", "--substeps", "4", "--no-pictures")
"""Of no interest here is how hair moves, as long as it does."""
FRAMES = 10
"""Frames of a bake: a quarter of a shake of the head, and where it turns round."""
STILL = ("--set", "anim.gravity_m_s2=[0,0,0]", "--contact", "bodies")
"""Nothing moves the hair, which then has to stay where the groom has it."""


@dataclass(frozen=True)
class Distance:
    """How far the groom's curves are from the baked strands, m."""

    mean: float
    percentile: float
    """95 % of the points are nearer."""
    largest: float
    of_length: float
    """Mean as a share of the length of the strands."""


@dataclass(frozen=True)
class Result:
    """The outcome for one way to draw the groom."""

    kept: dict[str, bool]
    """What lookdev and renderer see of the groom, and whether it is the same."""
    rest: float
    """Largest distance of a control point from the groom's own where nothing moves, m."""
    distance: Distance
    failed: list[str]
    """Checks of the validator on over mode that fail."""


def run(hairbake: Path, *arguments: object) -> str:
    """Runs the program and returns its messages.

    Raises:
        RuntimeError: It reports an error.
    """
    done = subprocess.run(
        [str(part) for part in (hairbake, *arguments)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"hairbake exited with {done.returncode}:\n{done.stderr}")
    return done.stderr


def bake(hairbake: Path, folder: Path, drawn: Drawn, frames: int, still: bool) -> Path:
    """Writes the character, imports and bakes it with everything by default; returns the cache's folder."""
    folder.mkdir(parents=True)
    shot = write(folder, drawn, still)
    groom, anim, out = folder / "groom.json", folder / "anim.json", folder / "out"
    run(hairbake, "import", "groom", shot, "--prim", f"{CHARACTER}/hairgroom", "-o", groom)
    head = ("--prim", f"{CHARACTER}/rig", "--joint", "head", "--groom", groom)
    # The groom has hair in the body, which would push it out.
    body = () if still else ("--collider", f"{shot}:{CHARACTER}/geo/body")
    run(hairbake, "import", "track", shot, *head, *body, "-o", anim)
    options = (*QUICK, *(STILL if still else ()), "--frames", f"{FIRST}-{FIRST + frames - 1}")
    run(hairbake, groom, anim, "-o", out, *options)
    return out


def study(hairbake: Path, folder: Path, drawn: Drawn, frames: int = FRAMES) -> Result:
    """Bakes the character, once as it moves and once still, and measures."""
    out = bake(hairbake, folder / "moving", drawn, frames, still=False)
    cache = Cache(out)
    report = validate(out, frames={cache.first, (cache.first + cache.last) // 2, cache.last})
    failed = [
        name for name, found in report.outcomes.items() if name[:5] == "over_" and found.status == "fail"
    ]
    still = Overs(Cache(bake(hairbake, folder / "still", drawn, 2, still=True)))
    return Result(kept(Overs(cache)), rest_error(still), distance(cache), failed)


def kept(overs: Overs) -> dict[str, bool]:
    """What lookdev and renderer see of the groom, and whether it is the same with the motion over it."""

    def attribute(name: str) -> Callable[[Usd.Stage], Any]:
        return lambda stage: stage.GetPrimAtPath(HAIR).GetAttribute(name).Get()

    def material(path: str) -> Callable[[Usd.Stage], Any]:
        return lambda stage: (
            UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()[0].GetPath()
        )

    def placed(stage: Usd.Stage) -> Any:
        return UsdGeom.Imageable(stage.GetPrimAtPath(HAIR)).ComputeLocalToWorldTransform(LAST)

    seen: dict[str, Callable[[Usd.Stage], Any]] = {
        "type, basis, wrap": lambda stage: [attribute(name)(stage) for name in ("type", "basis", "wrap")],
        "vertex counts": attribute("curveVertexCounts"),
        "widths": attribute("widths"),
        "material": material(HAIR),
        "subset": lambda stage: stage.GetPrimAtPath(f"{HAIR}/fringe").GetAttribute("indices").Get(),
        "its material": material(f"{HAIR}/fringe"),
        "hair_id": attribute("primvars:hair_id"),
        "melanin": attribute("primvars:melanin"),
        "st": attribute("primvars:st"),
        "displayColor": attribute("primvars:displayColor"),
        "purpose": lambda stage: UsdGeom.Imageable(stage.GetPrimAtPath(HAIR)).ComputePurpose(),
        "variant": lambda stage: (
            stage.GetPrimAtPath(f"{CHARACTER}/hairgroom").GetVariantSet("density").GetVariantSelection()
        ),
        "payload": lambda stage: stage.GetPrimAtPath(f"{CHARACTER}/hairgroom").HasAuthoredPayloads(),
        "transform": placed,
        "the instance": lambda stage: stage.GetPrimAtPath(INSTANCE).GetAttribute("points").Get(LAST),
    }
    return {name: value(overs.original) == value(overs.shot) is not None for name, value in seen.items()}


def rest_error(overs: Overs) -> float:
    """Largest distance of a control point from the groom's own over all frames, m."""
    points = overs.shot.GetPrimAtPath(HAIR).GetAttribute("points")
    rest = np.array(points.Get(), float)
    moved = (np.array(points.Get(frame), float) - rest for frame in overs.cache.frames)
    unit = float(UsdGeom.GetStageMetersPerUnit(overs.shot))
    return unit * max(float(np.linalg.norm(each, axis=1).max()) for each in moved)


def distance(cache: Cache) -> Distance:
    """Distances of the baked points from the groom's curves, over some strands of all frames."""
    window = Window(cache, Reference())
    overs = Overs(cache)
    over = next(prim for prim in overs.prims if prim.path == HAIR)
    each, shares = [], []
    for frame in cache.frames:
        window.move_to(frame)
        points = in_world(window, over)
        if points is None:
            continue
        for baked, drawn in strands(window, overs, points):
            found = distances(baked, drawn)
            each.append(found)
            shares.append(found.mean() / np.linalg.norm(np.diff(baked, axis=0), axis=1).sum())
    every = np.concatenate(each)
    return Distance(
        float(every.mean()), float(np.percentile(every, 95)), float(every.max()), float(np.mean(shares))
    )


def strands(window: Window, overs: Overs, points: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Baked points of strands in the world, and the groom's curves that stand for them, as fine polylines."""
    over = next(prim for prim in overs.prims if prim.path == HAIR)
    for run_ in over.runs:
        curves = next(each for each in window.cache.curves if each.path == run_.prim)
        world = window.get(run_.prim, "points")
        if world is None:
            continue
        baked = transformed(world, stage_to_metres(window.cache.stage))
        for which, drawn in sampled(over, points, run_.first + chosen_curves(run_), 16):
            for curve, line in zip(which - run_.first + run_.baked, drawn, strict=True):
                start = curves.starts[curve]
                yield baked[start : start + curves.counts[curve]], line


def line(drawn: Drawn, result: Result) -> str:
    """One line of the table."""
    found = result.distance
    millimetres = "  ".join(f"{1e3 * each:>9.4f}" for each in (found.mean, found.percentile, found.largest))
    lost = [name for name, same in result.kept.items() if not same]
    return (
        f"{drawn.name:<24}  {result.rest:>13.1e}  {millimetres}  {100 * found.of_length:>11.4f}"
        f"  {', '.join(lost) or 'all':<10}  {', '.join(result.failed) or 'none'}"
    )


def main() -> int:
    """Prints a line for each way to draw the groom. Exit code: 0 if all is kept and valid, else 1."""
    parser = argparse.ArgumentParser(
        prog="over", description="Put the motion of a bake over grooms drawn in every basis, and measure."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep scenes and caches in this new folder")
    options = parser.parse_args()
    good = True
    print(
        "drawn as                     at rest   mean, mm   95 %, mm    largest  % of length  kept        bad"
    )
    with tempfile.TemporaryDirectory() as folder:
        for drawn in DRAWN:
            place = (options.keep or Path(folder)) / drawn.name.replace(", ", "_")
            result = study(options.hairbake.resolve(), place, drawn)
            good = good and all(result.kept.values()) and not result.failed
            print(line(drawn, result), flush=True)
    print("compared with the stage below: " + ", ".join(result.kept))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
