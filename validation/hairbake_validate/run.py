"""Carries out the checks on a cache, its frames in parallel."""

import multiprocessing
from collections.abc import Container, Iterator
from pathlib import Path

from .cache import Cache
from .checks_frame import FRAME, FRAMES
from .checks_motion import MOTION
from .checks_static import CHECKSUMS, STATIC, checksums
from .report import Check, Finding, Report
from .window import Ground, Window

CHECKS: list[Check] = [*STATIC, CHECKSUMS, *FRAME, *MOTION]
"""Every check, in the order of the report."""

CHUNK = 16
"""Frames that one process takes at a time; each run of them reads its neighbours again."""

QUICK = 5
"""Frames at each of start, middle and end that a quick run looks at."""

PARTS = ("static", "moving")
"""What can be checked by itself."""

worker_window: Window
"""The window of a worker process."""


def validate(
    directory: Path,
    frames: Container[int] | None = None,
    quick: bool = False,
    jobs: int = 1,
    only: str | None = None,
) -> Report:
    """Checks the cache in `directory`; curves only of `frames`, if given, or of a few frames if `quick`; `only` one of
    `PARTS`, if given.

    Raises `Unreadable` if there is no cache to check.
    """
    cache = Cache(directory)
    report = Report(str(directory), CHECKS)
    if only != "moving":
        for check, examine in STATIC.items():
            report.ran([check])
            report.add(list(examine(cache)))
        if not quick:
            report.ran([CHECKSUMS])
            report.add(list(checksums(cache)))
    if only == "static":
        return report
    chosen = [frame for frame in cache.frames if frames is None or frame in frames]
    if quick and len(chosen) > 3 * QUICK:
        middle = (len(chosen) - QUICK) // 2
        chosen = chosen[:QUICK] + chosen[middle : middle + QUICK] + chosen[-QUICK:]
    ground = Ground.of(cache)
    report.ran([*FRAME, *MOTION])
    for findings in over_frames(cache, ground, chosen, jobs):
        report.add(findings)
    if only is None:
        others = [frame for frame in cache.frames if frame not in chosen]
        missing = [frame for frame in others if not cache.frame_path(frame).is_file()]
        report.add([Finding(FRAMES, message="no such file", frame=frame) for frame in missing])
    return report


def over_frames(cache: Cache, ground: Ground, frames: list[int], jobs: int) -> Iterator[list[Finding]]:
    """Findings of the moving part, a list a chunk, in the order of the frames."""
    chunks = [frames[i : i + CHUNK] for i in range(0, len(frames), CHUNK)]
    if jobs == 1 or len(chunks) == 1:
        window = Window(cache, ground)
        yield from (examine(window, chunk) for chunk in chunks)
        return
    # USD runs threads of its own, which a fork would leave in an undefined state.
    context = multiprocessing.get_context("spawn")
    with context.Pool(min(jobs, len(chunks)), start_worker, (cache.directory, ground)) as pool:
        yield from pool.imap(examine_in_worker, chunks)


def examine(window: Window, frames: list[int]) -> list[Finding]:
    """All moving checks on these frames."""
    findings = []
    for frame in frames:
        window.move_to(frame)
        for check in (*FRAME.values(), *MOTION.values()):
            findings += check(window)
    return findings


def start_worker(directory: Path, ground: Ground) -> None:
    """Opens the cache in a new process."""
    global worker_window
    worker_window = Window(Cache(directory), ground)


def examine_in_worker(frames: list[int]) -> list[Finding]:
    """`examine` on the process's own window."""
    return examine(worker_window, frames)
