"""The character of the study of over mode: everything of its groom is kept."""

from pathlib import Path

import pytest

from over.__main__ import Distance, Result, line, study
from over.character import Drawn
from support import HAIRBAKE, needs_hairbake


@needs_hairbake
@pytest.mark.slow
def test_everything_of_the_groom_is_kept(tmp_path: Path) -> None:
    result = study(HAIRBAKE, tmp_path, Drawn("bspline", "pinned"), frames=4)
    assert all(result.kept.values()) and len(result.kept) == 15, result.kept
    assert result.failed == []
    assert result.rest < 1e-6
    assert result.distance.of_length < 0.002


def test_what_is_lost_is_told() -> None:
    result = Result({"widths": True, "st": False}, 2e-7, Distance(1e-4, 2e-4, 3e-3, 1e-3), ["over_clips"])
    told = line(Drawn("bspline", "pinned"), result)
    assert told.split() == [
        *("bspline,", "pinned", "2.0e-07", "0.1000", "0.2000", "3.0000", "0.1000", "st", "over_clips")
    ]
