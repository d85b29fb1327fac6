"""A cache becomes Alembic and comes back as a groom, with ids, groups, widths and velocities."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import imath
import numpy as np
import pytest
from alembic3d import Abc, AbcGeom
from pxr import Usd, UsdGeom

import hairbake
from hairbake.alembic import read_curves, write_cache
from hairbake.cache import FloatArray
from support import HAIRBAKE, ROOT, Done, needs_hairbake, run_command, run_hairbake, unwrapped

pytestmark = needs_hairbake


@pytest.fixture(scope="module", autouse=True)
def environment() -> None:
    """The program under test, and the package from the sources."""
    os.environ.update(HAIRBAKE=str(HAIRBAKE), PYTHONPATH=str(ROOT / "pipeline"))


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> hairbake.Cache:
    """Two frames of the tutorial's asset, which is Z up and in centimetres."""
    folder = tmp_path_factory.mktemp("alembic")
    asset, groom, anim = folder / "asset.usda", folder / "groom.json", folder / "anim.json"
    done = run_command(os.environ["HAIRBAKE_PYTHON"], ROOT / "pipeline/sample_asset.py", asset)
    assert done.returncode == 0, done.stderr
    hairbake.run("import", "groom", asset, "--prim", "/char/head/hair", "--guides", "40", "-o", groom)
    skin = f"{asset}:/char/head/skin"
    hairbake.run("import", "track", asset, "--prim", "/char/head", "--collider", skin, "-o", anim)
    options: dict[str, hairbake.Option] = {"frames": "1003-1004", "substeps": 4, "no_pictures": True}
    return hairbake.bake(groom, anim, folder / "cache", **options)


@pytest.fixture(scope="module")
def alembic(cache: hairbake.Cache, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cache as Alembic."""
    file = tmp_path_factory.mktemp("written") / "hair.abc"
    assert write_cache(cache, file) == {"hair": len(cache.hair.counts), "guides": 40}
    return file


def y_up(vectors: FloatArray) -> FloatArray:
    """Vectors of the cache, which is Z up, with Y up."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([x, z, -y], axis=-1)


def test_every_frame_keeps_its_arrays(cache: hairbake.Cache, alembic: Path) -> None:
    assert (cache.up_axis, cache.metres_per_unit) == ("Z", 0.01)
    for frame in cache.frames:
        for found, name in zip(read_curves(alembic, frame / cache.fps), ("hair", "guides"), strict=True):
            curves = cache.hair if name == "hair" else cache.guides
            assert (found.path, found.kind, found.basis) == (f"/groom/{name}", "cubic", "catmullRom")
            assert np.array_equal(found.points, y_up(curves.points(frame)))
            assert np.array_equal(found.velocities, y_up(curves.velocities(frame)))
            assert np.array_equal(found.counts, curves.counts)
            assert np.array_equal(found.widths, curves.widths)
            expected: dict[str, Any] = {
                "groom_id": curves.ids,
                "groom_group_id": curves.groups,
                "groom_group_name": [cache.groups[group] for group in curves.groups.tolist()],
                "groom_guide": np.full(len(curves.counts), int(name == "guides")),
                "groom_root_uv": curves.root_uv,
            }
            if name == "hair":
                expected["groom_closest_guides"] = curves.closest_guides
                expected["groom_guide_weights"] = curves.guide_weights
            assert found.attributes.keys() == expected.keys()
            for attribute, values in expected.items():
                assert np.array_equal(found.attributes[attribute], values), attribute
    assert [curves.path for curves in read_curves(alembic)] == ["/groom/hair", "/groom/guides"]


def test_the_archive_follows_the_schema_of_grooms(cache: hairbake.Cache, alembic: Path) -> None:
    root = AbcGeom.IXform(Abc.IArchive(str(alembic)).getTop(), "groom")
    user = root.getSchema().getUserProperties()
    values = {
        name: Abc.IInt16Property(user, f"groom_version_{name}").getValue() for name in ("major", "minor")
    }
    assert values == {"major": 1, "minor": 4}
    times = AbcGeom.ICurves(root, "hair").getSchema().getTimeSampling()
    seconds = [times.getSampleTime(i) for i in range(len(cache.frames))]
    assert np.allclose(seconds, np.array(cache.frames) / cache.fps)


def run_alembic(*arguments: object) -> Done:
    """Runs the module as its text says."""
    return run_command(os.environ["HAIRBAKE_PYTHON"], "-m", "hairbake.alembic", *arguments)


def test_it_comes_back_as_a_groom(cache: hairbake.Cache, alembic: Path, tmp_path: Path) -> None:
    back, groom = tmp_path / "back.usda", tmp_path / "groom.json"
    done = run_alembic(alembic, "-o", back, "--units", "cm", "--time", 1004 / cache.fps)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"/groom/hair": len(cache.hair.counts), "/groom/guides": 40}
    stage = Usd.Stage.Open(str(back))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/groom/hair"))
    assert np.allclose(curves.GetPointsAttr().Get(), y_up(cache.hair.points(1004)), atol=1e-5)
    assert curves.GetWidthsInterpolation() == "vertex"
    done = run_hairbake("import", "groom", back, "-o", groom)
    assert done.returncode == 0, done.stderr
    assert "40 of 40 curves are guides" in done.stderr
    assert f"{len(cache.hair.counts)} render strands: all those of the file" in done.stderr


