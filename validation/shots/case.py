"""One case of the set: a motion moves a groom; import, bake, validation, and figures."""

import hashlib
import json
import shutil
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path

from wisps.bakes import timed

from . import scenes
from .grooms import Groom
from .measures import Measures, measure
from .motions import MOTIONS, Motion
from .scenes import RefusedError, Shot

RESULT = "result.json"


@dataclass
class Result:
    """What became of a case."""

    motion: str
    groom: str
    key: str = ""
    """Hash of the program and of the inputs: a case that is done is not run again."""
    refused: str = ""
    """The message if the input was refused, as it had to be or not."""
    exit_code: int = 0
    """Of the bake with --strict."""
    failed: list[str] = field(default_factory=list)
    """Checks of the validator that fail, with their worst values."""
    measures: Measures = field(default_factory=Measures)
    cut_short: int = 0
    """Motions in contact that were truncated, by the record of the bake."""
    seconds: float = 0.0
    """Processor time of the bake per frame, s, pre-roll included."""
    validation_seconds: float = 0.0
    """Processor time of the validation per frame, s."""
    faults: list[str] = field(default_factory=list)
    """Why the case fails; empty if it passes."""

    @property
    def name(self) -> str:
        """The case."""
        return f"{self.motion}/{self.groom}"


@dataclass(frozen=True)
class Job:
    """A case, for a process of its own."""

    hairbake: Path
    motion: str
    """Name."""
    file: Path | None
    """Motion file; None: the motion is one of the set."""
    groom: Groom
    frames: int
    folder: Path

    def run(self) -> Result:
        """Runs the case."""
        motion = MOTIONS[self.motion] if self.file is None else self.file
        return run(self.hairbake, self.motion, Shot(self.groom, motion, self.frames), self.folder)


def run(hairbake: Path, name: str, shot: Shot, folder: Path) -> Result:
    """Runs a case in `folder`, or reads its result if program and inputs are unchanged."""
    result = Result(name, shot.groom.name)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        anim = scenes.write(hairbake, shot, folder)
    except RefusedError as refused:
        result.refused = str(refused)
    else:
        result.key = hash_of(hairbake, shot.groom.file, shot.groom.file.with_suffix(".bin"), anim)
        done = folder / RESULT
        if done.is_file():
            known = json.loads(done.read_text())
            if known["key"] == result.key:
                return Result(**{**known, "measures": Measures(**known["measures"])})
        bake(hairbake, shot, anim, folder, result)
    result.faults = faults(shot, result)
    (folder / RESULT).write_text(json.dumps(asdict(result), indent=1) + "\n")
    return result


def hash_of(*files: Path) -> str:
    """A hash of the contents of files."""
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def bake(hairbake: Path, shot: Shot, anim: Path, folder: Path, result: Result) -> None:
    """Bakes, validates, measures and draws."""
    cache, frames = folder / "cache", shot.frames + 2
    shutil.rmtree(cache, ignore_errors=True)
    options = ("--strict", "--threads", 1, "--no-pictures", "-o", cache)
    done, seconds = timed(hairbake, "bake", shot.groom.file, anim, *options)
    (folder / "bake.txt").write_text(done.stderr)
    result.exit_code, result.seconds = done.returncode, seconds / frames
    if done.returncode == 65:
        result.refused = done.stderr
        return
    if done.returncode not in (0, 1):
        return
    record = json.loads((cache / "manifest.json").read_text())
    result.cut_short = record["totals"]["shortened"]
    report = folder / "validation.json"
    validator = (sys.executable, "-m", "hairbake_validate", cache, "--jobs", 1, "--json", report)
    done, seconds = timed(*validator)
    (folder / "validation.txt").write_text(done.stdout + done.stderr)
    result.validation_seconds = seconds / frames
    result.failed = [
        f"{check['id']} {check['worst']:.3g} ({check['faults']}×)"
        for check in json.loads(report.read_text())["checks"]
        if check["status"] == "fail"
    ]
    result.measures = measure(cache)
    timed(hairbake, "preview", cache, "-o", folder / "sheet.png", "--pictures", 12, "--size", 320)


def faults(shot: Shot, result: Result) -> list[str]:
    """Why the case fails."""
    expected = shot.motion.refused if isinstance(shot.motion, Motion) else None
    if result.refused:
        if expected is not None and expected in result.refused:
            return []
        return ["refused"]
    if expected is not None:
        return [f"not refused, although the motion cannot be right ({expected})"]
    found = [f"validator: {check}" for check in result.failed]
    if result.exit_code:
        found.append(f"--strict exits with {result.exit_code}")
    if result.measures.glitches:
        found.append(f"{result.measures.glitches} velocity glitches")
    if result.measures.pops:
        found.append(f"{result.measures.pops} pops")
    return found
