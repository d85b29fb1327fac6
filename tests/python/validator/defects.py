"""Defects that the validator must catch, each a change to a good cache, with the checks that must fail."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from validator.following_defects import FOLLOWING_DEFECTS
from validator.good_cache import CURVES, FPS, GUIDE_COUNT, POINTS, CacheBuilder, head_matrix
from validator.material_defects import MATERIAL_DEFECTS
from validator.settings_defects import SETTINGS_DEFECTS

DEFECTS = [
    pytest.param(checks, inject, id=f"{checks[0]}-{inject.__name__}")
    for checks, inject in SETTINGS_DEFECTS + MATERIAL_DEFECTS + FOLLOWING_DEFECTS
]
MIDDLE = 1003
HAIR, GUIDES, SKULL = "/groom/hair", "/groom/guides", "/groom/colliders/skull"


def defect(check: str, *others: str):
    """Registers an injected fault under the check that must catch it, with others that cannot but see it too."""

    def register(inject):
        DEFECTS.append(pytest.param([check, *others], inject, id=f"{check}-{inject.__name__}"))
        return inject

    return register


def set_extent(cache: CacheBuilder, frame: int, path: str) -> None:
    """Makes the extent fit the points again after a test has moved them."""
    layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(frame)))
    points = np.array(layer.QueryTimeSample(f"{path}.points", float(frame)))
    cache.edit_array(
        frame, f"{path}.extent", lambda _: np.stack([points.min(0) - 4e-5, points.max(0) + 4e-5])
    )


def move_points(cache: CacheBuilder, frame: int, path: str, change) -> None:
    """Changes points, given and returned as `curves × POINTS × 3`, and keeps the extent right."""

    def reshaped(points):
        return change(points.reshape(-1, POINTS, 3).astype(float)).reshape(-1, 3).astype(np.float32)

    cache.edit_array(frame, f"{path}.points", reshaped)
    set_extent(cache, frame, path)


def turned(curve: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """A curve turned about its root: lengths and root stay."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return curve[0] + (curve - curve[0]) @ rotation.T


# Files


@defect("record")
def wrong_version(cache):
    cache.record(lambda record: record.update(version=2))


@defect("record", "frames")
def no_settings(cache):
    cache.record(lambda record: record.pop("settings"))


@defect("record")
def input_without_hash(cache):
    cache.record(lambda record: record["inputs"][0].pop("sha256"))


@defect("record")
def frame_without_entry(cache):
    cache.record(lambda record: record["frames"].pop(2))


@defect("record")
def frame_with_two_entries(cache):
    cache.record(lambda record: record["frames"].append(record["frames"][0]))


@defect("figures")
def no_figures(cache):
    cache.record(lambda record: record["frames"][2].update(figures={}))


@defect("figures")
def infinite_figure(cache):
    cache.record(lambda record: record["frames"][2].update(figures={"depth": float("inf")}))


@defect("checksums")
def flipped_bit(cache):
    layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(MIDDLE)))
    points = np.array(layer.QueryTimeSample(f"{HAIR}.points", float(MIDDLE)))
    data = bytearray(cache.frame(MIDDLE).read_bytes())
    data[data.index(points.tobytes()[:48])] ^= 1
    cache.frame(MIDDLE).write_bytes(bytes(data))


@defect("checksums")
def static_layer_changed(cache):
    with cache.path("hair.usda").open("a") as file:
        file.write("\n")


@defect("checksums")
def layer_without_checksum(cache):
    cache.record(lambda record: record["layers"].pop())


@defect("temporaries")
def temporary_left(cache):
    cache.path(".aB3xY.tmp").write_bytes(b"")


@defect("temporaries")
def frame_of_a_longer_bake(cache):
    cache.path("hair.1020.usdc").write_bytes(cache.frame(MIDDLE).read_bytes())


# Stage


@defect("framework")
def sublayer_missing(cache):
    cache.edit("hair.usda", lambda layer: layer.subLayerPaths.append("./nothing.usdc"))


@defect("framework")
def gprim_below_a_gprim(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.Sphere.Define(stage, f"{SKULL}/eye").CreateExtentAttr([(-1, -1, -1), (1, 1, 1)])
    )


@defect("metadata")
def no_default_prim(cache):
    cache.edit("hair.usda", lambda layer: layer.ClearDefaultPrim())


@defect("metadata")
def units_left_to_fallback(cache):
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.ClearInfo("metersPerUnit"))
    cache.edit("hair.topology.usdc", lambda layer: layer.pseudoRoot.ClearInfo("metersPerUnit"))


@defect("metadata")
def no_up_axis(cache):
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.ClearInfo("upAxis"))


@defect("metadata")
def frame_rates_differ(cache):
    cache.edit("hair.usda", lambda layer: setattr(layer, "framesPerSecond", 30.0))


@defect("scale")
def wrong_units(cache):
    cache.edit("hair.usda", lambda layer: layer.pseudoRoot.SetInfo("metersPerUnit", 0.01))


@defect("prims")
def no_kind(cache):
    cache.edit_topology(lambda stage: Usd.ModelAPI(stage.GetPrimAtPath("/groom")).SetKind(""))


