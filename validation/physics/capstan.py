"""The capstan: a strand drawn over a cylinder by its clamp, its other end hanging, holds T = T0 e^(µφ)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .friction import UNTURNED, ramp
from .scene import GRAVITY, HORIZONTAL, Bake, Hairbake, Rod, Scene, Strand, straight
from .study import SCHEMES, Plot, Row, Study

CYLINDER = 0.05
"""Radius, m."""
THICKNESS = 5e-4
"""Distance kept from it, m."""
RADIUS = CYLINDER + THICKNESS
"""Of the circle on which a strand lies, m."""
SPAN, HANGS = 0.2, 0.25
"""Lengths drawn before the top of the cylinder and below its side, m."""
LENGTH = SPAN + 0.5 * np.pi * RADIUS + HANGS
ABOVE = 4 * THICKNESS
"""How far above the cylinder strands are drawn, so that all of the thickness is kept, m."""
FPS, SUBSTEPS = 24.0, 8
SPEED = 7.2e-3
"""Of the clamp, away from the cylinder, m/s. Drag is then some 0.1 % of the weight."""
STILL = 2.5
"""Time in which weight is put on and the strand laid down, before time 0, s."""

CASES = (
    (0.3, 3.0),
    (0.3, 10.0),
    (0.3, 30.0),
    (0.3, 100.0),
    (1.0, 3.0),
    (1.0, 10.0),
    (1.0, 30.0),
    (1.0, 100.0),
)
"""µ, and the weight that hangs over EI/R²."""


@dataclass(frozen=True)
class Tensions:
    """What pulls a strand off the cylinder at both its ends, N, its slopes there, and what theory says of the first."""

    span: float
    hanging: float
    angle: float
    """Between these pulls, rad."""
    theory: float


def tensions(points: np.ndarray, rod: Rod) -> Tensions:
    """The forces in a strand at rest as drawn by its points, `n × 3`, in the x-y plane, root first, over the cylinder clockwise.

    Statics alone: the hanging end is pulled by its weight. The force F(s) in the span rises by the weight, and its moment bends the strand,
    EI κ(s) = M + F × (r − r0) + moment of the weight, linear in M and F: least squares over the middle of the span. Along all that is
    free T + EI κ²/2 − ρSg y is constant, T being the part of the force along the strand, and where the cylinder begins to hold it κ = −1/R.
    """
    stiffness, weight = rod.bending[0], rod.line_density * GRAVITY
    x = points[:, :2]
    ways = np.diff(x, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    s *= rod.length / s[-1]
    turns = np.diff(np.unwrap(np.arctan2(ways[:, 1], ways[:, 0])))
    curvature = np.concatenate([[0.0], turns / (0.5 * (lengths[1:] + lengths[:-1])), [0.0]])
    # Clockwise from the side at which it hangs.
    polar = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    reached = s[np.argmax(np.linalg.norm(x, axis=1) < 1.02 * RADIUS)]
    middle = np.flatnonzero((s > 0.25 * reached) & (s < 0.75 * reached))
    first = middle[0]
    along, (dx, dy) = s[middle] - s[first], (x[middle] - x[first]).T
    moment = weight * np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]) * np.diff(dx))])
    (_, *force), *_ = np.linalg.lstsq(
        np.stack([np.ones_like(along), dy, -dx], axis=1), stiffness * curvature[middle] + moment, rcond=None
    )
    force = np.array(force)
    tangent = x[first + 1] - x[first - 1]
    bent = 0.5 * stiffness / RADIUS**2
    kept = (
        force @ tangent / np.linalg.norm(tangent)
        + 0.5 * stiffness * curvature[first] ** 2
        - weight * x[first, 1]
    )

    def at(angle: float) -> tuple[float, float]:
        """Arc length and height of the place at a polar angle."""
        return float(np.interp(-angle, -polar, s)), float(np.interp(-angle, -polar, x[:, 1]))

    above, below = 0.5 * np.pi, 0.0
    for _ in range(10):
        (s1, y1), (s2, y2) = at(above), at(below)
        pull = force + [0.0, weight * (s1 - s[first])]
        span, hanging = kept + weight * y1 - bent, weight * (y2 - x[-1, 1]) - bent
        slope = np.arctan2(pull[1], pull[0])
        above = slope + 0.5 * np.pi - np.arccos(min(span / np.linalg.norm(pull), 1.0))
        below = np.arccos(min(hanging / (weight * (s[-1] - s2)), 1.0))
    shear = [weight * (s[-1] - s2) * np.sin(below), np.sqrt(max(pull @ pull - span**2, 0.0))]
    return Tensions(span, hanging, slope + 0.5 * np.pi, slides(hanging, (below, above), shear, rod))


def slides(tension: float, angles: Sequence[float], shear: Sequence[float], rod: Rod) -> float:
    """Tension, N, beyond a cylinder over which a heavy strand slides, from that before it. It lies on it between two polar `angles`, 0 at the side
    of the hanging end.

    There T' = µ (T + ρSgR sin α) + ρSgR cos α, which is Euler and Eytelwein's law for a strand of no weight. Where it begins and ends to lie on
    the cylinder its curvature is that of the cylinder, and no longer changes: the cylinder holds the `shear` force, N, by a force at that point, and so brakes
    it by µ times as much.
    """
    mu, weight = rod.friction, rod.line_density * GRAVITY * RADIUS
    start, end = angles
    sin, cos = weight * (1 - mu**2) / (1 + mu**2), -2 * weight * mu / (1 + mu**2)

    def own(angle):
        return sin * np.sin(angle) + cos * np.cos(angle)

    on = tension + mu * shear[0]
    return float(own(end) + (on - own(start)) * np.exp(mu * (end - start)) + mu * shear[1])


def strand(mu: float, taut: float, z: float) -> Strand:
    """A strand drawn straight above the cylinder."""
    rod = Rod(length=LENGTH, friction=mu, drag=0.1)
    stiffness = rod.line_density * GRAVITY * HANGS * RADIUS**2 / taut
    rod = Rod(length=LENGTH, friction=mu, drag=0.1, bending=(stiffness, stiffness), torsion=stiffness)
    return Strand(rod, straight(rod, (1, 0, 0), (-SPAN, RADIUS + ABOVE, z)), HORIZONTAL)


def pulled(t: float) -> tuple[np.ndarray, np.ndarray]:
    """The clamp comes down on the cylinder before time 0, and then draws the strands over it."""
    return np.array([-SPEED * max(t, 0.0), -ABOVE * ramp(t, -0.8, 0.0), 0.0]), UNTURNED


def scene(cases: Sequence[tuple[float, float]], frames: int, nodes: int) -> Scene:
    """A strand for each µ and tautness."""
    return Scene(
        [strand(mu, taut, 0.05 * i) for i, (mu, taut) in enumerate(cases)],
        frames=frames,
        fps=FPS,
        substeps=SUBSTEPS,
        preroll=STILL,
        arc=list(np.linspace(0, 1, nodes)),
        gravity=(0, 0, 0),
        force={"frames": [-60, -20], "values": [[0, 0, 0], [0, -GRAVITY, 0]]},
        motion=pulled,
        colliders=[
            {
                "name": "cylinder",
                "shape": {"type": "capsule", "ends": [[0, 0, -1], [0, 0, 1]], "radius": CYLINDER},
                "thickness_m": THICKNESS,
            }
        ],
        settings={"scheme": SCHEMES[1]},
    )


def study(hairbake: Hairbake, cases: Sequence[tuple[float, float]] = CASES, frames=96, nodes=33) -> Study:
    """Strands drawn over a cylinder."""
    drawn = scene(cases, frames, nodes)
    bake: Bake = hairbake.bake(drawn)
    rows, curves = [], []
    for (mu, taut), strand, points in zip(cases, drawn.strands, bake.points):
        read = [tensions(x, strand.rod) for x in points[1:]]
        off = np.array([t.span / t.theory - 1 for t in read])
        # All that was slack has long been taken up.
        sliding = slice(frames // 2, None)
        measured, theory = (
            np.array([of(t) / t.hanging for t in read[sliding]])
            for of in (lambda t: t.span, lambda t: t.theory)
        )
        error = np.abs(measured / theory - 1)
        name = f"µ = {mu:g}, T R²/EI = {taut:g}: tension above over below"
        rows.append(
            Row(f"{name}, r.m.s.", theory.mean(), measured.mean(), float(np.sqrt((error**2).mean())), 0.02)
        )
        worst = int(error.argmax())
        rows.append(Row(f"{name}, worst frame", theory[worst], measured[worst], float(error[worst]), None))
        ideal = np.mean([np.exp(mu * t.angle) for t in read[sliding]])
        rows.append(
            Row(
                "the same of a strand without weight and stiffness",
                ideal,
                measured.mean(),
                abs(measured.mean() / ideal - 1),
                None,
            )
        )
        curves.append((mu, taut, off))
    cut = max(f["shortened"] for f in bake.figures[1:])
    rows.append(Row("motions cut short", 0, cut, float(cut), 0.0))

    def draw(axes):
        for mu, taut, off in curves:
            axes.plot(bake.times[1:], 100 * off, label=f"µ = {mu:g}, {taut:g}")
        axes.axhspan(-2, 2, alpha=0.1)
        axes.set(xlabel="s", ylabel="tension above over theory − 1, %", ylim=(-10, 10))
        axes.legend(fontsize=7)

    text = f"""<p>Strands of a hair's mass hang over a cylinder of {100 * CYLINDER:g} cm, {100 * HANGS:g} cm of them freely, and are drawn over it
at {1e3 * SPEED:g} mm/s by a clamp that is {100 * SPAN:g} cm away. Their stiffness EI is chosen so that what hangs weighs 3 to 100 times EI/R². Tensions are read
from the points of the cache by statics alone: below from the weight, above from the sag and the bending of the span. Theory: Euler and Eytelwein's law
with the strand's own weight, and with the forces by which the cylinder holds a stiff strand where it comes to lie on it. {nodes} nodes, {FPS * SUBSTEPS:g} steps a second.</p>"""
    return Study(
        "The capstan", text, rows, [Plot("Tension above the cylinder while strands are drawn over it.", draw)]
    )
