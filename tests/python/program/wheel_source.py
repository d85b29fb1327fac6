"""What tests need to build the wheel: a copy of the sources, and a cargo that has the program under test."""

import shutil
import sys
from pathlib import Path

from support import HAIRBAKE, ROOT

CARGO = """#!{python}
import json, os, subprocess, sys

if sys.argv[1] != "build":
    os.execv({cargo!r}, ["cargo", *sys.argv[1:]])
assert {{"--release", "--locked"}} <= set(sys.argv), sys.argv
(package,) = json.loads(subprocess.check_output(
    [{cargo!r}, "metadata", "--format-version=1", "--no-deps", "--offline"]
))["packages"]
print(json.dumps({{
    "reason": "compiler-artifact", "package_id": package["id"], "filenames": [],
    "target": {{"name": "hairbake", "kind": ["bin"], "crate_types": ["bin"]}},
    "executable": {program!r},
}}))
"""

OFFLINE = {"PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}
"""Environment in which pip builds with installed packages. 0 is how pip is told "no isolation"."""


def copy_sources(to: Path) -> None:
    """Copies the sources into a folder that does not exist."""
    shutil.copytree(ROOT, to, ignore=shutil.ignore_patterns(".*", "target", "__pycache__", "*.png", "*.jpg"))


def write_cargo(to: Path) -> None:
    """Writes a program that stands in for cargo: instead of building, it names the program under test."""
    cargo = shutil.which("cargo")
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(CARGO.format(python=sys.executable, cargo=cargo, program=str(HAIRBAKE)))
    to.chmod(0o755)
