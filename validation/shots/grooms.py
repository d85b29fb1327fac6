"""Procedural grooms, as the USD asset of a character: long, curly, ponytail, and fur.

Metres, Y up, the face towards +Z. The head turns about the origin, in the neck.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from physics.arrays import FloatArray
from torture.scenes import mesh as write_mesh
from wisps.bakes import processor_time

from .stage import add_curves, add_mesh, new_stage
from .surfaces import Surface, Triangles, ellipsoid, height_above, of_mesh, read_obj

HEAD_CENTRE = np.array([0.0, 0.12, 0.012])
"""Centre of the head of hairbake's samples, m."""
TORSO = {
    "neck": ellipsoid([0, -0.03, -0.012], [0.05, 0.14, 0.05]),
    "shoulders": ellipsoid([0, -0.21, -0.02], [0.20, 0.08, 0.09]),
}
TIE = np.array([0.0, 0.15, -0.115])
"""Where the ponytail is tied, m."""
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres per unit, of heads that are given."""
STEP = 0.004
"""Growth per step, m."""
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class Groom:
    """An imported groom and the meshes that it goes with."""

    name: str
    file: Path
    """groom.json."""
    head: str
    """Mesh of the head, as `import track --collider` takes it."""
    mesh: Path
    """The same as an OBJ file."""
    unit: float = 1.0
    """Metres per unit of `mesh`."""
    torso: dict[str, Path] = field(default_factory=dict)
    """Meshes of the torso, which moves on its own, by name."""
    tie: tuple[FloatArray, float] | None = None
    """Place and radius of a hair tie, m."""
    below: float = 0.0
    """How much lower the ground is than for a human head, m."""
    pivot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the head turns in rest space, m."""


def scatter(count: int) -> FloatArray:
    """Unit directions, evenly spread by the golden angle."""
    y = 1 - (2 * np.arange(count) + 1.0) / count
    turn, level = np.arange(count) * GOLDEN_ANGLE, np.sqrt(1 - y * y)
    return np.stack([level * np.sin(turn), y, level * np.cos(turn)], axis=1)


def scalp(count: int) -> FloatArray:
    """`count` directions above the hairline, from the centre of the head."""
    directions = scatter(10 * count)
    azimuth = np.abs(np.arctan2(directions[:, 0], directions[:, 2]))
    # Above the ears, which are between 1.55 and 1.95.
    line = np.interp(azimuth, [0, 0.55, 1, 1.55, 1.95, 2.1, np.pi], [0.66, 0.6, 0.4, 0.32, 0.32, -0.1, -0.55])
    above = directions[np.arcsin(directions[:, 1]) > line]
    chosen: FloatArray = above[np.linspace(0, len(above) - 1, count).round().astype(int)]
    return chosen


Comb = Callable[[FloatArray, FloatArray, float], FloatArray]
"""Direction in which hair with these roots grows at these points after this length, m; `N × 3`."""


@dataclass(frozen=True)
class Cut:
    """How strands grow."""

    comb: Comb
    length: float
    """Longest strand, m."""
    layer: float
    """Height of the topmost strands over the body, m."""
    curl: tuple[float, float] = (0.0, 1.0)
    """Radius and pitch of a helix, m."""
    vertices: int = 32


def grow(roots: FloatArray, bodies: Sequence[Surface], cut: Cut) -> FloatArray:
    """Strands from these roots, combed, kept out of the bodies, and curled; `n × vertices × 3`, m."""
    random = np.random.default_rng(7)
    layer = cut.layer * random.uniform(0.3, 1.0, len(roots))
    stray = random.normal(scale=0.05, size=roots.shape)
    along = height_above(bodies, roots)[1]
    path, at = [roots], roots
    for step in range(1, round(cut.length / STEP) + 1):
        direction = cut.comb(roots, at, step * STEP) + stray
        height, up = height_above(bodies, at)
        inwards = np.minimum(np.sum(direction * up, axis=1), 0)
        lift = np.clip(3 * (layer * min(1, step * STEP / 0.03) - height) / 0.01, -0.4, 1.2)
        near = (height < layer + 0.01)[:, None]
        direction = direction + np.where(near, up * (lift - inwards)[:, None], 0)
        along = along + 0.2 * (direction / np.linalg.norm(direction, axis=1)[:, None] - along)
        along /= np.linalg.norm(along, axis=1)[:, None]
        at = clear(bodies, at + STEP * along, 0.0015 * min(1, step * STEP / 0.01))
        path.append(at)
    strands = np.stack(path, axis=1)
    if cut.curl[0]:
        strands = curled(strands, bodies, cut.curl, random)
    share = random.uniform(0.85, 1.0, len(roots))
    return np.stack(
        [resampled(s[: round(k * len(s))], cut.vertices) for s, k in zip(strands, share, strict=True)]
    )


