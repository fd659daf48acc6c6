// Both domains as clouds and the profiles as lines in two diffusion coordinates; what is pointed at is shown beside.

const AROUND = 3; // so many seconds before and after now are drawn strongly

class DomainChart {
  constructor(map, motion, seek, colors) {
    Object.assign(this, { map, motion, colors, markers: [], last: null, index: 0, picked: false });
    this.hint = "Dots and crosses are sampled ellipsoids, lines the profiles. Point at a mark to see it, press a line to go there.";
    this.canvas = make("canvas", { role: "img", "aria-label": "Both domains and the profiles in two diffusion coordinates" });
    this.above = make("canvas", { class: "above", "aria-hidden": "true" });
    this.field = make("div", { class: "field", tabindex: 0, role: "group", "aria-label": "Map of domains and profiles: left and right move the time, up and down choose a profile" }, [this.canvas, this.above]);
    this.pointer = make("div", { class: "pointer" });
    this.field.append(this.pointer);
    for (const profile of map.profiles) {
      this.markers.push(make("div", { class: `marker ${profile.role}` }));
      this.field.append(this.markers.at(-1));
    }
    this.words = make("p", { class: "words", "aria-live": "polite" });
    this.glass = make("canvas", { "aria-hidden": "true" });
    this.node = make("div", { class: "map" }, [this.field, make("div", { class: "glass" }, [this.glass, this.words])]);
    this.sets = [...map.profiles.map((set) => ({ ...set, timed: true })), ...map.domains];
    const [x, y] = [0, 1].map((k) => this.range(k));
    this.place = (p, k) => [
      (0.03 + (0.94 * (p[2 * k] - x[0])) / (x[1] - x[0] || 1)) * this.canvas.clientWidth,
      (0.97 - (0.94 * (p[2 * k + 1] - y[0])) / (y[1] - y[0] || 1)) * this.canvas.clientHeight,
    ];
    const camera = new Camera(() => this.look());
    this.stage = new Stage(this.glass, camera, [0, 0, 0], 1, null);
    camera.follow(this.glass);
    this.field.addEventListener("pointermove", (event) => this.point(event));
    this.field.addEventListener("pointerdown", (event) => {
      const found = this.point(event);
      if (found?.set.timed) seek(motion.time[found.index]);
    });
    const leave = () => { [this.found, this.picked] = [null, false]; this.look(); };
    for (const end of ["pointerleave", "blur"]) this.field.addEventListener(end, leave);
    this.field.addEventListener("keydown", (event) => this.pick({ ArrowUp: -1, ArrowDown: 1 }[event.key], event));
    this.reach = this.largest();
  }

  // The next profile, at this time.
  pick(step, event) {
    if (!step || !this.map.profiles.length) return;
    event.preventDefault();
    const count = this.map.profiles.length, last = this.picked ? this.map.profiles.indexOf(this.map.profiles.find((set) => set.role === this.found?.set.role)) : -1;
    this.picked = true;
    this.found = { set: this.sets[(last + step + count + (last < 0 && step < 0 ? 1 : 0)) % count], index: this.index };
    this.look();
  }

  range(axis) {
    let low = Infinity, high = -Infinity;
    for (const set of this.sets)
      for (let k = axis; k < set.coordinates.data.length; k += 2) {
        low = Math.min(low, set.coordinates.data[k]);
        high = Math.max(high, set.coordinates.data[k]);
      }
    return [low, high];
  }

  // The longest semi-axis of all, which just fits the glass.
  largest() {
    let most = 0;
    for (const { ellipsoids } of this.sets)
      for (let k = 0; ellipsoids && k < ellipsoids.data.length; k += 6)
        most = Math.max(most, ellipsoids.data[k] + ellipsoids.data[k + 3] + ellipsoids.data[k + 5]);
    return Math.sqrt(most) || 1;
  }

  point(event) {
    const box = this.field.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let best = null, least = event.pointerType === "touch" ? 30 : 16;
    this.sets.forEach((set) => {
      for (let k = 0; k < set.coordinates.shape[0]; k++) {
        const [px, py] = this.place(set.coordinates.data, k);
        const away = Math.hypot(px - x, py - y) + (set.timed ? 0 : 3);
        if (away < least) [best, least] = [{ set, index: k }, away];
      }
    });
    [this.found, this.picked] = [best, false];
    this.look();
    return best;
  }

  key() {
    const entry = (set, mark, words) => make("li", {}, [make("i", { class: `swatch ${mark} ${set.role}` }), `${words}${set.name}`]);
    const entries = [...this.map.domains.map((set) => entry(set, set.role === "achieved" ? "crosses" : "dots", "domain of ")), ...this.map.profiles.map((set) => entry(set, "stroke", ""))];
    return make("ul", { class: "key" }, entries);
  }

