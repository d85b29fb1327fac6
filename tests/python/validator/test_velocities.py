"""Velocities of curves that swing faster than frames can tell: true ones pass, and wrong ones do not hide behind that."""

from types import SimpleNamespace

import numpy as np
import pytest

from hairbake_validate import tolerances
from hairbake_validate.cache import HAIR, Curves
from hairbake_validate.checks_motion import curve_velocities, velocities

FPS, SWINGS = 24.0, 7.0
"""Frames and swings a second."""


TOLERANCES = {
    velocities: tolerances.VELOCITY_RESIDUAL,
    curve_velocities: tolerances.CURVE_VELOCITY_RESIDUAL,
}


def worst(check, factor: float, swings: float = SWINGS, wrong: int | None = None) -> float:
    """Largest finding over a second, of a curve that swings so often, whose velocities are wrong by a factor, in one frame or in all, as a share of what is let
    pass.
    """
    turn = 2 * np.pi * swings
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))
    values = {
        "points": lambda t: np.full((2, 3), [0.03 * np.sin(turn * t) + 0.2 * t, 0, 0]),
        "velocities": lambda t: np.full((2, 3), [0.03 * turn * np.cos(turn * t) + 0.2, 0, 0]),
    }

    def scaled(name: str, frame: int) -> float:
        return factor if name == "velocities" and wrong in (None, frame) else 1.0

    def found(frame: int) -> float:
        window = SimpleNamespace(
            cache=SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0),
            frame=frame,
            get=lambda _, name, offset: scaled(name, frame + offset) * values[name]((frame + offset) / FPS),
        )
        return next(check(window)).value / TOLERANCES[check]

    return max(map(found, range(24)))


@pytest.mark.parametrize("check", TOLERANCES)
def test_a_fast_swing_is_no_fault(check):
    assert worst(check, 1.0) <= 1


@pytest.mark.parametrize("check", TOLERANCES)
@pytest.mark.parametrize("factor", [-1.0, 0.0, 1 / FPS, 0.3, 2.0])
def test_wrong_velocities_of_a_fast_swing_are(check, factor):
    assert worst(check, factor) > 1


@pytest.mark.parametrize("swings", [0.5, 2.5])
@pytest.mark.parametrize("factor", [0.6, 1.4])
def test_one_wrong_frame_of_a_slow_swing_is(swings, factor):
    assert worst(velocities, 1.0, swings) <= 0.5
    assert worst(velocities, factor, swings, wrong=12) > 1