def write_lines(file: Path) -> None:
    """Two straight lines below a transform, with one width, and an object that holds no curves."""
    archive = Abc.CreateArchiveWithInfo(str(file), "test", "lines")
    placed, sample = AbcGeom.OXform(archive.getTop(), "placed"), AbcGeom.XformSample()
    sample.setTranslation(imath.V3d(0, 10, 0))
    sample.setScale(imath.V3d(2, 2, 2))
    placed.getSchema().set(sample)
    AbcGeom.OXform(placed, "empty")
    points = imath.V3fArrayFromBuffer(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]], np.float32))
    counts, widths = imath.IntArrayFromBuffer(np.array([2, 2], np.int32)), imath.FloatArray(1)
    widths[0] = 0.5
    made = AbcGeom.OCurvesSchemaSample(
        points,
        counts,
        AbcGeom.CurveType.kLinear,
        AbcGeom.CurvePeriodicity.kNonPeriodic,
        AbcGeom.OFloatGeomParamSample(widths, AbcGeom.GeometryScope.kConstantScope),
    )
    AbcGeom.OCurves(placed, "lines").getSchema().set(made)


def test_transforms_and_lines_are_read(tmp_path: Path) -> None:
    write_lines(tmp_path / "lines.abc")
    (found,) = read_curves(tmp_path / "lines.abc")
    assert (found.path, found.kind, found.periodic) == ("/placed/lines", "linear", False)
    assert found.points.tolist() == [[0, 10, 0], [2, 10, 0], [0, 10, 2], [2, 10, 2]]
    assert (found.counts.tolist(), found.widths.tolist(), len(found.velocities)) == ([2, 2], [0.5], 0)
    done = run_alembic(tmp_path / "lines.abc", "-o", tmp_path / "lines.usda")
    assert done.returncode == 0, done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "lines.usda"))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/placed/lines"))
    assert (curves.GetTypeAttr().Get(), curves.GetWrapAttr().Get()) == ("linear", "nonperiodic")
    assert curves.GetWidthsInterpolation() == "constant"


def test_a_cache_that_ends_early_leaves_what_was_there(cache: hairbake.Cache, tmp_path: Path) -> None:
    shutil.copytree(cache.directory, tmp_path / "cache")
    (tmp_path / f"cache/hair.{cache.frames[-1]}.usdc").write_bytes(b"")
    (tmp_path / "hair.abc").write_text("earlier")
    with pytest.raises(hairbake.HairbakeError):
        write_cache(hairbake.open(tmp_path / "cache"), tmp_path / "hair.abc")
    assert (tmp_path / "hair.abc").read_text() == "earlier"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "hair.abc"]
    assert write_cache(cache, tmp_path / "new/hair.abc")["guides"] == 40


@pytest.mark.parametrize(
    ("source", "output", "message"),
    [
        ("no.abc", "groom.usda", "is not an Alembic file"),
        ("text.abc", "groom.usda", "is not an Alembic file"),
        ("empty.abc", "groom.usda", "holds no curves"),
        ("cache", "hair.usdc", "one of the two must be Alembic"),
        ("no-cache", "hair.abc", "no such file or folder"),
    ],
)
def test_what_is_wrong_is_told_and_nothing_is_written(
    tmp_path: Path, source: str, output: str, message: str
) -> None:
    (tmp_path / "text.abc").write_text("no archive")
    Abc.CreateArchiveWithInfo(str(tmp_path / "empty.abc"), "test", "nothing")
    done = run_alembic(tmp_path / source, "-o", tmp_path / output)
    assert done.returncode == 2 and message in unwrapped(done.stderr), done.stderr
    assert not (tmp_path / output).exists()
