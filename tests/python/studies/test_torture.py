"""Scenes that provoke crossings: nothing crosses a body or a strand, by the independent count."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hairbake_validate import crossing_check
from hairbake_validate.cache import GUIDES, HEAD, TRANSFORM
from hairbake_validate.geometry import FloatArray
from physics.program import Hairbake
from support import HAIRBAKE, needs_hairbake
from torture.__main__ import torture
from torture.scenes import SCENES


@needs_hairbake
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps"), [("whip", 5), ("pops", 5), ("edges", 5), ("edges", 1), ("crossed", 5)]
)
def test_nothing_crosses(name: str, steps: int) -> None:
    result = torture(Hairbake(HAIRBAKE), name, steps, seconds=0.3)
    assert result.found.body_pairs + result.found.strand_pairs > 400
    assert not result.found.events
    assert result.totals["crossings"] == result.unseen == 0
    # Steps of a whole film frame are divided.
    assert steps > 1 or result.totals["halvings"] > 0


@needs_hairbake
@pytest.mark.slow
@pytest.mark.parametrize("steps", [3, 1])
def test_hair_as_a_volume_crosses_no_body(steps: int) -> None:
    result = torture(Hairbake(HAIRBAKE), "edges", steps, seconds=0.3, contact="volume")
    assert result.found.body_pairs > 400
    assert not result.found.events
    assert result.totals["crossings"] == 0


def test_scenes_are_complete() -> None:
    assert list(SCENES) == ["whip", "dash", "pops", "edges", "closing", "crossed"]


def turn(angle: float) -> FloatArray:
    """A rotation about the third axis, for row vectors."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0, 0], [-s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("through", [False, True])
def test_crossings_of_a_turning_body_are_found_in_its_own_space(
    monkeypatch: pytest.MonkeyPatch, through: bool
) -> None:
    # A plate that faces its axis at 0.1 m turns by a right angle. A strand inside its orbit stays in place:
    # the chord of the plate's path passes through it, the plate does not. Or the strand moves along and
    # outwards.
    corners = np.array([[0.1, -0.1, -0.1], [0.1, 0.1, -0.1], [0.1, 0, 0.1]])
    along = np.array([[0, 0, -0.05], [0, 0, 0.05]])

    def strand_at(angle: float, radius: float) -> FloatArray:
        return along + radius * np.array([np.cos(angle), np.sin(angle), 0])

    positions = (
        [strand_at(0.0, 0.09), strand_at(np.pi / 2, 0.2)] if through else [strand_at(np.pi / 4, 0.09)] * 2
    )
    samples = [
        {f"{GUIDES}.points": points, f"{HEAD}.{TRANSFORM}": np.eye(4), f"/plate.{TRANSFORM}": turn(angle)}
        for points, angle in zip(positions, (0.0, np.pi / 2), strict=True)
    ]
    monkeypatch.setattr(
        crossing_check, "read_frame", lambda _, frame: SimpleNamespace(values=samples[frame], later={})
    )
    plate = SimpleNamespace(path="/plate", points=corners, triangles=np.array([[0, 1, 2]]), deforms=False)
    guides = SimpleNamespace(
        path=GUIDES,
        segments=np.array([0]),
        curve_of_point=np.array([0, 0]),
        rest=strand_at(0.0, 0.05),
    )
    cache: Any = SimpleNamespace(curves=[guides], colliders=[plate], frames=[0, 1], first=1)
    assert len(crossing_check.count(cache).events) == through
