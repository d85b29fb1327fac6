"""Opens every cache in a folder with usd-core and compares its values with expected.json.

Usage: check_caches.py FOLDER. Exits with an error at the first difference.
"""

import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Kind, Sdf, Usd, UsdGeom, UsdShade, UsdValidation

from second_reader import assert_same_in_both

Values = dict[str, Any]
"""Expected values, as in expected.json."""


def check_cache(folder: Path, header: Values, frames: list[Values]) -> None:
    """Checks one cache."""
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
    check_referenced(folder, header, frames)
    check_binding_above(folder, header)
    check_resaved(folder)

    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    errors = [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]
    assert not errors, errors
    assert assert_same_in_both(folder) > 0


def check_stage(stage: Usd.Stage, header: Values) -> None:
    """Checks the metadata of the stage."""
    assert stage.GetDefaultPrim().GetPath() == "/groom"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == Kind.Tokens.component
    assert UsdGeom.GetStageMetersPerUnit(stage) == header["metres_per_unit"]
    assert UsdGeom.GetStageUpAxis(stage) == header["up_axis"]
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == header["fps"]
    assert [stage.GetStartTimeCode(), stage.GetEndTimeCode()] == header["frames"]
    assert not stage.GetCompositionErrors()


def check_curves(curves: UsdGeom.BasisCurves, expected: Values, basis: str) -> None:
    """Checks the static attributes and primvars of curves."""
    assert curves, expected["prim"]
    kinds = [curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr()]
    assert [a.Get() for a in kinds] == ["cubic", basis, "pinned"]
    assert all(a.GetVariability() == Sdf.VariabilityUniform for a in kinds)
    purpose = "guide" if expected["prim"] == "/groom/guides" else "default"
    assert curves.ComputePurpose() == purpose
    assert_same(curves.GetCurveVertexCountsAttr().Get(), expected["counts"])
    assert_same(curves.GetWidthsAttr().Get(), expected["widths"])
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
        assert_same(primvar.Get(), expected[key])
    arc = primvars.GetPrimvar("groom_arc")
    assert bool(arc) == bool(expected["arc"])
    if arc:
        assert arc.GetTypeName() == Sdf.ValueTypeNames.FloatArray and arc.GetInterpolation() == "vertex"
        assert_same(arc.Get(), expected["arc"])
    assert primvars.GetPrimvar("displayColor").GetInterpolation() == "constant"
    assert len(curves.GetDisplayColorAttr().Get()) == 1


def check_collider(mesh: UsdGeom.Mesh, expected: Values) -> None:
    """Checks the static attributes of a collider."""
    assert mesh, expected["prim"]
    if expected["deforms"]:
        assert not mesh.GetPointsAttr().HasAuthoredValue() or mesh.GetPointsAttr().Get() is None
        rest = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("rest")
        assert_same(rest.Get(), expected["points"])
        assert rest.GetInterpolation() == "vertex"
    else:
        assert_same(mesh.GetPointsAttr().Get(), expected["points"])
        extent = UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get())
        assert_same(mesh.GetExtentAttr().Get(), extent)
    assert_same(mesh.GetFaceVertexIndicesAttr().Get(), np.ravel(expected["triangles"]))
    assert_same(mesh.GetFaceVertexCountsAttr().Get(), [3] * len(expected["triangles"]))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetDoubleSidedAttr().Get()
    assert mesh.ComputePurpose() == "guide"


def check_frame(stage: Usd.Stage, header: Values, frame: Values) -> None:
    """Checks animated attributes at one frame, and that they come from value clips."""
    time = frame["frame"]
    for static, moving in zip(header["curves"], frame["curves"], strict=True):
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(static["prim"]))
        assert_same(curves.GetPointsAttr().Get(time), moving["points"])
        assert_same(curves.GetVelocitiesAttr().Get(time), moving["velocities"])
        assert_same(curves.GetExtentAttr().Get(time), moving["extent"])
        for attribute in [curves.GetPointsAttr(), curves.GetVelocitiesAttr(), curves.GetExtentAttr()]:
            assert attribute.GetResolveInfo(time).GetSource() == Usd.ResolveInfoSourceValueClips
    transforms = [("/groom/head", frame["head"])]
    for static, moving in zip(header["colliders"], frame["colliders"], strict=True):
        transforms.append((static["prim"], moving["transform"]))
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(static["prim"]))
        points = mesh.GetPointsAttr().Get(time)
        assert_same(points, moving["points"] if static["deforms"] else static["points"])
        assert_same(mesh.GetExtentAttr().Get(time), UsdGeom.PointBased.ComputeExtent(points))
    for prim, matrix in transforms:
        world = UsdGeom.Xformable(stage.GetPrimAtPath(prim)).ComputeLocalToWorldTransform(time)
        assert_same(world, np.transpose(matrix))


