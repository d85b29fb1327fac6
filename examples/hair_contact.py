"""Draws hair against hair in five scenes: bodies alone, hair as a volume, and guides as rigid bundles.

python examples/hair_contact.py throw -o out/hair_contact
"""

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hairbake.program import run

Vector = NDArray[np.float64]

RATE = 96
"""Samples of a motion per second."""

HIPS, NECK = np.array([0.0, -0.45, -0.02]), np.array([0.0, 0.05, -0.018])
"""What the body bends about, and what the head turns about, m."""


def ease(start: float, end: float, t: float) -> float:
    """From 0 at `start` to 1 at `end`, smoothly; s."""
    u = min(max((t - start) / (end - start), 0.0), 1.0)
    return u**3 * (10 - 15 * u + 6 * u * u)


def turn(axis: int, angle: float) -> Vector:
    """The matrix of a turn about an axis of space, rad."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[[a, b], [a, b]] = math.cos(angle)
    matrix[a, b], matrix[b, a] = -math.sin(angle), math.sin(angle)
    return matrix


def about(place: Vector, matrix: Vector) -> Vector:
    """The pose that turns space about a place."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix, place - matrix @ place
    return pose


def throw(t: float) -> tuple[Vector, Vector]:
    """Poses of body and head: a bow, and the hair is thrown back over the head."""
    down = ease(0.1, 0.7, t) - ease(1.05, 1.4, t)
    back = ease(1.05, 1.35, t) - ease(1.45, 1.8, t)
    body = about(HIPS, turn(0, 1.1 * down))
    return body, body @ about(NECK, turn(0, 0.4 * down - 0.2 * back))


def lean(t: float) -> tuple[Vector, Vector]:
    """Poses of body and head: the head leans towards a shoulder and looks there."""
    share = ease(0.1, 0.7, t)
    return np.eye(4), about(NECK, turn(2, -0.4 * share) @ turn(1, 0.5 * share))


def walk(t: float) -> tuple[Vector, Vector]:
    """Poses of body and head: two steps a second."""
    phase = 2 * math.pi * t
    pose = about(HIPS, turn(1, 0.08 * math.sin(phase)))
    pose[:3, 3] += ease(0.0, 0.4, t) * np.array([0.02 * math.sin(phase), -0.025 * math.cos(2 * phase), 0.0])
    return pose, pose @ about(NECK, turn(0, 0.04 * math.sin(2 * phase)))


def track(poses: list[Vector]) -> dict[str, Any]:
    """A track of a body, as in anim.json."""
    quaternions = []
    for pose in poses:
        m = pose[:3, :3]
        w = 0.5 * math.sqrt(max(1 + float(np.trace(m)), 0.0))
        off = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]
        quaternions.append([w, *(float(x) / (4 * w) for x in off)])
    translations = [[float(x) for x in pose[:3, 3]] for pose in poses]
    return {"fps": RATE, "translation": translations, "rotation_wxyz": quaternions}


def on_a_head(
    style: str, motion: Callable[[float], tuple[Vector, Vector]] | str
) -> Callable[[Path], tuple[Path, Path]]:
    """A scene with a sample of the program, in a motion of its own or in one of ours."""

    def write(folder: Path) -> tuple[Path, Path]:
        run("sample", style, "--wisps", "120", "-o", folder)
        if isinstance(motion, str):
            return folder / "groom.json", folder / f"{motion}.json"
        anim = json.loads((folder / "jump.json").read_text())
        times = [i / RATE for i in range(3 * RATE)]
        bodies, heads = zip(*(motion(t) for t in times), strict=True)
        poses = {"head": list(heads), "torso": list(bodies)}
        for body in anim["bodies"]:
            body["track"] = track(poses[body["name"]])
        anim["frames"] = [1001, 1060]
        path = folder / f"{motion.__name__}.json"
        path.write_text(json.dumps(anim))
        return folder / "groom.json", path

    return write


