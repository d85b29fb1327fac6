"""Bakes for the comparisons, their processor time, and variants of their animations."""

import json
import resource
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hairbake_validate.cache import Cache

from .measures import StrandMotion, read_strands

STEPS = 4
"""Substeps per frame, as in Bertails, Kim, Cani and Neumann 2003."""
NUDGE = 1e-6
"""Relative increase of gravity in the bake that measures how far apart two nearly equal bakes are."""


@dataclass(frozen=True)
class SceneFiles:
    """The files of a scene."""

    groom: Path
    anim: Path


def processor_time(*command: object) -> float:
    """Runs a command, which must succeed, and returns its processor time, s."""
    done, seconds = timed(*command)
    done.check_returncode()
    return seconds


def timed(*command: object) -> tuple[subprocess.CompletedProcess[str], float]:
    """Runs a command and returns its exit code and output, and its processor time, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(part) for part in command], check=False, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def simulate(hairbake: Path, scene: SceneFiles, out: Path, *options: object) -> float:
    """Simulates into `out` and returns the processor time per substep, s, without start-up and pre-roll."""
    first, last = map(int, json.loads(scene.anim.read_text())["frames"])
    inputs = (scene.groom, scene.anim, "--substeps", STEPS)
    command = [hairbake, "simulate", *inputs, *options, "-o", out]
    shutil.rmtree(out, ignore_errors=True)
    processor_time(*command, "--frames", f"{first - 1}-{first - 1}")
    # Both commands resume from there, so start-up cancels. After the last frame follow the handle, and two
    # frames for the smoothing of strands.
    one_frame = processor_time(*command, "--frames", f"{first - 1}-{first}")
    return (processor_time(*command) - one_frame) / (last - first + 2) / STEPS


def bake(hairbake: Path, scene: SceneFiles, out: Path, *options: object) -> tuple[StrandMotion, float]:
    """Bakes into `out` and returns the strands, and the processor time of `simulate`."""
    seconds = simulate(hairbake, scene, out, *options)
    # Resumes from the simulation.
    inputs = (scene.groom, scene.anim, "--substeps", STEPS, "--no-pictures")
    processor_time(hairbake, *inputs, *options, "-o", out)
    return read_strands(Cache(out)), seconds


def sample(hairbake: Path, folder: Path, style: str, *options: object) -> SceneFiles:
    """The shaken sample of a `style`, made with further `options`."""
    processor_time(hairbake, "sample", style, *options, "-o", folder)
    return SceneFiles(folder / "groom.json", folder / "shake.json")


def variant(anim: Path, name: str, **changes: Any) -> Path:
    """The animation with these changes, written next to it."""
    path = anim.with_name(f"{anim.stem}.{name}.json")
    path.write_text(json.dumps({**json.loads(anim.read_text()), **changes}))
    return path


def shortened(anim: Path, frames: str) -> Path:
    """The animation with the frames `A-B` only."""
    return variant(anim, frames, frames=[int(frame) for frame in frames.split("-")])


def nudged(anim: Path) -> Path:
    """The animation with slightly more gravity."""
    content = json.loads(anim.read_text())
    down = [0.0, -9.81, 0.0] if content.get("up_axis", "y") == "y" else [0.0, 0.0, -9.81]
    gravity = content.get("gravity_m_s2") or down
    return variant(anim, "nudged", gravity_m_s2=[(1 + NUDGE) * g for g in gravity])


def frame_per_substep(anim: Path) -> Path:
    """The animation with a frame for each substep."""
    content = json.loads(anim.read_text())
    first, last = content["frames"]
    return variant(anim, "steps", fps=content["fps"] * STEPS, frames=[first * STEPS, last * STEPS])
