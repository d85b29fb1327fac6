"""The scenes: heads that whip, dash and jump, bodies with edges and corners, bodies that close, strands laid across each other."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from physics.scene import Motion, Rod, Scene, Strand, quaternion

FPS = 24.0
"""Film frames a second; a scene is baked at so many times the steps a frame, one step each, so that every step is written."""
SKULL = 0.09
"""Radius of the head, m."""
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
HAIR = Rod(length=0.22, damping=0.005, drag=1.0)


def turned(angle: float, axis=(0.0, 1.0, 0.0)) -> np.ndarray:
    """Unit quaternion (w, x, y, z)."""
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * np.asarray(axis, float)])


def frame_of(direction: np.ndarray) -> tuple[float, float, float, float]:
    """Some clamp frame with this tangent."""
    direction = direction / np.linalg.norm(direction)
    across = np.cross(direction, [0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    return quaternion(np.stack([across, np.cross(direction, across), direction], axis=1))


def head_of_hair(count: int, rod: Rod = HAIR) -> list[Strand]:
    """Strands out of the upper half of the skull, evenly (golden angle), rooted a millimetre deep."""
    strands = []
    for i in range(count):
        y = 1.0 - 0.9 * (i + 0.5) / count
        turn = i * np.pi * (3 - np.sqrt(5))
        out = np.array([np.sqrt(1 - y * y) * np.cos(turn), y, np.sqrt(1 - y * y) * np.sin(turn)])
        way = np.linspace(0.0, rod.length, 12)[:, None]
        strands.append(Strand(rod, (SKULL - 1e-3 + way) * out, frame_of(out)))
    return strands


def mesh(folder: Path, name: str, corners: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> dict:
    """A collider of triangles or quads, counter-clockwise from outside. Bodies of the torture set are meshes: what a cache holds of a ball is a mesh about it,
    whose corners stand off the ball, and strands that graze the one go through the other.
    """
    path = folder / f"{name}.obj"
    lines = ["v {} {} {}".format(*c) for c in corners] + [
        "f " + " ".join(str(i + 1) for i in f) for f in faces
    ]
    path.write_text("\n".join(lines) + "\n")
    return {"name": name, "shape": {"type": "mesh", "file": str(path)}}


def upright_capsule(
    folder: Path, name: str, ends: Sequence[Sequence[float]], radius: float, sides: int = 48
) -> dict:
    """A ball or, where its ends differ, a capsule along the second axis, the lower end first."""
    half = sides // 4
    angles = 2 * np.pi * np.arange(sides) / sides
    around = np.stack([np.sin(angles), np.zeros(sides), np.cos(angles)], axis=1)
    tilts = np.linspace(-np.pi / 2, 0, half + 1)[1:]
    low, high = np.asarray(ends, float)
    rings = [low + radius * (np.cos(t) * around + np.sin(t) * np.array([0, 1, 0])) for t in tilts]
    rings += [high + radius * (np.cos(t) * around - np.sin(t) * np.array([0, 1, 0])) for t in tilts[::-1]]
    if np.array_equal(low, high):
        del rings[half]
    corners = np.concatenate([low[None] - [0, radius, 0], *rings, high[None] + [0, radius, 0]])
    faces, top = [], len(corners) - 1
    for i in range(sides):
        j = (i + 1) % sides
        for ring in range(len(rings) - 1):
            a, b = 1 + ring * sides, 1 + (ring + 1) * sides
            faces.append((a + i, a + j, b + j, b + i))
        faces.append((0, 1 + j, 1 + i))
        faces.append((top, top - sides + i, top - sides + j))
    return mesh(folder, name, corners, faces)


def skull(folder: Path) -> dict:
    """The head as a ball."""
    return {**upright_capsule(folder, "skull", [[0, 0, 0]] * 2, SKULL), "body": "clamp"}


def wedge(folder: Path, name: str, size: float) -> dict:
    """A double pyramid with sharp edges and corners, as a mesh."""
    corners = size * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    return mesh(folder, name, corners, faces)


def begin(t: float) -> float:
    """Time since the start, 0 before it, brought up in a tenth of a second."""
    return 0.0 if t <= 0 else (5 * t * t if t < 0.1 else t - 0.05)


def whip(folder: Path) -> Scene:
    """The head swings to and fro about the upright at up to 20 rad/s."""

    def motion(t):
        return np.zeros(3), turned(2.5 * np.sin(8.0 * begin(t)))

    return Scene(head_of_hair(24), motion=motion, colliders=[skull(folder)])


def dash(folder: Path) -> Scene:
    """The head dashes to and fro at up to 7 m/s, past a post."""

    def motion(t):
        return np.array([0.25 * np.sin(28.0 * begin(t)), 0.0, 0.0]), UNTURNED

    post = upright_capsule(folder, "post", [[0, -0.5, 0.16], [0, 0.5, 0.16]], 0.03)

    def beside(strand: Strand) -> bool:
        """Whether it is not drawn through the post: what is cannot be kept out of it."""
        way = np.linspace(strand.points[0], strand.points[-1], 200) - [0, 0, 0.16]
        return bool(np.hypot(way[:, 0], way[:, 2]).min() > 0.032)

    strands = [strand for strand in head_of_hair(24) if beside(strand)]
    return Scene(strands, motion=motion, colliders=[skull(folder), post])


def pops(folder: Path) -> Scene:
    """The head jumps by 0.18 m and 127° within a step, and back."""

    def motion(t):
        away = 0.2 < t < 0.5 or t > 0.8
        return np.array([0.18 * away, 0.0, 0.0]), turned(np.radians(127.0) * away)

    return Scene(head_of_hair(24), motion=motion, colliders=[skull(folder)])


def edges(folder: Path) -> Scene:
    """Spikes are thrust up through hair that hangs out sideways, edge and corner first."""
    strands = []
    for i in range(12):
        out = np.array([1.0, 0.0, 0.0])
        root = np.array([0.0, 0.0, 0.015 * i - 0.0825])
        strands.append(Strand(HAIR, root + np.linspace(0.0, HAIR.length, 12)[:, None] * out, frame_of(out)))

    def thrust(at: float) -> Motion:
        def motion(t):
            # From below the hair, at up to 4 m/s.
            return np.array([at, -0.35 + 0.25 * (1 - np.cos(16.0 * begin(t))), 0.004 * at / 0.05]), turned(
                0.3 * at / 0.05
            )

        return motion

    names = {f"spike{i}": thrust(x) for i, x in enumerate((0.05, 0.13))}
    colliders = [{**wedge(folder, name, 0.05), "body": name} for name in names]
    return Scene(strands, bodies=names, colliders=colliders)


def closing(folder: Path) -> Scene:
    """A ball and a spike close on hair until they touch, and open."""

    def up(t):
        return np.array([0.0, -0.20 + 0.08 * (1 - np.cos(8.0 * begin(t))), 0.0]), UNTURNED

    ball = upright_capsule(folder, "ball", [[0.12, 0.07, 0]] * 2, 0.05)
    scene = edges(folder)
    spike = {**wedge(folder, "spike", 0.05), "body": "spike"}
    return Scene(
        scene.strands,
        bodies={"spike": lambda t: (up(t)[0] + [0.12, 0, 0], UNTURNED)},
        colliders=[ball, spike],
    )


def crossed(_: Path) -> Scene:
    """Strands fall on others, at right angles and nearly along them, and all are shaken."""
    strands = []
    stiff = Rod(length=0.2, bending=(2e-7, 2e-7), torsion=1e-7, damping=0.005, drag=1.0)
    for i in range(4):
        z = 0.05 * i
        along = np.array([1.0, 0.0, 0.0])
        strands.append(
            Strand(
                stiff,
                np.array([0.0, 0.0, z]) + np.linspace(0, stiff.length, 12)[:, None] * along,
                frame_of(along),
            )
        )
        angle = (np.pi / 2, 0.5, 0.05, 0.005)[i]
        above = np.array([np.cos(angle), 0.0, np.sin(angle)])
        root = np.array([0.1, 0.01, z]) - 0.05 * above
        strands.append(Strand(HAIR, root + np.linspace(0, HAIR.length, 12)[:, None] * above, frame_of(above)))

    def motion(t):
        return np.array([0.0, 0.05 * np.sin(20.0 * begin(t)), 0.0]), UNTURNED

    return Scene(strands, motion=motion)


SCENES: dict[str, Callable[[Path], Scene]] = {
    "whip": whip,
    "dash": dash,
    "pops": pops,
    "edges": edges,
    "closing": closing,
    "crossed": crossed,
}
"""By name; each takes a folder for its meshes."""
