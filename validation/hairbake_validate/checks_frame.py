"""Checks of single frames: file, sizes, values, transforms, extent, roots, lengths and penetration."""

from collections.abc import Callable, Iterator

import numpy as np

from . import tolerances
from .cache import GUIDES, HAIR, HEAD, TRANSFORM, Curves
from .geometry import Arcs, BoolArray, FloatArray, arc_lengths, norms, spacing, transformed
from .pinches import pinched
from .report import Check, Finding
from .skins import Values
from .window import Window

FRAMES = Check(
    "frames",
    "every frame and both handle frames have a readable file with all attributes, at their sample times only",
    "bake these frames again, or restore their files",
)
COVERAGE = Check(
    "coverage",
    "the clip manifest declares every attribute in the frame files",
    "declare the attributes in hair.manifest.usda, or remove them from the frame files",
)
SIZES = Check(
    "sizes",
    "points, velocities, accelerations, extents, levels and reactions have the size that topology requires",
    "bake these frames again with the groom that the topology layer was written from",
)
FINITE = Check(
    "finite",
    "no value is NaN or infinite",
    "bake these frames again; report a solver error if they stay so",
)
RIGID = Check(
    "rigid",
    "transforms of head and colliders are rigid",
    "remove scale, shear and projection from the transforms of the animation",
    1e-9,
    "(1)",
)
EXTENT = Check(
    "extent",
    "the extent contains the points and half their widths",
    "recompute the extents: renderers cull geometry outside them",
    tolerances.EXTENT_EXCESS_M,
    "m",
)
ROOTS = Check(
    "roots",
    "every root that is held is at its rest point under the head transform",
    "use the head transform that the frame was baked with, and move no roots",
    tolerances.ROOT_OFFSET_M,
    "m",
)
SKIN_ROOTS = Check(
    "skin_roots",
    "every root that is held is where its place on the skin carries it",
    "bake these frames again with the meshes that they show, and move no roots",
    tolerances.SKIN_ROOT_OFFSET_M,
    "m",
)
SEGMENTS = Check(
    "segments",
    "segments of render strands keep their rest length",
    "remove edits that stretch strands after the bake, or bake these frames again",
    tolerances.SEGMENT_DRIFT,
    "relative",
)
GUIDE_SEGMENTS = Check(
    "guide_segments",
    "arcs between points of a guide keep the length of the rod",
    "remove edits that stretch guides after the bake; where they bend sharply, bake with more nodes",
    tolerances.GUIDE_SEGMENT_DRIFT,
    "relative",
)
GUIDE_LENGTH = Check(
    "guide_length",
    "guides keep their total length",
    "remove edits that stretch guides after the bake; where they bend sharply, bake with more nodes",
    tolerances.GUIDE_LENGTH_DRIFT,
    "relative",
)
GUIDE_PENETRATION = Check(
    "guide_penetration",
    "guide points outside a collider at rest stay outside, except next to a stretch drawn through it",
    "bake these frames with more substeps, or check the collider's motion for jumps",
    tolerances.GUIDE_PENETRATION_M,
    "m",
)
HAIR_PENETRATION = Check(
    "hair_penetration",
    "points of render strands outside a collider at rest stay outside",
    "use more guides where strands penetrate, or bake these frames with more substeps",
    tolerances.HAIR_PENETRATION_M,
    "m",
)
PINCHES = Check(
    "pinches",
    "points that bodies leave no room for outside are as deep as manifest.json records",
    "keep the bodies apart where the hair is, or bake these frames again",
    tolerances.PINCH_UNRECORDED_M,
    "m",
)


def frames(window: Window) -> Iterator[Finding]:
    """Checks the file itself. Applications interpolate over a missing one without a message."""
    cache, frame = window.cache, window.frame
    if window.file is None:
        yield Finding(FRAMES, message=f"{cache.frame_path(frame).name}: {window.error}", frame=frame)
        return
    expected = cache.sample_times(frame)
    if cache.has_solver_steps:
        # The solver chooses the times. Those of the head are the reference; the first is the frame.
        later = window.file.times.get(f"{HEAD}.{TRANSFORM}", [])[1:]
        expected += [time for time in later if frame < time < frame + 1]
    for path in cache.animated():
        times = window.file.times.get(path)
        if times is None:
            yield Finding(FRAMES, message=f"{path} is missing", frame=frame)
        elif len(times) != len(expected) or not np.allclose(times, expected, rtol=0, atol=1e-9):
            message = f"{path} has samples at {times[:5]}, expected {expected[:5]}"
            yield Finding(FRAMES, message=message, frame=frame)


