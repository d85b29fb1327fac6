"""A cache in Blender: it opens, has the curves, widths and motion that were baked, and renders; it goes to Alembic and comes back.

`HAIRBAKE_BLENDER_PYTHON` names a Python that has `bpy` (PyPI), which bundles a USD of its own and so needs an environment of its own; else
`.blender/bin/python` of the repository is taken.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from support import ROOT

PYTHON = os.environ.get("HAIRBAKE_BLENDER_PYTHON") or str(ROOT / ".blender/bin/python")


pytestmark = pytest.mark.skipif(
    not Path(PYTHON).exists(),
    reason="no Python with bpy: python3.11 -m venv .blender && .blender/bin/python -m pip install bpy",
)


@pytest.fixture
def cache(hairbake, tmp_path) -> Path:
    """A bake of the tutorial's asset."""
    asset, groom, anim = tmp_path / "asset.usda", tmp_path / "groom.json", tmp_path / "anim.json"
    subprocess.run([os.environ["HAIRBAKE_PYTHON"], ROOT / "pipeline/sample_asset.py", asset], check=True)
    for arguments in (
        ("import", "groom", asset, "--prim", "/char/head/hair", "--guides", "40", "-o", groom),
        (
            "import",
            "track",
            asset,
            "--prim",
            "/char/head",
            "--collider",
            f"{asset}:/char/head/skin",
            "-o",
            anim,
        ),
        (groom, anim, "-o", tmp_path / "cache", "--frames", "1003-1007", "--no-pictures", "--substeps", "4"),
    ):
        done = hairbake(*arguments)
        assert done.returncode == 0, done.stderr
    return tmp_path / "cache/hair.usda"


def run(script: str, *arguments) -> dict:
    """What a script tells."""
    done = subprocess.run([PYTHON, ROOT / "pipeline" / script, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_cache_opens_and_renders(cache, tmp_path):
    picture = tmp_path / "frame.png"
    told = run("blender.py", cache, "--frame", "1006", "-o", picture, "--size", "160", "--samples", "4")

    stage = Usd.Stage.Open(str(cache))
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    assert told["frames"] == [1003, 1007]
    for name in ("hair", "guides"):
        ours, theirs = UsdGeom.BasisCurves.Get(stage, f"/groom/{name}"), told["curves"][name]
        counts, widths = ours.GetCurveVertexCountsAttr().Get(), ours.GetWidthsAttr().Get()
        assert (theirs["curves"], theirs["points"]) == (len(counts), sum(counts))
        # Blender brings the unit of the stage to metres.
        assert np.allclose(
            np.array(theirs["widths"]), np.array([widths[0], widths[counts[0] - 1]]) * unit, rtol=1e-4
        )
        first, last = (np.array(ours.GetPointsAttr().Get(frame)) * unit for frame in (1003, 1007))
        way = np.linalg.norm(last - first, axis=1)
        assert way.max() > 0.02 and np.allclose(theirs["way"], [way.mean(), way.max()], rtol=1e-3)
        assert np.allclose(theirs["first_root"], first[0], atol=1e-5)
    # Hair and head before a dark ground.
    look = f"import bpy, numpy; image = bpy.data.images.load({str(picture)!r}); print(*image.size, numpy.std(image.pixels[:]))"
    width, height, contrast = subprocess.run(
        [PYTHON, "-c", look], capture_output=True, text=True
    ).stdout.split()[-3:]
    assert (width, height) == ("160", "160") and float(contrast) > 0.03


def test_a_cache_goes_to_alembic_and_comes_back_as_a_groom(cache, hairbake, tmp_path):
    stage = Usd.Stage.Open(str(cache))
    unit, ours = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.BasisCurves.Get(stage, "/groom/hair")
    counts, widths = (
        np.array(attr.Get()) for attr in (ours.GetCurveVertexCountsAttr(), ours.GetWidthsAttr())
    )
    told = run("alembic.py", cache, "-o", tmp_path / "hair.abc")
    assert told == {"frames": [1003, 1007], "curves": {"hair": len(counts)}}

    # The asset's up is z, Alembic's y.
    assert (unit, UsdGeom.GetStageUpAxis(stage)) == (0.01, "Z")
    for frame in (1003, 1007):
        back = tmp_path / f"{frame}.usda"
        run("alembic.py", tmp_path / "hair.abc", "-o", back, "--frame", str(frame), "--units", "cm")
        theirs = Usd.Stage.Open(str(back))
        (prim,) = (prim for prim in theirs.Traverse() if prim.IsA(UsdGeom.BasisCurves))
        curves, matrix = (
            UsdGeom.BasisCurves(prim),
            np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)),
        )
        world = (
            np.array(curves.GetPointsAttr().Get()) @ matrix[:3, :3] + matrix[3, :3]
        ) * UsdGeom.GetStageMetersPerUnit(theirs)
        assert np.array_equal(curves.GetCurveVertexCountsAttr().Get(), counts)
        x, y, z = np.array(ours.GetPointsAttr().Get(frame)).T * unit
        assert np.allclose(world, np.stack([x, z, -y], axis=1), atol=2e-6)
        scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
        assert np.allclose(np.array(curves.GetWidthsAttr().Get()) * scale, widths * unit, rtol=1e-4)
    done = hairbake(
        "import", "groom", tmp_path / "1003.usda", "--guides", "40", "-o", tmp_path / "again.json"
    )
    assert done.returncode == 0, done.stderr
    command = [
        PYTHON,
        ROOT / "pipeline/alembic.py",
        tmp_path / "hair.abc",
        "-o",
        tmp_path / "none.usda",
        "--frame",
        "9",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "1003 to 1007" in done.stderr


def test_guides_alone_go_to_alembic(cache, hairbake, tmp_path):
    scene = (tmp_path / "groom.json", tmp_path / "anim.json")
    done = hairbake(
        *scene, "-o", tmp_path / "guides", "--frames", "1003-1004", "--curves", "guides", "--no-pictures"
    )
    assert done.returncode == 0, done.stderr
    assert run("alembic.py", tmp_path / "guides/hair.usda", "-o", tmp_path / "guides.abc")["curves"] == {
        "guides": 40
    }


@pytest.mark.parametrize(
    "source, output", [("no.abc", "groom.usda"), ("hair.usda", "hair.usdc"), ("empty/hair.usda", "hair.abc")]
)
def test_what_cannot_be_converted_is_told_and_nothing_written(tmp_path, source, output):
    if source.startswith("empty"):
        (tmp_path / "empty").mkdir()
        (tmp_path / source).write_text("#usda 1.0")
    command = [PYTHON, ROOT / "pipeline/alembic.py", tmp_path / source, "-o", tmp_path / output]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "error:" in done.stderr, done.stderr
    assert not (tmp_path / output).exists()
