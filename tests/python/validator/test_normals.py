"""Normals of the guides: true ones pass, and defects fail their check."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from hairbake_validate.cache import GUIDES, NORMALS
from hairbake_validate.geometry import Array
from hairbake_validate.run import validate
from validator.defects import MIDDLE, Defect, failed
from validator.good_cache import POINTS, CacheBuilder

PATH = f"{GUIDES}.{NORMALS}"
TURN = 1.5
"""Twist of each guide, rad."""


def add_normals(cache: CacheBuilder) -> None:
    """Adds the normals of guides, plane arcs with twist, to every sample."""

    def sample(layer: Sdf.Layer, frame: int, time: float) -> Vt.Vec3fArray:
        points = np.array(layer.QueryTimeSample(f"{GUIDES}.points", time), float).reshape(-1, POINTS, 3)
        tangents = np.gradient(points, axis=1, edge_order=2)
        tangents /= np.linalg.norm(tangents, axis=2, keepdims=True)
        # The head carries the same plane of each guide at all times.
        out = np.cross(points[:, 1] - points[:, 0], points[:, -1] - points[:, 0])[:, None]
        out = out / np.linalg.norm(out, axis=2, keepdims=True) + 0 * tangents
        turn = TURN * np.linspace(0, 1, POINTS)[None, :, None]
        normals = np.cos(turn) * out + np.sin(turn) * np.cross(tangents, out)
        return Vt.Vec3fArray.FromNumpy(normals.reshape(-1, 3).astype("f4"))

    def declare(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(GUIDES)
        UsdGeom.BasisCurves(prim).CreateNormalsAttr()
        UsdGeom.BasisCurves(prim).SetNormalsInterpolation("vertex")

    cache.edit_topology(declare)
    cache.add_attribute(PATH, Sdf.ValueTypeNames.Normal3fArray, sample)


def changed(points: slice) -> Defect:
    """Turns some normals of every guide around in the middle frame."""

    def inject(cache: CacheBuilder) -> None:
        def turn(normals: Array) -> Array:
            normals.reshape(-1, POINTS, 3)[:, points] *= -1
            return normals

        cache.edit_array(MIDDLE, PATH, turn)

    return inject


def one_value_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, PATH, lambda normals: normals[:-1])


def too_long(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, PATH, lambda normals: normals * np.float32(1.2))


def along_the_curve(cache: CacheBuilder) -> None:
    def tilt(layer: Sdf.Layer) -> None:
        points, normals = (
            np.array(layer.QueryTimeSample(f"{GUIDES}.{name}", MIDDLE)) for name in ("points", NORMALS)
        )
        chords = np.diff(points.reshape(-1, POINTS, 3), axis=1)
        chords /= np.linalg.norm(chords, axis=2, keepdims=True)
        normals.reshape(-1, POINTS, 3)[:, 1:] += np.float32(0.4) * chords
        layer.SetTimeSample(PATH, MIDDLE, Vt.Vec3fArray.FromNumpy(normals))

    cache.edit_frame(MIDDLE, tilt)


def in_rest_space(cache: CacheBuilder) -> None:
    """The normals of a bake that forgets that the head turns about its guides."""
    angle = 0.01
    spin = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    cache.edit_array(MIDDLE, PATH, lambda normals: (normals @ spin.T).astype("f4"))


def test_true_normals_pass(good_cache: CacheBuilder) -> None:
    add_normals(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(
    ("check", "inject"),
    [
        ("sizes", one_value_short),
        ("normals", too_long),
        ("normals", along_the_curve),
        ("normal_twist", changed(slice(4, None))),
        ("root_normals", changed(slice(None))),
        ("root_normals", in_rest_space),
    ],
)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, check: str, inject: Defect) -> None:
    add_normals(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == {check}, report.as_text()
