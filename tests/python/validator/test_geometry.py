"""Arc lengths against helices and circles, and the bound on their error that the tolerances use."""

import numpy as np
import pytest

from hairbake_validate.geometry import FloatArray, arc_lengths, screw, spacing


def turned_about(point: FloatArray, angle: float, rise: float) -> FloatArray:
    """A rotation about the third axis through a point with a rise along it, for row vectors."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, s, 0, 0], [-s, c, 0, 0], [0, 0, 1, 0], [0, 0, rise, 1]])
    matrix[3, :2] = point[:2] - point[:2] @ matrix[:2, :2]
    return matrix


@pytest.mark.parametrize("angle", [0.0, 1e-6, -0.3, 0.9, 2.5])
def test_a_screw_is_the_velocity_of_its_points(angle: float) -> None:
    point, at = np.array([0.3, -0.2, 0]), np.array([1.0, 2.0, 3.0, 1.0])
    field = screw(turned_about(point, angle, 0.4))
    x, y = (at[:3] - point)[:2]
    np.testing.assert_allclose((at @ field)[:3], [-angle * y, angle * x, 0.4], atol=1e-9)


@pytest.mark.parametrize("pitch", [0.0, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("unevenness", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("turn", [0.1, 0.3, 0.8, 1.2])
def test_arc_error_is_bounded_and_the_bound_is_tight(pitch: float, unevenness: float, turn: float) -> None:
    rng = np.random.default_rng(4)
    shares = []
    for points in (6, 8, 16, 32):
        steps = rng.uniform(1, 1 + unevenness, points - 1)
        steps *= turn / steps.max() * np.hypot(1, pitch)
        angle = np.concatenate([[0], np.cumsum(steps)]) / np.hypot(1, pitch)
        helix = np.stack([np.cos(angle), np.sin(angle), pitch * angle], axis=-1)
        arcs = arc_lengths(helix, np.array([points]))
        shares.append(np.abs(arcs.length - steps) / arcs.error)
    assert 0.3 < np.concatenate(shares).max() <= 1


def test_arcs_are_more_accurate_than_chords() -> None:
    angle = np.linspace(0, 3, 16)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    chord = np.linalg.norm(circle[1] - circle[0])
    np.testing.assert_allclose(arc_lengths(circle, np.array([16])).length, 0.2, rtol=5e-5)
    assert abs(chord / 0.2 - 1) > 1e-3


def test_curves_of_any_size_keep_their_order() -> None:
    counts = np.array([2, 5, 3, 5])
    points = np.concatenate(
        [(k + 1) * np.outer(np.arange(count), [1.0, 0, 0]) for k, count in enumerate(counts)]
    )
    np.testing.assert_allclose(arc_lengths(points, counts).length, np.repeat([1.0, 2, 3, 4], counts - 1))


def test_curves_do_not_affect_each_other() -> None:
    rng = np.random.default_rng(7)
    counts = np.array([2, 9, 4, 3, 17])
    curves = [np.cumsum([1.0, 0, 0] + 0.3 * rng.normal(size=(count, 3)), axis=0) for count in counts]
    together = arc_lengths(np.concatenate(curves), counts)
    alone = [arc_lengths(curve, np.array([len(curve)])) for curve in curves]
    np.testing.assert_allclose(together.length, np.concatenate([a.length for a in alone]), rtol=1e-12)
    np.testing.assert_allclose(together.error, np.concatenate([a.error for a in alone]), rtol=1e-9)


def test_spacing_is_that_of_32_bit_floats() -> None:
    assert spacing(np.array([-1.5, 0.2])) == 2**-23


def test_the_error_of_arcs_covers_a_bend_that_fades_from_the_root() -> None:
    # The turns at the points are 0.53, 0.32 and 0.19: curvature falls by e within two points.
    fine = np.linspace(0, 20, 200_001)
    heading = 1.75 * (1 - np.exp(-fine / 2))
    steps = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1) * (fine[1] - fine[0])
    curve = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (steps[1:] + steps[:-1]), axis=0)])
    points = curve[::10_000]
    arcs = arc_lengths(points, np.array([len(points)]))
    assert (np.abs(arcs.length - 1) < arcs.error + 1e-7).all(), (arcs.length - 1, arcs.error)
