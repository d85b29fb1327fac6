"""The layer for Houdini: a good one passes, and each defect fails its own check and no other."""

from collections.abc import Callable

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from hairbake_validate.checks_deform import DEFORM
from hairbake_validate.run import validate
from validator.defects import failed
from validator.deform_cache import GUIDES_PATH, PREFIX, ROOT, SKIN_PATH, DeformCache
from validator.good_cache import CURVES, FIRST, POINTS, CacheBuilder
from validator.over_cache import CURVES_PATH, bind_curves, put_over

Defect = Callable[[DeformCache], object]
KINDS = Sdf.ValueTypeNames


@pytest.fixture
def deform(good_cache: CacheBuilder) -> DeformCache:
    return DeformCache(good_cache)


def test_a_good_layer_passes(deform: DeformCache) -> None:
    report = validate(deform.cache.directory)
    assert not failed(report), report.as_text()
    assert all(report.outcomes[check.id].status == "pass" for check in DEFORM), report.as_text()


def test_caches_without_the_layer_skip_its_checks(good_cache: CacheBuilder) -> None:
    report = validate(good_cache.directory)
    assert all(report.outcomes[check.id].status == "skip" for check in DEFORM), report.as_text()


@pytest.mark.parametrize("kind", ["over", "deform"])
def test_what_bakes_put_over_other_characters_passes(deform: DeformCache, kind: str) -> None:
    put_over(deform.stage, kind, "/world/another/hair")
    report = validate(deform.cache.directory)
    assert not failed(report), report.as_text()


def stage_missing(deform: DeformCache) -> None:
    deform.stage.unlink()


def record_without_skin(deform: DeformCache) -> None:
    deform.cache.edit_record(lambda record: record["deform"]["prims"][0].pop("skin"))


def motion_of_another_bake(deform: DeformCache) -> None:
    put_over(deform.stage, "over", CURVES_PATH)


def unit_of_another_layer(deform: DeformCache) -> None:
    deform.edit(lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.1))


def widths_changed(prim: Usd.Prim) -> None:
    prim.CreateAttribute("widths", KINDS.FloatArray).Set([0.02])


def moves(name: str) -> Callable[[Usd.Prim], object]:
    """The layer holds vectors, as layers do that move the curves."""
    kind = KINDS.Float3Array if name == "extent" else KINDS.Vector3fArray
    return lambda prim: prim.CreateAttribute(name, kind, False).Set([(0.0, 0.0, 1.0)])


def schema_of_others(prim: Usd.Prim) -> None:
    prim.AddAppliedSchema("CollectionAPI:hair")


def prim_added(prim: Usd.Prim) -> None:
    UsdGeom.Sphere.Define(prim.GetStage(), "/world/ball")


def schema_removed(prim: Usd.Prim) -> None:
    prim.RemoveAppliedSchema("HoudiniHairDeformAPI")


def another_method(prim: Usd.Prim) -> None:
    prim.GetAttribute(f"{PREFIX}deformmethod").Set("pointdeform")


def guides_of_another_type(prim: Usd.Prim) -> None:
    prim.GetRelationship(f"{PREFIX}deformerPrim").SetTargets([SKIN_PATH])


def no_skin(prim: Usd.Prim) -> None:
    prim.RemoveProperty(f"{PREFIX}skinPrim")


def edit_rest(path: str, change: Callable[[np.ndarray], np.ndarray]) -> Defect:
    def inject(deform: DeformCache) -> None:
        def edit(stage: Usd.Stage) -> None:
            rest = stage.GetPrimAtPath(path).GetAttribute("primvars:rest")
            changed = np.ascontiguousarray(change(np.array(rest.Get())), np.float32)
            rest.Set(Vt.Vec3fArray.FromNumpy(changed))

        deform.edit(edit)

    return inject


def one_moved(points: np.ndarray) -> np.ndarray:
    points[3] += 0.001
    return points


def animated(deform: DeformCache) -> None:
    def edit(stage: Usd.Stage) -> None:
        points = stage.GetPrimAtPath(CURVES_PATH).GetAttribute("points")
        moved = np.array(points.Get()) + np.float32(1)
        points.Set(Vt.Vec3fArray.FromNumpy(moved), FIRST)

    deform.on_stage(edit)


def bound_again(deform: DeformCache) -> None:
    """The stage has a skeleton, from which the layer does not unbind the curves."""
    bind_curves(deform.stage)


def placed_elsewhere(deform: DeformCache) -> None:
    """The curves are drawn a metre from where the groom was imported."""

    def edit(stage: Usd.Stage) -> None:
        points = stage.GetPrimAtPath(CURVES_PATH).GetAttribute("points")
        points.Set(Vt.Vec3fArray.FromNumpy((np.array(points.Get()) + [100, 0, 0]).astype(np.float32)))

    deform.on_stage(edit)


