"""The curves of a stage that a bake overrides: their rest points, and where the stage places them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .errors import input_error
from .exchange import Array, Arrays, FloatArray, Header
from .groom import choose_time, read_controls
from .primvars import Layout
from .stage import all_of, baked_kind, convention, find, gather, open_below_bakes, open_stage, to_world

SIDE = 0.25
"""Greatest number of time codes from a moment to the next at which a transform is taken, for its rates.

Stages sample transforms at frames, or at a quarter of a frame for motion blur, and interpolate linearly
between: within a quarter the rate is that of the segment which renderers blur.
"""


@dataclass(frozen=True)
class Moments:
    """The time codes of a bake."""

    first: int
    """First frame."""
    count: int
    """Number of frames."""
    offsets: list[float]
    """Moments within each frame."""

    def sides(self) -> list[float]:
        """For each offset, the time codes to the next two places at which a transform is taken.

        They are after the moment, as the shutter is, and in the same frame: a transform is linear between
        samples, and its rate before a frame is another.
        """
        return [min(SIDE, (1 - offset) / 2) for offset in self.offsets]

    def codes(self) -> list[list[float]]:
        """All of them, in order, each with the two places after it."""
        moments = list(zip(self.offsets, self.sides(), strict=True))
        return [
            [self.first + frame + offset + i * side for i in range(3)]
            for frame in range(self.count)
            for offset, side in moments
        ]


@dataclass
class Curves:
    """The curves of one prim."""

    prim: Usd.Prim
    at: Usd.TimeCode
    """The time at which they are at rest."""
    points_name: str
    """The attribute of their rest points."""
    layout: Layout
    points: FloatArray
    """Control points at rest, in the space of the prim."""
    width: float
    """The largest diameter."""
    normals: FloatArray
    """`n × 3`; none if the prim has none that vary along or between curves."""
    normal_controls: Array
    """The control point whose tangent turns each normal."""
    normals_name: str
    """The attribute of the normals."""
    to_world: FloatArray
    """Matrices at each moment and the two places after it: `moments × 3 × 4 × 4`, for column vectors."""

    def header(self) -> Header:
        """What JSON holds of it."""
        return {
            "path": str(self.prim.GetPath()),
            "points_name": self.points_name,
            "time": None if self.at.IsDefault() else self.at.GetValue(),
            "shows_rest": self.points_name == UsdGeom.Tokens.points
            and not UsdGeom.PointBased(self.prim).GetPointsAttr().ValueMightBeTimeVarying(),
            **self.layout.type.header(),
            "curves": len(self.layout.counts),
            "points": len(self.points),
            "normals": len(self.normals),
            "normals_name": self.normals_name,
            "width": self.width,
            "accelerations": UsdGeom.PointBased(self.prim).GetAccelerationsAttr().HasAuthoredValue(),
            "skinned": is_skinned(self.prim),
        }


def read(
    path: str, prim_paths: list[str | None], time: float | None, moments: Moments
) -> tuple[Header, Arrays, list[Header]]:
    """Header and arrays of the curves at and below some prims, and all layers; None is the whole stage.

    Raises:
        InputErrors: All errors in the curves.
    """
    stage = open_below_bakes(path)
    roots = gather(prim_paths, lambda prim_path: find(stage, prim_path))
    prims = [prim for root in roots for prim in curves_of(root)]
    codes = moments.codes()
    parts = gather(prims, lambda prim: read_prim(prim, time, codes))
    header = {
        **convention(stage),
        "notes": [],
        "prims": [part.header() for part in parts],
        "time_codes_per_second": stage.GetTimeCodesPerSecond(),
        "frames_per_second": stage.GetFramesPerSecond(),
        "range": [stage.GetStartTimeCode(), stage.GetEndTimeCode()]
        if stage.HasAuthoredTimeCodeRange()
        else None,
        "default_prim": stage.GetRootLayer().defaultPrim or None,
    }
    arrays: Arrays = {
        "controls": ("u32", np.concatenate([part.layout.counts for part in parts])),
        "points": ("f64", np.concatenate([part.points for part in parts])),
        "normals": ("f64", np.concatenate([part.normals for part in parts])),
        "normal_controls": ("u32", np.concatenate([part.normal_controls for part in parts])),
        "to_world": ("f64", np.stack([part.to_world for part in parts])),
        "sides": ("f64", np.array(moments.sides())),
    }
    return header, arrays, list(layers(stage, path, prims))


def layers(stage: Usd.Stage, path: str, prims: list[Usd.Prim]) -> Iterator[Header]:
    """The files of a stage, which was opened below bakes, and those that bakes put over the stage at `path`.

    These have their kind, and which of some prims they change.
    """
    for layer in stage.GetUsedLayers(False):
        if layer.realPath:
            yield {"file": layer.realPath, "kind": None, "prims": []}
    if not stage.GetMutedLayers():
        return
    whole = open_stage(path)
    changed: dict[str, list[str]] = {}
    for prim in (whole.GetPrimAtPath(prim.GetPath()) for prim in prims):
        for name in {spec.layer.identifier for spec in prim.GetPrimStack()}:
            changed.setdefault(name, []).append(str(prim.GetPath()))
    for layer in whole.GetUsedLayers(False):
        if kind := baked_kind(layer):
            yield {"file": layer.realPath, "kind": kind, "prims": changed.get(layer.identifier, [])}


def curves_of(root: Usd.Prim) -> list[Usd.Prim]:
    """The curves at and below a prim. Those that are named are meant, also where the shot hides them.

    Raises:
        InputErrors: There are none.
    """
    return [root] if root.IsA(UsdGeom.BasisCurves) else all_of(root, UsdGeom.BasisCurves, "BasisCurves")


def read_prim(prim: Usd.Prim, time: float | None, codes: list[list[float]]) -> Curves:
    """The curves of one prim.

    Raises:
        InputErrors: The errors of the prim.
    """
    if prim.IsInstanceProxy():
        instance = prim
        while not instance.IsInstance():
            instance = instance.GetParent()
        raise input_error(
            prim.GetPath(),
            f"the prim is part of the instance {instance.GetPath()}, which no layer can change in one place",
            "a prim outside instances",
            f"set instanceable = false on {instance.GetPath()} in the shot, so that it has prims of its own",
        )
    at, layout, points = read_controls(prim, time, [])
    if layout.type.wrap == "periodic":
        raise input_error(
            f"{prim.GetPath()}.wrap",
            "the curves are closed",
            "nonperiodic or pinned",
            "export open curves",
        )
    normals, controls, name = read_normals(prim, layout, at)
    return Curves(
        prim=prim,
        at=at,
        points_name=choose_time(prim, time, [])[1].GetName(),
        layout=layout,
        points=points,
        width=largest_width(prim, at),
        normals=normals,
        normal_controls=controls,
        normals_name=name,
        to_world=placements(prim, codes),
    )


def placements(prim: Usd.Prim, codes: list[list[float]]) -> FloatArray:
    """Matrices to world at each time code, `moments × 3 × 4 × 4`."""
    moves = any(
        UsdGeom.Xformable(each).TransformMightBeTimeVarying()
        for each in [prim, *ancestors(prim)]
        if each.IsA(UsdGeom.Xformable)
    )
    if not moves:
        return np.broadcast_to(to_world(prim, Usd.TimeCode(codes[0][0])), (len(codes), 3, 4, 4))
    return np.array([[to_world(prim, Usd.TimeCode(code)) for code in each] for each in codes])


def ancestors(prim: Usd.Prim) -> list[Usd.Prim]:
    """The prims above one, the pseudo-root left out."""
    found = []
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        found.append(prim)
    return found


def largest_width(prim: Usd.Prim, at: Usd.TimeCode) -> float:
    """The largest diameter of the curves of a prim; 0 without widths."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("widths")
    attr = primvar.GetAttr() if primvar and primvar.HasValue() else UsdGeom.Curves(prim).GetWidthsAttr()
    widths = np.array(attr.Get(at) or (), float)
    return float(widths.max(initial=0.0))


