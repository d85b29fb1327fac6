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

from .compare import Change, Run, changes, distances, lock_distances, pops, read, read_motion, rest

STYLES = ("short", "short-curly", "long", "long-curly")
STEPS = 4
"""Sub-steps a frame, as in Bertails, Kim, Cani & Neumann 2003."""
PARTINGS = (0.005, 0.02, 0.06)
"""Of the adaptive bakes."""
NUDGE = 1e-6
"""By how much stronger gravity is in the bake that tells how far apart two are that should be the same."""
LEVELS_OF_TWO = ("short", "short-curly")
"""Styles in whose trees a guide follows a coarse one or none."""


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
    locks: float
    """Mean distance of the mean curves of locks, share of the mean length."""
    pops: tuple[float, float]
    """See `compare.pops`."""
    rest: tuple[int, float]
    """See `compare.rest`."""


def hairbake_time(*command: object) -> float:
    """Processor time of a command, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(c) for c in command], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def simulate(hairbake: Path, groom: Path, motion: Path, out: Path, *options: object) -> float:
    """Simulates into `out`; returns the seconds of processor time a sub-step, without start and pre-roll."""
    first, last = json.loads(motion.read_text())["frames"]
    command = [hairbake, "simulate", groom, motion, "--substeps", STEPS, *options, "-o", out]
    shutil.rmtree(out, ignore_errors=True)
    hairbake_time(*command, "--frames", f"{first - 1}-{first - 1}")
    # Each goes on from there, and so has what starting costs. Beyond the last there are the handle, and two frames for what smooths strands.
    one = hairbake_time(*command, "--frames", f"{first - 1}-{first}")
    return (hairbake_time(*command) - one) / (last - first + 2) / STEPS


def bake(hairbake: Path, groom: Path, motion: Path, out: Path, *options: object) -> tuple[Run, float]:
    """The bake, and what `simulate` returns."""
    seconds = simulate(hairbake, groom, motion, out, *options)
    # What is simulated is taken up.
    hairbake_time(hairbake, groom, motion, "--substeps", STEPS, *options, "-o", out)
    return read(Cache(out)), seconds


def sample(hairbake: Path, folder: Path, style: str, *options: object) -> tuple[Path, Path]:
    """Groom and shake of the sample `style`, made with further `options`."""
    hairbake_time(hairbake, "sample", style, *options, "-o", folder)
    return folder / "groom.json", folder / "shake.json"


def compare(
    hairbake: Path,
    folder: Path,
    style: str,
    scene: tuple[Path, Path],
    partings=PARTINGS,
    contact: str = "bodies",
) -> list[Row]:
    """Bakes groom and motion of a `style`, whose hair touches what `contact` says: all guides by themselves, twice, adaptive wisps, and coarse ones."""
    groom, motion = scene
    adaptive = {f"adaptive {p:g}": ("--resolution", "adaptive", "--parting", str(p)) for p in partings}
    ways = {
        "full": ("--resolution", "full"),
        "nudged": ("--resolution", "full"),
        **adaptive,
        "coarse": ("--resolution", "coarse"),
    }
    rows: list[Row] = []
    full = None
    for name, way in ways.items():
        out = folder / f"{style}-{name.replace(' ', '-')}"
        anim = nudged(motion) if name == "nudged" else motion
        run, seconds = bake(hairbake, groom, anim, out, "--contact", contact, *way)
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
                locks=float(lock_distances(full, run).mean()),
                pops=pops(full, run),
                rest=rest(run),
            )
        )
    return rows


def plot(path: Path, rows: list[Row]) -> None:
    """Error over cost, a line for each style; dotted, how far a nudged full bake is from the other."""
    # Only whoever draws needs it.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    for style in dict.fromkeys(row.style for row in rows):
        mine = [row for row in rows if row.style == style and row.name != "nudged"]
        (line,) = axes.plot(
            [r.seconds / mine[0].seconds for r in mine], [100 * r.mean for r in mine], "o-", label=style
        )
        for r in rows:
            if (r.style, r.name) == (style, "nudged"):
                axes.axhline(100 * r.mean, linestyle=":", color=line.get_color())
        for r in mine:
            axes.annotate(
                r.name.removeprefix("adaptive "), (r.seconds / mine[0].seconds, 100 * r.mean), fontsize=7
            )
    axes.set(
        xlabel="processor time of simulation, of that at full resolution",
        ylabel="mean distance of strands, % of length",
    )
    axes.set_xlim(left=0)
    axes.legend()
    figure.savefig(path, dpi=120)


def shorter(motion: Path, frames: str) -> Path:
    """The animation with these frames of it alone, beside it."""
    anim = json.loads(motion.read_text())
    anim["frames"] = [int(frame) for frame in frames.split("-")]
    path = motion.with_name(f"{motion.stem}.{frames}.json")
    path.write_text(json.dumps(anim))
    return path


def nudged(motion: Path) -> Path:
    """The animation with a little more gravity, beside it."""
    anim = json.loads(motion.read_text())
    down = [0.0, -9.81, 0.0] if anim.get("up_axis", "y") == "y" else [0.0, 0.0, -9.81]
    gravity = anim.get("gravity_m_s2") or down
    anim["gravity_m_s2"] = [(1 + NUDGE) * g for g in gravity]
    path = motion.with_name(f"{motion.stem}.nudged.json")
    path.write_text(json.dumps(anim))
    return path


def step_by_step(motion: Path) -> Path:
    """The animation with a frame for each sub-step, beside it."""
    anim = json.loads(motion.read_text())
    first, last = anim["frames"]
    anim["fps"] *= STEPS
    anim["frames"] = [first * STEPS, last * STEPS]
    path = motion.with_name(f"{motion.stem}.steps.json")
    path.write_text(json.dumps(anim))
    return path


def print_changes(hairbake: Path, folder: Path, style: str, parting: float) -> None:
    """What changes of wisps do to momentum and energy, sub-step by sub-step."""
    groom, motion = sample(hairbake, folder / f"{style}-steps", style, "--strands", 0)
    out = folder / f"{style}-steps-bake"
    shutil.rmtree(out, ignore_errors=True)
    options = ("--substeps", 1, "--resolution", "adaptive", "--parting", parting)
    hairbake_time(hairbake, groom, step_by_step(motion), *options, "-o", out)
    for name, change in zip(("came away", "joined"), changes(read_motion(Cache(out)))):
        print(f"{style:<11}  {parting:<8g}  {name:<9}  {change.count:>6}  {figures(change)}", flush=True)


def figures(change: Change) -> str:
    """Momentum and energy in the sub-steps before, from, and after a change."""
    momentum = " ".join(f"{1e3 * v:>7.2f}" for v in change.momentum)
    return momentum + "      " + " ".join(f"{1e3 * v:>7.2f}" for v in change.energy)


def print_sizes(hairbake: Path, folder: Path, style: str, wisps: list[int], parting: float) -> None:
    """Cost of an adaptive bake of `style` at numbers of leaf wisps."""
    for n in wisps:
        groom, motion = sample(hairbake, folder / f"{style}-{n}", style, "--strands", 0, "--wisps", n)
        out = folder / f"{style}-{n}-bake"
        seconds = simulate(hairbake, groom, motion, out, "--resolution", "adaptive", "--parting", parting)
        shutil.rmtree(out)
        print(
            f"{style:<11}  {parting:<8g}  {n:>6}  {1e3 * seconds:>9.2f}  {1e6 * seconds / n:>12.1f}",
            flush=True,
        )


def main() -> int:
    """Prints a line for each bake, and draws them."""
    parser = argparse.ArgumentParser(
        prog="wisps", description="Holds adaptive wisps against all guides by themselves."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for bakes and plot")
    parser.add_argument(
        "--scene",
        type=Path,
        nargs=2,
        metavar=("GROOM", "ANIM"),
        help="compares on this scene in place of samples",
    )
    parser.add_argument("--frames", metavar="A-B", help="of the scene")
    parser.add_argument(
        "--partings", type=float, nargs="+", default=PARTINGS, metavar="P", help="of the adaptive bakes"
    )
    parser.add_argument(
        "--contact", default="bodies", choices=("bodies", "full", "penalty"), help="what hair touches"
    )
    parser.add_argument(
        "--changes",
        action="store_true",
        help="prints what changes of wisps do to momentum and energy instead",
    )
    parser.add_argument(
        "--sizes",
        type=int,
        nargs="+",
        metavar="WISPS",
        help="prints the cost of samples of so many leaf wisps instead",
    )
    parser.add_argument("styles", nargs="*", metavar="STYLE", help=f"of {', '.join(STYLES)}; default: all")
    arguments = parser.parse_args()
    unknown = set(arguments.styles) - set(STYLES)
    if unknown:
        parser.error(f"no such style: {', '.join(sorted(unknown))}")
    if arguments.contact != "bodies" and (arguments.changes or arguments.sizes):
        parser.error("changes and sizes are told of hair that touches bodies")
    hairbake, out = arguments.hairbake.resolve(), arguments.out
    out.mkdir(parents=True, exist_ok=True)
    if arguments.changes:
        print(
            "style        parting   change      count  momentum: before, from it, next, mm/s   energy, mJ/kg"
        )
        for style in arguments.styles or LEVELS_OF_TWO:
            if style not in LEVELS_OF_TWO:
                parser.error(f"changes are told of {' and '.join(LEVELS_OF_TWO)} alone")
            for parting in arguments.partings:
                print_changes(hairbake, out, style, parting)
        return 0
    if arguments.sizes:
        print("style        parting    wisps  ms a step  us a wisp and step")
        for style in arguments.styles or ("short",):
            for parting in arguments.partings:
                print_sizes(hairbake, out, style, arguments.sizes, parting)
        return 0
    print(
        "style        resolution      nodes   ms a step  speed-up  mean error  95th percentile    of locks  accelerations over full, amid changes and without"
        "  at the end: nodes and speed"
    )
    if arguments.scene:
        groom, motion = (path.resolve() for path in arguments.scene)
        motion = shorter(motion, arguments.frames) if arguments.frames else motion
        scenes = {groom.parent.name: lambda: (groom, motion)}
    else:
        scenes = {s: lambda s=s: sample(hairbake, out / s, s) for s in arguments.styles or STYLES}
    rows = []
    for style, scene in scenes.items():
        for row in compare(hairbake, out, style, scene(), arguments.partings, arguments.contact):
            rows.append(row)
            print(
                f"{row.style:<11}  {row.name:<14}  {row.nodes:>6.0f}  {1e3 * row.seconds:>9.2f}  {row.speed_up:>8.2f}"
                f"  {100 * row.mean:>8.2f} %  {100 * row.p95:>13.2f} %  {100 * row.locks:>8.2f} %  {row.pops[0]:>12.2f} and {row.pops[1]:.2f}"
                f"  {row.rest[0]:>14} and {1e3 * row.rest[1]:.2f} mm/s",
                flush=True,
            )
    plot(out / "wisps.png", rows)
    print(out / "wisps.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
