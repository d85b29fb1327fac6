"""Measures of two caches of one scene: distance, accelerations at splits and merges, momentum and energy."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hairbake_validate.cache import HEAD, LEVEL, TRANSFORM, Cache, read_frame
from hairbake_validate.geometry import BoolArray, FloatArray, IntArray

GRAVITY = np.array([0.0, -9.81, 0.0])
"""Gravity of scenes whose Y axis is up, m/s²."""
LOCK_POINTS = 9
"""Points at which the mean curve of a lock is sampled."""


@dataclass(frozen=True)
class StrandMotion:
    """The curves of a cache over time, in the space of the head."""

    points: FloatArray
    """`frames × points × 3`, m."""
    counts: IntArray
    """Number of points of each curve."""
    lengths: FloatArray
    """Length of each curve at rest, m."""
    fps: float
    figures: list[dict[str, Any]]
    """hairbake's own figures of each frame."""

    @property
    def starts(self) -> IntArray:
        """Index of each curve's root point."""
        starts: IntArray = np.cumsum(self.counts) - self.counts
        return starts


def read_strands(cache: Cache) -> StrandMotion:
    """The render strands, or the guides of a cache without any, at the frames of the shot."""
    curves = cache.curves[0]
    points = []
    for frame in range(cache.first, cache.last + 1):
        values = read_frame(cache, frame).values
        to_head = np.linalg.inv(values[f"{HEAD}.{TRANSFORM}"])
        points.append(values[f"{curves.path}.points"] @ to_head[:3, :3] + to_head[3, :3])
    steps = np.linalg.norm(np.diff(curves.rest.astype(float), axis=0), axis=1)
    lengths = np.bincount(curves.curve_of_point[curves.segments], steps[curves.segments], len(curves.counts))
    figures = {frame["frame"]: frame["figures"] for frame in cache.record["frames"]}
    return StrandMotion(
        points=np.array(points) * cache.metres_per_unit,
        counts=curves.counts,
        lengths=lengths * cache.metres_per_unit,
        fps=cache.fps,
        figures=[figures[frame] for frame in range(cache.first, cache.last + 1)],
    )


def distances(full: StrandMotion, other: StrandMotion) -> FloatArray:
    """Mean distance between the points of each curve, relative to its length; `frames × curves`."""
    apart = np.linalg.norm(full.points - other.points, axis=2)
    mean: FloatArray = np.add.reduceat(apart, full.starts, axis=1) / full.counts / full.lengths
    return mean


def locks(motion: StrandMotion, count: int) -> IntArray:
    """The lock of each curve, by its root in the first frame: the nearest of `count` distant roots."""
    roots = motion.points[0][motion.starts]
    nearest, lock = np.full(len(roots), np.inf), np.zeros(len(roots), dtype=int)
    for k in range(min(count, len(roots))):
        apart = np.linalg.norm(roots - roots[np.argmax(nearest)], axis=1)
        lock[apart < nearest] = k
        nearest = np.minimum(nearest, apart)
    return lock


