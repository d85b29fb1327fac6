"""Checks of the files: manifest.json, checksums, and files that do not belong to the cache."""

import hashlib
import math
import re
from collections.abc import Callable, Iterator
from typing import Any

from . import tolerances
from .cache import RECORD, SHOT_LAYER, Cache
from .report import Check, Finding

# `.hairbake`, the work folder of a bake, is no temporary file: a bake resumes from it.
TEMPORARY = re.compile(r"^\.(?!hairbake$)|\.tmp|\.part$|~$")
FRAME_FILE = re.compile(r"hair\.(?:over\.)?0*(-?\d+)\.usdc")

RECORD_CHECK = Check(
    "record",
    "manifest.json holds format, version, inputs, settings, layers and one entry for every frame",
    "bake again, or restore manifest.json; docs/cache.md describes it",
)
FIGURES = Check(
    "figures",
    "manifest.json holds finite figures for every frame",
    "bake these frames again",
)
EXEMPT = Check(
    "exempt",
    "contact holds most segments of the guides: few are exempt because the groom has them inside a body",
    "compare groom and bodies in one picture: they may have other units, axes or rest poses",
    tolerances.EXEMPT_SHARE,
    "of the segments",
)
TEMPORARIES = Check(
    "temporaries",
    "the folder holds no temporary files, and no frame files outside the frame range",
    "delete the files, unless a bake is still writing this cache",
)
CHECKSUMS = Check(
    "checksums",
    "every file has the SHA-256 that manifest.json records",
    "restore the files that were changed after the bake, or bake again",
)


def record(cache: Cache) -> Iterator[Finding]:
    """Checks manifest.json against `docs/cache.md`."""
    for message in record_errors(cache):
        yield Finding(RECORD_CHECK, message=f"{RECORD}: {message}")
    recorded = [entry.get("frame") for entry in entries(cache, "frames")]
    for missing in sorted(set(cache.frames) - set(recorded)):
        yield Finding(RECORD_CHECK, message=f'{RECORD}: no entry in "frames"', frame=missing)
    for frame in recorded:
        if frame not in cache.frames:
            message = f"entry for frame {frame}, outside {cache.frames[0]} to {cache.frames[-1]}"
            yield Finding(RECORD_CHECK, message=f"{RECORD}: {message}")
        elif recorded.count(frame) > 1:
            message = f"{recorded.count(frame)} entries for frame {frame}, expected 1"
            yield Finding(RECORD_CHECK, message=f"{RECORD}: {message}")


def record_errors(cache: Cache) -> Iterator[str]:
    """Errors of manifest.json apart from its frames."""
    kinds = {"format": str, "version": int, "hairbake": str, "inputs": list, "layers": list, "frames": list}
    if "settings" not in cache.record:
        yield '"settings" is missing'
    for key, kind in kinds.items():
        if not isinstance(cache.record.get(key), kind):
            yield f'"{key}" is missing or no {kind.__name__}'
    found = (cache.record.get("format"), cache.record.get("version"))
    if found != ("hairbake-cache", 1):
        yield f"format and version are {found[0]} and {found[1]}, expected hairbake-cache and 1"
    for number, entry in enumerate(entries(cache, "inputs")):
        if not re.fullmatch("[0-9a-f]{64}", str(entry.get("sha256"))) or not entry.get("file"):
            yield f"inputs[{number}] lacks a file or its sha256"


def entries(cache: Cache, key: str) -> list[dict[str, Any]]:
    """The objects in a list of manifest.json."""
    values = cache.record.get(key)
    return [value for value in values if isinstance(value, dict)] if isinstance(values, list) else []


def figures(cache: Cache) -> Iterator[Finding]:
    """Checks that every frame has figures and that they are finite."""

    def finite(value: Any) -> bool:
        if isinstance(value, dict | list):
            return all(map(finite, value.values() if isinstance(value, dict) else value))
        return not isinstance(value, float) or math.isfinite(value)

    for entry in entries(cache, "frames"):
        values = entry.get("figures")
        if not isinstance(values, dict) or not values:
            yield Finding(FIGURES, message=f"{RECORD}: figures are missing", frame=entry.get("frame"))
        elif not finite(values):
            yield Finding(FIGURES, message=f"{RECORD}: figures are not finite", frame=entry.get("frame"))


def exempt(cache: Cache) -> Iterator[Finding]:
    """Compares the segments exempt from contact with all that there are."""
    for entry in entries(cache, "frames"):
        values = entry.get("figures")
        if isinstance(values, dict) and values.get("contact_segments"):
            share = values.get("exempt_segments", 0) / values["contact_segments"]
            yield Finding(EXEMPT, share, frame=entry.get("frame"))


def temporaries(cache: Cache) -> Iterator[Finding]:
    """Finds files left by a bake that was interrupted, or by an earlier bake of more frames."""
    for path in sorted(cache.directory.iterdir()):
        frame = FRAME_FILE.fullmatch(path.name)
        if TEMPORARY.search(path.name):
            yield Finding(TEMPORARIES, message=f"{path.name} is a temporary file")
        elif frame and int(frame[1]) not in cache.frames:
            message = f"{path.name} is outside the range {cache.frames[0]} to {cache.frames[-1]}"
            yield Finding(TEMPORARIES, message=message)


def checksums(cache: Cache) -> Iterator[Finding]:
    """Compares every static layer and frame file with its recorded checksum."""
    frames = entries(cache, "frames")
    overs = [{**entry["over"], "frame": entry.get("frame")} for entry in frames if entry.get("over")]
    recorded = entries(cache, "layers") + frames + overs
    expected = {str(entry.get("file")): (entry.get("sha256"), entry.get("frame")) for entry in recorded}
    for name, (digest, frame) in sorted(expected.items()):
        path = cache.directory / name
        if not path.is_file():
            # The check `frames` reports missing frame files.
            if frame is None:
                yield Finding(CHECKSUMS, message=f"{name}: no such file")
            continue
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != digest:
            message = f"{name}: SHA-256 is {found[:12]}…, recorded {str(digest)[:12]}…"
            yield Finding(CHECKSUMS, message=message, frame=frame)
    layers = (path.name for path in cache.directory.glob("hair*.usd[ac]"))
    shown = cache.record.get("over") or cache.record.get("deform")
    # It depends on where the stage is that it shows.
    layers = (name for name in layers if name != SHOT_LAYER or not shown)
    for name in sorted({name for name in layers if not FRAME_FILE.fullmatch(name)} - set(expected)):
        yield Finding(CHECKSUMS, message=f"{name}: no checksum in {RECORD}")


FILES: dict[Check, Callable[[Cache], Iterator[Finding]]] = {
    RECORD_CHECK: record,
    FIGURES: figures,
    EXEMPT: exempt,
    TEMPORARIES: temporaries,
}
"""The checks of the files and their functions, in the order of the report, without CHECKSUMS.

That check reads every byte of the cache and is left out of quick runs."""
