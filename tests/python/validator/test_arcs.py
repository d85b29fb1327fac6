"""Arc lengths of guides against their rest points: hairpins and rounding pass, wrong arcs do not."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from hairbake_validate import tolerances
from hairbake_validate.cache import GUIDES, Cache, Curves
from hairbake_validate.checks_topology import arcs
from hairbake_validate.geometry import FloatArray, over_chord

SEGMENTS = 40


def found(points: FloatArray, arc: FloatArray) -> tuple[float, list[str]]:
    """The largest finding of one guide as a share of the tolerance, and the messages."""
    curves = Curves(
        GUIDES,
        np.array([len(points)]),
        points.astype(np.float32),
        np.full(len(points), 1e-4, np.float32),
        arc.astype(np.float32),
    )
    findings = list(arcs(cast(Cache, SimpleNamespace(curves=[curves]))))
    values = [finding.value for finding in findings if not finding.message]
    return max(values) / tolerances.ARC_OVER_CHORD, [each.message for each in findings if each.message]


def hairpin(turns: float) -> tuple[FloatArray, FloatArray]:
    """A strand of 4 cm that runs straight, turns by `turns`, rad, about a circle of 0.3 mm, and runs on.

    Points and arc lengths; the points are evenly spaced, 1 mm apart.
    """
    fine = np.linspace(0, 0.04, 400 * SEGMENTS + 1)
    radius = 3e-4
    angle = np.clip((fine - 0.0202) / radius, 0, turns)
    steps = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * (fine[1] - fine[0])
    middle = (steps[1:] + steps[:-1]) / 2
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(middle, axis=0)])
    return points[::400], fine[::400]


@pytest.mark.parametrize("turns", [0.0, 0.5, 1.5, 2.5, 3.0])
def test_a_strand_may_fold_back_on_itself(turns: float) -> None:
    value, messages = found(*hairpin(turns))
    assert value <= 1 and not messages


@pytest.mark.parametrize("turns", [0.0, 2.5])
@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_wrong_arcs_of_a_strand_that_folds_back_are_found(turns: float, factor: float) -> None:
    points, arc = hairpin(turns)
    value, messages = found(points, factor * arc)
    assert value > 1 or messages


@pytest.mark.parametrize("curl", [0.1, 0.3])
@pytest.mark.parametrize("factor", [0.99, 1.1])
def test_wrong_arcs_of_curls_are_found(curl: float, factor: float) -> None:
    """Each segment of a circle turns by `curl`, rad: true arcs pass."""
    angle = curl * np.arange(SEGMENTS + 1)
    points = 0.01 / curl * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    arc = 0.01 * np.arange(SEGMENTS + 1)
    assert found(points, arc)[0] <= 1 and not found(points, arc)[1]
    value, messages = found(points, factor * arc)
    assert value > 1 or messages


@pytest.mark.parametrize("distance", [1.0, 30.0, 300.0, 3000.0])
def test_short_fur_of_many_points_is_measured_to_rounding(distance: float) -> None:
    """Fur of 1.8 mm with 541 points, far from the origin: segments are as short as the rounding of points."""
    rng = np.random.default_rng(3)
    arc = np.linspace(0, 1.8e-3, 541)
    for direction in rng.normal(size=(50, 3)):
        along = direction / np.linalg.norm(direction)
        points = distance * np.array([1.0, 0.9, 0.8]) + arc[:, None] * along
        value, messages = found(points, arc)
        assert value <= 1 and not messages


def test_the_length_over_a_chord_is_bounded_by_that_of_a_kink() -> None:
    """A triangle with a kink of θ in its middle is the longest; from half a turn on there is no bound."""
    kinks = np.array([0.0, 0.4, 2.0, 3.1])
    np.testing.assert_allclose(over_chord(kinks), 1 / np.cos(kinks / 2) - 1)
    assert np.isinf(over_chord(np.array([np.pi, 4.0, 6.0]))).all()
