// Small vectors and matrices. Matrices for WebGL are column-major.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => times(a, 1 / (Math.hypot(...a) || 1));

function product(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return out;
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2), depth = near - far;
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / depth, -1, 0, 0, (2 * far * near) / depth, 0];
}

function looking(eye, target, above) {
  const back = unit(minus(eye, target)), right = unit(cross(above, back)), up = cross(back, right);
  return [
    right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
  ];
}

// Numbers of a row of an array, and of how much of the way to the next one.
function between({ shape, data }, index, weight) {
  const width = data.length / shape[0], row = (k) => data.subarray(k * width, (k + 1) * width);
  if (!weight) return row(index);
  const next = row(index + 1);
  return row(index).map((x, k) => x + weight * (next[k] - x));
}

// A vector turned by a rotation, nine numbers row by row.
const turnedVector = (turn, v) => [0, 3, 6].map((k) => turn[k] * v[0] + turn[k + 1] * v[1] + turn[k + 2] * v[2]);

// Semi-axes, longest first, and their directions (a right-handed triple) of the ellipsoid of a symmetric matrix with
// the entries xx, xy, xz, yy, yz, zz: Jacobi's rotations.
function principalAxes(six) {
  const a = [[six[0], six[1], six[2]], [six[1], six[3], six[4]], [six[2], six[4], six[5]]];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const turn = (m, p, q, c, s) => { const x = m[p], y = m[q]; m[p] = c * x - s * y; m[q] = s * x + c * y; };
  for (let sweep = 0; sweep < 10; sweep++)
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (a[p][q] === 0) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(1, theta));
      const c = 1 / Math.hypot(1, t), s = t * c;
      for (let k = 0; k < 3; k++) turn(a[k], p, q, c, s);
      for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; k++) turn(v[k], p, q, c, s);
    }
  const order = [0, 1, 2].sort((i, j) => a[j][j] - a[i][i]);
  const axes = order.map((i) => [v[0][i], v[1][i], v[2][i]]);
  if (dot(cross(axes[0], axes[1]), axes[2]) < 0) axes[2] = times(axes[2], -1);
  return { lengths: order.map((i) => Math.sqrt(Math.max(a[i][i], 0))), axes };
}
