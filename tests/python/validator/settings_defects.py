"""Faults against what the settings of the bake promise, curves and moments of a frame, each with the checks that must catch it."""

import numpy as np

from validator.good_cache import POINTS, SHUTTER

FRAME, HAIR = 1003, "/groom/hair"


def guides_lost(cache):
    def drop(layer):
        del layer.GetPrimAtPath("/groom").nameChildren["guides"]

    cache.edit("hair.topology.usdc", drop)


def velocities_of_one_moment_backwards(cache):
    cache.edit_array(FRAME, f"{HAIR}.velocities", lambda velocities: -velocities, after=SHUTTER)


def root_off_the_head_at_one_moment(cache):
    def change(points):
        points[5 * POINTS] += [2e-5, 0, 0]
        return points

    cache.edit_array(FRAME, f"{HAIR}.points", change, after=SHUTTER / 2)


def moment_missing(cache):
    cache.edit(
        cache.frame(FRAME).name, lambda layer: layer.EraseTimeSample(f"{HAIR}.points", FRAME + SHUTTER)
    )


def moment_too_many(cache):
    def change(layer):
        layer.SetTimeSample(f"{HAIR}.points", FRAME + 0.9, layer.QueryTimeSample(f"{HAIR}.points", FRAME))

    cache.edit(cache.frame(FRAME).name, change)


def nan_point_at_one_moment(cache):
    cache.edit_array(FRAME, f"{HAIR}.points", lambda points: points * [[np.nan, 1, 1]], after=SHUTTER)


def point_short_at_one_moment(cache):
    cache.edit_array(FRAME, f"{HAIR}.points", lambda points: points[:-1], after=SHUTTER)


SETTINGS_DEFECTS = [
    (["prims", "resolution"], guides_lost),
    (["sub_frames"], velocities_of_one_moment_backwards),
    (["sub_frame_roots"], root_off_the_head_at_one_moment),
    (["frames"], moment_missing),
    (["frames"], moment_too_many),
    (["finite"], nan_point_at_one_moment),
    (["sizes"], point_short_at_one_moment),
]
