"""Penetration depth of many points in one triangle mesh, exact for every point that may be inside.

An octree in the mesh's own space is built once. Each leaf that the surface may intersect, or that lies
inside, keeps the triangles that can be closest to any of its points; all other space is known to be outside.
The distance to a set is 1-Lipschitz: for the distance d of a cell's centre and the cell's half diagonal r,
the surface intersects the cell only if d ≤ r, and only triangles within d + 2r of the centre can be closest
to a point of it.

The sign is that of the angle-weighted pseudonormal at the closest point (Bærentzen and Aanæs 2005), exact for
closed meshes. Points whose closest point is on the boundary of an open mesh count as outside, and so do
points deep in a head whose closest surface is that of an eyeball: hair enters through the skin, where the
sign is right.
"""

from dataclasses import dataclass

import numpy as np

from .geometry import BoolArray, FloatArray, IntArray

MAX_LEVELS = 7
"""Largest depth of the octree: the finest cell is then 1/128 of the root cell."""

PAIRS_PER_BLOCK = 200_000
"""Point-triangle pairs measured at once: the arrays stay in the processor's cache."""

FACE = 0
"""Index of a triangle's face among its features; 1-3 are the edges from corners 0-2, 4-6 the corners."""


@dataclass(frozen=True)
class Leaves:
    """The leaves of the octree that may hold inside points."""

    candidates: IntArray
    """Triangles that can be closest to a point of a leaf, leaf after leaf."""
    start: IntArray
    """Index of each leaf's first candidate."""
    count: IntArray
    """Number of candidates of each leaf."""
    clearance: FloatArray
    """Signed distance of the leaf's centre: points nearer to the centre are outside. 0 for coarse leaves."""


