"""A stage that was opened, its unit and axis, and the prims that were asked for."""

import math
from collections.abc import Iterator

import numpy as np
from pxr import Tf, Usd, UsdGeom

from .faults import Faults, fail

#: Prims that a fault names at most.
NAMED = 8


def open_stage(path: str) -> Usd.Stage:
    """Opens a stage with all its payloads."""
    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        reason = " ".join(str(error).split())
        raise fail(
            "", f"cannot be opened as USD: {reason}", "a .usd, .usda, .usdc or .usdz file", "export it again"
        ) from None
    return stage


def convention(stage: Usd.Stage) -> dict:
    """Unit and up axis as far as the stage says them; what it does not say is None."""
    unit = None
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        unit = UsdGeom.GetStageMetersPerUnit(stage)
        if not (math.isfinite(unit) and unit > 0):
            raise fail(
                "metersPerUnit",
                f"is {unit}",
                "a length above 0",
                "correct it, or leave it out and give --units",
            )
    up = (
        str(UsdGeom.GetStageUpAxis(stage)).lower()
        if stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
        else None
    )
    return {"metres_per_unit": unit, "up": up}


def composition_notes(stage: Usd.Stage) -> list[str]:
    """What the stage names and could not find."""
    return [f"not found: {' '.join(str(error).split())}" for error in stage.GetCompositionErrors()]


def find(stage: Usd.Stage, path: str | None) -> Usd.Prim:
    """The prim at `path`, or the root of the stage."""
    if path is None:
        return stage.GetPseudoRoot()
    prim = stage.GetPrimAtPath(path) if Tf.IsValidIdentifier(path.strip("/").split("/")[0]) else None
    if not prim:
        roots = ", ".join(str(child.GetPath()) for child in stage.GetPseudoRoot().GetAllChildren()) or "none"
        raise fail(path, "there is no such prim", f"a prim below one of these: {roots}", "correct the path")
    if not prim.IsActive() or not prim.IsDefined():
        raise fail(
            path,
            "the prim is switched off or only an over",
            "a prim that is active and defined",
            "name another",
        )
    return prim


def all_of(root: Usd.Prim, kind: type, what: str) -> list[Usd.Prim]:
    """The prims of schema `kind` at and below `root` in the order of the stage, those inside of instances included. What is hidden, and
    what is a prototype of a point instancer, is left out.

    Raises where there is none, naming what else is there.
    """
    found = list(_walk(root, kind))
    if found:
        return found
    others = sorted(
        {
            str(prim.GetTypeName())
            for prim in Usd.PrimRange(root, Usd.TraverseInstanceProxies())
            if prim.GetTypeName()
        }
    )
    there = f"it holds {', '.join(others[:NAMED])}" if others else "it holds no prim of any type"
    where = "" if root.IsPseudoRoot() else str(root.GetPath())
    place = "the stage" if root.IsPseudoRoot() else f"{root.GetTypeName() or 'prim'} {where}"
    raise fail(
        where,
        f"no {what} in {place}: {there}",
        f"a {what}, visible",
        f"name a prim with a {what} at or below it",
    )


def _walk(root: Usd.Prim, kind: type) -> Iterator[Usd.Prim]:
    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
        elif prim.IsA(kind) and UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible:
            yield prim


def to_world(prim: Usd.Prim, time: Usd.TimeCode) -> np.ndarray:
    """Matrix from the prim's space to the world, for columns: 4 × 4."""
    matrix = np.array(UsdGeom.Imageable(prim).ComputeLocalToWorldTransform(time)).T
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-30:
        raise fail(
            prim.GetPath(),
            f"its transform flattens all, or is no number, at {time}",
            "a transform that can be undone",
            "correct its xformOps",
        )
    return matrix


def moves_only(prim: Usd.Prim) -> list[float]:
    """Time samples of the transforms of a prim and all above it that have no value outside of time, in order."""
    times = set()
    while prim and not prim.IsPseudoRoot():
        for op in UsdGeom.Xformable(prim).GetOrderedXformOps() if prim.IsA(UsdGeom.Xformable) else ():
            if op.Get(Usd.TimeCode.Default()) is None:
                times.update(op.GetTimeSamples())
        prim = prim.GetParent()
    return sorted(times)


def apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points of shape (n, 3) under a matrix of `to_world`."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def gather(parts: list, read) -> list:
    """`read` of each part; the faults of all are raised together."""
    done, faults = [], []
    for part in parts:
        try:
            done.append(read(part))
        except Faults as found:
            faults.extend(found.faults)
    if faults:
        raise Faults(*faults)
    return done
