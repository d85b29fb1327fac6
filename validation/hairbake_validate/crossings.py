"""Continuous collision detection between successive samples of a cache, for points that move linearly.

Independent of the solver's own detection. A moving point and triangle, or two moving edges, can cross only
when their four points are coplanar: at a root of a cubic in time (Provot 1997). The cubics of all candidate
pairs are solved at once. In a cache with a sample for every solver step, this checks the motion that the
solver computed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .geometry import Array, BoolArray, FloatArray, IntArray

MARGIN = 1e-9
"""Crossings this far outside a segment or triangle, as a fraction of it, still count.

A crossing of an edge is then not lost between its two triangles."""
PAIRS_PER_BLOCK = 8_000_000
"""Pairs of the broad phase tested at once."""


@dataclass(frozen=True)
class Crossings:
    """The crossings between two samples."""

    tested: int
    """Pairs whose swept boxes intersect."""
    pairs: IntArray
    """Indices of the two things that cross, `n × 2`."""
    time: FloatArray
    """Time of each crossing, as a fraction of the interval, `n`."""


def cubic_roots(c: FloatArray) -> FloatArray:
    """Real roots in [0, 1] of c0 + c1 t + c2 t² + c3 t³ for each row of `c` (`n × 4`); `n × 3`, NaN for none.

    A cubic is monotonic between its extrema. On each such interval where its sign changes, bisection finds
    the root.
    """
    c0, c1, c2, c3 = c.T
    with np.errstate(divide="ignore", invalid="ignore"):
        disc = np.sqrt(c2 * c2 - 3 * c1 * c3)
        q = -(c2 + np.copysign(disc, c2))
        extrema = np.stack([q / (3 * c3), c1 / q], axis=1)
    extrema = np.sort(np.clip(np.nan_to_num(extrema, nan=0.0, posinf=1.0, neginf=0.0), 0, 1), axis=1)
    n = len(c)
    knots = np.concatenate([np.zeros((n, 1)), extrema, np.ones((n, 1))], axis=1)

    def value(t: FloatArray) -> Array:
        polynomial: Array = ((c3[:, None] * t + c2[:, None]) * t + c1[:, None]) * t + c0[:, None]
        return polynomial

    lo, hi = knots[:, :-1].copy(), knots[:, 1:].copy()
    at_lo, at_hi = value(lo), value(hi)
    # A root at a knot belongs to the interval that ends there, and a root at 0 to the sample interval before.
    changes = (at_lo * at_hi < 0) | ((at_hi == 0) & (at_lo != 0))
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        left = np.sign(value(mid)) == np.sign(at_lo)
        lo, hi = np.where(left, mid, lo), np.where(left, hi, mid)
    return np.where(changes, hi, np.nan)


def volume(x: FloatArray, v: FloatArray) -> FloatArray:
    """Coefficients in time of (a × b)·c for three moving vectors x + v t, `n × 3 × 3`; `n × 4`."""
    (a, b, c), (p, q, r) = np.moveaxis(x, 1, 0), np.moveaxis(v, 1, 0)

    def triple(u: FloatArray, w: FloatArray, z: FloatArray) -> Array:
        product: Array = np.einsum("ij,ij->i", np.cross(u, w), z)
        return product

    return np.stack(
        [
            triple(a, b, c),
            triple(p, b, c) + triple(a, q, c) + triple(a, b, r),
            triple(p, q, c) + triple(p, b, r) + triple(a, q, r),
            triple(p, q, r),
        ],
        axis=1,
    )


def first_hits(start: FloatArray, end: FloatArray, inside: Callable[[FloatArray], BoolArray]) -> FloatArray:
    """First time at which four points (`n × 4 × 3`) are coplanar and `inside` holds of them; NaN for none."""
    x, v = start[:, 1:] - start[:, :1], (end[:, 1:] - end[:, :1]) - (start[:, 1:] - start[:, :1])
    roots = cubic_roots(volume(x, v))
    first = np.full(len(start), np.nan)
    for k in reversed(range(roots.shape[1])):
        rows = np.flatnonzero(~np.isnan(roots[:, k]))
        t = roots[rows, k]
        points = start[rows] + (end[rows] - start[rows]) * t[:, None, None]
        hit = inside(points)
        first[rows[hit]] = t[hit]
    return first


def segments_meet(points: FloatArray) -> BoolArray:
    """True where the coplanar segments 0-1 and 2-3 of `points` (`n × 4 × 3`) intersect."""
    a, b, c, d = np.moveaxis(points, 1, 0)
    p, q, w = b - a, d - c, c - a
    n = np.cross(p, q)
    nn = np.einsum("ij,ij->i", n, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.einsum("ij,ij->i", np.cross(w, q), n) / nn
        t = np.einsum("ij,ij->i", np.cross(w, p), n) / nn
        meet: BoolArray = (s >= -MARGIN) & (s <= 1 + MARGIN) & (t >= -MARGIN) & (t <= 1 + MARGIN)
    return meet


def point_in_triangle(points: FloatArray) -> BoolArray:
    """True where point 0 of `points` (`n × 4 × 3`) lies in the coplanar triangle 1-2-3."""
    x, a, b, c = np.moveaxis(points, 1, 0)
    n = np.cross(b - a, c - a)
    nn = np.einsum("ij,ij->i", n, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", np.cross(c - b, x - b), n) / nn
        v = np.einsum("ij,ij->i", np.cross(a - c, x - c), n) / nn
        within: BoolArray = (u >= -MARGIN) & (v >= -MARGIN) & (u + v <= 1 + MARGIN)
    return within


@dataclass(frozen=True)
class _Grid:
    """A uniform grid over boxes, with cells of about their mean size."""

    origin: FloatArray
    cell: float

    def cells(self, points: FloatArray) -> IntArray:
        """Cell of each point, `n × 3`."""
        return np.floor((points - self.origin) / self.cell).astype(np.int64)

    def entries(self, low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray]:
        """Every pair of a box and a cell that it overlaps, as cell keys and box indices, sorted by both."""
        first = self.cells(low)
        spans = self.cells(high) - first + 1
        counts = spans.prod(axis=1)
        box = np.repeat(np.arange(len(low)), counts)
        rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        sy, sz = spans[box, 1], spans[box, 2]
        key = cell_keys(first[box] + np.stack([rank // (sy * sz), rank // sz % sy, rank % sz], axis=1))
        order = np.lexsort((box, key))
        return key[order], box[order]


def cell_keys(cells: IntArray) -> IntArray:
    """One integer for each cell (`n × 3`)."""
    return (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]


def meeting_boxes(
    low: FloatArray,
    high: FloatArray,
    other_low: FloatArray | None = None,
    other_high: FloatArray | None = None,
) -> IntArray:
    """Pairs of boxes that intersect, `n × 2`: of one set, the lower index first, or of two sets.

    Boxes are compared cell by cell of a uniform grid. A pair counts only in the cell of the lower corner of
    its intersection.
    """
    two_sets = other_low is not None and other_high is not None
    lows, highs = low, high
    if other_low is not None and other_high is not None:
        lows, highs = np.concatenate([low, other_low]), np.concatenate([high, other_high])
    if len(lows) == 0:
        return np.zeros((0, 2), int)
    size = highs - lows
    cell = max(float(size.max(axis=1).mean()) * 1.5, float(size.max()) / 16, 1e-9)
    grid = _Grid(lows.min(axis=0), cell)
    key, box = grid.entries(lows, highs)
    found = []
    for i, j in pairs_in_cells(key):
        a, b, shared = box[i], box[j], key[i]
        if two_sets:
            mixed = (a < len(low)) != (b < len(low))
            a, b, shared = a[mixed], b[mixed], shared[mixed]
        meet = np.all((lows[a] <= highs[b]) & (lows[b] <= highs[a]), axis=1)
        a, b, shared = a[meet], b[meet], shared[meet]
        counted = cell_keys(grid.cells(np.maximum(lows[a], lows[b]))) == shared
        found.append(np.stack([a[counted], b[counted]], axis=1))
    pairs = np.concatenate(found)
    return pairs - [0, len(low)] if two_sets else pairs


def pairs_in_cells(key: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Blocks of pairs of entries that share a cell; `key` is sorted and holds the cell of each entry."""
    starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    ends = np.r_[starts[1:], len(key)]
    # The number of entries after each one in its cell.
    sizes = ends - starts
    after = np.repeat(sizes, sizes) - (np.arange(len(key)) - np.repeat(starts, sizes)) - 1
    limits = np.arange(PAIRS_PER_BLOCK, after.sum() + PAIRS_PER_BLOCK, PAIRS_PER_BLOCK)
    bounds = np.searchsorted(np.cumsum(after), limits)
    at = 0
    for until in [*bounds, len(key)]:
        chosen = np.arange(at, min(until + 1, len(key)))
        at = chosen[-1] + 1 if len(chosen) else at
        n = after[chosen]
        i = np.repeat(chosen, n)
        yield i, i + 1 + np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)


