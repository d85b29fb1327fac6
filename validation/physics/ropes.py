"""The rigid law at rest: a rope that falls on another and comes to rest on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import ALONG_Z, GRAVITY, HORIZONTAL, Motion, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .pairs import arc_lengths, closest
from .program import Hairbake
from .reference import planar
from .reference.crossing import Crossing, RoundRod, rest
from .study import Plot, Row, Study, absolute, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RADIUS = 2e-3
"""Radius of a rope, m."""
PRESSED = RADIUS / math.sqrt(0.6)
"""Radius of one hair of this section at the packing fraction of 0.6, m."""
YOUNG = 2.07e8
"""Young's modulus E of the upper rope, Pa."""
LENGTH, ABOVE = 0.3, 0.02
"""Length of the upper rope, and height at which it is drawn above the lower one, m."""
CROSSING = (0.75 * 0.5 * LENGTH, 0.75 * LENGTH)
"""Arc lengths of the crossing as drawn: on the lower rope and on the upper one, m."""
STIFFER = 30.0
"""Stiffness of the lower rope over that of the upper one, so that the upper one stays on it."""
FPS, SECONDS = 24.0, 4.0


def law(sine: float) -> float:
    """Distance of two guides at an angle, m: (5.10)."""
    return 2.0 * RADIUS + 2.0 * PRESSED * sine


def rope(share: float) -> Rod:
    """The upper rope with the share `share` of E. The air stops it within a second."""
    stiffness = share * YOUNG * 0.25 * np.pi * RADIUS**4
    return Rod(
        length=LENGTH,
        bending=(stiffness, stiffness),
        torsion=0.5 * stiffness,
        line_density=1320 * np.pi * RADIUS**2,
        damping=0.005,
        drag=1000.0,
        friction=0.0,
        radius=RADIUS,
    )


def below(upper: Rod) -> Rod:
    """The lower rope."""
    ei1, ei2 = upper.bending
    return replace(
        upper,
        length=0.5 * upper.length,
        bending=(STIFFER * ei1, STIFFER * ei2),
        torsion=STIFFER * upper.torsion,
    )


def scene(shares: Sequence[float], substeps: int, nodes: int) -> Scene:
    """A pair of ropes for each share of E, a metre from the next."""
    strands = []
    for i, share in enumerate(shares):
        upper = rope(share)
        lower = below(upper)
        root = (CROSSING[0] + i, ABOVE, -CROSSING[1])
        strands.append(Strand(lower, straight(lower, (1, 0, 0), (i, 0, 0)), HORIZONTAL))
        strands.append(Strand(upper, straight(upper, (0, 0, 1), root), ALONG_Z))
    return Scene(
        strands,
        frames=round(SECONDS * FPS),
        fps=FPS,
        substeps=substeps,
        nodes=nodes,
        settings={"contact": "full", "reactions": True},
    )


