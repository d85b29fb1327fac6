"""The rigid law: a strand pressed on another, pulled until it slips."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import ALONG_Z, Motion, Rod, Scene, Strand, quaternion, straight

from .arrays import FloatArray
from .pairs import arc_lengths
from .program import Hairbake
from .study import SCHEMES, Plot, Row, Study, absolute, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEG, CORNER, REACH = 0.08, 0.015, 0.085
"""The strand: a leg along z, a quarter of a circle, and a leg along x; lengths and radius, m."""
LENGTH = LEG + 0.5 * math.pi * CORNER + REACH
BEYOND = 0.03
"""Length beyond the crossing, m."""
CROSSING = LENGTH - BEYOND
"""Arc length of the crossing, m."""
SUPPORT = 0.08
"""Length of the other strand, which crosses it 5 cm from its root, m."""
THICKER, RIGID = 10.0, 1e6
"""Its radius and its stiffness in those of a hair."""
PRESSED = 2e-5
"""Load that presses the strands together, N."""
PULLS = (0.9, 1.1)
"""First and last pull, in that of the theory."""
SLIPPED = 1e-4
"""Displacement of the crossing from which the strand counts as slipped, m: the leg resists it with 3e-4 of
the load."""
CREEP = 1e-6
"""Goal for the displacement before, m: a hundredth of a slip."""
NEAR = 1e-3
"""Displacement, m, up to which the strands still cross where and as they were drawn."""
FPS = 24.0


@dataclass(frozen=True)
class Case:
    """Two strands that cross, and the direction of the pull."""

    mu: float
    parallel: float
    """Friction along parallel strands over that of crossing ones, a."""
    angle: float
    """Between the strands, degrees."""
    pull: float
    """Angle between the pull and the bisector of the strands, degrees."""

    @property
    def name(self) -> str:
        """For tables."""
        return f"µ = {self.mu:g}, a = {self.parallel:g}, {self.angle:g}°, pulled at {self.pull:g}°"

    @property
    def along(self) -> float:
        """Coefficient along the bisector: (5.11)."""
        return self.mu * (self.parallel + (1 - self.parallel) * math.sin(math.radians(self.angle)) ** 2)

    @property
    def threshold(self) -> float:
        """Pull over load at which the strand slips: the radius of the ellipse of friction."""
        pull = math.radians(self.pull)
        return 1 / math.hypot(math.cos(pull) / self.along, math.sin(pull) / self.mu)

    def axes(self) -> FloatArray:
        """Unit vectors along the bisector and across it, in rows. The first strand is along x."""
        half = math.radians(0.5 * self.angle)
        cos, sin = math.cos(half), math.sin(half)
        return np.array([[cos, 0.0, sin], [-sin, 0.0, cos]])

    def direction(self) -> FloatArray:
        """Unit vector of the pull."""
        pull = math.radians(self.pull)
        direction: FloatArray = np.array([math.cos(pull), math.sin(pull)]) @ self.axes()
        return direction


CASES = (
    Case(0.3, 0.5, 90, 0),
    Case(0.6, 0.5, 90, 60),
    Case(0.3, 0.5, 30, 0),
    Case(0.3, 0.5, 30, 45),
    Case(0.3, 0.5, 30, 90),
    Case(0.3, 0.1, 30, 0),
    Case(0.3, 0.1, 60, 0),
)


def distance(rod: Rod, angle: float) -> float:
    """Distance of both strands at an angle in degrees, m: (5.10)."""
    return (1 + THICKER) * rod.radius * (1 + math.sin(math.radians(angle)) / math.sqrt(0.6))


def bent(height: float) -> FloatArray:
    """Points of the strand, drawn level, `n × 3`, m: its root at x = z = 0."""
    turn = np.linspace(0.0, 0.5 * np.pi, 12)
    arc = np.stack([CORNER * (1 - np.cos(turn)), 0 * turn, LEG + CORNER * np.sin(turn)], axis=1)
    far = np.linspace(0.0, REACH, 18)[1:, None] * [1.0, 0.0, 0.0] + arc[-1]
    near = np.linspace(0.0, LEG, 17)[:-1, None] * [0.0, 0.0, 1.0]
    points: FloatArray = np.concatenate([near, arc, far]) + [0.0, height, 0.0]
    return points


def scene(cases: Sequence[Case], steps: int, substeps: int, nodes: int) -> Scene:
    """A pair of strands for each case, a metre from the next: the pulled one, and the one below it."""
    strands, loads = [], []
    for i, case in enumerate(cases):
        rod = Rod(length=LENGTH, friction=case.mu, friction_parallel=case.parallel, damping=0.005, drag=1.0)
        stiff = RIGID * rod.bending[0]
        rigid = replace(
            rod,
            length=SUPPORT,
            bending=(stiff, stiff),
            torsion=0.5 * stiff,
            line_density=THICKER**2 * rod.line_density,
            radius=THICKER * rod.radius,
        )
        origin = np.array([i, 0.0, 0.0])
        # Drawn slightly apart, so that all of the distance is kept.
        points = bent(distance(rod, case.angle) + 2e-5) + origin
        crossing = points[-1] * [1, 0, 1] - [BEYOND, 0.0, 0.0]
        turn = math.radians(case.angle)
        across = np.array([math.cos(turn), 0.0, math.sin(turn)])
        strands.append(Strand(rod, points, ALONG_Z))
        frame = quaternion(np.stack([np.cross([0.0, 1.0, 0.0], -across), [0.0, 1.0, 0.0], -across], axis=1))
        strands.append(Strand(rigid, straight(rigid, (-across).tolist(), crossing + 0.05 * across), frame))
        pulls = [[0.0, -PRESSED, 0.0]]
        pulls += [
            (share * case.threshold * PRESSED * case.direction() + pulls[0]).tolist() for share in PULLS
        ]
        force = {"frames": [-0.5 * FPS, 0, steps], "values": pulls}
        loads.append({"name": f"pull{i}", "ids": [2 * i], "arc_m": CROSSING, "force_n": force})
    return Scene(
        strands,
        frames=steps,
        fps=FPS,
        substeps=substeps,
        preroll=1.0,
        nodes=nodes,
        gravity=(0.0, 0.0, 0.0),
        loads=loads,
        settings={"scheme": SCHEMES[0], "contact": "full", "reactions": True},
    )


@dataclass(frozen=True)
class Pulled:
    """A pulled strand."""

    case: Case
    pull: FloatArray
    """Pull in every frame, over the load."""
    moved: FloatArray
    """Displacement of the crossing in every frame, m."""
    held: FloatArray
    """Force of the strand below over the load, along the bisector, across it, and up, `frames × 3`."""

    @classmethod
    def read(cls, case: Case, bake: Motion, number: int) -> "Pulled":
        """Strand `number` of a bake."""
        if bake.clamp_forces is None:
            raise ValueError("a bake without reactions")
        points = bake.points[number]
        arcs = arc_lengths(points[0], LENGTH)
        crossing = np.array([[np.interp(CROSSING, arcs, x[:, c]) for c in range(3)] for x in points])
        moved = np.linalg.norm((crossing - crossing[0])[:, [0, 2]], axis=1)
        share = np.interp(bake.times, [0.0, bake.times[-1]], PULLS)
        load = share[:, None] * case.threshold * case.direction() + [0.0, -1.0, 0.0]
        contact = -(load + bake.clamp_forces[:, number] / PRESSED)
        frame = np.array([*case.axes(), [0.0, 1.0, 0.0]])
        return cls(case, share * case.threshold, moved, contact @ frame.T)

    def rows(self) -> list[Row]:
        """The pull at which it slips, creep before, and the force while it slips."""
        case = self.case
        slips = self.moved > SLIPPED
        slip = int(np.argmax(slips))
        if not slips.any() or slip == 0:
            return [Row(f"{case.name}: pull over load", case.threshold, "no slip", float("nan"), 0.01)]
        onset = 0.5 * float(self.pull[slip] + self.pull[slip - 1])
        along, across, normal = self.held[slips & (self.moved < NEAR)].T
        # 1 on the cone of friction.
        cone = float(np.mean(np.hypot(along / case.along, across / case.mu) / normal))
        return [
            relative(f"{case.name}: pull over load where it slips", case.threshold, onset, 0.01),
            self.creep(case.name),
            relative(
                f"{case.name}: friction over its bound over the first {1e3 * NEAR:g} mm", 1.0, cone, 0.01
            ),
        ]

    def creep(self, name: str) -> Row:
        """Displacement up to 98 % of the pull at which it is to slip."""
        sticks = self.pull < 0.98 * self.case.threshold
        return absolute(f"{name}: displacement before, m", float(self.moved[sticks].max()), CREEP)


def pulled(hairbake: Hairbake, cases: Sequence[Case], steps: int, substeps: int, nodes: int) -> list[Pulled]:
    """The pulled strand of each case."""
    bake = hairbake.bake(scene(cases, steps, substeps, nodes))
    return [Pulled.read(case, bake, 2 * i) for i, case in enumerate(cases)]


def study(
    hairbake: Hairbake,
    cases: Sequence[Case] = CASES,
    steps: int = 120,
    substeps: int = 8,
    others: Sequence[int] = (4, 16, 32),
    nodes: int = 12,
) -> Study:
    """Strands pulled over others until they slip; creep of the first one with `others` sub-steps, too."""
    found = pulled(hairbake, cases, steps, substeps, nodes)
    rows = [row for each in found for row in each.rows()]
    creeping = [(substeps, found[0])]
    for other in others:
        (first,) = pulled(hairbake, cases[:1], steps, other, nodes)
        rows.append(first.creep(f"{cases[0].name}, {FPS * other:g} steps/s"))
        creeping.append((other, first))

    def draw(axes: "Axes") -> None:
        for each in found:
            share = each.pull / each.case.threshold
            axes.semilogy(share, np.maximum(each.moved, 1e-9), label=each.case.name)
        axes.axhline(SLIPPED, color="k", linewidth=0.5)
        axes.set(xlabel="pull over that of the theory", ylabel="displacement of the crossing, m")
        axes.legend(fontsize=6)

    def draw_creep(axes: "Axes") -> None:
        for number, each in creeping:
            share = each.pull / each.case.threshold
            axes.semilogy(share, np.maximum(each.moved, 1e-9), label=f"{FPS * number:g} steps/s")
        axes.axhline(CREEP, color="k", linewidth=0.5)
        axes.set(xlabel="pull over that of the theory", ylabel="displacement of the crossing, m")
        axes.legend(fontsize=7)

    def draw_ellipse(axes: "Axes") -> None:
        turn = np.linspace(0, np.pi / 2, 100)
        for case, held in [(p.case, p.held[p.moved < NEAR]) for p in found if p.case.angle == 30]:
            line = axes.plot(case.along * np.cos(turn), case.mu * np.sin(turn), "-", linewidth=0.8)[0]
            ratio = np.abs(held[:, :2] / held[:, 2:])
            axes.plot(*ratio.T, ".", markersize=3, color=line.get_color(), label=case.name)
        axes.set(xlabel="friction along the bisector over load", ylabel="across")
        axes.legend(fontsize=6)

    text = f"""<p>A bent strand of a hair's stiffness lies on a straight one, {RIGID:g} times as stiff,
without weight (<code>--contact full</code>). A load of {1e6 * PRESSED:g} µN, 1.6 weights of such a hair,
presses it on at the crossing, and a pull there grows from {PULLS[0]:g} to {PULLS[1]:g} times that of the
theory in {steps / FPS:g} s, {FPS * substeps:g} steps a second. While it sticks, nothing is bent, so the
contact bears the load and the pull exactly, in any direction. Theory: it slips where the pull leaves the
ellipse of friction, with µ across the bisector of the strands and µ (a + (1 − a) sin² α) along it, (5.11).
While it slips, the force of the contact, which that of the clamp tells, is on the ellipse. Up to 98 % of that
pull it may move by {1e6 * CREEP:g} µm. Where that is missed, the rounds of a sub-step ended, within their
tolerance, at a place from which the next one holds it: the errors of many sub-steps add up.</p>"""
    plots = [
        Plot("Strands stand still, then slip.", draw),
        Plot("Displacement of the first strand, by time step.", draw_creep),
        Plot("Force of contact (dots) and its bound, for strands at 30°.", draw_ellipse),
    ]
    return Study("Friction of a strand on a strand", text, rows, plots)
