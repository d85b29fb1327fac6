"""Whole bakes, as a user runs them, pass the validator."""

import json
from pathlib import Path

import numpy as np
import pytest

from hairbake_validate.cache import Cache
from hairbake_validate.crossing_check import samples
from hairbake_validate.geometry import FloatArray
from hairbake_validate.run import validate
from second_reader import assert_same_in_both
from support import Run

RADIUS, LENGTH, POINTS, GUIDES, STRANDS_PER_GUIDE = 0.1, 0.15, 12, 24, 3


def strands(count: int, twist: float) -> FloatArray:
    """Arcs that leave the upper half of a ball and bend down, m; `count × POINTS × 3`."""
    index = np.arange(count)
    azimuth, height = 2.4 * index + twist, 0.3 + 0.6 * (index + 0.5) / count
    flat = np.sqrt(1 - height**2)
    out = np.stack([flat * np.cos(azimuth), height, flat * np.sin(azimuth)], axis=1)
    down = np.cross(np.cross(out, [0.0, -1.0, 0.0]), out)
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    angle = np.linspace(0, 1.0, POINTS)
    along, across = LENGTH * np.sin(angle), LENGTH * (1 - np.cos(angle))
    points: FloatArray = (
        RADIUS * out[:, None] + along[:, None] * out[:, None] + across[:, None] * down[:, None]
    )
    return points


def rounded(points: FloatArray) -> list[list[float]]:
    return [list(map(float, point)) for point in points.reshape(-1, 3).round(9)]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A folder with groom.json and anim.json: a ball with short hair that shakes and travels."""
    copies = [strands(GUIDES, 0.02 * (k + 1)) for k in range(STRANDS_PER_GUIDE)]
    groom = {
        "format": "hairbake-groom",
        "version": 1,
        "guides": {"vertices": POINTS, "points": rounded(strands(GUIDES, 0.0))},
        "strands": {
            "vertices": POINTS,
            "points": rounded(np.concatenate(copies)),
            "wisp": np.tile(np.arange(GUIDES), STRANDS_PER_GUIDE).tolist(),
        },
    }
    # Samples before the first and after the last frame, for pre-roll and handles.
    time = np.arange(-4, 17) / 24
    half = 0.25 * np.sin(2 * np.pi * 1.5 * time)
    track = {
        "first_frame": 997,
        "translation": [[0.05 * float(np.sin(4 * t)), 1.6, 0.2 * float(t)] for t in time],
        "rotation_wxyz": [[float(np.cos(h)), 0.0, float(np.sin(h)), 0.0] for h in half],
    }
    anim = {
        "format": "hairbake-anim",
        "version": 1,
        "fps": 24,
        "frames": [1001, 1012],
        "bodies": [{"name": "head", "track": track}],
        "colliders": [{"name": "skull", "shape": {"type": "sphere", "centre": [0, 0, 0], "radius": RADIUS}}],
    }
    (tmp_path / "groom.json").write_text(json.dumps(groom))
    (tmp_path / "anim.json").write_text(json.dumps(anim))
    return tmp_path


def bake_and_validate(hairbake: Run, scene: Path, *options: str) -> None:
    done = hairbake(scene / "groom.json", scene / "anim.json", "-o", scene / "out", *options)
    assert done.returncode == 0, done.stderr
    report = validate(scene / "out")
    # There is nothing over a stage.
    ran = {check: outcome.status for check, outcome in report.outcomes.items() if outcome.ran}
    assert set(ran.values()) == {"pass"}, report.as_text()
    assert all(check.startswith(("over_", "deform_", "goal")) for check in report.outcomes.keys() - ran)
    assert assert_same_in_both(scene / "out") > 0


@pytest.mark.slow
def test_bake_passes_the_validator(hairbake: Run, scene: Path) -> None:
    bake_and_validate(hairbake, scene)


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["bodies", "full"])
def test_bake_of_solver_steps_passes_the_validator(hairbake: Run, scene: Path, contact: str) -> None:
    bake_and_validate(hairbake, scene, "--curves", "steps", "--contact", contact, "--no-pictures")
    assert sum(1 for _ in samples(Cache(scene / "out"))) >= 13 * 8 + 1
