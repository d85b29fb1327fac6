"""Scenes that provoke crossings: fast heads, bodies with edges, closing bodies, and crossed strands."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hairbake.rods import Collider, Pose, Rod, Scene, Strand, Track, quaternion
from physics.arrays import FloatArray

FPS = 24.0
"""Film frames a second; a scene is baked at this rate times the steps per film frame, one step a frame."""
SKULL = 0.09
"""Radius of the head, m."""
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
HAIR = Rod(length=0.22, damping=0.005, drag=1.0)


def rotation(angle: float, axis: Sequence[float] = (0.0, 1.0, 0.0)) -> FloatArray:
    """Unit quaternion (w, x, y, z) of a rotation by `angle` about `axis`."""
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * np.asarray(axis, float)])


def frame_of(direction: FloatArray) -> tuple[float, float, float, float]:
    """A clamp frame with this tangent."""
    direction = direction / np.linalg.norm(direction)
    across = np.cross(direction, [0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    return quaternion(np.stack([across, np.cross(direction, across), direction], axis=1))


def head_of_hair(count: int, rod: Rod = HAIR) -> list[Strand]:
    """Strands over the upper half of the skull, spread by the golden angle, rooted a millimetre deep."""
    strands = []
    for i in range(count):
        y = 1.0 - 0.9 * (i + 0.5) / count
        turn = i * np.pi * (3 - np.sqrt(5))
        out = np.array([np.sqrt(1 - y * y) * np.cos(turn), y, np.sqrt(1 - y * y) * np.sin(turn)])
        along = np.linspace(0.0, rod.length, 12)[:, None]
        strands.append(Strand(rod, (SKULL - 1e-3 + along) * out, frame_of(out)))
    return strands


def mesh(
    folder: Path, name: str, corners: Sequence[Sequence[float]] | FloatArray, faces: Sequence[Sequence[int]]
) -> Collider:
    """A collider of triangles or quads, counter-clockwise from outside.

    All bodies here are meshes. A cache holds a sphere as a mesh whose corners stand off it, so a strand that
    grazes the sphere would cross the mesh.
    """
    path = folder / f"{name}.obj"
    lines = ["v {} {} {}".format(*corner) for corner in corners]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return {"name": name, "shape": {"type": "mesh", "file": str(path)}}


def upright_capsule(
    folder: Path, name: str, ends: Sequence[Sequence[float]], radius: float, sides: int = 48
) -> Collider:
    """A capsule along the second axis, the lower end first; a sphere if its ends coincide."""
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
    faces: list[tuple[int, ...]] = []
    top = len(corners) - 1
    for i in range(sides):
        j = (i + 1) % sides
        for ring in range(len(rings) - 1):
            a, b = 1 + ring * sides, 1 + (ring + 1) * sides
            faces.append((a + i, a + j, b + j, b + i))
        faces.append((0, 1 + j, 1 + i))
        faces.append((top, top - sides + i, top - sides + j))
    return mesh(folder, name, corners, faces)


def skull(folder: Path) -> Collider:
    """The head, a sphere that moves with the clamp."""
    return {**upright_capsule(folder, "skull", [[0, 0, 0]] * 2, SKULL), "body": "clamp"}


def spike(folder: Path, name: str, size: float) -> Collider:
    """A double pyramid with sharp edges and corners."""
    corners = size * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    return mesh(folder, name, corners, faces)


def eased(t: float) -> float:
    """Time since the start: 0 before it, with a rate that rises to 1 within a tenth of a second."""
    return 0.0 if t <= 0 else (5 * t * t if t < 0.1 else t - 0.05)


def whip(folder: Path) -> Scene:
    """The head swings about the upright axis at up to 20 rad/s."""

    def motion(t: float) -> Pose:
        return np.zeros(3), rotation(2.5 * np.sin(8.0 * eased(t)))

    return Scene(head_of_hair(24), motion=motion, colliders=[skull(folder)])


def dash(folder: Path) -> Scene:
    """The head moves to and fro at up to 7 m/s, past a post."""

    def motion(t: float) -> Pose:
        return np.array([0.25 * np.sin(28.0 * eased(t)), 0.0, 0.0]), IDENTITY

    post = upright_capsule(folder, "post", [[0, -0.5, 0.16], [0, 0.5, 0.16]], 0.03)

    def clear_of_post(strand: Strand) -> bool:
        """True if the strand is not drawn through the post, which could not keep it out."""
        along = np.linspace(strand.points[0], strand.points[-1], 200) - [0, 0, 0.16]
        return bool(np.hypot(along[:, 0], along[:, 2]).min() > 0.032)

    strands = [strand for strand in head_of_hair(24) if clear_of_post(strand)]
    return Scene(strands, motion=motion, colliders=[skull(folder), post])


def pops(folder: Path) -> Scene:
    """The head jumps by 0.18 m and 127° within a step, and back."""

    def motion(t: float) -> Pose:
        away = 0.2 < t < 0.5 or t > 0.8
        return np.array([0.18 * away, 0.0, 0.0]), rotation(np.radians(127.0) * away)

    return Scene(head_of_hair(24), motion=motion, colliders=[skull(folder)])


def edges(folder: Path) -> Scene:
    """Spikes thrust upwards, edge and corner first, through hair that is held out sideways."""
    strands = []
    for i in range(12):
        out = np.array([1.0, 0.0, 0.0])
        root = np.array([0.0, 0.0, 0.015 * i - 0.0825])
        strands.append(Strand(HAIR, root + np.linspace(0.0, HAIR.length, 12)[:, None] * out, frame_of(out)))

    def thrust(at: float) -> Track:
        def motion(t: float) -> Pose:
            # From below the hair, at up to 4 m/s.
            height = -0.35 + 0.25 * (1 - np.cos(16.0 * eased(t)))
            return np.array([at, height, 0.004 * at / 0.05]), rotation(0.3 * at / 0.05)

        return motion

    names = {f"spike{i}": thrust(x) for i, x in enumerate((0.05, 0.13))}
    colliders = [{**spike(folder, name, 0.05), "body": name} for name in names]
    return Scene(strands, bodies=names, colliders=colliders)


def closing(folder: Path) -> Scene:
    """A ball and a spike close on hair until they touch, and open again."""

    def rising(t: float) -> Pose:
        return np.array([0.12, -0.20 + 0.08 * (1 - np.cos(8.0 * eased(t))), 0.0]), IDENTITY

    ball = upright_capsule(folder, "ball", [[0.12, 0.07, 0]] * 2, 0.05)
    moving = {**spike(folder, "spike", 0.05), "body": "spike"}
    return Scene(edges(folder).strands, bodies={"spike": rising}, colliders=[ball, moving])


def crossed(_: Path) -> Scene:
    """Strands fall on others, at right angles and nearly along them, and all are shaken."""
    strands = []
    stiff = Rod(length=0.2, bending=(2e-7, 2e-7), torsion=1e-7, damping=0.005, drag=1.0)
    for i in range(4):
        z = 0.05 * i
        along = np.array([1.0, 0.0, 0.0])
        lower = np.array([0.0, 0.0, z]) + np.linspace(0, stiff.length, 12)[:, None] * along
        strands.append(Strand(stiff, lower, frame_of(along)))
        angle = (np.pi / 2, 0.5, 0.05, 0.005)[i]
        above = np.array([np.cos(angle), 0.0, np.sin(angle)])
        root = np.array([0.1, 0.01, z]) - 0.05 * above
        strands.append(Strand(HAIR, root + np.linspace(0, HAIR.length, 12)[:, None] * above, frame_of(above)))

    def motion(t: float) -> Pose:
        return np.array([0.0, 0.05 * np.sin(20.0 * eased(t)), 0.0]), IDENTITY

    return Scene(strands, motion=motion)


SCENES: dict[str, Callable[[Path], Scene]] = {
    "whip": whip,
    "dash": dash,
    "pops": pops,
    "edges": edges,
    "closing": closing,
    "crossed": crossed,
}
"""Scenes by name; each takes a folder for its meshes."""
