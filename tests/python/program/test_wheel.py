"""The wheel: program, USD readers, validator and Python API, built and installed into an empty environment.

Building it calls cargo, which a stand-in does for the program under test.
"""

import json
import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy
import pytest

from program.wheel_source import OFFLINE, copy_sources, write_cargo
from support import ROOT, needs_hairbake

pytest.importorskip("setuptools_rust")

VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text())["package"]["version"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    source, cargo = folder / "source", folder / "cargo"
    copy_sources(source)
    write_cargo(cargo)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", str(folder), str(source)]
    environment = {**os.environ, **OFFLINE, "CARGO": str(cargo)}
    built = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment with the wheel, and NumPy and USD from this one."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    interpreter = folder / "bin/python"
    command = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(interpreter),
        "install",
        "--no-deps",
        "--no-index",
    ]
    subprocess.run([*command, str(wheel)], check=True, capture_output=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    (packages / "dependencies.pth").write_text(f"{Path(numpy.__file__).parents[1]}\n")
    return interpreter


def run(python: Path, *command: str, folder: Path) -> str:
    """Standard output of a program of the environment, called by its path, in `folder`."""
    program = python.with_name(command[0])
    done = subprocess.run(
        [program, *command[1:]],
        cwd=folder,
        env={"PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_hairbake
@pytest.mark.slow
def test_the_wheel_holds_everything_and_fits_any_python(wheel: Path) -> None:
    assert wheel.name.startswith(f"hairbake-{VERSION}-cp311-abi3-")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (metadata,) = (archive.read(name).decode() for name in names if name.endswith("/METADATA"))
    assert {"hairbake/py.typed", "hairbake_usd/stage.py", "hairbake_validate/run.py"} <= names
    assert f"hairbake-{VERSION}.data/scripts/hairbake" in names
    assert not any(name.split("/")[0] in ("tests", "physics", "source") for name in names)
    assert {"Provides-Extra: usd", "Provides-Extra: blender"} <= set(metadata.splitlines())


@needs_hairbake
@pytest.mark.slow
def test_an_installed_hairbake_bakes_validates_and_is_read(python: Path, tmp_path: Path) -> None:
    assert run(python, "hairbake", "--version", folder=tmp_path) == f"hairbake {VERSION}\n"
    run(python, "hairbake", "sample", "short", "-o", "scene", "--wisps", "4", folder=tmp_path)
    script = """
import json
import hairbake

cache = hairbake.bake("scene/groom.json", "scene/shake.json", "out", frames="1001-1002", no_pictures=True)
print(json.dumps([cache.frames, list(cache.hair.points(1001).shape), int(cache.hair.counts.sum())]))
"""
    frames, shape, points = json.loads(run(python, "python", "-c", script, folder=tmp_path))
    assert frames == [1000, 1001, 1002, 1003]
    assert shape == [points, 3]
    # The program finds the Python beside it, which has USD.
    assert "PASSED" in run(python, "hairbake", "validate", "out", folder=tmp_path).upper()
