"""Counts what passed through what between successive written samples, by continuous detection on points that move linearly.

Independent of hairbake's own detection: a moving point or edge crosses another where the four points are coplanar, a root of a
cubic in time (Provot 1997), found for all candidate pairs at once. A cache baked with a sample at every step of the solver is so
checked on the motion that was solved for.
"""

from dataclasses import dataclass

import numpy as np

EDGE = 1e-9
"""How far outside a segment or a triangle, as a fraction of it, a crossing still counts: what meets an edge is not lost between its neighbours."""
CELLS = 8_000_000
"""Most entries of the broad phase at a time."""


@dataclass(frozen=True)
class Crossings:
    """What was found between two samples."""

    tested: int
    """Pairs whose swept boxes meet: those that were looked at closely."""
    pairs: np.ndarray
    """Of those that crossed: indices of the moving things, `n × 2`."""
    time: np.ndarray
    """When, as a fraction of the interval."""


def cubic_roots(c: np.ndarray) -> np.ndarray:
    """Real roots in [0, 1] of c0 + c1 t + c2 t² + c3 t³ for each row of `c`, `n × 3`, NaN where there is none.

    Between the extremes of a cubic, and 0 and 1, it is monotonous: where it changes sign there, bisection finds its one root.
    """
    c0, c1, c2, c3 = c.T
    with np.errstate(divide="ignore", invalid="ignore"):
        disc = np.sqrt(c2 * c2 - 3 * c1 * c3)
        q = -(c2 + np.copysign(disc, c2))
        turns = np.stack([q / (3 * c3), c1 / q], axis=1)
    turns = np.sort(np.clip(np.nan_to_num(turns, nan=0.0, posinf=1.0, neginf=0.0), 0, 1), axis=1)
    n = len(c)
    knots = np.concatenate([np.zeros((n, 1)), turns, np.ones((n, 1))], axis=1)

    def value(t):
        return ((c3[:, None] * t + c2[:, None]) * t + c1[:, None]) * t + c0[:, None]

    lo, hi = knots[:, :-1].copy(), knots[:, 1:].copy()
    at_lo, at_hi = value(lo), value(hi)
    # A knot's sign counts once: a root on a knot belongs to the interval that ends there, and one at 0 to the interval before.
    changes = (at_lo * at_hi < 0) | ((at_hi == 0) & (at_lo != 0))
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        left = np.sign(value(mid)) == np.sign(at_lo)
        lo, hi = np.where(left, mid, lo), np.where(left, hi, mid)
    return np.where(changes, hi, np.nan)


