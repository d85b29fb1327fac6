"""A cache in Blender: it opens with its curves and motion, renders, and converts to Alembic and back.

`HAIRBAKE_BLENDER_PYTHON` names a Python with `bpy` (PyPI); the default is `.blender/bin/python`. `bpy`
bundles its own USD and needs its own environment.
"""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from support import ROOT, Run, run_command

PYTHON = Path(os.environ.get("HAIRBAKE_BLENDER_PYTHON") or ROOT / ".blender/bin/python")
CONVERT = ROOT / "pipeline/alembic.py"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not PYTHON.exists(),
        reason="no Python with bpy: python3.11 -m venv .blender && .blender/bin/python -m pip install bpy",
    ),
]


@pytest.fixture
def cache(hairbake: Run, tmp_path: Path) -> Path:
    """A bake of the tutorial's asset."""
    asset, groom, anim = tmp_path / "asset.usda", tmp_path / "groom.json", tmp_path / "anim.json"
    done = run_command(os.environ["HAIRBAKE_PYTHON"], ROOT / "pipeline/sample_asset.py", asset)
    assert done.returncode == 0, done.stderr
    skin = f"{asset}:/char/head/skin"
    for arguments in (
        ("import", "groom", asset, "--prim", "/char/head/hair", "--guides", "40", "-o", groom),
        ("import", "track", asset, "--prim", "/char/head", "--collider", skin, "-o", anim),
        (groom, anim, "-o", tmp_path / "cache", "--frames", "1003-1007", "--no-pictures", "--substeps", "4"),
    ):
        done = hairbake(*arguments)
        assert done.returncode == 0, done.stderr
    return tmp_path / "cache/hair.usda"


def run_script(script: str, *arguments: object) -> dict[str, Any]:
    """Runs a script of `pipeline/` and returns the JSON that it prints last."""
    done = run_command(PYTHON, ROOT / "pipeline" / script, *arguments)
    assert done.returncode == 0, done.stderr
    assert script != "blender.py" or "Primvar" not in done.stdout, "Blender warns of a primvar"
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def test_cache_opens_and_renders(cache: Path, tmp_path: Path) -> None:
    picture = tmp_path / "frame.png"
    found = run_script("blender.py", cache, "--frame", 1006, "-o", picture, "--size", 160, "--samples", 4)

    stage = Usd.Stage.Open(str(cache))
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    assert found["frames"] == [1003, 1007]
    for name in ("hair", "guides"):
        ours, theirs = UsdGeom.BasisCurves.Get(stage, f"/groom/{name}"), found["curves"][name]
        counts, widths = ours.GetCurveVertexCountsAttr().Get(), ours.GetWidthsAttr().Get()
        assert (theirs["curves"], theirs["points"]) == (len(counts), sum(counts))
        # Blender converts the unit of the stage to metres.
        ends = np.array([widths[0], widths[counts[0] - 1]]) * unit
        assert np.allclose(np.array(theirs["widths"]), ends, rtol=1e-4)
        first, last = (np.array(ours.GetPointsAttr().Get(frame)) * unit for frame in (1003, 1007))
        moved = np.linalg.norm(last - first, axis=1)
        assert moved.max() > 0.02 and np.allclose(theirs["way"], [moved.mean(), moved.max()], rtol=1e-3)
        assert np.allclose(theirs["first_root"], first[0], atol=1e-5)
    # The picture shows hair and a head on a dark background.
    load = f"image = bpy.data.images.load({str(picture)!r})"
    look = f"import bpy, numpy; {load}; print(*image.size, numpy.std(image.pixels[:]))"
    width, height, contrast = run_command(PYTHON, "-c", look).stdout.split()[-3:]
    assert (width, height) == ("160", "160") and float(contrast) > 0.03


def test_cache_converts_to_alembic_and_back_to_a_groom(cache: Path, hairbake: Run, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(cache))
    unit, ours = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.BasisCurves.Get(stage, "/groom/hair")
    counts, widths = (
        np.array(attr.Get()) for attr in (ours.GetCurveVertexCountsAttr(), ours.GetWidthsAttr())
    )
    alembic = tmp_path / "hair.abc"
    found = run_script("alembic.py", cache, "-o", alembic)
    assert found == {"frames": [1003, 1007], "curves": {"hair": len(counts)}}

    # The asset is Z up, Alembic is Y up.
    assert (unit, UsdGeom.GetStageUpAxis(stage)) == (0.01, "Z")
    for frame in (1003, 1007):
        back = tmp_path / f"{frame}.usda"
        run_script("alembic.py", alembic, "-o", back, "--frame", frame, "--units", "cm")
        theirs = Usd.Stage.Open(str(back))
        (prim,) = (prim for prim in theirs.Traverse() if prim.IsA(UsdGeom.BasisCurves))
        curves = UsdGeom.BasisCurves(prim)
        matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
        points = np.array(curves.GetPointsAttr().Get()) @ matrix[:3, :3] + matrix[3, :3]
        assert np.array_equal(curves.GetCurveVertexCountsAttr().Get(), counts)
        x, y, z = np.array(ours.GetPointsAttr().Get(frame)).T * unit
        world = points * UsdGeom.GetStageMetersPerUnit(theirs)
        assert np.allclose(world, np.stack([x, z, -y], axis=1), atol=2e-6)
        scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
        assert np.allclose(np.array(curves.GetWidthsAttr().Get()) * scale, widths * unit, rtol=1e-4)
    done = hairbake(
        "import", "groom", tmp_path / "1003.usda", "--guides", "40", "-o", tmp_path / "again.json"
    )
    assert done.returncode == 0, done.stderr
    done = run_command(PYTHON, CONVERT, alembic, "-o", tmp_path / "none.usda", "--frame", "9")
    assert done.returncode == 2 and "1003 to 1007" in done.stderr


def test_guides_without_strands_convert_to_alembic(cache: Path, hairbake: Run, tmp_path: Path) -> None:
    assert cache.is_file()
    options = ("--frames", "1003-1004", "--curves", "guides", "--no-pictures")
    done = hairbake(tmp_path / "groom.json", tmp_path / "anim.json", "-o", tmp_path / "guides", *options)
    assert done.returncode == 0, done.stderr
    found = run_script("alembic.py", tmp_path / "guides/hair.usda", "-o", tmp_path / "guides.abc")
    assert found["curves"] == {"guides": 40}


@pytest.mark.parametrize(
    ("source", "output"),
    [("no.abc", "groom.usda"), ("hair.usda", "hair.usdc"), ("empty/hair.usda", "hair.abc")],
)
def test_conversion_errors_are_reported_and_nothing_is_written(
    tmp_path: Path, source: str, output: str
) -> None:
    if source.startswith("empty"):
        (tmp_path / "empty").mkdir()
        (tmp_path / source).write_text("#usda 1.0")
    done = run_command(PYTHON, CONVERT, tmp_path / source, "-o", tmp_path / output)
    assert done.returncode == 2 and "error:" in done.stderr, done.stderr
    assert not (tmp_path / output).exists()
