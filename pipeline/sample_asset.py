"""Writes a small character asset for `hairbake import`.

    python pipeline/sample_asset.py asset.usda

A ball serves as a head that looks around; its hair is B-splines. Centimetres, Z up.
"""

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

RADIUS, HEIGHT, LENGTH = 10.0, 160.0, 16.0
"""Radius and height of the head, and length of the hair, cm."""
STRANDS, POINTS = 600, 8
FRAMES, FPS = range(1001, 1025), 24

Points = NDArray[np.floating[Any]]


def root_directions() -> Points:
    """Directions spread evenly over the crown, `strands × 3`."""
    i = np.arange(STRANDS) + 0.5
    z = 1 - 0.75 * i / STRANDS
    turn = np.pi * (3 - np.sqrt(5)) * i
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def control_points() -> Points:
    """Control points of strands that leave the head and fall, longer at the sides, `strands × points × 3`."""
    out = root_directions()
    s = np.linspace(0, 1, POINTS)[None, :, None]
    length = LENGTH * (0.7 + 0.3 * (1 - out[:, 2]))[:, None, None]
    side = out * [1, 1, 0]
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    along = s * (1 - s) * out[:, None] + 0.6 * s**1.5 * side[:, None] - 0.75 * s**2 * np.array([0, 0, 1.0])
    points: Points = RADIUS * 1.01 * out[:, None] + length * along
    return points


def ball(rings: int = 24, sides: int = 48) -> tuple[Points, list[int], list[int]]:
    """Vertices, number of corners of each face, and vertex indices of the corners."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    x, y = np.outer(np.sin(polar), np.cos(turn)), np.outer(np.sin(polar), np.sin(turn))
    z = np.outer(np.cos(polar), np.ones(sides))
    ring = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    points = np.vstack([[[0, 0, 1]], ring, [[0, 0, -1]]]) * RADIUS

    def at(ring: int, side: int) -> int:
        return 1 + ring * sides + side % sides

    faces = [[0, at(0, s), at(0, s + 1)] for s in range(sides)]
    faces += [
        [at(r, s), at(r + 1, s), at(r + 1, s + 1), at(r, s + 1)]
        for r in range(rings - 2)
        for s in range(sides)
    ]
    faces += [[len(points) - 1, at(rings - 2, s + 1), at(rings - 2, s)] for s in range(sides)]
    return points, [len(face) for face in faces], [i for face in faces for i in face]


def add_head(stage: Usd.Stage) -> None:
    """The head with its motion and its mesh."""
    head = UsdGeom.Xform.Define(stage, "/char/head")
    place, turn = head.AddTranslateOp(), head.AddRotateZOp()
    place.Set(Gf.Vec3d(0, 0, HEIGHT))
    turn.Set(0.0)
    for i, frame in enumerate(FRAMES):
        turn.Set(50 * float(np.sin(2 * np.pi * i / 16) * min(1, i / 6)), frame)
    points, counts, corners = ball()
    skin = UsdGeom.Mesh.Define(stage, "/char/head/skin")
    skin.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    skin.CreateFaceVertexCountsAttr(counts)
    skin.CreateFaceVertexIndicesAttr(corners)
    skin.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)


def add_hair(stage: Usd.Stage) -> None:
    """The hair, below the head."""
    curves = UsdGeom.BasisCurves.Define(stage, "/char/head/hair")
    curves.CreateTypeAttr(UsdGeom.Tokens.cubic)
    curves.CreateBasisAttr(UsdGeom.Tokens.bspline)
    curves.CreateWrapAttr(UsdGeom.Tokens.pinned)
    curves.CreateCurveVertexCountsAttr([POINTS] * STRANDS)
    points = control_points().reshape(-1, 3).astype(np.float32)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    curves.CreateWidthsAttr([0.12])
    curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    ids = UsdGeom.PrimvarsAPI(curves).CreatePrimvar(
        "groom_id", Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.uniform
    )
    ids.Set(list(range(STRANDS)))


def write(path: str) -> None:
    """Writes the asset."""
    stage = Usd.Stage.CreateNew(path)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetTimeCodesPerSecond(FPS)
    stage.SetFramesPerSecond(FPS)
    stage.SetStartTimeCode(FRAMES[0])
    stage.SetEndTimeCode(FRAMES[-1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/char").GetPrim())
    add_head(stage)
    add_hair(stage)
    stage.Save()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", help="USD file to write")
    write(parser.parse_args().file)
