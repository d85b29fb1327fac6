"""Strands from the basis curves of a stage."""

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from .curves import CurveType
from .errors import InputError, InputErrors, input_error
from .exchange import Array, Arrays, FloatArray, Header, IntArray
from .primvars import CLUMPS, FACTORS, GUIDES, IDS, ROOT_UVS, Layout, Primvars
from .rest import RestSpace, character_space
from .roles import role_notes, roles
from .stage import (
    all_of,
    apply,
    composition_notes,
    convention,
    find,
    gather,
    open_below_bakes,
    times_without_rest,
    to_world,
)

RESTS = ("rest", "pref", "Pref")
"""Primvars that hold the rest pose of animated curves."""


@dataclass
class Controls:
    """The curves of one prim as they are drawn."""

    path: str
    type: CurveType
    counts: IntArray
    """Control points of each curve."""
    to_rest: FloatArray
    """Matrix from the space of the prim to the rest space, in stage units, for column vectors, 4 × 4."""

    def header(self) -> Header:
        """What JSON holds of it."""
        return {"path": self.path, **self.type.header(), "curves": len(self.counts)}


@dataclass
class Strands:
    """The curves of one prim, in rest space and stage units."""

    controls: Controls
    counts: IntArray
    """Points of each curve."""
    points: FloatArray
    """`N × 3`."""
    ids: IntArray | None
    guide: IntArray | None
    """1 for guides, else 0, by the primvar that tells them apart; None without it."""
    group: IntArray
    """Group number of each curve; -1 for none."""
    group_names: dict[int, str]
    root_uv: FloatArray
    width: FloatArray | None
    """Diameters at root and tip of each curve, `n × 2`."""
    clump: IntArray | None
    """Clump of each curve; negative for none."""
    factors: dict[str, FloatArray]
    notes: list[str]


def read(path: str, prim_path: str | None, time: float | None) -> tuple[Header, Arrays]:
    """Header and arrays of the strands at and below a prim.

    Raises:
        InputErrors: All errors in the curves.
    """
    stage = open_below_bakes(path)
    header = convention(stage)
    prims = all_of(find(stage, prim_path), UsdGeom.BasisCurves, "BasisCurves")
    space = character_space(prims)
    parts = gather(prims, lambda prim: read_prim(prim, time, space))
    found = roles(prims)
    guides = [
        np.full(len(part.counts), role.guides, int) if part.guide is None else part.guide
        for part, role in zip(parts, found, strict=True)
    ]
    names, group = merge_groups(prims, parts, guides)
    guide = np.concatenate(guides)
    notes = composition_notes(stage) + [note for part in parts for note in part.notes]
    notes += role_notes(prims, found, [len(part.counts) for part in parts], [part.guide for part in parts])
    arrays: Arrays = {
        "counts": ("u32", np.concatenate([part.counts for part in parts])),
        "controls": ("u32", np.concatenate([part.controls.counts for part in parts])),
        "to_rest": ("f64", np.stack([part.controls.to_rest for part in parts])),
        "points": ("f64", np.concatenate([part.points for part in parts])),
        "id": ("i32", merge_ids(parts, guide, notes)),
        "group": ("u32", group),
        "guide": ("u32", guide),
        "root_uv": ("f32", np.concatenate([part.root_uv for part in parts])),
    }
    widths = [part.width for part in parts if part.width is not None]
    if len(widths) == len(parts):
        arrays["width"] = ("f64", np.concatenate(widths))
    elif widths:
        notes.append("widths are ignored: only some prims have them")
    if any(part.clump is not None for part in parts):
        arrays["clump"] = ("i32", merge_clumps(parts))
    for name in FACTORS:
        if any(name in part.factors for part in parts):
            factors = [part.factors.get(name, np.ones(len(part.counts))) for part in parts]
            arrays[name] = ("f64", np.concatenate(factors))
    arrays["from_world"] = ("f64", space.from_world(None if time is None else Usd.TimeCode(time)))
    header |= {"groups": names, "notes": notes, "space": space.kind}
    return header | {"prims": [part.controls.header() for part in parts]}, arrays


