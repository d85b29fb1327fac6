"""Command line: `python -m goals walk.json --hairbake target/release/hairbake`.

A ponytail on a head that moves: an animator swings it, and its tip is simulated. Prints how far guides are
from the curves that lead them, whether a goal without weight changes a byte, and how a weight that jumps
accelerates hair.
"""

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd

from hairbake_validate.cache import GUIDES, Cache, read_value
from hairbake_validate.geometry import FloatArray, norms
from shots import grooms
from shots.stage import UNIT, add_curves, new_stage, vectors

FIRST = 1001
FPS = 24
HARD = 0.55
"""Share of each strand that is the animation, and what is simulated beyond."""
BACK = (30, 38)
"""Frames after the first between which the whole strand goes back to the animator."""


def swung(guides: FloatArray, frame: int) -> FloatArray:
    """The ponytail as the animator has it at a frame after the first: `n × vertices × 3`, m, rest space.

    Segments beyond the tie turn to the side and up, so that lengths stay.
    """
    steps = np.diff(guides, axis=1)
    lengths = np.concatenate(
        [np.zeros((len(guides), 1)), np.cumsum(norms(steps.reshape(-1, 3)).reshape(len(guides), -1), axis=1)],
        axis=1,
    )
    nearest = norms((guides - grooms.TIE).reshape(-1, 3)).reshape(len(guides), -1).argmin(axis=1)
    beyond = lengths[:, :-1] - np.take_along_axis(lengths, nearest[:, None], axis=1)
    bend = np.clip(beyond / 0.15, 0, 1)
    bend = bend * bend * (3 - 2 * bend)
    t = frame / FPS
    side, up = 1.1 * np.sin(2 * np.pi * t) * bend, 0.4 * (1 - np.cos(2.5 * np.pi * t)) * bend
    x, y, z = np.moveaxis(steps, -1, 0)
    x, y = np.cos(side) * x - np.sin(side) * y, np.sin(side) * x + np.cos(side) * y
    y, z = np.cos(up) * y - np.sin(up) * z, np.sin(up) * y + np.cos(up) * z
    turned = np.stack([x, y, z], axis=-1)
    found: FloatArray = np.concatenate([guides[:, :1], guides[:, :1] + np.cumsum(turned, axis=1)], axis=1)
    return found


def write_curves(path: Path, guides: FloatArray, frames: Sequence[int]) -> None:
    """The animator's curves as a USD stage."""
    stage = new_stage(path)
    add_curves(stage, "/tail", guides, guides=True)
    points = stage.GetPrimAtPath("/tail").GetAttribute("points")
    for frame in frames:
        points.Set(vectors(swung(guides, frame - FIRST).reshape(-1, 3) / UNIT), Usd.TimeCode(frame))
    stage.Save()


def rest_of(groom: Path) -> FloatArray:
    """The guides of an imported groom, `n × vertices × 3`, m, Y up."""
    content = json.loads(groom.read_text())
    view = content["guides"]["points"]
    data = (groom.parent / content["buffers"][view["buffer"]]["uri"]).read_bytes()
    points = np.frombuffer(data, "<f8", 3 * view["count"], view["offset"]).reshape(-1, 3)
    metres: FloatArray = points.reshape(-1, content["guides"]["vertices"], 3) * content["metres_per_unit"]
    return metres


