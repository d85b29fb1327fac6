"""A character in its asset, and placed in a shot: all ways to import it agree, or are refused."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, UsdGeom, UsdSkel

from hairbake_usd.exchange import FloatArray
from support import Run, unwrapped
from usd_import.stages import Groom, add_curves, new_stage
from usd_import.test_track import head_at, new_rig, read_vertices

PLACEMENT = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), 30)) * Gf.Matrix4d().SetTranslate(
    Gf.Vec3d(2, 0, 0.5)
)
"""Of the hero in the shot."""
ROOTS = np.array([[3 + x, 1.7, z] for x in (-0.05, 0.0, 0.05) for z in (-0.05, 0.0, 0.05)])
"""On the head of the asset, m."""


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """char.usda: rig, skin and hair. shot.usda: the hero, turned and moved, and an instance beside it."""
    stage = new_rig(tmp_path / "char.usda")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/char"))
    hair = UsdGeom.Xform.Define(stage, "/char/hair").GetPath()
    strands = np.stack([ROOTS, ROOTS + [0, 0.1, 0]], axis=1)
    # The root of the character is moved by 3 m.
    add_curves(stage, f"{hair}/strands", strands - [3, 0, 0]).CreateTypeAttr("linear")
    skin = UsdGeom.Mesh.Define(stage, "/char/skin")
    skin.CreatePointsAttr([(-0.1, 1.7, -0.1), (-0.1, 1.7, 0.1), (0.1, 1.7, 0.1), (0.1, 1.7, -0.1)])
    skin.CreateFaceVertexCountsAttr([4])
    skin.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    binding = UsdSkel.BindingAPI.Apply(skin.GetPrim())
    binding.CreateJointIndicesPrimvar(False, 1).Set([1] * 4)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1] * 4)
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d().SetTranslate(Gf.Vec3d(3, 0, 0)))
    binding.CreateSkeletonRel().AddTarget("/char/rig")
    stage.Save()
    path = tmp_path / "shot.usda"
    shot = new_stage(path)
    shot.SetTimeCodesPerSecond(24)
    shot.SetStartTimeCode(3)
    shot.SetEndTimeCode(5)
    for name, matrix in (("hero", PLACEMENT), ("extra", Gf.Matrix4d().SetTranslate(Gf.Vec3d(-4, 0, 0)))):
        UsdGeom.Xform.Define(shot, f"/world/{name}").AddTransformOp().Set(matrix)
        prim = shot.DefinePrim(f"/world/{name}/char")
        prim.GetReferences().AddReference("./char.usda")
        prim.SetInstanceable(name == "extra")
    shot.Save()
    return path


Ways = Callable[..., tuple[FloatArray, FloatArray, Path]]


@pytest.fixture
def ways(hairbake: Run, shot: Path, tmp_path: Path) -> Ways:
    """Imports groom and track; returns the roots at the last frame, the skin there, and the folder."""

    def run(
        groom_from: str, with_groom: bool, character: str = "hero"
    ) -> tuple[FloatArray, FloatArray, Path]:
        folder = tmp_path / f"{groom_from}_{with_groom}_{character}"
        groom, anim = folder / "groom.json", folder / "anim.json"
        stage, prim = {"asset": ("char.usda", "/char"), "shot": ("shot.usda", f"/world/{character}/char")}[
            groom_from
        ]
        skin = ("--head", f"{tmp_path / stage}:{prim}/skin")
        done = hairbake("import", "groom", tmp_path / stage, "--prim", f"{prim}/hair", *skin, "-o", groom)
        assert done.returncode == 0, done.stderr
        assert "1 unit = 1 m, Y up" in done.stderr
        joint = f"/world/{character}/char/rig/Hips/Head"
        options = ["--joint", joint, "--collider", f"{shot}:/world/{character}/char/skin"]
        options += ["--groom", str(groom)] if with_groom else []
        done = hairbake("import", "track", shot, *options, "-o", anim)
        assert done.returncode == 0, done.stderr
        done = hairbake("check", groom, anim)
        assert done.returncode == 0, done.stderr
        found = Groom(groom)
        roots = found.array("guides", "points").reshape(len(ROOTS), -1, 3)[:, 0]
        read = json.loads(anim.read_text())
        assert read["frames"] == [3, 5]
        last = len(read["bodies"][0]["track"]["translation"]) - 1
        moved = np.array([head_at(read, last, root) for root in roots])
        vertices = read_vertices(folder / "anim.skin.0005.obj")
        return moved[np.lexsort(moved.T)], vertices, folder

    return run


def test_groom_and_track_of_asset_and_shot_agree(ways: Ways) -> None:
    angle, along = np.radians(40), 0.4
    up, z = ROOTS[:, 1] - 1.5, ROOTS[:, 2]
    posed = np.stack(
        [
            ROOTS[:, 0],
            1.5 + up * np.cos(angle) - z * np.sin(angle),
            along + up * np.sin(angle) + z * np.cos(angle),
        ],
        axis=1,
    )
    expected = np.array([PLACEMENT.Transform(Gf.Vec3d(*point)) for point in posed])
    expected = expected[np.lexsort(expected.T)]
    for groom_from in ("asset", "shot"):
        for with_groom in (False, True):
            roots, skin, folder = ways(groom_from, with_groom)
            assert np.abs(np.sort(roots, axis=0) - np.sort(expected, axis=0)).max() < 1e-5, folder
            assert np.abs(skin.mean(axis=0) - roots.mean(axis=0)).max() < 1e-4, folder
            # Samples before the shot are those of the pre-roll.
            track = json.loads((folder / "anim.json").read_text())["bodies"][0]["track"]
            assert (track["first_frame"], len(track["translation"])) == (1, 5)
            assert (folder / "anim.skin.0001.obj").is_file()


def test_skin_of_an_instance_deforms(ways: Ways, shot: Path) -> None:
    # The instance has the animation of its asset.
    roots, skin, _ = ways("shot", True, "extra")
    assert np.abs(skin.mean(axis=0) - roots.mean(axis=0)).max() < 1e-4


def test_origin_is_recorded(ways: Ways) -> None:
    folder = ways("shot", False)[2]
    origin = json.loads((folder / "groom.json").read_text())["origin"]
    assert origin == {"file": "../shot.usda", "prim": "/world/hero/char/hair", "space": "bind"}


def test_two_characters_have_to_be_told_apart(hairbake: Run, shot: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.json"
    done = hairbake("import", "track", shot, "--joint", "Head", "-o", out)
    message = unwrapped(done.stderr)
    assert done.returncode == 65 and "/world/hero/char/rig/Hips/Head" in message and "--prim" in message
    for joint in ("hero/char/rig/Hips/Head", "/world/hero/char/rig/Hips/Head"):
        assert hairbake("import", "track", shot, "--joint", joint, "-o", out).returncode == 0
    done = hairbake("import", "groom", shot, "-o", tmp_path / "g.json")
    assert done.returncode == 65 and "2 characters" in unwrapped(done.stderr)


def test_a_collider_of_another_space_is_refused(hairbake: Run, ways: Ways, shot: Path) -> None:
    folder = ways("asset", False)[2]
    wrong = ("--rest", "world", "--pivot", "0,0,0", "--groom", folder / "groom.json")
    options = ("--joint", "hero/char/rig/Hips/Head", "--collider", f"{shot}:/world/hero/char/skin")
    done = hairbake("import", "track", shot, *options, *wrong, "-o", folder / "wrong.json")
    message = unwrapped(done.stderr)
    assert done.returncode == 65 and "colliders.skin" in message and "--groom" in message, message
    assert not (folder / "wrong.json").exists()


def test_the_rest_pose_of_a_rigid_head_is_that_of_the_grooms_stage(hairbake: Run, tmp_path: Path) -> None:
    asset = new_stage(tmp_path / "head.usda")
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/char").GetPrim())
    UsdGeom.Xform.Define(asset, "/char/head").AddTranslateOp().Set(Gf.Vec3d(0, 1.5, 0))
    add_curves(asset, "/char/head/hair", np.array([[[0, 0.1, 0], [0, 0.2, 0]]])).CreateTypeAttr("linear")
    asset.Save()
    stage = new_stage(tmp_path / "walk.usda")
    stage.SetTimeCodesPerSecond(24)
    UsdGeom.Xform.Define(stage, "/hero").AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    stage.DefinePrim("/hero/char").GetReferences().AddReference("./head.usda")
    head = UsdGeom.Xform(stage.OverridePrim("/hero/char/head"))
    for code in range(1, 6):
        head.GetOrderedXformOps()[0].Set(Gf.Vec3d(0, 1.5, 0.1 * code), code)
    stage.Save()
    groom, out = tmp_path / "groom.json", tmp_path / "anim.json"
    for file, prim in (("head.usda", "/char/head"), ("walk.usda", "/hero/char/head")):
        assert hairbake("import", "groom", tmp_path / file, "--prim", prim, "-o", groom).returncode == 0
        done = hairbake(
            "import",
            "track",
            tmp_path / "walk.usda",
            "--prim",
            "/hero/char/head",
            "--groom",
            groom,
            "-o",
            out,
        )
        assert done.returncode == 0, done.stderr
        root = Groom(groom).array("guides", "points").reshape(-1, 3)[0]
        assert np.allclose(head_at(json.loads(out.read_text()), 4, root), [5, 1.6, 0.5], atol=1e-6)


def test_swapped_files_are_told(hairbake: Run, ways: Ways) -> None:
    folder = ways("asset", False)[2]
    done = hairbake(folder / "anim.json", folder / "groom.json", "-o", folder / "out")
    assert done.returncode == 65 and "swap the two files" in unwrapped(done.stderr)
    assert not (folder / "out").exists()


def test_head_on_which_no_hair_can_grow_is_refused(hairbake: Run, shot: Path, tmp_path: Path) -> None:
    asset, groom = shot.parent / "char.usda", tmp_path / "groom.json"
    head = ("--head", f"{asset}:/char/skin")
    done = hairbake("import", "groom", asset, "--prim", "/char/hair", *head, "--offset", "5,0,0", "-o", groom)
    assert done.returncode == 65 and not groom.exists(), done.stderr
    assert "no hair can touch it" in done.stderr and "--offset" in done.stderr