def read_prim(prim: Usd.Prim, time: float | None, space: RestSpace) -> Strands:
    """Strands of one BasisCurves prim, in the rest space.

    Raises:
        InputErrors: The errors of the prim.
    """
    curves = UsdGeom.BasisCurves(prim)
    path = prim.GetPath()
    notes: list[str] = []
    at, layout, points = read_controls(prim, time, notes)
    counts, kind, basis, wrap = layout.counts, layout.type.kind, layout.type.basis, layout.type.wrap
    matrix = to_world(prim, at)
    to_rest: FloatArray = space.from_world(None if at.IsDefault() else at) @ matrix
    sizes, points = layout.type.evaluate(counts, points)
    if kind == "cubic" and (basis, wrap) != ("catmullRom", "pinned"):
        notes.append(f"{path}: {wrap} {basis} curves are evaluated at {sizes.mean():.1f} points on average")
    if wrap == "periodic":
        notes.append(f"{path}: closed curves are cut open at their first point")
    primvars = Primvars(prim, layout, at, notes)
    ids, guide, clump = (primvars.root(names, int) for names in (IDS, GUIDES, CLUMPS))
    group, group_names = primvars.groups()
    uv = primvars.root(ROOT_UVS, float)
    if uv is None:
        notes.append(f"{path}: no root texture coordinates")
    none = np.zeros(len(counts), int)
    return Strands(
        controls=Controls(str(path), layout.type, counts, to_rest),
        counts=sizes,
        points=apply(to_rest, points),
        ids=ids,
        guide=None if guide is None else (guide != 0).astype(int),
        group=none - 1 if group is None else group,
        group_names=group_names,
        root_uv=np.zeros((len(counts), 2)) if uv is None else uv[:, :2],
        width=read_widths(curves, layout, at, float(abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3))),
        clump=clump,
        factors=primvars.factors(),
        notes=notes,
    )


def read_controls(
    prim: Usd.Prim, time: float | None, notes: list[str]
) -> tuple[Usd.TimeCode, Layout, FloatArray]:
    """The time at which a BasisCurves prim is read, its layout, and its control points in its own space.

    Raises:
        InputErrors: Counts and points do not make curves.
    """
    curves = UsdGeom.BasisCurves(prim)
    at, points_attr = choose_time(prim, time, notes)
    counts = np.array(curves.GetCurveVertexCountsAttr().Get(at) or (), int)
    points = np.array(points_attr.Get(at) or (), float).reshape(-1, 3)
    kind, basis, wrap = (
        str(attr.Get(at)) for attr in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())
    )
    layout = Layout(CurveType(kind, basis, wrap), counts)
    check_counts(prim.GetPath(), layout, len(points))
    return at, layout, points


