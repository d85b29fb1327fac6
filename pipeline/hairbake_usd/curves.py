"""Evaluation of basis curves to points (UsdGeomBasisCurves: type, basis, wrap)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import polynomial

from .exchange import FloatArray, Header, IntArray

BASES = {
    "bezier": np.array([[1, -3, 3, -1], [0, 3, -6, 3], [0, 0, 3, -3], [0, 0, 0, 1]], float),
    "bspline": np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]], float) / 6,
    "catmullRom": np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]], float) / 2,
}
"""Each row: the weight of one of a segment's four control points as a polynomial of u, constant first."""

SAMPLES = {"bezier": 3, "bspline": 2, "catmullRom": 1}
"""Points taken per segment.

A Catmull-Rom spline passes through its control points. A Bézier segment adds three control points. A B-spline
segment is one polynomial: two points per segment define it.
"""


@dataclass(frozen=True)
class CurveType:
    """Type, basis and wrap of curves, as USD names them."""

    kind: str
    """`linear` or `cubic`."""
    basis: str
    wrap: str

    def header(self) -> Header:
        """Basis, `linear` for linear curves, and wrap."""
        return {"basis": "linear" if self.kind == "linear" else self.basis, "wrap": self.wrap}

    def segments(self, count: int) -> int | None:
        """Number of segments of a curve with `count` control points; None if there is no such curve."""
        if self.kind == "linear":
            least, n = 2, count if self.wrap == "periodic" else count - 1
        elif self.basis == "bezier":
            if self.wrap == "periodic":
                least, n = 3, count // 3 if count % 3 == 0 else 0
            else:
                least, n = 4, (count - 1) // 3 if count % 3 == 1 else 0
        else:
            sizes = {"nonperiodic": (4, count - 3), "periodic": (3, count), "pinned": (2, count - 1)}
            least, n = sizes[self.wrap]
        return n if count >= least and n > 0 else None

    def varying(self, count: int) -> int:
        """Number of varying values of a curve: one at each end of a segment."""
        n = self.segments(count) or 0
        return n if self.wrap == "periodic" else n + 1

    def varying_controls(self, count: int) -> IntArray:
        """The control point nearest to each varying value of a curve."""
        step = 3 if self.kind == "cubic" and self.basis == "bezier" else 1
        phantom = self.kind == "cubic" and self.basis != "bezier" and self.wrap == "nonperiodic"
        return step * np.arange(self.varying(count)) + (1 if phantom else 0)

    def evaluate(self, counts: IntArray, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Number of points of each curve, and the points of all curves, `N × 3`.

        `counts` are control points of each curve; each count must have segments.
        """
        starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
        rows = {int(n): weights(self, int(n)) for n in np.unique(counts)}
        sizes = np.array([len(rows[int(n)]) for n in counts])
        ends = np.cumsum(sizes)
        out = np.empty((int(ends[-1]), 3))
        for n, weight in rows.items():
            which = np.flatnonzero(counts == n)
            controls = points[starts[which, None] + np.arange(n)]
            # Curves that are their control points are copied: a round trip keeps every bit.
            exact = weight.shape[0] == n and np.array_equal(weight, np.eye(n))
            values = controls if exact else np.einsum("pc,scx->spx", weight, controls, optimize=True)
            out[(ends - sizes)[which, None] + np.arange(len(weight))] = values
        return sizes, out


@lru_cache
def weights(curve: CurveType, count: int) -> FloatArray:
    """Points of a curve as weights of its control points, `points × count`.

    A periodic curve ends at its first point. The count must have segments.
    """
    n, eye = curve.segments(count) or 0, np.eye(count)
    if curve.kind == "linear":
        return np.vstack([eye, eye[:1]]) if curve.wrap == "periodic" else eye
    step = 3 if curve.basis == "bezier" else 1
    if curve.wrap == "periodic":
        controls = np.vstack([eye, eye[:4]])
    elif curve.wrap == "pinned" and curve.basis != "bezier":
        controls = np.vstack([2 * eye[0] - eye[1], eye, 2 * eye[-1] - eye[-2]])
    else:
        controls = eye
    samples = SAMPLES[curve.basis]
    places = [(s, i / samples) for s in range(n) for i in range(samples)] + [(n - 1, 1.0)]
    basis = BASES[curve.basis].T
    return np.array([polynomial.polyval(u, basis) @ controls[step * s : step * s + 4] for s, u in places])
