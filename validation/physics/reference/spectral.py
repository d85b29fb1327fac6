"""Legendre polynomials on [0, 1]: quadrature, and bases that satisfy clamped ends."""

import numpy as np
from numpy.polynomial import Legendre

from ..arrays import FloatArray


def gauss(n: int) -> tuple[FloatArray, FloatArray]:
    """Points and weights of the n-point Gauss rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def clamped(s: FloatArray, count: int, power: int) -> list[FloatArray]:
    """The functions s^power P_k(2s − 1), k < count, and their first two derivatives at the points `s`.

    Returns three arrays, `count × points`.
    """
    factor = Legendre.fromroots([0.0] * power, domain=[0, 1]) if power else Legendre([1.0], domain=[0, 1])
    factor = factor / factor(1.0)
    functions = [factor * Legendre.basis(k, domain=[0, 1]) for k in range(count)]
    return [np.array([f.deriv(d)(s) if d else f(s) for f in functions]) for d in range(3)]


def integrals(s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Integrals of the polynomial through values at the points `s`, as linear maps of these values.

    Returns the matrix of the integrals from 0 to each point, and the row of the integral from 0 to 1.
    """
    n = s.size
    primitives = [Legendre.basis(k, domain=[0, 1]).integ(lbnd=0) for k in range(n)]
    values = np.polynomial.legendre.legvander(2 * s - 1, n - 1)
    to_coefficients = np.linalg.inv(values)
    running = np.array([p(s) for p in primitives]).T @ to_coefficients
    return running, np.array([p(1.0) for p in primitives]) @ to_coefficients
