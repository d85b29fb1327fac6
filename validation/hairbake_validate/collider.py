"""Penetration depth of many points in one triangle mesh, exact for every point that may be inside.

An octree in the mesh's own space is built once. Each leaf that the surface may intersect, or that lies
inside, keeps the triangles that can be closest to any of its points; all other space is known to be outside.
The distance to a set is 1-Lipschitz: for the distance d of a cell's centre and the cell's half diagonal r,
the surface intersects the cell only if d ≤ r, and only triangles within d + 2r of the centre can be closest
to a point of it.

The sign is that of the angle-weighted pseudonormal at the closest point (Bærentzen and Aanæs 2005), exact for
closed meshes. Points whose closest point is on the boundary of an open mesh count as outside, and so do
points deep in a head whose closest surface is that of an eyeball: hair enters through the skin, where the
sign is right. Where a surface passes through itself, points outside may count as inside, too: `winds_past`
tells them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .geometry import BoolArray, FloatArray, IntArray, cross, dot, norms, sums

MAX_LEVELS = 7
"""Largest depth of the octree: the finest cell is then 1/128 of the root cell."""

PAIRS_PER_BLOCK = 50_000
"""Point-triangle pairs measured at once: the arrays stay in the processor's cache."""

CHILDREN = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
"""Places of a cell's children on the next level."""

FACE = 0
"""Index of a triangle's face among its features; 1-3 are the edges from corners 0-2, 4-6 the corners."""


@dataclass(frozen=True)
class Runs:
    """Some triangles for each of some points: those that can be closest to it."""

    triangles: IntArray
    """The triangles, run after run."""
    start: IntArray
    """Index of each run's first triangle."""
    count: IntArray
    """Number of triangles of each run, at least 1."""

    @classmethod
    def adjacent(cls, triangles: IntArray, count: IntArray) -> "Runs":
        """Runs that follow each other without gaps."""
        return cls(triangles, np.cumsum(count) - count, count)

    def select(self, which: Any) -> "Runs":
        """The runs at an index, slice or mask."""
        return Runs(self.triangles, self.start[which], self.count[which])

    def expand(self) -> tuple[IntArray, IntArray]:
        """Run and triangle of every pair."""
        run = np.repeat(np.arange(len(self.count)), self.count)
        first = np.cumsum(self.count) - self.count
        return run, self.triangles[np.arange(len(run)) + np.repeat(self.start - first, self.count)]

    def blocks(self) -> Iterator[slice]:
        """Slices of consecutive runs of about `PAIRS_PER_BLOCK` pairs together."""
        total = np.cumsum(self.count)
        low = 0
        while low < len(self.count):
            end = total[low] - self.count[low] + PAIRS_PER_BLOCK
            high = max(low + 1, int(np.searchsorted(total, end, side="right")))
            yield slice(low, high)
            low = high


@dataclass(frozen=True)
class Leaves:
    """The leaves of the octree that may hold inside points."""

    runs: Runs
    """Triangles that can be closest to a point of each leaf."""
    clearance: FloatArray
    """Signed distance of the leaf's centre: points nearer to the centre are outside. 0 for coarse leaves."""


