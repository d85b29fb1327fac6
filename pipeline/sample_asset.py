"""Writes a small character asset to try `hairbake import` on: a ball for a head that looks round, and hair as B-splines; centimetres, Z up.

python pipeline/sample_asset.py asset.usda
"""

import argparse

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

RADIUS, HEIGHT, LENGTH = 10.0, 160.0, 16.0
STRANDS, POINTS = 600, 8
FRAMES, FPS = range(1001, 1025), 24


def roots() -> np.ndarray:
    """Directions spread evenly over the crown."""
    i = np.arange(STRANDS) + 0.5
    z = 1 - 0.75 * i / STRANDS
    turn = np.pi * (3 - np.sqrt(5)) * i
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def hair() -> np.ndarray:
    """Control points that leave the head and fall, longer at the sides: (strands × points × 3)."""
    out = roots()
    s = np.linspace(0, 1, POINTS)[None, :, None]
    length = LENGTH * (0.7 + 0.3 * (1 - out[:, 2]))[:, None, None]
    side = out * [1, 1, 0]
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    return RADIUS * 1.01 * out[:, None] + length * (
        s * (1 - s) * out[:, None] + 0.6 * s**1.5 * side[:, None] - 0.75 * s**2 * np.array([0, 0, 1.0])
    )


def ball(rings: int = 24, sides: int = 48) -> tuple[np.ndarray, list[int], list[int]]:
    """Vertices, corners of each face, and their indices."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(sides)),
        ],
        axis=-1,
    )
    points = np.vstack([[[0, 0, 1]], ring.reshape(-1, 3), [[0, 0, -1]]]) * RADIUS
    at = lambda r, s: 1 + r * sides + s % sides
    faces = [[0, at(0, s), at(0, s + 1)] for s in range(sides)]
    faces += [
        [at(r, s), at(r + 1, s), at(r + 1, s + 1), at(r, s + 1)]
        for r in range(rings - 2)
        for s in range(sides)
    ]
    faces += [[len(points) - 1, at(rings - 2, s + 1), at(rings - 2, s)] for s in range(sides)]
    return points, [len(face) for face in faces], [i for face in faces for i in face]


def write(path: str) -> None:
    stage = Usd.Stage.CreateNew(path)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetTimeCodesPerSecond(FPS)
    stage.SetFramesPerSecond(FPS)
    stage.SetStartTimeCode(FRAMES[0])
    stage.SetEndTimeCode(FRAMES[-1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/char").GetPrim())
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

    curves = UsdGeom.BasisCurves.Define(stage, "/char/head/hair")
    curves.CreateTypeAttr(UsdGeom.Tokens.cubic)
    curves.CreateBasisAttr(UsdGeom.Tokens.bspline)
    curves.CreateWrapAttr(UsdGeom.Tokens.pinned)
    curves.CreateCurveVertexCountsAttr([POINTS] * STRANDS)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(hair().reshape(-1, 3).astype(np.float32)))
    curves.CreateWidthsAttr([0.12])
    curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    primvars = UsdGeom.PrimvarsAPI(curves)
    primvars.CreatePrimvar("groom_id", Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.uniform).Set(
        list(range(STRANDS))
    )
    stage.Save()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file")
    write(parser.parse_args().file)
