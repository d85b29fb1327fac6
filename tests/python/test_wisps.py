"""A small part of the comparison of adaptive wisps with all guides by themselves."""

import os
from pathlib import Path

import numpy as np
import pytest
from wisps.__main__ import compare, sample
from wisps.compare import Run, distances, pops

HAIRBAKE = os.environ.get("HAIRBAKE", "")


def run(points: np.ndarray, changes: list[int]) -> Run:
    figures = [{"splits": n, "merges": 0} for n in changes]
    return Run(points, np.array([points.shape[1]]), np.array([2.0]), 10.0, figures)


def test_distances_are_shares_of_the_length():
    points = np.zeros((3, 4, 3))
    assert np.allclose(distances(run(points, [0] * 3), run(points + [0.1, 0, 0], [0] * 3)), 0.05)


def test_a_pop_is_seen_where_wisps_change():
    changes = [0] * 20
    changes[10] = 5
    points = np.zeros((20, 1, 3))
    points[10:, 0, 0] = 0.01
    most, least = pops(run(points, changes))
    assert np.isclose(most, 1.0, rtol=0.05) and least == 0.0


@pytest.mark.skipif(not HAIRBAKE, reason="HAIRBAKE names no program")
def test_adaptive_wisps_are_between_coarse_ones_and_all_guides(tmp_path):
    options = ["--wisps", "24", "--strands", "60", "--head-rounds", "2"]
    scene = sample(Path(HAIRBAKE), tmp_path / "long", "long", *options)
    full, adaptive, coarse = compare(Path(HAIRBAKE), tmp_path, "long", scene, partings=(0.0015,))
    assert full.mean == 0.0 and full.speed_up == 1.0
    assert full.nodes > adaptive.nodes > coarse.nodes
    assert adaptive.mean < coarse.mean
