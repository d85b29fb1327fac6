"""Defects of single frames: file, samples, sizes, values, extent, roots, lengths and penetration."""

import numpy as np
from pxr import Gf, Sdf

from hairbake_validate.geometry import Array, FloatArray
from validator.defects import MIDDLE, defect, move_points, turn_into_collider
from validator.good_cache import (
    FPS,
    GUIDES,
    HAIR,
    POINTS,
    SHUTTER,
    SKULL,
    CacheBuilder,
    head_matrix,
)


@defect("frames")
def missing_frame(cache: CacheBuilder) -> None:
    cache.frame(MIDDLE).unlink()
    cache.seal()


@defect("frames")
def missing_handle_frame(cache: CacheBuilder) -> None:
    cache.frame(1007).unlink()
    cache.seal()


@defect("frames")
def truncated_file(cache: CacheBuilder) -> None:
    data = cache.frame(MIDDLE).read_bytes()
    cache.frame(MIDDLE).write_bytes(data[: len(data) // 2])
    cache.seal()


@defect("frames")
def sample_at_wrong_time(cache: CacheBuilder) -> None:
    def change(layer: Sdf.Layer) -> None:
        value = layer.QueryTimeSample(f"{HAIR}.velocities", float(MIDDLE))
        layer.EraseTimeSample(f"{HAIR}.velocities", float(MIDDLE))
        layer.SetTimeSample(f"{HAIR}.velocities", MIDDLE + 0.5, value)

    cache.edit_frame(MIDDLE, change)


def copy_points_sample(cache: CacheBuilder, after: float) -> None:
    def change(layer: Sdf.Layer) -> None:
        value = layer.QueryTimeSample(f"{HAIR}.points", float(MIDDLE))
        layer.SetTimeSample(f"{HAIR}.points", MIDDLE + after, value)

    cache.edit_frame(MIDDLE, change)


@defect("frames")
def sample_of_the_next_frame(cache: CacheBuilder) -> None:
    copy_points_sample(cache, 1.0)


@defect("frames")
def extra_sample(cache: CacheBuilder) -> None:
    copy_points_sample(cache, 0.9)


@defect("frames")
def missing_sample(cache: CacheBuilder) -> None:
    cache.edit_frame(MIDDLE, lambda layer: layer.EraseTimeSample(f"{HAIR}.points", MIDDLE + SHUTTER))


@defect("coverage")
def attribute_missing_from_the_manifest(cache: CacheBuilder) -> None:
    def change(layer: Sdf.Layer) -> None:
        del layer.GetPrimAtPath(HAIR).properties["velocities"]

    cache.edit("hair.manifest.usda", change)


@defect("sizes")
def one_point_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{HAIR}.points", lambda points: points[:-1])


@defect("sizes")
def one_point_short_in_a_later_sample(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{HAIR}.points", lambda points: points[:-1], after=SHUTTER)


@defect("sizes")
def no_velocities(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{GUIDES}.velocities", lambda velocities: velocities[:0])


@defect("finite")
def nan_point(cache: CacheBuilder) -> None:
    def change(points: Array) -> Array:
        points[17, 1] = np.nan
        return points

    cache.edit_array(MIDDLE, f"{HAIR}.points", change)


@defect("finite")
def nan_points_in_a_later_sample(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{HAIR}.points", lambda points: points * [[np.nan, 1, 1]], after=SHUTTER)


@defect("finite")
def infinite_velocity(cache: CacheBuilder) -> None:
    def change(velocities: Array) -> Array:
        velocities[3, 0] = np.inf
        return velocities

    cache.edit_array(MIDDLE, f"{GUIDES}.velocities", change)


@defect("rigid")
def scaled_collider(cache: CacheBuilder) -> None:
    matrix = head_matrix((MIDDLE - 1001) / FPS)
    matrix[:3, :3] *= 1.00001
    value = Gf.Matrix4d(*matrix.ravel().tolist())
    path = f"{SKULL}.xformOp:transform"
    cache.edit_frame(MIDDLE, lambda layer: layer.SetTimeSample(path, float(MIDDLE), value))


@defect("extent")
def shrunken_extent(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{HAIR}.extent", lambda box: box * 0.99 + box.mean(0, keepdims=True) * 0.01)


@defect("extent")
def extent_without_widths(cache: CacheBuilder) -> None:
    inset = np.array([[4e-5], [-4e-5]], np.float32)
    cache.edit_array(MIDDLE, f"{HAIR}.extent", lambda box: box + inset)


def move_curve(cache: CacheBuilder, path: str, curve: int) -> None:
    def change(curves: FloatArray) -> FloatArray:
        curves[curve] += [0, 2e-5, 0]
        return curves

    move_points(cache, MIDDLE, path, change)


@defect("roots")
def moved_strand(cache: CacheBuilder) -> None:
    move_curve(cache, HAIR, 5)


@defect("roots")
def moved_guide(cache: CacheBuilder) -> None:
    move_curve(cache, GUIDES, 1)


@defect("segments")
def stretched_segment(cache: CacheBuilder) -> None:
    def change(curves: FloatArray) -> FloatArray:
        curves[4, 4:] += 5e-4 * (curves[4, 4] - curves[4, 3])
        return curves

    move_points(cache, MIDDLE, HAIR, change)


@defect("guide_segments")
def shifted_point_of_a_guide(cache: CacheBuilder) -> None:
    def change(curves: FloatArray) -> FloatArray:
        curves[1, 4] += 0.01 * (curves[1, 5] - curves[1, 4])
        return curves

    move_points(cache, MIDDLE, GUIDES, change)


@defect("guide_length")
def stretched_guide(cache: CacheBuilder) -> None:
    def change(curves: FloatArray) -> FloatArray:
        curves[1] = curves[1, 0] + 1.0009 * (curves[1] - curves[1, 0])
        return curves

    move_points(cache, MIDDLE, GUIDES, change)


@defect("hair_penetration", "curve_velocities")
def strand_turned_into_the_collider(cache: CacheBuilder) -> None:
    turn_into_collider(cache, HAIR)


@defect("guide_penetration", "curve_velocities")
def guide_turned_into_the_collider(cache: CacheBuilder) -> None:
    turn_into_collider(cache, GUIDES)


@defect("sub_frame_roots")
def root_off_the_head_in_a_later_sample(cache: CacheBuilder) -> None:
    def change(points: Array) -> Array:
        points[5 * POINTS] += [2e-5, 0, 0]
        return points

    cache.edit_array(MIDDLE, f"{HAIR}.points", change, after=SHUTTER / 2)
