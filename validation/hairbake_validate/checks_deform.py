"""Checks of the layer by which Houdini deforms curves of another stage by the guides of the cache."""

from collections.abc import Callable, Iterator

import numpy as np
from pxr import Sdf, UsdGeom

from . import tolerances
from .cache import TRANSFORM, Cache, Curves, Mesh, array, read_value
from .checks_over import Changes, composed, untouched
from .checks_placement import MAX_ROOTS, distances
from .deforms import LISTS, PREFIX, SCHEMA, SHAPES, WEIGHTS, DeformPrim, Deforms, deforms_of
from .geometry import FloatArray, norms, spacing, transformed
from .overs import GUIDES_ROOT, SKELETON, SKELETON_SCHEMA, deformed, opened, stage_to_metres
from .report import Check, Finding

TARGETS = ("deformerPrim", "skinPrim")
BLOCKED = ("velocities", "accelerations")
"""What the layer removes: it is of another motion."""

DEFORM_STAGE = Check(
    "deform_stage",
    "hair.shot.usda opens: hair.deform.usda over the stage of the groom, with the metadata of both",
    "restore the stage or its path in hair.shot.usda, or bake again",
)
DEFORM_UNTOUCHED = Check(
    "deform_untouched",
    "the layer tells Houdini how to deform the groom's curves, and changes nothing else",
    "remove the other opinions from hair.deform.usda and hair.shot.usda",
)
DEFORM_TARGETS = Check(
    "deform_targets",
    "curves have Houdini's schema applied, with guides and a mesh that have a place at rest for every point",
    "bake again, or remove what is stronger than hair.deform.usda",
)
DEFORM_REST = Check(
    "deform_rest",
    "guides, skin and the curves themselves are at rest in one space: that of the curves' points",
    "bake again over this stage: its curves may have been edited or animated",
    tolerances.DEFORM_M,
    "m",
)
DEFORM_ROOTS = Check(
    "deform_roots",
    "roots of the curves and of the guides are on the skin at rest",
    "bring groom and skin into one space: import the track with --groom",
)
DEFORM_WEIGHTS = Check(
    "deform_weights",
    "every curve has guides, which the cache holds, with weights of sum 1",
    "bake again",
)
DEFORM_MOTION = Check(
    "deform_motion",
    "guides and skin are in the world of the stage where the cache has them",
    "correct the transform of the reference to the cache, or the unit and axis of the stage",
    tolerances.DEFORM_M,
    "m",
)


def not_applicable(cache: Cache) -> set[Check]:
    """The checks of the layer that have nothing to look at in a cache."""
    found = opened(cache, Deforms)
    if found is None:
        return set(DEFORM)
    by_shapes = isinstance(found, Deforms) and all(prim.method != WEIGHTS for prim in found.prims)
    return {DEFORM_WEIGHTS} if by_shapes else set()


def deform_stage(cache: Cache) -> Iterator[Finding]:
    """Checks that the stage composes."""
    yield from composed(DEFORM_STAGE, opened(cache, Deforms))


def deform_untouched(cache: Cache) -> Iterator[Finding]:
    """Compares the stage with and without the layer, and looks for other opinions in it."""
    found = deforms_of(cache)
    if found is None:
        return
    for path in (f"{prim.path}.{name}" for prim in found.prims for name in BLOCKED):
        spec = found.layer.GetAttributeAtPath(path)
        if spec and not (isinstance(spec.default, Sdf.ValueBlock) and not spec.HasInfo("timeSamples")):
            yield Finding(DEFORM_UNTOUCHED, message=f"{found.name} has values of {path}")
    settings = {PREFIX + name for name in (*TARGETS, "deformmethod", "gsisearchradius")}
    allowed = Changes({"points", *BLOCKED, SKELETON, *LISTS, *settings}, {SCHEMA, SKELETON_SCHEMA})
    curves = {prim.path for prim in found.prims}
    yield from untouched(DEFORM_UNTOUCHED, found, curves, allowed, f"/{GUIDES_ROOT}")


