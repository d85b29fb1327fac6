"""Strands from the basis curves of a stage."""

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from . import curves
from .faults import Fault, Faults, fail
from .stage import (
    all_of,
    apply,
    composition_notes,
    convention,
    find,
    gather,
    moves_only,
    open_stage,
    to_world,
)

#: Primvars that are read, by the names that Unreal's importer, Houdini and our own cache give them; the first that is there counts.
IDS = ("groom_id", "id")
GUIDES = ("groom_guide",)
GROUPS = ("groom_group_id", "group_id")
GROUP_NAMES = ("groom_group_name",)
#: The clump that a curve is of; less than 0 for none.
CLUMPS = ("groom_clump_id", "clump_id", "clumpid", "clump")
ROOT_UVS = ("groom_root_uv", "root_uv", "rootuv", "st", "uv")
#: What curves may have of their own, as factors: on their length, and on what their material says. By interpolation constant or uniform, or the
#: value at the root; least and greatest.
FACTORS = {
    "length": (0.01, 100),
    "stiffness": (1e-3, 1e3),
    "damping": (0, 1e3),
    "friction": (0, 1e3),
    "drag": (0, 1e3),
    "goal": (0, 1e3),
}
#: Points in the pose in which the groom was drawn, of curves that move.
RESTS = ("rest", "pref", "Pref")


@dataclass
class Strands:
    """The curves of one prim, in world units."""

    counts: np.ndarray
    points: np.ndarray
    ids: np.ndarray | None
    guide: np.ndarray
    group: np.ndarray
    group_names: dict[int, str]
    root_uv: np.ndarray
    width: np.ndarray | None
    clump: np.ndarray | None
    factors: dict[str, np.ndarray]
    notes: list[str]


@dataclass
class Layout:
    """How many values a curve has of each interpolation, and which are its first and last."""

    kind: str
    basis: str
    wrap: str
    counts: np.ndarray

    def sizes(self, interpolation: str) -> np.ndarray:
        if interpolation == UsdGeom.Tokens.vertex:
            return self.counts
        if interpolation in (UsdGeom.Tokens.varying, UsdGeom.Tokens.faceVarying):
            of = {
                int(n): curves.varying(self.kind, self.basis, self.wrap, int(n))
                for n in np.unique(self.counts)
            }
            return np.array([of[int(n)] for n in self.counts])
        return np.ones(len(self.counts), int)

    def ends(self, path, values: np.ndarray, interpolation: str) -> tuple[np.ndarray, np.ndarray]:
        """The value at the root and at the tip of each curve."""
        if interpolation == UsdGeom.Tokens.constant:
            if len(values) == 1:
                both = np.repeat(values, len(self.counts), axis=0)
                return both, both
            wanted = 1
        else:
            sizes = self.sizes(interpolation)
            wanted, last = int(sizes.sum()), np.cumsum(sizes) - 1
            if len(values) == wanted:
                return values[last - sizes + 1], values[last]
        raise fail(
            path,
            f"has {len(values)} values",
            f"{wanted} of interpolation {interpolation}",
            "export it again, or leave it out",
        )


def read(path: str, prim_path: str | None, time: float | None) -> tuple[dict, dict]:
    """Header and arrays of the strands at and below a prim."""
    stage = open_stage(path)
    header = convention(stage)
    prims = all_of(find(stage, prim_path), UsdGeom.BasisCurves, "BasisCurves")
    parts = gather(prims, lambda prim: _prim(prim, time))
    names, group = _groups(prims, parts)
    guide = np.concatenate([part.guide for part in parts])
    notes = composition_notes(stage) + [note for part in parts for note in part.notes]
    arrays = {
        "counts": ("u32", np.concatenate([part.counts for part in parts])),
        "points": ("f64", np.concatenate([part.points for part in parts])),
        "id": ("i32", _ids(parts, guide, notes)),
        "group": ("u32", group),
        "guide": ("u32", guide),
        "root_uv": ("f32", np.concatenate([part.root_uv for part in parts])),
    }
    if all(part.width is not None for part in parts):
        arrays["width"] = ("f64", np.concatenate([part.width for part in parts]))
    elif any(part.width is not None for part in parts):
        notes.append("widths of some prims only: none is taken")
    if any(part.clump is not None for part in parts):
        arrays["clump"] = ("i32", _clumps(parts))
    for name in FACTORS:
        if any(name in part.factors for part in parts):
            factors = [part.factors.get(name, np.ones(len(part.counts))) for part in parts]
            arrays[name] = ("f64", np.concatenate(factors))
    return {**header, "groups": names, "notes": notes}, arrays


