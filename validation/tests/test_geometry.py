"""Arc lengths against helices, and the bound on their error that the tolerances rest on."""

import numpy as np
import pytest
from hairbake_validate.geometry import arc_lengths, equal_arc_lengths, spacing


@pytest.mark.parametrize("pitch", [0.0, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("unevenness", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("turn", [0.1, 0.3, 0.8, 1.2])
def test_arc_error_is_bounded_and_the_bound_is_close(pitch, unevenness, turn):
    rng = np.random.default_rng(4)
    shares = []
    for points in (6, 8, 16, 32):
        steps = rng.uniform(1, 1 + unevenness, points - 1)
        steps *= turn / steps.max() * np.hypot(1, pitch)
        angle = np.concatenate([[0], np.cumsum(steps)]) / np.hypot(1, pitch)
        helix = np.stack([np.cos(angle), np.sin(angle), pitch * angle], axis=-1)
        length, error = equal_arc_lengths(helix[None])
        shares.append(np.abs(length[0] - steps) / error[0])
    assert 0.3 < np.concatenate(shares).max() <= 1


def test_arcs_beat_chords():
    angle = np.linspace(0, 3, 16)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    chord = np.linalg.norm(circle[1] - circle[0])
    length, _ = equal_arc_lengths(circle[None])
    np.testing.assert_allclose(length[0], 0.2, rtol=5e-5)
    assert abs(chord / 0.2 - 1) > 1e-3


def test_curves_of_any_size_stay_in_order():
    counts = np.array([2, 5, 3, 5])
    points = np.concatenate(
        [(k + 1) * np.outer(np.arange(count), [1.0, 0, 0]) for k, count in enumerate(counts)]
    )
    np.testing.assert_allclose(arc_lengths(points, counts).length, np.repeat([1.0, 2, 3, 4], counts - 1))


def test_spacing_is_that_of_32_bits():
    assert spacing(np.array([-1.5, 0.2])) == 2**-23
