"""A head that raises its brows, to grow hair on: a mesh with a blend shape and painted density, as USD.

python examples/raise_brows.py gallery/short/head.obj -o gallery/brows.usda
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

Vector = NDArray[np.float64]

FACE = "/head/face"
FPS = 24
FRAMES = (1001, 1024)


def smooth_step(start: float, end: float, x: Vector) -> Vector:
    """From 0 at `start` to 1 at `end`, without kinks."""
    u = np.clip((x - start) / (end - start), 0, 1)
    stepped: Vector = u * u * (3 - 2 * u)
    return stepped


def read_mesh(path: Path) -> tuple[Vector, list[list[int]]]:
    """Vertices, m, and faces of an OBJ file."""
    lines = [line.split() for line in path.read_text().splitlines()]
    points = [[float(x) for x in line[1:4]] for line in lines if line[:1] == ["v"]]
    faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    return np.array(points), faces


def raised(points: Vector) -> Vector:
    """How far the blend shape moves the vertices, m."""
    over = np.exp(-(((points[:, 1] - 0.132) / 0.014) ** 2)) * smooth_step(0.06, 0.09, points[:, 2])
    return np.outer(over, [0, 0.012, 0.002])


def density(points: Vector) -> Vector:
    """Where brows grow, 0 to 1."""
    side, height, front = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    line = 0.129 + 0.004 * np.sin((side - 0.012) / 0.035 * np.pi)
    ends = smooth_step(0.010, 0.014, side) * smooth_step(0.052, 0.044, side)
    grown: Vector = np.exp(-(((height - line) / 0.0045) ** 4)) * ends * smooth_step(0.05, 0.07, front)
    return grown


def combed(points: Vector) -> Vector:
    """Direction of the hair: outward and a little up."""
    return np.stack([np.sign(points[:, 0]), np.full(len(points), 0.3), np.zeros(len(points))], axis=1)


def define_face(stage: Usd.Stage, points: Vector, faces: list[list[int]]) -> UsdGeom.Mesh:
    """The mesh with its maps."""
    mesh = UsdGeom.Mesh.Define(stage, FACE)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([corner for face in faces for corner in face])
    mesh.CreateSubdivisionSchemeAttr("none")
    maps = UsdGeom.PrimvarsAPI(mesh)
    painted = maps.CreatePrimvar("brows", Sdf.ValueTypeNames.FloatArray, "vertex")
    painted.Set(Vt.FloatArray.FromNumpy(density(points).astype(np.float32)))
    directions = maps.CreatePrimvar("comb", Sdf.ValueTypeNames.Vector3fArray, "vertex")
    directions.Set(Vt.Vec3fArray.FromNumpy(combed(points).astype(np.float32)))
    return mesh


def animate(stage: Usd.Stage, mesh: UsdGeom.Mesh, moved: Vector) -> None:
    """A skeleton of one joint at rest, and a blend shape that goes up and down again."""
    skeleton = UsdSkel.Skeleton.Define(stage, "/head/skeleton")
    skeleton.CreateJointsAttr(["head"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    shape = UsdSkel.BlendShape.Define(stage, f"{FACE}/raised")
    shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(moved.astype(np.float32)))
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(True, 1).Set([0])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    binding.CreateBlendShapesAttr(["raised"])
    binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    animation = UsdSkel.Animation.Define(stage, "/head/skeleton/animation")
    animation.CreateJointsAttr(["head"])
    animation.CreateTranslationsAttr([Gf.Vec3f(0)])
    animation.CreateRotationsAttr([Gf.Quatf(1)])
    animation.CreateScalesAttr([Gf.Vec3h(1)])
    animation.CreateBlendShapesAttr(["raised"])
    weights = animation.CreateBlendShapeWeightsAttr()
    frames = np.arange(FRAMES[0] - FPS, FRAMES[1] + 1)
    since = (frames - FRAMES[0]).astype(float)
    up = smooth_step(4, 9, since) * smooth_step(20, 14, since)
    for frame, weight in zip(frames, up, strict=True):
        weights.Set([float(weight)], float(frame))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])


def main() -> None:
    """Writes the stage."""
    parser = argparse.ArgumentParser(description="Make a head that raises its brows.")
    parser.add_argument("head", type=Path, help="mesh of a head in metres (OBJ)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="USD file to write")
    options = parser.parse_args()
    points, faces = read_mesh(options.head)
    stage = Usd.Stage.CreateNew(str(options.output))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetStartTimeCode(FRAMES[0])
    stage.SetEndTimeCode(FRAMES[1])
    stage.SetTimeCodesPerSecond(FPS)
    stage.SetDefaultPrim(UsdSkel.Root.Define(stage, "/head").GetPrim())
    animate(stage, define_face(stage, points, faces), raised(points))
    stage.Save()


if __name__ == "__main__":
    main()
