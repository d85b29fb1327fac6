"""Over mode: the motion of a bake over the curves that the groom was imported from, as a user runs it."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from hairbake_usd import goal
from hairbake_usd.exchange import FloatArray
from hairbake_usd.mesh import Times
from hairbake_usd.stage import open_below_bakes
from hairbake_validate.geometry import transformed
from hairbake_validate.report import Report
from hairbake_validate.run import validate
from program.over_shot import FIRST, FRAMES, HAIR, LAST, POINTS, QUICK, STRANDS, Shot
from support import Run, unwrapped
from usd_import.stages import new_stage

pytestmark = pytest.mark.slow
TYPES = [
    ("linear", "nonperiodic"),
    ("bezier", "nonperiodic"),
    ("bspline", "nonperiodic"),
    ("bspline", "pinned"),
    ("catmullRom", "nonperiodic"),
    ("catmullRom", "pinned"),
]


def composed(out: Path) -> tuple[Usd.Stage, UsdGeom.BasisCurves]:
    """The composed stage, and its curves, which live as long as the stage."""
    stage = Usd.Stage.Open(str(out / "hair.shot.usda"))
    return stage, UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR))


def values(attribute: Usd.Attribute, time: float | None = None) -> FloatArray:
    """An array at a time."""
    return np.array(attribute.Get() if time is None else attribute.Get(time), float)


def passed(out: Path) -> Report:
    """The report on a cache, all of whose checks of over mode hold."""
    report = validate(out)
    over = {name: outcome for name, outcome in report.outcomes.items() if name.startswith("over_")}
    assert all(outcome.status == "pass" for outcome in over.values()), report.as_text()
    assert report.outcomes["checksums"].status == "pass"
    assert over["over_roots"].worst is not None
    return report


@pytest.mark.parametrize(("basis", "wrap"), TYPES)
def test_the_curves_of_the_groom_are_drawn_where_strands_are_baked(
    hairbake: Run, tmp_path: Path, basis: str, wrap: str
) -> None:
    shot = Shot(tmp_path, hairbake, basis, wrap)
    out = shot.baked()
    assert f"over mode: a bake puts the motion over {HAIR} as well" in unwrapped(shot.track)
    worst = passed(out).outcomes["over_shape"].worst
    assert worst is not None and worst.value < 0.01
    _stage, found = composed(out)
    assert (found.GetBasisAttr().Get() if basis != "linear" else "linear", found.GetWrapAttr().Get()) == (
        basis,
        wrap,
    )
    moved = values(found.GetPointsAttr(), LAST) - values(found.GetPointsAttr())
    assert np.linalg.norm(moved, axis=1).max() > 1
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(found, LAST)
    assert np.allclose(values(found.GetExtentAttr(), LAST), np.array(extent), atol=1e-4)


@pytest.mark.parametrize(("basis", "wrap"), TYPES)
def test_what_does_not_move_comes_back_to_rounding(
    hairbake: Run, tmp_path: Path, basis: str, wrap: str
) -> None:
    shot = Shot(tmp_path, hairbake, basis, wrap)

    def still(stage: Usd.Stage) -> None:
        for path in ("/world/hero", "/world/hero/char/head"):
            for op in UsdGeom.Xformable(stage.GetPrimAtPath(path)).GetOrderedXformOps():
                value = op.Get(FIRST)
                op.GetAttr().Clear()
                op.Set(value)

    shot.edit(shot.shot, still)
    out = shot.baked("--set", "anim.gravity_m_s2=[0,0,0]", "--set", "anim.settings.contact=bodies")
    _stage, found = composed(out)
    points = found.GetPointsAttr()
    # The groom's points are rounded to 8e-6 cm, and points in the world, 2 m from its origin, to 1.5e-5 cm.
    assert all(np.abs(values(points, frame) - values(points)).max() < 6e-5 for frame in FRAMES)


def test_a_groom_of_the_asset_is_found_in_the_shot(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    passed(shot.baked(stage=shot.asset))
    expected = {"file": "shot.usda", "prims": [HAIR], "metres_per_unit": 0.01, "up_axis": "z"}
    assert json.loads((tmp_path / "anim.json").read_text())["over"] == expected


def test_a_unit_that_the_stage_does_not_declare_is_that_of_the_import(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake, units=1, declared=None)
    unit = ("--units", "m")
    scene, out = shot.imported(*unit, track=unit), tmp_path / "out"
    shot.run(*scene, "-o", out, *QUICK)
    passed(out)
    stage, found = composed(out)
    # Metres: the strands are 0.2 m long, and the shot is as it was, also for who takes it for centimetres.
    moved = np.linalg.norm(values(found.GetPointsAttr(), LAST) - values(found.GetPointsAttr()), axis=1)
    assert 0.01 < moved.max() < 0.5
    assert not stage.HasAuthoredMetadata("metersPerUnit")
    record = json.loads((out / "manifest.json").read_text())["over"]
    assert (record["metres_per_unit"], record["up_axis"]) == (1.0, "Z")
    # The same stage by another prim has the unit of the track; other stages have none.
    shot.run(*scene, "-o", tmp_path / "again", *QUICK, "--over", f"{shot.shot}:/world")
    assert (tmp_path / "again/hair.over.1003.usdc").read_bytes() == (out / "hair.over.1003.usdc").read_bytes()
    other = tmp_path / "other.usda"
    other.write_bytes(shot.shot.read_bytes())
    refused = hairbake(*scene, "-o", tmp_path / "none", "--over", f"{other}:{HAIR}")
    assert refused.returncode == 65
    assert "the stage does not declare its unit" in unwrapped(refused.stderr)


def test_groom_and_track_of_different_units_are_refused(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake, units=1, declared=None)
    done = hairbake(*shot.imported("--units", "m"), "-o", tmp_path / "out", *QUICK)
    assert done.returncode == 65, done.stderr
    assert "the stage shows the curves 0.010 times as large as they were imported" in unwrapped(done.stderr)


def test_moments_accelerations_and_normals(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)

    def ribbons(stage: Usd.Stage) -> None:
        hair = UsdGeom.BasisCurves(stage.GetPrimAtPath("/char/hair"))
        hair.CreateNormalsAttr(Vt.Vec3fArray(STRANDS * POINTS, Gf.Vec3f(1, 0, 0)))
        hair.SetNormalsInterpolation("vertex")

    shot.edit(shot.asset, ribbons)
    out = shot.baked("--samples", "3", "--accelerations")
    passed(out)
    _stage, found = composed(out)
    half = FIRST + 0.25
    points, rates, accelerations = (
        values(attribute, FIRST)
        for attribute in (found.GetPointsAttr(), found.GetVelocitiesAttr(), found.GetAccelerationsAttr())
    )
    step = 0.25 / 24
    extrapolated = points + rates * step + accelerations * step**2 / 2
    moved = np.abs(values(found.GetPointsAttr(), half) - points).max()
    assert np.abs(values(found.GetPointsAttr(), half) - extrapolated).max() < 0.02 * moved
    normals = values(found.GetNormalsAttr(), LAST).reshape(STRANDS, POINTS, 3)
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)
    places = values(found.GetPointsAttr(), LAST).reshape(STRANDS, POINTS, 3)
    tangents = places[:, 2:] - places[:, :-2]
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    # They are across the curves at rest, and stay so.
    assert np.abs((normals[:, 1:-1] * tangents).sum(-1)).max() < 1e-4
    assert np.abs(normals - [1, 0, 0]).max() > 0.05


@pytest.mark.parametrize(("bound", "shapes"), [("/char/hair", False), ("/char", False), ("/char/hair", True)])
def test_a_skeleton_does_not_move_the_curves_again(
    hairbake: Run, tmp_path: Path, bound: str, shapes: bool
) -> None:
    shot = Shot(tmp_path, hairbake)
    shot.bind(bound, shapes)
    out = shot.baked()
    passed(out)

    def skinned(path: Path) -> list[str]:
        stage = Usd.Stage.Open(str(path))
        root = UsdSkel.Root(stage.GetPrimAtPath("/world/hero/char"))
        cache = UsdSkel.Cache()
        cache.Populate(root, Usd.PrimDefaultPredicate)
        bindings = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
        targets = [target for binding in bindings for target in binding.GetSkinningTargets()]
        return [str(target.GetPrim().GetPath()) for target in targets]

    assert skinned(shot.shot) == [HAIR] and skinned(out / "hair.shot.usda") == []


def test_what_an_earlier_bake_put_over_the_shot_is_not_read(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    shot.edit(
        shot.asset,
        lambda stage: (
            UsdGeom.BasisCurves(stage.GetPrimAtPath("/char/hair"))
            .CreateAccelerationsAttr()
            .Set(Vt.Vec3fArray(STRANDS * POINTS))
        ),
    )
    first, second = shot.baked(), tmp_path / "again"
    # As a pipeline has it.
    shot.edit(shot.shot, lambda stage: stage.GetRootLayer().subLayerPaths.append("./out/hair.over.usda"))
    shot.run(*shot.imported(), "-o", second, *QUICK)
    names = sorted(path.name for path in first.glob("hair*"))
    assert "hair.over.1003.usdc" in names
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name
    inputs = [json.loads((out / "manifest.json").read_text())["inputs"] for out in (first, second)]
    assert [entry for entry in inputs[0] if entry["role"] == "over"] == [
        entry for entry in inputs[1] if entry["role"] == "over"
    ]
    passed(second)


def test_a_finished_cache_is_part_of_the_shot(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    scene = shot.imported()
    shot.run(*scene, "-o", tmp_path / "plain", *QUICK, "--no-over")

    def show(stage: Usd.Stage) -> None:
        stage.DefinePrim("/world/plain").GetReferences().AddReference("./plain/hair.usda")

    shot.edit(shot.shot, show)
    stage = open_below_bakes(str(shot.shot))
    assert stage.GetPrimAtPath("/world/plain/hair").IsA(UsdGeom.BasisCurves)
    shot.run(*scene, "-o", tmp_path / "out", *QUICK)
    passed(tmp_path / "out")


def test_goals_are_read_as_an_earlier_bake_moves_them(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake, "linear", "nonperiodic")
    out, times = shot.baked(), Times(FIRST, 1, LAST - FIRST + 1)
    carried, moved = (goal.read(str(path), HAIR, times) for path in (shot.shot, out / "hair.shot.usda"))
    spans = [np.array(arrays["span"][1]) for _, arrays in (carried, moved)]
    assert np.isinf(spans[0]).all() and (spans[1] == [FRAMES[0], FRAMES[-1]]).all()
    _stage, found = composed(out)
    place = found.ComputeLocalToWorldTransform(LAST)
    expected = transformed(values(found.GetPointsAttr(), LAST), np.array(place))
    assert np.array_equal(moved[1]["points"][1][-1], expected)
    assert np.abs(carried[1]["points"][1][-1] - expected).max() > 1


def test_layers_of_the_bake_are_no_stage_to_put_it_over(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    out = shot.baked()
    scene = (tmp_path / "groom.json", tmp_path / "anim.json", "-o", out, *QUICK, "--overwrite")
    before = (out / "hair.shot.usda").read_bytes()
    anim = json.loads((tmp_path / "anim.json").read_text())
    for over in (("--over", f"{out}/hair.shot.usda:{HAIR}"), ()):
        done = hairbake(*scene, *over)
        assert done.returncode == 64 and "name the stage below it" in unwrapped(done.stderr), done.stderr
        anim["over"]["file"] = "out/hair.shot.usda"
        (tmp_path / "anim.json").write_text(json.dumps(anim))
    # A stage that shows it would show itself.
    edit = new_stage(tmp_path / "edit.usda", 0.01, "Z")
    edit.GetRootLayer().subLayerPaths.append("./out/hair.shot.usda")
    edit.Save()
    done = hairbake(*scene, "--over", f"{tmp_path}/edit.usda:{HAIR}")
    assert done.returncode == 64 and "name the stage below it" in unwrapped(done.stderr), done.stderr
    assert (out / "hair.shot.usda").read_bytes() == before


def test_curves_that_only_the_shot_hides_move_as_well(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    scene = shot.imported()

    def hide(stage: Usd.Stage) -> None:
        UsdGeom.Imageable(stage.OverridePrim(HAIR)).MakeInvisible()

    shot.edit(shot.shot, hide)
    shot.run(*scene, "-o", tmp_path / "out", *QUICK)
    passed(tmp_path / "out")


def test_a_plan_names_the_stage_and_the_base_for_any_folder(
    hairbake: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = Shot(tmp_path, hairbake)
    scene = shot.imported()
    monkeypatch.chdir(tmp_path)
    over = ("--over", f"shot.usda:{HAIR}", "--groups", "hair", "--base", "old")
    done = hairbake("plan", *scene, "-o", "out", *over)
    assert done.returncode == 0, done.stderr
    commands = [task for step in json.loads(done.stdout)["steps"] for task in step["tasks"]]
    bakes = [command for command in commands if "--over" in command]
    assert bakes
    for command in bakes:
        named = {option: command[command.index(option) + 1] for option in ("--over", "--base")}
        assert named == {"--over": f"{shot.shot}:{HAIR}", "--base": str(tmp_path / "old")}


def test_a_shot_from_frame_0_passes(hairbake: Run, tmp_path: Path) -> None:
    out = Shot(tmp_path, hairbake, first=0).baked()
    names = {path.name for path in out.glob("hair.*-*.usdc")}
    assert names == {"hair.-001.usdc", "hair.over.-001.usdc"}
    report = passed(out)
    assert report.passed, report.as_text()


def test_strands_left_out_ride_with_the_head(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    shot.shorten(5)
    out = shot.baked()
    passed(out)
    record = json.loads((out / "manifest.json").read_text())
    runs = [(run["first"], run["baked"], run["count"]) for run in record["over"]["prims"][0]["baked"]]
    assert runs == [(0, 0, 5), (6, 5, 6)]


def test_stages_and_resumed_bakes_write_the_same_bytes(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    out, farm = shot.baked(), tmp_path / "farm"
    scene = (tmp_path / "groom.json", tmp_path / "anim.json", "-o", farm, *QUICK[:-1])
    shot.run("simulate", *scene, "--frames", "1000-1003")
    shot.run("simulate", *scene, "--frames", "1004-1010")
    for frames in ("1003-1007", "1000-1002"):
        shot.run("interpolate", *scene, "--frames", frames)
    shot.run("assemble", *scene, "--no-pictures")

    def contents() -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in farm.glob("*.*") if path.is_file()}

    first = contents()
    names = [name for name in first if name.startswith(("hair", "manifest"))]
    assert len([name for name in names if name.startswith("hair.over.1")]) == len(FRAMES)
    for name in names:
        assert first[name] == (out / name).read_bytes(), name
    (farm / "hair.over.1003.usdc").write_bytes(b"damaged")
    (farm / "hair.over.1004.usdc").unlink()
    shot.run(*scene, "--no-pictures")
    assert {name: contents()[name] for name in names} == {name: first[name] for name in names}
    shot.run(*scene, "--no-pictures", "--no-over", "--overwrite")
    assert not list(farm.glob("hair.over*")) and not (farm / "hair.shot.usda").exists()


def another_count(shot: Shot) -> None:
    def change(stage: Usd.Stage) -> None:
        hair = UsdGeom.BasisCurves(stage.GetPrimAtPath("/char/hair"))
        hair.GetPointsAttr().Set(hair.GetPointsAttr().Get()[:-POINTS])
        hair.GetCurveVertexCountsAttr().Set([POINTS] * (STRANDS - 1))

    shot.edit(shot.asset, change)


def another_basis(shot: Shot) -> None:
    basis = "/char/hair.basis"
    shot.edit(shot.asset, lambda stage: stage.GetAttributeAtPath(basis).Set("catmullRom"))


def another_place(shot: Shot) -> None:
    points = "/char/hair.points"
    shot.edit(
        shot.asset,
        lambda stage: stage.GetAttributeAtPath(points).Set(
            [point + Gf.Vec3f(1, 0, 0) for point in stage.GetAttributeAtPath(points).Get()]
        ),
    )


def closed(shot: Shot) -> None:
    shot.edit(shot.asset, lambda stage: stage.GetAttributeAtPath("/char/hair.wrap").Set("periodic"))


def instance(shot: Shot) -> None:
    shot.edit(shot.shot, lambda stage: stage.GetPrimAtPath("/world/hero/char").SetInstanceable(True))


def another_rate(shot: Shot) -> None:
    shot.edit(shot.shot, lambda stage: stage.SetTimeCodesPerSecond(30))


def two_characters(shot: Shot) -> None:
    def change(stage: Usd.Stage) -> None:
        stage.DefinePrim("/world/extra").GetReferences().AddReference("./char.usda")

    shot.edit(shot.shot, change)


def nothing(_: Shot) -> None:
    pass


@pytest.mark.parametrize(
    ("change", "over", "message"),
    [
        (nothing, "nothing.usda:/world", "no such file"),
        (nothing, "groom.json", "not a USD file"),
        (nothing, "shot.usda:/world/hero/char/head", "no BasisCurves in Xform /world/hero/char/head"),
        (nothing, "shot.usda:/world/nobody", "no such prim"),
        (another_count, f"shot.usda:{HAIR}", "11 curves of 77 points, imported as 12 curves of 84 points"),
        (another_basis, f"shot.usda:{HAIR}", "pinned catmullrom curves, imported as pinned bspline"),
        (another_place, f"shot.usda:{HAIR}", "is 0.010 m from where the groom was imported"),
        (closed, f"shot.usda:{HAIR}", "the curves are closed"),
        (instance, f"shot.usda:{HAIR}", "the prim is part of the instance /world/hero/char"),
        (another_rate, f"shot.usda:{HAIR}", "30 time codes per second, where the animation has 24 frames"),
        (two_characters, "shot.usda:/world", "the second prim with the curves of /world/hero/char/hair"),
    ],
)
def test_stages_that_nothing_can_be_put_over_are_refused(
    hairbake: Run, tmp_path: Path, change: Callable[[Shot], None], over: str, message: str
) -> None:
    shot = Shot(tmp_path, hairbake)
    scene, out = shot.imported(), tmp_path / "out"
    change(shot)
    done = hairbake(*scene, "-o", out, "--over", tmp_path / over)
    assert done.returncode == 65, done.stderr
    said = unwrapped(done.stderr)
    assert message in said and "or bake with --no-over" in said and "nothing written" in said
    assert not out.exists()


def test_grooms_of_other_files_are_refused(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    groom, anim = shot.imported()
    content = json.loads(groom.read_text())
    del content["source"]
    groom.write_text(json.dumps(content))
    done = hairbake(groom, anim, "-o", tmp_path / "out")
    assert done.returncode == 65
    assert "does not tell which curves it was imported from" in unwrapped(done.stderr)
    shot.run(groom, anim, "-o", tmp_path / "out", *QUICK, "--no-over")


def test_settings_that_leave_out_strands_switch_it_off(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    groom, anim = shot.imported()
    asked = hairbake(groom, anim, "-o", tmp_path / "out", "--over", f"{shot.shot}:{HAIR}", "--keep", "0.5")
    assert asked.returncode == 64 and "leave out --keep" in asked.stderr
    messages = shot.run(groom, anim, "-o", tmp_path / "out", *QUICK, "--keep", "0.5")
    assert "over mode is off" in messages and not (tmp_path / "out/hair.shot.usda").exists()


def test_instances_and_motions_of_other_files_have_no_default(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    instance(shot)
    shot.imported(stage=shot.asset)
    assert "is part of an instance, which no layer can change" in unwrapped(shot.track)
    assert "over" not in json.loads((tmp_path / "anim.json").read_text())
