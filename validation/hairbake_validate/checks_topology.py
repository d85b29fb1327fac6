"""Checks of the static data of curves and colliders: topology, primvars, guide weights and ids."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from pxr import Sdf, UsdGeom

from . import tolerances
from .cache import (
    CLAMPS,
    GUIDES,
    GUIDES_PER_STRAND,
    HAIR,
    HELD,
    TIES,
    Cache,
    Curves,
    attribute_value,
)
from .geometry import over_chord, spacing
from .report import Check, Finding

TOPOLOGY = Check(
    "topology",
    "curve and face counts match the points, and every index has a point",
    "export the groom and the colliders again",
)
PRIMVARS = Check(
    "primvars",
    "primvars have their type, interpolation and size",
    "write the primvars as docs/cache.md describes them",
)
FOLLOWING = Check(
    "following",
    "strands name guides of the cache, with weights that sum to 1",
    "normalize groom_guide_weights, and name guides by their groom_id",
    tolerance=tolerances.WEIGHT_SUM,
)
ARCS = Check(
    "arcs",
    "arc lengths of guides start at 0 and fit the rest points",
    "write groom_arc as docs/cache.md describes it",
    tolerance=tolerances.ARC_OVER_CHORD,
    unit="relative",
)
REACTIONS = Check(
    "reactions",
    "forces and moments that hold guides have their types, and those of ties name guides of the cache",
    "write the reactions as docs/cache.md describes them",
)
IDS = Check(
    "ids",
    "groom_id is unique",
    "give each curve its own groom_id: downstream tools match curves by it",
)


def topology(cache: Cache) -> Iterator[Finding]:
    """Checks counts and indices of curves and colliders."""
    for curves in cache.curves:
        if not len(curves.counts) or curves.counts.min() < 2:
            message = "no curves, or a curve of fewer than 2 points"
            yield Finding(TOPOLOGY, message=message, prim=curves.path)
        elif curves.counts.sum() != len(curves.rest):
            message = f"curveVertexCounts sum to {curves.counts.sum()}, expected {len(curves.rest)} (rest)"
            yield Finding(TOPOLOGY, message=message, prim=curves.path)
    for mesh in cache.colliders:
        if not mesh.consistent:
            message = "no triangles, an index without a point, or points that are not finite"
            yield Finding(TOPOLOGY, message=message, prim=mesh.path)


def primvars(cache: Cache) -> Iterator[Finding]:
    """Checks type, interpolation and size of each primvar and of the widths."""
    for curves in cache.curves:
        prim = cache.stage.GetPrimAtPath(curves.path)
        api = UsdGeom.PrimvarsAPI(prim)
        for name, kind, interpolation, size in expected_primvars(curves):
            for message in primvar_errors(api.GetPrimvar(name), name, kind, interpolation, size):
                yield Finding(PRIMVARS, message=message, prim=curves.path)
        for message in width_errors(prim, curves):
            yield Finding(PRIMVARS, message=message, prim=curves.path)
        if not np.isfinite(curves.rest).all():
            yield Finding(PRIMVARS, message="rest is not finite", prim=curves.path)


def expected_primvars(curves: Curves) -> list[tuple[str, Any, str, int | None]]:
    """Name, type, interpolation and size of each primvar; the check `topology` covers the size of `rest`."""
    types, count = Sdf.ValueTypeNames, len(curves.counts)
    expected: list[tuple[str, Any, str, int | None]] = [
        ("groom_id", types.IntArray, "uniform", count),
        ("groom_group_id", types.IntArray, "uniform", count),
        ("groom_group_name", types.StringArray, "uniform", count),
        ("groom_guide", types.IntArray, "uniform", count),
        ("groom_root_uv", types.TexCoord2fArray, "uniform", count),
        ("rest", types.Point3fArray, "vertex", None),
    ]
    if curves.path == GUIDES:
        expected.append(("groom_arc", types.FloatArray, "vertex", len(curves.rest)))
    if curves.path == HAIR:
        expected.append(("groom_closest_guides", types.IntArray, "uniform", GUIDES_PER_STRAND * count))
        expected.append(("groom_guide_weights", types.FloatArray, "uniform", GUIDES_PER_STRAND * count))
    return expected


def primvar_errors(
    primvar: UsdGeom.Primvar, name: str, kind: Any, interpolation: str, size: int | None
) -> Iterator[str]:
    """Errors of one primvar."""
    if not primvar or not primvar.HasValue():
        yield f"{name} is missing"
        return
    found = (primvar.GetTypeName(), primvar.GetInterpolation())
    if found != (kind, interpolation):
        yield f"{name} is {found[0]}, {found[1]}; expected {kind}, {interpolation}"
    if size is not None and len(primvar.Get()) != size:
        yield f"{name} has {len(primvar.Get())} values, expected {size}"


def width_errors(prim: Any, curves: Curves) -> Iterator[str]:
    """Errors of the widths."""
    interpolation = UsdGeom.BasisCurves(prim).GetWidthsInterpolation()
    if interpolation != "vertex":
        # Renderers disagree on how many varying values a pinned curve has.
        yield f"interpolation of widths is {interpolation}, expected vertex"
    total = int(curves.counts.sum())
    if len(curves.widths) != total:
        yield f"{len(curves.widths)} widths, expected {total}, one for each point"
    elif not (np.isfinite(curves.widths) & (curves.widths > 0)).all():
        yield "widths are not all finite and above 0"


def arcs(cache: Cache) -> Iterator[Finding]:
    """Compares the rods of guides with their chords at rest, and with how much these turn."""
    for curves in cache.curves:
        if curves.path != GUIDES or not curves.consistent or curves.rods is None:
            continue
        if curves.arc[curves.starts].any():
            yield Finding(ARCS, message="arc lengths do not start at 0", prim=curves.path)
        # Each point is off by up to √3/2 of a spacing, and the middle one of a pair is an end of both chords.
        rounding = 2 * np.sqrt(3) * spacing(curves.rest) + spacing(curves.arc)
        chords = curves.of_pairs(curves.rest_chords)
        excess = curves.rods - chords
        curve_of_pair = curves.curve_of_point[curves.segments[curves.pairs]]
        # A middle point may be off the curve next to a kink.
        short = np.flatnonzero(excess < -rounding - tolerances.GUIDE_SEGMENT_DRIFT * chords)
        if short.size:
            message = f"the rod is shorter than its chords in {short.size} places"
            yield Finding(ARCS, message=message, prim=curves.path, curve=int(curve_of_pair[short[0]]))
        turns = curves.rest_turns[curves.segments] + curves.rest_turns[curves.segments + 1]
        bent = curves.of_pairs(curves.rest_chords * over_chord(turns))
        # What a hairpin accounts for beyond the tolerance.
        hidden = np.maximum(bent - tolerances.ARC_OVER_CHORD * chords, 0)
        share = (excess - rounding - hidden) / np.maximum(chords, rounding)
        most = int(share.argmax())
        value, curve = max(0.0, float(share[most])), int(curve_of_pair[most])
        yield Finding(ARCS, value=value, prim=curves.path, curve=curve)


def following(cache: Cache) -> Iterator[Finding]:
    """Checks the guides that strands name, and the sum of their weights."""
    guides, weights = (
        np.array(attribute_value(cache, HAIR, f"primvars:groom_{name}"))
        for name in ("closest_guides", "guide_weights")
    )
    if guides.shape != weights.shape or not guides.size or guides.size % GUIDES_PER_STRAND:
        return
    error = np.abs(weights.reshape(-1, GUIDES_PER_STRAND).sum(axis=1) - 1.0)
    if weights.min() < 0.0:
        message = f"the smallest weight is {weights.min():.3g}, expected at least 0"
        yield Finding(FOLLOWING, value=max(1.0, float(error.max())), message=message, prim=HAIR)
    elif error.max() > tolerances.WEIGHT_SUM:
        message = f"weights sum to 1 ± {error.max():.3g}, allowed ± {tolerances.WEIGHT_SUM:g}"
        yield Finding(
            FOLLOWING, value=float(error.max()), message=message, prim=HAIR, curve=int(error.argmax())
        )
    known = attribute_value(cache, GUIDES, "primvars:groom_id")
    if known:
        unknown = set(guides[weights > 0.0].tolist()) - set(known)
        if unknown:
            message = f"guide {min(unknown)} is not in the cache ({len(unknown)} unknown guides)"
            yield Finding(FOLLOWING, message=message, prim=HAIR)


def reactions(cache: Cache) -> Iterator[Finding]:
    """Checks declarations of reactions, and what those of ties are of."""
    prim = cache.stage.GetPrimAtPath(GUIDES)
    found = [name for name in (*CLAMPS, *HELD, *TIES) if prim and prim.HasAttribute(name)]
    if not found:
        return
    api = UsdGeom.PrimvarsAPI(prim)
    ties = (*HELD, *TIES) if HELD[0] in found or TIES[0] in found else ()
    for name in (*CLAMPS, *ties):
        kind = Sdf.ValueTypeNames.IntArray if name in TIES else Sdf.ValueTypeNames.Vector3fArray
        expected = (kind, "uniform" if name in CLAMPS else "constant")
        primvar = api.GetPrimvar(name.removeprefix("primvars:"))
        declared = (primvar.GetTypeName(), primvar.GetInterpolation()) if primvar else "missing"
        if declared != expected:
            message = f"{name} is {declared}, expected {expected}"
            yield Finding(REACTIONS, message=message, prim=GUIDES)
    guides, numbers = (attribute_value(cache, GUIDES, name) for name in TIES)
    if len(guides) != len(numbers):
        message = f"{len(guides)} guides of ties, {len(numbers)} numbers of ties"
        yield Finding(REACTIONS, message=message, prim=GUIDES)
    unknown = set(guides) - set(attribute_value(cache, GUIDES, "primvars:groom_id"))
    if unknown:
        message = f"guide {min(unknown)} of a tie is not in the cache ({len(unknown)} unknown guides)"
        yield Finding(REACTIONS, message=message, prim=GUIDES)


def ids(cache: Cache) -> Iterator[Finding]:
    """Checks that no two curves share an id."""
    for curves in cache.curves:
        primvar = UsdGeom.PrimvarsAPI(cache.stage.GetPrimAtPath(curves.path)).GetPrimvar("groom_id")
        values = np.array(primvar.Get() if primvar and primvar.HasValue() else [], int)
        distinct, count = np.unique(values, return_counts=True)
        for value, times in zip(distinct[count > 1], count[count > 1], strict=True):
            second = int(np.flatnonzero(values == value)[1])
            message = f"{times} curves have groom_id {value}, expected 1"
            yield Finding(IDS, message=message, prim=curves.path, curve=second)


CURVE_DATA: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    TOPOLOGY: topology,
    PRIMVARS: primvars,
    ARCS: arcs,
    FOLLOWING: following,
    REACTIONS: reactions,
    IDS: ids,
}
"""The checks of static data and their functions, in the order of the report."""
