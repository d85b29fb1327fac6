"""Points inside a collider that bodies leave no room for outside: pinched hair.

Bodies of an animation close on hair and overlap where it is, and carry roots into each other. Where no place
outside is free, a bake cannot be right, and must say so. Found here from the colliders and the points alone:

- The shortest way out of a collider leads to another that faces it, alone or as seen along the curve, within
  `tolerances.PINCH_ROOM_M`.
- The root itself is inside, and the point follows it without a break, no deeper than a hair that leaves the
  collider in a curve of radius `tolerances.PINCH_RADIUS_M`, up to a slope of `tolerances.PINCH_RISE`.
- The same, by another part of the same collider, if it deforms: that its parts leave room is then not given.
  A root may be inside a part that faces its own, and another at an angle may be nearer: either is a way out.
  A part that faces the root within `tolerances.PINCH_ROOM_M` counts too.
- The point is next to such a point on its curve.
- The point is so held in the collider that it is deepest in: out of another it would only get deeper there.

What is inside one collider with room outside is none of these.
"""

from collections.abc import Iterator

import numpy as np

from . import tolerances
from .cache import Curves, Mesh
from .collider import Collider
from .geometry import BoolArray, FloatArray, dot, norms, transformed
from .window import Window, neighbours_on_curve


def pinched(window: Window, curves: Curves, _offset: int) -> dict[str, BoolArray]:
    """The points of curves that are pinched in the centre frame, by the path of the collider."""
    found: dict[str, tuple[FloatArray, BoolArray]] = {}
    for mesh, at_first in window.reference.colliders:
        depth = window.depths(mesh, at_first).get(curves.path)
        if depth is not None:
            found[mesh.path] = depth, pinched_in(window, curves, mesh, at_first, depth)
    deepest = np.max([depth for depth, _ in found.values()], axis=0, initial=0)
    held = np.any([here & (depth == deepest) for depth, here in found.values()], axis=0)
    return {path: here | held & (depth > 0) for path, (depth, here) in found.items()}


def pinched_in(
    window: Window, curves: Curves, mesh: Mesh, at_first: Collider, depth: FloatArray
) -> BoolArray:
    """The points of curves that are pinched in a collider, of those with a `depth`."""
    found = np.zeros(len(depth), bool)
    inside = np.flatnonzero(depth * window.cache.metres_per_unit > tolerances.PINCH_DEPTH_M)
    points = window.get(curves.path, "points")
    solid = window.solid(mesh, at_first)
    if not len(inside) or points is None or solid is None:
        return found
    places = points.astype(float)
    _, normals = surface(solid, places[inside])
    out = places[inside] + normals * depth[inside][:, None]
    along = np.diff(places, axis=0, prepend=places[:1])
    along[curves.starts] = 0
    found[inside] = faced(window, mesh, out, normals, along[inside])
    found |= swallowed(window.cache.metres_per_unit, curves, places, depth, solid)
    if mesh.deforms:
        left = inside[~found[inside]]
        found[left] = faced_by_part(window.cache.metres_per_unit, places[left], depth[left], solid)
        found |= swallowed_by_part(window.cache.metres_per_unit, curves, places, depth * ~found, solid)
    return (found | neighbours_on_curve(found, curves)) & (depth > 0)


def faced(window: Window, mesh: Mesh, out: FloatArray, normals: FloatArray, along: FloatArray) -> BoolArray:
    """Which places on a collider's surface, with outward normals, have another before them that faces it.

    `along` is the direction of the curve there, of any length; zero for none.
    """
    room = tolerances.PINCH_ROOM_M / window.cache.metres_per_unit
    found = np.zeros(len(out), bool)
    for other, at_first in window.reference.colliders:
        solid = None if other is mesh else window.solid(other, at_first)
        if solid is None:
            continue
        local = transformed(out, np.linalg.inv(solid[1]))
        collider = solid[0]
        offset = np.abs(local - collider.origin - collider.size / 2).max(axis=1)
        near = np.flatnonzero((offset <= collider.size / 2 + room) & ~found)
        if len(near):
            distance, against = surface(solid, out[near])
            facing = -cosine(along[near], normals[near], against) > tolerances.PINCH_FACING
            found[near] = (distance <= room) & facing
    return found