def faults(found: Deforms, prim: DeformPrim) -> Iterator[str]:
    """What keeps Houdini from deforming a prim."""
    shown = found.shot.GetPrimAtPath(prim.path)
    method = found.value(prim.path, f"{PREFIX}deformmethod")
    # USD lists as applied only what it knows.
    applied = shown.GetMetadata("apiSchemas")
    if SCHEMA not in (applied.GetAddedOrExplicitItems() if applied else []):
        yield f"{SCHEMA} is not applied"
    if prim.method not in (WEIGHTS, SHAPES) or method != prim.method:
        yield f"the method is {method}, recorded {prim.method}"
    radius = found.value(prim.path, f"{PREFIX}gsisearchradius")
    if prim.method == SHAPES and not (radius and radius > 0):
        yield f"guides are looked for within {radius}"
    for name, path, schema in zip(
        TARGETS, (prim.guides, prim.skin), (UsdGeom.BasisCurves, UsdGeom.Mesh), strict=True
    ):
        targets = found.targets(prim.path, name)
        target = found.shot.GetPrimAtPath(path)
        if targets != [path] or not target or not target.IsA(schema):
            kind = f"{schema.__name__} {path}"
            yield f"{name} is {', '.join(targets) or 'missing'}, expected the {kind}"
            continue
        points = array(found.value(path, "points", found.cache.first), np.float64, 2)
        rest = found.at_rest(prim, path)
        if len(rest) != len(points) or not len(rest) or not np.isfinite(rest).all():
            yield f"{path} has {len(rest)} places at rest for {len(points)} points, or they are not finite"


def deform_targets(cache: Cache) -> Iterator[Finding]:
    """Checks that Houdini finds what it needs to deform each prim."""
    found = deforms_of(cache)
    for prim in found.prims if found else []:
        for message in faults(found, prim) if found else ():
            yield Finding(DEFORM_TARGETS, message=message, prim=prim.path)


def deformable(cache: Cache) -> Iterator[tuple[Deforms, DeformPrim]]:
    """The prims that Houdini can deform."""
    found = deforms_of(cache)
    for prim in found.prims if found else []:
        if found and not any(faults(found, prim)):
            yield found, prim


def cache_rest(cache: Cache, path: str) -> FloatArray | None:
    """Places at rest of curves or a collider of the cache, in rest space, m, Y up."""
    parts: list[Curves | Mesh] = [*cache.curves, *cache.colliders]
    part = next((part for part in parts if part.path == path), None)
    if part is None:
        return None
    rest = part.points if isinstance(part, Mesh) else part.rest
    return transformed(rest, stage_to_metres(cache.stage))


def deform_rest(cache: Cache) -> Iterator[Finding]:
    """Compares what is at rest with the cache, and what the stage shows of the curves with their rest."""
    for found, prim in deformable(cache):
        for path in deformed(found.shot, [prim.path]):
            yield Finding(DEFORM_REST, message="a skeleton or blend shapes move its points", prim=path)
        scale = float(np.linalg.norm(prim.to_rest[:3, :3], axis=1).max())
        for frame in (None, cache.frames[0], cache.frames[-1]):
            points = array(found.value(prim.path, "points", frame), np.float64, 2)
            moved = points.shape != prim.points.shape or not np.array_equal(
                points.astype(np.float32), prim.points.astype(np.float32)
            )
            if moved:
                yield Finding(
                    DEFORM_REST, message="its points are not those at rest", frame=frame, prim=prim.path
                )
                break
        for path in (prim.guides, prim.skin):
            expected, rest = cache_rest(cache, prim.in_cache(path)), found.at_rest(prim, path)
            if expected is None or expected.shape != rest.shape:
                yield Finding(DEFORM_REST, message="the cache has no such points at rest", prim=path)
                continue
            off = norms(transformed(rest, prim.to_rest) - expected)
            # A place is rounded in the space of the curves, and in the cache.
            rounding = spacing(rest) * scale + spacing(expected)
            yield Finding(DEFORM_REST, max(0.0, float(off.max()) - rounding), prim=path)


