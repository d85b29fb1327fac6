"""Short versions of the physics studies run and meet their goals."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hairbake.rods import Rod, Scene, Strand, straight
from physics import (
    air,
    buckling,
    cantilever,
    capstan,
    energy,
    friction,
    helix,
    impact,
    layer,
    locks,
    page,
    ropes,
    strand_friction,
    symmetries,
    tufts,
    vibration,
    whip,
)
from physics.program import Hairbake
from physics.studies import STUDIES
from physics.study import Row, Study
from support import HAIRBAKE, needs_hairbake

SHORT: dict[str, Callable[[Hairbake], Study]] = {
    "cantilever": lambda h: cantilever.study(h, gammas=(1, 30, 100), nodes=(4, 8, 12, 16)),
    "bend-twist": lambda h: buckling.bend_twist(h, gammas=(100,), nodes=(8,)),
    "lateral-buckling": lambda h: buckling.lateral(h, ratios=(0.03,), nodes=(8,)),
    "helix": lambda h: helix.study(h, curls=((0.02, 3),), gammas=(30,), nodes=(16,)),
    "frequencies": lambda h: vibration.frequencies(h, modes=1, refine=()),
    "damping": lambda h: vibration.damping(h, modes=1),
    "wind": lambda h: air.study(h, winds=(1.0,), nodes=(8,)),
    "whip": lambda h: whip.study(h, substeps=(4, 8, 16)),
    "energy": lambda h: energy.study(h, substeps=(8,)),
    "symmetries": lambda h: symmetries.study(h, schemes=("bdf2",)),
    "stick-slip": lambda h: friction.stick_slip(h, shortenings=(0.04, 0.16), steps=200),
    "incline": lambda h: friction.incline(h, ratios=(0.99, 1.2), substeps=8),
    "capstan": lambda h: capstan.study(h, cases=((0.3, 10.0), (1.0, 10.0)), frames=72),
    "rope-on-rope": lambda h: ropes.study(h, shares=(0.1,), nodes=8),
    "strand-friction": lambda h: strand_friction.study(h, cases=strand_friction.CASES[2:4], others=()),
    "crossed-cantilevers": lambda h: impact.study(h, steps=(1000, 4000, 16000), nodes=8),
    "hair-layer": lambda h: layer.study(h, layer.Box(columns=4, nodes=6), goal=0.15),
    "tufts": lambda h: tufts.study(h, cases=tufts.CASES[:1], substeps=(4,)),
    "locks": lambda h: locks.study(h, cases=(locks.Case(steps=384),), contacts=("volume",)),
}


def test_every_study_has_a_short_version() -> None:
    assert list(SHORT) == list(STUDIES)


@needs_hairbake
@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_study_meets_its_goals(name: str) -> None:
    study = SHORT[name](Hairbake(HAIRBAKE))
    goals = [row for row in study.rows if row.goal is not None]
    assert goals
    assert not [row for row in goals if not row.passed]


@needs_hairbake
def test_strand_without_contact_is_written_as_finely_as_one_with_contact() -> None:
    rod = Rod()
    points = Hairbake(HAIRBAKE).bake(Scene([Strand(rod, straight(rod, (1, 0, 0)))])).points[0][-1]
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.0101


def test_missed_goals_and_nan_are_marked() -> None:
    rows = [
        Row("a", 1.0, 1.1, 0.1, 0.01),
        Row("b", 1.0, "none", float("nan"), 0.01),
        Row("c", 1.0, 1.0, 0.0, 0.01),
    ]
    assert [row.passed for row in rows] == [False, False, True]
    table = page.table(rows)
    assert table.count("missed") == 2 and table.count('<td class="met">met') == 1


def test_page_counts_the_goals_met(tmp_path: Path) -> None:
    page.write(
        tmp_path / "index.html", [Study("S", "<p>t</p>", [Row("a", 1.0, 1.0, 0.0, 0.1)])], "hairbake 0"
    )
    assert "1 of 1 goals met" in (tmp_path / "index.html").read_text()
