"""Closest approach of two strands, by splines through their points."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from .arrays import FloatArray


@dataclass(frozen=True)
class Approach:
    """Where two strands are closest to each other."""

    distance: float
    """m"""
    sine: float
    """Sine of the angle between them."""
    places: FloatArray
    """The points on the first and on the second strand, `2 × 3`, m."""


def arc_lengths(points: FloatArray, length: float) -> FloatArray:
    """Arc lengths of points (`n × 3`) of a strand, m: lengths of the chords, scaled to `length`."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    scaled: FloatArray = s * (length / s[-1])
    return scaled


def closest(first: FloatArray, second: FloatArray) -> Approach:
    """The closest approach of two strands from their points, `n × 3`, m."""
    curves = [CubicSpline(arc_lengths(x, 1.0), x) for x in (first, second)]
    # The nearest of a coarse sample, then Newton's method on lines along the tangents.
    coarse = np.linspace(0.0, 1.0, 200)
    distances = cdist(curves[0](coarse), curves[1](coarse))
    s = coarse[list(np.unravel_index(distances.argmin(), distances.shape))]
    for _ in range(5):
        tangents = np.stack([curve(u, 1) for curve, u in zip(curves, s, strict=True)], axis=1)
        apart = curves[1](s[1]) - curves[0](s[0])
        step = np.linalg.lstsq(tangents * [1.0, -1.0], apart, rcond=None)[0]
        s = np.clip(s + step, 0.0, 1.0)
    places = np.array([curve(u) for curve, u in zip(curves, s, strict=True)])
    one, other = (curve(u, 1) / np.linalg.norm(curve(u, 1)) for curve, u in zip(curves, s, strict=True))
    sine = float(np.linalg.norm(np.cross(one, other)))
    return Approach(float(np.linalg.norm(places[1] - places[0])), sine, places)