def _prim(prim: Usd.Prim, time: float | None) -> Strands:
    """Strands of one BasisCurves."""
    shape = UsdGeom.BasisCurves(prim)
    place, notes = prim.GetPath(), []
    at, points_attr = _when(prim, shape, time, notes)
    counts = np.array(shape.GetCurveVertexCountsAttr().Get(at) or (), int)
    points = np.array(points_attr.Get(at) or (), float).reshape(-1, 3)
    layout = Layout(
        *(str(a.Get(at)) for a in (shape.GetTypeAttr(), shape.GetBasisAttr(), shape.GetWrapAttr())), counts
    )
    _check(place, layout, len(points))
    matrix = to_world(prim, at)
    sizes, points = curves.evaluate(layout.kind, layout.basis, layout.wrap, counts, points)
    if layout.kind == "cubic" and not (layout.basis == "catmullRom" and layout.wrap == "pinned"):
        notes.append(
            f"{place}: {layout.basis} curves, {layout.wrap}, evaluated at {sizes.mean():.1f} points each on average"
        )
    if layout.wrap == "periodic":
        notes.append(f"{place}: closed curves are taken from their first point round to it again")
    primvars = _Primvars(prim, layout, at, notes)
    id_, guide = primvars.root(IDS, int), primvars.root(GUIDES, int)
    group, group_names = primvars.groups()
    uv = primvars.root(ROOT_UVS, float)
    if uv is None:
        notes.append(f"{place}: no root texture coordinates")
    of_guides = shape.ComputePurpose() == UsdGeom.Tokens.guide
    none = np.zeros(len(counts), int)
    return Strands(
        counts=sizes,
        points=apply(matrix, points),
        ids=id_,
        guide=none + 1 if of_guides else none if guide is None else (guide != 0).astype(int),
        group=none - 1 if group is None else group,
        group_names=group_names,
        root_uv=np.zeros((len(counts), 2)) if uv is None else uv[:, :2],
        width=_widths(shape, layout, at, abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)),
        clump=primvars.root(CLUMPS, int),
        factors=primvars.factors(place),
        notes=notes,
    )


def _when(
    prim: Usd.Prim, shape: UsdGeom.BasisCurves, time: float | None, notes: list[str]
) -> tuple[Usd.TimeCode, Usd.Attribute]:
    """The time to read at, and the attribute that has the points: as asked for, else the rest pose, else the earliest."""
    points = shape.GetPointsAttr()
    if time is not None:
        return Usd.TimeCode(time), points
    samples = points.GetTimeSamples()
    # What moves the curves moves them at their own time, and their rest pose stands outside of it.
    for name in RESTS if samples else ():
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
        if (
            primvar
            and primvar.HasValue()
            and primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
        ):
            notes.append(f"{prim.GetPath()}: moves; its rest pose primvars:{name} is taken")
            return Usd.TimeCode.Default(), primvar.GetAttr()
    if points.Get(Usd.TimeCode.Default()) is not None:
        samples = []
    # A transform that moves and has no value of its own would stand for none.
    samples = samples or moves_only(prim)
    if samples:
        notes.append(
            f"{prim.GetPath()}: moves; taken as it is at time code {samples[0]:g} (--time for another)"
        )
        return Usd.TimeCode(samples[0]), points
    return Usd.TimeCode.Default(), points


def _check(place, layout: Layout, points: int) -> None:
    faults = []
    if not len(layout.counts) or not points:
        what = f"{len(layout.counts)} curves with {points} points"
        raise fail(
            place,
            what,
            "one curve or more, with points",
            "name a prim that has curves, or --time for another time",
        )
    if (layout.counts < 0).any() or layout.counts.sum() != points:
        faults.append(
            Fault(
                f"{place}.curveVertexCounts",
                f"are {layout.counts.sum()} in sum, for {points} points",
                "their sum is the number of points",
                "export the curves again",
            )
        )
    wrong = [
        c
        for c, n in enumerate(layout.counts)
        if curves.segments(layout.kind, layout.basis, layout.wrap, int(n)) is None
    ]
    if wrong:
        kind = "linear" if layout.kind == "linear" else f"{layout.wrap} {layout.basis}"
        what = f"{len(wrong)} curves that cannot be, the first number {wrong[0]} with {layout.counts[wrong[0]]} points"
        faults.append(
            Fault(
                f"{place}.curveVertexCounts",
                what,
                f"numbers of points of {kind} curves",
                "correct type, basis or wrap, or leave such curves out",
            )
        )
    if faults:
        raise Faults(*faults)


def _widths(shape: UsdGeom.BasisCurves, layout: Layout, at: Usd.TimeCode, scale: float) -> np.ndarray | None:
    """Diameter at root and tip of each curve; None where the prim has none."""
    primvar = UsdGeom.PrimvarsAPI(shape).GetPrimvar("widths")
    attr = primvar.GetAttr() if primvar and primvar.HasValue() else shape.GetWidthsAttr()
    values = np.array(attr.Get(at) or (), float)
    if not len(values):
        return None
    interpolation = (
        primvar.GetInterpolation() if attr == primvar.GetAttr() else shape.GetWidthsInterpolation()
    )
    if not np.isfinite(values).all() or (values < 0).any():
        raise fail(
            attr.GetPath(),
            "has widths that are negative or no number",
            "0 or more",
            "correct them, or leave them out",
        )
    return np.stack(layout.ends(attr.GetPath(), values, interpolation), axis=1) * scale


