"use strict";
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

  mix(a, b, u) {
    return a.map((x, i) => x + (b[i] - x) * u);
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