@defect("prims")
def guides_would_render(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.Imageable(stage.GetPrimAtPath(GUIDES)).GetPurposeAttr().Set("default")
    )


@defect("prims")
def collider_would_render(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.Imageable(stage.GetPrimAtPath(SKULL)).GetPurposeAttr().Set("default")
    )


@defect("prims")
def linear_curves(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR)).GetTypeAttr().Set("linear")
    )


@defect("prims")
def transform_above_world_points(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.Xformable(stage.GetPrimAtPath(HAIR)).AddTranslateOp().Set(Gf.Vec3d(0, 1, 0))
    )


@defect("topology")
def counts_off_by_one(cache):
    counts = [POINTS] * (CURVES - 1) + [POINTS - 1]

    def change(stage):
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR))
        curves.GetCurveVertexCountsAttr().Set(counts)
        curves.GetWidthsAttr().Set([8e-5] * sum(counts))

    cache.edit_topology(change)


@defect("topology")
def index_without_point(cache):
    def change(stage):
        attribute = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL)).GetFaceVertexIndicesAttr()
        attribute.Set([9999, *list(attribute.Get())[1:]])

    cache.edit_topology(change)


def set_primvar(cache: CacheBuilder, name: str, change) -> None:
    cache.edit_topology(lambda stage: change(UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(HAIR)).GetPrimvar(name)))


@defect("primvars")
def short_primvar(cache):
    set_primvar(cache, "groom_group_id", lambda primvar: primvar.Set([0] * (CURVES - 1)))


@defect("primvars")
def primvar_of_wrong_interpolation(cache):
    set_primvar(cache, "groom_root_uv", lambda primvar: primvar.SetInterpolation("vertex"))


@defect("primvars")
def primvar_missing(cache):
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(HAIR).RemoveProperty("primvars:groom_guide"))


@defect("primvars")
def varying_widths(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR)).SetWidthsInterpolation("varying")
    )


@defect("primvars")
def short_widths(cache):
    cache.edit_topology(
        lambda stage: UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR)).GetWidthsAttr().Set([8e-5] * CURVES)
    )


@defect("ids")
def duplicate_id(cache):
    set_primvar(cache, "groom_id", lambda primvar: primvar.Set([0, *range(CURVES - 1)]))


@defect("clips")
def clips_without_handle(cache):
    cache.edit("hair.usda", lambda layer: edit_clips(layer, "templateEndTime", 1006.0))


@defect("clips")
def clip_manifest_missing(cache):
    cache.edit(
        "hair.usda", lambda layer: edit_clips(layer, "manifestAssetPath", Sdf.AssetPath("./none.usda"))
    )


@defect("clips")
def wrong_template(cache):
    cache.edit("hair.usda", lambda layer: edit_clips(layer, "templateAssetPath", "hair.####.usdc"))


def edit_clips(layer: Sdf.Layer, key: str, value) -> None:
    clips = dict(layer.GetPrimAtPath("/groom").GetInfo("clips"))
    clips["default"] = {**clips["default"], key: value}
    layer.GetPrimAtPath("/groom").SetInfo("clips", clips)


@defect("resolution")
def stronger_opinion_hides_the_clips(cache):
    def change(layer):
        prim = Sdf.CreatePrimInLayer(layer, GUIDES)
        Sdf.AttributeSpec(prim, "points", Sdf.ValueTypeNames.Point3fArray)
        layer.GetAttributeAtPath(f"{GUIDES}.points").default = Vt.Vec3fArray(GUIDE_COUNT * POINTS)

    cache.edit("hair.usda", change)


# Frames


@defect("frames")
def missing_frame(cache):
    cache.frame(MIDDLE).unlink()
    cache.seal()


@defect("frames")
def no_handle_frame(cache):
    cache.frame(1007).unlink()
    cache.seal()


