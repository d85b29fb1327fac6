"""Opens every cache of a folder with usd-core and compares all that it resolves with expected.json.

Usage: check_caches.py FOLDER; exits non-zero with the first difference.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Kind, Sdf, Usd, UsdGeom, UsdShade, UsdValidation


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
    check_material(stage, header)
    check_lighting(folder, header, frames)
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
        ("groom_group_name", "group_name", "uniform", "string[]"),
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


def check_material(stage: Usd.Stage, header: dict) -> None:
    """Curves are bound to a surface whose colour is their display colour."""
    for curves in header["curves"]:
        material = bound(stage, curves["prim"])
        assert material.GetPath() == "/groom/materials/hair"
        surface, _, _ = material.ComputeSurfaceSource()
        assert surface.GetShaderId() == "UsdPreviewSurface"
        [source] = surface.GetInput("diffuseColor").GetConnectedSources()[0]
        reader = UsdShade.Shader(source.source.GetPrim())
        assert reader.GetShaderId() == "UsdPrimvarReader_float3"
        assert reader.GetInput("varname").Get() == "displayColor"


def check_lighting(folder: Path, header: dict, frames: list) -> None:
    """A stage of lighting's that references /groom elsewhere, with a surface of its own in the place of the cache's material, and one of
    the prims bound to another material; points still come from the frames.
    """
    curves = [c["prim"].removeprefix("/groom") for c in header["curves"]]
    stage = Usd.Stage.CreateInMemory()
    stage.OverridePrim("/shot/hair").GetReferences().AddReference(str(folder / "hair.usda"), "/groom")
    place = "/shot/hair/materials/hair"
    assert all(bound(stage, f"/shot/hair{c}").GetPath() == place for c in curves)

    ours = UsdShade.Shader.Define(stage, f"{place}/ours")
    ours.CreateIdAttr("UsdPreviewSurface")
    UsdShade.Material.Get(stage, place).CreateSurfaceOutput().ConnectToSource(
        ours.ConnectableAPI(), "surface"
    )
    for c in curves:
        assert bound(stage, f"/shot/hair{c}").ComputeSurfaceSource()[0].GetPath() == f"{place}/ours"

    look = UsdShade.Material.Define(stage, "/shot/look/wet")
    UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(f"/shot/hair{curves[0]}")).Bind(look)
    assert bound(stage, f"/shot/hair{curves[0]}").GetPath() == "/shot/look/wet"
    assert all(bound(stage, f"/shot/hair{c}").GetPath() == place for c in curves[1:])

    # One binding above all of the cache.
    above = Usd.Stage.CreateInMemory()
    above.OverridePrim("/shot/hair").GetReferences().AddReference(str(folder / "hair.usda"), "/groom")
    everything = UsdShade.Material.Define(above, "/shot/look/all")
    binding = UsdShade.MaterialBindingAPI.Apply(above.GetPrimAtPath("/shot/hair"))
    binding.Bind(everything, UsdShade.Tokens.strongerThanDescendants)
    assert all(bound(above, f"/shot/hair{c}").GetPath() == "/shot/look/all" for c in curves)

    for frame in frames:
        for c, moving in zip(curves, frame["curves"], strict=True):
            same(
                UsdGeom.BasisCurves.Get(stage, f"/shot/hair{c}").GetPointsAttr().Get(frame["frame"]),
                moving["points"],
            )


def bound(stage: Usd.Stage, path: str) -> UsdShade.Material:
    return UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()[0]


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
