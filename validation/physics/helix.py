"""A curl that hangs under its weight."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from hairbake.rods import GRAVITY, Rod, Scene, Strand, quaternion

from .arrays import FloatArray
from .program import Hairbake
from .reference import kirchhoff
from .study import AT_REST, Plot, Row, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TEXT = """<p>A strand whose natural shape is a helix (diameter 2 cm, 3 turns in 25 cm; a tighter curl of 1
cm, 6 turns), clamped so that its axis hangs straight down, with hair's stiffness (GJ = 0.46 EI), Γ from 10
to 300. Theory: Kirchhoff's equations as a boundary-value problem for position, frame and strain (1e-8),
with the weight applied in stages. Error: the largest distance of a point of the cache's curve from the
theoretical curve, and of the tip from its tip, in L.</p>
<p>The columns theory and hairbake hold the height by which the tip hangs below the root, in L.</p>"""


def curl(length: float, diameter: float, turns: float) -> FloatArray:
    """Natural strain, 1/m, of a helix with this number of turns over its arc length."""
    rate = 2 * np.pi * turns / length
    curvature = 0.5 * diameter * rate**2
    return np.array([0.0, curvature, np.sqrt(rate**2 - curvature**2)])


def clamp(natural: FloatArray) -> FloatArray:
    """Root frame (columns) with which the axis of the helix, which is along the strain, points down."""
    axis = natural / np.linalg.norm(natural)
    turn, _ = Rotation.align_vectors([[0.0, -1.0, 0.0]], [axis])
    return turn.as_matrix()


def unloaded(natural: FloatArray, frame: FloatArray, length: float, points: int = 400) -> FloatArray:
    """The helix without load, m."""
    s = np.linspace(0.0, length, points)
    n = np.linalg.norm(natural)
    axis = natural / n
    e3 = np.array([0.0, 0, 1])
    along, across = axis * axis[2], e3 - axis * axis[2]
    side = np.cross(axis, e3)
    body = (
        s[:, None] * along + (np.sin(n * s) / n)[:, None] * across + ((1 - np.cos(n * s)) / n)[:, None] * side
    )
    curve: FloatArray = body @ frame.T
    return curve


def reference(rod: Rod, natural: FloatArray, frame: FloatArray) -> FloatArray:
    """The theoretical curve, in L."""
    stiffness = np.array([*rod.bending, rod.torsion])
    scale = rod.length**2 / stiffness[0]
    weight = np.array([0.0, -rod.line_density * GRAVITY, 0.0]) * rod.length * scale
    return kirchhoff.hanging(natural * rod.length, stiffness / stiffness[0], weight, frame)


def study(
    hairbake: Hairbake,
    curls: Sequence[tuple[float, float]] = ((0.02, 3), (0.01, 6)),
    gammas: Sequence[float] = (10, 100, 300),
    nodes: Sequence[int] = (8, 16, 32),
) -> Study:
    """Shapes against Kirchhoff's equations."""
    rows, shapes = [], []
    for diameter, turns in curls:
        natural = curl(Rod().length, diameter, turns)
        frame = clamp(natural)
        n1, n2, n3 = natural.tolist()
        rods = [Rod(natural=(n1, n2, n3)).with_weight(gamma) for gamma in gammas]
        points = unloaded(natural, frame, rods[0].length)
        exact = [reference(rod, natural, frame) for rod in rods]
        for n in nodes:
            strands = [Strand(rod, points, quaternion(frame)) for rod in rods]
            bake = hairbake.bake(Scene(strands, nodes=n, **AT_REST))
            for gamma, rod, line, found in zip(gammas, rods, exact, bake.points, strict=True):
                curve = found[-1] / rod.length
                error = max(float(np.linalg.norm(curve[-1] - line[-1])), distance(line, curve))
                name = f"{diameter * 100:g} cm curl, {turns} turns, Γ = {gamma}, {n} nodes: shape"
                heights = f"{-line[-1, 1]:.6f}", f"{-curve[-1, 1]:.6f}"
                rows.append(Row(name, *heights, error, 1e-3 if n == nodes[-1] else None))
                if n == nodes[-1]:
                    shapes.append((f"{turns} turns, Γ = {gamma}", line, curve))

    def draw(axes: "Axes") -> None:
        for i, (name, line, curve) in enumerate(shapes):
            axes.plot(line[:, 0] + 0.2 * i, line[:, 1], "k-", linewidth=0.8)
            axes.plot(curve[:, 0] + 0.2 * i, curve[:, 1], ".", markersize=3, label=name)
        axes.set(xlabel="x / L, side by side", ylabel="y / L", aspect="equal")
        axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))

    caption = "Hanging curls. Lines: theory; dots: points of the cache."
    return Study("Helix under gravity", TEXT, rows, [Plot(caption, draw)])


def distance(line: FloatArray, points: FloatArray) -> float:
    """Largest distance of points from the curve through `line`."""
    curve = CubicSpline(np.linspace(0, 1, len(line)), line)
    s = np.linspace(0, 1, 10 * len(line))
    nearest = s[cKDTree(curve(s)).query(points)[1]]
    tangent = curve(nearest, 1) / np.linalg.norm(curve(nearest, 1), axis=1, keepdims=True)
    away = points - curve(nearest)
    # The component along the curve is due to the spacing of the samples.
    return float(np.linalg.norm(away - tangent * (away * tangent).sum(axis=1, keepdims=True), axis=1).max())
