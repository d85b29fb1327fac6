"""A small part of the torture set: nothing passes through a body, by the independent count."""

import os
from pathlib import Path

import pytest
from physics.scene import Hairbake
from torture.__main__ import torture
from torture.scenes import SCENES

HAIRBAKE = os.environ.get("HAIRBAKE", "")


@pytest.mark.skipif(not HAIRBAKE, reason="HAIRBAKE names no program")
@pytest.mark.parametrize("name", ["whip", "pops", "edges"])
def test_nothing_passes_through_a_body(name):
    found, events, totals = torture(Hairbake(Path(HAIRBAKE)), name, steps=5, seconds=0.3)
    assert found.body_pairs > 1000
    assert not [event for event in events if event.what != "strands"]
    assert totals["crossings"] == 0


def test_the_set_is_whole():
    assert list(SCENES) == ["whip", "dash", "pops", "edges", "closing", "crossed"]
