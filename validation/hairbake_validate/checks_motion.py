"""Checks of the motion: velocities, accelerations, and jumps."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from . import cache, tolerances
from .cache import GUIDES, HAIR, HEAD, TRANSFORM, Curves
from .checks_frame import root_offsets, skin_root_offsets, worst
from .geometry import Array, FloatArray, dot, norms, screw, transformed
from .report import Check, Finding
from .window import Window

UNITS_AND_TIMES = "check that velocities are per second, in stage units, and of the same frame as the points"

VELOCITIES = Check(
    "velocities",
    "velocities integrate to the displacement of the points",
    UNITS_AND_TIMES,
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)
CURVE_VELOCITIES = Check(
    "curve_velocities",
    "velocities integrate to the displacement in at least 95 % of the curves",
    UNITS_AND_TIMES,
    tolerances.CURVE_VELOCITY_RESIDUAL,
    "of its RMS speed",
)
SUB_FRAMES = Check(
    "sub_frames",
    "velocities integrate to the displacement between the samples of a frame",
    UNITS_AND_TIMES,
    tolerances.VELOCITY_RESIDUAL,
    "of RMS speed",
)
SUB_FRAME_ROOTS = Check(
    "sub_frame_roots",
    "at the samples of a frame every held root is at its rest point under the head transform",
    "use the head transforms that the samples were baked with, and move no roots",
    tolerances.ROOT_OFFSET_M,
    "m",
)
SUB_FRAME_SKIN_ROOTS = Check(
    "sub_frame_skin_roots",
    "at the samples of a frame every held root is where its place on the skin carries it",
    "bake these frames again with the meshes that they show, and move no roots",
    tolerances.SKIN_ROOT_OFFSET_M,
    "m",
)
ACCELERATIONS = Check(
    "accelerations",
    "accelerations match the motion to the next frame",
    "check that accelerations are per second squared, in stage units, and of the same frame as the points",
    tolerances.ACCELERATION_RESIDUAL,
    "of their RMS",
)
SUB_FRAME_ACCELERATIONS = Check(
    "sub_frame_accelerations",
    "points, velocities and accelerations of a sample extrapolate to the points of the next",
    "check that accelerations are per second squared, in stage units, and of the same sample as the points",
    tolerances.SUB_FRAME_ACCELERATION_RESIDUAL,
    "of their RMS",
)
SPIKES = Check(
    "spikes",
    "no curve jumps for one frame or between two frames, relative to the head",
    "bake these frames with more substeps, or check the animation for jumps",
    tolerances.SPIKE_M,
    "m",
)

VELOCITY_PEAKS = Check(
    "velocity_peaks",
    "no point is faster than its positions at the neighbouring frames account for",
    "bake these frames again: renderers draw such a point as a streak",
    1.0,
    "of the allowed speed",
)
POPS = Check(
    "pops",
    "no render strand jumps there and back within two frames as neither its guides nor its speeds do",
    "bake these frames again, or use more guides where strands jump",
    tolerances.POP_M,
    "m",
)


@dataclass(frozen=True)
class Residual:
    """Velocities of curves compared with the displacement over two frame intervals."""

    curves: Curves
    speeds: list[FloatArray]
    """Speeds that the excess is measured against, `N`: that of each point by its displacement; and because
    frames may not resolve the head, its jump of velocity there, a share of one a frame away, and a share of
    its speed a frame away."""
    excess: FloatArray
    """Distance of the mean velocity by Simpson's rule from it, less the allowed sampling error, `N`."""


def velocities(window: Window) -> Iterator[Finding]:
    """Compares velocities with displacements by Simpson's rule.

    p(+1) − p(−1) = (v(−1) + 4 v(0) + v(+1)) / 3, in frame intervals.

    The median over points detects a wrong unit, sign or frame, and ignores points that collide within the two
    frames.
    """
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for residual in residuals(window):
        value = relative_residual(residual.excess, residual.speeds, floor)
        yield Finding(VELOCITIES, value, frame=window.frame, prim=residual.curves.path)


