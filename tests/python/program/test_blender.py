"""A cache in Blender: it opens with its curves and motion, and renders.

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
