"""Checks of a frame against its neighbours: velocities and one-frame jumps."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from . import cache, tolerances
from .cache import HEAD, TRANSFORM, Curves
from .checks_frame import root_offsets, worst
from .geometry import transformed
from .report import Check, Finding
from .window import Window

VELOCITIES = Check(
    "velocities",
    "velocities integrate to the displacement of the points",
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)
CURVE_VELOCITIES = Check(
    "curve_velocities",
    "the same for nineteen curves in twenty, each for itself",
    tolerances.CURVE_VELOCITY_RESIDUAL,
    "of its RMS speed",
)
SUB_FRAMES = Check(
    "sub_frames",
    "velocities integrate to the displacement between the moments of a frame",
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)
SUB_FRAME_ROOTS = Check(
    "sub_frame_roots",
    "at the moments of a frame every root is its rest point on the head transform",
    tolerances.ROOT_OFFSET_M,
    "m",
)
ACCELERATIONS = Check(
    "accelerations",
    "accelerations are those of the way to the next frame",
    tolerances.ACCELERATION_RESIDUAL,
    "of their RMS",
)
SUB_FRAME_ACCELERATIONS = Check(
    "sub_frame_accelerations",
    "with velocities and accelerations the points of a moment come to those of the next",
    tolerances.SUB_FRAME_ACCELERATION_RESIDUAL,
    "of their RMS",
)
SPIKES = Check(
    "spikes", "no curve jumps for one frame or between two, seen from the head", tolerances.SPIKE_M, "m"
)


def velocities(window: Window) -> Iterator[Finding]:
    """Simpson's rule: p(+1) − p(−1) = (v(−1) + 4 v(0) + v(+1)) / 3 frame intervals. The median over the points
    finds a wrong unit, sign or frame and is blind to single points that hit something within the two frames.

    Hair that swings several times a second, as in a landing, is sampled too coarsely for the rule, and so is all of it where a head trembles in a slow
    moment; how far the rule may be off tells the trapezoidal one, by its difference from it and from the displacement: of the smaller, `tolerances.SIMPSON_ERROR` is
    granted.
    """
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for curves, mean, residual in residuals(window):
        speed = np.sqrt(np.einsum("ij,ij->", mean, mean) / len(mean))
        value = float(np.median(residual)) / max(speed, floor)
        yield Finding(VELOCITIES, value, frame=window.frame, prim=curves.path)


def curve_velocities(window: Window) -> Iterator[Finding]:
    """A minority of curves with wrong velocities leaves the median over all points as it is. Root mean squares over each
    curve; the curve at the 95th percentile is named, since a few may hit something within the two frames.
    """
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for curves, mean, residual in residuals(window):

        def root_mean_square(squares: np.ndarray, curves: Curves = curves) -> np.ndarray:
            return np.sqrt(np.add.reduceat(squares, curves.starts) / curves.counts)

        speed = root_mean_square(np.einsum("ij,ij->i", mean, mean))
        share = root_mean_square(residual**2) / np.maximum(speed, floor)
        at = int(np.argsort(share)[int(np.ceil(0.95 * (len(share) - 1)))])
        yield Finding(CURVE_VELOCITIES, float(share[at]), frame=window.frame, prim=curves.path, curve=at)


def residuals(window: Window) -> Iterator[tuple[Curves, np.ndarray, np.ndarray]]:
    """Curves, their points' mean velocities over two frame intervals (`N × 3`), and how much farther Simpson's mean is off from it than it may be (`N`)."""
    for curves in window.cache.curves:
        before, after = (window.get(curves.path, "points", offset) for offset in (-1, 1))
        rates = [window.get(curves.path, "velocities", offset) for offset in (-1, 0, 1)]
        if before is None or after is None or any(rate is None for rate in rates):
            continue
        mean = (after.astype(float) - before) * window.cache.fps / 2
        simpson = (rates[0].astype(float) + 4 * rates[1] + rates[2]) / 6
        trapezoidal = (rates[0].astype(float) + rates[2]) / 2
        off, *coarse = (
            np.linalg.norm(a - b, axis=1)
            for a, b in ((simpson, mean), (simpson, trapezoidal), (trapezoidal, mean))
        )
        # Where one frame alone is wrong, the trapezoidal rule is not, and where all are wrong alike, the two rules agree.
        yield curves, mean, np.maximum(off - tolerances.SIMPSON_ERROR * np.minimum(*coarse), 0)


def sub_frames(window: Window) -> Iterator[Finding]:
    """Between two moments, so soon after each other, the mean of their velocities does. The median over the points. Those of the solver's own moments are of
    the way there.
    """
    if window.cache.stepwise:
        return
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for curves in window.cache.curves:
        points, rates = (window.moments(curves.path, name) for name in ("points", "velocities"))
        if [time for time, _ in points] != [time for time, _ in rates]:
            continue
        moments = [(time, point.astype(float), rate) for (time, point), (_, rate) in zip(points, rates)]
        for (start, before, first), (end, after, last) in pairwise(moments):
            mean = (after - before) * window.cache.fps / (end - start)
            residual = np.linalg.norm((first.astype(float) + last) / 2 - mean, axis=1)
            speed = np.sqrt(np.einsum("ij,ij->", mean, mean) / len(mean))
            value = float(np.median(residual)) / max(speed, floor)
            yield Finding(SUB_FRAMES, value, frame=window.frame, prim=curves.path)


def sub_frame_roots(window: Window) -> Iterator[Finding]:
    """As `roots` at the frame, at the moments after it."""
    heads = dict(window.moments(HEAD, TRANSFORM))
    for curves in window.cache.curves:
        for time, points in window.moments(curves.path, "points")[1:]:
            if time in heads:
                yield root_offsets(window, SUB_FRAME_ROOTS, curves, points, heads[time])


def accelerations(window: Window) -> Iterator[Finding]:
    """Where a frame has one moment, they tell how the shutter ends: a cubic's second derivative a third of the way there. A cache without has none to check."""
    end = window.cache.settings.get("shutter", 0.5) / 3
    for curves in window.cache.curves:
        found = window.get(curves.path, cache.ACCELERATIONS)
        points, rates = (
            [window.get(curves.path, name, i) for i in (0, 1)] for name in ("points", "velocities")
        )
        if found is None or len(window.moments(curves.path, cache.ACCELERATIONS)) > 1:
            continue
        if any(value is None for value in (*points, *rates)):
            continue
        way = 6 * (1 - 2 * end) * (points[1].astype(float) - points[0]) * window.cache.fps
        wanted = (way - (4 - 6 * end) * rates[0] - (2 - 6 * end) * rates[1]) * window.cache.fps
        yield acceleration_finding(window, ACCELERATIONS, curves, found, wanted)


