// Numbers over time, as SVG that the style sheet colours; a press anywhere goes to that time.

const SVG = "http://www.w3.org/2000/svg";

function make(name, attributes = {}, children = []) {
  const node = ["svg", "path", "line", "rect"].includes(name) ? document.createElementNS(SVG, name) : document.createElement(name);
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

class Chart {
  constructor(panel, motion, seek) {
    Object.assign(this, { panel, motion, lines: panel.lines.map((line) => ({ ...line, values: line.values.data })) });
    this.scale = panel.logarithmic ? Math.log10 : (x) => x;
    [this.low, this.high] = this.range();
    this.cursor = make("line", { class: "cursor", y1: 0, y2: 100, "vector-effect": "non-scaling-stroke" });
    this.readouts = this.lines.map(() => make("output"));
    this.node = this.build();
    const plot = this.node.querySelector(".plot");
    const go = (event) => {
      const box = plot.getBoundingClientRect();
      seek(((event.clientX - box.left) / box.width) * motion.duration);
    };
    plot.addEventListener("pointerdown", (event) => { plot.setPointerCapture(event.pointerId); go(event); });
    plot.addEventListener("pointermove", (event) => { if (event.buttons) go(event); });
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

  build() {
    const { panel, motion } = this;
    const svg = make("svg", { viewBox: "0 0 1000 100", preserveAspectRatio: "none", "aria-hidden": "true" });
    const still = { "vector-effect": "non-scaling-stroke" };
    const ticks = panel.logarithmic ? logarithmicTicks(this.low, this.high) : roundTicks(this.low, this.high, 3.5);
    const labels = make("div", { class: "ticks y" });
    for (const tick of ticks) {
      const y = 100 - (100 * (tick - this.low)) / (this.high - this.low);
      svg.append(make("line", { class: "rule", x1: 0, x2: 1000, y1: y, y2: y, ...still }));
      const label = make("span", {}, [readable(panel.logarithmic ? 10 ** tick : tick)]);
      label.style.top = `${y}%`;
      labels.append(label);
    }
    for (const [from, to] of this.beyond())
      svg.append(make("rect", { class: "beyond", x: 0, width: 1000, y: Math.min(from, to), height: Math.abs(to - from) }));
    for (const line of this.lines)
      svg.append(make("path", { class: `curve ${line.role} style${line.style}`, d: this.path(line.values), ...still }));
    svg.append(this.cursor);
    const times = make("div", { class: "ticks x" });
    for (const tick of roundTicks(motion.start, motion.start + motion.duration, 5)) {
      const label = make("span", {}, [`${readable(tick)} s`]);
      label.style.left = `${(100 * (tick - motion.start)) / (motion.duration || 1)}%`;
      times.append(label);
    }
    const key = make("ul", { class: this.lines.length > 5 ? "key rows" : "key" }, this.lines.map((line, k) => {
      const sample = make("svg", { viewBox: "0 0 22 6", "aria-hidden": "true" });
      sample.append(make("path", { class: `curve ${line.role} style${line.style}`, d: "M0 3H22" }));
      return make("li", { class: `of-${line.role}` }, [sample, `${line.name} `, this.readouts[k]]);
    }));
    const title = make("h4", {}, [panel.title]), alone = this.lines.length === 1;
    if (panel.unit) title.append(make("span", { class: "unit" }, [` [${panel.unit}]`]));
    if (alone) title.append(" ", this.readouts[0]);
    const body = make("div", { class: this.lines.length > 3 ? "axes tall" : "axes" }, [labels, make("div", { class: "plot" }, [svg]), times]);
    const note = panel.meaning ? [make("p", { class: "meaning" }, [panel.meaning])] : [];
    const label = `${panel.title}: ${this.inWords()}`;
    return make("figure", { class: "chart", role: "group", "aria-label": label }, [title, ...note, body, ...(alone ? [] : [key])]);
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

  show(index, share) {
    this.cursor.setAttribute("x1", 1000 * share);
    this.cursor.setAttribute("x2", 1000 * share);
    this.lines.forEach((line, k) => { this.readouts[k].textContent = readable(line.values[index]); });
  }
}
