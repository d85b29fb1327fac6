"""Velocities of curves that swing too fast for the frame rate: true ones pass, wrong ones do not."""

from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hairbake_validate import tolerances
from hairbake_validate.cache import GUIDES, HAIR, TRANSFORM, Curves
from hairbake_validate.checks_motion import (
    curve_velocities,
    head_jump,
    speed_beside,
    speed_in_head,
    spikes,
    unaccounted_jumps,
    velocities,
)
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
ALL_TOLERANCES = TOLERANCES | {spikes: tolerances.SPIKE_M}


def worst(
    check: CheckFunction,
    factor: float,
    frequency: float = FREQUENCY,
    wrong: int | None = None,
    phase: float = 0.0,
) -> float:
    """Largest finding over a second of a swinging curve, as a share of the tolerance.

    It swings with `phase`, rad, at the start. The velocities are multiplied by `factor`, in the frame `wrong`
    or in all frames.
    """
    omega = 2 * np.pi * frequency
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))

    def get(_: str, name: str, offset: int) -> Array:
        t = (frame + offset) / FPS
        if name == TRANSFORM:
            return np.eye(4)
        if name == "points":
            return np.full((2, 3), [0.03 * np.sin(omega * t + phase) + 0.2 * t, 0, 0])
        scale = factor if wrong in (None, frame + offset) else 1.0
        return scale * np.full((2, 3), [0.03 * omega * np.cos(omega * t + phase) + 0.2, 0, 0])

    cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0)
    reference = SimpleNamespace(followed=None)
    values = []
    for frame in range(24):
        window = SimpleNamespace(cache=cache, reference=reference, frame=frame, get=get)
        window.head = lambda offset, get=get: get("", TRANSFORM, offset)
        window.once = lambda compute, curves, offset=0, window=window: compute(window, curves, offset)
        values.append(next(check(window)).value)
    return max(values) / ALL_TOLERANCES[check]


def window_of(
    points: Sequence[Array], rates: Sequence[Array], heads: Sequence[FloatArray], at: int = 1
) -> Any:
    """A window at frame `at` of one curve, of frames from 0 on."""
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))
    values = {"points": points, "velocities": rates, TRANSFORM: heads}

    def get(_: str, name: str, offset: int = 0) -> Array | None:
        frame = at + offset
        return values[name][frame] if 0 <= frame < len(values[name]) else None

    cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0)
    window = SimpleNamespace(cache=cache, reference=SimpleNamespace(followed=None), frame=1000 + at, get=get)
    window.head = lambda offset: get("", TRANSFORM, offset)
    window.once = lambda compute, curves, offset=0: compute(window, curves, offset)
    return window


def heads_along(places: Sequence[float] | FloatArray) -> list[FloatArray]:
    """Transforms of a head at these places, m, along an axis."""
    heads: list[FloatArray] = [np.eye(4) for _ in places]
    for head, x in zip(heads, places, strict=True):
        head[3, 0] = x
    return heads


def along(values: Sequence[float] | FloatArray) -> list[Array]:
    """Points or velocities of a curve, all alike, along the same axis."""
    return [np.full((2, 3), [value, 0, 0]) for value in values]


def jump_of_head(places: FloatArray, at: int = 5) -> float | None:
    """Jump of velocity, m/s, of a head at these places, m, frame by frame."""
    window = window_of(along(places), along(places), heads_along(places), at)
    found = head_jump(window, window.cache.curves[0], 0)
    return None if found is None else float(found.max())


FRAMES = np.arange(11) - 5
"""The frames that tell whether the velocity of the head jumps at the one in their middle."""


@pytest.mark.parametrize("frequency", [0.5, 1.0, 1.7, 2.5, 3.1, 4.0, 5.0, 6.4, 8.0, 11.0])
def test_a_head_that_shakes_makes_no_velocity_jump(frequency: float) -> None:
    omega = 2 * np.pi * frequency
    for phase in np.linspace(0, 2 * np.pi, 37):
        assert jump_of_head(np.sin(omega * FRAMES / FPS + phase) / omega) == 0