def cosine(along: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Cosine of the angle between unit normals, or between them as seen along a curve, whichever is less.

    A curve that runs out of a groove cannot leave it that way (docs/theory.md eq. 5.8).
    """
    t = along / np.maximum(norms(along), np.finfo(float).tiny)[:, None]
    across = [n - t * dot(n, t)[:, None] for n in (a, b)]
    lengths = [np.maximum(norms(n), tolerances.PINCH_ACROSS) for n in across]
    found: FloatArray = np.minimum(dot(*across) / (lengths[0] * lengths[1]), dot(a, b))
    return found


def swallowed(
    metres: float, curves: Curves, points: FloatArray, depth: FloatArray, solid: tuple[Collider, FloatArray]
) -> BoolArray:
    """Which points follow a root inside a collider, without a break, and cannot be out of it yet."""
    found = np.zeros(len(depth), bool)
    for start, end in deep_roots(curves, depth):
        outside = np.flatnonzero(depth[start:end] == 0)
        run = slice(start, start + int(outside[0]) if len(outside) else end)
        s = np.concatenate([[0], np.cumsum(norms(np.diff(points[run], axis=0)))]) * metres
        _, normal = surface(solid, points[start : start + 1])
        first = points[start + 1] - points[start]
        sine = float(first @ normal[0] / max(np.linalg.norm(first), np.finfo(float).tiny))
        least = leaving(-float(depth[start]) * metres, sine, s) - tolerances.PINCH_ROOM_M
        found[run] = -depth[run] * metres >= least
    return found


def faced_by_part(
    metres: float, points: FloatArray, depth: FloatArray, solid: tuple[Collider, FloatArray]
) -> BoolArray:
    """Which points inside a collider have another part of it before them where they would leave it."""
    _, normals = surface(solid, points)
    distance, _ = part_facing(metres, points + normals * depth[:, None], solid)
    found: BoolArray = distance <= tolerances.PINCH_ROOM_M / metres
    return found


def swallowed_by_part(
    metres: float, curves: Curves, points: FloatArray, depth: FloatArray, solid: tuple[Collider, FloatArray]
) -> BoolArray:
    """Which points cannot be out of a part of a collider in which their root is, on another part of it."""
    found = np.zeros(len(depth), bool)
    deep = np.unique(curves.curve_of_point[depth * metres > tolerances.PINCH_DEPTH_M])
    roots = points[curves.starts[deep]]
    for around in (False, True):
        distance, normal = part_facing(metres, roots, solid, around)
        for curve, root, away in zip(deep, distance, normal, strict=True):
            if root * metres <= tolerances.PINCH_ROOM_M:
                run = slice(curves.starts[curve], curves.starts[curve] + curves.counts[curve])
                edges = np.diff(points[run], axis=0)
                s = np.concatenate([[0], np.cumsum(norms(edges))]) * metres
                sine = float(edges[0] @ away / max(np.linalg.norm(edges[0]), np.finfo(float).tiny))
                least = leaving(float(root) * metres, sine, s) - tolerances.PINCH_ROOM_M
                found[run] |= (depth[run] > 0) & (-depth[run] * metres >= least)
    return found


def part_facing(
    metres: float, points: FloatArray, solid: tuple[Collider, FloatArray], around: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Signed distance of places on a collider from the part of it that faces each, and the normals there.

    With `around`, from the part at any angle that each is inside. Infinite where there is none.
    """
    collider, matrix = solid
    local = transformed(points, np.linalg.inv(matrix))
    _, normals = collider.surface(local)
    front = tolerances.PINCH_IN_FRONT_M / metres
    if around:
        distance, away = collider.around(local, normals, tolerances.PINCH_BENT, tolerances.PINCH_AHEAD, front)
    else:
        distance, away = collider.facing(local, normals, tolerances.PINCH_FACING, front)
    distance[np.abs(distance) > tolerances.PINCH_PART_M / metres] = np.inf
    return distance, away @ matrix[:3, :3]


def deep_roots(curves: Curves, depth: FloatArray) -> Iterator[tuple[int, int]]:
    """First point and end of the curves whose root is inside."""
    for start, count in zip(curves.starts, curves.counts, strict=True):
        if depth[start] > 0:
            yield int(start), int(start + count)


def leaving(root: float, sine: float, s: FloatArray) -> FloatArray:
    """Distance from a body, at arc lengths `s`, m, of a hair that leaves it from a root at `root`, m.

    `sine` is that of the angle between the surface and the hair at its root (docs/theory.md eq. 5.9).
    """
    slope, radius = tolerances.PINCH_RISE, tolerances.PINCH_RADIUS_M
    turn = np.minimum(s, max(0.0, radius * (slope - sine)))
    distance: FloatArray = root + min(sine, slope) * turn + turn**2 / (2 * radius) + slope * (s - turn)
    return distance


def surface(solid: tuple[Collider, FloatArray], points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance of points in the scene from a collider, and the outward normals in the scene."""
    collider, matrix = solid
    distance, normal = collider.surface(transformed(points, np.linalg.inv(matrix)))
    turned = normal @ matrix[:3, :3]
    return distance, turned / np.maximum(norms(turned), np.finfo(float).tiny)[:, None]
