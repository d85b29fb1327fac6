"""Paths of the repository and of the built program, shared by all tests."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HAIRBAKE = Path(os.environ.get("HAIRBAKE") or ROOT / "target/debug/hairbake")
"""The program under test: `HAIRBAKE`, else the debug build."""

needs_hairbake = pytest.mark.skipif(
    not HAIRBAKE.is_file(), reason=f"{HAIRBAKE} is missing: run `cargo build`"
)


def run_hairbake(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs the program and captures its output; any exit code is accepted."""
    return subprocess.run([HAIRBAKE, *map(str, arguments)], capture_output=True, text=True, check=False)