def clear(bodies: Sequence[Surface], points: FloatArray, least: float) -> FloatArray:
    """The points, moved to a least height over the bodies, m."""
    height, up = height_above(bodies, points)
    moved: FloatArray = points + up * np.maximum(least - height, 0)[:, None]
    return moved


def curled(
    strands: FloatArray, bodies: Sequence[Surface], curl: tuple[float, float], random: np.random.Generator
) -> FloatArray:
    """Strands wound into helices whose radius opens over the first 5 cm."""
    radius, pitch = curl
    tangent = np.gradient(strands, axis=1)
    tangent /= np.linalg.norm(tangent, axis=2)[..., None]
    across = np.cross(tangent, [0.31, 0.2, 0.93])
    across /= np.linalg.norm(across, axis=2)[..., None]
    length = STEP * np.arange(strands.shape[1])
    phase = random.uniform(0, 2 * np.pi, (len(strands), 1)) + 2 * np.pi * length / pitch
    size = radius * np.minimum(1, length / 0.05)[None, :, None]
    wound = strands + size * (
        np.cos(phase)[..., None] * across + np.sin(phase)[..., None] * np.cross(tangent, across)
    )
    free = clear(bodies, wound[:, 1:].reshape(-1, 3), 0.0015).reshape(len(wound), -1, 3)
    return np.concatenate([strands[:, :1], free], axis=1)


def resampled(strand: FloatArray, count: int) -> FloatArray:
    """A polyline at `count` points of equal spacing along it."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(strand, axis=0), axis=1))])
    places = np.linspace(0, length[-1], count)
    return np.stack([np.interp(places, length, strand[:, k]) for k in range(3)], axis=1)


def slicked_back(_: FloatArray, at: FloatArray, grown: float) -> FloatArray:
    """Back from the forehead on both sides of a parting, then down."""
    top = np.clip((at[:, 1] - 0.14) / 0.06, 0, 1) * np.clip((at[:, 2] + 0.08) / 0.05, 0, 1)
    side = np.where(at[:, 0] < 0.02, -1.0, 1.0)
    return np.stack([0.45 * side * top, top - 1.3, -1.2 * top - 0.15], axis=1)


def falling(_: FloatArray, at: FloatArray, grown: float) -> FloatArray:
    """To both sides and the back, then down."""
    top = np.clip((at[:, 1] - 0.14) / 0.06, 0, 1) * np.clip((0.09 - np.abs(at[:, 0])) / 0.04, 0, 1)
    side = np.sign(at[:, 0] - 0.01)
    return np.stack([0.9 * side * top, -1.0 + 0 * top, -0.6 * top], axis=1)


def gathered(roots: FloatArray, at: FloatArray, grown: float) -> FloatArray:
    """To the tie, through it, and down."""
    offset = 0.009 * (roots - HEAD_CENTRE) / 0.1
    target = TIE + offset * [1, 1, 0]
    away = target - at
    distance = np.linalg.norm(away, axis=1)[:, None]
    reach = np.linalg.norm(target - roots, axis=1)[:, None]
    # Along the head hair takes a way that is longer than the chord.
    passed = (at[:, 2:] < TIE[2] + 0.004) | (grown > 1.7 * reach + 0.01)
    beyond = np.maximum(0, TIE[2] - at[:, 2:])
    down = [0, -1, 0] + np.array([0, 0, -1]) * np.maximum(0, 1 - beyond / 0.03)
    direction: FloatArray = np.where(passed, down, away / distance)
    return direction


def laid(_: FloatArray, at: FloatArray, grown: float) -> FloatArray:
    """Backwards along the body."""
    return np.tile([0.0, -0.35, -1.0], (len(at), 1))


def creature_radius(directions: FloatArray) -> FloatArray:
    """A body with a head in front: radius in a unit direction, m."""
    body = 1 / np.linalg.norm(directions / np.array([0.13, 0.14, 0.26]), axis=1)
    off = np.arccos(np.clip(directions @ np.array([0, 0.35, 0.94]) / np.hypot(0.35, 0.94), -1, 1))
    radius: FloatArray = body + 0.09 * np.exp(-0.5 * (off / 0.35) ** 2)
    return radius


def write_obj(folder: Path, name: str, mesh: Triangles) -> None:
    """Writes a mesh as an OBJ file, m."""
    vertices, triangles = mesh
    write_mesh(folder, name, vertices, triangles.tolist())


def sample_head(hairbake: Path, folder: Path) -> Triangles:
    """The head of hairbake's samples."""
    processor_time(
        hairbake, "sample", "short", "--wisps", 8, "--strands", 8, "--head-subdivisions", 3, "-o", folder
    )
    return read_obj(folder / "head.obj")


