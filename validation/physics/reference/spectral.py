"""Legendre polynomials on [0, 1]: quadrature and bases that satisfy clamped ends."""

import numpy as np
from numpy.polynomial import Legendre


def gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of the n-point Gauss rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def clamped(s: np.ndarray, count: int, power: int) -> list[np.ndarray]:
    """The functions s^power P_k(2s − 1), k < count, and their first two derivatives at the points `s`: three arrays
    `count × points`.
    """
    factor = Legendre.fromroots([0.0] * power, domain=[0, 1]) if power else Legendre([1.0], domain=[0, 1])
    factor = factor / factor(1.0)
    functions = [factor * Legendre.basis(k, domain=[0, 1]) for k in range(count)]
    return [np.array([f.deriv(d)(s) if d else f(s) for f in functions]) for d in range(3)]


def integrals(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matrix that takes values at the points `s` to the integrals, from 0 to each point, of the polynomial through
    them; and the row that takes them to its integral from 0 to 1.
    """
    n = s.size
    primitives = [Legendre.basis(k, domain=[0, 1]).integ(lbnd=0) for k in range(n)]
    values = np.polynomial.legendre.legvander(2 * s - 1, n - 1)
    to_coefficients = np.linalg.inv(values)
    running = np.array([p(s) for p in primitives]).T @ to_coefficients
    return running, np.array([p(1.0) for p in primitives]) @ to_coefficients
