"""How far two caches of one scene are apart, and whether anything in them pops."""

from dataclasses import dataclass

import numpy as np
from hairbake_validate.cache import HEAD, TRANSFORM, Cache, read_frame


@dataclass(frozen=True)
class Run:
    """The curves of a cache in motion, seen from the head."""

    points: np.ndarray
    """`frames × points × 3`, m."""
    counts: np.ndarray
    """Points of each curve."""
    lengths: np.ndarray
    """Of each curve at rest, m."""
    fps: float
    figures: list[dict]
    """hairbake's own figures of each frame."""


def read(cache: Cache) -> Run:
    """The render strands, or the guides of a cache without any. Only at the frames of the shot."""
    curves = cache.curves[0]
    points = []
    for frame in range(cache.first, cache.last + 1):
        values = read_frame(cache, frame).values
        # Seen from the head: for row vectors.
        head = np.linalg.inv(values[f"{HEAD}.{TRANSFORM}"])
        points.append(values[f"{curves.path}.points"] @ head[:3, :3] + head[3, :3])
    steps = np.linalg.norm(np.diff(curves.rest.astype(float), axis=0), axis=1)
    lengths = np.bincount(curves.curve_of_point[curves.segments], steps[curves.segments], len(curves.counts))
    figures = {f["frame"]: f["figures"] for f in cache.record["frames"]}
    return Run(
        points=np.array(points) * cache.metres_per_unit,
        counts=curves.counts,
        lengths=lengths * cache.metres_per_unit,
        fps=cache.fps,
        figures=[figures[frame] for frame in range(cache.first, cache.last + 1)],
    )


def distances(full: Run, other: Run) -> np.ndarray:
    """Mean distance of the points of each curve in two runs, over its length; `frames × curves`."""
    apart = np.linalg.norm(full.points - other.points, axis=2)
    starts = np.cumsum(full.counts) - full.counts
    return np.add.reduceat(apart, starts, axis=1) / full.counts / full.lengths


def pops(run: Run, quantile: float = 0.999) -> tuple[float, float]:
    """High quantile of the points' accelerations, m/s², in the frames with most splits and merges (the upper quarter), and in
    those with least: what pops does so in the former."""
    accelerations = np.linalg.norm(np.diff(run.points, 2, axis=0), axis=2) * run.fps**2
    changes = np.array([f["splits"] + f["merges"] for f in run.figures])
    # A second difference is of three frames, of which the changes are in two.
    changes = changes[1:-1] + changes[2:]
    order = np.argsort(changes, kind="stable")
    quarter = max(len(order) // 4, 1)
    most, least = accelerations[order[-quarter:]], accelerations[order[:quarter]]
    return float(np.quantile(most, quantile)), float(np.quantile(least, quantile))
