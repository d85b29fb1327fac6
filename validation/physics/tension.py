"""Tensions of a strand over a cylinder, computed from its points by statics."""

from dataclasses import dataclass

import numpy as np

from hairbake.rods import GRAVITY, Rod

from .arrays import FloatArray


@dataclass(frozen=True)
class Tensions:
    """The tensions of a strand where it leaves the cylinder."""

    span: float
    """Towards the clamp, N."""
    hanging: float
    """Towards the hanging end, N."""
    angle: float
    """Angle between the pulls at both ends, rad."""
    theory: float
    """Theoretical value of `span`, from `hanging`, N."""


@dataclass(frozen=True)
class _Outline:
    """A strand in the x-y plane."""

    x: FloatArray
    """Points, `n × 2`, m."""
    s: FloatArray
    """Arc length at the points, m."""
    curvature: FloatArray
    """Curvature at the points, 1/m; 0 at both ends."""

    @classmethod
    def of(cls, points: FloatArray, length: float) -> "_Outline":
        """The outline of points (`n × 3`), with arc lengths scaled to `length`."""
        x = points[:, :2]
        edges = np.diff(x, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        s = np.concatenate([[0.0], np.cumsum(lengths)])
        s *= length / s[-1]
        turns = np.diff(np.unwrap(np.arctan2(edges[:, 1], edges[:, 0])))
        curvature = np.concatenate([[0.0], turns / (0.5 * (lengths[1:] + lengths[:-1])), [0.0]])
        return cls(x, s, curvature)

    def at(self, angle: float) -> tuple[float, float]:
        """Arc length and height at a polar angle."""
        polar = np.unwrap(np.arctan2(self.x[:, 1], self.x[:, 0]))
        return float(np.interp(-angle, -polar, self.s)), float(np.interp(-angle, -polar, self.x[:, 1]))


def span_force(outline: _Outline, rod: Rod, radius: float) -> tuple[int, FloatArray]:
    """A point in the span, and the force across the section there, N.

    The force F(s) in the span grows by the weight, and its moment bends the strand: EI κ(s) = M + F × (r −
    r0) + moment of the weight, linear in M and F. Least squares over the middle half of the span.
    """
    x, s = outline.x, outline.s
    stiffness, weight = rod.bending[0], rod.line_density * GRAVITY
    reached = s[np.argmax(np.linalg.norm(x, axis=1) < 1.02 * radius)]
    middle = np.flatnonzero((s > 0.25 * reached) & (s < 0.75 * reached))
    first = int(middle[0])
    along, (dx, dy) = s[middle] - s[first], (x[middle] - x[first]).T
    moment = weight * np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]) * np.diff(dx))])
    terms = np.stack([np.ones_like(along), dy, -dx], axis=1)
    (_, *force), *_ = np.linalg.lstsq(terms, stiffness * outline.curvature[middle] + moment, rcond=None)
    return first, np.array(force)


def tensions(points: FloatArray, rod: Rod, radius: float) -> Tensions:
    """Tensions of a strand at rest, from its points (`n × 3`, m), root first, clockwise over the cylinder.

    `radius` is that of the circle on which the strand lies. The hanging end is pulled by its weight. Along a
    free part T + EI κ²/2 − ρSg y is constant for the tangential force T, and κ = −1/R where contact begins.
    """
    outline = _Outline.of(points, rod.length)
    x, s = outline.x, outline.s
    stiffness, weight = rod.bending[0], rod.line_density * GRAVITY
    first, force = span_force(outline, rod, radius)
    tangent = x[first + 1] - x[first - 1]
    bent = 0.5 * stiffness / radius**2
    invariant = (
        force @ tangent / np.linalg.norm(tangent)
        + 0.5 * stiffness * outline.curvature[first] ** 2
        - weight * x[first, 1]
    )
    above, below = 0.5 * np.pi, 0.0
    for _ in range(10):
        (s1, y1), (s2, y2) = outline.at(above), outline.at(below)
        pull = force + [0.0, weight * (s1 - s[first])]
        span, hanging = invariant + weight * y1 - bent, weight * (y2 - x[-1, 1]) - bent
        slope = np.arctan2(pull[1], pull[0])
        above = slope + 0.5 * np.pi - np.arccos(min(span / np.linalg.norm(pull), 1.0))
        below = np.arccos(min(hanging / (weight * (s[-1] - s2)), 1.0))
    shear = (weight * (s[-1] - s2) * np.sin(below), np.sqrt(max(pull @ pull - span**2, 0.0)))
    theory = sliding_tension(hanging, (below, above), shear, rod, radius)
    return Tensions(span, hanging, slope + 0.5 * np.pi, theory)


def sliding_tension(
    tension: float, angles: tuple[float, float], shear: tuple[float, float], rod: Rod, radius: float
) -> float:
    """Tension, N, beyond a cylinder over which a heavy strand slides, from the tension before it.

    The strand is in contact between two polar `angles`, rad, 0 at the side of the hanging end. There T' = µ
    (T + ρSgR sin α) + ρSgR cos α, which without weight is the law of Euler and Eytelwein. Where contact
    begins and ends the curvature becomes constant, so the cylinder takes the `shear` force, N, at a point,
    and brakes the strand by µ times as much.
    """
    mu, weight = rod.friction, rod.line_density * GRAVITY * radius
    start, end = angles
    sin, cos = weight * (1 - mu**2) / (1 + mu**2), -2 * weight * mu / (1 + mu**2)

    def particular(angle: float) -> float:
        return float(sin * np.sin(angle) + cos * np.cos(angle))

    on = tension + mu * shear[0]
    return float(particular(end) + (on - particular(start)) * np.exp(mu * (end - start)) + mu * shear[1])
