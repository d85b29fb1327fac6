"""A wedge: the same shot with softer and stiffer hair, and how far the tips swing.

python examples/wedge.py samples/short/groom.json samples/short/shake.json -o wedge.png
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import hairbake
from hairbake.cache import FloatArray

STIFFNESSES = (1e9, 4e9, 16e9)
"""Young's modulus, Pa."""


def tip_sway(cache: hairbake.Cache) -> FloatArray:
    """Mean distance of the guides' tips from where the head alone would carry them, m, for each frame."""
    guides = cache.guides
    tips = np.cumsum(guides.counts) - 1
    rest = np.column_stack([guides.rest[tips], np.ones(len(tips))])
    carried = (cache.head() @ rest.T)[:, :3].transpose(0, 2, 1)
    away = np.linalg.norm(guides.points()[:, tips] - carried, axis=2)
    sway: FloatArray = away.mean(axis=1) * cache.metres_per_unit
    return sway


def main() -> None:
    """Bakes the wedge and plots it."""
    parser = argparse.ArgumentParser(description="Bake a shot with softer and stiffer hair.")
    parser.add_argument("groom", type=Path)
    parser.add_argument("anim", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="plot to write")
    parser.add_argument("--frames", help="frames, such as 1001-1012 [default: all]")
    options = parser.parse_args()
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    with tempfile.TemporaryDirectory() as folder:
        for stiffness in STIFFNESSES:
            cache = hairbake.bake(
                options.groom,
                options.anim,
                Path(folder) / f"{stiffness:g}",
                frames=options.frames,
                no_pictures=True,
                set={"groom.materials[0].young_modulus_pa": stiffness},
            )
            axes.plot(cache.frames, 1e3 * tip_sway(cache), label=f"{stiffness / 1e9:g} GPa")
    axes.set(xlabel="frame", ylabel="tips away from the groom, mm")
    axes.legend()
    figure.savefig(options.output, dpi=150)


if __name__ == "__main__":
    main()
