"""The points that must stay outside a collider."""

import numpy as np

from hairbake_validate.cache import GUIDES, Curves
from hairbake_validate.window import inside_after_exit, neighbours_on_curve


def test_stretches_drawn_through_a_collider_and_their_neighbours() -> None:
    # Two curves: one rooted inside that re-enters further down, and one that ends inside.
    outside = np.array([0, 0, 1, 1, 0, 1, 1] + [1, 1, 0], bool)
    curves = Curves(GUIDES, np.array([7, 3]), np.zeros((10, 3), np.float32), np.zeros(10, np.float32))
    reentered = inside_after_exit(outside, curves)
    assert np.flatnonzero(reentered).tolist() == [4, 9]
    assert np.flatnonzero(neighbours_on_curve(reentered, curves)).tolist() == [3, 5, 8]
