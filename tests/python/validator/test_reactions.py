"""What holds the guides: true reactions pass, and defects fail their check."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_validate.cache import CLAMPS, GUIDES, HELD, TIES
from hairbake_validate.run import validate
from validator.defects import MIDDLE, Defect, failed
from validator.good_cache import CacheBuilder

FORCE, TIE = f"{GUIDES}.{CLAMPS[0]}", f"{GUIDES}.{HELD[0]}"
TIE_COUNT = 2


def primvars(stage: Usd.Stage) -> UsdGeom.PrimvarsAPI:
    return UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(GUIDES))


def add_reactions(cache: CacheBuilder) -> None:
    """Adds clamps, and two ties of one guide, to every sample."""
    types = Sdf.ValueTypeNames

    def declare(stage: Usd.Stage) -> None:
        api = primvars(stage)
        for name in CLAMPS:
            api.CreatePrimvar(name.removeprefix("primvars:"), types.Vector3fArray, "uniform")
        for name in HELD:
            api.CreatePrimvar(name.removeprefix("primvars:"), types.Vector3fArray, "constant")
        known = api.GetPrimvar("groom_id").Get()[0]
        for name, value in zip(TIES, ([known] * TIE_COUNT, range(TIE_COUNT)), strict=True):
            api.CreatePrimvar(name.removeprefix("primvars:"), types.IntArray, "constant").Set(list(value))

    cache.edit_topology(declare)
    counts = dict.fromkeys(CLAMPS, cache.counts[GUIDES]) | dict.fromkeys(HELD, TIE_COUNT)
    for name, count in counts.items():
        values = Vt.Vec3fArray.FromNumpy(np.full((count, 3), 1e-5, np.float32))
        cache.add_attribute(f"{GUIDES}.{name}", types.Vector3fArray, lambda *_, values=values: values)


def missing_sample(cache: CacheBuilder) -> None:
    cache.edit_frame(MIDDLE, lambda layer: layer.EraseTimeSample(FORCE, float(MIDDLE)))


def one_clamp_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, FORCE, lambda forces: forces[:-1])


def one_tie_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, TIE, lambda forces: forces[:-1])


def not_a_number(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, FORCE, lambda forces: forces * np.float32("nan"))


def tie_of_an_unknown_guide(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: primvars(stage).GetPrimvar("groom_tie_guide").Set([12345] * TIE_COUNT))


def one_number_short(cache: CacheBuilder) -> None:
    cache.edit_topology(lambda stage: primvars(stage).GetPrimvar("groom_tie_number").Set([0]))


def clamps_per_point(cache: CacheBuilder) -> None:
    cache.edit_topology(
        lambda stage: primvars(stage).GetPrimvar("groom_clamp_force").SetInterpolation("vertex")
    )


def test_reactions_pass(good_cache: CacheBuilder) -> None:
    add_reactions(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(
    ("check", "inject"),
    [
        ("frames", missing_sample),
        ("sizes", one_clamp_short),
        ("sizes", one_tie_short),
        ("finite", not_a_number),
        ("reactions", tie_of_an_unknown_guide),
        ("reactions", one_number_short),
        ("reactions", clamps_per_point),
    ],
)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, check: str, inject: Defect) -> None:
    add_reactions(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == {check}, report.as_text()
