"""Roots that ride on skins: where the meshes of a frame carry them (`docs/theory.md` §2.1)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .cache import TRANSFORM, Cache, Curves, Mesh, read_value
from .collider import nearest
from .geometry import Array, FloatArray, IntArray, cross, dot, norms, spacing, sums, transformed

Values = Callable[[str, str], Array | None]
"""Value of an attribute of a prim at one time; None if it is missing or not valid."""


class Skin:
    """A mesh at rest."""

    def __init__(self, mesh: Mesh, moved: Sequence[Array] = ()) -> None:
        """Joins vertices that coincide, at rest and in all that is `moved`: lips that part are two edges.

        Leaves out triangles without area, and repeated ones.
        """
        self.mesh = mesh
        places = np.hstack([mesh.points.astype(float), *moved])
        _, self.first, index = np.unique(places, axis=0, return_index=True, return_inverse=True)
        self.points = mesh.points.astype(float)[self.first]
        triangles: IntArray = index.reshape(-1)[mesh.triangles]
        triangles = triangles[doubled_areas(self.points[triangles]).any(axis=1)]
        _, once = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
        self.triangles = triangles[np.sort(once)]
        corners = self.points[self.triangles]
        normal = doubled_areas(corners)
        area = norms(normal) / 2
        face = normal / norms(normal)[:, None]
        self.slopes = [cross(face, corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3]) / 2 for k in range(3)]
        """Gradients of each triangle's hat functions times its area, `T × 3` for each corner."""
        weights: list[FloatArray] = [np.repeat(area[:, None], 3, axis=1)] * 3
        self.areas = sums(self.triangles, weights, len(self.points))[:, 0]
        self.normals = sums(self.triangles, [normal / 2] * 3, len(self.points))

    def gradients(self, points: FloatArray) -> FloatArray:
        """Mean gradients of deformation around each vertex, `V × 3 × 3`, with the mesh at `points`."""
        places = points.astype(float)[self.first][self.triangles]
        gradient = np.empty((len(self.points), 3, 3))
        for axis in range(3):
            of_corner = [places[:, k, axis, None] * self.slopes[k] for k in range(3)]
            of_face: FloatArray = of_corner[0] + of_corner[1] + of_corner[2]
            gradient[:, axis] = sums(self.triangles, [of_face] * 3, len(self.points))
        # A vertex of no triangle carries nothing.
        result: FloatArray = gradient / np.maximum(self.areas, np.finfo(float).tiny)[:, None, None]
        return result


@dataclass(frozen=True)
class Roots:
    """The roots of one set of curves that ride on one skin."""

    which: IntArray
    """Indices of the curves."""
    corners: IntArray
    """Vertices of the triangle that each is on, `n × 3`."""
    shares: FloatArray
    """Barycentric coordinates, `n × 3`."""
    tangents: FloatArray
    """Orthonormal tangents of the skin at rest, `n × 2 × 3`."""
    frames: FloatArray
    """Frames at rest, columns, `n × 3 × 3`."""
    surface: FloatArray
    """Points of the skin at rest, `n × 3`."""
    leverage: FloatArray
    """Largest displacement of a root where vertices are displaced by 1 at most, `n`."""


