"""A small part of the comparison of adaptive wisps with all guides by themselves."""

import os
from pathlib import Path

import numpy as np
import pytest
from wisps.__main__ import compare, sample
from wisps.compare import Run, pops

HAIRBAKE = os.environ.get("HAIRBAKE", "")


@pytest.mark.skipif(not HAIRBAKE, reason="HAIRBAKE names no program")
def test_adaptive_wisps_are_between_coarse_ones_and_all_guides(tmp_path):
    options = ["--wisps", "24", "--strands", "60", "--head-rounds", "2"]
    scene = sample(Path(HAIRBAKE), tmp_path / "long", "long", *options)
    full, adaptive, coarse = compare(Path(HAIRBAKE), tmp_path, "long", scene, partings=(0.0015,))
    assert full.mean == 0.0 and full.speed_up == 1.0
    assert full.nodes > adaptive.nodes > coarse.nodes
    assert adaptive.mean < coarse.mean


def test_a_pop_is_told_from_hair_that_is_stirred():
    frames = np.arange(40)
    figures = [{"splits": int(15 <= f <= 20), "merges": 0} for f in frames]

    def run(offset: np.ndarray) -> Run:
        # Stirred twice as much in the second half, in which the changes are.
        swing = 0.01 * (1 + (frames > 10)) * np.sin(frames) + offset
        points = swing[:, None, None] * np.ones((1, 5, 3))
        return Run(points, np.array([5]), np.array([0.1]), 24.0, figures)

    full = run(np.zeros(40))
    assert pops(full, full) == (1.0, 1.0)
    amid, without = pops(full, run(0.02 * (frames >= 18)))
    assert amid > 1.5 and without == 1.0
