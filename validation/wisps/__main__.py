"""Command line: `python -m wisps --hairbake target/release/hairbake -o out/wisps`."""

import argparse
import json
import resource
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hairbake_validate.cache import Cache

from .compare import Run, distances, pops, read

STYLES = ("short", "short-curly", "long", "long-curly")
STEPS = 4
"""Sub-steps a frame, as in Bertails, Kim, Cani & Neumann 2003."""
PARTINGS = (0.005, 0.01, 0.02, 0.04)
"""Of the adaptive bakes."""


@dataclass(frozen=True)
class Row:
    """One bake of a style, held against that of all guides by themselves."""

    style: str
    name: str
    nodes: float
    """That moved by themselves, mean over the frames."""
    seconds: float
    """Of processor time in simulation, a sub-step."""
    speed_up: float
    mean: float
    """Distance to the full bake, share of the strands' lengths."""
    p95: float
    pops: tuple[float, float]
    """See `compare.pops`, m/s²."""


def bake(hairbake: Path, groom: Path, motion: Path, out: Path, *options: str) -> tuple[Run, float]:
    """The bake and its seconds of processor time in simulation a sub-step, without start and pre-roll."""

    def run(*stage: str | Path) -> float:
        """Processor time of a command, s."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [hairbake, *stage, groom, motion, "--substeps", STEPS, *options, "-o", out]
        subprocess.run([str(c) for c in command], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    first, last = json.loads(motion.read_text())["frames"]
    start = run("simulate", "--frames", f"{first - 1}-{first - 1}")
    shutil.rmtree(out)
    whole = run("simulate")
    # What is simulated is taken up.
    run()
    # There is a handle at the end.
    return read(Cache(out)), (whole - start) / (last - first + 2) / STEPS


def compare(hairbake: Path, folder: Path, style: str, options: list[str], partings=PARTINGS) -> list[Row]:
    """Bakes the sample `style`, made with further `options`, shaken: all guides by themselves, coarse wisps, and adaptive ones."""
    sample = folder / style
    subprocess.run([hairbake, "sample", style, *options, "-o", sample], check=True, capture_output=True)
    groom, motion = sample / "groom.json", sample / "shake.json"
    adaptive = {f"adaptive {p:g}": ("--resolution", "adaptive", "--parting", str(p)) for p in partings}
    ways = {"full": (), **adaptive, "coarse": ("--resolution", "coarse")}
    rows: list[Row] = []
    full = None
    for name, way in ways.items():
        run, seconds = bake(hairbake, groom, motion, folder / f"{style}-{name.replace(' ', '-')}", *way)
        full = full or run
        apart = distances(full, run)
        rows.append(
            Row(
                style=style,
                name=name,
                nodes=float(np.mean([f["active_nodes"] for f in run.figures])),
                seconds=seconds,
                speed_up=(rows[0].seconds if rows else seconds) / seconds,
                mean=float(apart.mean()),
                p95=float(np.quantile(apart, 0.95)),
                pops=pops(run),
            )
        )
    return rows


def plot(path: Path, rows: list[Row]) -> None:
    """Error over cost, a line for each style."""
    # Only whoever draws needs it.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    for style in dict.fromkeys(row.style for row in rows):
        mine = [row for row in rows if row.style == style]
        axes.plot([r.seconds / mine[0].seconds for r in mine], [100 * r.mean for r in mine], "o-", label=style)
        for r in mine:
            axes.annotate(r.name.removeprefix("adaptive "), (r.seconds / mine[0].seconds, 100 * r.mean), fontsize=7)
    axes.set(
        xlabel="processor time of simulation, of that at full resolution", ylabel="mean distance of strands, % of length"
    )
    axes.set_xlim(left=0)
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> int:
    """Prints a line for each bake, and draws them."""
    parser = argparse.ArgumentParser(prog="wisps", description="Holds adaptive wisps against all guides by themselves.")
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for bakes and plot")
    parser.add_argument("styles", nargs="*", metavar="STYLE", help=f"of {', '.join(STYLES)}; default: all")
    arguments = parser.parse_args()
    unknown = set(arguments.styles) - set(STYLES)
    if unknown:
        parser.error(f"no such style: {', '.join(sorted(unknown))}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    print("style        resolution      nodes   ms a step  speed-up  mean error  95th percentile  acceleration amid changes and without")
    rows = []
    for style in arguments.styles or STYLES:
        for row in compare(arguments.hairbake.resolve(), arguments.out, style, []):
            rows.append(row)
            print(
                f"{row.style:<11}  {row.name:<14}  {row.nodes:>6.0f}  {1e3 * row.seconds:>9.2f}  {row.speed_up:>8.2f}"
                f"  {100 * row.mean:>8.2f} %  {100 * row.p95:>13.2f} %  {row.pops[0]:>10.1f} and {row.pops[1]:.1f} m/s²",
                flush=True,
            )
    plot(arguments.out / "wisps.png", rows)
    print(arguments.out / "wisps.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
