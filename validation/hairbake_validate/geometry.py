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


def transformed(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Applies a 4 × 4 matrix for row vectors, as USD has it, to points (`N × 3`)."""
    # Not `@`: a threaded BLAS is many times slower on such a thin product when processes share the cores.
    rotated: FloatArray = np.einsum("ni,ij->nj", points, matrix[:3, :3])
    return rotated + matrix[3, :3]


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

    def take(self, before: int) -> tuple[FloatArray, FloatArray, IntArray]:
        """Parameters (`n × 4`) and points (`n × 4 × 3`) of stencils, and their first points (`n`).

        A stencil starts `before` points ahead of the segment, shifted where it would leave the curve.
        """
        begin: IntArray = np.clip(self.here - before, self.first, self.last - 3)
        place = begin[:, None] + np.arange(4)
        return self.parameter[place], self.points[place], begin

    def arcs(self, u: FloatArray, p: FloatArray) -> FloatArray:
        """Arc length of each segment on the cubic through its stencil (`u`, `p`)."""
        return arc(u, p, self.parameter[self.here], self.step)


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
    chords: FloatArray = np.linalg.norm(points[here + 1] - points[here], axis=1)
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

    u, p, begin = stencils.take(1)
    centred = stencils.arcs(u, p)
    to_segment = begin - stencils.here + enough
    bend = third_derivative(u, p) * steps[to_segment[:, None] + np.arange(3)].max(axis=1) ** 2
    error = np.minimum(1, tolerances.ARC_ERROR * bend**2) * centred
    # Where the curve is no cubic, as at a kink, the cubics through the other stencils of the segment differ.
    # None is better than the others, so the bound covers the difference.
    for before in (0, 2):
        u, p, _ = stencils.take(before)
        error = np.maximum(error, np.abs(stencils.arcs(u, p) - centred))
    arcs.length[enough], arcs.error[enough] = centred, error
    return arcs


def arc(u: FloatArray, p: FloatArray, start: FloatArray, step: FloatArray) -> FloatArray:
    """Arc length from `start` to `start + step` of the cubics through `p` (`n × 4 × 3`) at `u` (`n × 4`)."""
    speeds = (np.linalg.norm(derivative(u, p, start + node * step), axis=1) for node in NODES)
    total: FloatArray = sum(
        (weight * speed for weight, speed in zip(WEIGHTS, speeds, strict=True)), start=np.zeros(1)
    )
    return step * total


def derivative(u: FloatArray, p: FloatArray, at: FloatArray) -> FloatArray:
    """Derivative at `at` (`n`) of the polynomials through `p` (`n × k × 3`) at `u` (`n × k`), by Lagrange."""
    k = u.shape[1]
    total = np.zeros((len(u), 3))
    for j in range(k):
        others = [i for i in range(k) if i != j]
        scale = np.prod([u[:, j] - u[:, i] for i in others], axis=0)
        slope = sum(
            np.prod([at - u[:, i] for i in others if i != skipped] or [np.ones(len(u))], axis=0)
            for skipped in others
        )
        total += (slope / scale)[:, None] * p[:, j]
    return total


def third_derivative(u: FloatArray, p: FloatArray) -> FloatArray:
    """Norm of the third derivative of the cubics through `p` (`n × 4 × 3`) at `u` (`n × 4`).

    It is κ√(κ² + τ²) for curvature κ and torsion τ that vary slowly.
    """
    scales = [np.prod([u[:, j] - u[:, i] for i in range(4) if i != j], axis=0) for j in range(4)]
    divided = sum((p[:, j] / scales[j][:, None] for j in range(4)), start=np.zeros((1, 3)))
    norm: FloatArray = np.linalg.norm(divided, axis=1)
    return 6 * norm
