"""Bakes of hair on a skin pass the validator, whose own skinning carries the roots; faults do not."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf

from hairbake_validate.geometry import FloatArray
from hairbake_validate.run import validate
from support import Run

FIRST, LAST = 1001, 1006
POINTS = 8


def sheet(time: float) -> FloatArray:
    """Vertices of a sheet of 12 by 12 cells of 2 cm that is wrung and waves, m."""
    u, v = (np.ravel(axis) for axis in np.meshgrid(*[np.linspace(-0.12, 0.12, 13)] * 2, indexing="ij"))
    angle = 6.0 * np.sin(5 * time) * u
    height = 0.02 * np.sin(20 * v + 9 * time) * np.sin(4 * time)
    y, z = height * np.cos(angle) - v * np.sin(angle), height * np.sin(angle) + v * np.cos(angle)
    return np.stack([u * (1 + 0.2 * time) + 0.3 * time, y, z], axis=1)


def write_mesh(path: Path, vertices: FloatArray) -> None:
    lines = ["v " + " ".join(f"{x:.12f}" for x in vertex) for vertex in vertices]
    for i in range(12):
        for j in range(12):
            a = 13 * i + j + 1
            lines += [f"f {a} {a + 1} {a + 14}", f"f {a} {a + 14} {a + 13}"]
    path.write_text("\n".join(lines))


def strands(roots: FloatArray) -> list[list[float]]:
    along = 0.03 * np.linspace(0, 1, POINTS)[None, :, None]
    points = roots[:, None] + along * np.array([0.2, 1.0, 0.1])
    return [list(map(float, point)) for point in points.reshape(-1, 3).round(9)]


@pytest.fixture
def bake(hairbake: Run, tmp_path: Path) -> Callable[..., Path]:
    """Bakes fur on the sheet and returns the folder of the cache."""
    write_mesh(tmp_path / "sheet.obj", sheet(0.0))
    for frame in range(FIRST - 6, LAST + 3):
        write_mesh(tmp_path / f"sheet.{frame}.obj", sheet((frame - FIRST) / 24))
    random = np.random.default_rng(5)
    # Roots up to 3 mm above the sheet.
    guides, hair = (
        np.stack([*random.uniform(-0.1, 0.1, (2, n)), random.uniform(0, 0.003, n)])[[0, 2, 1]].T
        for n in (40, 120)
    )
    groom = {
        "format": "hairbake-groom",
        "version": 1,
        "guides": {"vertices": POINTS, "points": strands(guides)},
        "strands": {
            "vertices": POINTS,
            "points": strands(hair),
            "wisp": [int(np.linalg.norm(guides - root, axis=1).argmin()) for root in hair],
        },
    }
    shape = {"type": "mesh", "file": "sheet.obj", "sequence": "sheet.####.obj"}
    anim = {
        "format": "hairbake-anim",
        "version": 1,
        "fps": 24,
        "frames": [FIRST, LAST],
        "colliders": [{"name": "sheet", "shape": shape}],
        "skins": ["sheet"],
        "settings": {"preroll_s": 0.2},
    }
    (tmp_path / "groom.json").write_text(json.dumps(groom))
    (tmp_path / "anim.json").write_text(json.dumps(anim))

    def baked(*options: str) -> Path:
        out = tmp_path / "out"
        done = hairbake(tmp_path / "groom.json", tmp_path / "anim.json", "-o", out, "--no-pictures", *options)
        assert done.returncode == 0, done.stderr
        return out

    return baked


def failed(out: Path) -> set[str]:
    outcomes = validate(out).outcomes
    return {check for check, outcome in outcomes.items() if outcome.status != "pass"}


@pytest.mark.slow
def test_roots_stay_where_the_validator_carries_them(bake: Callable[..., Path]) -> None:
    out = bake("--samples", "3")
    assert failed(out) == set()
    outcomes = validate(out).outcomes
    assert all(outcomes[check].status == "pass" for check in ("skin_roots", "sub_frame_skin_roots"))


def slip(points: FloatArray) -> FloatArray:
    """One strand is a tenth of a millimetre beside its place."""
    points.reshape(-1, POINTS, 3)[7] += [1e-4, 0, 0]
    return points


def dent(points: FloatArray) -> FloatArray:
    """The skin under some strands is a millimetre lower."""
    points[60:90, 1] -= 1e-3
    return points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "fault"), [("/groom/hair", slip), ("/groom/guides", slip), ("/groom/colliders/sheet", dent)]
)
def test_roots_off_their_places_are_found(
    bake: Callable[..., Path], path: str, fault: Callable[[FloatArray], FloatArray]
) -> None:
    out = bake()
    file = str(out / f"hair.{FIRST + 2}.usdc")
    layer = Sdf.Layer.OpenAsAnonymous(file)
    points = np.array(layer.QueryTimeSample(f"{path}.points", float(FIRST + 2)))
    value = type(layer.QueryTimeSample(f"{path}.points", float(FIRST + 2)))
    layer.SetTimeSample(f"{path}.points", float(FIRST + 2), value.FromNumpy(fault(points)))
    layer.Export(file)
    assert "skin_roots" in failed(out)