  draw() {
    const { canvas } = this, scale = window.devicePixelRatio || 1, pen = canvas.getContext("2d");
    Object.assign(canvas, { width: Math.round(canvas.clientWidth * scale), height: Math.round(canvas.clientHeight * scale) });
    pen.scale(scale, scale);
    for (const set of this.map.domains) {
      pen.fillStyle = this.colors.css(set.role);
      pen.globalAlpha = 0.5;
      for (let k = 0; k < set.coordinates.shape[0]; k++) {
        const [x, y] = this.place(set.coordinates.data, k);
        if (set.role !== "achieved") { pen.fillRect(x - 1.1, y - 1.1, 2.2, 2.2); continue; }
        pen.fillRect(x - 2.5, y - 0.5, 5, 1); // a cross: some people cannot distinguish blue and green dots
        pen.fillRect(x - 0.5, y - 2.5, 1, 5);
      }
    }
    Object.assign(pen, { globalAlpha: 0.22, lineJoin: "round", lineWidth: 1 });
    const breaks = new Set(this.motion.gaps);
    for (const set of this.map.profiles) {
      pen.strokeStyle = this.colors.css(set.role);
      pen.beginPath();
      for (let k = 0; k < set.coordinates.shape[0]; k++)
        pen[k && !breaks.has(k - 1) ? "lineTo" : "moveTo"](...this.place(set.coordinates.data, k));
      pen.stroke();
    }
    this.show(this.index);
  }

  // What moves, above what does not.
  drawNow() {
    const { above, canvas, motion } = this, { time } = motion, pen = above.getContext("2d"), scale = window.devicePixelRatio || 1;
    if (above.width !== canvas.width || above.height !== canvas.height) Object.assign(above, { width: canvas.width, height: canvas.height });
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, above.width, above.height);
    Object.assign(pen, { lineWidth: 2.4, lineJoin: "round", lineCap: "round" });
    const from = nearestIndex(time, time[this.index] - AROUND), to = nearestIndex(time, time[this.index] + AROUND);
    const breaks = new Set(motion.gaps);
    for (const set of this.map.profiles)
      for (let k = from; k < to; k++) {
        if (breaks.has(k)) continue;
        pen.strokeStyle = this.colors.css(set.role);
        pen.beginPath();
        pen.moveTo(...this.place(set.coordinates.data, k));
        pen.lineTo(...this.place(set.coordinates.data, k + 1));
        pen.stroke();
      }
  }

  show(index) {
    this.index = index;
    if (this.picked) this.found = { ...this.found, index };
    this.map.profiles.forEach((set, k) => {
      const [x, y] = this.place(set.coordinates.data, index);
      this.markers[k].style.transform = `translate(${x}px, ${y}px)`;
    });
    if (this.canvas.width) this.drawNow();
    if (!this.found || this.picked) this.look();
  }

  // The ellipsoid that is pointed at; else the ones of this time.
  look() {
    const { found } = this;
    this.pointer.hidden = !found;
    if (found) {
      const [x, y] = this.place(found.set.coordinates.data, found.index);
      this.pointer.style.transform = `translate(${x}px, ${y}px)`;
    }
    const shown = found ? [found] : this.map.profiles.slice(0, 2).map((set) => ({ set, index: this.index }));
    this.words.replaceChildren(...shown.flatMap(({ set, index }) => [this.describe(set, index, found && set.timed), make("br")]));
    if (!this.stage.begin()) return;
    shown.forEach(({ set, index }, k) => {
      if (!set.ellipsoids) return;
      const six = set.ellipsoids.data.subarray(6 * index, 6 * index + 6);
      this.stage.ellipsoid([0, 0, 0], six, 1.25 / this.reach, this.colors.rgb(set.role), k > 0);
    });
  }

  describe(set, index, timed) {
    const name = make("b", { class: set.role }, [`${this.map.domains.includes(set) ? "Domain of " : ""}${set.name}`]);
    const when = timed ? ` at ${(this.motion.start + this.motion.time[index]).toFixed(2)} s` : "";
    if (!set.ellipsoids) return make("span", {}, [name, when]);
    const { lengths } = principalAxes(set.ellipsoids.data.subarray(6 * index, 6 * index + 6));
    const ratio = (lengths[0] / lengths[lengths[2] > 1e-6 * lengths[0] ? 2 : 1]) ** 2;
    const axes = lengths.map((l) => l.toFixed(2)).join(" · ");
    return make("span", {}, [name, `${when}: semi-axes ${axes}, condition ${readable(ratio)}`]);
  }
}
