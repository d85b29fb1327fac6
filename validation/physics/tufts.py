"""The law of the hair's volume in motion: a tuft drawn through another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

from hairbake.rods import HORIZONTAL, Motion, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference.assembly import PARALLEL, contact_load, friction_bound
from .study import Plot, Row, Study, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROWS, COLUMNS, APART = 12, 32, 0.005
"""The lattice of strands, wide along the pull, and their distance, m: half that of the grid's nodes."""
RADIUS, MODULUS, DENSITY = 4e-5, 3.9e9, 1320.0
"""Of the hairs: radius, m; E, Pa; density, kg/m³."""
SECTION = math.pi * RADIUS**2
MASS = DENSITY * SECTION
"""Per length, kg/m."""
HAIRS = 50
"""Hairs that a strand stands for."""
FRACTION = HAIRS * SECTION / APART**2
"""Volume fraction φ of both tufts together."""
FRICTION, LENGTH = 0.3, 0.15
STICK = 0.01
"""Slip at which friction is at 1/√2 of its bound, m/s: (5.17)."""
FPS = 192.0
GOAL = 0.05
"""Goal for the bound of friction, and for the way: of the forces some per cent are lost between the nodes."""


@dataclass(frozen=True)
class Case:
    """A load on one tuft, and its opposite on the other."""

    name: str
    pull: float
    """Load over the bound of friction."""
    cohesion: float
    """In the bound's part from pressure, before µ."""
    frames: int

    @property
    def cohesion_n_m(self) -> float:
        """Cohesion, N/m."""
        return self.cohesion * friction_bound(1.0, 2 * RADIUS, PARALLEL * MODULUS * FRACTION**3, 0.0)

    @property
    def bound(self) -> float:
        """Most friction per length of a hair, N/m."""
        pressure = PARALLEL * MODULUS * FRACTION**3
        return friction_bound(FRICTION, 2 * RADIUS, pressure, self.cohesion_n_m)


CASES = (
    Case("0.8 of the bound", 0.8, 0.0, 12),
    Case("0.8 of the bound, with cohesion", 0.8, 1.0, 12),
    Case("2 times the bound", 2.0, 0.0, 6),
)


def scene(case: Case, substeps: int) -> Scene:
    """Parallel strands, those of both tufts in turn as on a chessboard, drawn across each other."""
    bending = MODULUS * 0.25 * math.pi * RADIUS**4
    rod = Rod(
        length=LENGTH,
        bending=(bending, bending),
        torsion=0.5 * bending,
        line_density=MASS,
        friction=FRICTION,
        cohesion=case.cohesion_n_m,
        radius=RADIUS,
    )
    grid = [(i, j) for i in range(ROWS) for j in range(COLUMNS)]
    strands = [
        Strand(rod, straight(rod, (1, 0, 0), (0, i * APART, j * APART)), HORIZONTAL, HAIRS) for i, j in grid
    ]
    force = case.pull * case.bound
    loads = [
        {
            "name": f"tuft{side}",
            "ids": [k for k, (i, j) in enumerate(grid) if (i + j) % 2 == side],
            "span_share": [0.0, 1.0],
            "force_n": [0.0, 0.0, (1 - 2 * side) * force],
        }
        for side in range(2)
    ]
    return Scene(
        strands,
        frames=case.frames,
        fps=FPS,
        substeps=substeps,
        arc=list(np.linspace(0, 1, 6)),
        gravity=(0.0, 0.0, 0.0),
        loads=loads,
    )