def theory(share: float) -> Crossing:
    """The equilibrium of both ropes."""
    upper = rope(share)

    def round_rod(rod: Rod, origin: Sequence[float], direction: Sequence[float]) -> RoundRod:
        weight = rod.line_density * GRAVITY
        return RoundRod(np.array(origin), np.array(direction), rod.length, rod.bending[0], weight)

    return rest(
        round_rod(below(upper), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        round_rod(upper, (CROSSING[0], ABOVE, -CROSSING[1]), (0.0, 0.0, 1.0)),
        law,
        CROSSING,
    )


def hanging_height(share: float) -> float:
    """Height of the upper rope alone below its clamp, at the arc length of the crossing, m."""
    rod = rope(share)
    shape = planar.equilibrium(rod.line_density * GRAVITY * rod.length**3 / rod.bending[0])
    return ABOVE + float(shape.at(np.array(CROSSING[1] / LENGTH))[5]) * LENGTH


@dataclass(frozen=True)
class Rest:
    """A pair of ropes at the end."""

    share: float
    lower: FloatArray
    """Points, `n × 3`, m."""
    upper: FloatArray
    theory: Crossing
    shape: float
    """Largest distance of a point from theory, in lengths of the upper rope."""
    force: float
    """Vertical force of the lower rope on the upper one: the weight that the clamp does not bear, N."""
    speed: float
    """Largest speed, m/s."""

    @classmethod
    def read(cls, share: float, origin: float, bake: Motion, pair: int) -> "Rest":
        """Pair `pair` of a bake, whose lower rope begins at `origin`, m along x."""
        exact = theory(share)
        points = [bake.points[2 * pair + i][-1] - [origin, 0.0, 0.0] for i in range(2)]
        errors = [
            np.linalg.norm(x - part.at(arc_lengths(x, length)), axis=1).max()
            for x, part, length in zip(
                points, (exact.lower, exact.upper), (0.5 * LENGTH, LENGTH), strict=True
            )
        ]
        speeds = [np.linalg.norm(bake.velocities[2 * pair + i][-1], axis=1).max() for i in range(2)]
        if bake.clamp_forces is None:
            raise ValueError("a bake without reactions")
        force = rope(share).line_density * GRAVITY * LENGTH - bake.clamp_forces[-1, 2 * pair + 1, 1]
        return cls(
            share, points[0], points[1], exact, float(max(errors)) / LENGTH, float(force), float(max(speeds))
        )

    def rows(self) -> list[Row]:
        """Distance, lift and shape against theory."""
        name = f"{self.share:g} E"
        found = closest(self.lower, self.upper)
        required = law(found.sine)
        hanging = hanging_height(self.share)
        lift = float(self.theory.upper.at(np.array([self.theory.upper.contact]))[0, 1]) - hanging
        measured = float(found.places[1, 1]) - hanging
        # The solver of contacts may leave 0.5 % of the distance, which lowers the upper rope by as much.
        goal = 0.005 * required / lift + 0.003
        return [
            relative(f"{name}: distance of the ropes, m", required, found.distance, 0.01),
            relative(f"{name}: lift of the upper rope, m", lift, measured, goal),
            absolute(f"{name}: shape, L", self.shape, 0.003),
            relative(f"{name}: contact force, N", self.theory.upper.force[1], self.force, 0.002),
            absolute(f"{name}: speed at the end, m/s", self.speed, 1e-4),
        ]


def study(
    hairbake: Hairbake, shares: Sequence[float] = (1.0, 0.1), substeps: int = 8, nodes: int = 16
) -> Study:
    """Ropes that lie on others."""
    bake = hairbake.bake(scene(shares, substeps, nodes))
    pairs = [Rest.read(share, float(i), bake, i) for i, share in enumerate(shares)]
    rows = [row for pair in pairs for row in pair.rows()]

    def draw(axes: "Axes") -> None:
        s = np.linspace(0, LENGTH, 200)
        for pair in pairs:
            exact = pair.theory.upper.at(s)
            line = axes.plot(100 * exact[:, 2], 100 * exact[:, 1], "-", linewidth=0.8)[0]
            colour = line.get_color()
            label = f"{pair.share:g} E"
            axes.plot(
                100 * pair.upper[:, 2], 100 * pair.upper[:, 1], "o", markersize=3, color=colour, label=label
            )
            below = closest(pair.lower, pair.upper).places[0]
            axes.plot(100 * below[2], 100 * below[1], "x", color=colour)
        axes.set(xlabel="z, cm", ylabel="y, cm")
        axes.legend(fontsize=7)

    text = f"""<p>A rope of {1e3 * RADIUS:g} mm radius and {100 * LENGTH:g} cm falls {100 * ABOVE:g} cm
across another one, {STIFFER:g} times as stiff, and comes to rest on it, without friction (<code>--contact
full</code>, {FPS * substeps:g} steps a second, {nodes} nodes). Theory: Kirchhoff's equations of both ropes
with one contact, whose force acts along the common normal at the distance (5.10), by shooting with a relative
error of 1e-8. Lift is the height of the crossing above that of the upper rope alone, the elastica. Goals: at
most 1 % of the distance lost, and a shape within 3e-3 of a length.</p>"""
    caption = "The upper ropes from the side. Lines: theory; dots: hairbake; crosses: the lower ropes."
    return Study("Rope on rope", text, rows, [Plot(caption, draw)])