class Skins:
    """The skins of a cache, and the places of all roots on them."""

    def __init__(self, cache: Cache) -> None:
        """Binds each root to the nearest place of a skin at rest."""
        meshes = [mesh for mesh in cache.colliders if mesh.is_skin and mesh.consistent]
        self.skins = [Skin(mesh, moved(cache, mesh)) for mesh in meshes]
        self.roots: dict[str, list[Roots]] = {}
        if self.skins:
            self.roots = {curves.path: self._bind(curves) for curves in cache.curves if curves.consistent}

    def __bool__(self) -> bool:
        """True if skins carry the roots."""
        return bool(self.skins)

    def _bind(self, curves: Curves) -> list[Roots]:
        rest = curves.rest[curves.starts].astype(float)
        found = [nearest(rest, skin.points, skin.triangles) for skin in self.skins]
        chosen = np.argmin([norms(away) for _, away in found], axis=0)
        bound = []
        for i, (skin, (triangle, away)) in enumerate(zip(self.skins, found, strict=True)):
            which = np.flatnonzero(chosen == i)
            corners = skin.triangles[triangle[which]]
            shares = barycentric(rest[which] - away[which], skin.points[corners])
            normal = weighted(shares, (skin.normals / np.maximum(skin.areas, 1e-300)[:, None])[corners])
            normal /= norms(normal)[:, None]
            axis = np.eye(3)[np.abs(normal).argmin(axis=1)] if len(which) else np.empty((0, 3))
            first = cross(normal, axis)
            first /= norms(first)[:, None]
            tangents = np.stack([first, cross(normal, first)], axis=1)
            frames = frame(weighted(shares, skin.gradients(skin.mesh.points)[corners]), tangents)
            surface = weighted(shares, skin.points[corners])
            # The frame turns by what moves the ends of an edge apart; the offset of a root turns with it.
            places = skin.points[corners]
            edges = norms((places - np.roll(places, 1, axis=1)).reshape(-1, 3)).reshape(-1, 3)
            leverage = 1 + 2 * norms(rest[which] - surface) / edges.min(axis=1)
            bound.append(Roots(which, corners, shares, tangents, frames, surface, leverage))
        return bound

    def carry(self, curves: Curves, values: Values) -> tuple[FloatArray, FloatArray] | None:
        """Rotations and translations from rest to the world that carry each curve's root, as row vectors.

        `values` are those of the time. None if a skin has no valid points or transform.
        """
        turns, moves = np.empty((len(curves.counts), 3, 3)), np.empty((len(curves.counts), 3))
        for skin, roots in zip(self.skins, self.roots.get(curves.path, ()), strict=False):
            matrix = values(skin.mesh.path, TRANSFORM)
            points = values(skin.mesh.path, "points") if skin.mesh.deforms else skin.mesh.points
            if matrix is None or points is None or points.shape != skin.mesh.points.shape:
                return None
            gradients = weighted(roots.shares, skin.gradients(points)[roots.corners])
            turn = roots.frames @ frame(gradients, roots.tangents).transpose(0, 2, 1)
            now = weighted(roots.shares, points.astype(float)[skin.first][roots.corners])
            turns[roots.which] = turn @ matrix[:3, :3]
            carried = transformed(now, matrix)
            moves[roots.which] = carried - (roots.surface[:, None] @ turns[roots.which])[:, 0]
        return turns, moves

    def rounding(self, curves: Curves, values: Values) -> FloatArray:
        """How far the rounding of the meshes' points to 32 bits moves each curve's root at most, `n`."""
        found = np.zeros(len(curves.counts))
        for skin, roots in zip(self.skins, self.roots.get(curves.path, ()), strict=False):
            points = values(skin.mesh.path, "points") if skin.mesh.deforms else skin.mesh.points
            if points is not None:
                found[roots.which] = np.sqrt(3) / 2 * spacing(points) * roots.leverage
        return found

    def carried(self, curves: Curves, values: Values) -> FloatArray | None:
        """The points of the rest pose, each carried with its root; None as for `carry`."""
        motion = self.carry(curves, values)
        if motion is None or curves.path not in self.roots:
            return None
        turns, moves = (of[curves.curve_of_point] for of in motion)
        points: FloatArray = (curves.rest.astype(float)[:, None] @ turns)[:, 0] + moves
        return points


def moved(cache: Cache, mesh: Mesh) -> list[Array]:
    """Points of a mesh that deforms at the first, middle and last frame, as far as they are valid."""
    frames = sorted({cache.frames[0], cache.frames[len(cache.frames) // 2], cache.frames[-1]})
    found = [read_value(cache, frame, f"{mesh.path}.points") for frame in frames if mesh.deforms]
    return [
        points
        for points in found
        if points is not None and points.shape == mesh.points.shape and np.isfinite(points).all()
    ]


def doubled_areas(corners: FloatArray) -> FloatArray:
    """Normals of triangles, `T × 3 × 3`, of twice their areas."""
    return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Barycentric coordinates of points of triangles, `n × 3` and `n × 3 × 3`."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal, offset = cross(first, second), points - corners[:, 0]
    squared = dot(normal, normal)
    one, two = dot(cross(offset, second), normal) / squared, dot(cross(first, offset), normal) / squared
    return np.stack([1 - one - two, one, two], axis=1)


def weighted(shares: FloatArray, of_corners: FloatArray) -> FloatArray:
    """Sums of the values at three corners, `n × 3 × …`, by their shares, `n × 3`."""
    result: FloatArray = np.einsum("nk,nk...->n...", shares, of_corners)
    return result


def frame(gradients: FloatArray, tangents: FloatArray) -> FloatArray:
    """Frames, as columns, of a surface whose tangents the gradients, `n × 3 × 3`, map."""
    first, second = (np.einsum("nij,nj->ni", gradients, tangents[:, k]) for k in (0, 1))
    normal = cross(first, second)
    normal /= norms(normal)[:, None]
    along = first + cross(second, normal)
    along /= norms(along)[:, None]
    return np.stack([along, cross(normal, along), normal], axis=2)
