"""Command line: `python -m physics --hairbake target/release/hairbake -o out/physics`."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from . import page
from .program import Hairbake
from .studies import STUDIES
from .study import Study


def run(hairbake: Hairbake, name: str) -> Study:
    """Runs one study and prints its rows."""
    start = time.monotonic()
    study = STUDIES[name](hairbake)
    print(f"\n{study.title} ({time.monotonic() - start:.0f} s)")
    for row in study.rows:
        verdict = "" if row.goal is None else f"goal {row.goal:.3g} {'met' if row.passed else 'MISSED'}"
        print(f"  {row.what:<58} {row.error:9.2e}  {verdict}", flush=True)
    return study


def main() -> int:
    """Runs the studies and writes the page. Exit code: 0 if every goal is met, else 1."""
    parser = argparse.ArgumentParser(prog="physics", description="Compare hairbake's rod with theory.")
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for index.html")
    parser.add_argument(
        "studies", nargs="*", metavar="STUDY", help=f"{', '.join(STUDIES)} [default: all of them]"
    )
    options = parser.parse_args()
    unknown = set(options.studies) - set(STUDIES)
    if unknown:
        parser.error(f"no such study: {', '.join(sorted(unknown))}; choose from {', '.join(STUDIES)}")
    hairbake = Hairbake(options.hairbake.resolve())
    studies = [run(hairbake, name) for name in options.studies or STUDIES]
    version = subprocess.run(
        [hairbake.binary, "--version"], capture_output=True, text=True, check=True
    ).stdout
    options.out.mkdir(parents=True, exist_ok=True)
    page.write(options.out / "index.html", studies, version.strip())
    print(f"\n{options.out / 'index.html'}")
    return 0 if all(row.passed for study in studies for row in study.rows) else 1


if __name__ == "__main__":
    sys.exit(main())
