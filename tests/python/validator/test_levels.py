"""Levels of wisps in the frames: good caches pass, and faults in the levels are caught."""

import pytest
from pxr import Sdf, UsdGeom, Vt

from hairbake_validate.cache import LEVEL
from hairbake_validate.run import validate
from validator.defects import GUIDES, MIDDLE, broken
from validator.good_cache import HANDLES, CacheBuilder


def tell_levels(cache: CacheBuilder) -> None:
    """Every frame tells the levels of the guides."""

    def topology(stage):
        primvars = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(GUIDES))
        primvars.CreatePrimvar(LEVEL.removeprefix("primvars:"), Sdf.ValueTypeNames.IntArray, "uniform")

    def declare(layer):
        Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, GUIDES), LEVEL, Sdf.ValueTypeNames.IntArray)

    def put(layer, frame):
        declare(layer)
        for time in layer.ListTimeSamplesForPath(f"{GUIDES}.points"):
            layer.SetTimeSample(f"{GUIDES}.{LEVEL}", time, Vt.IntArray([0] * cache.counts[GUIDES]))

    cache.edit_topology(topology)
    cache.edit("hair.manifest.usda", declare)
    for frame in HANDLES:
        cache.edit(cache.frame(frame).name, lambda layer, frame=frame: put(layer, frame))


def a_frame_without_levels(cache):
    cache.edit(
        cache.frame(MIDDLE).name, lambda layer: layer.EraseTimeSample(f"{GUIDES}.{LEVEL}", float(MIDDLE))
    )


def a_level_too_few(cache):
    cache.edit_array(MIDDLE, f"{GUIDES}.{LEVEL}", lambda levels: levels[:-1])


def test_levels_pass(good_cache):
    tell_levels(good_cache)
    report = validate(good_cache.directory)
    assert not broken(report), report.as_text()


@pytest.mark.parametrize("check, inject", [("frames", a_frame_without_levels), ("sizes", a_level_too_few)])
def test_fault_fails_its_own_check(good_cache, check, inject):
    tell_levels(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert broken(report) == {check}, report.as_text()
