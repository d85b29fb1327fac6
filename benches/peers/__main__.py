"""Command line: `python -m peers --hairbake target/release/hairbake`."""

import argparse
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from . import task
from .dismech_rods import DismechRods
from .elastica_rods import ElasticaRods
from .hairbake_rods import HairbakeRods
from .mujoco_chain import MujocoRods

ROUNDS = 3
"""Timings of each program, in turns so that other load affects all of them; the median counts."""
HEADER = (
    f"  {'':<11}{'clamp':<12}{'elements':>8}{'steps/frame':>13}{'at rest':>10}{'in motion':>11}"
    f"{'CPU s/frame':>13}{'× hairbake':>12}"
)


class Program(Protocol):
    """A program at certain settings."""

    @property
    def name(self) -> str:
        """Name of the program."""

    @property
    def clamp(self) -> str:
        """How its first element is held."""

    @property
    def elements(self) -> int:
        """Elements of a rod."""

    @property
    def substeps(self) -> int:
        """Steps per frame."""

    def accuracy(self) -> task.Accuracy:
        """Errors of one rod."""

    def seconds(self) -> float:
        """CPU seconds per frame for all rods on one thread."""


@dataclass(frozen=True)
class Table:
    """One comparison."""

    question: str
    in_motion: bool
    """True if the error in motion counts; else that at rest."""
    compared: list[Program]
    """Programs at the cheapest settings found that meet the tolerance (README.md), hairbake first."""
    shown: list[Program]
    """Further settings, for information."""


def tables(binary: Path) -> list[Table]:
    """The comparisons."""
    return [
        Table(
            f"At rest within {task.TOLERANCE} L; 10 steps a frame where the program can",
            False,
            [
                HairbakeRods(binary, 3, 10),
                MujocoRods(13, 10, True),
                ElasticaRods(10, 160, True, 0.007),
                DismechRods(22, 10),
            ],
            [MujocoRods(32, 10, False), ElasticaRods(32, 320, False, 0.008)],
        ),
        Table(
            f"At rest and in motion within {task.TOLERANCE} L",
            True,
            [
                HairbakeRods(binary, 3, 4),
                MujocoRods(16, 40, True),
                ElasticaRods(13, 400, True, 0.004),
                DismechRods(22, 3),
            ],
            [HairbakeRods(binary, 7, 10)],
        ),
    ]


def run(table: Table) -> bool:
    """Prints a table; true if every compared program meets the tolerance."""
    programs = table.compared + table.shown
    accuracy = [program.accuracy() for program in programs]
    rounds = [[program.seconds() for program in programs] for _ in range(ROUNDS)]
    seconds = [statistics.median(times) for times in zip(*rounds, strict=True)]
    print(f"\n{table.question}\n\n{HEADER}")
    for program, error, cpu in zip(programs, accuracy, seconds, strict=True):
        print(
            f"  {program.name:<11}{program.clamp:<12}{program.elements:>8}{program.substeps:>13}"
            f"{error.rest:>10.1e}{error.motion:>11.1e}{cpu:>13.4f}{cpu / seconds[0]:>12.1f}"
        )
    worst = max(e.motion if table.in_motion else e.rest for e in accuracy[: len(table.compared)])
    return worst <= task.TOLERANCE


def main() -> int:
    """Prints the tables. Exit code: 0 if every compared program meets the tolerance, else 1."""
    parser = argparse.ArgumentParser(
        prog="peers", description="Time hairbake and its peers at equal accuracy."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    options = parser.parse_args()
    print(f"{task.RODS} rods, Γ = {task.GAMMA:g}, {task.FPS} frames/s, one thread. Errors of the tip in L.")
    met = [run(table) for table in tables(options.hairbake.resolve())]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
