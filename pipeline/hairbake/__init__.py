"""hairbake from Python: bake shots, read caches, study single rods.

    import hairbake

    cache = hairbake.bake("groom.json", "anim.json", "out", substeps=16)
    cache.hair.points(1012)  # N × 3

`cache` reads caches, `rods` simulates single rods, `program` runs any command. Needs NumPy only.
"""

from os import PathLike
from pathlib import Path

from .cache import Cache, Curves, CurvesName
from .program import HairbakeError, Option, find_program, run

__all__ = [
    "Cache",
    "Curves",
    "CurvesName",
    "HairbakeError",
    "Option",
    "bake",
    "find_program",
    "open",
    "run",
]


def open(directory: str | PathLike[str]) -> Cache:
    """Opens a cache, which may be unfinished.

    Raises:
        HairbakeError: there is no cache in the folder, or it is damaged.
    """
    return Cache(Path(directory))


def bake(
    groom: str | PathLike[str], anim: str | PathLike[str], out: str | PathLike[str], **options: Option
) -> Cache:
    """Bakes a shot into the folder `out` and opens the cache.

    Args:
        groom: The groom, `groom.json`.
        anim: The animation, `anim.json`.
        out: Folder of the cache. A bake that was interrupted goes on there.
        options: Options of `hairbake bake`, such as `substeps=16`, `frames="1001-1012"`, `no_pictures=True`,
            `set={"anim.settings.nodes": 12}`.

    Raises:
        HairbakeError: the program reports an error; nothing that was finished is lost.
    """
    run("bake", Path(groom), Path(anim), "-o", Path(out), options=options)
    return open(out)
