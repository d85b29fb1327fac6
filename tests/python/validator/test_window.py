"""The points that must stay outside a collider, and what the checks of a frame share."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from hairbake_validate import checks_frame, checks_motion, window
from hairbake_validate.cache import GUIDES, Cache, Curves
from hairbake_validate.run import validate
from hairbake_validate.window import Reference, inside_after_exit, neighbours_on_curve
from validator.good_cache import HANDLES, RADIUS, SKULL, CacheBuilder


def test_stretches_drawn_through_a_collider_and_their_neighbours() -> None:
    # Two curves: one rooted inside that re-enters further down, and one that ends inside.
    outside = np.array([0, 0, 1, 1, 0, 1, 1] + [1, 1, 0], bool)
    curves = Curves(GUIDES, np.array([7, 3]), np.zeros((10, 3), np.float32), np.zeros(10, np.float32))
    reentered = inside_after_exit(outside, curves)
    assert np.flatnonzero(reentered).tolist() == [4, 9]
    assert np.flatnonzero(neighbours_on_curve(reentered, curves)).tolist() == [3, 5, 8]


def test_each_frame_is_read_and_measured_once(
    good_cache: CacheBuilder, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: Counter[str] = Counter()

    def counted(module: Any, name: str) -> None:
        function = getattr(module, name)

        def call(*arguments: Any) -> Any:
            calls[name] += 1
            return function(*arguments)

        call.__name__ = name
        monkeypatch.setattr(module, name, call)

    counted(window, "read_frame")
    counted(window, "read_value")
    counted(checks_frame, "arc_lengths")
    for name in ("in_head", "speed_in_head", "bend", "residual_of"):
        counted(checks_motion, name)
    assert validate(good_cache.directory, only="moving").passed
    frames = len(list(good_cache.directory.glob("hair.*.usdc"))) - 1
    assert calls["read_frame"] == frames + 1  # The first frame is the reference too.
    assert 0 < calls["read_value"] <= frames  # The head alone, of frames ahead.
    assert calls["arc_lengths"] == frames
    # Two sets of curves; windows at the ends ask for frames that do not exist on either side.
    assert calls["residual_of"] == 2 * frames
    assert all(2 * frames <= calls[name] <= 2 * (frames + 5) for name in ("in_head", "speed_in_head", "bend"))


@pytest.mark.parametrize(
    ("at_rest", "moved", "excused"), [(True, False, True), (True, True, False), (False, True, False)]
)
def test_what_is_inside_both_at_rest_and_in_the_first_frame_is_excused(
    good_cache: CacheBuilder, at_rest: bool, moved: bool, excused: bool
) -> None:
    """The skull is drawn half a radius into the hair, or moved there at first, or both."""
    shift = np.array([0.0, RADIUS / 2, 0.0])

    def draw(stage: Usd.Stage) -> None:
        points = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL)).GetPointsAttr()
        points.Set(Vt.Vec3fArray.FromNumpy((np.array(points.Get()) + shift).astype(np.float32)))

    def move(layer: Sdf.Layer) -> None:
        path, time = f"{SKULL}.xformOp:transform", float(HANDLES[0])
        by = Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(*(-shift if at_rest else shift).tolist()))
        layer.SetTimeSample(path, time, by * layer.QueryTimeSample(path, time))

    if at_rest:
        good_cache.edit_topology(draw)
    if moved:
        good_cache.edit_frame(HANDLES[0], move)
    outside = Reference.of(Cache(good_cache.directory)).outside
    assert all(flags.all() != excused for flags in outside.values())
