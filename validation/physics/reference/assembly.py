"""The mechanics of a fibre assembly, SI units: van Wyk's law, and the volume fraction of given strands."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from ..arrays import FloatArray

STIFFNESS = 1e-4
"""k of hair (docs/theory.md §5.3)."""


def pressure(fraction: FloatArray, rest: float, modulus: FloatArray | float) -> FloatArray:
    """Pressure of fibres pressed from the fraction `rest`: K (φ³ − φ0³) with K = k E (van Wyk 1946)."""
    excess: FloatArray = modulus * np.maximum(fraction**3 - rest**3, 0.0)
    return excess


def friction_bound(mu: float, diameter: float, pressure: float, cohesion: float) -> float:
    """Most friction per length of a parallel fibre under a pressure, as docs/theory.md states it: (5.17)."""
    return mu * (3 * np.pi * diameter * pressure + cohesion)


def layer_height(mass: float, density: float, rest: float, modulus: float, gravity: float) -> float:
    """Height of a layer of fibres under its own weight, of `mass` per area: ∫ dm/(ρ φ) with p = g (mass − m).

    With u = φ³ it is K/(g ρ) ∫ u^(−1/3) du from φ0³ to g mass/K + φ0³.
    """
    top, bottom = rest**3, gravity * mass / modulus + rest**3
    return float(1.5 * modulus / (gravity * density) * (bottom ** (2 / 3) - top ** (2 / 3)))


@dataclass(frozen=True)
class Fibres:
    """Pieces of strands with all their hairs."""

    places: FloatArray
    """Their middles, `n × 3`, m."""
    volumes: FloatArray
    """Volumes of the fibres, m³."""

    @classmethod
    def of(cls, strands: list[FloatArray], area: float) -> "Fibres":
        """Of points of strands, `n × 3` each, m, that stand for fibres of the sum of sections `area`, m²."""
        edges = np.concatenate([np.diff(x, axis=0) for x in strands])
        lengths = np.linalg.norm(edges, axis=1)
        places = np.concatenate([0.5 * (x[1:] + x[:-1]) for x in strands])
        return cls(places, area * lengths)

    def around(self, points: FloatArray, spacing: float) -> FloatArray:
        """Volume fraction φ at points, `m × 3`.

        (5.14) puts fibres on nodes `spacing`, m, apart by quadratic B-splines, and reads φ by the same: on
        average over positions of the nodes, by their convolution, the quintic B-spline.
        """
        kernel = BSpline.basis_element(np.arange(-3.0, 4.0), extrapolate=False)
        fraction = np.zeros(len(points))
        for i, x in enumerate(points):
            near = np.flatnonzero((np.abs(self.places - x) < 3 * spacing).all(axis=1))
            away = (self.places[near] - x) / spacing
            weight = self.volumes[near] * np.nan_to_num(kernel(away)).prod(axis=1) / spacing**3
            fraction[i] = weight.sum()
        return fraction
