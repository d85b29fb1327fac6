"""Checks of a frame against its neighbours: velocities and one-frame jumps."""

from collections.abc import Callable, Iterator

import numpy as np

from . import tolerances
from .cache import HEAD, TRANSFORM
from .geometry import transformed
from .report import Check, Finding
from .window import Window

VELOCITIES = Check(
    "velocities",
    "velocities integrate to the displacement of the points",
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)
SPIKES = Check(
    "spikes", "no curve jumps for one frame or between two, seen from the head", tolerances.SPIKE_M, "m"
)


def velocities(window: Window) -> Iterator[Finding]:
    """Simpson's rule: p(+1) − p(−1) = (v(−1) + 4 v(0) + v(+1)) / 3 frame intervals. The median over the points
    finds a wrong unit, sign or frame and is blind to single points that hit something within the two frames."""
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for curves in window.cache.curves:
        before, after = (window.get(curves.path, "points", offset) for offset in (-1, 1))
        rates = [window.get(curves.path, "velocities", offset) for offset in (-1, 0, 1)]
        if before is None or after is None or any(rate is None for rate in rates):
            continue
        mean = (after.astype(float) - before) * window.cache.fps / 2
        simpson = (rates[0].astype(float) + 4 * rates[1] + rates[2]) / 6
        residual = float(np.median(np.linalg.norm(simpson - mean, axis=1)))
        speed = np.sqrt(np.einsum("ij,ij->", mean, mean) / len(mean))
        yield Finding(VELOCITIES, residual / max(speed, floor), frame=window.frame, prim=curves.path)


def spikes(window: Window) -> Iterator[Finding]:
    """A jump throws the second difference one way and, a frame later, the other way; acceleration by forces or an
    impact does not. Each curve's largest jump counts if it stands out of the frame's median over the curves."""
    for curves in window.cache.curves:
        seen = [in_head(window, curves.path, offset) for offset in (-1, 0, 1, 2)]
        if any(points is None for points in seen):
            continue
        first = seen[2] - 2 * seen[1] + seen[0]
        second = seen[3] - 2 * seen[2] + seen[1]
        size = np.linalg.norm(first, axis=1)
        back = -np.einsum("ij,ij->i", first, second) / np.maximum(size, np.finfo(float).tiny)
        jump = np.maximum.reduceat(np.minimum(size, np.maximum(0, back)), curves.starts)
        jump[jump <= tolerances.SPIKE_OVER_MEDIAN * np.median(jump)] = 0
        at = int(np.argmax(jump))
        yield Finding(
            SPIKES,
            float(jump[at]) * window.cache.metres_per_unit,
            frame=window.frame,
            prim=curves.path,
            curve=at,
        )


def in_head(window: Window, path: str, offset: int) -> np.ndarray | None:
    """Points of a frame in the head's space, f64."""
    points, head = window.get(path, "points", offset), window.get(HEAD, TRANSFORM, offset)
    return None if points is None or head is None else transformed(points, np.linalg.inv(head))


MOTION: dict[Check, Callable[[Window], Iterator[Finding]]] = {VELOCITIES: velocities, SPIKES: spikes}
"""The checks of neighbouring frames and what carries them out."""
