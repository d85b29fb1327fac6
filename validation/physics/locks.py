"""The law of the hair's volume where hair crosses hair: a lock that falls across another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import Motion, Rod, Scene, Strand, quaternion, straight

from .arrays import FloatArray
from .program import Hairbake
from .study import Plot, Row, Study, absolute

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SOFT = Rod(length=0.16, damping=0.005, drag=0.1)
"""A hair, with the air drag that others in a lock leave to it."""
STIFF = replace(SOFT, bending=(7.8e-7, 7.8e-7), torsion=3.6e-7)
"""It stays nearly level."""
HAIRS = 16
"""Hairs that a guide stands for."""
ABOVE = 0.03
"""Height from which the one lock falls, m."""
PLACE = np.array([0.1, 0.0, 0.0])
"""Where they cross: from the root of the lock that is held, m."""
WAY = 0.05
"""From the root of the other to there, m."""
GOAL = 0.02
"""Goal for the share of the pairs of guides that have passed each other."""


@dataclass(frozen=True)
class Case:
    """Two locks."""

    angle: float = 90.0
    """Between them, degrees."""
    steps: int = 192
    """Steps a second."""
    guides: int = 16
    """Of each lock."""
    radius: float = 0.006
    """Of each lock, m."""
    seconds: float = 1.5

    @property
    def name(self) -> str:
        """Heading."""
        return f"{self.guides} guides, {self.angle:g}°, {self.steps} steps/s, {self.seconds:g} s"


CASES = (
    Case(),
    Case(angle=45.0),
    Case(angle=30.0),
    Case(guides=5, radius=0.004),
    Case(guides=40, radius=0.01),
    Case(steps=96),
    Case(steps=384),
    Case(seconds=5.0),
)


def scene(case: Case, contact: str) -> Scene:
    """The lock that falls, then the one that is held."""

    def lock(rod: Rod, root: FloatArray, angle: float) -> list[Strand]:
        course = np.array([math.cos(angle), 0.0, math.sin(angle)])
        aside = np.array([-math.sin(angle), 0.0, math.cos(angle)])
        frame = quaternion(np.stack([-aside, [0.0, 1.0, 0.0], course], axis=1))
        strands = []
        for n in range(case.guides):
            # By the golden angle.
            place = case.radius * math.sqrt((n + 0.5) / case.guides) * np.exp(2.4j * n)
            at = root + place.real * aside + [0.0, place.imag, 0.0]
            strands.append(Strand(rod, straight(rod, list(course), list(at)), frame, HAIRS))
        return strands

    angle = math.radians(case.angle)
    course = np.array([math.cos(angle), 0.0, math.sin(angle)])
    falls = lock(SOFT, PLACE + [0.0, ABOVE, 0.0] - WAY * course, angle)
    return Scene(
        [*falls, *lock(STIFF, np.zeros(3), 0.0)],
        frames=round(24 * case.seconds),
        substeps=case.steps // 24,
        arc=list(np.linspace(0, 1, 8)),
        settings={"contact": contact},
    )


def height(a: FloatArray, b: FloatArray) -> float:
    """How far the first of two polylines is above the other where they cross seen from above, m.

    Infinitely far below where they do not.
    """
    (da, db), between = (np.diff(x, axis=0) for x in (a, b)), b[None, :-1] - a[:-1, None]

    def flat(v: FloatArray, w: FloatArray) -> FloatArray:
        product: FloatArray = v[..., 0] * w[..., 2] - v[..., 2] * w[..., 0]
        return product

    area = flat(da[:, None], db[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = flat(between, db[None]) / area, flat(between, da[:, None]) / area
    crosses = np.argwhere((s >= 0) & (s <= 1) & (t >= 0) & (t <= 1))
    if not len(crosses):
        return -math.inf
    i, j = crosses[0]
    return float((a[i] + s[i, j] * da[i] - b[j] - t[i, j] * db[j])[1])


def passed(bake: Motion, guides: int) -> FloatArray:
    """Share of the pairs of guides in which the one that fell is not above the other, in every frame."""
    shares = []
    for frame in range(len(bake.times)):
        falls, held = ([x[frame] for x in part] for part in (bake.points[:guides], bake.points[guides:]))
        shares.append(np.mean([height(a, b) < 0 for a in falls for b in held]))
    return np.array(shares)


def study(
    hairbake: Hairbake,
    cases: Sequence[Case] = CASES,
    contacts: Sequence[str] = ("bodies", "volume", "full"),
) -> Study:
    """Locks that fall on others."""
    rows: list[Row] = []
    curves = []
    for case in cases:
        for contact in contacts:
            bake = hairbake.bake(scene(case, contact))
            shares = passed(bake, case.guides)
            goal = GOAL if contact == "volume" else None
            rows.append(absolute(f"{case.name}: pairs that passed, {contact}", float(shares[-1]), goal))
            if contact == "volume":
                curves.append((case, bake.times, shares))

    def draw(axes: "Axes") -> None:
        for case, times, shares in curves:
            axes.plot(times, 100 * shares, label=case.name)
        axes.set(xlabel="t, s", ylabel="pairs that passed, %", ylim=(-2, 102))
        axes.legend(fontsize=6)

    text = f"""<p>A lock of soft hair, held at one end, falls from {100 * ABOVE:g} cm on a stiff one.
Counted are pairs of guides, one of each lock, in which the one that fell is no longer above the other. With
bodies alone all pass; rigid bundles (<code>--contact full</code>) are the reference. The volume knows where
hair of another direction is, by means over cells of 1 cm: guides may pass where locks are thinner than
a cell, and where hair moves by a good part of a cell in a step.</p>"""
    return Study("A lock that falls across another", text, rows, [Plot("Pairs that passed, volume.", draw)])
