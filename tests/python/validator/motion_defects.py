"""Defects of the motion: velocities and jumps."""

from collections.abc import Callable

import numpy as np
from pxr import Sdf

from hairbake_validate.geometry import Array, FloatArray
from validator.defects import MIDDLE, defect, move_points, turned
from validator.good_cache import CURVES, FPS, HAIR, POINTS, SHUTTER, CacheBuilder


def replace_by(value: Array) -> Callable[[Array], Array]:
    return lambda _: value


def scale_velocities(cache: CacheBuilder, factor: float | Array) -> None:
    for frame in range(1000, 1008):
        cache.edit_array(frame, f"{HAIR}.velocities", lambda velocities: velocities * np.float32(factor))


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_per_frame(cache: CacheBuilder) -> None:
    scale_velocities(cache, 1 / FPS)


@defect("velocities", "curve_velocities", "sub_frames")
def reversed_velocities(cache: CacheBuilder) -> None:
    scale_velocities(cache, -1)


@defect("velocities", "curve_velocities", "sub_frames", "velocity_peaks")
def velocities_in_centimetres(cache: CacheBuilder) -> None:
    scale_velocities(cache, 100)


@defect("velocities", "curve_velocities", "sub_frames")
def velocities_of_the_neighbouring_frame(cache: CacheBuilder) -> None:
    def velocities(frame: int) -> Array:
        layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(frame)))
        return np.array(layer.QueryTimeSample(f"{HAIR}.velocities", float(frame)))

    for frame, value in [(frame, velocities(frame - 1)) for frame in range(1001, 1008)]:
        cache.edit_array(frame, f"{HAIR}.velocities", replace_by(value))


@defect("curve_velocities")
def reversed_velocities_of_one_curve_in_twelve(cache: CacheBuilder) -> None:
    scale_velocities(cache, np.repeat(np.where(np.arange(CURVES) == 7, -1, 1), POINTS)[:, None])


@defect("sub_frames")
def reversed_velocities_of_one_sample(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{HAIR}.velocities", lambda velocities: -velocities, after=SHUTTER)


def swing_one_curve(curves: FloatArray) -> FloatArray:
    curves[7] = turned(curves[7], np.array([0, 1.0, 0]), 0.6)
    return curves


@defect("velocity_peaks", "curve_velocities")
def streak_of_one_point(cache: CacheBuilder) -> None:
    def streak(velocities: Array) -> Array:
        velocities[7 * POINTS + 5] = [0, 9.0, 0]
        return velocities

    cache.edit_array(MIDDLE, f"{HAIR}.velocities", streak)


@defect("pops", "spikes", "curve_velocities")
def one_frame_pop(cache: CacheBuilder) -> None:
    def bend_one_tip(curves: FloatArray) -> FloatArray:
        curves[7, -3:] = turned(curves[7, -3:], np.array([0, 1.0, 0]), 1.0)
        return curves

    move_points(cache, MIDDLE, HAIR, bend_one_tip)


@defect("pops", "spikes")
def one_frame_jump_with_central_differences_as_velocities(cache: CacheBuilder) -> None:
    """Jumps for a frame; the velocities at the frames around are those of the jump."""
    jump = np.zeros((CURVES * POINTS, 3), np.float32)

    def swing(curves: FloatArray) -> FloatArray:
        swung = swing_one_curve(curves.copy())
        jump[:] = (swung - curves).reshape(-1, 3)
        return swung

    move_points(cache, MIDDLE, HAIR, swing)
    change = jump * np.float32(FPS / 2)
    cache.edit_array(MIDDLE - 1, f"{HAIR}.velocities", lambda velocities: velocities + change)
    cache.edit_array(MIDDLE + 1, f"{HAIR}.velocities", lambda velocities: velocities - change)


@defect("spikes", "curve_velocities", "pops")
def one_frame_jump(cache: CacheBuilder) -> None:
    move_points(cache, MIDDLE, HAIR, swing_one_curve)


@defect("spikes")
def jump_that_stays(cache: CacheBuilder) -> None:
    for frame in range(MIDDLE, 1008):
        move_points(cache, frame, HAIR, swing_one_curve)