def boxes(start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corners of the boxes swept by things of `k` points each, `n × k × 3`."""
    both = np.concatenate([start, end], axis=1)
    return both.min(axis=1), both.max(axis=1)


def strand_strand(start: FloatArray, end: FloatArray, strand: IntArray) -> Crossings:
    """Crossings of segments (`n × 2 × 3`) that do not follow each other on a strand.

    They are in order along their strands; `strand` is the strand of each.
    """
    pairs = meeting_boxes(*boxes(start, end))
    a, b = pairs.T
    pairs = pairs[(strand[a] != strand[b]) | (np.abs(a - b) > 1)]
    a, b = pairs.T
    hit = first_hits(
        np.concatenate([start[a], start[b]], axis=1), np.concatenate([end[a], end[b]], axis=1), segments_meet
    )
    found = ~np.isnan(hit)
    return Crossings(len(pairs), pairs[found], hit[found])


def strand_body(
    start: FloatArray, end: FloatArray, corners: FloatArray, corners_end: FloatArray
) -> Crossings:
    """Crossings of segments (`n × 2 × 3`) with moving triangles (`m × 3 × 3`).

    Either an end of the segment passes through the face, as for a strand that enters with its tip, or the
    segment passes through an edge, as for a strand that is wrapped around it.
    """
    pairs = meeting_boxes(*boxes(start, end), *boxes(corners, corners_end))
    s, t = pairs.T
    hits = []
    for k in range(2):
        before = np.concatenate([start[s, k : k + 1], corners[t]], axis=1)
        after = np.concatenate([end[s, k : k + 1], corners_end[t]], axis=1)
        hits.append(first_hits(before, after, point_in_triangle))
    for k in range(3):
        edge = [k, (k + 1) % 3]
        before = np.concatenate([start[s], corners[t][:, edge]], axis=1)
        after = np.concatenate([end[s], corners_end[t][:, edge]], axis=1)
        hits.append(first_hits(before, after, segments_meet))
    hit = np.fmin.reduce(hits)
    found = ~np.isnan(hit)
    return Crossings(len(pairs), pairs[found], hit[found])


def segments_meet_faces(segments: FloatArray, corners: FloatArray) -> BoolArray:
    """True where segments (`n × 2 × 3`) intersect triangles (`n × 3 × 3`), by Möller and Trumbore (1997)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    d, p, q, w = segments[:, 1] - segments[:, 0], b - a, c - a, segments[:, 0] - a
    h = np.cross(d, q)
    det = np.einsum("ij,ij->i", p, h)
    k = np.cross(w, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, t = (np.einsum("ij,ij->i", x, y) / det for x, y in ((w, h), (d, k), (q, k)))
        meet: BoolArray = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
    return meet
