"""Fur on painted meshes of USD stages, grown by the program."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

from hairbake_usd.exchange import FloatArray
from support import Run, needs_hairbake, unwrapped
from usd_import.stages import Groom, add_primvar, new_stage

pytestmark = needs_hairbake


def sheet(path: Path) -> Usd.Stage:
    """Two squares of 40 cm side by side, in centimetres and Z up, facing up, turned by 90° about z.

    In the space of the mesh they are along x.
    """
    stage = new_stage(path, 0.01, "Z")
    UsdGeom.Xform.Define(stage, "/beast").AddRotateZOp().Set(90)
    mesh = UsdGeom.Mesh.Define(stage, "/beast/body")
    mesh.CreatePointsAttr([(40 * i, 40 * j, 0) for j in range(2) for i in range(3)])
    mesh.CreateFaceVertexCountsAttr([4, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 4, 3, 1, 2, 5, 4])
    subset = UsdGeom.Subset.Define(stage, "/beast/body/belly")
    subset.CreateIndicesAttr([1])
    return stage


def grown(hairbake: Run, stage: Usd.Stage, tmp_path: Path, *options: object) -> tuple[FloatArray, str]:
    """Roots and tips of strands in the space of the mesh, `n × 2 × 3`, cm; the messages."""
    stage.Save()
    groom = tmp_path / "fur.json"
    asset = stage.GetRootLayer().realPath
    done = hairbake(
        *("grow", f"{asset}:/beast/body", "-o", groom, "--guides", 20, "--strands", 400, "--gravity", 0),
        *options,
    )
    assert done.returncode == 0, done.stderr
    points = Groom(groom).array("strands", "points").reshape(400, -1, 3)[:, [0, -1]].astype(float)
    # Turned back by 90°.
    return np.stack([points[..., 1], -points[..., 0], points[..., 2]], axis=-1), done.stderr


@pytest.mark.parametrize(
    ("interpolation", "values"),
    [("uniform", [0, 1]), ("vertex", [0, 0, 1, 0, 0, 1]), ("faceVarying", [0, 0, 0, 0, 1, 1, 1, 1])],
)
def test_density_of_any_interpolation(
    hairbake: Run, tmp_path: Path, interpolation: str, values: list[float]
) -> None:
    stage = sheet(tmp_path / "beast.usda")
    prim = stage.GetPrimAtPath("/beast/body")
    add_primvar(prim, "fur", Sdf.ValueTypeNames.FloatArray, interpolation, values)
    roots = grown(hairbake, stage, tmp_path, "--density-map", "fur")[0][:, 0]
    assert (roots[:, 0] > 40 - 1e-3).all()
    assert np.abs(roots[:, 2]).max() < 1e-3


def test_parts_and_combed_vectors(hairbake: Run, tmp_path: Path) -> None:
    stage = sheet(tmp_path / "beast.usda")
    prim = stage.GetPrimAtPath("/beast/body")
    add_primvar(prim, "comb", Sdf.ValueTypeNames.Vector3fArray, "constant", [Gf.Vec3f(0, -3, 1)])
    add_primvar(prim, "red", Sdf.ValueTypeNames.Color3fArray, "constant", [Gf.Vec3f(0.5, 0, 0)])
    strands, messages = grown(
        *(hairbake, stage, tmp_path, "--on", "belly", "--direction", "primvar:comb", "--length-map", "red"),
        *("--length", 40, "--length-variation", 0, "--clump", 0, "--frizz", 0),
    )
    assert (strands[:, 0, 0] > 40 - 1e-3).all()
    along = (strands[:, 1] - strands[:, 0]) * [1, 1, 0]
    angles = np.arctan2(along[:, 0], -along[:, 1])
    assert np.abs(angles).max() < 0.3
    assert (strands[:, 1, 2] > 0).all()
    assert "20.0 mm on average" in messages


def test_maps_that_are_missing_or_wrong(hairbake: Run, tmp_path: Path) -> None:
    stage = sheet(tmp_path / "beast.usda")
    prim = stage.GetPrimAtPath("/beast/body")
    add_primvar(prim, "short", Sdf.ValueTypeNames.FloatArray, "vertex", [1, 1])
    stage.Save()
    asset = stage.GetRootLayer().realPath

    def refused(*options: object) -> str:
        done = hairbake("grow", f"{asset}:/beast/body", "-o", tmp_path / "fur.json", *options)
        assert done.returncode == 65, done.stderr
        return unwrapped(done.stderr)

    assert "the mesh has no fur" in refused("--density-map", "fur")
    assert "has 2 values of interpolation vertex" in refused("--density-map", "short")
    assert "the mesh has no uv" in refused("--direction", "u")