HEADS = {
    "long": (Cut(slicked_back, 0.46, 0.012), 90),
    "curly": (Cut(falling, 0.30, 0.014, (0.007, 0.035), vertices=96), 80),
    "ponytail": (Cut(gathered, 0.55, 0.006, vertices=48), 80),
}
"""Cut and number of guides of the grooms on a head."""
FUR = Cut(laid, 0.028, 0.006, vertices=8)
FUR_STRANDS = 4000
NAMES = (*HEADS, "fur")


def make(hairbake: Path, name: str, folder: Path) -> Groom:
    """Writes asset.usda into `folder`, and imports its groom."""
    folder.mkdir(parents=True, exist_ok=True)
    asset, groom = folder / "asset.usda", folder / "groom.json"
    stage = new_stage(asset)
    torso: dict[str, Path] = {}
    options: list[object] = []
    if name == "fur":
        body = Surface(np.zeros(3), creature_radius)
        skin = body.triangles(48, 64)
        strands = grow(body.at(scatter(FUR_STRANDS)), [body], FUR)
    else:
        skin = sample_head(hairbake, folder / "sample")
        body = of_mesh(skin, HEAD_CENTRE)
        cut, count = HEADS[name]
        strands = grow(body.at(scalp(count)), [body, *TORSO.values()], cut)
        for part, surface in TORSO.items():
            write_obj(folder, part, surface.triangles())
            torso[part] = folder / f"{part}.obj"
        options = ["--strands-per-guide", 12]
    write_obj(folder, "head", skin)
    add_mesh(stage, "/asset/head", skin)
    add_curves(stage, "/asset/hair", strands, guides=name != "fur")
    stage.Save()
    source = ("--prim", "/asset/hair", "--head", f"{asset}:/asset/head")
    processor_time(hairbake, "import", "groom", asset, *source, *options, "-o", groom)
    tie = (TIE, 0.012) if name == "ponytail" else None
    below = 0.25 if name == "fur" else 0.0
    return Groom(name, groom, f"{asset}:/asset/head", folder / "head.obj", torso=torso, tie=tie, below=below)


def real(hairbake: Path, text: str, folder: Path) -> Groom:
    """Imports the groom of `FILE=HEAD[:UNIT]`, which turns about the centre of its roots."""
    file, _, head = text.partition("=")
    mesh, _, unit = head.partition(":")
    folder.mkdir(parents=True, exist_ok=True)
    groom = folder / "groom.json"
    processor_time(hairbake, "import", "groom", file, "--head", head, "-o", groom)
    x, y, z = roots(groom).mean(axis=0)
    return Groom(Path(file).stem, groom, head, Path(mesh), UNITS[unit or "m"], pivot=(x, y, z))


def roots(groom: Path) -> FloatArray:
    """Roots of the guides of an imported groom, m, Y up."""
    content = json.loads(groom.read_text())
    guides = content["guides"]
    view, vertices = guides["points"], guides["vertices"]
    data = (groom.parent / content["buffers"][view["buffer"]]["uri"]).read_bytes()
    points = np.frombuffer(data, "<f8", 3 * view["count"], view["offset"]).reshape(-1, 3)
    counts = np.full(len(points) // vertices, vertices) if isinstance(vertices, int) else np.array(vertices)
    at: FloatArray = points[np.cumsum(counts) - counts] * content["metres_per_unit"]
    return at
