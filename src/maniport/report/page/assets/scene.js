// ArmGroup and ellipsoids in space, drawn with WebGL 2.

const FIELD = Math.PI / 7, TUBE = 0.013, KNOB = 0.02, THINNEST = 0.003;

const SOLID_VERTEX = `#version 300 es
in vec3 point, normal;
uniform mat4 view;
uniform mat3 shape, slope;
uniform vec3 place;
out vec3 world, face, ball;
void main() {
  world = place + shape * point;
  face = slope * normal;
  ball = point;
  gl_Position = view * vec4(world, 1.0);
}`;

const SOLID_FRAGMENT = `#version 300 es
precision highp float;
in vec3 world, face, ball;
uniform vec3 eye, color;
uniform float opacity, rings;
out vec4 pixel;
void main() {
  vec3 toEye = normalize(eye - world), n = normalize(face), facet = cross(dFdx(world), dFdy(world));
  // the side that is seen is lit; near a silhouette a smooth normal may point away though its triangle is seen
  n = dot(n, facet) * dot(facet, toEye) < 0.0 ? -n : n;
  vec3 light = normalize(toEye + vec3(0.0, 0.0, 0.9));
  vec3 shown = color * (0.62 + 0.5 * max(dot(n, light), 0.0));
  shown += 0.18 * pow(max(dot(n, normalize(light + toEye)), 0.0), 30.0);
  // the three ellipses in the planes of the principal axes
  vec3 away = abs(ball) / max(fwidth(ball), vec3(1e-6));
  float ring = rings * (1.0 - smoothstep(0.7, 1.7, min(away.x, min(away.y, away.z))));
  float alpha = opacity;
  if (opacity < 1.0) alpha = max(mix(opacity, 0.8, pow(1.0 - max(dot(n, toEye), 0.0), 2.0)), 0.9 * ring);
  shown = opacity < 1.0 ? mix(shown, color, ring) : mix(shown, 0.45 * color, 0.7 * ring);
  pixel = vec4(shown * alpha, alpha);
}`;

const LINE_VERTEX = `#version 300 es
in vec2 corner;
in vec3 start, end;
uniform mat4 view;
uniform vec2 canvas;
uniform float width;
void main() {
  vec4 a = view * vec4(start, 1.0), b = view * vec4(end, 1.0);
  vec2 along = (b.xy / b.w - a.xy / a.w) * canvas;
  vec2 across = length(along) > 0.0 ? vec2(-along.y, along.x) / length(along) : vec2(0.0);
  vec4 p = mix(a, b, corner.x);
  p.xy += across * corner.y * width / canvas * p.w;
  gl_Position = p;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 color;
uniform float opacity;
out vec4 pixel;
void main() { pixel = vec4(color * opacity, opacity); }`;

function program(gl, vertex, fragment, attributes) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  attributes.forEach((name, place) => gl.bindAttribLocation(made, place, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(`shader: ${gl.getProgramInfoLog(made)}`);
  const uniforms = {};
  for (let k = 0; k < (gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS) || 0); k++) {
    const { name } = gl.getActiveUniform(made, k);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

// Points and normals of a ball, or of a tube from z = 0 to 1, as triangles.
function surface(rows, columns, at) {
  const numbers = [];
  for (let i = 0; i < rows; i++)
    for (let j = 0; j < columns; j++)
      for (const [di, dj] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]])
        numbers.push(...at((i + di) / rows, (2 * Math.PI * (j + dj)) / columns));
  return new Float32Array(numbers);
}
const ball = (u, phi) => {
  const p = [Math.sin(Math.PI * u) * Math.cos(phi), Math.sin(Math.PI * u) * Math.sin(phi), Math.cos(Math.PI * u)];
  return [...p, ...p];
};
const tube = (u, phi) => [Math.cos(phi), Math.sin(phi), u, Math.cos(phi), Math.sin(phi), 0];

