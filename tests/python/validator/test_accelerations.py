"""Accelerations in the frames: true ones pass, and defects fail their check."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pxr import Sdf, Vt

from hairbake_validate import tolerances
from hairbake_validate.cache import ACCELERATIONS, GUIDES, HAIR, Curves
from hairbake_validate.checks_motion import accelerations
from hairbake_validate.geometry import Array
from hairbake_validate.run import validate
from validator.defects import MIDDLE, Defect, failed
from validator.good_cache import FPS, SAMPLES, SHUTTER, CacheBuilder

PATH = f"{GUIDES}.{ACCELERATIONS}"


def add_accelerations(cache: CacheBuilder) -> None:
    """Adds true accelerations of the guides to every sample."""

    def sample(layer: Sdf.Layer, frame: int, time: float) -> Vt.Vec3fArray:
        times = [frame + SHUTTER * i / (SAMPLES - 1) for i in range(SAMPLES)]
        i = times.index(time)
        neighbour = times[i + 1 if i + 1 < SAMPLES else i - 1]
        here, there = (
            np.array(layer.QueryTimeSample(f"{GUIDES}.points", t), float) for t in (time, neighbour)
        )
        rate = np.array(layer.QueryTimeSample(f"{GUIDES}.velocities", time), float)
        step = (neighbour - time) / FPS
        value = 2 * (there - here - rate * step) / step**2
        return Vt.Vec3fArray.FromNumpy(value.astype("f4"))

    def declare(stage: Any) -> None:
        stage.GetPrimAtPath(GUIDES).CreateAttribute(
            ACCELERATIONS, Sdf.ValueTypeNames.Vector3fArray, custom=False
        )

    cache.edit_topology(declare)
    cache.add_attribute(PATH, Sdf.ValueTypeNames.Vector3fArray, sample)


def missing_sample(cache: CacheBuilder) -> None:
    cache.edit_frame(MIDDLE, lambda layer: layer.EraseTimeSample(PATH, float(MIDDLE)))


def one_value_short(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, PATH, lambda values: values[:-1])


def per_frame_squared(cache: CacheBuilder) -> None:
    cache.edit_array(MIDDLE, PATH, lambda values: values / np.float32(FPS**2))


def test_true_accelerations_pass(good_cache: CacheBuilder) -> None:
    add_accelerations(good_cache)
    report = validate(good_cache.directory)
    assert not failed(report), report.as_text()


@pytest.mark.parametrize(
    ("check", "inject"),
    [("frames", missing_sample), ("sizes", one_value_short), ("sub_frame_accelerations", per_frame_squared)],
)
def test_defect_fails_its_own_check(good_cache: CacheBuilder, check: str, inject: Defect) -> None:
    add_accelerations(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert failed(report) == {check}, report.as_text()


def worst(factor: float) -> float:
    """Largest finding over a second of a shake with one sample a frame and accelerations times `factor`."""
    omega = 2 * np.pi * 2.5
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))

    def get(_: str, name: str, offset: int = 0) -> Array:
        t = (frame + offset) / FPS
        position, rate = np.sin(omega * t), omega * np.cos(omega * t)
        step = SHUTTER / FPS
        acceleration = 2 * (np.sin(omega * (t + step)) - position - rate * step) / step**2
        values = {"points": position, "velocities": rate, ACCELERATIONS: factor * acceleration}
        return np.full((2, 3), [values[name], 0, 0])

    cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0, settings={"shutter": SHUTTER})
    values = []
    for frame in range(24):
        window: Any = SimpleNamespace(cache=cache, frame=frame, get=get, samples=lambda *_: [0])
        values.append(next(accelerations(window)).value)
    return max(values)


def test_true_accelerations_of_a_shake_pass() -> None:
    assert worst(1.0) <= tolerances.ACCELERATION_RESIDUAL / 4


@pytest.mark.parametrize("factor", [-1.0, 0.0, 1 / FPS**2, 2.0])
def test_wrong_accelerations_of_a_shake_fail(factor: float) -> None:
    assert worst(factor) > tolerances.ACCELERATION_RESIDUAL