def read_normals(prim: Usd.Prim, layout: Layout, at: Usd.TimeCode) -> tuple[FloatArray, Array, str]:
    """Normals, the control point that each turns with, and their attribute.

    Constant normals stay: they are the same wherever the curves are.

    Raises:
        InputErrors: Their number is wrong.
    """
    none = np.zeros((0, 3)), np.zeros(0, int), ""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    is_primvar = bool(primvar and primvar.HasValue())
    point_based = UsdGeom.PointBased(prim)
    attr = primvar.GetAttr() if is_primvar else point_based.GetNormalsAttr()
    interpolation = primvar.GetInterpolation() if is_primvar else point_based.GetNormalsInterpolation()
    if is_primvar and primvar.IsIndexed():
        raise input_error(
            attr.GetPath(), "the normals are indexed", "normals without indices", "flatten the primvar"
        )
    values = np.array(attr.Get(at) or (), float).reshape(-1, 3)
    if not len(values) or interpolation == UsdGeom.Tokens.constant:
        return none
    layout.ends(attr.GetPath(), values, interpolation)
    starts = np.concatenate([[0], np.cumsum(layout.counts)])[:-1]
    if interpolation == UsdGeom.Tokens.vertex:
        controls = np.arange(len(values))
    elif interpolation == UsdGeom.Tokens.uniform:
        controls = starts
    else:
        each = [layout.type.varying_controls(int(n)) for n in layout.counts]
        controls = np.concatenate([start + own for start, own in zip(starts, each, strict=True)])
    return values, controls, attr.GetName()


def is_skinned(prim: Usd.Prim) -> bool:
    """Whether a skeleton or blend shapes deform the points of a prim, which are baked where they put them."""
    root = UsdSkel.Root.Find(prim)
    if not root:
        return False
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkinningQuery(prim)
    return bool(query and (query.HasJointInfluences() or query.HasBlendShapes()))
