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
  // A digest of the picture, and in how many colours it is.
  const picture = () => {
    const gl = part("canvas").getContext("webgl2");
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const pixels = new Uint8Array(4 * width * height);
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
  const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key }));
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
        await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
        found.coloured[option.value] = picture().digest;
      }
      press("b"); press("v"); press("f"); press("+"); press("]");
      await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
      found.last = picture();
      // The points of the strands at a frame, in the world.
      const { shot } = window.hairbakeView;
      const [at, strands] = [shot.frames.indexOf(1003), shot.sets[0]];
      const head = shot.head[at];
      found.points = Array.from({ length: strands.n }, (_, i) => {
        const place = 4 * (at * strands.n + i);
        const { low, step } = strands.points;
        const p = [0, 1, 2].map((k) => low[k] + step * strands.places[place + k]);
        return [0, 1, 2].map((r) => head[r] * p[0] + head[4 + r] * p[1] + head[8 + r] * p[2] + head[12 + r]);
      });
    }
  } catch (error) {
    problems.push(error.stack);
  }
  found.problems = problems;
  await fetch("LISTENER", { method: "POST", mode: "no-cors", body: JSON.stringify(found) });
})();
</script>
"""
"""Uses the view, and sends what it finds."""


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
    """What the script above finds on a page, which is opened as a file."""
    server = http.server.HTTPServer(("127.0.0.1", 0), Listener)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    after = AFTER.replace("LISTENER", f"http://127.0.0.1:{server.server_port}/")
    path = folder / "used.html"
    path.write_text(page.replace("<head>", "<head>" + BEFORE).replace("</body>", after + "</body>"))
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
    digests = {picture["digest"] for picture in (first, played, stepped, linked, found["last"])}
    assert len(digests) >= 4, "pictures differ"
    expected = {"hair", "group", "speed", "level", "crowding", "contact", "penetration"}
    assert expected <= set(found["coloured"])
    assert len(set(found["coloured"].values())) >= 5
    run_hairbake("read", cache, "hair.points", "--frames", "1003", "-o", tmp_path / "points.npy")
    off = np.abs(np.array(found["points"]) - np.load(tmp_path / "points.npy")[0]).max()
    bound = re.search(r"off by ([\d.]+) mm at most", page)
    assert bound
    assert off < 1e-3 * (float(bound[1]) + 0.01) * np.sqrt(3), "turning with the head mixes coordinates"


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
    frames = json.loads(re.search('"frames":(\\[.*?\\])', other.read_text())[1])  # type: ignore[index]
    assert frames == [1000, 1001, 1002, 1004, 1005]


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
    assert hairbake("view", cache).returncode == 0
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
