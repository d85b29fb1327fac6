"""Command line: `python -m wisps --hairbake target/release/hairbake -o out/wisps`."""

import argparse
import shutil
import sys
from pathlib import Path

from hairbake_validate.cache import Cache

from .bakes import SceneFiles, frame_per_substep, processor_time, sample, shortened, simulate
from .comparison import HEADER, SPLIT_TOLERANCES, compare, line, plot
from .measures import LevelChanges, level_changes, read_guides

STYLES = ("short", "short-curly", "long", "long-curly")
TWO_LEVELS = ("short", "short-curly")
"""Styles in whose trees a guide follows a coarse one or none."""


def print_comparison(hairbake: Path, out: Path, options: argparse.Namespace) -> None:
    """Prints a line for each bake, and draws the plot."""
    print(HEADER)
    rows = []
    for style in [None] if options.scene else options.styles or STYLES:
        if style is None:
            groom, anim = (path.resolve() for path in options.scene)
            name = groom.parent.name
            scene = SceneFiles(groom, shortened(anim, options.frames) if options.frames else anim)
        else:
            name, scene = style, sample(hairbake, out / style, style)
        for row in compare(hairbake, out, name, scene, options.split_tolerances, options.contact):
            rows.append(row)
            print(line(row), flush=True)
    plot(out / "wisps.png", rows)
    print(out / "wisps.png")


def print_changes(hairbake: Path, out: Path, styles: list[str], split_tolerances: list[float]) -> None:
    """Prints momentum and energy of guides in the substeps around splits and merges."""
    print("style        tolerance  change     count  momentum: before, from it, next, mm/s   energy, mJ/kg")
    for style in styles:
        scene = sample(hairbake, out / f"{style}-steps", style, "--strands", 0)
        anim = frame_per_substep(scene.anim)
        folder = out / f"{style}-steps-bake"
        for tolerance in split_tolerances:
            shutil.rmtree(folder, ignore_errors=True)
            adaptive = (
                "--substeps",
                1,
                "--no-pictures",
                "--resolution",
                "adaptive",
                "--split-tolerance",
                tolerance,
            )
            processor_time(hairbake, scene.groom, anim, *adaptive, "-o", folder)
            changes = level_changes(read_guides(Cache(folder)))
            for name, change in zip(("splits", "merges"), changes, strict=True):
                figures = changes_line(change)
                print(f"{style:<11}  {tolerance:<9g}  {name:<6}  {change.count:>8}  {figures}", flush=True)


def changes_line(change: LevelChanges) -> str:
    """Momentum and energy in the substeps before, from, and after a change."""
    momentum = " ".join(f"{1e3 * v:>7.2f}" for v in change.momentum)
    return momentum + "      " + " ".join(f"{1e3 * v:>7.2f}" for v in change.energy)


def print_sizes(hairbake: Path, out: Path, style: str, sizes: list[int], split_tolerance: float) -> None:
    """Prints the cost of adaptive bakes of a `style` with these numbers of leaf wisps."""
    for n in sizes:
        scene = sample(hairbake, out / f"{style}-{n}", style, "--strands", 0, "--wisps", n)
        folder = out / f"{style}-{n}-bake"
        adaptive = ("--resolution", "adaptive", "--split-tolerance", split_tolerance)
        seconds = simulate(hairbake, scene, folder, *adaptive)
        shutil.rmtree(folder)
        cost = f"{1e3 * seconds:>9.2f}  {1e6 * seconds / n:>12.1f}"
        print(f"{style:<11}  {split_tolerance:<9g}  {n:>6}  {cost}", flush=True)


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="wisps", description="Compare adaptive wisps with bakes that step every guide."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for bakes and plot")
    parser.add_argument(
        "--scene", type=Path, nargs=2, metavar=("GROOM", "ANIM"), help="compare on this scene, not on samples"
    )
    parser.add_argument("--frames", metavar="A-B", help="frames of the scene [default: all of them]")
    parser.add_argument(
        "--split-tolerances",
        "--partings",
        type=float,
        nargs="+",
        default=SPLIT_TOLERANCES,
        metavar="T",
        help="split tolerances of the adaptive bakes",
    )
    parser.add_argument(
        "--contact",
        default="bodies",
        choices=("volume", "bodies", "full", "penalty"),
        help="what hair touches [default: bodies alone, unlike a bake]",
    )
    modes = parser.add_mutually_exclusive_group()
    modes.add_argument(
        "--changes", action="store_true", help="print momentum and energy around splits and merges instead"
    )
    modes.add_argument(
        "--sizes",
        type=int,
        nargs="+",
        metavar="WISPS",
        help="print the cost for numbers of leaf wisps instead",
    )
    parser.add_argument(
        "styles", nargs="*", metavar="STYLE", help=f"{', '.join(STYLES)} [default: all of them]"
    )
    return parser


def main() -> int:
    """Runs the chosen comparison."""
    parser = argument_parser()
    options = parser.parse_args()
    unknown = set(options.styles) - set(STYLES)
    if unknown:
        parser.error(f"no such style: {', '.join(sorted(unknown))}; choose from {', '.join(STYLES)}")
    if options.contact != "bodies" and (options.changes or options.sizes):
        parser.error("--changes and --sizes need --contact bodies")
    if options.changes and set(options.styles) - set(TWO_LEVELS):
        parser.error(f"--changes needs styles with two levels: {', '.join(TWO_LEVELS)}")
    hairbake, out = options.hairbake.resolve(), options.out
    out.mkdir(parents=True, exist_ok=True)
    if options.changes:
        print_changes(hairbake, out, options.styles or list(TWO_LEVELS), options.split_tolerances)
    elif options.sizes:
        print("style        tolerance   wisps  ms a step  us a wisp and step")
        for style in options.styles or ("short",):
            for tolerance in options.split_tolerances:
                print_sizes(hairbake, out, style, options.sizes, tolerance)
    else:
        print_comparison(hairbake, out, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
