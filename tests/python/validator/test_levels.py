"""Levels of wisps in the frames: good caches pass, and defects fail their check."""

import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_validate.cache import GUIDES, LEVEL
from hairbake_validate.run import validate
from validator.defects import MIDDLE, Defect, failed
from validator.good_cache import CacheBuilder

PATH = f"{GUIDES}.{LEVEL}"


def add_levels(cache: CacheBuilder) -> None:
    """Adds the levels of the guides to every sample."""

    def declare(stage: Usd.Stage) -> None:
        primvars = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(GUIDES))
        primvars.CreatePrimvar(LEVEL.removeprefix("primvars:"), Sdf.ValueTypeNames.IntArray, "uniform")

    cache.edit_topology(declare)
    levels = Vt.IntArray([0] * cache.counts[GUIDES])
    cache.add_attribute(PATH, Sdf.ValueTypeNames.IntArray, lambda *_: levels)


def missing_sample(cache: CacheBuilder) -> None:
    cache.edit_frame(MIDDLE, lambda layer: layer.EraseTimeSample(PATH, float(MIDDLE)))


def one_level_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, PATH, lambda levels: levels[:-1])


def test_levels_pass(good_cache: CacheBuilder) -> None:
    add_levels(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(("check", "inject"), [("frames", missing_sample), ("sizes", one_level_short)])
def test_defect_fails_its_own_check(good_cache: CacheBuilder, check: str, inject: Defect) -> None:
    add_levels(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == {check}, report.as_text()
