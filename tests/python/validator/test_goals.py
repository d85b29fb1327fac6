"""The check of animated goals: curves that the guides of the good cache follow."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hairbake_validate.cache import Cache, read_value
from hairbake_validate.geometry import Array, FloatArray
from hairbake_validate.run import validate
from validator.good_cache import FIRST, GUIDE_COUNT, GUIDES, LAST, POINTS, CacheBuilder, rest_points

SHOT = range(FIRST, LAST + 1)
LENGTH = 0.2


def write_curves(path: Path, curves: FloatArray) -> None:
    points = "".join(f"v {x:.9f} {y:.9f} {z:.9f}\n" for x, y, z in curves.reshape(-1, 3))
    count = curves.shape[1]
    lines = (" ".join(str(count * c + k + 1) for k in range(count)) for c in range(len(curves)))
    path.write_text(points + "".join(f"l {line}\n" for line in lines))


def led(
    good_cache: CacheBuilder,
    values: dict[str, Any] | None = None,
    space: str = "world",
    bent: bool = False,
    overrides: dict[str, Any] | None = None,
) -> Path:
    """An animation with a goal of the `values`, in which the guides are, in another order.

    If `bent`, they are then bent away from it at the third frame. The bake was given the `overrides`.
    """
    folder = good_cache.directory.parent
    cache = Cache(good_cache.directory)
    order = [2, 0, 1]
    inputs = []
    for frame in SHOT:
        points: FloatArray = rest_points(GUIDE_COUNT)
        if space == "world":
            points = np.array(read_value(cache, frame, f"{GUIDES}.points"), float) * cache.metres_per_unit
        path = folder / f"tail.{frame}.obj"
        write_curves(path, points.reshape(GUIDE_COUNT, POINTS, 3)[order])
        inputs.append({"role": "goal", "file": path.name, "sha256": digest(path)})
    goal = {"name": "tail", "sequence": "tail.####.obj", "space": space, **(values or {})}
    anim = folder / "anim.json"
    anim.write_text(json.dumps({"metres_per_unit": 1, "up_axis": "y", "goals": [goal]}))
    inputs.append({"role": "anim", "file": anim.name, "sha256": digest(anim)})

    def record(manifest: dict[str, Any]) -> None:
        manifest["inputs"] += inputs
        figures = {"name": "tail", "guides": order, "weights": [1.0] * GUIDE_COUNT}
        manifest.setdefault("scene_figures", {})["goals"] = [figures]
        manifest.setdefault("settings", {})["set"] = overrides or {}

    if bent:
        good_cache.edit_array(FIRST + 2, f"{GUIDES}.points", bend)
    good_cache.edit_record(record)
    return anim


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def status(good_cache: CacheBuilder, anim: Path) -> tuple[str, str]:
    outcome = validate(good_cache.directory, goals=anim).outcomes["goal"]
    return outcome.status, outcome.worst.message if outcome.worst else ""


def bend(points: Array) -> Array:
    """Bends two of the three guides away beyond their middle, by up to a tenth of their length."""
    bent = points.reshape(GUIDE_COUNT, POINTS, 3).copy()
    bent[:2, POINTS // 2 :, 0] += np.linspace(0, 0.1 * LENGTH, POINTS - POINTS // 2, dtype=bent.dtype)
    return bent.reshape(-1, 3)


@pytest.mark.parametrize("space", ["world", "rest"])
def test_guides_on_their_curves_pass(good_cache: CacheBuilder, space: str) -> None:
    found, message = status(good_cache, led(good_cache, space=space))
    assert found == "pass", message


def test_guides_off_their_curves_fail(good_cache: CacheBuilder) -> None:
    anim = led(good_cache, bent=True)
    outcome = validate(good_cache.directory, goals=anim).outcomes["goal"]
    assert outcome.status == "fail" and outcome.worst is not None
    assert (outcome.worst.frame, outcome.worst.prim) == (FIRST + 2, GUIDES)
    assert 0.01 < outcome.worst.value < 0.05
    assert validate(good_cache.directory, frames=[FIRST + 1], goals=anim).outcomes["goal"].status == "pass"


@pytest.mark.parametrize(
    "free",
    [
        {"weight": 0.9},
        {"weight": {"frames": [FIRST - 9, FIRST + 3, FIRST + 9], "values": [1, 0.5, 1]}},
        {"hard_to": 0.3},
        {"hard_to": {"frames": [FIRST - 3, FIRST + 3], "values": [0.2, 1]}},
        {"along": {"arc": [0, 0.4, 1], "values": [1, 1, 0]}},
        {"weight": {"frames": [FIRST - 12, FIRST - 10], "values": [0, 1]}, "hz": 1},
        {"weight": {"frames": [FIRST - 4, FIRST - 3], "values": [0, 1]}},
    ],
)
def test_what_is_not_held_may_be_elsewhere(good_cache: CacheBuilder, free: dict[str, Any]) -> None:
    assert status(good_cache, led(good_cache, free, bent=True))[0] == "pass"


@pytest.mark.parametrize(
    "held",
    [
        {"weight": {"frames": [FIRST - 30, FIRST - 20], "values": [0, 1]}},
        {"hard_to": 1},
        {"hard_to": 0.2, "along": {"arc": [0, 1], "values": [1, 1]}},
        # Two periods after it comes to weight 1.
        {"weight": {"frames": [FIRST - 12, FIRST - 10], "values": [0, 1]}},
        {"weight": {"frames": [FIRST - 4, FIRST - 3], "values": [0, 1]}, "hz": 12},
    ],
)
def test_what_is_held_may_not(good_cache: CacheBuilder, held: dict[str, Any]) -> None:
    assert status(good_cache, led(good_cache, held, bent=True))[0] == "fail"


def test_other_files_than_those_of_the_bake_are_told(good_cache: CacheBuilder) -> None:
    anim = led(good_cache)
    curves = anim.parent / f"tail.{FIRST + 1}.obj"
    curves.write_text(curves.read_text() + "\n")
    assert status(good_cache, anim) == ("fail", f"{curves.name} is not the file of this bake")
    anim.write_text(anim.read_text() + "\n")
    assert status(good_cache, anim) == ("fail", "anim.json is not the animation of this bake")


def test_values_that_the_bake_was_given_count(good_cache: CacheBuilder) -> None:
    anim = led(good_cache, bent=True, overrides={"anim.goals[0].hard_to": 0.3, "groom.materials[0].drag": 1})
    assert status(good_cache, anim)[0] == "pass"


def test_values_that_the_bake_was_given_replace_those_of_the_file(good_cache: CacheBuilder) -> None:
    anim = led(good_cache, {"hard_to": 0.3}, bent=True, overrides={"anim.goals[0].hard_to": 1})
    assert status(good_cache, anim)[0] == "fail"


def test_goals_that_the_bake_was_not_given_are_told(good_cache: CacheBuilder) -> None:
    unlike: list[dict[str, object]] = [{"anim.goals": []}, {"anim.goals[4].hz": 2}]
    for overrides in unlike:
        found, message = status(good_cache, led(good_cache, overrides=overrides))
        assert found == "fail" and message.startswith("the goals of anim.json are not those of this bake")
