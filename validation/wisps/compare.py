"""How far two caches of one scene are apart, whether anything in them pops, and what changes of wisps do to momentum and energy."""

from dataclasses import dataclass

import numpy as np

from hairbake_validate.cache import HEAD, LEVEL, TRANSFORM, Cache, read_frame

GRAVITY = np.array([0.0, -9.81, 0.0])
"""Of scenes whose Y axis is up, m/s²."""


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


def locks(run: Run, count: int) -> np.ndarray:
    """Which of so many locks each curve belongs to, by its root in the first frame: the nearest of roots that are far from each other."""
    roots = run.points[0][np.cumsum(run.counts) - run.counts]
    nearest, lock = np.full(len(roots), np.inf), np.zeros(len(roots), dtype=int)
    for k in range(min(count, len(roots))):
        apart = np.linalg.norm(roots - roots[np.argmax(nearest)], axis=1)
        lock[apart < nearest] = k
        nearest = np.minimum(nearest, apart)
    return lock


def lock_distances(full: Run, other: Run) -> np.ndarray:
    """Distance of the mean curves of locks in two runs, over the mean length; `frames × locks × 9` places along them; locks count alike. What each curve does for itself, and
    would do otherwise for any other reason, is not in it.
    """
    # Each of eight curves at least, on average.
    lock = locks(full, int(np.clip(len(full.counts) // 8, 1, 60)))
    starts = np.cumsum(full.counts) - full.counts
    places = starts[:, None] + np.round((full.counts[:, None] - 1) * np.linspace(0, 1, 9)).astype(int)
    apart = full.points[:, places] - other.points[:, places]
    means = [apart[:, lock == k].mean(axis=1) for k in np.unique(lock)]
    return np.linalg.norm(np.stack(means, axis=1), axis=3) / full.lengths.mean()


def pops(full: Run, run: Run, quantile: float = 0.999) -> tuple[float, float]:
    """High quantile of the points' accelerations over that of the full bake in the same frames: those with most splits and merges (the upper
    quarter), and those with least. What pops is above 1 in the former alone; what is merely stirred is so in the full bake too.
    """
    accelerations = [np.linalg.norm(np.diff(r.points, 2, axis=0), axis=2) for r in (run, full)]
    changes = np.array([f["splits"] + f["merges"] for f in run.figures])
    # A second difference is of three frames, of which the changes are in two.
    changes = changes[1:-1] + changes[2:]
    order = np.argsort(changes, kind="stable")
    quarter = max(len(order) // 4, 1)

    def ratio(frames: np.ndarray) -> float:
        own, plain = (np.quantile(a[frames], quantile) for a in accelerations)
        return float(own / plain)

    return ratio(order[-quarter:]), ratio(order[:quarter])


def rest(run: Run) -> tuple[int, float]:
    """Nodes that move by themselves in the last frame, and the 95th percentile of the points' speeds up to it, seen from the head, m/s."""
    speeds = np.linalg.norm(run.points[-1] - run.points[-2], axis=1) * run.fps
    return run.figures[-1]["active_nodes"], float(np.quantile(speeds, 0.95))


@dataclass(frozen=True)
class Motion:
    """The guides of a cache whose frames are its sub-steps, in the world."""

    points: np.ndarray
    """`frames × points × 3`, m."""
    velocities: np.ndarray
    """The same, m/s."""
    counts: np.ndarray
    """Points of each curve."""
    levels: np.ndarray
    """Level of the wisp that each guide moves with, `frames × curves`."""


def read_motion(cache: Cache) -> Motion:
    """At the frames of the shot."""
    guides = cache.curves[-1]
    frames = [read_frame(cache, frame).values for frame in range(cache.first, cache.last + 1)]
    scale = cache.metres_per_unit
    return Motion(
        points=np.array([f[f"{guides.path}.points"] for f in frames], dtype=float) * scale,
        velocities=np.array([f[f"{guides.path}.velocities"] for f in frames], dtype=float) * scale,
        counts=guides.counts,
        levels=np.array([f[f"{guides.path}.{LEVEL}"] for f in frames]),
    )


@dataclass(frozen=True)
class Change:
    """What sub-steps around changes of one kind do, on average over the guides that changed: per mass, as points of a guide weigh alike."""

    count: int
    momentum: np.ndarray
    """Magnitude of the change of momentum in the last sub-step before it, in the one from it on, and in the next, m/s."""
    energy: np.ndarray
    """Magnitude of the change of kinetic energy and that of height, J/kg."""


def changes(motion: Motion) -> tuple[Change, Change]:
    """Guides that came away, and guides that joined. A jump would show in the sub-step from the change on alone."""
    starts = np.cumsum(motion.counts) - motion.counts

    def mean(values: np.ndarray) -> np.ndarray:
        counts = motion.counts.reshape((1, -1) + (1,) * (values.ndim - 2))
        return np.add.reduceat(values, starts, axis=1) / counts

    momentum = mean(motion.velocities)
    energy = mean(0.5 * (motion.velocities**2).sum(axis=2) - motion.points @ GRAVITY)
    # In the step to each frame but the first.
    step = {
        "momentum": np.linalg.norm(np.diff(momentum, axis=0), axis=2),
        "energy": np.abs(np.diff(energy, axis=0)),
    }
    own = motion.levels.max(axis=0)

    def around(changed: np.ndarray) -> Change:
        # Frames at which it is another than at the frame before, with a step before them and two after.
        frame, curve = np.nonzero(changed[:-2])
        frame = frame + 1
        means = {
            name: np.array([of[frame + k, curve].mean() if len(frame) else np.nan for k in (-1, 0, 1)])
            for name, of in step.items()
        }
        return Change(len(frame), **means)

    free = motion.levels == own
    return around(free[1:] & ~free[:-1]), around(~free[1:] & free[:-1])