def edit_list(name: str, change: Callable[[list[float]], object]) -> Defect:
    def inject(deform: DeformCache) -> None:
        def edit(prim: Usd.Prim) -> None:
            attribute = prim.GetAttribute(f"primvars:{name}")
            values = list(attribute.Get())
            change(values)
            attribute.Set(values)

        deform.on_curves(edit)

    return inject


def replaced(value: float) -> Callable[[list[float]], None]:
    def change(values: list[float]) -> None:
        values[5] = value

    return change


def no_weights(prim: Usd.Prim) -> None:
    prim.RemoveProperty("primvars:weights")


def another_place(deform: DeformCache) -> None:
    def edit(stage: Usd.Stage) -> None:
        op = UsdGeom.Xformable(stage.GetPrimAtPath(ROOT)).GetOrderedXformOps()[0]
        op.Set(op.Get() * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, 0.01)))

    deform.edit(edit)


def on_curves(change: Callable[[Usd.Prim], object]) -> Defect:
    return lambda deform: deform.on_curves(change)


DEFECTS: list[tuple[str, Defect]] = [
    ("deform_stage", stage_missing),
    ("deform_stage", record_without_skin),
    ("deform_stage", unit_of_another_layer),
    ("deform_stage", motion_of_another_bake),
    *(("deform_untouched", on_curves(change)) for change in (widths_changed, schema_of_others, prim_added)),
    *(("deform_untouched", on_curves(moves(name))) for name in ("velocities", "extent", "normals")),
    *(
        ("deform_targets", on_curves(change))
        for change in (schema_removed, another_method, guides_of_another_type, no_skin)
    ),
    ("deform_targets", edit_rest(GUIDES_PATH, lambda rest: rest[:-1])),
    ("deform_targets", edit_rest(SKIN_PATH, lambda rest: rest[:0])),
    ("deform_rest", edit_rest(GUIDES_PATH, one_moved)),
    ("deform_rest", edit_rest(SKIN_PATH, one_moved)),
    ("deform_rest", animated),
    ("deform_rest", bound_again),
    ("deform_roots", placed_elsewhere),
    ("deform_weights", edit_list("guides", replaced(3))),
    ("deform_weights", edit_list("guides", replaced(-1))),
    ("deform_weights", edit_list("guides", lambda values: values.pop())),
    ("deform_weights", edit_list("weights", replaced(0.26))),
    ("deform_weights", edit_list("weights:lengths", replaced(3))),
    ("deform_weights", on_curves(no_weights)),
    ("deform_motion", another_place),
]


@pytest.mark.parametrize(("check", "inject"), DEFECTS)
def test_defect_fails_its_own_check(deform: DeformCache, check: str, inject: Defect) -> None:
    inject(deform)
    report = validate(deform.cache.directory)
    assert failed(report) == {check}, report.as_text()


def test_a_negative_weight_is_found_though_the_sum_is_one(deform: DeformCache) -> None:
    def swap(values: list[float]) -> None:
        values[4:6] = [1.25, -0.25]

    edit_list("weights", swap)(deform)
    assert failed(validate(deform.cache.directory)) == {"deform_weights"}


def test_points_that_the_layer_puts_back_to_rest_pass(deform: DeformCache) -> None:
    stage = Usd.Stage.Open(str(deform.stage))
    rest = stage.GetPrimAtPath(CURVES_PATH).GetAttribute("points").Get()
    assert len(rest) == CURVES * POINTS
    animated(deform)
    deform.on_curves(lambda prim: prim.CreateAttribute("points", KINDS.Point3fArray, False).Set(rest))
    report = validate(deform.cache.directory)
    assert not failed(report), report.as_text()


def test_curves_by_shape_need_a_radius_and_no_weights(deform: DeformCache) -> None:
    def by_shape(prim: Usd.Prim) -> None:
        prim.GetAttribute(f"{PREFIX}deformmethod").Set("guideshapeinterpolation")
        for name in ("guides", "guides:lengths", "weights", "weights:lengths"):
            prim.RemoveProperty(f"primvars:{name}")

    deform.on_curves(by_shape)
    record = {"method": "guideshapeinterpolation"}
    deform.cache.edit_record(lambda manifest: manifest["deform"]["prims"][0].update(record))
    assert failed(validate(deform.cache.directory)) == {"deform_targets"}
    deform.on_curves(
        lambda prim: prim.CreateAttribute(
            f"{PREFIX}gsisearchradius", KINDS.Float, False, Sdf.VariabilityUniform
        ).Set(5.0)
    )
    deform.cache.edit_record(lambda manifest: manifest["deform"]["prims"][0].update(record))
    report = validate(deform.cache.directory)
    assert not failed(report), report.as_text()
    assert report.outcomes["deform_weights"].status == "skip"


def test_every_check_has_a_defect() -> None:
    assert {check for check, _ in DEFECTS} == {check.id for check in DEFORM}
