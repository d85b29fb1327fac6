"""Checks of one frame: its file, sizes, extent, roots, lengths and penetration."""

from collections.abc import Callable, Iterator

import numpy as np

from . import tolerances
from .cache import GUIDES, HAIR, HEAD, TRANSFORM, Curves
from .geometry import Arcs, arc_lengths, spacing, transformed
from .report import Check, Finding
from .window import Window

FRAMES = Check(
    "frames",
    "every frame and handle frame has a readable file with all attributes, each at its own moments only",
)
COVERAGE = Check("coverage", "the clip manifest declares every attribute that the frame files hold")
SIZES = Check("sizes", "points, velocities and extents have the size that the topology asks for")
FINITE = Check("finite", "no value is NaN or infinite")
RIGID = Check("rigid", "transforms of head and colliders are rigid", 1e-9, "(1)")
EXTENT = Check("extent", "the extent holds the points and half their widths", tolerances.EXTENT_EXCESS_M, "m")
ROOTS = Check("roots", "every root is its rest point on the head transform", tolerances.ROOT_OFFSET_M, "m")
SEGMENTS = Check(
    "segments", "segments of render strands keep their rest length", tolerances.SEGMENT_DRIFT, "relative"
)
GUIDE_SEGMENTS = Check(
    "guide_segments",
    "arcs between points of a guide keep their rest length",
    tolerances.GUIDE_SEGMENT_DRIFT,
    "relative",
)
GUIDE_LENGTH = Check(
    "guide_length", "guides keep their whole length", tolerances.GUIDE_LENGTH_DRIFT, "relative"
)
GUIDE_PENETRATION = Check(
    "guide_penetration",
    "no point of a guide that was outside a collider, and not beside a stretch drawn through it, is inside",
    tolerances.GUIDE_PENETRATION_M,
    "m",
)
HAIR_PENETRATION = Check(
    "hair_penetration",
    "no point of a render strand that was outside a collider is inside",
    tolerances.HAIR_PENETRATION_M,
    "m",
)


def frames(window: Window) -> Iterator[Finding]:
    """The file itself. A missing one is interpolated over in silence by every application."""
    if window.file is None:
        yield Finding(
            FRAMES,
            message=f"{window.cache.frame_path(window.frame).name}: {window.fault}",
            frame=window.frame,
        )
        return
    moments = window.cache.moments(window.frame)
    if window.cache.stepwise:
        # Those of the head, the first of which is the frame.
        after = window.file.times.get(f"{HEAD}.{TRANSFORM}", [])[1:]
        moments += [time for time in after if window.frame < time < window.frame + 1]
    for path in window.cache.animated():
        times = window.file.times.get(path)
        if times is None:
            yield Finding(FRAMES, message=f"no {path}", frame=window.frame)
        elif len(times) != len(moments) or not np.allclose(times, moments, rtol=0, atol=1e-9):
            yield Finding(FRAMES, message=f"{path} has samples at {times[:5]}", frame=window.frame)


def coverage(window: Window) -> Iterator[Finding]:
    """An attribute that the clip manifest does not declare resolves to nothing, without an error."""
    declared = window.cache.declared
    if window.file is not None and declared is not None:
        for path in sorted(set(window.file.times) - declared):
            yield Finding(COVERAGE, message=f"{path} is not in the clip manifest", frame=window.frame)


def sizes(window: Window) -> Iterator[Finding]:
    """Every array against the shape that the topology gives it."""
    for path, value in window.all_values():
        wanted = window.shape(path)
        if wanted is not None and value.shape != wanted:
            yield Finding(SIZES, message=f"{path} has shape {value.shape}, not {wanted}", frame=window.frame)


def finite(window: Window) -> Iterator[Finding]:
    """NaN and infinity."""
    for path, value in window.all_values():
        bad = np.flatnonzero(~np.isfinite(value).reshape(len(value), -1).all(axis=1)) if len(value) else []
        if len(bad):
            yield Finding(
                FINITE,
                message=f"{path} is not finite at {len(bad)} places, first at {bad[0]}",
                frame=window.frame,
            )


def rigid(window: Window) -> Iterator[Finding]:
    """Orthonormal rotation, no shear, scale or projection: what the solver was given."""
    for path in window.bodies():
        matrix = window.get(path, TRANSFORM)
        if matrix is not None:
            rotation = matrix[:3, :3]
            error = max(
                np.abs(rotation @ rotation.T - np.eye(3)).max(), np.abs(matrix[:, 3] - [0, 0, 0, 1]).max()
            )
            yield Finding(RIGID, float(error), frame=window.frame, prim=path)


def extent(window: Window) -> Iterator[Finding]:
    """What lies outside its extent is culled."""
    for curves in window.cache.curves:
        points, box = window.get(curves.path, "points"), window.get(curves.path, "extent")
        if points is None or box is None or len(curves.widths) != len(points):
            continue
        half = curves.widths[:, None].astype(float) / 2
        excess = np.maximum(box[0] - (points - half), (points + half) - box[1]).max(axis=1)
        yield worst(window, EXTENT, curves, (excess - spacing(box)) * window.cache.metres_per_unit)


