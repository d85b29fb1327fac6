"""The law of the hair's volume at rest: a layer of hair in a box that its own weight compresses."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hairbake.rods import GRAVITY, HORIZONTAL, Motion, Rod, Scene, Strand, straight

from .arrays import FloatArray
from .program import Hairbake
from .reference.assembly import STIFFNESS, Fibres, layer_height, pressure
from .study import Plot, Row, Study, absolute, relative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELL = 0.01
"""Distance of the nodes of the grid, and of columns of strands as drawn, m."""
APART = 0.5 * CELL
"""Distance of strands in a column as drawn, m."""
RADIUS, MODULUS, DENSITY = 4e-5, 3.9e9, 1320.0
"""Of the hairs: radius, m; E, Pa; density, kg/m³."""
SECTION = math.pi * RADIUS**2
HAIRS = 200
"""Hairs that a strand stands for."""
REST = HAIRS * SECTION / (CELL * APART)
"""Volume fraction as drawn."""
FPS, STEPS = 24.0, 192
INNER = (0.15, 0.25)
"""Distances from the clamp between which pressure is measured, m: hair hangs from the clamp over some bending
lengths of 5 cm, and near the tips the grid smears it."""
GOAL = 0.05
"""Goal for k: of the forces some per cent are lost between the nodes (docs/theory.md §5.3)."""


@dataclass(frozen=True)
class Box:
    """Size of the layer."""

    layers: int = 32
    columns: int = 8
    length: float = 0.3
    """m"""
    seconds: float = 4.0
    nodes: int = 8

    def rod(self) -> Rod:
        """A hair that settles slowly in the air, without friction, which would carry part of the weight."""
        bending = MODULUS * 0.25 * math.pi * RADIUS**4
        return Rod(
            length=self.length,
            bending=(bending, bending),
            torsion=0.5 * bending,
            line_density=DENSITY * SECTION,
            damping=0.005,
            drag=10.0,
            friction=0.0,
            radius=RADIUS,
        )

    def scene(self) -> Scene:
        """Level strands between two walls, above a floor, none with friction."""
        rod, half = self.rod(), 0.5 * self.columns * CELL
        strands = [
            Strand(
                rod,
                straight(rod, (1, 0, 0), (0, (i + 0.5) * APART, (j + 0.5) * CELL - half)),
                HORIZONTAL,
                HAIRS,
            )
            for i in range(self.layers)
            for j in range(self.columns)
        ]
        planes = {
            "floor": ([0, 0, 0], [0, 1, 0]),
            "left": ([0, 0, -half], [0, 0, 1]),
            "right": ([0, 0, half], [0, 0, -1]),
        }
        return Scene(
            strands,
            frames=round(self.seconds * FPS),
            fps=FPS,
            substeps=round(STEPS / FPS),
            arc=list(np.linspace(0, 1, self.nodes)),
            colliders=[
                {
                    "name": name,
                    "shape": {"type": "plane", "point": point, "normal": normal},
                    "friction": 0.0,
                }
                for name, (point, normal) in planes.items()
            ],
            settings={"contact": "volume"},
        )


@dataclass(frozen=True)
class Profile:
    """Means over the inner part of the layer at each height."""

    heights: FloatArray
    """m"""
    fraction: FloatArray
    weight: FloatArray
    """Weight above, per area, Pa."""
    pressure: FloatArray
    """By van Wyk's law, Pa."""
    inner: NDArray[np.bool_]
    """Whether a height is two cells above the floor, and two below where φ falls below that at rest."""

    @classmethod
    def read(cls, bake: Motion) -> "Profile":
        """At the end of a bake."""
        fibres = Fibres.of([x[-1] for x in bake.points], HAIRS * SECTION)
        heights = np.arange(-3 * CELL, 0.2, 0.25 * CELL)
        across = [(x, z) for x in np.linspace(*INNER, 8) for z in (-0.5 * CELL, 0.5 * CELL)]
        points = np.array([(x, y, z) for x, z in across for y in heights])
        fraction = fibres.around(points, CELL).reshape(len(across), -1)
        slices = DENSITY * GRAVITY * fraction.mean(axis=0) * (heights[1] - heights[0])
        weight = np.cumsum(slices[::-1])[::-1] - 0.5 * slices
        law = pressure(fraction, REST, STIFFNESS * MODULUS).mean(axis=0)
        mean = fraction.mean(axis=0)
        top = heights[np.flatnonzero(mean > REST)[-1]]
        inner = (heights >= 2 * CELL) & (heights <= top - 2 * CELL)
        return cls(heights, mean, weight, law, inner)


