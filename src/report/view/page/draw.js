// Drawing with WebGL 2. Curves are ribbons: for each segment the card draws a short strip along the spline
// through its four nearest points, which it takes from one buffer at four offsets.

const PIECES = 4;
const POINT = 8; // Bytes of a point in a buffer.

const CURVE_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec2 corner; // along the segment, and side
layout(location = 1) in vec3 a0; layout(location = 2) in vec3 a1;
layout(location = 3) in vec3 a2; layout(location = 4) in vec3 a3;
layout(location = 5) in vec3 b0; layout(location = 6) in vec3 b1;
layout(location = 7) in vec3 b2; layout(location = 8) in vec3 b3;
layout(location = 9) in vec2 near_; // width and end of the point
layout(location = 10) in vec2 far_; // those of the next point
layout(location = 11) in vec3 colour0; layout(location = 12) in vec3 colour1;
uniform mat4 toView, project;
uniform vec3 low;
uniform float size, between, widest, thinnest, flatness;
uniform vec2 viewport;
uniform bool bspline;
out vec3 shade;

void main() {
  vec3 p0 = mix(a0, b0, between), p1 = mix(a1, b1, between);
  vec3 p2 = mix(a2, b2, between), p3 = mix(a3, b3, between);
  int here = int(near_.y * 255.0 + 0.5), next = int(far_.y * 255.0 + 0.5);
  if ((here & 2) != 0) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; } // after the last point of a curve
  if ((here & 1) != 0) p0 = 2.0 * p1 - p2;
  if ((next & 2) != 0) p3 = 2.0 * p2 - p1;
  float t = corner.x;
  vec4 w, d;
  if (bspline) {
    float s = 1.0 - t;
    w = vec4(s*s*s, 4.0 - 6.0*t*t + 3.0*t*t*t, 1.0 + 3.0*t + 3.0*t*t - 3.0*t*t*t, t*t*t) / 6.0;
    d = vec4(-s*s, -4.0*t + 3.0*t*t, 1.0 + 2.0*t - 3.0*t*t, t*t) / 2.0;
  } else {
    w = vec4(2.0*t*t - t - t*t*t, 2.0 - 5.0*t*t + 3.0*t*t*t, t + 4.0*t*t - 3.0*t*t*t, t*t*t - t*t) / 2.0;
    d = vec4(4.0*t - 1.0 - 3.0*t*t, -10.0*t + 9.0*t*t, 1.0 + 8.0*t - 9.0*t*t, 3.0*t*t - 2.0*t) / 2.0;
  }
  vec3 p = (toView * vec4(low + size * (p0*w.x + p1*w.y + p2*w.z + p3*w.w), 1.0)).xyz;
  vec3 along = mat3(toView) * (p0*d.x + p1*d.y + p2*d.z + p3*d.w);
  vec3 tangent = along / max(length(along), 1e-12);
  vec4 clip = project * vec4(p, 1.0);
  vec4 ahead = project * vec4(tangent, 0.0);
  vec2 way = (ahead.xy * clip.w - clip.xy * ahead.w) * viewport;
  vec2 across = vec2(-way.y, way.x) / max(length(way), 1e-12);
  float wide = mix(near_.x, far_.x, t) * widest * project[1][1] * 0.5 * viewport.y / clip.w;
  clip.xy += across * corner.y * max(wide, thinnest) / viewport * clip.w;
  gl_Position = clip;
  // Diffuse and glossy light of a fibre, lamp over the left shoulder of the viewer.
  vec3 lamp = normalize(vec3(-0.5, 0.7, 0.6));
  vec3 eye = -normalize(p);
  float tl = dot(tangent, lamp), te = dot(tangent, eye);
  float sl = sqrt(max(1.0 - tl*tl, 0.0)), se = sqrt(max(1.0 - te*te, 0.0));
  float gloss = pow(max(sl*se - tl*te, 0.0), 40.0);
  vec3 colour = mix(colour0 * colour0, colour1 * colour1, t);
  shade = mix(colour * (0.35 + 0.75 * sl) + 0.10 * gloss, colour, flatness);
}`;

const BODY_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 a; layout(location = 1) in vec3 b;
layout(location = 2) in vec3 normal;
uniform mat4 toView, project;
uniform vec3 low;
uniform float size, between;
out vec3 shade;

void main() {
  vec3 p = (toView * vec4(low + size * mix(a, b, between), 1.0)).xyz;
  vec3 n = normalize(mat3(toView) * normal);
  n *= -sign(dot(n, p)); // of a sheet both sides are lit
  gl_Position = project * vec4(p, 1.0);
  float lamp = max(dot(n, normalize(vec3(-0.5, 0.7, 0.6))), 0.0);
  float rim = max(dot(n, vec3(0.8, 0.2, 0.1)), 0.0);
  shade = vec3(0.40, 0.335, 0.30) * (0.25 + 0.65 * lamp + 0.2 * rim);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 shade;
uniform float opacity;
out vec4 colour;
void main() { colour = vec4(pow(clamp(shade, 0.0, 1.0), vec3(1.0 / 2.2)), opacity); }`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