def roots(window: Window) -> Iterator[Finding]:
    """Point 0 against the rest point under the head, beyond the rounding of both to 32 bits (half a spacing a
    coordinate, the rest's turned by the head).
    """
    head = window.get(HEAD, TRANSFORM)
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if head is not None and points is not None:
            yield root_offsets(window, ROOTS, curves, points, head)


def root_offsets(
    window: Window, check: Check, curves: Curves, points: np.ndarray, head: np.ndarray
) -> Finding:
    """The root of `points` that is farthest from its rest point under `head`."""
    rest, now = curves.rest[curves.starts], points[curves.starts]
    offset = np.linalg.norm(now - transformed(rest, head), axis=1)
    rounding = np.sqrt(3) / 2 * (spacing(rest) + spacing(now))
    return worst(window, check, curves, (offset - rounding) * window.cache.metres_per_unit, per_curve=True)


def segments(window: Window) -> Iterator[Finding]:
    """Chords of render strands against their rest chords. Rounding moves each end of a chord by at most √3/2 of a
    coordinate's spacing, at rest and now.
    """
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if points is None or curves.path != HAIR:
            continue
        first = curves.segments
        rest = np.linalg.norm(np.diff(curves.rest.astype(float), axis=0)[first], axis=1)
        now = np.linalg.norm(np.diff(points.astype(float), axis=0)[first], axis=1)
        rounding = np.sqrt(3) * (spacing(curves.rest) + spacing(points))
        drift = np.zeros(len(points))
        drift[first] = np.maximum(0, np.abs(now - rest) - rounding) / np.maximum(rest, rounding)
        yield worst(window, SEGMENTS, curves, drift)


def guide_segments(window: Window) -> Iterator[Finding]:
    """Arcs of guides, beyond what the interpolating cubic itself is off by where the curve turns."""
    for curves, rest, now, rounding in guide_arcs(window):
        floor = rounding + rest.error + now.error
        drift = np.zeros(len(curves.rest))
        drift[curves.segments] = np.maximum(0, np.abs(now.length - rest.length) - floor) / np.maximum(
            rest.length, rounding
        )
        yield worst(window, GUIDE_SEGMENTS, curves, drift)


def guide_length(window: Window) -> Iterator[Finding]:
    """Sum of a guide's arcs."""
    for curves, rest, now, rounding in guide_arcs(window):
        first = np.cumsum(curves.counts - 1) - (curves.counts - 1)
        total = np.add.reduceat(rest.length, first)
        drift = np.abs(np.add.reduceat(now.length, first) - total) - np.add.reduceat(
            rest.error + now.error + rounding, first
        )
        yield worst(
            window, GUIDE_LENGTH, curves, np.maximum(0, drift) / np.maximum(total, rounding), per_curve=True
        )


def guide_arcs(window: Window) -> Iterator[tuple[Curves, Arcs, Arcs, float]]:
    """Guides with the arcs of rest and frame, and the rounding of an arc."""
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if points is not None and curves.path == GUIDES:
            rounding = np.sqrt(3) * (spacing(curves.rest) + spacing(points))
            yield curves, window.ground.rest_arcs, arc_lengths(points, curves.counts), rounding


def guide_penetration(window: Window) -> Iterator[Finding]:
    """Guides against every collider."""
    yield from penetration(window, GUIDES, GUIDE_PENETRATION)


def hair_penetration(window: Window) -> Iterator[Finding]:
    """Render strands against every collider."""
    yield from penetration(window, HAIR, HAIR_PENETRATION)


def penetration(window: Window, path: str, check: Check) -> Iterator[Finding]:
    """Depth of the points in each collider's own space, of those that it has to keep outside."""
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if points is None or curves.path != path:
            continue
        for mesh, collider in window.ground.colliders:
            matrix = window.get(mesh.path, TRANSFORM)
            if mesh.deforms:
                collider = window.collider(mesh)
            if matrix is None or collider is None:
                continue
            outside = np.flatnonzero(window.ground.outside[curves.path, mesh.path])
            depth = np.zeros(len(points))
            depth[outside] = collider.depth(transformed(points[outside], np.linalg.inv(matrix)))
            yield worst(window, check, curves, depth * window.cache.metres_per_unit)


def worst(
    window: Window, check: Check, curves: Curves, values: np.ndarray, per_curve: bool = False
) -> Finding:
    """The largest of the values, one a point or one a curve."""
    at = int(np.argmax(values))
    curve = at if per_curve else int(np.searchsorted(curves.starts, at, side="right")) - 1
    return Finding(check, max(0.0, float(values[at])), frame=window.frame, prim=curves.path, curve=curve)


FRAME: dict[Check, Callable[[Window], Iterator[Finding]]] = {
    FRAMES: frames,
    COVERAGE: coverage,
    SIZES: sizes,
    FINITE: finite,
    RIGID: rigid,
    EXTENT: extent,
    ROOTS: roots,
    SEGMENTS: segments,
    GUIDE_SEGMENTS: guide_segments,
    GUIDE_LENGTH: guide_length,
    GUIDE_PENETRATION: guide_penetration,
    HAIR_PENETRATION: hair_penetration,
}
"""The checks of one frame and what carries them out, in the order of the report."""