def top_height(bake: Motion, box: Box) -> float:
    """Mean height of the uppermost strands over the inner part at the end, m."""
    top = bake.points[-box.columns :]
    parts = [x[-1][(x[-1][:, 0] > INNER[0]) & (x[-1][:, 0] < INNER[1]), 1] for x in top]
    return float(np.concatenate(parts).mean())


def study(hairbake: Hairbake, box: Box | None = None, goal: float = GOAL) -> Study:
    """Hair that lies on hair."""
    box = box or Box()
    bake = hairbake.bake(box.scene())
    profile = Profile.read(bake)
    inner = profile.inner
    weight, law = profile.weight[inner], profile.pressure[inner]
    share = float(law.sum() / weight.sum())
    mass = DENSITY * REST * box.layers * APART
    modulus = STIFFNESS * MODULUS
    height = layer_height(mass, DENSITY, REST, modulus, GRAVITY)
    softened = max(float(frame["hair_softened"]) for frame in bake.figures[1:])
    rows = [
        relative("pressure by van Wyk's law over the weight above, inner heights", 1.0, share, goal),
        Row(
            "the same at single heights, worst",
            1.0,
            float(law[np.abs(law / weight - 1).argmax()] / weight[np.abs(law / weight - 1).argmax()]),
            float(np.abs(law / weight - 1).max()),
            None,
        ),
        absolute("hair that the time step softens", softened, 0.0),
        relative("height of the layer, m, to the floor", height, top_height(bake, box), None),
    ]

    def draw_law(axes: "Axes") -> None:
        fraction = np.linspace(REST, 0.05, 100)
        axes.plot(fraction, pressure(fraction, REST, modulus), "k-", label="van Wyk")
        axes.plot(fraction, pressure(fraction, REST, 0.9 * modulus), "k:", label="van Wyk, 10 % softer")
        axes.plot(profile.fraction[inner], weight, "o", markersize=4, label="weight above")
        outer = np.logical_not(inner) & (profile.heights > 0) & (profile.weight > 1)
        axes.plot(
            profile.fraction[outer], profile.weight[outer], "x", markersize=4, label="near floor or top"
        )
        axes.set(xlabel="φ", ylabel="p, Pa")
        axes.legend(fontsize=7)

    def draw_profile(axes: "Axes") -> None:
        axes.plot(100 * profile.heights, profile.pressure, label="van Wyk, from φ")
        axes.plot(100 * profile.heights, profile.weight, label="weight above")
        axes.axvspan(100 * profile.heights[inner][0], 100 * profile.heights[inner][-1], alpha=0.1)
        axes.set(xlabel="height above the floor, cm", ylabel="Pa", xlim=(-3, 14))
        axes.legend(fontsize=7)

    text = f"""<p>{box.layers * box.columns} strands that stand for {HAIRS} hairs each lie in a box, φ =
{REST:.3f} as drawn, and settle under their weight for {box.seconds:g} s (<code>--contact volume</code>,
{STEPS} steps a second), which presses the layer to about half its height. Theory: the pressure of van Wyk's
law p = k E (φ³ − φ0³), with k as the theory page has it, bears the weight above. φ and the weight follow from
the points of the cache, φ by the B-splines of (5.14), averaged over where nodes may be. Within two nodes of
the floor and of the top, 2 cm, the grid does not resolve φ: at the floor and the walls it sees half of the
hair, which therefore crowds there. Inner heights exclude these; the height of the whole layer includes them,
is outside of what the grid resolves, and is for information.</p>"""
    plots = [
        Plot("Pressure by volume fraction.", draw_law),
        Plot("Pressure by height; shaded: inner heights.", draw_profile),
    ]
    return Study("A layer of hair under its weight", text, rows, plots)