def volume(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Coefficients of (a × b)·c over time, for three vectors x + v t each: `n × 3 × 3` to `n × 4`."""
    (a, b, c), (p, q, r) = np.moveaxis(x, 1, 0), np.moveaxis(v, 1, 0)

    def triple(u, w, z):
        return np.einsum("ij,ij->i", np.cross(u, w), z)

    return np.stack(
        [
            triple(a, b, c),
            triple(p, b, c) + triple(a, q, c) + triple(a, b, r),
            triple(p, q, c) + triple(p, b, r) + triple(a, q, r),
            triple(p, q, r),
        ],
        axis=1,
    )


def first_hits(start: np.ndarray, end: np.ndarray, inside) -> np.ndarray:
    """First time at which four points, `n × 4 × 3`, are coplanar and `inside` holds of them there; NaN where they never are."""
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


def segments_meet(points: np.ndarray) -> np.ndarray:
    """Whether coplanar segments (points 0-1 and 2-3) cross."""
    a, b, c, d = np.moveaxis(points, 1, 0)
    p, q, w = b - a, d - c, c - a
    n = np.cross(p, q)
    nn = np.einsum("ij,ij->i", n, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.einsum("ij,ij->i", np.cross(w, q), n) / nn
        t = np.einsum("ij,ij->i", np.cross(w, p), n) / nn
        return (s >= -EDGE) & (s <= 1 + EDGE) & (t >= -EDGE) & (t <= 1 + EDGE)


def point_in_triangle(points: np.ndarray) -> np.ndarray:
    """Whether point 0 lies in the coplanar triangle of points 1, 2, 3."""
    x, a, b, c = np.moveaxis(points, 1, 0)
    n = np.cross(b - a, c - a)
    nn = np.einsum("ij,ij->i", n, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", np.cross(c - b, x - b), n) / nn
        v = np.einsum("ij,ij->i", np.cross(a - c, x - c), n) / nn
        return (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1 + EDGE)


def meeting_boxes(
    low: np.ndarray,
    high: np.ndarray,
    other_low: np.ndarray | None = None,
    other_high: np.ndarray | None = None,
):
    """Pairs of boxes that meet, `n × 2`: of one set with itself, the lower index first, or of two sets. A uniform grid with cells
    of the mean size of the boxes; a pair counts in the cell of the lower corner of what it shares.
    """
    alone = other_low is None
    lows, highs = (
        (low, high) if alone else (np.concatenate([low, other_low]), np.concatenate([high, other_high]))
    )
    if len(lows) == 0:
        return np.zeros((0, 2), int)
    size = highs - lows
    cell = max(float(size.max(axis=1).mean()) * 1.5, float(size.max()) / 16, 1e-9)
    origin = lows.min(axis=0)
    first, last = (
        np.floor((lows - origin) / cell).astype(np.int64),
        np.floor((highs - origin) / cell).astype(np.int64),
    )
    spans = last - first + 1
    counts = spans.prod(axis=1)
    box = np.repeat(np.arange(len(lows)), counts)
    rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    sy, sz = spans[box, 1], spans[box, 2]
    place = first[box] + np.stack([rank // (sy * sz), rank // sz % sy, rank % sz], axis=1)
    key = (place[:, 0] << 42) | (place[:, 1] << 21) | place[:, 2]
    order = np.lexsort((box, key))
    key, box = key[order], box[order]
    starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    ends = np.r_[starts[1:], len(key)]
    # Each entry with those after it in its cell.
    after = (
        np.repeat(ends - starts, ends - starts) - (np.arange(len(key)) - np.repeat(starts, ends - starts)) - 1
    )
    found = []
    bounds = np.searchsorted(np.cumsum(after), np.arange(CELLS, after.sum() + CELLS, CELLS))
    at = 0
    for until in [*bounds, len(key)]:
        chosen = np.arange(at, min(until + 1, len(key)))
        at = chosen[-1] + 1 if len(chosen) else at
        n = after[chosen]
        i = np.repeat(chosen, n)
        j = i + 1 + np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        a, b, cell_of = box[i], box[j], key[i]
        if not alone:
            crossed = (a < len(low)) != (b < len(low))
            a, b, cell_of = a[crossed], b[crossed], cell_of[crossed]
        meet = np.all((lows[a] <= highs[b]) & (lows[b] <= highs[a]), axis=1)
        a, b, cell_of = a[meet], b[meet], cell_of[meet]
        corner = np.floor((np.maximum(lows[a], lows[b]) - origin) / cell).astype(np.int64)
        told = ((corner[:, 0] << 42) | (corner[:, 1] << 21) | corner[:, 2]) == cell_of
        found.append(np.stack([a[told], b[told]], axis=1))
    pairs = np.concatenate(found)
    if not alone:
        pairs = pairs - [0, len(low)]
    return pairs


def boxes(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the motion of things of several points each, `n × k × 3`."""
    both = np.concatenate([start, end], axis=1)
    return both.min(axis=1), both.max(axis=1)


def strand_strand(start: np.ndarray, end: np.ndarray, strand: np.ndarray) -> Crossings:
    """Segments of different strands that passed through each other; ends of segments `n × 2 × 3`, `strand` of each."""
    pairs = meeting_boxes(*boxes(start, end))
    pairs = pairs[strand[pairs[:, 0]] != strand[pairs[:, 1]]]
    a, b = pairs.T
    hit = first_hits(
        np.concatenate([start[a], start[b]], axis=1), np.concatenate([end[a], end[b]], axis=1), segments_meet
    )
    found = ~np.isnan(hit)
    return Crossings(len(pairs), pairs[found], hit[found])


def strand_body(
    start: np.ndarray, end: np.ndarray, corners: np.ndarray, corners_end: np.ndarray
) -> Crossings:
    """Segments `n × 2 × 3` that passed through, or into, moving triangles `m × 3 × 3`: an end through a face, or the segment
    through an edge. A strand that goes in with its tip, and one that is wrapped round an edge, so both count.
    """
    pairs = meeting_boxes(*boxes(start, end), *boxes(corners, corners_end))
    s, t = pairs.T
    hits = []
    for k in range(2):
        points = [
            np.concatenate([x[s, k : k + 1], y[t]], axis=1) for x, y in ((start, corners), (end, corners_end))
        ]
        hits.append(first_hits(*points, point_in_triangle))
    for k in range(3):
        edge = [k, (k + 1) % 3]
        points = [
            np.concatenate([x[s], y[t][:, edge]], axis=1) for x, y in ((start, corners), (end, corners_end))
        ]
        hits.append(first_hits(*points, segments_meet))
    hit = np.fmin.reduce(hits) if hits else np.zeros(0)
    found = ~np.isnan(hit)
    return Crossings(len(pairs), pairs[found], hit[found])


def segments_meet_faces(segments: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether segments `n × 2 × 3` that stand still pierce triangles `n × 3 × 3` (Möller & Trumbore 1997)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    d, p, q, w = segments[:, 1] - segments[:, 0], b - a, c - a, segments[:, 0] - a
    h = np.cross(d, q)
    det = np.einsum("ij,ij->i", p, h)
    k = np.cross(w, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, t = (np.einsum("ij,ij->i", x, y) / det for x, y in ((w, h), (d, k), (q, k)))
        return (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
