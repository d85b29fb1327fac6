"""The studies of single rods in `examples/rods`, and their page."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pages.markdown import Page
from support import HAIRBAKE, ROOT, needs_hairbake

STUDIES = ROOT / "examples/rods"
NAMES = sorted(path.stem for path in STUDIES.glob("*.py"))
QUICK = {"circle", "elastica"}
NUMBER = r"(-?[\d.]+(?:e[+-]\d+)?)"

BOUNDS = {
    "elastica": {rf"largest error {NUMBER}": 1.5e-4},
    "circle": {rf"largest error {NUMBER}": 1e-6},
    "column": {rf"tips {NUMBER} L aside": 1e-3, rf"largest error {NUMBER} L": 2e-4},
    "twist": {rf"largest relative error {NUMBER}": 1e-2},
    "clamp": {
        rf"misses the weight by {NUMBER}": 1e-6,
        rf"force {NUMBER} of the weight": 1e-3,
        rf"moment {NUMBER} of": 1e-4,
    },
    "energy": {rf"four-step, 800 steps/s: loses {NUMBER}": 2e-4, rf"gains {NUMBER}": 1e-4},
    "capstan": {rf"largest relative error {NUMBER}": 1e-2},
}
"""Figures that a study prints, and the largest value of each."""


def run_study(name: str, plot: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "pipeline"), "HAIRBAKE": str(HAIRBAKE)}
    command = [sys.executable, str(STUDIES / f"{name}.py"), "-o", str(plot)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs_hairbake
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in NAMES]
)
def test_a_study_agrees_with_theory_and_draws_its_plot(name: str, tmp_path: Path) -> None:
    plot = tmp_path / f"{name}.png"
    printed = run_study(name, plot)
    for pattern, bound in BOUNDS[name].items():
        found = [abs(float(value)) for value in re.findall(pattern, printed)]
        assert found and max(found) < bound, f"{pattern}: {printed}"
    assert plot.read_bytes().startswith(b"\x89PNG")
    if name == "twist":
        largest, touches = map(float, re.findall(r"is ([\d.]+);.*from ([\d.]+) on", printed)[0])
        assert 0 < touches / largest - 1 < 0.1, printed


def test_the_page_shows_the_studies_as_they_are() -> None:
    page = Page(ROOT / "docs/rods.md")
    sources = {name: (STUDIES / f"{name}.py").read_text(encoding="utf-8") for name in NAMES}
    for name in NAMES:
        assert f"../examples/rods/{name}.py" in page.links()
        assert f"gallery/rod-{name}.png" in page.links()
    blocks = ["\n".join(block.lines) for block in page.blocks() if block.language == "python"]
    assert len(blocks) == len(NAMES)
    for block in blocks:
        assert any(block in source for source in sources.values()), block
