"""Scenes that provoke crossings: nothing crosses a body or a strand, by the independent count."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hairbake_validate import crossing_check
from hairbake_validate.cache import ARRIVED, GUIDES, HEAD, TRANSFORM
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
    # Steps of a whole film frame are divided, by what touches.
    assert steps > 1 or min(result.totals["halvings"], result.found.of_some) > 0


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


Z = np.array([[0, 0, -0.05], [0, 0, 0.05]])
"""A strand along the third axis."""
PLATE = np.array([[0.1, -0.1, -0.1], [0.1, 0.1, -0.1], [0.1, 0, 0.1]])
"""A plate that faces the third axis at 0.1 m."""


def events(
    monkeypatch: pytest.MonkeyPatch,
    moments: list[tuple[float, list[FloatArray], list[int]]],
    plate: FloatArray | None = None,
) -> list[crossing_check.Event]:
    """The crossings of strands of two points.

    Each moment has its time, where the strands are, and whether they have arrived there. A `plate` of one
    triangle turns about the third axis by a right angle between two frames.
    """
    values = {
        time: {
            f"{GUIDES}.points": np.concatenate(strands),
            f"{GUIDES}.{ARRIVED}": np.array(arrived),
            f"{HEAD}.{TRANSFORM}": np.eye(4),
            f"/plate.{TRANSFORM}": turn(time * np.pi / 2),
        }
        for time, strands, arrived in moments
    }
    later = {time: at for time, at in values.items() if 0 < time < 1}
    files = [SimpleNamespace(values=values[0], later=later), SimpleNamespace(values=values[1], later={})]
    monkeypatch.setattr(crossing_check, "read_frame", lambda _, frame: files[frame])
    count = len(moments[0][1])
    guides = SimpleNamespace(
        path=GUIDES,
        segments=2 * np.arange(count),
        curve_of_point=np.repeat(np.arange(count), 2),
        counts=[2] * count,
        rest=np.concatenate([Z + [0.05, 0, 0]] * count),
    )
    body = SimpleNamespace(path="/plate", points=plate, triangles=np.array([[0, 1, 2]]), deforms=False)
    colliders = [] if plate is None else [body]
    cache: Any = SimpleNamespace(curves=[guides], colliders=colliders, frames=[0, 1], first=1)
    return crossing_check.count(cache).events


@pytest.mark.parametrize("through", [False, True])
def test_crossings_of_a_turning_body_are_found_in_its_own_space(
    monkeypatch: pytest.MonkeyPatch, through: bool
) -> None:
    # A strand inside the orbit of the plate stays in place: the chord of the plate's path passes through it,
    # the plate does not. Or the strand moves along and outwards.
    def strand_at(angle: float, radius: float) -> FloatArray:
        return Z + radius * np.array([np.cos(angle), np.sin(angle), 0])

    positions = (
        [strand_at(0.0, 0.09), strand_at(np.pi / 2, 0.2)] if through else [strand_at(np.pi / 4, 0.09)] * 2
    )
    moments = [(float(time), [strand], [1]) for time, strand in enumerate(positions)]
    assert len(events(monkeypatch, moments, PLATE)) == through


@pytest.mark.parametrize("arrived", [False, True])
def test_a_strand_that_takes_a_step_whole_is_tested_against_bodies_over_all_of_it(
    monkeypatch: pytest.MonkeyPatch, arrived: bool
) -> None:
    # It rides in front of the plate; the middle of its chord is behind it.
    start, end = Z + [0.11, 0, 0], Z + [0, 0.11, 0]
    moments = [(0, [start], [1]), (0.5, [(start + end) / 2], [int(arrived)]), (1, [end], [1])]
    assert bool(events(monkeypatch, moments, PLATE)) == arrived


@pytest.mark.parametrize("through", [False, True])
def test_strands_are_tested_against_each_other_where_one_takes_a_step_in_parts(
    monkeypatch: pytest.MonkeyPatch, through: bool
) -> None:
    # The first moves evenly along the second, which passes its way in the first half of the step and comes
    # back; what is written of the first in the middle is far away.
    start, end, away = Z + [0.11, 0, 0], Z + [0, 0.11, 0], Z + [5, 5, 0]
    across = np.array([[-0.05, 0.05, 0], [0.05, -0.05, 0]])
    out, back = across + [0.1, 0.1, 0], across + ([0.02, 0.02, 0] if through else [0.06, 0.06, 0])
    moments = [(0, [start, out], [1, 1]), (0.5, [away, back], [0, 1]), (1, [end, out], [1, 1])]
    assert [event.curves for event in events(monkeypatch, moments)] == [(0, 1)] * (2 if through else 0)
