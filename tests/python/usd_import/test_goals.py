"""Animated curves from USD that guides are pulled to, imported by the program."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from pxr import Gf, Usd, UsdGeom, Vt

from hairbake_usd.exchange import FloatArray
from support import Run
from usd_import.stages import INTS, Refused, add_curves, add_primvar, hanging, new_stage

FRAMES = range(1001, 1006)

Goals = Callable[..., tuple[dict[str, Any], Path, str]]
"""Imports a track with a goal and options; returns the goal, the folder of anim.json and the messages."""


@pytest.fixture
def scene(hairbake: Run, tmp_path: Path) -> Path:
    """Four guides with the ids 10, 11, 12 and 13 that do not move, in `tmp_path`; a track of five frames."""
    stage = new_stage(tmp_path / "guides.usda")
    curves = add_curves(stage, "/guides", hanging(4))
    add_primvar(curves.GetPrim(), "groom_id", INTS, "uniform", [10, 11, 12, 13])
    stage.Save()
    groom = tmp_path / "groom.json"
    options = ("--strands-per-guide", "0", "--sections", "4")
    done = hairbake("import", "groom", tmp_path / "guides.usda", *options, "-o", groom)
    assert done.returncode == 0, done.stderr
    still = {"translation": [0, 0, 0], "rotation_quat_wxyz": [1, 0, 0, 0]}
    motion = {"fps": 24, "units": "m", "up_axis": "Y", "frames": [still] * len(FRAMES)}
    (tmp_path / "still.json").write_text(json.dumps(motion))
    return tmp_path


@pytest.fixture
def goals(hairbake: Run, scene: Path) -> Goals:
    def imported(source: object, *options: object) -> tuple[dict[str, Any], Path, str]:
        out = scene / "shot" / "anim.json"
        track = ("import", "track", scene / "still.json", "--pivot", "0,0,0")
        done = hairbake(*track, "--groom", scene / "groom.json", "--goal", source, *options, "-o", out)
        assert done.returncode == 0, done.stderr
        return json.loads(out.read_text())["goals"][0], out.parent, done.stderr

    return imported


@pytest.fixture
def refused_goal(refused: Refused, scene: Path) -> Callable[..., str]:
    def message(source: object) -> str:
        track = ("import", "track", scene / "still.json", "--pivot", "0,0,0")
        return refused(*track, "--groom", scene / "groom.json", "--goal", source)

    return message


def swinging(frame: int, count: int = 4, vertices: int = 9) -> FloatArray:
    """Curves that lean further along x from frame to frame, m; `count × vertices × 3`."""
    points = hanging(count, vertices)
    points[..., 0] += 0.02 * (frame - FRAMES[0]) * np.linspace(0, 1, vertices) ** 2
    return points


def animate(curves: UsdGeom.BasisCurves, at: Callable[[int], ArrayLike]) -> None:
    """Time samples of the points at all frames."""
    points = curves.GetPointsAttr()
    points.Clear()
    for frame in FRAMES:
        array = np.asarray(at(frame), np.float32).reshape(-1, 3)
        points.Set(Vt.Vec3fArray.FromNumpy(array), frame)


def new_goal(path: Path, ids: list[int] | None = None, count: int = 4) -> Usd.Stage:
    """Animated curves, at `/curves`."""
    stage = new_stage(path)
    stage.SetTimeCodesPerSecond(24)
    curves = add_curves(stage, "/curves", swinging(FRAMES[0], count))
    animate(curves, lambda frame: swinging(frame, count))
    if ids is not None:
        add_primvar(curves.GetPrim(), "groom_id", INTS, "uniform", ids)
    stage.Save()
    return stage


def read_obj(path: Path) -> list[FloatArray]:
    """The curves of an OBJ file."""
    words = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([[float(x) for x in word[1:]] for word in words if word[0] == "v"])
    return [vertices[[int(i) - 1 for i in word[1:]]] for word in words if word[0] == "l"]


def test_curves_of_each_frame_are_written_in_world_space(goals: Goals, scene: Path) -> None:
    # Centimetres, Z up, below a transform that moves: 1 m up in the world, then 5 cm a frame along x.
    stage = new_stage(scene / "a.usda", 0.01, "Z")
    shift = UsdGeom.Xform.Define(stage, "/char").AddTranslateOp()
    curves = add_curves(stage, "/char/curves", hanging(4, 9))
    for frame in FRAMES:
        shift.Set(Gf.Vec3d(5 * (frame - FRAMES[0]), 0, 100), frame)

    def in_centimetres(frame: int) -> FloatArray:
        x, y, z = np.moveaxis(swinging(frame), -1, 0)
        return 100 * np.stack([x, -z, y], axis=-1)

    animate(curves, in_centimetres)
    stage.Save()
    goal, folder, messages = goals(scene / "a.usda")
    assert goal["sequence"] == "anim.goal_a.####.obj"
    assert (goal["metres_per_unit"], goal["up_axis"]) == (1, "y")
    assert "ids" not in goal and "4 curves, in the order of the guides" in messages
    for frame in FRAMES:
        expected = swinging(frame) + [0.05 * (frame - FRAMES[0]), 1, 0]
        assert np.allclose(read_obj(folder / f"anim.goal_a.{frame}.obj"), expected, atol=1e-6)


def test_curves_belong_to_guides_by_id(goals: Goals, scene: Path) -> None:
    new_goal(scene / "b.usda", [12, 10, 99], 3)
    goal, folder, messages = goals(f"{scene / 'b.usda'}:/curves", "--goal-space", "rest")
    assert goal["ids"] == [10, 12] and goal["space"] == "rest" and goal["name"] == "curves"
    assert "2 guides have a curve, by id; 2 guides and 1 curves are without each other" in " ".join(
        messages.split()
    )
    found = read_obj(folder / "anim.goal_curves.1003.obj")
    assert np.allclose(found, swinging(1003, 3)[[1, 0]], atol=1e-6)


def test_guides_count_where_there_are_any(goals: Goals, scene: Path) -> None:
    stage = new_goal(scene / "a.usda")
    add_curves(stage, "/hair", hanging(50))
    UsdGeom.Imageable(stage.GetPrimAtPath("/curves")).CreatePurposeAttr("guide")
    stage.Save()
    _, folder, messages = goals(scene / "a.usda")
    assert len(read_obj(folder / "anim.goal_a.1001.obj")) == 4 and "curves of /curves" in messages


def test_a_sequence_of_obj_files_is_referred_to(goals: Goals, scene: Path) -> None:
    for frame in FRAMES:
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in 100 * swinging(frame).reshape(-1, 3))
        lines = "".join("l " + " ".join(str(9 * c + k + 1) for k in range(9)) + "\n" for c in range(4))
        (scene / f"tail.{frame}.obj").write_text(text + lines)
    goal, _, _ = goals(f"{scene}/tail.####.obj:cm")
    assert goal["sequence"] == "../tail.####.obj" and goal["metres_per_unit"] == 0.01


def test_curves_that_cannot_be_goals_are_refused(refused_goal: Callable[..., str], scene: Path) -> None:
    new_goal(scene / "few.usda", count=3)
    assert "holds 3 curves without ids, for 4 guides" in refused_goal(scene / "few.usda")
    new_goal(scene / "others.usda", [1, 2, 3, 4, 5], count=5)
    assert "none of the ids of its 5 curves is that of a guide" in refused_goal(scene / "others.usda")

    new_goal(scene / "ids.usda", [12, 10, 99])
    assert "has 3 values" in refused_goal(scene / "ids.usda")

    stage = new_goal(scene / "rate.usda")
    stage.SetTimeCodesPerSecond(30)
    stage.Save()
    assert "30 time codes a second, where the bake reads 24" in refused_goal(scene / "rate.usda")

    stage = new_goal(scene / "counts.usda")
    counts = UsdGeom.BasisCurves(stage.GetPrimAtPath("/curves")).GetCurveVertexCountsAttr()
    counts.Clear()
    for frame in FRAMES:
        counts.Set([9, 9, 9, 9] if frame < 1004 else [8, 10, 9, 9], frame)
    stage.Save()
    message = refused_goal(scene / "counts.usda")
    assert (
        "/curves.curveVertexCounts" in message and "changes between the time codes 1001 and 1004" in message
    )

    stage = new_goal(scene / "nan.usda")
    bad = swinging(1003)
    bad[2, 3] = np.nan
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/curves")).GetPointsAttr()
    points.Set(Vt.Vec3fArray.FromNumpy(bad.reshape(-1, 3).astype(np.float32)), 1003)
    stage.Save()
    assert "point 21 is not finite at time code 1003" in refused_goal(scene / "nan.usda")
    (scene / "tail.tfx").write_bytes(b"x")
    assert "is no file of animated curves" in refused_goal(scene / "tail.tfx")


def test_curves_that_end_before_the_shot_are_told(goals: Goals, scene: Path) -> None:
    stage = new_goal(scene / "a.usda")
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/curves"))
    assert "stand still" not in " ".join(goals(scene / "a.usda")[2].split())
    curves.GetPointsAttr().ClearAtTime(1005)
    curves.GetPointsAttr().ClearAtTime(1004)
    stage.Save()
    _, folder, messages = goals(scene / "a.usda")
    told = (
        "4 of 4 curves that move have samples for a part of the frames 1001 to 1005 only (all have them from"
    )
    assert f"{told} 1001 to 1003), and stand still in the others" in " ".join(messages.split())
    assert np.allclose(read_obj(folder / "anim.goal_a.1005.obj"), swinging(1003), atol=1e-6)


def test_curves_that_stand_still_on_purpose_are_not_told(goals: Goals, scene: Path) -> None:
    stage = new_goal(scene / "a.usda")
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/curves"))
    # Still from the third frame on, with two samples that say so.
    animate(curves, lambda frame: swinging(min(frame, 1003)))
    curves.GetPointsAttr().ClearAtTime(1005)
    # Curves that hold a pose, and end early.
    held = add_curves(stage, "/held", swinging(1002, 2))
    animate(held, lambda frame: swinging(1002, 2))
    held.GetPointsAttr().ClearAtTime(1005)
    for prim, ids in ((curves, [10, 11, 12, 13]), (held, [20, 21])):
        add_primvar(prim.GetPrim(), "groom_id", INTS, "uniform", ids)
    stage.Save()
    assert "stand still" not in goals(scene / "a.usda")[2]


def test_curves_that_do_not_move_are_told(goals: Goals, scene: Path) -> None:
    stage = new_goal(scene / "a.usda")
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/curves"))
    assert "do not move" not in goals(scene / "a.usda")[2]
    # Samples that are alike.
    animate(curves, lambda frame: swinging(1002))
    stage.Save()
    assert "the curves do not move" in goals(scene / "a.usda")[2]
    # One sample below a transform that moves.
    curves.GetPointsAttr().Clear()
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(swinging(1002).reshape(-1, 3).astype(np.float32)))
    shift = curves.AddTranslateOp()
    for frame in FRAMES:
        shift.Set(Gf.Vec3d(0.05 * frame, 0, 0), frame)
    stage.Save()
    assert "do not move" not in goals(scene / "a.usda")[2]