@pytest.mark.parametrize("moment", [-2 / 3, -1 / 2, -1 / 3, 0, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 1])
def test_jumps_of_the_velocity_of_the_head_are_found_between_frames(moment: float) -> None:
    """The head stands and goes at 4 m/s; or falls freely, and is stopped from there by the ground."""
    frames = np.maximum(FRAMES - moment, 0)
    assert jump_of_head(4.0 / FPS * frames) == pytest.approx(4.0)
    time = (FRAMES - moment) / FPS
    landing = -4.0 * np.minimum(time, 0) - 9.81 / 2 * np.minimum(time, 0) ** 2
    found = jump_of_head(landing)
    assert found is not None and 1.5 < found < 4.0


def test_a_jump_two_frames_away_is_none_and_near_the_ends_nothing_is_known() -> None:
    assert jump_of_head(4.0 / FPS * np.maximum(FRAMES - 2, 0)) == 0
    assert jump_of_head(4.0 / FPS * np.maximum(FRAMES, 0), at=3) is None


@pytest.mark.parametrize("check", [velocities, curve_velocities])
@pytest.mark.parametrize("early", [False, True])
def test_hair_at_rest_before_the_head_jumps_is_measured_against_the_jump(
    check: CheckFunction, early: bool
) -> None:
    """The head stands, and goes at 4 m/s from frame 6 on; hair begins at half of it, or a frame early."""
    places = 4.0 / FPS * np.maximum(FRAMES - 1, 0)
    rates = 4.0 * np.clip(FRAMES - 0.5 + early, 0, 1)
    rates[5] *= 2.0 if early else 1.0
    window = window_of(along(places), along(rates), heads_along(places), 5)
    assert (next(check(window)).value > TOLERANCES[check]) == early


@pytest.mark.parametrize(("frequency", "factor"), [(2.5, 0.75), (2.5, 1.25), (5.0, 0.5), (5.0, 1.5)])
def test_wrong_velocities_on_a_head_that_shakes_fail(frequency: float, factor: float) -> None:
    omega = 2 * np.pi * frequency / FPS
    places, rates = 0.02 * np.sin(omega * FRAMES), 0.02 * omega * FPS * np.cos(omega * FRAMES)
    for scale, fails in ((1.0, False), (factor, True)):
        window = window_of(along(places), along(scale * rates), heads_along(places), 5)
        assert (next(velocities(window)).value > tolerances.VELOCITY_RESIDUAL) == fails


def test_the_speed_of_the_head_a_frame_away_counts_by_a_quarter() -> None:
    def beside(places: FloatArray, at: int = 5) -> float | None:
        window = window_of(along(places), along(places), heads_along(places), at)
        found = speed_beside(window, window.cache.curves[0], 0)
        return None if found is None else float(found.max())

    start = 4.0 / FPS * np.maximum(FRAMES, 0)
    assert [beside(start, at) for at in (1, 3, 5, 7)] == [None, 0.0, 1.0, 1.0]
    for phase in np.linspace(0, 2 * np.pi, 37):
        shake = beside(np.sin(10 * np.pi * FRAMES / FPS + phase) / (10 * np.pi))
        assert shake is not None and shake <= 0.25


@pytest.mark.parametrize("size", [0.0, 0.15, 0.3])
def test_a_spike_while_the_velocity_of_the_head_jumps_is_found(size: float) -> None:
    """The head goes at 2 m/s from one frame to the next, 8 cm; hair goes with it, and is off for a frame."""
    places = 2.0 / FPS * np.maximum(FRAMES, 0)
    points = places + size * (FRAMES == 0)
    window = window_of(along(points), along(2.0 * (FRAMES > 0)), heads_along(places), 5)
    assert (next(spikes(window)).value > tolerances.SPIKE_M) == (size > 0)