def deform_roots(cache: Cache) -> Iterator[Finding]:
    """Measures how far most roots are off the skin at rest, which carries them with its nearest place."""
    for found, prim in deformable(cache):
        mesh = next((mesh for mesh in cache.colliders if mesh.path == prim.in_cache(prim.skin)), None)
        if mesh is None or not mesh.consistent:
            continue
        vertices = transformed(found.at_rest(prim, prim.skin), prim.to_rest)
        guides = found.at_rest(prim, prim.guides)
        counts = array(found.value(prim.guides, "curveVertexCounts"), int, 1)
        starts = np.cumsum(counts) - counts
        if starts.max(initial=0) >= len(guides):
            continue
        for roots, what in (
            (prim.roots, "roots"),
            (transformed(guides[starts], prim.to_rest), "roots of the guides"),
        ):
            some = roots[:: max(1, -(-len(roots) // MAX_ROOTS))]
            off = float(np.median(distances(some, vertices, mesh.triangles)))
            diagonal = float(np.linalg.norm(np.ptp(roots, axis=0)))
            if not off <= max(tolerances.OFF_SKIN_M, tolerances.OFF_SKIN_SHARE * diagonal):
                yield Finding(
                    DEFORM_ROOTS, message=f"most {what} are {off:.2g} m off it at rest", prim=prim.path
                )


def deform_weights(cache: Cache) -> Iterator[Finding]:
    """Checks the guides of each curve, and their weights."""
    for found, prim in deformable(cache):
        if prim.method == WEIGHTS:
            for message in weight_faults(found, prim):
                yield Finding(DEFORM_WEIGHTS, message=message, prim=prim.path)


def weight_faults(found: Deforms, prim: DeformPrim) -> Iterator[str]:
    """What is wrong with the guides of the curves of a prim."""
    guides, sizes, weights, others = (
        array(found.value(prim.path, name), float if name == LISTS[2] else int, 1) for name in LISTS
    )
    if not len(sizes) == len(others) == len(prim.counts) or not np.array_equal(sizes, others):
        yield f"{len(sizes)} and {len(others)} lists for {len(prim.counts)} curves, or of other lengths"
        return
    if sizes.min(initial=1) < 1 or not len(guides) == len(weights) == sizes.sum():
        yield f"{len(guides)} guides and {len(weights)} weights, expected {sizes.sum()}, some per curve"
        return
    number = len(array(found.value(prim.guides, "curveVertexCounts"), int, 1))
    if guides.min() < 0 or guides.max() >= number:
        yield f"guides {guides.min()} to {guides.max()}, of {number}"
    total = np.add.reduceat(weights, np.cumsum(sizes) - sizes)
    if not (weights.min() >= 0 and np.abs(total - 1).max() <= tolerances.WEIGHT_SUM):
        yield f"weights are {weights.min():.4g} or more, and sum to {total.min():.7g} to {total.max():.7g}"


def deform_motion(cache: Cache) -> Iterator[Finding]:
    """Compares guides and skins in the world with the files of frames."""
    to_world = stage_to_metres(cache.stage)
    for found, prim in deformable(cache):
        for frame in (cache.first, (cache.first + cache.last) // 2, cache.last):
            for path in (prim.guides, prim.skin):
                expected = in_cache_world(cache, prim.in_cache(path), frame)
                if expected is None:
                    continue
                expected, shown = transformed(expected, to_world), found.in_world(path, frame)
                off = np.inf if shown.shape != expected.shape else float(norms(shown - expected).max())
                rounding = 2 * spacing(expected)
                yield Finding(DEFORM_MOTION, max(0.0, off - rounding), frame=frame, prim=path)


def in_cache_world(cache: Cache, path: str, frame: int) -> FloatArray | None:
    """Points of curves or a collider in the world of the cache, from the file of a frame."""
    mesh = next((mesh for mesh in cache.colliders if mesh.path == path), None)
    points = mesh.points if mesh and not mesh.deforms else read_value(cache, frame, f"{path}.points")
    matrix = np.eye(4) if mesh is None else read_value(cache, frame, f"{path}.{TRANSFORM}")
    # The check `frames` reports what a file lacks.
    return None if points is None or matrix is None else transformed(points, matrix)


DEFORM: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    DEFORM_STAGE: deform_stage,
    DEFORM_UNTOUCHED: deform_untouched,
    DEFORM_TARGETS: deform_targets,
    DEFORM_REST: deform_rest,
    DEFORM_ROOTS: deform_roots,
    DEFORM_WEIGHTS: deform_weights,
    DEFORM_MOTION: deform_motion,
}
"""The checks of the layer and their functions, in the order of the report."""
