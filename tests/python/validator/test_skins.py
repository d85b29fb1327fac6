"""Roots on a skin: good caches pass, and roots that leave their places are caught."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from hairbake_validate.cache import Cache, Curves, Mesh
from hairbake_validate.geometry import Array, FloatArray
from hairbake_validate.run import validate
from hairbake_validate.skins import Skin, Skins
from validator.defects import MIDDLE, Defect, failed, move_points
from validator.good_cache import GUIDES, HAIR, POINTS, SHUTTER, SKULL, CacheBuilder


def make_skin(cache: CacheBuilder) -> None:
    def edit(stage: Usd.Stage) -> None:
        primvars = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(SKULL))
        primvars.CreatePrimvar("groom_skin", Sdf.ValueTypeNames.Int, "constant").Set(1)

    cache.edit_topology(edit)


def shifted(curves: FloatArray) -> FloatArray:
    curves[1] += [0, 5e-5, 0]
    return curves


def moved_strand(cache: CacheBuilder) -> None:
    move_points(cache, MIDDLE, HAIR, shifted)


def moved_guide(cache: CacheBuilder) -> None:
    move_points(cache, MIDDLE, GUIDES, shifted)


def moved_strand_within_the_shutter(cache: CacheBuilder) -> None:
    def change(points: Array) -> Array:
        return shifted(points.reshape(-1, POINTS, 3).astype(float)).reshape(-1, 3).astype(np.float32)

    cache.edit_array(MIDDLE, f"{HAIR}.points", change, after=SHUTTER)


def test_a_rigid_skin_passes(good_cache: CacheBuilder) -> None:
    make_skin(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(
    ("check", "inject"),
    [
        ("skin_roots", moved_strand),
        ("skin_roots", moved_guide),
        ("sub_frame_skin_roots", moved_strand_within_the_shutter),
    ],
)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, check: str, inject: Defect) -> None:
    make_skin(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == {check}, report.as_text()


def test_a_sheet_that_is_rolled_up_turns_its_roots(good_cache: CacheBuilder) -> None:
    u, v = (np.ravel(axis) for axis in np.meshgrid(np.linspace(0, 0.2, 41), np.linspace(0, 0.1, 11)))
    quads = [(41 * j + i, 41 * (j + 1) + i) for j in range(10) for i in range(40)]
    triangles = np.array([t for a, b in quads for t in ((a, b, b + 1), (a, b + 1, a + 1))])
    flat, radius = np.stack([u, 0 * u, v], axis=1), 0.05
    rolled = np.stack([radius * np.sin(u / radius), radius * np.cos(u / radius), v], axis=1)
    mesh = Mesh("/skin", flat, triangles, np.empty((0, 3), int), deforms=True, is_skin=True)
    rest = np.array([[0.053, 0.004, 0.041], [0.053, 0.014, 0.041], [0.15, 0.0, 0.06], [0.15, 0.01, 0.06]])
    curves = Curves("/hair", np.array([2, 2]), rest.astype(np.float32), np.ones(4, np.float32))
    cache = Cache(good_cache.directory)
    cache.colliders, cache.curves = [mesh], [curves]
    values = {"points": rolled, "xformOp:transform": np.eye(4)}
    carried = Skins(cache).carried(curves, lambda _, name: values[name])
    assert carried is not None
    for point, (x, height, z) in zip(carried, rest, strict=True):
        # Hair stands on its root's normal.
        angle = rest[0, 0] / radius if x < 0.1 else rest[2, 0] / radius
        expected = [(radius + height) * np.sin(angle), (radius + height) * np.cos(angle), z]
        assert np.abs(point - expected).max() < 2e-4


def test_edges_that_part_later_are_not_joined() -> None:
    # Two triangles on both sides of a slit, one of which is drawn twice.
    points = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 0, 0]], float)
    triangles = np.array([[0, 1, 2], [3, 5, 4], [5, 4, 3]])
    mesh = Mesh("/lids", points, triangles, np.empty((0, 3), int), deforms=True, is_skin=True)
    opened = points.copy()
    opened[3] += [0.1, 0, 0]
    counts = {
        name: (len(skin.points), len(skin.triangles))
        for name, skin in (
            ("closed", Skin(mesh)),
            ("still", Skin(mesh, [points])),
            ("open", Skin(mesh, [points, opened])),
        )
    }
    assert counts == {"closed": (4, 2), "still": (4, 2), "open": (5, 2)}
