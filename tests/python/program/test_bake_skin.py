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
RINGS, SECTORS = 11, 16


def ball(time: float) -> FloatArray:
    """Vertices of a ball that is wrung, stretched and thrown, m: two poles and eleven rings of sixteen."""
    polar, turn = np.pi * np.arange(1, RINGS + 1) / (RINGS + 1), 2 * np.pi * np.arange(SECTORS) / SECTORS
    ring = [np.outer(np.sin(polar), np.cos(turn)), np.outer(np.sin(polar), np.sin(turn))]
    height = np.repeat(np.cos(polar)[:, None], SECTORS, axis=1)
    flat = np.stack([ring[0], height, ring[1]], axis=-1).reshape(-1, 3)
    x, y, z = (0.1 * np.concatenate([[[0, 1, 0]], flat, [[0, -1, 0]]])).T
    angle = 8.0 * np.sin(5 * time) * y
    across = 1 + 3.0 * np.sin(4 * time) * y
    x, z = across * (x * np.cos(angle) + z * np.sin(angle)), z * np.cos(angle) - x * np.sin(angle)
    return np.stack([x + 0.3 * time, y * (1 + 0.3 * np.sin(6 * time)), z], axis=1)


def write_mesh(path: Path, vertices: FloatArray) -> None:
    last, faces = len(vertices), []
    for j in range(SECTORS):
        k = (j + 1) % SECTORS
        faces += [(1, 2 + k, 2 + j), (last, last - SECTORS + j, last - SECTORS + k)]
        for i in range(RINGS - 1):
            a, b = 2 + SECTORS * i + j, 2 + SECTORS * i + k
            faces += [(a, b, b + SECTORS), (a, b + SECTORS, a + SECTORS)]
    lines = ["v " + " ".join(f"{x:.12f}" for x in vertex) for vertex in vertices]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in faces]))


def strands(roots: FloatArray) -> list[list[float]]:
    along = 0.4 * np.linspace(0, 1, POINTS)[None, :, None]
    points = roots[:, None] + along * (roots + [0.01, 0.02, 0.0])[:, None]
    return [list(map(float, point)) for point in points.reshape(-1, 3).round(9)]


@pytest.fixture
def bake(hairbake: Run, tmp_path: Path) -> Callable[..., Path]:
    """Bakes fur on the ball and returns the folder of the cache."""
    write_mesh(tmp_path / "ball.obj", ball(0.0))
    for frame in range(FIRST - 6, LAST + 3):
        write_mesh(tmp_path / f"ball.{frame}.obj", ball((frame - FIRST) / 24))
    random = np.random.default_rng(5)
    # Roots up to 3 mm above the ball.
    directions = [random.normal(size=(n, 3)) for n in (40, 120)]
    guides, hair = (
        d / np.linalg.norm(d, axis=1, keepdims=True) * random.uniform(0.1, 0.103, (len(d), 1))
        for d in directions
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
    shape = {"type": "mesh", "file": "ball.obj", "sequence": "ball.####.obj"}
    anim = {
        "format": "hairbake-anim",
        "version": 1,
        "fps": 24,
        "frames": [FIRST, LAST],
        "colliders": [{"name": "ball", "shape": shape}],
        "skins": ["ball"],
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
    return {check for check, outcome in outcomes.items() if outcome.status in ("fail", "warn")}


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
    points[60:90] *= 0.99
    return points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "fault"), [("/groom/hair", slip), ("/groom/guides", slip), ("/groom/colliders/ball", dent)]
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
