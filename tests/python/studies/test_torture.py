"""A small part of the torture set: nothing passes through a body or another strand, by the independent count."""

from types import SimpleNamespace

import numpy as np
import pytest

from hairbake_validate import crossing_check
from hairbake_validate.cache import GUIDES, HEAD, TRANSFORM
from physics.scene import Hairbake
from support import HAIRBAKE, needs_hairbake
from torture.__main__ import torture
from torture.scenes import SCENES


@needs_hairbake
@pytest.mark.parametrize(
    ("name", "steps"), [("whip", 5), ("pops", 5), ("edges", 5), ("edges", 1), ("crossed", 5)]
)
def test_nothing_passes_through_anything(name, steps):
    found, _, totals = torture(Hairbake(HAIRBAKE), name, steps, seconds=0.3)
    assert found.body_pairs + found.strand_pairs > 400
    assert not found.events
    assert totals["crossings"] == 0
    # Steps that are all of a film frame are taken in parts.
    assert steps > 1 or totals["halvings"] > 0


def test_the_set_is_whole():
    assert list(SCENES) == ["whip", "dash", "pops", "edges", "closing", "crossed"]


def turn(angle: float) -> np.ndarray:
    """About the third axis, for row vectors."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0, 0], [-s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("through", [False, True])
def test_crossings_of_a_turning_body_are_those_in_its_own_space(monkeypatch, through):
    # A plate that faces its axis at 0.1 m turns by a right angle. A strand within its orbit stays where it is: the chord of the plate's way goes
    # through it, the plate does not. Or it goes along, and outwards.
    corners = np.array([[0.1, -0.1, -0.1], [0.1, 0.1, -0.1], [0.1, 0, 0.1]])
    along = np.array([[0, 0, -0.05], [0, 0, 0.05]])
    at = lambda angle, radius: along + radius * np.array([np.cos(angle), np.sin(angle), 0])
    ways = [at(0.0, 0.09), at(np.pi / 2, 0.2)] if through else [at(np.pi / 4, 0.09)] * 2
    samples = [
        {f"{GUIDES}.points": points, f"{HEAD}.{TRANSFORM}": np.eye(4), f"/plate.{TRANSFORM}": turn(angle)}
        for points, angle in zip(ways, (0.0, np.pi / 2))
    ]
    monkeypatch.setattr(
        crossing_check, "read_frame", lambda _, frame: SimpleNamespace(values=samples[frame], later={})
    )
    plate = SimpleNamespace(path="/plate", points=corners, triangles=np.array([[0, 1, 2]]), deforms=False)
    guides = SimpleNamespace(
        path=GUIDES, segments=np.array([0]), curve_of_point=np.array([0, 0]), rest=at(0.0, 0.05)
    )
    cache = SimpleNamespace(curves=[guides], colliders=[plate], frames=[0, 1], first=1)
    assert len(crossing_check.count(cache).events) == through
