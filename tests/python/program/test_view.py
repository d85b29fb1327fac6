"""The view of a report, in a real browser: it loads, plays, jumps, and says so where it cannot draw."""

import http.server
import json
import os
import queue
import re
import shutil
import subprocess
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hairbake_validate.geometry import FloatArray
from support import HAIRBAKE, ROOT, Run, run_hairbake

CHROMIUM = (
    os.environ.get("HAIRBAKE_CHROMIUM")
    or shutil.which("chromium")
    or shutil.which("chromium-browser")
    or shutil.which("google-chrome")
)

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on the path; HAIRBAKE_CHROMIUM names one"
)

BEFORE = """
<script>
window.problems = [];
window.addEventListener("error", (event) => problems.push(String(event.message)));
window.addEventListener("unhandledrejection", (event) => problems.push(String(event.reason)));
console.error = (...words) => problems.push(words.join(" "));
console.warn = console.error;
</script>
"""
"""Notes what goes wrong on the page."""

AFTER = """
<script>
(async () => {
  const view = document.getElementById("view");
  const part = (name) => document.getElementById("view-" + name);
  const until = async (done) => {
    for (let i = 0; i < 600 && !done(); i++) await new Promise((go) => setTimeout(go, 20));
  };
  const found = {};
  let pixels;
  // A digest of the picture, and in how many colours it is.
  const picture = () => {
    const gl = part("canvas").getContext("webgl2");
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const words = new Uint32Array(pixels.buffer);
    let digest = 0;
    for (const word of words) digest = (digest * 31 + word) >>> 0;
    return { digest, colours: new Set(words).size };
  };
  const shown = async (act) => {
    const before = view.dataset.drawn;
    await act();
    await until(() => view.dataset.drawn !== before);
    return { frame: Number(view.dataset.drawn), ...picture() };
  };
  const press = (key, on = document) =>
    on.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const drawnAgain = () => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
  try {
    await until(() => view.dataset.state && (view.dataset.drawn || view.dataset.state === "failed"));
    found.state = view.dataset.state;
    found.say = part("say").textContent;
    if (found.state === "ready") {
      found.first = { frame: Number(view.dataset.drawn), ...picture() };
      found.played = await shown(() => part("play").click());
      part("play").click();
      found.stepped = await shown(() => press("End"));
      found.linked = await shown(() => { location.hash = "#frame=1002"; });
      found.text = part("frame").textContent;
      found.coloured = {};
      for (const option of part("colour").options) {
        part("colour").value = option.value;
        part("colour").dispatchEvent(new Event("change"));
        await drawnAgain();
        found.coloured[option.value] = picture().digest;
      }
      part("colour").value = "hair";
      part("colour").dispatchEvent(new Event("change"));
      const player = window.hairbakeView;
      const state = () => {
        const { frame, playing, look, camera } = player;
        return { frame, playing, ...look, ...camera };
      };
      // What each key changes, and whether the picture is another one.
      found.keys = [];
      for (const key of ["ArrowRight", "ArrowLeft", "Home", "End", "+", "-", "]", "[", "c", "v", "b", "f"]) {
        const [before, drawn] = [state(), picture().digest];
        press(key);
        await drawnAgain();
        const differs = ([name, value]) => String(value) !== String(before[name]);
        const changed = Object.entries(state()).filter(differs);
        found.keys.push([key, Object.fromEntries(changed), picture().digest !== drawn]);
      }
      press("+");
      press("r");
      found.reset = player.camera.distance;
      press(" ");
      found.space = [player.playing];
      press(" ");
      found.space.push(player.playing);
      press(" ", part("next"));
      found.space.push(player.playing);
      press("c"); press("f"); press("f");
      await drawnAgain();
      found.last = picture();
      // The points of the strands at a frame, in the world.
      const { shot } = player;
      const [at, strands] = [shot.frames.indexOf(1003), shot.sets[0]];
      const head = shot.head[at];
      found.points = Array.from({ length: strands.n }, (_, i) => {
        const place = 4 * (at * strands.n + i);
        const { low, step } = strands.points;
        const p = [0, 1, 2].map((k) => low[k] + step * strands.places[place + k]);
        return [0, 1, 2].map((r) => head[r] * p[0] + head[4 + r] * p[1] + head[8 + r] * p[2] + head[12 + r]);
      });
      // The mean difference of a picture from that of the same shot in centimetres, Z up.
      const show = async (player) => {
        Object.assign(player.look, { colour: "speed", curves: "strands", bodies: "solid", follow: "head" });
        Object.assign(player.camera, { azimuth: 60, elevation: 20 });
        player.goTo(1003);
        await drawnAgain();
        picture();
        return pixels;
      };
      const metres = await show(player);
      convert(shot);
      const centimetres = await show(new player.constructor(view, shot));
      found.difference = metres.reduce((sum, x, i) => sum + Math.abs(x - centimetres[i]), 0) / metres.length;
    }
  } catch (error) {
    problems.push(error.stack);
  }
  found.problems = problems;
  await send(found);
})();
</script>
"""
"""Uses the view, and sends what it finds."""

