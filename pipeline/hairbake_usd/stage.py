"""Opening a stage: its unit and axis, its prims, and their transforms."""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

from .errors import InputError, InputErrors, input_error
from .exchange import FloatArray, Header

NAMED = 8
"""Largest number of prims that a message lists."""

SYNTAX = re.compile(r"(?:.* -- )?(?P<file>\S.*?):(?P<line>\d+):(?P<column>\d+): (?P<what>.*)", re.DOTALL)
"""A message of USD's text parser: place and reason."""

PARSE = re.compile(r"parse error matching \S+ at '(?P<text>.*)' in <(?P<path>.*)>", re.DOTALL)
"""A reason of USD's text parser that names a class of its own."""

SUB_PART = re.compile(r" \(at sub-part \d+ if there are multiple parts\)")

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def open_stage(path: str) -> Usd.Stage:
    """Opens a stage with all its payloads.

    Raises:
        InputErrors: USD cannot open it; with the places of syntax errors.
    """
    try:
        return Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        reasons = [str(part.commentary) for part in error.args]
        found = [syntax for reason in reasons if (syntax := syntax_error(reason))]
        if found:
            raise InputErrors(*found) from None
        said = [
            " ".join(reason.split()) for reason in reasons if not reason.startswith("Failed to open layer")
        ]
        raise input_error(
            "",
            ": ".join(["cannot be opened as USD", *said]),
            "a .usd, .usda, .usdc or .usdz file",
            "export the file again; the copy may be incomplete",
        ) from None


def open_below_bakes(path: str) -> Usd.Stage:
    """Opens a stage without what earlier bakes put over it, unless that is what `path` names.

    Raises:
        InputErrors: As `open_stage`.
    """
    stage = open_stage(path)
    root = stage.GetRootLayer()
    baked = [layer for layer in stage.GetUsedLayers(False) if layer != root and baked_kind(layer)]
    stage.MuteAndUnmuteLayers([layer.identifier for layer in baked], [])
    return stage


def baked_kind(layer: Sdf.Layer) -> str | None:
    """What a layer of a bake does to the stage below it, `over` or `deform`; None for all other layers.

    It is a `hair.over.usda` or `hair.deform.usda`, whatever its name.
    """
    kind = layer.customLayerData.get("hairbake")
    return kind if kind in ("over", "deform") else None


def syntax_error(message: str) -> InputError | None:
    """The error of a message of USD's text parser; None for other messages."""
    place = SYNTAX.fullmatch(message.strip())
    if not place:
        return None
    what = " ".join(SUB_PART.sub("", place["what"].removesuffix("; skipping.")).split())
    parse = PARSE.match(what)
    if parse:
        what = f"syntax error at or before {parse['text']!r}"
        what += f", in <{parse['path']}>" if parse["path"] else ""
    return InputError(
        "",
        what,
        "USD text that usdcat accepts",
        "correct this line or the one before it, or export the file again",
        file=place["file"],
        line=int(place["line"]),
        column=int(place["column"]),
    )


def broken_layers(stage: Usd.Stage) -> list[InputError]:
    """Syntax errors in layers that the stage refers to: what they define is missing."""
    found = (syntax_error(str(error)) for error in stage.GetCompositionErrors())
    return [error for error in found if error]


def convention(stage: Usd.Stage) -> Header:
    """Unit and up axis; None for what the stage does not declare.

    Raises:
        InputErrors: The unit is not a positive length.
    """
    unit = None
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        unit = UsdGeom.GetStageMetersPerUnit(stage)
        if not (math.isfinite(unit) and unit > 0):
            help = "correct it, or remove it and give --units"
            raise input_error("metersPerUnit", f"{unit} m", "a positive length", help)
    has_axis = stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
    up = str(UsdGeom.GetStageUpAxis(stage)).lower() if has_axis else None
    return {"metres_per_unit": unit, "up": up}


def composition_notes(stage: Usd.Stage) -> list[str]:
    """Notes on layers and prims that the stage refers to and USD does not find or cannot read."""
    notes = []
    for error in stage.GetCompositionErrors():
        syntax = syntax_error(str(error))
        if syntax:
            notes.append(f"left out: {syntax.file}, line {syntax.line}: {syntax.message}")
        else:
            notes.append(f"not found: {' '.join(str(error).split())}")
    return notes


