"""Draws what figures 7 to 9 of Bertails and Cani (2004) show: a hair, hair on a ball, and a wisp.

python examples/paper.py -o out/paper
"""

import argparse
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hairbake.program import run

Vector = NDArray[np.float64]

MATERIAL = {"name": "hair", "sag_free": 0.0}


def groom(guides: Sequence[Vector], strands: Sequence[Vector] = ()) -> dict[str, Any]:
    """Content of groom.json: curves of one group, each drawn through its points, m."""
    content: dict[str, Any] = {
        "format": "hairbake-groom",
        "version": 1,
        "materials": [MATERIAL],
        "groups": [{"name": "hair", "material": 0}],
        "guides": curves(guides),
    }
    if strands:
        roots = np.array([points[0] for points in guides])
        nearest = [int(np.linalg.norm(roots - points[0], axis=1).argmin()) for points in strands]
        content["strands"] = {**curves(strands), "wisp": nearest}
    return content


def curves(curves: Sequence[Vector]) -> dict[str, Any]:
    """Curves as in groom.json."""
    return {
        "vertices": [len(points) for points in curves],
        "points": np.concatenate(curves).tolist(),
        "group": [0] * len(curves),
    }


def anim(frames: int, shake: float, **more: Any) -> dict[str, Any]:
    """Content of anim.json: the clamp swings by ± `shake`, m, along x, once a second."""
    times = np.arange(-2, frames + 6) / 24
    away = shake * np.where(times > 0, np.sin(2 * math.pi * times), 0.0)
    track = {
        "fps": 24,
        "first_frame": -2,
        "translation": [[x, 0.0, 0.0] for x in away],
        "rotation_wxyz": [[1.0, 0.0, 0.0, 0.0]] * len(times),
    }
    floor = {"translation": [[0.0, 0.0, 0.0]], "rotation_wxyz": [[1.0, 0.0, 0.0, 0.0]]}
    return {
        "format": "hairbake-anim",
        "version": 1,
        "fps": 24,
        "frames": [1, frames],
        "bodies": [{"name": "clamp", "track": track}, {"name": "floor", "track": floor}],
        **more,
    }


def straight(root: Sequence[float], direction: Sequence[float], length: float, points: int = 17) -> Vector:
    """A straight hair."""
    away: Vector = np.linspace(0.0, length, points)[:, None] * np.asarray(direction)
    away += np.asarray(root)
    return away


def helix(root: Sequence[float], length: float, radius: float, turns: float, phase: float) -> Vector:
    """A ringlet that hangs from its root and opens over its first turn."""
    u = np.linspace(0.0, 1.0, 97)
    angle = 2 * math.pi * turns * u + phase
    wide = radius * np.minimum(1.0, turns * u)
    away: Vector = np.vstack([wide * np.cos(angle), -length * u, wide * np.sin(angle)]).T
    away += np.asarray(root)
    return away


def one_hair() -> tuple[dict[str, Any], dict[str, Any]]:
    """Figure 7, right: one ringlet, simulated."""
    return groom([helix((0, 0, 0), 0.18, 0.012, 6, 0.0)]), anim(24, 0.03)


def hair_on_a_ball() -> tuple[dict[str, Any], dict[str, Any]]:
    """Figure 8: a curtain of hair, held out straight, falls on a ball."""
    roots = [(-0.07, 0.0, 0.1 * (i / 59 - 0.5)) for i in range(60)]
    hair = [straight(root, (1.0, 0.0, 0.0), 0.22) for root in roots]
    ball = {"type": "sphere", "centre": [0.02, -0.075, 0.0], "radius": 0.05}
    collider = {"name": "ball", "body": "floor", "shape": ball}
    return groom(hair), anim(24, 0.0, colliders=[collider], settings={"preroll_s": 0.0})


def wisp() -> tuple[dict[str, Any], dict[str, Any]]:
    """Figure 9: a few guides, simulated, and the hair between them, interpolated."""
    chance = np.random.default_rng(9)

    def lock(x: float, z: float) -> Vector:
        return helix((x, 0.0, z), 0.2 + 0.01 * chance.uniform(-1, 1), 0.011, 4, 25 * x)

    places = 0.008 * np.array([[0, 0], [1, 0.3], [-0.9, 0.5], [0.1, -1]])
    radius, turn = np.sqrt(chance.uniform(size=150)) * 0.009, chance.uniform(0, 2 * math.pi, 150)
    inside = np.vstack([radius * np.cos(turn), radius * np.sin(turn)]).T
    return groom([lock(x, z) for x, z in places], [lock(x, z) for x, z in inside]), anim(24, 0.05)


FIGURES: dict[str, tuple[Callable[[], tuple[dict[str, Any], dict[str, Any]]], list[str]]] = {
    "hair": (one_hair, ["--curves", "guides", "--width-scale", "8"]),
    "ball": (hair_on_a_ball, ["--curves", "guides", "--width-scale", "6"]),
    "wisp": (wisp, ["--curves", "both", "--width-scale", "3"]),
}


def main() -> None:
    """Writes, bakes and draws the scenes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for all files")
    output: Path = parser.parse_args().output
    for name, (scene, options) in FIGURES.items():
        folder = output / name
        folder.mkdir(parents=True, exist_ok=True)
        for file, content in zip(("groom.json", "anim.json"), scene(), strict=True):
            (folder / file).write_text(json.dumps(content))
        groom_file, anim_file, cache = folder / "groom.json", folder / "anim.json", folder / "cache"
        run("--no-pictures", "--overwrite", groom_file, anim_file, "-o", cache)
        picture = output / f"{name}.png"
        run("preview", cache, "-o", picture, "--pictures", "4", "--size", "300x340", *options)
        print(picture)


if __name__ == "__main__":
    main()