def curve_velocities(window: Window) -> Iterator[Finding]:
    """Compares root mean squares over each curve, and names the curve at the 95th percentile.

    A minority of curves with wrong velocities does not change the median over all points. A few curves may
    collide within the two frames.
    """
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for residual in residuals(window):
        curves = residual.curves
        values = (residual.excess, *residual.speeds)
        excess, *speeds = (np.sqrt(np.add.reduceat(v**2, curves.starts) / curves.counts) for v in values)
        share = excess / np.maximum(np.max(speeds, axis=0), floor)
        at = int(np.argsort(share)[int(np.ceil(0.95 * (len(share) - 1)))])
        yield Finding(CURVE_VELOCITIES, float(share[at]), frame=window.frame, prim=curves.path, curve=at)


def residuals(window: Window) -> Iterator[Residual]:
    """Residuals of Simpson's rule around the frame."""
    for curves in window.cache.curves:
        residual = window.once(residual_of, curves)
        if residual is not None:
            yield residual


def residual_of(window: Window, curves: Curves, offset: int) -> Residual | None:
    """The residual of Simpson's rule around a frame; None without valid values in the three frames."""
    found = simpson_residual(
        [window.get(curves.path, "points", offset + step) for step in (-1, 1)],
        [window.get(curves.path, "velocities", offset + step) for step in (-1, 0, 1)],
        window.cache.fps,
    )
    if found is None:
        return None
    speed, excess = found
    of_head = [window.once(measure, curves, offset) for measure in (head_jump, ringing, speed_beside)]
    return Residual(curves, [speed, *(speed for speed in of_head if speed is not None)], excess)


def simpson_residual(
    places: Sequence[FloatArray | None], rates: Sequence[FloatArray | None], fps: float
) -> tuple[FloatArray, FloatArray] | None:
    """Speeds by displacement, and by how much Simpson's rule is off it beyond the sampling error, `N` each.

    `places` are those at the frames before and after, `rates` the velocities at the three frames. None if any
    is missing.

    Where motion is sampled too coarsely for Simpson's rule, as in a landing or a tremor, the trapezoidal rule
    estimates its error: `tolerances.SIMPSON_ERROR` times the smaller of its differences from Simpson's rule
    and from the displacement is allowed. If the centre frame alone is wrong, the trapezoidal rule matches the
    displacement; if all three are wrong alike, the two rules agree. Neither is excused.
    """
    before, after = places
    v0, v1, v2 = rates
    if before is None or after is None or v0 is None or v1 is None or v2 is None:
        return None
    mean = (after.astype(float) - before) * fps / 2
    trapezoidal = (v0.astype(float) + v2) / 2
    simpson = (trapezoidal + 2 * v1.astype(float)) / 3
    pairs = ((simpson, mean), (simpson, trapezoidal), (trapezoidal, mean))
    error, *sampling = (norms(a - b) for a, b in pairs)
    return norms(mean), np.maximum(error - tolerances.SIMPSON_ERROR * np.minimum(*sampling), 0)


def relative_residual(excess: FloatArray, speeds: Iterable[FloatArray], floor: float) -> float:
    """The median of an excess over points, relative to the largest RMS of their speeds, at least `floor`."""
    largest = max(root_mean_square(speed) for speed in speeds)
    return float(np.median(excess)) / max(largest, floor)


