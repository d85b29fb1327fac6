"""Over mode: a good stage passes, and each defect fails its own check and no other."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_validate.checks_over import OVER, OVER_FRAME
from hairbake_validate.run import validate
from validator.defects import MIDDLE, failed
from validator.good_cache import CURVES, FIRST, FPS, HAIR, HANDLES, POINTS, CacheBuilder, transform
from validator.over_cache import CURVES_PATH, TO_METRES, OverCache, bind_curves, place, put_over

Defect = Callable[[OverCache], object]


@pytest.fixture
def over(good_cache: CacheBuilder) -> OverCache:
    return OverCache(good_cache)


def test_a_good_stage_passes(over: OverCache) -> None:
    report = validate(over.cache.directory)
    assert not failed(report), report.as_text()
    shape = report.outcomes["over_shape"].worst
    assert shape is not None and shape.value < 1e-3


@pytest.mark.parametrize("kind", ["over", "deform"])
def test_what_bakes_put_over_other_characters_passes(over: OverCache, kind: str) -> None:
    put_over(over.stage, kind, "/world/another/hair")
    report = validate(over.cache.directory)
    assert not failed(report), report.as_text()


def test_a_stage_that_was_made_from_the_layer_of_a_bake_passes(over: OverCache) -> None:
    def mark(layer: Sdf.Layer) -> None:
        layer.customLayerData = {"hairbake": "over"}

    over.edit(over.stage, mark)
    report = validate(over.cache.directory)
    assert not failed(report), report.as_text()


def stage_missing(over: OverCache) -> None:
    over.stage.unlink()


def houdini_deforms_as_well(over: OverCache) -> None:
    put_over(over.stage, "deform", CURVES_PATH)


def unit_of_another_layer(over: OverCache) -> None:
    over.edit_stage("hair.shot.usda", lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.1))


def rate_of_another_layer(over: OverCache) -> None:
    over.edit_stage("hair.over.usda", lambda stage: stage.SetFramesPerSecond(30))


def record_without_curves(over: OverCache) -> None:
    over.cache.edit_record(lambda record: record["over"]["prims"][0].pop("baked"))


def on_curves(change: Callable[[Usd.Prim], object]) -> Defect:
    return lambda over: over.edit_stage(
        "hair.over.usda", lambda stage: change(stage.OverridePrim(CURVES_PATH))
    )


def widths_changed(prim: Usd.Prim) -> None:
    prim.CreateAttribute("widths", Sdf.ValueTypeNames.FloatArray).Set([0.02])


def material_changed(prim: Usd.Prim) -> None:
    binding = prim.CreateRelationship("material:binding")
    binding.SetTargets(["/world/look/red"])


def purpose_changed(prim: Usd.Prim) -> None:
    prim.CreateAttribute("purpose", Sdf.ValueTypeNames.Token, False, Sdf.VariabilityUniform).Set("proxy")


def id_changed(prim: Usd.Prim) -> None:
    prim.CreateAttribute("primvars:hair_id", Sdf.ValueTypeNames.IntArray).Set([7] * 12)


def subset_changed(prim: Usd.Prim) -> None:
    subset = prim.GetStage().OverridePrim(f"{CURVES_PATH}/fringe")
    subset.CreateAttribute("indices", Sdf.ValueTypeNames.IntArray).Set([1])


def primvar_added(prim: Usd.Prim) -> None:
    prim.CreateAttribute("primvars:wet", Sdf.ValueTypeNames.Float).Set(1.0)


def hidden(prim: Usd.Prim) -> None:
    prim.SetActive(False)


def prim_added(prim: Usd.Prim) -> None:
    UsdGeom.Sphere.Define(prim.GetStage(), "/world/ball")


def clips_too_short(prim: Usd.Prim) -> None:
    Usd.ClipsAPI(prim).SetClipTemplateEndTime(MIDDLE, "hairbake")


def schema_added(prim: Usd.Prim) -> None:
    prim.AddAppliedSchema("CollectionAPI:hair")


def bound_again(over: OverCache) -> None:
    """The stage has a skeleton, from which the overs do not unbind the curves."""
    bind_curves(over.stage, "/world/hero/groom")


def samples_over_clips(over: OverCache) -> None:
    def change(stage: Usd.Stage) -> None:
        points = stage.OverridePrim(CURVES_PATH).CreateAttribute("points", Sdf.ValueTypeNames.Point3fArray)
        points.Set(Vt.Vec3fArray(12 * POINTS), 1001)

    over.edit_stage("hair.shot.usda", change)


def frame_missing(over: OverCache) -> None:
    over.frame(MIDDLE).unlink()


def attribute_missing(over: OverCache) -> None:
    over.edit(
        over.frame(MIDDLE),
        lambda layer: layer.GetPrimAtPath("/over/curves0").RemoveProperty(
            layer.GetAttributeAtPath("/over/curves0.velocities")
        ),
    )


def points_missing(over: OverCache) -> None:
    over.edit_array(MIDDLE, "points", lambda points: points[:-1])


def not_finite(over: OverCache) -> None:
    over.edit_array(
        MIDDLE, "velocities", lambda rates: np.where(np.arange(len(rates))[:, None] == 5, np.nan, rates)
    )


def extent_too_small(over: OverCache) -> None:
    over.edit_array(MIDDLE, "extent", lambda box: box + [[0.005], [0]])


def moved(change: Callable[[np.ndarray], None]) -> Defect:
    """Moves points of a frame, and the extent with them."""

    def inject(over: OverCache) -> None:
        def curves(points: np.ndarray) -> np.ndarray:
            each = points.reshape(-1, POINTS, 3).copy()
            change(each)
            return each.reshape(-1, 3)

        over.edit_array(MIDDLE, "points", curves)
        over.edit_array(MIDDLE, "extent", lambda box: box + [[-60], [60]])

    return inject


def one_root(each: np.ndarray) -> None:
    each[3, 0] += 0.01


def most_tips(each: np.ndarray) -> None:
    each[:, 4:] += np.linspace(0, 3, POINTS - 4)[:, None]


def one_tip(each: np.ndarray) -> None:
    each[3, -1] += 0.5


def velocities_per_frame(over: OverCache) -> None:
    over.edit_array(MIDDLE, "velocities", lambda rates: rates / 24)


DEFECTS: list[tuple[str, Defect]] = [
    ("over_stage", stage_missing),
    ("over_stage", record_without_curves),
    ("over_stage", unit_of_another_layer),
    ("over_stage", rate_of_another_layer),
    ("over_stage", houdini_deforms_as_well),
    *(
        ("over_untouched", on_curves(change))
        for change in (
            widths_changed,
            material_changed,
            purpose_changed,
            id_changed,
            subset_changed,
            primvar_added,
            prim_added,
            hidden,
            schema_added,
        )
    ),
    ("over_clips", on_curves(clips_too_short)),
    ("over_clips", samples_over_clips),
    ("over_clips", bound_again),
    ("over_frames", frame_missing),
    ("over_frames", attribute_missing),
    ("over_frames", points_missing),
    ("over_frames", not_finite),
    ("over_extent", extent_too_small),
    ("over_velocities", velocities_per_frame),
]


@pytest.mark.parametrize(("check", "inject"), DEFECTS)
def test_defect_fails_its_own_check(over: OverCache, check: str, inject: Defect) -> None:
    inject(over)
    report = validate(over.cache.directory)
    assert failed(report) == {check}, report.as_text()


@pytest.mark.parametrize(
    ("checks", "change"),
    [
        ({"over_roots", "over_rest"}, one_root),
        ({"over_shape", "over_rest"}, most_tips),
        ({"over_rest"}, one_tip),
    ],
)
def test_points_that_are_off_are_found(
    over: OverCache, checks: set[str], change: Callable[[np.ndarray], None]
) -> None:
    moved(change)(over)
    report = validate(over.cache.directory)
    assert failed(report) == checks, report.as_text()


BEARD_PATH = "/world/hero/groom/beard"


@pytest.mark.parametrize("of_strands", [1.0, 0.5])
@pytest.mark.parametrize("of_beard", [1.0, 0.5])
def test_velocities_are_compared_with_those_of_the_strands_that_a_prim_draws(
    good_cache: CacheBuilder, of_strands: float, of_beard: float
) -> None:
    """Velocities of a beard, a third of the strands, may be wrong in the cache, and in the overs.

    As the median over all strands is right, the overs are right only if theirs are, or if those of the beard
    in the cache are as wrong.
    """
    hair = CURVES - CURVES // 3

    def slow(rates: np.ndarray) -> np.ndarray:
        factor = np.where(np.arange(len(rates)) < hair * POINTS, 1, of_strands)
        return (rates * factor[:, None]).astype(np.float32)

    parts = {CURVES_PATH: range(hair), BEARD_PATH: range(hair, CURVES)}
    over = OverCache(good_cache, parts)
    for frame in HANDLES:
        good_cache.edit_array(frame, f"{HAIR}.velocities", slow)
        scale_world_rates(over, frame, 1, of_beard)
    over.seal()
    found = validate(good_cache.directory).outcomes["over_velocities"]
    assert (found.status == "fail") == (of_beard < of_strands), found
    assert not found.broken or {each.prim for each in found.broken} == {BEARD_PATH}


def scale_world_rates(over: OverCache, frame: int, prim: int, factor: float) -> None:
    """Multiplies the velocities that a prim has in the world; those in it are less the motion of the prim."""
    layer = Sdf.Layer.OpenAsAnonymous(str(over.frame(frame)))
    points = np.array(layer.QueryTimeSample(f"/over/curves{prim}.points", float(frame)), float)
    time, step = (frame - FIRST) / FPS, 1e-4
    before, after = (
        transform(points, place(time + shift) @ TO_METRES @ np.linalg.inv(place(time) @ TO_METRES))
        for shift in (-step, step)
    )
    of_prim = (after - before) / (2 * step)
    over.edit_array(frame, "velocities", lambda rates: factor * (rates + of_prim) - of_prim, prim)


@pytest.mark.parametrize("factor", [1.0, 0.3, -1.0])
def test_a_swing_that_frames_sample_coarsely_passes_with_true_velocities(
    over: OverCache, factor: float
) -> None:
    """The curves swing by 3 cm eight times a second beside the strands, which do not."""
    omega = 2 * np.pi * 8
    for frame in HANDLES:
        phase = omega * (frame - FIRST) / FPS
        swing, rate = 3 * np.sin(phase), 3 * omega * np.cos(phase)
        over.edit_array(frame, "points", partial(np.add, [0, 0, swing]))
        over.edit_array(frame, "velocities", partial(np.add, [0, 0, factor * rate]))
    assert ("over_velocities" in failed(validate(over.cache.directory))) == (factor < 1)


def test_the_unit_is_that_of_the_manifest(over: OverCache) -> None:
    over.cache.edit_record(lambda record: record["over"].update(metres_per_unit=0.1))
    assert {"over_roots", "over_shape", "over_rest"} <= failed(validate(over.cache.directory))


def test_the_rest_of_lengthened_curves_is_not_compared(over: OverCache) -> None:
    over.cache.edit_record(lambda record: record["over"]["prims"][0].update(lengthened=True))
    off_root = validate(over.cache.directory)
    assert off_root.passed and off_root.outcomes["over_rest"].status == "skip", off_root.as_text()


def test_an_unbound_skeleton_passes(over: OverCache) -> None:
    bound_again(over)

    def unbind(prim: Usd.Prim) -> None:
        prim.AddAppliedSchema("SkelBindingAPI")
        prim.CreateRelationship("skel:skeleton", False).SetTargets([])

    on_curves(unbind)(over)
    report = validate(over.cache.directory)
    assert not failed(report), report.as_text()


def test_a_run_of_other_frames_finds_missing_files(over: OverCache) -> None:
    over.frame(MIDDLE).unlink()
    report = validate(over.cache.directory, frames=[FIRST])
    assert failed(report) == {"over_frames"}, report.as_text()


def test_a_stage_that_is_placed_elsewhere_is_found(over: OverCache) -> None:
    stage = Usd.Stage.Open(str(over.stage))
    UsdGeom.Xformable(stage.GetPrimAtPath("/world")).AddTranslateOp().Set((1, 0, 0))
    stage.Save()
    report = validate(over.cache.directory)
    assert {"over_roots", "over_rest"} <= failed(report), report.as_text()


def test_every_check_has_a_defect() -> None:
    proved = {check for check, _ in DEFECTS} | {"over_roots", "over_shape", "over_rest"}
    assert proved == {check.id for check in (*OVER, *OVER_FRAME)}