// One canvas with its own middle; the direction of view is shared, so that frames can be compared.
class Stage {
  constructor(canvas, camera, middle, radius, ground, turn = null) {
    Object.assign(this, { canvas, camera, middle, radius, ground, turn: turn || [1, 0, 0, 0, 1, 0, 0, 0, 1], buffers: new Map() });
    this.gl = canvas.getContext("webgl2", { alpha: true, antialias: true, premultipliedAlpha: true });
    if (!this.gl) return;
    this.prepare();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.buffers.clear(); this.prepare(); camera.changed(); });
  }

  prepare() {
    const gl = this.gl;
    this.solids = program(gl, SOLID_VERTEX, SOLID_FRAGMENT, ["point", "normal"]);
    this.lines = program(gl, LINE_VERTEX, LINE_FRAGMENT, ["corner", "start", "end"]);
    this.ball = this.upload(surface(24, 36, ball));
    this.tube = this.upload(surface(1, 18, tube));
    this.corners = this.upload(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]));
    this.grid = this.upload(this.gridLines());
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  upload(numbers) {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, numbers, this.gl.STATIC_DRAW);
    return { buffer, length: numbers.length };
  }

  // Points that several triangles share are stored and computed once.
  uploadSurface({ numbers, indices }) {
    const mesh = { ...this.upload(numbers), order: this.gl.createBuffer(), count: indices.length };
    this.gl.bindBuffer(this.gl.ELEMENT_ARRAY_BUFFER, mesh.order);
    this.gl.bufferData(this.gl.ELEMENT_ARRAY_BUFFER, indices, this.gl.STATIC_DRAW);
    return mesh;
  }

  gridLines() {
    const step = this.radius > 1.2 ? 0.5 : 0.2, reach = step * Math.ceil(this.radius / step), lines = [];
    for (let x = -reach; x < reach + 1e-9; x += step)
      lines.push(x, -reach, this.ground, x, reach, this.ground, -reach, x, this.ground, reach, x, this.ground);
    this.step = step;
    return new Float32Array(lines);
  }

  // Start a picture; returns false where there is nothing to draw on.
  begin() {
    const gl = this.gl, { canvas } = this, scale = Math.min(window.devicePixelRatio || 1, 2);
    if (!gl || gl.isContextLost() || !canvas.clientWidth) return false;
    const width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const { azimuth, elevation, zoom } = this.camera, aspect = width / height;
    const distance = (0.8 * this.radius) / Math.sin(FIELD / 2) / Math.min(aspect, 1) / zoom;
    const direction = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
    this.eye = add(this.middle, times(turnedVector(this.turn, direction), distance));
    this.view = product(perspective(FIELD, aspect, distance / 50, distance + 6 * this.radius), looking(this.eye, this.middle, turnedVector(this.turn, [0, 0, 1])));
    this.scale = scale;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    return true;
  }

  solid(mesh, place, columns, normals, color, opacity = 1, rings = 0) {
    const gl = this.gl, { made, uniforms } = this.solids;
    gl.useProgram(made);
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
    for (const [slot, offset] of [[0, 0], [1, 12]]) {
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, offset);
      gl.vertexAttribDivisor(slot, 0);
    }
    gl.disableVertexAttribArray(2);
    gl.uniformMatrix4fv(uniforms.view, false, this.view);
    gl.uniformMatrix3fv(uniforms.shape, false, columns.flat());
    gl.uniformMatrix3fv(uniforms.slope, false, normals.flat());
    gl.uniform3fv(uniforms.place, place);
    gl.uniform3fv(uniforms.eye, this.eye);
    gl.uniform3fv(uniforms.color, color);
    gl.uniform1f(uniforms.opacity, opacity);
    gl.uniform1f(uniforms.rings, rings);
    if (mesh.order) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.order);
      return gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    }
    if (opacity === 1) return gl.drawArrays(gl.TRIANGLES, 0, mesh.length / 6);
    gl.depthMask(false); // what is translucent hides nothing: first its far side, then the near one
    gl.enable(gl.CULL_FACE);
    for (const side of [gl.FRONT, gl.BACK]) {
      gl.cullFace(side);
      gl.drawArrays(gl.TRIANGLES, 0, mesh.length / 6);
    }
    gl.disable(gl.CULL_FACE);
    return gl.depthMask(true);
  }

  knob(place, color, size = KNOB) {
    const columns = [[size, 0, 0], [0, size, 0], [0, 0, size]];
    this.solid(this.ball, place, columns, columns, color);
  }

  bone(from, to, color, size = TUBE) {
    const along = minus(to, from), side = unit(cross(along, Math.abs(unit(along)[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const other = cross(unit(along), side);
    this.solid(this.tube, from, [times(side, size), times(other, size), along], [side, other, unit(along)], color);
  }

  ellipsoid(place, six, size, color, shell) {
    const { lengths, axes } = principalAxes(six), l = lengths.map((x) => Math.max(x * size, THINNEST));
    const columns = axes.map((axis, k) => times(axis, l[k]));
    const normals = axes.map((axis, k) => times(axis, l[0] / l[k]));
    this.solid(this.ball, place, columns, normals, color, shell ? 0.22 : 1, 1);
  }

  // Lines between pairs of points, or through the points of a strip from the first to the last that are named.
  draw(line, color, opacity, width, strip = false, first = 0, last = Infinity) {
    const gl = this.gl, { made, uniforms } = this.lines, stride = strip ? 12 : 24;
    const segments = Math.min(strip ? line.length / 3 - 1 : line.length / 6, last) - first;
    if (segments < 1) return;
    gl.useProgram(made);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners.buffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 8, 0);
    gl.vertexAttribDivisor(0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, line.buffer);
    for (const [slot, offset] of [[1, 0], [2, 12]]) {
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, stride, offset + first * stride);
      gl.vertexAttribDivisor(slot, 1);
    }
    gl.uniformMatrix4fv(uniforms.view, false, this.view);
    gl.uniform2f(uniforms.canvas, this.canvas.width, this.canvas.height);
    gl.uniform1f(uniforms.width, width * this.scale);
    gl.uniform3fv(uniforms.color, color);
    gl.uniform1f(uniforms.opacity, opacity);
    gl.depthMask(false); // it may be drawn over itself
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, segments);
    gl.depthMask(true);
  }

  // A line or a surface that stays as it is, uploaded when it is first drawn.
  kept(name, made, upload = (numbers) => this.upload(numbers)) {
    if (!this.buffers.has(name)) this.buffers.set(name, upload(made()));
    return this.buffers.get(name);
  }

  part(name, part, index, weight, color) {
    part.smooth ??= smoothed(part.points.data, part.triangles.data);
    const mesh = this.kept(name, () => part.smooth, (surface) => this.uploadSurface(surface));
    const { place, columns } = poseAt(part.poses, index, weight);
    this.solid(mesh, place, columns, columns, color);
  }

  // Where a point is on the canvas, in its own pixels.
  onCanvas(point) {
    const m = this.view, p = [0, 1, 3].map((r) => m[r] * point[0] + m[4 + r] * point[1] + m[8 + r] * point[2] + m[12 + r]);
    return [(0.5 + p[0] / p[2] / 2) * this.canvas.clientWidth, (0.5 - p[1] / p[2] / 2) * this.canvas.clientHeight];
  }
}

// Where from the stages of a motion are looked at; dragging turns, pinching and Ctrl + wheel come nearer.
class Camera {
  constructor(changed) { Object.assign(this, { changed, azimuth: -0.9, elevation: 0.32, zoom: 1 }); }

  turn(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = Math.max(-1.5, Math.min(1.5, elevation));
    this.changed();
  }

  nearer(factor) {
    this.zoom = Math.max(0.4, Math.min(6, this.zoom * factor));
    this.changed();
  }

  follow(canvas) {
    const fingers = new Map();
    const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    canvas.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const before = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) this.nearer(spread() / (before || 1));
      else this.turn(this.azimuth - (event.clientX - last[0]) / 120, this.elevation + (event.clientY - last[1]) / 120);
    });
    for (const end of ["pointerup", "pointercancel"])
      canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
      event.preventDefault();
      this.nearer(Math.exp(-event.deltaY / 300));
    }, { passive: false });
  }
}
