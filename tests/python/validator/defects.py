"""The register of defects that the validator must catch, and helpers to inject them into a good cache."""

from collections.abc import Callable

import numpy as np
import pytest
from _pytest.mark.structures import ParameterSet
from pxr import Sdf

from hairbake_validate.geometry import Array, FloatArray
from hairbake_validate.report import Report
from validator.good_cache import POINTS, CacheBuilder

MIDDLE = 1003
"""The frame into which defects of single frames are injected."""

Defect = Callable[[CacheBuilder], None]
DEFECTS: list[ParameterSet] = []
"""Checks that must fail, and the defect."""


def defect(check: str, *others: str) -> Callable[[Defect], Defect]:
    """Registers a defect under the check that must catch it, and `others` that necessarily fail too."""

    def register(inject: Defect) -> Defect:
        DEFECTS.append(pytest.param([check, *others], inject, id=f"{check}-{inject.__name__}"))
        return inject

    return register


def failed(report: Report) -> set[str]:
    """Ids of the checks that failed or warned."""
    return {check for check, outcome in report.outcomes.items() if outcome.status in ("fail", "warn")}


def move_points(
    cache: CacheBuilder, frame: int, path: str, change: Callable[[FloatArray], FloatArray]
) -> None:
    """Changes points, as `curves × POINTS × 3`, and updates the extent."""

    def reshaped(points: Array) -> Array:
        return change(points.reshape(-1, POINTS, 3).astype(float)).reshape(-1, 3).astype(np.float32)

    cache.edit_array(frame, f"{path}.points", reshaped)
    layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(frame)))
    points = np.array(layer.QueryTimeSample(f"{path}.points", float(frame)))
    extent = np.stack([points.min(0) - 4e-5, points.max(0) + 4e-5])
    cache.edit_array(frame, f"{path}.extent", lambda _: extent)


def turned(curve: FloatArray, axis: FloatArray, angle: float) -> FloatArray:
    """A curve turned about its root: its length and its root stay."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    moved: FloatArray = curve[0] + (curve - curve[0]) @ rotation.T
    return moved


def turn_into_collider(cache: CacheBuilder, path: str) -> None:
    """Turns a curve about its root into the collider, smoothly, from the first frame on.

    The first frame defines which points are outside.
    """
    for frame in range(1001, 1008):
        share = (frame - 1000) / 7

        def change(curves: FloatArray, share: float = share) -> FloatArray:
            curve = curves[0].copy()
            axis = np.cross(curve[1] - curve[0], curve[-1] - curve[-2])
            curves[0] = turned(curve, axis, np.pi * (1 - np.cos(np.pi * share)) / 2)
            return curves

        move_points(cache, frame, path, change)
