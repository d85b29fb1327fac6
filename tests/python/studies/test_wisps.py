"""A small comparison of adaptive wisps with bakes that step every guide."""

from pathlib import Path

import pytest

from support import HAIRBAKE, needs_hairbake
from wisps.bakes import sample
from wisps.comparison import compare


@needs_hairbake
@pytest.mark.slow
def test_adaptive_wisps_lie_between_coarse_ones_and_all_guides(tmp_path: Path) -> None:
    options = ["--wisps", "24", "--strands", "600", "--head-subdivisions", "2"]
    scene = sample(HAIRBAKE, tmp_path / "long", "long", *options)
    full, nudged, adaptive, coarse = compare(HAIRBAKE, tmp_path, "long", scene, split_tolerances=(0.0015,))
    assert full.mean == 0.0 and full.speed_up == 1.0
    assert full.nodes == nudged.nodes > adaptive.nodes > coarse.nodes
    assert full.mean == full.locks < nudged.mean < adaptive.mean < coarse.mean
    assert nudged.locks < adaptive.locks < coarse.locks
