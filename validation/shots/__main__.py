"""Command line: `python -m shots --hairbake target/release/hairbake -o out/shots`."""

import argparse
import fnmatch
import json
import multiprocessing
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from wisps.bakes import timed

from . import grooms
from .case import Job, Result
from .motions import MOTIONS

HEADER = (
    "case",
    "s/frame",
    "validator",
    "glitches",
    "pops",
    "deepest guide, mm",
    "deepest hair, mm",
    "cut short",
    "--strict",
    "validation, s/frame",
)


def row(result: Result) -> tuple[str, ...]:
    """The figures of a case, as texts."""
    if result.refused:
        verdict = "refused" if result.faults else "refused, as it must be"
        return (result.name, "", verdict, *[""] * 7)
    found = result.measures
    return (
        result.name,
        f"{result.seconds:.2f}",
        "; ".join(result.failed) or "passed",
        str(found.glitches),
        str(found.pops),
        f"{1e3 * found.guide_depth:.2f}",
        f"{1e3 * found.hair_depth:.2f}",
        str(result.cut_short),
        str(result.exit_code),
        f"{result.validation_seconds:.2f}",
    )


def table(results: list[Result]) -> str:
    """All cases as a table in Markdown."""
    rows = [HEADER, ("---",) * len(HEADER), *map(row, results)]
    failed = sum(bool(result.faults) for result in results)
    return (
        "\n".join(f"| {' | '.join(cells)} |" for cells in rows)
        + f"\n\n{failed} of {len(results)} cases fail.\n"
    )


def jobs(options: argparse.Namespace) -> Iterator[Job]:
    """The chosen cases; makes the grooms that they need."""
    hairbake, out = options.hairbake.resolve(), options.out.resolve()
    motions: dict[str, Path | None] = {
        **dict.fromkeys(MOTIONS),
        **{path.stem: path for path in options.motion},
    }
    given = {Path(text.partition("=")[0]).stem: text for text in options.groom}
    made: dict[str, grooms.Groom] = {}
    for motion, file in motions.items():
        for name in (*grooms.NAMES, *given):
            if not any(fnmatch.fnmatch(f"{motion}/{name}", pattern) for pattern in options.only):
                continue
            if name not in made:
                folder = out / "grooms" / name
                real = name in given
                made[name] = (
                    grooms.real(hairbake, given[name], folder)
                    if real
                    else grooms.make(hairbake, name, folder)
                )
            yield Job(hairbake, motion, file, made[name], options.frames, out / motion / name)


def argument_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="shots", description="Bake hard motions of several grooms, and validate and draw each."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for the cases and the table")
    parser.add_argument(
        "--only",
        nargs="+",
        default=["*"],
        metavar="CASE",
        help="cases such as fall/long or fall/* [default: all]",
    )
    parser.add_argument("--frames", type=int, default=60, metavar="N", help="frames of a shot [default: 60]")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="cases at a time [default: 1]")
    parser.add_argument(
        "--groom",
        action="append",
        default=[],
        metavar="FILE=HEAD[:UNIT]",
        help="add a groom and the mesh of its head (OBJ; m, cm or mm); may be repeated",
    )
    parser.add_argument(
        "--motion",
        action="append",
        default=[],
        type=Path,
        metavar="FILE[=JOINT]",
        help="add a motion file; may be repeated",
    )
    return parser


def main() -> int:
    """Runs the cases, prints the table and writes it. Exit code: 1 if a case fails."""
    options = argument_parser().parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = list(jobs(options))
    order = [f"{job.motion}/{job.groom.name}" for job in chosen]
    results: list[Result] = []
    print(f"| {' | '.join(HEADER)} |")
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for result in pool.imap_unordered(Job.run, chosen):
            results.append(result)
            results.sort(key=lambda each: order.index(each.name))
            print(f"| {' | '.join(row(result))} |", flush=True)
            (options.out / "table.md").write_text(table(results))
            content = [asdict(each) for each in results]
            (options.out / "table.json").write_text(json.dumps(content, indent=1) + "\n")
    caches = [job.folder / "cache" for job in chosen if (job.folder / "cache/hair.usda").is_file()]
    if caches:
        overview = ("-o", options.out / "overview.png", "--pictures", 8, "--size", 160)
        timed(options.hairbake.resolve(), "preview", *caches, *overview)
    for result in results:
        for fault in result.faults:
            print(f"{result.name}: {fault}")
    return 1 if any(result.faults for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
