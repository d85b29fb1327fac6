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
    neighbouring points with chord lengths as parameters, since strands are sampled unevenly."""
    starts = np.cumsum(counts) - counts
    first = starts - np.arange(len(counts))
    arcs = Arcs(*np.empty((2, len(points) - len(counts))))
    # Curves of one count are worked on together.
    for count in np.unique(counts):
        group = np.flatnonzero(counts == count)
        curves = points[starts[group][:, None] + np.arange(count)].astype(float)
        place = first[group][:, None] + np.arange(count - 1)
        arcs.length[place], arcs.error[place] = equal_arc_lengths(curves)
    return arcs


def equal_arc_lengths(curves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same for `n` curves of `m` points (`n × m × 3`): lengths and errors, `n × (m − 1)`."""
    n, m = curves.shape[:2]
    chords = np.linalg.norm(np.diff(curves, axis=1), axis=2)
    if m < 4:
        # Too few points to tell an arc from its chord: nothing is claimed.
        return chords, chords.copy()
    # Points that coincide would divide by zero; any small step does for them.
    steps = np.maximum(chords, 1e-9 * chords.max(initial=1e-30))
    parameter = np.concatenate([np.zeros((n, 1)), np.cumsum(steps, axis=1)], axis=1)
    length, error = np.zeros((n, m - 1)), np.zeros((n, m - 1))
    for i in range(m - 1):
        centred = min(max(i - 1, 0), m - 4)
        # The cubics through the other fours of points that hold this segment differ where the curve is not a cubic,
        # as at a kink: by no less than any of them can be trusted.
        firsts = [centred, *{min(max(i - k, 0), m - 4) for k in (0, 2)} - {centred}]
        arcs = [arc(parameter, steps, curves, i, first) for first in firsts]
        length[:, i] = arcs[0]
        u, p = parameter[:, centred : centred + 4], curves[:, centred : centred + 4]
        bend = third_derivative(u, p) * steps[:, centred : centred + 3].max(axis=1) ** 2
        bound = np.minimum(1, tolerances.ARC_ERROR * bend**2) * length[:, i]
        error[:, i] = np.maximum.reduce([bound, *(np.abs(other - arcs[0]) for other in arcs[1:])])
    return length, error


def arc(
    parameter: np.ndarray, steps: np.ndarray, curves: np.ndarray, segment: int, first: int
) -> np.ndarray:
    """Arcs (`n`) of one segment of each curve, on the cubic through the four points from `first` on."""
    u, p = parameter[:, first : first + 4], curves[:, first : first + 4]
    total = np.zeros(len(curves))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        at = parameter[:, segment] + node * steps[:, segment]
        total += weight * steps[:, segment] * np.linalg.norm(derivative(u, p, at), axis=1)
    return total


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
    curvature κ and torsion τ, where they vary slowly."""
    scales = [np.prod([u[:, j] - u[:, i] for i in range(4) if i != j], axis=0) for j in range(4)]
    return 6 * np.linalg.norm(sum(p[:, j] / scales[j][:, None] for j in range(4)), axis=1)
