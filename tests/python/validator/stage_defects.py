"""Defects of the stage: metadata, prims, material, topology, primvars and value clips."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from hairbake_validate.geometry import FloatArray
from validator.defects import defect
from validator.good_cache import CURVES, GUIDE_COUNT, GUIDES, HAIR, MATERIAL, POINTS, SKULL, CacheBuilder


@defect("framework")
def sublayer_missing(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: layer.subLayerPaths.append("./nothing.usdc"))


@defect("framework")
def gprim_below_a_gprim(cache: CacheBuilder) -> None:
    def change(stage: Usd.Stage) -> None:
        UsdGeom.Sphere.Define(stage, f"{SKULL}/eye").CreateExtentAttr([(-1, -1, -1), (1, 1, 1)])

    cache.edit_topology(change)


@defect("metadata")
def no_default_prim(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: layer.ClearDefaultPrim())


@defect("metadata")
def unit_not_authored(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.ClearInfo("metersPerUnit"))
    cache.edit("hair.topology.usdc", lambda layer: layer.pseudoRoot.ClearInfo("metersPerUnit"))


@defect("metadata")
def no_up_axis(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.ClearInfo("upAxis"))


@defect("metadata")
def frame_rates_differ(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: setattr(layer, "framesPerSecond", 30.0))


@defect("scale")
def wrong_unit(cache: CacheBuilder) -> None:
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.SetInfo("metersPerUnit", 0.01))


@defect("prims")
def no_kind(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: Usd.ModelAPI(stage.GetPrimAtPath("/groom")).SetKind(""))


def set_default_purpose(cache: CacheBuilder, path: str) -> None:
    def change(stage: Usd.Stage) -> None:
        UsdGeom.Imageable(stage.GetPrimAtPath(path)).GetPurposeAttr().Set("default")

    cache.edit_topology(change)


@defect("prims")
def guides_render(cache: CacheBuilder) -> None:
    set_default_purpose(cache, GUIDES)


@defect("prims")
def collider_renders(cache: CacheBuilder) -> None:
    set_default_purpose(cache, SKULL)


def edit_hair(cache: CacheBuilder, change: Callable[[UsdGeom.BasisCurves], Any]) -> None:
    cache.edit_topology(lambda stage: change(UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR))))


@defect("prims")
def linear_curves(cache: CacheBuilder) -> None:
    edit_hair(cache, lambda curves: curves.GetTypeAttr().Set("linear"))


@defect("prims")
def transform_on_world_space_points(cache: CacheBuilder) -> None:
    edit_hair(cache, lambda curves: curves.AddTranslateOp().Set(Gf.Vec3d(0, 1, 0)))


@defect("prims", "resolution")
def guides_missing(cache: CacheBuilder) -> None:
    def change(layer: Sdf.Layer) -> None:
        del layer.GetPrimAtPath("/groom").nameChildren["guides"]

    cache.edit("hair.topology.usdc", change)


@defect("material")
def no_binding(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(HAIR).RemoveProperty("material:binding"))


@defect("material", "framework")
def binding_without_its_schema(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(GUIDES).RemoveAPI(UsdShade.MaterialBindingAPI))


@defect("material", "framework")
def binding_to_a_missing_material(cache: CacheBuilder) -> None:
    def change(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(GUIDES).GetRelationship("material:binding").SetTargets(["/groom/materials/skin"])

    cache.edit_topology(change)


@defect("material")
def material_outside_the_groom(cache: CacheBuilder) -> None:
    def change(stage: Usd.Stage) -> None:
        other = UsdShade.Material.Define(stage, "/lookdev/hair")
        surface = UsdShade.Shader.Get(stage, f"{MATERIAL}/surface")
        other.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(HAIR)).Bind(other)

    cache.edit_topology(change)


@defect("material")
def material_without_a_surface(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(MATERIAL).RemoveProperty("outputs:surface"))


@defect("topology")
def count_off_by_one(cache: CacheBuilder) -> None:
    counts = [POINTS] * (CURVES - 1) + [POINTS - 1]

    def change(curves: UsdGeom.BasisCurves) -> None:
        curves.GetCurveVertexCountsAttr().Set(counts)
        curves.GetWidthsAttr().Set([8e-5] * sum(counts))

    edit_hair(cache, change)


@defect("topology")
def index_without_point(cache: CacheBuilder) -> None:
    def change(stage: Usd.Stage) -> None:
        attribute = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL)).GetFaceVertexIndicesAttr()
        attribute.Set([9999, *list(attribute.Get())[1:]])

    cache.edit_topology(change)


def edit_primvar(cache: CacheBuilder, name: str, change: Callable[[UsdGeom.Primvar], Any]) -> None:
    edit_hair(cache, lambda curves: change(UsdGeom.PrimvarsAPI(curves).GetPrimvar(name)))


def edit_arcs(cache: CacheBuilder, change: Callable[[FloatArray], FloatArray]) -> None:
    """Changes the arc lengths of the guides, `GUIDE_COUNT × POINTS`."""

    def edit(stage: Usd.Stage) -> None:
        primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(GUIDES)).GetPrimvar("groom_arc")
        arcs = change(np.array(primvar.Get()).reshape(-1, POINTS))
        primvar.Set(Vt.FloatArray.FromNumpy(arcs.ravel().astype(np.float32)))

    cache.edit_topology(edit)


@defect("arcs")
def arc_lengths_from_the_second_point(cache: CacheBuilder) -> None:
    edit_arcs(cache, lambda arcs: arcs - arcs[:, 1:2])


@defect("arcs")
def arc_lengths_in_another_unit(cache: CacheBuilder) -> None:
    edit_arcs(cache, lambda arcs: 100 * arcs)


@defect("arcs", "guide_segments")
def segment_shorter_than_its_chord(cache: CacheBuilder) -> None:
    def change(arcs: FloatArray) -> FloatArray:
        arcs[1, 4] -= 0.005 * (arcs[1, 4] - arcs[1, 3])
        return arcs

    edit_arcs(cache, change)


@defect("primvars")
def guides_without_arc_lengths(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(GUIDES).RemoveProperty("primvars:groom_arc"))


@defect("primvars")
def short_primvar(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_group_id", lambda primvar: primvar.Set([0] * (CURVES - 1)))


@defect("primvars")
def primvar_of_wrong_interpolation(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_root_uv", lambda primvar: primvar.SetInterpolation("vertex"))


@defect("primvars")
def primvar_missing(cache: CacheBuilder) -> None:
    edit_hair(cache, lambda curves: curves.GetPrim().RemoveProperty("primvars:groom_guide"))


@defect("primvars")
def varying_widths(cache: CacheBuilder) -> None:
    edit_hair(cache, lambda curves: curves.SetWidthsInterpolation("varying"))


@defect("primvars")
def short_widths(cache: CacheBuilder) -> None:
    edit_hair(cache, lambda curves: curves.GetWidthsAttr().Set([8e-5] * CURVES))


@defect("primvars")
def weight_missing(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_guide_weights", lambda primvar: primvar.Set([1.0] * CURVES))


@defect("following")
def weights_sum_to_more_than_one(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_guide_weights", lambda primvar: primvar.Set([0.5, 0.5, 0.5] * CURVES))


@defect("following")
def negative_weight(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_guide_weights", lambda primvar: primvar.Set([1.5, -0.5, 0.0] * CURVES))


@defect("following")
def unknown_guide(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_closest_guides", lambda primvar: primvar.Set([999, 0, 0] * CURVES))


@defect("ids")
def duplicate_id(cache: CacheBuilder) -> None:
    edit_primvar(cache, "groom_id", lambda primvar: primvar.Set([0, *range(CURVES - 1)]))


def edit_clips(cache: CacheBuilder, key: str, value: Any) -> None:
    def change(layer: Sdf.Layer) -> None:
        clips = dict(layer.GetPrimAtPath("/groom").GetInfo("clips"))
        clips["default"] = {**clips["default"], key: value}
        layer.GetPrimAtPath("/groom").SetInfo("clips", clips)

    cache.edit("hair.usda", change)


@defect("clips")
def clips_without_handle(cache: CacheBuilder) -> None:
    edit_clips(cache, "templateEndTime", 1006.0)


@defect("clips")
def clip_manifest_missing(cache: CacheBuilder) -> None:
    edit_clips(cache, "manifestAssetPath", Sdf.AssetPath("./none.usda"))


@defect("clips")
def wrong_template(cache: CacheBuilder) -> None:
    edit_clips(cache, "templateAssetPath", "hair.####.usdc")


@defect("resolution")
def stronger_opinion_hides_the_clips(cache: CacheBuilder) -> None:
    def change(layer: Sdf.Layer) -> None:
        prim = Sdf.CreatePrimInLayer(layer, GUIDES)
        Sdf.AttributeSpec(prim, "points", Sdf.ValueTypeNames.Point3fArray)
        layer.GetAttributeAtPath(f"{GUIDES}.points").default = Vt.Vec3fArray(GUIDE_COUNT * POINTS)

    cache.edit("hair.usda", change)
