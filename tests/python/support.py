"""Paths of the repository and of the built program, shared by all tests."""

import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HAIRBAKE = Path(os.environ.get("HAIRBAKE") or ROOT / "target/debug/hairbake")
"""The program under test: `HAIRBAKE`, else the debug build."""

Done = subprocess.CompletedProcess[str]
Run = Callable[..., Done]
"""Runs the program with arguments; see `run_hairbake`."""

needs_hairbake = pytest.mark.skipif(
    not HAIRBAKE.is_file(), reason=f"{HAIRBAKE} is missing: run `cargo build`"
)


def run_command(*command: object) -> Done:
    """Runs a command and captures its output; any exit code is accepted."""
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)


def run_hairbake(*arguments: object) -> Done:
    """Runs the program and captures its output; any exit code is accepted."""
    return run_command(HAIRBAKE, *arguments)


def unwrapped(message: str) -> str:
    """A diagnostic on one line, without its frame. Lines break at spaces, and after slashes and hyphens."""
    text = re.sub(r"(?:(?<=/)|(?<=\w-))\n[│╰─▶ ]*(?=\S)", "", message)
    return " ".join(text.replace("│", " ").replace("╰─▶", " ").split())
