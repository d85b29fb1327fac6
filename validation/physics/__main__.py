"""Command line: `python -m physics --hairbake target/release/hairbake -o out/physics`."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from . import page
from .scene import Hairbake
from .studies import STUDIES
from .study import Study


def main() -> int:
    """Runs the studies; 0 where every goal is met, 1 where one is missed."""
    parser = argparse.ArgumentParser(prog="physics", description="Holds hairbake's rod against theory.")
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder for index.html")
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=f"of {', '.join(STUDIES)}; default: all")
    arguments = parser.parse_args()
    unknown = set(arguments.studies) - set(STUDIES)
    if unknown:
        parser.error(f"no such study: {', '.join(sorted(unknown))}")
    hairbake = Hairbake(arguments.hairbake.resolve())
    done: list[Study] = []
    for name in arguments.studies or STUDIES:
        start = time.monotonic()
        study = STUDIES[name](hairbake)
        done.append(study)
        print(f"\n{study.title} ({time.monotonic() - start:.0f} s)")
        for row in study.rows:
            verdict = "" if row.goal is None else f"goal {row.goal:.3g} {'met' if row.passed else 'MISSED'}"
            print(f"  {row.what:<58} {row.error:9.2e}  {verdict}")
    version = subprocess.run(
        [hairbake.binary, "--version"], capture_output=True, text=True, check=True
    ).stdout
    arguments.out.mkdir(parents=True, exist_ok=True)
    page.write(arguments.out / "index.html", done, version.strip())
    print(f"\n{arguments.out / 'index.html'}")
    return 0 if all(row.passed for study in done for row in study.rows) else 1


if __name__ == "__main__":
    sys.exit(main())
