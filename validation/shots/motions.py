"""Hard motions of a head and its body, and the files in which a studio has them.

Metres, seconds, Y up. At rest the head turns about the origin, 1.5 m above the ground. A shot starts at 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.spatial.transform import Rotation

from physics.arrays import FloatArray

GROUND = -1.5
"""Height of the ground, m."""
LYING = GROUND + 0.13
"""Height of the neck of a head that lies on the ground, m: some 3 cm stay free for the hair."""
SPIN = 20.0
"""Rate of the spins, rad/s."""

Place = Callable[[float], FloatArray]
"""Pose of a body at a time, as a matrix for column vectors, 4 × 4, m."""


class Source(Enum):
    """The file in which a motion comes."""

    USD = "usd"
    """Moving prims, a sample a frame."""
    BVH = "bvh"
    """A skeleton of hips and head at 120 Hz."""
    JSON = "json"
    """Samples at 120 Hz."""
    ANIM = "anim"
    """anim.json itself, without an import."""


@dataclass(frozen=True)
class Motion:
    """A motion of the head, and of the body below it."""

    text: str
    head: Place
    body: Place | None = None
    """None: the body stands still."""
    source: Source = Source.USD
    options: tuple[str, ...] = ()
    """Options of `import track`."""
    ground: bool = False
    """True if the shot has a ground."""
    preroll: int = 8
    """Frames with samples before the shot."""
    scale: Callable[[float], float] | None = None
    """Size of the head over time, relative to rest."""
    refused: str | None = None
    """What the message of a refusal says; None: the motion must be baked."""


def pose(position: tuple[float, float, float] = (0, 0, 0), turn: Rotation | None = None) -> FloatArray:
    """A pose."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    if turn is not None:
        matrix[:3, :3] = turn.as_matrix()
    return matrix


def about(axis: str, angle: float) -> Rotation:
    """The rotation about an axis, rad: x nods forward, y turns to the left, z tilts to the right ear."""
    return Rotation.from_euler(axis, angle)


def ease(t: float, start: float, end: float) -> float:
    """From 0 to 1 without jumps in acceleration (Flash and Hogan 1985)."""
    u = min(max((t - start) / (end - start), 0.0), 1.0)
    return u**3 * (10 - 15 * u + 6 * u * u)


def run_up(t: float, rise: float) -> float:
    """Time since the start, with a rate that rises to 1 within `rise` seconds."""
    if t <= 0:
        return 0.0
    return t * t / (2 * rise) if t < rise else t - rise / 2


def spin(axis: str) -> Place:
    """Turns at 20 rad/s about an axis from 0.2 s on."""
    return lambda t: pose(turn=about(axis, SPIN * run_up(t - 0.2, 0.3)))


def fall(t: float) -> FloatArray:
    """Tips over backwards in free fall and stops on the ground within 40 ms."""
    start, drop = 0.3, -LYING
    landing = start + np.sqrt(2 * drop / 9.81)
    fallen = min(0.5 * 9.81 * max(t - start, 0) ** 2, drop)
    # The ground stops the head over the last 8 cm.
    near = drop - 0.08
    if fallen > near:
        since = t - start - np.sqrt(2 * near / 9.81)
        fallen = near + 0.08 * (1 - np.exp(-since * np.sqrt(2 * 9.81 * near) / 0.08))
    return pose(
        (0, -fallen, -0.9 * ease(t, start, landing)), about("x", -np.pi / 2 * ease(t, start, landing))
    )


def whip_turn(t: float) -> FloatArray:
    """Turns by 180° within 0.15 s."""
    return pose(turn=about("y", np.pi * ease(t, 0.5, 0.65)))


def half_whip_turn(t: float) -> FloatArray:
    """The shoulders take part in the whip turn."""
    return pose(turn=about("y", np.pi / 2 * ease(t, 0.45, 0.8)))


def walk(t: float) -> FloatArray:
    """Walks at 1.4 m/s."""
    bob = 0.02 * np.sin(2 * np.pi * 1.9 * t)
    return pose((0.01 * np.sin(np.pi * 1.9 * t), bob, 1.4 * t), about("y", 0.05 * np.sin(np.pi * 1.9 * t)))


def after_cut(t: float) -> FloatArray:
    """Still where the last shot ended, then elsewhere and walking."""
    elsewhere = pose((2.0, 0.0, -1.0), about("y", np.radians(140.0)))
    place: FloatArray = elsewhere @ walk(t) if t > -1e-9 else np.eye(4)
    return place


def t_pose(t: float) -> FloatArray:
    """The first sample is a T-pose at the origin; the actor walks elsewhere."""
    elsewhere = pose((1.5, 0.1, 2.0), about("y", np.pi / 2))
    place: FloatArray = np.eye(4) if t < 1e-9 else elsewhere @ walk(t)
    return place


def captured(t: float) -> FloatArray:
    """An optical capture: noise of 1 mm and 0.5°, drop-outs that hold, and a stair-stepped stretch."""
    sample = round(120 * t)
    for first, last in ((40, 52), (130, 145)):
        sample = first if first <= sample < last else sample
    if 180 <= sample < 240:
        sample -= sample % 6
    smooth = sample / 120
    random = np.random.default_rng(1000 + sample)
    nod = about("x", 0.25 * np.sin(2 * np.pi * 0.8 * smooth)) * about(
        "y", 0.6 * np.sin(2 * np.pi * 0.5 * smooth)
    )
    noise = Rotation.from_rotvec(np.radians(0.5) * random.normal(size=3))
    x, y, z = 1e-3 * random.normal(size=3)
    return pose((x, y + 0.02 * np.sin(2 * np.pi * 1.6 * smooth), z + 0.4 * smooth), noise * nod)


