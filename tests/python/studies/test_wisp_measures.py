"""Measures of the comparison of adaptive wisps, on motions with known results."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hairbake_validate.geometry import FloatArray
from wisps.bakes import NUDGE, nudged
from wisps.measures import (
    GRAVITY,
    GuideMotion,
    StrandMotion,
    acceleration_ratios,
    distances,
    final_state,
    level_changes,
    lock_distances,
    locks,
)

STEP = 0.01
FRAMES = 12


def two_curves(points: FloatArray, active: list[int] | None = None, split: int | None = None) -> StrandMotion:
    """Two curves of two points, with active nodes for each frame and a split in the frame `split`."""
    nodes = active or [1] * len(points)
    figures = [
        {"active_nodes": n, "splits": int(frame == split), "merges": 0} for frame, n in enumerate(nodes)
    ]
    return StrandMotion(points, np.array([2, 2]), np.array([0.1, 0.2]), 24.0, figures)


def test_distances_are_relative_to_length() -> None:
    still = np.zeros((3, 4, 3))
    moved = still.copy()
    moved[1, 1] = [0.03, 0.0, 0.04]
    expected = np.array([[0, 0], [0.25, 0], [0, 0]])
    assert distances(two_curves(still), two_curves(moved)) == pytest.approx(expected)


def test_mean_curve_of_a_lock_ignores_motion_within_the_lock() -> None:
    still = np.zeros((3, 4, 3))
    spread, moved = still.copy(), still.copy()
    # From the same root the tips move apart, or together to one side.
    spread[1, [1, 3], 0] = [0.03, -0.03]
    moved[1, [1, 3], 0] = 0.03
    assert lock_distances(two_curves(still), two_curves(spread)).max() < 1e-15
    # The second point is nearest to four of the nine places; the one in the middle rounds to the root.
    found = lock_distances(two_curves(still), two_curves(moved))[:, 0].mean(axis=1)
    assert found == pytest.approx([0, 0.03 / 0.15 * 4 / 9, 0])


@pytest.mark.parametrize(
    ("anim", "gravity"),
    [
        ({}, [0, -9.81, 0]),
        ({"up_axis": "z", "gravity_m_s2": None}, [0, 0, -9.81]),
        ({"up_axis": "z", "gravity_m_s2": [1, 2, -3]}, [1, 2, -3]),
    ],
)
def test_nudge_changes_gravity_by_one_millionth(
    tmp_path: Path, anim: dict[str, Any], gravity: list[float]
) -> None:
    (tmp_path / "shot.json").write_text(json.dumps(anim))
    written = json.loads(nudged(tmp_path / "shot.json").read_text())
    assert written.pop("gravity_m_s2") == pytest.approx([(1 + NUDGE) * g for g in gravity], rel=1e-12)
    assert written == {key: value for key, value in anim.items() if key != "gravity_m_s2"}


def test_locks_group_curves_by_near_roots() -> None:
    roots = np.array([0.0, 0.9, 1.0, 0.1])
    points = np.repeat(roots, 2)[None, :, None] * np.array([1.0, 0.0, 0.0])
    # The tips lie differently.
    points[0, 1::2, 0] = [0.0, 0.1, 0.9, 1.0]
    four = StrandMotion(points, np.array([2, 2, 2, 2]), np.full(4, 0.1), 24.0, [])
    first, second, third, fourth = locks(four, 2)
    assert first == fourth != second == third


def test_jump_at_a_split_is_distinguished_from_faster_motion() -> None:
    frames = np.arange(20)
    # The motion is twice as fast in the second half, which holds the split.
    swing = 0.01 * (1 + (frames > 5)) * np.sin(frames)
    full, jumping = (np.tile(x[:, None, None], (1, 4, 3)) for x in (swing, swing + 0.06 * (frames >= 10)))
    assert acceleration_ratios(two_curves(full), two_curves(full, split=10)) == (1.0, 1.0)
    most, fewest = acceleration_ratios(two_curves(full), two_curves(jumping, split=10))
    assert most > 1.5 and fewest == 1.0


def test_final_state_is_that_of_the_last_frame() -> None:
    points = np.zeros((FRAMES, 4, 3))
    points[:-1, :, 1] = 0.5
    nodes, speed = final_state(two_curves(points, active=[9] * (FRAMES - 1) + [4]))
    assert nodes == 4 and speed == pytest.approx(0.5 * 24.0)


def falling(kick: float) -> GuideMotion:
    """Two guides in free fall; the second splits at frame 5 and is then faster by `kick`, m/s."""
    times = STEP * np.arange(FRAMES)
    velocities = np.tile(times[:, None, None] * GRAVITY, (1, 4, 1))
    points = np.tile(0.5 * times[:, None, None] ** 2 * GRAVITY, (1, 4, 1))
    velocities[6:, 2:, 0] += kick
    levels = np.zeros((FRAMES, 2), dtype=int)
    levels[5:9, 1] = 1
    return GuideMotion(points, velocities, np.array([2, 2]), levels)


def test_smooth_split_changes_no_more_than_any_substep() -> None:
    split, merged = level_changes(falling(0.0))
    assert (split.count, merged.count) == (1, 1)
    assert split.momentum == pytest.approx([9.81 * STEP] * 3)
    assert split.energy == pytest.approx([0.0] * 3, abs=1e-12)
    assert merged.momentum == pytest.approx([9.81 * STEP] * 3)


def test_jump_at_a_split_appears_in_the_substep_from_it_on() -> None:
    split, merged = level_changes(falling(0.3))
    fall = 9.81 * STEP
    assert split.momentum == pytest.approx([fall, np.hypot(fall, 0.3), fall])
    assert split.energy[1] == pytest.approx(0.5 * 0.3**2)
    assert split.energy[[0, 2]] == pytest.approx([0, 0], abs=1e-12)
    assert merged.momentum == pytest.approx([fall] * 3)
