"""Head tracks and colliders from USD, through the program."""

import json

import numpy as np
import pytest
from pxr import Gf, UsdGeom, UsdSkel

from usd_import.stages import new_stage

SAMPLES = range(101, 113)


@pytest.fixture
def track(hairbake, tmp_path):
    """Imports a track; returns anim.json, its folder and what was said."""

    def imported(source, *options):
        out = tmp_path / "shot" / "anim.json"
        done = hairbake("import", "track", source, *options, "-o", out)
        assert done.returncode == 0, done.stderr
        return json.loads(out.read_text()), out.parent, done.stderr

    return imported


def head_at(anim: dict, sample: int, point) -> np.ndarray:
    """Where the point of rest space is in the world at a sample: T · rest⁻¹ · p, metres in the file's axes."""
    track, unit = anim["bodies"][0]["track"], anim["metres_per_unit"]

    def pose(translation, wxyz):
        rotation = Gf.Rotation(Gf.Quatd(wxyz[0], *wxyz[1:]))
        return Gf.Matrix4d().SetTransform(rotation, Gf.Vec3d(*translation))

    rest = pose(track["rest"]["translation"], track["rest"]["rotation_wxyz"])
    now = pose(track["translation"][sample], track["rotation_wxyz"][sample])
    return np.array((rest.GetInverse() * now).Transform(Gf.Vec3d(*point) / unit)) * unit


def plate(stage, path: str) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(-10, 0, -10), (-10, 0, 10), (10, 0, 10), (10, 0, -10)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    return mesh


def shot(path, rest=True):
    """A head in centimetres, Z up, that goes 2 cm a frame along x on a body that turns by 3° a frame about z, 30 frames a second."""
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


def test_a_transform_with_its_frames_unit_axis_and_rest_pose(track, tmp_path):
    stage = shot(tmp_path / "a.usda")
    stage.Save()
    anim, _, said = track(tmp_path / "a.usda", "--prim", "/char/head")
    assert (anim["fps"], anim["frames"], anim["metres_per_unit"], anim["up_axis"]) == (
        30,
        [101, 112],
        0.01,
        "z",
    )
    assert "1 unit = 0.01 m, Z up" in said and "oriented as in the file" in said
    # A point of the head as it was modelled, 1.6 m up, after nine frames: 18 cm out, turned by 27°.
    angle = np.radians(27)
    assert np.allclose(
        head_at(anim, 9, [0, 0.05, 1.6]),
        [0.18 * np.cos(angle) - 0.05 * np.sin(angle), 0.18 * np.sin(angle) + 0.05 * np.cos(angle), 1.6],
    )
    part, _, _ = track(tmp_path / "a.usda", "--prim", "/char/head", "--frames", "105-108")
    assert part["frames"] == [105, 108] and part["bodies"][0]["track"]["first_frame"] == 101


def test_without_a_value_outside_of_time_the_first_sample_is_the_rest(track, tmp_path):
    shot(tmp_path / "a.usda", rest=False).Save()
    anim, _, said = track(tmp_path / "a.usda", "--prim", "/char/head")
    assert "rest pose is that at time code 101" in said
    assert np.allclose(head_at(anim, 0, [0.1, 0.2, 1.6]), [0.1, 0.2, 1.6])


def rigged(path):
    """Hips that go 10 cm a frame along z, 3 m along x, and a head half a metre above that nods by 10° a frame; metres, Y up."""
    stage = new_stage(path)
    stage.SetTimeCodesPerSecond(24)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(5)
    root = UsdSkel.Root.Define(stage, "/char")
    UsdGeom.Xform(root).AddTranslateOp().Set(Gf.Vec3d(3, 0, 0))
    skeleton = UsdSkel.Skeleton.Define(stage, "/char/rig")
    joints = ["Hips", "Hips/Head"]
    up = lambda y: Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, y, 0))
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateBindTransformsAttr(
        [
            up(1) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(3, 0, 0)),
            up(1.5) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(3, 0, 0)),
        ]
    )
    skeleton.CreateRestTransformsAttr([up(1), up(0.5)])
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


def test_a_joint_of_a_skeleton(track, refused, tmp_path):
    rigged(tmp_path / "a.usda").Save()
    anim, _, _ = track(tmp_path / "a.usda", "--joint", "Head")
    assert anim["frames"] == [1, 5]
    angle = np.radians(30)
    moved = head_at(anim, 3, [3, 1.7, 0])
    assert np.allclose(moved, [3, 1.5 + 0.2 * np.cos(angle), 0.3 + 0.2 * np.sin(angle)], atol=1e-6)
    words = refused("import", "track", tmp_path / "a.usda", "--joint", "Tail")
    assert "Tail" in words and "Hips, Head" in words


def test_meshes_that_go_along_and_meshes_that_deform(hairbake, track, tmp_path):
    stage = shot(tmp_path / "a.usda")
    plate(stage, "/char/head/skin")
    cloth = plate(stage, "/cloth")
    for code in SAMPLES:
        cloth.GetPointsAttr().Set([(-10, 0, -10), (-10, 0.5 * code, 10), (10, 0, 10), (10, 0, -10)], code)
    stage.Save()
    mesh = lambda prim: ("--collider", f"{tmp_path}/a.usda:{prim}")
    anim, folder, _ = track(
        tmp_path / "a.usda",
        "--prim",
        "/char/head",
        *mesh("/char/head/skin"),
        *mesh("/cloth"),
        "--frames",
        "104-109",
    )
    skin, worn = anim["colliders"]
    assert (skin["name"], skin.get("body"), worn["name"], worn["body"]) == ("skin", None, "cloth", "world")
    # In metres, Y up, as modelled: 1.5 m up.
    first = (folder / skin["shape"]["file"]).read_text().splitlines()
    assert np.allclose([float(x) for x in first[0].split()[1:]], [-0.1, 1.4, 0])
    assert sum(line.startswith("f ") for line in first) == 2
    frames = sorted(path.name for path in folder.glob("cloth.*.obj"))
    # Two frames more on both sides, for the motion at the ends; and the mesh at rest.
    assert frames == [f"cloth.{i:04d}.obj" for i in range(102, 112)]
    second = (folder / "cloth.0106.obj").read_text().splitlines()[1]
    assert np.allclose([float(x) for x in second.split()[1:]], [-0.1, 0.1, -0.53])
    assert hairbake("check", folder / "anim.json").returncode == 0


