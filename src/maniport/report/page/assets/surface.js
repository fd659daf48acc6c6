// Surfaces of links: normals that are smooth except over sharp edges, and where the links are at a time.

const SHARP = Math.cos((40 * Math.PI) / 180);

// Points with normals, six numbers each, and triangles of these. Triangles that share a point share its normal, unless
// they meet at a sharp edge; their order may differ from one to the next, so a normal counts with either sign.
function smoothed(points, triangles) {
  const count = triangles.length, place = (k) => points.subarray(3 * k, 3 * k + 3);
  const areas = [], flat = [], around = Array.from({ length: points.length / 3 }, () => []);
  for (let k = 0; k < count; k += 3) {
    const [a, b, c] = [place(triangles[k]), place(triangles[k + 1]), place(triangles[k + 2])];
    const area = cross(minus(b, a), minus(c, a));
    areas.push(area);
    flat.push(unit(area));
    for (let i = k; i < k + 3; i++) around[triangles[i]].push(k / 3);
  }
  const numbers = [], indices = new Uint32Array(count), made = around.map(() => []);
  triangles.forEach((point, corner) => {
    const own = flat[Math.floor(corner / 3)], sum = [0, 0, 0];
    for (const face of around[point]) {
      const turn = dot(own, flat[face]), area = areas[face];
      if (Math.abs(turn) >= SHARP) for (let k = 0; k < 3; k++) sum[k] += turn < 0 ? -area[k] : area[k];
    }
    const normal = dot(sum, sum) > 0 ? unit(sum) : own;
    let known = made[point].find((other) => dot(other.normal, normal) > 0.9999);
    if (!known) {
      known = { normal, index: numbers.length / 6 };
      made[point].push(known);
      numbers.push(...place(point), ...normal);
    }
    indices[corner] = known.index;
  });
  return { numbers: new Float32Array(numbers), indices };
}

// Where a frame is between two stored times: origin and axes, from three rows of four numbers.
function poseAt({ shape, data }, index, weight) {
  const still = shape[0] === 1, from = still ? 0 : 12 * index, to = still || !weight ? from : from + 12;
  const column = (k) => [0, 4, 8].map((row) => data[from + row + k] + weight * (data[to + row + k] - data[from + row + k]));
  return { place: column(3), columns: [0, 1, 2].map(column) };
}

// Call with every corner of a box around the points, at every stored time.
function sweep({ points, poses }, take) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  points.data.forEach((x, k) => { low[k % 3] = Math.min(low[k % 3], x); high[k % 3] = Math.max(high[k % 3], x); });
  const corners = Array.from({ length: 8 }, (_, k) => low.map((x, axis) => ((k >> axis) & 1 ? high[axis] : x)));
  for (let index = 0; index < poses.shape[0]; index++) {
    const { place, columns } = poseAt(poses, index, 0);
    for (const [x, y, z] of corners) {
      const at = [0, 1, 2].map((k) => place[k] + columns[0][k] * x + columns[1][k] * y + columns[2][k] * z);
      at.forEach(take);
    }
  }
}
