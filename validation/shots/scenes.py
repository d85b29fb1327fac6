"""The files of a case: the motion as a studio has it, and anim.json, by `hairbake import track`."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from physics.arrays import FloatArray
from wisps.bakes import timed

from .grooms import TORSO, Groom
from .motions import GROUND, Motion, Place, Source, still
from .stage import UNIT, add_mesh, add_moving, new_stage

FPS, FIRST = 24, 1001
RATE = 120
"""Samples a second of BVH and JSON, and of tracks in anim.json."""


class RefusedError(Exception):
    """hairbake refused the input; the message is its own."""


@dataclass(frozen=True)
class Shot:
    """A motion that moves a groom for a number of frames."""

    groom: Groom
    motion: Motion | Path
    """A motion of the set, or a motion file."""
    frames: int

    @property
    def range(self) -> str:
        """The frames, as options take them."""
        return f"{FIRST}-{FIRST + self.frames - 1}"


def write(hairbake: Path, shot: Shot, folder: Path) -> Path:
    """Writes the motion into `folder`, imports it, and returns anim.json.

    Raises:
        RefusedError: The import was refused.
    """
    anim, motion = folder / "anim.json", shot.motion
    if isinstance(motion, Path):
        file, _, joint = str(motion).partition("=")
        options = ["--pops", "bridge", *(["--joint", joint] if joint else [])]
        imported(hairbake, shot, Path(file), options, anim)
    elif motion.source is Source.ANIM:
        anim.write_text(json.dumps(direct(shot, motion)))
    else:
        imported(hairbake, shot, *write_source(shot, motion, folder), anim)
    complete(anim, shot)
    return anim


def write_source(shot: Shot, motion: Motion, folder: Path) -> tuple[Path, list[str]]:
    """Writes the file of a motion; returns it with the options of its import."""
    if motion.source is Source.USD:
        path = folder / "shot.usda"
        write_usd(path, shot, motion)
        colliders = [f"--collider={path}:/shot/torso/{part}" for part in shot.groom.torso]
        return path, [*motion.options, "--prim=/shot/head", *colliders]
    options = [*motion.options, "--pivot", ",".join(f"{x:.6f}" for x in shot.groom.pivot)]
    if motion.source is Source.BVH:
        path = folder / "motion.bvh"
        write_bvh(path, shot, motion)
        return path, [*options, "--joint=Head", "--units=cm"]
    path = folder / "motion.json"
    write_json(path, shot, motion)
    return path, options


def imported(hairbake: Path, shot: Shot, file: Path, options: Sequence[str], anim: Path) -> None:
    """Runs `import track`.

    Raises:
        RefusedError: It ends with an error.
    """
    inputs = (file, "--groom", shot.groom.file, "--collider", shot.groom.head, "--frames", shot.range)
    done, _ = timed(hairbake, "import", "track", *inputs, *options, "-o", anim)
    (anim.parent / "import.txt").write_text(done.stderr)
    if done.returncode:
        raise RefusedError(f"import track exits with {done.returncode}: {done.stderr}")


def times(shot: Shot, motion: Motion, rate: float) -> FloatArray:
    """Times of samples, s, to two frames after the shot; BVH and JSON start with it, other files earlier."""
    starts_with_shot = motion.source in (Source.BVH, Source.JSON)
    first = 0.0 if starts_with_shot else -motion.preroll / FPS
    last = (shot.frames + 1) / FPS
    return np.arange(round(first * rate), round(last * rate) + 1) / rate


def write_usd(path: Path, shot: Shot, motion: Motion) -> None:
    """Head and torso as moving prims; the torso carries its meshes."""
    stage = new_stage(path)
    stage.SetStartTimeCode(FIRST)
    stage.SetEndTimeCode(FIRST + shot.frames - 1)
    samples = times(shot, motion, FPS)
    pivot = np.eye(4)
    pivot[:3, 3] = shot.groom.pivot
    heads = {}
    for t in samples:
        size = np.diag([*[motion.scale(t)] * 3, 1.0]) if motion.scale else np.eye(4)
        heads[FIRST + t * FPS] = pivot @ motion.head(t) @ size @ np.linalg.inv(pivot)
    add_moving(stage, "/shot/head", heads)
    body = motion.body or still
    moving = {FIRST + t * FPS: body(t) for t in samples} if motion.body else {}
    add_moving(stage, "/shot/torso", moving)
    for part in shot.groom.torso:
        add_mesh(stage, f"/shot/torso/{part}", TORSO[part].triangles())
    stage.Save()


def write_bvh(path: Path, shot: Shot, motion: Motion) -> None:
    """A skeleton of hips and head, cm. The hips are at the neck and carry the position."""
    rows = []
    for t in times(shot, motion, RATE):
        head = motion.head(t)
        turn = Rotation.from_matrix(head[:3, :3]).as_euler("ZXY", degrees=True)
        rows.append(" ".join(f"{x:.6f}" for x in (*head[:3, 3] / UNIT, 0, 0, 0, *turn)))
    channels = "Zrotation Xrotation Yrotation"
    path.write_text(
        "HIERARCHY\nROOT Hips\n{\n\tOFFSET 0 0 0\n"
        f"\tCHANNELS 6 Xposition Yposition Zposition {channels}\n"
        f"\tJOINT Head\n\t{{\n\t\tOFFSET 0 0 0\n\t\tCHANNELS 3 {channels}\n"
        "\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 20 0\n\t\t}\n\t}\n}\n"
        f"MOTION\nFrames: {len(rows)}\nFrame Time: {1 / RATE:.7f}\n" + "\n".join(rows) + "\n"
    )


def write_json(path: Path, shot: Shot, motion: Motion) -> None:
    """The motion as samples at 120 Hz from the first frame on."""
    track = sampled(motion.head, times(shot, motion, RATE))
    frames = [
        {"translation": t, "rotation_quat_wxyz": q}
        for t, q in zip(track["translation"], track["rotation_wxyz"], strict=True)
    ]
    path.write_text(json.dumps({"fps": RATE, "units": "m", "up_axis": "Y", "frames": frames}))


def sampled(place: Place, samples: FloatArray, unit: float = 1.0) -> dict[str, Any]:
    """Translations, in a unit of this many metres, and rotations of a body at these times."""
    poses = np.array([place(t) for t in samples])
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
    return {"translation": (poses[:, :3, 3] / unit).tolist(), "rotation_wxyz": quaternions.tolist()}


def track(shot: Shot, motion: Motion, place: Place, unit: float = 1.0) -> dict[str, Any]:
    """A track of anim.json."""
    samples = times(shot, motion, RATE)
    first = FIRST + samples[0] * FPS
    pops = "bridge" if "bridge" in motion.options else "error"
    poses = sampled(place, samples, unit)
    return {"fps": RATE, "first_frame": first, "smoothing_hz": 0.0, "pops": pops, **poses}


def direct(shot: Shot, motion: Motion) -> dict[str, Any]:
    """anim.json of the head and its mesh."""
    rest = {"translation": list(shot.groom.pivot)}
    mesh = {"type": "mesh", "file": str(shot.groom.mesh), "metres_per_unit": shot.groom.unit}
    return {
        "format": "hairbake-anim",
        "version": 1,
        "fps": FPS,
        "frames": [FIRST, FIRST + shot.frames - 1],
        "head": "head",
        "bodies": [{"name": "head", "track": {**track(shot, motion, motion.head), "rest": rest}}],
        "colliders": [{"name": "head", "body": "head", "shape": mesh}],
    }


def complete(anim: Path, shot: Shot) -> None:
    """Adds to anim.json what an import does not know: torso, ground and ties."""
    content = json.loads(anim.read_text())
    motion = shot.motion if isinstance(shot.motion, Motion) else None
    unit = content.get("metres_per_unit", 1.0)
    bodies, colliders = content["bodies"], content.setdefault("colliders", [])
    if motion and motion.source is not Source.USD and shot.groom.torso:
        torso: dict[str, Any] = {"name": "torso"}
        if motion.body:
            torso["track"] = track(shot, motion, motion.body, unit)
        bodies.append(torso)
        for part, file in shot.groom.torso.items():
            mesh = {"type": "mesh", "file": str(file), "metres_per_unit": 1.0}
            colliders.append({"name": part, "body": "torso", "shape": mesh})
    if motion and motion.ground:
        bodies.append({"name": "ground"})
        plane = {"type": "plane", "point": [0, (GROUND - shot.groom.below) / unit, 0], "normal": [0, 1, 0]}
        colliders.append({"name": "ground", "body": "ground", "shape": plane})
    if shot.groom.tie is not None:
        at, radius = shot.groom.tie
        tie = {"name": "ponytail", "at": (np.array(at) / unit).tolist(), "radius": radius / unit}
        content["ties"] = [tie]
    anim.write_text(json.dumps(content))