def run(*command: object) -> str:
    """Runs a command; its output on standard error."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stderr


class Study:
    """The files of the study."""

    def __init__(self, hairbake: Path, motion: Path, folder: Path, frames: int) -> None:
        """Makes the groom, the curves and the animation."""
        self.hairbake, self.folder, self.frames = hairbake, folder, range(FIRST, FIRST + frames)
        groom = grooms.make(hairbake, "ponytail", folder / "groom")
        self.groom = groom.file
        self.guides = rest_of(groom.file)
        write_curves(folder / "tail.usda", self.guides, self.frames)
        done = run(
            *(
                hairbake,
                "import",
                "track",
                motion,
                "--groom",
                groom.file,
                "--pivot",
                "0,0,0",
                "--pops",
                "bridge",
            ),
            *("--rest", "first", "--fps", FPS, "--frames", f"{self.frames[0]}-{self.frames[-1]}"),
            *("--collider", groom.head, "--goal", folder / "tail.usda", "--goal-space", "rest"),
            *("-o", folder / "anim.json"),
        )
        print("\n".join(line.strip() for line in done.splitlines() if "goal" in line))
        self.anim = json.loads((folder / "anim.json").read_text())

    def bake(self, name: str, goal: dict[str, Any] | None, *options: object) -> Cache:
        """Bakes with other values of the goal, or without any; prints what the program says of goals."""
        goals = [] if goal is None else [{**self.anim["goals"][0], **goal}]
        anim = self.folder / f"{name}.json"
        anim.write_text(json.dumps({**self.anim, "goals": goals}))
        out = self.folder / name
        said = run(self.hairbake, self.groom, anim, "-o", out, "--overwrite", "--no-pictures", *options)
        kept = ("goals", "time", "penetration", "warning")
        print(
            f"{name}: "
            + "; ".join(" ".join(line.split()) for line in said.splitlines() if line.startswith(kept))
        )
        return Cache(out)

    def points(self, cache: Cache) -> FloatArray:
        """Points of the guides at all frames, `frames × N × 3`, m."""
        values = [np.array(read_value(cache, frame, f"{GUIDES}.points"), float) for frame in self.frames]
        metres: FloatArray = np.stack(values) * cache.metres_per_unit
        return metres


def digest(cache: Cache) -> str:
    """Checksum of the files of all frames."""
    return hashlib.sha256(b"".join(cache.frame_path(f).read_bytes() for f in cache.frames)).hexdigest()


def accelerations(points: FloatArray) -> FloatArray:
    """Second differences over frames, `frames − 2 × N`, m/s²."""
    second = (points[2:] - 2 * points[1:-1] + points[:-2]) * FPS**2
    return norms(second.reshape(-1, 3)).reshape(len(second), -1)


def statistics(name: str, points: FloatArray) -> None:
    """Prints the accelerations of a bake."""
    found = accelerations(points)
    print(
        f"{name}: accelerations {np.median(found):.0f} m/s² in the median, "
        f"{np.percentile(found, 99):.0f} at the 99th percentile, {found.max():.0f} at most"
    )


def main() -> int:
    """Bakes the ponytail and prints the figures."""
    parser = argparse.ArgumentParser(prog="goals", description=__doc__)
    parser.add_argument("motion", type=Path, help="head track, JSON")
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--keep", type=Path, help="folder to work in; default: one that is removed")
    parser.add_argument("--only", choices=("ponytail", "figures"), help="one part")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        study = Study(options.hairbake.resolve(), options.motion, folder.resolve(), options.frames)
        if options.only != "figures":
            back = [FIRST + frame for frame in BACK]
            study.bake("ponytail", {"hard_to": {"frames": back, "values": [HARD, 1]}})
        if options.only != "ponytail":
            # Bodies alone: what the goal does is seen without what hair does to hair.
            alone = ("--contact", "bodies")
            free = study.bake("free", None, *alone)
            weightless = study.bake("weightless", {"weight": 0}, *alone)
            same = digest(free) == digest(weightless)
            print(f"at weight 0 the cache has {'the same' if same else 'OTHER'} bytes")
            full = study.bake("full", {}, *alone)
            middle = FIRST + len(study.frames) // 2
            step = study.bake(
                "step", {"weight": {"frames": [middle, middle + 0.01], "values": [0, 1]}}, *alone
            )
            blend = study.bake(
                "blend", {"weight": {"frames": [middle, middle + 8], "values": [0, 1]}}, *alone
            )
            found = {"free": free, "full": full, "step": step, "blend": blend}
            for name, cache in found.items():
                statistics(name, study.points(cache))
    return 0


if __name__ == "__main__":
    sys.exit(main())