@defect("frames")
def truncated_file(cache):
    data = cache.frame(MIDDLE).read_bytes()
    cache.frame(MIDDLE).write_bytes(data[: len(data) // 2])
    cache.seal()


@defect("frames")
def wrong_time(cache):
    def change(layer):
        value = layer.QueryTimeSample(f"{HAIR}.velocities", float(MIDDLE))
        layer.EraseTimeSample(f"{HAIR}.velocities", float(MIDDLE))
        layer.SetTimeSample(f"{HAIR}.velocities", MIDDLE + 0.5, value)

    cache.edit(cache.frame(MIDDLE).name, change)


@defect("frames")
def second_time(cache):
    def change(layer):
        value = layer.QueryTimeSample(f"{HAIR}.points", float(MIDDLE))
        layer.SetTimeSample(f"{HAIR}.points", MIDDLE + 1.0, value)

    cache.edit(cache.frame(MIDDLE).name, change)


@defect("coverage")
def attribute_missing_from_the_manifest(cache):
    def change(layer):
        prim = layer.GetPrimAtPath(HAIR)
        del prim.properties["velocities"]

    cache.edit("hair.manifest.usda", change)


@defect("sizes")
def one_point_short(cache):
    cache.edit_array(MIDDLE, f"{HAIR}.points", lambda points: points[:-1])


@defect("sizes")
def no_velocities(cache):
    cache.edit_array(MIDDLE, f"{GUIDES}.velocities", lambda velocities: velocities[:0])


@defect("finite")
def nan_point(cache):
    def change(points):
        points[17, 1] = np.nan
        return points

    cache.edit_array(MIDDLE, f"{HAIR}.points", change)


@defect("finite")
def infinite_velocity(cache):
    def change(velocities):
        velocities[3, 0] = np.inf
        return velocities

    cache.edit_array(MIDDLE, f"{GUIDES}.velocities", change)


@defect("rigid")
def scaled_collider(cache):
    matrix = head_matrix((MIDDLE - 1001) / FPS)
    matrix[:3, :3] *= 1.00001
    cache.edit(
        cache.frame(MIDDLE).name,
        lambda layer: layer.SetTimeSample(
            f"{SKULL}.xformOp:transform", float(MIDDLE), Gf.Matrix4d(*matrix.ravel().tolist())
        ),
    )


@defect("extent")
def shrunken_extent(cache):
    cache.edit_array(MIDDLE, f"{HAIR}.extent", lambda box: box * 0.99 + box.mean(0, keepdims=True) * 0.01)


@defect("extent")
def extent_without_widths(cache):
    cache.edit_array(MIDDLE, f"{HAIR}.extent", lambda box: box + np.array([[4e-5], [-4e-5]], np.float32))


@defect("roots")
def moved_root(cache):
    def change(curves):
        curves[5] += [0, 2e-5, 0]
        return curves

    move_points(cache, MIDDLE, HAIR, change)


@defect("roots")
def moved_guide(cache):
    def change(curves):
        curves[1] += [0, 2e-5, 0]
        return curves

    move_points(cache, MIDDLE, GUIDES, change)


@defect("segments")
def stretched_segment(cache):
    def change(curves):
        curves[4, 4:] += 5e-4 * (curves[4, 4] - curves[4, 3])
        return curves

    move_points(cache, MIDDLE, HAIR, change)


@defect("guide_segments")
def shifted_point_of_a_guide(cache):
    def change(curves):
        curves[1, 4] += 0.01 * (curves[1, 5] - curves[1, 4])
        return curves

    move_points(cache, MIDDLE, GUIDES, change)


@defect("guide_length")
def stretched_guide(cache):
    def change(curves):
        curves[1] = curves[1, 0] + 1.0009 * (curves[1] - curves[1, 0])
        return curves

    move_points(cache, MIDDLE, GUIDES, change)


def push_in(cache: CacheBuilder, path: str) -> None:
    """Turns a curve about its root into the collider, in all frames but the first, from which on points are
    judged; gently, so that it is no jump.
    """
    for frame in range(1001, 1008):
        share = (frame - 1000) / 7

        def change(curves, share=share):
            curve = curves[0].copy()
            axis = np.cross(curve[1] - curve[0], curve[-1] - curve[-2])
            curves[0] = turned(curve, axis, np.pi * (1 - np.cos(np.pi * share)) / 2)
            return curves

        move_points(cache, frame, path, change)


@defect("hair_penetration", "curve_velocities")
def strand_pushed_into_the_collider(cache):
    push_in(cache, HAIR)


@defect("guide_penetration", "curve_velocities")
def guide_pushed_into_the_collider(cache):
    push_in(cache, GUIDES)


# Motion


def scale_velocities(cache: CacheBuilder, factor: float | np.ndarray) -> None:
    for frame in range(1000, 1008):
        cache.edit_array(frame, f"{HAIR}.velocities", lambda velocities: velocities * np.float32(factor))


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_per_frame(cache):
    scale_velocities(cache, 1 / FPS)


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_backwards(cache):
    scale_velocities(cache, -1)


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_in_centimetres(cache):
    scale_velocities(cache, 100)


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_of_the_neighbouring_frame(cache):
    def velocities(frame):
        layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(frame)))
        return np.array(layer.QueryTimeSample(f"{HAIR}.velocities", float(frame)))

    for frame, value in [(frame, velocities(frame - 1)) for frame in range(1001, 1008)]:
        cache.edit_array(frame, f"{HAIR}.velocities", lambda _, value=value: value)


@defect("curve_velocities")
def velocities_of_one_curve_in_twelve_backwards(cache):
    scale_velocities(cache, np.repeat(np.where(np.arange(CURVES) == 7, -1, 1), POINTS)[:, None])


def swung(curves):
    curves[7] = turned(curves[7], np.array([0, 1.0, 0]), 0.6)
    return curves


@defect("spikes", "curve_velocities")
def one_frame_pop(cache):
    move_points(cache, MIDDLE, HAIR, swung)


@defect("spikes")
def jump_that_stays(cache):
    for frame in range(MIDDLE, 1008):
        move_points(cache, frame, HAIR, swung)


def broken(report) -> set[str]:
    return {check for check, outcome in report.outcomes.items() if outcome.status != "pass"}