def find(stage: Usd.Stage, path: str | None) -> Usd.Prim:
    """The prim at `path`; the pseudo-root if `path` is None.

    Raises:
        InputErrors: There is no such prim, or it is inactive or an over.
    """
    if path is None:
        return stage.GetPseudoRoot()
    prim = stage.GetPrimAtPath(path) if Tf.IsValidIdentifier(path.strip("/").split("/")[0]) else None
    if not prim:
        roots = ", ".join(str(child.GetPath()) for child in stage.GetPseudoRoot().GetAllChildren()) or "none"
        error = InputError(path, "no such prim", f"a prim at or below one of: {roots}", "correct the path")
        raise InputErrors(error, *broken_layers(stage))
    if not prim.IsActive() or not prim.IsDefined():
        raise input_error(
            path, "the prim is inactive or only an over", "an active, defined prim", "name another prim"
        )
    return prim


def all_of(root: Usd.Prim, schema: type, name: str) -> list[Usd.Prim]:
    """The prims of a schema at and below `root`, in stage order, including those inside instances.

    Invisible prims and prototypes of point instancers are left out.

    Raises:
        InputErrors: There is none; the message lists the types that there are.
    """
    found = list(_walk(root, schema))
    if found:
        return found
    below = Usd.PrimRange(root, Usd.TraverseInstanceProxies())
    others = sorted({str(prim.GetTypeName()) for prim in below if prim.GetTypeName()})
    contents = f"it holds {', '.join(others[:NAMED])}" if others else "it holds no typed prim"
    path = "" if root.IsPseudoRoot() else str(root.GetPath())
    place = "the stage" if root.IsPseudoRoot() else f"{root.GetTypeName() or 'prim'} {path}"
    error = InputError(
        path,
        f"no {name} in {place}: {contents}",
        f"a visible {name}",
        f"name a prim with a {name} at or below it",
    )
    raise InputErrors(error, *broken_layers(root.GetStage()))


def _walk(root: Usd.Prim, schema: type) -> Iterator[Usd.Prim]:
    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
        elif prim.IsA(schema) and UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible:
            yield prim


def to_world(prim: Usd.Prim, time: Usd.TimeCode) -> FloatArray:
    """Matrix from the prim's space to world, for column vectors, 4 × 4.

    Raises:
        InputErrors: The matrix is singular or not finite.
    """
    matrix: FloatArray = np.array(UsdGeom.Imageable(prim).ComputeLocalToWorldTransform(time)).T
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-30:
        raise input_error(
            prim.GetPath(),
            f"its transform is singular or not finite at {time}",
            "an invertible transform",
            "correct its xformOps",
        )
    return matrix


def xform_ops(prim: Usd.Prim) -> Iterator[UsdGeom.XformOp]:
    """The transform operations of a prim and of all its ancestors."""
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(UsdGeom.Xformable):
            yield from UsdGeom.Xformable(prim).GetOrderedXformOps()
        prim = prim.GetParent()


def times_without_rest(prim: Usd.Prim) -> list[float]:
    """Sorted time samples of the transform operations, of a prim and its ancestors, without default value."""
    times: set[float] = set()
    for op in xform_ops(prim):
        if op.Get(Usd.TimeCode.Default()) is None:
            times.update(op.GetTimeSamples())
    return sorted(times)


def without_instances(prim: Usd.Prim) -> Usd.Prim:
    """The prim, which is no longer part of an instance: nothing can be written to those."""
    stage, path = prim.GetStage(), prim.GetPath()
    while prim.IsInstanceProxy():
        instance = prim
        while not instance.IsInstance():
            instance = instance.GetParent()
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            instance.SetInstanceable(False)
        prim = stage.GetPrimAtPath(path)
    return prim


def apply(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Points (`n × 3`) under a matrix of `to_world`."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    moved: FloatArray = points @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def gather(items: Iterable[_Item], read: Callable[[_Item], _Result]) -> list[_Result]:
    """`read` of each item.

    Raises:
        InputErrors: The errors of all items.
    """
    results: list[_Result] = []
    errors: list[InputError] = []
    for item in items:
        try:
            results.append(read(item))
        except InputErrors as found:
            errors.extend(found.errors)
    if errors:
        raise InputErrors(*errors)
    return results
