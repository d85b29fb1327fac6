"""Basis curves evaluated to points (UsdGeomBasisCurves: type, basis, wrap)."""

from functools import lru_cache

import numpy as np
from numpy.polynomial import polynomial

#: Rows: weight of each of a segment's four control points as a polynomial of u, constant first.
BASES = {
    "bezier": np.array([[1, -3, 3, -1], [0, 3, -6, 3], [0, 0, 3, -3], [0, 0, 0, 1]], float),
    "bspline": np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]], float) / 6,
    "catmullRom": np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]], float) / 2,
}
#: Points taken of each segment. A spline that passes through its control points needs no others; a B-spline's segments are one
#: polynomial each, and three places a Bézier segment are as many points as it adds.
SAMPLES = {"bezier": 3, "bspline": 2, "catmullRom": 1}


def segments(kind: str, basis: str, wrap: str, count: int) -> int | None:
    """Segments of a curve of `count` control points; None where there can be no such curve."""
    if kind == "linear":
        least, n = 2, count if wrap == "periodic" else count - 1
    elif basis == "bezier":
        if wrap == "periodic":
            least, n = 3, count // 3 if count % 3 == 0 else 0
        else:
            least, n = 4, (count - 1) // 3 if count % 3 == 1 else 0
    else:
        least, n = {"nonperiodic": (4, count - 3), "periodic": (3, count), "pinned": (2, count - 1)}[wrap]
    return n if count >= least and n > 0 else None


def varying(kind: str, basis: str, wrap: str, count: int) -> int:
    """Values that a curve has of what varies (one at each end of a segment)."""
    n = segments(kind, basis, wrap, count) or 0
    return n if wrap == "periodic" else n + 1


@lru_cache
def weights(kind: str, basis: str, wrap: str, count: int) -> np.ndarray:
    """Points of a curve as weights of its control points: (points × count). A closed curve ends where it began."""
    n, eye = segments(kind, basis, wrap, count), np.eye(count)
    if kind == "linear":
        return np.vstack([eye, eye[:1]]) if wrap == "periodic" else eye
    step = 3 if basis == "bezier" else 1
    if wrap == "periodic":
        controls = np.vstack([eye, eye[:4]])
    elif wrap == "pinned" and basis != "bezier":
        controls = np.vstack([2 * eye[0] - eye[1], eye, 2 * eye[-1] - eye[-2]])
    else:
        controls = eye
    places = [(s, i / SAMPLES[basis]) for s in range(n) for i in range(SAMPLES[basis])] + [(n - 1, 1.0)]
    return np.array(
        [polynomial.polyval(u, BASES[basis].T) @ controls[step * s : step * s + 4] for s, u in places]
    )


def evaluate(
    kind: str, basis: str, wrap: str, counts: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Number of points of each curve, and all their points; every count must have segments."""
    starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
    rows = {int(n): weights(kind, basis, wrap, int(n)) for n in np.unique(counts)}
    sizes = np.array([len(rows[int(n)]) for n in counts])
    ends = np.cumsum(sizes)
    out = np.empty((int(ends[-1]), 3))
    for n, weight in rows.items():
        which = np.flatnonzero(counts == n)
        controls = points[starts[which, None] + np.arange(n)]
        # What is only a control point as it stands is copied: a round trip keeps its bits.
        exact = weight.shape[0] == n and np.array_equal(weight, np.eye(n))
        values = controls if exact else np.einsum("pc,scx->spx", weight, controls, optimize=True)
        out[(ends - sizes)[which, None] + np.arange(len(weight))] = values
    return sizes, out
