"""Command line: `python -m peers --hairbake target/release/hairbake`."""

import argparse
import statistics
import sys
from pathlib import Path

from . import task
from .elastica_rods import ElasticaRods
from .mujoco_chain import MujocoRods
from .ours import HairbakeRods

ROUNDS = 3
"""Timings of each, in turns, so that what else the machine does falls on all; their median counts."""


def tables(binary: Path) -> dict[str, tuple[list, list]]:
    """For each question the programs at settings that answer it, the cheapest found (README.md), and those shown beside."""
    return {
        f"At rest within {task.TOLERANCE} L; 10 steps a frame where the program can": (
            [HairbakeRods(binary, 3, 10), MujocoRods(13, 10, True), ElasticaRods(10, 160, True, 0.007)],
            [MujocoRods(32, 10, False), ElasticaRods(32, 320, False, 0.008)],
        ),
        f"At rest and in motion within {task.TOLERANCE} L": (
            [HairbakeRods(binary, 3, 7), MujocoRods(16, 40, True), ElasticaRods(13, 400, True, 0.004)],
            [HairbakeRods(binary, 7, 10)],
        ),
    }


def main() -> int:
    """Prints the tables; 1 where a program that is compared misses the accuracy."""
    parser = argparse.ArgumentParser(
        prog="peers", description="Times hairbake and its peers at equal accuracy."
    )
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    arguments = parser.parse_args()
    print(f"{task.RODS} rods, Γ = {task.GAMMA:g}, {task.FPS} frames/s, one thread. Errors of the tip in L.")
    missed = False
    for question, (compared, shown) in tables(arguments.hairbake.resolve()).items():
        everyone = compared + shown
        accuracy = [program.accuracy() for program in everyone]
        rounds = [[program.seconds() for program in everyone] for _ in range(ROUNDS)]
        seconds = [statistics.median(times) for times in zip(*rounds)]
        print(f"\n{question}\n")
        print(
            f"  {'':<11}{'clamp':<12}{'elements':>8}{'steps/frame':>13}{'at rest':>10}{'in motion':>11}{'CPU s/frame':>13}{'× hairbake':>12}"
        )
        for program, error, cpu in zip(everyone, accuracy, seconds):
            print(
                f"  {program.name:<11}{program.clamp:<12}{program.elements:>8}{program.substeps:>13}{error.rest:>10.1e}"
                f"{error.motion:>11.1e}{cpu:>13.4f}{cpu / seconds[0]:>12.1f}"
            )
        in_motion = "motion" in question
        worst = max(e.motion if in_motion else e.rest for e in accuracy[: len(compared)])
        missed |= not worst <= task.TOLERANCE
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
