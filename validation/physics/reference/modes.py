"""Natural frequencies of straight clamped-free rods."""

import numpy as np
from scipy.linalg import eigh

from ..arrays import FloatArray
from .spectral import clamped, gauss

MODES = 16
"""Number of polynomials in each direction."""


def frequencies(count: int, ratio: float = 1.0, turn: float = 0.0) -> FloatArray:
    """The lowest `count` angular frequencies of a pre-twisted rod, in √(EI1/ρSL⁴).

    EI2 = `ratio` · EI1, and the section turns by `turn` radians from root to tip. EI1 is the bending
    stiffness about d1, against displacement along d2. Small bending obeys (D u'')'' = ω² u with D turning
    along the rod; twist decouples. Sections have no rotary inertia.
    """
    s, w = gauss(3 * MODES)
    value, _, bend = clamped(s, MODES, 2)
    c, d = np.cos(turn * s), np.sin(turn * s)
    # D = d2 d2ᵀ + ratio d1 d1ᵀ with d1 = (c, d), d2 = (−d, c).
    stiff = [[d * d + ratio * c * c, (ratio - 1) * c * d], [(ratio - 1) * c * d, c * c + ratio * d * d]]
    k = np.block([[(bend * (w * e)) @ bend.T for e in row] for row in stiff])
    m = np.kron(np.eye(2), (value * w) @ value.T)
    squares: FloatArray = eigh(k, m, eigvals_only=True, subset_by_index=[0, count - 1])
    return np.sqrt(squares)