class _Primvars:
    """Primvars of a prim, inherited ones included, by the value at each root."""

    def __init__(self, prim: Usd.Prim, layout: Layout, at: Usd.TimeCode, notes: list[str]):
        self.api, self.layout, self.at, self.notes = UsdGeom.PrimvarsAPI(prim), layout, at, notes

    def _flat(self, names: tuple[str, ...]):
        for name in names:
            primvar = self.api.FindPrimvarWithInheritance(name)
            if primvar and primvar.HasValue():
                return primvar, primvar.ComputeFlattened(self.at)
        return None, None

    def root(self, names: tuple[str, ...], kind: type) -> np.ndarray | None:
        primvar, values = self._flat(names)
        if primvar is None or isinstance(values, str):
            return None
        try:
            values = np.array([values] if np.ndim(values) == 0 else values, kind)
        except (TypeError, ValueError, OverflowError):
            self.notes.append(f"{primvar.GetAttr().GetPath()}: {primvar.GetTypeName()} is not read")
            return None
        return self.layout.ends(primvar.GetAttr().GetPath(), values, str(primvar.GetInterpolation()))[0]

    def factors(self, place) -> dict[str, np.ndarray]:
        """What the curves have of their own, by the names in FACTORS."""
        found, faults = {}, []
        for name, (least, most) in FACTORS.items():
            values = self.root((f"hairbake:{name}",), float)
            if values is None:
                continue
            values = values.reshape(len(values), -1)[:, 0]
            wrong = np.flatnonzero(~((values >= least) & (values <= most)))
            if len(wrong):
                what = f"is {values[wrong[0]]:g} of curve {wrong[0]}" + (
                    f", and wrong of {len(wrong) - 1} more" if len(wrong) > 1 else ""
                )
                faults.append(
                    Fault(
                        f"{place}.primvars:hairbake:{name}",
                        what,
                        f"{least:g} to {most:g}",
                        "correct the factor",
                    )
                )
            found[name] = values
        if faults:
            raise Faults(*faults)
        return found

    def groups(self) -> tuple[np.ndarray | None, dict[int, str]]:
        """The group of each curve by number, and the names of groups by theirs; curves that have names alone are numbered in the names' order."""
        group = self.root(GROUPS, int)
        primvar, values = self._flat(GROUP_NAMES)
        if primvar is None:
            return group, {}
        values = np.array([values] if isinstance(values, str) else values, object)
        roots = self.layout.ends(primvar.GetAttr().GetPath(), values, str(primvar.GetInterpolation()))[0]
        if group is None:
            group = np.unique(roots.astype(str), return_inverse=True)[1]
        return group, {int(number): str(name) for number, name in zip(group, roots)}


def _groups(prims: list[Usd.Prim], parts: list[Strands]) -> tuple[list[str], np.ndarray]:
    """Names of the groups, and the group of every curve: by number, else by prim where there are several that are no guides."""
    several = sum(not part.guide.all() for part in parts) > 1
    names, index = [], []
    for prim, part in zip(prims, parts):
        of = {}
        for number in np.unique(part.group):
            usual = (prim.GetName() if several else "hair") if number < 0 else f"group_{number}"
            name = part.group_names.get(int(number)) or usual
            if name not in names:
                names.append(name)
            of[int(number)] = names.index(name)
        index.append(np.array([of[int(number)] for number in part.group], int))
    return names, np.concatenate(index)


def _clumps(parts: list[Strands]) -> np.ndarray:
    """Clumps of all curves, those of different prims different; -1 for none."""
    clumps, first = [], 0
    for part in parts:
        own = np.full(len(part.counts), -1) if part.clump is None else part.clump
        numbers, index = np.unique(own, return_inverse=True)
        clumps.append(np.where(own < 0, -1, index + first))
        first += len(numbers)
    return np.concatenate(clumps)


def _ids(parts: list[Strands], guide: np.ndarray, notes: list[str]) -> np.ndarray:
    """Ids of all curves, unique among guides and among the others: as they are in the file, else numbered in order."""
    ids = np.concatenate([np.arange(len(part.counts)) if part.ids is None else part.ids for part in parts])
    fits = (ids >= -(2**31)).all() and (ids < 2**31).all()
    if fits and all(len(np.unique(ids[guide == flag])) == (guide == flag).sum() for flag in (0, 1)):
        return ids
    if any(part.ids is not None for part in parts):
        notes.append("ids that are not unique: the curves are numbered in order instead")
    for flag in (0, 1):
        ids[guide == flag] = np.arange((guide == flag).sum())
    return ids