class Collider:
    """Signed distance to a triangle mesh."""

    def __init__(self, points: FloatArray, triangles: IntArray) -> None:
        """Builds the octree of a mesh: `points` f64, `V × 3`; `triangles`, `T × 3`, of either orientation."""
        # Texture seams split vertices; pseudonormals need them joined.
        points, index = np.unique(points, axis=0, return_inverse=True)
        triangles = index.reshape(-1)[triangles]
        corners = points[triangles]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        triangles, corners = triangles[area > 0], corners[area > 0]
        centre = (points.min(0) + points.max(0)) / 2
        volume = np.einsum(
            "ij,ij->i", corners[:, 0] - centre, np.cross(corners[:, 1] - centre, corners[:, 2] - centre)
        ).sum()
        if volume < 0:
            triangles, corners = triangles[:, ::-1], corners[:, ::-1]
        self.corners = np.ascontiguousarray(corners)
        self.centroids = self.corners.mean(axis=1)
        self.radii = np.linalg.norm(self.corners - self.centroids[:, None], axis=2).max(axis=1)
        self.normals = pseudonormals(triangles, self.corners, len(points))
        # The margin gives flat meshes space on both sides.
        self.size = 1.1 * (points.max(0) - points.min(0)).max()
        self.origin = centre - self.size / 2
        # Cells much smaller than the triangles gain nothing.
        self.levels = int(np.clip(np.ceil(np.log2(2 * self.size / np.median(self.radii))), 2, MAX_LEVELS))
        self.leaf_of_cell = np.full((2**self.levels,) * 3, -1, np.int32)
        """Leaf of each finest cell; -1 if the cell is outside."""
        self.leaves = self._build()

    def depth(self, points: FloatArray) -> FloatArray:
        """Penetration depth of points (`N × 3`): minus the signed distance, 0 outside; `N`."""
        cells = 2**self.levels
        place = (points - self.origin) * (cells / self.size)
        within = np.flatnonzero(((place >= 0) & (place < cells)).all(axis=1))
        x, y, z = place[within].astype(int).T
        leaf = self.leaf_of_cell[x, y, z]
        centre = self.origin + (np.floor(place[within]) + 0.5) * (self.size / cells)
        offset = np.linalg.norm(points[within] - centre, axis=1)
        uncertain = (leaf >= 0) & (offset >= self.leaves.clearance[leaf])
        within, leaf = within[uncertain], leaf[uncertain]
        depth = np.zeros(len(points))
        start, count = self.leaves.start[leaf], self.leaves.count[leaf]
        _, signed = self._nearest(points[within], self.leaves.candidates, start, count)
        depth[within] = np.maximum(0, -signed)
        return depth

    def _build(self) -> Leaves:
        """Refines the octree level by level, and collects its leaves."""
        lists: list[IntArray] = []
        counts: list[IntArray] = []
        clearances: list[FloatArray] = []
        cells = np.zeros((1, 3), int)
        candidates: IntArray = np.arange(len(self.corners))
        count: IntArray = np.array([len(self.corners)])
        for level in range(self.levels + 1):
            side = self.size / 2**level
            half_diagonal = np.sqrt(3) / 2 * side
            centres = self.origin + (cells + 0.5) * side
            candidates, count = self._within_spheres(centres, candidates, count, 2 * half_diagonal)
            start = np.cumsum(count) - count
            distance, signed = self._nearest(centres, candidates, start, count)
            nearest = np.abs(signed)
            keep = distance <= np.repeat(nearest + 2 * half_diagonal, count)
            cell_of = np.repeat(np.arange(len(cells)), count)[keep]
            candidates, count = candidates[keep], np.bincount(cell_of, minlength=len(cells))
            near = nearest <= half_diagonal
            is_leaf = (near if level == self.levels else np.zeros_like(near)) | (~near & (signed < 0))
            self._assign_leaves(cells[is_leaf], level, first=sum(len(c) for c in counts))
            lists.append(candidates[is_leaf[cell_of]])
            counts.append(count[is_leaf])
            # `depth` measures from the centres of the finest cells only.
            clearances.append(np.where(level == self.levels, np.maximum(0, signed[is_leaf]), 0.0))
            cells, candidates, count = subdivide(cells, candidates, count, cell_of, near & ~is_leaf)
            if not len(cells):
                break
        count = np.concatenate(counts)
        return Leaves(np.concatenate(lists), np.cumsum(count) - count, count, np.concatenate(clearances))

    def _within_spheres(
        self, centres: FloatArray, candidates: IntArray, count: IntArray, slack: float
    ) -> tuple[IntArray, IntArray]:
        """Drops candidates whose bounding spheres are more than `slack` farther than the nearest centroid."""
        cell_of = np.repeat(np.arange(len(count)), count)
        offset = np.linalg.norm(centres[cell_of] - self.centroids[candidates], axis=1)
        nearest = np.minimum.reduceat(offset, np.cumsum(count) - count)
        keep = offset - self.radii[candidates] <= np.repeat(nearest + slack, count)
        return candidates[keep], np.bincount(cell_of[keep], minlength=len(count))

    def _assign_leaves(self, cells: IntArray, level: int, first: int) -> None:
        """Enters leaves `first`, `first + 1`, … in the finest grid."""
        block = 2 ** (self.levels - level)
        offsets = np.stack(np.meshgrid(*[np.arange(block)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        x, y, z = (cells[:, None] * block + offsets).reshape(-1, 3).T
        self.leaf_of_cell[x, y, z] = np.repeat(np.arange(first, first + len(cells)), len(offsets))

    def _nearest(
        self, points: FloatArray, candidates: IntArray, start: IntArray, count: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Distance of every pair of a point and one of its candidates, and the signed distance of each point.

        The candidates of a point are `count` entries of `candidates` from `start` on.
        """
        distances: list[FloatArray] = [np.empty(0)]
        signed: list[FloatArray] = [np.empty(0)]
        total = np.cumsum(count)
        low = 0
        while low < len(points):
            base = total[low] - count[low]
            high = max(low + 1, int(np.searchsorted(total, base + PAIRS_PER_BLOCK, side="right")))
            block = slice(low, high)
            pairs, nearest = self._nearest_in_block(points[block], candidates, start[block], count[block])
            distances.append(pairs)
            signed.append(nearest)
            low = high
        return np.concatenate(distances), np.concatenate(signed)

    def _nearest_in_block(
        self, points: FloatArray, candidates: IntArray, start: IntArray, count: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        point_of = np.repeat(np.arange(len(points)), count)
        begin = np.cumsum(count) - count
        triangle = candidates[np.arange(len(point_of)) + np.repeat(start - begin, count)]
        squared, away, feature = closest(points[point_of], self.corners[triangle])
        smallest = np.minimum.reduceat(squared, begin)
        hits = np.flatnonzero(squared == np.repeat(smallest, count))
        hits = hits[np.unique(point_of[hits], return_index=True)[1]]
        normal = self.normals[triangle[hits], feature[hits]]
        inside = np.einsum("ij,ij->i", away[hits], normal) < 0
        return np.sqrt(squared), np.where(inside, -1, 1) * np.sqrt(smallest)


def subdivide(
    cells: IntArray, candidates: IntArray, count: IntArray, cell_of: IntArray, split: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """The eight children of each cell that is split; each inherits the cell's candidates.

    `cell_of` is the cell of each candidate. Returns the cells, their candidates, and how many each has.
    """
    children = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    finer = (2 * cells[split][:, None] + children).reshape(-1, 3)
    if not len(finer):
        return finer, np.empty(0, int), np.empty(0, int)
    runs = np.split(candidates[split[cell_of]], np.cumsum(count[split])[:-1])
    return finer, np.concatenate([np.tile(run, 8) for run in runs]), np.repeat(count[split], 8)


def closest(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Closest points of triangles to points, pairwise (`M × 3`, `M × 3 × 3`).

    Returns the squared distance, the vector from the closest point to the point, and the feature on which the
    closest point lies.
    """
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    over = np.ones(len(points), bool)
    squared = np.full(len(points), np.inf)
    away = np.empty_like(points)
    feature = np.full(len(points), FACE)
    for k in range(3):
        a, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        from_a = points - a
        over &= np.einsum("ij,ij->i", np.cross(edge, from_a), normal) >= 0
        t = np.clip(np.einsum("ij,ij->i", from_a, edge) / np.einsum("ij,ij->i", edge, edge), 0, 1)
        offset = from_a - t[:, None] * edge
        distance = np.einsum("ij,ij->i", offset, offset)
        better = distance < squared
        squared[better], away[better] = distance[better], offset[better]
        feature[better] = np.select([t == 0, t == 1], [4 + k, 4 + (k + 1) % 3], 1 + k)[better]
    height = np.einsum("ij,ij->i", points - corners[:, 0], normal) / np.einsum("ij,ij->i", normal, normal)
    away[over] = (height[:, None] * normal)[over]
    squared[over] = np.einsum("ij,ij->i", away[over], away[over])
    feature[over] = FACE
    return squared, away, feature


def pseudonormals(triangles: IntArray, corners: FloatArray, vertices: int) -> FloatArray:
    """Pseudonormals of each triangle's seven features, `T × 7 × 3`; zero on the boundary of an open mesh."""
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    normals = np.empty((len(triangles), 7, 3))
    normals[:, FACE] = face
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    unique, edge_of, uses = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    edge_of = edge_of.reshape(-1)
    edge_normal = np.zeros((len(unique), 3))
    np.add.at(edge_normal, edge_of, np.repeat(face, 3, axis=0))
    edge_normal[uses == 1] = 0
    normals[:, 1:4] = edge_normal[edge_of].reshape(-1, 3, 3)
    vertex_normal = np.zeros((vertices, 3))
    for k in range(3):
        to_next = corners[:, (k + 1) % 3] - corners[:, k]
        to_last = corners[:, (k + 2) % 3] - corners[:, k]
        cosine = np.einsum("ij,ij->i", to_next, to_last) / (
            np.linalg.norm(to_next, axis=1) * np.linalg.norm(to_last, axis=1)
        )
        np.add.at(vertex_normal, triangles[:, k], np.arccos(np.clip(cosine, -1, 1))[:, None] * face)
    vertex_normal[unique[uses == 1].ravel()] = 0
    normals[:, 4:7] = vertex_normal[triangles]
    return normals
