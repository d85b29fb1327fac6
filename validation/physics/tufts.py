"""The law of the hair's volume in motion: a tuft drawn through another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hairbake.rods import HORIZONTAL, Motion, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference.assembly import STIFFNESS, friction_bound
from .study import Plot, Row, Study, absolute, relative

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
FPS = 192.0
FRAMES = 24
"""The load rises in proportion to time, to twice the bound of friction."""
GOAL = 0.05
"""Goal for the load at which a tuft slips, and for its way: some forces are lost between nodes."""
HELD = 1e-4
"""Goal for the way of a tuft while friction holds it, m: a thousandth of that without friction."""


@dataclass(frozen=True)
class Case:
    """Tufts that friction holds."""

    name: str
    cohesion: float
    """In the bound's part from pressure, before µ."""

    @property
    def cohesion_n_m(self) -> float:
        """Cohesion, N/m."""
        return self.cohesion * friction_bound(1.0, 2 * RADIUS, STIFFNESS * MODULUS * FRACTION**3, 0.0)

    @property
    def bound(self) -> float:
        """Most friction per length of a hair, N/m."""
        pressure = STIFFNESS * MODULUS * FRACTION**3
        return friction_bound(FRICTION, 2 * RADIUS, pressure, self.cohesion_n_m)


CASES = (Case("without cohesion", 0.0), Case("with cohesion", 1.0))


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
    loads = [
        {
            "name": f"tuft{side}",
            "ids": [k for k, (i, j) in enumerate(grid) if (i + j) % 2 == side],
            "span_share": [0.0, 1.0],
            "force_n": {
                "frames": [0, FRAMES],
                "values": [[0.0, 0.0, 0.0], [0.0, 0.0, (1 - 2 * side) * 2 * case.bound]],
            },
        }
        for side in range(2)
    ]
    return Scene(
        strands,
        frames=FRAMES,
        fps=FPS,
        substeps=substeps,
        arc=list(np.linspace(0, 1, 6)),
        gravity=(0.0, 0.0, 0.0),
        loads=loads,
        settings={"contact": "volume"},
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
    """Displacement of a tuft, m: m v' is what the load exceeds the bound by, once it does."""
    end = FRAMES / FPS
    beyond = np.maximum(times - 0.5 * end, 0.0)
    found: FloatArray = 2 * case.bound / (MASS * end) * beyond**3 / 6
    return found


def rows_of(case: Case, steps: float, times: FloatArray, moved: FloatArray) -> list[Row]:
    """The way of a tuft while it is held, the load at which it slips, and its way in the end."""
    name = f"{case.name}, {steps:g} steps/s"
    exact = theory(case, times)
    held = times < 0.49 * times[-1]
    # The root of the way's cube is linear in time once a tuft slips; it starts where that line is zero.
    sliding = slice(3 * len(times) // 4, None)
    slope, start = np.polyfit(times[sliding], np.cbrt(moved[sliding]), 1)
    load = 2 * case.bound * float(-start / slope) / times[-1]
    return [
        absolute(f"{name}: way while held, m", float(np.abs(moved[held]).max()), HELD),
        relative(f"{name}: load at which it slips, N/m", case.bound, load, GOAL),
        relative(f"{name}: way at the end, m", float(exact[-1]), float(moved[-1]), GOAL),
    ]


def study(hairbake: Hairbake, cases: Sequence[Case] = CASES, substeps: Sequence[int] = (1, 4, 32)) -> Study:
    """Tufts drawn through each other."""
    rows: list[Row] = []
    curves = []
    for case in cases:
        for n in substeps:
            bake = hairbake.bake(scene(case, n))
            moved = way(bake)
            rows += rows_of(case, FPS * n, bake.times, moved)
            curves.append((case, n, bake.times, moved))

    def draw(axes: "Axes") -> None:
        colours = {case.name: f"C{i}" for i, case in enumerate(cases)}
        for case, n, times, moved in curves:
            style = ":" if n == substeps[0] else "--" if n == substeps[-1] else "-."
            label = f"{case.name}, {FPS * n:g}/s"
            axes.plot(1e3 * times, 1e3 * moved, style, color=colours[case.name], label=label)
        times = np.linspace(0, FRAMES / FPS, 100)
        for case in cases:
            axes.plot(1e3 * times, 1e3 * theory(case, times), "-", color=colours[case.name], linewidth=0.8)
        axes.set(xlabel="t, ms", ylabel="way of a tuft, mm")
        axes.legend(fontsize=6)

    text = f"""<p>Two tufts of parallel hair (µ = {FRICTION:g}, φ = {FRACTION:.3f} together), mixed like
the fields of a chessboard, are drawn across each other by opposite loads on all hairs (<code>--contact
volume</code>), which rise evenly to twice what friction holds. Their mean stands still, so each hair
slips against it by its own velocity. Theory: friction per length is at most b = µ (3π d k E φ³ + c), with
van Wyk's k of parallel hair, (5.17). Up to b a tuft is held; what the load is above b accelerates it. In
the middle, which is measured, hair is neither bent nor loses density.</p>"""
    return Study("A tuft drawn through another", text, rows, [Plot("Solid, thin: theory.", draw)])
