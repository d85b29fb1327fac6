"""Which points a collider has to keep outside."""

from types import SimpleNamespace

import numpy as np

from hairbake_validate.cache import Curves
from hairbake_validate.window import beside, through


def test_stretches_drawn_through_a_collider_and_the_points_beside_them():
    # Two curves: one rooted inside and through again further down; one that ends inside.
    outside = np.array([0, 0, 1, 1, 0, 1, 1] + [1, 1, 0], bool)
    curves = SimpleNamespace(counts=np.array([7, 3]), rest=np.zeros((10, 3)))
    curves.starts = Curves.starts.fget(curves)
    curves.segments = Curves.segments.fget(curves)
    drawn = through(outside, curves)
    assert np.flatnonzero(drawn).tolist() == [4, 9]
    assert np.flatnonzero(beside(drawn, curves)).tolist() == [3, 5, 8]
