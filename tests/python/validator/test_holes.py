"""A collider with a hole: hair that falls into it is inside, although it crosses no drawn triangle."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from hairbake_validate.geometry import FloatArray
from hairbake_validate.run import validate
from validator.defects import MIDDLE, failed, move_points
from validator.good_cache import (
    HAIR,
    RADIUS,
    SKULL,
    CacheBuilder,
    head_matrix,
    sphere_mesh,
    transform,
)


def open_the_neck(cache: CacheBuilder, capped: bool) -> None:
    """Removes the lowest triangles of the skull; the hole is closed if `capped`."""
    points, triangles = sphere_mesh()
    lowest = (triangles == len(points) - 1).any(axis=1)
    rim = np.arange(len(points) - 1 - lowest.sum(), len(points) - 1)
    caps = np.stack([np.full(len(rim) - 2, rim[0]), rim[1:-1], rim[2:]], axis=1)

    def edit(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL))
        mesh.GetFaceVertexCountsAttr().Set([3] * int((~lowest).sum()))
        mesh.GetFaceVertexIndicesAttr().Set(triangles[~lowest].ravel().tolist())
        if capped:
            kind = Sdf.ValueTypeNames.IntArray
            UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("groom_caps", kind, "constant").Set(caps.ravel().tolist())

    cache.edit_topology(edit)


def drop_a_tip_into_the_hole(cache: CacheBuilder) -> None:
    """Moves the tip of a strand 5 mm above the middle of the rim."""
    height = -RADIUS * np.cos(np.pi / 8) + 0.005

    def change(curves: FloatArray) -> FloatArray:
        matrix = head_matrix((MIDDLE - 1001) / 24.0)
        curves[0, -1] = transform(np.array([[0.002, height, 0.003]]), matrix)[0]
        return curves

    move_points(cache, MIDDLE, HAIR, change)


@pytest.mark.parametrize("capped", [True, False])
def test_tip_in_a_hole_is_inside_if_it_is_closed(good_cache: CacheBuilder, capped: bool) -> None:
    open_the_neck(good_cache, capped)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()
    drop_a_tip_into_the_hole(good_cache)
    report = validate(good_cache.directory)
    assert ("hair_penetration" in failed(report)) is capped, report.as_text()
