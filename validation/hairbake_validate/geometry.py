"""Points under transforms, rounding of 32-bit floats, and arc lengths of sampled curves."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import tolerances

Array = NDArray[Any]
FloatArray = NDArray[np.floating[Any]]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]


BLOCK = 8192
"""Points transformed at once: they stay in the processor's cache, and BLAS starts no threads for so few."""


def transformed(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Applies a 4 × 4 matrix for row vectors, as USD has it, to points (`N × 3`)."""
    result = np.empty((len(points), 3))
    rotation = np.ascontiguousarray(matrix[:3, :3], float)
    for low in range(0, len(points), BLOCK):
        part = result[low : low + BLOCK]
        np.matmul(points[low : low + BLOCK].astype(float), rotation, out=part)
        part += matrix[3, :3]
    return result


def screw(step: FloatArray) -> FloatArray:
    """The logarithm of a rigid 4 × 4 matrix for row vectors: the velocity that leads to it in unit time.

    Of a rotation by nearly half a turn, whose axis is lost in rounding, the difference from the identity.
    """
    rotation = step[:3, :3]
    angle = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    if angle > 3.0:
        return step - np.eye(4)
    turn = (rotation - rotation.T) / (2 * np.sinc(angle / np.pi))
    # The displacement is the mean of the velocity along the way (Murray, Li and Sastry 1994, eq. 2.36).
    small = angle < 1e-4
    first = 0.5 if small else (1 - np.cos(angle)) / angle**2
    second = 1 / 6 if small else (angle - np.sin(angle)) / angle**3
    mean = np.eye(3) + first * turn + second * turn @ turn
    field = np.zeros((4, 4))
    field[:3, :3] = turn
    field[3, :3] = step[3, :3] @ np.linalg.inv(mean)
    return field


# numpy's norm, cross and einsum are several times slower than sums of columns for vectors of three numbers.


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot products of vectors, `N × 3`."""
    product: FloatArray = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return product


def norms(vectors: FloatArray) -> FloatArray:
    """Norms of vectors, `N × 3`."""
    norm: FloatArray = np.sqrt(dot(vectors, vectors))
    return norm


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of vectors, `N × 3`."""
    product = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return product


def sums(places: IntArray, vectors: list[FloatArray], count: int) -> FloatArray:
    """Sums three vectors of each triangle (`T × 3` each) at the places in `places` (`T × 3`); `count × 3`."""
    flat, total = places.T.ravel(), np.empty((count, 3))
    for axis in range(3):
        total[:, axis] = np.bincount(flat, np.concatenate([v[:, axis] for v in vectors]), count)
    return total


def over_chord(turn: FloatArray) -> FloatArray:
    """Largest length of a curve that turns by `turn`, rad, over its chord, minus 1; ∞ from π on."""
    folded = turn >= np.pi
    bound: FloatArray = np.where(folded, np.inf, 1 / np.cos(np.where(folded, 0, turn) / 2) - 1)
    return bound


def spacing(values: FloatArray) -> float:
    """Distance between adjacent 32-bit floats at the largest magnitude: twice the largest rounding error."""
    return float(np.spacing(np.float32(np.abs(values).max())))


@dataclass(frozen=True)
class Arcs:
    """Arc lengths of the segments of curves, in the unit of their points."""

    length: FloatArray
    """Arc length of each segment."""
    error: FloatArray
    """Bound on the error of each length."""


_LEGENDRE_NODES, _LEGENDRE_WEIGHTS = np.polynomial.legendre.leggauss(4)
# Gauss-Legendre quadrature on [0, 1].
NODES, WEIGHTS = (_LEGENDRE_NODES + 1) / 2, _LEGENDRE_WEIGHTS / 2


class _Cubics:
    """Cubics through four points each, by Newton's divided differences."""

    def __init__(self, parameters: list[FloatArray], points: list[FloatArray]) -> None:
        """The four parameters (`n`) and points (`n × 3`) of all cubics."""
        self.parameters = parameters
        self.differences: list[FloatArray] = []
        """Divided differences of order 1 to 3 from the first point on, `n × 3`."""
        for order in (1, 2, 3):
            spans = [parameters[k + order] - parameters[k] for k in range(4 - order)]
            points = [(points[k + 1] - points[k]) / span[:, None] for k, span in enumerate(spans)]
            self.differences.append(points[0])

    def derivative(self, at: FloatArray) -> FloatArray:
        """First derivatives at the parameters `at` (`n`)."""
        first, second, third = self.differences
        a, b, c = (at - u for u in self.parameters[:3])
        return first + (a + b)[:, None] * second + (a * b + a * c + b * c)[:, None] * third

    def third_derivative(self) -> FloatArray:
        """Norms of the third derivatives: κ√(κ² + τ²) for curvature κ and torsion τ that vary slowly."""
        return 6 * norms(self.differences[2])

    def arc(self, start: FloatArray, step: FloatArray) -> FloatArray:
        """Arc lengths from the parameters `start` to `start + step`."""
        total = np.zeros(len(start))
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            total += weight * norms(self.derivative(start + node * step))
        return step * total


@dataclass(frozen=True)
class _Stencils:
    """The points around each segment of curves that have at least four points.

    A stencil is four neighbouring points of one curve, with chord lengths as parameters.
    """

    points: FloatArray
    """All points, `N × 3`."""
    parameter: FloatArray
    """Parameter of each point, `N`. Only differences within one curve are meaningful."""
    here: IntArray
    """First point of each segment, `n`."""
    first: IntArray
    """First point of each segment's curve, `n`."""
    last: IntArray
    """Last point of each segment's curve, `n`."""
    step: FloatArray
    """Parameter step over each segment, `n`."""

    def take(self, before: int) -> tuple["_Cubics", IntArray]:
        """The cubics through stencils, and the first points of these (`n`).

        A stencil starts `before` points ahead of the segment, shifted where it would leave the curve.
        """
        begin: IntArray = np.clip(self.here - before, self.first, self.last - 3)
        places = [begin + k for k in range(4)]
        return _Cubics([self.parameter[k] for k in places], [self.points[k] for k in places]), begin

    def arcs(self, cubics: "_Cubics") -> FloatArray:
        """Arc length of each segment on the cubic through its stencil."""
        return cubics.arc(self.parameter[self.here], self.step)


def arc_lengths(points: FloatArray, counts: IntArray) -> Arcs:
    """Arc length of every segment of smooth curves through `points` (`N × 3`).

    Each segment is measured on the cubic through four neighbouring points, with chord lengths as parameters
    because strands are sampled unevenly. `counts` holds the number of points of each curve.
    """
    points = points.astype(float)
    segments = counts - 1
    curve = np.repeat(np.arange(len(counts)), segments)
    starts = np.cumsum(counts) - counts
    here = np.arange(segments.sum()) + curve
    first, last = starts[curve], starts[curve] + segments[curve]
    chords: FloatArray = norms(points[here + 1] - points[here])
    # A curve of two or three points does not tell its arc from its chord: the bound is the chord itself.
    arcs = Arcs(chords, chords.copy())
    # A tiny step keeps coincident points from dividing by zero.
    longest = np.maximum.reduceat(chords, starts - np.arange(len(counts)))[curve] if len(chords) else chords
    steps = np.maximum(chords, 1e-9 * np.maximum(longest, 1e-30))
    parameter = np.zeros(len(points))
    parameter[here + 1] = steps
    enough = np.flatnonzero(segments[curve] > 2)
    stencils = _Stencils(
        points, np.cumsum(parameter), here[enough], first[enough], last[enough], steps[enough]
    )

    cubics, begin = stencils.take(1)
    centred = stencils.arcs(cubics)
    to_segment = begin - stencils.here + enough
    bend = cubics.third_derivative() * steps[to_segment[:, None] + np.arange(3)].max(axis=1) ** 2
    error = np.minimum(1, tolerances.ARC_ERROR * bend**2) * centred
    # Where the curve is no cubic, as at a kink, the cubics through the other stencils of the segment differ.
    # None is better than the others, so the bound covers the difference.
    for before in (0, 2):
        error = np.maximum(error, np.abs(stencils.arcs(stencils.take(before)[0]) - centred))
    uneven = _unevenness(points[here + 1] - points[here], chords, curve)[enough]
    arcs.length[enough], arcs.error[enough] = centred, np.maximum(error, uneven * chords[enough])
    return arcs


def _unevenness(edges: FloatArray, chords: FloatArray, curve: IntArray) -> FloatArray:
    """Relative error of the arc of each segment where the bend changes from point to point.

    An arc that turns by θ is longer than its chord by θ²/24. Where the turns at neighbouring points differ by
    δ, the turn within a segment is known to δ/2. Along a helix they do not differ.
    """
    tangents = edges / np.maximum(chords, 1e-30)[:, None]
    turns = np.zeros(len(edges) + 1)
    inner = np.flatnonzero(curve[1:] == curve[:-1]) + 1
    turns[inner] = norms(np.cross(tangents[inner - 1], tangents[inner]))
    # Along the segments of which both ends turn, and their neighbours.
    change = np.zeros(len(edges))
    between = inner[np.isin(inner + 1, inner)]
    change[between] = np.abs(turns[between + 1] - turns[between])
    padded = np.pad(change, 1)
    delta = np.maximum.reduce([padded[:-2], padded[1:-1], padded[2:]])
    theta = np.maximum(turns[:-1], turns[1:])
    uneven: FloatArray = theta * delta / 24 + delta**2 / 96
    return uneven
