// Numbers over time, as SVG that the style sheet colours; a press anywhere goes to that time, pointing reads.

const SVG = "http://www.w3.org/2000/svg";

function make(name, attributes = {}, children = []) {
  const node = ["svg", "path", "line", "rect", "g", "text"].includes(name) ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

// A number for reading: three digits that count.
function readable(x) {
  if (!Number.isFinite(x)) return "–";
  if (x !== 0 && (Math.abs(x) >= 1e5 || Math.abs(x) < 1e-3)) return x.toExponential(1).replace("e+", "e").replace("-", "−");
  return String(Number(x.toPrecision(3))).replace("-", "−");
}

function roundTicks(low, high, about) {
  const raw = (high - low) / about, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= raw * 0.999), ticks = [];
  for (let x = Math.ceil(low / step - 1e-6) * step; x <= high + 1e-6 * step; x += step) ticks.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  return ticks;
}

function logarithmicTicks(low, high) {
  const every = high - low > 4 ? [1] : high - low > 1.4 ? [1, 3] : [1, 2, 5], ticks = [];
  for (let decade = Math.floor(low); decade <= high; decade++)
    for (const k of every) ticks.push(decade + Math.log10(k));
  const shown = ticks.filter((x) => x >= low && x <= high);
  const stride = Math.ceil(shown.length / 5);
  return shown.filter((_, k) => k % stride === 0);
}

const STILL = { "vector-effect": "non-scaling-stroke" };

class Chart {
  constructor(panel, motion, seek) {
    Object.assign(this, { panel, motion, seek, index: 0, pointed: null, hidden: new Set() });
    this.lines = panel.lines.map((line) => ({ ...line, values: line.values.data }));
    this.scale = panel.logarithmic ? Math.log10 : (x) => x;
    [this.low, this.high] = this.range();
    this.cursor = make("line", { class: "cursor", y1: 0, y2: 100, ...STILL });
    this.finger = make("line", { class: "cursor finger", y1: 0, y2: 100, x1: -9, x2: -9, ...STILL });
    this.readouts = this.lines.map(() => make("output"));
    this.paths = this.lines.map((line) => make("path", { class: `curve ${line.role} style${line.style}${line.wide ? " wide" : ""}`, d: this.path(line.values), ...STILL }));
    this.node = this.build();
    this.listen(this.node.querySelector(".plot"));
  }

  listen(plot) {
    const share = (event) => {
      const box = plot.getBoundingClientRect();
      return Math.max(0, Math.min(1, (event.clientX - box.left) / box.width));
    };
    plot.addEventListener("pointerdown", (event) => { plot.setPointerCapture(event.pointerId); this.seek(share(event) * this.motion.duration); });
    plot.addEventListener("pointermove", (event) => {
      if (event.buttons) this.seek(share(event) * this.motion.duration);
      else this.point(share(event));
    });
    plot.addEventListener("pointerleave", () => this.point(null));
  }

  // Read at the stored time nearest to where the pointer is; null: at the moment that is shown.
  point(share) {
    const { time, duration, start } = this.motion;
    this.pointed = share === null ? null : nearestIndex(time, share * duration);
    const x = share === null ? -9 : (1000 * time[this.pointed]) / (duration || 1);
    this.finger.setAttribute("x1", x);
    this.finger.setAttribute("x2", x);
    this.when.textContent = share === null ? "" : `${(start + time[this.pointed]).toFixed(2)} s`;
    this.read(this.pointed ?? this.index);
  }

  range() {
    const { panel } = this;
    if (panel.span) return panel.span;
    let low = Infinity, high = -Infinity;
    for (const line of this.lines)
      for (const value of line.values) {
        const x = this.scale(value);
        if (Number.isFinite(x)) { low = Math.min(low, x); high = Math.max(high, x); }
      }
    if (panel.limits) { low = Math.min(low, panel.limits[0]); high = Math.max(high, panel.limits[1]); }
    if (low > high) return [0, 1];
    if (!panel.logarithmic && !panel.limits && low >= 0) low = 0;
    const margin = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
    return [low === 0 ? 0 : low - margin, high + margin];
  }

  y(value) { return 100 - (100 * (this.scale(value) - this.low)) / (this.high - this.low); }

  path(values) {
    const { time, gaps, duration } = this.motion, breaks = new Set(gaps);
    let text = "", pen = "M";
    for (let i = 0; i < values.length; i++) {
      const y = this.y(values[i]);
      if (!Number.isFinite(y)) { pen = "M"; continue; }
      text += `${pen}${((1000 * time[i]) / (duration || 1)).toFixed(1)} ${y.toFixed(2)}`;
      pen = breaks.has(i) ? "M" : "L";
    }
    return text;
  }

