"""A collider that deforms: good caches pass, and faults that only its own points show are caught."""

import numpy as np
import pytest
from pxr import Sdf, UsdGeom, Vt

from hairbake_validate.run import validate
from validator.defects import GUIDES, MIDDLE, SKULL, broken, push_in
from validator.good_cache import HANDLES, CacheBuilder


def soften(cache: CacheBuilder) -> None:
    """Makes a deforming mesh of the collider: every frame's file has its points, and at rest it is half as large."""
    animated = {"points": Sdf.ValueTypeNames.Point3fArray, "extent": Sdf.ValueTypeNames.Float3Array}
    sphere = {}

    def topology(stage):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL))
        for name in animated:
            attribute = mesh.GetPrim().GetAttribute(name)
            sphere[name] = np.array(attribute.Get())
            attribute.Clear()
        rest = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("rest", Sdf.ValueTypeNames.Point3fArray, "vertex")
        rest.Set(Vt.Vec3fArray.FromNumpy(sphere["points"] / 2))

    def declare(layer):
        for name, kind in animated.items():
            Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, SKULL), name, kind)

    def put(layer, frame):
        declare(layer)
        for name, value in sphere.items():
            for time in layer.ListTimeSamplesForPath(f"{SKULL}.xformOp:transform"):
                layer.SetTimeSample(f"{SKULL}.{name}", time, Vt.Vec3fArray.FromNumpy(value))

    cache.edit_topology(topology)
    cache.edit("hair.manifest.usda", declare)
    for frame in HANDLES:
        cache.edit(cache.frame(frame).name, lambda layer, frame=frame: put(layer, frame))


def guide_pushed_into_a_deforming_collider(cache):
    push_in(cache, GUIDES)


def deforming_collider_without_points(cache):
    cache.edit(
        cache.frame(MIDDLE).name, lambda layer: layer.EraseTimeSample(f"{SKULL}.points", float(MIDDLE))
    )


def deforming_collider_of_another_size(cache):
    cache.edit_array(MIDDLE, f"{SKULL}.points", lambda points: points[:-1])


def test_deforming_collider_passes(good_cache):
    soften(good_cache)
    report = validate(good_cache.directory)
    assert not broken(report), report.as_text()


@pytest.mark.parametrize(
    "checks, inject",
    [
        # The curve is pushed in for one frame, which its velocities do not tell.
        ({"guide_penetration", "curve_velocities"}, guide_pushed_into_a_deforming_collider),
        ({"frames"}, deforming_collider_without_points),
        ({"sizes"}, deforming_collider_of_another_size),
    ],
)
def test_fault_fails_its_own_check(good_cache, checks, inject):
    soften(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert broken(report) == checks, report.as_text()
