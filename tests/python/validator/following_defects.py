"""Faults in what strands say that they follow, with the checks that must catch them."""

from pxr import UsdGeom

from validator.good_cache import CURVES, CacheBuilder


def set_primvar(cache: CacheBuilder, name: str, values: list) -> None:
    def change(stage):
        UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/groom/hair")).GetPrimvar(name).Set(values)

    cache.edit_topology(change)


def weight_missing(cache):
    set_primvar(cache, "groom_guide_weights", [1.0] * CURVES)


def weights_of_more_than_one(cache):
    set_primvar(cache, "groom_guide_weights", [0.5, 0.5, 0.5] * CURVES)


def guide_that_is_not_there(cache):
    set_primvar(cache, "groom_closest_guides", [999, 0, 0] * CURVES)


FOLLOWING_DEFECTS = [
    (["primvars"], weight_missing),
    (["following"], weights_of_more_than_one),
    (["following"], guide_that_is_not_there),
]
