// Force and speed along lines through the hand: arrows with two heads above a view, with their numbers.

const HEAD = 10, ASIDE = 7, LETTER = 8, LINE = 15; // pixels
const BARE = 0.2; // of a line without a value: its length to either side [m]

class Arrows {
  constructor(view, kinds) {
    this.kinds = kinds;
    this.node = make("svg", { class: "arrows", "aria-hidden": "true" });
    this.items = view.bodies.flatMap((body) => body.arrows.map((arrow) => this.item(body, arrow)));
    this.node.append(...this.items.map(({ group }) => group));
    for (const { arrow, number } of this.items) if (arrow.values) this.node.append(number); // on top of all arrows
  }

  item(body, arrow) {
    const halo = make("path", { class: "halo" }), shaft = make("path", { class: "shaft" });
    const look = `arrow arrow-${arrow.kind} ${arrow.role}${arrow.dashed ? " arrow-dashed" : ""}${arrow.values ? "" : " arrow-bare"}`;
    const heads = make("path", { class: "heads" }), number = make("text", { class: look });
    return { body, arrow, halo, shaft, heads, number, group: make("g", { class: look }, [halo, shaft, heads]) };
  }

  // How far the heads are from the hand [m]; not finite where there is no value.
  length({ kind, values }, index, weight) {
    if (!values) return BARE;
    return Math.min(between(values, index, weight)[0] * this.kinds[kind].size, this.kinds[kind].longest);
  }

  // Call with all points that arrows reach.
  sweep(body, take) {
    const { shape: [frames, corners], data } = body.skeleton;
    for (const arrow of body.arrows)
      for (let index = 0; index < frames; index++) {
        const length = this.length(arrow, index, 0), hand = 3 * (corners * (index + 1) - 1);
        if (!Number.isFinite(length)) continue;
        for (let k = 0; k < 3; k++) take(data[hand + k], k, Math.abs(length * arrow.lines.data[3 * index + k]));
      }
  }

  show(stage, index, weight, hidden) {
    const { clientWidth: width, clientHeight: height } = stage.canvas, taken = [];
    this.node.setAttribute("viewBox", `0 0 ${width} ${height}`);
    for (const item of this.items) {
      const length = this.length(item.arrow, index, weight);
      const visible = Number.isFinite(length) && !hidden.has(item.arrow.kind) && !(item.arrow.dashed && hidden.has("dashed"));
      for (const node of [item.group, item.number]) node.toggleAttribute("hidden", !visible);
      if (!visible) continue;
      const hand = [...between(item.body.skeleton, index, weight).slice(-3)], line = lineBetween(item.arrow.lines, index, weight);
      const ends = [1, -1].map((sense) => stage.onCanvas(add(hand, times(line, sense * length)))).sort((a, b) => a[1] - b[1]);
      this.draw(item, ends);
      if (item.arrow.values) this.write(item, ends, index, weight, { width, height, taken });
    }
  }

  // The upper end comes first. Dashed arrows are beside the others, whose lines they share.
  draw({ arrow, halo, shaft, heads }, ends) {
    const along = minusFlat(ends[0], ends[1]), size = Math.hypot(...along) || 1, [x, y] = along.map((k) => k / size);
    if (arrow.dashed) for (const end of ends) { end[0] -= ASIDE * y; end[1] += ASIDE * x; }
    const line = `M${flat(ends[0])}L${flat(ends[1])}`, head = arrow.values ? Math.min(HEAD, 0.4 * size) : 0;
    const tips = ends.map((end, k) => {
      const back = (k ? 1 : -1) * head, wing = 0.45 * head, foot = [end[0] + back * x, end[1] + back * y];
      return `M${flat([foot[0] - wing * y, foot[1] + wing * x])}L${flat(end)}L${flat([foot[0] + wing * y, foot[1] - wing * x])}`;
    });
    halo.setAttribute("d", line + (head ? tips.join("") : ""));
    shaft.setAttribute("d", line);
    heads.setAttribute("d", head ? tips.map((tip) => (arrow.kind === "force" ? `${tip}Z` : tip)).join("") : "");
  }

  // A number beyond the upper end, or the lower one of a dashed arrow, within the view and clear of the others.
  write({ arrow, number }, [upper, lower], index, weight, { width, height, taken }) {
    const text = `${readable(between(arrow.values, index, weight)[0])} ${this.kinds[arrow.kind].unit}`;
    const [end, other] = arrow.dashed ? [lower, upper] : [upper, lower], half = (LETTER * text.length) / 2;
    const [x, y] = unit([...minusFlat(end, other), 0]);
    const at = [end[0] + x * (half + 5), end[1] + y * LINE];
    at[0] = Math.max(half, Math.min(width - half, at[0]));
    at[1] = Math.max(LINE, Math.min(height - LINE / 2, at[1]));
    const close = () => taken.some((one) => Math.abs(one.at[0] - at[0]) < one.half + half && Math.abs(one.at[1] - at[1]) < LINE);
    for (let tries = 0; tries < 8 && close(); tries++) at[1] += arrow.dashed ? LINE / 2 : -LINE / 2;
    taken.push({ at, half });
    number.textContent = text;
    number.setAttribute("x", at[0].toFixed(1));
    number.setAttribute("y", at[1].toFixed(1));
  }
}

const minusFlat = (a, b) => [a[0] - b[0], a[1] - b[1]];
const flat = (point) => point.map((x) => x.toFixed(1)).join(" ");

// A line has no sense, so the next one counts with the sign that is nearer.
function lineBetween(lines, index, weight) {
  const now = [...between(lines, index, 0)];
  if (!weight) return now;
  const next = [...between(lines, index + 1, 0)], sign = dot(now, next) < 0 ? -1 : 1;
  return unit(add(times(now, 1 - weight), times(next, sign * weight)));
}