def coverage(window: Window) -> Iterator[Finding]:
    """Checks that attributes are declared: USD resolves others to no value, without an error."""
    declared = window.cache.declared
    if window.file is not None and declared is not None:
        for path in sorted(set(window.file.times) - declared):
            yield Finding(COVERAGE, message=f"{path} is not in the clip manifest", frame=window.frame)


def sizes(window: Window) -> Iterator[Finding]:
    """Checks the shape of every array."""
    for path, value in window.all_values():
        expected = window.shape(path)
        if expected is not None and value.shape != expected:
            message = f"{path} has shape {value.shape}, expected {expected}"
            yield Finding(SIZES, message=message, frame=window.frame)


def finite(window: Window) -> Iterator[Finding]:
    """Checks for NaN and infinity."""
    for path, value in window.all_values():
        finite = np.isfinite(value)
        if not finite.all():
            bad = np.flatnonzero(~finite.reshape(len(value), -1).all(axis=1))
            message = (
                f"{path}: {len(bad)} of {len(value)} entries are not finite, the first at index {bad[0]}"
            )
            yield Finding(FINITE, message=message, frame=window.frame)


def rigid(window: Window) -> Iterator[Finding]:
    """Checks for an orthonormal rotation without shear, scale or projection, as in the solver's input."""
    for path in window.bodies():
        matrix = window.get(path, TRANSFORM)
        if matrix is not None:
            rotation = matrix[:3, :3]
            error = max(
                np.abs(rotation @ rotation.T - np.eye(3)).max(), np.abs(matrix[:, 3] - [0, 0, 0, 1]).max()
            )
            yield Finding(RIGID, float(error), frame=window.frame, prim=path)


def extent(window: Window) -> Iterator[Finding]:
    """Measures by how much points and widths exceed the extent, beyond rounding."""
    for curves in window.cache.curves:
        points, box = window.get(curves.path, "points"), window.get(curves.path, "extent")
        if points is None or box is None or len(curves.widths) != len(points):
            continue
        half = curves.widths.astype(float) / 2
        excess = np.full(len(points), -np.inf)
        for low, high, place in zip(*box, points.T, strict=True):
            for side in (low - (place - half), (place + half) - high):
                np.maximum(excess, side, out=excess)
        yield worst(window, EXTENT, curves, (excess - spacing(box)) * window.cache.metres_per_unit)


def roots(window: Window) -> Iterator[Finding]:
    """Measures the distance of roots from their rest points under the head transform."""
    head = window.get(HEAD, TRANSFORM)
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if head is not None and points is not None and not window.reference.skins:
            yield root_offsets(window, ROOTS, curves, points, transformed(curves.rest, head))


def skin_roots(window: Window) -> Iterator[Finding]:
    """Measures the distance of roots from where the skins of the frame carry them."""
    yield from skin_root_offsets(window, SKIN_ROOTS, window.get)


def skin_root_offsets(window: Window, check: Check, values: Values) -> Iterator[Finding]:
    """The root of each set of curves that is farthest from where skins carry it at one time."""
    if not window.reference.skins:
        return
    skins = window.reference.skins
    for curves in window.cache.curves:
        points, carried = values(curves.path, "points"), skins.carried(curves, values)
        if points is not None and carried is not None:
            yield root_offsets(window, check, curves, points, carried, skins.rounding(curves, values))


def root_offsets(
    window: Window,
    check: Check,
    curves: Curves,
    points: FloatArray,
    carried: FloatArray,
    rounding_of_carrier: FloatArray | float = 0.0,
) -> Finding:
    """The root that is farthest from its rest point as it is carried. Those that nothing holds do not count.

    The rounding of both points to 32 bits, half a spacing in each coordinate, is subtracted, and that of what
    carries it.
    """
    rest, now = curves.rest[curves.starts], points[curves.starts]
    offset = norms(now - carried[curves.starts])
    rounding = np.sqrt(3) / 2 * (spacing(rest) + spacing(now)) + rounding_of_carrier
    beyond = (offset - rounding) * curves.held
    return worst(window, check, curves, beyond * window.cache.metres_per_unit, per_curve=True)


def segments(window: Window) -> Iterator[Finding]:
    """Measures the change of length of render strands' segments, by their chords.

    Rounding moves each end of a chord by at most √3/2 of a coordinate's spacing, at rest and in the frame.
    """
    for curves in window.cache.curves:
        points = window.get(curves.path, "points")
        if points is None or curves.path != HAIR:
            continue
        rest, now = curves.rest_chords, curves.chords(points)
        rounding = np.sqrt(3) * (spacing(curves.rest) + spacing(points))
        drift = np.zeros(len(points))
        drift[curves.segments] = np.maximum(0, np.abs(now - rest) - rounding) / np.maximum(rest, rounding)
        yield worst(window, SEGMENTS, curves, drift)