SEND = """
<script>
const send = (found) => fetch("LISTENER", { method: "POST", mode: "no-cors", body: JSON.stringify(found) });
</script>
"""
"""Sends what a script finds."""

CONVERT = """
<script>
// Turns a decoded shot in metres, Y up, into the same one in centimetres, Z up.
const convert = (shot) => {
  const turned = ([x, y, z]) => [100 * x, -100 * z, 100 * y];
  for (const part of [...shot.sets, ...shot.bodies]) {
    const { places, points } = part;
    const [x, y, z] = points.low;
    points.low = turned([x, y, z + 65535 * points.step]);
    points.step *= 100;
    for (let i = 0; i < places.length; i += 4)
      [places[i + 1], places[i + 2]] = [65535 - places[i + 2], places[i + 1]];
    if (part.widest) part.widest *= 100;
  }
  const motion = (m) => {
    const axis = (c, sign) => [sign * m[4 * c], -sign * m[4 * c + 2], sign * m[4 * c + 1], 0];
    return [...axis(0, 1), ...axis(2, -1), ...axis(1, 1), ...turned(m.slice(12, 15)), 1];
  };
  shot.head = shot.head.map(motion);
  for (const body of shot.bodies) body.motion = body.motion.map(motion);
  [shot.zUp, shot.metresPerUnit] = [true, 0.01];
};
</script>
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache of four frames with its report."""
    if not HAIRBAKE.is_file():
        pytest.skip(f"{HAIRBAKE} is missing: run `cargo build`")
    sample = ROOT / "samples/short"
    out = tmp_path_factory.mktemp("view") / "out"
    done = run_hairbake(
        sample / "groom.json", sample / "shake.json", "-o", out, "--frames", "1001-1004", "--preroll", "0"
    )
    assert done.returncode == 0, done.stderr
    return out


