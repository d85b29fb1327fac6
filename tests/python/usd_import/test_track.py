"""Head tracks and colliders from USD, imported by the program."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from hairbake_usd.exchange import FloatArray
from support import Run
from usd_import.stages import Refused, new_stage

SAMPLES = range(101, 113)

Track = Callable[..., tuple[dict[str, Any], Path, str]]
"""Imports a track with options; returns anim.json, its folder and the messages."""


@pytest.fixture
def track(hairbake: Run, tmp_path: Path) -> Track:
    def imported(source: Path, *options: object) -> tuple[dict[str, Any], Path, str]:
        out = tmp_path / "shot" / "anim.json"
        done = hairbake("import", "track", source, *options, "-o", out)
        assert done.returncode == 0, done.stderr
        return json.loads(out.read_text()), out.parent, done.stderr

    return imported


def head_at(anim: dict[str, Any], sample: int, point: Sequence[float]) -> FloatArray:
    """World position of a point of the rest pose at a sample, T · rest⁻¹ · p, m, in the axes of the file."""
    track, unit = anim["bodies"][0]["track"], anim["metres_per_unit"]

    def pose(translation: list[float], wxyz: list[float]) -> Gf.Matrix4d:
        rotation = Gf.Rotation(Gf.Quatd(wxyz[0], *wxyz[1:]))
        return Gf.Matrix4d().SetTransform(rotation, Gf.Vec3d(*translation))

    rest = pose(track["rest"]["translation"], track["rest"]["rotation_wxyz"])
    now = pose(track["translation"][sample], track["rotation_wxyz"][sample])
    moved: FloatArray = np.array((rest.GetInverse() * now).Transform(Gf.Vec3d(*point) / unit)) * unit
    return moved


def add_plate(stage: Usd.Stage, path: str) -> UsdGeom.Mesh:
    """A square of one face."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(-10, 0, -10), (-10, 0, 10), (10, 0, 10), (10, 0, -10)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    return mesh


def new_shot(path: Path, rest: bool = True) -> Usd.Stage:
    """A head that moves by 2 cm a frame along x, on a body that turns by 3° a frame about z.

    Centimetres, Z up, 30 frames a second.
    """
    stage = new_stage(path, 0.01, "Z")
    stage.SetTimeCodesPerSecond(30)
    stage.SetFramesPerSecond(30)
    stage.SetStartTimeCode(SAMPLES[0])
    stage.SetEndTimeCode(SAMPLES[-1])
    turn = UsdGeom.Xform.Define(stage, "/char").AddRotateZOp()
    shift = UsdGeom.Xform.Define(stage, "/char/head").AddTranslateOp()
    if rest:
        turn.Set(0.0)
        shift.Set(Gf.Vec3d(0, 0, 150))
    for i, code in enumerate(SAMPLES):
        turn.Set(3.0 * i, code)
        shift.Set(Gf.Vec3d(2 * i, 0, 150), code)
    return stage


def test_transform_with_frames_unit_axis_and_rest_pose(track: Track, tmp_path: Path) -> None:
    new_shot(tmp_path / "a.usda").Save()
    anim, _, messages = track(tmp_path / "a.usda", "--prim", "/char/head")
    found = (anim["fps"], anim["frames"], anim["metres_per_unit"], anim["up_axis"])
    assert found == (30, [101, 112], 0.01, "z")
    assert "1 unit = 0.01 m, Z up" in messages and "oriented as in the file" in messages
    # After nine frames a point of the head at 1.6 m is moved by 18 cm and turned by 27°.
    angle = np.radians(27)
    assert np.allclose(
        head_at(anim, 9, [0, 0.05, 1.6]),
        [0.18 * np.cos(angle) - 0.05 * np.sin(angle), 0.18 * np.sin(angle) + 0.05 * np.cos(angle), 1.6],
    )
    part, _, _ = track(tmp_path / "a.usda", "--prim", "/char/head", "--frames", "105-108")
    assert part["frames"] == [105, 108] and part["bodies"][0]["track"]["first_frame"] == 101


def test_rest_pose_without_a_default_value_is_the_first_sample(track: Track, tmp_path: Path) -> None:
    new_shot(tmp_path / "a.usda", rest=False).Save()
    anim, _, messages = track(tmp_path / "a.usda", "--prim", "/char/head")
    assert "the rest pose is that at time code 101" in messages
    assert np.allclose(head_at(anim, 0, [0.1, 0.2, 1.6]), [0.1, 0.2, 1.6])