def test_hair_that_swings_within_few_frames_has_no_spikes() -> None:
    phases = np.linspace(0, np.pi, 5)
    swings = {
        (f, phase): worst(spikes, 1.0, f, phase=phase) for f in np.linspace(0.5, 40, 40) for phase in phases
    }
    assert max(swings.values()) < 0.02, max(swings, key=lambda swing: swings[swing])


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_hair_may_whip_as_far_as_its_guides(share: float) -> None:
    jump = 0.1 * (FRAMES > 0)
    window = window_of(along(jump), along(0 * jump), heads_along(0 * jump), 5)
    hair, head = window.cache.curves[0], window.get
    guides = Curves(GUIDES, hair.counts, hair.rest, hair.widths)
    window.cache.curves.append(guides)
    window.reference = SimpleNamespace(followed=np.array([[0, 0, 0]]))

    def get(path: str, name: str, offset: int = 0) -> Array | None:
        value: Array | None = head(path, name, offset)
        return share * value if path == GUIDES and name == "points" and value is not None else value

    window.get = get
    found = {finding.prim: finding.value for finding in spikes(window)}
    assert found == pytest.approx({HAIR: 0.1 * (1 - share), GUIDES: 0.1 * share})


@pytest.mark.parametrize("size", [0.0, 0.08])
def test_a_jump_of_hair_that_swings_is_found(size: float) -> None:
    """Hair swings by 3 cm four times a second, and jumps aside from a frame on."""
    omega = 2 * np.pi * 4 / FPS
    points = 0.03 * np.sin(omega * FRAMES) + size * (FRAMES > 0)
    rates = 0.03 * omega * FPS * np.cos(omega * FRAMES)
    window = window_of(along(points), along(rates), heads_along(np.zeros(11)), 5)
    assert (next(spikes(window)).value > tolerances.SPIKE_M) == (size > 0)


def test_what_rings_a_frame_after_a_landing_is_measured_against_the_landing() -> None:
    """The head falls at 5 m/s and stops; two frames later it goes back at a hundredth of that."""
    frames, at = np.arange(-8, 9), 10
    falling, still = 5.0 / FPS * np.minimum(frames, 0), np.zeros(len(frames))
    points, rates = falling.copy(), np.zeros(len(frames))
    points[at + 1 :], rates[at] = 1e-3, 0.05
    for heads, passes in ((falling, True), (still, False)):
        window = window_of(along(points), along(rates), heads_along(heads), at)
        assert (next(velocities(window)).value < tolerances.VELOCITY_RESIDUAL) == passes


@pytest.mark.parametrize(
    ("frequency", "factor", "share"), [(2.5, 1.0, 0.1), (5.0, 1.0, 0.2), (5.0, 0.0, 1.0)]
)
def test_hair_that_whips_beside_a_guide_at_rest_does_not_pop(
    frequency: float, factor: float, share: float
) -> None:
    """Hair turns at the frame, with true velocities or none; `share` of its jump is left at most."""
    omega = 2 * np.pi * frequency / FPS
    places, rates = 0.1 * np.cos(omega * FRAMES), -0.1 * omega * FPS * np.sin(omega * FRAMES)
    window = window_of(along(places), along(factor * rates), heads_along(np.zeros(11)), 5)
    hair = window.cache.curves[0]
    guides = Curves(GUIDES, hair.counts, hair.rest, hair.widths)
    window.cache.curves.append(guides)
    window.reference = SimpleNamespace(followed=np.array([[0, 0, 0]]))
    of_hair = window.once

    def once(compute: Any, curves: Curves, offset: int = 0) -> Any:
        return np.zeros((2, 3)) if curves is guides else of_hair(compute, curves, offset)

    window.once = once
    left = unaccounted_jumps(window, hair)
    jump = 0.1 * (1 - np.cos(omega))
    assert (
        left is not None and left.max() <= share * jump + 1e-12 and (left.max() > 0.99 * jump) == (share == 1)
    )


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
