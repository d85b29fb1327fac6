"""Grooms from USD, through the program."""

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom

from usd_import.stages import FLOATS, INTS, NAMES, UVS, add_curves, add_primvar, hanging, new_stage

OPTIONS = ("--strands-per-guide", "0", "--sections", "4")


def guides(groom) -> np.ndarray:
    """Points of the guides in metres, Y up: (guides × vertices × 3)."""
    points = groom.array("guides", "points") * groom.file["metres_per_unit"]
    if groom.file["up_axis"] == "z":
        points = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    return points.reshape(-1, groom.file["guides"]["vertices"], 3)


def groups(groom, kind: str) -> list[str]:
    """Name of the group of each guide or strand."""
    return [groom.file["groups"][group]["name"] for group in groom.array(kind, "group")]


def test_units_axes_and_transforms(imports, tmp_path):
    """The same strands in centimetres, Z up, below a chain of transforms, in an instance."""
    wanted = hanging(3)
    asset = new_stage(tmp_path / "asset.usda", 0.01, "Z")
    root = UsdGeom.Xform.Define(asset, "/asset")
    asset.SetDefaultPrim(root.GetPrim())
    UsdGeom.Xform.Define(asset, "/asset/scaled").AddScaleOp().Set(Gf.Vec3f(2))
    z_up = np.stack([wanted[..., 0], -wanted[..., 2], wanted[..., 1]], axis=-1) * 100
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
    groom, said = imports(tmp_path / "shot.usda", *OPTIONS, "--guide-vertices", "6")
    assert groom.file["metres_per_unit"] == 0.01 and groom.file["up_axis"] == "z"
    assert "guessed" not in said
    # Resampled evenly along a curve through them, the ends stay.
    assert np.allclose(guides(groom)[:, [0, -1]], wanted[:, [0, -1]], atol=1e-6)


@pytest.mark.parametrize("numbered", [True, False])
def test_ids_order_groups_widths_and_root_coordinates(imports, tmp_path, numbered):
    """Groups that have names alone are told by these."""
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
    groom, said = imports(tmp_path / "a.usda", *OPTIONS)
    assert "2 of them marked as guides" in said
    assert groom.array("guides", "id").tolist() == [10, 20]
    assert groom.array("strands", "id").tolist() == [40, 30]
    assert np.allclose(groom.array("guides", "root_uv"), [[0.1, 0.2], [0.3, 0.2]])
    assert groups(groom, "strands") == ["fringe", "back"]
    # The width of a group is that of its strands, not of its guides.
    widths = {g["name"]: g["width_m"] for g in groom.file["groups"]}
    assert np.allclose(widths["fringe"], [0.001, 0.001]) and np.allclose(widths["back"], [0.0005, 0.0005])


def test_what_single_curves_have_of_their_own(imports, tmp_path):
    """Factors on length and material; guides get those of the curves that they are, by id."""
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
    # Of a factor that is 1 for all guides nothing is written.
    assert factors == {"stiffness": [0.5, 2], "goal": [3, 3]}
    drawn = np.linalg.norm(hanging(4)[:, -1] - hanging(4)[:, 0], axis=1)
    ends = guides(groom)[:, [0, -1]]
    assert np.allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), drawn[[1, 3]] * [0.4, 0.8], rtol=1e-5)
    assert np.allclose(ends[:, 0], hanging(4)[[1, 3], 0], atol=1e-7)


def test_factors_out_of_range(refused, tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(3))
    add_primvar(hair, "hairbake:stiffness", FLOATS, "uniform", [1, 0, -1])
    add_primvar(hair, "hairbake:length", FLOATS, "uniform", [1, float("nan"), 1])
    stage.Save()
    said = refused("import", "groom", tmp_path / "a.usda", *OPTIONS)
    assert "primvars:hairbake:stiffness" in said and "and wrong of 1 more" in said
    assert "primvars:hairbake:length" in said and "0.01 to 100" in said


def test_clumps_stay_together(imports, tmp_path):
    """Two guides; the strands of a clump are all in the wisp of the one that most of them are near to."""
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(8))
    add_primvar(hair, "groom_guide", INTS, "uniform", [1, 0, 0, 0, 0, 0, 0, 1])
    options = (*OPTIONS, "--leaf-wisps", "2", "--levels", "1")
    stage.Save()
    apart, _ = imports(tmp_path / "a.usda", *options)
    add_primvar(hair, "clump_id", INTS, "uniform", [0, 7, 7, 7, 7, 7, -1, 0])
    stage.Save()
    groom, _ = imports(tmp_path / "a.usda", *options)
    wisps = groom.array("strands", "wisp")
    assert len(set(apart.array("strands", "wisp")[:5])) == 2
    assert len(set(wisps[:5])) == 1 and wisps[5] == apart.array("strands", "wisp")[5]


