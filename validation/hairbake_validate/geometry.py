"""Small geometry on arrays of points."""

from dataclasses import dataclass

import numpy as np

from . import tolerances


def transformed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Points (`N × 3`) under a matrix for row vectors, as USD has them."""
    # Not `@`: a threaded BLAS is many times slower on so thin a product when the processes share the cores.
    return np.einsum("ni,ij->nj", points, matrix[:3, :3]) + matrix[3, :3]


def spacing(values: np.ndarray) -> float:
    """Distance of neighbouring 32-bit floats at the largest of the values: twice the rounding of any of them."""
    return float(np.spacing(np.float32(np.abs(values).max())))


@dataclass(frozen=True)
class Arcs:
    """Arcs of segments: `length`, and a bound on the `error` of each, in the same unit."""

    length: np.ndarray
    error: np.ndarray


# Gauss-Legendre on [0, 1].
NODES, WEIGHTS = (lambda x, w: ((x + 1) / 2, w / 2))(*np.polynomial.legendre.leggauss(4))


def arc_lengths(points: np.ndarray, counts: np.ndarray) -> Arcs:
    """Arc of every segment of smooth curves through the points (`N × 3`, `n` counts), by the cubic through four
    neighbouring points with chord lengths as parameters, since strands are sampled unevenly.
    """
    points = points.astype(float)
    segments = counts - 1
    # Of every segment: its first point, and the first and last point of its curve.
    curve = np.repeat(np.arange(len(counts)), segments)
    starts = np.cumsum(counts) - counts
    here = np.arange(segments.sum()) + curve
    first, last = starts[curve], starts[curve] + segments[curve]
    chords = np.linalg.norm(points[here + 1] - points[here], axis=1)
    # Too few points to tell an arc from its chord: nothing is claimed.
    arcs = Arcs(chords, chords.copy())
    # Points that coincide would divide by zero; any small step does for them.
    longest = np.maximum.reduceat(chords, starts - np.arange(len(counts)))[curve] if len(chords) else chords
    steps = np.maximum(chords, 1e-9 * np.maximum(longest, 1e-30))
    # Its value at the first point of a curve is arbitrary: differences within a curve matter.
    parameter = np.zeros(len(points))
    parameter[here + 1] = steps
    parameter = np.cumsum(parameter)
    enough = np.flatnonzero(segments[curve] > 2)
    here, first, last, steps_here = here[enough], first[enough], last[enough], steps[enough]

    def four(before: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Parameters and points of the four that begin so many before the segment, and where they do."""
        begin = np.clip(here - before, first, last - 3)
        place = begin[:, None] + np.arange(4)
        return parameter[place], points[place], begin

    u, p, begin = four(1)
    centred = arc(u, p, parameter[here], steps_here)
    to_segment = begin - here + enough
    bend = third_derivative(u, p) * steps[to_segment[:, None] + np.arange(3)].max(axis=1) ** 2
    error = np.minimum(1, tolerances.ARC_ERROR * bend**2) * centred
    # The cubics through the other fours of points that hold this segment differ where the curve is not a cubic,
    # as at a kink: by no less than any of them can be trusted.
    for before in (0, 2):
        u, p, _ = four(before)
        error = np.maximum(error, np.abs(arc(u, p, parameter[here], steps_here) - centred))
    arcs.length[enough], arcs.error[enough] = centred, error
    return arcs


def arc(u: np.ndarray, p: np.ndarray, start: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Arcs (`n`) from parameter `start` over `step` of the cubics through points `p` (`n × 4 × 3`) at `u` (`n × 4`)."""
    speeds = (np.linalg.norm(derivative(u, p, start + node * step), axis=1) for node in NODES)
    return step * sum(weight * speed for weight, speed in zip(WEIGHTS, speeds, strict=True))


def derivative(u: np.ndarray, p: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Derivative at `at` (`n`) of the polynomials through values `p` (`n × k × 3`) at parameters `u` (`n × k`)."""
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


def third_derivative(u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Size of the third derivative of the cubics through `p` (`n × 4 × 3`) at `u` (`n × 4`): κ√(κ² + τ²) for
    curvature κ and torsion τ, where they vary slowly.
    """
    scales = [np.prod([u[:, j] - u[:, i] for i in range(4) if i != j], axis=0) for j in range(4)]
    return 6 * np.linalg.norm(sum(p[:, j] / scales[j][:, None] for j in range(4)), axis=1)
