"""Check of the space of groom, head and colliders: hair grows on what it is drawn on, or near bodies."""

from collections.abc import Callable, Iterator

import numpy as np

from . import tolerances
from .cache import HEAD, TRANSFORM, Cache
from .collider import Collider, nearest
from .geometry import FloatArray, IntArray, norms, transformed
from .report import Check, Finding
from .window import first_values

PLACEMENT = Check(
    "placement",
    "roots are where a collider is: on a skin, or within reach of a body, and not deep inside",
    "bring groom, rest pose of the head and colliders into one space: import the track with --groom",
)

MAX_ROOTS = 200
"""Most roots that are compared."""


def placement(cache: Cache) -> Iterator[Finding]:
    """Compares roots with the colliders, in the first frame.

    One collider where the hair is suffices: others may be clothes or props.
    """
    values = first_values(cache)
    head = values.get(f"{HEAD}.{TRANSFORM}")
    curves = [curves for curves in cache.curves if curves.consistent]
    if head is None or not curves:
        return
    rest = np.concatenate([c.rest[c.starts].astype(float) for c in curves])
    roots = rest[:: max(1, -(-len(rest) // MAX_ROOTS))]
    reach = max(longest(c.rest.astype(float), c.segments, c.curve_of_point) for c in curves)
    unit = cache.metres_per_unit
    diagonal = float(np.linalg.norm(np.ptp(roots, axis=0)))
    tolerance = max(tolerances.OFF_SKIN_M / unit, tolerances.OFF_SKIN_SHARE * diagonal)
    faults = []
    skins = [mesh for mesh in cache.colliders if mesh.is_skin and mesh.consistent]
    if skins:
        # The check skin_roots tells whether roots go with their skins.
        off = np.min([distances(roots, mesh.points, mesh.triangles) for mesh in skins], axis=0)
        if off.max() > tolerances.OFF_SKIN_M / unit:
            yield Finding(PLACEMENT, message=f"a root is {off.max() * unit:.2g} m off the skin at rest")
        return
    for mesh in cache.colliders:
        matrix = values.get(f"{mesh.path}.{TRANSFORM}")
        points = values.get(f"{mesh.path}.points", mesh.points)
        carried = matrix is not None and np.allclose(matrix, head, atol=1e-9)
        if matrix is None or not mesh.consistent or points.shape != mesh.points.shape:
            continue
        if not np.isfinite(points).all():
            continue
        local = transformed(transformed(roots, head), np.linalg.inv(matrix))
        fault = fault_of(local, points.astype(float), mesh.solid, reach, tolerance, unit)
        if mesh.deforms and fault is None:
            at_rest = distances(roots, mesh.points, mesh.solid)
            now = distances(local, points.astype(float), mesh.solid)
            if np.median(at_rest) <= tolerance and np.median(now) > 2 * tolerance:
                fault = (
                    f"roots are on it at rest, and {np.median(now) * unit:.2g} m off it in the first frame"
                )
        if fault is None:
            return
        # A body of its own may be anywhere.
        if carried or mesh.deforms:
            faults.append((mesh.path, fault))
    for path, fault in faults[:1]:
        yield Finding(PLACEMENT, message=fault, prim=path)


def fault_of(
    roots: FloatArray, points: FloatArray, triangles: IntArray, reach: float, tolerance: float, unit: float
) -> str | None:
    """What is wrong with roots in the space of a mesh; None if they may belong to it."""
    nearest = float(distances(roots, points, triangles).min())
    if nearest > reach:
        return (
            f"the nearest root is {nearest * unit:.2g} m away, and the longest strand {reach * unit:.2g} m: "
            "no hair can touch it"
        )
    depth = float(np.median(Collider(points, triangles).depth(roots)))
    return f"most roots are {depth * unit:.2g} m inside it" if depth > tolerance else None


def longest(points: FloatArray, segments: IntArray, curve_of_point: IntArray) -> float:
    """Length of the longest curve."""
    lengths = norms(points[segments + 1] - points[segments])
    return float(np.bincount(curve_of_point[segments], weights=lengths).max())


def distances(points: FloatArray, vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Distance of each point from a mesh."""
    return norms(nearest(points, vertices, triangles)[1])


PLACEMENTS: dict[Check, Callable[[Cache], Iterator[Finding]]] = {PLACEMENT: placement}
"""The check and its function."""
