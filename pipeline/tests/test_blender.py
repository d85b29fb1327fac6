"""A cache in Blender: it opens, has the curves, widths and motion that were baked, and renders.

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

ROOT = Path(__file__).parents[2]
PYTHON = os.environ.get("HAIRBAKE_BLENDER_PYTHON") or str(ROOT / ".blender/bin/python")


@pytest.mark.skipif(not Path(PYTHON).exists(), reason="no Python with bpy: python3.11 -m venv .blender && .blender/bin/python -m pip install bpy")
def test_a_cache_opens_and_renders(hairbake, tmp_path):
    asset, groom, anim = tmp_path / "asset.usda", tmp_path / "groom.json", tmp_path / "anim.json"
    subprocess.run([os.environ["HAIRBAKE_PYTHON"], ROOT / "pipeline/sample_asset.py", asset], check=True)
    for arguments in (
        ("import", "groom", asset, "--prim", "/char/head/hair", "--guides", "40", "-o", groom),
        ("import", "track", asset, "--prim", "/char/head", "--collider", f"{asset}:/char/head/skin", "-o", anim),
        (groom, anim, "-o", tmp_path / "cache", "--frames", "1003-1007", "--no-pictures", "--substeps", "4"),
    ):
        done = hairbake(*arguments)
        assert done.returncode == 0, done.stderr
    picture = tmp_path / "frame.png"
    command = [PYTHON, ROOT / "pipeline/blender.py", tmp_path / "cache/hair.usda", "--frame", "1006", "-o", picture]
    done = subprocess.run([*command, "--size", "160", "--samples", "4"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])

    stage = Usd.Stage.Open(str(tmp_path / "cache/hair.usda"))
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    assert told["frames"] == [1003, 1007]
    for name in ("hair", "guides"):
        ours, theirs = UsdGeom.BasisCurves.Get(stage, f"/groom/{name}"), told["curves"][name]
        counts, widths = ours.GetCurveVertexCountsAttr().Get(), ours.GetWidthsAttr().Get()
        assert (theirs["curves"], theirs["points"]) == (len(counts), sum(counts))
        # Blender brings the unit of the stage to metres.
        assert np.allclose(np.array(theirs["widths"]), np.array([widths[0], widths[counts[0] - 1]]) * unit, rtol=1e-4)
        first, last = (np.array(ours.GetPointsAttr().Get(frame)) * unit for frame in (1003, 1007))
        way = np.linalg.norm(last - first, axis=1)
        assert way.max() > 0.02 and np.allclose(theirs["way"], [way.mean(), way.max()], rtol=1e-3)
        assert np.allclose(theirs["first_root"], first[0], atol=1e-5)
    # Hair and head before a dark ground.
    look = f"import bpy, numpy; image = bpy.data.images.load({str(picture)!r}); print(*image.size, numpy.std(image.pixels[:]))"
    width, height, contrast = subprocess.run([PYTHON, "-c", look], capture_output=True, text=True).stdout.split()[-3:]
    assert (width, height) == ("160", "160") and float(contrast) > 0.03
