// The data of the page: compressed, then arrays as src/report/view/mod.rs lays them out.

async function unpack(text, length) {
  const letters = atob(text);
  const packed = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  if (bytes.length !== length) throw new Error(`${bytes.length} bytes of data, expected ${length}`);
  return bytes;
}

// Points of all frames, as src/report/view/codec.rs encodes them: three 16-bit numbers and one unused for
// each point. `counts` are the lengths of the curves; without them every point is on its own.
function decodePoints(bytes, points, counts) {
  const n = points.count;
  const frames = points.shifts.length;
  const places = new Uint16Array(4 * n * frames);
  const isRoot = new Uint8Array(n).fill(counts ? 0 : 1);
  let start = 0;
  for (const count of counts || []) {
    isRoot[start] = 1;
    start += count;
  }
  let at = points.at;
  for (let f = 0; f < frames; f++) {
    const scale = 1 << points.shifts[f];
    for (let i = 0; i < n; i++) {
      const now = 4 * (f * n + i);
      if (bytes[at] === 128) {
        for (let k = 0; k < 3; k++) places[now + k] = bytes[at + 1 + 2 * k] | (bytes[at + 2 + 2 * k] << 8);
        at += 7;
        continue;
      }
      const before = now - 4 * n;
      for (let k = 0; k < 3; k++) {
        const carried = isRoot[i] ? 0 : places[now - 4 + k] - places[before - 4 + k];
        const change = (bytes[at + k] << 24) >> 24;
        places[now + k] = places[before + k] + carried + change * scale;
      }
      at += 3;
    }
  }
  return places;
}

function decodeMotion(bytes, at, frames) {
  const values = new Float32Array(bytes.buffer, at, 12 * frames);
  return Array.from({ length: frames }, (_, f) => Matrix.fromRows(values.subarray(12 * f, 12 * f + 12)));
}

// Everything of the page, decoded.
async function decodeShot(description, text) {
  const bytes = await unpack(text, description.bytes);
  const frames = description.frames.length;
  const sets = description.sets.map((set) => {
    const n = set.points.count;
    const curves = set.counts.length;
    const curveOf = new Uint32Array(n);
    let start = 0;
    set.counts.forEach((count, curve) => {
      curveOf.fill(curve, start, start + count);
      start += count;
    });
    return {
      ...set,
      n,
      curveOf,
      places: decodePoints(bytes, set.points, set.counts),
      widths: bytes.subarray(set.widthsAt, set.widthsAt + n),
      shades: bytes.subarray(set.shadesAt, set.shadesAt + n * frames),
      levels: description.levels ? bytes.subarray(set.levelsAt, set.levelsAt + curves * frames) : null,
    };
  });
  const bodies = description.bodies.map((body) => ({
    ...body,
    n: body.points.count,
    deforms: body.points.shifts.length > 1,
    places: decodePoints(bytes, body.points, null),
    corners: new Uint32Array(bytes.buffer, body.trianglesAt, 3 * body.triangles),
    motion: decodeMotion(bytes, body.motionAt, frames),
  }));
  return { ...description, sets, bodies, head: decodeMotion(bytes, description.head, frames) };
}