def captured_body(t: float) -> FloatArray:
    """The shoulders walk along below the captured head."""
    return pose((0.0, 0.02 * np.sin(2 * np.pi * 1.6 * t), 0.4 * t))


def jump(t: float) -> FloatArray:
    """Crouches, leaps half a metre into the air, and lands."""
    crouch, flight = 0.3, 2 * np.sqrt(2 * 0.5 / 9.81)
    if t < 0.6:
        height = -crouch * ease(t, 0.1, 0.4) + crouch * ease(t, 0.4, 0.6)
    elif t < 0.6 + flight:
        s = t - 0.6
        height = np.sqrt(2 * 0.5 * 9.81) * s - 0.5 * 9.81 * s * s
    else:
        s = t - 0.6 - flight
        height = -np.sqrt(2 * 0.5 * 9.81) * s * np.exp(-s / 0.08)
    return pose((0, float(height), 0.5 * ease(t, 0.5, 1.4)))


def cartwheel(t: float) -> FloatArray:
    """Wheels sideways about a point at hip height once within 1.3 s."""
    hip = pose((0, -0.6, 0))
    turn = pose((1.6 * ease(t, 0.3, 1.6), 0, 0), about("z", -2 * np.pi * ease(t, 0.3, 1.6)))
    place: FloatArray = hip @ turn @ np.linalg.inv(hip)
    return place


def hanging(t: float) -> FloatArray:
    """Tips over to hang head down, and swings."""
    swing = 0.3 * np.sin(2 * np.pi * 0.9 * (t - 1.2)) * ease(t, 1.2, 1.5)
    return pose((0, 0.2, 0), about("x", np.pi * ease(t, 0.2, 1.2)) * about("x", swing))


def sprint(t: float) -> FloatArray:
    """Runs at 7 m/s with the shocks of 3.2 steps a second."""
    phase = 2 * np.pi * 3.2 * t
    shock = 0.035 * np.sin(phase) + 0.012 * np.sin(2 * phase + 0.7) + 0.004 * np.sin(4 * phase)
    nod = about("x", 0.12 + 0.06 * np.sin(phase + 1)) * about("z", 0.07 * np.sin(phase / 2))
    return pose((0.02 * np.sin(phase / 2), shock, 7.0 * t), nod)


def slow_yaw(t: float) -> FloatArray:
    """Turns at 137° a second."""
    return pose(turn=about("y", np.radians(137.0) * run_up(t - 0.2, 0.2)))


def headbang(t: float) -> FloatArray:
    """Nods by 40° to both sides three times a second."""
    return pose(turn=about("x", np.radians(40.0) * np.sin(2 * np.pi * 3 * t) * ease(t, 0, 0.3)))


def sudden_start(t: float) -> FloatArray:
    """Stands, and moves at 4 m/s from one frame to the next."""
    return pose((4.0 * max(t - 0.5, 0), 0, 0))


def ground_roll(t: float) -> FloatArray:
    """Lies on its back and rolls over sideways along the ground, once within 1.6 s."""
    angle = 2 * np.pi * ease(t, 0.2, 1.8)
    lying = about("x", -np.pi / 2)
    return pose((-0.15 * angle, LYING, 0), about("z", angle) * lying)


def still(_: float) -> FloatArray:
    """Stands still."""
    return np.eye(4)


MOTIONS: dict[str, Motion] = {
    "spin-yaw": Motion("spins at 20 rad/s about the upright axis", spin("y"), spin("y")),
    "spin-pitch": Motion("spins forwards at 20 rad/s", spin("x"), spin("x")),
    "spin-roll": Motion("spins sideways at 20 rad/s", spin("z"), spin("z"), Source.ANIM),
    "fall": Motion("falls over backwards and stops on the ground", fall, fall, Source.BVH, ground=True),
    "whip-turn": Motion("turns by 180° in 0.15 s and stops", whip_turn, half_whip_turn, Source.JSON),
    "cut": Motion("still up to a cut, then elsewhere and walking", after_cut, after_cut, refused="jump"),
    "t-pose": Motion(
        "the first sample is a T-pose elsewhere", t_pose, t_pose, Source.BVH, ("--pops", "bridge")
    ),
    "capture": Motion("capture with noise, drop-outs and held samples", captured, captured_body, Source.JSON),
    "jump": Motion("leaps off the ground and lands", jump, jump, ground=True),
    "cartwheel": Motion("wheels sideways, head down", cartwheel, cartwheel, Source.BVH, ground=True),
    "hanging": Motion("tips over and hangs head down", hanging, hanging, Source.ANIM),
    "scaled": Motion(
        "a head that the shot makes a tenth larger", walk, walk, scale=lambda t: 1.1, refused="scale"
    ),
    "growing": Motion(
        "a head that grows by a fifth", walk, walk, scale=lambda t: 1 + 0.2 * ease(t, 0.5, 2), refused="scale"
    ),
    "sprint": Motion("sprints at 7 m/s", sprint, sprint, Source.JSON),
    "slow-yaw": Motion("turns at 137° a second", slow_yaw),
    "headbang": Motion("nods by 40° at 3 Hz", headbang, None, Source.JSON),
    "sudden-start": Motion("from rest to 4 m/s within a frame", sudden_start, sudden_start),
    "ground-roll": Motion("rolls over on the ground", ground_roll, ground_roll, Source.ANIM, ground=True),
}
"""The motions by name."""