def guide_segments(window: Window) -> Iterator[Finding]:
    """Measures by how much the arcs of pairs of segments of guides are longer or shorter than their rods."""
    for curves, (least, most), now in guide_arcs(window):
        outside = np.maximum(now.length - most, least - now.length) - now.error
        drift = np.zeros(len(curves.rest))
        drift[curves.segments[curves.pairs]] = np.maximum(0, outside) / np.maximum(most, now.error)
        yield worst(window, GUIDE_SEGMENTS, curves, drift)


def guide_length(window: Window) -> Iterator[Finding]:
    """Measures the change of guides' total length, the sum of their arcs."""
    for curves, bounds, now in guide_arcs(window):
        first = np.flatnonzero(np.diff(curves.curve_of_point[curves.segments[curves.pairs]], prepend=-1))
        least, most, length, error = (
            np.add.reduceat(each, first) for each in (*bounds, now.length, now.error)
        )
        outside = np.maximum(length - most, least - length) - error
        yield worst(window, GUIDE_LENGTH, curves, np.maximum(0, outside) / most, per_curve=True)


def guide_arcs(window: Window) -> Iterator[tuple[Curves, tuple[FloatArray, FloatArray], Arcs]]:
    """Guides, bounds of the arcs of pairs of their segments, and the arcs in the frame.

    An arc is as long as the rod. A cubic does not see a bend within a segment, as at a kink of the groom, and
    may be as much shorter than the rod as at rest. The errors include rounding.
    """
    rest_arcs = window.reference.rest_arcs
    for curves in window.cache.curves:
        found = window.once(arcs_in_frame, curves) if curves.path == GUIDES else None
        if rest_arcs is not None and curves.rods is not None and found is not None:
            arcs, spaced = found
            least = np.minimum(curves.of_pairs(rest_arcs.length - rest_arcs.error), curves.rods)
            rounding = float(np.sqrt(3)) * (spacing(curves.rest) + spaced) + spacing(curves.arc)
            now = Arcs(curves.of_pairs(arcs.length), curves.of_pairs(arcs.error) + rounding)
            yield curves, (least, curves.rods), now


def arcs_in_frame(window: Window, curves: Curves, offset: int) -> tuple[Arcs, float] | None:
    """Arcs of curves in a frame and the spacing of their points; None without valid points."""
    points = window.get(curves.path, "points", offset)
    return None if points is None else (arc_lengths(points, curves.counts), spacing(points))


def guide_penetration(window: Window) -> Iterator[Finding]:
    """Measures the penetration of colliders by guides."""
    yield from penetration(window, GUIDES, GUIDE_PENETRATION)


def hair_penetration(window: Window) -> Iterator[Finding]:
    """Measures the penetration of colliders by render strands."""
    yield from penetration(window, HAIR, HAIR_PENETRATION)


def penetration(window: Window, path: str, check: Check) -> Iterator[Finding]:
    """Depth, in each collider's own space, of the points that must stay outside it and have room there."""
    for curves, depth, held in inside(window):
        if curves.path == path:
            free = np.where(held, 0, depth)
            yield worst(window, check, curves, free * window.cache.metres_per_unit)


def pinches(window: Window) -> Iterator[Finding]:
    """Compares the depth of pinched points with the record of the frame."""
    recorded = window.cache.figure(window.frame, "pinched_penetration_m")
    for curves, depth, held in inside(window):
        deepest = np.where(held, depth, 0) * window.cache.metres_per_unit
        if held.any():
            yield worst(window, PINCHES, curves, deepest - recorded)


def inside(window: Window) -> Iterator[tuple[Curves, FloatArray, BoolArray]]:
    """Curves, the depth of their points in a collider, and which are pinched; collider by collider."""
    for curves in window.cache.curves:
        for mesh, at_first in window.reference.colliders:
            depth = window.depths(mesh, at_first).get(curves.path)
            if depth is not None:
                yield curves, depth, window.once(pinched, curves)[mesh.path]


def worst(
    window: Window, check: Check, curves: Curves, values: FloatArray, per_curve: bool = False
) -> Finding:
    """The finding of the largest value; `values` has one entry for each point, or for each curve."""
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
    SKIN_ROOTS: skin_roots,
    SEGMENTS: segments,
    GUIDE_SEGMENTS: guide_segments,
    GUIDE_LENGTH: guide_length,
    GUIDE_PENETRATION: guide_penetration,
    HAIR_PENETRATION: hair_penetration,
    PINCHES: pinches,
}
"""The checks of single frames and their functions, in the order of the report."""
