"""hairbake from Python: caches as arrays, bakes, single rods, and the examples."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel
from scipy.spatial.transform import Rotation

import hairbake
from hairbake.program import as_arguments
from hairbake.rods import (
    DOWN,
    GRAVITY,
    HORIZONTAL,
    Motion,
    Rod,
    Scene,
    Strand,
    bake_scene,
    quaternion,
    simulate,
    straight,
)
from support import HAIRBAKE, ROOT, needs_hairbake, run_command

SAMPLE = ROOT / "samples/short"
BLENDER = Path(os.environ.get("HAIRBAKE_BLENDER_PYTHON") or ROOT / ".blender/bin/python")


@pytest.fixture(scope="module", autouse=True)
def program() -> None:
    """The program under test."""
    os.environ["HAIRBAKE"] = str(HAIRBAKE)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> hairbake.Cache:
    """Two frames of the sample."""
    out = tmp_path_factory.mktemp("api") / "cache"
    options: dict[str, hairbake.Option] = {"frames": "1005-1006", "no_pictures": True, "accelerations": True}
    return hairbake.bake(SAMPLE / "groom.json", SAMPLE / "shake.json", out, **options)


@needs_hairbake
@pytest.mark.parametrize("name", ["hair", "guides"])
def test_arrays_are_those_of_usd(cache: hairbake.Cache, name: hairbake.CurvesName) -> None:
    stage = Usd.Stage.Open(str(cache.directory / "hair.usda"))
    prim, curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(f"/groom/{name}")), cache.curves(name)
    primvars = UsdGeom.PrimvarsAPI(prim)
    assert (cache.frames, cache.shot, cache.fps) == ([1004, 1005, 1006, 1007], (1005, 1006), 24.0)
    assert cache.metres_per_unit == UsdGeom.GetStageMetersPerUnit(stage)
    assert cache.up_axis == UsdGeom.GetStageUpAxis(stage)
    fixed = {
        "counts": prim.GetCurveVertexCountsAttr().Get(),
        "widths": prim.GetWidthsAttr().Get(),
        "ids": primvars.GetPrimvar("groom_id").Get(),
        "groups": primvars.GetPrimvar("groom_group_id").Get(),
        "rest": primvars.GetPrimvar("rest").Get(),
        "root_uv": primvars.GetPrimvar("groom_root_uv").Get(),
    }
    if name == "guides":
        fixed["arc"] = primvars.GetPrimvar("groom_arc").Get()
    for array, value in fixed.items():
        assert np.array_equal(getattr(curves, array), np.array(value)), array
    frames = [1005, 1007]
    for field, attribute in (
        (curves.points, prim.GetPointsAttr()),
        (curves.velocities, prim.GetVelocitiesAttr()),
        (curves.accelerations, prim.GetAccelerationsAttr()),
    ):
        expected = np.array([attribute.Get(frame) for frame in frames])
        assert expected.shape == (2, curves.counts.sum(), 3)
        assert np.array_equal(field(frames), expected)
        assert np.array_equal(field(1007), expected[1])
        assert np.array_equal(field()[[1, 3]], expected)
    strands = curves.split(curves.points(1005))
    assert [len(strand) for strand in strands] == curves.counts.tolist()
    assert np.array_equal(np.concatenate(strands), curves.points(1005))


@needs_hairbake
def test_a_cache_tells_its_head_its_groups_and_its_figures(cache: hairbake.Cache) -> None:
    stage = Usd.Stage.Open(str(cache.directory / "hair.usda"))
    head = UsdGeom.Xformable(stage.GetPrimAtPath("/groom/head"))
    assert np.array_equal(cache.head(1006), np.array(head.GetLocalTransformation(1006)).T)
    assert set(cache.hair.groups.tolist()) <= set(cache.groups)
    assert len(cache.figure("penetration_m")) == len(cache.frames)
    assert cache.hair.closest_guides.shape == cache.hair.guide_weights.shape == (len(cache.hair.counts), 3)
    assert cache.points(1005).shape == cache.hair.points(1005).shape


@needs_hairbake
def test_what_is_wrong_is_told_as_on_the_command_line(cache: hairbake.Cache, tmp_path: Path) -> None:
    with pytest.raises(hairbake.HairbakeError, match="no frame 900: it has 1004-1007") as error:
        cache.points(900)
    assert error.value.code == 64
    with pytest.raises(hairbake.HairbakeError, match=r"no array hair\.colour: it has hair\.counts, "):
        cache.fixed("hair.colour")
    with pytest.raises(hairbake.HairbakeError, match="does not move"):
        cache.moving("hair.widths", 1005)
    with pytest.raises(hairbake.HairbakeError) as error:
        hairbake.open(tmp_path)
    assert error.value.code == 65
    scene, wrong = (SAMPLE / "groom.json", SAMPLE / "shake.json"), {"anim.settings.scheme": "euler"}
    with pytest.raises(hairbake.HairbakeError, match="scheme") as error:
        hairbake.bake(*scene, tmp_path / "out", set=wrong)
    assert error.value.code == 65 and not (tmp_path / "out").exists()


@needs_hairbake
def test_a_bake_tells_what_holds_its_strands(tmp_path: Path) -> None:
    rod = Rod(length=0.1, damping=0.02).with_weight(2.0)
    angles = np.linspace(0, np.pi / 2, 60)
    arc = 2 * rod.length / np.pi * np.stack([np.sin(angles), 1 - np.cos(angles), 0 * angles], axis=1)
    strands = [
        Strand(rod, straight(rod, (0, -1, 0)), DOWN),
        Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL),
        Strand(rod, arc, HORIZONTAL),
    ]
    tie = {"name": "tip", "body": "floor", "ids": [2], "arc_share": 1}
    settings = {"reactions": True, "scheme": "backward-euler"}
    scene = Scene(strands, frames=3, preroll=60.0, substeps=1, fps=1.0, ties=[tie], settings=settings)
    cache = hairbake.open(bake_scene(scene, tmp_path))
    motion = Motion.read(cache)
    forces, moments, ties = motion.clamp_forces, motion.clamp_moments, motion.tie_forces
    assert forces is not None and moments is not None and ties is not None
    frames = len(cache.frames)
    assert (forces.shape, moments.shape, ties.shape) == ((frames, 3, 3), (frames, 3, 3), (frames, 1, 3))
    assert (cache.guides.tie_guides.tolist(), cache.guides.tie_numbers.tolist()) == ([2], [0])
    stage = Usd.Stage.Open(str(cache.directory / "hair.usda"))
    prim = stage.GetPrimAtPath("/groom/guides")
    for name, array in (("clamp_force", forces), ("clamp_moment", moments), ("tie_force", ties)):
        value = np.array(prim.GetAttribute(f"primvars:groom_{name}").Get(1))
        assert np.array_equal(value, array[cache.frames.index(1)]), name
    weight = rod.line_density * rod.length * GRAVITY
    held = forces[-1].astype(float)
    held[2] += ties[-1, 0]
    assert np.abs(held - [0, weight, 0]).max() < 1e-6 * weight
    assert np.abs(moments[-1, 0]).max() < 1e-6 * weight * rod.length
    # A straight strand bears its weight at its middle if it does not sag; sagging by Γ/8 shortens the arm.
    assert 0.9 < moments[-1, 1, 2] / (weight * rod.length / 2) < 1.0
    assert np.linalg.norm(ties[-1, 0]) > 0.1 * weight


@needs_hairbake
def test_ends_are_pinned_or_clamped_twice(tmp_path: Path) -> None:
    rod = Rod(length=0.1, damping=0.02).with_weight(0.01)
    sideways = Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)
    ends = [
        {"name": "clamp", "ids": [0], "orientation": "drawn"},
        {"name": "prop", "ids": [1], "orientation": "free"},
    ]
    scene = Scene(
        [sideways, sideways],
        frames=3,
        preroll=60.0,
        substeps=1,
        fps=1.0,
        nodes=24,
        roots=[{"name": "pin", "ids": [1], "hold": "pinned"}],
        ties=[{**end, "body": "floor", "arc_share": 1, "slides": True} for end in ends],
        settings={"reactions": True, "scheme": "backward-euler"},
    )
    motion = Motion.read(hairbake.open(bake_scene(scene, tmp_path)))
    assert motion.clamp_moments is not None and motion.tie_moments is not None
    unit = rod.line_density * rod.length * GRAVITY * rod.length
    roots, tips = motion.clamp_moments[-1, :, 2] / unit, motion.tie_moments[-1, :, 2] / unit
    assert np.allclose(roots, [1 / 12, 0], atol=1e-6)
    assert np.allclose(tips, [-1 / 12, 0], atol=1e-6)


@needs_hairbake
def test_a_loose_strand_falls_and_one_on_two_ties_is_held_by_them(tmp_path: Path) -> None:
    rod = Rod(length=0.1, damping=0.02).with_weight(0.01)
    sideways = Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)
    ends = [{"name": f"end {i}", "ids": [1], "body": "floor", "arc_share": i} for i in (0, 1)]
    scene = Scene(
        [sideways, sideways],
        frames=5,
        preroll=0.0,
        substeps=8,
        fps=24.0,
        roots=[{"name": "loose", "hold": "free"}],
        ties=ends,
        settings={"reactions": True},
    )
    cache = hairbake.open(bake_scene(scene, tmp_path))
    assert np.array_equal(cache.guides.loose, [1, 1])
    motion = Motion.read(cache)
    assert motion.clamp_forces is not None and not motion.clamp_forces.any()
    starts = np.cumsum(cache.guides.counts) - cache.guides.counts
    first, last = (cache.guides.points(frame)[starts, 1] for frame in (cache.frames[0], cache.frames[-1]))
    time = (cache.frames[-1] - cache.frames[0]) / 24
    fallen = (first - last) / (GRAVITY * time**2 / 2)
    assert np.allclose(fallen, [1, 0], atol=0.05)


@needs_hairbake
def test_normals_turn_with_twist(tmp_path: Path) -> None:
    turn = 2.0
    rod = Rod(length=0.1, damping=0.02, natural=(0.0, 0.0, turn / 0.1))
    settings = {"normals": True, "resolution": "full", "scheme": "backward-euler"}
    strand = Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)
    scene = Scene(
        [strand],
        frames=2,
        preroll=60.0,
        substeps=1,
        fps=1.0,
        gravity=(0, 0, 0),
        settings=settings,
    )
    cache = hairbake.open(bake_scene(scene, tmp_path))
    normals, turned = cache.guides.normals(1), turn * cache.guides.points(1)[:, 0] / rod.length
    # The first axis is along -z at the clamp, and turns about the tangent, x.
    expected = np.stack([0 * turned, np.sin(turned), -np.cos(turned)], axis=1)
    assert np.abs(normals - expected).max() < 1e-4
    stage = Usd.Stage.Open(str(cache.directory / "hair.usda"))
    prim = UsdGeom.BasisCurves(stage.GetPrimAtPath("/groom/guides"))
    assert np.array_equal(np.array(prim.GetNormalsAttr().Get(1)), normals)
    assert prim.GetNormalsInterpolation() == "vertex"
    done = run_command(HAIRBAKE, "validate", cache.directory)
    assert done.returncode == 0, done.stdout


@needs_hairbake
def test_loads_act_on_the_strands_that_they_name(tmp_path: Path) -> None:
    rod = Rod(length=0.1, damping=0.02)
    strands = [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)] * 3
    circle = 2 * np.pi * rod.bending[0] / rod.length
    pull = 2 * rod.bending[0] / rod.length**2
    ramp = {"frames": [-40, -20], "values": [[0, 0, 0], [0, 0, circle]]}
    loads: list[dict[str, Any]] = [
        {"name": "roll", "ids": [0], "moment_n_m": ramp},
        {"name": "rest", "group": "g1", "span_share": [0, 1], "force_n": [0, -pull / rod.length, 0]},
    ]
    settings = {"reactions": True, "scheme": "backward-euler"}
    scene = Scene(
        strands,
        frames=2,
        preroll=60.0,
        substeps=1,
        fps=1.0,
        gravity=(0, 0, 0),
        loads=loads,
        settings=settings,
    )
    motion = simulate(scene)
    tips = np.array([points[-1, -1] for points in motion.points])
    assert np.linalg.norm(tips[0]) < 1e-4 * rod.length
    assert tips[1, 1] < -0.2 * rod.length
    assert np.allclose(tips[2], [rod.length, 0, 0], atol=1e-7)
    assert motion.clamp_forces is not None and motion.clamp_moments is not None
    assert np.abs(motion.clamp_moments[-1, 0] + [0, 0, circle]).max() < 1e-5 * circle
    assert np.abs(motion.clamp_forces[-1, 1] - [0, pull, 0]).max() < 1e-5 * pull


def test_options_become_arguments() -> None:
    options: dict[str, hairbake.Option] = {
        "split_tolerance": 0.02,
        "no_pictures": True,
        "strict": False,
        "frames": None,
        "groups": ["fringe", "back"],
        "set": {"anim.fps": 25, "groom.materials[0].friction": 0.5},
    }
    text = "--split-tolerance 0.02 --no-pictures --groups fringe --groups back"
    text += " --set anim.fps=25 --set groom.materials[0].friction=0.5"
    assert as_arguments(options) == text.split()


def test_frames_become_quaternions() -> None:
    turns = np.concatenate([np.random.default_rng(3).normal(size=(50, 3)), np.pi * np.eye(3)])
    for turn in [*turns, np.zeros(3)]:
        w, x, y, z = quaternion(Rotation.from_rotvec(turn).as_matrix())
        angle = (Rotation.from_quat([x, y, z, w]).inv() * Rotation.from_rotvec(turn)).magnitude()
        assert angle < 1e-7, turn


@needs_hairbake
def test_a_rod_hangs_where_it_is_clamped() -> None:
    rod = Rod()
    strands = [
        Strand(rod, straight(rod, (0, -1, 0)), DOWN),
        Strand(rod, straight(rod, (1, 0, 0), (0.5, 0, 0)), HORIZONTAL),
    ]
    motion = simulate(Scene(strands, frames=3))
    assert motion.times[:2] == pytest.approx([0, 1 / 24])
    assert np.allclose(motion.points[0][:, -1], [0, -rod.length, 0], atol=1e-6)
    assert np.allclose(motion.points[1][:, 0], [0.5, 0, 0], atol=1e-6)
    assert motion.velocities[1][-1, -1, 1] < -0.1


def example(
    name: str, *arguments: object, python: Path = Path(sys.executable)
) -> subprocess.CompletedProcess[str]:
    """Runs an example as its text says."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "pipeline")}
    command = [str(part) for part in (python, ROOT / "examples" / name, *arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@needs_hairbake
@pytest.mark.slow
def test_the_example_plots_a_wedge(tmp_path: Path) -> None:
    plot = tmp_path / "wedge.png"
    scene = (SAMPLE / "groom.json", SAMPLE / "shake.json")
    done = example("wedge.py", *scene, "-o", plot, "--frames", "1001-1003")
    assert done.returncode == 0, done.stderr
    assert plot.read_bytes().startswith(b"\x89PNG")


@needs_hairbake
@pytest.mark.slow
def test_the_example_draws_the_figures_of_the_paper(tmp_path: Path) -> None:
    done = example("paper.py", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("hair", "ball", "wisp"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    cache = hairbake.open(tmp_path / "ball" / "cache")
    centre, radius = np.array([0.02, -0.075, 0.0]), 0.05
    # The hair lies on the ball, whose facets are a fraction of a millimetre below its radius.
    distance = np.linalg.norm(cache.guides.points(24) - centre, axis=1).min()
    assert radius < distance < radius + 1e-3


@needs_hairbake
@pytest.mark.slow
def test_the_example_lets_a_lock_fall_on_another(tmp_path: Path) -> None:
    done = example("hair_contact.py", "locks", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "locks.png").read_bytes().startswith(b"\x89PNG")

    def heights(contact: str) -> list[float]:
        """Mean heights of the tips of the lock that falls and of the one that is held."""
        cache = hairbake.open(tmp_path / "locks" / contact)
        tips = cache.guides.points(1020).reshape(32, -1, 3)[:, -1, 1]
        return [float(tips[:16].mean()), float(tips[16:].mean())]

    # Rigid bundles carry the lock that falls, which presses the other down.
    assert heights("full")[1] < heights("bodies")[1] - 0.003


def test_the_example_raises_brows_where_it_paints_them(tmp_path: Path) -> None:
    usd = tmp_path / "brows.usda"
    done = example("raise_brows.py", SAMPLE / "head.obj", "-o", usd)
    assert done.returncode == 0, done.stderr
    stage = Usd.Stage.Open(str(usd))
    face = stage.GetPrimAtPath("/head/face")
    offsets = np.array(UsdSkel.BlendShape.Get(stage, "/head/face/raised").GetOffsetsAttr().Get())
    painted = np.array(UsdGeom.PrimvarsAPI(face).GetPrimvar("brows").Get()) > 0.5
    assert painted.any() and offsets[painted, 1].min() > 5e-3
    weights = UsdSkel.Animation.Get(stage, "/head/skeleton/animation").GetBlendShapeWeightsAttr()
    at = [weights.Get(frame)[0] for frame in (1001, 1013, 1024)]
    assert at == pytest.approx([0, 1, 0], abs=1e-6)


@needs_hairbake
@pytest.mark.slow
@pytest.mark.skipif(not BLENDER.exists(), reason="no Python with bpy")
def test_the_example_makes_curves_of_blender(cache: hairbake.Cache, tmp_path: Path) -> None:
    blend = tmp_path / "hair.blend"
    done = example("to_blender.py", cache.directory, 1005, "-o", blend, python=BLENDER)
    assert done.returncode == 0, done.stderr
    script = f"""
import bpy, json
bpy.ops.wm.open_mainfile(filepath={str(blend)!r})
curves = bpy.data.hair_curves["hair"]
print(json.dumps([len(curves.curves), list(curves.points[0].position), curves.points[0].radius]))
"""
    read = run_command(BLENDER, "-c", script)
    count, (x, y, z), radius = json.loads(read.stdout.splitlines()[-1])
    first = cache.hair.points(1005)[0] * cache.metres_per_unit
    assert count == len(cache.hair.counts)
    assert np.allclose([x, z, -y], first, atol=1e-6)
    assert radius == pytest.approx(0.5 * cache.hair.widths[0] * cache.metres_per_unit)


@needs_hairbake
@pytest.mark.parametrize(
    ("rod", "thickness", "drum"),
    [
        (Rod(length=0.16, damping=0.005, drag=1.0), 0.0, 9e-4),
        (Rod(0.16, (2e-6, 2e-6), 1.5e-6, 0.016, damping=0.01, radius=2e-3), 5e-4, 0.01),
    ],
)
def test_a_strand_lies_on_its_surface(rod: Rod, thickness: float, drum: float) -> None:
    """Across a drum: its axis keeps at least its radius, whatever the thickness of the drum."""
    points = straight(rod, (1, 0, 0), (-0.06, drum + 0.004, 0))
    shape = {"type": "capsule", "ends": [[0, 0, -0.1], [0, 0, 0.1]], "radius": drum}
    collider = {"name": "drum", "shape": shape, "thickness_m": thickness}
    scene = Scene([Strand(rod, points, HORIZONTAL)], frames=40, colliders=[collider])
    places = simulate(scene).points[0]
    along = np.linspace(0, 1, 20)[:, None]
    pieces = [[a + along * (b - a) for a, b in pairwise(x)] for x in places]
    near = [float(np.hypot(*piece.T[:2]).min()) for x in pieces for piece in x]
    assert drum + 0.7 * rod.radius < min(near) < drum + 1.3 * rod.radius
    # Where it first comes over the axis of the drum.
    over = [next(piece[0] for piece in x if piece[-1, 0] > 0) for x in pieces]
    assert min(place[1] for place in over) > drum
