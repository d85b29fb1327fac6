"""Velocities of curves that swing too fast for the frame rate: true ones pass, wrong ones do not."""

from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hairbake_validate import tolerances
from hairbake_validate.cache import HAIR, TRANSFORM, Curves
from hairbake_validate.checks_motion import curve_velocities, speed_in_head, velocities
from hairbake_validate.geometry import Array, FloatArray
from hairbake_validate.report import Finding
from validator.test_geometry import turned_about

FPS = 24.0
FREQUENCY = 7.0
"""Swings a second."""

CheckFunction = Callable[[Any], Iterator[Finding]]
TOLERANCES: dict[CheckFunction, float] = {
    velocities: tolerances.VELOCITY_RESIDUAL,
    curve_velocities: tolerances.CURVE_VELOCITY_RESIDUAL,
}


def worst(
    check: CheckFunction, factor: float, frequency: float = FREQUENCY, wrong: int | None = None
) -> float:
    """Largest finding over a second of a swinging curve, as a share of the tolerance.

    The velocities are multiplied by `factor`, in the frame `wrong` or in all frames.
    """
    omega = 2 * np.pi * frequency
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))

    def get(_: str, name: str, offset: int) -> Array:
        t = (frame + offset) / FPS
        if name == TRANSFORM:
            return np.eye(4)
        if name == "points":
            return np.full((2, 3), [0.03 * np.sin(omega * t) + 0.2 * t, 0, 0])
        scale = factor if wrong in (None, frame + offset) else 1.0
        return scale * np.full((2, 3), [0.03 * omega * np.cos(omega * t) + 0.2, 0, 0])

    cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0)
    values = []
    for frame in range(24):
        window = SimpleNamespace(cache=cache, frame=frame, get=get)
        window.once = lambda compute, curves, offset=0, window=window: compute(window, curves, offset)
        values.append(next(check(window)).value)
    return max(values) / TOLERANCES[check]


@pytest.mark.parametrize("check", [velocities, curve_velocities])
@pytest.mark.parametrize("early", [False, True])
def test_hair_at_rest_before_the_head_jumps_is_measured_against_the_jump(
    check: CheckFunction, early: bool
) -> None:
    """The head stands, and goes at 4 m/s from frame 2 on; hair begins at half of it, or a frame early."""
    heads = {offset: np.eye(4) for offset in range(-3, 4)}
    for offset, head in heads.items():
        head[3, 0] = 4.0 / FPS * max(offset - 1, 0)
    rates = {offset: 4.0 * min(max(offset - 0.5 + early, 0), 1) for offset in heads}
    rates[0] *= 2.0 if early else 1.0
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))

    def get(_: str, name: str, offset: int = 0) -> Array:
        if name == TRANSFORM:
            return heads[offset]
        return np.full((2, 3), [heads[offset][3, 0] if name == "points" else rates[offset], 0, 0])

    window = SimpleNamespace(
        cache=SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0), frame=1, get=get
    )
    window.once = lambda compute, curves, offset=0: compute(window, curves, offset)
    assert (next(check(window)).value > TOLERANCES[check]) == early


def window_of(points: Sequence[Array], rates: Sequence[Array], heads: Sequence[FloatArray]) -> Any:
    """A window at the second frame of one curve."""
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))
    values = {"points": points, "velocities": rates, TRANSFORM: heads}

    def get(_: str, name: str, offset: int = 0) -> Array | None:
        frame = 1 + offset
        return values[name][frame] if 0 <= frame < len(values[name]) else None

    cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0)
    window = SimpleNamespace(cache=cache, frame=1001, get=get)
    window.once = lambda compute, curves, offset=0: compute(window, curves, offset)
    return window


def test_points_on_a_spinning_head_have_no_speed_relative_to_it() -> None:
    # At 20 rad/s a head turns by 48° from frame to frame.
    angles = 20 / FPS * np.arange(3)
    spun = [np.array([[0.5 * np.cos(a), 0.5 * np.sin(a), 0.1]] * 2) for a in angles]
    rates = [20 * np.stack([-p[:, 1], p[:, 0], 0 * p[:, 0]], axis=1) for p in spun]
    window = window_of(spun, rates, [turned_about(np.zeros(3), a, 0.0) for a in angles])
    speeds = speed_in_head(window, window.cache.curves[0], 0)
    assert speeds is not None and speeds.max() < 1e-9


@pytest.mark.parametrize("check", TOLERANCES)
def test_fast_swing_passes(check: CheckFunction) -> None:
    assert worst(check, 1.0) <= 1


@pytest.mark.parametrize("check", TOLERANCES)
@pytest.mark.parametrize("factor", [-1.0, 0.0, 1 / FPS, 0.3, 2.0])
def test_wrong_velocities_of_a_fast_swing_fail(check: CheckFunction, factor: float) -> None:
    assert worst(check, factor) > 1


@pytest.mark.parametrize("frequency", [0.5, 2.5])
@pytest.mark.parametrize("factor", [0.6, 1.4])
def test_one_wrong_frame_of_a_slow_swing_fails(frequency: float, factor: float) -> None:
    assert worst(velocities, 1.0, frequency) <= 0.5
    assert worst(velocities, factor, frequency, wrong=12) > 1
