"""Triangles from the meshes of a stage, at rest and over time."""

from dataclasses import dataclass

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel

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

#: Largest change of a place, relative to the size of the mesh, that counts as none.
STILL = 1e-6


@dataclass
class Times:
    """Time codes: `count` of them from `start`, `step` apart."""

    start: float
    step: float
    count: int

    def codes(self) -> list[float]:
        return [self.start + self.step * i for i in range(self.count)]


def read(
    path: str, prim_path: str | None, time: float | None, times: Times | None, carrier: str | None
) -> tuple[dict, dict]:
    """Header and arrays of the meshes at and below a prim, as one.

    vertices are those at rest; with `times`, moving are those at each of them, unless the mesh stands still or goes along with the prim
    `carrier`.
    """
    stage = open_stage(path)
    header = convention(stage)
    root = find(stage, prim_path)
    prims = all_of(root, UsdGeom.Mesh, "Mesh")
    notes = composition_notes(stage)
    rests = gather(prims, lambda prim: _rest_time(prim, time))
    # What is skinned is read at rest before the skinning is worked out in its place.
    parts = gather(list(zip(prims, rests)), lambda part: _triangles(*part, notes))
    firsts = np.cumsum([0] + [len(points) for points, _ in parts])
    vertices = np.concatenate([points for points, _ in parts])
    triangles = np.concatenate([corners + first for (_, corners), first in zip(parts, firsts)])
    if not len(triangles):
        raise fail(
            root.GetPath(),
            "the mesh holds no triangle",
            "faces of three corners or more",
            "name a mesh that has faces",
        )
    arrays = {"vertices": ("f64", vertices), "triangles": ("u32", triangles)}
    if times is not None:
        carried_by = find(stage, carrier) if carrier else None
        moving = _over(
            stage, prims, rests, triangles, times, carried_by, float(np.ptp(vertices, axis=0).max())
        )
        if moving is not None:
            arrays["moving"] = ("f64", moving)
    return {**header, "notes": notes}, arrays


def _rest_time(prim: Usd.Prim, time: float | None) -> Usd.TimeCode:
    if time is not None:
        return Usd.TimeCode(time)
    points = UsdGeom.Mesh(prim).GetPointsAttr()
    samples = [] if points.Get(Usd.TimeCode.Default()) is not None else points.GetTimeSamples()
    samples = samples or moves_only(prim)
    return Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default()


def _points(prim: Usd.Prim, at: Usd.TimeCode) -> np.ndarray:
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(at) or (), float).reshape(-1, 3)
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise fail(
            f"{prim.GetPath()}.points",
            f"vertex {bad} is no number at {at}",
            "finite numbers",
            "export the mesh again",
        )
    return apply(to_world(prim, at), points)


def _triangles(prim: Usd.Prim, at: Usd.TimeCode, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Places in the world, and faces as fans of triangles, counter-clockwise from outside."""
    shape, place = UsdGeom.Mesh(prim), prim.GetPath()
    for attr in (shape.GetFaceVertexCountsAttr(), shape.GetFaceVertexIndicesAttr()):
        if attr.GetNumTimeSamples() > 1:
            raise fail(
                attr.GetPath(),
                "changes over time",
                "the same faces at all times",
                "export a mesh that keeps its faces",
            )
    points = _points(prim, at)
    counts = np.array(shape.GetFaceVertexCountsAttr().Get(Usd.TimeCode.EarliestTime()) or (), int)
    indices = np.array(shape.GetFaceVertexIndicesAttr().Get(Usd.TimeCode.EarliestTime()) or (), int)
    faults = []
    if (counts < 0).any() or counts.sum() != len(indices):
        what = f"are {counts.sum()} in sum, for {len(indices)} indices"
        faults.append(
            Fault(
                f"{place}.faceVertexCounts",
                what,
                "their sum is the number of indices",
                "export the mesh again",
            )
        )
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        what = f"go from {indices.min()} to {indices.max()}, of {len(points)} vertices"
        faults.append(
            Fault(f"{place}.faceVertexIndices", what, "indices of vertices", "export the mesh again")
        )
    if faults:
        raise Faults(*faults)
    starts = np.repeat(np.cumsum(counts) - counts, np.maximum(counts - 2, 0))
    step = np.concatenate([np.arange(n - 2) for n in counts]) if len(counts) else np.zeros(0, int)
    corners = (
        np.stack([indices[starts], indices[starts + step + 1], indices[starts + step + 2]], axis=1)
        if len(starts)
        else np.zeros((0, 3), int)
    )
    mirrored = np.linalg.det(to_world(prim, at)[:3, :3]) < 0
    if (shape.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded) != mirrored:
        corners = corners[:, ::-1]
    if (
        shape.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none
        and shape.GetSubdivisionSchemeAttr().HasAuthoredValue()
    ):
        notes.append(f"{place}: a subdivision surface; its cage is taken")
    return points, corners


def _over(stage, prims, rests, triangles, times: Times, carrier, size: float) -> np.ndarray | None:
    """Places at all times; None where nothing moves but as `carrier` does."""
    roots = {
        UsdSkel.Root.Find(prim)
        for prim in prims
        if UsdSkel.BindingAPI(prim).GetJointIndicesPrimvar().HasValue()
    }
    codes = times.codes()
    for root in roots:
        if root:
            UsdSkel.BakeSkinning(root, Gf.Interval(codes[0], codes[-1]))
    out = np.concatenate(
        [np.stack([_points(prim, Usd.TimeCode(code)) for code in codes]) for prim in prims], axis=1
    )
    if out.shape[1] <= triangles.max():
        raise fail(
            prims[0].GetPath(),
            "has fewer points at some times than at rest",
            "the same points at all times",
            "export it again",
        )
    still = out
    if carrier is not None:
        # Back to where each was in the space of what may carry it.
        still = np.stack(
            [apply(np.linalg.inv(to_world(carrier, Usd.TimeCode(code))), x) for code, x in zip(codes, out)]
        )
    return None if np.abs(still - still[0]).max() <= STILL * size else out