class Collider:
    """Signed distance to a triangle mesh."""

    def __init__(self, points: FloatArray, triangles: IntArray, queries: FloatArray | None = None) -> None:
        """Builds the octree of a mesh.

        Args:
            points: Vertices, f64, `V × 3`.
            triangles: `T × 3`, of either orientation.
            queries: The only points whose depth will be asked for, `N × 3`; default: any. Space without them
                is left out of the octree: for a mesh that is used for one frame.
        """
        # Texture seams split vertices; pseudonormals need them joined.
        points, index = np.unique(points, axis=0, return_inverse=True)
        triangles = index.reshape(-1)[triangles]
        self.closed = is_closed(triangles)
        """Whether it has no boundary."""
        corners = points[triangles]
        area = norms(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        triangles, corners = triangles[area > 0], corners[area > 0]
        centre = (points.min(0) + points.max(0)) / 2
        volume = dot(corners[:, 0] - centre, cross(corners[:, 1] - centre, corners[:, 2] - centre)).sum()
        if volume < 0:
            triangles, corners = triangles[:, ::-1], corners[:, ::-1]
        self.corners = np.ascontiguousarray(corners)
        # Each coordinate is contiguous: it is gathered for many pairs at once.
        self.centroids = np.asfortranarray(self.corners.mean(axis=1))
        self.radii = np.max([norms(self.corners[:, k] - self.centroids) for k in range(3)], axis=0)
        self.frames = Frames(self.corners)
        self.normals = pseudonormals(triangles, self.corners, len(points))
        # The margin gives flat meshes space on both sides.
        self.size = 1.1 * (points.max(0) - points.min(0)).max()
        self.origin = centre - self.size / 2
        # Cells much smaller than the triangles gain nothing.
        self.levels = int(np.clip(np.ceil(np.log2(2 * self.size / np.median(self.radii))), 2, MAX_LEVELS))
        self.leaf_of_cell = np.full((2**self.levels,) * 3, -1, np.int32)
        """Leaf of each finest cell; -1 if the cell is outside."""
        self.leaves = self._build(None if queries is None else self._occupied(queries))

    def depth(self, points: FloatArray) -> FloatArray:
        """Penetration depth of points (`N × 3`): minus the signed distance, 0 outside; `N`."""
        within, cells, offset = self._cells(points)
        leaf = self.leaf_of_cell[tuple(cells)]
        uncertain = np.flatnonzero(leaf >= 0)
        uncertain = uncertain[offset[uncertain] >= self.leaves.clearance[leaf[uncertain]]]
        within, leaf = within[uncertain], leaf[uncertain]
        depth = np.zeros(len(points))
        near, runs = points[within], self.leaves.runs.select(leaf)
        for block in runs.blocks():
            signed, *_ = self._signed_distance(near[block], runs.select(block))
            depth[within[block]] = np.maximum(0, -signed)
        return depth

    def surface(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance of points (`N × 3`) and the outward normals there, from all triangles."""
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        every = np.arange(len(self.corners))
        runs = Runs(every, np.zeros(len(points), int), np.full(len(points), len(every)))
        for block in runs.blocks():
            signed, away, *_ = self._signed_distance(points[block], runs.select(block))
            distance[block] = signed
            normal[block] = away / np.where(signed == 0, 1, signed)[:, None]
        return distance, normal

    def facing(
        self, points: FloatArray, normals: FloatArray, least: float, front: float
    ) -> tuple[FloatArray, FloatArray]:
        """Signed distance of places on the surface from the part of it that faces each, and its normals.

        Infinite where no part does, or where it is but the other side of the solid that the place is on.

        Args:
            points: The places, `N × 3`.
            normals: Outward normals there.
            least: Cosine of the angle between outward normals, negated, from which parts face each other.
            front: How far in front of its place a point is told to be inside or outside.
        """
        distance, away = np.full(len(points), np.inf), np.zeros((len(points), 3))
        for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
            faces = np.flatnonzero(self.normals[:, FACE] @ normal < -least)
            if len(faces):
                run = Runs.adjacent(faces, np.array([len(faces)]))
                signed, offset, *_ = self._signed_distance(point[None], run)
                if signed[0] >= 0 or self.winding(point + front * normal) > 0.5:
                    distance[k], away[k] = signed[0], offset[0] / (signed[0] or 1)
        return distance, away

    def around(
        self, points: FloatArray, normals: FloatArray, bent: float, ahead: float, front: float
    ) -> tuple[FloatArray, FloatArray]:
        """Signed distance of places on the surface from the part of it that each is inside, and its normals.

        Infinite where a place is inside no other part.

        Args:
            points: The places, `N × 3`.
            normals: Outward normals there.
            bent: Cosine of the angle between outward normals above which a face is of the part of the place.
            ahead: Least cosine of the angle between the way out of a part and its normal.
            front: How far in front of its place a point is told to be inside or outside.
        """
        distance, away = np.full(len(points), np.inf), np.zeros((len(points), 3))
        for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
            if self.winding(point + front * normal) <= 0.5:
                continue
            faces = np.flatnonzero(self.normals[:, FACE] @ normal < bent)
            each = Runs(faces, np.arange(len(faces)), np.ones(len(faces), int))
            signed, offset, *_ = self._signed_distance(np.tile(point, (len(faces), 1)), each)
            cosine = dot(-offset, self.normals[faces, FACE]) / np.maximum(norms(offset), np.finfo(float).tiny)
            signed = np.where((cosine > ahead) & (signed < 0), signed, -np.inf)
            best = int(signed.argmax()) if len(faces) else 0
            if len(faces) and signed[best] > -np.inf:
                distance[k], away[k] = signed[best], offset[best] / signed[best]
        return distance, away

    def winds_past(self, points: FloatArray) -> BoolArray:
        """Which points (`N × 3`) the mesh is closed and does not wind about.

        The surface nearest to such a point is turned inside out if the point is behind it.
        """
        return np.array([self.closed and self.winding(point) <= 0.5 for point in points], bool)

    def winding(self, point: FloatArray) -> float:
        """How many times the mesh winds about a point (Van Oosterom and Strackee 1983)."""
        a, b, c = (self.corners[:, k] - point for k in range(3))
        la, lb, lc = norms(a), norms(b), norms(c)
        below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
        return float(np.arctan2(dot(a, cross(b, c)), below).sum() / (2 * np.pi))

    def _cells(self, points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Points within the root cell, their finest cells, `3 × n`, and distances from the cells' centres."""
        count = 2**self.levels
        place = (points - self.origin).T * (count / self.size)
        within = np.flatnonzero(np.logical_and.reduce((place >= 0) & (place < count)))
        place = place[:, within]
        cells = place.astype(int)
        return within, cells, norms((place - cells - 0.5).T) * (self.size / count)

    def _occupied(self, points: FloatArray) -> list[BoolArray]:
        """The cells that hold points, level by level."""
        finest = np.zeros((2**self.levels,) * 3, bool)
        finest[tuple(self._cells(points)[1])] = True
        levels = [finest]
        while len(levels[-1]) > 1:
            halves = (len(levels[-1]) // 2, 2)
            levels.append(np.logical_or.reduce(levels[-1].reshape(halves * 3), axis=(1, 3, 5)))
        return levels[::-1]

    def _build(self, occupied: list[BoolArray] | None) -> Leaves:
        """Refines the octree level by level, and collects its leaves; drops cells that are not `occupied`."""
        leaves = [Runs.adjacent(np.empty(0, int), np.empty(0, int))]
        clearances: list[FloatArray] = [np.empty(0)]
        cells = np.zeros((1, 3), int)
        runs = Runs.adjacent(np.arange(len(self.corners)), np.array([len(self.corners)]))
        for level in range(self.levels + 1):
            if occupied is not None:
                kept = occupied[level][tuple(cells.T)]
                cells, runs = cells[kept], runs.select(kept)
            if not len(cells):
                break
            side = self.size / 2**level
            half_diagonal = np.sqrt(3) / 2 * side
            signed, runs = self._narrow(self.origin + (cells + 0.5) * side, runs, 2 * half_diagonal)
            near = np.abs(signed) <= half_diagonal
            is_leaf = (near if level == self.levels else np.zeros_like(near)) | (~near & (signed < 0))
            self._assign_leaves(cells[is_leaf], level, first=sum(len(c) for c in clearances))
            leaves.append(runs.select(is_leaf))
            # `depth` measures from the centres of the finest cells only.
            clearances.append(np.where(level == self.levels, np.maximum(0, signed[is_leaf]), 0.0))
            split = np.flatnonzero(near & ~is_leaf)
            # Each child inherits the candidates of its parent.
            cells = (2 * cells[split][:, None] + CHILDREN).reshape(-1, 3)
            runs = runs.select(np.repeat(split, len(CHILDREN)))
        triangles = np.concatenate([leaf.expand()[1] for leaf in leaves])
        count = np.concatenate([leaf.count for leaf in leaves])
        return Leaves(Runs.adjacent(triangles, count), np.concatenate(clearances))

    def _narrow(self, centres: FloatArray, runs: Runs, slack: float) -> tuple[FloatArray, Runs]:
        """Signed distance of cells' centres, and the candidates that may be as close, up to `slack`."""
        distances: list[FloatArray] = []
        triangles: list[IntArray] = []
        counts: list[IntArray] = []
        for block in runs.blocks():
            signed, _, cell, triangle, least = self._signed_distance(centres[block], runs.select(block))
            keep = least <= (np.abs(signed) + slack)[cell]
            distances.append(signed)
            triangles.append(triangle[keep])
            counts.append(np.bincount(cell[keep], minlength=len(signed)))
        return np.concatenate(distances), Runs.adjacent(np.concatenate(triangles), np.concatenate(counts))

    def _signed_distance(
        self, points: FloatArray, runs: Runs
    ) -> tuple[FloatArray, FloatArray, IntArray, IntArray, FloatArray]:
        """Signed distance of each point to the closest triangle of its run.

        Also returns the vector from there to the point, and point, triangle and least possible distance of
        every pair, by the bounding spheres: only triangles that may be closer than the nearest centroid are
        measured.
        """
        point, triangle = runs.expand()
        squares = np.zeros(len(point))
        for place, centroid in zip(points.T, self.centroids.T, strict=True):
            difference = np.repeat(place, runs.count)
            difference -= centroid[triangle]
            squares += np.square(difference, out=difference)
        offset = np.sqrt(squares, out=squares)
        nearest = np.minimum.reduceat(offset, np.cumsum(runs.count) - runs.count)
        least = offset - self.radii[triangle]
        measured = np.flatnonzero(least <= np.repeat(nearest, runs.count))
        at, candidate = point[measured], triangle[measured]
        squared = self.frames.squared_distance([place[at] for place in points.T], candidate)
        begin = np.flatnonzero(np.diff(at, prepend=-1))
        hits = np.flatnonzero(squared == np.minimum.reduceat(squared, begin)[at])
        hits = hits[np.flatnonzero(np.diff(at[hits], prepend=-1))]
        away, feature = closest(points, self.corners[candidate[hits]])
        inside = dot(away, self.normals[candidate[hits], feature]) < 0
        return np.where(inside, -1, 1) * norms(away), away, point, triangle, least

    def _assign_leaves(self, cells: IntArray, level: int, first: int) -> None:
        """Enters leaves `first`, `first + 1`, … in the finest grid."""
        if not len(cells):
            return
        block = 2 ** (self.levels - level)
        offsets = np.stack(np.meshgrid(*[np.arange(block)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        x, y, z = (cells[:, None] * block + offsets).reshape(-1, 3).T
        self.leaf_of_cell[x, y, z] = np.repeat(np.arange(first, first + len(cells)), len(offsets))


class Frames:
    """Triangles in their own planes: the first edge along x, the second side of it at positive y."""

    def __init__(self, corners: FloatArray) -> None:
        """Frames of triangles, `T × 3 × 3`, none without area."""
        first, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        self.origin = np.asfortranarray(corners[:, 0])
        self.length: FloatArray = norms(first)
        """x of the second corner."""
        x = first / self.length[:, None]
        z = cross(first, other)
        z /= norms(z)[:, None]
        self.axes = [np.asfortranarray(axis) for axis in (x, cross(z, x), z)]
        self.apex = (dot(other, x), dot(other, self.axes[1]))
        """x and y of the third corner."""

    def squared_distance(self, points: list[FloatArray], triangles: IntArray) -> FloatArray:
        """Squared distances of points to triangles, pairwise; `points` holds their three coordinates."""
        offset = [place - self.origin[:, k][triangles] for k, place in enumerate(points)]
        x, y, z = (sum(part * axis[:, k][triangles] for k, part in enumerate(offset)) for axis in self.axes)
        length, right, height = (values[triangles] for values in (self.length, *self.apex))
        distance = (x - np.clip(x, 0, length)) ** 2 + y**2
        inside = y >= 0
        # The other two edges run from the ends of the first one to the apex.
        for side, start in ((1, 0.0), (-1, length)):
            run, from_start = right - start, x - start
            inside &= side * (height * from_start - run * y) >= 0
            t = np.clip((from_start * run + y * height) / (run**2 + height**2), 0, 1)
            distance = np.minimum(distance, (from_start - t * run) ** 2 + (y - t * height) ** 2)
        distance[inside] = 0
        distance += z**2
        return distance


def closest(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Vectors from the closest points of triangles to points, pairwise (`M × 3`, `M × 3 × 3`).

    Also returns the feature on which the closest point lies.
    """
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    over = np.ones(len(points), bool)
    squared = np.full(len(points), np.inf)
    away = np.empty_like(points)
    feature = np.full(len(points), FACE)
    for k in range(3):
        a, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        from_a = points - a
        over &= dot(cross(edge, from_a), normal) >= 0
        t = np.clip(dot(from_a, edge) / dot(edge, edge), 0, 1)
        offset = from_a - t[:, None] * edge
        distance = dot(offset, offset)
        better = distance < squared
        squared[better], away[better] = distance[better], offset[better]
        feature[better] = np.select([t == 0, t == 1], [4 + k, 4 + (k + 1) % 3], 1 + k)[better]
    height = dot(points - corners[:, 0], normal) / dot(normal, normal)
    away[over] = (height[:, None] * normal)[over]
    feature[over] = FACE
    return away, feature


def nearest(points: FloatArray, vertices: FloatArray, triangles: IntArray) -> tuple[IntArray, FloatArray]:
    """The triangle that is nearest to each point, and the vector to the point from its closest place."""
    corners = vertices[triangles]
    whole = np.flatnonzero(norms(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) > 0)
    corners = corners[whole]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    found, vectors = np.empty(len(points), int), np.empty((len(points), 3))
    for block in near_each_other(points):
        middle = points[block].mean(axis=0)
        reach = norms(points[block] - middle).max()
        far = norms(centres - middle)
        near = np.flatnonzero(far - radii - reach <= (far + radii).min() + reach)
        pairs = np.repeat(points[block], len(near), axis=0), np.tile(corners[near], (len(block), 1, 1))
        away = closest(*pairs)[0].reshape(len(block), len(near), 3)
        best = np.linalg.norm(away, axis=2).argmin(axis=1)
        found[block], vectors[block] = whole[near[best]], away[np.arange(len(block)), best]
    return found, vectors


def near_each_other(points: FloatArray, most: int = 32) -> list[IntArray]:
    """Indices of the points in blocks of at most `most`, halved at medians along their greatest extent."""
    blocks: list[IntArray] = []
    left: list[IntArray] = [np.arange(len(points))] if len(points) else []
    while left:
        block = left.pop()
        if len(block) <= most:
            blocks.append(block)
            continue
        along = points[block, np.ptp(points[block], axis=0).argmax()]
        left += np.split(block[np.argpartition(along, len(block) // 2)], [len(block) // 2])
    return blocks


def is_closed(triangles: IntArray) -> bool:
    """Whether each edge is followed as often one way as the other."""
    start, end = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    count = int(triangles.max(initial=0)) + 1
    edges, index = np.unique(np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True)
    return not np.bincount(index.reshape(-1), np.sign(end - start), len(edges)).any()


def pseudonormals(triangles: IntArray, corners: FloatArray, vertices: int) -> FloatArray:
    """Pseudonormals of each triangle's seven features, `T × 7 × 3`; zero on the boundary of an open mesh."""
    face = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= norms(face)[:, None]
    normals = np.empty((len(triangles), 7, 3))
    normals[:, FACE] = face
    following = np.roll(triangles, -1, axis=1)
    edges = np.minimum(triangles, following) * vertices + np.maximum(triangles, following)
    unique, edge_of, uses = np.unique(edges, return_inverse=True, return_counts=True)
    edge_of, boundary = edge_of.reshape(triangles.shape), uses == 1
    edge_normal = sums(edge_of, [face] * 3, len(unique))
    edge_normal[boundary] = 0
    normals[:, 1:4] = edge_normal[edge_of]
    weighted = []
    for k in range(3):
        to_next = corners[:, (k + 1) % 3] - corners[:, k]
        to_last = corners[:, (k + 2) % 3] - corners[:, k]
        cosine = dot(to_next, to_last) / (norms(to_next) * norms(to_last))
        weighted.append(np.arccos(np.clip(cosine, -1, 1))[:, None] * face)
    vertex_normal = sums(triangles, weighted, vertices)
    vertex_normal[np.concatenate(np.divmod(unique[boundary], vertices))] = 0
    normals[:, 4:7] = vertex_normal[triangles]
    return normals