def choose_time(prim: Usd.Prim, time: float | None, notes: list[str]) -> tuple[Usd.TimeCode, Usd.Attribute]:
    """The time to read at, and the attribute that holds the points.

    `time` if given; else the rest pose; else the first sample.
    """
    points = UsdGeom.BasisCurves(prim).GetPointsAttr()
    if time is not None:
        return Usd.TimeCode(time), points
    samples = points.GetTimeSamples()
    # The rest pose of animated curves is a primvar without time samples.
    for name in RESTS if samples else ():
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
        per_point = (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
        if primvar and primvar.HasValue() and primvar.GetInterpolation() in per_point:
            notes.append(f"{prim.GetPath()}: animated; the rest pose primvars:{name} is used")
            return Usd.TimeCode.Default(), primvar.GetAttr()
    if points.Get(Usd.TimeCode.Default()) is not None:
        samples = []
    # A transform without a default value is the identity at the default time.
    samples = samples or times_without_rest(prim)
    if samples:
        notes.append(f"{prim.GetPath()}: animated; time code {samples[0]:g} is used (--time for another)")
        return Usd.TimeCode(samples[0]), points
    return Usd.TimeCode.Default(), points


def check_counts(path: object, layout: Layout, points: int) -> None:
    """Checks that the counts match the points and that every curve has segments.

    Raises:
        InputErrors: The errors found.
    """
    counts = layout.counts
    if not len(counts) or not points:
        raise input_error(
            path,
            f"{len(counts)} curves with {points} points",
            "one curve or more, with points",
            "name a prim that has curves, or give --time for another time",
        )
    errors = []
    key = f"{path}.curveVertexCounts"
    if (counts < 0).any() or counts.sum() != points:
        message = f"the counts sum to {counts.sum()}, for {points} points"
        errors.append(
            InputError(key, message, "counts that sum to the number of points", "export the curves again")
        )
    wrong = [c for c, n in enumerate(counts) if layout.type.segments(int(n)) is None]
    if wrong:
        kind = "linear" if layout.type.kind == "linear" else f"{layout.type.wrap} {layout.type.basis}"
        message = f"{counts[wrong[0]]} points for curve {wrong[0]}"
        if len(wrong) > 1:
            message += f" ({len(wrong)} curves with a wrong count)"
        help = "correct type, basis or wrap, or remove these curves"
        errors.append(InputError(key, message, f"numbers of points of {kind} curves", help))
    if errors:
        raise InputErrors(*errors)


def read_widths(
    curves: UsdGeom.BasisCurves, layout: Layout, at: Usd.TimeCode, scale: float
) -> FloatArray | None:
    """Diameters at root and tip of each curve, `n × 2`, times `scale`; None for none.

    Raises:
        InputErrors: Widths are negative or not finite, or their number is wrong.
    """
    primvar = UsdGeom.PrimvarsAPI(curves).GetPrimvar("widths")
    is_primvar = bool(primvar and primvar.HasValue())
    attr = primvar.GetAttr() if is_primvar else curves.GetWidthsAttr()
    values = np.array(attr.Get(at) or (), float)
    if not len(values):
        return None
    interpolation = primvar.GetInterpolation() if is_primvar else curves.GetWidthsInterpolation()
    if not np.isfinite(values).all() or (values < 0).any():
        bad = int(np.flatnonzero(~(np.isfinite(values) & (values >= 0)))[0])
        raise input_error(
            attr.GetPath(),
            f"width {bad} is {values[bad]:g}",
            "0 or more",
            "correct the widths, or remove them",
        )
    widths: FloatArray = np.stack(layout.ends(attr.GetPath(), values, interpolation), axis=1) * scale
    return widths


def merge_groups(
    prims: list[Usd.Prim], parts: list[Strands], guides: list[IntArray]
) -> tuple[list[str], Array]:
    """Names of the groups, and the index of every curve's group.

    Curves without a group form one group, or one per prim if several prims hold strands.
    """
    several = sum(not guide.all() for guide in guides) > 1
    names: list[str] = []
    indices = []
    for prim, part in zip(prims, parts, strict=True):
        index_of = {}
        for number in np.unique(part.group):
            default = (prim.GetName() if several else "hair") if number < 0 else f"group_{number}"
            name = part.group_names.get(int(number)) or default
            if name not in names:
                names.append(name)
            index_of[int(number)] = names.index(name)
        indices.append(np.array([index_of[int(number)] for number in part.group], int))
    return names, np.concatenate(indices)


def merge_clumps(parts: list[Strands]) -> Array:
    """The clump of every curve, distinct between prims; -1 for none."""
    clumps, first = [], 0
    for part in parts:
        own = np.full(len(part.counts), -1) if part.clump is None else part.clump
        numbers, index = np.unique(own, return_inverse=True)
        clumps.append(np.where(own < 0, -1, index + first))
        first += len(numbers)
    return np.concatenate(clumps)


def merge_ids(parts: list[Strands], guide: IntArray, notes: list[str]) -> Array:
    """The id of every curve: from the file if unique among guides and among strands, else in order."""
    ids = np.concatenate([np.arange(len(part.counts)) if part.ids is None else part.ids for part in parts])
    fits = (ids >= -(2**31)).all() and (ids < 2**31).all()
    if fits and all(len(np.unique(ids[guide == flag])) == (guide == flag).sum() for flag in (0, 1)):
        return ids
    if any(part.ids is not None for part in parts):
        notes.append("ids are not unique 32-bit numbers: curves are numbered in order instead")
    for flag in (0, 1):
        ids[guide == flag] = np.arange((guide == flag).sum())
    return ids
