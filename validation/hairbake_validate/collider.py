"""Signed distance from many points to one rigid triangle mesh, exact wherever a point may be inside.

An octree in the mesh's own space is built once. A leaf that the surface may touch, or that lies inside,
keeps the triangles that can be closest to any of its points; all else is known to be outside. Distance to a
set is 1-Lipschitz: with d the distance of a cell's centre and r the cell's half diagonal, the surface
passes through the cell only if d ≤ r, and only triangles within d + 2r of the centre can be closest to a
point of the cell.

The sign is that of the angle-weighted pseudonormal of the closest feature (Bærentzen & Aanæs 2005), exact
for closed meshes. Points closest to the rim of an open mesh count as outside, and so do points deep in a
head whose closest surface is that of an eyeball: what counts for hair is the way through the skin, which
the sign sees.
"""

import numpy as np

DEEPEST = 7
"""Most levels of the octree: the finest cell is then 1/128 of the mesh's largest side."""

PAIRS = 200_000
"""Point-triangle pairs measured at once: arrays that stay in the processor's cache."""

FACE = 0
"""Features of a triangle: 0 the face, 1-3 the edges from corner 0, 1, 2, and 4-6 the corners."""


class Collider:
    """Signed distance to a mesh: `points` f64 `V × 3`, `triangles` int `T × 3`; outward normals not required."""

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        # Texture seams split vertices; the pseudonormals need them joined.
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
        self.middles = self.corners.mean(axis=1)
        self.radii = np.linalg.norm(self.corners - self.middles[:, None], axis=2).max(axis=1)
        self.normals = pseudonormals(triangles, self.corners, len(points))
        # A margin, so that flat meshes have a space on both sides.
        self.size = 1.1 * (points.max(0) - points.min(0)).max()
        self.origin = centre - self.size / 2
        # Cells much smaller than the triangles would gain nothing.
        self.levels = int(np.clip(np.ceil(np.log2(2 * self.size / np.median(self.radii))), 2, DEEPEST))
        self._build()

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How deep each of the points (`N × 3`) lies inside: minus the signed distance, or 0 where outside; `N`."""
        cells = 2**self.levels
        place = (points - self.origin) * (cells / self.size)
        within = np.flatnonzero(((place >= 0) & (place < cells)).all(axis=1))
        x, y, z = place[within].astype(int).T
        leaf = self.leaf[x, y, z]
        # A point nearer to the cell's centre than the surface is on the centre's side of it.
        centre = self.origin + (np.floor(place[within]) + 0.5) * (self.size / cells)
        offset = np.linalg.norm(points[within] - centre, axis=1)
        doubtful = (leaf >= 0) & (offset >= self.clear[leaf])
        within, leaf = within[doubtful], leaf[doubtful]
        depth = np.zeros(len(points))
        _, signed = self._nearest(points[within], self.start[leaf], self.count[leaf])
        depth[within] = np.maximum(0, -signed)
        return depth

    def _build(self) -> None:
        self.leaf = np.full((2**self.levels,) * 3, -1, np.int32)
        lists, counts, clear = [], [], []
        cells = np.zeros((1, 3), int)
        candidates, count = np.arange(len(self.corners)), np.array([len(self.corners)])
        for level in range(self.levels + 1):
            side = self.size / 2**level
            half_diagonal = np.sqrt(3) / 2 * side
            centres = self.origin + (cells + 0.5) * side
            candidates, count = self._within_spheres(centres, candidates, count, 2 * half_diagonal)
            start = np.cumsum(count) - count
            self.candidates = candidates
            distance, signed = self._nearest(centres, start, count)
            nearest = np.abs(signed)
            keep = distance <= np.repeat(nearest + 2 * half_diagonal, count)
            cell_of = np.repeat(np.arange(len(cells)), count)[keep]
            candidates, count = candidates[keep], np.bincount(cell_of, minlength=len(cells))
            near = nearest <= half_diagonal
            is_leaf = (near if level == self.levels else np.zeros_like(near)) | (~near & (signed < 0))
            first = sum(len(c) for c in counts)
            self._mark(cells[is_leaf], level, first)
            lists.append(candidates[is_leaf[cell_of]])
            counts.append(count[is_leaf])
            # Only the finest cells have the centre that `depth` measures from.
            clear.append(np.where(level == self.levels, np.maximum(0, signed[is_leaf]), 0.0))
            split = near & ~is_leaf
            children = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
            cells = (2 * cells[split][:, None] + children).reshape(-1, 3)
            runs = np.split(candidates[split[cell_of]], np.cumsum(count[split])[:-1])
            candidates = np.concatenate([np.tile(run, 8) for run in runs]) if len(cells) else np.empty(0, int)
            count = np.repeat(count[split], 8)
            if not len(cells):
                break
        self.candidates = np.concatenate(lists)
        self.count = np.concatenate(counts)
        self.start = np.cumsum(self.count) - self.count
        self.clear = np.concatenate(clear)

    def _within_spheres(
        self, centres: np.ndarray, candidates: np.ndarray, count: np.ndarray, slack: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Drops candidates whose bounding spheres show that they are `slack` farther from the centre than another."""
        cell_of = np.repeat(np.arange(len(count)), count)
        offset = np.linalg.norm(centres[cell_of] - self.middles[candidates], axis=1)
        nearest = np.minimum.reduceat(offset, np.cumsum(count) - count)
        keep = offset - self.radii[candidates] <= np.repeat(nearest + slack, count)
        return candidates[keep], np.bincount(cell_of[keep], minlength=len(count))

    def _mark(self, cells: np.ndarray, level: int, first: int) -> None:
        """Notes leaves `first`, `first + 1`, … in the finest grid."""
        block = 2 ** (self.levels - level)
        offsets = np.stack(np.meshgrid(*[np.arange(block)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        x, y, z = (cells[:, None] * block + offsets).reshape(-1, 3).T
        self.leaf[x, y, z] = np.repeat(np.arange(first, first + len(cells)), len(offsets))

    def _nearest(
        self, points: np.ndarray, start: np.ndarray, count: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distance of every pair of a point and one of its candidates, and each point's signed distance."""
        distances, signed = [], []
        total = np.cumsum(count)
        low = 0
        while low < len(points):
            base = total[low] - count[low]
            high = max(low + 1, int(np.searchsorted(total, base + PAIRS, side="right")))
            pair_distance, point_signed = self._nearest_block(
                points[low:high], start[low:high], count[low:high]
            )
            distances.append(pair_distance)
            signed.append(point_signed)
            low = high
        empty = np.empty(0)
        return np.concatenate([empty, *distances]), np.concatenate([empty, *signed])

    def _nearest_block(
        self, points: np.ndarray, start: np.ndarray, count: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        point_of = np.repeat(np.arange(len(points)), count)
        begin = np.cumsum(count) - count
        triangle = self.candidates[np.arange(len(point_of)) + np.repeat(start - begin, count)]
        squared, away, feature = closest(points[point_of], self.corners[triangle])
        smallest = np.minimum.reduceat(squared, begin)
        hits = np.flatnonzero(squared == np.repeat(smallest, count))
        hits = hits[np.unique(point_of[hits], return_index=True)[1]]
        normal = self.normals[triangle[hits], feature[hits]]
        inside = np.einsum("ij,ij->i", away[hits], normal) < 0
        return np.sqrt(squared), np.where(inside, -1, 1) * np.sqrt(smallest)


def closest(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point against triangle, pairwise (`M × 3`, `M × 3 × 3`): squared distance, the vector from the closest
    point, and the feature it lies on.
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


def pseudonormals(triangles: np.ndarray, corners: np.ndarray, vertices: int) -> np.ndarray:
    """Pseudonormals of each triangle's seven features, `T × 7 × 3`; zero on the rim of an open mesh."""
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