def way(bake: Motion) -> FloatArray:
    """Displacement of a tuft in every frame, m: half that of the strands in the middle past each other.

    Their outer half, but for the last 3 cm, where the grid smears the tips.
    """
    sums = []
    for i in range(ROWS // 2 - 1, ROWS // 2 + 1):
        for j in range(COLUMNS // 2 - 2, COLUMNS // 2 + 2):
            points = bake.points[i * COLUMNS + j]
            inner = (points[0, :, 0] > 0.5 * LENGTH) & (points[0, :, 0] < LENGTH - 0.03)
            moved = (points - points[0])[:, inner, 2].mean(axis=1)
            sums.append(moved if (i + j) % 2 == 0 else -moved)
    found: FloatArray = np.mean(sums, axis=0)
    return found


def theory(case: Case, times: FloatArray) -> FloatArray:
    """Displacement of a tuft, m: m v' = load − bound · v/√(v² + STICK²), from rest."""
    force, bound = case.pull * case.bound, case.bound

    def slope(_: float, y: FloatArray) -> list[float]:
        return [float(y[1]), (force - bound * float(y[1]) / math.hypot(float(y[1]), STICK)) / MASS]

    solved = solve_ivp(slope, (0.0, times[-1]), [0.0, 0.0], "Radau", t_eval=times, rtol=1e-9, atol=1e-12)
    found: FloatArray = solved.y[0]
    return found


def rows_of(case: Case, steps: float, times: FloatArray, moved: FloatArray, goal: float | None) -> list[Row]:
    """The bound by the speed of a tuft that creeps, or the way of one that slides."""
    name = f"{case.name}, {steps:g} steps/s"
    if case.pull > 1:
        return [relative(f"{name}: way, m", theory(case, times)[-1], moved[-1], goal)]
    half = len(times) // 2
    speed = float((moved[-1] - moved[half]) / (times[-1] - times[half]))
    bound = case.pull * case.bound * math.hypot(speed, STICK) / speed
    exact = STICK * case.pull / math.sqrt(1 - case.pull**2)
    return [
        relative(f"{name}: bound of friction by the creep, N/m", case.bound, bound, goal),
        relative(f"{name}: speed of the creep, m/s", exact, speed, None),
    ]


def study(
    hairbake: Hairbake, cases: Sequence[Case] = CASES, substeps: Sequence[int] = (1, 8, 64, 256)
) -> Study:
    """Tufts drawn through each other."""
    rows: list[Row] = []
    curves = []
    for case in cases:
        for n in substeps:
            bake = hairbake.bake(scene(case, n))
            moved = way(bake)
            goal = GOAL if n in (substeps[0], substeps[-1]) else None
            rows += rows_of(case, FPS * n, bake.times, moved, goal)
            curves.append((case, n, bake.times, moved))

    pressure = PARALLEL * MODULUS * FRACTION**3
    virial = FRICTION * contact_load(2 * RADIUS, FRACTION, pressure)
    stated = friction_bound(FRICTION, 2 * RADIUS, pressure, 0.0)
    rows.append(relative("bound of (5.17) against µ times the virial's load, N/m", virial, stated, None))

    def draw(axes: "Axes") -> None:
        colours = {case.name: f"C{i}" for i, case in enumerate(cases)}
        for case, n, times, moved in curves:
            style = ":" if n == substeps[0] else "--" if n == substeps[-1] else "-."
            label = f"{case.name}, {FPS * n:g}/s"
            axes.plot(1e3 * times, 1e3 * moved, style, color=colours[case.name], label=label)
        for case in cases:
            times = np.linspace(0, case.frames / FPS, 50)
            axes.plot(1e3 * times, 1e3 * theory(case, times), "-", color=colours[case.name], linewidth=0.8)
        axes.set(xlabel="t, ms", ylabel="way of a tuft, mm")
        axes.legend(fontsize=6)

    text = f"""<p>Two tufts of parallel hair (µ = {FRICTION:g}, φ = {FRACTION:.3f} together), mixed like the
fields of a chessboard, are drawn across each other by opposite loads on all hairs (<code>--contact
volume</code>). Their mean stands still, so each hair slips against it by its own velocity. Theory: friction
per length is at most b = µ (3π d k E φ³ + c), with van Wyk's k of parallel hair, regularised below
{100 * STICK:g} cm/s, (5.17). Below b a tuft creeps, at a speed that tells b; above, what is left of the load
accelerates it. In the middle, which is measured, hair is neither bent nor loses density. The goals are for
the usual {FPS:g} steps a second and for the shortest step. Friction is explicit in time: it takes away at
most the slip at the start of a step, to which the load adds anew,
{100 * CASES[0].pull * CASES[0].bound / MASS / FPS:.0f} cm/s in a usual step. Where that is not small against
{100 * STICK:g} cm/s, hair slips that ought to hold. The last row, for information, compares (5.17) with
the load that the virial theorem gives.</p>"""
    return Study("A tuft drawn through another", text, rows, [Plot("Solid, thin: theory.", draw)])
