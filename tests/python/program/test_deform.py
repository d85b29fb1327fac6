"""Guides alone, with the layer by which Houdini deforms the groom: as a user runs it, without Houdini."""

import json
from pathlib import Path

import lightusd
import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, Vt

from hairbake_usd.exchange import FloatArray
from hairbake_validate.collider import nearest
from hairbake_validate.geometry import transformed
from hairbake_validate.report import Report
from hairbake_validate.run import validate
from program.over_shot import FIRST, HAIR, LAST, POINTS, QUICK, STRANDS, Shot
from second_reader import assert_same_layer
from support import Done, Run, unwrapped
from usd_import.stages import INTS, add_curves, add_primvar, hanging

CHARACTER = "/world/hero/char"
SCALP = f"{CHARACTER}/head/scalp"
GUIDES = "/hairbake_guides/world_hero_char_hair/guides"
PREFIX = "houdini:hairdeform:"
GUIDES_ALONE = ("--curves", "guides")
pytestmark = pytest.mark.slow


def add_scalp(
    shot: Shot, path: str = "head/scalp", start: float = -0.05, length: float = 0.35, height: float = 0
) -> None:
    """A plate, on whose lower side the hair grows."""
    x = start + np.linspace(0, length, 8)
    ring = np.array([[-0.05, 0], [0.05, 0], [0.05, 0.03], [-0.05, 0.03]]) + [0, height]
    points = np.concatenate([np.column_stack([np.full(4, at), ring]) for at in x]) * shot.units
    sides = [
        [4 * i + k, 4 * i + (k + 1) % 4, 4 * i + 4 + (k + 1) % 4, 4 * i + 4 + k]
        for i in range(7)
        for k in range(4)
    ]
    faces = [[3, 2, 1, 0], *sides, [28, 29, 30, 31]]

    def define(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh.Define(stage, f"/char/{path}")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr([4] * len(faces))
        mesh.CreateFaceVertexIndicesAttr([i for face in faces for i in face])
        mesh.CreateSubdivisionSchemeAttr("none")

    shot.edit(shot.asset, define)


def add_skin(shot: Shot) -> None:
    """A plate that is not on the head, and that the shot bends from its first sample on."""
    add_scalp(shot, "skin", height=1.5)

    def bend(stage: Usd.Stage) -> None:
        points = stage.OverridePrim(f"{CHARACTER}/skin").GetAttribute("points")
        rest = np.array(points.Get(), float)
        for frame in range(FIRST - 8, LAST + 9):
            turn = np.radians(12) * np.sin(5 * (frame - FIRST + 8) / 24)
            moved = rest + np.outer(np.sin(turn) * rest[:, 0], [0, 0, 1])
            points.Set(Vt.Vec3fArray.FromNumpy(moved.astype(np.float32)), frame)

    shot.edit(shot.shot, bend)


@pytest.fixture
def shot(hairbake: Run, tmp_path: Path) -> Shot:
    """A character whose curves are their control points, with a scalp."""
    shot = Shot(tmp_path, hairbake, "catmullRom", "pinned")
    add_scalp(shot)
    return shot


def make_guides(stage: Usd.Stage) -> None:
    """Makes guides of the curves of the asset."""
    guides = UsdGeom.BasisCurves(stage.GetPrimAtPath("/char/hair"))
    add_primvar(guides, "groom_guide", INTS, "uniform", [1] * STRANDS)
    guides.GetPurposeAttr().Set("guide")


def scene(shot: Shot, option: str = "--collider", path: str = SCALP) -> tuple[Path, Path]:
    """Groom and animation, with a mesh of the shot as skin or collider."""
    return shot.imported(track=(option, f"{shot.shot}:{path}"))


def passed(out: Path) -> Report:
    """The report on a cache, all of whose checks of the layer hold."""
    report = validate(out)
    assert report.passed, report.as_text()
    found = {name: outcome for name, outcome in report.outcomes.items() if name.startswith("deform_")}
    assert all(outcome.status in ("pass", "skip") for outcome in found.values()), report.as_text()
    assert found["deform_targets"].status == found["deform_motion"].status == "pass"
    return report


def composed(out: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(out / "hair.shot.usda"))


def values(stage: Usd.Stage, path: str, name: str, time: float | None = None) -> FloatArray:
    attribute = stage.GetPrimAtPath(path).GetAttribute(name)
    return np.array(attribute.Get() if time is None else attribute.Get(time), float)


def in_world(stage: Usd.Stage, path: str, time: float) -> FloatArray:
    place = UsdGeom.Imageable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(time)
    return transformed(values(stage, path, "points", time), np.array(place))


def target(stage: Usd.Stage, name: str) -> str:
    (path,) = stage.GetPrimAtPath(HAIR).GetRelationship(PREFIX + name).GetTargets()
    return str(path)


class Skin:
    """The skin of the composed stage at a time: its place nearest to a root carries the curve."""

    def __init__(self, stage: Usd.Stage, time: float) -> None:
        """Reads the mesh."""
        path = target(stage, "skinPrim")
        self.rest, self.now = values(stage, path, "primvars:rest"), in_world(stage, path, time)
        self.corners = values(stage, path, "faceVertexIndices").astype(int).reshape(-1, 3)

    def carry(self, curve: FloatArray) -> FloatArray:
        """A curve, root first, as its place on the skin carries it."""
        (triangle,), (away,) = nearest(curve[:1], self.rest, self.corners)
        corners = self.corners[triangle]
        foot, rest, now = curve[0] - away, self.rest[corners], self.now[corners]
        shares = np.linalg.lstsq((rest[1:] - rest[0]).T, foot - rest[0], rcond=None)[0]
        moved: FloatArray = (curve - foot) @ axes(rest).T @ axes(now) + now[0] + shares @ (now[1:] - now[0])
        return moved


def axes(corners: FloatArray) -> FloatArray:
    """Axes of a triangle, as rows."""
    along, normal = corners[1] - corners[0], np.cross(corners[1] - corners[0], corners[2] - corners[0])
    along, normal = along / np.linalg.norm(along), normal / np.linalg.norm(normal)
    return np.stack([along, np.cross(normal, along), normal])


def as_houdini(stage: Usd.Stage, time: float) -> tuple[FloatArray, FloatArray]:
    """The curves as guides and skin put them in the world, and as the skin alone does.

    An implementation of the idea of SideFX's deformer, not of its details: the skin carries each curve, and
    guides add by how much they are off where it carries them.
    """
    skin, guides = Skin(stage, time), target(stage, "deformerPrim")
    curves = values(stage, HAIR, "points", time).reshape(STRANDS, POINTS, 3)
    on_skin = np.stack([skin.carry(curve) for curve in curves])
    ends = np.cumsum(values(stage, guides, "curveVertexCounts").astype(int))[:-1]
    rest = np.split(values(stage, guides, "primvars:rest"), ends)
    now = np.split(in_world(stage, guides, time), ends)
    deformed = on_skin.copy()
    for curve, guide, weight in zip(
        np.repeat(np.arange(STRANDS), values(stage, HAIR, "primvars:guides:lengths").astype(int)),
        values(stage, HAIR, "primvars:guides").astype(int),
        values(stage, HAIR, "primvars:weights"),
        strict=True,
    ):
        off = now[guide] - skin.carry(rest[guide])
        at, sampled = arc(curves[curve]), arc(rest[guide])
        deformed[curve] += weight * np.stack([np.interp(at, sampled, axis) for axis in off.T], axis=1)
    return deformed, on_skin


def arc(points: FloatArray) -> FloatArray:
    """Arc length up to each point as a share of the whole."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    shares: FloatArray = length / length[-1]
    return shares


def followed(stage: Usd.Stage) -> list[list[tuple[int, float]]]:
    """The guides that the layer has each curve follow, by their ids, with their weights."""
    names = ("guides", "weights", "guides:lengths")
    guides, weights, counts = (values(stage, HAIR, f"primvars:{name}") for name in names)
    ids = values(stage, GUIDES, "primvars:groom_id").astype(int)[guides.astype(int)]
    ends = np.cumsum(counts).astype(int)[:-1]
    lists = zip(np.split(ids, ends), np.split(weights, ends), strict=True)
    return [list(zip(each.tolist(), own.tolist(), strict=True)) for each, own in lists]


def closest(cache: Path) -> list[list[tuple[int, float]]]:
    """The guides that each strand of a cache follows, by their ids, with their weights."""
    stage = Usd.Stage.Open(str(cache / "hair.usda"))
    names = ("closest_guides", "guide_weights")
    guides, weights = (values(stage, "/groom/hair", f"primvars:groom_{name}") for name in names)
    lists = zip(guides.astype(int).reshape(STRANDS, -1), weights.reshape(STRANDS, -1), strict=True)
    return [
        [pair for pair in zip(each.tolist(), own.tolist(), strict=True) if pair[1] > 0] for each, own in lists
    ]


@pytest.mark.parametrize(("option", "path"), [("--collider", SCALP), ("--skin", f"{CHARACTER}/skin")])
def test_guides_and_skin_put_the_curves_where_strands_are_baked(shot: Shot, option: str, path: str) -> None:
    if option == "--skin":
        add_skin(shot)
    files, out, strands = scene(shot, option, path), shot.folder / "out", shot.folder / "strands"
    said = shot.run(*files, "-o", out, *QUICK, *GUIDES_ALONE)
    assert f"in which Houdini deforms {HAIR} by the guides" in unwrapped(said)
    assert passed(out).outcomes["deform_weights"].status == "pass"
    names = {path.name for path in out.glob("hair*")}
    assert {"hair.deform.usda", "hair.shot.usda"} < names and not any("over" in name for name in names)
    shot.run(*files, "-o", strands, *QUICK)
    ours, theirs = composed(out), composed(strands)
    assert target(ours, "deformerPrim") == GUIDES
    assert followed(ours) == closest(strands)
    off = []
    for frame in (FIRST, LAST):
        deformed, on_skin = as_houdini(ours, frame)
        baked = in_world(theirs, HAIR, frame).reshape(STRANDS, POINTS, 3)
        # Single precision, some metres from the origin, in centimetres.
        assert np.abs(deformed[:, 0] - baked[:, 0]).max() < 1e-3
        swing = np.linalg.norm(baked - on_skin, axis=-1)[:, -1]
        off.append(np.linalg.norm(deformed - baked, axis=-1)[:, -1].mean() / swing.mean())
    assert swing.mean() > 0.5
    # Strands are rods that keep their lengths, and sums of offsets do not: 0.012 of the swing here.
    assert max(off) < 0.02, off


def test_a_second_reader_reads_the_layer(shot: Shot) -> None:
    out = shot.folder / "out"
    shot.run(*scene(shot), "-o", out, *QUICK, *GUIDES_ALONE)
    assert assert_same_layer(out / "hair.deform.usda") > 8
    stage = lightusd.load(str(out / "hair.deform.usda"))
    assert not stage.warnings(), stage.warnings()


def test_a_skeleton_and_samples_of_the_stage_do_not_move_the_curves(shot: Shot) -> None:
    def move(stage: Usd.Stage) -> None:
        points = stage.OverridePrim(HAIR).GetAttribute("points")
        for frame in (FIRST, LAST):
            points.Set([point + Gf.Vec3f(0, frame - FIRST, 0) for point in points.Get()], frame)

    shot.bind("/char/hair")
    files, out = scene(shot), shot.folder / "out"
    shot.edit(shot.shot, move)
    shot.run(*files, "-o", out, *QUICK, *GUIDES_ALONE)
    passed(out)
    stage = composed(out)
    asset = Usd.Stage.Open(str(shot.asset))
    rest = asset.GetAttributeAtPath("/char/hair.points").Get()
    assert stage.GetAttributeAtPath(f"{HAIR}.points").Get(LAST) == rest
    schemas = stage.GetPrimAtPath(HAIR).GetMetadata("apiSchemas").GetAddedOrExplicitItems()
    assert schemas[:2] == ["HoudiniHairDeformAPI", "SkelBindingAPI"]


def test_curves_that_were_not_imported_are_deformed_by_guides_of_like_shapes(shot: Shot) -> None:
    def render_curves(stage: Usd.Stage) -> None:
        make_guides(stage)
        points = hanging(3 * STRANDS - 2, 5) / [3, 1, 1]
        points = np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1) * shot.units
        curves = add_curves(stage, "/char/look/render", points + [0, 0.5, 0])
        # In a space of its own, in millimetres.
        curves.AddScaleOp().Set(Gf.Vec3f(0.1))
        curves.GetPointsAttr().Set([point * 10 for point in curves.GetPointsAttr().Get()])

    shot.edit(shot.asset, render_curves)
    groom, anim, out = (shot.folder / name for name in ("groom.json", "anim.json", "out"))
    shot.run("import", "groom", shot.shot, "--prim", HAIR, "-o", groom)
    head = ("--prim", f"{CHARACTER}/head", "--collider", f"{shot.shot}:{SCALP}")
    shot.run("import", "track", shot.shot, *head, "--groom", groom, "-o", anim)
    over = ("--over", f"{shot.shot}:{CHARACTER}")
    shot.run(groom, anim, "-o", out, *QUICK, *GUIDES_ALONE, *over)
    passed(out)
    stage, render = composed(out), f"{CHARACTER}/look/render"
    methods = {
        path: stage.GetAttributeAtPath(f"{path}.{PREFIX}deformmethod").Get() for path in (HAIR, render)
    }
    assert methods == {HAIR: "guideweights", render: "guideshapeinterpolation"}
    # Guides are 2 cm apart: of the three nearest to a root the last is 2 to 4 cm away, in the curves' unit.
    assert 20 < stage.GetAttributeAtPath(f"{render}.{PREFIX}gsisearchradius").Get() < 45
    # Each guide's own curve follows it alone.
    assert list(stage.GetAttributeAtPath(f"{HAIR}.primvars:guides").Get()) == list(range(STRANDS))
    # Alone they move as ever.
    shot.run(groom, anim, "-o", shot.folder / "moved", *QUICK, *GUIDES_ALONE)
    assert (shot.folder / "moved/hair.over.usda").exists()
    alone = shot.hairbake(
        groom, anim, "-o", shot.folder / "no", *GUIDES_ALONE, "--over", f"{shot.shot}:{CHARACTER}/look"
    )
    assert alone.returncode == 65, alone.stderr


def test_a_layer_of_an_earlier_bake_is_not_read_and_stages_write_the_same_bytes(shot: Shot) -> None:
    files, out, again = scene(shot), shot.folder / "out", shot.folder / "again"
    shot.run(*files, "-o", out, *QUICK, *GUIDES_ALONE)
    shot.edit(shot.shot, lambda stage: stage.GetRootLayer().subLayerPaths.append("./out/hair.deform.usda"))
    stages = (*files, "-o", again, *QUICK[:-1], *GUIDES_ALONE)
    shot.run("simulate", *stages)
    shot.run("interpolate", *stages)
    shot.run("assemble", *stages, "--no-pictures")
    names = sorted(path.name for path in out.glob("hair*"))
    assert "hair.deform.usda" in names
    for name in [*names, "manifest.json"]:
        assert (out / name).read_bytes() == (again / name).read_bytes(), name
    passed(again)
    shot.run(*stages, "--no-pictures", "--no-over", "--overwrite")
    assert not (again / "hair.deform.usda").exists() and not (again / "hair.shot.usda").exists()


@pytest.mark.parametrize(
    ("earlier", "options", "layer"),
    [(GUIDES_ALONE, (), "hair.deform.usda"), ((), GUIDES_ALONE, "hair.over.usda")],
)
def test_curves_that_another_bake_would_move_as_well_are_refused(
    shot: Shot, earlier: tuple[str, ...], options: tuple[str, ...], layer: str
) -> None:
    files, out, again = scene(shot), shot.folder / "out", shot.folder / "again"
    shot.run(*files, "-o", out, *QUICK, *earlier)
    shot.edit(shot.shot, lambda stage: stage.GetRootLayer().subLayerPaths.append(f"./out/{layer}"))
    done = shot.hairbake(*files, "-o", again, *QUICK, *options)
    assert done.returncode == 65 and not again.exists(), done.stderr
    assert f"take {out / layer} out of the sublayers" in unwrapped(done.stderr), done.stderr
    # It may be for another character.
    other = shot.folder / "other.usda"
    other.write_text(f'#usda 1.0\n(subLayers = [@./out/{layer}@])\ndef Xform "world"\n{{\n}}\n')
    shot.edit(shot.shot, lambda stage: stage.GetRootLayer().subLayerPaths.clear())

    def another(stage: Usd.Stage) -> None:
        stage.DefinePrim("/other").GetReferences().AddReference("./other.usda", "/world")

    shot.edit(shot.shot, another)
    shot.run(*files, "-o", again, *QUICK, *options)
    report = validate(again)
    assert report.passed, report.as_text()


def test_a_curve_that_was_not_imported_follows_the_nearest_guide(shot: Shot) -> None:
    shot.shorten(STRANDS - 1)
    out = shot.folder / "out"
    shot.run(*scene(shot), "-o", out, *QUICK, *GUIDES_ALONE)
    passed(out)
    stage = composed(out)
    counts = values(stage, GUIDES, "curveVertexCounts").astype(int)
    guides = values(stage, GUIDES, "primvars:rest")[np.cumsum(counts) - counts]
    root = values(stage, HAIR, "points").reshape(STRANDS, POINTS, 3)[-1, 0]
    closest_guide = int(np.linalg.norm(guides - root, axis=1).argmin())
    lists = followed(stage)
    assert lists[-1] == [(values(stage, GUIDES, "primvars:groom_id")[closest_guide], 1.0)]
    assert any(len(each) > 1 for each in lists)


def test_curves_that_move_against_the_guides_are_refused(shot: Shot) -> None:
    guides = ("--prim", HAIR)
    groom, anim = (shot.folder / name for name in ("groom.json", "anim.json"))
    shot.edit(shot.asset, make_guides)
    shot.run("import", "groom", shot.shot, *guides, "-o", groom)
    head = ("--prim", f"{CHARACTER}/head", "--collider", f"{shot.shot}:{SCALP}")
    shot.run("import", "track", shot.shot, *head, "--groom", groom, "-o", anim)
    # The character walks, and they stay.
    shot.edit(shot.shot, lambda stage: add_curves(stage, "/world/render", hanging(STRANDS, 5) * shot.units))
    over = ("--over", f"{shot.shot}:/world")
    done = shot.hairbake(groom, anim, "-o", shot.folder / "out", *QUICK, *GUIDES_ALONE, *over)
    assert done.returncode == 65, done.stderr
    assert f"the curves move against {HAIR}" in unwrapped(done.stderr)


def left_out(done: Done, out: Path, message: str) -> None:
    """Checks that a bake went without the layer, for which nobody asked, and said why."""
    assert done.returncode == 0 and not (out / "hair.shot.usda").exists(), done.stderr
    said = unwrapped(done.stderr)
    assert "over mode is off: " in said and message in said, said


def test_heads_without_a_mesh_are_refused(hairbake: Run, tmp_path: Path) -> None:
    shot = Shot(tmp_path, hairbake)
    groom, anim = shot.imported()
    content = json.loads(anim.read_text())
    ball = {"type": "sphere", "centre": [0, 0, 160], "radius": 9}
    content["colliders"] = [{"name": "ball", "shape": ball}]
    anim.write_text(json.dumps(content))
    out = tmp_path / "out"
    done = hairbake(groom, anim, "-o", out, *QUICK, *GUIDES_ALONE, "--over", f"{shot.shot}:{HAIR}")
    assert done.returncode == 65 and not out.exists(), done.stderr
    said = unwrapped(done.stderr)
    assert "no mesh carries its roots" in said and "--collider, or --skin" in said and "--no-over" in said
    # What is not asked for is left out, and said, without a look at the stage.
    shot.shot.unlink()
    done = hairbake(groom, anim, "-o", out, *QUICK, *GUIDES_ALONE)
    left_out(done, out, "no mesh carries the hair")


def test_roots_on_several_skins_are_refused(shot: Shot) -> None:
    add_scalp(shot, "head/left", -0.05, 0.15)
    add_scalp(shot, "head/right", 0.10, 0.20)
    skins = [("--skin", f"{shot.shot}:{CHARACTER}/head/{name}") for name in ("left", "right")]
    files = shot.imported(track=(*skins[0], *skins[1]))
    out = shot.folder / "out"
    message = "its roots ride on several skins (left, right), and Houdini takes one"
    done = shot.hairbake(*files, "-o", out, *QUICK, *GUIDES_ALONE, "--over", f"{shot.shot}:{HAIR}")
    assert done.returncode == 65 and message in unwrapped(done.stderr), done.stderr
    left_out(shot.hairbake(*files, "-o", out, *QUICK, *GUIDES_ALONE), out, f"{HAIR}: {message}")


def test_lengthened_curves_are_refused(shot: Shot) -> None:
    files = shot.imported("--length-scale", "1.2", track=("--collider", f"{shot.shot}:{SCALP}"))
    out, message = shot.folder / "out", "the strands were lengthened as they were imported"
    done = shot.hairbake(*files, "-o", out, *QUICK, *GUIDES_ALONE, "--over", f"{shot.shot}:{HAIR}")
    assert done.returncode == 65 and message in unwrapped(done.stderr), done.stderr
    left_out(shot.hairbake(*files, "-o", out, *QUICK, *GUIDES_ALONE), out, message)