def check_between_frames(stage: Usd.Stage, header: Values, frames: list[Values]) -> None:
    """Checks that points halfway between frames, handles included, are interpolated and not held."""
    for before, after in pairwise(frames):
        for i, curves in enumerate(header["curves"]):
            prim = UsdGeom.BasisCurves(stage.GetPrimAtPath(curves["prim"]))
            found = np.array(prim.GetPointsAttr().Get(before["frame"] + 0.5))
            halfway = [(np.array(f["curves"][i]["points"]) / 2) for f in (before, after)]
            np.testing.assert_allclose(found, sum(halfway), rtol=1e-5, atol=1e-6)


def check_material(stage: Usd.Stage, header: Values) -> None:
    """Checks that curves are bound to a surface whose colour is their display colour."""
    for curves in header["curves"]:
        material = bound_material(stage, curves["prim"])
        assert material.GetPath() == "/groom/materials/hair"
        surface, _, _ = material.ComputeSurfaceSource()
        assert surface.GetShaderId() == "UsdPreviewSurface"
        [source] = surface.GetInput("diffuseColor").GetConnectedSources()[0]
        reader = UsdShade.Shader(source.source.GetPrim())
        assert reader.GetShaderId() == "UsdPrimvarReader_float3"
        assert reader.GetInput("varname").Get() == "displayColor"


def curve_paths(header: Values) -> list[str]:
    """Paths of the curves below /groom."""
    return [curves["prim"].removeprefix("/groom") for curves in header["curves"]]


def referencing_stage(folder: Path) -> Usd.Stage:
    """A stage that references /groom as /shot/hair."""
    stage = Usd.Stage.CreateInMemory()
    stage.OverridePrim("/shot/hair").GetReferences().AddReference(str(folder / "hair.usda"), "/groom")
    return stage


def check_referenced(folder: Path, header: Values, frames: list[Values]) -> None:
    """Checks that a referencing stage can replace the surface, or bind one prim to another material.

    Points still come from the frames.
    """
    paths = curve_paths(header)
    stage = referencing_stage(folder)
    place = "/shot/hair/materials/hair"
    assert all(bound_material(stage, f"/shot/hair{path}").GetPath() == place for path in paths)

    surface = UsdShade.Shader.Define(stage, f"{place}/own")
    surface.CreateIdAttr("UsdPreviewSurface")
    output = UsdShade.Material.Get(stage, place).CreateSurfaceOutput()
    output.ConnectToSource(surface.ConnectableAPI(), "surface")
    for path in paths:
        source = bound_material(stage, f"/shot/hair{path}").ComputeSurfaceSource()[0]
        assert source.GetPath() == f"{place}/own"

    look = UsdShade.Material.Define(stage, "/shot/look/wet")
    UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(f"/shot/hair{paths[0]}")).Bind(look)
    assert bound_material(stage, f"/shot/hair{paths[0]}").GetPath() == "/shot/look/wet"
    assert all(bound_material(stage, f"/shot/hair{path}").GetPath() == place for path in paths[1:])

    for frame in frames:
        for path, moving in zip(paths, frame["curves"], strict=True):
            points = UsdGeom.BasisCurves.Get(stage, f"/shot/hair{path}").GetPointsAttr().Get(frame["frame"])
            assert_same(points, moving["points"])


def check_binding_above(folder: Path, header: Values) -> None:
    """Checks that one binding above the cache can override its own."""
    stage = referencing_stage(folder)
    look = UsdShade.Material.Define(stage, "/shot/look/all")
    binding = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/shot/hair"))
    binding.Bind(look, UsdShade.Tokens.strongerThanDescendants)
    for path in curve_paths(header):
        assert bound_material(stage, f"/shot/hair{path}").GetPath() == "/shot/look/all"


def bound_material(stage: Usd.Stage, path: str) -> UsdShade.Material:
    """The material that a prim resolves to."""
    return UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()[0]


def check_resaved(folder: Path) -> None:
    """Checks that every layer is unchanged when usd-core saves it as text and as crate."""
    for path in sorted(folder.glob("hair.*usd*")):
        layer = Sdf.Layer.FindOrOpen(str(path))
        text = layer.ExportToString()
        for suffix in ["usda", "usdc"]:
            copy = folder / "resaved" / f"{path.stem}.{suffix}"
            assert layer.Export(str(copy))
            assert Sdf.Layer.OpenAsAnonymous(str(copy)).ExportToString() == text, copy


def assert_same(found: Any, expected: Any) -> None:
    """Asserts that arrays are equal, with `expected` converted to the type of `found`."""
    array = np.array(found)
    np.testing.assert_array_equal(array, np.array(expected, dtype=array.dtype))


def main() -> None:
    """Checks all caches."""
    folder = Path(sys.argv[1])
    cases = json.loads((folder / "expected.json").read_text())
    assert cases
    for case in cases:
        check_cache(folder / case["folder"], case["header"], case["frames"])


if __name__ == "__main__":
    main()