def lock_distances(full: StrandMotion, other: StrandMotion) -> FloatArray:
    """Distance between the mean curves of locks, relative to the mean length; `frames × locks × 9` points.

    Locks have equal weight. The motion of single curves relative to their lock, which differs between any two
    bakes, is averaged out.
    """
    # On average a lock has at least eight curves.
    lock = locks(full, int(np.clip(len(full.counts) // 8, 1, 60)))
    along = np.linspace(0, 1, LOCK_POINTS)
    places = full.starts[:, None] + np.round((full.counts[:, None] - 1) * along).astype(int)
    apart = full.points[:, places] - other.points[:, places]
    means = [apart[:, lock == k].mean(axis=1) for k in np.unique(lock)]
    relative: FloatArray = np.linalg.norm(np.stack(means, axis=1), axis=3) / full.lengths.mean()
    return relative


def acceleration_ratios(
    full: StrandMotion, motion: StrandMotion, quantile: float = 0.999
) -> tuple[float, float]:
    """High quantile of the points' accelerations, relative to that of the full bake in the same frames.

    The first ratio is that of the quarter of frames with most splits and merges, the second that of the
    quarter with fewest. Jumps at splits and merges raise the first alone.
    """
    accelerations = [np.linalg.norm(np.diff(m.points, 2, axis=0), axis=2) for m in (motion, full)]
    changes = np.array([figures["splits"] + figures["merges"] for figures in motion.figures])
    # A second difference spans three frames; it sees the changes in the last two.
    changes = changes[1:-1] + changes[2:]
    order = np.argsort(changes, kind="stable")
    quarter = max(len(order) // 4, 1)

    def ratio(frames: IntArray) -> float:
        own, reference = (np.quantile(a[frames], quantile) for a in accelerations)
        return float(own / reference)

    return ratio(order[-quarter:]), ratio(order[:quarter])


def final_state(motion: StrandMotion) -> tuple[int, float]:
    """Active nodes in the last frame, and the 95th percentile of the points' speeds in head space, m/s."""
    speeds = np.linalg.norm(motion.points[-1] - motion.points[-2], axis=1) * motion.fps
    return motion.figures[-1]["active_nodes"], float(np.quantile(speeds, 0.95))


@dataclass(frozen=True)
class GuideMotion:
    """The guides of a cache with a frame for each substep, in world space."""

    points: FloatArray
    """`frames × points × 3`, m."""
    velocities: FloatArray
    """`frames × points × 3`, m/s."""
    counts: IntArray
    """Number of points of each curve."""
    levels: IntArray
    """Level of the wisp that each guide moves with, `frames × curves`."""


def read_guides(cache: Cache) -> GuideMotion:
    """The guides at the frames of the shot."""
    guides = cache.curves[-1]
    frames = [read_frame(cache, frame).values for frame in range(cache.first, cache.last + 1)]
    scale = cache.metres_per_unit
    return GuideMotion(
        points=np.array([frame[f"{guides.path}.points"] for frame in frames], dtype=float) * scale,
        velocities=np.array([frame[f"{guides.path}.velocities"] for frame in frames], dtype=float) * scale,
        counts=guides.counts,
        levels=np.array([frame[f"{guides.path}.{LEVEL}"] for frame in frames]),
    )


@dataclass(frozen=True)
class LevelChanges:
    """Momentum and energy around changes of one kind, per mass, as means over the guides that changed.

    The points of a guide have equal masses. Each array holds the substep before the change, the one from it
    on, and the next one.
    """

    count: int
    momentum: FloatArray
    """Magnitude of the change of momentum, m/s."""
    energy: FloatArray
    """Magnitude of the change of kinetic and potential energy, J/kg."""


def level_changes(motion: GuideMotion) -> tuple[LevelChanges, LevelChanges]:
    """Splits and merges. A jump appears only in the substep from the change on."""
    starts = np.cumsum(motion.counts) - motion.counts

    def mean(values: FloatArray) -> FloatArray:
        counts = motion.counts.reshape((1, -1) + (1,) * (values.ndim - 2))
        over_points: FloatArray = np.add.reduceat(values, starts, axis=1) / counts
        return over_points

    momentum = mean(motion.velocities)
    energy = mean(0.5 * (motion.velocities**2).sum(axis=2) - motion.points @ GRAVITY)
    # In the substep to each frame but the first.
    momentum_change = np.linalg.norm(np.diff(momentum, axis=0), axis=2)
    energy_change = np.abs(np.diff(energy, axis=0))

    def around(changed: BoolArray) -> LevelChanges:
        # Changes with a substep before them and two after.
        frame, curve = np.nonzero(changed[:-2])
        frame = frame + 1

        def means(values: FloatArray) -> FloatArray:
            return np.array([values[frame + k, curve].mean() if len(frame) else np.nan for k in (-1, 0, 1)])

        return LevelChanges(len(frame), means(momentum_change), means(energy_change))

    own_level = motion.levels.max(axis=0)
    split: BoolArray = motion.levels == own_level
    return around(split[1:] & ~split[:-1]), around(~split[1:] & split[:-1])
