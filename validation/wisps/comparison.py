"""Cost and error of adaptive and coarse bakes against the full one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .bakes import SceneFiles, bake, nudged
from .measures import StrandMotion, acceleration_ratios, distances, final_state, lock_distances

SPLIT_TOLERANCES = (0.01, 0.02, 0.06)
"""Split tolerances of the adaptive bakes."""


@dataclass(frozen=True)
class Row:
    """One bake of a style, compared with the bake that steps every guide."""

    style: str
    name: str
    nodes: float
    """Active nodes, mean over frames."""
    seconds: float
    """Processor time of the simulation per substep."""
    speed_up: float
    mean: float
    """Mean distance from the full bake, relative to the strands' lengths."""
    p95: float
    """95th percentile of the same."""
    locks: float
    """Mean distance of the mean curves of locks, relative to the mean length."""
    accelerations: tuple[float, float]
    """See `measures.acceleration_ratios`."""
    final: tuple[int, float]
    """See `measures.final_state`."""


HEADER = (
    "style        resolution      nodes   ms a step  speed-up  mean error  95th percentile    of locks"
    "  accelerations over full, frames with most and fewest changes  at the end: nodes and speed"
)


def line(row: Row) -> str:
    """The row as a line under HEADER."""
    return (
        f"{row.style:<11}  {row.name:<14}  {row.nodes:>6.0f}  {1e3 * row.seconds:>9.2f}"
        f"  {row.speed_up:>8.2f}  {100 * row.mean:>8.2f} %  {100 * row.p95:>13.2f} %"
        f"  {100 * row.locks:>8.2f} %"
        f"  {row.accelerations[0]:>12.2f} and {row.accelerations[1]:.2f}"
        f"  {row.final[0]:>14} and {1e3 * row.final[1]:.2f} mm/s"
    )


def compare(
    hairbake: Path,
    folder: Path,
    style: str,
    scene: SceneFiles,
    split_tolerances: Sequence[float] = SPLIT_TOLERANCES,
    contact: str = "bodies",
) -> list[Row]:
    """Bakes the scene of a `style` with every guide stepped, the same nudged, adaptive, and coarse."""
    resolutions = {"full": ["--resolution", "full"], "nudged": ["--resolution", "full"]}
    for tolerance in split_tolerances:
        adaptive = ["--resolution", "adaptive", "--split-tolerance", str(tolerance)]
        resolutions[f"adaptive {tolerance:g}"] = adaptive
    resolutions["coarse"] = ["--resolution", "coarse"]
    rows: list[Row] = []
    full: StrandMotion | None = None
    for name, options in resolutions.items():
        out = folder / f"{style}-{name.replace(' ', '-')}"
        varied = SceneFiles(scene.groom, nudged(scene.anim)) if name == "nudged" else scene
        motion, seconds = bake(hairbake, varied, out, "--contact", contact, *options)
        full = full or motion
        apart = distances(full, motion)
        rows.append(
            Row(
                style=style,
                name=name,
                nodes=float(np.mean([figures["active_nodes"] for figures in motion.figures])),
                seconds=seconds,
                speed_up=(rows[0].seconds if rows else seconds) / seconds,
                mean=float(apart.mean()),
                p95=float(np.quantile(apart, 0.95)),
                locks=float(lock_distances(full, motion).mean()),
                accelerations=acceleration_ratios(full, motion),
                final=final_state(motion),
            )
        )
    return rows


def plot(path: Path, rows: list[Row]) -> None:
    """Draws error over cost, a line for each style; dotted: distance between the two full bakes."""
    # Only the plot needs matplotlib.
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    for style in dict.fromkeys(row.style for row in rows):
        own = [row for row in rows if row.style == style and row.name != "nudged"]
        cost, error = [row.seconds / own[0].seconds for row in own], [100 * row.mean for row in own]
        (series,) = axes.plot(cost, error, "o-", label=style)
        for row in rows:
            if (row.style, row.name) == (style, "nudged"):
                axes.axhline(100 * row.mean, linestyle=":", color=series.get_color())
        for row, x, y in zip(own, cost, error, strict=True):
            axes.annotate(row.name.removeprefix("adaptive "), (x, y), fontsize=7)
    axes.set(
        xlabel="processor time of simulation, relative to full resolution",
        ylabel="mean distance of strands, % of length",
    )
    axes.set_xlim(left=0)
    axes.legend()
    figure.savefig(path, dpi=120)
