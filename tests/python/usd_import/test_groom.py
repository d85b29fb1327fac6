"""Grooms from USD, imported by the program."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom

from hairbake_usd.exchange import FloatArray
from support import Run
from usd_import.stages import (
    FLOATS,
    INTS,
    NAMES,
    UVS,
    Groom,
    Imports,
    Refused,
    add_curves,
    add_primvar,
    hanging,
    new_stage,
)

OPTIONS = ("--strands-per-guide", "0", "--sections", "4")


def guides(groom: Groom) -> FloatArray:
    """Points of the guides, m, Y up; `guides × vertices × 3`."""
    points: FloatArray = groom.array("guides", "points") * groom.file["metres_per_unit"]
    if groom.file["up_axis"] == "z":
        points = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    return np.reshape(points, (-1, groom.file["guides"]["vertices"], 3))


def groups(groom: Groom, kind: str) -> list[str]:
    """Name of the group of each guide or strand."""
    return [groom.file["groups"][group]["name"] for group in groom.array(kind, "group")]


def vectors(points: FloatArray) -> list[Gf.Vec3f]:
    return [Gf.Vec3f(*point) for point in points.reshape(-1, 3).tolist()]


def test_units_axes_transforms_and_instances(imports: Imports, tmp_path: Path) -> None:
    expected = hanging(3)
    asset = new_stage(tmp_path / "asset.usda", 0.01, "Z")
    root = UsdGeom.Xform.Define(asset, "/asset")
    asset.SetDefaultPrim(root.GetPrim())
    UsdGeom.Xform.Define(asset, "/asset/scaled").AddScaleOp().Set(Gf.Vec3f(2))
    z_up = np.stack([expected[..., 0], -expected[..., 2], expected[..., 1]], axis=-1) * 100
    turned = np.stack([z_up[..., 1], -z_up[..., 0], z_up[..., 2]], axis=-1)
    add_curves(asset, "/asset/scaled/hair", (turned - [5, 0, 10]) / 2)
    asset.Save()
    stage = new_stage(tmp_path / "shot.usda", 0.01, "Z")
    instance = UsdGeom.Xform.Define(stage, "/shot/hero")
    instance.AddRotateZOp().Set(90)
    instance.AddTranslateOp().Set(Gf.Vec3d(5, 0, 10))
    instance.GetPrim().GetReferences().AddReference("./asset.usda")
    instance.GetPrim().SetInstanceable(True)
    stage.Save()
    groom, messages = imports(tmp_path / "shot.usda", *OPTIONS, "--guide-vertices", "6")
    assert groom.file["metres_per_unit"] == 0.01 and groom.file["up_axis"] == "z"
    assert "guessed" not in messages
    # Guides are resampled evenly along a curve; their ends stay.
    assert np.allclose(guides(groom)[:, [0, -1]], expected[:, [0, -1]], atol=1e-6)


@pytest.mark.parametrize("numbered", [True, False])
def test_ids_order_groups_widths_and_root_coordinates(
    imports: Imports, tmp_path: Path, numbered: bool
) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(4))
    add_primvar(hair, "groom_id", INTS, "uniform", [40, 10, 30, 20])
    add_primvar(hair, "groom_guide", INTS, "uniform", [0, 1, 0, 1])
    if numbered:
        add_primvar(hair, "groom_group_id", INTS, "uniform", [5, 5, 2, 2])
    add_primvar(hair, "groom_group_name", NAMES, "uniform", ["fringe", "fringe", "back", "back"])
    add_primvar(hair, "st", UVS, "vertex", [(0.1 * c, 0.2 + 0.01 * v) for c in range(4) for v in range(6)])
    hair.CreateWidthsAttr([0.001, 0.5, 0.0005, 0.5])
    hair.SetWidthsInterpolation("uniform")
    stage.Save()
    groom, messages = imports(tmp_path / "a.usda", *OPTIONS)
    assert "2 of them marked as guides" in messages
    assert groom.array("guides", "id").tolist() == [10, 20]
    assert groom.array("strands", "id").tolist() == [40, 30]
    assert np.allclose(groom.array("guides", "root_uv"), [[0.1, 0.2], [0.3, 0.2]])
    assert groups(groom, "strands") == ["fringe", "back"]
    # The width of a group is that of its strands, not of its guides.
    widths = {g["name"]: g["width_m"] for g in groom.file["groups"]}
    assert np.allclose(widths["fringe"], [0.001, 0.001]) and np.allclose(widths["back"], [0.0005, 0.0005])


def test_guides_get_the_factors_of_their_curves(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(4))
    add_primvar(hair, "groom_id", INTS, "uniform", [40, 10, 30, 20])
    add_primvar(hair, "groom_guide", INTS, "uniform", [0, 1, 0, 1])
    add_primvar(hair, "hairbake:stiffness", FLOATS, "uniform", [9, 0.5, 9, 2])
    add_primvar(hair, "hairbake:goal", FLOATS, "constant", [3])
    add_primvar(hair, "hairbake:drag", FLOATS, "uniform", [5, 1, 5, 1])
    add_primvar(hair, "hairbake:length", FLOATS, "uniform", [1, 0.5, 2, 1])
    stage.Save()
    groom, _ = imports(tmp_path / "a.usda", *OPTIONS, "--length-scale", "0.8")
    factors = groom.file["guides"]["factors"]
    assert groom.array("guides", "id").tolist() == [10, 20]
    # A factor that is 1 for all guides is not written.
    assert factors == {"stiffness": [0.5, 2], "goal": [3, 3]}
    drawn = np.linalg.norm(hanging(4)[:, -1] - hanging(4)[:, 0], axis=1)
    ends = guides(groom)[:, [0, -1]]
    assert np.allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), drawn[[1, 3]] * [0.4, 0.8], rtol=1e-5)
    assert np.allclose(ends[:, 0], hanging(4)[[1, 3], 0], atol=1e-7)


def test_factors_out_of_range_are_refused(refused: Refused, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(3))
    add_primvar(hair, "hairbake:stiffness", FLOATS, "uniform", [1, 0, -1])
    add_primvar(hair, "hairbake:length", FLOATS, "uniform", [1, float("nan"), 1])
    stage.Save()
    message = refused("import", "groom", tmp_path / "a.usda", *OPTIONS)
    assert "primvars:hairbake:stiffness: 0 for curve 1 (2 curves out of range)" in message
    assert "primvars:hairbake:length: nan for curve 1" in message and "0.01 to 100" in message


def test_strands_of_a_clump_share_a_wisp(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(8))
    add_primvar(hair, "groom_guide", INTS, "uniform", [1, 0, 0, 0, 0, 0, 0, 1])
    options = (*OPTIONS, "--leaf-wisps", "2", "--levels", "1")
    stage.Save()
    apart, _ = imports(tmp_path / "a.usda", *options)
    add_primvar(hair, "clump_id", INTS, "uniform", [0, 7, 7, 7, 7, 7, -1, 0])
    stage.Save()
    groom, _ = imports(tmp_path / "a.usda", *options)
    # All of a clump follow the guide to which most of its strands are near.
    wisps = groom.array("strands", "wisp")
    assert len(set(apart.array("strands", "wisp")[:5])) == 2
    assert len(set(wisps[:5])) == 1 and wisps[5] == apart.array("strands", "wisp")[5]


@pytest.mark.parametrize(
    ("interpolation", "values"), [("constant", [0.002]), ("varying", None), ("vertex", None)]
)
def test_widths_of_every_interpolation(
    imports: Imports, tmp_path: Path, interpolation: str, values: list[float] | None
) -> None:
    stage = new_stage(tmp_path / "a.usda", 0.5)
    hair = add_curves(stage, "/hair", hanging(2, 7) * 2, basis="bezier", wrap="nonperiodic")
    each = {"varying": [0.004, 0.003, 0.002], "vertex": [0.004, *[0.003] * 5, 0.002]}
    hair.CreateWidthsAttr(values or each[interpolation] * 2)
    hair.SetWidthsInterpolation(interpolation)
    stage.Save()
    groom, _ = imports(tmp_path / "a.usda", *OPTIONS)
    assert np.allclose(groom.file["groups"][0]["width_m"], [0.001, 0.001] if values else [0.002, 0.001])


def test_negative_widths_are_refused(refused: Refused, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(2))
    hair.CreateWidthsAttr([0.001, -0.002])
    hair.SetWidthsInterpolation("uniform")
    stage.Save()
    message = refused("import", "groom", tmp_path / "a.usda", *OPTIONS)
    assert "/hair.widths: width 1 is -0.002" in message and "0 or more" in message


def test_prims_of_purpose_guide_or_a_second_prim_are_the_guides(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    add_curves(stage, "/groom/guides", hanging(2))
    add_curves(stage, "/groom/fringe", hanging(3) + [0, 0.01, 0])
    add_curves(stage, "/groom/back", hanging(2) - [0, 0.01, 0])
    UsdGeom.Imageable(stage.GetPrimAtPath("/groom/guides")).CreatePurposeAttr("guide")
    stage.Save()
    source = tmp_path / "a.usda"
    groom, _ = imports(source, *OPTIONS)
    assert len(guides(groom)) == 2 and len(groom.array("strands", "id")) == 5
    # Prims without ids would share numbers: curves are numbered in order.
    assert groom.array("strands", "id").tolist() == [0, 1, 2, 3, 4]
    assert groups(groom, "strands") == ["fringe"] * 3 + ["back"] * 2
    both, _ = imports(source, "--prim", "/groom/guides", "--strands", f"{source}:/groom/back", *OPTIONS)
    assert len(guides(both)) == 2 and len(both.array("strands", "id")) == 2
    chosen, _ = imports(source, "--guides", "3", *OPTIONS)
    assert len(guides(chosen)) == 3 and len(chosen.array("strands", "id")) == 5


def test_animated_curves_are_read_at_rest_or_at_a_time(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(2))
    hair.GetPointsAttr().Clear()
    for code, lift in [(10, 0.1), (20, 0.2)]:
        hair.GetPointsAttr().Set(vectors(hanging(2) + [0, lift, 0]), code)
    stage.Save()

    def height(*options: str) -> float:
        return float(guides(imports(tmp_path / "a.usda", *OPTIONS, *options)[0])[0, 0, 1])

    assert abs(height() - 1.6) < 1e-6
    assert abs(height("--time", "15") - 1.65) < 1e-6
    add_primvar(hair, "rest", Sdf.ValueTypeNames.Point3fArray, "vertex", vectors(hanging(2)))
    stage.Save()
    assert abs(height() - 1.5) < 1e-6


def test_undeclared_unit_is_guessed_and_reported(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda", None, None)
    add_curves(stage, "/hair", hanging(8) * 100)
    stage.Save()
    groom, messages = imports(tmp_path / "a.usda", *OPTIONS)
    assert groom.file["metres_per_unit"] == 0.01 and "unit guessed: centimetres" in messages


def test_distance_of_roots_from_a_head_is_reported(imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    add_curves(stage, "/hair", hanging(3))
    plate = UsdGeom.Mesh.Define(stage, "/head/plate")
    plate.CreatePointsAttr([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)])
    plate.CreateFaceVertexCountsAttr([4])
    plate.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    UsdGeom.Xformable(plate).AddTranslateOp().Set(Gf.Vec3d(0, 1.495, 0))
    stage.Save()
    _, messages = imports(tmp_path / "a.usda", "--head", f"{tmp_path}/a.usda:/head", *OPTIONS)
    assert "3 roots: 0 inside" in messages and "mean distance 5.00 mm" in messages


def test_all_errors_of_a_stage_are_reported_at_once(refused: Refused, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    add_curves(stage, "/groom/hair", hanging(2))
    add_curves(stage, "/groom/cut", hanging(2), counts=[6, 5])
    add_curves(stage, "/groom/bezier", hanging(2), basis="bezier", wrap="nonperiodic")
    add_curves(stage, "/groom/none", np.zeros((0, 6, 3)))
    ids = add_curves(stage, "/groom/ids", hanging(2))
    add_primvar(ids, "groom_id", INTS, "uniform", [1, 2, 3])
    stage.Save()
    message = refused("import", "groom", tmp_path / "a.usda")
    for part in [
        "4 errors",
        "/groom/cut.curveVertexCounts: the counts sum to 11, for 12 points",
        "/groom/bezier.curveVertexCounts: 6 points for curve 0 (2 curves with a wrong count)",
        "/groom/none: 0 curves with 0 points",
        "/groom/ids.primvars:groom_id: has 3 values",
    ]:
        assert part in message, message


def test_bad_prims_points_and_units_are_refused(refused: Refused, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(2))
    UsdGeom.Mesh.Define(stage, "/head")
    stage.Save()
    source = tmp_path / "a.usda"

    def groom(*options: str) -> str:
        return refused("import", "groom", source, *options)

    assert "/groom/hat: no such prim" in groom("--prim", "/groom/hat") and "/groom" in groom("--prim", "/no")
    assert "it holds Mesh" in groom("--prim", "/head")
    assert "no triangle" in groom("--prim", "/groom/hair", "--head", f"{source}:/head")
    hair.GetPointsAttr().Set([Gf.Vec3f(float("nan"))] * 12)
    stage.Save()
    assert "2 not finite" in groom("--prim", "/groom/hair", "--units", "m")
    UsdGeom.SetStageMetersPerUnit(stage, -1)
    stage.Save()
    assert "metersPerUnit: -1.0 m" in groom("--prim", "/groom/hair")


def test_files_that_are_not_usd_are_refused(refused: Refused, tmp_path: Path) -> None:
    for name, content in [("b.usdc", "PXR-USDC and no more"), ("c.usd", ""), ("d.usdz", "no archive")]:
        (tmp_path / name).write_text(content)
        message = refused("import", "groom", tmp_path / name)
        assert f"{name}: cannot be opened as USD" in message
        assert not any(noise in message for noise in ("pxr", "Error in", "Traceback", ".cpp"))


BROKEN = """#usda 1.0
def Xform "groom"
{
    def BasisCurves "hair"
    {
        int[] curveVertexCounts = [3
        float width = 1
    }
}
"""


def test_syntax_errors_are_shown_with_file_line_and_text(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "broken.usda").write_text(BROKEN)
    (tmp_path / "shot.usda").write_text("#usda 1.0\n(\n    subLayers = [@broken.usda@]\n)\n")
    (tmp_path / "value.usda").write_text('#usda 1.0\ndef Xform "a"\n{\n    float size = "large"\n}\n')
    (tmp_path / "cut.usda").write_text("#usda 1.0\ndef Xform {")
    for name, place, said in [
        ("broken.usda", "broken.usda:7:", "syntax error at or before 'float width = 1'"),
        ("shot.usda", "broken.usda:7:", "syntax error at or before 'float width = 1'"),
        ("value.usda", "value.usda:4:", "'\"large\"' in </a.size>"),
        ("cut.usda", "cut.usda:2:1", "syntax error at or before 'def Xform {'"),
    ]:
        message = refused("import", "groom", tmp_path / name)
        assert place in message and said in message, message
        assert not any(noise in message for noise in ("pxr", "Error in", "sub-part", "Traceback", ".h :")), (
            message
        )


def test_invisible_prims_and_prototypes_are_left_out(
    imports: Imports, refused: Refused, tmp_path: Path
) -> None:
    stage = new_stage(tmp_path / "a.usda")
    instancer = UsdGeom.PointInstancer.Define(stage, "/scatter")
    add_curves(stage, "/scatter/prototype", hanging(3))
    instancer.CreatePrototypesRel().AddTarget("/scatter/prototype")
    hidden = add_curves(stage, "/hidden", hanging(4))
    hidden.CreateVisibilityAttr("invisible")
    stage.Save()
    assert "no BasisCurves" in refused("import", "groom", tmp_path / "a.usda")
    add_curves(stage, "/hair", hanging(2))
    stage.GetRootLayer().subLayerPaths.append("./missing.usda")
    stage.Save()
    groom, messages = imports(tmp_path / "a.usda", *OPTIONS)
    assert len(guides(groom)) == 2
    assert "missing.usda" in messages


def test_baked_cache_imports_as_the_same_groom(hairbake: Run, imports: Imports, tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(6))
    fringe = [True, True, False, False, True, False]
    names = ["the fringe" if flag else "back" for flag in fringe]
    add_primvar(hair, "groom_id", INTS, "uniform", [9, 8, 7, 3, 2, 1])
    add_primvar(hair, "groom_guide", INTS, "uniform", [1, 0, 0, 1, 0, 0])
    add_primvar(hair, "groom_root_uv", UVS, "uniform", [(0.1 * i, 0.5) for i in range(6)])
    add_primvar(hair, "groom_group_id", INTS, "uniform", [7 if flag else 4 for flag in fringe])
    add_primvar(hair, "groom_group_name", NAMES, "uniform", names)
    roots = [3e-4 if flag else 2e-4 for flag in fringe]
    hair.CreateWidthsAttr(np.repeat(roots, 6) * np.tile(np.linspace(1, 0.25, 6), 6))
    hair.SetWidthsInterpolation("vertex")
    stage.Save()
    first, _ = imports(tmp_path / "a.usda", *OPTIONS)
    anim = tmp_path / "anim.json"
    anim.write_text('{"format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 1]}')
    cache = tmp_path / "cache"
    done = hairbake(tmp_path / "shot/groom.json", anim, "-o", cache, "--no-pictures", "--preroll", "0")
    assert done.returncode == 0, done.stderr
    again, messages = imports(cache / "hair.usda", *OPTIONS)
    assert "the rest pose primvars:rest is used" in messages
    for kind in ("guides", "strands"):
        for name in ("id", "root_uv"):
            assert np.array_equal(first.array(kind, name), again.array(kind, name)), (kind, name)
        assert groups(again, kind) == groups(first, kind)
    assert groups(again, "strands") == ["the fringe", "back", "the fringe", "back"]
    for name, root in [("the fringe", 3e-4), ("back", 2e-4)]:
        for groom in (first, again):
            [group] = [group for group in groom.file["groups"] if group["name"] == name]
            assert np.allclose(group["width_m"], [root, root / 4], rtol=1e-5)
    assert np.allclose(first.array("strands", "points"), again.array("strands", "points"), atol=1e-6)