def sub_frame_accelerations(window: Window) -> Iterator[Finding]:
    """From each moment of a frame to the next, and from the last to the one before."""
    for curves in window.cache.curves:
        parts = [window.moments(curves.path, name) for name in ("points", "velocities", cache.ACCELERATIONS)]
        times = [[time for time, _ in part] for part in parts]
        if len(times[0]) < 2 or times[1:] != times[:-1]:
            continue
        moments = [
            (time, *(value.astype(float) for value in values))
            for time, *values in zip(times[0], *([value for _, value in part] for part in parts), strict=True)
        ]
        for (start, before, rate, found), (end, after, *_) in [*pairwise(moments), moments[:-3:-1]]:
            step = (end - start) / window.cache.fps
            wanted = 2 * (after - before - rate * step) / step**2
            yield acceleration_finding(window, SUB_FRAME_ACCELERATIONS, curves, found, wanted)


def acceleration_finding(
    window: Window, check: Check, curves: Curves, found: np.ndarray, wanted: np.ndarray
) -> Finding:
    """The median over the points of what accelerations are off by, relative to the root mean square of what they are to be."""
    floor = tolerances.ACCELERATION_FLOOR_M_S2 / window.cache.metres_per_unit
    size = np.sqrt(np.einsum("ij,ij->", wanted, wanted) / len(wanted))
    residual = float(np.median(np.linalg.norm(found - wanted, axis=1)))
    return Finding(check, residual / max(size, floor), frame=window.frame, prim=curves.path)


def spikes(window: Window) -> Iterator[Finding]:
    """A jump throws the second difference one way and, a frame later, the other way, and between the two frames a point
    goes farther than its speeds around them take it. Hair whipped by a landing does the first, not the second: its
    velocities tell of the motion. Each curve's largest jump counts.
    """
    for curves in window.cache.curves:
        seen = [in_head(window, curves.path, offset) for offset in (-1, 0, 1, 2)]
        speeds = [speed_in_head(window, curves.path, offset) for offset in (-1, 0, 1, 2)]
        known = [speed for speed in speeds if speed is not None]
        if any(values is None for values in seen) or not known:
            continue
        first = seen[2] - 2 * seen[1] + seen[0]
        second = seen[3] - 2 * seen[2] + seen[1]
        size = np.linalg.norm(first, axis=1)
        back = -np.einsum("ij,ij->i", first, second) / np.maximum(size, np.finfo(float).tiny)
        reach = tolerances.SPIKE_SPEED * np.maximum.reduce(known) / window.cache.fps
        beyond = np.linalg.norm(seen[2] - seen[1], axis=1) - reach
        jump = np.maximum(0, np.minimum.reduce([size, back, beyond]))
        yield worst(window, SPIKES, curves, jump * window.cache.metres_per_unit)


def in_head(window: Window, path: str, offset: int) -> np.ndarray | None:
    """Points of a frame in the head's space, f64."""
    points, head = window.get(path, "points", offset), window.get(HEAD, TRANSFORM, offset)
    return None if points is None or head is None else transformed(points, np.linalg.inv(head))


def speed_in_head(window: Window, path: str, offset: int) -> np.ndarray | None:
    """Speed of the points of a frame as seen from the head, whose own velocity is the central difference."""
    local, rates = in_head(window, path, offset), window.get(path, "velocities", offset)
    heads = [window.get(HEAD, TRANSFORM, offset + step) for step in (-1, 1)]
    if local is None or rates is None or any(head is None for head in heads):
        return None
    before, after = (transformed(local, head) for head in heads)
    return np.linalg.norm(rates - (after - before) * window.cache.fps / 2, axis=1)


MOTION: dict[Check, Callable[[Window], Iterator[Finding]]] = {
    VELOCITIES: velocities,
    CURVE_VELOCITIES: curve_velocities,
    SUB_FRAMES: sub_frames,
    SUB_FRAME_ROOTS: sub_frame_roots,
    ACCELERATIONS: accelerations,
    SUB_FRAME_ACCELERATIONS: sub_frame_accelerations,
    SPIKES: spikes,
}
"""The checks of neighbouring frames and what carries them out."""