class Listener(http.server.BaseHTTPRequestHandler):
    """Takes what the page found."""

    found: queue.Queue[bytes] = queue.Queue()

    def do_POST(self) -> None:
        """Puts the content into the queue."""
        self.found.put(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        """Says nothing."""


def use(page: str, folder: Path, *options: str) -> dict[str, Any]:
    """What the script above finds on a page."""
    page = page.replace("<head>", "<head>" + BEFORE).replace("</body>", CONVERT + SEND + AFTER + "</body>")
    return opened(page, folder, *options)


def evaluate(scripts: list[str], expression: str, folder: Path) -> Any:
    """The value of an expression after scripts of the page."""
    text = "".join((ROOT / "src/report/view/page" / name).read_text() for name in scripts)
    script = f"(() => {{ {text} send({{ value: {expression} }}); }})();"
    page = f"<html><body>{SEND}<script>{script}</script></body></html>"
    return opened(page, folder)["value"]


def opened(page: str, folder: Path, *options: str) -> dict[str, Any]:
    """What a page sends that is opened as a file."""
    server = http.server.HTTPServer(("127.0.0.1", 0), Listener)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    path = folder / "used.html"
    path.write_text(page.replace("LISTENER", f"http://127.0.0.1:{server.server_port}/"))
    command = [
        str(CHROMIUM),
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--window-size=400,300",
        f"--user-data-dir={folder / 'profile'}",
        *options,
        path.as_uri(),
    ]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as browser:
        try:
            found: dict[str, Any] = json.loads(Listener.found.get(timeout=100))
        finally:
            browser.terminate()
            server.shutdown()
            server.server_close()
    return found


@needs_chromium
def test_the_view_plays_and_jumps(cache: Path, tmp_path: Path) -> None:
    page = (cache / "report.html").read_text()
    found = use(page, tmp_path)
    assert (found["problems"], found["state"], found["say"]) == ([], "ready", "")
    first, played, stepped, linked = (found[name] for name in ("first", "played", "stepped", "linked"))
    assert first["frame"] == 1000
    assert first["colours"] > 100, "hair and head are drawn"
    assert played["frame"] > 1000
    assert (stepped["frame"], linked["frame"]) == (1005, 1002)
    assert found["text"] == "frame 1002"
    digests = {picture["digest"] for picture in (first, stepped, linked, found["last"])}
    assert len(digests) == 4, "pictures differ"
    expected = {"hair", "group", "speed", "level", "crowding", "contact", "penetration"}
    assert expected <= set(found["coloured"])
    assert found["coloured"]["contact"] != found["coloured"]["penetration"], "hair lies near the head"
    assert len(set(found["coloured"].values())) >= 5
    assert found["difference"] < 0.1, "units and axes of the cache do not show"
    run_hairbake("read", cache, "hair.points", "--frames", "1003", "-o", tmp_path / "points.npy")
    off = np.linalg.norm(np.array(found["points"]) - np.load(tmp_path / "points.npy")[0], axis=-1).max()
    bound = re.search(r"off by ([\d.]+) mm at most", page)
    assert bound
    # Coordinates of about a metre, and motions, are in single precision.
    assert off <= 1e-3 * float(bound[1]) + 1e-6
    assert found["reset"] == 1
    assert found["space"] == [True, False, False], "a focused button takes the key itself"
    keys = {
        "ArrowRight": {"frame": 1003},
        "ArrowLeft": {"frame": 1002},
        "Home": {"frame": 1000},
        "End": {"frame": 1005},
        "+": {"distance": 0.8},
        "-": {"distance": 1},
        "]": {"width": 2**0.25},
        "[": {"width": 1},
        "c": {"colour": "group"},
        "v": {"curves": "guides"},
        "b": {"bodies": "glass"},
        "f": {"follow": "head"},
    }
    for key, changed, drawn_anew in found["keys"]:
        assert changed == pytest.approx(keys.pop(key)), key
        assert drawn_anew or key in "[]f", key
    assert not keys


@needs_chromium
def test_motions_between_stored_frames_keep_their_size(tmp_path: Path) -> None:
    def motion(turn: FloatArray, scale: float, move: list[float]) -> FloatArray:
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = scale * turn, move
        return out

    def about(axis: list[float], degrees: float) -> FloatArray:
        x, y, z = np.array(axis) / np.linalg.norm(axis)
        cross, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.radians(degrees)
        turned: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        return turned

    pairs, expected = [], []
    for axis in ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -2.0, 0.5]):
        for first, degrees in ((0, 170), (100, 90), (250, 1e-5), (30, 0), (140, 179)):
            for mirror in (np.eye(3), np.diag([1.0, -1.0, 1.0])):
                places = [motion(about(axis, first) @ mirror, 2, [1, 2, 3])]
                places.append(motion(about(axis, first + degrees) @ mirror, 4, [2, 2, 2]))
                pairs.append([place.T.ravel().tolist() for place in places])
                between = motion(about(axis, first + 0.25 * degrees) @ mirror, 2.5, [1.25, 2, 2.75])
                expected.append(between.T.ravel())
    expression = f"{json.dumps(pairs)}.map(([a, b]) => [0, 0.25, 1].map((u) => Matrix.mix(a, b, u)))"
    found = np.array(evaluate(["matrix.js"], expression, tmp_path))
    np.testing.assert_allclose(found[:, 1], expected, atol=1e-9)
    assert np.array_equal(found[:, [0, 2]], np.array(pairs)), "stored frames are as they are"


@needs_chromium
def test_colours_of_contact_and_depth_differ_where_they_must(tmp_path: Path) -> None:
    set_of_codes = "{ n: 16, shades: Array.from({ length: 16 }, (_, code) => code << 4) }"
    colours = (
        f"['contact', 'penetration'].map((name) => Array.from({{ length: 16 }}, (_, i) => "
        f"COLOURINGS[name].colour(null, {set_of_codes}, 0)(i)))"
    )
    contact, depth = evaluate(["colours.js"], colours, tmp_path)
    grey = contact[0]
    # Code 0 is free, 1 to 4 are within two millimetres of a body, 5 to 15 ever deeper inside.
    assert depth[:5] == [grey] * 5
    assert len({tuple(colour) for colour in contact[:5]}) == 5
    assert contact[5:] == [contact[5]] * 11
    assert contact[5] not in contact[:5]
    assert len({tuple(colour) for colour in depth[4:]}) == 12


@needs_chromium
def test_a_browser_without_webgl_is_told(cache: Path, tmp_path: Path) -> None:
    found = use((cache / "report.html").read_text(), tmp_path, "--disable-3d-apis")
    assert found["state"] == "failed"
    assert "no WebGL 2" in found["say"]


