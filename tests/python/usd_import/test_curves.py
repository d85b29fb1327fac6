"""Evaluation of basis curves against their definitions."""

import numpy as np
import pytest
from scipy.interpolate import BSpline, CubicSpline

from hairbake_usd.curves import CurveType
from hairbake_usd.exchange import FloatArray

RNG = np.random.default_rng(7)


def evaluated(controls: FloatArray, *curve: str) -> FloatArray:
    """Points of one curve of a type, basis and wrap."""
    sizes, points = CurveType(*curve).evaluate(np.array([len(controls)]), controls)
    assert sizes.tolist() == [len(points)]
    return points


def distance(points: FloatArray, path: FloatArray) -> float:
    """Largest distance of points from the points of a path."""
    return float(np.linalg.norm(points[:, None] - path[None], axis=2).min(axis=1).max())


def test_linear_curves_are_their_points() -> None:
    controls = RNG.normal(size=(5, 3))
    assert np.array_equal(evaluated(controls, "linear", "bezier", "nonperiodic"), controls)
    assert np.array_equal(evaluated(controls, "linear", "bezier", "pinned"), controls)
    closed = evaluated(controls, "linear", "bezier", "periodic")
    assert np.array_equal(closed, np.vstack([controls, controls[:1]]))


@pytest.mark.parametrize("wrap", ["nonperiodic", "pinned"])
def test_bezier_matches_bernstein_polynomials(wrap: str) -> None:
    controls = RNG.normal(size=(7, 3))
    u = np.linspace(0, 1, 4)[:, None]

    def segment(p: FloatArray) -> FloatArray:
        points: FloatArray = (
            (1 - u) ** 3 * p[0] + 3 * u * (1 - u) ** 2 * p[1] + 3 * u**2 * (1 - u) * p[2] + u**3 * p[3]
        )
        return points

    expected = np.vstack([segment(controls[:4])[:-1], segment(controls[3:])])
    assert np.allclose(evaluated(controls, "cubic", "bezier", wrap), expected, atol=1e-14)


def test_closed_bezier_is_a_circle() -> None:
    k = 4 / 3 * (np.sqrt(2) - 1)
    quarter = np.array([[1, 0, 0], [1, k, 0], [k, 1, 0]])
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], float)
    controls = np.vstack([quarter @ np.linalg.matrix_power(turn, i) for i in range(4)])
    points = evaluated(controls, "cubic", "bezier", "periodic")
    assert len(points) == 13 and np.allclose(points[0], points[-1])
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 3e-4


@pytest.mark.parametrize("wrap", ["nonperiodic", "pinned", "periodic"])
def test_bspline_matches_scipy(wrap: str) -> None:
    controls = RNG.normal(size=(8, 3))
    n = {"nonperiodic": 5, "pinned": 7, "periodic": 8}[wrap]
    if wrap == "pinned":
        whole = np.vstack([2 * controls[0] - controls[1], controls, 2 * controls[-1] - controls[-2]])
    else:
        whole = np.vstack([controls, controls[: 3 if wrap == "periodic" else 0]])
    spline = BSpline(np.arange(len(whole) + 4) - 3, whole, 3)
    points = evaluated(controls, "cubic", "bspline", wrap)
    assert np.allclose(points, spline(np.linspace(0, n, 2 * n + 1)), atol=1e-13)
    if wrap == "pinned":
        assert np.allclose(points[[0, -1]], controls[[0, -1]])


def test_catmull_rom_passes_through_its_points() -> None:
    controls = RNG.normal(size=(6, 3))
    assert np.array_equal(evaluated(controls, "cubic", "catmullRom", "pinned"), controls)
    assert np.array_equal(evaluated(controls, "cubic", "catmullRom", "nonperiodic"), controls[1:-1])
    closed = evaluated(controls, "cubic", "catmullRom", "periodic")
    assert np.array_equal(closed, np.vstack([controls[1:], controls[:2]]))


def test_points_of_a_bspline_define_its_curve() -> None:
    # A bend of 60° per segment is as coarse as grooms are.
    angle = np.arange(9) * np.pi / 3
    controls = np.stack([np.cos(angle), np.sin(angle), 0.2 * angle], axis=1)
    fine = BSpline(np.arange(13) - 3, controls, 3)(np.linspace(0, 6, 300))
    points = evaluated(controls, "cubic", "bspline", "nonperiodic")
    chords = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    through = CubicSpline(chords, points)(np.linspace(0, chords[-1], 4000))
    assert distance(fine, through) < 2e-3


def test_curves_of_different_sizes_keep_their_order() -> None:
    counts = np.array([4, 7, 4, 10])
    controls = RNG.normal(size=(counts.sum(), 3))
    sizes, points = CurveType("cubic", "bezier", "pinned").evaluate(counts, controls)
    parts = np.split(controls, np.cumsum(counts)[:-1])
    alone = [evaluated(part, "cubic", "bezier", "pinned") for part in parts]
    assert sizes.tolist() == [len(part) for part in alone]
    assert np.allclose(points, np.vstack(alone), atol=1e-15)


@pytest.mark.parametrize(
    ("curve", "count"),
    [
        (("linear", "bezier", "nonperiodic"), 1),
        (("cubic", "bezier", "nonperiodic"), 5),
        (("cubic", "bezier", "periodic"), 4),
        (("cubic", "bspline", "nonperiodic"), 3),
        (("cubic", "catmullRom", "pinned"), 1),
    ],
)
def test_invalid_counts_have_no_segments(curve: tuple[str, str, str], count: int) -> None:
    assert CurveType(*curve).segments(count) is None
