"""Two cantilevers that swing and meet at a point: modes with a unilateral, inelastic contact."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from ..arrays import FloatArray


@dataclass(frozen=True)
class Cantilever:
    """A straight, level cantilever that bends little, SI units."""

    length: float
    bending: float
    """EI."""
    line_density: float
    damping: float
    """Kelvin-Voigt time."""
    contact: float
    """Arc length at which it meets the other one."""


@dataclass(frozen=True)
class Modes:
    """The lowest modes of a cantilever, of unit modal mass."""

    frequency: FloatArray
    """Angular frequencies, 1/s."""
    at_contact: FloatArray
    """Displacement at the contact."""
    at_tip: FloatArray
    mean: FloatArray
    """Integral of the displacement along the cantilever, over its length."""

    @classmethod
    def of(cls, rod: Cantilever, count: int) -> "Modes":
        """The lowest `count` modes: cos k cosh k = −1 (Rao 2007, §11.5)."""
        k = np.array([wave_number(n) for n in range(count)])
        unit = 1 / np.sqrt(rod.line_density * rod.length)
        frequency = k**2 * np.sqrt(rod.bending / (rod.line_density * rod.length**4))
        end, contact = (shape(k, x) for x in (1.0, rod.contact / rod.length))
        # The integral of the shape is −(shape''')/k⁴ at the root, by the equation of the mode.
        mean = 2 * ratio(k) / k
        return cls(frequency, unit * contact, unit * end, unit * mean)


def wave_number(n: int) -> float:
    """The root of cos k cosh k = −1 number `n`, from 0."""
    middle = (n + 0.5) * np.pi
    near = 0.35 if n == 0 else 0.1
    return float(brentq(lambda k: np.cos(k) + 1 / np.cosh(k), middle - near, middle + near, xtol=1e-14))


def ratio(k: FloatArray) -> FloatArray:
    """The ratio (sinh k − sin k) / (cosh k + cos k)."""
    decay = np.exp(-k)
    found: FloatArray = (1 - decay**2 - 2 * decay * np.sin(k)) / (1 + decay**2 + 2 * decay * np.cos(k))
    return found


def shape(k: FloatArray, x: float) -> FloatArray:
    """The mode cosh kx − cos kx − ratio (sinh kx − sin kx) at the share `x` of the length.

    Its mean square is 1. Written so that no large numbers are subtracted.
    """
    decay, r = np.exp(-k), ratio(k)
    # (1 − ratio) exp(kx) / 2.
    growing = np.exp(k * (x - 1)) * (decay + np.cos(k) + np.sin(k)) / (1 + decay**2 + 2 * decay * np.cos(k))
    found: FloatArray = growing + 0.5 * (1 + r) * np.exp(-k * x) - np.cos(k * x) + r * np.sin(k * x)
    return found


@dataclass(frozen=True)
class Swing:
    """Motion of both cantilevers."""

    times: FloatArray
    upper: FloatArray
    """Displacement of the upper tip, m, upwards."""
    lower: FloatArray
    gap: FloatArray
    """Distance at the contact beyond that which is kept, m."""
    kinetic: FloatArray
    """J"""
    energy: FloatArray
    """Kinetic, elastic and gravitational, J, 0 at the start."""
    touched: float
    """Time of the first contact, s; infinity for none."""


def swing(
    pair: tuple[Cantilever, Cantilever],
    gap: float,
    gravity: float,
    times: FloatArray,
    *,
    step: float,
    modes: int,
) -> Swing:
    """Motion of an upper and a lower cantilever from rest, straight and `gap` apart, under `gravity`.

    Each mode obeys q'' + damping ω² q' + ω² q = force, solved exactly over a `step` in which the contact
    force is constant. Where a step would end without a gap, the force is that with which it ends without
    approach (Moreau 1988), or none if they part anyhow. Steps must resolve the highest mode.
    """
    both = [Modes.of(rod, modes) for rod in pair]
    frequency = np.concatenate([m.frequency for m in both])
    damping = np.repeat([rod.damping for rod in pair], modes)
    across = np.concatenate([both[0].at_contact, -both[1].at_contact])
    weight = -gravity * np.concatenate(
        [rod.line_density * rod.length * m.mean for rod, m in zip(pair, both, strict=True)]
    )
    turn, push = propagators(frequency, damping, step)
    fall = push * weight
    mobility = float(across @ (push[1] * across))
    q = np.zeros((2, 2 * modes))
    tips = np.zeros((2, 2 * modes))
    tips[0, :modes], tips[1, modes:] = both[0].at_tip, both[1].at_tip
    squares = frequency**2
    states = []
    wanted = np.rint(times / step).astype(int)
    frames = set(wanted.tolist())
    touched = float("inf")
    for n in range(int(wanted[-1]) + 1):
        if n in frames:
            states.append(q.copy())
        q = np.stack([turn[0, 0] * q[0] + turn[0, 1] * q[1], turn[1, 0] * q[0] + turn[1, 1] * q[1]]) + fall
        if gap + across @ q[0] < 0:
            approach = float(across @ q[1])
            if approach < 0:
                q += push * (across * (-approach / mobility))
                touched = min(touched, (n + 1) * step)
    found = np.array(states)
    kinetic = 0.5 * (found[:, 1] ** 2).sum(axis=1)
    energy = kinetic + 0.5 * found[:, 0] ** 2 @ squares - found[:, 0] @ weight
    upper, lower = (found[:, 0] @ tips.T).T
    return Swing(times, upper, lower, gap + found[:, 0] @ across, kinetic, energy, touched)


def propagators(frequency: FloatArray, damping: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """State after a step: from displacement and velocity, `2 × 2 × modes`; from unit force, `2 × modes`."""
    turn, push = [], []
    for w, tau in zip(frequency, damping, strict=True):
        full = expm(step * np.array([[0, 1, 0], [-w * w, -tau * w * w, 1], [0, 0, 0]]))
        turn.append(full[:2, :2])
        push.append(full[:2, 2])
    return np.moveaxis(np.array(turn), 0, -1), np.array(push).T
