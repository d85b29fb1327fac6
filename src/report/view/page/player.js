// The player: frames, camera, keys and links.

const START = { azimuth: 35, elevation: 8, distance: 1, pan: [0, 0, 0] };
const FIELD_OF_VIEW = (24 * Math.PI) / 180;

class Player {
  constructor(root, shot) {
    this.root = root;
    this.shot = shot;
    this.canvas = this.part("canvas");
    this.drawing = new Drawing(this.canvas, shot);
    this.first = shot.frames[0];
    this.last = shot.frames[shot.frames.length - 1];
    this.frame = this.first;
    this.playing = false;
    this.camera = { ...START };
    this.look = {
      colour: "hair",
      curves: shot.sets[0].name,
      bodies: shot.bodies.length ? "solid" : "off",
      follow: "position",
      width: 1,
    };
    this.speed = 1;
    this.measure();
    this.fillControls();
    this.markWarnings();
    this.listen();
    this.goTo(this.first);
    this.followLink();
  }

  part(name) {
    return document.getElementById(`view-${name}`);
  }

  // Centre and radius of what is shown at the first frame, and where the camera looks.
  measure() {
    const { shot } = this;
    const [set] = shot.sets;
    const scale = set.points.step;
    let low = [Infinity, Infinity, Infinity];
    let high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < set.n; i++)
      for (let k = 0; k < 3; k++) {
        const x = set.points.low[k] + scale * set.places[4 * i + k];
        low[k] = Math.min(low[k], x);
        high[k] = Math.max(high[k], x);
      }
    this.pivot = low.map((x, k) => (x + high[k]) / 2);
    this.radius = Math.max(Math.hypot(...high.map((x, k) => x - low[k])) / 2, 1e-9);
    const places = shot.head.map((head) => Matrix.point(head, this.pivot));
    const range = (k) => places.map((p) => p[k]);
    this.middle = [0, 1, 2].map((k) => (Math.min(...range(k)) + Math.max(...range(k))) / 2);
    this.travel = Math.max(...places.map((p) => Math.hypot(...p.map((x, k) => x - this.middle[k]))));
  }

  // Stored frames before and after the current one, and how far it is between them.
  place() {
    const { frames } = this.shot;
    let before = 0;
    while (before + 1 < frames.length && frames[before + 1] <= this.frame) before++;
    if (frames[before] === this.frame || before + 1 === frames.length)
      return { before, after: before, between: 0 };
    const between = (this.frame - frames[before]) / (frames[before + 1] - frames[before]);
    return { before, after: before + 1, between };
  }

  goTo(frame) {
    this.frame = Math.min(Math.max(Math.round(frame), this.first), this.last);
    const place = this.place();
    const stored = place.between === 0;
    this.part("scrub").value = this.frame;
    this.part("frame").textContent = `frame ${this.frame}${stored ? "" : " (interpolated)"}`;
    const warnings = this.shot.warnings.filter((warning) => warning.frames.includes(this.frame));
    this.part("warning").textContent = warnings.map((warning) => warning.what).join("; ");
    this.redraw();
  }

  step(by) {
    this.play(false);
    this.goTo(this.frame + by);
  }

  play(on) {
    if (this.playing === on) return;
    this.playing = on;
    this.part("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    let start = null;
    let from = this.frame === this.last ? this.first : this.frame;
    const advance = (time) => {
      if (!this.playing) return;
      if (start === null) start = time;
      const span = this.last - this.first + 1;
      const passed = Math.floor(((time - start) / 1000) * this.shot.fps * this.speed);
      const frame = this.first + ((from - this.first + passed) % span);
      if (frame !== this.frame) this.goTo(frame);
      requestAnimationFrame(advance);
    };
    this.restart = () => {
      start = null;
      from = this.frame;
    };
    requestAnimationFrame(advance);
  }

  redraw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.drawNow();
    });
  }

  drawNow() {
    const pixel = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((x) =>
      Math.max(Math.round(x * pixel), 1),
    );
    if (this.canvas.width !== width || this.canvas.height !== height)
      Object.assign(this.canvas, { width, height });
    const place = this.place();
    try {
      this.drawing.draw(place, this.look, this.cameraAt(place, width / height, pixel));
    } catch (error) {
      this.play(false);
      say(error.message);
      return;
    }
    this.root.dataset.drawn = this.frame;
  }

  cameraAt(place, aspect, pixel) {
    const { shot, camera, look } = this;
    const head = Matrix.mix(shot.head[place.before], shot.head[place.after], place.between);
    const world = look.follow === "world";
    // In picture space Y is up, and azimuth 0 is in front of the head.
    const up = (v) => (shot.zUp ? [v[0], -v[2], v[1]] : v);
    const turn = (v) => {
      const axis = look.follow === "head" ? Matrix.direction(head, up(v)) : up(v);
      const length = Math.hypot(...axis);
      return axis.map((x) => x / length);
    };
    const [a, e] = [camera.azimuth, camera.elevation].map((x) => (x * Math.PI) / 180);
    const [sa, ca, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
    const axes = [
      [ca, 0, -sa],
      [-se * sa, ce, -se * ca],
      [ce * sa, se, ce * ca],
    ].map(turn);
    const reach = this.radius + (world ? this.travel : 0);
    const distance = (0.95 * reach * camera.distance * Math.max(1, 1 / aspect)) / Math.sin(FIELD_OF_VIEW / 2);
    const target = world ? this.middle : Matrix.point(head, this.pivot);
    const shift = [camera.pan[0] * reach, camera.pan[1] * reach, distance];
    const eye = target.map(
      (x, k) => x + axes[0][k] * shift[0] + axes[1][k] * shift[1] + axes[2][k] * shift[2],
    );
    this.perPixel = (2 * distance * Math.tan(FIELD_OF_VIEW / 2)) / (this.canvas.clientHeight * reach);
    return {
      view: Matrix.view(...axes, eye),
      project: Matrix.perspective(
        FIELD_OF_VIEW,
        aspect,
        distance * 0.02,
        distance + 20 * (reach + this.travel),
      ),
      pixel,
    };
  }

  fillControls() {
    const { shot } = this;
    const scrub = this.part("scrub");
    Object.assign(scrub, { min: this.first, max: this.last });
    const fill = (name, values, chosen, change) => {
      const select = this.part(name);
      for (const [value, text] of values) select.add(new Option(text, value, false, value === chosen));
      select.addEventListener("change", () => {
        change(select.value);
        this.redraw();
      });
    };
    const same = (values) => values.map((value) => [value, value]);
    const names = shot.sets.map((set) => set.name);
    const look = (key) => (value) => {
      this.look[key] = value;
      this.showLegend();
    };
    fill(
      "speed",
      [
        ["1", "1"],
        ["0.5", "1/2"],
        ["0.25", "1/4"],
        ["0.125", "1/8"],
      ],
      "1",
      (value) => {
        this.speed = Number(value);
        if (this.playing) this.restart();
      },
    );
    fill(
      "colour",
      same(Object.keys(COLOURINGS).filter((name) => COLOURINGS[name].has(shot))),
      "hair",
      look("colour"),
    );
    fill("curves", same(names.length > 1 ? [...names, "both"] : names), names[0], look("curves"));
    fill(
      "bodies",
      same(shot.bodies.length ? ["solid", "glass", "off"] : ["off"]),
      this.look.bodies,
      look("bodies"),
    );
    fill("follow", same(["position", "head", "world"]), "position", look("follow"));
    this.showLegend();
  }

  showLegend() {
    const items = COLOURINGS[this.look.colour].legend(this.shot).map(({ colour, text }) => {
      const swatch = document.createElement("i");
      swatch.style.background = `rgb(${colour.map((c) => Math.round(255 * c ** (1 / 2.2))).join(",")})`;
      const item = document.createElement("span");
      item.append(swatch, text);
      return item;
    });
    this.part("legend").replaceChildren(...items);
  }

  markWarnings() {
    const span = Math.max(this.last - this.first, 1);
    const marks = new Map();
    for (const { what, frames } of this.shot.warnings)
      for (const frame of frames) marks.set(frame, [...(marks.get(frame) || []), what]);
    for (const [frame, what] of marks) {
      const mark = document.createElement("i");
      mark.style.left = `${(100 * (frame - this.first)) / span}%`;
      mark.title = `frame ${frame}: ${what.join("; ")}`;
      mark.addEventListener("click", () => this.step(frame - this.frame));
      this.part("marks").append(mark);
    }
  }

  // Links such as #frame=1002.
  followLink() {
    const frame = /^#frame=(-?\d+)$/.exec(location.hash);
    if (!frame) return;
    this.play(false);
    this.goTo(Number(frame[1]));
    this.root.scrollIntoView({ block: "nearest" });
  }

  // The next choice of a control.
  cycle(name) {
    const select = this.part(name);
    select.selectedIndex = (select.selectedIndex + 1) % select.length;
    select.dispatchEvent(new Event("change"));
  }

  zoom(factor) {
    this.camera.distance = Math.min(Math.max(this.camera.distance * factor, 0.02), 30);
    this.redraw();
  }

  widen(by) {
    const width = this.part("width");
    width.value = Number(width.value) + by;
    width.dispatchEvent(new Event("input"));
  }

  reset() {
    this.camera = { ...START };
    this.redraw();
  }

  listen() {
    const click = (name, action) => this.part(name).addEventListener("click", action);
    click("first", () => this.step(this.first - this.frame));
    click("back", () => this.step(-1));
    click("play", () => this.play(!this.playing));
    click("next", () => this.step(1));
    click("last", () => this.step(this.last - this.frame));
    click("reset", () => this.reset());
    this.part("scrub").addEventListener("input", (event) =>
      this.step(Number(event.target.value) - this.frame),
    );
    this.part("width").addEventListener("input", (event) => {
      this.look.width = 2 ** Number(event.target.value);
      this.redraw();
    });
    window.addEventListener("hashchange", () => this.followLink());
    window.addEventListener("resize", () => this.redraw());
    // A link to the frame that is shown already changes no hash.
    document.addEventListener("click", (event) => {
      const link = event.target.closest && event.target.closest('a[href^="#frame="]');
      if (link && link.hash === location.hash) this.followLink();
    });
    this.listenToPointer();
    document.addEventListener("keydown", (event) => this.key(event));
  }

  listenToPointer() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) return;
      const [dx, dy] = [event.movementX, event.movementY];
      if (event.shiftKey || event.buttons !== 1) {
        const [x, y] = this.camera.pan;
        this.camera.pan = [x - dx * this.perPixel, y + dy * this.perPixel, 0];
      } else {
        this.camera.azimuth -= 0.4 * dx;
        this.camera.elevation = Math.min(Math.max(this.camera.elevation + 0.4 * dy, -89), 89);
      }
      this.redraw();
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.zoom(Math.exp(0.0015 * event.deltaY));
      },
      { passive: false },
    );
  }

  key(event) {
    const { tagName, id } = event.target;
    const typing = ["SELECT", "INPUT", "TEXTAREA"].includes(tagName) && id !== "view-scrub";
    // A focused button takes the space bar itself.
    const pressed = tagName === "BUTTON" && event.key === " ";
    if (typing || pressed || event.ctrlKey || event.altKey || event.metaKey) return;
    const keys = {
      " ": () => this.play(!this.playing),
      ArrowLeft: () => this.step(event.shiftKey ? -10 : -1),
      ArrowRight: () => this.step(event.shiftKey ? 10 : 1),
      Home: () => this.step(this.first - this.frame),
      End: () => this.step(this.last - this.frame),
      "+": () => this.zoom(0.8),
      "=": () => this.zoom(0.8),
      "-": () => this.zoom(1.25),
      "[": () => this.widen(-0.25),
      "]": () => this.widen(0.25),
      c: () => this.cycle("colour"),
      v: () => this.cycle("curves"),
      b: () => this.cycle("bodies"),
      f: () => this.cycle("follow"),
      r: () => this.reset(),
    };
    const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }
}

function say(text) {
  document.getElementById("view-say").textContent = text;
}

(async () => {
  const root = document.getElementById("view");
  const text = (name) => document.getElementById(`view-${name}`).textContent;
  say("Unpacking ...");
  try {
    const needed = typeof DecompressionStream === "undefined";
    if (needed)
      throw new Error(
        "This browser is too old to unpack the view; the sheet and the charts below do not need it.",
      );
    const shot = await decodeShot(JSON.parse(text("description")), text("data"));
    window.hairbakeView = new Player(root, shot);
    say("");
    root.dataset.state = "ready";
  } catch (error) {
    say(error.message);
    root.dataset.state = "failed";
  }
})();
