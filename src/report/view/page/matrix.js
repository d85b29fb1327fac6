"use strict";

function dot(a, b) {
  return a.reduce((sum, x, i) => sum + x * b[i], 0);
}

// Between two unit quaternions, the shorter way.
function slerp(a, b, u) {
  const cosine = dot(a, b);
  const near = cosine < 0 ? b.map((x) => -x) : b;
  const angle = Math.acos(Math.min(Math.abs(cosine), 1));
  const share = (part) => (angle < 1e-6 ? part : Math.sin(part * angle) / Math.sin(angle));
  return a.map((x, i) => share(1 - u) * x + share(u) * near[i]);
}

// Matrices of 16 numbers, column by column as WebGL takes them. All are in double precision until they are
// passed on, so that a head far from the origin does not tremble.
const Matrix = {
  // Three rows of four numbers, as the cache has them.
  fromRows(r) {
    return [r[0], r[4], r[8], 0, r[1], r[5], r[9], 0, r[2], r[6], r[10], 0, r[3], r[7], r[11], 1];
  },

  multiply(a, b) {
    const out = new Array(16).fill(0);
    for (let c = 0; c < 4; c++)
      for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
  },

  // A pose between two: turns are even, so that nothing shrinks on the way, and scales are mixed.
  mix(a, b, u) {
    if (u === 0) return a;
    if (u === 1) return b;
    const [from, to] = [a, b].map((m) => this.parts(m));
    const mixed = (x, y) => x.map((value, i) => value + (y[i] - value) * u);
    const scale = mixed(from.scale, to.scale);
    const columns = this.turns(slerp(from.turn, to.turn, u)).map((column, c) =>
      column.map((x) => x * scale[c]),
    );
    return [...columns.flatMap((column) => [...column, 0]), ...mixed(from.move, to.move), 1];
  },

  // Unit quaternion, scales along the axes, and translation of a pose. A mirrored axis has a negative scale.
  parts(m) {
    const columns = [0, 4, 8].map((c) => [m[c], m[c + 1], m[c + 2]]);
    const [x, y, z] = columns;
    const volume = dot(x, [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]);
    const scale = columns.map((column) => Math.hypot(...column) || 1);
    if (volume < 0) scale[0] *= -1;
    const r = columns.map((column, c) => column.map((value) => value / scale[c]));
    // The largest of the four components comes first (Shepperd 1978).
    const squares = [
      1 + r[0][0] + r[1][1] + r[2][2],
      1 + r[0][0] - r[1][1] - r[2][2],
      1 - r[0][0] + r[1][1] - r[2][2],
      1 - r[0][0] - r[1][1] + r[2][2],
    ];
    const most = squares.indexOf(Math.max(...squares));
    const [wx, wy, wz] = [r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0]];
    const [xy, xz, yz] = [r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]];
    const turn = [
      [squares[0], wx, wy, wz],
      [wx, squares[1], xy, xz],
      [wy, xy, squares[2], yz],
      [wz, xz, yz, squares[3]],
    ][most];
    const length = Math.hypot(...turn);
    return { turn: turn.map((value) => value / length), scale, move: [m[12], m[13], m[14]] };
  },

  // The columns of the rotation by a unit quaternion.
  turns([w, x, y, z]) {
    return [
      [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
      [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
      [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ];
  },

  point(m, p) {
    return [0, 1, 2].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
  },

  direction(m, v) {
    return [0, 1, 2].map((r) => m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2]);
  },

  perspective(fovRadians, aspect, near, far) {
    const f = 1 / Math.tan(fovRadians / 2);
    const depth = near - far;
    return [
      f / aspect,
      0,
      0,
      0,
      0,
      f,
      0,
      0,
      0,
      0,
      (far + near) / depth,
      -1,
      0,
      0,
      (2 * far * near) / depth,
      0,
    ];
  },

  // From the world to the axes of a viewer: right, up and back are unit vectors, `eye` is where it stands.
  view(right, up, back, eye) {
    const along = (axis) => -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
    return [
      right[0],
      up[0],
      back[0],
      0,
      right[1],
      up[1],
      back[1],
      0,
      right[2],
      up[2],
      back[2],
      0,
      along(right),
      along(up),
      along(back),
      1,
    ];
  },
};