def test_a_skinned_mesh_deforms_as_its_skeleton_asks(hairbake, track, tmp_path):
    stage = rigged(tmp_path / "a.usda")
    coat = UsdGeom.Mesh.Define(stage, "/char/coat")
    coat.CreatePointsAttr([(0, 1, 0.1), (0, 1.7, 0), (0.1, 1.25, 0)])
    coat.CreateFaceVertexCountsAttr([3])
    coat.CreateFaceVertexIndicesAttr([0, 1, 2])
    # One vertex goes with the hips, one with the head, one half with each.
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
    assert (worn["name"], worn["body"], worn["shape"]["sequence"]) == ("coat", "world", "coat.####.obj")

    def vertices(name):
        lines = (folder / name).read_text().splitlines()
        return np.array([[float(x) for x in line.split()[1:]] for line in lines if line.startswith("v ")])

    assert np.allclose(vertices(worn["shape"]["file"]), [[3, 1, 0.1], [3, 1.7, 0], [3.1, 1.25, 0]], atol=1e-6)
    for code in range(1, 6):
        along, nod = 0.1 * (code - 1), np.radians(10 * (code - 1))
        nodded = lambda x, up: np.array([3 + x, 1.5 + up * np.cos(nod), along + up * np.sin(nod)])
        half = (np.array([3.1, 1.25, along]) + nodded(0.1, -0.25)) / 2
        assert np.allclose(
            vertices(f"coat.{code:04d}.obj"), [[3, 1, 0.1 + along], nodded(0, 0.2), half], atol=1e-5
        )
    assert hairbake("check", folder / "anim.json").returncode == 0


def test_faces_look_outwards_whichever_way_they_are_kept(track, tmp_path):
    """A left-handed mesh, a mirrored one, and one that is both: triangles that turn as seen from outside."""
    stage = shot(tmp_path / "a.usda")
    for name, left, mirrored in [
        ("plain", False, False),
        ("left", True, False),
        ("mirror", False, True),
        ("both", True, True),
    ]:
        mesh = plate(stage, f"/{name}")
        # The plate looks along y; wound for the left hand, or seen in a mirror, its corners are the other way round.
        mesh.GetFaceVertexIndicesAttr().Set([3, 2, 1, 0] if left else [0, 1, 2, 3])
        mesh.CreateOrientationAttr("leftHanded" if left else "rightHanded")
        if mirrored:
            UsdGeom.Xformable(mesh).AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    stage.Save()
    _, folder, _ = track(
        tmp_path / "a.usda",
        "--prim",
        "/char/head",
        *[x for n in ("plain", "left", "mirror", "both") for x in ("--collider", f"{tmp_path}/a.usda:/{n}")],
    )
    for name in ("plain", "left", "mirror", "both"):
        lines = [line.split() for line in (folder / f"{name}.obj").read_text().splitlines()]
        points = np.array([line[1:] for line in lines if line[0] == "v"], float)
        a, b, c = points[[int(i) - 1 for i in next(line for line in lines if line[0] == "f")[1:]]]
        # y of a stage with Z up is -z here.
        assert np.cross(b - a, c - a)[2] < 0, name


def test_faults_are_told_and_nothing_is_written(refused, tmp_path):
    stage = shot(tmp_path / "a.usda")
    stage.DefinePrim("/scope", "Scope")
    UsdGeom.Xform.Define(stage, "/still")
    mirrored = UsdGeom.Xform.Define(stage, "/mirrored")
    mirrored.AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    holes = plate(stage, "/holes")
    holes.GetFaceVertexIndicesAttr().Set([0, 1, 2, 9])
    torn = plate(stage, "/torn")
    torn.GetPointsAttr().Set([(float("nan"), 0, 0)] * 4)
    stage.Save()
    words = lambda *options: refused("import", "track", tmp_path / "a.usda", *options)
    assert "/char, /char/head" in words()
    assert "no such prim" in words("--prim", "/nobody")
    assert "no transform" in words("--prim", "/scope")
    assert "mirror" in words("--prim", "/mirrored")
    assert "frames: 90 to 95" in words("--prim", "/char", "--frames", "90-95") and "101 to 112" in words(
        "--prim", "/char", "--frames", "90-95"
    )
    both = words(
        "--prim",
        "/nobody",
        "--collider",
        f"{tmp_path}/a.usda:/holes",
        "--collider",
        f"{tmp_path}/a.usda:/torn",
    )
    assert "3 errors" in both and "go from 0 to 9, of 4 vertices" in both and "vertex 0 is no number" in both


def test_a_pop_is_named(track, tmp_path):
    stage = shot(tmp_path / "a.usda")
    UsdGeom.Xform.Get(stage, "/char/head").GetOrderedXformOps()[0].Set(Gf.Vec3d(60, 0, 150), 106)
    stage.Save()
    _, _, said = track(tmp_path / "a.usda", "--prim", "/char/head")
    assert "1 sample pops (5)" in said
