"""Checks of the normals of guides, the first axes of their sections."""

from collections.abc import Callable, Iterator

import numpy as np

from . import tolerances
from .cache import GUIDES, HEAD, NORMALS, TRANSFORM, Cache, Curves, read_value
from .checks_frame import worst
from .geometry import Array, FloatArray, dot, norms
from .report import Check, Finding
from .window import Window

ACROSS = Check(
    "normals",
    "normals of guides have unit length and are across their curves",
    "write the first axis of the section, and turn it with the curve",
    tolerances.NORMAL,
    "(1)",
)
TWIST = Check(
    "normal_twist",
    "normals of a guide turn smoothly along it",
    "write the normals of the material frame, all on the same side",
    tolerances.NORMAL_TWIST,
    "rad",
)
ROOTS = Check(
    "root_normals",
    "normals of roots are carried by the head",
    "write the normals in world space, at the frame of their points",
    tolerances.ROOT_NORMAL,
    "rad",
)


def of_guides(window: Window) -> Iterator[tuple[Curves, FloatArray, FloatArray]]:
    """The guides with their points and normals, if they have any."""
    for curves in window.cache.curves:
        points, normals = (window.get(curves.path, name) for name in ("points", NORMALS))
        if curves.path == GUIDES and points is not None and normals is not None:
            yield curves, points.astype(float), normals.astype(float)


def across(window: Window) -> Iterator[Finding]:
    """Measures how far normals are from unit vectors across the curve."""
    for curves, points, normals in of_guides(window):
        length = np.abs(norms(normals) - 1)
        along = np.abs(dot(normals, tangents(curves, points)))
        yield worst(window, ACROSS, curves, np.maximum(length, along))


def tangents(curves: Curves, points: FloatArray) -> FloatArray:
    """Unit tangents of the parabolas through three neighbouring points."""
    chords = np.zeros_like(points)
    chords[curves.segments] = points[curves.segments + 1] - points[curves.segments]
    lengths = np.maximum(norms(chords), np.finfo(float).tiny)[:, None]
    chords /= lengths
    found = np.zeros_like(points)
    sums = lengths[:-1] + lengths[1:]
    found[1:] = (lengths[1:] * chords[:-1] + lengths[:-1] * chords[1:]) / sums
    first, last = curves.starts, curves.starts + curves.counts - 1
    for end, near, next_chord in ((first, first, first + 1), (last, last - 1, last - 2)):
        # A curve of two points has no second chord.
        far = np.where(curves.counts > 2, next_chord, near)
        share = lengths[near] / (lengths[near] + lengths[far])
        found[end] = chords[near] + (chords[near] - chords[far]) * share
    unit: FloatArray = found / np.maximum(norms(found), np.finfo(float).tiny)[:, None]
    return unit


def twist(window: Window) -> Iterator[Finding]:
    """Measures the turn of normals about the curve between neighbouring points."""
    for curves, points, normals in of_guides(window):
        chords = np.zeros_like(points)
        chords[curves.segments] = points[curves.segments + 1] - points[curves.segments]
        chords /= np.maximum(norms(chords), np.finfo(float).tiny)[:, None]
        here, there = (side(normals[curves.segments + k], chords[curves.segments]) for k in (0, 1))
        turn = np.zeros(len(points))
        turn[curves.segments] = angle(here, there)
        yield worst(window, TWIST, curves, turn)


def side(vectors: FloatArray, axis: FloatArray) -> FloatArray:
    """The parts of vectors across unit vectors."""
    across: FloatArray = vectors - dot(vectors, axis)[:, None] * axis
    return across


def angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angles between vectors, rad."""
    found: FloatArray = np.arctan2(norms(np.cross(a, b)), dot(a, b))
    return found


def roots(window: Window) -> Iterator[Finding]:
    """Compares the normals of roots, in the space of the head, with those at the first frame."""
    head = window.get(HEAD, TRANSFORM)
    for curves, _, normals in of_guides(window):
        first = in_head(window.cache, window.cache.first - 1, curves)
        if head is None or first is None or window.reference.skins:
            continue
        now = normals[curves.starts] @ head[:3, :3].T
        yield worst(window, ROOTS, curves, angle(first, now) * curves.held, per_curve=True)


def in_head(cache: Cache, frame: int, curves: Curves) -> Array | None:
    """The normals of roots at a frame, in the space of the head."""
    head, normals = (
        read_value(cache, frame, path) for path in (f"{HEAD}.{TRANSFORM}", f"{curves.path}.{NORMALS}")
    )
    if head is None or normals is None or len(normals) != len(curves.rest):
        return None
    found: Array = normals[curves.starts].astype(float) @ head[:3, :3].T
    return found


NORMAL_CHECKS: dict[Check, Callable[[Window], Iterator[Finding]]] = {
    ACROSS: across,
    TWIST: twist,
    ROOTS: roots,
}
"""The checks of normals and their functions, in the order of the report."""
