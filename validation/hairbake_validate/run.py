"""Runs the checks on a cache, with frames in parallel."""

import multiprocessing
from collections.abc import Container, Iterator
from pathlib import Path

from . import checks_deform, checks_over
from .cache import Cache
from .checks_clips import CLIP_CHECKS
from .checks_deform import DEFORM
from .checks_files import CHECKSUMS, FILES, checksums
from .checks_frame import FRAME, FRAMES
from .checks_goals import GOAL, goal
from .checks_motion import MOTION
from .checks_normals import NORMAL_CHECKS
from .checks_over import OVER, OVER_FRAME, OVER_FRAMES
from .checks_placement import PLACEMENTS
from .checks_stage import STAGE
from .checks_topology import CURVE_DATA
from .overs import overs_of
from .report import Check, Finding, Report
from .window import Reference, Window

STATIC = {
    **FILES,
    **STAGE,
    **CURVE_DATA,
    **CLIP_CHECKS,
    **PLACEMENTS,
    **OVER,
    **DEFORM,
}
"""The checks of static data and their functions, without CHECKSUMS."""

MOVING = {**FRAME, **MOTION, **NORMAL_CHECKS, **OVER_FRAME}
"""The checks of frames and their functions."""

CHECKS: list[Check] = [*STATIC, CHECKSUMS, *MOVING, GOAL]
"""Every check, in the order of the report."""

CHUNK = (8, 16)
"""Least and greatest number of consecutive frames that a process takes at a time.

Each chunk reads the neighbours of its ends again; few frames are divided among all processes.
"""

QUICK = 5
"""Frames that a quick run checks at each of start, middle and end."""

PARTS = ("static", "moving")
"""The parts of a validation that can run on their own."""


def validate(
    directory: Path,
    frames: Container[int] | None = None,
    quick: bool = False,
    jobs: int = 1,
    only: str | None = None,
    goals: Path | None = None,
) -> Report:
    """Validates the cache in `directory`.

    Args:
        directory: Folder of the cache.
        frames: Frames whose curves are checked; default: all.
        quick: Checks curves at the start, middle and end only, and no checksums.
        jobs: Number of processes.
        only: One of `PARTS`; default: both.
        goals: The animation of the bake, whose goals guides are compared with; default: they are not.

    Raises:
        CacheError: The folder holds no cache that can be opened.
    """
    cache = Cache(directory)
    report = Report(str(directory), CHECKS)
    left_out = checks_over.not_applicable(cache) | checks_deform.not_applicable(cache)
    if only != "moving":
        for check, function in STATIC.items():
            report.ran({check} - left_out)
            report.add(list(function(cache)))
        if not quick:
            report.ran([CHECKSUMS])
            report.add(list(checksums(cache)))
    if only == "static":
        return report
    chosen = [frame for frame in cache.frames if frames is None or frame in frames]
    if quick and len(chosen) > 3 * QUICK:
        middle = (len(chosen) - QUICK) // 2
        chosen = chosen[:QUICK] + chosen[middle : middle + QUICK] + chosen[-QUICK:]
    report.ran(MOVING.keys() - left_out)
    for findings in check_frames(cache, Reference.of(cache), chosen, jobs):
        report.add(findings)
    if goals is not None:
        report.ran([GOAL])
        report.add(list(goal(cache, goals, chosen)))
    if only is None:
        report.add(missing_frames(cache, chosen))
    return report


def missing_frames(cache: Cache, chosen: list[int]) -> list[Finding]:
    """Findings of frames without a file, among those that were not chosen."""
    overs = overs_of(cache)
    unchecked = [frame for frame in cache.frames if frame not in chosen]
    files = [(FRAMES, frame, cache.frame_path(frame)) for frame in unchecked]
    files += [(OVER_FRAMES, frame, overs.frame_paths[frame]) for frame in unchecked] if overs else []
    return [
        Finding(check, message=f"{path.name}: no such file", frame=frame)
        for check, frame, path in files
        if not path.is_file()
    ]


def check_frames(cache: Cache, reference: Reference, frames: list[int], jobs: int) -> Iterator[list[Finding]]:
    """Findings of the animated data, one list for each chunk of frames, in order."""
    size = min(max(CHUNK[0], -(-len(frames) // jobs)), CHUNK[1])
    chunks = [frames[i : i + size] for i in range(0, len(frames), size)]
    if jobs == 1 or len(chunks) == 1:
        window = Window(cache, reference)
        yield from (check_chunk(window, chunk) for chunk in chunks)
        return
    # USD has threads of its own, which a fork would leave in an undefined state.
    context = multiprocessing.get_context("spawn")
    with context.Pool(min(jobs, len(chunks)), _Worker.start, (cache.directory, reference)) as pool:
        yield from pool.imap(_Worker.check, chunks)


def check_chunk(window: Window, frames: list[int]) -> list[Finding]:
    """Findings of all checks of animated data on these frames."""
    findings: list[Finding] = []
    for frame in frames:
        window.move_to(frame)
        for function in MOVING.values():
            findings += function(window)
    return findings


class _Worker:
    """State of a worker process."""

    window: Window

    @classmethod
    def start(cls, directory: Path, reference: Reference) -> None:
        """Opens the cache in a new process."""
        cls.window = Window(Cache(directory), reference)

    @classmethod
    def check(cls, frames: list[int]) -> list[Finding]:
        """Runs `check_chunk` on the process's own window."""
        return check_chunk(cls.window, frames)