def locks(folder: Path) -> tuple[Path, Path]:
    """A lock falls across another, which is stiff."""
    chance = np.random.default_rng(4)

    def lock(root: list[float], along: list[float], count: int) -> list[Vector]:
        """Parallel hairs with roots in a disc, m."""
        away = np.array(along)
        disc = 0.006 * np.sqrt(chance.uniform(size=count)) * np.exp(2j * math.pi * chance.uniform(size=count))
        aside = np.cross(away, [0.0, 1.0, 0.0])
        roots = [np.array(root) + z.real * aside + [0.0, z.imag, 0.0] for z in disc]
        return [root + np.linspace(0, 0.16, 17)[:, None] * away for root in roots]

    def curves(count: int) -> dict[str, Any]:
        """Hairs of both locks, as in groom.json."""
        both = lock([0.03, 0.03, -0.04], [0, 0, 1], count) + lock([-0.07, 0.0, 0.01], [1, 0, 0], count)
        points = np.concatenate(both).tolist()
        return {"vertices": [17] * len(both), "points": points, "group": [0] * count + [1] * count}

    guides, strands = curves(16), curves(250)
    roots, others = (np.array(all_of["points"])[::17] for all_of in (guides, strands))
    strands["wisp"] = [int(np.linalg.norm(roots - root, axis=1).argmin()) for root in others]
    stiff = {"name": "stiff", "sag_free": 1.0, "young_modulus_pa": 4e10, "shear_modulus_pa": 1e10}
    groom = {
        "format": "hairbake-groom",
        "version": 1,
        "materials": [{"name": "soft", "sag_free": 0.0}, stiff],
        "groups": [{"name": "falls", "material": 0}, {"name": "held", "material": 1}],
        "guides": guides,
        "strands": strands,
    }
    anim = {
        "format": "hairbake-anim",
        "version": 1,
        "fps": 24,
        "frames": [1001, 1036],
        "bodies": [{"name": "clamp", "track": track([np.eye(4)] * (2 * RATE))}],
        "settings": {"preroll_s": 0.0},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in (("groom", groom), ("anim", anim)):
        (folder / f"{name}.json").write_text(json.dumps(content))
    return folder / "groom.json", folder / "anim.json"


SCENES: dict[str, tuple[Callable[[Path], tuple[Path, Path]], str, list[str]]] = {
    "throw": (on_a_head("long", throw), "1020-1048", ["--azimuth", "70"]),
    "ponytail": (on_a_head("ponytail", "turn"), "1012-1027", ["--azimuth", "215"]),
    "shoulder": (on_a_head("long", lean), "1009-1036", ["--azimuth", "-20"]),
    "locks": (locks, "1002-1020", ["--azimuth", "50", "--curves", "both", "--width-scale", "3"]),
    "walk": (on_a_head("long-curly", walk), "1024-1042", ["--azimuth", "35"]),
}
"""Of each scene what writes it, the frames that are drawn, and how."""


def main() -> None:
    """Writes, bakes and draws the scenes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", choices=SCENES, help="what to draw")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for all files")
    parser.add_argument("--contact", default="bodies,volume,full", help="rows of the picture")
    arguments = parser.parse_args()
    write, frames, camera = SCENES[arguments.scene]
    folder: Path = arguments.output / arguments.scene
    groom, anim = write(folder)
    caches = []
    for contact in arguments.contact.split(","):
        caches.append(folder / contact)
        first, last = "1001", frames.split("-")[1]
        options = ["--contact", contact, "--frames", f"{first}-{last}", "--no-pictures", "--overwrite"]
        run(groom, anim, "-o", caches[-1], *options)
    picture = arguments.output / f"{arguments.scene}.png"
    run(
        "preview", *caches, "-o", picture, "--frames", frames, "--pictures", "4", "--size", "300x300", *camera
    )
    print(picture)


if __name__ == "__main__":
    main()