def new_rig(path: Path) -> Usd.Stage:
    """Hips that move by 10 cm a frame along z, and a head half a metre above that nods by 10° a frame.

    Metres, Y up, moved by 3 m along x.
    """
    stage = new_stage(path)
    stage.SetTimeCodesPerSecond(24)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(5)
    root = UsdSkel.Root.Define(stage, "/char")
    UsdGeom.Xform(root).AddTranslateOp().Set(Gf.Vec3d(3, 0, 0))
    skeleton = UsdSkel.Skeleton.Define(stage, "/char/rig")
    joints = ["Hips", "Hips/Head"]

    def shift(x: float, y: float) -> Gf.Matrix4d:
        return Gf.Matrix4d().SetTranslate(Gf.Vec3d(x, y, 0))

    skeleton.CreateJointsAttr(joints)
    skeleton.CreateBindTransformsAttr([shift(3, 1), shift(3, 1.5)])
    skeleton.CreateRestTransformsAttr([shift(0, 1), shift(0, 0.5)])
    move = UsdSkel.Animation.Define(stage, "/char/move")
    move.CreateJointsAttr(joints)
    move.CreateScalesAttr([Gf.Vec3h(1)] * 2)
    translations, rotations = move.CreateTranslationsAttr(), move.CreateRotationsAttr()
    for code in range(1, 6):
        nod = Gf.Quatf(Gf.Rotation(Gf.Vec3d(1, 0, 0), 10.0 * (code - 1)).GetQuat())
        translations.Set([Gf.Vec3f(0, 1, 0.1 * (code - 1)), Gf.Vec3f(0, 0.5, 0)], code)
        rotations.Set([Gf.Quatf(1), nod], code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().AddTarget("/char/move")
    return stage


def test_joint_of_a_skeleton(track: Track, refused: Refused, tmp_path: Path) -> None:
    new_rig(tmp_path / "a.usda").Save()
    anim, _, _ = track(tmp_path / "a.usda", "--joint", "Head")
    assert anim["frames"] == [1, 5]
    angle = np.radians(30)
    moved = head_at(anim, 3, [3, 1.7, 0])
    assert np.allclose(moved, [3, 1.5 + 0.2 * np.cos(angle), 0.3 + 0.2 * np.sin(angle)], atol=1e-6)
    message = refused("import", "track", tmp_path / "a.usda", "--joint", "Tail")
    assert "Tail: no such joint" in message and "Hips, Head" in message


def test_rigid_meshes_follow_the_head_and_deforming_ones_are_sequences(
    hairbake: Run, track: Track, tmp_path: Path
) -> None:
    stage = new_shot(tmp_path / "a.usda")
    add_plate(stage, "/char/head/skin")
    cloth = add_plate(stage, "/cloth")
    for code in SAMPLES:
        cloth.GetPointsAttr().Set([(-10, 0, -10), (-10, 0.5 * code, 10), (10, 0, 10), (10, 0, -10)], code)
    stage.Save()
    meshes = [
        x for prim in ("/char/head/skin", "/cloth") for x in ("--collider", f"{tmp_path}/a.usda:{prim}")
    ]
    anim, folder, _ = track(tmp_path / "a.usda", "--prim", "/char/head", *meshes, "--frames", "104-109")
    skin, worn = anim["colliders"]
    assert (skin["name"], skin.get("body"), worn["name"], worn["body"]) == ("skin", None, "cloth", "world")
    # In metres, Y up, in the rest pose, 1.5 m up.
    first = (folder / skin["shape"]["file"]).read_text().splitlines()
    assert np.allclose([float(x) for x in first[0].split()[1:]], [-0.1, 1.4, 0])
    assert sum(line.startswith("f ") for line in first) == 2
    frames = sorted(path.name for path in folder.glob("anim.cloth.*.obj"))
    # All there are before the shot, for the pre-roll, and two after it.
    assert frames == [f"anim.cloth.{i:04d}.obj" for i in range(101, 112)]
    second = (folder / "anim.cloth.0106.obj").read_text().splitlines()[1]
    assert np.allclose([float(x) for x in second.split()[1:]], [-0.1, 0.1, -0.53])
    assert hairbake("check", folder / "anim.json").returncode == 0


def read_vertices(path: Path) -> FloatArray:
    lines = path.read_text().splitlines()
    return np.array([[float(x) for x in line.split()[1:]] for line in lines if line.startswith("v ")])


def test_skinned_mesh_deforms_with_its_skeleton(hairbake: Run, track: Track, tmp_path: Path) -> None:
    stage = new_rig(tmp_path / "a.usda")
    coat = UsdGeom.Mesh.Define(stage, "/char/coat")
    coat.CreatePointsAttr([(0, 1, 0.1), (0, 1.7, 0), (0.1, 1.25, 0)])
    coat.CreateFaceVertexCountsAttr([3])
    coat.CreateFaceVertexIndicesAttr([0, 1, 2])
    # One vertex is bound to the hips, one to the head, one to both in halves.
    skin = UsdSkel.BindingAPI.Apply(coat.GetPrim())
    skin.CreateJointIndicesPrimvar(False, 2).Set([0, 1, 0, 1, 0, 1])
    skin.CreateJointWeightsPrimvar(False, 2).Set([1, 0, 0, 1, 0.5, 0.5])
    skin.CreateGeomBindTransformAttr(Gf.Matrix4d().SetTranslate(Gf.Vec3d(3, 0, 0)))
    skin.CreateSkeletonRel().AddTarget("/char/rig")
    stage.Save()
    anim, folder, _ = track(
        tmp_path / "a.usda", "--joint", "Head", "--collider", f"{tmp_path}/a.usda:/char/coat"
    )
    (worn,) = anim["colliders"]
    assert (worn["name"], worn["body"]) == ("coat", "world")
    assert worn["shape"]["sequence"] == "anim.coat.####.obj"
    at_rest = read_vertices(folder / worn["shape"]["file"])
    assert np.allclose(at_rest, [[3, 1, 0.1], [3, 1.7, 0], [3.1, 1.25, 0]], atol=1e-6)
    for code in range(1, 6):
        along, nod = 0.1 * (code - 1), np.radians(10 * (code - 1))

        def on_head(x: float, up: float, along: float = along, nod: float = nod) -> FloatArray:
            return np.array([3 + x, 1.5 + up * np.cos(nod), along + up * np.sin(nod)])

        half = (np.array([3.1, 1.25, along]) + on_head(0.1, -0.25)) / 2
        found = read_vertices(folder / f"anim.coat.{code:04d}.obj")
        expected = np.stack([np.array([3, 1, 0.1 + along]), on_head(0, 0.2), half])
        assert np.allclose(found, expected, atol=1e-5)
    assert hairbake("check", folder / "anim.json").returncode == 0


def test_faces_point_outwards_for_every_orientation(track: Track, tmp_path: Path) -> None:
    stage = new_shot(tmp_path / "a.usda")
    variants = {
        "plain": (False, False),
        "left": (True, False),
        "mirror": (False, True),
        "both": (True, True),
    }
    for name, (left, mirrored) in variants.items():
        mesh = add_plate(stage, f"/{name}")
        # The plate faces y. Left-handed faces have the reverse order of corners.
        mesh.GetFaceVertexIndicesAttr().Set([3, 2, 1, 0] if left else [0, 1, 2, 3])
        mesh.CreateOrientationAttr("leftHanded" if left else "rightHanded")
        if mirrored:
            UsdGeom.Xformable(mesh).AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    stage.Save()
    colliders = [x for name in variants for x in ("--collider", f"{tmp_path}/a.usda:/{name}")]
    _, folder, _ = track(tmp_path / "a.usda", "--prim", "/char/head", *colliders)
    for name in variants:
        lines = [line.split() for line in (folder / f"anim.{name}.obj").read_text().splitlines()]
        points = np.array([line[1:] for line in lines if line[0] == "v"], float)
        a, b, c = points[[int(i) - 1 for i in next(line for line in lines if line[0] == "f")[1:]]]
        # y of a Z-up stage is -z in the OBJ file.
        assert np.cross(b - a, c - a)[2] < 0, name


def test_errors_are_reported_and_nothing_is_written(refused: Refused, tmp_path: Path) -> None:
    stage = new_shot(tmp_path / "a.usda")
    stage.DefinePrim("/scope", "Scope")
    UsdGeom.Xform.Define(stage, "/still")
    mirrored = UsdGeom.Xform.Define(stage, "/mirrored")
    mirrored.AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    holes = add_plate(stage, "/holes")
    holes.GetFaceVertexIndicesAttr().Set([0, 1, 2, 9])
    torn = add_plate(stage, "/torn")
    torn.GetPointsAttr().Set([(float("nan"), 0, 0)] * 4)
    stage.Save()

    def message(*options: str) -> str:
        return refused("import", "track", tmp_path / "a.usda", *options)

    assert "/char, /char/head" in message()
    assert "/nobody: no such prim" in message("--prim", "/nobody")
    assert "Scope has no transform" in message("--prim", "/scope")
    assert "mirror" in message("--prim", "/mirrored")
    outside = message("--prim", "/char", "--frames", "90-95")
    assert "frames: 90 to 95" in outside and "101 to 112" in outside
    meshes = ("--collider", f"{tmp_path}/a.usda:/holes", "--collider", f"{tmp_path}/a.usda:/torn")
    both = message("--prim", "/nobody", *meshes)
    assert "3 errors" in both
    assert "/holes.faceVertexIndices: indices 0 to 9, for 4 vertices" in both
    assert "/torn.points: vertex 0 is not finite" in both


def test_jump_is_reported(track: Track, tmp_path: Path) -> None:
    stage = new_shot(tmp_path / "a.usda")
    UsdGeom.Xform.Get(stage, "/char/head").GetOrderedXformOps()[0].Set(Gf.Vec3d(60, 0, 150), 106)
    stage.Save()
    _, _, messages = track(tmp_path / "a.usda", "--prim", "/char/head")
    assert "1 sample is off, at frame 106" in messages