function buffer(gl, data, usage) {
  const made = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.bufferData(gl.ARRAY_BUFFER, data, usage);
  return made;
}

class Drawing {
  constructor(canvas, shot) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl)
      throw new Error(
        "This browser has no WebGL 2, which the view needs; the sheet and the charts below do not.",
      );
    this.gl = gl;
    this.shot = shot;
    this.curves = program(gl, CURVE_VERTEX, FRAGMENT);
    this.solid = program(gl, BODY_VERTEX, FRAGMENT);
    const strip = [];
    for (let k = 0; k <= PIECES; k++) strip.push(k / PIECES, -1, k / PIECES, 1);
    this.strip = buffer(gl, new Float32Array(strip), gl.STATIC_DRAW);
    shot.sets.forEach((set) => this.prepareCurves(set));
    shot.bodies.forEach((body) => this.prepareBody(body));
    gl.enable(gl.DEPTH_TEST);
  }

  prepareCurves(set) {
    const { gl } = this;
    // A point before the first and two after the last, for the offsets.
    const room = (set.n + 3) * POINT;
    const ends = new Uint8Array(2 * (set.n + 1));
    let start = 0;
    for (const count of set.counts) {
      for (let i = start; i < start + count; i++) ends[2 * i] = set.widths[i];
      ends[2 * start + 1] |= 1;
      ends[2 * (start + count - 1) + 1] |= 2;
      start += count;
    }
    set.drawn = {
      places: [buffer(gl, room, gl.DYNAMIC_DRAW), buffer(gl, room, gl.DYNAMIC_DRAW)],
      stored: [-1, -1],
      ends: buffer(gl, ends, gl.STATIC_DRAW),
      colours: buffer(gl, 4 * (set.n + 1), gl.DYNAMIC_DRAW),
      coloured: "",
      array: gl.createVertexArray(),
    };
    const { places, colours, array } = set.drawn;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.strip);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    const each = (location, size, type, stride, offset) => {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, type, true, stride, offset);
      gl.vertexAttribDivisor(location, 1);
    };
    places.forEach((points, which) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, points);
      for (let k = 0; k < 4; k++) each(1 + 4 * which + k, 3, gl.UNSIGNED_SHORT, POINT, k * POINT);
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, set.drawn.ends);
    for (let k = 0; k < 2; k++) each(9 + k, 2, gl.UNSIGNED_BYTE, 2, 2 * k);
    gl.bindBuffer(gl.ARRAY_BUFFER, colours);
    for (let k = 0; k < 2; k++) each(11 + k, 3, gl.UNSIGNED_BYTE, 4, 4 * k);
    gl.bindVertexArray(null);
  }

  prepareBody(body) {
    const { gl } = this;
    body.drawn = {
      places: [0, 1].map(() => buffer(gl, body.n * POINT, gl.DYNAMIC_DRAW)),
      stored: [-1, -1],
      normals: buffer(gl, 12 * body.n, gl.DYNAMIC_DRAW),
      corners: gl.createBuffer(),
      array: gl.createVertexArray(),
    };
    gl.bindVertexArray(body.drawn.array);
    body.drawn.places.forEach((points, which) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, points);
      gl.enableVertexAttribArray(which);
      gl.vertexAttribPointer(which, 3, gl.UNSIGNED_SHORT, true, POINT, 0);
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, body.drawn.normals);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.drawn.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, body.corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }

  // Has the stored frames f and g of `of` on the card; returns whether anything changed.
  store(of, frames, offset) {
    const { gl } = this;
    let changed = false;
    frames.forEach((frame, which) => {
      if (of.drawn.stored[which] === frame) return;
      of.drawn.stored[which] = frame;
      changed = true;
      gl.bindBuffer(gl.ARRAY_BUFFER, of.drawn.places[which]);
      gl.bufferSubData(gl.ARRAY_BUFFER, offset, of.places.subarray(4 * of.n * frame, 4 * of.n * (frame + 1)));
    });
    return changed;
  }

  storeColours(set, name, frame) {
    const key = `${name} ${frame}`;
    if (set.drawn.coloured === key) return;
    set.drawn.coloured = key;
    const colour = COLOURINGS[name].colour(this.shot, set, frame);
    const bytes = new Uint8Array(4 * (set.n + 1));
    for (let i = 0; i < set.n; i++)
      // Square roots, so that dark colours keep their steps.
      colour(i).forEach((c, k) => (bytes[4 * i + k] = Math.round(255 * Math.sqrt(Math.min(c, 1)))));
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, set.drawn.colours);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, bytes);
  }

  storeNormals(body, frame) {
    const normals = new Float32Array(3 * body.n);
    const at = 4 * body.n * frame;
    const { places, corners } = body;
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [corners[t], corners[t + 1], corners[t + 2]];
      const edge = (i, k) => places[at + 4 * i + k] - places[at + 4 * a + k];
      const [ux, uy, uz, vx, vy, vz] = [
        edge(b, 0),
        edge(b, 1),
        edge(b, 2),
        edge(c, 0),
        edge(c, 1),
        edge(c, 2),
      ];
      const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      for (const i of [a, b, c]) for (let k = 0; k < 3; k++) normals[3 * i + k] += n[k];
    }
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, body.drawn.normals);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, normals);
  }

  // Draws what `look` says at `place`: the stored frames before and after, and how far between them.
  draw(place, look, camera) {
    const { gl, shot } = this;
    const { canvas } = gl;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.23, 0.245, 0.27, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const frames = [place.before, place.after];
    const moved = (motion) => Matrix.mix(motion[place.before], motion[place.after], place.between);
    const common = ({ uniforms }, of, motion) => {
      gl.uniformMatrix4fv(uniforms.toView, false, Matrix.multiply(camera.view, moved(motion)));
      gl.uniformMatrix4fv(uniforms.project, false, camera.project);
      gl.uniform3fv(uniforms.low, of.points.low);
      gl.uniform1f(uniforms.size, of.points.step * 65535);
      gl.uniform1f(uniforms.between, place.between);
    };
    const bodies = (opacity) => {
      gl.useProgram(this.solid.made);
      gl.uniform1f(this.solid.uniforms.opacity, opacity);
      for (const body of shot.bodies) {
        if (this.store(body, body.deforms ? frames : [0, 0], 0))
          this.storeNormals(body, body.deforms ? place.before : 0);
        common(this.solid, body, body.motion);
        gl.bindVertexArray(body.drawn.array);
        gl.drawElements(gl.TRIANGLES, body.corners.length, gl.UNSIGNED_INT, 0);
      }
    };
    if (look.bodies === "solid") bodies(1);
    gl.useProgram(this.curves.made);
    gl.uniform2f(this.curves.uniforms.viewport, canvas.width, canvas.height);
    gl.uniform1i(this.curves.uniforms.bspline, shot.bspline ? 1 : 0);
    gl.uniform1f(this.curves.uniforms.opacity, 1);
    gl.uniform1f(this.curves.uniforms.flatness, look.colour === "hair" ? 0 : 0.4);
    for (const set of shot.sets.filter((set) => look.curves === "both" || look.curves === set.name)) {
      this.store(set, frames, POINT);
      this.storeColours(set, look.colour, place.between < 0.5 ? place.before : place.after);
      common(this.curves, set, shot.head);
      // What is left out is made up for in width.
      gl.uniform1f(this.curves.uniforms.widest, set.widest * set.every * look.width);
      gl.uniform1f(this.curves.uniforms.thinnest, (set.name === "guides" ? 1.6 : 1) * camera.pixel);
      gl.bindVertexArray(set.drawn.array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 2 * (PIECES + 1), set.n - 1);
    }
    if (look.bodies === "glass") {
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthMask(false);
      bodies(0.3);
      gl.depthMask(true);
      gl.disable(gl.BLEND);
    }
    gl.bindVertexArray(null);
    const error = gl.getError();
    if (error !== gl.NO_ERROR) throw new Error(`WebGL error ${error}`);
  }
}