  // Where the axis has numbers: distance from the top [%] and label.
  ticks() {
    const ticks = this.panel.logarithmic ? logarithmicTicks(this.low, this.high) : roundTicks(this.low, this.high, 3.5);
    return ticks.map((tick) => [100 - (100 * (tick - this.low)) / (this.high - this.low), readable(this.panel.logarithmic ? 10 ** tick : tick)]);
  }

  times() {
    const { start, duration } = this.motion;
    return roundTicks(start, start + duration, 5).map((tick) => [(100 * (tick - start)) / (duration || 1), `${readable(tick)} s`]);
  }

  build() {
    const { panel } = this, svg = make("svg", { viewBox: "0 0 1000 100", preserveAspectRatio: "none", "aria-hidden": "true" });
    const labels = make("div", { class: "ticks y" }), times = make("div", { class: "ticks x" });
    for (const [y, text] of this.ticks()) {
      svg.append(make("line", { class: "rule", x1: 0, x2: 1000, y1: y, y2: y, ...STILL }));
      labels.append(at(make("span", {}, [text]), "top", y));
    }
    for (const [from, to] of this.beyond())
      svg.append(make("rect", { class: "beyond", x: 0, width: 1000, y: Math.min(from, to), height: Math.abs(to - from) }));
    svg.append(...this.paths.filter((_, k) => this.lines[k].wide), ...this.paths.filter((_, k) => !this.lines[k].wide), this.cursor, this.finger);
    for (const [x, text] of this.times()) times.append(at(make("span", {}, [text]), "left", x));
    const title = make("h4", {}, [panel.title]), alone = this.lines.length === 1;
    if (panel.unit) title.append(make("span", { class: "unit" }, [` [${panel.unit}]`]));
    if (panel.logarithmic) title.append(make("span", { class: "unit" }, [", logarithmic axis"]));
    this.when = make("output", { class: "when" });
    const head = make("div", { class: "head" }, [title, ...(alone ? [this.readouts[0]] : [])]);
    const plot = make("div", { class: "plot", tabindex: 0, role: "group", "aria-label": `${panel.title}: ${this.inWords()}. Arrow keys move the time.` }, [svg, this.when]);
    const note = panel.meaning ? [make("p", { class: "meaning" }, [panel.meaning])] : [];
    return make("figure", { class: "chart" }, [head, ...note, make("div", { class: "axes" }, [labels, plot, times]), ...(alone ? [] : [this.key()])]);
  }

  // What the lines are; a press hides or shows one.
  key() {
    return make("ul", { class: "key" }, this.lines.map((line, k) => {
      const sample = make("svg", { viewBox: "0 0 22 6", "aria-hidden": "true" });
      sample.append(make("path", { class: `curve ${line.role} style${line.style}${line.wide ? " wide" : ""}`, d: "M0 3H22" }));
      const button = make("button", { type: "button", "aria-pressed": "true" }, [sample, `${line.name} `, this.readouts[k]]);
      button.addEventListener("click", () => this.hide(k, !this.hidden.has(k)));
      this.buttons = [...(this.buttons || []), button];
      return make("li", { class: `of-${line.role}` }, [button]);
    }));
  }

  hide(k, hidden) {
    this.hidden[hidden ? "add" : "delete"](k);
    this.paths[k].classList.toggle("off", hidden);
    this.buttons[k].setAttribute("aria-pressed", String(!hidden));
  }

  beyond() {
    if (!this.panel.limits) return [];
    const [low, high] = this.panel.limits.map((x) => this.y(x));
    return [[100, Math.min(low, 100)], [Math.max(high, 0), 0]];
  }

  inWords() {
    return this.lines.map((line) => {
      const found = [...line.values].filter(Number.isFinite);
      const ends = found.length ? [found.reduce((a, b) => Math.min(a, b)), found.reduce((a, b) => Math.max(a, b))] : [NaN, NaN];
      return `${line.name} from ${readable(ends[0])} to ${readable(ends[1])}`;
    }).join("; ");
  }

  read(index) { this.lines.forEach((line, k) => { this.readouts[k].textContent = readable(line.values[index]); }); }

  show(index, share) {
    this.index = index;
    this.cursor.setAttribute("x1", 1000 * share);
    this.cursor.setAttribute("x2", 1000 * share);
    if (this.pointed === null) this.read(index);
  }
}

// A node placed by so many per cent; set as a property, which the page's policy allows.
function at(node, edge, share) {
  node.style[edge] = `${share}%`;
  return node;
}

function nearestIndex(time, t) {
  let low = 0, high = time.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (time[middle] <= t) low = middle; else high = middle; }
  return t - time[low] > time[high] - t ? high : low;
}
