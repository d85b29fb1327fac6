"""A collider that deforms: good caches pass, and defects that only its animated points reveal are caught."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_validate.geometry import Array
from hairbake_validate.run import validate
from validator.defects import MIDDLE, Defect, failed, turn_into_collider
from validator.good_cache import GUIDES, SKULL, CacheBuilder


def make_collider_deform(cache: CacheBuilder) -> None:
    """Gives the collider animated points; its rest points are half as large."""
    kinds = {"points": Sdf.ValueTypeNames.Point3fArray, "extent": Sdf.ValueTypeNames.Float3Array}
    values: dict[str, Array] = {}

    def edit(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL))
        for name in kinds:
            attribute = mesh.GetPrim().GetAttribute(name)
            values[name] = np.array(attribute.Get())
            attribute.Clear()
        rest = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("rest", Sdf.ValueTypeNames.Point3fArray, "vertex")
        rest.Set(Vt.Vec3fArray.FromNumpy(values["points"] / 2))

    cache.edit_topology(edit)
    for name, kind in kinds.items():
        value = Vt.Vec3fArray.FromNumpy(values[name])
        cache.add_attribute(f"{SKULL}.{name}", kind, lambda *_, value=value: value)


def guide_turned_into_the_collider(cache: CacheBuilder) -> None:
    turn_into_collider(cache, GUIDES)


def missing_sample(cache: CacheBuilder) -> None:
    cache.edit_frame(MIDDLE, lambda layer: layer.EraseTimeSample(f"{SKULL}.points", float(MIDDLE)))


def one_point_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, f"{SKULL}.points", lambda points: points[:-1])


def test_deforming_collider_passes(good_cache: CacheBuilder) -> None:
    make_collider_deform(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(
    ("checks", "inject"),
    [
        # The velocities do not contain the turn.
        ({"guide_penetration", "curve_velocities"}, guide_turned_into_the_collider),
        ({"frames"}, missing_sample),
        ({"sizes"}, one_point_short),
    ],
)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, checks: set[str], inject: Defect) -> None:
    make_collider_deform(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == checks, report.as_text()
