"""How adaptive wisps are held against all guides by themselves, on motions that are known."""

import json

import numpy as np
import pytest

from wisps.__main__ import NUDGE, nudged
from wisps.compare import GRAVITY, Motion, Run, changes, distances, lock_distances, locks, pops, rest

STEP = 0.01
FRAMES = 12


def run(points: np.ndarray, active: list[int] | None = None, changed: int | None = None) -> Run:
    """Two curves of two points."""
    figures = [
        {"active_nodes": 1, "splits": int(frame == changed), "merges": 0} for frame in range(len(points))
    ]
    for figure, nodes in zip(figures, active or []):
        figure["active_nodes"] = nodes
    return Run(points, np.array([2, 2]), np.array([0.1, 0.2]), 24.0, figures)


def test_distances_are_shares_of_length():
    still = np.zeros((3, 4, 3))
    moved = still.copy()
    moved[1, 1] = [0.03, 0.0, 0.04]
    assert distances(run(still), run(moved)) == pytest.approx(np.array([[0, 0], [0.25, 0], [0, 0]]))


def test_what_curves_of_a_lock_do_each_for_itself_is_not_in_its_mean():
    still = np.zeros((3, 4, 3))
    parted, moved = still.copy(), still.copy()
    # From the same root, tips to both sides; then both to one.
    parted[1, [1, 3], 0] = [0.03, -0.03]
    moved[1, [1, 3], 0] = 0.03
    assert lock_distances(run(still), run(parted)).max() < 1e-15
    # Of nine places along them the second point is the nearest to four: to the even one in the middle the root is.
    assert lock_distances(run(still), run(moved))[:, 0].mean(axis=1) == pytest.approx(
        [0, 0.03 / 0.15 * 4 / 9, 0]
    )


@pytest.mark.parametrize(
    ("anim", "gravity"),
    [
        ({}, [0, -9.81, 0]),
        ({"up_axis": "z", "gravity_m_s2": None}, [0, 0, -9.81]),
        ({"up_axis": "z", "gravity_m_s2": [1, 2, -3]}, [1, 2, -3]),
    ],
)
def test_a_nudge_is_a_millionth_more_gravity(tmp_path, anim, gravity):
    (tmp_path / "shot.json").write_text(json.dumps(anim))
    written = json.loads(nudged(tmp_path / "shot.json").read_text())
    assert written["gravity_m_s2"] == pytest.approx([(1 + NUDGE) * g for g in gravity], rel=1e-12)
    assert {k: v for k, v in written.items() if k != "gravity_m_s2"} == {
        k: v for k, v in anim.items() if k != "gravity_m_s2"
    }


def test_locks_are_of_roots_that_are_near():
    roots = np.array([0.0, 0.9, 1.0, 0.1])
    points = np.repeat(roots, 2)[None, :, None] * np.array([1.0, 0.0, 0.0])
    # Tips lie otherwise.
    points[0, 1::2, 0] = [0.0, 0.1, 0.9, 1.0]
    four = Run(points, np.array([2, 2, 2, 2]), np.full(4, 0.1), 24.0, [])
    first, second, third, fourth = locks(four, 2)
    assert first == fourth != second == third


def test_a_pop_is_told_from_hair_that_is_stirred():
    frames = np.arange(20)
    # Stirred twice as much in the second half, in which the change is.
    swing = 0.01 * (1 + (frames > 5)) * np.sin(frames)
    full, popped = (np.tile(x[:, None, None], (1, 4, 3)) for x in (swing, swing + 0.06 * (frames >= 10)))
    assert pops(run(full), run(full, changed=10)) == (1.0, 1.0)
    amid, without = pops(run(full), run(popped, changed=10))
    assert amid > 1.5 and without == 1.0


def test_rest_is_that_of_the_last_frame():
    points = np.zeros((FRAMES, 4, 3))
    points[:-1, :, 1] = 0.5
    nodes, speed = rest(run(points, active=[9] * (FRAMES - 1) + [4]))
    assert (nodes, speed) == (4, pytest.approx(0.5 * 24.0))


def falling(kick: float) -> Motion:
    """Two guides that fall freely; the second comes away at frame 5, and is `kick` quicker from the next frame on, m/s."""
    times = STEP * np.arange(FRAMES)
    velocities = np.tile(times[:, None, None] * GRAVITY, (1, 4, 1))
    points = np.tile(0.5 * times[:, None, None] ** 2 * GRAVITY, (1, 4, 1))
    velocities[6:, 2:, 0] += kick
    levels = np.zeros((FRAMES, 2), dtype=int)
    levels[5:9, 1] = 1
    return Motion(points, velocities, np.array([2, 2]), levels)


def test_a_change_without_a_jump_does_no_more_than_any_step():
    split, merged = changes(falling(0.0))
    assert (split.count, merged.count) == (1, 1)
    assert split.momentum == pytest.approx([9.81 * STEP] * 3)
    assert split.energy == pytest.approx([0.0] * 3, abs=1e-12)
    assert merged.momentum == pytest.approx([9.81 * STEP] * 3)


def test_a_jump_at_a_change_is_seen_in_the_step_from_it_on():
    split, merged = changes(falling(0.3))
    fall = 9.81 * STEP
    assert split.momentum == pytest.approx([fall, np.hypot(fall, 0.3), fall])
    assert split.energy[1] == pytest.approx(0.5 * 0.3**2) and split.energy[[0, 2]] == pytest.approx(
        [0, 0], abs=1e-12
    )
    assert merged.momentum == pytest.approx([fall] * 3)