def ringing(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """`tolerances.HEAD_RING` times the jump of the head's velocity around the frame before or after, `N`."""
    beside = [window.once(head_jump, curves, offset + step) for step in (-1, 1)]
    known = [jump for jump in beside if jump is not None]
    return tolerances.HEAD_RING * np.maximum.reduce(known) if known else None


def speed_beside(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """`tolerances.HEAD_SPEED_BESIDE` times the larger speed that the head gives a frame before or after, `N`.

    Central differences of carried positions; None near the ends. Where the head starts to whip from frame to
    frame, the speed at its first frame is a small part of that a frame later, and so uncertain.
    """
    points = window.once(in_head, curves, offset)
    heads = [window.head(offset + step) for step in (-2, 0, 2)]
    known = [head for head in heads if head is not None]
    if points is None or len(known) < len(heads):
        return None
    speeds = [norms(transformed(points, step)) for step in np.diff(known, axis=0)]
    share = tolerances.HEAD_SPEED_BESIDE * window.cache.fps / 2
    return share * np.maximum(*speeds)


def head_jump(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """Jump of the velocity that the head gives to points, within a frame, `N`; None near the ends.

    A jump between two frames is the sum of the second differences of carried positions at both. What the
    differences at the three frames before and the three after account for, as in a smooth motion, is no jump:
    `tolerances.HEAD_JUMP_SMOOTH` times the root of their sum of squares.
    """
    points = window.once(in_head, curves, offset)
    heads = [window.head(offset + step) for step in range(-5, 6)]
    if points is None:
        return None
    jumps = []
    for around in (heads[:-1], heads[1:]):
        known = [head for head in around if head is not None]
        if len(known) == len(around):
            bends = [transformed(points, bend) for bend in np.diff(known, 2, axis=0)]
            smooth = np.sqrt(sum(dot(bends[i], bends[i]) for i in (0, 1, 2, 5, 6, 7)))
            jumps.append(norms(bends[3] + bends[4]) - tolerances.HEAD_JUMP_SMOOTH * smooth)
    return np.maximum.reduce([np.zeros(len(points)), *jumps]) * window.cache.fps if jumps else None


def sub_frames(window: Window) -> Iterator[Finding]:
    """Compares the mean velocity of consecutive samples of a frame with the displacement, by the median.

    Velocities at the solver's own steps are not compared: they are the displacement of the step.
    """
    if window.cache.has_solver_steps:
        return
    floor = tolerances.VELOCITY_FLOOR_M_S / window.cache.metres_per_unit
    for curves in window.cache.curves:
        points, rates = (window.samples(curves.path, name) for name in ("points", "velocities"))
        if [time for time, _ in points] != [time for time, _ in rates]:
            continue
        samples = [
            (time, point.astype(float), rate) for (time, point), (_, rate) in zip(points, rates, strict=True)
        ]
        for (start, before, first), (end, after, last) in pairwise(samples):
            mean = (after - before) * window.cache.fps / (end - start)
            residual = norms((first.astype(float) + last) / 2 - mean)
            value = float(np.median(residual)) / max(root_mean_square(norms(mean)), floor)
            yield Finding(SUB_FRAMES, value, frame=window.frame, prim=curves.path)


def sub_frame_roots(window: Window) -> Iterator[Finding]:
    """Measures the distance of roots from where they are carried at the samples after the frame."""
    heads = {} if window.reference.skins else dict(window.samples(HEAD, TRANSFORM))
    for curves in window.cache.curves:
        for time, points in window.samples(curves.path, "points")[1:]:
            if time in heads:
                carried = transformed(curves.rest, heads[time])
                yield root_offsets(window, SUB_FRAME_ROOTS, curves, points, carried)


def sub_frame_skin_roots(window: Window) -> Iterator[Finding]:
    """Measures the distance of roots from where skins carry them at the samples after the frame."""
    for time, _ in window.samples(HEAD, TRANSFORM)[1:]:
        yield from skin_root_offsets(window, SUB_FRAME_SKIN_ROOTS, partial(value_at, window, time))


def value_at(window: Window, time: float, prim: str, name: str) -> Array | None:
    """Value of an attribute at a sample of the centre frame's file; None if it is missing or not valid."""
    return dict(window.samples(prim, name)).get(time)


def accelerations(window: Window) -> Iterator[Finding]:
    """Compares accelerations with the cubic to the next frame, in caches with one sample a frame.

    They extrapolate to the end of the shutter: the cubic's second derivative at a third of the shutter.
    """
    end = window.cache.settings.get("shutter", 0.5) / 3
    for curves in window.cache.curves:
        found = window.get(curves.path, cache.ACCELERATIONS)
        p0, p1 = (window.get(curves.path, "points", offset) for offset in (0, 1))
        v0, v1 = (window.get(curves.path, "velocities", offset) for offset in (0, 1))
        if found is None or len(window.samples(curves.path, cache.ACCELERATIONS)) > 1:
            continue
        if p0 is None or p1 is None or v0 is None or v1 is None:
            continue
        rate = 6 * (1 - 2 * end) * (p1.astype(float) - p0) * window.cache.fps
        expected = (rate - (4 - 6 * end) * v0 - (2 - 6 * end) * v1) * window.cache.fps
        yield acceleration_residual(window, ACCELERATIONS, curves, found, expected)


def sub_frame_accelerations(window: Window) -> Iterator[Finding]:
    """Compares accelerations from each sample of a frame to the next, and from the last one backwards."""
    for curves in window.cache.curves:
        parts = [window.samples(curves.path, name) for name in ("points", "velocities", cache.ACCELERATIONS)]
        times = [[time for time, _ in part] for part in parts]
        if len(times[0]) < 2 or times[1:] != times[:-1]:
            continue
        points, rates, found = ([value.astype(float) for _, value in part] for part in parts)
        last = len(points) - 1
        for i, j in [*pairwise(range(last + 1)), (last, last - 1)]:
            step = (times[0][j] - times[0][i]) / window.cache.fps
            expected = 2 * (points[j] - points[i] - rates[i] * step) / step**2
            yield acceleration_residual(window, SUB_FRAME_ACCELERATIONS, curves, found[i], expected)


def acceleration_residual(
    window: Window, check: Check, curves: Curves, found: FloatArray, expected: FloatArray
) -> Finding:
    """The median difference of accelerations over points, relative to the RMS of the expected ones."""
    floor = tolerances.ACCELERATION_FLOOR_M_S2 / window.cache.metres_per_unit
    residual = float(np.median(norms(found - expected)))
    value = residual / max(root_mean_square(norms(expected)), floor)
    return Finding(check, value, frame=window.frame, prim=curves.path)


def spikes(window: Window) -> Iterator[Finding]:
    """Measures each curve's largest one-frame jump in the space of the head.

    A jump is a whip of which the speeds around it do not account for the way. Where the velocity of the head
    jumps, as in an impact, hair may be faster between the frames by as much. Hair that swings within few
    frames has second differences at both frames beside, too. Render strands whip as far as the guides that
    they follow.
    """
    found = {curves.path: (curves, window.once(whip, curves)) for curves in window.cache.curves}
    guides, of_guides = found.get(GUIDES, (None, None))
    followed = window.reference.followed
    for path, (curves, whips) in found.items():
        way = window.once(way_beyond_speeds, curves)
        if whips is None or way is None:
            continue
        accounted: FloatArray | float = 0.0
        if path == HAIR and guides is not None and of_guides is not None and followed is not None:
            largest = np.maximum.reduceat(of_guides, guides.starts)[followed].max(axis=1)
            accounted = np.repeat(largest, curves.counts)
        jump = np.maximum(0, np.minimum(whips, way) - accounted)
        yield worst(window, SPIKES, curves, jump * window.cache.metres_per_unit)


def whip(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """Opposite parts of the second differences at a frame and the next, in the space of the head, `N`."""
    first, second = (window.once(bend, curves, offset + step) for step in (0, 1))
    if first is None or second is None:
        return None
    size = norms(first)
    back = -dot(first, second) / np.maximum(size, np.finfo(float).tiny)
    opposite: FloatArray = np.maximum(0, np.minimum(size, back))
    return opposite


def way_beyond_speeds(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """How far points go from a frame to the next beyond what the speeds around account for, `N`."""
    here, there = (window.once(in_head, curves, offset + step) for step in (0, 1))
    speeds = [window.once(speed_in_head, curves, offset + step) for step in (-1, 0, 1, 2)]
    known = [speed for speed in speeds if speed is not None]
    if here is None or there is None or not known:
        return None
    jumps = [window.once(head_jump, curves, offset + step) for step in (0, 1)]
    left = np.maximum.reduce([np.zeros(len(here)), *(jump for jump in jumps if jump is not None)])
    fastest = np.maximum.reduce(known)
    reach = np.maximum(tolerances.SPIKE_SPEED * fastest, fastest + left) / window.cache.fps
    beside = [window.once(bend, curves, offset + step) for step in (-1, 2)]
    swings = [norms(swing) for swing in beside if swing is not None]
    if swings:
        reach += tolerances.SPIKE_SWING * np.minimum.reduce(swings)
    beyond: FloatArray = norms(there - here) - reach
    return beyond


def velocity_peaks(window: Window) -> Iterator[Finding]:
    """Compares every point's speed with that of the central difference of its positions."""
    for curves in window.cache.curves:
        shares = speed_shares(window, curves)
        if shares is not None:
            yield worst(window, VELOCITY_PEAKS, curves, shares)


def speed_shares(window: Window, curves: Curves) -> FloatArray | None:
    """Speed of each point relative to the largest that its positions account for, `N`."""
    floor = tolerances.VELOCITY_PEAK_M_S / window.cache.metres_per_unit
    before, after = (window.get(curves.path, "points", offset) for offset in (-1, 1))
    rates = window.get(curves.path, "velocities")
    if before is None or after is None or rates is None:
        return None
    moved = norms(after.astype(float) - before) * window.cache.fps / 2
    shares: FloatArray = norms(rates) / np.maximum(tolerances.VELOCITY_PEAK * moved, moved + floor)
    return shares


def pops(window: Window) -> Iterator[Finding]:
    """Measures how far each strand jumps there and back around the frame beyond its guides and its speeds.

    Hair that whips there and back within two frames moves continuously: it is fast in the frames around.
    """
    for hair in window.cache.curves:
        beyond = unaccounted_jumps(window, hair) if hair.path == HAIR else None
        if beyond is not None:
            yield worst(window, POPS, hair, beyond)


def unaccounted_jumps(window: Window, hair: Curves) -> FloatArray | None:
    """How far each point of the render strands jumps there and back without an account of it, m, `N`.

    Its guides account for their largest jump, its speeds at the frames before and after for half the way that
    it goes in a frame at the larger of them.
    """
    guides = next((curves for curves in window.cache.curves if curves.path == GUIDES), None)
    followed = window.reference.followed
    if guides is None or followed is None:
        return None
    jumps = [there_and_back(window, curves) for curves in (hair, guides)]
    if jumps[0] is None or jumps[1] is None:
        return None
    of_guides = np.maximum.reduceat(jumps[1], guides.starts)[followed].max(axis=1)
    accounts = [np.repeat(of_guides, hair.counts)]
    speeds = [window.once(speed_in_head, hair, offset) for offset in (-1, 1)]
    accounts += [tolerances.POP_SPEED * speed / window.cache.fps for speed in speeds if speed is not None]
    beyond: FloatArray = np.maximum(0, jumps[0] - np.maximum.reduce(accounts))
    beyond *= window.cache.metres_per_unit
    return beyond


def there_and_back(window: Window, curves: Curves) -> FloatArray | None:
    """How far each point jumps there and back around the frame, in the space of the head, `N`.

    The geometric mean of the steps to the frame and back, times the root of the cosine between them.
    """
    before, now, after = (window.once(in_head, curves, offset) for offset in (-1, 0, 1))
    if before is None or now is None or after is None:
        return None
    back: FloatArray = np.sqrt(np.maximum(0, dot(now - before, now - after)))
    return back


def in_head(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """Points of a frame in the space of the head, f64."""
    points, head = window.get(curves.path, "points", offset), window.get(HEAD, TRANSFORM, offset)
    return None if points is None or head is None else transformed(points, np.linalg.inv(head))


def bend(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """Second difference of the points around a frame, in the space of the head."""
    before, here, after = (window.once(in_head, curves, offset + step) for step in (-1, 0, 1))
    return None if before is None or here is None or after is None else after - 2 * here + before


def speed_in_head(window: Window, curves: Curves, offset: int) -> FloatArray | None:
    """Speed of the points relative to the head, which moves by a screw from frame to frame."""
    points, rates = (window.get(curves.path, name, offset) for name in ("points", "velocities"))
    before, head, after = (window.get(HEAD, TRANSFORM, offset + step) for step in (-1, 0, 1))
    if points is None or rates is None or before is None or head is None or after is None:
        return None
    twist = screw(np.linalg.inv(before) @ head) + screw(np.linalg.inv(head) @ after)
    return norms(rates - transformed(points, twist * (window.cache.fps / 2)))


def root_mean_square(values: FloatArray) -> float:
    """Root mean square of values, `N`."""
    return float(np.sqrt(np.mean(values**2)))


MOTION: dict[Check, Callable[[Window], Iterator[Finding]]] = {
    VELOCITIES: velocities,
    CURVE_VELOCITIES: curve_velocities,
    SUB_FRAMES: sub_frames,
    SUB_FRAME_ROOTS: sub_frame_roots,
    SUB_FRAME_SKIN_ROOTS: sub_frame_skin_roots,
    ACCELERATIONS: accelerations,
    SUB_FRAME_ACCELERATIONS: sub_frame_accelerations,
    SPIKES: spikes,
    VELOCITY_PEAKS: velocity_peaks,
    POPS: pops,
}
"""The checks of the motion and their functions, in the order of the report."""