@pytest.mark.parametrize(
    "interpolation, values", [("constant", [0.002]), ("varying", None), ("vertex", None)]
)
def test_widths_of_every_interpolation(imports, tmp_path, interpolation, values):
    stage = new_stage(tmp_path / "a.usda", 0.5)
    hair = add_curves(stage, "/hair", hanging(2, 7) * 2, basis="bezier", wrap="nonperiodic")
    each = {"varying": [0.004, 0.003, 0.002], "vertex": [0.004] + [0.003] * 5 + [0.002]}.get(interpolation)
    hair.CreateWidthsAttr(values or each * 2)
    hair.SetWidthsInterpolation(interpolation)
    stage.Save()
    groom, _ = imports(tmp_path / "a.usda", *OPTIONS)
    assert np.allclose(groom.file["groups"][0]["width_m"], [0.001, 0.001] if values else [0.002, 0.001])


def test_a_second_prim_names_the_guides(imports, tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    add_curves(stage, "/groom/guides", hanging(2))
    add_curves(stage, "/groom/fringe", hanging(3) + [0, 0.01, 0])
    add_curves(stage, "/groom/back", hanging(2) - [0, 0.01, 0])
    UsdGeom.Imageable(stage.GetPrimAtPath("/groom/guides")).CreatePurposeAttr("guide")
    stage.Save()
    groom, said = imports(tmp_path / "a.usda", *OPTIONS)
    assert len(guides(groom)) == 2 and len(groom.array("strands", "id")) == 5
    # Two prims without ids have the same numbers; all are numbered in order.
    assert groom.array("strands", "id").tolist() == [0, 1, 2, 3, 4]
    names = [g["name"] for g in groom.file["groups"]]
    assert [names[g] for g in groom.array("strands", "group")] == ["fringe"] * 3 + ["back"] * 2
    both, _ = imports(
        tmp_path / "a.usda",
        "--prim",
        "/groom/guides",
        "--strands",
        f"{tmp_path}/a.usda:/groom/back",
        *OPTIONS,
    )
    assert len(guides(both)) == 2 and len(both.array("strands", "id")) == 2
    chosen, _ = imports(tmp_path / "a.usda", "--guides", "3", *OPTIONS)
    assert len(guides(chosen)) == 3 and len(chosen.array("strands", "id")) == 5


def test_moving_curves_are_taken_at_rest_or_at_a_time(imports, tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(2))
    hair.GetPointsAttr().Clear()
    for code, lift in [(10, 0.1), (20, 0.2)]:
        hair.GetPointsAttr().Set(
            [Gf.Vec3f(*p) for p in (hanging(2) + [0, lift, 0]).reshape(-1, 3).tolist()], code
        )
    stage.Save()
    height = lambda *options: guides(imports(tmp_path / "a.usda", *OPTIONS, *options)[0])[0, 0, 1]
    assert abs(height() - 1.6) < 1e-6
    assert abs(height("--time", "15") - 1.65) < 1e-6
    add_primvar(
        hair,
        "rest",
        Sdf.ValueTypeNames.Point3fArray,
        "vertex",
        [Gf.Vec3f(*p) for p in hanging(2).reshape(-1, 3).tolist()],
    )
    stage.Save()
    assert abs(height() - 1.5) < 1e-6


def test_a_unit_that_is_not_said_is_guessed_and_told(imports, tmp_path):
    stage = new_stage(tmp_path / "a.usda", None, None)
    add_curves(stage, "/hair", hanging(8) * 100)
    stage.Save()
    groom, said = imports(tmp_path / "a.usda", *OPTIONS)
    assert groom.file["metres_per_unit"] == 0.01 and "unit guessed: centimetres" in said


def test_a_head_from_usd_tells_where_the_roots_lie(imports, tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    add_curves(stage, "/hair", hanging(3))
    plate = UsdGeom.Mesh.Define(stage, "/head/plate")
    plate.CreatePointsAttr([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)])
    plate.CreateFaceVertexCountsAttr([4])
    plate.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    UsdGeom.Xformable(plate).AddTranslateOp().Set(Gf.Vec3d(0, 1.495, 0))
    stage.Save()
    _, said = imports(tmp_path / "a.usda", "--head", f"{tmp_path}/a.usda:/head", *OPTIONS)
    assert "3 roots: 0 inside" in said and "mean distance 5.00 mm" in said


def test_faults_are_told_and_nothing_is_written(refused, tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/groom/hair", hanging(2))
    add_curves(stage, "/groom/cut", hanging(2), counts=[6, 5])
    add_curves(stage, "/groom/bezier", hanging(2), basis="bezier", wrap="nonperiodic")
    add_curves(stage, "/groom/none", np.zeros((0, 6, 3)))
    ids = add_curves(stage, "/groom/ids", hanging(2))
    add_primvar(ids, "groom_id", INTS, "uniform", [1, 2, 3])
    UsdGeom.Mesh.Define(stage, "/head")
    stage.Save()
    groom = lambda *options: refused("import", "groom", tmp_path / "a.usda", *options)
    # All of a stage at once.
    words = groom()
    for part in [
        "4 errors",
        "/groom/cut",
        "11 in sum, for 12 points",
        "/groom/bezier",
        "6 points",
        "/groom/none",
        "0 curves",
        "groom_id",
        "3 values",
    ]:
        assert part in words, words
    assert "there is no such prim" in groom("--prim", "/groom/hat") and "/groom" in groom("--prim", "/no")
    assert "it holds Mesh" in groom("--prim", "/head")
    assert "no triangle" in refused(
        "import", "groom", tmp_path / "a.usda", "--prim", "/groom/hair", "--head", f"{tmp_path}/a.usda:/head"
    )
    hair.GetPointsAttr().Set([Gf.Vec3f(float("nan"))] * 12)
    stage.Save()
    assert "2 not finite" in groom("--prim", "/groom/hair", "--units", "m")
    UsdGeom.SetStageMetersPerUnit(stage, -1)
    stage.Save()
    assert "metersPerUnit" in groom("--prim", "/groom/hair")


def test_files_that_are_no_usd(refused, tmp_path):
    for name, content in [
        ("a.usda", "#usda 1.0\ndef Xform {"),
        ("b.usdc", "PXR-USDC and no more"),
        ("c.usd", ""),
    ]:
        (tmp_path / name).write_text(content)
        assert "cannot be opened as USD" in refused("import", "groom", tmp_path / name)


def test_what_is_hidden_or_only_a_prototype_is_left_out(imports, refused, tmp_path):
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
    groom, said = imports(tmp_path / "a.usda", *OPTIONS)
    assert len(guides(groom)) == 2
    assert "missing.usda" in said


def test_our_own_cache_comes_back(hairbake, imports, tmp_path):
    """Baked and imported again, a groom keeps ids, order, groups by name, root coordinates, widths and points."""
    stage = new_stage(tmp_path / "a.usda")
    hair = add_curves(stage, "/hair", hanging(6))
    add_primvar(hair, "groom_id", INTS, "uniform", [9, 8, 7, 3, 2, 1])
    add_primvar(hair, "groom_guide", INTS, "uniform", [1, 0, 0, 1, 0, 0])
    add_primvar(hair, "groom_root_uv", UVS, "uniform", [(0.1 * i, 0.5) for i in range(6)])
    add_primvar(hair, "groom_group_id", INTS, "uniform", [7, 7, 4, 4, 7, 4])
    add_primvar(
        hair,
        "groom_group_name",
        NAMES,
        "uniform",
        ["the fringe", "the fringe", "back", "back", "the fringe", "back"],
    )
    hair.CreateWidthsAttr(
        np.repeat([3e-4, 3e-4, 2e-4, 2e-4, 3e-4, 2e-4], 6) * np.tile(np.linspace(1, 0.25, 6), 6)
    )
    hair.SetWidthsInterpolation("vertex")
    stage.Save()
    first, _ = imports(tmp_path / "a.usda", *OPTIONS)
    (tmp_path / "anim.json").write_text(
        '{"format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 1]}'
    )
    done = hairbake(
        tmp_path / "shot/groom.json",
        tmp_path / "anim.json",
        "-o",
        tmp_path / "cache",
        "--no-pictures",
        "--preroll",
        "0",
    )
    assert done.returncode == 0, done.stderr
    again, said = imports(tmp_path / "cache" / "hair.usda", *OPTIONS)
    assert "rest pose primvars:rest is taken" in said
    for kind in ("guides", "strands"):
        for name in ("id", "root_uv"):
            assert np.array_equal(first.array(kind, name), again.array(kind, name)), (kind, name)
        assert groups(first, kind) == groups(again, kind)
    assert groups(again, "strands") == ["the fringe", "back", "the fringe", "back"]
    for name, root in [("the fringe", 3e-4), ("back", 2e-4)]:
        for groom in (first, again):
            [group] = [group for group in groom.file["groups"] if group["name"] == name]
            assert np.allclose(group["width_m"], [root, root / 4], rtol=1e-5)
    assert np.allclose(first.array("strands", "points"), again.array("strands", "points"), atol=1e-6)
