// What colours mean: for each way to colour, a colour for every point of a set at a frame, and a legend.

function hue(h) {
  return [0, 4, 2].map((k) => {
    const x = (((h * 6 + k) % 6) + 6) % 6;
    return 0.12 + 0.6 * Math.min(Math.max(Math.abs(x - 3) - 1, 0), 1) ** 2;
  });
}

const GREY = [0.3, 0.31, 0.33];
// Blue over green and yellow to red, for 0 to 1.
const heat = (x) => hue(0.6 * (1 - Math.min(Math.max(x, 0), 1)));
// The colours of `hairbake preview`.
const levelColour = (level) => hue(0.6 * 0.55 ** level - (level > 0 ? 0.16 : 0));
const groupColour = (group) => hue(((group * 0.618033988749895) % 1) + 1);
const INSIDE = 5;
const depthColour = (code) => (code >= INSIDE ? hue(0.16 * (1 - (code - INSIDE) / 10)) : GREY);
const contactColour = (code) =>
  code === 0 ? GREY : code >= INSIDE ? [0.75, 0.1, 0.08] : hue(0.6 - 0.09 * code);

// A number in [0, 1) for a curve, the same every time.
function chance(curve, which) {
  const x = Math.sin(curve * 12.9898 + which * 78.233) * 43758.5453;
  return x - Math.floor(x);
}

function hairColour(curve) {
  const dark = chance(curve, 0);
  const light = 0.75 + 0.5 * chance(curve, 1);
  return [
    [0.165, 0.085],
    [0.083, 0.04],
    [0.044, 0.022],
  ].map(([a, b]) => (a + (b - a) * dark) * light * 2);
}

// Speed of a point against the head, m/s, from the stored frame before to that after it.
function speeds(shot, set, f) {
  const [a, b] = [Math.max(f - 1, 0), Math.min(f + 1, shot.frames.length - 1)];
  const seconds = (shot.frames[b] - shot.frames[a]) / shot.fps;
  const scale = seconds > 0 ? (set.points.step * shot.metresPerUnit) / seconds : 0;
  const { places, n } = set;
  return (i) => {
    const [p, q] = [4 * (a * n + i), 4 * (b * n + i)];
    return (
      scale * Math.hypot(places[q] - places[p], places[q + 1] - places[p + 1], places[q + 2] - places[p + 2])
    );
  };
}

const FASTEST = 2;
const swatches = (pairs) => pairs.map(([colour, text]) => ({ colour, text }));

// What is marked of the guides, where anything is.
const guidesOf = (shot, which) =>
  shot.sets.map((set) => set[which]).filter((marked) => marked && Object.keys(marked.places).length > 0);

// Each: whether the shot has it, the colour of point i of a set at stored frame f, and the legend.
const COLOURINGS = {
  hair: {
    has: () => true,
    colour: (shot, set) => (i) =>
      set.name === "guides" ? groupColour(set.groups[set.curveOf[i]]) : hairColour(set.curveOf[i]),
    legend: () => [],
  },
  group: {
    has: () => true,
    colour: (shot, set) => (i) => groupColour(set.groups[set.curveOf[i]]),
    legend: (shot) => {
      const names = new Map(shot.sets.flatMap((set) => set.groupNames));
      return swatches(
        [...names].slice(0, 12).map(([group, name]) => [groupColour(group), name || `group ${group}`]),
      );
    },
  },
  level: {
    has: (shot) => shot.levels,
    colour: (shot, set, f) => (i) => levelColour(set.levels[f * set.counts.length + set.curveOf[i]]),
    legend: () =>
      swatches(
        [0, 1, 2, 3].map((level) => [levelColour(level), level === 0 ? "coarse wisp" : `level ${level}`]),
      ),
  },
  speed: {
    has: (shot) => shot.frames.length > 1,
    colour: (shot, set, f) => {
      const speed = speeds(shot, set, f);
      return (i) => heat(speed(i) / FASTEST);
    },
    legend: () => swatches([0, 0.5, 1, 2].map((v) => [heat(v / FASTEST), `${v} m/s against the head`])),
  },
  crowding: {
    has: () => true,
    colour: (shot, set, f) => (i) => heat((set.shades[f * set.n + i] & 15) / 15),
    legend: () =>
      swatches([
        [heat(0), "loose"],
        [heat(0.5), "as the densest of the groom"],
        [heat(0.75), "1.5 times"],
        [heat(1), "twice"],
      ]),
  },
  contact: {
    has: (shot) => shot.bodies.length > 0,
    colour: (shot, set, f) => (i) => contactColour(set.shades[f * set.n + i] >> 4),
    legend: () =>
      swatches([
        [GREY, "free"],
        [contactColour(1), "2 mm from a body"],
        [contactColour(4), "touches"],
        [contactColour(15), "inside"],
      ]),
  },
  penetration: {
    has: (shot) => shot.bodies.length > 0,
    colour: (shot, set, f) => (i) => depthColour(set.shades[f * set.n + i] >> 4),
    legend: () =>
      swatches([
        [GREY, "outside"],
        [depthColour(5), "inside by 0.5 mm"],
        [depthColour(10), "3 mm"],
        [depthColour(15), "5 mm or more"],
      ]),
  },
  solver: {
    has: (shot) => ["unconverged", "halved"].some((which) => guidesOf(shot, which).length > 0),
    colour: (shot, set, f) => {
      const of = (which) => new Set(set[which] ? set[which].places[shot.frames[f]] : []);
      const [failed, halved] = [of("unconverged"), of("halved")];
      return (i) => (failed.has(set.curveOf[i]) ? hue(0) : halved.has(set.curveOf[i]) ? hue(0.12) : GREY);
    },
    legend: (shot) => {
      const missing = (which) => {
        const n = guidesOf(shot, which).reduce((sum, marked) => sum + marked.missing, 0);
        return n > 0 ? ` (${n} of them not shown)` : "";
      };
      return swatches([
        [GREY, "as usual"],
        [hue(0.12), `guide whose step was halved${missing("halved")}`],
        [hue(0), `guide that did not converge${missing("unconverged")}`],
      ]);
    },
  },
};
