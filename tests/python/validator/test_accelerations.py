"""Accelerations in the frames: good ones pass, and faults in them are caught."""

from types import SimpleNamespace

import numpy as np
import pytest
from pxr import Sdf, Vt

from hairbake_validate import tolerances
from hairbake_validate.cache import ACCELERATIONS, HAIR, Curves
from hairbake_validate.checks_motion import accelerations
from hairbake_validate.run import validate
from validator.defects import GUIDES, MIDDLE, broken
from validator.good_cache import FPS, HANDLES, SAMPLES, SHUTTER, CacheBuilder


def tell_accelerations(cache: CacheBuilder) -> None:
    """Every frame tells those of the guides."""

    def declare(layer):
        prim = Sdf.CreatePrimInLayer(layer, GUIDES)
        Sdf.AttributeSpec(prim, ACCELERATIONS, Sdf.ValueTypeNames.Vector3fArray)

    def put(layer, frame):
        declare(layer)
        times = [frame + SHUTTER * i / (SAMPLES - 1) for i in range(SAMPLES)]
        points, rates = (
            [np.array(layer.QueryTimeSample(f"{GUIDES}.{name}", time), float) for time in times]
            for name in ("points", "velocities")
        )
        for i, time in enumerate(times):
            then = i + 1 if i + 1 < SAMPLES else i - 1
            step = (times[then] - time) / FPS
            value = 2 * (points[then] - points[i] - rates[i] * step) / step**2
            layer.SetTimeSample(
                f"{GUIDES}.{ACCELERATIONS}", time, Vt.Vec3fArray.FromNumpy(value.astype("f4"))
            )

    cache.edit("hair.topology.usdc", declare)
    cache.edit("hair.manifest.usda", declare)
    for frame in HANDLES:
        cache.edit(cache.frame(frame).name, lambda layer, frame=frame: put(layer, frame))


def a_frame_without(cache):
    path = f"{GUIDES}.{ACCELERATIONS}"
    cache.edit(cache.frame(MIDDLE).name, lambda layer: layer.EraseTimeSample(path, float(MIDDLE)))


def one_too_few(cache):
    cache.edit_array(MIDDLE, f"{GUIDES}.{ACCELERATIONS}", lambda values: values[:-1])


def per_frame(cache):
    cache.edit_array(MIDDLE, f"{GUIDES}.{ACCELERATIONS}", lambda values: values / np.float32(FPS**2))


def test_accelerations_pass(good_cache):
    tell_accelerations(good_cache)
    report = validate(good_cache.directory)
    assert not broken(report), report.as_text()


@pytest.mark.parametrize(
    "check, inject",
    [("frames", a_frame_without), ("sizes", one_too_few), ("sub_frame_accelerations", per_frame)],
)
def test_fault_fails_its_own_check(good_cache, check, inject):
    tell_accelerations(good_cache)
    inject(good_cache)
    report = validate(good_cache.directory)
    assert broken(report) == {check}, report.as_text()


def worst(factor: float) -> float:
    """Largest finding over a second of a shake with one moment a frame, whose accelerations are wrong by a factor."""
    turn = 2 * np.pi * 2.5
    curves = Curves(HAIR, np.array([2]), np.zeros((2, 3), np.float32), np.full(2, 1e-4, np.float32))

    def at(values):
        return np.full((2, 3), [values, 0, 0])

    def get(_, name, offset=0):
        t = (frame + offset) / FPS
        position, rate = np.sin(turn * t), turn * np.cos(turn * t)
        step = SHUTTER / FPS
        acceleration = 2 * (np.sin(turn * (t + step)) - position - rate * step) / step**2
        return at({"points": position, "velocities": rate, ACCELERATIONS: factor * acceleration}[name])

    def found():
        cache = SimpleNamespace(curves=[curves], fps=FPS, metres_per_unit=1.0, settings={"shutter": SHUTTER})
        window = SimpleNamespace(cache=cache, frame=frame, get=get, moments=lambda *_: [0])
        return next(accelerations(window)).value

    values = []
    for frame in range(24):
        values.append(found())
    return max(values)


def test_those_of_a_shake_are_no_fault():
    assert worst(1.0) <= tolerances.ACCELERATION_RESIDUAL / 4


@pytest.mark.parametrize("factor", [-1.0, 0.0, 1 / FPS**2, 2.0])
def test_wrong_ones_are(factor):
    assert worst(factor) > tolerances.ACCELERATION_RESIDUAL
