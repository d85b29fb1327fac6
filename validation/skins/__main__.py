"""Command line: `python -m skins --hairbake target/release/hairbake CesiumMan.glb`."""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from hairbake_validate.cache import Cache, read_frame
from hairbake_validate.geometry import FloatArray, IntArray, norms

from .gltf import FPS, Character, skinned

FRAMES = range(1001, 1025)
LENGTH, POINTS = 0.015, 6
"""Length of the fur, m, and points of a strand."""


def fur(body: Character, count: int, seed: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """Strands on the body at rest, `n × POINTS × 3`, m; their triangles and barycentric coordinates."""
    random, points = np.random.default_rng(seed), body.at_rest()
    corners = points[body.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = norms(normals)
    chosen = random.choice(len(area), count, p=area / area.sum())
    shares = random.dirichlet([1, 1, 1], count)
    roots = np.einsum("nk,nkx->nx", shares, corners[chosen])
    # Combed down.
    along = normals[chosen] / area[chosen, None] + [0, -0.5, 0]
    along /= norms(along)[:, None]
    strands = roots[:, None] + LENGTH * np.linspace(0, 1, POINTS)[None, :, None] * along[:, None]
    return strands, chosen, shares


def write_groom(path: Path, guides: FloatArray, strands: FloatArray) -> None:
    """Writes guides and strands; each strand is in the wisp of the nearest guide."""
    roots = guides[:, 0]
    wisps: list[int] = []
    for part in np.array_split(strands[:, 0], max(1, len(strands) // 500)):
        squared = (part**2).sum(1)[:, None] - 2 * part @ roots.T + (roots**2).sum(1)
        wisps += squared.argmin(axis=1).tolist()
    groom = {
        "format": "hairbake-groom",
        "version": 1,
        "materials": [{"name": "fur", "sag_free": 1.0, "goal_hz": [4, 1]}],
        "guides": {"vertices": POINTS, "points": guides.reshape(-1, 3).round(8).tolist()},
        "strands": {"vertices": POINTS, "points": strands.reshape(-1, 3).round(8).tolist(), "wisp": wisps},
    }
    path.write_text(json.dumps(groom))


def run(*command: object) -> str:
    """Runs a command; its output on standard error."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stderr


def measure(cache: Cache, stage: Path, chosen: IntArray, shares: FloatArray, body: Character) -> None:
    """Prints how far roots are from where pxr's skinning of the mesh has them, and how they move."""
    hair = next(curves for curves in cache.curves if curves.path.endswith("hair"))
    worst, values = 0.0, {}
    for frame in cache.frames:
        file = read_frame(cache, frame)
        for moment, found in [(float(frame), file.values), *file.later.items()]:
            points, rates = (found[f"{hair.path}.{name}"][hair.starts] for name in ("points", "velocities"))
            values[moment] = points.astype(float), rates.astype(float)
        if frame in FRAMES:
            corners = skinned(stage, frame)[body.triangles[chosen]]
            off = norms(values[float(frame)][0] - np.einsum("nk,nkx->nx", shares, corners))
            worst = max(worst, float(off.max()))
    print(f"roots off pxr's skinning at frames: {worst:.2e} m at most")
    moments = sorted(values)
    residual, jump, fastest = 0.0, 0.0, 0.0
    for before, here, after in zip(moments, moments[1:], moments[2:], strict=False):
        (x0, v0), (_, v), (x1, v1) = (values[moment] for moment in (before, here, after))
        mean = (x1 - x0) * FPS / (after - before)
        even = abs((after - here) - (here - before)) < 1e-6
        residual = max(residual, float(norms((v0 + 4 * v + v1) / 6 - mean).max())) if even else residual
        # Across a frame, velocities change by no more than accelerations within frames account for.
        jump = max(jump, float(norms(v - v0).max()) / (here - before))
        fastest = max(fastest, float(norms(v).max()))
    print(
        f"speed {fastest:.2f} m/s at most; velocities off their displacements by {residual:.2e} m/s at most,"
    )
    print(f"and changing by {jump:.2f} m/s per frame at most, between {len(moments)} moments")


def main() -> int:
    """Prints the figures of fur on a walking character."""
    parser = argparse.ArgumentParser(prog="skins", description=__doc__)
    parser.add_argument("character", type=Path, help="a binary glTF file with a skinned mesh")
    parser.add_argument("--hairbake", type=Path, required=True, help="the program")
    parser.add_argument("--joint", default="torso_joint_3", help="the joint that is the frame of reference")
    parser.add_argument("--guides", type=int, default=300)
    parser.add_argument("--strands", type=int, default=2000)
    parser.add_argument("--samples", type=int, default=8, help="moments of a frame")
    parser.add_argument("--reader", choices=("usd", "gltf"), default="usd", help="what reads the mesh")
    parser.add_argument("--contact", default="penalty", help="contact of the bake; roots do not depend on it")
    parser.add_argument("--keep", type=Path, help="folder to work in; default: one that is removed")
    options = parser.parse_args()
    body = Character(options.character)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        stage = folder / "man.usda"
        body.write(stage, range(FRAMES[0], FRAMES[-1] + 4))
        guides, _, _ = fur(body, options.guides, 1)
        strands, chosen, shares = fur(body, options.strands, 2)
        write_groom(folder / "groom.json", guides, strands)
        mesh = f"{stage}:/man/body" if options.reader == "usd" else str(options.character)
        run(
            *(options.hairbake, "import", "track", options.character, "--joint", options.joint),
            *("--frames", f"{FRAMES[0]}-{FRAMES[-1]}", "--skin", mesh, "-o", folder / "anim.json"),
        )
        start = time.monotonic()
        sampling = ("--samples", options.samples, "--shutter", 1 - 1 / options.samples)
        said = run(
            *(options.hairbake, folder / "groom.json", folder / "anim.json", "-o", folder / "out"),
            *(sampling if options.samples > 1 else ()),
            *("--contact", options.contact, "--substeps", "4", "--preroll", "0"),
            *("--no-pictures", "--figures"),
        )
        kept = ("made", "time", "peak memory", "penetration", "hair in body", "exempt", "warning")
        print("\n".join(line for line in said.splitlines() if line.startswith(kept)))
        print(f"{time.monotonic() - start:.1f} s in all")
        measure(Cache(folder / "out"), stage, chosen, shares, body)
    return 0


if __name__ == "__main__":
    sys.exit(main())
