"""The program, run as a user would."""

import os
import shutil
import subprocess
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path

Value = str | int | float | Path
"""A value of an option."""
Option = Value | bool | Sequence[Value] | Mapping[str, Value] | None
"""True: an option without a value. A sequence repeats the option, once with each value; a mapping repeats it
with `KEY=VALUE`. False and None leave it out."""


class HairbakeError(RuntimeError):
    """The program reports an error."""

    def __init__(self, code: int, report: str) -> None:
        """Of the exit code and the text on standard error."""
        super().__init__(report.strip() or f"hairbake exited with {code}")
        self.code = code
        """Exit code: 64 usage, 65 bad input, 70 internal, 74 I/O, 75 try again later, 78 configuration, 85
        stopped."""
        self.report = report
        """All errors, as the program prints them."""


def find_program() -> Path:
    """The program: `HAIRBAKE`; else that of this installation; else the one on the path.

    Raises:
        FileNotFoundError: there is none.
    """
    if named := os.environ.get("HAIRBAKE"):
        return Path(named)
    beside = Path(sysconfig.get_path("scripts")) / "hairbake"
    found = beside if beside.is_file() else shutil.which("hairbake")
    if found is None:
        raise FileNotFoundError("no hairbake: install the wheel, or name the program in HAIRBAKE")
    return Path(found)


def run(*arguments: Value, options: Mapping[str, Option] | None = None, program: Path | None = None) -> bytes:
    """Runs the program and returns what it writes to standard output.

    Args:
        arguments: Arguments as on the command line.
        options: Options by name, such as `{"split_tolerance": 0.02}` for `--split-tolerance 0.02`.
        program: The program; by default [`find_program`].

    Raises:
        HairbakeError: it does not end with 0.
    """
    command = [program or find_program(), *arguments, *as_arguments(options or {})]
    # Progress would be lost, and must not be in the report.
    quiet = {**os.environ, "HAIRBAKE_PROGRESS": "none"}
    done = subprocess.run([str(part) for part in command], capture_output=True, env=quiet, check=False)
    if done.returncode:
        raise HairbakeError(done.returncode, done.stderr.decode(errors="replace"))
    return done.stdout


def as_arguments(options: Mapping[str, Option]) -> list[str]:
    """Options as on the command line."""
    arguments: list[str] = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if isinstance(value, Mapping):
            pairs = (f"{key}={part}" for key, part in value.items())
            arguments += [part for pair in pairs for part in (flag, pair)]
        elif isinstance(value, str | int | float | Path) and not isinstance(value, bool):
            arguments += [flag, str(value)]
        elif isinstance(value, Sequence):
            arguments += [part for item in value for part in (flag, str(item))]
        elif value:
            arguments.append(flag)
    return arguments
