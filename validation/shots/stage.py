"""USD files as other programs write them: centimetres, Y up, 24 frames a second."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

from physics.arrays import FloatArray

from .surfaces import Triangles

UNIT = 0.01
"""Metres per unit."""


def new_stage(path: Path) -> Usd.Stage:
    """An empty stage in place of the file at `path`."""
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, UNIT)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetTimeCodesPerSecond(24)
    return stage


def add_mesh(stage: Usd.Stage, path: str, mesh: Triangles) -> None:
    """A mesh of triangles, given in metres."""
    vertices, triangles = mesh
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(vectors(vertices / UNIT))
    prim.CreateFaceVertexCountsAttr([3] * len(triangles))
    prim.CreateFaceVertexIndicesAttr(triangles.ravel().tolist())
    prim.CreateSubdivisionSchemeAttr("none")


def add_curves(stage: Usd.Stage, path: str, strands: FloatArray, guides: bool) -> None:
    """Cubic curves through the points of strands, `n × vertices × 3`, m; guides, or strands to be drawn."""
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("cubic")
    curves.CreateBasisAttr("catmullRom")
    curves.CreateWrapAttr("pinned")
    curves.CreateCurveVertexCountsAttr([strands.shape[1]] * len(strands))
    curves.CreatePointsAttr(vectors(strands.reshape(-1, 3) / UNIT))
    curves.CreatePurposeAttr("guide" if guides else "render")


def add_moving(stage: Usd.Stage, path: str, poses: Mapping[float, FloatArray]) -> None:
    """A transform with a matrix, m, for column vectors, at each time code; none by default."""
    op = UsdGeom.Xform.Define(stage, path).AddTransformOp()
    op.Set(Gf.Matrix4d(1.0))
    for code, pose in poses.items():
        matrix = pose.T.copy()
        matrix[3, :3] /= UNIT
        op.Set(Gf.Matrix4d(matrix.tolist()), code)


def vectors(points: FloatArray) -> Any:
    """The points as a USD array."""
    return Vt.Vec3fArray.FromNumpy(points.astype(np.float32))