def test_the_page_is_written_where_it_is_missing_and_opened(
    cache: Path, tmp_path: Path, hairbake: Run
) -> None:
    out = shutil.copytree(cache, tmp_path / "out")
    page = out / "report.html"
    text = page.read_text()
    assert hairbake("view", out, "--no-open").stdout == f"{page}\n"
    assert page.read_text() == text, "it was there"
    page.unlink()
    done = hairbake("view", out, "--no-open")
    assert (done.returncode, done.stdout) == (0, f"{page}\n")
    assert "wrote" in done.stderr
    again = page.read_text()
    # Of the bake itself the report alone knows the pre-roll's time.
    assert re.sub("<tr><th>pre-roll time.*?</tr>", "", text) == again
    page.write_text("an old report")
    assert hairbake("view", out, "--no-open").returncode == 0
    assert page.read_text() == again, "one that does not play is replaced"
    (out / "manifest.json").unlink()
    (out / "hair.1003.usdc").unlink()
    other = tmp_path / "other.html"
    assert hairbake("view", out, "-o", other, "--no-open").returncode == 0
    unfinished = other.read_text()
    frames = json.loads(re.search('"frames":(\\[.*?\\])', unfinished)[1])  # type: ignore[index]
    assert frames == [1000, 1001, 1002, 1004, 1005]
    assert "neither drawn nor warned of: Contacts, Contacts between guides, Distance missing" in unfinished
    assert ", Splits and merges, number of exempt segments, " in unfinished
    assert "<h2>Penetration" not in unfinished
    assert "Total time" in unfinished, "the data of the report tell it"
    (out / "report.json").unlink()
    assert hairbake("view", out, "-o", other, "--no-open").returncode == 0
    assert "Their time is not known." in other.read_text()


def test_a_page_that_cannot_be_written_is_told_where_else(cache: Path, tmp_path: Path, hairbake: Run) -> None:
    out = shutil.copytree(cache, tmp_path / "out")
    (out / "report.html").unlink()
    # A folder in place of the page: even root cannot write there.
    (out / "report.html").mkdir()
    refused = hairbake("view", out, "--no-open")
    assert refused.returncode == 74
    assert "report.html" in refused.stderr
    assert "-o FILE writes the page elsewhere" in refused.stderr
    assert hairbake("view", out, "--no-open", "-o", tmp_path / "page.html").returncode == 0


def test_another_place_does_not_help_where_a_frame_cannot_be_read(
    cache: Path, tmp_path: Path, hairbake: Run
) -> None:
    out = shutil.copytree(cache, tmp_path / "out")
    (out / "hair.1003.usdc").unlink()
    (out / "hair.1003.usdc").mkdir()
    refused = hairbake("view", out, "--no-open", "-o", tmp_path / "page.html")
    assert refused.returncode == 74
    assert "hair.1003.usdc" in refused.stderr
    assert "-o FILE" not in refused.stderr


def test_a_figure_that_an_older_program_did_not_record_is_absent(
    cache: Path, tmp_path: Path, hairbake: Run
) -> None:
    out, page = shutil.copytree(cache, tmp_path / "out"), tmp_path / "page.html"
    manifest = json.loads((out / "manifest.json").read_text())
    for frame in manifest["frames"]:
        del frame["figures"]["penetration_m"]
        del frame["figures"]["length_drift"]
    manifest["inputs"][0]["sha256"] = "short"
    (out / "manifest.json").write_text(json.dumps(manifest))
    assert hairbake("view", out, "-o", page, "--no-open").returncode == 0
    text = page.read_text()
    assert "neither drawn nor warned of: Penetration (guides), Length drift of guides.</p>" in text
    assert re.search("guides</th>(<td>–</td>){3}<td></td></tr>.*exempt</th><td>[0-9]", text)
    assert "(short)</td>" in text


@pytest.mark.skipif(os.uname().sysname != "Linux", reason="the program that opens a page is xdg-open")
def test_the_page_is_opened_by_the_program_of_the_desktop(
    cache: Path, tmp_path: Path, hairbake: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    opener = tmp_path / "bin/xdg-open"
    opener.parent.mkdir()
    opener.write_text(
        f'#!/bin/sh\nprintf %s "$1" >{tmp_path}/opened.part && mv {tmp_path}/opened.part {tmp_path}/opened\n'
    )
    opener.chmod(0o755)
    monkeypatch.setenv("PATH", f"{opener.parent}:/usr/bin:/bin")
    monkeypatch.setenv("DISPLAY", ":0")
    done = hairbake("view", cache)
    assert (done.returncode, done.stdout) == (0, f"{cache / 'report.html'}\n")
    opened = tmp_path / "opened"
    for _ in range(100):
        if opened.exists():
            break
        subprocess.run(["sleep", "0.05"], check=True)
    assert opened.read_text() == str(cache / "report.html")
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    refused = hairbake("view", cache)
    assert refused.returncode == 78
    assert f"no browser opens {cache / 'report.html'}" in refused.stderr
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert hairbake("view", cache).stdout == f"{cache / 'report.html'}\n"
