"""Opens every cache of a folder with usd-core and compares all that it resolves with expected.json.

Usage: check_caches.py FOLDER; exits non-zero with the first difference.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Kind, Sdf, Usd, UsdGeom, UsdValidation


def check_cache(folder: Path, header: dict, frames: list) -> None:
    stage = Usd.Stage.Open(str(folder / "hair.usda"))
    check_stage(stage, header)
    for curves in header["curves"]:
        check_curves(UsdGeom.BasisCurves(stage.GetPrimAtPath(curves["prim"])), curves, header["basis"])
    for collider in header["colliders"]:
        check_collider(UsdGeom.Mesh(stage.GetPrimAtPath(collider["prim"])), collider)
    for frame in frames:
        check_frame(stage, header, frame)
    check_between_frames(stage, header, frames)
    check_resaved(folder)

    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    errors = [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(stage)]
    assert not errors, errors


def check_stage(stage: Usd.Stage, header: dict) -> None:
    assert stage.GetDefaultPrim().GetPath() == "/groom"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == Kind.Tokens.component
    assert UsdGeom.GetStageMetersPerUnit(stage) == header["metres_per_unit"]
    assert UsdGeom.GetStageUpAxis(stage) == header["up_axis"]
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == header["fps"]
    assert [stage.GetStartTimeCode(), stage.GetEndTimeCode()] == header["frames"]
    assert not stage.GetCompositionErrors()


def check_curves(curves: UsdGeom.BasisCurves, expected: dict, basis: str) -> None:
    assert curves, expected["prim"]
    kinds = [curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr()]
    assert [a.Get() for a in kinds] == ["cubic", basis, "pinned"]
    assert all(a.GetVariability() == Sdf.VariabilityUniform for a in kinds)
    purpose = "guide" if expected["prim"] == "/groom/guides" else "default"
    assert curves.ComputePurpose() == purpose
    same(curves.GetCurveVertexCountsAttr().Get(), expected["counts"])
    same(curves.GetWidthsAttr().Get(), expected["widths"])
    assert curves.GetWidthsInterpolation() == "vertex"

    primvars = UsdGeom.PrimvarsAPI(curves)
    for name, key, interpolation, type_name in [
        ("groom_id", "id", "uniform", "int[]"),
        ("groom_group_id", "group", "uniform", "int[]"),
        ("groom_group_name", "group_name", "uniform", "token[]"),
        ("groom_guide", "guide", "uniform", "int[]"),
        ("groom_root_uv", "root_uv", "uniform", "texCoord2f[]"),
        ("rest", "rest", "vertex", "point3f[]"),
    ]:
        primvar = primvars.GetPrimvar(name)
        assert primvar.GetTypeName() == Sdf.ValueTypeNames.Find(type_name), name
        assert primvar.GetInterpolation() == interpolation, name
        same(primvar.Get(), expected[key])
    assert primvars.GetPrimvar("displayColor").GetInterpolation() == "constant"
    assert len(curves.GetDisplayColorAttr().Get()) == 1


def check_collider(mesh: UsdGeom.Mesh, expected: dict) -> None:
    assert mesh, expected["prim"]
    if expected["deforms"]:
        assert not mesh.GetPointsAttr().HasAuthoredValue() or mesh.GetPointsAttr().Get() is None
        rest = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("rest")
        same(rest.Get(), expected["points"])
        assert rest.GetInterpolation() == "vertex"
    else:
        same(mesh.GetPointsAttr().Get(), expected["points"])
        same(mesh.GetExtentAttr().Get(), UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    same(mesh.GetFaceVertexIndicesAttr().Get(), np.ravel(expected["triangles"]))
    same(mesh.GetFaceVertexCountsAttr().Get(), [3] * len(expected["triangles"]))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetDoubleSidedAttr().Get()
    assert mesh.ComputePurpose() == "guide"


def check_frame(stage: Usd.Stage, header: dict, frame: dict) -> None:
    time = frame["frame"]
    for static, moving in zip(header["curves"], frame["curves"], strict=True):
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(static["prim"]))
        same(curves.GetPointsAttr().Get(time), moving["points"])
        same(curves.GetVelocitiesAttr().Get(time), moving["velocities"])
        same(curves.GetExtentAttr().Get(time), moving["extent"])
        for attribute in [curves.GetPointsAttr(), curves.GetVelocitiesAttr(), curves.GetExtentAttr()]:
            assert attribute.GetResolveInfo(time).GetSource() == Usd.ResolveInfoSourceValueClips
    moving = list(zip(header["colliders"], frame["colliders"], strict=True))
    bodies = [(c["prim"], m["transform"]) for c, m in moving]
    for static, now in moving:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(static["prim"]))
        points = mesh.GetPointsAttr().Get(time)
        same(points, now["points"] if static["deforms"] else static["points"])
        same(mesh.GetExtentAttr().Get(time), UsdGeom.PointBased.ComputeExtent(points))
    for prim, matrix in [("/groom/head", frame["head"]), *bodies]:
        world = UsdGeom.Xformable(stage.GetPrimAtPath(prim)).ComputeLocalToWorldTransform(time)
        same(world, np.transpose(matrix))


def check_between_frames(stage: Usd.Stage, header: dict, frames: list) -> None:
    """Halfway between two frames, handles included, points are interpolated and not held."""
    for before, after in zip(frames, frames[1:]):
        for i, curves in enumerate(header["curves"]):
            prim = UsdGeom.BasisCurves(stage.GetPrimAtPath(curves["prim"]))
            found = np.array(prim.GetPointsAttr().Get(before["frame"] + 0.5))
            halfway = [(np.array(f["curves"][i]["points"]) / 2) for f in (before, after)]
            np.testing.assert_allclose(found, sum(halfway), rtol=1e-5, atol=1e-6)


def check_resaved(folder: Path) -> None:
    """Every layer says the same after usd-core has saved it again as text and as crate."""
    for path in sorted(folder.glob("hair.*usd*")):
        layer = Sdf.Layer.FindOrOpen(str(path))
        text = layer.ExportToString()
        for suffix in ["usda", "usdc"]:
            copy = folder / "resaved" / f"{path.stem}.{suffix}"
            assert layer.Export(str(copy))
            assert Sdf.Layer.OpenAsAnonymous(str(copy)).ExportToString() == text, copy


def same(found, expected) -> None:
    found = np.array(found)
    np.testing.assert_array_equal(found, np.array(expected, dtype=found.dtype))


def main() -> None:
    folder = Path(sys.argv[1])
    cases = json.loads((folder / "expected.json").read_text())
    assert cases
    for case in cases:
        check_cache(folder / case["folder"], case["header"], case["frames"])


if __name__ == "__main__":
    main()
